//! `recorder replay`: logs through the recorder, records sealed.

use std::io::Write;
use std::path::{Path, PathBuf};

use schema::Record;
use schema::parts::TriggerKind;
use schema::seal::Hex;
use schema::units::{MetersPerSecond, MetersPerSecondSquared};
use serde::Serialize;

use super::{GAPS, SOUND, inputs, pair, print, say, seconds};
use crate::config::Settings;
use crate::daemon::status::kind_word;
use crate::error::RecorderError;
use crate::replay::{LogInput, ReplayOptions, ReplayOutcome, replay};
use crate::store;

/// Arguments of `replay`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Configuration (TOML).
    #[arg(long)]
    config: PathBuf,
    /// Logs in the form of `candump -L`; `-` is standard input. Several are merged by time.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Folder of the sealed records (default: `[store] dir` of the configuration).
    #[arg(long)]
    out: Option<PathBuf>,
    /// Sentences of the satellite receiver whose device `[gnss]` names: one a line, `(seconds.fraction) $...`, on the clock of
    /// the logs.
    #[arg(long, value_name = "FILE")]
    nmea: Option<PathBuf>,
    /// Manual trigger, seconds from the first frame of the log; repeatable.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    trigger_at: Vec<f64>,
    /// Take the log's interface NAME for the configured one; repeatable.
    #[arg(long, value_name = "NAME=CONFIGURED", value_parser = pair)]
    map: Vec<(String, String)>,
    /// One JSON object a sealed record.
    #[arg(long)]
    json: bool,
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

/// Runs the command.
pub(super) fn run(args: Args, err: &mut impl Write) -> Result<u8, RecorderError> {
    let settings = Settings::load(&args.config)?;
    let dir = args.out.unwrap_or_else(|| settings.store.dir.clone());
    let mut lines = Vec::new();
    let sink = Box::new(|record: Record| {
        let (path, seal) = store::save(&record, &dir)?;
        print(&sealed_line(&record, &path, &seal, args.json))?;
        lines.extend(warnings(&record, &path));
        Ok(())
    });
    let outcome = replay(
        &settings,
        inputs(&args.logs),
        ReplayOptions {
            trigger_at: args.trigger_at,
            map: args.map,
            nmea: args.nmea.map(LogInput::File),
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
