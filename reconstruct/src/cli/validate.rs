//! `reconstruct validate`: the whole validation, on all cores.

use std::io::{self, IsTerminal, Write};

use reconstruct::run::Model;
use reconstruct::simulate::Class;
use reconstruct::validate::sets::{self, Plan};
use reconstruct::validate::{tabulate, text, workers};

use crate::cli::{CliError, SOUND, print, run};

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
    #[arg(long = "model", default_value = "nine-state", value_name = "MODEL", value_parser = run::model)]
    models: Vec<Model>,
    /// Threads; as many as the machine has cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// First and last seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Seeds {
    first: u64,
    last: u64,
}

/// Most crashes of one class in one run: the scores of all are held in memory.
const MOST_SEEDS: u64 = 100_000;

fn class(text: &str) -> Result<Class, String> {
    text.trim()
        .parse()
        .map_err(|error: reconstruct::simulate::SimulateError| error.to_string())
}

fn seeds(text: &str) -> Result<Seeds, String> {
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
    let mut models = Vec::new();
    for model in &args.models {
        if !models.contains(model) {
            models.push(*model);
        }
    }
    let plan = Plan {
        classes: args.classes.clone(),
        seeds: args.seeds.first..=args.seeds.last,
        models,
        threads: args.threads.map_or_else(workers::cores, usize::from),
        ideal: None,
    };
    let mut progress = Progress::new("crashes");
    let cases = sets::run(&plan, |done, all| progress.show(done, all));
    let set = tabulate(&plan, &cases);
    print(&text::screen(&set))?;
    Ok(SOUND)
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
