//! A box laid on each of its six sides in turn, as for [S00, table 4.7]: what its sensors put out, and their hidden errors.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use schema::num::real;

use super::city::{BoxSample, IMU_HZ};
use super::class::Class;
use super::random::{Random, Stream};
use crate::mechanize::{EARTH_RATE, gravity};

/// How the box is laid, and what it does wrong. SI and radians, one sigma where it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct TumbleSheet {
    /// Time on each side, s.
    pub still_s: f64,
    /// Positions askew after the six, for the misalignment.
    pub askew: usize,
    /// Sides left out, by their order in x+, x-, y+, y-, z+, z-.
    pub without: Vec<usize>,
    /// Table's tilt and the hand's, rad.
    pub tilt: f64,
    /// Variance of one sample of specific force, at rest [S00, table 4.5].
    pub accel_variance: [f64; 3],
    /// Variance of one sample of rate, at rest [S00, table 4.4].
    pub rate_variance: [f64; 3],
    /// Accelerometer scale, mean and spread: S00's read 2 to 4 % too much [S00, table 4.7].
    pub accel_scale: [f64; 2],
    /// Accelerometer bias, m/s^2.
    pub accel_bias: f64,
    /// Cross terms, rad.
    pub misalignment: f64,
    /// Gyro bias, rad/s.
    pub rate_bias: f64,
    /// Latitude, rad.
    pub latitude: f64,
}

impl Default for TumbleSheet {
    fn default() -> Self {
        Self {
            still_s: 12.0,
            askew: 0,
            without: Vec::new(),
            tilt: 1.5_f64.to_radians(),
            accel_variance: [1.877e-4, 2.189e-4, 3.517e-4],
            rate_variance: [7.02e-6, 5.14e-6, 7.36e-6],
            accel_scale: [1.03, 0.01],
            accel_bias: 0.08,
            misalignment: 0.008,
            rate_bias: 0.003,
            latitude: 63.42_f64.to_radians(),
        }
    }
}

/// A simulated log of positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Tumble {
    /// 50 Hz, the sensor's axes.
    pub samples: Vec<BoxSample>,
    /// True scales, x, y, z.
    pub scale: [f64; 3],
    /// True biases, m/s^2.
    pub bias: [f64; 3],
    /// True cross terms xy, xz, yz of the force from the reading, rad.
    pub misalignment: [f64; 3],
    /// True gyro bias, rad/s.
    pub rate_bias: [f64; 3],
}

/// One log.
#[must_use]
pub fn tumble(seed: u64, sheet: &TumbleSheet) -> Tumble {
    let mut random = Random::new(Class::Still, seed ^ 0x7015_b1e5, Stream::Errors);
    let scale = [(); 3].map(|()| sheet.accel_scale[0] + sheet.accel_scale[1] * random.normal());
    let bias = random.normals(sheet.accel_bias);
    let cross = random.normals(sheet.misalignment);
    let rate_bias = random.normals(sheet.rate_bias);
    // Force = K (reading - bias), K upper triangular.
    let k = Matrix3::new(
        1.0 / scale[0],
        cross[0],
        cross[1],
        0.0,
        1.0 / scale[1],
        cross[2],
        0.0,
        0.0,
        1.0 / scale[2],
    );
    let reading = k.try_inverse().unwrap_or_else(Matrix3::identity);
    let poses = poses(sheet, &mut random);
    let g = gravity(sheet.latitude);
    // North-east-down: the table pushes up.
    let push = Vector3::new(0.0, 0.0, -g);
    let (s, c) = sheet.latitude.sin_cos();
    let earth = Vector3::new(EARTH_RATE * c, 0.0, -EARTH_RATE * s);
    let dt = 1.0 / real(IMU_HZ);
    let still = schema::num::round_usize(sheet.still_s * real(IMU_HZ)).max(1);
    let turning = 2 * IMU_HZ;
    let mut samples = Vec::new();
    let mut emit = |pose: &Rotation3<f64>, rate: Vector3<f64>, shake: f64, random: &mut Random| {
        let hand = Vector3::from(random.normals(shake));
        let force = pose.inverse() * push + hand;
        let turn = rate + pose.inverse() * earth + Vector3::from(random.normals(0.1 * shake));
        let accel = reading * force
            + Vector3::from(bias)
            + Vector3::from([0, 1, 2].map(|i| sheet.accel_variance[i].sqrt() * random.normal()));
        let rate = turn
            + Vector3::from(rate_bias)
            + Vector3::from([0, 1, 2].map(|i| sheet.rate_variance[i].sqrt() * random.normal()));
        samples.push(BoxSample {
            t_s: dt * real(samples.len() + 1),
            accel,
            rate,
        });
    };
    for (i, pose) in poses.iter().enumerate() {
        for _ in 0..still {
            emit(pose, Vector3::zeros(), 0.0, &mut random);
        }
        let Some(next) = poses.get(i + 1) else {
            break;
        };
        let between = pose.inverse() * next;
        let full = between.scaled_axis();
        for step in 0..turning {
            let x = (real(step) + 0.5) / real(turning);
            let angle = x - (std::f64::consts::TAU * x).sin() / std::f64::consts::TAU;
            let speed = (1.0 - (std::f64::consts::TAU * x).cos()) / (real(turning) * dt);
            let now = pose * Rotation3::new(full * angle);
            emit(&now, full * speed, 0.4, &mut random);
        }
    }
    Tumble {
        samples,
        scale,
        bias,
        misalignment: cross,
        rate_bias,
    }
}

/// Attitudes of the box, box to north-east-down, in a drawn order.
fn poses(sheet: &TumbleSheet, random: &mut Random) -> Vec<Rotation3<f64>> {
    let mut sides: Vec<usize> = (0..6).filter(|s| !sheet.without.contains(s)).collect();
    for i in (1..sides.len()).rev() {
        let j = schema::num::round_usize((random.unit() * real(i + 1)).floor()).min(i);
        sides.swap(i, j);
    }
    let mut poses = Vec::new();
    let heading = |random: &mut Random| {
        Rotation3::from_axis_angle(&Vector3::z_axis(), random.range(0.0, std::f64::consts::TAU))
    };
    for side in sides {
        let mut axis = Vector3::zeros();
        axis[side / 2] = if side % 2 == 0 { 1.0 } else { -1.0 };
        // The axis points up, against down.
        let up = Vector3::new(0.0, 0.0, -1.0);
        let laid = Rotation3::rotation_between(&axis, &up).unwrap_or_else(|| {
            Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
        });
        let tilt = Rotation3::new(Vector3::from(random.normals(sheet.tilt)));
        poses.push(heading(random) * tilt * laid);
    }
    for _ in 0..sheet.askew {
        let axis = Unit::new_normalize(Vector3::from(random.normals(1.0)));
        let angle = random.range(0.3, 2.8);
        poses.push(Rotation3::from_axis_angle(&axis, angle));
    }
    poses
}
