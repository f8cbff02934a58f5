//! What a car obeys, as scalar measurements of the nine errors: wheels, no side-slip, no jump, road angles.
//!
//! Every Jacobian follows from `C_hat = (I - [psi x]) C`: the predicted component along body axis `a` (written
//! in navigation axes) is off by `a . dv - (a x v) . psi`.

use nalgebra::{SVector, Vector3};

use crate::error_model::{
    ATT, BG, CONSIDERED, LATENCY, MOUNT_PITCH, NineScalar, SG, STATES, VEL, WHEEL, WHEEL_DIFF,
};
use crate::mechanize::Nav9;

/// Places on the car, body axes, from the rear axle's centre on the ground, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// IMU.
    pub imu: Vector3<f64>,
    /// One sigma per axis.
    pub imu_sd: Vector3<f64>,
    /// Half the track width.
    pub half_track: f64,
}

impl Geometry {
    /// From the header; an IMU of unknown place is taken where most are, with a wide doubt.
    #[must_use]
    pub fn new(vehicle: &schema::header::Vehicle) -> Self {
        let (imu, imu_sd) = match vehicle.imu_position_m {
            Some(place) => (
                Vector3::from(place),
                Vector3::from(vehicle.imu_position_sd_m),
            ),
            None => (Vector3::new(1.2, 0.0, -0.5), Vector3::new(0.8, 0.4, 0.3)),
        };
        Self {
            imu,
            imu_sd,
            half_track: 0.5 * vehicle.track_width_m,
        }
    }
}

/// Component of the velocity along body axis `axis`, and its sensitivity to the errors.
pub(crate) fn velocity_along(nav: &Nav9, axis: usize) -> (f64, SVector<f64, STATES>) {
    let a: Vector3<f64> = nav.c_nb.m.column(axis).into_owned();
    let v = &nav.v_n.v;
    let mut h = SVector::<f64, STATES>::zeros();
    h.fixed_rows_mut::<3>(VEL).copy_from(&a);
    h.fixed_rows_mut::<3>(ATT).copy_from(&-a.cross(v));
    (a.dot(v), h)
}

/// A wheel's reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelReading {
    /// -1 for the left wheel, +1 for the right one.
    pub side: f64,
    /// Its speed, m/s.
    pub speed: f64,
    /// How long before the state that speed was true, s.
    pub shift_s: f64,
    /// Forward acceleration over that time, m/s^2.
    pub accel: f64,
    /// One sigma of the value as white noise, m/s.
    pub noise: f64,
}

/// One wheel [S03, 2.7-2.10]: `v_left = vx + wz d/2`, `v_right = vx - wz d/2` at the rear axle. Nothing divides by
/// the difference, so a straight road is no special case [S03, 2.14].
#[must_use]
pub fn wheel(
    nav: &Nav9,
    rate: &Vector3<f64>,
    geometry: &Geometry,
    reading: &WheelReading,
) -> NineScalar {
    let WheelReading {
        side,
        speed,
        shift_s,
        accel,
        noise,
    } = *reading;
    let (vx, h_x) = velocity_along(nav, 0);
    let arm = side * geometry.half_track - geometry.imu.y;
    let predicted = vx - rate.z * arm - rate.y * geometry.imu.z - accel * shift_s;
    let mut h_c = SVector::<f64, CONSIDERED>::zeros();
    h_c[BG + 2] = -arm;
    h_c[SG + 2] = -arm * rate.z;
    h_c[WHEEL] = -predicted;
    h_c[WHEEL_DIFF] = 0.5 * side * predicted;
    h_c[LATENCY] = -accel;
    let lever = rate.z * geometry.imu_sd.y;
    NineScalar {
        residual: predicted - speed,
        h_x,
        h_c,
        r: noise * noise + lever * lever,
    }
}

/// No side-slip: the rear axle does not move sideways. `sd` in m/s.
#[must_use]
pub fn no_side_slip(nav: &Nav9, rate: &Vector3<f64>, geometry: &Geometry, sd: f64) -> NineScalar {
    let (vy, h_x) = velocity_along(nav, 1);
    let imu = &geometry.imu;
    let mut h_c = SVector::<f64, CONSIDERED>::zeros();
    h_c[BG + 2] = -imu.x;
    h_c[SG + 2] = -imu.x * rate.z;
    let lever = rate.z * geometry.imu_sd.x;
    NineScalar {
        residual: vy - rate.z * imu.x + rate.x * imu.z,
        h_x,
        h_c,
        r: sd * sd + lever * lever,
    }
}

/// No jump: the rear axle does not leave the road. `sd` in m/s.
#[must_use]
pub fn no_jump(nav: &Nav9, rate: &Vector3<f64>, geometry: &Geometry, sd: f64) -> NineScalar {
    let (vz, h_x) = velocity_along(nav, 2);
    let (vx, _) = velocity_along(nav, 0);
    let imu = &geometry.imu;
    let mut h_c = SVector::<f64, CONSIDERED>::zeros();
    h_c[MOUNT_PITCH] = vx;
    let lever = rate.y * geometry.imu_sd.x;
    NineScalar {
        residual: vz - rate.x * imu.y + rate.y * imu.x,
        h_x,
        h_c,
        r: sd * sd + lever * lever,
    }
}

/// The road's bank (`index` 0) or grade (1), rad, as a prior on the car's roll or pitch: mean and sd, rad.
#[must_use]
pub fn road_angle(nav: &Nav9, index: usize, mean: f64, sd: f64) -> NineScalar {
    let (roll, pitch, _) = nav.c_nb.euler();
    let jacobian = nav.c_nb.euler_jacobian();
    let mut h_x = SVector::<f64, STATES>::zeros();
    h_x.fixed_rows_mut::<3>(ATT)
        .copy_from(&jacobian.row(index).transpose());
    let angle = if index == 0 { roll } else { pitch };
    NineScalar {
        residual: angle - mean,
        h_x,
        h_c: SVector::zeros(),
        r: sd * sd,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Body, Nav, Rot, Vec3, exp_so3};

    fn nav() -> Nav9 {
        Nav9 {
            r_n: Vec3::zero(),
            v_n: Vec3::new(18.0, 9.0, -0.4),
            c_nb: Rot::<Nav, Body>::from_euler(0.06, -0.04, 0.45),
        }
    }

    fn reading(side: f64, speed: f64, accel: f64) -> WheelReading {
        WheelReading {
            side,
            speed,
            shift_s: 0.02,
            accel,
            noise: 0.1,
        }
    }

    fn geometry() -> Geometry {
        Geometry {
            imu: Vector3::new(1.3, 0.1, -0.5),
            imu_sd: Vector3::zeros(),
            half_track: 0.73,
        }
    }

    type Build = fn(&Nav9, &Vector3<f64>) -> NineScalar;

    /// Each Jacobian against a finite difference of its own residual.
    #[test]
    fn jacobians_meet_finite_differences() {
        let rate = Vector3::new(0.02, -0.05, 0.4);
        let builds: [Build; 5] = [
            |n, w| wheel(n, w, &geometry(), &reading(-1.0, 20.0, 1.5)),
            |n, w| no_side_slip(n, w, &geometry(), 0.2),
            |n, w| no_jump(n, w, &geometry(), 0.2),
            |n, _| road_angle(n, 0, 0.03, 0.04),
            |n, _| road_angle(n, 1, 0.0, 0.04),
        ];
        for (i, build) in builds.iter().enumerate() {
            let base = build(&nav(), &rate);
            for s in 0..STATES {
                let mut e = [0.0; STATES];
                e[s] = 1e-6;
                let mut off = nav();
                off.v_n = off.v_n + Vec3::new(e[3], e[4], e[5]);
                let psi = Vector3::new(e[6], e[7], e[8]);
                off.c_nb = Rot::from_matrix(exp_so3(&-psi) * off.c_nb.m);
                let found = (build(&off, &rate).residual - base.residual) / 1e-6;
                assert!(
                    (found - base.h_x[s]).abs() < 1e-4,
                    "{i} state {s}: {found} {}",
                    base.h_x[s]
                );
            }
            // The gyro's bias enters through the lever arm.
            let found = (build(&nav(), &(rate + Vector3::new(0.0, 0.0, 1e-6))).residual
                - base.residual)
                / 1e-6;
            if base.h_c[BG + 2] != 0.0 {
                assert!((found - base.h_c[BG + 2]).abs() < 1e-6, "{i}: {found}");
            }
        }
    }

    #[test]
    fn left_wheel_is_faster_in_a_right_turn() {
        let level = Nav9 {
            c_nb: Rot::identity(),
            v_n: Vec3::new(10.0, 0.0, 0.0),
            ..nav()
        };
        let right_turn = Vector3::new(0.0, 0.0, 0.5);
        let flat = Geometry {
            imu: Vector3::zeros(),
            ..geometry()
        };
        let left = wheel(&level, &right_turn, &flat, &reading(-1.0, 0.0, 0.0)).residual;
        let right = wheel(&level, &right_turn, &flat, &reading(1.0, 0.0, 0.0)).residual;
        assert!((left - 10.365).abs() < 1e-9 && (right - 9.635).abs() < 1e-9);
    }
}
