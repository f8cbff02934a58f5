//! `recorder run`, `status` and `trigger`.

use std::path::{Path, PathBuf};

use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use super::{FAILED, GAPS, SOUND, print};
use crate::config::{Settings, default_socket};
use crate::daemon::control::{Answer, ask};
use crate::daemon::status::Status;
use crate::daemon::{self, Options};
use crate::error::RecorderError;

/// `recorder run`.
pub(super) fn run(
    config: PathBuf,
    paced: Vec<PathBuf>,
    map: Vec<(String, String)>,
) -> Result<u8, RecorderError> {
    log();
    daemon::run(&Options { config, paced, map })?;
    Ok(SOUND)
}

/// Log lines go to the journal where the service manager listens there, else to standard error.
fn log() {
    let journal = std::env::var_os("JOURNAL_STREAM").and_then(|_| tracing_journald::layer().ok());
    let plain = journal.is_none().then(|| {
        tracing_subscriber::fmt::layer()
            .with_writer(std::io::stderr)
            .with_ansi(false)
            .with_target(false)
    });
    // Fails only where another subscriber was set before, as in a test.
    let _ = tracing_subscriber::registry()
        .with(tracing_subscriber::filter::LevelFilter::INFO)
        .with(journal)
        .with(plain)
        .try_init();
}

/// The socket: named, or that of a configuration, or where it is by default.
fn socket(config: Option<&Path>, socket: Option<PathBuf>) -> Result<PathBuf, RecorderError> {
    match (socket, config) {
        (Some(socket), _) => Ok(socket),
        (None, Some(config)) => Ok(Settings::load(config)?.run.socket),
        (None, None) => Ok(default_socket()),
    }
}

fn unexpected(line: &str, error: &serde_json::Error) -> RecorderError {
    let shown: String = line.chars().take(80).collect();
    RecorderError::io("the recorder's answer", "read")(std::io::Error::new(
        std::io::ErrorKind::InvalidData,
        format!("expected JSON, found `{shown}` ({error})"),
    ))
}

/// `recorder status`.
pub(super) fn status(
    config: Option<&Path>,
    at: Option<PathBuf>,
    json: bool,
    watch: bool,
) -> Result<u8, RecorderError> {
    let at = socket(config, at)?;
    let mut code = FAILED;
    ask(&at, if watch { "watch" } else { "status" }, |line| {
        let status: Status =
            serde_json::from_str(line).map_err(|error| unexpected(line, &error))?;
        code = if status.alarms.is_empty() {
            SOUND
        } else {
            GAPS
        };
        match (json, watch) {
            (true, _) => print(line)?,
            // Home and clear, so that the screen stands still.
            (false, true) => print(&format!("\x1b[H\x1b[2J{}", status.screen().trim_end()))?,
            (false, false) => print(status.screen().trim_end())?,
        }
        Ok(!watch)
    })?;
    Ok(code)
}

/// `recorder trigger`.
pub(super) fn trigger(
    config: Option<&Path>,
    at: Option<PathBuf>,
    json: bool,
) -> Result<u8, RecorderError> {
    let at = socket(config, at)?;
    let mut code = FAILED;
    ask(&at, "trigger", |line| {
        let answer: Answer =
            serde_json::from_str(line).map_err(|error| unexpected(line, &error))?;
        code = if answer.ok { SOUND } else { FAILED };
        print(if json { line } else { &answer.message })?;
        Ok(true)
    })?;
    Ok(code)
}
