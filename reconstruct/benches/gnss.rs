//! Cost of one inertial sample of the published GNSS filter, in one run: its chains, its dense form, and the floor of
//! the dense form, the product `phi P phi' + Q` of 15 x 15 alone.
//!
//! Interleaved, many rounds; medians. "filter" is predict and update of 8 rows, "whole" the loop with synchronisation,
//! stop detector, mechanisation, levelling, geographic coordinates and its output.
//!
//! Then our filter and its sweep on a simulated town drive, beside the published filter on the same logs and a floor: a plain
//! dense 15-state filter and its Rauch-Tung-Striebel sweep, two scalar updates an epoch, nothing else.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    missing_docs,
    reason = "a benchmark prints, reads the clock and fails by panicking"
)]

#[path = "../tests/support/floor.rs"]
mod floor;
#[path = "../tests/support/gnss_drive.rs"]
mod gnss_drive;

use std::hint::black_box;
use std::time::Instant;

use gnss_drive::{Plan, drive};
use reconstruct::gnss::forward::{self, Start};
use reconstruct::gnss::logs::{self, Axes};
use reconstruct::gnss::published::constants::{DT, Noise, Process};
use reconstruct::gnss::published::earth::Earth;
use reconstruct::gnss::published::matrices::{
    Cov, Estimator, H2_STATES, Row, State, p0, phi, q, r2_diagonal,
};
use reconstruct::gnss::published::{Chains, Dense, Engine, Initial, Options, Reading, Source, run};
use reconstruct::gnss::sheet::Sheet;
use reconstruct::gnss::smooth;
use reconstruct::gnss::stop::{Detector, ENTRY_S, EXIT_S};
use reconstruct::simulate::city::{self, BoxSheet};
use schema::num::{real, round_usize};

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

fn product(phi: &Cov, q: &Cov) -> f64 {
    let begin = Instant::now();
    let mut p = p0();
    for _ in 0..STEPS {
        p = phi * p * phi.transpose() + black_box(q);
    }
    black_box(&p);
    begin.elapsed().as_secs_f64() / f64::from(STEPS)
}

fn main() {
    published();
    println!();
    ours();
}

/// Ours on a town drive of 200 s, 50 Hz, a fix a second.
fn ours() {
    let sheet = BoxSheet::default();
    let city = city::drive(90_001, 200.0, &sheet).unwrap();
    let axes = Axes::Car;
    let (fixes, motions, _) = logs::rows(&city, &sheet, &axes);
    let known = Sheet::default();
    let fixed = logs::fixes(&fixes, sheet.latency_s, &known);
    let drive = logs::drive(&motions, &axes, fixed, Vec::new()).unwrap();
    let found = Detector::default().detect(&drive);
    let standing = Detector::hindsight(&drive, &found, ENTRY_S, EXIT_S);
    let start = Start::at_first_course(&drive, &standing).unwrap();
    let known = known.heard(&drive, &found);
    let passed = forward::run(&drive, &standing, &known, &start).unwrap();
    let n = passed.estimates.len();
    // The published filter begins with a fix that moves, behind so many samples as it looks back on.
    let mut input = logs::published(&motions, &axes, &fixes);
    let lead = input.motions[0].t_s + sheet.latency_s + 60.0 * DT;
    input
        .fixes
        .retain(|f| f.t_s >= lead.max(drive.periods[start.first].t_s + sheet.latency_s));
    let initial = Initial::from_reference(&input.fixes[0], &input.fixes[0].v_ned);
    let options = Options {
        latency: round_usize(sheet.latency_s / DT),
        ..Options::default()
    };
    let steps = run(&input, &initial, &options).unwrap().len();
    let rows = floor::rows();
    let list = floor::forward(n, &rows);
    let origin = Instant::now();
    let mut times: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::new());
    // Short jobs are repeated: the system counts a thread's time in steps of milliseconds.
    let mut time = |at: usize, epochs: usize, again: usize, job: &mut dyn FnMut()| {
        let begin = floor::clock(origin);
        for _ in 0..again {
            job();
        }
        times[at].push((floor::clock(origin) - begin) / real(epochs * again));
    };
    for _ in 0..25 {
        time(0, n, 1, &mut || {
            black_box(floor::forward(n, black_box(&rows)));
        });
        time(1, n, 1, &mut || {
            black_box(floor::sweep(black_box(&list)));
        });
        time(2, steps, 20, &mut || {
            black_box(run(&input, &initial, &options).unwrap());
        });
        time(3, n, 20, &mut || {
            let found = Detector::default().detect(black_box(&drive));
            black_box(Detector::hindsight(&drive, &found, ENTRY_S, EXIT_S));
        });
        time(4, n, 1, &mut || {
            black_box(forward::run(&drive, &standing, &known, &start).unwrap());
        });
        time(5, n, 1, &mut || {
            black_box(smooth::run(&drive, &standing, &known, &start).unwrap());
        });
    }
    let [dense, swept, theirs, stops, forwards, both] = times.map(|mut t| median(&mut t));
    let back = both - forwards;
    println!("town drive, {n} epochs of ours, {steps} of the published filter");
    for (name, t, floor) in [
        ("floor forward", dense, dense),
        ("floor sweep", swept, swept),
        ("published, whole", theirs, dense),
        ("ours, stop detector", stops, dense),
        ("ours, forward", forwards, dense),
        ("ours, tape and sweep", back, swept),
        ("ours, all three", stops + both, dense + swept),
    ] {
        println!(
            "{name:24} {:9.4} us an epoch {:8.3} million a second, {:.2} of its floor, {:.2} of the published filter",
            t * 1e6,
            1e-6 / t,
            t / floor,
            t / theirs
        );
    }
}

fn published() {
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
        times[0].push(product(&phi, &q));
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
