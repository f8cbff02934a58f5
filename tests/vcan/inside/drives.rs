//! The daemon on a live bus: drives played in real time, loads, outages, clocks that are set, hostile senders.

use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use recorder::clock::monotonic_ns;
use schema::Record;
use schema::parts::TriggerKind;
use serde_json::Value;

use crate::bench::{Lane, Process, Test, link, read_log, run};
use crate::daemon::{AT_REST, Daemon, Senders, cpu_s, records};

/// The tests of this file.
pub(crate) const TESTS: &[Test] = &[
    (
        "records_of_a_stop_by_hand_equal_a_replay_of_the_log",
        false,
        stop_equals_replay,
    ),
    (
        "records_of_a_crash_equal_a_replay_of_the_log",
        false,
        crash_equals_replay,
    ),
    ("a_full_bus_for_a_minute_loses_no_mapped_frame", false, load),
    (
        "outages_and_set_clocks_in_an_event_leave_a_whole_record",
        true,
        event_in_trouble,
    ),
    ("a_hostile_bus_is_survived_and_told", false, hostile),
];

/// A drive to be played.
struct Drive {
    /// Its log, beginning at 1700000000.
    log: PathBuf,
    /// Its configuration.
    config: String,
    /// Seconds of it that are played.
    played: std::ops::Range<f64>,
    /// Seconds after the beginning at which it is triggered by hand.
    by_hand_s: Option<u64>,
    /// The trigger it must have.
    kind: TriggerKind,
}

fn replaced(lane: &Lane, config: &str, pairs: &[(&str, &str)]) -> String {
    let mut text = fs::read_to_string(lane.root.join(config)).unwrap();
    for (from, to) in pairs.iter().chain(&[("\"can0\"", "\"vcan0\"")]) {
        assert!(text.contains(from), "{config} has no {from}");
        text = text.replace(from, to);
    }
    text
}

/// A crash that the project's simulator made.
fn crash(lane: &Lane) -> Drive {
    let dbc = lane.root.join("fixtures/dbc/oblique-1.dbc");
    let pairs = [
        ("../dbc/oblique-1.dbc", dbc.to_str().unwrap()),
        ("seconds = 40", "seconds = 30"),
    ];
    Drive {
        log: lane.root.join("fixtures/can/oblique-1.log"),
        config: replaced(lane, "fixtures/config/oblique-1.toml", &pairs),
        played: 19.0..53.2,
        by_hand_s: None,
        kind: TriggerKind::DeltaV,
    }
}

/// The first stop of a recorded drive, or of the simulated one where there is none.
fn stop(lane: &Lane) -> Drive {
    let data = lane.root.join("../shared/data");
    if !data.join("wid08.log").exists() {
        println!(
            "skipped: the drive wid08 (../shared/data is not here): a simulated one is played instead"
        );
        return Drive {
            // A second mark of the crash, soon enough for the record to end before the log does.
            by_hand_s: Some(23),
            kind: TriggerKind::Manual,
            ..crash(lane)
        };
    }
    let dbc = data.join("lab.dbc");
    let pairs = [
        ("../../../shared/data/lab.dbc", dbc.to_str().unwrap()),
        ("post_trigger_s = 5", "seconds = 30\npost_trigger_s = 5"),
    ];
    Drive {
        log: data.join("wid08.log"),
        config: replaced(lane, "tests/config/wid08.toml", &pairs),
        played: 32.0..66.5,
        // The car stands since a second.
        by_hand_s: Some(26),
        kind: TriggerKind::Manual,
    }
}

impl Drive {
    /// Writes log and configuration into the test's folder; gives their paths.
    fn write(&self, lane: &Lane) -> (PathBuf, PathBuf) {
        let text = fs::read_to_string(&self.log).unwrap();
        let lines = text.split_inclusive('\n').filter(|line| {
            let seconds: f64 = line[1..line.find(')').unwrap()].parse().unwrap();
            self.played.contains(&(seconds - 1_700_000_000.0))
        });
        let cut: String = lines.collect();
        let (log, config) = (
            lane.dir().join("played.log"),
            lane.dir().join("config.toml"),
        );
        fs::write(&log, cut).unwrap();
        fs::write(&config, &self.config).unwrap();
        (log, config)
    }
}

/// Samples by their time in UTC, ns.
fn by_utc(record: &Record) -> Vec<(i64, schema::sample::Sample)> {
    record
        .samples()
        .map(|at| {
            (
                record.monotonic_ns(at.index) + record.header.clock.offset_ns,
                at.sample,
            )
        })
        .collect()
}

fn kinds(record: &Record) -> Vec<TriggerKind> {
    record.triggers.iter().map(|trigger| trigger.kind).collect()
}

fn stop_equals_replay(lane: &Lane) {
    equals_replay(lane, &stop(lane));
}

fn crash_equals_replay(lane: &Lane) {
    equals_replay(lane, &crash(lane));
}

fn equals_replay(lane: &Lane, drive: &Drive) {
    let (played, config) = drive.write(lane);
    let mut daemon = Daemon::start(lane, &config);
    let (mut candump, log) = lane.candump(&["vcan0"]);
    let words = ["-I", played.to_str().unwrap(), "vcan0=can0"];
    let mut player = Process::start("canplayer", &words, &lane.dir().join("canplayer"));
    if let Some(seconds) = drive.by_hand_s {
        sleep(Duration::from_secs(seconds));
        daemon.trigger();
    }
    assert_eq!(player.wait(), Some(0));
    daemon.until("no event runs", 30, |status| status["state"] == "recording");
    let status = daemon.until("the records are sealed", 30, |status| {
        status["records"]["sealed"].as_u64() > Some(0) && status["records"]["waiting"] == 0
    });
    println!("{}", status["interfaces"][0]);
    let live = daemon.stop();
    candump.stop("INT");

    let frames = read_log(&log, &["vcan0"]);
    let first = frames.first().unwrap().time_ns;
    let manual: Vec<String> = live
        .iter()
        .flat_map(|record| {
            let offset = record.header.clock.offset_ns;
            record.triggers.iter().map(move |trigger| (trigger, offset))
        })
        .filter(|(trigger, _)| trigger.kind == TriggerKind::Manual)
        .map(|(trigger, offset)| {
            let after = trigger.monotonic_ns + offset - first;
            format!("{}.{:09}", after / 1_000_000_000, after % 1_000_000_000)
        })
        .collect();
    assert_eq!(manual.len(), usize::from(drive.by_hand_s.is_some()));
    let out = lane.dir().join("replayed");
    let mut words = vec![
        "replay",
        "--config",
        config.to_str().unwrap(),
        log.to_str().unwrap(),
    ];
    words.extend(["--out", out.to_str().unwrap()]);
    for seconds in &manual {
        words.extend(["--trigger-at", seconds]);
    }
    let status = std::process::Command::new(lane.bin.join("recorder"))
        .args(&words)
        .output()
        .unwrap();
    // 3: the log may end before the time after a trigger is over.
    assert!(matches!(status.status.code(), Some(0 | 3)), "{status:?}");
    let replayed = records(&out);
    assert!(!live.is_empty());
    assert_eq!(live.len(), replayed.len());
    let mut triggers = Vec::new();
    for (live, replayed) in live.iter().zip(&replayed) {
        assert_eq!(kinds(live), kinds(replayed));
        triggers.extend(kinds(live));
        let (ours, theirs) = (by_utc(live), by_utc(replayed));
        println!(
            "record of {} samples live, {} replayed, triggers {:?}",
            ours.len(),
            theirs.len(),
            kinds(live)
        );
        let differ = ours.iter().zip(&theirs).filter(|(a, b)| a != b).count();
        let example = ours.iter().zip(&theirs).position(|(a, b)| a != b);
        assert_eq!(
            differ,
            0,
            "first at {example:?}: {:?}",
            example.map(|at| (ours[at], theirs[at]))
        );
        assert_eq!(ours.len(), theirs.len());
        assert!(live.raw == replayed.raw, "the raw frames differ");
        assert!(live.completion.complete, "{:?}", live.completion);
    }
    assert!(triggers.contains(&drive.kind), "{triggers:?}");
}

/// A configuration without counters for the daemon, with a piece of its own.
fn config(lane: &Lane, raw: &str, tail: &str) -> PathBuf {
    let path = lane.config(&["vcan0"], raw, tail);
    let text = fs::read_to_string(&path).unwrap();
    let text: String = text
        .split_inclusive('\n')
        .filter(|line| !line.starts_with("accel_counter"))
        .collect();
    fs::write(&path, text).unwrap();
    path
}

fn number(status: &Value, path: &str) -> u64 {
    let value = status.pointer(path).and_then(Value::as_u64);
    value.unwrap_or_else(|| panic!("no {path} in {status}"))
}

fn load(lane: &Lane) {
    let mut daemon = Daemon::start(lane, &config(lane, "mapped", "[ring]\nseconds = 40"));
    let mapped = ["vcan0,120:C00007FF,121:C00007FF,122:C00007FF"];
    let (mut candump, log) = lane.candump(&mapped);
    let began = monotonic_ns();
    let signals = Senders::start(lane, AT_REST);
    // Identifiers that are mapped would be a second sender: those are left to another test.
    let flood = Senders::start(lane, &["vcan0 -g 0 -I 2AA -L 8"]);
    sleep(Duration::from_mins(1));
    flood.stop();
    signals.stop();
    let took = schema::num::real_i64(monotonic_ns() - began) * 1e-9;
    sleep(Duration::from_secs(1));
    candump.stop("INT");
    let logged = schema::num::u64_of(read_log(&log, &["vcan0"]).len());
    let status = daemon.until("all frames are counted", 10, |status| {
        number(status, "/interfaces/0/frames") >= logged
    });
    let sent = fs::read_to_string("/sys/class/net/vcan0/statistics/rx_packets").unwrap();
    let memory = daemon.peak_memory();
    println!(
        "{took:.0} s with {} frames on the bus since the lane began: {} mapped ones heard, {logged} logged, {} \
         dropped; peak memory {:.1} MB, processor {:.2} s",
        sent.trim(),
        number(&status, "/interfaces/0/frames"),
        number(&status, "/interfaces/0/dropped"),
        schema::num::real_u64(memory) / 1e6,
        daemon.cpu_s(),
    );
    assert_eq!(number(&status, "/interfaces/0/frames"), logged);
    assert_eq!(number(&status, "/interfaces/0/dropped"), 0);
    assert!(logged > 9_000, "{logged}");
    assert!(memory < 16_000_000, "{memory} bytes");
    daemon.stop();
    whole_bus(lane);
}

/// The same with every frame let in: what it costs beside `candump -l`, on the same frames.
fn whole_bus(lane: &Lane) {
    fs::remove_dir_all(lane.dir().join("records")).unwrap();
    let mut daemon = Daemon::start(lane, &config(lane, "all", "[ring]\nseconds = 40"));
    let words = ["-l", "-r", "67108864", "vcan0"];
    let dir = lane.dir().join("logged");
    fs::create_dir_all(&dir).unwrap();
    let mut candump = Process::start("candump", &words, &dir.join("candump"));
    sleep(Duration::from_millis(500));
    let before = (daemon.cpu_s(), cpu_s(&candump));
    let signals = Senders::start(lane, AT_REST);
    let sender = ["vcan0", "-g", "0", "-I", "2AA", "-L", "8", "-n", "100000"];
    assert_eq!(
        Process::start("cangen", &sender, &dir.join("cangen")).wait(),
        Some(0)
    );
    signals.stop();
    sleep(Duration::from_secs(2));
    let status = daemon.until("all frames are counted", 20, |status| {
        number(status, "/interfaces/0/frames") + number(status, "/interfaces/0/dropped") >= 100_000
    });
    let ours = daemon.cpu_s() - before.0;
    let theirs = cpu_s(&candump) - before.1;
    candump.stop("INT");
    let (heard, dropped) = (
        number(&status, "/interfaces/0/frames"),
        number(&status, "/interfaces/0/dropped"),
    );
    let memory = daemon.peak_memory();
    println!(
        "every frame let in: {heard} heard, {dropped} dropped; processor time as the kernel accounts it: {:.1} us a \
         frame in the daemon, {:.1} us in candump -l; peak memory {:.1} MB",
        ours / schema::num::real_u64(heard) * 1e6,
        theirs / schema::num::real_u64(heard + dropped) * 1e6,
        schema::num::real_u64(memory) / 1e6,
    );
    assert!(heard + dropped >= 100_000);
    assert!(memory < 16_000_000, "{memory} bytes");
    assert!(ours <= theirs, "{ours} s {theirs} s");
    daemon.stop();
}

fn event_in_trouble(lane: &Lane) {
    let tail = "[ring]\nseconds = 30\npost_trigger_s = 24";
    let mut daemon = Daemon::start(lane, &config(lane, "mapped", tail));
    let signals = Senders::start(lane, AT_REST);
    daemon.until("the ring fills", 30, |status| {
        status["ring"]["held_s"].as_f64() > Some(7.0)
    });
    daemon.trigger();
    for round in 0..5 {
        sleep(Duration::from_millis(300));
        link("set vcan0 down");
        sleep(Duration::from_millis(400));
        link("set vcan0 up");
        sleep(Duration::from_millis(400));
        match round {
            1 => run("date", &["-s", "-1 hour"]),
            3 => run("date", &["-s", "+1 day"]),
            _ => String::new(),
        };
    }
    let status = daemon.until("the record is sealed", 60, |status| {
        number(status, "/records/sealed") == 1
    });
    assert_eq!(number(&status, "/interfaces/0/outages"), 5);
    assert_eq!(number(&status, "/totals/clock_steps"), 2);
    signals.stop();
    let records = daemon.stop();
    let [record] = records.as_slice() else {
        panic!("{} records", records.len());
    };
    assert!(record.completion.complete, "{:?}", record.completion);
    let mut next = 0;
    for at in record.samples() {
        assert!(at.index >= next, "time goes back at {}", at.index);
        next = at.index + at.span;
    }
    let after = next - record.triggers[0].index;
    println!(
        "{} samples, {after} after the trigger; {:?}",
        next - record.first_index(),
        record.health.notes
    );
    assert!(after >= 2400, "{after}");
    assert_eq!(
        record.health.clock_steps.len(),
        2,
        "{:?}",
        record.health.clock_steps
    );
    let down = record
        .health
        .notes
        .iter()
        .filter(|note| note.contains("went down"))
        .count();
    assert_eq!(down, 5, "{:?}", record.health.notes);
    assert!(record.health.gaps.len() >= 5);
}

fn hostile(lane: &Lane) {
    let path: &Path = &lane.config(
        &["vcan0"],
        "mapped",
        "[ring]\nseconds = 30\npost_trigger_s = 2",
    );
    let mut daemon = Daemon::start(lane, path);
    let mut commands = AT_REST.to_vec();
    commands.extend([
        // Anything at all, as fast as it goes.
        "vcan0 -g 0 -m -i",
        // A second sender of mapped frames: any length, any value, counters that jump.
        "vcan0 -g 3 -I 120 -L r",
        "vcan0 -g 3 -I 121 -L r",
        "vcan0 -g 5 -I 122 -L 2",
        "vcan0 -g 7 -I 120 -R",
        "vcan0 -g 7 -I 120 -f -L r",
    ]);
    let senders = Senders::start(lane, &commands);
    for error in ["20000004#0030000000000000", "20000040#0000000000000000"] {
        run("cansend", &["vcan0", error]);
    }
    sleep(Duration::from_secs(12));
    let status = daemon.until("it answers", 20, |_| true);
    senders.stop();
    let memory = daemon.peak_memory();
    println!(
        "hostile bus: totals {}, records {}, alarms {}, peak memory {:.1} MB",
        status["totals"],
        status["records"]["sealed"],
        status["alarms"],
        schema::num::real_u64(memory) / 1e6
    );
    assert!(number(&status, "/totals/malformed") > 100);
    assert!(number(&status, "/totals/error_frames") >= 2);
    assert_eq!(number(&status, "/interfaces/0/bus_off"), 1);
    assert!(memory < 64_000_000, "{memory} bytes");
    daemon.until("it goes on", 20, |status| status["state"] != "stopping");
    for record in daemon.stop() {
        record.validate().unwrap();
    }
}
