//! Command line of the reconstructor: translates arguments, results and errors; everything else is the library.

use std::process::ExitCode;

mod cli;

fn main() -> ExitCode {
    ExitCode::from(cli::main())
}
