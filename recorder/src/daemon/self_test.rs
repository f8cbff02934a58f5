//! The self-test: does each sensor tell what the car does? From the samples since the last one: noise and gravity at
//! rest, signals that never change while the car moves, the turn of the wheels against that of the gyro.

use schema::Sample;
use schema::units::STANDARD_GRAVITY;

use crate::config::Settings;
use crate::moments::Moments;
use crate::rest::{Rest, RestLimits};
use crate::trigger::Rules;

const AXES: [&str; 6] = [
    "accel x", "accel y", "accel z", "rate x", "rate y", "rate z",
];
const SIDES: [&str; 2] = ["wheel-left", "wheel-right"];
/// Samples in a row with exactly one value, while the car moves, that make a signal stuck.
const STUCK: u32 = 1000;
/// The car moves, m/s.
const MOVING: f64 = 3.0;
/// Wheels and gyro are compared above this speed, m/s, and this turn, rad/s.
const TURN_SPEED: f64 = 4.0;
const TURN_RATE: f64 = 0.05;
/// Samples at rest, or in turns, that are enough to judge by.
const ENOUGH: f64 = 300.0;
/// A wheel's value is used for so many samples.
const WHEEL_AGE: u32 = 20;
/// No gravity is too far off for rest, m/s^2.
const ANY_BIAS: f64 = 100.0;
/// Largest noise at rest that a working sensor has, m/s^2 and rad/s: an idling engine shakes one by 0.65 m/s^2.
const NOISY_ACCEL: f64 = 3.0;
const NOISY_RATE: f64 = 0.1;

/// Exactly one value, how often in a row.
#[derive(Clone, Copy, Debug)]
struct Run {
    value: f64,
    count: u32,
    longest: u32,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            value: f64::NAN,
            count: 0,
            longest: 0,
        }
    }
}

impl Run {
    fn add(&mut self, value: f64, moving: bool) {
        if value.to_bits() == self.value.to_bits() && moving {
            self.count += 1;
        } else {
            self.count = 0;
        }
        self.value = value;
        self.longest = self.longest.max(self.count);
    }
}

/// One result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finding {
    /// It is as it should be.
    Good(String),
    /// It is not.
    Fault(String),
    /// There was nothing to tell it by.
    Unknown(String),
}

impl Finding {
    /// The sentence, with the verdict before it.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Good(text) => format!("good: {text}"),
            Self::Fault(text) => format!("FAULT: {text}"),
            Self::Unknown(text) => format!("cannot tell: {text}"),
        }
    }
}

/// What was seen since the last test.
#[derive(Clone, Debug)]
pub struct SelfTest {
    limits: RestLimits,
    track_m: f64,
    accel_bias: f64,
    wheels: bool,
    rest: Rest,
    at_rest: [Moments; 6],
    gravity: Moments,
    runs: [Run; 6],
    wheel_runs: [Run; 2],
    last_wheel: [(f64, u32); 2],
    /// Sums over turns: wheels squared, wheels times gyro, and how many.
    turn: [f64; 3],
    moved: u32,
}

impl SelfTest {
    /// With nothing seen yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self {
            limits: RestLimits {
                // A sensor whose gravity is wrong must not for that reason look as if the car moved.
                accel_bias: ANY_BIAS,
                ..Rules::of(settings).rest
            },
            track_m: settings.vehicle.track_width_m,
            accel_bias: settings.imu.accel_bias,
            wheels: settings.wheels.present,
            rest: Rest::default(),
            at_rest: [Moments::default(); 6],
            gravity: Moments::default(),
            runs: [Run::default(); 6],
            wheel_runs: [Run::default(); 2],
            last_wheel: [(0.0, u32::MAX); 2],
            turn: [0.0; 3],
            moved: 0,
        }
    }

    /// Takes the next sample, unrounded.
    pub fn sample(&mut self, sample: &Sample) {
        self.rest = self.rest.step(sample, &self.limits);
        for ((last, run), value) in self
            .last_wheel
            .iter_mut()
            .zip(&mut self.wheel_runs)
            .zip(sample.wheels)
        {
            match value {
                Some(value) => {
                    *last = (value, 0);
                    run.add(value, value > MOVING);
                }
                None => last.1 = last.1.saturating_add(1),
            }
        }
        let [(left, left_age), (right, right_age)] = self.last_wheel;
        let known = left_age < WHEEL_AGE && right_age < WHEEL_AGE;
        let speed = if known {
            f64::midpoint(left, right)
        } else {
            0.0
        };
        self.moved = self.moved.saturating_add(u32::from(speed > MOVING));
        let axes = sample.accel.iter().chain(&sample.rate);
        for ((run, moments), value) in self.runs.iter_mut().zip(&mut self.at_rest).zip(axes) {
            let Some(value) = value else { continue };
            run.add(*value, speed > MOVING);
            if self.rest.at_rest() {
                moments.add(*value);
            }
        }
        if let ([Some(x), Some(y), Some(z)], true) = (sample.accel, self.rest.at_rest()) {
            self.gravity.add((x * x + y * y + z * z).sqrt());
        }
        if let (Some(yaw), true) = (sample.rate[2], known && speed > TURN_SPEED) {
            // Body z is down, so a turn to the right is positive and the left wheel the faster one.
            let wheels = (left - right) / self.track_m;
            if wheels.abs() > TURN_RATE || yaw.abs() > TURN_RATE {
                let [square, product, count] = &mut self.turn;
                *square += wheels * wheels;
                *product += wheels * yaw;
                *count += 1.0;
            }
        }
    }

    /// The results; the next test begins.
    pub fn finish(&mut self) -> Vec<Finding> {
        let mut findings = Vec::new();
        self.noise(&mut findings);
        self.stuck(&mut findings);
        if self.wheels {
            findings.push(self.wheels_and_gyro());
        }
        *self = Self {
            rest: self.rest,
            runs: self.runs,
            wheel_runs: self.wheel_runs,
            last_wheel: self.last_wheel,
            at_rest: [Moments::default(); 6],
            gravity: Moments::default(),
            turn: [0.0; 3],
            moved: 0,
            ..*self
        };
        for run in self.runs.iter_mut().chain(&mut self.wheel_runs) {
            run.longest = run.count;
        }
        findings
    }

    fn noise(&self, findings: &mut Vec<Finding>) {
        if self.gravity.count() < ENOUGH {
            findings.push(Finding::Unknown(
                "noise and gravity: the car was not at rest for 3 s".to_owned(),
            ));
            return;
        }
        let off = self.gravity.mean() - STANDARD_GRAVITY;
        let allowed = 0.1 + 3.0 * self.accel_bias;
        let text = format!(
            "gravity at rest {:.3} m/s^2, {off:+.3} from the standard (allowed {allowed:.2})",
            self.gravity.mean()
        );
        findings.push(if off.abs() <= allowed {
            Finding::Good(text)
        } else {
            Finding::Fault(text)
        });
        let [ax, ay, az, wx, wy, wz] = self.at_rest.map(|moments| moments.sd());
        let (accel, rate) = (ax.max(ay).max(az), wx.max(wy).max(wz));
        let text = format!(
            "noise at rest {accel:.4} m/s^2 and {:.4} deg/s",
            rate.to_degrees()
        );
        findings.push(if accel <= NOISY_ACCEL && rate <= NOISY_RATE {
            Finding::Good(text)
        } else {
            Finding::Fault(text)
        });
    }

    fn stuck(&self, findings: &mut Vec<Finding>) {
        let named = AXES
            .iter()
            .zip(&self.runs)
            .chain(SIDES.iter().zip(&self.wheel_runs));
        let mut found = false;
        for (name, run) in named {
            // A wheel comes in some of the samples only: a tenth as many values are as long a time.
            let limit = if name.starts_with("wheel") {
                STUCK / 5
            } else {
                STUCK
            };
            if run.longest >= limit {
                found = true;
                findings.push(Finding::Fault(format!(
                    "{name} had exactly one value for {} samples while the car moved",
                    run.longest
                )));
            }
        }
        if found {
            return;
        }
        findings.push(if f64::from(self.moved) < 2.0 * f64::from(STUCK) {
            Finding::Unknown("stuck signals: the car did not move for 20 s".to_owned())
        } else {
            Finding::Good("no signal is stuck".to_owned())
        });
    }

    fn wheels_and_gyro(&self) -> Finding {
        let [square, product, count] = self.turn;
        if count < ENOUGH || square <= 0.0 {
            return Finding::Unknown("wheels against gyro: no turns for 3 s".to_owned());
        }
        let ratio = product / square;
        let text = format!(
            "the gyro's turn is {ratio:.2} of the wheels' over {:.0} s",
            count / 100.0
        );
        if (0.7..=1.4).contains(&ratio) {
            Finding::Good(text)
        } else if ratio < -0.5 {
            Finding::Fault(format!(
                "{text}: left and right wheel are exchanged, or an axis points the other way"
            ))
        } else {
            Finding::Fault(text)
        }
    }
}
