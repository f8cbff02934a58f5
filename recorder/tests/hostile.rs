//! A hostile bus, frame by frame into the pipeline: the record stays right, the memory small, and the health tells.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

mod support;

use std::alloc::System;
use std::sync::Arc;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recorder::can::{EFF, Frame};
use recorder::pipeline::Pipeline;
use schema::{Record, num};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};
use support::{EPOCH, settings};

#[global_allocator]
static HEAP: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Bytes that live on the heap now.
fn live() -> usize {
    let stats = HEAP.stats();
    stats
        .bytes_allocated
        .saturating_sub(stats.bytes_deallocated)
}

/// Three 20-bit numbers of 0.002 and a counter of 4 bits.
fn triple(values: [f64; 3], counter: u64) -> [u8; 8] {
    let mut bits = (counter % 16) << 60;
    for (axis, value) in values.into_iter().enumerate() {
        let code = num::round_i64(value / 0.002).cast_unsigned() & 0xF_FFFF;
        bits |= code << (20 * axis);
    }
    bits.to_le_bytes()
}

fn frame(t_ns: i64, id: u32, data: &[u8]) -> Frame {
    Frame::new(EPOCH * 1_000_000_000 + t_ns, 0, id, 0, data)
}

/// The good senders' frames in the 10 ms from `k` on: a car that stands, 100 Hz IMU, 50 Hz wheels.
fn good(k: i64) -> Vec<Frame> {
    let (at, counter) = (k * 10_000_000, k.cast_unsigned());
    let mut frames = vec![
        frame(at, 0x120, &triple([0.0, 0.0, 9.806], counter)),
        frame(at + 100_000, 0x121, &triple([0.0; 3], counter)),
    ];
    if k % 2 == 0 {
        frames.push(frame(at + 200_000, 0x122, &[0; 5]));
    }
    frames
}

/// What a run gave.
struct Run {
    /// The last record, and how many there were.
    record: Record,
    records: usize,
    frames: u64,
    /// Most bytes on the heap beyond those at the start.
    heap: usize,
}

/// So many steps of 10 ms, each with the good frames (as changed) and the hostile ones, in order of time; a manual
/// trigger 15 s before the end.
fn run(steps: i64, mut each: impl FnMut(i64, &mut Vec<Frame>)) -> Run {
    let before = live();
    let settings = Arc::new(settings(&[]));
    let trigger = num::real_i64(steps) / 100.0 - 15.0;
    let mut pipeline = Pipeline::new(settings, &[trigger], None);
    let (mut heap, mut records, mut last) = (0, 0, None);
    let mut sealed = |record: Record| {
        let bytes = record.to_bytes().unwrap();
        assert!(Record::read(&bytes).is_ok());
        records += 1;
        last = Some(record);
    };
    for k in 0..steps {
        let mut frames = good(k);
        each(k, &mut frames);
        frames.sort_by_key(|frame| frame.time_ns);
        for frame in &frames {
            pipeline.frame(frame);
        }
        heap = heap.max(live().saturating_sub(before));
        while let Some(record) = pipeline.take_ready() {
            sealed(record);
        }
    }
    pipeline.finish();
    while let Some(record) = pipeline.take_ready() {
        sealed(record);
    }
    Run {
        record: last.unwrap(),
        records,
        frames: pipeline.totals().frames,
        heap,
    }
}

impl Run {
    fn notes(&self) -> String {
        self.record.health.notes.join("\n")
    }
}

fn random_frame(r: &mut ChaCha8Rng, t_ns: i64, mapped: bool) -> Frame {
    let mut data = [0; 8];
    r.fill_bytes(&mut data);
    let length = r.random_range(0..=8);
    let id = loop {
        let id = if r.random_range(0..4) == 0 {
            EFF | r.random_range(0..0x2000_0000)
        } else {
            r.random_range(0..0x800)
        };
        if mapped || !(0x120..0x126).contains(&id) {
            break id;
        }
    };
    frame(t_ns, id, &data[..length])
}

/// All runs share one counter of the heap, so they are one test.
#[test]
fn a_hostile_bus_is_survived_in_bounded_memory_and_told() {
    let quiet = run(6000, |_, _| {});
    eprintln!("quiet bus: {} bytes on the heap", quiet.heap);
    assert!(!quiet.notes().contains("counter"), "{}", quiet.notes());
    assert!(
        !quiet.notes().contains("second sender"),
        "{}",
        quiet.notes()
    );

    foreign_identifiers(&quiet);
    every_identifier(&quiet);
    flood();
    wrong_lengths(&quiet);
    counters();
    second_senders(&quiet);
}

/// 25,000 frames/s of other identifiers for two minutes: the record is that of a quiet bus.
fn foreign_identifiers(quiet: &Run) {
    let mut r = ChaCha8Rng::seed_from_u64(1);
    let run = run(12_000, |k, frames| {
        for i in 0..250 {
            let t = k * 10_000_000 + i * 40_000 + r.random_range(1..39_000);
            frames.push(random_frame(&mut r, t, false));
        }
    });
    eprintln!(
        "random identifiers: {} frames, {} bytes on the heap",
        run.frames, run.heap
    );
    assert!(run.frames > 3_000_000);
    assert!(
        run.heap < quiet.heap + 2_000_000,
        "{} {}",
        run.heap,
        quiet.heap
    );
    let record = &run.record;
    assert!(record.completion.complete, "{:?}", record.completion);
    assert_eq!(run.records, 1);
    assert_eq!(record.health.malformed, 0);
    assert!(record.health.frames_seen > 2_500_000);
    let other = &quiet.record;
    assert_eq!(record.samples().count(), other.samples().count());
}

/// The same over every identifier, the mapped ones too, for a minute: no panic, and the health is full.
fn every_identifier(quiet: &Run) {
    let mut r = ChaCha8Rng::seed_from_u64(2);
    let run = run(6000, |k, frames| {
        for i in 0..250 {
            let t = k * 10_000_000 + i * 40_000 + r.random_range(1..39_000);
            let mut hostile = random_frame(&mut r, t, true);
            if r.random_range(0..20) == 0 {
                hostile.id = r.random_range(0x120..0x126);
            }
            frames.push(hostile);
        }
    });
    let notes = run.notes();
    eprintln!(
        "every identifier: {} records, {} bytes on the heap\n{notes}",
        run.records, run.heap
    );
    assert!(
        run.heap < quiet.heap + 16_000_000,
        "{} {}",
        run.heap,
        quiet.heap
    );
    assert!(run.record.health.malformed > 1000);
    assert!(notes.contains("jumped in"), "{notes}");
}

/// A mapped identifier at 25,000 frames/s: as much memory after three minutes as after one.
fn flood() {
    let mut heaps = Vec::new();
    for minutes in [1, 3] {
        let mut r = ChaCha8Rng::seed_from_u64(3);
        let run = run(1000 + 6000 * minutes, |k, frames| {
            for i in 0..250 * i64::from(k > 1000) {
                let mut data = [0; 8];
                r.fill_bytes(&mut data);
                frames.push(frame(k * 10_000_000 + i * 40_000 + 20_000, 0x120, &data));
            }
        });
        eprintln!(
            "a mapped identifier flooded: {} records, {} frames, {} bytes on the heap",
            run.records, run.frames, run.heap
        );
        let notes = run.notes();
        assert!(notes.contains("before that every 10.0"), "{notes}");
        heaps.push(run.heap);
    }
    // An event keeps at most 200,000 raw frames; they live twice while it is sealed.
    assert!(heaps[1] < heaps[0] + 8_000_000, "{heaps:?}");
    assert!(heaps[0] < 80_000_000, "{heaps:?}");
}

/// Frames of mapped messages that are too short are counted, and the values of the good ones stand.
fn wrong_lengths(quiet: &Run) {
    let mut sent = 0;
    let run = run(6000, |k, frames| {
        for (at, id) in [(1_000_000, 0x120), (2_000_000, 0x121), (3_000_000, 0x122)] {
            let length = usize::try_from(k % 4).unwrap();
            frames.push(frame(k * 10_000_000 + at, id, &[0xFF; 8][..length.min(2)]));
            sent += 1;
        }
    });
    let health = &run.record.health;
    assert!(
        health.malformed > sent * 3 / 5,
        "{} of {sent}",
        health.malformed
    );
    assert!(
        run.heap < quiet.heap + 2_000_000,
        "{} {}",
        run.heap,
        quiet.heap
    );
}

/// Counters that stand still, and that are reset.
fn counters() {
    let stale = run(6000, |k, frames| {
        if (2000..2100).contains(&k) {
            frames[0] = frame(k * 10_000_000, 0x120, &triple([0.0, 0.0, 9.806], 5));
        }
    });
    let notes = stale.notes();
    assert!(
        notes.contains("accelerometer's frames stood still in 99 frames"),
        "{notes}"
    );
    assert!(!notes.contains("gyro's frames stood"), "{notes}");
    let reset = run(6000, |k, frames| {
        // Every 5 s the counter begins at 0 again.
        let counter = (k % 500).cast_unsigned();
        frames[1] = frame(k * 10_000_000 + 100_000, 0x121, &triple([0.0; 3], counter));
    });
    let notes = reset.notes();
    assert!(notes.contains("gyro's frames jumped in"), "{notes}");
    assert!(!notes.contains("accelerometer's frames jumped"), "{notes}");
    assert!(reset.record.completion.complete);
}

/// A second sender on the identifiers of the accelerometer and of the wheels, from 20 s on, with other values.
fn second_senders(quiet: &Run) {
    let accel = run(6000, |k, frames| {
        if k > 2000 {
            let data = triple([3.0, -3.0, 9.0], (k * 3 + 7).cast_unsigned());
            frames.push(frame(k * 10_000_000 + 4_000_000, 0x120, &data));
        }
    });
    let notes = accel.notes();
    assert!(
        notes.contains("accelerometer's frames jumped in"),
        "{notes}"
    );
    assert!(notes.contains("before that every 10.0"), "{notes}");
    assert!(
        accel.heap < quiet.heap + 2_000_000,
        "{} {}",
        accel.heap,
        quiet.heap
    );
    let wheels = run(6000, |k, frames| {
        if k > 2000 && k % 2 == 0 {
            frames.push(frame(
                k * 10_000_000 + 9_000_000,
                0x122,
                &[0x27, 0x10, 0x27, 0x10, 0],
            ));
        }
    });
    let notes = wheels.notes();
    assert!(notes.contains("before that every 20.0"), "{notes}");
}
