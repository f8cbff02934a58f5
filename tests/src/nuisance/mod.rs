//! Hours of driving without a crash, straight into the trigger: unrounded samples, and peaks frame by frame.
//!
//! A drive is half an hour: a car with its own sensor (bias to 0.3 m/s^2 drifting by 0.1 m/s^2, mounting 1 to 2
//! degrees off, noise), kept on a route of standing, cruising, braking and parking ([`route`]), with the shocks of
//! [`events`] on top in steps of 1 ms. Gravity comes in by the slope of the road and by the body's
//! pitch and roll on its springs. Three sensors take turns: frames of 1 kHz that are means, of 100 Hz that are means, and
//! of 100 Hz that are points (what a sensor without a filter does). Frames are lost for up to 3 s, and
//! values stand still for up to 20 s. Each half hour the machine starts anew, as the car does.

pub mod events;
pub mod route;
pub mod wave;

use std::collections::BTreeMap;
use std::f64::consts::PI;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use reconstruct::simulate::{Class, Scenario, simulate};
use recorder::sampler::Peak;
use recorder::trigger::{Action, Fired, Input, Rules, State};
use schema::Sample;
use schema::num::{real, round_i64, round_usize};
use schema::units::STANDARD_GRAVITY as G;

use crate::crash;
use events::Kind;
use route::{Motion, Route, STEP};
use wave::{normal, pick, sign};

/// Length of a drive, s.
pub const DRIVE_S: f64 = 1800.0;
/// Steps of 1 ms in a sample.
const FINE: usize = 10;
/// Samples of the 150 ms window.
const WINDOW: usize = 15;
/// A shock is looked for so long before the largest values, s.
const RECENT: f64 = 4.0;
/// Vibration of a 10 ms mean on a good road at 25 m/s, m/s^2.
const VIBRATION: f64 = 0.3;

/// The rules that a configuration with the default triggers gives.
pub fn rules() -> Rules {
    let simulated = simulate(&Scenario::draw(Class::Still, 1)).unwrap();
    Rules::of(&crash::settings(&simulated, &[]))
}

/// A trigger in a drive.
#[derive(Clone, Debug)]
pub struct False {
    /// Seed of the drive.
    pub seed: u64,
    /// s from its begin.
    pub t: f64,
    /// What fired.
    pub fired: Fired,
    /// What was met last.
    pub near: Vec<&'static str>,
}

/// A largest value and what was met shortly before.
#[derive(Clone, Debug, Default)]
pub struct Largest {
    /// km/h or g.
    pub value: f64,
    /// Names of the events.
    pub near: Vec<&'static str>,
}

impl Largest {
    fn take(&mut self, value: f64, near: impl FnOnce() -> Vec<&'static str>) {
        if value > self.value {
            *self = Self {
                value,
                near: near(),
            };
        }
    }

    /// The larger of both.
    pub fn merge(&mut self, other: &Self) {
        if other.value > self.value {
            self.clone_from(other);
        }
    }
}

/// What drives showed.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Hours.
    pub hours: f64,
    /// Events met, by kind.
    pub met: BTreeMap<Kind, usize>,
    /// Triggers.
    pub fired: Vec<False>,
    /// Largest true change of velocity within 150 ms, without gravity and errors, km/h.
    pub truth: Largest,
    /// Largest change of velocity within 150 ms that the trigger saw, km/h.
    pub seen: Largest,
    /// Largest frame, g.
    pub frame: Largest,
}

impl Outcome {
    /// Adds another's.
    pub fn merge(&mut self, other: Self) {
        self.hours += other.hours;
        for (kind, count) in other.met {
            *self.met.entry(kind).or_default() += count;
        }
        self.fired.extend(other.fired);
        self.truth.merge(&other.truth);
        self.seen.merge(&other.seen);
        self.frame.merge(&other.frame);
    }
}

/// The sensor of a drive.
struct Sensor {
    bias: [f64; 3],
    drift: [f64; 3],
    mounting: [f64; 3],
    pitch_per: f64,
    roll_per: f64,
    /// 0: 1 kHz means, 1: 100 Hz means, 2: 100 Hz points.
    kind: u64,
    wheels: bool,
    outage: f64,
    outage_end: f64,
    stuck: f64,
    stuck_end: f64,
    held: [f64; 3],
}

impl Sensor {
    fn draw(seed: u64, r: &mut ChaCha8Rng) -> Self {
        Self {
            bias: [0; 3].map(|_| sign(r) * pick(r, 0.1, 0.3)),
            drift: [0; 3].map(|_| pick(r, -0.1, 0.1)),
            mounting: [0; 3].map(|_| sign(r) * pick(r, 1.0, 2.0_f64).to_radians()),
            pitch_per: pick(r, 0.15, 0.3_f64).to_radians(),
            roll_per: pick(r, 0.3, 0.6_f64).to_radians(),
            kind: seed % 3,
            wheels: !seed.is_multiple_of(5),
            outage: pick(r, 30.0, 600.0),
            outage_end: 0.0,
            stuck: pick(r, 60.0, 1200.0),
            stuck_end: 0.0,
            held: [0.0; 3],
        }
    }

    /// What a perfect one turned by the mounting feels, plus bias.
    fn feel(&self, t: f64, accel: [f64; 3], motion: &Motion) -> [f64; 3] {
        let pitch = motion.slope[0] + self.pitch_per * motion.accel[0];
        let roll = motion.slope[1] - self.roll_per * motion.accel[1];
        let force = [
            accel[0] + G * pitch.sin(),
            accel[1] - G * roll.sin() * pitch.cos(),
            accel[2] - G * roll.cos() * pitch.cos(),
        ];
        let [a, b, c] = self.mounting;
        let [x, y, z] = force;
        // Small turns: sin is the angle, cos is one.
        let turned = [x + c * y - b * z, y - c * x + a * z, z + b * x - a * y];
        let part = (t / 600.0).min(1.0);
        [0, 1, 2].map(|i| turned[i] + self.bias[i] + self.drift[i] * part)
    }
}

/// One drive of [`DRIVE_S`] seconds.
pub fn drive(seed: u64, rules: &Rules) -> Outcome {
    let mut r = ChaCha8Rng::seed_from_u64(seed);
    let mut sensor = Sensor::draw(seed, &mut r);
    let mut route = Route::new(&mut r);
    let mut state = State::default();
    let mut outcome = Outcome::default();
    let mut window = [[0.0; 2]; WINDOW];
    let count = round_usize(DRIVE_S / STEP);
    for k in 0..count {
        let t = real(k) * STEP;
        let index = schema::num::u64_of(k);
        let motion = route.step(t, &mut r);
        let shake = VIBRATION * (motion.speed / 25.0).min(1.2) * motion.rough + 0.02;
        let fine = sensor.kind == 0 || !route.waves.quiet(t);
        let steps = if fine { FINE } else { 1 };
        let (mut mean, mut own) = ([0.0; 3], [0.0; 3]);
        for step in 1..=steps {
            let at = t + STEP * real(step) / real(steps);
            let shock = if fine {
                route.waves.at(at - STEP / real(2 * steps))
            } else {
                [0.0; 3]
            };
            let accel = [
                motion.accel[0] + shock[0],
                motion.accel[1] + shock[1],
                shock[2],
            ];
            let noise = shake * real(steps).sqrt();
            let mut felt = sensor.feel(at, accel, &motion);
            for value in &mut felt {
                *value += noise * normal(&mut r);
            }
            for axis in 0..3 {
                mean[axis] += felt[axis] / real(steps);
                own[axis] += accel[axis] / real(steps);
            }
            if sensor.kind == 2 && step == steps {
                // A point is as noisy as a frame of 1 ms would be.
                mean = felt;
            }
            if sensor.kind == 0 {
                frame(at, felt, rules, &mut state, seed, &route, &mut outcome);
            }
        }
        if sensor.kind > 0 {
            frame(
                t + STEP,
                mean,
                rules,
                &mut state,
                seed,
                &route,
                &mut outcome,
            );
        }
        window[k % WINDOW] = [own[0], own[1]];
        for axis in 0..2 {
            let sum: f64 = window.iter().map(|own| own[axis]).sum();
            outcome
                .truth
                .take(sum.abs() * STEP * 3.6, || near(&route, t));
        }
        let sample = sample(&mut sensor, t, mean, &motion, k, &mut r);
        let before = state.largest_delta_v();
        let (next, action) = state.step(&Input::Sample(index, &sample), rules);
        state = next;
        if state.largest_delta_v() > before {
            outcome
                .seen
                .take(state.largest_delta_v() * 3.6, || near(&route, t));
        }
        note(action, t, seed, &route, &mut outcome);
    }
    for (_, kind) in &route.met {
        *outcome.met.entry(*kind).or_default() += 1;
    }
    outcome.hours = DRIVE_S / 3600.0;
    outcome
}

/// A frame: the trigger is told of it if it is large.
fn frame(
    t: f64,
    felt: [f64; 3],
    rules: &Rules,
    state: &mut State,
    seed: u64,
    route: &Route,
    outcome: &mut Outcome,
) {
    let value = felt.iter().map(|x| x * x).sum::<f64>().sqrt();
    outcome.frame.take(value / G, || near(route, t));
    if rules.peak.is_some_and(|threshold| value >= threshold) {
        let peak = Peak {
            time_ns: round_i64(t * 1e9),
            value,
            axis: 0,
        };
        let (next, action) = state.step(&Input::Peak(peak), rules);
        *state = next;
        note(action, t, seed, route, outcome);
    }
}

fn note(action: Action, t: f64, seed: u64, route: &Route, outcome: &mut Outcome) {
    if let Action::Open(fired)
    | Action::OpenNext(fired)
    | Action::Mark(fired)
    | Action::MarkNext(fired) = action
    {
        let near = near(route, t);
        outcome.fired.push(False {
            seed,
            t,
            fired,
            near,
        });
    }
}

fn near(route: &Route, t: f64) -> Vec<&'static str> {
    let recent = route.met.iter().rev().take(6);
    recent
        .filter(|(at, _)| (0.0..RECENT).contains(&(t - at)))
        .map(|(_, kind)| kind.name())
        .collect()
}

/// The sample of a bin, with the sensor's outages.
fn sample(
    sensor: &mut Sensor,
    t: f64,
    mean: [f64; 3],
    motion: &Motion,
    k: usize,
    r: &mut ChaCha8Rng,
) -> Sample {
    if t >= sensor.outage {
        (sensor.outage_end, sensor.outage) = (t + pick(r, 0.03, 3.0), t + pick(r, 60.0, 900.0));
    }
    if t >= sensor.stuck {
        (sensor.stuck_end, sensor.stuck) = (t + pick(r, 0.2, 20.0), t + pick(r, 300.0, 1800.0));
    }
    if t >= sensor.stuck_end {
        sensor.held = mean;
    }
    let rate = motion.accel[1] / motion.speed.max(3.0);
    let there = t >= sensor.outage_end;
    // Under ABS the wheels turn up to 15 % too slowly, to and fro, each in its own time.
    let braking = ((-motion.accel[0] - 5.0) / 2.0).clamp(0.0, 1.0);
    let wheels = [9.0, 11.0].map(|hz: f64| {
        let slip = 0.15 * braking * (0.5 + 0.5 * (2.0 * PI * hz * t).sin());
        (sensor.wheels && k.is_multiple_of(2))
            .then(|| (motion.speed * (1.0 - slip) * 100.0).round() / 100.0)
    });
    Sample {
        wheels,
        accel: sensor.held.map(|value| there.then_some(value)),
        rate: [0.0, 0.0, rate].map(|value| there.then_some(value + 0.003 * normal(r))),
    }
}
