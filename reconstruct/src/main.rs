//! Command line of the reconstructor.
fn main() {}
