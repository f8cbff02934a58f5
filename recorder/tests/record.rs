//! What a record holds: layouts, events that overlap, raw frames, several logs.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::cell::RefCell;
use std::io::Cursor;

use recorder::replay::{LogInput, ReplayOptions, replay};
use schema::Record;
use support::{Log, run, settings};

fn drive(seconds: f64) -> Log {
    let mut log = Log::default();
    log.steady(0.0, seconds, 100.0, 0.0);
    log
}

#[test]
fn two_rate_thins_what_is_far_from_the_trigger_and_the_end() {
    let run = run(
        &settings(&[("layout = \"full\"", "layout = \"two-rate\"")]),
        drive(60.0).text(),
        &[40.0],
    );
    let record = &run.records[0];
    let thin = record
        .blocks
        .iter()
        .filter(|block| block.rate_hz == 20)
        .count();
    assert!(
        (23..=25).contains(&thin),
        "{thin} of {}",
        record.blocks.len()
    );
    let back = Record::read(&record.to_bytes().unwrap()).unwrap().0;
    assert_eq!(&back, record);
}

#[test]
fn a_trigger_6_s_after_the_last_gives_a_record_of_its_own() {
    let run = run(&settings(&[]), drive(80.0).text(), &[40.0, 44.0, 50.0]);
    let [first, second] = &run.records[..] else {
        unreachable!("{}", run.records.len())
    };
    assert_eq!((first.triggers.len(), second.triggers.len()), (2, 1));
    assert!(
        first.completion.complete && second.completion.complete,
        "{:?}",
        second.completion
    );
    assert_eq!(first.end_index() - first.triggers[0].index, 1401);
    assert_eq!(second.triggers[0].index - second.first_index(), 3000);
    assert_eq!(second.header.number, 2);
    assert!(
        first
            .health
            .notes
            .iter()
            .any(|note| note.contains("began the next record"))
    );
}

#[test]
fn raw_frames_lie_a_second_about_the_trigger() {
    let run = run(&settings(&[]), drive(60.0).text(), &[40.0]);
    let record = &run.records[0];
    let trigger = record.triggers[0].monotonic_ns;
    assert!(
        record
            .raw
            .iter()
            .all(|frame| (frame.monotonic_ns - trigger).abs() <= 1_000_000_000)
    );
    // 100 Hz of acceleration and rate, 50 Hz of wheels, two seconds.
    assert!(
        (498..=502).contains(&record.raw.len()),
        "{}",
        record.raw.len()
    );
    assert!(
        record
            .raw
            .windows(2)
            .all(|pair| pair[0].monotonic_ns <= pair[1].monotonic_ns)
    );
}

#[test]
fn an_early_trigger_says_that_the_ring_was_not_full() {
    let run = run(&settings(&[]), drive(40.0).text(), &[12.0]);
    let reasons = &run.records[0].completion.reasons;
    assert!(
        reasons[0].starts_with("the ring was not full: 12.0"),
        "{reasons:?}"
    );
}

#[test]
fn several_logs_are_merged_by_time() {
    let whole = drive(60.0).text();
    let (imu, wheels): (Vec<&str>, Vec<&str>) =
        whole.lines().partition(|line| !line.contains(" 122#"));
    let settings = settings(&[]);
    let records = RefCell::new(Vec::new());
    let log = |name: &str, lines: &[&str]| {
        LogInput::Reader(
            name.to_owned(),
            Box::new(Cursor::new(lines.join("\n").into_bytes())),
        )
    };
    let options = ReplayOptions {
        trigger_at: vec![40.0],
        sink: Some(Box::new(|record| {
            records.borrow_mut().push(record);
            Ok(())
        })),
        ..ReplayOptions::default()
    };
    replay(
        &settings,
        vec![log("wheels", &wheels), log("imu", &imu)],
        options,
    )
    .unwrap();
    let merged = records.into_inner();
    let single = run(&settings, whole, &[40.0]).records;
    assert_eq!(
        (&merged[0].blocks, &merged[0].raw),
        (&single[0].blocks, &single[0].raw)
    );
}
