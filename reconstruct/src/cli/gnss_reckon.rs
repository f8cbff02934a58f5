//! The reckoning of `reconstruct gnss run`: our filter over each drive between the holes of a log, or that of S00.

use reconstruct::gnss::drive::{Drive, Fixed, Speed, thinned};
use reconstruct::gnss::forward::{Estimate, Fate, FixUse, Start};
use reconstruct::gnss::logs;
use reconstruct::gnss::pictures::Shot;
use reconstruct::gnss::plausible;
use reconstruct::gnss::published::constants::{DT, GATE};
use reconstruct::gnss::published::{self as theirs, Initial, Options, SpeedAid, SpeedUse};
use reconstruct::gnss::sheet::Sheet;
use reconstruct::gnss::smooth;
use reconstruct::gnss::stands::{self, Found};
use reconstruct::gnss::stop::{Detector, ENTRY_S, EXIT_S};
use reconstruct::gnss::trial::ours_smoothed;
use reconstruct::gnss::unproven;
use schema::num::real;
use serde_json::json;

use crate::cli::CliError;
use crate::cli::gnss::failed;
use crate::cli::gnss_logs::Logs;
use crate::cli::gnss_run::Args;
use crate::cli::gnss_track;

/// A reckoned log, what it says of its fixes for the summary, and each of them.
pub(crate) struct Reckoned {
    pub(crate) track: Vec<Estimate>,
    pub(crate) fixes: serde_json::Value,
    pub(crate) shots: Vec<Shot>,
    pub(crate) notes: Vec<String>,
    /// Our smoothed track of the same fixes, for the stops: one of each drive, empty where there is none.
    smoothed: Vec<Vec<Estimate>>,
}

impl Reckoned {
    /// What the detectors say, which hear the fixes that the filter is given.
    pub(crate) fn stops(&self, drives: &[Drive], every_s: f64) -> Option<[Found; 3]> {
        let list = drives.iter().zip(&self.smoothed);
        list.map(|(drive, smoothed)| stands::detectors(&drive.thinned(every_s), smoothed))
            .reduce(|mut all, next| {
                for (all, next) in all.iter_mut().zip(next) {
                    all.flags.extend(next.flags);
                }
                all
            })
    }
}

/// One drive by ours.
struct Part {
    track: Vec<Estimate>,
    smoothed: Vec<Estimate>,
    uses: FixUse,
    fates: Vec<(f64, Fate)>,
    notes: Vec<String>,
}

impl Part {
    fn fate(&self, fix: &Fixed) -> Option<Fate> {
        let at = self.fates.partition_point(|x| x.0 < fix.t_s);
        let own = self.fates.get(at).filter(|x| x.0 <= fix.t_s);
        // That of the start is used by the start.
        let start = self.track.first();
        let start = start.is_some_and(|e| (e.t_s - fix.t_s).abs() < 0.03);
        own.map(|x| x.1).or(start.then_some(Fate::Used))
    }
}

fn part(
    args: &Args,
    sheet: &Sheet,
    drive: &Drive,
    before: Option<&Estimate>,
) -> Result<Part, CliError> {
    logs::startable(drive).map_err(|e| failed(&e))?;
    let found = if args.no_stop {
        vec![false; drive.periods.len()]
    } else {
        Detector::default().detect(drive)
    };
    let standing = Detector::hindsight(drive, &found, ENTRY_S, EXIT_S);
    let mut start = Start::at_first_course(drive, &standing).map_err(|e| failed(&e))?;
    // What the drive before has found of the gyros, older by the hole.
    let begin = drive.periods.get(start.first).map_or(0.0, |p| p.t_s);
    let known = before.map(|e| {
        let drift = sheet.rate_drift * (begin - e.t_s).max(0.0).sqrt();
        (e.rate_bias, e.rate_bias_sd.max().hypot(drift))
    });
    start.rate_bias = start.rate_bias.or(known);
    let sheet = sheet.clone().heard(drive, &found);
    let (mut passed, smoothed) =
        smooth::run(drive, &standing, &sheet, &start).map_err(|e| failed(&e))?;
    let notes = unproven::notes(drive, &start, &passed);
    Ok(Part {
        track: if args.no_smoother {
            std::mem::take(&mut passed.estimates)
        } else {
            smoothed.clone()
        },
        smoothed,
        uses: passed.fixes,
        fates: passed.fates,
        notes,
    })
}

/// A hole that no drive goes over, in words.
fn hole(from: f64, to: f64) -> String {
    format!(
        "no inertial sample for {:.1} s from {from:.2} s on",
        to - from
    )
}

/// Holes that are told one by one.
const TOLD: usize = 12;

/// The first of many notes on holes, and how many there are more.
fn few(mut holes: Vec<String>) -> Vec<String> {
    let more = holes.len().saturating_sub(TOLD);
    if more > 0 {
        holes.truncate(TOLD);
        holes.push(format!("{more} more such holes"));
    }
    holes
}

/// Ours: each drive for itself.
pub(crate) fn refined(
    args: &Args,
    sheet: &Sheet,
    drives: &[Drive],
    speeds: &[Speed],
) -> Result<Reckoned, CliError> {
    let mut out = Reckoned {
        track: Vec::new(),
        fixes: json!(null),
        shots: Vec::new(),
        notes: Vec::new(),
        smoothed: Vec::new(),
    };
    let mut uses = FixUse::default();
    let mut failure: Option<(f64, CliError)> = None;
    let mut before: Option<f64> = None;
    let mut holes = Vec::new();
    for drive in drives {
        let [from, to] = drive.span().unwrap_or_default();
        let hole = before.map(|end| hole(end, from));
        before = Some(to);
        let mut given = drive.thinned(args.every);
        let within = speeds.iter().filter(|s| s.t_s >= from && s.t_s <= to);
        given.speeds = within.copied().collect();
        let part = part(args, sheet, &given, out.track.last());
        out.shots.extend(drive.fixes.iter().map(|fix| Shot {
            fix: *fix,
            fate: part.as_ref().ok().and_then(|part| part.fate(fix)),
        }));
        match part {
            Ok(part) => {
                let begin = part.track.first().map_or(to, |e| e.t_s);
                let what = if out.track.is_empty() {
                    "the track begins behind it,"
                } else {
                    "the track ends there and begins anew"
                };
                let said = |hole: String| format!("{hole}: {what} at {begin:.2} s");
                holes.extend(hole.map(said));
                out.notes.extend(part.notes);
                uses = uses.and(&part.uses);
                out.track.extend(part.track);
                out.smoothed.push(part.smoothed);
            }
            Err(error) => {
                let what = format!("no track from {from:.2} to {to:.2} s: {error}");
                holes.push(match hole {
                    Some(hole) => format!("{hole}; {what}"),
                    None => what,
                });
                out.smoothed.push(Vec::new());
                if failure.as_ref().is_none_or(|f| f.0 < to - from) {
                    failure = Some((to - from, error));
                }
            }
        }
    }
    if let (true, Some((_, error))) = (out.track.is_empty(), failure) {
        return Err(error);
    }
    out.notes.splice(0..0, few(holes));
    out.fixes = gnss_track::fates(&out.track, &out.shots);
    out.fixes["speeds_refused"] = json!(uses.speeds_refused);
    out.fixes["speeds_forced"] = json!(uses.speeds_forced);
    out.notes.extend(plausible::refused(&uses));
    Ok(out)
}

/// That of S00, over all drives as one and with each for the stops: it has no clock but a step a sample, and goes over every hole as if it were not there.
pub(crate) fn published(
    args: &Args,
    sheet: &Sheet,
    logs: &Logs,
    drive: &Drive,
    drives: &[Drive],
    speeds: &[Speed],
) -> Result<Reckoned, CliError> {
    logs::startable(&drive.thinned(args.every)).map_err(|e| failed(&e))?;
    let latency_s = args.logs.choice.latency;
    let mut input = logs::published(&logs.motions, &args.logs.choice.axes.into(), &logs.fixes);
    let moving = input
        .fixes
        .iter()
        .position(|f| f.v_ned.norm() >= GATE)
        .ok_or_else(|| failed(&"fixes: expected one that moves at 3 m/s or more, found none"))?;
    input.fixes.drain(..moving);
    let latency = schema::num::round_usize(latency_s / DT);
    // The program wants samples ahead of its first fix.
    let lead = input.motions.first().map_or(0.0, |m| m.t_s) + real(latency + 60) * DT;
    input.fixes.retain(|f| f.t_s >= lead);
    let first = *input.fixes.first().ok_or_else(|| {
        failed(&"fixes: expected one after the first inertial samples, found none")
    })?;
    let initial = Initial::from_reference(&first, &first.v_ned);
    let due = thinned(input.fixes.iter().map(|f| f.t_s), args.every);
    let options = Options {
        due: Some(due),
        stop: if args.no_stop {
            None
        } else {
            Options::default().stop
        },
        latency,
        speed: args.exact_speed.then(|| SpeedAid {
            speeds: logs::speed_at_fixes(&input.fixes, speeds, latency_s),
            how: SpeedUse::Set,
        }),
        ..Options::default()
    };
    let steps = theirs::run(&input, &initial, &options).map_err(|e| failed(&e))?;
    let track = logs::track(&steps, latency_s);
    let taken: Vec<f64> = track.iter().filter(|e| e.fixed).map(|e| e.t_s).collect();
    let start_s = first.t_s - latency_s;
    let shots: Vec<Shot> = drive
        .fixes
        .iter()
        .map(|fix| {
            let at = taken.partition_point(|t| *t < fix.t_s - 1e-3);
            let used = taken.get(at).is_some_and(|t| t - fix.t_s < 1.5 * DT)
                || (fix.t_s - start_s).abs() < 1e-6;
            Shot {
                fix: *fix,
                fate: used.then_some(Fate::Used),
            }
        })
        .collect();
    let spans: Vec<[f64; 2]> = drives.iter().filter_map(Drive::span).collect();
    let notes = spans.windows(2).map(|w| {
        let hole = hole(w[0][1], w[1][0]);
        format!("{hole}: the published filter goes on as if that were no time")
    });
    let smoothed = drives.iter().map(|drive| {
        let part = drive.thinned(args.every);
        let found = Detector::default().detect(&part);
        let known = sheet.clone().heard(&part, &found);
        ours_smoothed(&part, &known, None).map_or_else(|_| Vec::new(), |p| p.1)
    });
    Ok(Reckoned {
        fixes: gnss_track::fates(&track, &shots),
        track,
        shots,
        notes: few(notes.collect()),
        smoothed: smoothed.collect(),
    })
}
