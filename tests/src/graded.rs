//! Crashes graded evenly by their change of velocity, and what the recorder's triggers make of each.
//!
//! The size of a crash is the largest change of velocity of the IMU's true motion, forward or to the right in
//! the body's axes, within any 150 ms (49 CFR 563, UN R160). It is drawn evenly; class, car, road, braking and
//! sensor errors are those of the simulator, with more of what makes a trigger's life hard: slopes to
//! 10 %, pulses of 60 to 200 ms from nearly square to haversine, front-loaded, with ripple, cars struck while they
//! stand, cars without wheel speeds, three rates of frames, two ranges of the sensor, up to twice the vibration.

use nalgebra::{Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reconstruct::simulate::errors::Burst;
use reconstruct::simulate::scenario::SpeedTarget;
use reconstruct::simulate::{Class, Pulse, Scenario, Simulated, simulate};
use schema::num::{real_i64, round_i64};
use schema::parts::TriggerKind;
use schema::units::STANDARD_GRAVITY;

use crate::{crash, pipeline};

/// Classes, in turn.
pub const CLASSES: [Class; 4] = [Class::Frontal, Class::Oblique, Class::Side, Class::Rear];
/// Rates of the IMU's frames, in turn, Hz.
pub const RATES: [usize; 3] = [100, 200, 1000];
/// Range of the small sensor, g: it can not see the peak threshold.
pub const SMALL_RANGE_G: f64 = 16.0;
/// Sizes are drawn evenly between these, km/h.
pub const SIZES: (f64, f64) = (4.0, 82.0);
/// The same for a closer look at the threshold, km/h.
pub const NEAR: (f64, f64) = (6.5, 9.5);
/// The drive before the impact is cut to begin so much later than the simulator has it, s.
const CUT: f64 = 22.0;
/// A trigger so long after the contact still is that of the crash, s.
const LATEST: f64 = 0.5;
/// And so long before it (a frame's period and jitter), s.
const EARLIEST: f64 = -0.02;

/// What became of one crash.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Seed.
    pub seed: u64,
    /// Class.
    pub class: Class,
    /// Rate of the IMU's frames, Hz.
    pub imu_hz: usize,
    /// True if the sensor's range is the small one.
    pub small_range: bool,
    /// Its true size, km/h.
    pub size_kmh: f64,
    /// Length of the pulse, s.
    pub duration: f64,
    /// From contact to the peak trigger, s.
    pub peak: Option<f64>,
    /// From contact to the delta-V trigger, s.
    pub delta_v: Option<f64>,
    /// Triggers before the contact, s before it.
    pub false_triggers: Vec<f64>,
    /// Largest change of speed within 150 ms that the trigger saw, km/h.
    pub seen_kmh: f64,
    /// Hours driven before the contact.
    pub hours: f64,
}

impl Outcome {
    /// The first of both triggers.
    pub fn either(&self) -> Option<f64> {
        match (self.peak, self.delta_v) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }
}

/// One car in five sends no wheel speeds.
pub fn has_wheels(seed: u64) -> bool {
    !seed.is_multiple_of(5)
}

/// The scenario of a seed, its size drawn between two figures (km/h).
pub fn scenario(seed: u64, sizes: (f64, f64)) -> Scenario {
    let turn = |n: u64| usize::try_from(seed % n).unwrap();
    let class = CLASSES[turn(4)];
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut pick = |low: f64, high: f64| random.random_range(low..high);
    let mut scenario = Scenario::draw(class, seed);
    scenario.imu_hz = RATES[turn(3)];
    if pick(0.0, 1.0) < 1.0 / 3.0 {
        let range = Some(SMALL_RANGE_G * STANDARD_GRAVITY);
        (scenario.errors.accel_range, scenario.sheet.accel_range) = (range, range);
    }
    let shake = pick(0.5, 2.0);
    scenario.errors.accel_vibration *= shake;
    scenario.errors.rate_vibration *= shake;
    scenario.road.pitch_sd = pick(0.5, 5.0_f64).to_radians();
    if !has_wheels(seed) {
        scenario.errors.wheel_bursts = vec![Burst {
            t: -1.0,
            duration: 1e4,
        }];
    }
    let size = pick(sizes.0, sizes.1);

    let plan = &mut scenario.manoeuvre;
    let before = plan.speeds.iter().rfind(|target| target.t <= CUT);
    plan.start_speed = before.map_or(plan.start_speed, |target| target.speed);
    plan.speeds.retain(|target| target.t > CUT);
    for target in &mut plan.speeds {
        target.t -= CUT;
    }
    let (braked, stands) = (pick(0.0, 1.0) < 0.6, pick(0.0, 1.0) < 0.5);
    if let Some(braking) = &mut plan.braking {
        braking.t -= CUT;
    }
    if !braked {
        plan.braking = None;
    }
    if class == Class::Rear && stands {
        plan.start_speed = 14.0;
        plan.braking = None;
        plan.speeds = vec![SpeedTarget { t: 1.0, speed: 0.0 }];
        plan.drive_decel = 2.5;
    }
    plan.rest = 2.5;
    for impact in &mut plan.impacts {
        impact.t -= CUT;
        let [forward, right] = impact.delta_v;
        let gain = size / 3.6 / forward.abs().max(right.abs());
        impact.delta_v = [forward * gain, right * gain];
        // A small impact turns the car little.
        let part = (size / 40.0).min(1.0);
        impact.spin *= part;
        impact.kick = impact.kick.map(|kick| kick * part);
        impact.pulse = Pulse {
            duration: pick(0.06, 0.20),
            main: pick(0.45, 1.0),
            exponent: pick(0.5, 2.0),
            rebound: pick(0.0, 0.35),
            ripple: pick(0.0, 0.4),
            ripple_hz: pick(30.0, 150.0),
        };
    }
    scenario
}

/// The true size: see the module, km/h.
pub fn size_kmh(simulated: &Simulated) -> f64 {
    const WINDOW: usize = 15;
    let steps: Vec<[f64; 2]> = simulated
        .truth
        .rows
        .windows(2)
        .map(|pair| {
            let (a, b) = (&pair[0], &pair[1]);
            let change = Vector3::from(b.velocity) - Vector3::from(a.velocity);
            let body = (attitude(a).inverse() * change + attitude(b).inverse() * change) / 2.0;
            [body.x, body.y]
        })
        .collect();
    let mut largest = 0.0_f64;
    for window in steps.windows(WINDOW) {
        for axis in 0..2 {
            largest = largest.max(window.iter().map(|step| step[axis]).sum::<f64>().abs());
        }
    }
    largest * 3.6
}

fn attitude(row: &reconstruct::simulate::TruthRow) -> Rotation3<f64> {
    Rotation3::from_euler_angles(row.roll, row.pitch, row.heading)
}

/// Simulates the crash of a seed and plays its frames through the recorder.
pub fn run(seed: u64, sizes: (f64, f64)) -> Outcome {
    let simulated = simulate(&scenario(seed, sizes)).unwrap();
    let range = simulated.scenario.sheet.accel_range;
    let small_range = range.is_some_and(|range| range < 50.0 * STANDARD_GRAVITY);
    let changes: &[(&str, &str)] = if small_range {
        &[("peak_g = 50", "peak_g = false")]
    } else {
        &[]
    };
    let settings = crash::settings(&simulated, changes);
    let replayed = pipeline::record(&settings, simulated.candump(), &[]);
    let impact = &simulated.truth.facts.impacts[0];
    let contact_ns =
        simulated.truth.facts.start_unix_s * 1_000_000_000 + round_i64(impact.t_s * 1e9);
    let (mut peak, mut delta_v, mut early) = (None::<f64>, None::<f64>, Vec::new());
    for record in &replayed.records {
        for trigger in &record.triggers {
            let utc = trigger.monotonic_ns + record.header.clock.offset_ns;
            let after = real_i64(utc - contact_ns) * 1e-9;
            if after < EARLIEST {
                early.push(-after);
            } else if after <= LATEST {
                let slot = match trigger.kind {
                    TriggerKind::Peak => &mut peak,
                    _ => &mut delta_v,
                };
                *slot = Some(slot.map_or(after, |first| first.min(after)));
            }
        }
    }
    Outcome {
        seed,
        class: simulated.scenario.class,
        imu_hz: simulated.scenario.imu_hz,
        small_range,
        size_kmh: size_kmh(&simulated),
        duration: impact.duration_s,
        peak,
        delta_v,
        false_triggers: early,
        seen_kmh: replayed.outcome.totals.largest_delta_v * 3.6,
        hours: impact.t_s / 3600.0,
    }
}
