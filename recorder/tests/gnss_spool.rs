//! Satellite fixes and the spool: after a cut at any point everything of them that was synchronised is read back, and
//! the record that is sealed then has the fixes and sentences that it would have had.
#![allow(clippy::unwrap_used, reason = "tests")]

mod receiver;
mod support;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use recorder::can::Frame;
use recorder::config::Settings;
use recorder::nmea::{Heard, Text};
use recorder::pipeline::Pipeline;
use recorder::recovery::recover;
use recorder::spool::{Entry, Journal, SpoolFile, bundles, scan};
use recorder::storage::Storage;
use recorder::storage::model::{Cut, Model};
use schema::gnss::Gnss;
use schema::parts::TriggerKind;
use schema::{Record, num};
use support::{EPOCH, Log, etc, frames};

const MS: i64 = 1_000_000;
const CRASH_S: f64 = 3.0;
const START: i64 = EPOCH * 1000 * MS;

fn spool_path() -> PathBuf {
    PathBuf::from("/records/spool.svs")
}

const DEVICE: &str = "[gnss]\ndevice = \"/dev/none\"\nbaud = 4800\n";
const SIGNALS: &str = "[gnss]\nlatitude = \"POS.Lat\"\nlongitude = \"POS2.Lon\"\nspeed = \"POS2.Speed\"\n\
    valid = \"POS2.Valid\"\nvalid_equals = 1\n";
const DBC: &str = "\nBO_ 768 POS: 4 SENSOR\n SG_ Lat : 0|32@1- (0.0000001,0) [0|0] \"deg\" BRAKES\n\
    \nBO_ 769 POS2: 7 SENSOR\n SG_ Lon : 0|32@1- (0.0000001,0) [0|0] \"deg\" BRAKES\n \
    SG_ Speed : 32|16@1+ (0.01,0) [0|0] \"m/s\" BRAKES\n SG_ Valid : 48|1@1+ (1,0) [0|1] \"\" BRAKES\n";

/// Removes the folder of a configuration.
fn done_with(config: &Path) {
    std::fs::remove_dir_all(config.parent().unwrap()).unwrap();
}

/// A folder with a configuration that has this table.
fn configuration(name: &str, table: &str) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("recorder-gnss-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let dbc = std::fs::read_to_string(etc().join("example.dbc")).unwrap() + DBC;
    std::fs::write(dir.join("example.dbc"), dbc).unwrap();
    let text = std::fs::read_to_string(etc().join("recorder.toml")).unwrap();
    let path = dir.join("recorder.toml");
    std::fs::write(&path, format!("{text}\n{table}")).unwrap();
    path
}

/// A car at 50 km/h that is stopped within 140 ms and stands; a fix each 100 ms over CAN, frames of no mapped message
/// among them.
fn crash() -> Vec<Frame> {
    let mut log = Log::default();
    for number in 0_u32..1900 {
        let t = f64::from(number) / 100.0;
        let forward = if (CRASH_S..CRASH_S + 0.14).contains(&t) {
            -100.0
        } else {
            0.0
        };
        log.accel(t, [forward, 0.0, 9.8], u64::from(number));
        log.rate(t + 0.0002, [0.0; 3], u64::from(number));
        if number % 2 == 0 {
            log.wheels(t + 0.0004, if t < CRASH_S { 50.0 } else { 0.0 });
        }
        log.frame(t + 0.0071, "555", &[1, 2, 3]);
        if number % 10 == 5 {
            let epoch = i32::try_from(number).unwrap();
            log.frame(t + 0.001, "300", &(480_000_000 + epoch).to_le_bytes());
            let mut data = (110_000_000 + epoch).to_le_bytes().to_vec();
            data.extend([0xE8, 0x03, u8::from(number % 70 != 5)]);
            // Some come too late for their latitude.
            let late = if number % 110 == 15 { 0.06 } else { 0.004 };
            log.frame(t + late, "301", &data);
        }
    }
    frames(&log.text())
}

/// What a receiver sends each second at 4800 bit/s, with when its first byte comes: the satellites in view between
/// position and speed take half a second.
fn sentences() -> Vec<(i64, Text)> {
    let mut all = Vec::new();
    for second in 0_i64..18 {
        let utc_ns = START + second * 1000 * MS;
        let [rmc, gga, vtg] =
            receiver::epoch(utc_ns, num::real_i64(second), u8::from(second % 7 != 4))
                .try_into()
                .unwrap();
        let mut burst = vec![gga];
        for view in 1..=4 {
            burst.push(receiver::sentence(&format!(
                "GPGSV,4,{view},16,01,40,083,46,02,17,308,41,12,07,344,39,14,22,228,45"
            )));
        }
        burst.extend([vtg, rmc]);
        let mut at_ns = utc_ns + 200 * MS;
        for text in burst {
            let taken = i64::try_from(text.len() + 2).unwrap() * 10_000_000_000 / 4800;
            all.push((at_ns, Text::new(text.as_bytes()).unwrap()));
            at_ns += taken;
        }
    }
    all
}

#[derive(Clone, Copy)]
struct Durable {
    changes: usize,
    upto_ns: i64,
    triggered: bool,
    /// Sentences handed to the spool.
    sentences: usize,
}

struct Recording {
    model: Model,
    started: usize,
    durable: Vec<Durable>,
    /// Changes of the file system when the event was over.
    over: usize,
    live: Record,
}

/// The daemon's loop on the log's own clock, which never tells the spool that the event was sealed.
fn record(config: &Path, frames: &[Frame], sentences: &[(i64, Text)], blocks: u64) -> Recording {
    let model = Model::new();
    let storage: Arc<dyn Storage> = Arc::new(model.clone());
    let (settings, bundle) = Settings::load_bundled(config).unwrap();
    let digest = bundles::store(storage.as_ref(), &spool_path(), &bundle).unwrap();
    let found = scan(storage.as_ref(), &spool_path()).unwrap();
    let mut file = SpoolFile::begin(&storage, &spool_path(), blocks, &found, 1).unwrap();
    let mut journal = Journal::new();
    let settings = Arc::new(settings);
    let mut pipeline = Pipeline::new(Arc::clone(&settings), &[], None);
    let started = model.changes();
    journal.entry(&Entry::Session {
        at_ns: frames[0].time_ns,
        bundle: digest,
        utc_offset_ns: 0,
    });
    let (mut flushed, mut triggered, mut heard, mut upto_ns) = (0, false, 0, 0);
    let (mut durable, mut live, mut over) = (Vec::new(), None, 0);
    for frame in frames {
        let now = frame.time_ns;
        if settings.plan.find(frame.interface, frame.id).is_some() {
            journal.frame(frame);
            upto_ns = now;
        }
        pipeline.frame(frame);
        // A sentence is known when its last byte has come, with the next turn.
        while let Some((at_ns, text)) = sentences.get(heard)
            && at_ns + i64::try_from(text.as_bytes().len()).unwrap() * 10_000_000_000 / 4800 <= now
        {
            heard += 1;
            let (at_ns, text) = (*at_ns, *text);
            journal.entry(&Entry::Sentence { at_ns, text });
            pipeline.heard(at_ns, &Heard::Sentence { at_ns, text });
        }
        pipeline.tick(now);
        pipeline.take_fired(|fired| {
            journal.entry(&Entry::Trigger {
                fired,
                utc_offset_ns: 0,
            });
            triggered = true;
        });
        if live.is_none() {
            live = pipeline.take_ready();
            over = model.changes();
        }
        let interval = if pipeline.alert() { 15 } else { 60 } * MS;
        if now - flushed >= interval {
            flushed = now;
            journal.entry(&Entry::Closed {
                at_ns: pipeline.undecided_ns(),
            });
            let mut bytes = journal.exchange(Vec::new());
            file.write(&mut bytes).unwrap();
            file.sync().unwrap();
            durable.push(Durable {
                changes: model.changes(),
                upto_ns,
                triggered,
                sentences: heard,
            });
        }
    }
    let live = live.unwrap();
    Recording {
        model,
        started,
        durable,
        over,
        live,
    }
}

fn part(record: &Record) -> &Gnss {
    record.gnss.as_ref().unwrap()
}

/// One line of a difference, where a whole part fills screens.
fn assert_same(ours: &Gnss, theirs: &Gnss) {
    assert_eq!(ours.sheet, theirs.sheet);
    for (at, (our, their)) in ours.fixes.iter().zip(&theirs.fixes).enumerate() {
        assert_eq!(our, their, "fix {at}");
    }
    assert_eq!(ours.fixes.len(), theirs.fixes.len());
    assert_eq!(ours.sentences, theirs.sentences);
}

/// The sentence of the notes that counts what came.
fn counted(record: &Record) -> Vec<&String> {
    let notes = &record.health.notes;
    notes
        .iter()
        .filter(|note| note.starts_with("satellite receiver: "))
        .collect()
}

#[test]
fn a_record_that_is_read_back_has_the_fixes_of_the_one_that_was_sealed() {
    let frames = crash();
    for (name, table, sentences) in [("line", DEVICE, sentences()), ("can", SIGNALS, Vec::new())] {
        let config = configuration(name, table);
        let recording = record(&config, &frames, &sentences, 3000);
        done_with(&config);
        let back = recover(&recording.model, &spool_path()).unwrap();
        let [record] = back.records.as_slice() else {
            unreachable!("one event: {}", back.records.len());
        };
        let live = &recording.live;
        assert_eq!(live.triggers[0].kind, TriggerKind::DeltaV);
        assert!(part(live).fixes.len() >= 12, "{}", part(live).fixes.len());
        assert_same(part(record), part(live));
        assert_eq!(counted(record), counted(live));
        if name == "line" {
            // Each second is one fix with speed and place, however long its sentences took.
            let fixes = &part(live).fixes;
            let whole = fixes.iter().filter(|fix| {
                fix.position.is_some() && fix.speed_mps.is_some() && fix.height_m.is_some()
            });
            let seconds: Vec<Option<i64>> = fixes.iter().map(|fix| fix.utc_ns).collect();
            let mut apart = seconds.clone();
            apart.dedup();
            assert_eq!(seconds, apart, "each second once");
            let without = fixes.iter().filter(|fix| fix.position.is_none()).count();
            assert_eq!(whole.count() + without, fixes.len());
        }
    }
}

#[test]
fn whatever_of_it_was_synchronised_is_read_back_after_any_cut() {
    let (frames, sentences) = (crash(), sentences());
    let config = configuration("cut", DEVICE);
    // Fewer blocks than flushes: the circle comes round while the event runs.
    let recording = record(&config, &frames, &sentences, 650);
    done_with(&config);
    let last = recording.over;
    let step = ((last - recording.started) / 15).max(1);
    let (mut cuts, mut events, mut checked) = (0, 0, 0);
    for count in (recording.started..=last).step_by(step) {
        let durable = &recording.durable;
        let Some(known) = durable.iter().rfind(|known| known.changes <= count) else {
            continue;
        };
        for cut in [
            Cut::Least,
            Cut::Process,
            Cut::Some(num::u64_of(count)),
            Cut::Some(!num::u64_of(count)),
        ] {
            cuts += 1;
            let back = recover(&recording.model.after_cut(count, cut), &spool_path()).unwrap();
            assert!(back.last_ns.unwrap() >= known.upto_ns);
            let Some(record) = back.records.first() else {
                assert!(!known.triggered);
                continue;
            };
            events += 1;
            record.to_bytes().unwrap();
            let offset = record.header.clock.offset_ns;
            let from_ns = record.blocks[0].monotonic_ns + offset;
            let kept = receiver::texts(&part(record).sentences);
            let interpreted = |text: &Text| !text.as_str().starts_with("$GPGSV");
            // The first second of the ring may have lost the sentence that began before it.
            for (at_ns, text) in sentences.iter().take(known.sentences) {
                if interpreted(text) && *at_ns >= from_ns && *at_ns < known.upto_ns - 100 * MS {
                    checked += 1;
                    assert!(kept.contains(&text.as_str()), "{count} {cut:?}: {text:?}");
                }
            }
            // No fix but those of the record that was sealed; the last may not have been whole.
            let reference = &part(&recording.live).fixes;
            let fixes = &part(record).fixes;
            for fix in fixes.iter().take(fixes.len().saturating_sub(1)).skip(1) {
                assert!(reference.contains(fix), "{count} {cut:?}: {fix:?}");
            }
        }
    }
    println!("{cuts} cuts, {events} events, {checked} sentences looked for");
    assert!(events > 50 && checked > 500);
}

/// What is told before the first frame has no place among samples: it must not stand for ever, nor hold up what is
/// told later.
#[test]
fn what_is_told_before_the_first_frame_is_forgotten_in_its_time() {
    let config = configuration("early", DEVICE);
    let settings = Arc::new(Settings::load(&config).unwrap());
    done_with(&config);
    for (seconds, there) in [(10, true), (60, false)] {
        let mut log = Log::default();
        log.steady(0.0, f64::from(seconds), 100.0, 0.0);
        let mut pipeline = Pipeline::new(Arc::clone(&settings), &[], None);
        pipeline.remark(START - 100 * MS, "a device is open");
        for (number, frame) in frames(&log.text()).iter().enumerate() {
            pipeline.frame(frame);
            if number == 100 {
                pipeline.remark(frame.time_ns, "it is gone");
            }
        }
        assert!(pipeline.trigger_at(START + (i64::from(seconds) - 1) * 1000 * MS));
        pipeline.tick(START + (i64::from(seconds) + 1) * 1000 * MS);
        pipeline.cut("the log ended");
        let notes = pipeline.take_ready().unwrap().health.notes.join("\n");
        for told in ["a device is open", "it is gone"] {
            assert_eq!(notes.contains(told), there, "{seconds} s: {notes}");
        }
        // A time before the trigger, and no other.
        assert_eq!(
            notes.matches("at -").count(),
            2 * usize::from(there),
            "{notes}"
        );
    }
}
