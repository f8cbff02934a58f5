//! Command line of the recorder: 0 sound, 1 failed, 2 usage, 3 finished with gaps or an incomplete record.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    recorder::cli::run(recorder::cli::Args::parse())
}
