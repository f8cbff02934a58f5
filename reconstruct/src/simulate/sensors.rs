//! What the sensors put out: IMU frames that are means over their period, wheel frames late and coarse.

use nalgebra::{Matrix3, Vector3};
use schema::num;

use super::errors::{Burst, Errors};
use super::motion::{Motion, STEPS_PER_BIN, STEPS_PER_SECOND, node_time};
use super::process::Vibration;
use super::random::{Random, Stream};
use super::rigid::{Rigid, rotation};
use super::scenario::Scenario;

/// Resolution of an acceleration on the bus, m/s^2.
pub(super) const ACCEL_STEP: f64 = 0.002;
/// Resolution of a rate on the bus, deg/s.
pub(super) const RATE_STEP_DEGPS: f64 = 0.002;
/// Resolution of a wheel speed on the bus, km/h.
pub(super) const WHEEL_STEP_KMH: f64 = 0.01;
/// Speed at which the vibration has its stated size, m/s.
const VIBRATION_SPEED: f64 = 25.0;
/// The vibration grows no further beyond this multiple of that speed.
const VIBRATION_MOST: f64 = 1.2;

/// One period of the IMU: accelerometer and gyro frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuFrame {
    /// End of the period the values are means of, s of the log.
    pub t: f64,
    /// Step (of 0.5 ms) after the last of the period; steps count from -10 ms.
    pub(super) end: usize,
    /// Specific force as put out, body axes, m/s^2.
    pub accel: [f64; 3],
    /// Rate as put out, body axes, rad/s.
    pub rate: [f64; 3],
    /// The accelerometer frame does not reach the bus.
    pub accel_lost: bool,
    /// The gyro frame does not reach the bus.
    pub rate_lost: bool,
    /// At least one of the six values stands at its sensor's range.
    pub clipped: bool,
}

/// One frame of the wheel speed sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelFrame {
    /// Time of sending, s of the log.
    pub t: f64,
    /// Left and right as put out, m/s, not negative.
    pub speed: [f64; 2],
    /// The frame does not reach the bus.
    pub lost: bool,
}

fn in_burst(bursts: &[Burst], t: f64) -> bool {
    bursts
        .iter()
        .any(|burst| t >= burst.t && t < burst.t + burst.duration)
}

/// Output of one axis for the true input `x`.
fn distort(x: f64, bias: f64, scale: f64, second: f64, asymmetry: f64) -> f64 {
    let side = if x < 0.0 { -0.5 } else { 0.5 };
    x * (1.0 + scale + second * x + side * asymmetry) + bias
}

fn clip(value: &mut f64, range: Option<f64>) -> bool {
    match range {
        Some(range) if value.abs() >= range => {
            *value = value.clamp(-range, range);
            true
        }
        _ => false,
    }
}

fn quantise(value: &mut f64, step: f64) {
    *value = (*value / step).round() * step;
}

struct Noise {
    random: Random,
    accel: [Vibration; 3],
    rate: [Vibration; 3],
    accel_white: f64,
    rate_white: f64,
    white_share: f64,
}

impl Noise {
    fn new(scenario: &Scenario) -> Self {
        let period = 1.0 / num::real(scenario.imu_hz);
        let mut random = Random::new(scenario.class, scenario.sensor_seed, Stream::Imu);
        let mut vibration = || Vibration::new(period, random.range(10.0, 14.0));
        let (accel, rate) = ([(); 3].map(|()| vibration()), [(); 3].map(|()| vibration()));
        Self {
            random,
            accel,
            rate,
            accel_white: scenario.errors.accel_density / period.sqrt(),
            rate_white: scenario.errors.rate_density / period.sqrt(),
            white_share: Vibration::white_variance(period),
        }
    }

    /// Noise of the next frame at `speed`: vibration (part of the motion felt) and sensor noise.
    fn step(&mut self, errors: &Errors, speed: f64) -> [[f64; 3]; 4] {
        let share = (speed / VIBRATION_SPEED).min(VIBRATION_MOST);
        let white = self.white_share.sqrt();
        let random = &mut self.random;
        let mut shake = |vibration: &mut [Vibration; 3], sd: f64| {
            [0, 1, 2].map(|i| {
                let value = white * random.normal() + vibration[i].step(random);
                value * share * sd
            })
        };
        let accel = shake(&mut self.accel, errors.accel_vibration);
        let rate = shake(&mut self.rate, errors.rate_vibration);
        [
            accel,
            rate,
            self.random.normals(self.accel_white),
            self.random.normals(self.rate_white),
        ]
    }
}

/// The IMU's frames, from the first period of the log to the last.
pub(super) fn imu_frames(scenario: &Scenario, rigid: &Rigid, steps: usize) -> Vec<ImuFrame> {
    let errors = &scenario.errors;
    let length = STEPS_PER_SECOND / scenario.imu_hz;
    let to_sensor: Matrix3<f64> = rotation(errors.mounting).transpose();
    let mut noise = Noise::new(scenario);
    let mut bus = Random::new(scenario.class, scenario.sensor_seed, Stream::Bus);
    let first = STEPS_PER_BIN - (STEPS_PER_BIN / length - 1) * length;
    let mut frames = Vec::with_capacity(steps / length + 1);
    let mut end = first;
    while end <= steps {
        let felt = rigid.felt.get(end - length..end).unwrap_or_default();
        let mut force = Vector3::zeros();
        let mut rate = Vector3::zeros();
        for step in felt {
            force += step.force;
            rate += step.rate;
        }
        let t = node_time(end);
        let speed = rigid.velocity.get(end).map_or(0.0, |v| v.xy().norm());
        let [shake, twist, white_f, white_w] = noise.step(errors, speed);
        let force = to_sensor * (force / num::real(length) + Vector3::from(shake));
        let rate = to_sensor * (rate / num::real(length) + Vector3::from(twist));
        let mut frame = ImuFrame {
            t,
            end,
            accel: [0.0; 3],
            rate: [0.0; 3],
            accel_lost: bus.chance(errors.frame_loss),
            rate_lost: bus.chance(errors.frame_loss),
            clipped: false,
        };
        for i in 0..3 {
            let (mut bias_f, mut bias_w) = (errors.accel_bias[i], errors.rate_bias[i]);
            for (n, impact) in scenario.manoeuvre.impacts.iter().take(2).enumerate() {
                if t >= impact.t + impact.pulse.duration / 2.0 {
                    bias_f += errors.accel_bias_jump[n][i];
                    bias_w += errors.rate_bias_jump[n][i];
                }
            }
            let (scale, second, side) = (
                errors.accel_scale[i],
                errors.accel_second[i],
                errors.accel_asymmetry[i],
            );
            frame.accel[i] = distort(force[i], bias_f, scale, second, side) + white_f[i];
            let (scale, second, side) = (
                errors.rate_scale[i],
                errors.rate_second[i],
                errors.rate_asymmetry[i],
            );
            frame.rate[i] = distort(rate[i], bias_w, scale, second, side) + white_w[i];
            frame.clipped |= clip(&mut frame.accel[i], errors.accel_range);
            frame.clipped |= clip(&mut frame.rate[i], errors.rate_range);
            if errors.quantised {
                quantise(&mut frame.accel[i], ACCEL_STEP);
                quantise(&mut frame.rate[i], RATE_STEP_DEGPS.to_radians());
            }
        }
        if in_burst(&errors.bursts, t) {
            (frame.accel_lost, frame.rate_lost) = (true, true);
        }
        if end <= STEPS_PER_BIN {
            // The log starts with a frame: its time stamp is the log's zero.
            (frame.accel_lost, frame.rate_lost) = (false, false);
        }
        frames.push(frame);
        end += length;
    }
    frames
}

/// The wheel sensors' frames.
pub(super) fn wheel_frames(scenario: &Scenario, motion: &Motion, steps: usize) -> Vec<WheelFrame> {
    let errors = &scenario.errors;
    let mut random = Random::new(scenario.class, scenario.sensor_seed, Stream::Wheels);
    let last = node_time(steps);
    let mut frames = Vec::new();
    let mut t = scenario.wheel_phase.max(1e-3);
    while t < last {
        let speed = wheels_at(motion, t - errors.wheel_latency);
        let speed = [0, 1].map(|i| {
            let noise = random.normal() * errors.wheel_noise;
            let mut value: f64 = speed[i] * (1.0 + errors.wheel_scale[i]);
            if value > 0.0 {
                value = (value + noise).max(0.0);
            }
            if value < errors.wheel_cutoff {
                value = 0.0;
            }
            if errors.quantised {
                quantise(&mut value, WHEEL_STEP_KMH / 3.6);
            }
            value
        });
        let lost = random.chance(errors.frame_loss) || in_burst(&errors.wheel_bursts, t);
        frames.push(WheelFrame { t, speed, lost });
        t += 1.0 / scenario.wheel_hz;
    }
    frames
}

/// True circumferential speeds at time `t`, m/s, without direction.
fn wheels_at(motion: &Motion, t: f64) -> [f64; 2] {
    let x = ((t - node_time(0)) * num::real(STEPS_PER_SECOND)).max(0.0);
    let k = num::usize_of(u64::try_from(num::floor_i64(x)).unwrap_or(0));
    let share = x - num::real(k);
    match (motion.nodes.get(k), motion.nodes.get(k + 1)) {
        (Some(a), Some(b)) => {
            [0, 1].map(|i| (a.wheels[i] + share * (b.wheels[i] - a.wheels[i])).abs())
        }
        _ => motion
            .nodes
            .last()
            .map_or([0.0; 2], |node| node.wheels.map(f64::abs)),
    }
}
