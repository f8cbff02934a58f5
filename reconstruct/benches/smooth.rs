//! Cost of the refined pass and its smoothers beside a floor, in one run; and of the batch solve of a record.
//!
//! The floor: a plain dense 15-state filter and Rauch-Tung-Striebel sweep on nalgebra, two scalar updates an epoch, nothing else.
//! All run interleaved; the medians and their ratios are printed.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    missing_docs,
    reason = "a benchmark prints, reads the clock and fails by panicking"
)]

#[path = "../tests/support/crash.rs"]
mod crash;
#[path = "../tests/support/floor.rs"]
mod floor;

use std::hint::black_box;
use std::time::Instant;

use crash::Crash;
use floor::{clock, forward, rows, sweep};
use reconstruct::refined::pass::Given;
use reconstruct::refined::{self, Tuning};
use reconstruct::simulate::{Class, Scenario};
use reconstruct::smooth::Smoother;
use reconstruct::smooth::batch::solve;
use reconstruct::smooth::relinear::Ground;
use schema::num::real;

/// Median and least.
fn median(values: &mut [f64]) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[0]]
}

fn main() {
    // A record of 40 s: 30 s before the event and 10 s behind it.
    let mut crash = Crash::of(&Scenario::draw(Class::Oblique, 7), 30.0);
    crash.cut(4000);
    let setup = crash.setup();
    let n = crash.epochs.list.len();
    let tuning = Tuning::default();
    let rows = rows();
    let mut times: [Vec<f64>; 5] = [const { Vec::new() }; 5];
    let origin = Instant::now();
    let mut time = |at: usize, run: &mut dyn FnMut()| {
        let begin = clock(origin);
        run();
        times[at].push(clock(origin) - begin);
    };
    for _ in 0..15 {
        time(0, &mut || {
            black_box(sweep(&forward(n, black_box(&rows))));
        });
        for (at, smoother) in [
            (1, Smoother::None),
            (2, Smoother::Rts),
            (3, Smoother::Batch),
        ] {
            time(at, &mut || {
                black_box(refined::run(&setup, &crash.rest, &tuning, smoother).unwrap());
            });
        }
        let passed = crash.pass();
        let ground = Ground {
            given: Given {
                setup: &setup,
                rest: &crash.rest,
                tuning: &tuning,
                again: None,
                mounting: None,
            },
            passed: &passed,
        };
        time(4, &mut || {
            let solved = solve(&ground).unwrap();
            solved.factor.covariances(|_, p| {
                black_box(p);
            });
        });
    }
    let [floor, pass, rts, batch, solved] = times.map(|mut t| median(&mut t));
    println!("{n} epochs; medians (least of all rounds in brackets)");
    let epoch = |name: &str, [t, least]: [f64; 2]| {
        let us = |t: f64| t / real(n) * 1e6;
        println!(
            "{name:15} {:.1} ({:.1}) us an epoch, {:.2} of the floor",
            us(t),
            us(least),
            t / floor[0]
        );
    };
    epoch("floor", floor);
    epoch("pass", pass);
    epoch("pass and rts", rts);
    for (name, [t, least]) in [("pass and batch", batch), ("batch alone", solved)] {
        println!(
            "{name:15} {t:.3} ({least:.3}) s a record, {:.2} of the floor",
            t / floor[0]
        );
    }
}
