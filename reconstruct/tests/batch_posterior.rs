//! The batch smoother: linearised about its solution, sample paths, error budget.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/crash.rs"]
mod crash;

use crash::{Crash, with};
use nalgebra::{Matrix2, SMatrix, Vector2};
use reconstruct::refined::states::{Cov, DIM, Nominal, SLIP};
use reconstruct::refined::tape::{Source, Tape};
use reconstruct::simulate::Class;
use reconstruct::smooth::arrow::factor;
use reconstruct::smooth::batch::solve;
use reconstruct::smooth::budget::{Cause, budget};
use reconstruct::smooth::figures::figures;
use reconstruct::smooth::posterior::nine;
use reconstruct::smooth::problem::Problem;
use reconstruct::smooth::relinear::correction;
use reconstruct::smooth::rts;
use schema::num::real;

/// About the pass' own nominals the problem made from the samples is the one on the tape.
#[test]
fn rebuilt_problem_is_the_one_on_the_tape() {
    for (class, seed) in [(Class::Oblique, 31), (Class::Lights, 32)] {
        with(&Crash::draw(class, seed, 30.0), |ground| {
            let tape = &ground.passed.tape;
            let nominals: Vec<Nominal> = tape.steps.iter().map(|s| s.nominal).collect();
            let (rebuilt, taped) = (ground.problem(&nominals), Problem::of_tape(tape));
            assert_eq!(rebuilt.rows.len(), taped.rows.len());
            let (mut offset, mut row, mut slope) = (0.0_f64, 0.0_f64, 0.0_f64);
            for (i, (a, b)) in rebuilt.stages.iter().zip(&taped.stages).enumerate() {
                for s in 0..DIM {
                    let sd = tape.steps[i].p[(s, s)].sqrt();
                    offset = offset.max((a.offset[s] - b.offset[s]).abs() / sd);
                }
                let x =
                    nalgebra::SVector::<f64, DIM>::from_fn(|s, _| tape.steps[i].p[(s, s)].sqrt());
                if let (Some(a), Some(b)) = (&a.transition, &b.transition) {
                    let off = a.apply(&x) - b.apply(&x);
                    for s in 0..DIM {
                        slope = slope.max(off[s].abs() / tape.steps[i].p[(s, s)].sqrt());
                    }
                }
                for (a, b) in rebuilt.rows[a.rows.clone()]
                    .iter()
                    .zip(&taped.rows[b.rows.clone()])
                {
                    let off = (a.residual - b.residual).abs() / b.r.sqrt();
                    // Levelling at a stand corrects tilt, heading and bias at once: products of them show.
                    row = row.max(if b.source == Source::Levelling {
                        0.05 * off
                    } else {
                        off
                    });
                }
            }
            println!(
                "{class} {seed}: offset {offset:.1e}, rows {row:.1e}, steps {slope:.1e} of the sd"
            );
            // What is left is of second order in the corrections of one epoch.
            assert!(offset < 0.01 && row < 0.05 && slope < 1e-9);
        });
    }
}

/// Settles, and stays within a fraction of the spread of the sweep, which is linear about the filter.
#[test]
fn settles_near_the_sweep() {
    for (class, seed) in [
        (Class::Frontal, 41),
        (Class::Oblique, 42),
        (Class::Side, 43),
        (Class::Rear, 44),
        (Class::Double, 45),
        (Class::Lights, 46),
        (Class::Roof, 47),
        (Class::Drive, 48),
    ] {
        with(&Crash::draw(class, seed, 30.0), |ground| {
            let batch = solve(ground).unwrap();
            let swept = rts::means(&ground.passed.tape);
            let mut off = [0.0_f64; 3];
            batch.factor.covariances(|i, p| {
                let x = correction(&swept[i], &batch.trajectory[i]);
                for s in 0..9 {
                    // At rest the heading is zero by definition, far below what it is anywhere else.
                    off[s / 3] = off[s / 3].max(x[s].abs() / p[(s, s)].sqrt().max(1e-4));
                }
            });
            println!(
                "{class} {seed}: {} linearisations, step left {:.1e}, limits {:?}, outlying {:?}, off the sweep by {:.2} {:.2} {:.2} sd",
                batch.linearisations,
                batch.left,
                batch.limits,
                batch.outlying,
                off[0],
                off[1],
                off[2]
            );
            assert!(batch.linearisations <= 16 && batch.left < 0.01);
            // A spin and a second impact lie far from where the filter was linear.
            assert!(
                off.iter()
                    .all(|x| *x < if class == Class::Double { 4.0 } else { 1.5 })
            );
        });
    }
}

/// Against the truth: linearised about the solution the batch is no worse than the sweep.
#[test]
fn no_worse_than_the_sweep() {
    let mut squares = [[0.0_f64; 3]; 2];
    let mut count = 0.0;
    for class in [
        Class::Frontal,
        Class::Oblique,
        Class::Side,
        Class::Rear,
        Class::Double,
        Class::Lights,
    ] {
        for seed in 70..74 {
            let crash = Crash::draw(class, seed, 30.0);
            with(&crash, |ground| {
                let batch = solve(ground).unwrap();
                let swept = rts::means(&ground.passed.tape);
                let last = swept.len() - 1;
                let Some(pulse) = crash.motion.impacts.first() else {
                    return;
                };
                let before = batch
                    .problem
                    .stages
                    .iter()
                    .position(|s| s.k == pulse.before)
                    .unwrap();
                count += 1.0;
                for (sum, list) in squares.iter_mut().zip([&swept, &batch.trajectory]) {
                    let truth = crash.truth(batch.problem.stages[last].k);
                    let r = list[last].nav.r_n.v;
                    let place = (r.x - truth.position[0]).hypot(r.y - truth.position[1]);
                    let distance = truth.position[0].hypot(truth.position[1]).max(50.0);
                    sum[0] += (place / distance).powi(2);
                    let truth = crash.truth(pulse.before);
                    let v = list[before].nav.v_n.v;
                    let speed = v.norm() - truth.velocity.iter().map(|x| x * x).sum::<f64>().sqrt();
                    sum[1] += speed * speed;
                    let (_, _, heading) = list[before].nav.c_nb.euler();
                    let off = heading - truth.heading;
                    sum[2] += off.sin().powi(2);
                }
            });
        }
    }
    let [sweep, batch] = squares.map(|s| s.map(|x| (x / count).sqrt()));
    println!(
        "rms of {count} crashes, sweep and batch: place at the start {:.3} {:.3} %, impact speed {:.3} {:.3} m/s, heading at impact {:.3} {:.3} deg",
        100.0 * sweep[0],
        100.0 * batch[0],
        sweep[1],
        batch[1],
        sweep[2].to_degrees(),
        batch[2].to_degrees()
    );
    for (sweep, batch) in sweep.iter().zip(&batch) {
        assert!(*batch < 1.1 * sweep);
    }
}

/// Sample paths drawn.
const COUNT: usize = 400;

/// The same seed gives the same paths, and their spread is the posterior's.
#[test]
fn paths_have_the_joint_covariance() {
    with(&Crash::draw(Class::Oblique, 61, 20.0), |ground| {
        let batch = solve(ground).unwrap();
        let n = batch.trajectory.len();
        let paths = batch.paths(COUNT, 7);
        assert_eq!(paths[..3], batch.paths(3, 7)[..]);
        assert_ne!(paths[0], batch.paths(1, 8)[0]);
        // Paths are in recording order, stages in that of the pass.
        let place = |path: &Vec<[f64; 3]>, stage: usize| {
            let p = path[n - 1 - stage];
            Vector2::new(p[0], p[1])
        };
        let mean = |stage: usize| {
            let r = batch.trajectory[stage].nav.r_n.v;
            Vector2::new(r.x, r.y)
        };
        let sampled = |a: usize, b: usize| -> Matrix2<f64> {
            paths
                .iter()
                .map(|p| (place(p, a) - mean(a)) * (place(p, b) - mean(b)).transpose())
                .sum::<Matrix2<f64>>()
                / real(COUNT)
        };
        let mut covs = vec![Cov::zeros(); n];
        batch.factor.covariances(|i, p| covs[i] = *p);
        for (a, b) in [
            (n - 1, n - 1),
            (n / 2, n / 2),
            (n / 4, n / 4),
            (n / 2, n - 1),
            (n / 4, n / 2),
        ] {
            // Errors are estimate minus truth, paths are truth minus estimate: the covariance is the same.
            let want = batch.factor.cross(a, b, &covs[b]);
            let found = sampled(a, b);
            for r in 0..2 {
                for c in 0..2 {
                    let (va, vb) = (covs[a][(r, r)], covs[b][(c, c)]);
                    // Standard deviation of a sample covariance.
                    let noise = ((va * vb + want[(r, c)].powi(2)) / real(COUNT)).sqrt();
                    let off = (found[(r, c)] - want[(r, c)]).abs() / noise;
                    assert!(off < 4.5, "{a} {b} {r} {c}: {off} sd");
                }
            }
        }
    });
}

/// Variance of `a . x` of the last step of the pass with the gains kept and all sources off but those of `keep`.
fn with_gains_kept(
    tape: &Tape,
    a: &nalgebra::SVector<f64, DIM>,
    keep: impl Fn(Option<Source>, usize) -> bool,
) -> f64 {
    let mut p = Cov::zeros();
    for r in 0..DIM {
        for c in 0..DIM {
            if keep(None, r) && keep(None, c) {
                p[(r, c)] = tape.prior[(r, c)];
            }
        }
    }
    for step in &tape.steps {
        if let Some(transition) = &step.transition {
            let mut t = *transition;
            if !keep(None, 100) {
                t.q = SMatrix::zeros();
            }
            if !keep(None, SLIP) {
                t.q_slip = 0.0;
            }
            if !keep(None, 9) {
                t.jump[0] = 0.0;
            }
            if !keep(None, 19) {
                t.jump[1] = 0.0;
            }
            t.predict(&mut p);
        }
        for z in &tape.linear[step.measurements.clone()] {
            // Joseph's form holds for any gain.
            let hp = p.transpose() * z.h;
            let php = z.h.dot(&hp);
            let r = if keep(Some(z.source), 0) { z.r } else { 0.0 };
            p -= z.gain * hp.transpose() + hp * z.gain.transpose();
            p += z.gain * z.gain.transpose() * (php + r);
        }
    }
    a.dot(&(p * a))
}

#[test]
fn budget_adds_up_and_meets_sources_turned_off() {
    with(&Crash::draw(Class::Frontal, 62, 30.0), |ground| {
        let batch = solve(ground).unwrap();
        let mut nines = vec![SMatrix::<f64, 9, 9>::zeros(); batch.trajectory.len()];
        batch.factor.covariances(|i, p| nines[i] = nine(p));
        for b in batch.budgets(ground).unwrap() {
            let sum: f64 = b.shares.iter().map(|s| s.1).sum();
            let top: Vec<String> = b.shares[..5]
                .iter()
                .map(|(c, s)| format!("{} {:.1} %", c.name(), 100.0 * s))
                .collect();
            println!("{}: sd {:.4}: {}", b.figure, b.sd, top.join(", "));
            assert!((sum - 1.0).abs() < 1e-12);
        }
        for figure in figures(ground, &batch.problem, &batch.trajectory) {
            let sd = budget(
                ground,
                &batch.problem,
                &batch.factor,
                &batch.trajectory,
                &figure,
            )
            .unwrap()
            .sd;
            assert!((batch.factor.variance(&figure.terms).sqrt() / sd - 1.0).abs() < 1e-6);
            if let [(stage, a)] = figure.terms.as_slice() {
                let a = a.fixed_rows::<9>(0);
                let want = (a.transpose() * nines[*stage] * a)[0].sqrt();
                assert!(
                    (sd / want - 1.0).abs() < 1e-6,
                    "{}: {sd} {want}",
                    figure.name
                );
            }
        }
        // The tape's own problem: at the last step of the pass the gains are the filter's.
        let tape = &ground.passed.tape;
        let nominals: Vec<Nominal> = tape.steps.iter().map(|s| s.nominal).collect();
        let problem = Problem::of_tape(tape);
        let solved = factor(&problem).unwrap();
        let figure = figures(ground, &problem, &nominals)
            .into_iter()
            .find(|f| f.name == "position across the path at the start")
            .unwrap();
        let found = budget(ground, &problem, &solved, &nominals, &figure).unwrap();
        let a = figure.terms[0].1;
        let whole = with_gains_kept(tape, &a, |_, _| true);
        assert!((whole.sqrt() / found.sd - 1.0).abs() < 1e-6);
        let share = |causes: &[Cause]| -> f64 {
            found
                .shares
                .iter()
                .filter(|(c, _)| causes.contains(c))
                .map(|(_, s)| s)
                .sum()
        };
        // Sources, states of the prior (and jumps) off; 100 stands for the noise of the steps.
        let cases: [(&[Cause], Option<Source>, std::ops::Range<usize>); 10] = [
            (&[Cause::AccelBias], None, 9..12),
            (&[Cause::AccelScale], None, 12..15),
            (&[Cause::Mounting], None, 17..19),
            (&[Cause::GyroBias], None, 19..22),
            (&[Cause::WheelScale], None, 25..27),
            (&[Cause::TrackWidth], None, 29..30),
            (
                &[Cause::WheelNoise, Cause::Quantisation],
                Some(Source::Wheel),
                0..0,
            ),
            (&[Cause::RoadLimits], Some(Source::Road), 0..0),
            (&[Cause::Levelling], Some(Source::Levelling), 0..0),
            (&[Cause::NoJump], Some(Source::Jump), 0..0),
        ];
        for (causes, source, states) in cases {
            let left = with_gains_kept(tape, &a, |s, state| match s {
                Some(s) => Some(s) != source,
                None => !states.contains(&state),
            });
            let want = 1.0 - left / whole;
            assert!(
                (share(causes) - want).abs() < 1e-6,
                "{causes:?}: {} {want}",
                share(causes)
            );
        }
        // The gyro's scale owns the prior of its states and the bent part of the steps' noise.
        let left = with_gains_kept(tape, &a, |s, state| s.is_some() || state != 100);
        let noise = 1.0 - left / whole;
        let steps = share(&[
            Cause::AccelNoise,
            Cause::AccelVibration,
            Cause::GyroNoise,
            Cause::GyroVibration,
            Cause::GapsAndLimits,
        ]);
        assert!(
            noise >= steps - 1e-9
                && noise - steps < share(&[Cause::GyroScale]) + share(&[Cause::Rest]) + 1e-9
        );
    });
}
