//! `reconstruct gnss run`: a drive from both logs of a box.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use reconstruct::gnss::drive::{Drive, Fixed, Speed, thinned};
use reconstruct::gnss::forward::{self, Estimate, Fate, Start};
use reconstruct::gnss::logs;
use reconstruct::gnss::pictures::{self, Shot, Shown, page};
use reconstruct::gnss::plausible;
use reconstruct::gnss::published::constants::{DT, GATE};
use reconstruct::gnss::published::{self, Initial, Options, SpeedAid, SpeedUse};
use reconstruct::gnss::reference::compare;
use reconstruct::gnss::sheet::Sheet;
use reconstruct::gnss::smooth::smooth;
use reconstruct::gnss::stands::{self, Count};
use reconstruct::gnss::stop::{Detector, ENTRY_S, EXIT_S};
use reconstruct::gnss::trial::ours;
use reconstruct::gnss::unproven;
use reconstruct::report::svg;
use schema::num::real;
use serde_json::json;

use crate::cli::gnss::failed;
use crate::cli::gnss_logs::{self, LogArgs, Logs, seconds};
use crate::cli::gnss_receiver::ReceiverArgs;
use crate::cli::gnss_told::Told;
use crate::cli::gnss_track::{self, Begin, milli};
use crate::cli::{CliError, GAPS, SOUND, print, print_json, write_file};

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Filter {
    /// Ours: error states on WGS 84
    Refined,
    /// That of S00, with its faults
    Published,
}

#[derive(Debug, clap::Args)]
#[command(after_help = gnss_logs::EXIT_CODES)]
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
    #[command(flatten)]
    results: Results,
    #[command(flatten)]
    receiver: ReceiverArgs,
}

#[derive(Debug, clap::Args)]
struct Results {
    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print the summary
    #[arg(long)]
    json: bool,
}

/// A reckoned drive, what it says of its fixes for the summary, and each of them.
struct Reckoned {
    track: Vec<Estimate>,
    fixes: serde_json::Value,
    shots: Vec<Shot>,
    notes: Vec<String>,
    /// Our smoothed track of the same fixes, for the stops.
    smoothed: Vec<Estimate>,
}

/// Why a track begins where it does.
const BEGINS: [&str; 2] = [
    "where the first fix with a course that those after it bear out tells the heading",
    "with the first fix of 3 m/s or more that the program has samples ahead of",
];

pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    seconds("--every", args.every)?;
    let sheet = args.receiver.sheet()?;
    let mut logs = gnss_logs::read(&args.logs)?;
    let latency_s = args.logs.choice.latency;
    let fixed = logs::fixes(&logs.fixes, latency_s, &sheet);
    let drive = logs::drive(
        &logs.motions,
        &args.logs.choice.axes.into(),
        fixed,
        Vec::new(),
    )
    .map_err(|e| failed(&e))?;
    logs::startable(&drive.thinned(args.every)).map_err(|e| failed(&e))?;
    let speeds = fed_speeds(args, &logs, &drive)?;
    let plausible = logs.examine(&drive, latency_s);
    let Reckoned {
        track,
        fixes,
        shots,
        notes,
        smoothed,
    } = match args.filter {
        Filter::Refined => refined(args, &sheet, &drive, speeds)?,
        Filter::Published => by_published(args, &sheet, &logs, &drive, &speeds)?,
    };
    logs.note(notes);
    // They hear the fixes that the filter is given.
    let part = drive.thinned(args.every);
    let found = stands::detectors(&part, &smoothed);
    let counts: Vec<Count> = found
        .iter()
        .map(|f| stands::count(&drive, f, &logs.reference))
        .filter(|c| c.seconds > 0)
        .collect();
    let compared = compare(&track, &logs.reference);
    let by_ours = args.filter == Filter::Refined;
    let shown = Shown {
        filter: args.words(),
        track: &track,
        shots: &shots,
        drive: &drive,
        found: &found,
        reference: &logs.reference,
        seconds: &compared,
        counts: &counts,
        outages: &pictures::outages(&track, &shots),
    };
    let why = BEGINS[usize::from(!by_ours)];
    let begin = Begin::of(&track, &drive, &found[2].flags, why);
    let told = Told::new(
        &logs,
        &args.logs,
        by_ours.then_some(&args.receiver),
        args.entries(),
    );
    std::fs::create_dir_all(&args.results.out).map_err(|e| CliError::file(&args.results.out, e))?;
    let table = gnss_track::csv(&track, &shots);
    write_file(&args.results.out.join("track.csv"), table.as_bytes())?;
    let mut summary = summary(args, &shown, &logs, &fixes);
    summary["begin"] = begin.json();
    summary["plausibility"] = plausible.json();
    told.put(&mut summary);
    write_file(
        &args.results.out.join("summary.json"),
        format!("{summary:#}\n").as_bytes(),
    )?;
    let mut notes = logs.notes(&args.logs);
    if by_ours {
        notes.insert(0, args.receiver.words());
    }
    let told = page::Told {
        files: gnss_logs::files(&args.logs),
        notes,
        rows: told.rows(),
        begin: begin.words(),
        fed: args.exact_speed,
    };
    draw(&args.results.out, &shown, &told)?;
    if args.results.json {
        print_json(&summary)?;
    } else {
        print(&text(args, &counts))?;
    }
    Ok(if logs.sound() { SOUND } else { GAPS })
}

impl Args {
    /// The filter, for a page.
    fn words(&self) -> &'static str {
        match (self.filter, self.no_smoother) {
            (Filter::Published, _) => "that of S00",
            (Filter::Refined, true) => "ours, running",
            (Filter::Refined, false) => "ours, smoothed",
        }
    }

    /// Options of this command.
    fn entries(&self) -> Vec<(&'static str, &'static str, serde_json::Value)> {
        let ours = self.filter == Filter::Refined;
        let filter = if ours { "refined" } else { "published" };
        vec![
            ("filter", "Filter", json!(filter)),
            (
                "smoother",
                "Each instant from all data",
                json!(ours && !self.no_smoother),
            ),
            (
                "every_s",
                "One fix used each so many seconds",
                json!(self.every),
            ),
            ("stop_detector", "Stop detector", json!(!self.no_stop)),
            (
                "exact_speed",
                "Speed of the reference fed in",
                json!(self.exact_speed),
            ),
        ]
    }
}

/// Speeds of the reference within the drive, if they are to be fed in.
fn fed_speeds(args: &Args, logs: &Logs, drive: &Drive) -> Result<Vec<Speed>, CliError> {
    if !args.exact_speed {
        return Ok(Vec::new());
    }
    let mut speeds = logs.reference.speeds();
    let all = speeds.len();
    let begin = drive.periods.first().map_or(0.0, |p| p.t_s - p.dt);
    let end = drive.periods.last().map_or(0.0, |p| p.t_s);
    speeds.retain(|s| s.t_s >= begin && s.t_s <= end);
    if speeds.is_empty() {
        return Err(failed(&format!(
            "--exact-speed: expected speeds of the reference within the drive, {begin:.2} to {end:.2} s, found none among {all} of its seconds"
        )));
    }
    Ok(speeds)
}

fn summary(
    args: &Args,
    shown: &Shown<'_>,
    logs: &Logs,
    fixes: &serde_json::Value,
) -> serde_json::Value {
    let ours = args.filter == Filter::Refined;
    let track = shown.track;
    let first = track.first().map_or(f64::INFINITY, |e| e.t_s);
    // Ours holds the last sample over a hole and says so; the published one has a step a sample.
    let periods = shown.drive.periods.iter();
    let held = periods
        .filter(|p| ours && !p.measured && p.t_s >= first)
        .count();
    json!({
        "filter": args.filter.to_possible_value().map(|v| v.get_name().to_owned()),
        "smoothed": ours && !args.no_smoother,
        "fixes_every_s": args.every, "latency_s": args.logs.choice.latency, "stop_detector": !args.no_stop,
        "receiver": ours.then(|| args.receiver.json()),
        "begin_s": track.first().map(|e| milli(e.t_s)), "end_s": track.last().map(|e| milli(e.t_s)),
        "samples": track.len() - held, "held": held, "fixes": fixes,
        "standing_s": gnss_track::standing_s(track),
        "deviation": gnss_track::deviation(shown.seconds, args.exact_speed),
        "stop_errors": page::stops_json(shown.counts),
        "notes": {
            "fixes": logs.said[0], "motions": logs.said[1], "reference": logs.said[2], "together": logs.together,
        },
    })
}

/// What was written, and the errors of the stop detectors.
fn text(args: &Args, counts: &[Count]) -> String {
    let mut text = String::new();
    for name in ["track.csv", "summary.json", "report.html", "pictures"] {
        let _ = writeln!(text, "{}", args.results.out.join(name).display());
    }
    if !counts.is_empty() {
        let _ = write!(
            text,
            "\nErrors of the stop detectors against a reference speed of 0.2 m/s; in brackets 95 %.\n{}",
            page::stops_text(counts)
        );
    }
    text
}

/// The page and the pictures as files of their own.
fn draw(out: &Path, shown: &Shown<'_>, told: &page::Told) -> Result<(), CliError> {
    let list = pictures::all(shown);
    let folder = out.join("pictures");
    std::fs::create_dir_all(&folder).map_err(|e| CliError::file(&folder, e))?;
    for (name, _, picture) in &list {
        let path = folder.join(format!("{name}.svg"));
        write_file(&path, svg::file(picture).as_bytes())?;
    }
    let html = page::drive(shown, &list, told);
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
    let smoothed = smooth(&passed);
    let track = if args.no_smoother {
        passed.estimates.clone()
    } else {
        smoothed.clone()
    };
    let fate = |fix: &Fixed| {
        let at = passed.fates.partition_point(|x| x.0 < fix.t_s);
        let own = passed.fates.get(at).filter(|x| x.0 <= fix.t_s);
        // That of the start is used by the start.
        let start = track
            .first()
            .is_some_and(|e| (e.t_s - fix.t_s).abs() < 0.03);
        own.map(|x| x.1).or(start.then_some(Fate::Used))
    };
    let shots: Vec<Shot> = whole
        .fixes
        .iter()
        .map(|fix| Shot {
            fix: *fix,
            fate: fate(fix),
        })
        .collect();
    let mut fixes = gnss_track::fates(&track, &shots);
    fixes["speeds_refused"] = json!(passed.fixes.speeds_refused);
    fixes["speeds_forced"] = json!(passed.fixes.speeds_forced);
    let mut notes = plausible::refused(&passed.fixes);
    notes.extend(unproven::notes(&drive, &start, &passed));
    Ok(Reckoned {
        track,
        fixes,
        shots,
        notes,
        smoothed,
    })
}

fn by_published(
    args: &Args,
    sheet: &Sheet,
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
    let steps = published::run(&input, &initial, &options).map_err(|e| failed(&e))?;
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
    let part = drive.thinned(args.every);
    let known = sheet
        .clone()
        .heard(&part, &Detector::default().detect(&part));
    Ok(Reckoned {
        fixes: gnss_track::fates(&track, &shots),
        track,
        shots,
        notes: Vec::new(),
        smoothed: ours(&part, &known, None).map_or_else(|_| Vec::new(), |p| smooth(&p)),
    })
}
