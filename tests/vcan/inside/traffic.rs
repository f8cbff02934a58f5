//! What listening costs.

use std::time::Duration;

use recorder::live::LiveSource;

use crate::bench::{Lane, Process, Test, cangen, listen, listen_for};

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

fn cost(lane: &Lane) {
    let config = lane.config(&["vcan0"], "all", "");
    let dir = lane.dir();
    let mut ours = Process::start(
        lane.bin.join("examples/listen"),
        &[config.to_str().unwrap(), "600"],
        &dir.join("listen"),
    );
    let mut theirs = Process::start(
        "candump",
        &["-l", "-r", "33554432", "vcan0"],
        &dir.join("candump"),
    );
    // Both read what they need to start.
    let (mut sockets, _) = lane.sockets(&["vcan0"], "none", "");
    listen_for(&mut sockets, 1.0);
    for (what, words) in [
        ("no gap", "vcan0 -g 0 -n 200000 -L 8"),
        ("1 ms", "vcan0 -g 1 -n 3000 -L 8"),
    ] {
        let before = (ours.cpu_s(), theirs.cpu_s());
        let words: Vec<&str> = words.split_whitespace().collect();
        let count: f64 = words[4].parse().unwrap();
        let began = sockets.now_ns();
        let mut sender = Process::start("cangen", &words, &dir.join("cangen"));
        listen(&mut sockets, 120, |_, _| !sender.running());
        let took = schema::num::real_i64(sockets.now_ns() - began) * 1e-9;
        let mut used = theirs.cpu_s();
        loop {
            listen_for(&mut sockets, 0.3);
            // Until it has written what waited.
            if theirs.cpu_s() - std::mem::replace(&mut used, theirs.cpu_s()) < 0.01 {
                break;
            }
        }
        let (ours, theirs) = (ours.cpu_s() - before.0, theirs.cpu_s() - before.1);
        println!(
            "{what}: {:.0} frames/s; processor time a frame: {:.2} us here, {:.2} us in candump -l, ratio {:.2}",
            count / took,
            ours / count * 1e6,
            theirs / count * 1e6,
            ours / theirs,
        );
        assert!(ours <= theirs, "{what}");
    }
    assert!(ours.running() && theirs.running());
    theirs.stop("INT");
    ours.stop("KILL");
    // Both saw everything: the figures are of the same frames.
    let name = std::fs::read_dir(&dir)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .find(|path| path.extension().is_some_and(|kind| kind == "log"))
        .unwrap();
    let lines = std::fs::read_to_string(name).unwrap().lines().count();
    assert_eq!(lines, 203_000, "candump lost frames");
}
