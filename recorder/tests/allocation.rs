//! In steady state nothing is allocated, whatever the rate of frames: spool, pipeline, triggers and ring go on with the
//! memory they have.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::alloc::System;
use std::sync::Arc;

use recorder::can::Frame;
use recorder::config::Settings;
use recorder::pipeline::Pipeline;
use recorder::spool::{Entry, Journal};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use support::{Log, etc, frames};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

const FLUSH_NS: i64 = 60_000_000;

#[test]
fn a_frame_allocates_nothing_once_the_ring_is_full() {
    let settings = Arc::new(Settings::load(&etc().join("recorder.toml")).unwrap());
    let mut log = Log::default();
    log.steady(0.0, 120.0, 1000.0, 60.0);
    let frames = frames(&log.text());

    let mut pipeline = Pipeline::new(Arc::clone(&settings), &[], None);
    let mut journal = Journal::new();
    let mut buffers = vec![Vec::new(), Vec::new()];
    let mut flushed = 0;
    let mut feed = |frames: &[Frame]| {
        for frame in frames {
            journal.frame(frame);
            pipeline.frame(frame);
            pipeline.take_fired(|_| ());
            assert!(pipeline.take_ready().is_none());
            if frame.time_ns - flushed >= FLUSH_NS {
                flushed = frame.time_ns;
                journal.entry(&Entry::Closed {
                    at_ns: pipeline.undecided_ns(),
                });
                let full = journal.exchange(buffers.pop().unwrap());
                buffers.insert(0, full);
            }
        }
    };
    let (warm, steady) = frames.split_at(frames.len() / 2);
    feed(warm);
    let region = Region::new(ALLOCATOR);
    feed(steady);
    let change = region.change();
    println!("{} frames: {change:?}", steady.len());
    assert_eq!(change.allocations + change.reallocations, 0);
}
