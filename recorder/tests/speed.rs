//! From text to sealed records at half a million frames a second on one core.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::disallowed_methods,
    reason = "a measurement needs a clock"
)]

mod support;

use std::time::Instant;

use schema::num;
use support::{Log, run, settings};

#[test]
fn half_a_million_frames_a_second() {
    let mut log = Log::default();
    log.steady(0.0, 100.0, 1000.0, 0.0);
    let (text, settings) = (log.text(), settings(&[]));
    let mut rates: Vec<f64> = (0..3)
        .map(|_| {
            let start = Instant::now();
            let run = run(&settings, text.clone(), &[40.0]);
            assert_eq!(run.records.len(), 1);
            num::real_u64(run.outcome.totals.frames) / start.elapsed().as_secs_f64()
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    eprintln!(
        "{:.2} million frames a second (median of 3: {rates:.0?})",
        rates[1] / 1e6
    );
    // Unoptimised builds are no measure; they must only not be absurd.
    let floor = if cfg!(debug_assertions) { 5e4 } else { 5e5 };
    assert!(rates[1] >= floor, "{rates:?}");
}
