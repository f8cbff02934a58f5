//! `reconstruct gnss`: satellite fixes and inertial samples of a box in the car [S00].

use std::fmt::Write;
use std::path::PathBuf;

use clap::{Subcommand, ValueEnum};
use reconstruct::gnss::experiments::{self, Experiment, Outcome};
use reconstruct::gnss::layout::Layout;
use reconstruct::gnss::logs::{self, Axes};
use reconstruct::gnss::pictures::page;
use reconstruct::gnss::published::SLIPS;
use reconstruct::gnss::published::sensor::Orientation;
use reconstruct::gnss::write::{write_fixes, write_motions};
use reconstruct::simulate::city::{self, BoxSheet};
use reconstruct::simulate::tumble::{self, TumbleSheet};
use reconstruct::validate::workers;
use schema::num::real;
use serde_json::json;

use crate::cli::validate::{Seeds, seeds};
use crate::cli::{
    CliError, SOUND, complain, gnss_analyse, gnss_outages, gnss_run, print, print_json, write_file,
};

/// Arguments of `gnss`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Reckon a drive from a log of fixes and one of inertial samples: track.csv, summary.json, report.html, pictures
    Run(Box<gnss_run::Args>),
    /// Withhold fixes of a drive with a reference as S00 does: what both filters make of the outages
    Outages(Box<gnss_outages::Args>),
    /// What the logs tell of receiver and sensors: deviation from a reference, noise, bias, scale, wraps, Allan deviation
    Analyse(Box<gnss_analyse::Args>),
    /// Make both logs, and those of a reference receiver, of a town drive with known truth
    Simulate(SimulateArgs),
    /// The experiments of S00 on simulated drives: its filter and ours
    Experiments(ExperimentArgs),
    /// List where S00 slips, and what is done about it
    Slips,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SensorAxes {
    /// Those of the tags of S00
    Tag,
    /// Those of the car: x forward, y right, z down
    Car,
}

impl SensorAxes {
    /// As it is told.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Tag => "tag",
            Self::Car => "car",
        }
    }
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
    /// Instead of a drive, a log of motions of a box laid on each of its six sides, then askew, and its hidden scales and biases
    #[arg(long)]
    six_positions: bool,
    /// Folder for the logs; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, clap::Args)]
struct ExperimentArgs {
    /// Seeds of the drives, first and last
    #[arg(long, default_value = "90001..90010", value_name = "FIRST..LAST", value_parser = seeds)]
    seeds: Seeds,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Folder for experiments.html, the table with its errors and a picture; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// A failure in words, exit code 1.
pub(crate) fn failed(error: &dyn std::fmt::Display) -> CliError {
    CliError::Gnss(error.to_string())
}

pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    match &args.command {
        Command::Run(args) => gnss_run::run(args),
        Command::Outages(args) => gnss_outages::run(args),
        Command::Analyse(args) => gnss_analyse::run(args),
        Command::Simulate(args) if args.six_positions => six_positions(args),
        Command::Simulate(args) => simulate(args),
        Command::Experiments(args) => experiment(args),
        Command::Slips => slips(),
    }
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

fn six_positions(args: &SimulateArgs) -> Result<u8, CliError> {
    let sheet = TumbleSheet {
        askew: 9,
        ..TumbleSheet::default()
    };
    let tumble = tumble::tumble(args.seed, &sheet);
    let rows = logs::positions(&tumble);
    std::fs::create_dir_all(&args.out).map_err(|e| CliError::file(&args.out, e))?;
    let mut bytes = Vec::new();
    write_motions(&mut bytes, "motions", &rows, Layout::default()).map_err(|e| failed(&e))?;
    let truth = json!({
        "latitude_deg": sheet.latitude.to_degrees(), "scale": tumble.scale, "bias_mps2": tumble.bias,
        "misalignment_rad": tumble.misalignment, "rate_bias_radps": tumble.rate_bias,
    });
    for (name, bytes) in [
        (format!("positions-{}.txt", args.seed), bytes),
        (
            format!("positions-{}.truth.json", args.seed),
            format!("{truth:#}\n").into_bytes(),
        ),
    ] {
        let path = args.out.join(name);
        write_file(&path, &bytes)?;
        print(&format!("{}\n", path.display()))?;
    }
    Ok(SOUND)
}

fn experiment(args: &ExperimentArgs) -> Result<u8, CliError> {
    let sheet = BoxSheet::default();
    let jobs: Vec<u64> = (args.seeds.first..=args.seeds.last).collect();
    let threads = std::thread::available_parallelism().map_or(2, usize::from);
    let mut all: Vec<Outcome> = Vec::new();
    for result in workers::run(
        &jobs,
        threads,
        |seed| experiments::run(*seed, &sheet, &Experiment::ALL),
        |done| {
            complain("drives", &format!("{done} of {}", jobs.len()));
        },
    ) {
        all.extend(result.map_err(|e| failed(&e))?);
    }
    let mut text = String::from(
        "Largest deviation of a window from the truth, mean over the windows, m.\n\
         cold: from the start that the published program has. ours: with a fix each second until the window begins, and\n\
         told the heading there, as the published filter is. alone: the same with its own heading.\n\n\
         experiment                        windows  S00  published  mended   cold  alone   ours  smoothed  inside 95 %\n",
    );
    let mut rows = Vec::new();
    for experiment in Experiment::ALL {
        let of: Vec<&Outcome> = all.iter().filter(|o| o.experiment == experiment).collect();
        let n = real(of.len().max(1));
        let mean = |f: fn(&Outcome) -> f64| of.iter().map(|o| f(o)).sum::<f64>() / n;
        let [seconds, held] = [0, 1].map(|i| of.iter().map(|o| o.inside[i]).sum::<usize>());
        let inside = real(held) / real(seconds.max(1));
        let [published, mended] = [mean(|o| o.published_m[0]), mean(|o| o.published_m[1])];
        let (cold, alone, ours, smoothed) = (
            mean(|o| o.cold_m),
            mean(|o| o.alone_m),
            mean(|o| o.ours_m),
            mean(|o| o.smoothed_m),
        );
        let source = experiment
            .source_m()
            .map_or_else(|| "-".to_owned(), |m| format!("{m:.0}"));
        let _ = writeln!(
            text,
            "{:32} {:8} {source:>4} {published:10.1} {mended:7.1} {cold:6.1} {alone:6.1} {ours:6.1} {smoothed:9.1} {:12.1}",
            experiment.name(),
            of.len(),
            100.0 * inside,
        );
        rows.push(json!({
            "experiment": experiment.name(), "windows": of.len(), "source_m": experiment.source_m(),
            "published_m": published, "published_mended_m": mended, "cold_m": cold, "alone_m": alone, "ours_m": ours,
            "smoothed_m": smoothed, "inside_95": inside,
        }));
    }
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).map_err(|e| CliError::file(out, e))?;
        let html = page::experiments(&all, [args.seeds.first, args.seeds.last]);
        write_file(&out.join("experiments.html"), html.as_bytes())?;
    }
    if args.json {
        print_json(&json!({ "seeds": [args.seeds.first, args.seeds.last], "rows": rows }))?;
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
