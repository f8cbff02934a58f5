//! What may not be stored is refused by the writer, before a byte is written, and named.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use schema::header::{Layout, Origin};
use schema::sample::MISSING;
use schema::{Codes, Record, SchemaError};
use support::{record, small};

fn refused(name: &str, change: impl FnOnce(&mut Record)) {
    let mut record = small();
    change(&mut record);
    let mut out = Vec::new();
    let error = record.write(&mut out).unwrap_err();
    assert!(out.is_empty(), "{name}");
    assert!(error.to_string().contains(name), "{name}: {error}");
    assert!(record.validate().is_err() || matches!(error, SchemaError::Encode { .. }));
}

#[test]
fn numbers_that_would_poison_the_mathematics_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, -1.0, 1e10] {
        refused("wheel_scale.step", |r| r.header.wheel_scale.step = bad);
        refused("accel_scale.fine_step", |r| {
            r.header.accel_scale.fine_step = bad;
        });
        refused("rate_scale.coarse_step", |r| {
            r.header.rate_scale.coarse_step = bad;
        });
        refused("accel_scale.carry_limit", |r| {
            r.header.accel_scale.carry_limit = bad;
        });
        refused("track_width_m", |r| r.header.vehicle.track_width_m = bad);
        refused("imu.rate_range", |r| r.header.imu.rate_range = Some(bad));
        refused("imu.accel_density", |r| r.header.imu.accel_density = bad);
        refused("mounting_sd", |r| r.header.imu.mounting_sd[2] = bad);
        refused("cg_position_sd_m", |r| {
            r.header.vehicle.cg_position_sd_m[0] = bad;
        });
        refused("wheels.noise_mps", |r| r.header.wheels.noise_mps = bad);
    }
    refused("imu_position_m", |r| {
        r.header.vehicle.imu_position_m = Some([0.0, f64::NAN, 0.0]);
    });
    refused("imu.mounting", |r| {
        r.header.imu.mounting[0] = f64::NEG_INFINITY;
    });
    refused("accel_scale.fine_step", |r| {
        r.header.accel_scale.fine_step = 0.0;
    });
    refused("511 on each side", |r| r.header.rate_scale.fine_steps = 401);
    refused("511 on each side", |r| {
        r.header.rate_scale.coarse_steps = u16::MAX;
    });
    refused("trigger 0, value", |r| r.triggers[0].value = f64::NAN);
    refused("trigger 0, threshold", |r| {
        r.triggers[0].threshold = f64::INFINITY;
    });
}

#[test]
fn blocks_that_do_not_fit_the_grid_are_refused() {
    refused("at least one second block", |r| r.blocks.clear());
    refused("samples", |r| r.blocks[1].samples.clear());
    refused("samples", |r| {
        r.blocks[1].samples.resize(101, Codes::default());
    });
    refused("codes of ten bits", |r| r.blocks[0].samples[0].0[3] = 1024);
    for axis in 0..6 {
        refused("remainder", |r| {
            for codes in &mut r.blocks[1].samples {
                codes.0[2 + axis] = MISSING;
            }
            r.blocks[1].remainder = [0; 6];
            r.blocks[1].remainder[axis] = -1;
        });
    }
    refused("100 Hz in the full layout", |r| r.blocks[0].rate_hz = 20);
    refused("100 or 20 Hz", |r| {
        r.header.layout = Layout::TwoRate;
        r.blocks[0].rate_hz = 50;
    });
    refused("stamp", |r| r.blocks[0].stamp.day = 32);
    refused("stamp", |r| r.blocks[1].stamp.second += 1);
    refused("first_index", |r| r.blocks.swap(0, 1));
    refused("first_index", |r| r.blocks[0].first_index = u64::MAX);
    refused("monotonic_ns", |r| r.blocks[1].monotonic_ns += 1);
    refused("stamp", |r| r.header.clock.offset_ns = i64::MAX);
}

#[test]
fn a_leap_second_may_move_the_stamps_by_one() {
    let mut leap = small();
    leap.header.clock.leap_second = true;
    leap.blocks[1].stamp.second += 1;
    assert_eq!(Record::read(&leap.to_bytes().unwrap()).unwrap().0, leap);
    leap.blocks[1].stamp.second += 1;
    assert!(leap.validate().is_err());
}

#[test]
fn parts_that_contradict_themselves_or_the_header_are_refused() {
    refused("number", |r| r.header.number = 0);
    refused("at least one log", |r| {
        r.header.origin = Origin::Replay { logs: vec![] }
    });
    refused("axis", |r| r.clipping[0].axis = 6);
    refused("sign", |r| r.clipping[0].sign = 0);
    refused("sign", |r| r.clipping[0].sign = i8::MIN);
    refused("clipped", |r| r.clipping[0].clipped = 0);
    refused("clipped", |r| r.clipping[0].frames = 2);
    refused("frame 1, interface", |r| r.raw[1].interface = 1);
    refused("frame 0, payload", |r| r.raw[0].data = vec![0; 65]);
}

#[test]
fn what_is_too_large_is_refused_before_a_byte_is_written() {
    refused("header", |r| r.header.device_id = "x".repeat(70_000));
    refused("health", |r| r.health.notes = vec!["x".repeat(1000); 1100]);
    refused("completion", |r| {
        r.completion.reasons = vec!["x".repeat(70_000)];
    });
    refused("triggers", |r| {
        r.triggers = vec![r.triggers[0].clone(); 2000];
    });
    let two_rate = record(Layout::TwoRate, 3, 4003, 3000);
    refused("blocks", |r| {
        r.blocks = vec![two_rate.blocks[0].clone(); 4097];
    });
}

#[test]
fn auxiliary_values_that_are_no_numbers_are_stored_as_missing() {
    let mut record = small();
    record.aux[0].values = vec![Some(f64::NAN), Some(1.0), Some(f64::INFINITY), None];
    let back = Record::read(&record.to_bytes().unwrap()).unwrap().0;
    assert_eq!(back.aux[0].values, [None, Some(1.0), None, None]);
}
