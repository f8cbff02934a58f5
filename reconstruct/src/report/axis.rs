//! Axes: round steps, and the map from a quantity to the picture.

use schema::num;

use crate::export::fixed::fixed;

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

/// A power of ten as a person writes it: plain from 0.001 to 1000, else 10 with the power raised.
#[must_use]
pub fn power_of_ten(power: i64) -> String {
    if (-3..=3).contains(&power) {
        let digits = usize::try_from(-power).unwrap_or(0);
        return fixed(10.0_f64.powf(num::real_i64(power)), digits);
    }
    let raised = |c: char| match c {
        '-' => '\u{207b}',
        '1' => '\u{b9}',
        '2' => '\u{b2}',
        '3' => '\u{b3}',
        d => d
            .to_digit(10)
            .and_then(|d| char::from_u32(0x2070 + d))
            .unwrap_or(d),
    };
    let power: String = power.to_string().chars().map(raised).collect();
    format!("10{power}")
}

/// A positive number with two digits at most, beyond a thousandth with a power of ten: `0.048`, `4\u{b7}10\u{207b}\u{2074}`.
#[must_use]
pub fn scientific(x: f64) -> String {
    let power = num::floor_i64(x.log10() + 1e-9);
    let front = x / 10.0_f64.powf(num::real_i64(power));
    let digits = usize::from((front - front.round()).abs() > 0.05);
    if (-3..=3).contains(&power) {
        let below = usize::try_from(-power).unwrap_or(0);
        return fixed(x, below + digits);
    }
    format!("{}\u{b7}{}", fixed(front, digits), power_of_ten(power))
}

#[cfg(test)]
mod tests {
    use super::{Scale, power_of_ten, round_step, scientific, step_decimals};

    #[test]
    fn powers_of_ten_as_a_person_writes_them() {
        assert_eq!(power_of_ten(-3), "0.001");
        assert_eq!(power_of_ten(2), "100");
        assert_eq!(power_of_ten(-12), "10\u{207b}\u{b9}\u{b2}");
        assert_eq!(scientific(0.048), "0.048");
        assert_eq!(scientific(1.0), "1");
        assert_eq!(scientific(4e-4), "4\u{b7}10\u{207b}\u{2074}");
        assert_eq!(scientific(6.3e-5), "6.3\u{b7}10\u{207b}\u{2075}");
    }

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
