//! `reconstruct gnss analyse`: what the logs tell of receiver and sensors.

use std::path::{Path, PathBuf};

use reconstruct::gnss::analyse::{self, Logs, Settings, json, page, pictures, tables};
use reconstruct::gnss::read::Read;
use reconstruct::gnss::reference::Reference;
use reconstruct::gnss::rows::{Fix, Motion, Row};
use reconstruct::gnss::sheet::Sheet;
use reconstruct::gnss::{clocks, logs};
use reconstruct::report::svg;

use crate::cli::gnss::failed;
use crate::cli::gnss_logs::{self, Broken, Choice, listed};
use crate::cli::{CliError, GAPS, SOUND, complain, print, print_json, write_file};

#[derive(Debug, clap::Args)]
#[command(
    mut_arg("equipment", |a| a.help("Equipment to take; of the fixes all are taken otherwise")),
    mut_arg("axes", |a| a.help("Axes of the inertial sensors, for telling stops from driving; the figures are of the sensor's own axes")),
    mut_arg("latency", |a| a.help("Delay of the fixes behind the inertial samples, for telling stops from driving")),
    after_help = "Exit code 3: the logs have gaps or broken lines, a sensor came to the end of its range, a log that is there does not tell what it ought to, or the logs cannot be what they are taken for: units, axes, clocks."
)]
pub(crate) struct Args {
    /// Log of fixes, 35 columns
    #[arg(long, value_name = "FILE", required_unless_present = "motions")]
    fixes: Option<PathBuf>,
    /// Log of accelerations and rates, 14 columns
    #[arg(long, value_name = "FILE")]
    motions: Option<PathBuf>,
    /// Log of a reference receiver, in the format of the fixes; without it equipment 6 among the fixes
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    #[command(flatten)]
    choice: Choice,
    /// A span with the engine off, seconds of the box's clock; may be repeated
    #[arg(long, value_name = "FROM..TO", value_parser = span, allow_hyphen_values = true)]
    rest: Vec<[f64; 2]>,
    /// Latitude, where no fixes tell it: for gravity
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    latitude: Option<f64>,
    #[command(flatten)]
    broken: Broken,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Folder for analysis.json, analysis.html and the pictures; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// A span of two numbers.
fn span(text: &str) -> Result<[f64; 2], String> {
    let wrong = || format!("expected FROM..TO in seconds, TO after FROM, found {text}");
    let (from, to) = text.split_once("..").ok_or_else(wrong)?;
    match (from.trim().parse::<f64>(), to.trim().parse::<f64>()) {
        (Ok(from), Ok(to)) if from.is_finite() && to.is_finite() && from < to => Ok([from, to]),
        _ => Err(wrong()),
    }
}

/// Reads a log that was given and adds what there is to note of it.
fn load<T>(
    path: Option<&PathBuf>,
    read: impl Fn(&Path) -> Result<Read<T>, CliError>,
    notes: &mut Vec<String>,
) -> Result<Option<Read<T>>, CliError> {
    let Some(path) = path else {
        return Ok(None);
    };
    let log = read(path)?;
    let said = gnss_logs::notes(path, &log);
    notes.extend(said.iter().map(|n| format!("{}: {n}", path.display())));
    Ok(Some(log))
}

/// An empty choice from a log that is there is an error, with what there is.
fn some<T: Row>(read: &Read<T>, rows: usize, path: Option<&PathBuf>) -> Result<(), CliError> {
    if rows > 0 {
        return Ok(());
    }
    Err(failed(&format!(
        "{}: expected rows of the equipment, drive and leg chosen, found {}",
        path.map_or_else(String::new, |p| p.display().to_string()),
        listed(&read.legs())
    )))
}

fn check(args: &Args) -> Result<(), CliError> {
    args.choice.check()?;
    match args.latitude {
        Some(d) if !(d.is_finite() && d.abs() <= 90.0) => Err(failed(&format!(
            "--latitude: expected -90 to 90 degrees, found {d}"
        ))),
        _ => Ok(()),
    }
}

pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    check(args)?;
    let tolerance = args.broken.tolerance();
    let mut notes = Vec::new();
    let as_fixes = |path: &Path| gnss_logs::fixes(path, tolerance).map(|log| log.read);
    let fixes = load(args.fixes.as_ref(), as_fixes, &mut notes)?;
    let mut reference = load(args.reference.as_ref(), as_fixes, &mut notes)?;
    if let (Some(read), Some(path)) = (&mut reference, &args.reference) {
        args.choice.cut(&mut read.rows, |f| f.head.obu_s, path)?;
    }
    let as_motions = |path: &Path| gnss_logs::motions(path, tolerance).map(|log| log.read);
    let motions = load(args.motions.as_ref(), as_motions, &mut notes)?;
    let own = chosen_fixes(args, fixes.as_ref())?;
    let samples = chosen_motions(args, motions.as_ref())?;
    let reference_rows = reference.map_or_else(Vec::new, |r| r.rows);
    if let Some(said) = examined(args, &own, &samples, &reference_rows) {
        for note in &said {
            complain("note", note);
        }
        notes.extend(said);
    }
    let logs = Logs {
        fixes: &own,
        motions: &samples,
        reference: &reference_rows,
    };
    let analysis = analyse::analyse(
        &logs,
        &Settings {
            axes: args.choice.axes.into(),
            latency_s: args.choice.latency,
            rest: args.rest.clone(),
            latitude: args.latitude.map(f64::to_radians),
        },
    );
    let sections = tables::sections(&analysis);
    let mut value = json::json(&analysis);
    if let Some(object) = value.as_object_mut() {
        object.insert("notes".to_owned(), notes.clone().into());
    }
    if let Some(out) = &args.out {
        let files = [&args.fixes, &args.motions, &args.reference];
        let names: Vec<String> = files
            .iter()
            .filter_map(|p| p.as_ref().and_then(|p| p.file_name()))
            .map(|n| n.to_string_lossy().into_owned())
            .collect();
        let drawn = pictures::draw(&analysis);
        write(
            out,
            &value,
            &page::html(&sections, &drawn, &names, &notes),
            &drawn,
        )?;
    }
    if args.json {
        print_json(&value)?;
    } else {
        print(&tables::text(&sections))?;
    }
    Ok(if notes.is_empty() && !analysis.gaps(&logs) {
        SOUND
    } else {
        GAPS
    })
}

/// What speaks against the logs of a box being what they are taken for; `None` unless both are there, of one leg each.
fn examined(
    args: &Args,
    own: &[Fix],
    samples: &[(u64, Motion)],
    reference: &[Fix],
) -> Option<Vec<String>> {
    let motions: Vec<Motion> = samples.iter().map(|s| s.1).collect();
    let leg = motions.first()?.head.leg;
    let fixes: Vec<Fix> = own.iter().filter(|f| f.head.leg == leg).copied().collect();
    if fixes.is_empty() || motions.iter().any(|m| m.head.leg != leg) {
        return None;
    }
    let latency_s = args.choice.latency;
    let fixed = logs::fixes(&fixes, latency_s, &Sheet::default());
    let axes = args.choice.axes.into();
    let drives = logs::drives(&motions, &axes, &fixed).ok()?;
    let mut said = gnss_logs::examined(&drives, &motions).notes();
    said.extend(clocks::delay_note(&fixes, &motions, latency_s));
    let mut marks = reference.to_vec();
    if marks.is_empty() {
        let beside = |f: &&Fix| f.head.leg.equipment == analyse::REFERENCE;
        marks = own.iter().filter(beside).copied().collect();
    }
    let marks = Reference::of_rows(&gnss_logs::of_reference(marks, leg));
    said.extend(clocks::reference_note(&fixed, &marks));
    Some(said)
}

/// Fixes of the equipment chosen, and those of the reference beside them.
fn chosen_fixes(args: &Args, fixes: Option<&Read<Fix>>) -> Result<Vec<Fix>, CliError> {
    let Some(read) = fixes else {
        return Ok(Vec::new());
    };
    let c = &args.choice;
    let mut own = read.select(c.equipment, c.drive, c.leg);
    some(read, own.len(), args.fixes.as_ref())?;
    if args.reference.is_none() && c.equipment.is_some_and(|e| e != analyse::REFERENCE) {
        own.extend(read.select(Some(analyse::REFERENCE), c.drive, c.leg));
    }
    if let Some(path) = &args.fixes {
        c.cut(&mut own, |f| f.head.obu_s - c.latency, path)?;
    }
    Ok(own)
}

/// Samples of the one equipment chosen: sensors of several boxes are not one.
fn chosen_motions(
    args: &Args,
    motions: Option<&Read<Motion>>,
) -> Result<Vec<(u64, Motion)>, CliError> {
    let Some(read) = motions else {
        return Ok(Vec::new());
    };
    let c = &args.choice;
    let mut samples = read.numbered(c.equipment, c.drive, c.leg);
    some(read, samples.len(), args.motions.as_ref())?;
    if let Some(path) = &args.motions {
        c.cut(&mut samples, |s| s.1.head.obu_s, path)?;
    }
    let first = samples.first().map(|s| s.1.head.leg.equipment);
    if samples
        .iter()
        .any(|s| Some(s.1.head.leg.equipment) != first)
    {
        return Err(failed(&format!(
            "{}: expected motions of one equipment (--equipment), found {}",
            args.motions
                .as_ref()
                .map_or_else(String::new, |p| p.display().to_string()),
            listed(&read.legs())
        )));
    }
    Ok(samples)
}

fn write(
    out: &Path,
    value: &serde_json::Value,
    page: &str,
    drawn: &[pictures::Picture],
) -> Result<(), CliError> {
    std::fs::create_dir_all(out).map_err(|e| CliError::file(out, e))?;
    write_file(
        &out.join("analysis.json"),
        format!("{value:#}\n").as_bytes(),
    )?;
    write_file(&out.join("analysis.html"), page.as_bytes())?;
    for picture in drawn {
        let path = out.join(format!("{}.svg", picture.name));
        write_file(&path, svg::file(&picture.svg).as_bytes())?;
    }
    complain("written", &out.join("analysis.html").display().to_string());
    Ok(())
}
