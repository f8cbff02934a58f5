//! What listening costs.

use std::path::Path;
use std::time::Duration;

use recorder::clock::monotonic_ns;
use recorder::live::LiveSource;

use crate::bench::{Lane, Process, Test, cangen, listen_for};

/// The tests of this file.
pub(crate) const TESTS: &[Test] = &[
    ("listening_allocates_nothing", false, allocations),
    ("listening_costs_no_more_than_candump", false, cost),
];

fn allocations(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0", "vcan1"], "all", "");
    cangen("vcan0 -g 0 -n 500");
    listen_for(&mut sockets, 0.5);
    let out = lane.dir().join("cangen");
    let mut slow = Process::start("cangen", &["vcan1", "-m", "-g", "1"], &out);
    let mut fast = Process::start("cangen", &["vcan0", "-g", "0", "-n", "60000"], &out);
    let mut frames = 0_u64;
    let counted = allocation_counter::measure(|| {
        let end = sockets.now_ns() + 3_000_000_000;
        while sockets.now_ns() < end {
            sockets
                .read(Duration::from_millis(50), &mut |_| frames += 1)
                .unwrap();
        }
    });
    slow.stop("INT");
    fast.stop("INT");
    println!("{frames} frames, {} allocations", counted.count_total);
    assert!(frames > 5_000, "{frames}");
    assert_eq!(counted.count_total, 0);
}

/// Frames of one measurement.
const FRAMES: &str = "30000";

/// Wall time until so many frames are sent as fast as it goes and the reader has ended, s. There is one processor
/// that never rests meanwhile, so that it is processor time, of all that happens for a frame. (What the user-mode
/// kernel accounts to a process is told by ticks of 10 ms and misses those that run between two ticks.)
fn saturated(reader: Option<Process>, dir: &Path) -> f64 {
    std::thread::sleep(Duration::from_millis(700));
    let began = monotonic_ns();
    let words = ["vcan0", "-g", "0", "-L", "8", "-n", FRAMES];
    let mut sender = Process::start("cangen", &words, &dir.join("cangen"));
    assert_eq!(sender.wait(), Some(0));
    if let Some(mut reader) = reader {
        assert_eq!(reader.wait(), Some(0));
    }
    schema::num::real_i64(monotonic_ns() - began) * 1e-9
}

fn cost(lane: &Lane) {
    let config = lane.config(&["vcan0"], "all", "");
    let dir = lane.dir();
    let program = lane.bin.join("examples/listen");
    let words = [config.to_str().unwrap(), "60", "--count", FRAMES];
    let mut best = [f64::INFINITY; 3];
    for _ in 0..5 {
        let ours = || Process::start(&program, &words, &dir.join("listen"));
        let theirs = || {
            let words = ["-l", "-r", "33554432", "-n", FRAMES, "vcan0"];
            Process::start("candump", &words, &dir.join("candump"))
        };
        best[0] = best[0].min(saturated(None, &dir));
        best[1] = best[1].min(saturated(Some(ours()), &dir));
        best[2] = best[2].min(saturated(Some(theirs()), &dir));
    }
    let count: f64 = FRAMES.parse().unwrap();
    let [alone, ours, theirs] = best.map(|time| time / count * 1e6);
    println!(
        "at no gap, us a frame: sent {alone:.1}, heard by us {:.1}, by candump -l {:.1}, ratio {:.2}",
        ours - alone,
        theirs - alone,
        (ours - alone) / (theirs - alone),
    );
    assert!(ours <= theirs, "{ours} us a frame, candump {theirs} us");
}
