//! The spool against a model of what a loss of power leaves: after a cut at any point of a recording, with writes
//! torn into sectors and in any order until they were synchronised, everything that was synchronised is read back, the
//! event that ran is found, and it holds the samples that a replay of the same frames gives.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use recorder::can::Frame;
use recorder::config::{Bundle, Settings};
use recorder::pipeline::Pipeline;
use recorder::recovery::{Recovered, recover};
use recorder::spool::{Entry, Journal, SpoolFile, bundles, scan};
use recorder::storage::Storage;
use recorder::storage::model::{Cut, Model};
use schema::parts::TriggerKind;
use schema::{Record, num};
use support::{EPOCH, Log, etc, frames};

const CRASH_S: f64 = 3.0;
/// In samples of 10 ms.
const LENGTH: u32 = 2000;
const MS: i64 = 1_000_000;
/// The longest that a flush takes in the model, and what may be lost in all.
const FLUSH_TAKES: i64 = 30 * MS;
const BOUND: i64 = 100 * MS;
const EVENT_BOUND: i64 = 50 * MS;

fn spool_path() -> PathBuf {
    PathBuf::from("/records/spool.svs")
}

fn crash_log() -> String {
    let mut log = Log::default();
    for number in 0_u32..LENGTH {
        let t = f64::from(number) / 100.0;
        let pulse = (CRASH_S..CRASH_S + 0.14).contains(&t);
        let wobble = f64::from(number % 7) * 0.05;
        log.accel(
            t,
            [if pulse { -100.0 } else { wobble }, -wobble, 9.8],
            u64::from(number),
        );
        log.rate(t + 0.0002, [0.0, wobble, 0.0], u64::from(number));
        if number.is_multiple_of(2) {
            log.wheels(t + 0.0004, if t < CRASH_S { 50.0 } else { 0.0 });
        }
    }
    log.text()
}

/// What was known to be durable when so many changes of the file system had been made.
#[derive(Clone, Copy)]
struct Durable {
    changes: usize,
    upto_ns: i64,
    triggered: bool,
    sealed: bool,
}

struct Recording {
    model: Model,
    durable: Vec<Durable>,
    started: usize,
    oldest_unsynced_ms: [f64; 2],
    live: Option<Record>,
}

/// The daemon's loop on the log's own clock: a flush each `flush_ns` (15 ms in an event) that takes up to 30 ms
/// (20 in an event) to be durable.
fn record(settings: &Arc<Settings>, frames: &[Frame], blocks: u64) -> Recording {
    let model = Model::new();
    let storage: Arc<dyn Storage> = Arc::new(model.clone());
    let (_, bundle) = Settings::load_bundled(&etc().join("recorder.toml")).unwrap();
    let digest = bundles::store(storage.as_ref(), &spool_path(), &bundle).unwrap();
    let found = scan(storage.as_ref(), &spool_path()).unwrap();
    let mut file = SpoolFile::begin(&storage, &spool_path(), blocks, &found, 1).unwrap();
    let mut journal = Journal::new();
    let mut pipeline = Pipeline::new(Arc::clone(settings), &[], None);
    let mut recording = Recording {
        started: model.changes(),
        model: model.clone(),
        durable: Vec::new(),
        oldest_unsynced_ms: [0.0; 2],
        live: None,
    };
    journal.entry(&Entry::Session {
        at_ns: frames[0].time_ns,
        bundle: digest,
        utc_offset_ns: 0,
    });
    let (mut flushed, mut second, mut durable_ns) = (0, 0, frames[0].time_ns);
    let mut pending: Option<(i64, Durable)> = None;
    let mut alert_since = None;
    let (mut triggered, mut sealed, mut number) = (false, false, 0);
    for frame in frames {
        let now = frame.time_ns;
        journal.frame(frame);
        pipeline.frame(frame);
        pipeline.take_fired(|fired| {
            journal.entry(&Entry::Trigger {
                fired,
                utc_offset_ns: 0,
            });
            triggered = true;
        });
        while let Some(record) = pipeline.take_ready() {
            let trigger_ns = pipeline.trigger_line_ns(&record);
            journal.entry(&Entry::Sealed {
                first_ns: trigger_ns,
                last_ns: trigger_ns,
            });
            recording.live = Some(record);
            sealed = true;
        }
        if now - second >= 1000 * MS {
            second = now;
            journal.entry(&Entry::Counts {
                at_ns: now,
                bundle: digest,
                clock: 1,
                uncertainty_ns: None,
                dropped: 0,
                error_frames: 0,
                utc_offset_ns: 0,
            });
        }
        let event = pipeline.alert();
        if let Some((done_at, durable)) = pending
            && now >= done_at
        {
            durable_ns = durable.upto_ns;
            recording.durable.push(durable);
            pending = None;
        }
        let interval = if event {
            15 * MS
        } else {
            settings.spool.flush_ns
        };
        if pending.is_none() && now - flushed >= interval {
            journal.entry(&Entry::Closed {
                at_ns: pipeline.undecided_ns(),
            });
            let mut bytes = journal.exchange(Vec::new());
            file.write(&mut bytes).unwrap();
            file.sync().unwrap();
            number += 1;
            let takes = if event { FLUSH_TAKES / 2 } else { FLUSH_TAKES } * (1 + number % 3) / 3;
            let durable = Durable {
                changes: model.changes(),
                upto_ns: now,
                triggered,
                sealed,
            };
            pending = Some((now + takes, durable));
            flushed = now;
        }
        let age = num::real_i64(now - durable_ns) / 1e6;
        let since = alert_since.filter(|_| event).unwrap_or(now);
        alert_since = event.then_some(since);
        // What came before the alert falls under the quiet bound.
        let slot = &mut recording.oldest_unsynced_ms[usize::from(event && durable_ns >= since)];
        *slot = slot.max(age);
    }
    recording
}

fn read_back(model: &Model) -> Recovered {
    recover(model, &spool_path()).unwrap()
}

fn code_rows(record: &Record) -> Vec<(i64, schema::Codes)> {
    let offset = record.header.clock.offset_ns;
    let rows = record.blocks.iter().flat_map(|block| {
        (0_i64..)
            .zip(&block.samples)
            .map(move |(at, codes)| (block.monotonic_ns + offset + at * 10 * MS, *codes))
    });
    rows.collect()
}

#[test]
fn whatever_was_synchronised_is_read_back_after_any_cut() {
    let settings = Arc::new(Settings::load(&etc().join("recorder.toml")).unwrap());
    let frames = frames(&crash_log());
    // Fewer blocks than flushes: the circle comes round while the event runs.
    let recording = record(&settings, &frames, 700);
    let [quiet, event] = recording.oldest_unsynced_ms;
    println!("oldest frame that was not synchronised: {quiet:.1} ms, in an event {event:.1} ms");
    assert!(quiet <= num::real_i64(BOUND) / 1e6 && event <= num::real_i64(EVENT_BOUND) / 1e6);
    let live = recording
        .live
        .as_ref()
        .expect("the event ends within the log");
    let reference = code_rows(live);

    let last = recording.model.changes();
    let (mut cuts, mut events, mut blocks_lost) = (0, 0, 0);
    let step = ((last - recording.started) / 110).max(1);
    for count in (recording.started..=last)
        .step_by(step)
        .chain(last - 3..=last)
    {
        let known = recording
            .durable
            .iter()
            .rfind(|durable| durable.changes <= count);
        for cut in [
            Cut::Least,
            Cut::Process,
            Cut::Some(num::u64_of(count)),
            Cut::Some(!num::u64_of(count)),
        ] {
            let left = recording.model.after_cut(count, cut);
            let back = read_back(&left);
            cuts += 1;
            let Some(known) = known else { continue };
            let last_ns = back.last_ns.expect("something was synchronised");
            assert!(
                last_ns >= known.upto_ns,
                "{count} {cut:?}: {last_ns} before {}",
                known.upto_ns
            );
            blocks_lost += usize::from(!back.notes.is_empty());
            if known.sealed {
                assert!(back.records.is_empty(), "{count} {cut:?}: sealed already");
            }
            if known.triggered && !known.sealed {
                assert_eq!(back.records.len(), 1, "{count} {cut:?}");
            }
            let Some(record) = back.records.first() else {
                continue;
            };
            if record.triggers[0].kind == TriggerKind::PowerLoss {
                // Cut before the crash.
                continue;
            }
            events += 1;
            let utc =
                |record: &Record| record.triggers[0].monotonic_ns + record.header.clock.offset_ns;
            assert_eq!(utc(record), utc(live));
            assert!(record.to_bytes().is_ok());
            // The same samples, up to the end, where the last bins were not full.
            let rows = code_rows(record);
            let open = last_ns - 100 * MS;
            for row in rows
                .iter()
                .filter(|row| row.0 < open && row.0 > (EPOCH + 2) * 1000 * MS)
            {
                assert!(reference.contains(row), "{count} {cut:?}: {row:?}");
            }
        }
    }
    println!(
        "{cuts} cuts, {events} unfinished events read back, {blocks_lost} with blocks that a cut tore"
    );
    assert!(events > 100);
}

/// A cut between contact and the decision of the trigger, some 60 ms later: the event is found when the spool is read.
#[test]
fn a_crash_whose_trigger_was_not_decided_yet_is_found() {
    let settings = Arc::new(Settings::load(&etc().join("recorder.toml")).unwrap());
    let all = frames(&crash_log());
    let contact = EPOCH * 1000 * MS + num::round_i64(CRASH_S * 1e9);
    let mut found_after = i64::MAX;
    for after_ms in (20..200).step_by(5) {
        let until = contact + after_ms * MS;
        let frames: Vec<Frame> = all
            .iter()
            .copied()
            .filter(|frame| frame.time_ns <= until)
            .collect();
        let recording = record(&settings, &frames, 300);
        let back = read_back(
            &recording
                .model
                .after_cut(recording.model.changes(), Cut::Process),
        );
        let [record] = back.records.as_slice() else {
            unreachable!("the car moved: there is a record");
        };
        if record.triggers[0].kind == TriggerKind::DeltaV {
            found_after = found_after.min(after_ms);
            assert!(!record.completion.complete);
            assert!(
                record
                    .completion
                    .reasons
                    .iter()
                    .any(|reason| reason.contains("cut"))
            );
        }
    }
    println!("found where the cut came {found_after} ms after contact or later");
    // -100 m/s^2 takes 22 ms to change the speed by 8 km/h; the rest is the flush.
    assert!(found_after <= 22 + 60 + 20, "{found_after}");
}

#[test]
fn a_spool_of_any_bytes_is_read_without_harm() {
    use rand::{RngExt, SeedableRng};
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(83_001);
    let settings = Arc::new(Settings::load(&etc().join("recorder.toml")).unwrap());
    let all = frames(&crash_log());
    let recording = record(&settings, &all[..1500], 300);
    let path = spool_path();
    for round in 0..300 {
        let model = recording
            .model
            .after_cut(recording.model.changes(), Cut::Process);
        let length = model.length(&path).unwrap();
        let mut file = model.open(&path).unwrap();
        for _ in 0..random.random_range(1..200) {
            let junk: Vec<u8> = (0..random.random_range(1..64))
                .map(|_| random.random())
                .collect();
            file.write_at(random.random_range(0..length), &junk)
                .unwrap();
        }
        if round % 3 == 0 {
            file.write_at(length, &[0xFF; 5000]).unwrap();
        }
        drop(file);
        let _ = recover(&model, &path);
    }
    assert!(
        scan(&recording.model, Path::new("/nowhere"))
            .unwrap()
            .newest()
            == 0
    );
}

#[test]
fn a_bundle_comes_back_and_any_other_bytes_are_refused() {
    use rand::{RngExt, SeedableRng};
    let (settings, bundle) = Settings::load_bundled(&etc().join("recorder.toml")).unwrap();
    let bytes = bundle.to_bytes();
    let back = Bundle::from_bytes(Path::new("x"), &bytes).unwrap();
    assert_eq!(back, bundle);
    assert_eq!(
        back.settings().unwrap().config_sha256,
        settings.config_sha256
    );
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(83_002);
    for _ in 0..2000 {
        let mut broken = bytes.clone();
        for _ in 0..random.random_range(1..20) {
            let at = random.random_range(0..broken.len());
            broken[at] = random.random();
        }
        broken.truncate(random.random_range(0..=broken.len()));
        if let Ok(other) = Bundle::from_bytes(Path::new("x"), &broken)
            && other != bundle
        {
            assert_ne!(other.digest(), bundle.digest());
        }
    }
}
