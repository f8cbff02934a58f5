//! The least-squares problem over all epochs: prior, steps and measurement rows about one trajectory.
//!
//! Errors `x_i` (31, signs of [`crate::refined::states`]) are about the trajectory's own point at each step of the pass
//! (last epoch first):
//!
//! ```text
//! x_0 + c_0 ~ N(0, P_0)
//! x_i + c_i = Phi_i x_{i-1} + w_i           w_i ~ N(0, Q_i)
//! residual_j = h_j x_i + n_j                 n_j ~ N(0, r_j / weight_j)
//! ```
//!
//! Calibration has no noise but at an impact, so its twenty constants are global: they make the arrow. About the tape of
//! the pass `c` is the sum of the corrections given ([`Problem::of_tape`]); about any other trajectory it is what one
//! mechanised step misses the next point by.

use nalgebra::{SMatrix, SVector};

use crate::error_model::STATES;
use crate::refined::states::{Cov, Row};
use crate::refined::tape::{Source, Tape};
use crate::refined::transition::Transition;

/// States of one epoch: nine of motion and the sideslip.
pub const LOCAL: usize = STATES + 1;
/// States that are one and the same in all epochs.
pub const GLOBAL: usize = crate::refined::states::DIM - LOCAL;

/// One measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// What it comes from.
    pub source: Source,
    /// Sensitivity.
    pub h: Row,
    /// Predicted minus measured about the trajectory's point.
    pub residual: f64,
    /// Variance of its noise.
    pub r: f64,
    /// Weight of the robust loss, 0 to 1.
    pub weight: f64,
}

impl Measured {
    /// One over the standard deviation it counts with.
    #[must_use]
    pub fn root_weight(&self) -> f64 {
        (self.weight / self.r).sqrt()
    }
}

/// One step of the pass.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Index of the epoch in recording order.
    pub k: usize,
    /// The way here from the step before (a later epoch); `None` for the first.
    pub transition: Option<Transition>,
    /// `c`.
    pub offset: Row,
    /// Its rows in [`Problem::rows`].
    pub rows: std::ops::Range<usize>,
    /// Limits that its noise is held to.
    pub bounds: Vec<Bound>,
}

/// `a . w = value` of a step's noise `w` (local states, not whitened), with a standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Sensitivity.
    pub a: SVector<f64, LOCAL>,
    /// What it is held to.
    pub value: f64,
    /// How closely.
    pub sd: f64,
}

/// The whole problem.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Covariance before the first measurement.
    pub prior: Cov,
    /// Steps in the order of the pass.
    pub stages: Vec<Stage>,
    /// Measurements in the order of the pass.
    pub rows: Vec<Measured>,
}

impl Problem {
    /// The problem the pass solved, exactly: the one whose solution is the fixed-interval smoother's.
    #[must_use]
    pub fn of_tape(tape: &Tape) -> Self {
        let mut rows = Vec::with_capacity(tape.linear.len());
        let mut stages = Vec::with_capacity(tape.steps.len());
        for step in &tape.steps {
            let mut offset = Row::zeros();
            let from = rows.len();
            for z in tape.linear[step.measurements.clone()].iter().rev() {
                offset += z.gain * z.residual;
                rows.push(Measured {
                    source: z.source,
                    h: z.h,
                    residual: z.residual - z.h.dot(&offset),
                    r: z.r,
                    weight: 1.0,
                });
            }
            rows[from..].reverse();
            stages.push(Stage {
                k: step.k,
                transition: step.transition,
                offset,
                rows: from..rows.len(),
                bounds: Vec::new(),
            });
        }
        Self {
            prior: tape.prior,
            stages,
            rows,
        }
    }
}

/// States of one epoch and then the global ones, from the order of [`crate::refined::states`].
pub(crate) fn ordered(x: &Row) -> Row {
    let mut out = Row::zeros();
    out.fixed_rows_mut::<STATES>(0)
        .copy_from(&x.fixed_rows::<STATES>(0));
    out[STATES] = x[STATES + GLOBAL];
    out.fixed_rows_mut::<GLOBAL>(LOCAL)
        .copy_from(&x.fixed_rows::<GLOBAL>(STATES));
    out
}

/// The inverse of [`ordered`].
pub(crate) fn unordered(x: &Row) -> Row {
    let mut out = Row::zeros();
    out.fixed_rows_mut::<STATES>(0)
        .copy_from(&x.fixed_rows::<STATES>(0));
    out[STATES + GLOBAL] = x[STATES];
    out.fixed_rows_mut::<GLOBAL>(STATES)
        .copy_from(&x.fixed_rows::<GLOBAL>(LOCAL));
    out
}

/// Noise of the local states as `L L' = Q`, lower; a state without noise has a column of zeros, so that nothing divides
/// by it: a car that stands keeps its place exactly.
#[must_use]
pub fn noise_root(transition: &Transition) -> SMatrix<f64, LOCAL, LOCAL> {
    let mut l = SMatrix::<f64, LOCAL, LOCAL>::zeros();
    l.fixed_view_mut::<STATES, STATES>(0, 0)
        .copy_from(&semi_root(&transition.q));
    l[(STATES, STATES)] = transition.q_slip.max(0.0).sqrt();
    l
}

/// Lower root of a covariance that may have zero variances.
#[must_use]
pub fn semi_root<const N: usize>(p: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let mut l = *p;
    for j in 0..N {
        let own = p[(j, j)];
        let pivot = l[(j, j)];
        let column: SVector<f64, N> = if own > 0.0 && pivot > 1e-14 * own {
            let root = pivot.sqrt();
            SVector::from_fn(|r, _| if r < j { 0.0 } else { l[(r, j)] / root })
        } else {
            SVector::zeros()
        };
        for c in j + 1..N {
            for r in c..N {
                l[(r, c)] -= column[r] * column[c];
            }
        }
        l.set_column(j, &column);
    }
    l
}

#[cfg(test)]
mod tests {
    use super::*;
    use schema::num::real;

    #[test]
    fn order_and_roots() {
        let x = Row::from_fn(|i, _| real(i));
        assert_eq!(unordered(&ordered(&x)), x);
        let a = SMatrix::<f64, 4, 4>::from_fn(|i, j| real(1 + 3 * i + 7 * j).sin());
        let mut p = a * a.transpose();
        let l = semi_root(&p);
        assert!((l * l.transpose() - p).norm() < 1e-14);
        p.row_mut(1).fill(0.0);
        p.column_mut(1).fill(0.0);
        let l = semi_root(&p);
        assert!((l * l.transpose() - p).norm() < 1e-14 && l.column(1).norm() < 1e-300);
    }
}
