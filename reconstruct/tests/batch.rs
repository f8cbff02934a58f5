//! The batch solve against the fixed-interval sweep, dense algebra and another library's sparse factor.
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

use crash::Crash;
use nalgebra::{DMatrix, DVector};
use reconstruct::refined::states::{Cov, DIM, Row};
use reconstruct::refined::tape::Tape;
use reconstruct::simulate::Class;
use reconstruct::smooth::arrow::factor;
use reconstruct::smooth::problem::Problem;
use reconstruct::smooth::rts::{Adjoint, cross_covariance};

/// Means and covariances of every step by the sweep, in the order of the pass.
fn sweep(tape: &Tape) -> Vec<(Row, Cov, Adjoint)> {
    let mut out = Vec::new();
    let mut adjoint = Adjoint::last();
    for i in (0..tape.steps.len()).rev() {
        let p = &tape.steps[i].p;
        out.push((adjoint.errors(p), adjoint.whole(p), adjoint));
        adjoint.retreat(tape, i);
    }
    out.reverse();
    out
}

/// Largest difference of two covariances, each entry over the standard deviations of its row and column.
fn apart(a: &Cov, b: &Cov, states: std::ops::Range<usize>) -> f64 {
    let mut worst: f64 = 0.0;
    for i in states.clone() {
        for j in states.clone() {
            let scale = (a[(i, i)] * a[(j, j)]).sqrt();
            if scale > 0.0 {
                worst = worst.max((a[(i, j)] - b[(i, j)]).abs() / scale);
            }
        }
    }
    worst
}

#[test]
fn batch_meets_the_sweep_where_both_are_linear() {
    for (class, seed) in [
        (Class::Frontal, 11),
        (Class::Oblique, 12),
        (Class::Lights, 13),
        (Class::Double, 14),
        (Class::Drive, 15),
    ] {
        let passed = Crash::draw(class, seed, 30.0).pass();
        let tape = &passed.tape;
        let swept = sweep(tape);
        let solved = factor(&Problem::of_tape(tape)).unwrap();
        let means = solved.means();
        let (mut mean_off, mut cov_off) = (0.0_f64, 0.0_f64);
        let mut p_late = None;
        solved.covariances(|i, p| {
            let (mean, want, _) = &swept[i];
            for s in 0..DIM {
                mean_off = mean_off.max((means[i][s] - mean[s]).abs() / want[(s, s)].sqrt());
            }
            let off = apart(want, p, 0..DIM);
            if off > 1e-8 && cov_off < 1e-8 {
                for s in 0..DIM {
                    println!(
                        "stage {i} state {s}: rts {:.3e} batch {:.3e} filter {:.3e}",
                        want[(s, s)],
                        p[(s, s)],
                        tape.steps[i].p[(s, s)]
                    );
                }
            }
            cov_off = cov_off.max(off);
            if i == tape.steps.len() - 200 {
                p_late = Some(*p);
            }
        });
        let (late, early) = (tape.steps.len() - 200, tape.steps.len() - 260);
        let cross = solved.cross(early, late, &p_late.unwrap());
        let want = cross_covariance(tape, early, late, &swept[late].2);
        let mut cross_off: f64 = 0.0;
        for i in 0..DIM {
            for j in 0..DIM {
                let scale = (swept[early].1[(i, i)] * swept[late].1[(j, j)]).sqrt();
                cross_off = cross_off.max((cross[(i, j)] - want[(i, j)]).abs() / scale);
            }
        }
        println!(
            "{class} {seed}: {} epochs, mean {mean_off:.1e}, covariance {cov_off:.1e}, cross {cross_off:.1e} of the sd",
            tape.steps.len()
        );
        assert!(mean_off < 1e-8 && cov_off < 1e-8 && cross_off < 1e-8);
    }
}

/// Steps `from..to` of a tape as a tape of their own.
fn cut(tape: &Tape, from: usize, to: usize) -> Tape {
    let mut prior = tape.steps[from - 1].p;
    tape.steps[from].transition.unwrap().predict(&mut prior);
    let shift = tape.steps[from].measurements.start;
    let mut steps = tape.steps[from..to].to_vec();
    steps[0].transition = None;
    for step in &mut steps {
        step.measurements = step.measurements.start - shift..step.measurements.end - shift;
    }
    let end = steps.last().unwrap().measurements.end;
    Tape {
        prior,
        steps,
        linear: tape.linear[shift..shift + end].to_vec(),
    }
}

/// Joint mean and covariance of all errors by Gaussian conditioning on the whole stack.
fn dense(tape: &Tape) -> (DVector<f64>, DMatrix<f64>) {
    let n = tape.steps.len();
    let size = n * DIM;
    // Prior of the stack: x_i + c_i = Phi x_{i-1} + w.
    let mut mean = DVector::zeros(size);
    let mut p = DMatrix::zeros(size, size);
    let mut rows = Vec::new();
    for (i, step) in tape.steps.iter().enumerate() {
        let at = i * DIM;
        let mut after = Row::zeros();
        for z in tape.linear[step.measurements.clone()].iter().rev() {
            after += z.gain * z.residual;
            rows.push((at, z, after));
        }
        if let Some(transition) = &step.transition {
            let mut phi = Cov::zeros();
            for j in 0..DIM {
                let mut e = Row::zeros();
                e[j] = 1.0;
                phi.set_column(j, &transition.apply(&e));
            }
            let phi = DMatrix::from_column_slice(DIM, DIM, phi.as_slice());
            let mut q = Cov::zeros();
            transition.predict(&mut q);
            let m = &phi * mean.rows(at - DIM, DIM) - DVector::from_column_slice(after.as_slice());
            mean.rows_mut(at, DIM).copy_from(&m);
            let cross = &phi * p.view((at - DIM, 0), (DIM, at));
            p.view_mut((at, 0), (DIM, at)).copy_from(&cross);
            p.view_mut((0, at), (at, DIM)).copy_from(&cross.transpose());
            let own = &phi * p.view((at - DIM, at - DIM), (DIM, DIM)) * phi.transpose()
                + DMatrix::from_column_slice(DIM, DIM, q.as_slice());
            p.view_mut((at, at), (DIM, DIM)).copy_from(&own);
        } else {
            mean.rows_mut(at, DIM)
                .copy_from(&-DVector::from_column_slice(after.as_slice()));
            let prior = DMatrix::from_column_slice(DIM, DIM, tape.prior.as_slice());
            p.view_mut((at, at), (DIM, DIM)).copy_from(&prior);
        }
    }
    // residual = h (x + c_j) + n.
    for (at, z, after) in rows {
        let mut h = DVector::zeros(size);
        h.rows_mut(at, DIM)
            .copy_from(&DVector::from_column_slice(z.h.as_slice()));
        let ph = &p * &h;
        let s = h.dot(&ph) + z.r;
        let innovation = z.residual - z.h.dot(&after) - h.dot(&mean);
        mean += &ph * (innovation / s);
        p -= &ph * ph.transpose() / s;
    }
    (mean, p)
}

#[test]
fn sweep_and_batch_meet_dense_algebra() {
    let passed = Crash::draw(Class::Frontal, 21, 30.0).pass();
    let whole = &passed.tape;
    // Around the impact and its jump of the biases, and in the drive before it.
    let jump = whole
        .steps
        .iter()
        .position(|s| s.transition.is_some_and(|t| t.jump[0] > 0.0))
        .unwrap();
    for from in [jump - 4, whole.steps.len() - 300] {
        let tape = cut(whole, from, from + 12);
        let (mean, p) = dense(&tape);
        let swept = sweep(&tape);
        let solved = factor(&Problem::of_tape(&tape)).unwrap();
        let means = solved.means();
        let block = |i: usize, j: usize| Cov::from_fn(|r, c| p[(i * DIM + r, j * DIM + c)]);
        let mut p_batch = vec![Cov::zeros(); 12];
        solved.covariances(|i, p| p_batch[i] = *p);
        for i in 0..12 {
            let want = block(i, i);
            for s in 0..DIM {
                let sd = want[(s, s)].sqrt();
                let off = [means[i][s], swept[i].0[s]].map(|m| (m - mean[i * DIM + s]).abs() / sd);
                assert!(off[0] < 1e-8 && off[1] < 1e-8, "mean {i} {s}: {off:?}");
            }
            let off = [&p_batch[i], &swept[i].1].map(|p| apart(&want, p, 0..DIM));
            assert!(off[0] < 1e-8 && off[1] < 1e-8, "covariance {i}: {off:?}");
            assert!(
                apart(
                    &want,
                    &Cov::from(swept[i].2.covariance::<DIM>(&tape.steps[i].p)),
                    0..9
                ) < 1e-8
            );
        }
        for (early, late) in [(0, 11), (3, 7), (5, 6)] {
            let want = block(early, late);
            let found = [
                solved.cross(early, late, &p_batch[late]),
                cross_covariance(&tape, early, late, &swept[late].2),
            ];
            for m in found {
                for r in 0..DIM {
                    for c in 0..DIM {
                        let scale = (p[(early * DIM + r, early * DIM + r)]
                            * p[(late * DIM + c, late * DIM + c)])
                            .sqrt();
                        let off = (m[(r, c)] - want[(r, c)]).abs() / scale;
                        assert!(off < 1e-8, "{early} {late} {r} {c}: {off}");
                    }
                }
            }
        }
    }
}
