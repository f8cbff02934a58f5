//! `reconstruct validate`: the whole validation, on all cores.

use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;

use reconstruct::run::Model;
use reconstruct::simulate::Class;
use reconstruct::validate::fault_runs::{self, FaultPlan};
use reconstruct::validate::faults::Fault;
use reconstruct::validate::fixes::Window;
use reconstruct::validate::folder::{self, FolderPlan, Unused};
use reconstruct::validate::sets::{self, Plan};
use reconstruct::validate::{Settings, Validation, json, page, tabulate, text, workers};

use crate::cli::{CliError, GAPS, SOUND, print, print_json, run, write_file};

/// Arguments of `validate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Classes of simulated crashes, separated by commas: see `simulate --list`
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "CLASS,...",
        default_value = "frontal,oblique,side,rear,double,lights",
        value_parser = class
    )]
    classes: Vec<Class>,
    /// Seeds of each class, first and last
    #[arg(long, default_value = "70001..70170", value_name = "FIRST..LAST", value_parser = seeds)]
    seeds: Seeds,
    /// Model to validate; may be given several times
    #[arg(long = "model", default_values = ["refined", "nine-state"], value_name = "MODEL", value_parser = run::model)]
    models: Vec<Model>,
    /// Threads; as many as the machine has cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// No simulated crashes (only recordings, or only faults)
    #[arg(long)]
    no_simulated: bool,
    /// Crashes with a fault in each as well: locked wheels, dropouts, clipping, gaps, power cut, roof, wrong sheet
    #[arg(long)]
    faults: bool,
    /// Seeds of each fault, first and last
    #[arg(long, default_value = "80001..80125", value_name = "FIRST..LAST", value_parser = seeds)]
    fault_seeds: Seeds,
    /// Folder of recordings with truth: NAME.truth.csv beside NAME.svb, or beside NAME.log with NAME.toml; may be given
    /// several times
    #[arg(long = "folder", value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Folder of the recorder's configurations NAME.toml, where they do not lie beside the logs
    #[arg(long, value_name = "DIR")]
    configs: Option<PathBuf>,
    /// The recorder's program; the one beside this program if not given, else the one found by name
    #[arg(long, value_name = "PROGRAM")]
    recorder: Option<PathBuf>,
    /// Folder for validate.html and validate.json; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    show: Show,
}

/// What goes to standard output.
#[derive(Debug, clap::Args)]
struct Show {
    /// Print the tables by class and instant as well
    #[arg(long)]
    tables: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// First and last seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seeds {
    pub(crate) first: u64,
    pub(crate) last: u64,
}

/// Most crashes of one class in one run: the scores of all are held in memory.
const MOST_SEEDS: u64 = 10_000;

fn class(text: &str) -> Result<Class, String> {
    text.trim()
        .parse()
        .map_err(|error: reconstruct::simulate::SimulateError| error.to_string())
}

pub(crate) fn seeds(text: &str) -> Result<Seeds, String> {
    let fault = || format!("expected FIRST..LAST, such as 1..100, found {text:?}");
    let (first, last) = text.split_once("..").ok_or_else(fault)?;
    let number = |part: &str| part.trim().parse::<u64>().map_err(|_| fault());
    let (first, last) = (number(first)?, number(last)?);
    if first > last {
        return Err(format!(
            "expected the last seed not before the first, found {text:?}"
        ));
    }
    if last - first >= MOST_SEEDS {
        return Err(format!(
            "expected at most {MOST_SEEDS} seeds, found {}",
            last - first + 1
        ));
    }
    Ok(Seeds { first, last })
}

/// Runs the command; gives the exit code.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    if let Some(out) = &args.out {
        // Before minutes of work, not after.
        std::fs::create_dir_all(out).map_err(|error| CliError::file(out, error))?;
    }
    let models = once(&args.models);
    let threads = args.threads.map_or_else(workers::cores, usize::from);
    let plan = Plan {
        classes: if args.no_simulated {
            Vec::new()
        } else {
            once(&args.classes)
        },
        seeds: args.seeds.first..=args.seeds.last,
        models: models.clone(),
        threads,
        ideal: Some(&sets::told),
    };
    let mut progress = Progress::new("crashes");
    let cases = sets::run(&plan, |done, all| progress.show(done, all));
    let mut set = tabulate(&plan, &cases);
    let faults = if args.faults {
        let plan = FaultPlan {
            faults: Fault::ALL.to_vec(),
            seeds: args.fault_seeds.first..=args.fault_seeds.last,
            models: models.clone(),
            threads,
        };
        let mut progress = Progress::new("crashes with faults");
        let (faults, failures) = fault_runs::run(&plan, |done, all| progress.show(done, all));
        set.failures.extend(failures);
        faults
    } else {
        Vec::new()
    };
    let (windows, unused) = recordings(args, &models)?;
    let pair = |seeds: Seeds| [seeds.first, seeds.last];
    let validation = Validation {
        settings: Settings {
            classes: plan.classes.iter().map(|c| c.name()).collect(),
            seeds: pair(args.seeds),
            models: models.iter().map(|m| m.name()).collect(),
            fault_seeds: args.faults.then(|| pair(args.fault_seeds)),
            folders: args
                .folders
                .iter()
                .map(|f| f.display().to_string())
                .collect(),
        },
        set,
        faults,
        windows,
        unused,
    };
    let value = json::json(&validation);
    if let Some(out) = &args.out {
        write_file(
            &out.join("validate.json"),
            format!("{value:#}\n").as_bytes(),
        )?;
        write_file(
            &out.join("validate.html"),
            page::html(&validation).as_bytes(),
        )?;
    }
    if args.show.json {
        print_json(&value)?;
    } else {
        print(&text::summary(&validation))?;
        if args.show.tables {
            print(&text::screen(&validation.set))?;
        }
    }
    Ok(if validation.whole() { SOUND } else { GAPS })
}

/// Each once, in the order given.
fn once<T: Copy + PartialEq>(list: &[T]) -> Vec<T> {
    let mut out = Vec::new();
    for item in list {
        if !out.contains(item) {
            out.push(*item);
        }
    }
    out
}

fn recordings(args: &Args, models: &[Model]) -> Result<(Vec<Window>, Vec<Unused>), CliError> {
    if args.folders.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    for folder in args.folders.iter().chain(&args.configs) {
        std::fs::read_dir(folder).map_err(|error| CliError::file(folder, error))?;
    }
    let scratch = std::env::temp_dir().join(format!("svartboks-validate-{}", std::process::id()));
    std::fs::create_dir_all(&scratch).map_err(|error| CliError::file(&scratch, error))?;
    let plan = FolderPlan {
        folders: args.folders.clone(),
        configs: args.configs.clone(),
        recorder: args.recorder.clone().unwrap_or_else(recorder),
        scratch: scratch.clone(),
        models: models.to_vec(),
    };
    let result = folder::run(&plan, |name| {
        let _ = writeln!(io::stderr(), "recording {name}");
    });
    let _ = std::fs::remove_dir_all(&scratch);
    Ok(result)
}

/// The recorder beside this program, else by name alone.
fn recorder() -> PathBuf {
    let name = format!("recorder{}", std::env::consts::EXE_SUFFIX);
    std::env::current_exe()
        .ok()
        .map(|own| own.with_file_name(&name))
        .filter(|path| path.is_file())
        .unwrap_or_else(|| PathBuf::from(name))
}

/// One line on standard error: how many are done, at what rate, and how long the rest will take.
pub(crate) struct Progress {
    what: &'static str,
    start: std::time::Instant,
    shown_s: f64,
    terminal: bool,
}

impl Progress {
    pub(crate) fn new(what: &'static str) -> Self {
        Self {
            what,
            start: now(),
            shown_s: 0.0,
            terminal: io::stderr().is_terminal(),
        }
    }

    pub(crate) fn show(&mut self, done: usize, all: usize) {
        let elapsed = (now() - self.start).as_secs_f64();
        let due = if self.terminal { 0.2 } else { 10.0 };
        if done < all && elapsed - self.shown_s < due {
            return;
        }
        self.shown_s = elapsed;
        let line = line(self.what, done, all, elapsed);
        // A terminal's line is written over; a file gets one line each time.
        let _ = if self.terminal {
            let end = if done < all { "" } else { "\n" };
            write!(io::stderr(), "\r{line}\u{1b}[K{end}")
        } else {
            writeln!(io::stderr(), "{line}")
        };
    }
}

fn line(what: &str, done: usize, all: usize, elapsed_s: f64) -> String {
    let (done_, all_) = (schema::num::real(done), schema::num::real(all));
    let rate = done_ / elapsed_s.max(1e-3);
    let left = (all_ - done_) / rate.max(1e-9);
    let tail = if done < all {
        format!("about {left:.0} s left")
    } else {
        format!("{elapsed_s:.0} s")
    };
    format!("{done} of {all} {what}, {rate:.1} a second, {tail}")
}

#[allow(
    clippy::disallowed_methods,
    reason = "the rate of a progress line; no result hangs on it"
)]
fn now() -> std::time::Instant {
    std::time::Instant::now()
}

#[cfg(test)]
mod tests {
    use super::{Seeds, class, line, seeds};

    #[test]
    fn arguments() {
        assert_eq!(seeds("3..7").unwrap(), Seeds { first: 3, last: 7 });
        for wrong in [
            "",
            "3",
            "7..3",
            "a..b",
            "-1..4",
            "1..200000",
            "1..18446744073709551615",
        ] {
            assert!(seeds(wrong).is_err(), "{wrong}");
        }
        assert!(
            class("frontal").is_ok() && class("sideways").unwrap_err().contains("expected one")
        );
    }

    #[test]
    fn progress_tells_rate_and_time_left() {
        assert_eq!(
            line("crashes", 50, 150, 10.0),
            "50 of 150 crashes, 5.0 a second, about 20 s left"
        );
        assert_eq!(
            line("crashes", 4, 4, 2.0),
            "4 of 4 crashes, 2.0 a second, 2 s"
        );
    }
}
