//! `reconstruct gnss run`: a drive from both logs of a box.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use reconstruct::gnss::drive::{Drive, Fixed, Speed};
use reconstruct::gnss::forward::{self, Estimate, Fate, Start};
use reconstruct::gnss::logs;
use reconstruct::gnss::pictures::{self, Shot, Shown, page};
use reconstruct::gnss::plausible;
use reconstruct::gnss::published::constants::{DT, GATE};
use reconstruct::gnss::published::{self, Initial, Options, SpeedAid, SpeedUse};
use reconstruct::gnss::reference::{Second, compare};
use reconstruct::gnss::sheet::Sheet;
use reconstruct::gnss::smooth::smooth;
use reconstruct::gnss::stands::{self, Count};
use reconstruct::gnss::stop::{Detector, ENTRY_S, EXIT_S};
use reconstruct::report::svg;
use schema::num::real;
use serde_json::json;

use crate::cli::gnss::failed;
use crate::cli::gnss_logs::{self, LogArgs, Logs, seconds};
use crate::cli::gnss_receiver::ReceiverArgs;
use crate::cli::{CliError, GAPS, SOUND, print, write_file};

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Filter {
    /// Ours: error states on WGS 84
    Refined,
    /// That of S00, with its faults
    Published,
}

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    logs: LogArgs,
    /// Filter
    #[arg(long, value_enum, default_value = "refined")]
    filter: Filter,
    /// The running filter's answer instead of the smoothed one (refined)
    #[arg(long)]
    no_smoother: bool,
    /// Use one fix each so many seconds
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    every: f64,
    /// No stop detector
    #[arg(long)]
    no_stop: bool,
    /// Take the speed of the reference, once a second, as a speedometer [S00, 3.8]
    #[arg(long, requires = "reference")]
    exact_speed: bool,
    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    receiver: ReceiverArgs,
}

/// A reckoned drive, what it says of its fixes for the summary, and each of them.
struct Reckoned {
    track: Vec<Estimate>,
    used: serde_json::Value,
    shots: Vec<Shot>,
    notes: Vec<String>,
}

pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    seconds("--every", args.every)?;
    let sheet = args.receiver.sheet()?;
    let mut logs = gnss_logs::read(&args.logs)?;
    let reference = logs.reference.clone();
    let reference = &reference;
    let speeds = if args.exact_speed {
        reference.speeds()
    } else {
        Vec::new()
    };
    let fixed = logs::fixes(&logs.fixes, args.logs.choice.latency, &sheet);
    let drive = logs::drive(
        &logs.motions,
        &args.logs.choice.axes.into(),
        fixed,
        Vec::new(),
    )
    .map_err(|e| failed(&e))?;
    let plausible = plausible::look(&drive, &logs.motions);
    logs.note(plausible.notes());
    let Reckoned {
        track,
        used,
        shots,
        notes,
    } = match args.filter {
        Filter::Refined => refined(args, &sheet, &drive, speeds)?,
        Filter::Published => by_published(args, &logs, &drive, &speeds)?,
    };
    logs.note(notes);
    // They hear the fixes that the filter is given.
    let found = stands::detectors(&drive.thinned(args.every));
    let counts: Vec<Count> = found
        .iter()
        .map(|f| stands::count(&drive, f, reference))
        .filter(|c| c.seconds > 0)
        .collect();
    let seconds = compare(&track, reference);
    let shown = Shown {
        filter: match (args.filter, args.no_smoother) {
            (Filter::Published, _) => "that of S00",
            (Filter::Refined, true) => "ours, running",
            (Filter::Refined, false) => "ours, smoothed",
        },
        track: &track,
        shots: &shots,
        drive: &drive,
        found: &found,
        reference,
        seconds: &seconds,
        counts: &counts,
        outages: &pictures::outages(&track, &shots),
    };
    let ours = args.filter == Filter::Refined;
    std::fs::create_dir_all(&args.out).map_err(|e| CliError::file(&args.out, e))?;
    write_file(&args.out.join("track.csv"), csv(&track).as_bytes())?;
    let summary = json!({
        "filter": args.filter.to_possible_value().map(|v| v.get_name().to_owned()),
        "smoothed": ours && !args.no_smoother,
        "fixes_every_s": args.every, "latency_s": args.logs.choice.latency, "stop_detector": !args.no_stop,
        "receiver": ours.then(|| args.receiver.json()),
        "begin_s": track.first().map(|e| e.t_s), "end_s": track.last().map(|e| e.t_s),
        "samples": track.len(), "fixes": used,
        "standing_s": standing_s(&track),
        "deviation": deviation(&seconds),
        "stop_errors": page::stops_json(&counts),
        "notes": { "fixes": logs.said[0], "motions": logs.said[1], "reference": logs.said[2], "together": logs.together },
        "plausibility": plausible.json(),
    });
    write_file(
        &args.out.join("summary.json"),
        format!("{summary:#}\n").as_bytes(),
    )?;
    let mut notes = logs.notes(&args.logs);
    if ours {
        notes.insert(0, args.receiver.words());
    }
    draw(&args.out, &shown, &gnss_logs::files(&args.logs), &notes)?;
    let mut text = String::new();
    for name in ["track.csv", "summary.json", "report.html", "pictures"] {
        let _ = writeln!(text, "{}", args.out.join(name).display());
    }
    if !counts.is_empty() {
        let _ = write!(
            text,
            "\nErrors of the stop detectors against a reference speed of 0.2 m/s; in brackets 95 %.\n{}",
            page::stops_text(&counts)
        );
    }
    print(&text)?;
    Ok(if logs.sound() { SOUND } else { GAPS })
}

/// The page and the pictures as files of their own.
fn draw(out: &Path, shown: &Shown<'_>, files: &str, notes: &[String]) -> Result<(), CliError> {
    let list = pictures::all(shown);
    let folder = out.join("pictures");
    std::fs::create_dir_all(&folder).map_err(|e| CliError::file(&folder, e))?;
    for (name, _, picture) in &list {
        let path = folder.join(format!("{name}.svg"));
        write_file(&path, svg::file(picture).as_bytes())?;
    }
    let html = page::drive(shown, &list, files, notes);
    write_file(&out.join("report.html"), html.as_bytes())
}

fn refined(
    args: &Args,
    sheet: &Sheet,
    whole: &Drive,
    speeds: Vec<Speed>,
) -> Result<Reckoned, CliError> {
    let mut drive = whole.thinned(args.every);
    drive.speeds = speeds;
    let found = if args.no_stop {
        vec![false; drive.periods.len()]
    } else {
        Detector::default().detect(&drive)
    };
    let standing = Detector::hindsight(&drive, &found, ENTRY_S, EXIT_S);
    let start = Start::at_first_course(&drive, &standing).map_err(|e| failed(&e))?;
    let sheet = sheet.clone().heard(&drive, &found);
    let passed = forward::run(&drive, &standing, &sheet, &start).map_err(|e| failed(&e))?;
    let track = if args.no_smoother {
        passed.estimates.clone()
    } else {
        smooth(&passed)
    };
    let f = &passed.fixes;
    let said = json!({
        "offered": f.offered, "used": f.used, "refused": f.refused, "forced": f.forced,
        "speeds_refused": f.speeds_refused, "speeds_forced": f.speeds_forced,
    });
    let fate = |fix: &Fixed| {
        let at = passed.fates.partition_point(|x| x.0 < fix.t_s);
        let own = passed.fates.get(at).filter(|x| x.0 <= fix.t_s);
        // That of the start is used by the start.
        let start = track
            .first()
            .is_some_and(|e| (e.t_s - fix.t_s).abs() < 0.03);
        own.map(|x| x.1).or(start.then_some(Fate::Used))
    };
    let shots = whole
        .fixes
        .iter()
        .map(|fix| Shot {
            fix: *fix,
            fate: fate(fix),
        })
        .collect();
    Ok(Reckoned {
        track,
        used: said,
        shots,
        notes: plausible::refused(f),
    })
}

fn by_published(
    args: &Args,
    logs: &Logs,
    drive: &Drive,
    speeds: &[Speed],
) -> Result<Reckoned, CliError> {
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
    let options = Options {
        every: Some(schema::num::round_usize(args.every).max(1)),
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
    let steps = published::run(&input, &initial, &options).map_err(|e| failed(&e))?;
    let used = steps
        .iter()
        .filter(|s| s.used == published::Used::Gnss)
        .count();
    let track = logs::track(&steps, latency_s);
    let taken: Vec<f64> = track.iter().filter(|e| e.fixed).map(|e| e.t_s).collect();
    let shots = drive
        .fixes
        .iter()
        .map(|fix| {
            let at = taken.partition_point(|t| *t < fix.t_s - 1e-3);
            let used = taken.get(at).is_some_and(|t| t - fix.t_s < 1.5 * DT);
            Shot {
                fix: *fix,
                fate: used.then_some(Fate::Used),
            }
        })
        .collect();
    Ok(Reckoned {
        track,
        used: json!({ "offered": input.fixes.len(), "used": used }),
        shots,
        notes: Vec::new(),
    })
}

/// Horizontal deviation from the reference at its stamps, m: mean, 95th percentile, largest, and how often the reference
/// lies in the ellipse of 95 %; null where the two do not meet.
fn deviation(list: &[Second]) -> serde_json::Value {
    if list.is_empty() {
        return serde_json::Value::Null;
    }
    let mut off: Vec<f64> = list.iter().map(|s| s.off_m).collect();
    let inside = list.iter().filter(|s| s.inside).count();
    off.sort_by(f64::total_cmp);
    let last = off.len() - 1;
    json!({
        "instants": off.len(), "mean_m": off.iter().sum::<f64>() / real(off.len()),
        "p95_m": off[schema::num::round_usize(0.95 * real(last))], "largest_m": off[last],
        "inside_95": real(inside) / real(off.len()),
    })
}

fn standing_s(track: &[Estimate]) -> f64 {
    track
        .windows(2)
        .filter(|w| w[1].standing)
        .map(|w| w[1].t_s - w[0].t_s)
        .sum()
}

/// `t_s` is the box's clock.
fn csv(track: &[Estimate]) -> String {
    let mut out = String::from(
        "t_s,latitude_deg,longitude_deg,height_m,v_north_mps,v_east_mps,v_down_mps,roll_deg,pitch_deg,heading_deg,sd_north_m,sd_east_m,cov_north_east_m2,sd_down_m,sd_v_north_mps,sd_v_east_mps,sd_heading_deg,standing,fix_used\n",
    );
    for e in track {
        let sd = |i: usize| e.p[(i, i)].max(0.0).sqrt();
        let _ = writeln!(
            out,
            "{:.3},{:.9},{:.9},{:.3},{:.4},{:.4},{:.4},{:.3},{:.3},{:.3},{:.3},{:.3},{:.4},{:.3},{:.4},{:.4},{:.3},{},{}",
            e.t_s,
            e.place.latitude.to_degrees(),
            e.place.longitude.to_degrees(),
            e.place.height,
            e.v_n.x,
            e.v_n.y,
            e.v_n.z,
            e.angles[0].to_degrees(),
            e.angles[1].to_degrees(),
            e.angles[2].to_degrees(),
            sd(0),
            sd(1),
            e.p[(0, 1)],
            sd(2),
            sd(3),
            sd(4),
            sd(8).to_degrees(),
            u8::from(e.standing),
            u8::from(e.fixed),
        );
    }
    out
}
