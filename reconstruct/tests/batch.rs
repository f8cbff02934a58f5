//! The batch solve against the fixed-interval sweep, dense algebra and another library's sparse factor.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::disallowed_methods,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/crash.rs"]
mod crash;

use std::time::Instant;

use crash::Crash;
use faer::linalg::solvers::{Solve, SolveLstsq};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector, SMatrix};
use reconstruct::refined::states::{Cov, DIM, Row, SLIP};
use reconstruct::refined::tape::Tape;
use reconstruct::simulate::Class;
use reconstruct::smooth::arrow::factor;
use reconstruct::smooth::problem::{GLOBAL, LOCAL, Problem, noise_root};
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

/// The rows in states: ten of each step and the global constants, weighted; `(row, column, value)` and right-hand side.
/// Of a tape without impact and stand.
fn sparse_rows(tape: &Tape) -> (Vec<(usize, usize, f64)>, Vec<f64>, usize) {
    let n = tape.steps.len();
    let globals = n * LOCAL;
    let local = |j: usize| if j < 9 { j } else { SLIP };
    let (mut triplets, mut rhs) = (Vec::new(), Vec::new());
    let mut add = |entries: &[(usize, f64)], b: f64| {
        for (column, value) in entries.iter().filter(|e| e.1 != 0.0) {
            triplets.push((rhs.len(), *column, *value));
        }
        rhs.push(b);
    };
    // Constants are counted from the start of the pass: x_i = X - sum of the corrections so far.
    let mut given = Row::zeros();
    for (i, step) in tape.steps.iter().enumerate() {
        let mut c = Row::zeros();
        let mut measured = Vec::new();
        for z in tape.linear[step.measurements.clone()].iter().rev() {
            c += z.gain * z.residual;
            measured.push((z, c));
        }
        let before = given;
        given += c;
        for s in 9..SLIP {
            assert!(
                step.transition
                    .is_none_or(|t| t.jump.iter().all(|v| *v <= 0.0) && !t.stands())
                    && c[s].is_finite()
            );
        }
        let column = |i: usize, s: usize| match s {
            0..9 => i * LOCAL + s,
            SLIP => i * LOCAL + 9,
            _ => globals + s - 9,
        };
        if let Some(transition) = &step.transition {
            let root = noise_root(transition);
            let one = SMatrix::<f64, LOCAL, LOCAL>::identity();
            let whiten = root.solve_lower_triangular(&one).unwrap();
            let mut phi = Cov::zeros();
            for j in 0..DIM {
                let mut e = Row::zeros();
                e[j] = 1.0;
                phi.set_column(j, &transition.apply(&e));
            }
            for r in 0..LOCAL {
                let mut row = vec![0.0; DIM];
                let mut entries = Vec::new();
                let mut b = 0.0;
                for j in 0..=r {
                    let w = whiten[(r, j)];
                    entries.push((column(i, local(j)), w));
                    for s in 0..DIM {
                        row[s] -= w * phi[(local(j), s)];
                    }
                    b -= w * c[local(j)];
                }
                for s in 0..DIM {
                    entries.push((column(i - 1, s), row[s]));
                    if (9..SLIP).contains(&s) {
                        b += row[s] * before[s];
                    }
                }
                add(&entries, b);
            }
        } else {
            let whiten = tape.prior.cholesky().unwrap().l();
            let whiten = whiten.solve_lower_triangular(&Cov::identity()).unwrap();
            for r in 0..DIM {
                let entries: Vec<(usize, f64)> =
                    (0..=r).map(|s| (column(0, s), whiten[(r, s)])).collect();
                // The constants are X itself before the first correction.
                let b: f64 = (0..=r)
                    .filter(|s| !(9..SLIP).contains(s))
                    .map(|s| whiten[(r, s)] * c[s])
                    .sum();
                add(&entries, -b);
            }
        }
        for (z, after) in measured {
            let w = 1.0 / z.r.sqrt();
            let entries: Vec<(usize, f64)> = (0..DIM).map(|s| (column(i, s), z.h[s] * w)).collect();
            let known: f64 = (9..SLIP).map(|s| z.h[s] * given[s]).sum();
            add(&entries, w * (z.residual - z.h.dot(&after) + known));
        }
    }
    (triplets, rhs, globals + GLOBAL)
}

/// Another library's sparse QR on the same record in states instead of noises; and what its normal equations lose.
#[test]
fn batch_meets_a_sparse_factor_of_another_library() {
    let passed = Crash::draw(Class::Drive, 16, 30.0).pass();
    let tape = &passed.tape;
    let (triplets, rhs, columns) = sparse_rows(tape);
    let rows = rhs.len();
    let entries: Vec<Triplet<usize, usize, f64>> = triplets
        .iter()
        .map(|(r, c, v)| Triplet::new(*r, *c, *v))
        .collect();
    let a = SparseColMat::<usize, f64>::try_new_from_triplets(rows, columns, &entries).unwrap();
    let b = Mat::<f64>::from_fn(rows, 1, |i, _| rhs[i]);
    let solved = factor(&Problem::of_tape(tape)).unwrap();
    let means = solved.means();
    let mut sds = vec![[0.0; 9]; tape.steps.len()];
    solved.covariances(|i, p| sds[i] = std::array::from_fn(|s| p[(s, s)].sqrt()));
    let off = |x: &Mat<f64>| -> f64 {
        let mut worst: f64 = 0.0;
        for (i, mean) in means.iter().enumerate() {
            for s in 0..9 {
                worst = worst.max((x[(i * LOCAL + s, 0)] - mean[s]).abs() / sds[i][s]);
            }
        }
        worst
    };
    let begin = Instant::now();
    let qr = a.sp_qr().unwrap();
    let by_qr = qr.solve_lstsq(&b);
    let qr_s = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let transposed = a.transpose().to_col_major().unwrap();
    let normal = &transposed * &a;
    let llt = normal.sp_cholesky(Side::Lower);
    let by_llt = llt.as_ref().ok().map(|llt| llt.solve(&transposed * &b));
    let llt_s = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let own = factor(&Problem::of_tape(tape)).unwrap().means();
    let own_s = begin.elapsed().as_secs_f64();
    assert_eq!(own.len(), means.len());
    println!(
        "{} steps, {rows} rows: sparse QR {:.1e} sd off in {qr_s:.2} s, normal equations {} in {llt_s:.2} s, own {own_s:.2} s",
        tape.steps.len(),
        off(&by_qr),
        by_llt
            .as_ref()
            .map_or("not positive".to_owned(), |x| format!(
                "{:.1e} sd off",
                off(x)
            ))
    );
    assert!(off(&by_qr) < 1e-5);
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
            let found = vec![
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
