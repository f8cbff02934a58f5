//! The logs that the commands of `reconstruct gnss` take: options, reading, and what is said of them.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use reconstruct::gnss::read::{Read, Tolerance, read_fixes, read_motions};
use reconstruct::gnss::reference::Reference;
use reconstruct::gnss::rows::{Fix, Leg, Motion, Row};

use crate::cli::gnss::{SensorAxes, failed};
use crate::cli::{CliError, complain};

/// Which rows of the logs are taken, and how their axes and times are read: options of every command that takes logs.
#[derive(Debug, clap::Args)]
pub(crate) struct Choice {
    /// Equipment to take, where the logs hold several
    #[arg(long, value_name = "ID")]
    pub(crate) equipment: Option<u32>,
    /// Drive to take
    #[arg(long, value_name = "ID")]
    pub(crate) drive: Option<u32>,
    /// Leg to take
    #[arg(long, value_name = "ID")]
    pub(crate) leg: Option<u32>,
    /// Axes of the inertial sensors
    #[arg(long, value_enum, default_value = "tag")]
    pub(crate) axes: SensorAxes,
    /// Delay of the fixes behind the inertial samples
    #[arg(long, default_value_t = 1.24, value_name = "SECONDS")]
    pub(crate) latency: f64,
}

impl Choice {
    pub(crate) fn check(&self) -> Result<(), CliError> {
        seconds("--latency", self.latency)
    }

    fn takes(&self, l: Leg) -> bool {
        let fits = |choice: Option<u32>, id: u32| choice.is_none_or(|c| c == id);
        fits(self.equipment, l.equipment) && fits(self.drive, l.drive) && fits(self.leg, l.leg)
    }
}

/// What to do with a line that cannot be read; an option of every command that takes logs.
#[derive(Debug, clap::Args)]
pub(crate) struct Broken {
    /// Skip lines that cannot be read, and count them
    #[arg(long)]
    skip_broken: bool,
}

impl Broken {
    pub(crate) fn tolerance(&self) -> Tolerance {
        if self.skip_broken {
            Tolerance::SkipBroken
        } else {
            Tolerance::Strict
        }
    }
}

#[derive(Debug, clap::Args)]
pub(crate) struct LogArgs {
    /// Log of fixes, 35 columns
    #[arg(long, value_name = "FILE")]
    pub(crate) fixes: PathBuf,
    /// Log of accelerations and rates, 14 columns
    #[arg(long, value_name = "FILE")]
    pub(crate) motions: PathBuf,
    #[command(flatten)]
    pub(crate) choice: Choice,
    /// Log of a reference receiver, in the format of the fixes and on the box's clock: the deviation from it goes into the
    /// summary, the page and the pictures
    #[arg(long, value_name = "FILE")]
    pub(crate) reference: Option<PathBuf>,
    #[command(flatten)]
    broken: Broken,
}

/// What was read.
pub(crate) struct Logs {
    pub(crate) fixes: Vec<Fix>,
    pub(crate) motions: Vec<Motion>,
    /// Without marks where none is given.
    pub(crate) reference: Reference,
    /// What is said of fixes, motions and reference.
    pub(crate) said: [Vec<String>; 3],
    /// What is said of them together.
    pub(crate) together: Vec<String>,
}

impl Logs {
    /// Notes what the logs say together; on standard error too.
    pub(crate) fn note(&mut self, notes: Vec<String>) {
        for note in &notes {
            complain("note", note);
        }
        self.together.extend(notes);
    }

    /// Nothing was noted.
    pub(crate) fn sound(&self) -> bool {
        self.said.iter().all(Vec::is_empty) && self.together.is_empty()
    }

    /// What is noted, with the file each is said of, for a page.
    pub(crate) fn notes(&self, args: &LogArgs) -> Vec<String> {
        let reference = args.reference.as_deref().unwrap_or(Path::new(""));
        [args.fixes.as_path(), &args.motions, reference]
            .into_iter()
            .zip(&self.said)
            .flat_map(|(path, said)| said.iter().map(move |n| format!("{}: {n}", name(path))))
            .chain(self.together.iter().cloned())
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

/// Reads a log of fixes.
pub(crate) fn fixes(path: &Path, tolerance: Tolerance) -> Result<Read<Fix>, CliError> {
    read_fixes(open(path)?, &path.display().to_string(), tolerance).map_err(|e| failed(&e))
}

/// Reads a log of accelerations and rates.
pub(crate) fn motions(path: &Path, tolerance: Tolerance) -> Result<Read<Motion>, CliError> {
    read_motions(open(path)?, &path.display().to_string(), tolerance).map_err(|e| failed(&e))
}

fn open(path: &Path) -> Result<BufReader<File>, CliError> {
    File::open(path)
        .map(BufReader::new)
        .map_err(|error| CliError::file(path, error))
}

/// What there is to note of a log; said on standard error too.
pub(crate) fn notes<T>(path: &Path, read: &Read<T>) -> Vec<String> {
    let notes: Vec<String> = read.notes.iter().map(ToString::to_string).collect();
    for note in &notes {
        complain("note", &format!("{}: {note}", path.display()));
    }
    notes
}

/// Legs in words, for an error.
pub(crate) fn listed(legs: &[(Leg, usize)]) -> String {
    let each = legs.iter().map(|(l, rows)| {
        format!(
            "equipment {} drive {} leg {} ({rows} rows)",
            l.equipment, l.drive, l.leg
        )
    });
    each.collect::<Vec<_>>().join(", ")
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
    let choice = &args.choice;
    choice.check()?;
    let tolerance = args.broken.tolerance();
    let all_fixes = fixes(&args.fixes, tolerance)?;
    let all_motions = motions(&args.motions, tolerance)?;
    let mut said = [
        notes(&args.fixes, &all_fixes),
        notes(&args.motions, &all_motions),
        Vec::new(),
    ];
    let chosen_fixes = all_fixes.select(choice.equipment, choice.drive, choice.leg);
    let chosen = all_motions.select(choice.equipment, choice.drive, choice.leg);
    one_leg(&all_fixes, chosen_fixes.len(), choice, &args.fixes)?;
    one_leg(&all_motions, chosen.len(), choice, &args.motions)?;
    let mut reference = Reference::default();
    if let Some(path) = &args.reference {
        let read = fixes(path, tolerance)?;
        said[2] = notes(path, &read);
        reference = Reference::of_rows(&read.rows);
    }
    Ok(Logs {
        fixes: chosen_fixes,
        motions: chosen,
        reference,
        said,
        together: Vec::new(),
    })
}

/// Several legs in one log are several drives on several clocks: one has to be chosen.
fn one_leg<T: Row>(
    read: &Read<T>,
    chosen: usize,
    choice: &Choice,
    path: &Path,
) -> Result<(), CliError> {
    let mut legs = read.legs();
    legs.retain(|(l, _)| choice.takes(*l));
    if legs.len() == 1 && chosen > 0 {
        return Ok(());
    }
    Err(failed(&format!(
        "{}: expected one leg (--equipment, --drive, --leg), found {}",
        path.display(),
        if legs.is_empty() {
            "none".to_owned()
        } else {
            listed(&legs)
        }
    )))
}
