//! The state at the end of one period, and what became of the fixes.

use std::f64::consts::PI;

use nalgebra::{Matrix2, SMatrix, Vector2, Vector3};

use crate::error_model::{ATT, POS, STATES};
use crate::refined::states::{BG, Nominal};
use crate::stats::ellipse_radius;
use crate::wgs84::Geodetic;

/// The state at the end of one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// s.
    pub t_s: f64,
    /// Place of the sensor.
    pub place: Geodetic,
    /// Velocity north, east, down, m/s.
    pub v_n: Vector3<f64>,
    /// Roll, pitch, heading, rad.
    pub angles: [f64; 3],
    /// Covariance of place, velocity and platform angles in the axes here.
    pub p: SMatrix<f64, STATES, STATES>,
    /// Gyro bias about the axes of the periods, rad/s.
    pub rate_bias: Vector3<f64>,
    /// One sigma of it, rad/s.
    pub rate_bias_sd: Vector3<f64>,
    /// The car was taken to stand.
    pub standing: bool,
    /// A fix was used here.
    pub fixed: bool,
}

impl Estimate {
    /// Covariance of the place north and east, m^2.
    #[must_use]
    pub fn horizontal(&self) -> Matrix2<f64> {
        self.p.fixed_view::<2, 2>(POS, POS).into_owned()
    }

    /// Radius of the circle about the estimate that holds the true place with `confidence`, m: `d` of `N(0, P)` lies within
    /// `R` in the mean over directions of `1 - exp(-R^2 / 2 s^2)`, `s^2 = a cos^2 + b sin^2` of the two variances.
    #[must_use]
    pub fn radius(&self, confidence: f64) -> f64 {
        let p = self.horizontal();
        let mean = f64::midpoint(p[(0, 0)], p[(1, 1)]);
        let spread = (0.5 * (p[(0, 0)] - p[(1, 1)])).hypot(p[(0, 1)]);
        let squares: Vec<f64> = (0..24_u8)
            .map(|i| mean + spread * ((f64::from(i) + 0.5) / 24.0 * PI).cos())
            .filter(|s| *s > 0.0)
            .collect();
        let within = |r: f64| {
            let sum: f64 = squares.iter().map(|s| 1.0 - (-0.5 * r * r / s).exp()).sum();
            sum / schema::num::real(squares.len().max(1))
        };
        let (mut low, mut high) = (0.0, 10.0 * (mean + spread).max(0.0).sqrt());
        for _ in 0..40 {
            let middle = f64::midpoint(low, high);
            if within(middle) < confidence {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    /// True if a place `d` metres north and east of the estimate's lies in its ellipse of `confidence`.
    #[must_use]
    pub fn holds(&self, d: &Vector2<f64>, confidence: f64) -> bool {
        let p = self.horizontal();
        p.try_inverse().is_some_and(|inverse| {
            (d.transpose() * inverse * d)[0] < ellipse_radius(confidence).powi(2)
        })
    }
}

/// What became of a fix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// Its position was used.
    Used,
    /// Its position was refused by its innovation.
    Refused,
    /// Taken in with wide noise after refusals in a row.
    Forced,
}

/// What became of the fixes, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FixUse {
    /// Fixes within the drive.
    pub offered: u64,
    /// Positions used.
    pub used: u64,
    /// Positions refused by their innovation.
    pub refused: u64,
    /// Positions taken in with wide noise after refusals in a row.
    pub forced: u64,
    /// Velocities of which a component was refused.
    pub speeds_refused: u64,
    /// Velocities of which one was taken in with wide noise after refusals in a row.
    pub speeds_forced: u64,
}

impl FixUse {
    /// Of two passes together.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        Self {
            offered: self.offered + other.offered,
            used: self.used + other.used,
            refused: self.refused + other.refused,
            forced: self.forced + other.forced,
            speeds_refused: self.speeds_refused + other.speeds_refused,
            speeds_forced: self.speeds_forced + other.speeds_forced,
        }
    }
}

/// The state in geodetic terms; `rate_bias`, (rad/s)^2, are the variances of the gyro biases; `mounting_roll`, rad, is added
/// to what is unsure of the car's roll.
pub(in crate::gnss) fn estimate(
    t_s: f64,
    anchor: &Geodetic,
    nominal: &Nominal,
    p: &SMatrix<f64, STATES, STATES>,
    rate_bias: [f64; 3],
    mounting_roll: f64,
) -> Estimate {
    let (roll, pitch, heading) = nominal.nav.c_nb.euler();
    let ahead = nominal.nav.c_nb.m.column(0);
    let mut p = *p;
    let mut tilt = p.fixed_view_mut::<3, 3>(ATT, ATT);
    tilt += ahead * ahead.transpose() * mounting_roll.powi(2);
    Estimate {
        t_s,
        place: anchor.moved(&nominal.nav.r_n.v),
        v_n: nominal.nav.v_n.v,
        angles: [roll, pitch, heading.rem_euclid(std::f64::consts::TAU)],
        p,
        rate_bias: nominal.triple(BG),
        rate_bias_sd: Vector3::from(rate_bias.map(|v| v.max(0.0).sqrt())),
        standing: false,
        fixed: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_circle_holds_what_it_says() {
        let mut e = Estimate {
            t_s: 0.0,
            place: Geodetic {
                latitude: 1.0,
                longitude: 0.2,
                height: 0.0,
            },
            v_n: Vector3::zeros(),
            angles: [0.0; 3],
            p: SMatrix::identity(),
            rate_bias: Vector3::zeros(),
            rate_bias_sd: Vector3::zeros(),
            standing: false,
            fixed: false,
        };
        // Of a round one the circle is the ellipse; of a line it is the two-sided normal bound.
        assert!((e.radius(0.95) - ellipse_radius(0.95)).abs() < 1e-6);
        e.p[(1, 1)] = 0.0;
        assert!((e.radius(0.95) - 1.96).abs() < 0.01, "{}", e.radius(0.95));
        e.p[(0, 0)] = 0.0;
        assert!(e.radius(0.95).abs() < 1e-9);
    }
}
