//! Smoothers over the tape of a backward pass: every epoch from all data.
//!
//! The pass runs from rest to the beginning of the record, so its last epoch (the earliest) knows everything already; the
//! sweep back brings what was learnt late - calibration from the drive before the crash - to the crash itself.
//!
//! [`rts`] is that sweep, linear about the filter's path. [`batch`] solves all epochs at once, linear about its own solution:
//! the same figures where the attitude is known to some milliradians, and honest ones where it is not (a gap, a gyro at its
//! limit), where the filter learns from its own changes of mind. [`arrow`] is its factor, from which the covariances and the
//! influence of every row follow ([`posterior`]), and so sample paths and the error budget ([`budget`], [`figures`]).

pub mod arrow;
pub mod batch;
pub mod budget;
pub mod figures;
pub mod limits;
pub mod posterior;
pub mod problem;
pub mod relinear;
pub mod rts;
pub(crate) mod sample;

use nalgebra::SMatrix;

/// Which smoother runs behind the refined filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Smoother {
    /// Fixed-interval sweep.
    #[default]
    Rts,
    /// All epochs at once, linearised about the solution, with robust losses and limits.
    Batch,
    /// The filter's own answer.
    None,
}

impl Smoother {
    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rts => "rts",
            Self::Batch => "batch",
            Self::None => "none",
        }
    }
}

/// `a b`, with the columns of `a` as short fixed arrays: the general product calls a routine for each of them.
pub(crate) fn product<const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<f64, R, K>,
    b: &SMatrix<f64, K, C>,
) -> SMatrix<f64, R, C> {
    let mut out = SMatrix::<f64, R, C>::zeros();
    for (to, from) in out.data.0.iter_mut().zip(&b.data.0) {
        let mut sum = [0.0; R];
        for (column, x) in a.data.0.iter().zip(from) {
            for (s, y) in sum.iter_mut().zip(column) {
                *s += x * y;
            }
        }
        *to = sum;
    }
    out
}
