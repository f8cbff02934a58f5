//! The shape of a crash pulse.

use std::f64::consts::PI;

/// A pulse of unit area: a main lobe between half-sine and haversine with ripple of the structure, and a
/// rebound lobe of the same sign that overlaps its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// From onset to separation, s.
    pub duration: f64,
    /// Share of the duration that the main lobe takes.
    pub main: f64,
    /// Exponent of the sine of the main lobe: 1 half-sine, 2 haversine.
    pub exponent: f64,
    /// Share of the area that is rebound.
    pub rebound: f64,
    /// Depth of the ripple, share of the main lobe.
    pub ripple: f64,
    /// Frequency of the ripple, Hz.
    pub ripple_hz: f64,
}

impl Pulse {
    /// A plain half-sine.
    #[must_use]
    pub const fn half_sine(duration: f64) -> Self {
        Self {
            duration,
            main: 1.0,
            exponent: 1.0,
            rebound: 0.0,
            ripple: 0.0,
            ripple_hz: 0.0,
        }
    }

    /// Begin of the rebound lobe, share of the duration.
    const REBOUND_FROM: f64 = 0.45;

    fn main_lobe(&self, t: f64) -> f64 {
        let x = t / (self.duration * self.main);
        if !(0.0..=1.0).contains(&x) {
            return 0.0;
        }
        let ripple = 1.0 + self.ripple * (2.0 * PI * self.ripple_hz * t).sin();
        (PI * x).sin().max(0.0).powf(self.exponent) * ripple
    }

    fn rebound_lobe(&self, t: f64) -> f64 {
        let x = (t / self.duration - Self::REBOUND_FROM) / (1.0 - Self::REBOUND_FROM);
        if (0.0..=1.0).contains(&x) {
            (PI * x).sin().max(0.0)
        } else {
            0.0
        }
    }

    /// The pulse with its area known, ready to be evaluated.
    pub(super) fn prepared(&self) -> PreparedPulse {
        const POINTS: u32 = 2000;
        let step = self.duration / f64::from(POINTS);
        let area = (0..POINTS)
            .map(|i| self.main_lobe((f64::from(i) + 0.5) * step))
            .sum::<f64>()
            * step;
        let rebound_area = 2.0 / PI * self.duration * (1.0 - Self::REBOUND_FROM);
        PreparedPulse {
            pulse: *self,
            main_gain: (1.0 - self.rebound) / area,
            rebound_gain: self.rebound / rebound_area,
        }
    }
}

/// A pulse normalised to unit area.
#[derive(Clone, Debug)]
pub(super) struct PreparedPulse {
    pulse: Pulse,
    main_gain: f64,
    rebound_gain: f64,
}

impl PreparedPulse {
    /// Value `t` seconds after the onset, 1/s; zero outside.
    pub(super) fn at(&self, t: f64) -> f64 {
        if t <= 0.0 || t >= self.pulse.duration {
            return 0.0;
        }
        self.main_gain * self.pulse.main_lobe(t) + self.rebound_gain * self.pulse.rebound_lobe(t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_is_one() {
        let pulse = Pulse {
            duration: 0.09,
            main: 0.75,
            exponent: 1.4,
            rebound: 0.12,
            ripple: 0.25,
            ripple_hz: 80.0,
        };
        for pulse in [pulse, Pulse::half_sine(0.1)] {
            let prepared = pulse.prepared();
            let step = 1e-5;
            let area = (0..20_000)
                .map(|i| prepared.at((f64::from(i) + 0.5) * step))
                .sum::<f64>()
                * step;
            assert!((area - 1.0).abs() < 1e-5, "area {area}");
            assert!((0..200).all(|i| prepared.at(f64::from(i) * 1e-3) >= 0.0));
        }
    }
}
