//! What one backward pass did, step by step: the linear problem that both smoothers solve.
//!
//! Every epoch has a nominal (after its measurements) and the errors `x` about it. With `c` the sum of the corrections
//! that the epoch's measurements gave, the problem is, in the order of the pass (last epoch first),
//!
//! ```text
//! x_0 ~ N(0, P_0)                     before the first measurement, about the nominal of the start
//! x_i + c_i = Phi_i x_{i-1} + w_i      w_i ~ N(0, Q_i)
//! residual_j = h_j (x_i + c_{i,j}) + n_j       n_j ~ N(0, r_j), c_{i,j}: corrections given by the measurements from j on
//! ```
//!
//! where corrections and errors have the signs of [`super::states`].

use super::states::{Cov, Nominal, Row};
use super::transition::Transition;

/// What a measurement or a noise comes from: the sources of the error budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Source {
    /// Standstill: velocity zero.
    Rest,
    /// Mean specific force at rest: tilt and accelerometer bias.
    Levelling,
    /// Mean rate at rest: gyro bias.
    RestRate,
    /// A wheel.
    Wheel,
    /// No side-slip.
    SideSlip,
    /// No jump.
    Jump,
    /// Road limits.
    Road,
    /// A satellite fix: place or velocity.
    Fix,
}

/// One scalar measurement as the filter used it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// What it comes from.
    pub source: Source,
    /// Sensitivity.
    pub h: Row,
    /// Predicted minus measured about the nominal before this measurement.
    pub residual: f64,
    /// Variance of its noise.
    pub r: f64,
    /// Variance of the residual.
    pub s: f64,
    /// Gain `P h / s`; the correction is `gain * residual`.
    pub gain: Row,
}

/// One epoch of the pass.
#[derive(Clone, Debug)]
pub struct Step {
    /// Index of the epoch in recording order.
    pub k: usize,
    /// The way here from the step before (a later epoch); `None` for the first.
    pub transition: Option<Transition>,
    /// Its measurements in [`Tape::linear`].
    pub measurements: std::ops::Range<usize>,
    /// Nominal after the measurements.
    pub nominal: Nominal,
    /// Filtered covariance after the measurements.
    pub p: Cov,
}

/// The whole pass.
#[derive(Clone, Debug)]
pub struct Tape {
    /// Covariance before the first measurement.
    pub prior: Cov,
    /// Steps in the order of the pass: the last epoch first.
    pub steps: Vec<Step>,
    /// Measurements in the order of the pass.
    pub linear: Vec<Linear>,
}
