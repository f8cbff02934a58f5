//! The logs that the commands of `reconstruct gnss` take: options, reading, and what is said of them.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use reconstruct::gnss::drive::{Drive, Fixed};
use reconstruct::gnss::read::{Read, Tolerance, read_fixes, read_motions};
use reconstruct::gnss::reference::Reference;
use reconstruct::gnss::rows::{Fix, Leg, Motion, Row};
use reconstruct::gnss::{GnssError, analyse, clocks, plausible};

use schema::seal::Hex;
use sha2::{Digest, Sha256};

use crate::cli::gnss::{SensorAxes, failed};
use crate::cli::gnss_told::Taken;
use crate::cli::{CliError, complain};

/// For the help of the commands that reckon.
pub(crate) const EXIT_CODES: &str = "Exit codes: 0 sound, 1 failed, 2 usage, 3 finished with notes: gaps or broken lines, or logs that cannot be what they are taken for.";

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
    /// Leave out what is before, seconds of the box's clock
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) from: Option<f64>,
    /// Leave out what is after, seconds of the box's clock
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) to: Option<f64>,
    /// Axes of the inertial sensors
    #[arg(long, value_enum, default_value = "tag")]
    pub(crate) axes: SensorAxes,
    /// Delay of the fixes behind the inertial samples
    #[arg(long, default_value_t = 1.24, value_name = "SECONDS")]
    pub(crate) latency: f64,
}

impl Choice {
    pub(crate) fn check(&self) -> Result<(), CliError> {
        let [from, to] = self.span();
        if from.is_nan() || to.is_nan() || from >= to {
            return Err(failed(&format!(
                "--from, --to: expected seconds, the second after the first, found {from} and {to}"
            )));
        }
        seconds("--latency", self.latency)
    }

    /// What is taken, s of the box's clock.
    fn span(&self) -> [f64; 2] {
        [
            self.from.unwrap_or(f64::NEG_INFINITY),
            self.to.unwrap_or(f64::INFINITY),
        ]
    }

    /// Leaves out the rows before and after, whose stamps are so late, s.
    ///
    /// # Errors
    /// If rows were there and none is left.
    pub(crate) fn cut<T>(
        &self,
        rows: &mut Vec<T>,
        stamp_s: impl Fn(&T) -> f64,
        path: &Path,
    ) -> Result<(), CliError> {
        let [from, to] = self.span();
        let [mut first, mut last] = [f64::INFINITY, f64::NEG_INFINITY];
        for t in rows.iter().map(&stamp_s) {
            (first, last) = (first.min(t), last.max(t));
        }
        rows.retain(|row| (from..=to).contains(&stamp_s(row)));
        if rows.is_empty() && first <= last {
            let end = |bound: Option<f64>, open: &str| {
                bound.map_or_else(|| open.to_owned(), |s| format!("{s} s"))
            };
            return Err(failed(&format!(
                "{}: expected rows from {} to {} (--from, --to), found rows from {first:.3} to {last:.3} s",
                path.display(),
                end(self.from, "the begin"),
                end(self.to, "the end")
            )));
        }
        Ok(())
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

impl LogArgs {
    pub(crate) fn skips_broken(&self) -> bool {
        self.broken.skip_broken
    }
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
    /// The files and what was taken of them.
    pub(crate) taken: Vec<Taken>,
}

impl Logs {
    /// Notes what the logs say together; on standard error too.
    pub(crate) fn note(&mut self, notes: Vec<String>) {
        for note in &notes {
            complain("note", note);
        }
        self.together.extend(notes);
    }

    /// Looks whether the logs can be what they are taken for, and notes what speaks against it. Drives and `fixes` are all there
    /// are; axes and units are looked at in the longest drive.
    pub(crate) fn examine(
        &mut self,
        drives: &[Drive],
        fixes: &[Fixed],
        latency_s: f64,
    ) -> plausible::Found {
        let found = examined(drives, &self.motions);
        let mut notes = found.notes();
        notes.extend(clocks::delay_note(&self.fixes, &self.motions, latency_s));
        notes.extend(clocks::reference_note(fixes, &self.reference));
        self.note(notes);
        found
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

/// The longest of the drives of some rows beside its rows: can they be what they are taken for?
pub(crate) fn examined(drives: &[Drive], motions: &[Motion]) -> plausible::Found {
    let length = |d: &&Drive| d.span().map_or(0.0, |[from, to]| to - from);
    let longest = drives.iter().max_by(|a, b| length(a).total_cmp(&length(b)));
    let drive = longest.cloned().unwrap_or_default();
    let [from, to] = drive.span().unwrap_or_default();
    let within = |m: &&Motion| m.head.obu_s > from - 1e-6 && m.head.obu_s < to + 1e-6;
    let rows: Vec<Motion> = motions.iter().filter(within).copied().collect();
    plausible::look(&drive, &rows)
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

/// A log and the digest of its bytes.
pub(crate) struct Log<T> {
    pub(crate) read: Read<T>,
    sha256: String,
}

impl<T> Log<T> {
    fn taken(&self, what: &'static str, path: &Path, rows: usize, leg: Option<Leg>) -> Taken {
        Taken {
            what,
            file: name(path),
            sha256: self.sha256.clone(),
            rows,
            leg,
        }
    }
}

/// Reads a log of fixes.
pub(crate) fn fixes(path: &Path, tolerance: Tolerance) -> Result<Log<Fix>, CliError> {
    log(path, |input, name| read_fixes(input, name, tolerance))
}

/// Reads a log of accelerations and rates.
pub(crate) fn motions(path: &Path, tolerance: Tolerance) -> Result<Log<Motion>, CliError> {
    log(path, |input, name| read_motions(input, name, tolerance))
}

/// A file, and the digest of what was read of it.
struct Hashed {
    file: File,
    hash: Sha256,
}

impl io::Read for Hashed {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.file.read(buffer)?;
        self.hash.update(&buffer[..n]);
        Ok(n)
    }
}

fn log<T>(
    path: &Path,
    read: impl Fn(&mut BufReader<Hashed>, &str) -> Result<Read<T>, GnssError>,
) -> Result<Log<T>, CliError> {
    let wrong = |error| CliError::file(path, error);
    let hashed = Hashed {
        file: File::open(path).map_err(wrong)?,
        hash: Sha256::new(),
    };
    let mut input = BufReader::new(hashed);
    let read = read(&mut input, &path.display().to_string()).map_err(|e| failed(&e))?;
    io::copy(&mut input, &mut io::sink()).map_err(wrong)?;
    let digest = input.into_inner().hash.finalize();
    let sha256 = Hex(&digest).to_string();
    Ok(Log { read, sha256 })
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
    let each = legs
        .iter()
        .map(|(l, rows)| format!("{} ({rows} rows)", ids(*l)));
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
        notes(&args.fixes, &all_fixes.read),
        notes(&args.motions, &all_motions.read),
        Vec::new(),
    ];
    let ids = (choice.equipment, choice.drive, choice.leg);
    let mut chosen_fixes = all_fixes.read.select(ids.0, ids.1, ids.2);
    let mut chosen = all_motions.read.select(ids.0, ids.1, ids.2);
    one_leg(&all_fixes.read, chosen_fixes.len(), choice, &args.fixes)?;
    one_leg(&all_motions.read, chosen.len(), choice, &args.motions)?;
    let true_at = |f: &Fix| f.head.obu_s - choice.latency;
    choice.cut(&mut chosen_fixes, true_at, &args.fixes)?;
    choice.cut(&mut chosen, |m| m.head.obu_s, &args.motions)?;
    let leg = chosen_fixes.first().map(|f| f.head.leg);
    let moved = chosen.first().map(|m| m.head.leg);
    let mut taken = vec![
        all_fixes.taken("fixes", &args.fixes, chosen_fixes.len(), leg),
        all_motions.taken("motions", &args.motions, chosen.len(), moved),
    ];
    let mut together: Vec<String> = Vec::new();
    // The reference receiver has no inertial samples of its own: those of any box.
    let lent = leg.is_some_and(|l| l.equipment == analyse::REFERENCE);
    let of = moved.zip(leg).map(|(m, l)| Leg {
        equipment: if lent { l.equipment } else { m.equipment },
        ..m
    });
    together.extend(strangers("motions", leg, of));
    let mut reference = Reference::default();
    if let (Some(path), Some(leg)) = (&args.reference, leg) {
        let log = fixes(path, tolerance)?;
        said[2] = notes(path, &log.read);
        let rows = reference_rows(&log.read, choice, leg, path)?;
        let found = rows.first().map(|f| f.head.leg);
        taken.push(log.taken("reference", path, rows.len(), found));
        // A reference is of an equipment of its own.
        let own = found.map(|l| Leg {
            equipment: leg.equipment,
            ..l
        });
        together.extend(strangers("reference", Some(leg), own));
        reference = Reference::of_rows(&rows);
    }
    let mut logs = Logs {
        fixes: chosen_fixes,
        motions: chosen,
        reference,
        said,
        together: Vec::new(),
        taken,
    };
    logs.note(together);
    Ok(logs)
}

fn ids(l: Leg) -> String {
    format!("equipment {} drive {} leg {}", l.equipment, l.drive, l.leg)
}

/// What there is to note where another log is not of the fixes' equipment, drive and leg.
fn strangers(what: &str, fixes: Option<Leg>, other: Option<Leg>) -> Option<String> {
    let (fixes, other) = (fixes?, other?);
    (fixes != other).then(|| {
        format!(
            "{what}: expected those of the fixes' {}, found {}",
            ids(fixes),
            ids(other)
        )
    })
}

/// Rows of a reference: of the drive and leg chosen, or, where it holds several, of those of the fixes; of its equipments the
/// reference receiver.
fn reference_rows(
    read: &Read<Fix>,
    choice: &Choice,
    fixes: Leg,
    path: &Path,
) -> Result<Vec<Fix>, CliError> {
    let rows = of_reference(read.select(None, choice.drive, choice.leg), fixes);
    if rows.is_empty() {
        return Err(failed(&format!(
            "{}: expected a reference of equipment {}, drive {} and leg {}, found {}",
            path.display(),
            analyse::REFERENCE,
            choice.drive.unwrap_or(fixes.drive),
            choice.leg.unwrap_or(fixes.leg),
            listed(&read.legs())
        )));
    }
    Ok(rows)
}

/// Of rows of several equipments those of the reference receiver, of several drives or legs those of the fixes.
pub(crate) fn of_reference(mut rows: Vec<Fix>, fixes: Leg) -> Vec<Fix> {
    let narrow = |rows: &mut Vec<Fix>, of: &dyn Fn(Leg) -> u32, wanted: u32| {
        let first = rows.first().map(|f| of(f.head.leg));
        if rows.iter().any(|f| Some(of(f.head.leg)) != first) {
            rows.retain(|f| of(f.head.leg) == wanted);
        }
    };
    narrow(&mut rows, &|l| l.equipment, analyse::REFERENCE);
    narrow(&mut rows, &|l| l.drive, fixes.drive);
    narrow(&mut rows, &|l| l.leg, fixes.leg);
    rows
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
