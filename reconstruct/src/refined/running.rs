//! Where a filter pass stands: nominal, covariance, and what it has taken down. Forward and backward passes share it.

use super::measure::Scalar;
use super::states::{Cov, Nominal};
use super::tape::Linear;

/// State of a pass between two steps.
#[derive(Clone, Debug)]
pub(crate) struct Running {
    /// Nominal after the measurements so far.
    pub(crate) nominal: Nominal,
    /// Its covariance.
    pub(crate) p: Cov,
    /// Measurements used so far, in the order of the pass.
    pub(crate) linear: Vec<Linear>,
    /// An innovation variance that was not a positive number.
    pub(crate) failed: Option<f64>,
}

impl Running {
    /// Before the first measurement.
    pub(crate) fn new(nominal: &Nominal, p: &Cov) -> Self {
        Self {
            nominal: *nominal,
            p: *p,
            linear: Vec::new(),
            failed: None,
        }
    }

    /// The update, taken down for the tape; false where the innovation is beyond `gate` (chi-square, one degree of
    /// freedom) or the arithmetic failed, see [`Self::failed`].
    pub(crate) fn apply(&mut self, z: &Scalar, gate: f64) -> bool {
        let ph = self.p * z.h;
        let s = z.h.dot(&ph) + z.r;
        if !(s > 0.0 && s.is_finite() && z.residual.is_finite()) {
            self.failed = Some(s);
            return false;
        }
        if z.residual * z.residual > gate * s {
            return false;
        }
        let gain = ph / s;
        self.p.ger(-1.0, &gain, &ph, 1.0);
        self.nominal = self.nominal.corrected(&(gain * z.residual));
        self.linear.push(Linear {
            source: z.source,
            h: z.h,
            residual: z.residual,
            r: z.r,
            s,
            gain,
        });
        true
    }
}
