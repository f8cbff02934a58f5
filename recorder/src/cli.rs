//! The command line: what is asked for, and what is printed. Results to `out`, all else to `err`.

mod daemon;
mod key;
mod replay;
mod serve;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::check::{CheckReport, check_live, check_with};
use crate::config::Settings;
use crate::error::RecorderError;
use crate::replay::{LogInput, ReplayOptions};
use crate::socket::Sockets;

/// Everything went well.
const SOUND: u8 = 0;
/// It failed.
const FAILED: u8 = 1;
/// Finished, with gaps or an incomplete record.
const GAPS: u8 = 3;

/// Keeps the last seconds of a car's motion from its CAN bus and seals them at a crash.
#[derive(Debug, Parser)]
#[command(name = "recorder", version, about)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Replay candump logs through the recorder and seal what triggers.
    Replay(replay::Args),
    /// Record from the CAN interfaces until told to stop: the daemon.
    Run {
        /// Configuration (TOML).
        #[arg(long)]
        config: PathBuf,
        /// In place of the interfaces, a log at the pace of its own stamps, for the bench; repeatable.
        #[arg(long, value_name = "LOG")]
        paced: Vec<PathBuf>,
        /// Take the paced log's interface NAME for the configured one; repeatable.
        #[arg(long, value_name = "NAME=CONFIGURED", value_parser = pair, requires = "paced")]
        map: Vec<(String, String)>,
    },
    /// Ask the running daemon how it is. Exit code 3 where it has alarms.
    Status {
        /// Configuration that names its socket.
        #[arg(long)]
        config: Option<PathBuf>,
        /// Its socket.
        #[arg(long)]
        socket: Option<PathBuf>,
        /// The answer as JSON.
        #[arg(long)]
        json: bool,
        /// Again each second.
        #[arg(long)]
        watch: bool,
    },
    /// Ask the running daemon for a manual trigger.
    Trigger {
        /// Configuration that names its socket.
        #[arg(long)]
        config: Option<PathBuf>,
        /// Its socket.
        #[arg(long)]
        socket: Option<PathBuf>,
        /// The answer as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Make, show and change the device's key.
    #[command(subcommand)]
    Key(key::KeyCommand),
    /// Say whether a configuration is valid and whether each mapped signal arrives: in logs, or with --for on the live
    /// bus.
    Check {
        /// Configuration (TOML).
        #[arg(long)]
        config: PathBuf,
        /// Logs to look at.
        logs: Vec<PathBuf>,
        /// Sentences of the satellite receiver, `(seconds.fraction) $...` a line, on the clock of the logs.
        #[arg(long, value_name = "FILE", requires = "logs")]
        nmea: Option<PathBuf>,
        /// Look at so many seconds of the logs; without a log, listen to the interfaces for so long.
        #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
        seconds: Option<f64>,
        /// Take the log's interface NAME for the configured one; repeatable.
        #[arg(long, value_name = "NAME=CONFIGURED", value_parser = pair)]
        map: Vec<(String, String)>,
        /// The result as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Read the records out over a serial line, to who knows the token.
    Serve(serve::Args),
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1e9).contains(&value) => Ok(value),
        _ => Err("expected seconds from the first frame, 0 or more".to_owned()),
    }
}

fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((from, to)) if !from.is_empty() && !to.is_empty() => {
            Ok((from.to_owned(), to.to_owned()))
        }
        _ => Err("expected NAME=CONFIGURED".to_owned()),
    }
}

/// Runs the command line and gives the exit code.
#[must_use]
pub fn run(args: Args) -> ExitCode {
    let mut err = io::stderr();
    let done = match args.command {
        Command::Replay(args) => replay::run(args, &mut err),
        Command::Key(command) => key::run(command),
        Command::Check {
            config,
            logs,
            nmea,
            seconds,
            map,
            json,
        } => {
            let options = ReplayOptions {
                map,
                stop_after: seconds,
                nmea: nmea.map(LogInput::File),
                ..ReplayOptions::default()
            };
            run_check(&config, &logs, options, json)
        }
        Command::Run { config, paced, map } => daemon::run(config, paced, map),
        Command::Status {
            config,
            socket,
            json,
            watch,
        } => daemon::status(config.as_deref(), socket, json, watch),
        Command::Trigger {
            config,
            socket,
            json,
        } => daemon::trigger(config.as_deref(), socket, json),
        Command::Serve(args) => serve::run(args, &mut err),
    };
    match done {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            // A reader that went away needs no message.
            if !matches!(&error, RecorderError::Io { source, .. } if source.kind() == io::ErrorKind::BrokenPipe)
            {
                let _ = writeln!(err, "recorder: {error}");
            }
            ExitCode::from(FAILED)
        }
    }
}

fn inputs(logs: &[PathBuf]) -> Vec<LogInput> {
    logs.iter()
        .map(|path| {
            if path.as_os_str() == "-" {
                LogInput::Reader("-".to_owned(), Box::new(io::stdin()))
            } else {
                LogInput::File(path.clone())
            }
        })
        .collect()
}

fn print(line: &str) -> Result<(), RecorderError> {
    let mut out = io::stdout().lock();
    writeln!(out, "{line}")
        .and_then(|()| out.flush())
        .map_err(RecorderError::io("standard output", "write"))
}

fn say(err: &mut impl Write, line: &str) {
    // Progress and warnings: that standard error is closed is no reason to lose a record.
    let _ = writeln!(err, "recorder: {line}");
}

fn run_check(
    config: &Path,
    logs: &[PathBuf],
    options: ReplayOptions<'_>,
    json: bool,
) -> Result<u8, RecorderError> {
    let settings = Settings::load(config)?;
    if let (true, Some(seconds)) = (logs.is_empty(), options.stop_after) {
        let mut sockets = Sockets::open(&settings)?;
        let report = check_live(&settings, &mut sockets, seconds)?;
        return tell_check(&report, json);
    }
    if logs.is_empty() {
        print(if json {
            "{\"valid\":true}"
        } else {
            "configuration valid"
        })?;
        return Ok(SOUND);
    }
    let report = check_with(&settings, inputs(logs), options)?;
    tell_check(&report, json)
}

fn tell_check(report: &CheckReport, json: bool) -> Result<u8, RecorderError> {
    if json {
        print(&serde_json::to_string(report).unwrap_or_default())?;
    } else {
        print_check(report)?;
    }
    Ok(if report.warnings.is_empty() {
        SOUND
    } else {
        GAPS
    })
}

fn print_check(report: &CheckReport) -> Result<(), RecorderError> {
    print("configuration valid")?;
    print(&format!(
        "{:.1} s looked at, {:.1} s of them at rest",
        report.seconds, report.rest_seconds
    ))?;
    for signal in &report.signals {
        let noise = match (signal.noise_at_rest, signal.signal.as_str()) {
            (Some(noise), "accel") => format!(", noise at rest {noise:.4} m/s^2"),
            (Some(noise), _) => format!(", noise at rest {noise:.4} deg/s"),
            (None, _) => String::new(),
        };
        let text = if signal.arrives {
            format!(
                "{}: {:.2} Hz, jitter {:.3} ms{noise}",
                signal.signal, signal.rate_hz, signal.jitter_ms
            )
        } else {
            format!("{}: never arrived", signal.signal)
        };
        print(&text)?;
    }
    if let Some(gnss) = &report.gnss {
        print(&format!(
            "gnss: {} fixes, {} epochs without a fix",
            gnss.fixes, gnss.no_fix
        ))?;
        for arrival in &gnss.arrivals {
            print(&format!("gnss {}: {:.2} Hz", arrival.name, arrival.rate_hz))?;
        }
    }
    for warning in &report.warnings {
        print(&format!("warning: {warning}"))?;
    }
    Ok(())
}
