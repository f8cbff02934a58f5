//! Daemons ended by SIGKILL at random instants, side by side on one live bus, each started again where it was killed:
//! what was sealed still verifies, what was unfinished is sealed at the next start, and what is lost is bounded.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::thread::sleep;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recorder::clock::{monotonic_ns, realtime_ns};
use recorder::keys::read_public;
use recorder::recovery::recover;
use recorder::storage::Disk;
use schema::{Record, num};

use crate::bench::{Lane, Process, Test, run};
use crate::car::{self, CRASH_S};
use crate::reaper::{Death, Killer, Reaper};

/// The tests of this file.
pub(crate) const TESTS: &[Test] = &[(
    "daemons_that_are_killed_lose_at_most_the_bound_and_seal_every_event_once",
    false,
    kills,
)];

/// Daemons side by side, and kills of each.
const DAEMONS: u64 = 6;
const KILLS: usize = 17;
/// What is played: a crash each round, s; no daemon is started any more after `START_S`.
const ROUND_S: u32 = 6;
const PLAYED_S: u32 = 105;
const START_S: f64 = 60.0;
/// After the trigger, s.
const POST_S: f64 = 3.0;
/// A cut loses at most so much, ms; and while an event runs.
const BOUND_MS: f64 = 100.0;
const EVENT_BOUND_MS: f64 = 50.0;
/// Between two frames of the log, ms: part of no loss.
const FEED_MS: f64 = 10.0;
/// Where a thread of the daemons' own priority had to wait longer for a processor, ms, in the second before a kill, the
/// machine (or the other daemons on its only processor) held the daemon up: such kills are counted and told, and their
/// losses held to no bound.
const STALL_MS: f64 = 20.0;

/// A daemon's folder.
struct Place {
    program: PathBuf,
    dir: PathBuf,
    config: PathBuf,
}

impl Place {
    fn new(lane: &Lane, number: u64) -> Self {
        let dir = lane.dir().join(number.to_string());
        fs::create_dir_all(&dir).unwrap();
        let etc = lane.root.join("recorder/etc");
        let mut text = fs::read_to_string(etc.join("recorder.toml")).unwrap();
        let dbc = format!("\"{}\"", etc.join("example.dbc").display());
        for (from, to) in [
            ("\"example.dbc\"", dbc.as_str()),
            ("\"can0\"", "\"vcan0\""),
            ("# key =", "key ="),
            ("post_trigger_s = 10", "post_trigger_s = 3"),
            ("realtime_priority = 0", "realtime_priority = 20"),
            // None goes by the keep rule: each event must be found again, and each link of the chain.
            ("keep = 5", "keep = 500"),
            ("[run]", "[run]\nsocket = \"sock\""),
        ] {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        recorder::keys::create(&dir.join("device.key")).unwrap();
        let config = dir.join("recorder.toml");
        fs::write(&config, text).unwrap();
        Self {
            program: lane.bin.join("recorder"),
            dir,
            config,
        }
    }

    fn start(&self) -> Child {
        let mut options = fs::OpenOptions::new();
        let err = options.create(true).append(true).open(self.log()).unwrap();
        Command::new(&self.program)
            .args(["run", "--config"])
            .arg(&self.config)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(err)
            .spawn()
            .unwrap()
    }

    /// Starts it, and stops it once it records.
    fn once(&self) {
        let starts = self.recording().len();
        let mut child = self.start();
        self.wait_for(starts + 1);
        run("kill", &["-TERM", &child.id().to_string()]);
        assert!(child.wait().unwrap().success(), "{}", self.said());
    }

    fn log(&self) -> PathBuf {
        self.dir.join("err.txt")
    }

    fn said(&self) -> String {
        fs::read_to_string(self.log()).unwrap_or_default()
    }

    /// When it began to record, each time it was started, UTC, ns, as it logs it.
    fn recording(&self) -> Vec<i64> {
        let said = self.said();
        let lines = said.lines().filter(|line| line.contains("INFO recording"));
        lines.map(|line| utc_ns(&line[..27])).collect()
    }

    /// Waits until it began to record so many times.
    fn wait_for(&self, starts: usize) {
        let most_ns = monotonic_ns() + 30_000_000_000;
        while self.recording().len() < starts {
            assert!(monotonic_ns() < most_ns, "not started: {}", self.said());
            sleep(Duration::from_millis(50));
        }
    }

    /// The records, each sealed by the key and naming the one before. Gives the times of their first triggers.
    fn verified(&self) -> Vec<i64> {
        let key = read_public(&self.dir.join("device.key.pub")).unwrap();
        let mut paths: Vec<PathBuf> = fs::read_dir(self.dir.join("records"))
            .map(|entries| entries.map(|entry| entry.unwrap().path()).collect())
            .unwrap_or_default();
        paths.retain(|path| path.extension().is_some_and(|end| end == "svb"));
        paths.sort();
        let mut before: Option<(u64, [u8; 32])> = None;
        let mut triggers = Vec::new();
        for path in paths {
            let read = Record::read(&fs::read(&path).unwrap());
            let (record, seal) = read.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            assert!(seal.signed_by(&key), "{}", path.display());
            if let Some((number, digest)) = before {
                assert_eq!(record.header.number, number + 1, "{}", path.display());
                assert_eq!(record.header.previous_sha256, digest, "{}", path.display());
            }
            before = Some((record.header.number, seal.sha256));
            triggers.push(trigger_utc(&record));
        }
        triggers
    }
}

/// UTC of a record's first trigger, ns: the same wherever it was sealed.
fn trigger_utc(record: &Record) -> i64 {
    record.triggers[0].monotonic_ns + record.header.clock.offset_ns
}

/// `2026-01-31T23:59:59.123456Z` as ns since 1970, as far as the time of the day goes: the day is today.
fn utc_ns(text: &str) -> i64 {
    let number = |part: std::ops::Range<usize>| text[part].parse::<i64>().unwrap();
    let seconds = (number(11..13) * 60 + number(14..16)) * 60 + number(17..19);
    let day_ns = 86_400_000_000_000;
    let of_day = seconds * 1_000_000_000 + number(20..26) * 1000;
    let now = realtime_ns();
    let today = now - now.rem_euclid(day_ns) + of_day;
    // At midnight it was yesterday.
    if today > now { today - day_ns } else { today }
}

/// What one kill cost.
struct Loss {
    ms: f64,
    event: bool,
    stall_ms: f64,
}

#[derive(Default)]
struct Tally {
    kills: usize,
    unread: usize,
    recovered: usize,
    sealed: usize,
    sending_ms: f64,
    losses: Vec<Loss>,
}

/// When to kill a daemon, s of what is played, now that it records: in the 2 s after a trigger, or before one.
fn instant(random: &mut ChaCha8Rng, now_s: f64, after: bool) -> f64 {
    let round = f64::from(ROUND_S);
    let crash = CRASH_S + round * ((now_s + 0.3 - CRASH_S) / round).ceil();
    if after {
        crash + 0.1 + random.random_range(0.0..2.0)
    } else {
        random.random_range(now_s..crash)
    }
}

/// One daemon's life: started, killed, looked at, again.
fn life(place: &Place, began_ns: i64, seed: u64, killer: &Killer, tally: &Mutex<Tally>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut unfinished: Vec<i64> = Vec::new();
    let played_s = || num::real_i64(monotonic_ns() - began_ns) * 1e-9;
    for _ in 0..KILLS {
        if played_s() > START_S {
            break;
        }
        let starts = place.recording().len();
        let child = place.start();
        // A third in the 2 s after the trigger, a third before it, the rest anywhere, while it starts too.
        let at_s = match random.random_range(0..3) {
            2 => played_s() + random.random_range(0.05..4.0),
            kind => {
                place.wait_for(starts + 1);
                instant(&mut random, played_s(), kind == 0)
            }
        };
        let at_ns = began_ns + num::round_i64(at_s * 1e9);
        let death = killer.kill_at(child, at_ns);
        assert!(death.ran, "it ended by itself: {}", place.said());
        let recording_ns = place.recording().get(starts).copied();
        look(place, &death, recording_ns, &mut unfinished, tally);
    }
    // One more start: everything that was left is sealed.
    place.once();
    let triggers = place.verified();
    for utc in unfinished {
        let times = triggers.iter().filter(|found| **found == utc).count();
        assert_eq!(times, 1, "{}", place.said());
    }
    tally.lock().unwrap().sealed += triggers.len();
}

/// Looks at what a kill left.
fn look(
    place: &Place,
    death: &Death,
    recording_ns: Option<i64>,
    unfinished: &mut Vec<i64>,
    tally: &Mutex<Tally>,
) {
    let triggers = place.verified();
    let recovered = recover(&Disk, &place.dir.join("records/spool.svs")).unwrap();
    assert!(recovered.notes.is_empty(), "{:?}", recovered.notes);
    let waiting: Vec<i64> = recovered.records.iter().map(trigger_utc).collect();
    for utc in &*unfinished {
        let times = triggers.iter().filter(|found| *found == utc).count();
        assert!(times <= 1, "sealed twice: {}", place.said());
        // Killed again before it could be sealed: then the spool still has it.
        let found = times == 1 || waiting.contains(utc);
        assert!(found, "not sealed: {}", place.said());
    }
    unfinished.retain(|utc| !triggers.contains(utc));
    let mut tally = tally.lock().unwrap();
    for (utc, record) in waiting.iter().zip(&recovered.records) {
        if !triggers.contains(utc) && !unfinished.contains(utc) {
            unfinished.push(*utc);
            tally.recovered += 1;
            assert!(!record.completion.complete);
        }
    }
    tally.kills += 1;
    tally.sending_ms = tally.sending_ms.max(num::real_i64(death.sending_ns) / 1e6);
    let Some(recording_ns) = recording_ns else {
        tally.unread += 1;
        return;
    };
    // Of what was on the bus before it recorded nothing is lost by the kill.
    let last_ns = recovered
        .last_ns
        .map_or(recording_ns, |last| last.max(recording_ns));
    let age_s = |utc: &i64| num::real_i64(last_ns - utc) * 1e-9;
    tally.losses.push(Loss {
        ms: num::real_i64(death.killed_ns - last_ns) / 1e6,
        event: waiting
            .iter()
            .any(|utc| (0.1..POST_S - 0.1).contains(&age_s(utc))),
        stall_ms: num::real_i64(death.stall_ns) / 1e6,
    });
}

fn quantile(sorted: &[f64], part: f64) -> f64 {
    let at = num::round_usize((num::real(sorted.len()) * part).ceil());
    sorted[at.clamp(1, sorted.len()) - 1]
}

/// Median, 99th percentile, most.
fn figures(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    if all.is_empty() {
        return [0.0; 3];
    }
    [0.5, 0.99, 1.0].map(|part| quantile(&all, part))
}

fn kills(lane: &Lane) {
    let log = car::log(lane, PLAYED_S, Some(ROUND_S));
    let places: Vec<Place> = (0..DAEMONS)
        .map(|number| Place::new(lane, number))
        .collect();
    // Laying out the spool, done once, is a load of its own.
    places.iter().for_each(Place::once);
    let reaper = Reaper::start(20);
    // The bus of a car does not wait for anybody.
    let words = [
        "--fifo",
        "25",
        "canplayer",
        "-g",
        "2",
        "-I",
        log.to_str().unwrap(),
    ];
    let began_ns = monotonic_ns();
    let player = [&words[..], &["vcan0=can0"]].concat();
    let mut player = Process::start("chrt", &player, &lane.dir().join("canplayer"));
    let tally = Mutex::new(Tally::default());
    std::thread::scope(|scope| {
        let lives: Vec<_> = (82_100..)
            .zip(&places)
            .map(|(seed, place)| {
                let (killer, tally) = (reaper.killer(), &tally);
                scope.spawn(move || life(place, began_ns, seed, &killer, tally))
            })
            .collect();
        // What the first to fail said is the reason; the scope would hide it.
        for life in lives {
            if let Err(what) = life.join() {
                std::panic::resume_unwind(what);
            }
        }
    });
    let took_s = num::real_i64(monotonic_ns() - began_ns) * 1e-9;
    assert!(player.running(), "the log is over before the daemons are");
    let stalls: Vec<f64> = reaper
        .end()
        .iter()
        .map(|ns| num::real_i64(*ns) / 1e6)
        .collect();
    tell(
        &tally.into_inner().unwrap(),
        &stalls,
        took_s,
        lane.dir().as_path(),
    );
}

fn tell(tally: &Tally, stalls: &[f64], took_s: f64, dir: &Path) {
    println!(
        "{} kills of {DAEMONS} daemons on one bus in {took_s:.0} s, {} of them before it recorded; {} unfinished events \
         read back, {} records at the end, all verified",
        tally.kills, tally.unread, tally.recovered, tally.sealed
    );
    println!(
        "a sleep of 1 ms at the daemons' priority took too long by {:.1} ms in the median, {:.1} ms at the 99.9th percentile, {:.1} ms at most; \
         a kill is sent within {:.1} ms; folders in {}",
        quantile(stalls, 0.5),
        quantile(stalls, 0.999),
        quantile(stalls, 1.0),
        tally.sending_ms,
        file_system(dir),
    );
    let mut broken = false;
    for (event, bound) in [(false, BOUND_MS), (true, EVENT_BOUND_MS)] {
        for stalled in [false, true] {
            let of = |loss: &&Loss| loss.event == event && (loss.stall_ms > STALL_MS) == stalled;
            let of: Vec<&Loss> = tally.losses.iter().filter(of).collect();
            let [median, high, most] = figures(of.iter().map(|loss| loss.ms));
            let beyond = of.iter().filter(|loss| loss.ms > bound + FEED_MS).count();
            println!(
                "{} kills {}, {}: lost {median:.1} ms in the median, {high:.1} ms at the 99th percentile, {most:.1} ms \
                 at most; {beyond} beyond {bound} ms",
                of.len(),
                if event {
                    "while an event ran"
                } else {
                    "without an event"
                },
                if stalled { "held up" } else { "not held up" },
            );
            for loss in of.iter().filter(|loss| loss.ms > bound + FEED_MS) {
                println!("  lost {:.1} ms, stall {:.1} ms", loss.ms, loss.stall_ms);
            }
            broken |= !stalled && beyond > 0;
        }
    }
    assert!(
        !broken,
        "a loss beyond the bound, and nothing held the daemon up"
    );
    assert!(tally.kills >= 50, "{}", tally.kills);
    let events = tally.losses.iter().filter(|loss| loss.event).count();
    assert!(events >= 5 && tally.recovered >= events, "{events}");
}

/// Kind of the file system that a folder is on.
fn file_system(dir: &Path) -> String {
    run("stat", &["-f", "-c", "%T", dir.to_str().unwrap()])
        .trim()
        .to_owned()
}
