//! `reconstruct export`: the record's data in another format.

use std::path::PathBuf;

use reconstruct::export::{candump, samples};

use crate::cli::decrypt::Identity;
use crate::cli::load::Loaded;
use crate::cli::{CliError, complain, print, write_file};

/// Arguments of `export`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Record to export (.svb)
    record: PathBuf,
    #[command(flatten)]
    identity: Identity,
    /// Format: csv (samples in SI), candump (raw frames about the trigger, original times), json (everything)
    #[arg(long, value_name = "FORMAT")]
    to: Format,
    /// File to write; standard output if not given
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    Csv,
    Candump,
    Json,
}

/// Runs the command; gives the exit code.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    let loaded = Loaded::open(&args.record, &args.identity)?;
    let case = loaded.case();
    let text = match args.to {
        Format::Csv => samples::csv(&case),
        Format::Candump => candump::text(&case),
        Format::Json => format!("{:#}\n", samples::json(&case)),
    };
    if matches!(args.to, Format::Candump) && text.is_empty() {
        complain("warning", "the record holds no raw frames");
    }
    match &args.out {
        Some(path) => write_file(path, text.as_bytes())?,
        None => print(&text)?,
    }
    Ok(loaded.exit_code())
}
