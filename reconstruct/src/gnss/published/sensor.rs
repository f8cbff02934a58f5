//! The tag's raw samples in the car's axes.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use super::constants::{ACCEL_SCALE, GRAVITY, TAG_PITCH, TAG_ROLL};
use super::earth::{rx, ry, rz};
use super::variant::Source;

/// How the tag sits in the car: (2.6) of its own accelerometer, at rest on level ground [S00, 6.5: `orientation`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    /// Pitch of the tag, rad.
    pub pitch: f64,
    /// Roll of the tag, rad.
    pub roll: f64,
    /// True over raw acceleration.
    pub accel_scale: f64,
}

impl Default for Orientation {
    /// The program's.
    fn default() -> Self {
        Self {
            pitch: TAG_PITCH,
            roll: TAG_ROLL,
            accel_scale: ACCEL_SCALE,
        }
    }
}

impl Orientation {
    /// Accelerometer to body axes, 3 x 3: levelled, then turned half round about z [S00, 6.5: `Cs_b_a`].
    #[must_use]
    pub fn accel(&self) -> Matrix3<f64> {
        let sense = Source::Program;
        rz(PI, sense) * ry(self.pitch, sense) * rx(self.roll, sense)
    }

    /// Negated gyro to body axes, 3 x 3 [S00, 6.5: `Cs_b_g`], as the program has it.
    ///
    /// It is not the accelerometer's: taken through the half turn that one reads `Ry(-pitch) Rx(-roll) Rz(pi)`, and
    /// here the pitch keeps its sign and all three rates are negated, a mirror image. See [`super::SLIPS`].
    #[must_use]
    pub fn gyro(&self) -> Matrix3<f64> {
        let sense = Source::Program;
        ry(self.pitch, sense) * rx(-self.roll, sense)
    }
}

/// Specific force (m/s^2) and rate (rad/s) in body axes of a raw sample in milli-g and millidegrees per second
/// [S00, 6.5].
#[must_use]
pub fn to_body(
    accel_mg: &Vector3<f64>,
    rate_mdps: &Vector3<f64>,
    orientation: &Orientation,
) -> (Vector3<f64>, Vector3<f64>) {
    let f_s = accel_mg * (orientation.accel_scale * GRAVITY / 1000.0);
    let w_s = -rate_mdps / 1000.0;
    (
        orientation.accel() * f_s,
        (orientation.gyro() * w_s).map(f64::to_radians),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::published::mechanise::level;

    /// The program's orientation is (2.6) of the raw accelerometer, so its rotations turn the vector, not the axes.
    #[test]
    fn orientation_levels_the_tag() {
        let tag = Orientation::default();
        let raw = tag.accel().transpose() * Vector3::new(0.0, 0.0, -1000.0 / tag.accel_scale);
        let (roll, pitch) = level(&raw);
        assert!((roll - TAG_ROLL).abs() < 1e-12 && (pitch - TAG_PITCH).abs() < 1e-12);
        let (f_b, w_b) = to_body(&raw, &Vector3::zeros(), &tag);
        assert!((f_b - Vector3::new(0.0, 0.0, -GRAVITY)).norm() < 1e-12);
        assert!(w_b.norm() < 1e-15);
    }

    /// With the axes turned instead the same figures would leave the tag on its side.
    #[test]
    fn printed_rotations_do_not_level_it() {
        let tag = Orientation::default();
        let raw = tag.accel().transpose() * Vector3::new(0.0, 0.0, -1.0);
        let printed = ry(tag.pitch, Source::Text) * rx(tag.roll, Source::Text) * raw;
        let (_, pitch) = level(&printed);
        assert!((pitch - 2.0 * TAG_PITCH).abs() < 1e-3);
    }

    #[test]
    fn gyro_is_fifty_degrees_off_the_accelerometer() {
        let tag = Orientation::default();
        let half = rz(PI, Source::Program);
        let same = tag.accel() * half;
        let yaw_rate = (tag.gyro() * same.transpose()).m33;
        assert!((yaw_rate - (2.0 * TAG_PITCH).cos()).abs() < 1e-3);
    }
}
