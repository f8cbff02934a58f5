//! The floor that benchmarks of a filter and its sweep stand beside: a plain dense 15-state filter and Rauch-Tung-Striebel
//! sweep on nalgebra, two scalar updates an epoch, nothing else; and the clock they are timed by.
#![allow(
    clippy::unwrap_used,
    reason = "part of a benchmark, which fails by panicking"
)]

use std::time::Instant;

use nalgebra::{SMatrix, SVector};
use schema::num::real;

type M15 = SMatrix<f64, 15, 15>;

/// Time that this thread was on a core, s, where the system tells it: other work on the machine does not count.
pub(crate) fn clock(begin: Instant) -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let on_core = stat.split(' ').next().and_then(|ns| ns.parse::<f64>().ok());
    on_core.map_or_else(|| begin.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

/// Two rows that touch every state.
pub(crate) fn rows() -> [SVector<f64, 15>; 2] {
    [0.3_f64, -0.2].map(|s| SVector::from_fn(|i, _| s + 0.1 * real(i)))
}

fn transition() -> M15 {
    let mut f = M15::identity();
    for i in 0..6 {
        f[(i, i + 3)] = 0.01;
        f[(i, i + 9)] += 0.001;
    }
    f
}

/// Predicted and updated covariances of `n` epochs.
pub(crate) fn forward(n: usize, rows: &[SVector<f64, 15>; 2]) -> Vec<(M15, M15)> {
    let f = transition();
    let q = M15::identity() * 1e-6;
    let mut p = M15::identity();
    let mut list = Vec::with_capacity(n);
    for _ in 0..n {
        let predicted = f * p * f.transpose() + q;
        p = predicted;
        for row in rows {
            let s = p * row;
            let k = s / (row.dot(&s) + 0.01);
            p -= k * s.transpose();
        }
        list.push((predicted, p));
    }
    list
}

/// The sweep back over them.
pub(crate) fn sweep(list: &[(M15, M15)]) -> f64 {
    let f = transition();
    let mut smoothed = list[list.len() - 1].1;
    let mut sum = 0.0;
    for k in (0..list.len() - 1).rev() {
        let (predicted, filtered) = (list[k + 1].0, list[k].1);
        let gain = filtered * f.transpose() * predicted.cholesky().unwrap().inverse();
        smoothed = filtered + gain * (smoothed - predicted) * gain.transpose();
        sum += smoothed[(0, 0)];
    }
    sum
}
