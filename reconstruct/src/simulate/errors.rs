//! Sensor errors [S03, 1.2.1 and 1.3.1]: what a data sheet says of them, and what one sensor drew.

use schema::units::STANDARD_GRAVITY;

use super::class::Grade;
use super::random::Random;

/// The data sheet: statistics that the configuration states. One sigma, SI and radians.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// White noise of specific force, m/s^2/sqrt(Hz): the mean over T seconds has the sd `density / sqrt(T)`.
    pub accel_density: f64,
    /// White noise of rate, rad/s/sqrt(Hz).
    pub rate_density: f64,
    /// Turn-on bias, m/s^2.
    pub accel_bias: f64,
    /// Turn-on bias, rad/s.
    pub rate_bias: f64,
    /// Shift of the bias at an impact, m/s^2.
    pub accel_bias_jump: f64,
    /// Shift of the bias at an impact, rad/s.
    pub rate_bias_jump: f64,
    /// Scale error of the accelerometers, fraction.
    pub accel_scale: f64,
    /// Scale error of the gyros, fraction.
    pub rate_scale: f64,
    /// Vibration in a 10 ms mean at 25 m/s, m/s^2.
    pub accel_vibration: f64,
    /// Vibration in a 10 ms mean at 25 m/s, rad/s.
    pub rate_vibration: f64,
    /// Second-order scale of the accelerometers: scale error per m/s^2.
    pub accel_second: f64,
    /// Second-order scale of the gyros: scale error per rad/s.
    pub rate_second: f64,
    /// Difference of scale between positive and negative input, fraction (both sensors).
    pub asymmetry: f64,
    /// Range of the accelerometers, m/s^2; `None`: none.
    pub accel_range: Option<f64>,
    /// Range of the gyros, rad/s; `None`: none.
    pub rate_range: Option<f64>,
    /// Mounting angles, rad, per axis.
    pub mounting: f64,
    /// Place of the IMU, m, per axis.
    pub imu_place: f64,
    /// Place of the centre of gravity, m, per axis.
    pub cg_place: f64,
    /// Receive jitter, s.
    pub jitter: f64,
    /// Probability that a frame is lost.
    pub frame_loss: f64,
    /// Least and greatest delay of a wheel frame, s (uniform).
    pub wheel_latency: [f64; 2],
    /// Least and greatest speed below which a wheel reads zero, m/s (uniform).
    pub wheel_cutoff: [f64; 2],
    /// Scale error common to both wheels, fraction.
    pub wheel_scale: f64,
    /// Difference of scale, left minus right, fraction.
    pub wheel_scale_difference: f64,
    /// White noise of one wheel frame, m/s.
    pub wheel_noise: f64,
}

impl Sheet {
    /// The data sheet of a grade.
    #[must_use]
    pub fn of(grade: Grade) -> Self {
        let consumer = Self {
            accel_density: 0.0015,
            rate_density: 0.01_f64.to_radians(),
            accel_bias: 0.1,
            rate_bias: 0.2_f64.to_radians(),
            accel_bias_jump: 0.05,
            rate_bias_jump: 0.02_f64.to_radians(),
            accel_scale: 0.003,
            rate_scale: 0.003,
            accel_vibration: 0.3,
            rate_vibration: 0.3_f64.to_radians(),
            accel_second: 2e-6,
            rate_second: 1e-4,
            asymmetry: 5e-4,
            accel_range: Some(80.0 * STANDARD_GRAVITY),
            rate_range: Some(500.0_f64.to_radians()),
            mounting: 1.0_f64.to_radians(),
            imu_place: 0.05,
            cg_place: 0.02,
            jitter: 1e-3,
            frame_loss: 5e-4,
            wheel_latency: [0.005, 0.040],
            wheel_cutoff: [1.0 / 3.6, 3.0 / 3.6],
            wheel_scale: 0.003,
            wheel_scale_difference: 0.002,
            wheel_noise: 0.1 / 3.6,
        };
        match grade {
            Grade::Consumer => consumer,
            Grade::Tactical => Self {
                accel_density: 3e-4,
                rate_density: 0.002_f64.to_radians(),
                accel_bias: 0.02,
                rate_bias: 0.01_f64.to_radians(),
                accel_bias_jump: 0.01,
                rate_bias_jump: 0.002_f64.to_radians(),
                accel_scale: 0.0005,
                rate_scale: 0.0005,
                accel_second: 5e-7,
                rate_second: 2e-5,
                asymmetry: 1e-4,
                rate_range: Some(1000.0_f64.to_radians()),
                mounting: 0.3_f64.to_radians(),
                imu_place: 0.02,
                jitter: 2e-4,
                ..consumer
            },
            Grade::Perfect => Self {
                accel_density: 0.0,
                rate_density: 0.0,
                accel_bias: 0.0,
                rate_bias: 0.0,
                accel_bias_jump: 0.0,
                rate_bias_jump: 0.0,
                accel_scale: 0.0,
                rate_scale: 0.0,
                accel_vibration: 0.0,
                rate_vibration: 0.0,
                accel_second: 0.0,
                rate_second: 0.0,
                asymmetry: 0.0,
                accel_range: None,
                rate_range: None,
                mounting: 0.0,
                imu_place: 0.0,
                cg_place: 0.0,
                jitter: 0.0,
                frame_loss: 0.0,
                wheel_latency: [0.0; 2],
                wheel_cutoff: [0.0; 2],
                wheel_scale: 0.0,
                wheel_scale_difference: 0.0,
                wheel_noise: 0.0,
            },
        }
    }
}

/// A stretch of the log in which every frame of the IMU is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burst {
    /// Begin, s.
    pub t: f64,
    /// s.
    pub duration: f64,
}

/// What the sensors of one car do wrong. SI and radians, body axes. [`Errors::none`] switches all off.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Errors {
    /// White noise density, m/s^2/sqrt(Hz).
    pub accel_density: f64,
    /// White noise density, rad/s/sqrt(Hz).
    pub rate_density: f64,
    /// Vibration of the driving car, sd of a 10 ms mean at 25 m/s, proportional to speed up to 30 m/s, m/s^2.
    pub accel_vibration: f64,
    /// Vibration of the driving car, rad/s.
    pub rate_vibration: f64,
    /// Bias, m/s^2.
    pub accel_bias: [f64; 3],
    /// Bias, rad/s.
    pub rate_bias: [f64; 3],
    /// Shift of the bias at the peak of each impact, m/s^2, first and second.
    pub accel_bias_jump: [[f64; 3]; 2],
    /// Shift of the bias at the peak of each impact, rad/s.
    pub rate_bias_jump: [[f64; 3]; 2],
    /// Scale error, fraction.
    pub accel_scale: [f64; 3],
    /// Scale error, fraction.
    pub rate_scale: [f64; 3],
    /// Scale error per m/s^2 of input.
    pub accel_second: [f64; 3],
    /// Scale error per rad/s of input.
    pub rate_second: [f64; 3],
    /// Scale of positive input is higher by half of it, of negative input lower.
    pub accel_asymmetry: [f64; 3],
    /// As `accel_asymmetry`.
    pub rate_asymmetry: [f64; 3],
    /// The frame's value is clipped at this, m/s^2.
    pub accel_range: Option<f64>,
    /// The frame's value is clipped at this, rad/s.
    pub rate_range: Option<f64>,
    /// Roll, pitch, yaw of the sensor against the body, rad.
    pub mounting: [f64; 3],
    /// Receive jitter, s: each frame is late by the magnitude of a normal number of this sd.
    pub jitter: f64,
    /// Probability that a frame (accelerometer, gyro, wheel) is lost.
    pub frame_loss: f64,
    /// Stretches without IMU frames.
    pub bursts: Vec<Burst>,
    /// Stretches without wheel frames.
    pub wheel_bursts: Vec<Burst>,
    /// Values rounded to the resolution of the CAN signals (frames on the bus always are; this rounds the
    /// values of the direct path too).
    pub quantised: bool,
    /// Delay from motion to wheel frame, s.
    pub wheel_latency: f64,
    /// Below this a wheel reads zero, m/s.
    pub wheel_cutoff: f64,
    /// Scale error of left and right, fraction.
    pub wheel_scale: [f64; 2],
    /// White noise of a wheel frame, m/s.
    pub wheel_noise: f64,
}

impl Errors {
    /// No error at all.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// One set of sensors of the given data sheet.
    pub(super) fn draw(sheet: &Sheet, random: &mut Random) -> Self {
        let common = random.normal() * sheet.wheel_scale;
        let half = random.normal() * sheet.wheel_scale_difference / 2.0;
        Self {
            accel_density: sheet.accel_density,
            rate_density: sheet.rate_density,
            accel_vibration: sheet.accel_vibration,
            rate_vibration: sheet.rate_vibration,
            accel_bias: random.normals(sheet.accel_bias),
            rate_bias: random.normals(sheet.rate_bias),
            accel_bias_jump: [
                random.normals(sheet.accel_bias_jump),
                random.normals(sheet.accel_bias_jump),
            ],
            rate_bias_jump: [
                random.normals(sheet.rate_bias_jump),
                random.normals(sheet.rate_bias_jump),
            ],
            accel_scale: random.normals(sheet.accel_scale),
            rate_scale: random.normals(sheet.rate_scale),
            accel_second: random.normals(sheet.accel_second),
            rate_second: random.normals(sheet.rate_second),
            accel_asymmetry: random.normals(sheet.asymmetry),
            rate_asymmetry: random.normals(sheet.asymmetry),
            accel_range: sheet.accel_range,
            rate_range: sheet.rate_range,
            mounting: random.normals(sheet.mounting),
            jitter: sheet.jitter,
            frame_loss: sheet.frame_loss,
            bursts: Vec::new(),
            wheel_bursts: Vec::new(),
            quantised: sheet.accel_density > 0.0,
            wheel_latency: random.range(sheet.wheel_latency[0], sheet.wheel_latency[1]),
            wheel_cutoff: random.range(sheet.wheel_cutoff[0], sheet.wheel_cutoff[1]),
            wheel_scale: [common + half, common - half],
            wheel_noise: sheet.wheel_noise,
        }
    }
}
