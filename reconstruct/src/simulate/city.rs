//! Drives through a town with a box behind the windscreen: what the prototypes of S00 put out, and the truth.
//!
//! The car and its driver are those of the crashes; the sensors have the noise of [S00, tables 4.1 and 4.4 to 4.7].

use nalgebra::{Matrix3, Vector3};
use schema::num;

use super::class::{Class, Grade};
use super::errors::Sheet;
use super::process::Correlated;
use super::random::{Random, Stream};
use super::scenario::{Axes, Curve, Scenario, SpeedTarget};
use super::{SimulateError, simulate};
use crate::frame::{Nav, Rot};
use crate::mechanize::{EARTH_RATE, gravity};
use crate::wgs84::Geodetic;

/// Rate of the inertial samples, Hz [S00, 3.3].
pub const IMU_HZ: usize = 50;
/// 10 ms bins a sample.
const BINS: usize = 2;

/// What the box does wrong. SI and radians, one sigma where it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxSheet {
    /// Variance of one sample of specific force: standing with the engine on, driving [S00, table 4.5].
    pub accel_variance: [[f64; 3]; 2],
    /// Variance of one sample of rate: standing, driving [S00, table 4.4].
    pub rate_variance: [[f64; 3]; 2],
    /// Accelerometer bias.
    pub accel_bias: f64,
    /// Accelerometer scale.
    pub accel_scale: f64,
    /// Gyro bias [S00, table 4.6].
    pub rate_bias: f64,
    /// Random walk of the gyro bias, rad/s/sqrt(s): 6e-4 rad/s in ten minutes [S00, table 4.6].
    pub rate_drift: f64,
    /// Gyro scale.
    pub rate_scale: f64,
    /// Rate at which the gyro's output wraps, rad/s [S00, 5.2]; `None`: never.
    pub rate_wrap: Option<f64>,
    /// Error of the rough mounting that a program would be told, rad per axis.
    pub mounting: f64,
    /// Position of a fix, north, east, down, m [S00, table 4.1, receiver 2: mean deviations times 1.25].
    pub fix: [f64; 3],
    /// Share of the variance of a fix that changes slowly, and the time in which it does, s.
    pub fix_slow: (f64, f64),
    /// Velocity of a fix, m/s.
    pub fix_speed: [f64; 3],
    /// Delay of a fix behind the inertial samples, s [S00, 3.3].
    pub latency_s: f64,
    /// Shaking of an idling engine beside the table's, m/s^2 rms.
    pub idle: f64,
}

impl Default for BoxSheet {
    fn default() -> Self {
        Self {
            accel_variance: [
                [1.986e-3, 1.090e-3, 1.930e-2],
                [9.949e-2, 4.694e-2, 2.0443e-1],
            ],
            rate_variance: [[5.65e-6, 4.38e-6, 7.22e-6], [1.829e-4, 5.503e-4, 2.908e-5]],
            accel_bias: 0.05,
            accel_scale: 0.005,
            rate_bias: 0.003,
            rate_drift: 2.4e-5,
            rate_scale: 0.003,
            rate_wrap: None,
            mounting: 0.5_f64.to_radians(),
            fix: [4.5, 2.9, 5.1],
            fix_slow: (0.75, 30.0),
            fix_speed: [0.39, 0.29, 0.24],
            latency_s: 1.24,
            idle: 0.0,
        }
    }
}

/// One inertial sample of the box, its own axes turned into the car's by the rough mounting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxSample {
    /// Stamp, s: the end of the 20 ms it is the mean of.
    pub t_s: f64,
    /// Specific force, m/s^2.
    pub accel: Vector3<f64>,
    /// Rate, rad/s.
    pub rate: Vector3<f64>,
}

/// One fix of the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxFix {
    /// Stamp, s: the instant it was true plus the delay.
    pub t_s: f64,
    /// Place.
    pub place: Geodetic,
    /// Velocity north, east, down, m/s.
    pub v_n: Vector3<f64>,
}

/// True state at the end of an inertial sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxTruth {
    /// s.
    pub t_s: f64,
    /// Place of the box.
    pub place: Geodetic,
    /// Velocity north, east, down, m/s.
    pub v_n: Vector3<f64>,
    /// Roll, pitch, heading, rad.
    pub angles: [f64; 3],
    /// Forward speed, m/s.
    pub speed: f64,
}

/// A simulated drive.
#[derive(Clone, Debug, PartialEq)]
pub struct CityDrive {
    /// 50 Hz.
    pub samples: Vec<BoxSample>,
    /// 1 Hz.
    pub fixes: Vec<BoxFix>,
    /// One entry a sample.
    pub truth: Vec<BoxTruth>,
    /// Gyro bias at each sample, the car's axes, rad/s.
    pub rate_bias: Vec<Vector3<f64>>,
    /// The same [`EARLIER_S`] before the drive: what a program knows that was told the bias of an earlier stop.
    pub earlier_bias: Vector3<f64>,
}

/// Age of the bias that the experiments of S00 were told, at the begin of the drive, s: there it is that of the stop at fix
/// 381, the window begins with fix 631 and here 40 s after the drive.
pub const EARLIER_S: f64 = 210.0;

/// The scenario: `seconds` of town traffic with stops at lights, ending in a stop.
fn scenario(seed: u64, seconds: f64) -> Scenario {
    let mut scenario = Scenario::draw(Class::Drive, seed);
    scenario.redraw_sensors(&Sheet::of(Grade::Perfect), seed);
    scenario.axes = Axes::FrontRightDown;
    scenario.imu_hz = 100;
    let place = [1.8, 0.0, -1.1];
    scenario.car.imu = place;
    scenario.car.imu_nominal = place;
    let mut random = Random::new(Class::Drive, seed ^ 0x5eed_c17e, Stream::Scenario);
    let plan = &mut scenario.manoeuvre;
    plan.start_speed = random.range(9.0, 15.0);
    plan.drive_accel = 2.0;
    plan.drive_decel = 2.2;
    plan.speeds.clear();
    let mut t = random.range(5.0, 10.0);
    let mut until_stop = random.range(30.0, 55.0);
    while t < seconds - 15.0 {
        if t > until_stop {
            plan.speeds.push(SpeedTarget { t, speed: 0.0 });
            t += random.range(14.0, 26.0);
            until_stop = t + random.range(35.0, 70.0);
        }
        let speed = random.range(8.0, 17.0);
        plan.speeds.push(SpeedTarget { t, speed });
        t += random.range(8.0, 16.0);
    }
    if let Some(braking) = &mut plan.braking {
        braking.t = seconds - 10.0;
        braking.decel = 2.0;
        braking.abs_depth = 0.0;
        braking.slip = [0.0; 2];
    }
    plan.curves.clear();
    let mut start = random.range(20.0, 60.0);
    while start < 17.0 * seconds {
        let length = random.range(25.0, 120.0);
        plan.curves.push(Curve {
            start,
            length,
            ramp: 0.3,
            lateral: random.sign() * random.range(0.8, 3.0),
        });
        start += length + random.range(40.0, 250.0);
    }
    scenario
}

/// One drive.
///
/// # Errors
/// [`SimulateError`] if `seconds` is out of what the simulator drives (60 to 230 s).
pub fn drive(seed: u64, seconds: f64, sheet: &BoxSheet) -> Result<CityDrive, SimulateError> {
    if !(60.0..=230.0).contains(&seconds) {
        return Err(SimulateError::Quantity {
            name: "length of the drive",
            value: seconds,
            expected: "60 to 230 s",
        });
    }
    let simulated = simulate(&scenario(seed, seconds))?;
    let mut random = Random::new(Class::Drive, seed ^ 0x0b0c_5000, Stream::Errors);
    let rest = Geodetic {
        latitude: random.range(63.0, 63.8_f64).to_radians(),
        longitude: random.range(10.0, 11.0_f64).to_radians(),
        height: random.range(20.0, 150.0),
    };
    let turn = Rot::<Nav, Nav>::from_matrix(
        Rot::from_euler(0.0, 0.0, random.range(0.0, std::f64::consts::TAU)).m,
    );
    let truth = truth(&simulated.truth.rows, &rest, &turn.m);
    let mut rates = Vec::with_capacity(truth.len());
    let earth = Vector3::new(
        EARTH_RATE * rest.latitude.cos(),
        0.0,
        -EARTH_RATE * rest.latitude.sin(),
    );
    // The simulator's Earth is flat, still and pulls as standard: the rest is added here.
    let pull = gravity(rest.latitude) - simulated.scenario.gravity;
    for (k, state) in truth.iter().enumerate() {
        // Frame `j` ends with row `j`; entry `k` is row `BINS (k + 1)`.
        let frames = simulated.imu.get(BINS * k + 1..BINS * (k + 1) + 1);
        let mean = |of: fn(&super::ImuFrame) -> [f64; 3]| {
            let frames = frames.unwrap_or_default();
            let sum: Vector3<f64> = frames.iter().map(|f| Vector3::from(of(f))).sum();
            sum / num::real(frames.len().max(1))
        };
        let [roll, pitch, heading] = state.angles;
        let c_bn = Rot::from_euler(roll, pitch, heading).m.transpose();
        let extra = 2.0 * earth.cross(&state.v_n) - Vector3::new(0.0, 0.0, pull);
        rates.push((
            mean(|f| f.accel) + c_bn * extra,
            mean(|f| f.rate) + c_bn * earth,
        ));
    }
    let (samples, rate_bias, earlier_bias) = sensors(&truth, &rates, sheet, &mut random);
    let fixes = fixes(&truth, sheet, &mut random);
    Ok(CityDrive {
        samples,
        fixes,
        truth,
        rate_bias,
        earlier_bias,
    })
}

fn truth(rows: &[super::TruthRow], rest: &Geodetic, turn: &Matrix3<f64>) -> Vec<BoxTruth> {
    let heading = turn.m21.atan2(turn.m11);
    let whole = rows.iter().skip(BINS).step_by(BINS);
    whole
        .map(|row| BoxTruth {
            t_s: row.t_s,
            place: rest.moved(&(turn * Vector3::from(row.position))),
            v_n: turn * Vector3::from(row.velocity),
            angles: [
                row.roll,
                row.pitch,
                (row.heading + heading).rem_euclid(std::f64::consts::TAU),
            ],
            speed: row.speed,
        })
        .collect()
}

fn sensors(
    truth: &[BoxTruth],
    felt: &[(Vector3<f64>, Vector3<f64>)],
    sheet: &BoxSheet,
    random: &mut Random,
) -> (Vec<BoxSample>, Vec<Vector3<f64>>, Vector3<f64>) {
    let accel_bias = Vector3::from(random.normals(sheet.accel_bias));
    let accel_scale = Vector3::from(random.normals(sheet.accel_scale)).add_scalar(1.0);
    let earlier = Vector3::from(random.normals(sheet.rate_bias));
    let mut rate_bias =
        earlier + Vector3::from(random.normals(sheet.rate_drift * EARLIER_S.sqrt()));
    let mut biases = Vec::with_capacity(truth.len());
    let walk = sheet.rate_drift / num::real(IMU_HZ).sqrt();
    let rate_scale = Vector3::from(random.normals(sheet.rate_scale)).add_scalar(1.0);
    let tilt = random.normals(sheet.mounting);
    let mounting = Rot::from_euler(tilt[0], tilt[1], tilt[2]).m.transpose();
    let mut shaken = 0.0;
    let samples = truth.iter().zip(felt).map(|(state, (force, rate))| {
        let moving = usize::from(state.speed.abs() > 0.05);
        // Vibration comes and goes with the speed, not at once.
        shaken += 0.05 * (num::real(moving) - shaken);
        let noise = |variance: &[[f64; 3]; 2], random: &mut Random| {
            let axis = |i: usize| variance[0][i] + shaken * (variance[1][i] - variance[0][i]);
            Vector3::from([0, 1, 2].map(|i| axis(i).sqrt() * random.normal()))
        };
        let idle = Vector3::from(random.normals(sheet.idle)) * (1.0 - shaken);
        let accel = (mounting * force).component_mul(&accel_scale)
            + accel_bias
            + noise(&sheet.accel_variance, random)
            + idle;
        rate_bias += Vector3::from(random.normals(walk));
        biases.push(rate_bias);
        let mut rate = (mounting * rate).component_mul(&rate_scale)
            + rate_bias
            + noise(&sheet.rate_variance, random);
        if let Some(wrap) = sheet.rate_wrap {
            rate = rate.map(|w| (w + wrap).rem_euclid(2.0 * wrap) - wrap);
        }
        BoxSample {
            t_s: state.t_s,
            accel,
            rate,
        }
    });
    let samples = samples.collect();
    (samples, biases, earlier)
}

fn fixes(truth: &[BoxTruth], sheet: &BoxSheet, random: &mut Random) -> Vec<BoxFix> {
    let (share, time) = sheet.fix_slow;
    let mut slow = [0, 1, 2].map(|i| Correlated::new(sheet.fix[i] * share.sqrt(), time, random));
    let mut out = Vec::new();
    for state in truth.iter().step_by(IMU_HZ) {
        let mut off = Vector3::zeros();
        for (axis, process) in slow.iter_mut().enumerate() {
            let mut value = 0.0;
            for _ in 0..50 {
                value = process.step(0.02, random);
            }
            off[axis] = value + sheet.fix[axis] * (1.0 - share).sqrt() * random.normal();
        }
        let v = Vector3::from([0, 1, 2].map(|i| sheet.fix_speed[i] * random.normal()));
        out.push(BoxFix {
            t_s: state.t_s + sheet.latency_s,
            place: state.place.moved(&off),
            v_n: state.v_n + v,
        });
    }
    out
}
