//! Logs as they should not be: a clear error or a record that says what was wrong; never a panic, bounded memory.
#![allow(
    clippy::unwrap_used,
    clippy::as_conversions,
    clippy::cast_precision_loss,
    reason = "tests"
)]

mod support;

use std::fmt::Write as _;
use std::path::PathBuf;

use proptest::prelude::*;
use recorder::config::Settings;
use recorder::error::RecorderError;
use recorder::replay::{LogInput, ReplayOptions, replay};
use support::{Log, etc, run, settings, try_run};

#[test]
fn a_log_without_a_frame_is_an_error() {
    for text in ["", "\n\n", "hello\n", "(1.0) can0 xyz\n"] {
        let error = try_run(&settings(&[]), text, &[]).map(|_| ()).unwrap_err();
        assert!(matches!(error, RecorderError::NoFrames { .. }), "{error}");
    }
    let garbage: Vec<u8> = (0..200_000_u32)
        .map(|k| u8::try_from(k.wrapping_mul(2_654_435_761) >> 24).unwrap())
        .collect();
    assert!(try_run(&settings(&[]), garbage, &[]).is_err());
    let missing = vec![LogInput::File(PathBuf::from("/nowhere/at/all.log"))];
    let error = replay(&settings(&[]), missing, ReplayOptions::default()).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("/nowhere/at/all.log: open the log"),
        "{error}"
    );
    let folder = vec![LogInput::File(etc())];
    assert!(replay(&settings(&[]), folder, ReplayOptions::default()).is_err());
}

#[test]
fn malformed_lines_are_counted_and_the_first_reported() {
    let mut log = Log::default();
    log.steady(0.0, 8.0, 100.0, 50.0);
    let mut text = log.text();
    for _ in 0..10 {
        text.push_str("(17000000\n");
    }
    text.push_str(&"x".repeat(3_000_000));
    text.push('\n');
    writeln!(text, "(1700000008.0) can7 120#00\r").unwrap();
    let run = run(&settings(&[]), text, &[5.0]);
    assert_eq!(run.outcome.source.malformed, 11);
    assert_eq!(run.outcome.source.examples.len(), 5);
    assert!(
        run.outcome.source.examples[0].contains("expected ')'"),
        "{:?}",
        run.outcome.source.examples
    );
    assert_eq!(run.outcome.source.foreign, ["can7"]);
    assert_eq!(run.records[0].health.malformed, 11);
    assert!(
        run.records[0]
            .health
            .notes
            .iter()
            .any(|note| note.contains("expected ')'"))
    );
}

#[test]
fn frames_too_short_are_no_update() {
    let mut log = Log::default();
    log.steady(0.0, 6.0, 100.0, 50.0);
    for k in 0..50 {
        log.frame(3.0 + f64::from(k) * 0.01, "122", &[1, 2]);
        log.frame(3.0 + f64::from(k) * 0.01, "120", &[]);
    }
    let run = run(&settings(&[]), log.text(), &[5.0]);
    assert_eq!(run.outcome.totals.decode.too_short, 100);
    assert_eq!(run.records[0].health.malformed, 100);
    assert!(
        run.samples
            .iter()
            .all(|(_, sample)| sample.accel[0].is_some())
    );
}

#[test]
fn a_clock_set_back_leaves_one_missing_bin_and_is_noted() {
    let mut log = Log::default();
    log.steady(1000.0, 1003.0, 100.0, 50.0);
    let first = log.text();
    let mut log = Log::default();
    log.steady(700.004, 704.004, 100.0, 50.0);
    let run = run(&settings(&[]), first + &log.text(), &[5.0]);
    let record = &run.records[0];
    assert_eq!(run.outcome.totals.clock_steps, 1);
    assert_eq!(record.health.clock_steps.len(), 1);
    let step = record.health.clock_steps[0].step_ns;
    assert!((step + 303_000_000_000).abs() < 50_000_000, "{step}");
    let missing: Vec<u64> = run
        .samples
        .iter()
        .filter(|(_, sample)| sample.accel[0].is_none())
        .map(|(index, _)| *index)
        .collect();
    assert!((1..=2).contains(&missing.len()), "{missing:?}");
    assert!(
        run.samples
            .windows(2)
            .all(|pair| pair[1].0 == pair[0].0 + 1),
        "the line goes on"
    );
}

#[test]
fn a_stray_stamp_is_dropped_and_small_disorder_accepted() {
    let mut log = Log::default();
    log.steady(0.0, 4.0, 100.0, 50.0);
    let mut lines: Vec<String> = log.text().lines().map(str::to_owned).collect();
    lines.insert(
        300,
        "(1800000000.000000) can0 120#0000000000000000".to_owned(),
    );
    lines.insert(
        500,
        "(1600000000.000000) can0 120#0000000000000000".to_owned(),
    );
    for at in (10..900).step_by(7) {
        lines.swap(at, at + 3);
    }
    let run = run(&settings(&[]), lines.join("\n"), &[]);
    assert_eq!(
        (run.outcome.totals.late, run.outcome.totals.clock_steps),
        (2, 0)
    );
    assert!(
        run.samples
            .iter()
            .all(|(_, sample)| sample.accel[0].is_some())
    );
}

#[test]
fn hours_of_silence_cost_nothing() {
    let mut text = String::new();
    for part in 0..200 {
        let mut log = Log::default();
        log.steady(
            f64::from(part) * 50_000.0,
            f64::from(part) * 50_000.0 + 0.5,
            100.0,
            50.0,
        );
        text.push_str(&log.text());
    }
    let run = run(&settings(&[]), text, &[0.2]);
    assert!(run.samples.len() < 40_000, "{}", run.samples.len());
    assert_eq!(run.records.len(), 1, "the event is over within the silence");
    assert!(!run.records[0].completion.complete);
}

#[test]
fn values_that_are_not_finite_are_missing() {
    let dbc = std::fs::read_to_string(etc().join("example.dbc")).unwrap();
    let dbc = dbc.replace("Forward : 0|20@1- (0.002,0)", "Forward : 0|20@1- (1e400,0)");
    let folder = std::env::temp_dir().join(format!("recorder-nan-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("example.dbc"), dbc).unwrap();
    let text = std::fs::read_to_string(etc().join("recorder.toml")).unwrap();
    let settings = Settings::from_toml_str(&text, &folder).unwrap();
    let mut log = Log::default();
    log.steady(0.0, 4.0, 100.0, 50.0);
    let run = run(&settings, log.text(), &[3.0]);
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(run.outcome.totals.decode.not_finite > 300);
    assert!(
        run.samples
            .iter()
            .all(|(_, sample)| sample.accel[0].is_none() && sample.accel[1].is_some())
    );
    assert!(
        run.records[0]
            .health
            .notes
            .iter()
            .any(|note| note.contains("not finite"))
    );
}

#[test]
fn no_imu_at_all_still_gives_an_honest_record() {
    let mut log = Log::default();
    for k in 0..300 {
        log.wheels(f64::from(k) * 0.02, 40.0);
    }
    let run = run(&settings(&[]), log.text(), &[3.0]);
    let record = &run.records[0];
    assert!(!record.completion.complete);
    assert!(
        record
            .health
            .notes
            .iter()
            .any(|note| note.contains("no frame of accel")),
        "{:?}",
        record.health.notes
    );
    assert!(
        record.health.gaps.iter().any(|gap| gap.signal == "rate"),
        "{:?}",
        record.health.gaps
    );
}

#[test]
fn clipping_is_listed_on_body_axes() {
    let mut log = Log::default();
    for k in 0..3000_u64 {
        let left = if (2000..2007).contains(&k) {
            981.0
        } else {
            0.0
        };
        log.accel(k as f64 * 0.001, [0.0, left, 9.806], k);
    }
    let run = run(&settings(&[]), log.text(), &[2.5]);
    let clips = &run.records[0].clipping;
    let clipped: u16 = clips.iter().map(|clip| clip.clipped).sum();
    assert_eq!(clipped, 7, "{clips:?}");
    assert!(
        clips.iter().all(|clip| clip.axis == 1 && clip.sign == -1),
        "left is minus right: {clips:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    /// Any sequence of stamps, however wild, ends, and never gives an index twice.
    #[test]
    fn any_stamps_are_survived(stamps in prop::collection::vec((0_i64..2_000_000_000, 0_u32..4), 1..300)) {
        let mut text = String::new();
        let mut time = 0_i64;
        for (stamp, kind) in stamps {
            time = match kind {
                0 => stamp,
                1 => (time - stamp % 100).max(0),
                _ => time + stamp % 20,
            };
            writeln!(text, "({time}.5) can0 120#00000000000000F0").unwrap();
        }
        let run = run(&settings(&[]), text, &[1.0]);
        prop_assert!(run.samples.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}
