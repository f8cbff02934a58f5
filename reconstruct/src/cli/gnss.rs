//! `reconstruct gnss`: satellite fixes and inertial samples of a box in the car [S00].

use std::fmt::Write;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use clap::{Subcommand, ValueEnum};
use reconstruct::gnss::experiments::{self, Experiment, Outcome};
use reconstruct::gnss::forward::{self, Estimate, Start};
use reconstruct::gnss::layout::Layout;
use reconstruct::gnss::logs::{self, Axes};
use reconstruct::gnss::published::sensor::Orientation;
use reconstruct::gnss::published::{self, Initial, Options, SLIPS};
use reconstruct::gnss::read::{Read, Tolerance, read_fixes, read_motions};
use reconstruct::gnss::rows::{Fix, Motion};
use reconstruct::gnss::sheet::Sheet;
use reconstruct::gnss::smooth::smooth;
use reconstruct::gnss::stop::{Detector, ENTRY_S, EXIT_S};
use reconstruct::gnss::write::{write_fixes, write_motions};
use reconstruct::simulate::city::{self, BoxSheet};
use reconstruct::validate::workers;
use schema::num::real;
use serde_json::json;

use crate::cli::{CliError, GAPS, SOUND, complain, print, print_json, write_file};

/// Arguments of `gnss`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Reckon a drive from a log of fixes and one of inertial samples: track.csv and summary.json
    Run(Box<RunArgs>),
    /// Make both logs, and those of a reference receiver, of a town drive with known truth
    Simulate(SimulateArgs),
    /// The experiments of S00 on simulated drives: its filter and ours
    Experiments(ExperimentArgs),
    /// List where S00 slips, and what is done about it
    Slips,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Filter {
    /// Ours: error states on WGS 84
    Refined,
    /// That of S00, with its faults
    Published,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SensorAxes {
    /// Those of the tags of S00
    Tag,
    /// Those of the car: x forward, y right, z down
    Car,
}

impl From<SensorAxes> for Axes {
    fn from(axes: SensorAxes) -> Self {
        match axes {
            SensorAxes::Tag => Self::Tag(Orientation::default()),
            SensorAxes::Car => Self::Car,
        }
    }
}

#[derive(Debug, clap::Args)]
struct RunArgs {
    /// Log of fixes, 35 columns
    #[arg(long, value_name = "FILE")]
    fixes: PathBuf,
    /// Log of accelerations and rates, 14 columns
    #[arg(long, value_name = "FILE")]
    motions: PathBuf,
    /// Equipment to take, where the logs hold several
    #[arg(long, value_name = "ID")]
    equipment: Option<u32>,
    /// Drive to take
    #[arg(long, value_name = "ID")]
    drive: Option<u32>,
    /// Leg to take
    #[arg(long, value_name = "ID")]
    leg: Option<u32>,
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
    /// Axes of the inertial sensors
    #[arg(long, value_enum, default_value = "tag")]
    axes: SensorAxes,
    /// Delay of the fixes behind the inertial samples
    #[arg(long, default_value_t = 1.24, value_name = "SECONDS")]
    latency: f64,
    /// Skip lines that cannot be read, and count them
    #[arg(long)]
    skip_broken: bool,
    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, clap::Args)]
struct SimulateArgs {
    /// Seed
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Length of the drive, 60 to 230
    #[arg(long, default_value_t = 200.0, value_name = "SECONDS")]
    seconds: f64,
    /// Axes of the inertial sensors
    #[arg(long, value_enum, default_value = "tag")]
    axes: SensorAxes,
    /// Folder for the logs; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, clap::Args)]
struct ExperimentArgs {
    /// Seeds of the drives, first and last
    #[arg(long, default_value = "90001..90010", value_name = "FIRST..LAST", value_parser = seeds)]
    seeds: std::ops::RangeInclusive<u64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

fn seeds(text: &str) -> Result<std::ops::RangeInclusive<u64>, String> {
    let wrong = || {
        format!(
            "expected FIRST..LAST with FIRST at most LAST and at most 10000 seeds, found `{text}`"
        )
    };
    let (first, last) = text.split_once("..").ok_or_else(wrong)?;
    let first: u64 = first.parse().map_err(|_| wrong())?;
    let last: u64 = last.parse().map_err(|_| wrong())?;
    if first <= last && last - first < 10_000 {
        Ok(first..=last)
    } else {
        Err(wrong())
    }
}

/// A failure in words, exit code 1.
fn failed(error: &dyn std::fmt::Display) -> CliError {
    CliError::Gnss(error.to_string())
}

pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    match &args.command {
        Command::Run(args) => reckon(args),
        Command::Simulate(args) => simulate(args),
        Command::Experiments(args) => experiment(args),
        Command::Slips => slips(),
    }
}

fn open(path: &Path) -> Result<BufReader<File>, CliError> {
    File::open(path)
        .map(BufReader::new)
        .map_err(|error| CliError::file(path, error))
}

fn notes<T>(path: &Path, read: &Read<T>) -> Vec<String> {
    let notes: Vec<String> = read.notes.iter().map(ToString::to_string).collect();
    for note in &notes {
        complain("note", &format!("{}: {note}", path.display()));
    }
    notes
}

fn reckon(args: &RunArgs) -> Result<u8, CliError> {
    for (name, value) in [("--every", args.every), ("--latency", args.latency)] {
        if !(value.is_finite() && (0.0..=3600.0).contains(&value)) {
            return Err(failed(&format!(
                "{name}: expected 0 to 3600 s, found {value}"
            )));
        }
    }
    let tolerance = if args.skip_broken {
        Tolerance::SkipBroken
    } else {
        Tolerance::Strict
    };
    let named = |path: &Path| path.display().to_string();
    let fixes =
        read_fixes(open(&args.fixes)?, &named(&args.fixes), tolerance).map_err(|e| failed(&e))?;
    let motions = read_motions(open(&args.motions)?, &named(&args.motions), tolerance)
        .map_err(|e| failed(&e))?;
    let said = [notes(&args.fixes, &fixes), notes(&args.motions, &motions)];
    let chosen_fixes = fixes.select(args.equipment, args.drive, args.leg);
    let chosen = motions.select(args.equipment, args.drive, args.leg);
    one_leg(&fixes, chosen_fixes.len(), args, &args.fixes)?;
    one_leg(&motions, chosen.len(), args, &args.motions)?;
    let (track, used) = match args.filter {
        Filter::Refined => refined(args, &chosen_fixes, &chosen)?,
        Filter::Published => by_published(args, &chosen_fixes, &chosen)?,
    };
    std::fs::create_dir_all(&args.out).map_err(|e| CliError::file(&args.out, e))?;
    write_file(&args.out.join("track.csv"), csv(&track).as_bytes())?;
    let summary = json!({
        "filter": args.filter.to_possible_value().map(|v| v.get_name().to_owned()),
        "smoothed": args.filter == Filter::Refined && !args.no_smoother,
        "fixes_every_s": args.every, "latency_s": args.latency, "stop_detector": !args.no_stop,
        "begin_s": track.first().map(|e| e.t_s), "end_s": track.last().map(|e| e.t_s),
        "samples": track.len(), "fixes": used,
        "standing_s": standing_s(&track),
        "notes": { "fixes": said[0], "motions": said[1] },
    });
    write_file(
        &args.out.join("summary.json"),
        format!("{summary:#}\n").as_bytes(),
    )?;
    print(&format!("{}\n", args.out.join("track.csv").display()))?;
    Ok(if said.iter().all(Vec::is_empty) {
        SOUND
    } else {
        GAPS
    })
}

/// Several legs in one log are several drives on several clocks: one has to be chosen.
fn one_leg<T: reconstruct::gnss::rows::Row>(
    read: &Read<T>,
    chosen: usize,
    args: &RunArgs,
    path: &Path,
) -> Result<(), CliError> {
    let fits = |choice: Option<u32>, id: u32| choice.is_none_or(|c| c == id);
    let legs: Vec<String> = read
        .legs()
        .iter()
        .filter(|(l, _)| {
            fits(args.equipment, l.equipment) && fits(args.drive, l.drive) && fits(args.leg, l.leg)
        })
        .map(|(l, rows)| {
            format!(
                "equipment {} drive {} leg {} ({rows} rows)",
                l.equipment, l.drive, l.leg
            )
        })
        .collect();
    if legs.len() == 1 && chosen > 0 {
        return Ok(());
    }
    Err(failed(&format!(
        "{}: expected one leg (--equipment, --drive, --leg), found {}",
        path.display(),
        if legs.is_empty() {
            "none".to_owned()
        } else {
            legs.join(", ")
        }
    )))
}

fn refined(
    args: &RunArgs,
    fixes: &[Fix],
    motions: &[Motion],
) -> Result<(Vec<Estimate>, serde_json::Value), CliError> {
    let sheet = Sheet::default();
    let fixed = logs::fixes(fixes, args.latency, &sheet);
    let drive = logs::drive(motions, &args.axes.into(), fixed, Vec::new())
        .map_err(|e| failed(&e))?
        .thinned(args.every);
    let found = if args.no_stop {
        vec![false; drive.periods.len()]
    } else {
        Detector::default().detect(&drive)
    };
    let standing = Detector::hindsight(&drive, &found, ENTRY_S, EXIT_S);
    let start = Start::at_first_course(&drive, &standing).map_err(|e| failed(&e))?;
    let sheet = sheet.heard(&drive, &found);
    let passed = forward::run(&drive, &standing, &sheet, &start).map_err(|e| failed(&e))?;
    let track = if args.no_smoother {
        passed.estimates.clone()
    } else {
        smooth(&passed)
    };
    let f = &passed.fixes;
    Ok((
        track,
        json!({ "offered": f.offered, "used": f.used, "refused": f.refused, "forced": f.forced }),
    ))
}

fn by_published(
    args: &RunArgs,
    fixes: &[Fix],
    motions: &[Motion],
) -> Result<(Vec<Estimate>, serde_json::Value), CliError> {
    let input = logs::published(motions, &args.axes.into(), fixes);
    let moving = input
        .fixes
        .iter()
        .position(|f| f.v_ned.norm() >= 3.0)
        .ok_or_else(|| failed(&"fixes: expected one that moves at 3 m/s or more, found none"))?;
    let mut input = input;
    input.fixes.drain(..moving);
    let period = 0.02;
    let latency = schema::num::round_usize(args.latency / period);
    // The program wants samples ahead of its first fix.
    let lead = input.motions.first().map_or(0.0, |m| m.t_s) + real(latency + 60) * period;
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
        ..Options::default()
    };
    let steps = published::run(&input, &initial, &options).map_err(|e| failed(&e))?;
    let used = steps
        .iter()
        .filter(|s| s.used == published::Used::Gnss)
        .count();
    let track = steps
        .iter()
        .map(|step| {
            let place = reconstruct::wgs84::Geodetic {
                latitude: step.lat,
                longitude: step.lon,
                height: step.height,
            };
            let to_local = place.c_en().transpose();
            let mut p = nalgebra::SMatrix::<f64, 9, 9>::zeros();
            for i in 0..9 {
                p[(i, i)] = step.variances[i];
            }
            let angles = step.angles();
            Estimate {
                t_s: step.t_s - args.latency,
                place,
                v_n: to_local * step.velocity(),
                angles: [
                    angles.x,
                    angles.y,
                    angles.z.rem_euclid(std::f64::consts::TAU),
                ],
                p,
                standing: step.used == published::Used::Stop,
                fixed: step.used == published::Used::Gnss,
            }
        })
        .collect();
    Ok((track, json!({ "offered": input.fixes.len(), "used": used })))
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

fn simulate(args: &SimulateArgs) -> Result<u8, CliError> {
    let sheet = BoxSheet::default();
    let city = city::drive(args.seed, args.seconds, &sheet).map_err(|e| failed(&e))?;
    let (fixes, motions, reference) = logs::rows(&city, &sheet, &args.axes.into());
    std::fs::create_dir_all(&args.out).map_err(|e| CliError::file(&args.out, e))?;
    let layout = Layout::default();
    for (name, rows) in [("fixes", &fixes), ("reference", &reference)] {
        let path = args.out.join(format!("{name}-{}.txt", args.seed));
        let mut bytes = Vec::new();
        write_fixes(&mut bytes, name, rows, layout).map_err(|e| failed(&e))?;
        write_file(&path, &bytes)?;
        print(&format!("{}\n", path.display()))?;
    }
    let path = args.out.join(format!("motions-{}.txt", args.seed));
    let mut bytes = Vec::new();
    write_motions(&mut bytes, "motions", &motions, layout).map_err(|e| failed(&e))?;
    write_file(&path, &bytes)?;
    print(&format!("{}\n", path.display()))?;
    Ok(SOUND)
}

fn experiment(args: &ExperimentArgs) -> Result<u8, CliError> {
    let sheet = BoxSheet::default();
    let jobs: Vec<u64> = args.seeds.clone().collect();
    let threads = std::thread::available_parallelism().map_or(2, usize::from);
    let mut all: Vec<Outcome> = Vec::new();
    for result in workers::run(
        &jobs,
        threads,
        |seed| experiments::run(*seed, &sheet),
        |done| {
            complain("drives", &format!("{done} of {}", jobs.len()));
        },
    ) {
        all.extend(result.map_err(|e| failed(&e))?);
    }
    let mut text = String::from(
        "Largest deviation of a window from the truth, mean over the windows, m.\n\
         cold: from the start that the published program has. ours: with a fix each second until the window begins.\n\n\
         experiment                        windows  S00  published  mended   cold   ours  smoothed  inside 95 %\n",
    );
    let mut rows = Vec::new();
    for experiment in Experiment::ALL {
        let of: Vec<&Outcome> = all.iter().filter(|o| o.experiment == experiment).collect();
        let n = real(of.len().max(1));
        let mean = |f: fn(&Outcome) -> f64| of.iter().map(|o| f(o)).sum::<f64>() / n;
        let [seconds, held] = [0, 1].map(|i| of.iter().map(|o| o.inside[i]).sum::<usize>());
        let inside = real(held) / real(seconds.max(1));
        let [published, mended] = [mean(|o| o.published_m[0]), mean(|o| o.published_m[1])];
        let (cold, ours, smoothed) = (
            mean(|o| o.cold_m),
            mean(|o| o.ours_m),
            mean(|o| o.smoothed_m),
        );
        let source = experiment
            .source_m()
            .map_or_else(|| "-".to_owned(), |m| format!("{m:.0}"));
        let _ = writeln!(
            text,
            "{:32} {:8} {source:>4} {published:10.1} {mended:7.1} {cold:6.1} {ours:6.1} {smoothed:9.1} {:12.1}",
            experiment.name(),
            of.len(),
            100.0 * inside,
        );
        rows.push(json!({
            "experiment": experiment.name(), "windows": of.len(), "source_m": experiment.source_m(),
            "published_m": published, "published_mended_m": mended, "cold_m": cold, "ours_m": ours,
            "smoothed_m": smoothed, "inside_95": inside,
        }));
    }
    if args.json {
        print_json(&json!({ "seeds": [args.seeds.start(), args.seeds.end()], "rows": rows }))?;
    } else {
        print(&text)?;
    }
    Ok(SOUND)
}

fn slips() -> Result<u8, CliError> {
    let mut text = String::new();
    for slip in &SLIPS {
        let switch = if slip.switch.is_empty() {
            String::new()
        } else {
            format!("\n  switch: {}", slip.switch)
        };
        let _ = writeln!(
            text,
            "{}\n  says:   {}\n  right:  {}\n  here:   {}{switch}",
            slip.place, slip.says, slip.right, slip.ours
        );
    }
    print(&text)?;
    Ok(SOUND)
}
