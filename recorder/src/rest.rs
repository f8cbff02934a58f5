//! Is the car at rest? Decided over one second: means over 100 ms that hardly vary, gravity alone, wheels still.
//!
//! An idling engine shakes a sensor more than slow driving does (0.2 to 0.6 m/s^2 and 0.9 deg/s in single samples of real
//! recordings), but at 20 Hz and more, which a mean over 100 ms takes out: at rest such means vary by up
//! to 0.10 m/s^2 and 0.13 deg/s, on a road by at least 0.07 m/s^2 and 0.24 deg/s. A smooth slide looks the same to
//! the gyros; its deceleration shows as specific force beyond gravity.

use schema::Sample;
use schema::num;
use schema::units::STANDARD_GRAVITY;

/// Samples of a part, and parts of the second that is looked at.
const PART: usize = 10;
const PARTS: usize = 10;
/// Values an axis must have in a part, and parts that must have them.
const ENOUGH: f64 = 5.0;
const ENOUGH_PARTS: f64 = 8.0;
/// Largest standard deviation of the parts' means at rest: m/s^2 and rad/s (0.18 deg/s).
const QUIET_ACCEL: f64 = 0.12;
const QUIET_RATE: f64 = 0.003_14;
/// Largest mean rate at rest beyond three times the data sheet's bias, rad/s.
const STILL_RATE: f64 = 0.01;
/// Largest difference of the mean specific force from gravity beyond three times the bias, m/s^2.
const STILL_ACCEL: f64 = 0.25;
/// Samples of rest that end a record.
pub const REST_SAMPLES: u64 = 200;

/// The limits that follow from the data sheets.
#[derive(Clone, Copy, Debug)]
pub struct RestLimits {
    /// Bias of the accelerometers, m/s^2.
    pub accel_bias: f64,
    /// Bias of the gyros, rad/s.
    pub rate_bias: f64,
    /// Wheel speed below which the wheels say nothing, m/s; `None` without wheels.
    pub wheel_cutoff: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Part {
    count: [f64; 6],
    sum: [f64; 6],
    wheel: f64,
}

/// The detector.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rest {
    parts: [Part; PARTS],
    open: Part,
    filled: usize,
    at: usize,
    run: u64,
}

impl Rest {
    /// True after two seconds of rest.
    #[must_use]
    pub fn at_rest(&self) -> bool {
        self.run >= REST_SAMPLES
    }

    /// Takes the next sample.
    #[must_use]
    pub fn step(mut self, sample: &Sample, limits: &RestLimits) -> Self {
        let open = &mut self.open;
        let axes = open.count.iter_mut().zip(&mut open.sum);
        for ((count, sum), value) in axes.zip(sample.accel.iter().chain(&sample.rate)) {
            if let Some(value) = value {
                *count += 1.0;
                *sum += value;
            }
        }
        for wheel in sample.wheels.iter().flatten() {
            open.wheel = open.wheel.max(*wheel);
        }
        self.filled += 1;
        if self.filled == PART {
            if let Some(slot) = self.parts.get_mut(self.at) {
                *slot = self.open;
            }
            self.at = (self.at + 1) % PARTS;
            self.open = Part::default();
            self.filled = 0;
            let second = num::u64_of(PART * PARTS);
            self.run = match (self.quiet(limits), self.run) {
                (false, _) => 0,
                (true, 0) => second,
                (true, run) => run.saturating_add(num::u64_of(PART)),
            };
        }
        self
    }

    fn quiet(&self, limits: &RestLimits) -> bool {
        let (mut mean, mut wheel) = ([0.0; 6], 0.0_f64);
        for (axis, into) in mean.iter_mut().enumerate() {
            // Welford's sums over the parts' means.
            let (mut parts, mut squares) = (0.0, 0.0);
            for part in &self.parts {
                let (Some(count), Some(sum)) = (part.count.get(axis), part.sum.get(axis)) else {
                    continue;
                };
                if *count >= ENOUGH {
                    parts += 1.0;
                    let off = sum / count - *into;
                    *into += off / parts;
                    squares += off * (sum / count - *into);
                }
            }
            if parts < ENOUGH_PARTS {
                return false;
            }
            let variance = squares / parts;
            let quiet = if axis < 3 { QUIET_ACCEL } else { QUIET_RATE };
            if variance > quiet * quiet {
                return false;
            }
        }
        for part in &self.parts {
            wheel = wheel.max(part.wheel);
        }
        let [x, y, z, rates @ ..] = mean;
        let off = ((x * x + y * y + z * z).sqrt() - STANDARD_GRAVITY).abs();
        off <= STILL_ACCEL + 3.0 * limits.accel_bias
            && rates
                .iter()
                .all(|rate| rate.abs() <= STILL_RATE + 3.0 * limits.rate_bias)
            && limits.wheel_cutoff.is_none_or(|cutoff| wheel <= cutoff)
    }
}
