//! Cost of one inertial sample of the published GNSS filter, in one run: its chains, its dense form, and the floor of
//! the dense form, the product `phi P phi' + Q` of 15 x 15 alone.
//!
//! Interleaved, many rounds; medians. "filter" is predict and update of 8 rows, "whole" the loop with synchronisation,
//! stop detector, mechanisation, levelling, geographic coordinates and its output.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    missing_docs,
    reason = "a benchmark prints, reads the clock and fails by panicking"
)]

#[path = "../tests/support/gnss_drive.rs"]
mod gnss_drive;

use std::hint::black_box;
use std::time::Instant;

use gnss_drive::{Plan, drive};
use reconstruct::gnss::published::constants::{DT, Noise, Process};
use reconstruct::gnss::published::earth::Earth;
use reconstruct::gnss::published::matrices::{
    Cov, Estimator, H2_STATES, Row, State, p0, phi, q, r2_diagonal,
};
use reconstruct::gnss::published::{Chains, Dense, Engine, Options, Reading, Source, run};
use schema::num::real;

const STEPS: u32 = 4000;

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Seconds a step of predict and update.
fn filter<E: Estimator>(mut filter: E, rows: &[Row; 8]) -> f64 {
    let begin = Instant::now();
    for _ in 0..STEPS {
        filter.predict();
        filter.update(black_box(rows)).unwrap();
    }
    black_box(filter.x());
    black_box(filter.covariance());
    begin.elapsed().as_secs_f64() / f64::from(STEPS)
}

fn floor(phi: &Cov, q: &Cov) -> f64 {
    let begin = Instant::now();
    let mut p = p0();
    for _ in 0..STEPS {
        p = phi * p * phi.transpose() + black_box(q);
    }
    black_box(&p);
    begin.elapsed().as_secs_f64() / f64::from(STEPS)
}

fn main() {
    let phi = phi(DT, Source::Program);
    let q = q(&Process::of(Source::Program), DT, Reading::Published);
    let r = r2_diagonal(&Noise::of(Source::Program));
    let z = [3.0, -2.0, 1.0, 0.01, -0.02, 0.001, 0.002, 0.1];
    let rows = std::array::from_fn(|i| Row {
        state: H2_STATES[i],
        z: z[i],
        r: r[i],
    });
    let mut plan = Plan::town(Earth::of(Reading::Published));
    plan.legs = (0..8).flat_map(|_| plan.legs.clone()).collect();
    let drive = drive(&plan, 9);
    let options = Options::default();
    let dense = Options {
        engine: Engine::Dense,
        ..Options::default()
    };
    let whole = |options: &Options| {
        let begin = Instant::now();
        let steps = run(&drive.input, &drive.initial, options).unwrap();
        begin.elapsed().as_secs_f64() / real(black_box(steps).len())
    };
    let mut times: [Vec<f64>; 5] = std::array::from_fn(|_| Vec::new());
    for _ in 0..40 {
        times[0].push(floor(&phi, &q));
        let chains = Chains::new(State::zeros(), &p0(), &phi, &q).unwrap();
        times[1].push(filter(chains, &rows));
        times[2].push(filter(Dense::new(State::zeros(), p0(), phi, q), &rows));
        times[3].push(whole(&options));
        times[4].push(whole(&dense));
    }
    let names = [
        "floor of the dense form",
        "filter, chains",
        "filter, dense",
        "whole, chains",
        "whole, dense",
    ];
    for (name, times) in names.into_iter().zip(&mut times) {
        let seconds = median(times);
        println!(
            "{name:24} {:9.4} us a sample {:8.3} million a second",
            seconds * 1e6,
            1e-6 / seconds
        );
    }
}
