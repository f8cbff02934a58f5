//! The command line: what is asked for, and what is printed. Results to `out`, all else to `err`.

mod daemon;
mod key;
mod serve;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use schema::Record;
use schema::parts::TriggerKind;
use schema::seal::Hex;
use schema::units::{MetersPerSecond, MetersPerSecondSquared};
use serde::Serialize;

use crate::check::{CheckReport, check, check_live};
use crate::config::Settings;
use crate::daemon::status::kind_word;
use crate::error::RecorderError;
use crate::replay::{LogInput, ReplayOptions, ReplayOutcome, replay};
use crate::socket::Sockets;
use crate::store;

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
    Replay {
        /// Configuration (TOML).
        #[arg(long)]
        config: PathBuf,
        /// Logs in the form of `candump -L`; `-` is standard input. Several are merged by time.
        #[arg(required = true)]
        logs: Vec<PathBuf>,
        /// Folder of the sealed records (default: `[store] dir` of the configuration).
        #[arg(long)]
        out: Option<PathBuf>,
        /// Manual trigger, seconds from the first frame of the log; repeatable.
        #[arg(long, value_name = "SECONDS", value_parser = seconds)]
        trigger_at: Vec<f64>,
        /// Take the log's interface NAME for the configured one; repeatable.
        #[arg(long, value_name = "NAME=CONFIGURED", value_parser = pair)]
        map: Vec<(String, String)>,
        /// One JSON object a sealed record.
        #[arg(long)]
        json: bool,
    },
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

/// A sealed record as `--json` prints it.
#[derive(Serialize)]
struct SealedLine<'a> {
    path: String,
    triggers: Vec<TriggerLine>,
    complete: bool,
    ends_at_rest: bool,
    reasons: &'a [String],
    gaps: usize,
    sha256: String,
}

#[derive(Serialize)]
struct TriggerLine {
    kind: TriggerKind,
    t_s: f64,
    value: f64,
    threshold: f64,
    source: String,
}

/// Runs the command line and gives the exit code.
#[must_use]
pub fn run(args: Args) -> ExitCode {
    let mut err = io::stderr();
    let done = match args.command {
        Command::Replay {
            config,
            logs,
            out,
            trigger_at,
            map,
            json,
        } => run_replay(&config, &logs, out, trigger_at, map, json, &mut err),
        Command::Key(command) => key::run(command),
        Command::Check {
            config,
            logs,
            seconds,
            map,
            json,
        } => run_check(&config, &logs, seconds, map, json),
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

fn run_replay(
    config: &Path,
    logs: &[PathBuf],
    out: Option<PathBuf>,
    trigger_at: Vec<f64>,
    map: Vec<(String, String)>,
    json: bool,
    err: &mut impl Write,
) -> Result<u8, RecorderError> {
    let settings = Settings::load(config)?;
    let dir = out.unwrap_or_else(|| settings.store.dir.clone());
    let mut lines = Vec::new();
    let sink = Box::new(|record: Record| {
        let (path, seal) = store::save(&record, &dir)?;
        print(&sealed_line(&record, &path, &seal, json))?;
        lines.extend(warnings(&record, &path));
        Ok(())
    });
    let outcome = replay(
        &settings,
        inputs(logs),
        ReplayOptions {
            trigger_at,
            map,
            sink: Some(sink),
            ..ReplayOptions::default()
        },
    )?;
    for line in lines {
        say(err, &line);
    }
    tell(&outcome, err);
    Ok(if outcome.sound() { SOUND } else { GAPS })
}

fn sealed_line(record: &Record, path: &Path, seal: &schema::Seal, json: bool) -> String {
    if !json {
        return path.display().to_string();
    }
    let first_ns = record
        .triggers
        .first()
        .map_or(0, |trigger| trigger.monotonic_ns);
    let line = SealedLine {
        path: path.display().to_string(),
        triggers: record
            .triggers
            .iter()
            .map(|trigger| TriggerLine {
                kind: trigger.kind,
                t_s: schema::num::real_i64(trigger.monotonic_ns - first_ns) / 1e9,
                value: trigger.value,
                threshold: trigger.threshold,
                source: trigger.source.clone(),
            })
            .collect(),
        complete: record.completion.complete,
        ends_at_rest: record.completion.ends_at_rest,
        reasons: &record.completion.reasons,
        gaps: record.health.gaps.len(),
        sha256: Hex(&seal.sha256).to_string(),
    };
    serde_json::to_string(&line).unwrap_or_default()
}

fn warnings(record: &Record, path: &Path) -> Vec<String> {
    let name = path
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let kinds: Vec<&str> = record
        .triggers
        .iter()
        .map(|trigger| kind_word(trigger.kind))
        .collect();
    let mut lines = vec![format!("{name}: triggers: {}", kinds.join(", "))];
    for reason in &record.completion.reasons {
        lines.push(format!("{name}: incomplete: {reason}"));
    }
    for gap in record.health.gaps.iter().take(5) {
        let seconds = schema::num::real_i64(gap.to_ns - gap.from_ns) / 1e9;
        lines.push(format!("{name}: gap of {seconds:.3} s in {}", gap.signal));
    }
    if record.health.gaps.len() > 5 {
        lines.push(format!("{name}: {} gaps in all", record.health.gaps.len()));
    }
    lines
}

fn tell(outcome: &ReplayOutcome, err: &mut impl Write) {
    let totals = &outcome.totals;
    for example in &outcome.source.examples {
        say(err, example);
    }
    for name in &outcome.source.foreign {
        say(
            err,
            &format!(
                "interface {name} is in the log and no bus names it (--map {name}=CONFIGURED)"
            ),
        );
    }
    for at in &outcome.triggers_left {
        say(
            err,
            &format!("--trigger-at {at}: expected a time within the log, found its end before"),
        );
    }
    let seconds = schema::num::real_i64(totals.span_ns) / 1e9;
    say(
        err,
        &format!(
            "{} frames in {seconds:.1} s of log, {} malformed, {} late, {} gaps, {} records",
            totals.frames,
            outcome.source.malformed + totals.decode.too_short,
            totals.late,
            totals.gaps,
            outcome.records
        ),
    );
    if outcome.records == 0 {
        say(
            err,
            &format!(
                "no trigger fired: the largest delta-V within 150 ms was {:.1} km/h, the largest acceleration of a frame {:.1} g",
                MetersPerSecond(totals.largest_delta_v).kmh(),
                MetersPerSecondSquared(totals.largest_peak).g()
            ),
        );
    }
}

fn run_check(
    config: &Path,
    logs: &[PathBuf],
    seconds: Option<f64>,
    map: Vec<(String, String)>,
    json: bool,
) -> Result<u8, RecorderError> {
    let settings = Settings::load(config)?;
    if let (true, Some(seconds)) = (logs.is_empty(), seconds) {
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
    let report = check(&settings, inputs(logs), map, seconds)?;
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
    for warning in &report.warnings {
        print(&format!("warning: {warning}"))?;
    }
    Ok(())
}
