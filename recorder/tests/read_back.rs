//! What is read back from a spool in the cases that are not a plain cut: several triggers of which the first is
//! overwritten, a bus that falls silent before the power goes, a parked car, a clock set before the spool began, a reload
//! in the moment of an impact, settings that are gone, a page that can not be read.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use recorder::can::Frame;
use recorder::config::Settings;
use recorder::pipeline::Pipeline;
use recorder::recovery::{Recovered, recover};
use recorder::spool::{Entry, Journal, SpoolFile, bundles, scan};
use recorder::storage::Storage;
use recorder::storage::model::Model;
use schema::parts::TriggerKind;
use support::{EPOCH, Log, etc};

const S: i64 = 1_000_000_000;

fn spool_path() -> PathBuf {
    PathBuf::from("/records/spool.svs")
}

/// A car at 50 km/h that is hit for 140 ms at each of these times, and stands after the first; without hits it drives on.
fn frames(until_s: u32, hits: &[f64], kmh: f64) -> Vec<Frame> {
    let mut log = Log::default();
    for number in 0..until_s * 100 {
        let t = f64::from(number) / 100.0;
        let pulse = hits.iter().any(|at| (*at..*at + 0.14).contains(&t));
        let moving = hits.first().is_none_or(|at| t < *at);
        log.accel(
            t,
            [if pulse { -100.0 } else { 0.0 }, 0.0, 9.8],
            u64::from(number),
        );
        log.rate(t + 0.0002, [0.0; 3], u64::from(number));
        log.wheels(t + 0.0004, if moving { kmh } else { 0.0 });
    }
    support::frames(&log.text())
}

fn at(seconds: f64) -> i64 {
    EPOCH * S + schema::num::round_i64(seconds * 1e9)
}

/// A daemon in small: what it does to a spool, without threads and clocks.
struct Small {
    model: Model,
    file: SpoolFile,
    journal: Journal,
    pipeline: Pipeline<'static>,
    bundle: [u8; 32],
    flushed_ns: i64,
    sealed: usize,
    /// Records are told to be sealed.
    seals: bool,
}

impl Small {
    fn new(blocks: u64, begin_offset_ns: i64) -> Self {
        let model = Model::new();
        let storage: Arc<dyn Storage> = Arc::new(model.clone());
        let (settings, bundle) = Settings::load_bundled(&etc().join("recorder.toml")).unwrap();
        let digest = bundles::store(storage.as_ref(), &spool_path(), &bundle).unwrap();
        let found = scan(storage.as_ref(), &spool_path()).unwrap();
        let mut small = Self {
            file: SpoolFile::begin(&storage, &spool_path(), blocks, &found, 1).unwrap(),
            model,
            journal: Journal::new(),
            pipeline: Pipeline::new(Arc::new(settings), &[], None),
            bundle: digest,
            flushed_ns: 0,
            sealed: 0,
            seals: true,
        };
        if begin_offset_ns != 0 {
            small.pipeline.clock_step(at(0.0), begin_offset_ns);
        }
        small.journal.entry(&Entry::Session {
            at_ns: at(0.0),
            bundle: digest,
            utc_offset_ns: begin_offset_ns,
        });
        small
    }

    fn take(&mut self, frames: &[Frame]) {
        for frame in frames {
            self.journal.frame(frame);
            self.pipeline.frame(frame);
            self.turn(frame.time_ns);
        }
    }

    fn turn(&mut self, now: i64) {
        let shift = self.pipeline.shift_ns();
        let journal = &mut self.journal;
        self.pipeline.take_fired(|fired| {
            journal.entry(&Entry::Trigger {
                fired,
                utc_offset_ns: shift,
            });
        });
        while let Some(record) = self.pipeline.take_ready() {
            self.sealed += 1;
            let first_ns = self.pipeline.trigger_line_ns(&record);
            let span =
                record.triggers.last().unwrap().monotonic_ns - record.triggers[0].monotonic_ns;
            if self.seals {
                self.journal.entry(&Entry::Sealed {
                    first_ns,
                    last_ns: first_ns + span,
                });
            }
        }
        if now - self.flushed_ns >= 60_000_000 {
            self.flushed_ns = now;
            self.journal.entry(&Entry::Closed {
                at_ns: self.pipeline.undecided_ns(),
            });
            let mut bytes = self.journal.exchange(Vec::new());
            self.file.write(&mut bytes).unwrap();
            self.file.sync().unwrap();
        }
    }

    /// No frame comes, the recorder lives: counts each second.
    fn silence(&mut self, from_s: f64, seconds: u32) {
        for second in 0..seconds {
            let now = at(from_s + f64::from(second));
            self.pipeline.tick(now);
            self.journal.entry(&Entry::Counts {
                at_ns: now,
                bundle: self.bundle,
                clock: 1,
                uncertainty_ns: None,
                dropped: 0,
                error_frames: 0,
                utc_offset_ns: self.pipeline.shift_ns(),
            });
            self.turn(now);
        }
    }

    fn read_back(&self) -> Recovered {
        recover(&self.model, &spool_path()).unwrap()
    }
}

#[test]
fn a_sealed_event_whose_first_trigger_is_overwritten_is_not_sealed_again() {
    // 60 s at a flush each 60 ms are 1,000 blocks; the circle forgets the first trigger and keeps the second.
    for blocks in [520, 560, 600, 640] {
        let mut small = Small::new(blocks, 0);
        small.take(&frames(60, &[22.0, 26.0], 50.0));
        assert_eq!(small.sealed, 1, "both hits are one event");
        let back = small.read_back();
        assert!(
            back.records.is_empty(),
            "{blocks} blocks: {:?}",
            back.records[0].triggers
        );
    }
}

#[test]
fn the_time_of_the_cut_is_told_also_where_the_bus_was_silent_before() {
    let mut small = Small::new(2000, 0);
    let all = frames(40, &[35.0], 50.0);
    let down = at(35.2);
    let before: Vec<Frame> = all
        .into_iter()
        .filter(|frame| frame.time_ns < down)
        .collect();
    small.take(&before);
    small.silence(35.3, 6);
    let back = small.read_back();
    let [record] = back.records.as_slice() else {
        unreachable!("one event")
    };
    assert_eq!(record.triggers[0].kind, TriggerKind::DeltaV);
    // Five seconds of silence were witnessed: the record ends there, not at the last frame.
    let end = record.time_s(record.end_index());
    assert!((4.0..6.0).contains(&end), "{end}");
    assert!(
        record
            .health
            .gaps
            .iter()
            .any(|gap| gap.signal == "accel" && gap.to_ns - gap.from_ns > 3 * S)
    );
    assert!(
        record
            .health
            .notes
            .iter()
            .any(|note| note.contains("read back from the spool"))
    );
}

#[test]
fn a_moving_car_that_loses_its_power_is_recorded_and_a_parked_one_is_not() {
    let mut moving = Small::new(2000, 0);
    moving.take(&frames(20, &[], 50.0));
    let back = moving.read_back();
    assert_eq!(back.records.len(), 1);
    let trigger = &back.records[0].triggers[0];
    assert_eq!(trigger.kind, TriggerKind::PowerLoss);
    assert!((trigger.value - 50.0 / 3.6).abs() < 0.1);
    back.records[0].to_bytes().unwrap();

    let mut standing = Small::new(2000, 0);
    standing.take(&frames(20, &[], 0.0));
    assert!(standing.read_back().records.is_empty());

    // Parked, the bus asleep for a minute, then the supply is cut.
    let mut asleep = Small::new(2000, 0);
    asleep.take(&frames(20, &[], 0.0));
    asleep.silence(20.0, 60);
    assert!(asleep.read_back().records.is_empty());

    let mut ended = Small::new(2000, 0);
    ended.take(&frames(20, &[], 50.0));
    ended.journal.entry(&Entry::End { at_ns: at(20.0) });
    ended.flushed_ns = 0;
    ended.turn(at(20.0));
    assert!(ended.read_back().records.is_empty(), "stopped on purpose");
}

#[test]
fn a_clock_that_was_set_before_the_spool_began_is_that_of_the_record() {
    let offset = 1_000_000 * S;
    let mut small = Small::new(2000, offset);
    let all = frames(40, &[35.0], 50.0);
    small.take(&all[..all.len() - 1]);
    let back = small.read_back();
    let record = &back.records[0];
    let utc = record.triggers[0].monotonic_ns + record.header.clock.offset_ns;
    assert!((utc - (at(35.0) + offset)).abs() < S);
}

#[test]
fn a_reload_in_the_moment_of_an_impact_takes_no_event_apart() {
    let settings = Arc::new(Settings::load(&etc().join("recorder.toml")).unwrap());
    let all = frames(90, &[35.0, 60.0], 50.0);
    for after_ms in [20, 40, 60, 80, 100] {
        let mut pipeline = Pipeline::new(Arc::clone(&settings), &[], None);
        let reload = at(35.0) + i64::from(after_ms) * 1_000_000;
        let mut done = false;
        let mut records = Vec::new();
        for frame in &all {
            if frame.time_ns >= reload && !done && !pipeline.running() {
                pipeline.reconfigure(Arc::clone(&settings), reload);
                done = true;
            }
            pipeline.frame(frame);
            records.extend(std::iter::from_fn(|| pipeline.take_ready()));
        }
        let times: Vec<i64> = records
            .iter()
            .map(|record| pipeline.trigger_line_ns(record) - at(0.0))
            .collect();
        assert_eq!(records.len(), 2, "{after_ms} ms: {times:?}");
        assert!(
            (times[0] - 35 * S).abs() < S && (times[1] - 60 * S).abs() < S,
            "{times:?}"
        );
    }
}

#[test]
fn frames_without_their_settings_are_told_to_be_there_and_a_page_that_is_gone_costs_itself() {
    let mut small = Small::new(2000, 0);
    small.take(&frames(40, &[35.0], 50.0));
    // One page of the circle reads as anything: some 60 ms are missing, and told.
    let page = 300 * 4096;
    let mut file = small.model.open(&spool_path()).unwrap();
    file.write_at(page, &[0xA5; 4096]).unwrap();
    let back = small.read_back();
    assert_eq!(back.records.len(), 1);
    assert!(
        back.notes
            .iter()
            .any(|note| note.contains("could not be read")),
        "{:?}",
        back.notes
    );
    assert!(
        back.records[0]
            .health
            .notes
            .iter()
            .any(|note| note.contains("could not be read"))
    );

    let folder = Path::new("/records");
    for path in small.model.list(folder).unwrap() {
        if path.extension().is_some_and(|end| end == "settings") {
            small.model.remove(&path).unwrap();
        }
    }
    let back = small.read_back();
    assert!(back.unreadable && back.records.is_empty());
    assert!(
        back.notes.iter().any(|note| note.contains("settings")),
        "{:?}",
        back.notes
    );
}
