//! Records made from simulated crashes without a bus between, for the tests of the command line.
#![allow(dead_code, reason = "each test file uses some of it")]

pub(crate) mod json_schema;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use reconstruct::simulate::{Class, Scenario, Simulated, simulate};
use schema::header::{
    Clock, ClockSource, Header, ImuSheet, Interface, Layout, Origin, Periods, SourceLog, Vehicle,
    WheelSheet,
};
use schema::packer::Packer;
use schema::parts::{Completion, Health, RawFrame, SignalHealth, Trigger, TriggerKind};
use schema::scale::{TwoSlope, WheelScale};
use schema::time::Grid;
use schema::{Record, block, num};

/// Monotonic time of the simulation's t = 0, s.
const MONOTONIC_S: i64 = 100;

/// Fixes, motions and reference of a simulated drive in both formats of S00, by the program; `more` are further options.
pub(crate) fn gnss_logs(dir: &Path, seed: &str, more: &[&str]) -> [PathBuf; 3] {
    let to = dir.to_str().unwrap();
    let args = [&["gnss", "simulate", "--seed", seed, "--out", to], more].concat();
    let made = reconstruct(&args);
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    ["fixes", "motions", "reference"].map(|n| dir.join(format!("{n}-{seed}.txt")))
}

/// A crash and its record: 30 s before the trigger to the end.
pub(crate) fn crash(class: Class, seed: u64) -> (Simulated, Record) {
    let simulated = simulate(&Scenario::draw(class, seed)).unwrap();
    let record = record(&simulated);
    (simulated, record)
}

pub(crate) fn record(simulated: &Simulated) -> Record {
    let facts = &simulated.truth.facts;
    let trigger_ns = MONOTONIC_S * 1_000_000_000 + num::round_i64(facts.trigger_at_s * 1e9);
    let grid = Grid {
        origin_ns: MONOTONIC_S * 1_000_000_000 - 10_000_000,
        utc_offset_ns: (facts.start_unix_s - MONOTONIC_S) * 1_000_000_000,
    };
    let header = header(simulated, grid.utc_offset_ns);
    let mut packer = Packer::new(header.wheel_scale, header.accel_scale, header.rate_scale);
    let first = num::round_usize((facts.trigger_at_s - 30.0).max(0.0) * 100.0).max(1);
    let samples = simulated.samples();
    let run: Vec<_> = samples
        .iter()
        .enumerate()
        .skip(first)
        .map(|(k, sample)| {
            let index = num::u64_of(k);
            if grid.starts_second(index) {
                packer.reset();
            }
            (index, packer.packed(sample))
        })
        .collect();
    let signal = |name: &str, frames, period_ns| SignalHealth {
        signal: name.to_owned(),
        frames,
        lost_by_counter: None,
        period_ns,
        jitter_ns: 200_000,
    };
    Record {
        header,
        blocks: block::cut(run, &grid),
        clipping: Vec::new(),
        raw: vec![RawFrame {
            monotonic_ns: trigger_ns,
            interface: 0,
            id: 0x120,
            flags: 0,
            data: vec![1, 2, 3, 4],
        }],
        aux: Vec::new(),
        gnss: None,
        health: Health {
            frames_seen: 12_000,
            signals: vec![
                signal("accel", 4000, 10_000_000),
                signal("rate", 4000, 10_000_000),
            ],
            ..Health::default()
        },
        triggers: vec![Trigger {
            kind: TriggerKind::DeltaV,
            monotonic_ns: trigger_ns,
            index: num::u64_of(num::round_usize(facts.trigger_at_s * 100.0)),
            value: 2.4,
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

fn header(simulated: &Simulated, offset_ns: i64) -> Header {
    let car = &simulated.scenario.car;
    Header {
        number: 1,
        previous_sha256: [0; 32],
        parent_sha256: None,
        origin: Origin::Replay {
            logs: vec![SourceLog {
                name: "crash.log".to_owned(),
                bytes: 1_000,
                sha256: [7; 32],
            }],
        },
        device_id: "<b>bench</b> & \"co\"".to_owned(),
        software: "svartboks-recorder 0.1.0".to_owned(),
        config_sha256: [9; 32],
        vehicle: Vehicle {
            vin: String::new(),
            name: "simulated car".to_owned(),
            track_width_m: car.track_width,
            imu_position_m: Some(car.imu),
            imu_position_sd_m: [0.02; 3],
            cg_position_m: Some(car.cg),
            cg_position_sd_m: [0.05; 3],
        },
        imu: ImuSheet {
            accel_range: None,
            rate_range: None,
            accel_density: 0.0015,
            rate_density: 1.7e-4,
            accel_bias: 0.1,
            rate_bias: 0.005,
            accel_bias_jump: 0.03,
            rate_bias_jump: 0.001,
            accel_scale: 0.003,
            rate_scale: 0.003,
            accel_vibration: 0.15,
            rate_vibration: 0.005,
            mounting: [0.0; 3],
            mounting_sd: [0.01; 3],
        },
        wheels: WheelSheet {
            present: true,
            latency_s: 0.02,
            latency_sd_s: 0.005,
            cutoff_mps: 0.7,
            scale_sd: 0.01,
            scale_difference_sd: 0.001,
            noise_mps: 0.03,
        },
        wheel_scale: WheelScale::default_kmh(),
        accel_scale: TwoSlope::accel_default(),
        rate_scale: TwoSlope::rate_default(),
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
            offset_ns,
            uncertainty_ns: None,
            leap_second: false,
        },
    }
}

/// An empty folder of its own for one test.
pub(crate) fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// The program with arguments.
pub(crate) fn reconstruct(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_reconstruct"))
        .args(args)
        .output()
        .unwrap()
}

pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}
