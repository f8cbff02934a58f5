//! The triggers' statistics as tables in Markdown: shares found, times, false triggers, each with its bound.

use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use schema::num::{real, real_i64};

use crate::graded::{self, CLASSES, RATES};
use crate::nuisance::events::Kind;
use crate::nuisance::{self, DRIVE_S};
use crate::statistics::{count_bound, quantile, share_bounds};
use crate::{pipeline, recordings};

/// First seed of the crashes; tuning used 1 to 100.
pub const CRASH_SEEDS: u64 = 81_001;
/// First seed of the closer look at the threshold.
pub const NEAR_SEEDS: u64 = 83_001;
/// First seed of the drives.
pub const DRIVE_SEEDS: u64 = 91_001;
/// Crashes at or above the threshold that are asked for.
pub const CRASHES: usize = 500;
/// The threshold, km/h.
pub const THRESHOLD_KMH: f64 = 8.0;
/// The larger crashes end here, km/h.
const MOST_KMH: f64 = 80.0;

/// Makes one thing a seed on two threads, in order of the seeds.
fn spread<T: Send>(seeds: std::ops::Range<u64>, make: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let (next, done) = (AtomicU64::new(seeds.start), Mutex::new(Vec::new()));
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                break;
            }
            let made = make(seed);
            done.lock().unwrap().push((seed, made));
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(work);
        scope.spawn(work);
    });
    let mut done = done.into_inner().unwrap();
    done.sort_by_key(|(seed, _)| *seed);
    done.into_iter().map(|(_, made)| made).collect()
}

/// The crashes of [`CRASHES`] sizes from [`THRESHOLD_KMH`] on, and those below that came between.
pub struct Crashes {
    /// At or above the threshold, in order of their seeds.
    pub above: Vec<graded::Outcome>,
    /// Below.
    pub below: Vec<graded::Outcome>,
    /// The last seed that was used.
    pub last_seed: u64,
}

/// Simulates and records them.
pub fn crashes(first: u64) -> Crashes {
    let (mut above, mut below, mut seed) = (Vec::new(), Vec::new(), first);
    let mut last_seed = first;
    while above.len() < CRASHES {
        let missing = schema::num::u64_of(CRASHES - above.len());
        for outcome in spread(seed..seed + missing + 1, |seed| {
            graded::run(seed, graded::SIZES)
        }) {
            if above.len() == CRASHES {
                break;
            }
            last_seed = outcome.seed;
            if outcome.size_kmh < THRESHOLD_KMH {
                below.push(outcome);
            } else if outcome.size_kmh <= MOST_KMH {
                above.push(outcome);
            }
        }
        seed += missing + 1;
    }
    Crashes {
        above,
        below,
        last_seed,
    }
}

/// A closer look at the threshold: so many crashes of sizes about it.
pub fn near(first: u64, count: u64) -> Vec<graded::Outcome> {
    spread(first..first + count, |seed| graded::run(seed, graded::NEAR))
}

/// The table of them.
pub fn near_table(near: &[graded::Outcome]) -> String {
    let mut text = "| true change of velocity in 150 ms | n | fire delta-V | 95 % interval |\n|---|---|---|---|\n".to_owned();
    for (low, high) in [
        (6.0, 7.0),
        (7.0, 7.5),
        (7.5, 7.75),
        (7.75, 8.0),
        (8.0, 8.25),
        (8.25, 8.5),
        (8.5, 9.0),
        (9.0, 10.0),
    ] {
        let rows: Vec<_> = near
            .iter()
            .filter(|c| (low..high).contains(&c.size_kmh))
            .collect();
        let fired = rows.iter().filter(|c| c.delta_v.is_some()).count();
        let (from, to) = share_bounds(fired, rows.len());
        writeln!(
            text,
            "| {low} to {high} km/h | {} | {} | {:.0} to {:.0} % |",
            rows.len(),
            percent(fired, rows.len()),
            100.0 * from,
            100.0 * to
        )
        .unwrap();
    }
    text
}

/// Drives of so many hours (whole drives).
pub fn drives(first: u64, hours: f64) -> nuisance::Outcome {
    let count = schema::num::u64_of(schema::num::round_usize((hours * 3600.0 / DRIVE_S).ceil()));
    let rules = nuisance::rules();
    let mut all = nuisance::Outcome::default();
    for outcome in spread(first..first + count, |seed| nuisance::drive(seed, &rules)) {
        all.merge(outcome);
    }
    all
}

/// The recordings of real drives with both triggers at their defaults: hours, and triggers where there was no crash.
pub struct Real {
    /// Name, hours, triggers, largest change of speed within 150 ms (km/h).
    pub drives: Vec<(&'static str, f64, usize, f64)>,
    /// Seconds from contact to the first trigger in the barrier test.
    pub barrier: Option<f64>,
}

/// Plays them; `None` (and a printed line) where they are not here.
pub fn real_drives() -> Option<Real> {
    const PEAK: &[(&str, &str)] = &[("peak_g = false", "peak_g = 50")];
    let mut real = Real {
        drives: Vec::new(),
        barrier: None,
    };
    for name in ["wid08", "wid02", "wid02-consumer", "rav4"] {
        let replayed = pipeline::record(
            &recordings::settings(name, PEAK),
            recordings::log(name)?,
            &[],
        );
        let fired = replayed
            .records
            .iter()
            .map(|record| record.triggers.len())
            .sum();
        let totals = replayed.outcome.totals;
        real.drives.push((
            name,
            real_i64(totals.span_ns) / 3.6e12,
            fired,
            totals.largest_delta_v * 3.6,
        ));
    }
    let settings = recordings::settings("nhtsa10146", &[]);
    let replayed = pipeline::record(&settings, recordings::log("nhtsa10146")?, &[]);
    real.barrier = replayed.records.first().map(|record| {
        let utc = record.triggers[0].monotonic_ns + record.header.clock.offset_ns;
        // The log begins at a full second, 60 s before the contact.
        real_i64(utc - 1_700_000_060_000_000_000) * 1e-9
    });
    Some(real)
}

fn percent(hits: usize, of: usize) -> String {
    format!("{:.1} %", 100.0 * real(hits) / real(of.max(1)))
}

fn crash_row(text: &mut String, name: &str, crashes: &[&graded::Outcome]) {
    let of = crashes.len();
    let count =
        |found: &dyn Fn(&graded::Outcome) -> bool| crashes.iter().filter(|c| found(c)).count();
    let either = count(&|c| c.either().is_some());
    let (low, high) = share_bounds(either, of);
    let times: Vec<f64> = crashes.iter().filter_map(|c| c.either()).collect();
    let time = if times.is_empty() {
        "-".to_owned()
    } else {
        format!(
            "{:.0}, {:.0}",
            1e3 * quantile(&times, 0.5),
            1e3 * quantile(&times, 0.95)
        )
    };
    writeln!(
        text,
        "| {name} | {of} | {} | {} | {} | {:.1} to {:.1} % | {time} |",
        percent(count(&|c| c.peak.is_some()), of),
        percent(count(&|c| c.delta_v.is_some()), of),
        percent(either, of),
        100.0 * low,
        100.0 * high
    )
    .unwrap();
}

/// The table of the crashes.
pub fn crash_table(crashes: &Crashes) -> String {
    let mut text = "| crashes | n | peak 50 g | delta-V 8 km/h | either | 95 % interval of it | contact to trigger, median and 95 % (ms) |\n\
        |---|---|---|---|---|---|---|\n"
        .to_owned();
    let all: Vec<&graded::Outcome> = crashes.above.iter().collect();
    let of = |keep: &dyn Fn(&graded::Outcome) -> bool| -> Vec<&graded::Outcome> {
        all.iter().copied().filter(|c| keep(c)).collect()
    };
    crash_row(&mut text, "**all, 8 to 80 km/h**", &all);
    for (low, high) in [(8.0, 10.0), (10.0, 25.0), (25.0, 80.1)] {
        let rows = of(&|c| (low..high).contains(&c.size_kmh));
        crash_row(&mut text, &format!("{low:.0} to {high:.0} km/h"), &rows);
    }
    for class in CLASSES {
        crash_row(&mut text, class.name(), &of(&|c| c.class == class));
    }
    for rate in RATES {
        let rows = of(&|c| c.imu_hz == rate && !c.small_range);
        crash_row(&mut text, &format!("{rate} Hz, range 80 g"), &rows);
    }
    crash_row(&mut text, "any rate, range 16 g", &of(&|c| c.small_range));
    crash_row(
        &mut text,
        "no wheel speeds",
        &of(&|c| !graded::has_wheels(c.seed)),
    );
    for (low, high) in [(2.0, 7.0), (7.0, 7.5), (7.5, 8.0)] {
        let rows: Vec<_> = crashes
            .below
            .iter()
            .filter(|c| (low..high).contains(&c.size_kmh))
            .collect();
        crash_row(
            &mut text,
            &format!("(below the threshold: {low} to {high} km/h)"),
            &rows,
        );
    }
    let missed: Vec<String> = crashes
        .above
        .iter()
        .filter(|c| c.either().is_none())
        .map(|c| {
            format!(
                "seed {} ({}, {:.2} km/h true, {:.2} seen)",
                c.seed, c.class, c.size_kmh, c.seen_kmh
            )
        })
        .collect();
    let missed = if missed.is_empty() {
        "none".to_owned()
    } else {
        missed.join(", ")
    };
    let small: Vec<f64> = crashes
        .above
        .iter()
        .chain(&crashes.below)
        .filter(|c| c.size_kmh < 25.0)
        .map(|c| c.seen_kmh - c.size_kmh)
        .collect();
    let hours: f64 = crashes
        .above
        .iter()
        .chain(&crashes.below)
        .map(|c| c.hours)
        .sum();
    let early = crashes
        .above
        .iter()
        .chain(&crashes.below)
        .map(|c| c.false_triggers.len())
        .sum::<usize>();
    writeln!(
        text,
        "\nMissed at or above 8 km/h: {missed}. Largest change of speed seen less the true one, below 25 km/h: median {:+.2}, 2.5 to \
         97.5 % {:+.2} to {:+.2} km/h. Before the contacts {hours:.1} h were driven: {early} false triggers. Seeds {} to {}.",
        quantile(&small, 0.5),
        quantile(&small, 0.025),
        quantile(&small, 0.975),
        crashes.above.iter().chain(&crashes.below).map(|c| c.seed).min().unwrap_or(0),
        crashes.last_seed
    )
    .unwrap();
    text
}

fn rate_row(text: &mut String, name: &str, hours: f64, fired: usize) {
    writeln!(
        text,
        "| {name} | {hours:.2} | {fired} | {:.0} | {:.0} |",
        1e3 * real(fired) / hours,
        1e3 * count_bound(fired) / hours
    )
    .unwrap();
}

/// The tables of the drives.
pub fn drive_table(drives: &nuisance::Outcome, real: Option<&Real>) -> String {
    let mut text = "| driving | hours | false triggers | per 1,000 h | fewer than, per 1,000 h (95 %) |\n|---|---|---|---|---|\n".to_owned();
    rate_row(&mut text, "simulated", drives.hours, drives.fired.len());
    if let Some(real) = real {
        let hours = real.drives.iter().map(|drive| drive.1).sum();
        rate_row(
            &mut text,
            "recordings of real drives",
            hours,
            real.drives.iter().map(|drive| drive.2).sum(),
        );
    }
    text.push_str("\n| met in the simulated hours | times |\n|---|---|\n");
    for kind in Kind::ALL {
        writeln!(
            text,
            "| {} | {} |",
            kind.name(),
            drives.met.get(&kind).copied().unwrap_or(0)
        )
        .unwrap();
    }
    writeln!(
        text,
        "\nLargest in 150 ms: true {:.2} km/h ({}); seen by the trigger {:.2} km/h ({}). Largest frame {:.1} g ({}).",
        drives.truth.value,
        drives.truth.near.join(", "),
        drives.seen.value,
        drives.seen.near.join(", "),
        drives.frame.value,
        drives.frame.near.join(", ")
    )
    .unwrap();
    for fired in &drives.fired {
        writeln!(
            text,
            "False trigger: seed {}, {:.2} s, {:?} {:.2}, near: {}",
            fired.seed,
            fired.t,
            fired.fired.kind,
            fired.fired.value,
            fired.near.join(", ")
        )
        .unwrap();
    }
    if let Some(real) = real {
        for (name, hours, fired, largest) in &real.drives {
            writeln!(
                text,
                "{name}: {:.1} s, {fired} triggers, largest {largest:.2} km/h in 150 ms.",
                hours * 3600.0
            )
            .unwrap();
        }
        if let Some(barrier) = real.barrier {
            writeln!(
                text,
                "nhtsa10146 (barrier, 57 km/h): trigger {:.0} ms after contact.",
                1e3 * barrier
            )
            .unwrap();
        }
    }
    text
}
