//! `reconstruct gnss run`: a drive from both logs of a box.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use reconstruct::gnss::drive::{Drive, Speed};
use reconstruct::gnss::logs;
use reconstruct::gnss::pictures::{self, Shown, page};
use reconstruct::gnss::reference::compare;
use reconstruct::gnss::stands::{self, Count};
use reconstruct::report::svg;
use serde_json::json;

use crate::cli::gnss::failed;
use crate::cli::gnss_logs::{self, LogArgs, Logs, seconds};
use crate::cli::gnss_receiver::ReceiverArgs;
use crate::cli::gnss_reckon::{self, Reckoned};
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
    pub(super) logs: LogArgs,
    /// Filter
    #[arg(long, value_enum, default_value = "refined")]
    filter: Filter,
    /// The running filter's answer instead of the smoothed one (refined)
    #[arg(long)]
    pub(super) no_smoother: bool,
    /// Use one fix each so many seconds
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    pub(super) every: f64,
    /// No stop detector
    #[arg(long)]
    pub(super) no_stop: bool,
    /// Take the speed of the reference, once a second, as a speedometer [S00, 3.8]
    #[arg(long, requires = "reference")]
    pub(super) exact_speed: bool,
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

/// Longest time without a speed that is fed in that needs no word, s.
const UNFED_S: f64 = 2.5;

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
    let axes = args.logs.choice.axes.into();
    let drives = logs::drives(&logs.motions, &axes, &fixed).map_err(|e| failed(&e))?;
    let drive = Drive::joined(&drives);
    let speeds = fed_speeds(args, &logs, &drive)?;
    logs.note(unfed(args, &speeds, &drives).into_iter().collect());
    let plausible = logs.examine(&drives, &fixed, latency_s);
    let mut reckoned = match args.filter {
        Filter::Refined => gnss_reckon::refined(args, &sheet, &drives, &speeds)?,
        Filter::Published => gnss_reckon::published(args, &sheet, &logs, &drive, &drives, &speeds)?,
    };
    logs.note(std::mem::take(&mut reckoned.notes));
    let found = reckoned
        .stops(&drives, args.every)
        .ok_or_else(|| failed(&"expected a drive, found none"))?;
    let Reckoned {
        track,
        fixes,
        shots,
        ..
    } = reckoned;
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
    let [begin, end] = drive.span().unwrap_or_default();
    speeds.retain(|s| s.t_s >= begin && s.t_s <= end);
    if speeds.is_empty() {
        return Err(failed(&format!(
            "--exact-speed: expected speeds of the reference within the drive, {begin:.2} to {end:.2} s, found none among {all} of its seconds"
        )));
    }
    Ok(speeds)
}

/// What to say where the speeds that are fed in leave time of the drives without one.
fn unfed(args: &Args, speeds: &[Speed], drives: &[Drive]) -> Option<String> {
    let longest = drives
        .iter()
        .filter_map(|drive| {
            let [from, to] = drive.span()?;
            let within = speeds.iter().map(|s| s.t_s);
            let within = within.filter(|t| *t > from && *t < to);
            let mut ends = vec![from];
            ends.extend(within.chain([to]));
            let gaps = ends.windows(2).map(|w| [w[0], w[1]]);
            gaps.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
        })
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
        .filter(|[from, to]| args.exact_speed && to - from > UNFED_S);
    longest.map(|[from, to]| {
        format!(
            "--exact-speed: expected a speed of the reference each second, found none from {from:.2} to {to:.2} s"
        )
    })
}

fn summary(
    args: &Args,
    shown: &Shown<'_>,
    logs: &Logs,
    fixes: &serde_json::Value,
) -> serde_json::Value {
    let ours = args.filter == Filter::Refined;
    let track = shown.track;
    // Ours holds the last sample over a hole and says so; the published one has a step a sample.
    let periods = shown.drive.periods.iter();
    let in_track = |t: f64| {
        let at = track.partition_point(|e| e.t_s < t - 1e-6);
        track.get(at).is_some_and(|e| e.t_s < t + 1e-6)
    };
    let held = periods
        .filter(|p| ours && !p.measured && in_track(p.t_s))
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
