//! The scales between physical values and 10-bit codes, and the error feedback between samples.

use bincode::{Decode, Encode};
use serde::Serialize;

/// Scale of the wheel fields: `code * step`.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct WheelScale {
    /// Speed of one code, m/s.
    pub step: f64,
}

/// A two-slope scale, symmetric about code 511: `fine` steps on each side of zero, then coarse steps to the top.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct TwoSlope {
    /// Size of a fine step (m/s^2 or rad/s).
    pub fine_step: f64,
    /// Number of fine steps on each side of zero (400).
    pub fine_steps: u16,
    /// Size of a coarse step.
    pub coarse_step: f64,
    /// Number of coarse steps on each side (111); `fine_steps + coarse_steps` is 511.
    pub coarse_steps: u16,
    /// Limit of the carried rounding error, same unit: beyond it the carry saturates.
    pub carry_limit: f64,
}
