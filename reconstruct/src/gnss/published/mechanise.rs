//! Velocity and levelling from the inertial samples [S00, 2.1 to 2.7], step by step as the program has them.
#![allow(
    non_snake_case,
    reason = "matrices keep the names they have in the literature"
)]

use nalgebra::{Matrix3, Vector3};

use super::constants::{EARTH_RATE, GRAVITY};
use super::earth::{rx, ry, rz};
use super::matrices::{ATT, BIAS, State, VEL};
use super::variant::{Reading, Source, Variant};
use crate::frame::exp_so3;

/// Roll and pitch, rad, of a specific force (m/s^2) in body axes at rest (2.6).
#[must_use]
pub fn level(f_b: &Vector3<f64>) -> (f64, f64) {
    (
        (-f_b.y).atan2(-f_b.z),
        f_b.x.atan2((f_b.y * f_b.y + f_b.z * f_b.z).sqrt()),
    )
}

/// The three rotations of an attitude, made once.
struct Attitude {
    x: Matrix3<f64>,
    y: Matrix3<f64>,
    z: Matrix3<f64>,
}

impl Attitude {
    fn new(roll: f64, pitch: f64, yaw: f64, variant: &Variant) -> Self {
        let sense = variant.rotations;
        Self {
            x: rx(roll, sense),
            y: ry(pitch, sense),
            z: rz(yaw, sense),
        }
    }

    fn body_to_geographic(&self, variant: &Variant) -> Matrix3<f64> {
        match variant.roll {
            Source::Program => self.z * self.y,
            Source::Text => self.z * self.y * self.x,
        }
    }

    fn gravity_b(&self, variant: &Variant) -> Vector3<f64> {
        // The rotation by the negative angle is the transpose.
        let g_g = Vector3::new(0.0, 0.0, GRAVITY);
        match variant.gravity_order {
            Reading::Published => self.y.tr_mul(&self.x.tr_mul(&g_g)),
            Reading::Corrected => self.x.tr_mul(&self.y.tr_mul(&g_g)),
        }
    }
}

/// Body to geographic axes, 3 x 3 (2.5). The program sets roll to 0 here.
#[must_use]
pub fn body_to_geographic(roll: f64, pitch: f64, yaw: f64, variant: &Variant) -> Matrix3<f64> {
    Attitude::new(roll, pitch, yaw, variant).body_to_geographic(variant)
}

/// Gravity in body axes, m/s^2, by the state's roll and pitch, as the program adds it to the specific force.
///
/// Published, pitch is taken out after roll is; the inverse of (2.5) takes them in the other order. At 5 degrees
/// of each the two are 0.005 m/s^2 apart.
#[must_use]
pub fn gravity_b(roll: f64, pitch: f64, variant: &Variant) -> Vector3<f64> {
    Attitude::new(roll, pitch, 0.0, variant).gravity_b(variant)
}

/// Inertial velocity after a step of `dt` seconds, ECEF axes, m/s (2.7).
///
/// `Ce_g` (3 x 3) takes ECEF to geographic axes, `f_b` is the specific force (m/s^2) and `w_b` the rate (rad/s) in body
/// axes. The velocity starts along the body's x axis whatever the state's direction: the car neither slides
/// nor jumps.
#[must_use]
pub fn velocity(
    x: &State,
    Ce_g: &Matrix3<f64>,
    f_b: &Vector3<f64>,
    w_b: &Vector3<f64>,
    dt: f64,
    variant: &Variant,
) -> Vector3<f64> {
    let (roll, pitch, yaw) = (x[ATT], x[ATT + 1], x[ATT + 2]);
    let veb_e = x.fixed_rows::<3>(VEL).into_owned();
    let bias = x.fixed_rows::<3>(BIAS).into_owned();
    let Cg_e = Ce_g.transpose();
    let attitude = Attitude::new(roll, pitch, yaw, variant);
    let Cb_e = Cg_e * attitude.body_to_geographic(variant);
    let oie_e = Vector3::new(0.0, 0.0, EARTH_RATE);
    // (2.7a); the text prints the matrix untransposed.
    let oie_b = match variant.earth_rate {
        Source::Program => Cb_e.transpose() * oie_e,
        Source::Text => Cb_e * oie_e,
    };
    let oeb_b = w_b - bias - oie_b;
    // (2.7b to d), to first order, or the whole rotation.
    let turned = match variant.orthogonal {
        Reading::Published => Matrix3::identity() + (oeb_b * dt).cross_matrix(),
        Reading::Corrected => exp_so3(&(oeb_b * dt)),
    };
    let Cb_e_hat = Cb_e * turned;
    // (2.7e and f)
    let coriolis = oie_e.cross(&veb_e) * 2.0;
    let aeb_e = match variant.acceleration {
        Source::Program => Cb_e_hat * (f_b + attitude.gravity_b(variant)) - coriolis,
        Source::Text => Cb_e * f_b - coriolis + Cg_e * Vector3::new(0.0, 0.0, GRAVITY),
    };
    let speed = match variant.speed {
        Reading::Published => veb_e.norm(),
        Reading::Corrected => Cb_e.column(0).dot(&veb_e),
    };
    // (2.7g). The rotation over the step turns the velocity by the rate, and the acceleration across it turns it once
    // more; put right, the rate alone turns it, and of the acceleration only what is along it counts.
    let forward = Cb_e_hat.column(0).into_owned();
    match variant.turn {
        Reading::Published => forward * speed + aeb_e * dt,
        Reading::Corrected => forward * (speed + forward.dot(&aeb_e) * dt),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levelling and gravity are each other's inverse in the corrected order; in the published one they are not, quite.
    #[test]
    fn gravity_cancels_the_specific_force_at_rest() {
        let angle = 5.0_f64.to_radians();
        let mut variant = Variant::program();
        variant.gravity_order = Reading::Corrected;
        let right = gravity_b(angle, angle, &variant);
        let (roll, pitch) = level(&-right);
        assert!((roll - angle).abs() < 1e-15 && (pitch - angle).abs() < 1e-15);
        let published = gravity_b(angle, angle, &Variant::program());
        assert!(((published - right).norm() - 0.0046).abs() < 1e-4);
        variant.roll = Source::Text;
        let back = body_to_geographic(angle, angle, 1.0, &variant) * right;
        assert!((back - Vector3::new(0.0, 0.0, GRAVITY)).norm() < 1e-14);
    }
}
