//! What a car obeys, as rows over all states: wheels, sideslip, no jump, road angles, rest.
//!
//! As in [`crate::constraint`] every Jacobian follows from `C_hat = (I - [psi x]) C`; calibration errors are truth minus
//! the value applied.

use nalgebra::Vector3;

use super::states::{
    BA, BG, CORIOLIS, LATENCY, LEVER, MOUNT_PITCH, MOUNT_YAW, Nominal, Row, SG, SLIP,
    SLIP_GRADIENT, TRACK, WHEEL_LEFT, WHEEL_RIGHT,
};
use super::tape::Source;
use super::transition::velocity_drive;
use crate::constraint::{Geometry, road_angle, velocity_along};
use crate::error_model::{ATT, STATES, VEL};
use crate::frame::{Body, Vec3, skew};

/// A scalar measurement about a nominal: `residual = h x + noise of variance r`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scalar {
    /// What it comes from.
    pub source: Source,
    /// Predicted minus measured.
    pub residual: f64,
    /// Sensitivity to all states.
    pub h: Row,
    /// Variance of the noise.
    pub r: f64,
}

fn widen(h9: &nalgebra::SVector<f64, STATES>) -> Row {
    let mut h = Row::zeros();
    h.fixed_rows_mut::<STATES>(0).copy_from(h9);
    h
}

/// A residual that holds `arm . rate` also holds the gyro's bias, scale and mounting.
fn by_rate(h: &mut Row, rate: &Vector3<f64>, arm: &Vector3<f64>, factor: f64) {
    h[MOUNT_YAW] += arm.dot(&Vector3::z().cross(rate)) * factor;
    h[MOUNT_PITCH] += arm.dot(&Vector3::y().cross(rate)) * factor;
    for axis in 0..3 {
        h[BG + axis] = arm[axis] * factor;
        h[SG + axis] = arm[axis] * rate[axis] * factor;
    }
}

/// What the wheel frame says and when it was true.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelFrame {
    /// 0 left, 1 right.
    pub side: usize,
    /// Speed as read, m/s.
    pub speed: f64,
    /// Age of the frame at the state's time beside the sensor's own delay, s.
    pub age_s: f64,
    /// Forward acceleration over that time, m/s^2.
    pub accel: f64,
    /// Variance of the noise, (m/s)^2.
    pub variance: f64,
}

/// One wheel [S03, 2.7-2.10] with its scale and the delay of its frames.
#[must_use]
pub fn wheel(
    nominal: &Nominal,
    rate: &Vector3<f64>,
    geometry: &Geometry,
    frame: &WheelFrame,
) -> Scalar {
    let (side, state) = if frame.side == 0 {
        (-1.0, WHEEL_LEFT)
    } else {
        (1.0, WHEEL_RIGHT)
    };
    let (vx, h9) = velocity_along(&nominal.nav, 0);
    let half = side * geometry.half_track;
    let arm = half * (1.0 + nominal.value(TRACK)) - geometry.imu.y;
    let delay = frame.age_s + nominal.value(LATENCY);
    let over_ground = vx - rate.z * arm - rate.y * geometry.imu.z - frame.accel * delay;
    let scale = 1.0 + nominal.value(state);
    let mut h = widen(&(h9 * scale));
    by_rate(
        &mut h,
        rate,
        &Vector3::new(0.0, -geometry.imu.z, -arm),
        scale,
    );
    h[state] = -over_ground;
    h[LATENCY] = frame.accel * scale;
    // A track wider by c than assumed shows `-rate c half` more: predicted minus measured is the opposite.
    h[TRACK] = rate.z * half * scale;
    let lever = rate.z * geometry.imu_sd.y;
    Scalar {
        source: Source::Wheel,
        residual: over_ground * scale - frame.speed,
        h,
        r: frame.variance + lever * lever,
    }
}

/// Speed of the rear axle's middle along the car's forward axis from a source without scale error. m/s.
#[must_use]
pub fn forward_speed(
    nominal: &Nominal,
    rate: &Vector3<f64>,
    geometry: &Geometry,
    speed: f64,
    sd: f64,
) -> Scalar {
    let (vx, h9) = velocity_along(&nominal.nav, 0);
    let imu = &geometry.imu;
    let mut h = widen(&h9);
    by_rate(&mut h, rate, &Vector3::new(0.0, -imu.z, imu.y), 1.0);
    Scalar {
        source: Source::Wheel,
        residual: vx - rate.y * imu.z + rate.z * imu.y - speed,
        h,
        r: sd * sd,
    }
}

/// The rear axle moves sideways by its sideslip alone: a part that grows with the lateral acceleration `lateral`
/// (m/s^2), outwards, and a correlated one. `sd` in m/s.
#[must_use]
pub fn side_slip(
    nominal: &Nominal,
    rate: &Vector3<f64>,
    geometry: &Geometry,
    lateral: f64,
    sd: f64,
) -> Scalar {
    let (vy, h9) = velocity_along(&nominal.nav, 1);
    let (vx, _) = velocity_along(&nominal.nav, 0);
    let imu = &geometry.imu;
    let ahead = imu.x + nominal.value(LEVER);
    let mut h = widen(&h9);
    by_rate(&mut h, rate, &Vector3::new(imu.z, 0.0, -ahead), 1.0);
    h[SLIP] = vx;
    h[SLIP_GRADIENT] = -vx * lateral;
    h[LEVER] = rate.z;
    let angle = nominal.value(SLIP) - nominal.value(SLIP_GRADIENT) * lateral;
    Scalar {
        source: Source::SideSlip,
        residual: vy - rate.z * ahead + rate.x * imu.z - vx * angle,
        h,
        r: sd * sd,
    }
}

/// The rear axle does not leave the road. `sd` in m/s.
#[must_use]
pub fn no_jump(nominal: &Nominal, rate: &Vector3<f64>, geometry: &Geometry, sd: f64) -> Scalar {
    let (vz, h9) = velocity_along(&nominal.nav, 2);
    let imu = &geometry.imu;
    let ahead = imu.x + nominal.value(LEVER);
    let mut h = widen(&h9);
    by_rate(&mut h, rate, &Vector3::new(-imu.y, ahead, 0.0), 1.0);
    h[LEVER] = -rate.y;
    Scalar {
        source: Source::Jump,
        residual: vz - rate.x * imu.y + rate.y * ahead,
        h,
        r: sd * sd,
    }
}

/// The road's bank (`index` 0) or grade (1), rad, as a prior on the car's roll or pitch: mean and sd, rad.
#[must_use]
pub fn road(nominal: &Nominal, index: usize, mean: f64, sd: f64) -> Scalar {
    let z = road_angle(&nominal.nav, index, mean, sd);
    Scalar {
        source: Source::Road,
        residual: z.residual,
        h: widen(&z.h_x),
        r: z.r,
    }
}

/// Standstill along navigation axis `axis`. `sd` in m/s.
#[must_use]
pub fn standstill(nominal: &Nominal, axis: usize, sd: f64) -> Scalar {
    let mut h = Row::zeros();
    h[VEL + axis] = 1.0;
    Scalar {
        source: Source::Rest,
        residual: nominal.nav.v_n.v[axis],
        h,
        r: sd * sd,
    }
}

/// Levelling: the mean specific force of a car at rest balances gravity along navigation axis `axis`
/// [S00, 2.6 in another form]. It cannot tell tilt from accelerometer bias, and as a measurement of both it does not.
/// `accel` is the mean of the samples, `sd` that of the mean, m/s^2.
#[must_use]
pub fn levelling(
    nominal: &Nominal,
    accel: &Vector3<f64>,
    gravity: f64,
    axis: usize,
    sd: f64,
) -> Scalar {
    let f_b: Vec3<Body> = nominal.force(accel);
    let f_n = nominal.nav.c_nb.apply(f_b);
    let mut h = Row::zeros();
    h.fixed_rows_mut::<3>(ATT)
        .copy_from(&skew(&f_n.v).row(axis).transpose());
    for (j, drive) in velocity_drive(&nominal.nav.c_nb, &f_b).iter().enumerate() {
        if !(CORIOLIS..CORIOLIS + 2).contains(&(BA + j)) {
            h[BA + j] = drive[axis];
        }
    }
    let pull = if axis == 2 { gravity } else { 0.0 };
    Scalar {
        source: Source::Levelling,
        residual: f_n.v[axis] + pull,
        h,
        r: sd * sd,
    }
}

/// The mean rate of a car at rest is the gyro's bias. `rate` is the mean about body axis `axis` with the calibration
/// and the Earth's rate taken out, `sd` that of the mean, rad/s.
#[must_use]
pub fn rest_rate(rate: f64, axis: usize, sd: f64) -> Scalar {
    let mut h = Row::zeros();
    h[BG + axis] = 1.0;
    Scalar {
        source: Source::RestRate,
        residual: rate,
        h,
        r: sd * sd,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error_model::POS;
    use crate::frame::{Nav, Rot};
    use crate::mechanize::{Earth, Nav9};
    use crate::refined::states::{DIM, PARAMS};
    use nalgebra::SVector;

    fn nominal() -> Nominal {
        let mut cal =
            SVector::<f64, PARAMS>::from_fn(|i, _| 0.001 * (1.0 + schema::num::real(i % 5)));
        cal[LATENCY - STATES] = 0.02;
        Nominal {
            nav: Nav9 {
                r_n: Vec3::zero(),
                v_n: Vec3::new(18.0, 9.0, -0.4),
                c_nb: Rot::<Nav, Body>::from_euler(0.06, -0.04, 0.45),
            },
            cal,
        }
    }

    fn geometry() -> Geometry {
        Geometry {
            imu: Vector3::new(1.3, 0.1, -0.5),
            imu_sd: Vector3::zeros(),
            half_track: 0.73,
        }
    }

    type Build<'a> = Box<dyn Fn(&Nominal) -> Scalar + 'a>;

    const RATE: [f64; 3] = [0.02, -0.05, 0.4];
    const ACCEL: [f64; 3] = [0.3, -0.6, -9.7];

    /// Each row against a finite difference of its own residual: a true error `x` moves the estimate of the first nine
    /// by `+x` and leaves a calibration that is too small by `x`.
    #[test]
    fn rows_meet_finite_differences() {
        let frame = WheelFrame {
            side: 1,
            speed: 20.0,
            age_s: 0.005,
            accel: 1.5,
            variance: 0.01,
        };
        let left = WheelFrame { side: 0, ..frame };
        let earth = Earth::flat();
        let (rate, accel) = (Vector3::from(RATE), Vector3::from(ACCEL));
        let builds: Vec<Build> = vec![
            Box::new(|n| wheel(n, &n.rate(&rate, &earth).v, &geometry(), &frame)),
            Box::new(|n| wheel(n, &n.rate(&rate, &earth).v, &geometry(), &left)),
            Box::new(|n| side_slip(n, &n.rate(&rate, &earth).v, &geometry(), 2.0, 0.05)),
            Box::new(|n| no_jump(n, &n.rate(&rate, &earth).v, &geometry(), 0.2)),
            Box::new(|n| road(n, 0, 0.03, 0.04)),
            Box::new(|n| road(n, 1, 0.0, 0.04)),
            Box::new(|n| standstill(n, 1, 0.01)),
            Box::new(|n| levelling(n, &accel, 9.81, 0, 0.01)),
            Box::new(|n| levelling(n, &accel, 9.81, 1, 0.01)),
            Box::new(|n| levelling(n, &accel, 9.81, 2, 0.01)),
            // At rest the rate is next to nothing.
            Box::new(|n| rest_rate(n.rate(&(rate * 1e-3), &earth).v.z, 2, 0.01)),
        ];
        for (i, build) in builds.iter().enumerate() {
            let base = build(&nominal());
            for s in POS..DIM {
                let mut x = Row::zeros();
                x[s] = -1e-6;
                // `corrected` takes errors off: an error of +1e-6 is a correction of -1e-6.
                let found = (build(&nominal().corrected(&x)).residual - base.residual) / 1e-6;
                let want = base.h[s];
                // Products of two small errors, and what the mounting yaw does to the cross rates, are left out.
                let allowed = 0.05 + 0.01 * want.abs();
                assert!(
                    (found - want).abs() < allowed,
                    "{i} state {s}: {found} {want}"
                );
            }
        }
    }
}
