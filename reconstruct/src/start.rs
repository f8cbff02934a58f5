//! Where the backward pass starts: the final rest, or, if the record ends moving, the last wheel speeds.

use nalgebra::{SMatrix, SVector, Vector2, Vector3};

use crate::epochs::Epochs;
use crate::error_model::{
    ATT, BA, BG, CONSIDERED, CORIOLIS, LATENCY, MOUNT_PITCH, MOUNT_YAW, Nine, POS, SA, SG, STATES,
    VEL, WHEEL, WHEEL_DIFF, velocity_drive,
};
use crate::frame::{Body, Nav, Rot, Vec3};
use crate::mechanize::{EARTH_RATE, Earth, Nav9};
use crate::rest::{RestInterval, level};

/// Standard deviation of the standstill velocity: the springs still rock, m/s.
const REST_SPEED_SD: f64 = 0.01;
/// The final place itself is where the springs left the IMU, one sigma, m.
const REST_PLACE_SD: f64 = 0.005;
/// In-run drift of a gyro bias within a minute, as a share of its turn-on bias.
const RATE_BIAS_DRIFT: f64 = 0.01;
/// Attitude of a car that was not seen at rest: sd of roll and pitch, rad (half the H1 limits and the springs).
const MOVING_TILT_SD: f64 = 0.052;
/// Speed where neither rest nor wheels tell it, sd, m/s.
const UNKNOWN_SPEED_SD: f64 = 20.0;

/// State and covariance at the end of epoch `k`, and the biases taken off every sample.
#[derive(Clone, Debug)]
pub struct Start {
    /// Epoch at whose end the state holds; later epochs stand at rest (or were not heard).
    pub k: usize,
    /// The state.
    pub nav: Nav9,
    /// Its covariance.
    pub belief: Nine,
    /// Accelerometer bias to take off, m/s^2: only its part along gravity can be seen.
    pub accel_bias: Vector3<f64>,
    /// Gyro bias to take off, rad/s, the Earth's rate at rest included.
    pub rate_bias: Vector3<f64>,
    /// Rate of the Earth in body axes at rest, which `rate_bias` holds; zero where not known.
    pub rest_earth_b: Vector3<f64>,
}

/// Variances of the considered errors from the data sheet.
fn considered(epochs: &Epochs, earth: &Earth) -> SVector<f64, { CONSIDERED }> {
    let (imu, wheels) = (&epochs.header.imu, &epochs.header.wheels);
    let mut d = SVector::zeros();
    let top = epochs
        .list
        .iter()
        .flat_map(|e| e.wheels)
        .flatten()
        .fold(30.0, f64::max);
    // The horizontal Coriolis acceleration is at most 2 Omega v (0.36 cm/s^2 at 25 m/s; the bound of
    // [S03, 3.3.1] of 0.95 cm/s^2 also holds for the vertical one); uniform within it.
    let coriolis = if earth.rate_n.v == Vector3::zeros() {
        2.0 * EARTH_RATE * top / 3.0_f64.sqrt()
    } else {
        0.0
    };
    for axis in 0..3 {
        d[BA + axis] = imu.accel_bias.powi(2);
        d[SA + axis] = imu.accel_scale.powi(2);
        d[BG + axis] = imu.rate_bias.powi(2);
        d[SG + axis] = imu.rate_scale.powi(2);
    }
    d[MOUNT_YAW] = imu.mounting_sd[2].powi(2);
    d[MOUNT_PITCH] = imu.mounting_sd[1].powi(2);
    d[CORIOLIS] = coriolis.powi(2);
    d[CORIOLIS + 1] = coriolis.powi(2);
    d[LATENCY] = wheels.latency_sd_s.powi(2);
    d[WHEEL] = wheels.scale_sd.powi(2);
    d[WHEEL_DIFF] = wheels.scale_difference_sd.powi(2);
    d
}

/// The start from a final rest: velocity 0, roll and pitch from the mean specific force [S00, 2.6], gyro bias
/// from the mean rate.
///
/// Levelling cannot tell tilt from accelerometer bias, so the two start fully correlated and stay so.
#[must_use]
pub fn at_rest(epochs: &Epochs, rest: &RestInterval, earth: &Earth) -> Start {
    let imu = &epochs.header.imu;
    let c_nb = level(&rest.accel);
    let mut d = considered(epochs, earth);
    let seconds = rest.settled_s.max(0.01);
    let drift = (RATE_BIAS_DRIFT * imu.rate_bias).powi(2);
    for axis in 0..3 {
        d[BG + axis] = imu.rate_density.powi(2) / seconds + drift;
    }
    // Along gravity the bias shows at rest; what is left is the doubt about gravity itself.
    let along = rest.accel / rest.accel.norm();
    for axis in 0..3 {
        let seen = along[axis].powi(2);
        if seen > 0.9 {
            d[BA + axis] *= (1.0 - seen).max(0.0);
            d[BA + axis] += 0.015_f64.powi(2);
        }
    }
    let mut p_xx = SMatrix::<f64, STATES, STATES>::zeros();
    let mut p_xc = SMatrix::<f64, STATES, CONSIDERED>::zeros();
    for axis in 0..3 {
        p_xx[(POS + axis, POS + axis)] = REST_PLACE_SD.powi(2);
        p_xx[(VEL + axis, VEL + axis)] = REST_SPEED_SD.powi(2);
    }
    let white = imu.accel_density.powi(2) / seconds + 1e-6;
    // Levelling makes C_hat f vertical: an error df of the specific force tilts by psi_x = (C df)_y / g,
    // psi_y = -(C df)_x / g. Bias, scale and mounting yaw (on a slope) all do.
    let g = earth.gravity;
    let drive = velocity_drive(&c_nb, &Vec3::from(rest.accel));
    for axis in 0..2 {
        p_xx[(ATT + axis, ATT + axis)] = white / (g * g);
    }
    for (j, df) in drive
        .iter()
        .enumerate()
        .filter(|(j, _)| !(CORIOLIS..CORIOLIS + 2).contains(j))
    {
        let tilt = Vector2::new(df.y, -df.x) / g;
        p_xc.fixed_view_mut::<2, 1>(ATT, j)
            .copy_from(&(tilt * d[j]));
        let mut block = p_xx.fixed_view_mut::<2, 2>(ATT, ATT);
        block += tilt * tilt.transpose() * d[j];
    }
    let rest_earth_b = c_nb.m.transpose() * earth.rate_n.v;
    Start {
        k: rest.settled,
        nav: Nav9 {
            r_n: Vec3::zero(),
            v_n: Vec3::zero(),
            c_nb,
        },
        belief: Nine {
            p_xx,
            p_xc,
            p_cc: d,
        },
        accel_bias: rest.accel - along * g,
        rate_bias: rest.rate,
        rest_earth_b,
    }
}

/// The start of a record that ends moving: the last wheel speeds, level, with wide covariances.
#[must_use]
pub fn moving(epochs: &Epochs, earth: &Earth) -> Start {
    let list = &epochs.list;
    let k = list
        .iter()
        .rposition(|e| e.measured == [true; 6])
        .unwrap_or(list.len().saturating_sub(1));
    let end = list.get(k).map_or(0.0, |e| e.t_s);
    let mut sum = 0.0;
    let mut n = 0.0;
    for e in list.iter().filter(|e| e.t_s > end - 0.3 && e.t_s <= end) {
        for w in e.wheels.iter().flatten() {
            sum += w;
            n += 1.0;
        }
    }
    let wheels = &epochs.header.wheels;
    let (speed, sd) = if n > 0.0 {
        let speed: f64 = sum / n;
        // Slip and braking since the last frame may hide a tenth of it.
        (
            speed,
            (0.5_f64.powi(2) + (0.05 * speed).powi(2) + wheels.noise_mps.powi(2)).sqrt(),
        )
    } else {
        (0.0, UNKNOWN_SPEED_SD)
    };
    let mut p_xx = SMatrix::<f64, STATES, STATES>::zeros();
    for axis in 0..3 {
        p_xx[(POS + axis, POS + axis)] = 1e-6;
    }
    let side = if n > 0.0 {
        (0.5 + 0.03 * speed).powi(2)
    } else {
        UNKNOWN_SPEED_SD.powi(2)
    };
    p_xx[(VEL, VEL)] = sd * sd;
    p_xx[(VEL + 1, VEL + 1)] = side;
    p_xx[(VEL + 2, VEL + 2)] = (0.3 + 0.05 * speed).powi(2);
    p_xx[(ATT, ATT)] = MOVING_TILT_SD.powi(2);
    p_xx[(ATT + 1, ATT + 1)] = MOVING_TILT_SD.powi(2);
    Start {
        k,
        nav: Nav9 {
            r_n: Vec3::zero(),
            v_n: Vec3::<Nav>::new(speed, 0.0, 0.0),
            c_nb: Rot::<Nav, Body>::identity(),
        },
        belief: Nine {
            p_xx,
            p_xc: SMatrix::zeros(),
            p_cc: considered(epochs, earth),
        },
        accel_bias: Vector3::zeros(),
        rate_bias: Vector3::zeros(),
        rest_earth_b: Vector3::zeros(),
    }
}
