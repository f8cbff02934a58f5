//! The scales between physical values and 10-bit codes.
//!
//! They are data in the header, not constants of the reader: a record from a finer sensor may carry finer
//! steps. The error feedback that keeps sums exact over these steps is [`Packer`].

use bincode::{Decode, Encode};
use serde::Serialize;

use crate::num;
use crate::sample::MISSING;
use crate::units::{MetersPerSecond, MetersPerSecondSquared, RadiansPerSecond};

pub use crate::packer::{Packer, Thinner, unpack};

/// The code of zero on a two-slope scale; there are as many codes on each side of it.
pub const ZERO_CODE: u16 = 511;
/// The highest code of a value.
pub const TOP_CODE: u16 = MISSING - 1;

const _: () = assert!(TOP_CODE == 2 * ZERO_CODE);

/// Scale of the wheel fields: `code * step`.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct WheelScale {
    /// Speed of one code, m/s.
    pub step: f64,
}

impl WheelScale {
    /// Steps of 0.25 km/h: 0 to 255.5 km/h.
    #[must_use]
    pub fn default_kmh() -> Self {
        Self {
            step: MetersPerSecond::from_kmh(0.25).0,
        }
    }

    /// The highest speed, m/s.
    #[must_use]
    pub fn top(&self) -> f64 {
        f64::from(TOP_CODE) * self.step
    }

    /// The speed of a code, m/s; `None` for [`MISSING`] or anything above.
    #[must_use]
    pub fn value(&self, code: u16) -> Option<f64> {
        (code <= TOP_CODE).then(|| f64::from(code) * self.step)
    }

    /// The code nearest to a speed in m/s, saturating at both ends; NaN is [`MISSING`].
    #[must_use]
    pub fn nearest(&self, value: f64) -> u16 {
        if value.is_nan() {
            return MISSING;
        }
        let code = num::round_i64(value / self.step).clamp(0, i64::from(TOP_CODE));
        u16::try_from(code).unwrap_or(MISSING)
    }
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

impl TwoSlope {
    /// A scale from its fine step, the number of fine steps on each side (at most 510) and its top.
    ///
    /// The carry limit is half a coarse step. Rounding alone never leaves more than that, so the limit does
    /// not bite as long as values stay below the top; what lies beyond the top is lost and is not
    /// shifted into later samples (it would otherwise wind up to the whole excess of a clipped pulse).
    #[must_use]
    pub fn with_top(fine_step: f64, fine_steps: u16, top: f64) -> Self {
        let fine_steps = fine_steps.min(ZERO_CODE - 1);
        let coarse_steps = ZERO_CODE - fine_steps;
        let coarse_step = (top - f64::from(fine_steps) * fine_step) / f64::from(coarse_steps);
        Self {
            fine_step,
            fine_steps,
            coarse_step,
            coarse_steps,
            carry_limit: coarse_step / 2.0,
        }
    }

    /// Acceleration: 0.05 m/s^2 to 20 m/s^2, then 111 equal steps to 80 g.
    #[must_use]
    pub fn accel_default() -> Self {
        Self::with_top(0.05, 400, MetersPerSecondSquared::from_g(80.0).0)
    }

    /// Rate: 0.125 deg/s to 50 deg/s, then 111 equal steps to 1000 deg/s; in rad/s.
    #[must_use]
    pub fn rate_default() -> Self {
        let radians = |degps| RadiansPerSecond::from_degps(degps).0;
        Self::with_top(radians(0.125), 400, radians(1000.0))
    }

    /// The end of the fine steps.
    fn knee(&self) -> f64 {
        f64::from(self.fine_steps) * self.fine_step
    }

    /// The value of `steps` steps from zero.
    fn magnitude(&self, steps: u16) -> f64 {
        if steps <= self.fine_steps {
            f64::from(steps) * self.fine_step
        } else {
            self.knee() + f64::from(steps - self.fine_steps) * self.coarse_step
        }
    }

    /// The highest value, that of code 1022.
    #[must_use]
    pub fn top(&self) -> f64 {
        self.magnitude(ZERO_CODE)
    }

    /// The value of a code; `None` for [`MISSING`] or anything above.
    #[must_use]
    pub fn value(&self, code: u16) -> Option<f64> {
        if code > TOP_CODE {
            return None;
        }
        let magnitude = self.magnitude(code.abs_diff(ZERO_CODE));
        Some(if code < ZERO_CODE {
            -magnitude
        } else {
            magnitude
        })
    }

    /// The code nearest to a value, saturating at both ends; NaN is [`MISSING`].
    #[must_use]
    pub fn nearest(&self, value: f64) -> u16 {
        if value.is_nan() {
            return MISSING;
        }
        let (magnitude, knee) = (value.abs(), self.knee());
        let steps = if magnitude <= knee {
            num::round_i64(magnitude / self.fine_step)
        } else {
            num::round_i64((magnitude - knee) / self.coarse_step)
                .saturating_add(i64::from(self.fine_steps))
        };
        let steps = u16::try_from(steps.clamp(0, i64::from(ZERO_CODE))).unwrap_or(ZERO_CODE);
        if value < 0.0 {
            ZERO_CODE - steps
        } else {
            ZERO_CODE + steps
        }
    }

    /// The size of the step at a value, for the noise of rounding; the coarse step beyond the top.
    #[must_use]
    pub fn step_at(&self, value: f64) -> f64 {
        if value.abs() < self.knee() {
            self.fine_step
        } else {
            self.coarse_step
        }
    }
}

/// The three scales of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Wheel speed, m/s.
    pub wheel: WheelScale,
    /// Acceleration, m/s^2.
    pub accel: TwoSlope,
    /// Rate, rad/s.
    pub rate: TwoSlope,
}

impl Default for Scales {
    fn default() -> Self {
        Self {
            wheel: WheelScale::default_kmh(),
            accel: TwoSlope::accel_default(),
            rate: TwoSlope::rate_default(),
        }
    }
}
