//! Axes: round steps, and the map from a quantity to the picture.

use schema::num;

/// A linear map from a quantity to picture units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Quantity at the first end.
    pub low: f64,
    /// Quantity at the other end.
    pub high: f64,
    /// Picture coordinate of `low`.
    pub from: f64,
    /// Picture coordinate of `high`.
    pub to: f64,
}

impl Scale {
    /// Picture coordinate of a quantity.
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        self.from + (x - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Round values within the ends, at most about `wanted`, with their step.
    #[must_use]
    pub fn ticks(&self, wanted: f64) -> (Vec<f64>, f64) {
        let step = round_step((self.high - self.low) / wanted);
        let first = -num::floor_i64(-(self.low / step) + 1e-9);
        let last = num::floor_i64(self.high / step + 1e-9);
        (
            (first..=last.min(first + 200))
                .map(|i| num::real_i64(i) * step)
                .collect(),
            step,
        )
    }
}

/// The round step (1, 2 or 5 times a power of ten) next above `least`.
#[must_use]
pub fn round_step(least: f64) -> f64 {
    if !least.is_finite() || least <= 0.0 {
        return 1.0;
    }
    let power = 10.0_f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|m| m * power >= least * (1.0 - 1e-9))
        .unwrap_or(10.0);
    step * power
}

/// Decimals that a step needs.
#[must_use]
pub fn step_decimals(step: f64) -> usize {
    num::round_usize((-step.log10().floor()).clamp(0.0, 6.0))
}

#[cfg(test)]
mod tests {
    use super::{Scale, round_step, step_decimals};

    #[test]
    fn steps_are_round_and_ticks_within() {
        assert!((round_step(0.13) - 0.2).abs() < 1e-12);
        assert!((round_step(5.0) - 5.0).abs() < 1e-12);
        assert!((round_step(f64::NAN) - 1.0).abs() < 1e-12);
        assert_eq!(step_decimals(0.05), 2);
        assert_eq!(step_decimals(20.0), 0);
        let s = Scale {
            low: -30.0,
            high: 8.0,
            from: 0.0,
            to: 380.0,
        };
        let (ticks, step) = s.ticks(8.0);
        assert!((step - 5.0).abs() < 1e-12);
        assert!((ticks[0] + 30.0).abs() < 1e-9 && (ticks[ticks.len() - 1] - 5.0).abs() < 1e-9);
        assert!((s.at(0.0) - 300.0).abs() < 1e-9);
    }
}
