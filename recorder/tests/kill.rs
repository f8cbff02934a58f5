//! The daemon ended by SIGKILL at random instants, several side by side, each started again where it was killed:
//! what was sealed still verifies, what was unfinished is sealed at the next start, and what is lost is bounded.
//!
//! `SVARTBOKS_KILLS` sets how many (50), `SVARTBOKS_KILL_DAEMONS` how many side by side (6). The folders are on a file
//! system in memory where there is one: daemons that each synchronise 67 times a second share one disk badly, which is
//! no car's. What a real disk takes each daemon measures itself (`recorder status`), and what is lost when it is cut
//! is the matter of `spool_model.rs`. A kill at which the machine itself stood still is counted and told.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use nix::sched::{CpuSet, sched_setaffinity};
use nix::unistd::Pid;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recorder::clock::realtime_ns;
use recorder::keys::read_public;
use recorder::recovery::{Recovered, recover};
use recorder::storage::Disk;
use schema::{Record, num};
use support::{Log, etc};

/// When the crash is, s from the log's start.
const CRASH_S: f64 = 2.5;
/// The log's length, in samples of 10 ms.
const LENGTH: u32 = 1600;
/// A cut loses at most so much, ms; and while an event runs.
const BOUND_MS: f64 = 100.0;
const EVENT_BOUND_MS: f64 = 50.0;
/// The machine stood still for so long in the second before the kill: a sleep of 1 ms took so much longer, ms.
const STALL_MS: f64 = 15.0;
/// Between the reading of the clock and the death of the process, ms: part of no loss.
const FEED_MS: f64 = 10.0;

/// A car at 50 km/h that is stopped within 140 ms.
fn crash_log() -> String {
    let mut log = Log::default();
    let mut at = 0.0;
    for number in 0_u32..LENGTH {
        let t = f64::from(number) / 100.0;
        let pulse = (CRASH_S..CRASH_S + 0.14).contains(&t);
        let forward = if pulse { -100.0 } else { 0.0 };
        log.accel(t, [forward, 0.0, 9.806], u64::from(number));
        log.rate(t + 0.0002, [0.0; 3], u64::from(number));
        if number.is_multiple_of(2) {
            log.wheels(t + 0.0004, if t < CRASH_S { 50.0 } else { 0.0 });
        }
        at = t;
    }
    assert!(at > CRASH_S);
    log.text()
}

struct Place {
    dir: PathBuf,
    config: PathBuf,
    log: PathBuf,
}

impl Place {
    fn new(root: &Path, number: u64) -> Self {
        let dir = root.join(number.to_string());
        fs::create_dir_all(&dir).unwrap();
        let text = fs::read_to_string(etc().join("recorder.toml")).unwrap();
        let text = text
            .replace(
                "\"example.dbc\"",
                &format!("\"{}\"", etc().join("example.dbc").display()),
            )
            .replace("# key =", "key =")
            // As in a car; where it is not allowed the daemon says so and goes on.
            .replace("realtime_priority = 0", "realtime_priority = 20")
            .replace("[run]", "[run]\nsocket = \"sock\"");
        recorder::keys::create(&dir.join("device.key")).unwrap();
        let config = dir.join("recorder.toml");
        fs::write(&config, text).unwrap();
        let log = dir.join("crash.log");
        fs::write(&log, crash_log()).unwrap();
        Self { dir, config, log }
    }

    fn start(&self) -> Child {
        let err = fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(self.dir.join("err.txt"))
            .unwrap();
        Command::new(env!("CARGO_BIN_EXE_recorder"))
            .args(["run", "--config"])
            .arg(&self.config)
            .arg("--paced")
            .arg(&self.log)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(err)
            .spawn()
            .unwrap()
    }

    fn spool(&self) -> PathBuf {
        self.dir.join("records/spool.svs")
    }

    fn records(&self) -> Vec<PathBuf> {
        let mut found: Vec<PathBuf> = fs::read_dir(self.dir.join("records"))
            .map(|entries| entries.map(|entry| entry.unwrap().path()).collect())
            .unwrap_or_default();
        found.retain(|path| path.extension().is_some_and(|end| end == "svb"));
        found.sort();
        found
    }

    fn said(&self) -> String {
        fs::read_to_string(self.dir.join("err.txt")).unwrap_or_default()
    }
}

/// UTC of a record's first trigger, ns: the same wherever it was sealed.
fn trigger_utc(record: &Record) -> i64 {
    record.triggers[0].monotonic_ns + record.header.clock.offset_ns
}

fn read_record(path: &Path) -> Record {
    let bytes = fs::read(path).unwrap();
    let read = Record::read(&bytes).map_err(|error| format!("{}: {error}", path.display()));
    read.unwrap().0
}

/// The records of a place, each sealed by the key and naming the one before; those between may have been removed by
/// the keep rule.
fn verify(place: &Place) -> Vec<Record> {
    let key = read_public(&place.dir.join("device.key.pub")).unwrap();
    let mut before: Option<(u64, [u8; 32])> = None;
    let mut records = Vec::new();
    for path in place.records() {
        let (record, seal) = Record::read(&fs::read(&path).unwrap()).unwrap();
        assert!(seal.signed_by(&key), "{}", path.display());
        if let Some((number, digest)) = before
            && record.header.number == number + 1
        {
            assert_eq!(record.header.previous_sha256, digest, "{}", path.display());
        }
        before = Some((record.header.number, seal.sha256));
        records.push(record);
    }
    records
}

#[derive(Default)]
struct Tally {
    kills: AtomicU64,
    after_trigger: AtomicU64,
    /// Killed before anything was recorded.
    early: AtomicU64,
    recovered: AtomicU64,
    sealed: AtomicU64,
    losses: Mutex<Vec<(f64, bool)>>,
    /// Losses at which the machine stood still.
    stalled: Mutex<Vec<f64>>,
    /// When the machine stood still lately, ns, and for how long, ms.
    stalls: Mutex<Vec<(i64, f64)>>,
    over: AtomicBool,
}

impl Tally {
    /// Watches one processor of the machine.
    fn watch(&self, processor: usize) {
        let mut only = CpuSet::new();
        only.set(processor).unwrap();
        // Where that is not allowed it watches whichever it is given.
        let _ = sched_setaffinity(Pid::from_raw(0), &only);
        while !self.over.load(Ordering::Relaxed) {
            let before = realtime_ns();
            thread::sleep(Duration::from_millis(1));
            let now = realtime_ns();
            let late = num::real_i64(now - before) / 1e6 - 1.0;
            if late > STALL_MS {
                self.stalls.lock().unwrap().push((now, late));
            }
        }
    }

    fn stalled_before(&self, at_ns: i64) -> bool {
        let stalls = self.stalls.lock().unwrap();
        stalls
            .iter()
            .any(|(when, _)| (at_ns - 1_000_000_000..=at_ns + 50_000_000).contains(when))
    }
}

fn quantile(sorted: &[f64], part: f64) -> f64 {
    let at = num::round_usize((num::real(sorted.len()) * part).ceil());
    sorted[at.clamp(1, sorted.len()) - 1]
}

/// One daemon's life: started, killed, looked at, again.
fn worker(place: &Place, runs: u64, seed: u64, tally: &Tally) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut unfinished: Vec<i64> = Vec::new();
    let mut before = 0;
    for _ in 0..runs {
        let mut child = place.start();
        // A third in the 2 s after the trigger, a third before it, the rest anywhere.
        let wait = match random.random_range(0..3) {
            0 => CRASH_S + 0.1 + random.random_range(0.0..2.0),
            1 => random.random_range(0.05..CRASH_S),
            _ => random.random_range(0.05..9.0),
        };
        thread::sleep(Duration::from_secs_f64(wait));
        let killed_ns = realtime_ns();
        child.kill().unwrap();
        child.wait().unwrap();
        tally.kills.fetch_add(1, Ordering::Relaxed);

        // What was unfinished at the kill before this start is sealed now, once.
        let records: Vec<Record> = place
            .records()
            .iter()
            .map(|path| read_record(path))
            .collect();
        let triggers: Vec<i64> = records.iter().map(trigger_utc).collect();
        let recovered: Recovered = recover(&Disk, &place.spool()).unwrap();
        assert!(recovered.notes.is_empty(), "{:?}", recovered.notes);
        for utc in &unfinished {
            let times = triggers.iter().filter(|found| *found == utc).count();
            let waits = recovered
                .records
                .iter()
                .any(|record| trigger_utc(record) == *utc);
            assert!(times <= 1, "sealed twice: {}", place.said());
            // Killed again before it could be sealed: then the spool still has it.
            assert!(times == 1 || waits, "not sealed: {}", place.said());
        }
        unfinished.retain(|utc| !triggers.contains(utc));
        for record in &recovered.records {
            let utc = trigger_utc(record);
            if !triggers.contains(&utc) && !unfinished.contains(&utc) {
                unfinished.push(utc);
                tally.recovered.fetch_add(1, Ordering::Relaxed);
                assert!(!record.completion.complete);
            }
        }
        // Killed before it began to write: what is there is the session before.
        let session = recovered.found.session();
        if std::mem::replace(&mut before, session) == session {
            tally.early.fetch_add(1, Ordering::Relaxed);
            continue;
        }
        // How much is lost: frames come each 10 ms at least, the whole time.
        let Some(last_ns) = recovered.last_ns.filter(|_| recovered.frames > 20) else {
            continue;
        };
        let loss_ms = num::real_i64(killed_ns - last_ns) / 1e6;
        let event = recovered
            .records
            .iter()
            .any(|record| trigger_utc(record) + 100_000_000 < last_ns);
        if loss_ms < 5000.0 {
            if event {
                tally.after_trigger.fetch_add(1, Ordering::Relaxed);
            }
            if tally.stalled_before(killed_ns) {
                tally.stalled.lock().unwrap().push(loss_ms);
            } else {
                tally.losses.lock().unwrap().push((loss_ms, event));
            }
        }
    }
    // One more start: everything that was left is sealed.
    let mut child = place.start();
    thread::sleep(Duration::from_secs(1));
    let _ = Command::new("kill")
        .arg("-TERM")
        .arg(child.id().to_string())
        .status();
    assert!(child.wait().unwrap().success(), "{}", place.said());
    let triggers: Vec<i64> = verify(place).iter().map(trigger_utc).collect();
    for utc in unfinished {
        assert_eq!(
            triggers.iter().filter(|found| **found == utc).count(),
            1,
            "{}",
            place.said()
        );
    }
    tally
        .sealed
        .fetch_add(num::u64_of(triggers.len()), Ordering::Relaxed);
}

#[test]
fn what_is_killed_loses_at_most_the_bound_and_every_event_is_sealed_once() {
    let number = |name: &str, otherwise: u64| {
        std::env::var(name).map_or(otherwise, |text| text.parse().unwrap())
    };
    let kills = number("SVARTBOKS_KILLS", 50);
    let daemons = number("SVARTBOKS_KILL_DAEMONS", 6).min(kills);
    let memory = PathBuf::from("/dev/shm");
    let folder = if memory.is_dir() {
        memory
    } else {
        std::env::temp_dir()
    };
    let root = folder.join(format!("recorder-kill-{}", std::process::id()));
    let _ = fs::remove_dir_all(&root);
    let tally = Arc::new(Tally::default());
    let workers: Vec<_> = (0..daemons)
        .map(|number| {
            let place = Place::new(&root, number);
            let runs = kills / daemons + u64::from(number < kills % daemons);
            let tally = Arc::clone(&tally);
            thread::spawn(move || worker(&place, runs, 82_000 + number, &tally))
        })
        .collect();
    let processors = thread::available_parallelism().map_or(1, usize::from);
    let watching: Vec<_> = (0..processors)
        .map(|processor| {
            let tally = Arc::clone(&tally);
            thread::spawn(move || tally.watch(processor))
        })
        .collect();
    for worker in workers {
        worker.join().unwrap();
    }
    tally.over.store(true, Ordering::Relaxed);
    for watching in watching {
        watching.join().unwrap();
    }
    let stalled = tally.stalled.lock().unwrap();
    if !stalled.is_empty() {
        println!(
            "{} kills while the machine stood still: {:.1} ms at most",
            stalled.len(),
            stalled.iter().copied().fold(0.0, f64::max)
        );
    }
    let losses = tally.losses.lock().unwrap();
    for (event, bound) in [(false, BOUND_MS), (true, EVENT_BOUND_MS)] {
        let mut of: Vec<f64> = losses
            .iter()
            .filter(|(_, is)| *is == event)
            .map(|(loss, _)| *loss)
            .collect();
        of.sort_by(f64::total_cmp);
        if of.is_empty() {
            continue;
        }
        println!(
            "{} kills {}: lost {:.1} ms in the median, {:.1} ms at the 99th percentile, {:.1} ms at most",
            of.len(),
            if event {
                "while an event ran"
            } else {
                "without an event"
            },
            quantile(&of, 0.5),
            quantile(&of, 0.99),
            of[of.len() - 1]
        );
        assert!(of[of.len() - 1] <= bound + FEED_MS);
    }
    println!(
        "{} kills, {} of them before it recorded, {} while an event ran; {} unfinished events read back, {} records at the end, all verified",
        tally.kills.load(Ordering::Relaxed),
        tally.early.load(Ordering::Relaxed),
        tally.after_trigger.load(Ordering::Relaxed),
        tally.recovered.load(Ordering::Relaxed),
        tally.sealed.load(Ordering::Relaxed)
    );
    assert_eq!(tally.kills.load(Ordering::Relaxed), kills);
    fs::remove_dir_all(&root).unwrap();
}
