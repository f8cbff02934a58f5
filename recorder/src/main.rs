//! Command line of the recorder.
fn main() {}
