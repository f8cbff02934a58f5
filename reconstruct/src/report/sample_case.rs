//! A made-up crash for the tests of everything a person sees: a curve, braking, an impact, a spin, a slide to rest.

use std::f64::consts::TAU;

use schema::Record;
use schema::header::{
    Clock, ClockSource, Header, ImuSheet, Interface, Layout, Origin, Periods, SourceLog, Vehicle,
    WheelSheet,
};
use schema::num;
use schema::parts::{Clip, ClockStep, Completion, Gap, Health, SignalHealth, Trigger, TriggerKind};
use schema::scale::{TwoSlope, WheelScale};

use crate::findings::{
    Braking, DeltaV, Figure, Impact, ModelAnswer, Reconstruction, Rest, RoadUse, WheelUse,
};
use crate::report::case::{Case, Signature};
use crate::trajectory::State;

pub(crate) fn figure(value: f64, sd: f64) -> Figure {
    Figure {
        value,
        sd,
        low: value - 1.96 * sd,
        high: value + 1.96 * sd,
    }
}

/// Forward and right acceleration and yaw rate of the made-up drive.
fn motion(t: f64, v: f64) -> (f64, f64, f64) {
    match t {
        t if t < -22.0 => (0.25, 0.02 * v, 0.02),
        t if t < -15.0 => (0.4, v * 0.16, 0.16),
        t if t < -9.0 => (0.1, -v * 0.14, -0.14),
        t if t < -1.2 => (-0.1, 0.0, 0.003),
        t if t < -0.012 => (-6.4 + 0.4 * (t * 9.0).sin(), -0.2, 0.01),
        t if t < 0.1 => {
            let shape = (TAU * 0.5 * (t + 0.012) / 0.112).sin();
            (-150.0 * shape, 55.0 * shape, -3.2 * shape)
        }
        t if t < 3.4 && v > 0.05 => (-2.4, 0.9, -2.4 * (1.0 - t / 3.4)),
        _ => (0.0, 0.0, 0.0),
    }
}

/// 30 s before to 8 s after the trigger.
pub(crate) fn reconstruction() -> Reconstruction {
    let dt = 0.01;
    let (mut north, mut east, mut heading, mut speed) = (0.0_f64, 0.0_f64, 0.3_f64, 18.0_f64);
    let mut drift = 0.0_f64;
    let mut states = Vec::new();
    for k in 0..3800_u64 {
        let t = -30.0 + num::real_u64(k) * dt;
        let (forward, right, yaw_rate) = motion(t, speed);
        speed = (speed + forward * dt).max(0.0);
        heading += yaw_rate * dt;
        if (0.1..3.4).contains(&t) {
            drift += 2.4 * (1.0 - t / 3.4) * dt;
        }
        let course = heading + drift;
        north += speed * course.cos() * dt;
        east += speed * course.sin() * dt;
        let age = (3.4 - t).max(0.0);
        let along = 0.02 + 0.004 * age.powf(1.9);
        let across = 0.02 + 0.0025 * age.powf(2.1);
        let (s, c) = course.sin_cos();
        states.push(State {
            index: 1000 + k,
            t_s: t,
            utc_ns: Some(1_700_000_030_000_000_000 + num::round_i64(t * 1e9)),
            position: [north, east, 0.0],
            velocity: [speed * course.cos(), speed * course.sin(), 0.0],
            roll: 0.02,
            pitch: -0.01,
            heading: heading.rem_euclid(TAU),
            speed: speed * drift.cos(),
            ground_speed: speed,
            sideslip: (speed > 1.0).then_some(drift),
            accel: [Some(forward), Some(right), Some(0.1)],
            yaw_rate: Some(yaw_rate),
            sd_north: (along * along * c * c + across * across * s * s).sqrt(),
            sd_east: (along * along * s * s + across * across * c * c).sqrt(),
            cov_north_east: (along * along - across * across) * s * c,
            sd_down: 0.1,
            sd_speed: 0.01 + 0.012 * age,
            sd_heading: 0.002 + 0.0004 * age,
            sd_accel: [0.12, 0.15],
            sd_yaw_rate: 0.01,
            wheels_used: t < -1.8,
            on_earth: None,
            bridged: (-18.4..-18.1).contains(&t),
        });
    }
    let (n0, e0, h0) = (north, east, heading);
    for s in &mut states {
        let (sin, cos) = h0.sin_cos();
        let turn = |n: f64, e: f64| (n * cos + e * sin, e * cos - n * sin);
        let (n, e) = turn(s.position[0] - n0, s.position[1] - e0);
        s.position = [n, e, 0.0];
        let (vn, ve) = turn(s.velocity[0], s.velocity[1]);
        s.velocity = [vn, ve, 0.0];
        s.heading = (s.heading - h0).rem_euclid(TAU);
        let (a, b, c) = (s.sd_north.powi(2), s.sd_east.powi(2), s.cov_north_east);
        s.sd_north = (a * cos * cos + b * sin * sin + 2.0 * c * sin * cos).sqrt();
        s.sd_east = (a * sin * sin + b * cos * cos - 2.0 * c * sin * cos).sqrt();
        s.cov_north_east = (b - a) * sin * cos + c * (cos * cos - sin * sin);
    }
    for s in &mut states[1180..1195] {
        (s.accel, s.yaw_rate) = ([None; 3], None);
    }
    findings(states)
}

fn findings(states: Vec<State>) -> Reconstruction {
    let start = states[0].clone();
    let distance: f64 = states.iter().map(|s| s.ground_speed * 0.01).sum();
    let onset = states.iter().find(|s| s.t_s >= -0.012).unwrap().clone();
    Reconstruction {
        model: "nine-state",
        confidence: 0.95,
        rest: Rest {
            found: true,
            t_s: Some(3.41),
            duration_s: 4.59,
            reason: "accelerations, rates and wheels are still over the last 4.6 s".to_owned(),
        },
        impacts: vec![Impact {
            t_s: figure(-0.012, 0.003),
            speed_mps: figure(onset.speed, 0.09),
            heading_deg: figure(onset.heading.to_degrees(), 0.4),
            north_m: figure(onset.position[0], 0.1),
            east_m: figure(onset.position[1], 0.1),
            cov_north_east_m2: 0.0,
            delta_v: DeltaV {
                longitudinal_mps: figure(-10.7, 0.12),
                lateral_mps: figure(3.9, 0.1),
                resultant_mps: figure(11.39, 0.12),
                pdof_deg: figure(-20.0, 1.4),
                duration_s: figure(0.112, 0.008),
                end_t_s: 0.1,
                point: "cg",
                ..super::sample_details::pulse()
            },
        }],
        braking: Some(Braking {
            onset_t_s: figure(-1.21, 0.03),
            mean_mps2: figure(6.42, 0.05),
            peak_mps2: figure(6.81, 0.08),
        }),
        distance_m: figure(distance, 1.9),
        start_speed_mps: figure(start.speed, 0.21),
        top_speed_mps: figure(23.4, 0.18),
        top_speed_t_s: -9.1,
        models: vec![
            answer("dead-reckoning", &start, 4.1, f64::INFINITY, onset.speed - 0.6),
            answer("published", &start, 1.2, 1.9, onset.speed + 0.08),
            answer("nine-state", &start, 0.0, 1.4, onset.speed),
        ],
        comparisons: vec![super::sample_details::comparison()],
        details: super::sample_details::details(),
        road: RoadUse { samples: 2600, roll: 12, pitch: 0, vertical: 3 },
        wheels: WheelUse { offered: 3400, used: 2480, refused_physics: 610, refused_innovation: 22, below_cutoff: 288 },
        missing_samples: 15,
        clipped_samples: 0,
        rest_pose: None,
        gnss: None,
        map: None,
        limits: vec![
            "Wheel speeds were not used from 1.8 s before the trigger on: under hard braking they read low.".to_owned(),
            "15 samples of the motion sensor are missing between 18.2 and 18.1 s before the trigger and were bridged with wide noise.".to_owned(),
            "At 100 samples a second no SAE J211 channel frequency class is claimed.".to_owned(),
        ],
        gaps: true,
        states,
    }
}

fn answer(name: &'static str, start: &State, off: f64, sd: f64, speed: f64) -> ModelAnswer {
    ModelAnswer {
        name,
        start_north_m: figure(start.position[0] + off, sd),
        start_east_m: figure(start.position[1] - 0.6 * off, sd),
        start_cov_north_east_m2: 0.0,
        impact_speed_mps: Some(figure(speed, if sd.is_finite() { 0.09 } else { sd })),
        impact: None,
    }
}

/// A record that fits the reconstruction, without its samples.
pub(crate) fn record() -> Record {
    let scale = TwoSlope {
        fine_step: 0.05,
        fine_steps: 400,
        coarse_step: 6.9,
        coarse_steps: 111,
        carry_limit: 0.1,
    };
    Record {
        header: Header {
            number: 1,
            previous_sha256: [0; 32],
            parent_sha256: None,
            origin: Origin::Replay {
                logs: vec![SourceLog {
                    name: "crash.log".to_owned(),
                    bytes: 1_234_567,
                    sha256: [0xab; 32],
                }],
            },
            device_id: "bench-7 <script>alert(1)</script>".to_owned(),
            software: "svartboks-recorder 0.1.0".to_owned(),
            config_sha256: [0xcd; 32],
            vehicle: Vehicle {
                vin: "SB1TEST0000000001".to_owned(),
                name: "Test car \"A\" & trailer".to_owned(),
                track_width_m: 1.46,
                imu_position_m: Some([1.1, 0.0, -0.4]),
                imu_position_sd_m: [0.02; 3],
                cg_position_m: Some([1.3, 0.0, -0.5]),
                cg_position_sd_m: [0.05; 3],
            },
            imu: sheet(),
            wheels: WheelSheet {
                present: true,
                latency_s: 0.02,
                latency_sd_s: 0.005,
                cutoff_mps: 0.6,
                scale_sd: 0.01,
                scale_difference_sd: 0.002,
                noise_mps: 0.03,
            },
            wheel_scale: WheelScale { step: 0.25 / 3.6 },
            accel_scale: scale,
            rate_scale: scale,
            layout: Layout::Full,
            channel_frequency_class: None,
            periods: Periods {
                accel_ns: 10_000_000,
                rate_ns: 10_000_000,
                wheels_ns: [20_000_000; 2],
            },
            interfaces: vec![Interface {
                name: "can0".to_owned(),
                offset_ns: 0,
                uncertainty_ns: None,
            }],
            clock: Clock {
                source: ClockSource::LogStamps,
                offset_ns: 1_700_000_000_000_000_000,
                uncertainty_ns: None,
                leap_second: false,
            },
        },
        blocks: Vec::new(),
        clipping: vec![Clip {
            index: 4001,
            axis: 0,
            sign: -1,
            clipped: 1,
            frames: 1,
        }],
        raw: Vec::new(),
        aux: Vec::new(),
        gnss: None,
        health: health(),
        triggers: vec![Trigger {
            kind: TriggerKind::DeltaV,
            monotonic_ns: 30_000_000_000,
            index: 4000,
            value: 2.31,
            threshold: 2.222,
            source: "x".to_owned(),
        }],
        completion: Completion {
            complete: true,
            reasons: Vec::new(),
            ends_at_rest: true,
        },
    }
}

fn sheet() -> ImuSheet {
    ImuSheet {
        accel_range: Some(784.5),
        rate_range: Some(17.45),
        accel_density: 0.0015,
        rate_density: 1e-4,
        accel_bias: 0.05,
        rate_bias: 0.002,
        accel_bias_jump: 0.02,
        rate_bias_jump: 0.001,
        accel_scale: 0.002,
        rate_scale: 0.002,
        accel_vibration: 0.1,
        rate_vibration: 0.005,
        mounting: [0.0; 3],
        mounting_sd: [0.005; 3],
    }
}

fn health() -> Health {
    let signal = |name: &str, frames, period_ns| SignalHealth {
        signal: name.to_owned(),
        frames,
        lost_by_counter: (name == "accel").then_some(15),
        period_ns,
        jitter_ns: 310_000,
    };
    Health {
        frames_seen: 11_400,
        malformed: 2,
        gaps: vec![Gap {
            signal: "accel".to_owned(),
            from_ns: 11_800_000_000,
            to_ns: 11_950_000_000,
        }],
        clock_steps: vec![ClockStep {
            monotonic_ns: 9_000_000_000,
            step_ns: -12_000_000,
        }],
        signals: vec![
            signal("accel", 3785, 10_000_000),
            signal("rate", 3785, 10_000_000),
            signal("wheel-left", 1900, 20_000_000),
            signal("wheel-right", 1900, 20_000_000),
        ],
        ..Health::default()
    }
}

pub(crate) fn case<'a>(record: &'a Record, damage: &'a [String]) -> Case<'a> {
    Case {
        file: "crash-0001.svb",
        bytes: 48_213,
        file_sha256: [0x5a; 32],
        seal_sha256: Some([0x3c; 32]),
        signature: if damage.is_empty() {
            Signature::Unsigned
        } else {
            Signature::Broken
        },
        damage,
        record,
    }
}
