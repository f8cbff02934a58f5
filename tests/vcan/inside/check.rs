//! `recorder check` on a live bus.

use serde_json::Value;

use crate::bench::{Lane, Process, Test, read_log};
use crate::car;

/// The tests of this file.
pub(crate) const TESTS: &[Test] = &[(
    "a_check_of_the_live_bus_finds_each_signal_at_its_rate",
    false,
    check,
)];

/// A car that stands is played for so long, s; the check listens for less of it.
const PLAYED_S: u32 = 8;
/// Frames that come farther apart than this, ns, are a gap of the bus: whoever plays them was held up.
const HELD_UP_NS: i64 = 50_000_000;
/// Rounds, of which one must not have been held up.
const ROUNDS: usize = 6;

fn check(lane: &Lane) {
    let log = car::log(lane, PLAYED_S, None);
    let config = lane.config(&["vcan0"], "mapped", "");
    let config = config.to_str().unwrap();
    for _ in 0..ROUNDS {
        let (mut candump, logged) = lane.candump(&["vcan0"]);
        let words = ["-I", log.to_str().unwrap(), "vcan0=can0"];
        let mut player = Process::start("canplayer", &words, &lane.dir().join("canplayer"));
        let words = ["check", "--config", config, "--for", "5", "--json"];
        let out = lane.dir().join("check");
        let mut checking = Process::start(lane.bin.join("recorder"), &words, &out);
        let code = checking.wait();
        assert!(player.running(), "it was played while it was listened to");
        assert_eq!(player.wait(), Some(0));
        candump.stop("INT");
        let report: Value = serde_json::from_slice(&std::fs::read(&out).unwrap()).unwrap();
        let frames = read_log(&logged, &["vcan0"]);
        let held_up = [0x120, 0x121, 0x122].map(|id| widest(&frames, id));
        println!("exit code {code:?}, widest gap of the bus {held_up:?} ns: {report}");
        let seconds = report["seconds"].as_f64().unwrap();
        let undisturbed = held_up.iter().all(|gap| *gap < HELD_UP_NS);
        for (signal, hertz) in [
            ("accel", 100.0),
            ("rate", 100.0),
            ("wheel-left", 50.0),
            ("wheel-right", 50.0),
        ] {
            let of = |found: &&Value| found["signal"] == signal;
            let found = report["signals"].as_array().unwrap().iter().find(of);
            let found = found.unwrap_or_else(|| panic!("no {signal} in {report}"));
            assert_eq!(found["arrives"], true, "{signal}");
            let rate = found["rate_hz"].as_f64().unwrap();
            // What a player that was held up has missed it sends at once, and the time line fitted to that is bent.
            assert!(
                !undisturbed || (rate / hertz - 1.0).abs() < 0.02,
                "{signal}: {rate} Hz"
            );
        }
        if undisturbed {
            assert!((4.0..=5.2).contains(&seconds), "{seconds} s");
            assert_eq!(code, Some(0), "{}", report["warnings"]);
            assert_eq!(report["warnings"], Value::Array(Vec::new()));
            return;
        }
        // What the bus did not bring is rightly warned of: once more.
        assert!(matches!(code, Some(0 | 3)), "{code:?}");
    }
    panic!("in {ROUNDS} rounds the bus was held up each time");
}

/// The widest time between two frames of an identifier, ns.
fn widest(frames: &[recorder::can::Frame], id: u32) -> i64 {
    let times: Vec<i64> = frames
        .iter()
        .filter(|frame| frame.id == id)
        .map(|frame| frame.time_ns)
        .collect();
    let gaps = times.windows(2).map(|pair| pair[1] - pair[0]);
    gaps.max().unwrap_or(i64::MAX)
}
