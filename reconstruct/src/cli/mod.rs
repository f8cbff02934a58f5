//! One file a subcommand. Results go to standard output, progress and complaints to standard error.

use std::io::{self, Write};
use std::path::Path;

use clap::{Parser, Subcommand};
use reconstruct::ReconstructError;
use reconstruct::compare::CompareError;

mod compare;
mod decrypt;
mod design;
mod export;
mod fetch;
mod gnss;
mod gnss_analyse;
mod gnss_logs;
mod gnss_outages;
mod gnss_receiver;
mod gnss_reckon;
mod gnss_run;
mod gnss_told;
mod gnss_track;
mod inspect;
mod load;
mod run;

mod simulate;
mod validate;
mod verify;

/// Sound.
pub(crate) const SOUND: u8 = 0;
/// Finished with gaps, an incomplete record or a broken seal.
pub(crate) const GAPS: u8 = 3;

/// What happened in a crash, from the record that svartboks keeps.
#[derive(Debug, Parser)]
#[command(name = "reconstruct", version, arg_required_else_help = true)]
#[command(
    after_help = "Exit codes: 0 sound, 1 failed, 2 usage, 3 finished with gaps, an incomplete record or a broken seal."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Reconstruct the motion from a record: trajectory, summary, funnel, pictures and report
    Run(Box<run::Args>),
    /// Show what a record holds: header, health, triggers, samples
    Inspect(inspect::Args),
    /// Check records: digests, signatures, chain and ledger; who made them, when, with which software
    Verify(verify::Args),
    /// Write a record's data in another format
    Export(export::Args),
    /// Compare a trajectory with the truth
    Compare(compare::Args),
    /// Make a crash with known truth, as a CAN log
    Simulate(simulate::Args),
    /// Validate the models on simulated crashes and on recordings with truth
    Validate(validate::Args),
    /// Expected bounds of a sensor on a manoeuvre, before anything is recorded
    Design(Box<design::Args>),
    /// Satellite fixes and inertial samples of a box in the car: reckon, simulate, compare with S00
    Gnss(gnss::Args),
    /// Fetch records from a recorder over a serial line
    Fetch(fetch::Args),
    /// Print the JSON Schema of summary.json
    Schema,
}

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    /// A file could not be read or written.
    #[error("{path}: {error}")]
    File {
        /// The file.
        path: String,
        /// What the system said.
        error: io::Error,
    },
    /// The record cannot be read at all.
    #[error("{path}: {error}")]
    Record {
        /// The file.
        path: String,
        /// What is wrong.
        error: Box<::schema::SchemaError>,
    },
    /// An encrypted record that cannot be opened.
    #[error("{path}: expected a record, found {found}")]
    Sealed {
        /// The file.
        path: String,
        /// What is there.
        found: String,
    },
    /// A public key's file.
    #[error("{path}: {error}")]
    Key {
        /// The file.
        path: String,
        /// What is wrong.
        error: ::schema::key::KeyError,
    },
    /// The reconstruction.
    #[error(transparent)]
    Reconstruct(Box<ReconstructError>),
    /// The comparison.
    #[error(transparent)]
    Compare(Box<CompareError>),
    /// The simulation.
    #[error(transparent)]
    Simulate(Box<simulate::Error>),
    /// The design study.
    #[error(transparent)]
    Design(Box<reconstruct::design::DesignError>),
    /// The read-out over a serial line.
    #[error(transparent)]
    Fetch(Box<reconstruct::fetch::FetchError>),
    /// Satellite fixes and inertial samples.
    #[error("{0}")]
    Gnss(String),
    /// The token of the read-out.
    #[error("{place}: expected a token of 1 to 128 bytes, found {found} bytes")]
    Token {
        /// Where it was looked for.
        place: String,
        /// Its bytes.
        found: usize,
    },
    /// Standard output.
    #[error("standard output: {0}")]
    Print(io::Error),
}

impl From<ReconstructError> for CliError {
    fn from(error: ReconstructError) -> Self {
        Self::Reconstruct(Box::new(error))
    }
}

impl From<CompareError> for CliError {
    fn from(error: CompareError) -> Self {
        Self::Compare(Box::new(error))
    }
}

impl From<simulate::Error> for CliError {
    fn from(error: simulate::Error) -> Self {
        Self::Simulate(Box::new(error))
    }
}

impl From<reconstruct::design::DesignError> for CliError {
    fn from(error: reconstruct::design::DesignError) -> Self {
        Self::Design(Box::new(error))
    }
}

impl CliError {
    pub(crate) fn file(path: &Path, error: io::Error) -> Self {
        Self::File {
            path: path.display().to_string(),
            error,
        }
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Simulate(error) => error.exit_code(),
            Self::Token { .. } => 2,
            Self::Design(error) => error.exit_code(),
            Self::Reconstruct(error) => match **error {
                ReconstructError::Option { .. } | ReconstructError::Window { .. } => 2,
                _ => 1,
            },
            _ => 1,
        }
    }
}

/// Runs the program; gives the exit code.
pub(crate) fn main() -> u8 {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version come this way too; a closed pipe is no fault of ours.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    let result = match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Simulate(args) => match simulate::run(&args) {
            Err(simulate::Error::Print(error)) if error.kind() == io::ErrorKind::BrokenPipe => {
                Ok(SOUND)
            }
            other => other.map_err(CliError::from),
        },
        Command::Validate(args) => validate::run(&args),
        Command::Design(args) => design::run(&args),
        Command::Gnss(args) => gnss::run(&args),
        Command::Fetch(args) => fetch::run(&args),
        Command::Schema => print(reconstruct::report::SUMMARY_SCHEMA).map(|()| SOUND),
    };
    result.unwrap_or_else(|error| {
        complain("error", &error.to_string());
        error.exit_code()
    })
}

/// Writes to standard output; a reader that went away is not an error.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CliError::Print(error)),
        _ => Ok(()),
    }
}

/// Prints a value as JSON, with a line end.
pub(crate) fn print_json(value: &serde_json::Value) -> Result<(), CliError> {
    print(&format!("{value:#}\n"))
}

/// One line on standard error; control characters in it are disarmed.
pub(crate) fn complain(kind: &str, text: &str) {
    let safe: String = text
        .chars()
        .map(|c| if c.is_control() && c != '\n' { '?' } else { c })
        .collect();
    let _ = writeln!(io::stderr(), "{kind}: {safe}");
}

/// Writes a file whole or not at all: into a temporary name beside it, then renamed.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let name = path
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    let partial = path.with_file_name(format!(".{name}.{}.partial", std::process::id()));
    let written = std::fs::write(&partial, bytes).and_then(|()| std::fs::rename(&partial, path));
    written.map_err(|error| {
        let _ = std::fs::remove_file(&partial);
        CliError::file(path, error)
    })
}
