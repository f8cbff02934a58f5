//! The logs that the commands of `reconstruct gnss` take: options, reading, and what is said of them.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use reconstruct::gnss::read::{Read, Tolerance, read_fixes, read_motions};
use reconstruct::gnss::reference::Reference;
use reconstruct::gnss::rows::{Fix, Motion};

use crate::cli::gnss::{SensorAxes, failed};
use crate::cli::{CliError, complain};

#[derive(Debug, clap::Args)]
pub(crate) struct LogArgs {
    /// Log of fixes, 35 columns
    #[arg(long, value_name = "FILE")]
    pub(crate) fixes: PathBuf,
    /// Log of accelerations and rates, 14 columns
    #[arg(long, value_name = "FILE")]
    pub(crate) motions: PathBuf,
    /// Equipment to take, where the logs hold several
    #[arg(long, value_name = "ID")]
    equipment: Option<u32>,
    /// Drive to take
    #[arg(long, value_name = "ID")]
    drive: Option<u32>,
    /// Leg to take
    #[arg(long, value_name = "ID")]
    leg: Option<u32>,
    /// Axes of the inertial sensors
    #[arg(long, value_enum, default_value = "tag")]
    pub(crate) axes: SensorAxes,
    /// Delay of the fixes behind the inertial samples
    #[arg(long, default_value_t = 1.24, value_name = "SECONDS")]
    pub(crate) latency: f64,
    /// Log of a reference receiver, in the format of the fixes and on the box's clock: the deviation from it goes into the
    /// summary, the page and the pictures
    #[arg(long, value_name = "FILE")]
    pub(crate) reference: Option<PathBuf>,
    /// Skip lines that cannot be read, and count them
    #[arg(long)]
    skip_broken: bool,
}

/// What was read.
pub(crate) struct Logs {
    pub(crate) fixes: Vec<Fix>,
    pub(crate) motions: Vec<Motion>,
    /// Without marks where none is given.
    pub(crate) reference: Reference,
    /// What is said of fixes, motions and reference.
    pub(crate) said: [Vec<String>; 3],
}

impl Logs {
    /// The same with the file each is said of, for a page.
    pub(crate) fn notes(&self, args: &LogArgs) -> Vec<String> {
        let reference = args.reference.as_deref().unwrap_or(Path::new(""));
        [args.fixes.as_path(), &args.motions, reference]
            .into_iter()
            .zip(&self.said)
            .flat_map(|(path, said)| said.iter().map(move |n| format!("{}: {n}", name(path))))
            .collect()
    }
}

/// Names of the files, for a page.
pub(crate) fn files(args: &LogArgs) -> String {
    let reference = args.reference.as_ref().map_or_else(
        || "no reference".to_owned(),
        |p| format!("reference {}", name(p)),
    );
    format!(
        "fixes {}, inertial samples {}, {reference}",
        name(&args.fixes),
        name(&args.motions)
    )
}

fn name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned())
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

/// A time among the options.
pub(crate) fn seconds(name: &str, value: f64) -> Result<(), CliError> {
    if value.is_finite() && (0.0..=3600.0).contains(&value) {
        return Ok(());
    }
    Err(failed(&format!(
        "{name}: expected 0 to 3600 s, found {value}"
    )))
}

pub(crate) fn read(args: &LogArgs) -> Result<Logs, CliError> {
    seconds("--latency", args.latency)?;
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
    let mut said = [
        notes(&args.fixes, &fixes),
        notes(&args.motions, &motions),
        Vec::new(),
    ];
    let chosen_fixes = fixes.select(args.equipment, args.drive, args.leg);
    let chosen = motions.select(args.equipment, args.drive, args.leg);
    one_leg(&fixes, chosen_fixes.len(), args, &args.fixes)?;
    one_leg(&motions, chosen.len(), args, &args.motions)?;
    let mut reference = Reference::default();
    if let Some(path) = &args.reference {
        let read = read_fixes(open(path)?, &named(path), tolerance).map_err(|e| failed(&e))?;
        said[2] = notes(path, &read);
        reference = Reference::of_rows(&read.rows);
    }
    Ok(Logs {
        fixes: chosen_fixes,
        motions: chosen,
        reference,
        said,
    })
}

/// Several legs in one log are several drives on several clocks: one has to be chosen.
fn one_leg<T: reconstruct::gnss::rows::Row>(
    read: &Read<T>,
    chosen: usize,
    args: &LogArgs,
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
