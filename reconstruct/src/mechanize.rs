//! Strapdown mechanisation in the local navigation frame, backward and forward.
//!
//! Backward from standstill [S03, 3.3.2]. S03 reverses the order of the data and changes their sign; that
//! holds for velocities, rates and wheel speeds only. Positions and accelerations keep theirs: a second
//! derivative does not change under time reversal.

use nalgebra::Vector3;

use crate::frame::{Body, Nav, Rot, Vec3, exp_so3};

/// Rate of the Earth, rad/s (WGS 84).
pub const EARTH_RATE: f64 = 7.292_115e-5;

/// Gravity at sea level by latitude, m/s^2 (Somigliana's formula, WGS 84).
#[must_use]
pub fn gravity(latitude_rad: f64) -> f64 {
    let s2 = latitude_rad.sin().powi(2);
    9.780_325_335_9 * (1.0 + 0.001_931_852_652_41 * s2) / (1.0 - 0.006_694_379_990_14 * s2).sqrt()
}

/// Mean gravity on the Earth's surface where the latitude is not known, m/s^2; within +-0.026 of the truth
/// from the equator to the pole, which levelling absorbs.
pub const MEAN_GRAVITY: f64 = 9.806;

/// Position, velocity and attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nav9 {
    /// Position of the IMU, m.
    pub r_n: Vec3<Nav>,
    /// Velocity of the IMU, m/s.
    pub v_n: Vec3<Nav>,
    /// Attitude.
    pub c_nb: Rot<Nav, Body>,
}

/// What one step saw, for the error model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepView {
    /// Attitude at mid-interval.
    pub c_mid: Rot<Nav, Body>,
    /// Specific force at mid-interval, navigation axes, m/s^2.
    pub f_n: Vec3<Nav>,
    /// Acceleration over the ground, navigation axes, m/s^2.
    pub a_n: Vec3<Nav>,
}

/// The Earth as the mechanisation knows it, in the navigation frame of the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Earth {
    /// Gravity, m/s^2, down positive.
    pub gravity: f64,
    /// Rate of the Earth, rad/s; zero where latitude and heading are not known.
    pub rate_n: Vec3<Nav>,
}

impl Earth {
    /// A flat, still Earth.
    #[must_use]
    pub fn flat() -> Self {
        Self {
            gravity: MEAN_GRAVITY,
            rate_n: Vec3::zero(),
        }
    }

    /// The Earth at a latitude, in axes turned by `heading` (radians) from true north: the frame in which the
    /// car's forward axis at rest is north.
    #[must_use]
    pub fn at(latitude_rad: f64, heading_rad: f64) -> Self {
        let (sl, cl) = latitude_rad.sin_cos();
        let (sh, ch) = heading_rad.sin_cos();
        Self {
            gravity: gravity(latitude_rad),
            rate_n: Vec3::new(
                EARTH_RATE * cl * ch,
                -EARTH_RATE * cl * sh,
                -EARTH_RATE * sl,
            ),
        }
    }

    /// Gravity less Coriolis acceleration at velocity `v_n`.
    fn pull(&self, v_n: Vec3<Nav>) -> Vec3<Nav> {
        Vec3::new(0.0, 0.0, self.gravity) - self.rate_n.scale(2.0).cross(v_n)
    }
}

/// One step backwards: from the end of a sample to its start.
///
/// `f_b` and `w_b` are the sample's mean specific force and rate relative to the navigation frame, `dt > 0`.
/// The acceleration is taken with the attitude at mid-interval: with that at the end the impact speed is off
/// by 0.1 m/s where a car spins.
#[must_use]
pub fn backward(
    state: &Nav9,
    f_b: Vec3<Body>,
    w_b: Vec3<Body>,
    dt: f64,
    earth: &Earth,
) -> (Nav9, StepView) {
    let turn = exp_so3(&(w_b.v * (-0.5 * dt)));
    let half = Rot::from_matrix(state.c_nb.m * turn);
    let f_n = half.apply(f_b);
    let a_n = f_n + earth.pull(state.v_n);
    let next = Nav9 {
        r_n: state.r_n - state.v_n.scale(dt) + a_n.scale(0.5 * dt * dt),
        v_n: state.v_n - a_n.scale(dt),
        c_nb: half.turned(w_b.scale(-0.5 * dt)),
    };
    (
        next,
        StepView {
            c_mid: half,
            f_n,
            a_n,
        },
    )
}

/// One step forwards: from the start of a sample to its end. The mirror of [`backward`].
#[must_use]
pub fn forward(
    state: &Nav9,
    f_b: Vec3<Body>,
    w_b: Vec3<Body>,
    dt: f64,
    earth: &Earth,
) -> (Nav9, StepView) {
    let half = state.c_nb.turned(w_b.scale(0.5 * dt));
    let f_n = half.apply(f_b);
    let a_n = f_n + earth.pull(state.v_n);
    let next = Nav9 {
        r_n: state.r_n + state.v_n.scale(dt) + a_n.scale(0.5 * dt * dt),
        v_n: state.v_n + a_n.scale(dt),
        c_nb: half.turned(w_b.scale(0.5 * dt)),
    };
    (
        next,
        StepView {
            c_mid: half,
            f_n,
            a_n,
        },
    )
}

/// Acceleration free of gravity in body axes, m/s^2.
#[must_use]
pub fn free_of_gravity(f_b: &Vector3<f64>, c_nb: &Rot<Nav, Body>, gravity: f64) -> Vector3<f64> {
    f_b + c_nb.m.row(2).transpose() * gravity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backward_undoes_forward() {
        let earth = Earth::flat();
        let start = Nav9 {
            r_n: Vec3::new(1.0, 2.0, 3.0),
            v_n: Vec3::new(20.0, -3.0, 0.5),
            c_nb: Rot::from_euler(0.05, -0.03, 1.2),
        };
        let mut state = start;
        let input = |k: i32| {
            let t = f64::from(k) * 0.01;
            (
                Vec3::<Body>::new(3.0 * t.sin(), 2.0 * (2.0 * t).cos(), -9.8 + 0.3 * t.cos()),
                Vec3::<Body>::new(0.1 * t.cos(), 0.2 * t.sin(), 2.0 * (0.7 * t).sin()),
            )
        };
        for k in 0..4000 {
            let (f, w) = input(k);
            state = forward(&state, f, w, 0.01, &earth).0;
        }
        for k in (0..4000).rev() {
            let (f, w) = input(k);
            state = backward(&state, f, w, 0.01, &earth).0;
        }
        assert!((state.r_n - start.r_n).v.norm() < 1e-6, "{:?}", state.r_n);
        assert!((state.v_n - start.v_n).v.norm() < 1e-8);
        assert!((state.c_nb.m - start.c_nb.m).norm() < 1e-10);
    }

    #[test]
    fn gravity_meets_the_ellipsoid() {
        assert!((gravity(0.0) - 9.780_325).abs() < 1e-6);
        assert!((gravity(std::f64::consts::FRAC_PI_2) - 9.832_185).abs() < 1e-5);
    }

    #[test]
    fn coriolis_turns_to_the_right_in_the_north() {
        let earth = Earth::at(60.0_f64.to_radians(), 0.7);
        let pull = earth.pull(Vec3::new(25.0, 0.0, 0.0));
        assert!((pull.v.y - 2.0 * EARTH_RATE * 60.0_f64.to_radians().sin() * 25.0).abs() < 1e-9);
    }
}
