//! `reconstruct gnss run`: a drive from both logs of a box.

use std::fmt::Write;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use reconstruct::gnss::drive::Speed;
use reconstruct::gnss::forward::{self, Estimate, Start};
use reconstruct::gnss::logs;
use reconstruct::gnss::published::constants::{DT, GATE};
use reconstruct::gnss::published::{self, Initial, Options, SpeedAid, SpeedUse};
use reconstruct::gnss::read::{Read, Tolerance, read_fixes, read_motions};
use reconstruct::gnss::reference::{Reference, Second, compare};
use reconstruct::gnss::rows::{Fix, Motion};
use reconstruct::gnss::sheet::Sheet;
use reconstruct::gnss::smooth::smooth;
use reconstruct::gnss::stop::{Detector, ENTRY_S, EXIT_S};
use schema::num::real;
use serde_json::json;

use crate::cli::gnss::{SensorAxes, failed};
use crate::cli::{CliError, GAPS, SOUND, complain, print, write_file};

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Filter {
    /// Ours: error states on WGS 84
    Refined,
    /// That of S00, with its faults
    Published,
}

#[derive(Debug, clap::Args)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line"
)]
pub(crate) struct Args {
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
    /// Log of a reference receiver, in the format of the fixes and on the box's clock: the deviation from it goes into the
    /// summary
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Take the speed of the reference, once a second, as a speedometer [S00, 3.8]
    #[arg(long, requires = "reference")]
    exact_speed: bool,
    /// Skip lines that cannot be read, and count them
    #[arg(long)]
    skip_broken: bool,
    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
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

pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
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
    let reference = match &args.reference {
        Some(path) => {
            let read = read_fixes(open(path)?, &named(path), tolerance).map_err(|e| failed(&e))?;
            notes(path, &read);
            Reference::of_rows(&read.rows)
        }
        None => Reference::default(),
    };
    let speeds = if args.exact_speed {
        reference.speeds()
    } else {
        Vec::new()
    };
    let (track, used) = match args.filter {
        Filter::Refined => refined(args, &chosen_fixes, &chosen, speeds)?,
        Filter::Published => by_published(args, &chosen_fixes, &chosen, &speeds)?,
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
        "deviation": deviation(&compare(&track, &reference)),
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
    args: &Args,
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
    args: &Args,
    fixes: &[Fix],
    motions: &[Motion],
    speeds: Vec<Speed>,
) -> Result<(Vec<Estimate>, serde_json::Value), CliError> {
    let sheet = Sheet::default();
    let fixed = logs::fixes(fixes, args.latency, &sheet);
    let drive = logs::drive(motions, &args.axes.into(), fixed, speeds)
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
    args: &Args,
    fixes: &[Fix],
    motions: &[Motion],
    speeds: &[Speed],
) -> Result<(Vec<Estimate>, serde_json::Value), CliError> {
    let mut input = logs::published(motions, &args.axes.into(), fixes);
    let moving = input
        .fixes
        .iter()
        .position(|f| f.v_ned.norm() >= GATE)
        .ok_or_else(|| failed(&"fixes: expected one that moves at 3 m/s or more, found none"))?;
    input.fixes.drain(..moving);
    let latency = schema::num::round_usize(args.latency / DT);
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
            speeds: logs::speed_at_fixes(&input.fixes, speeds, args.latency),
            how: SpeedUse::Set,
        }),
        ..Options::default()
    };
    let steps = published::run(&input, &initial, &options).map_err(|e| failed(&e))?;
    let used = steps
        .iter()
        .filter(|s| s.used == published::Used::Gnss)
        .count();
    let track = logs::track(&steps, args.latency);
    Ok((track, json!({ "offered": input.fixes.len(), "used": used })))
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
