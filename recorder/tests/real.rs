//! Recordings that others made: real drives, a real car's bus, the pulse of a barrier test.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::as_conversions,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "tests"
)]

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recorder::config::Settings;
use schema::Record;
use schema::parts::TriggerKind;
use support::{Log, Run, run};

/// The folder of the recordings and the settings of one; `None` (and a printed line) where it is absent.
fn open(name: &str) -> Option<(PathBuf, Settings)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let log = root.join(format!("shared/data/{name}.log"));
    if !log.exists() {
        eprintln!("skipped: the recordings are not here ({name}.log)");
        return None;
    }
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../tests/config/{name}.toml"));
    Some((log, Settings::load(&config).unwrap()))
}

fn replayed(name: &str, trigger_at: &[f64]) -> Option<Run> {
    let (log, settings) = open(name)?;
    Some(run(&settings, fs::read(log).unwrap(), trigger_at))
}

fn seconds_before_trigger(record: &Record) -> f64 {
    (record.triggers[0].index - record.first_index()) as f64 / 100.0
}

#[test]
fn both_stops_of_wid08_end_in_the_rest() {
    let Some(run) = replayed("wid08", &[60.0, 122.0]) else {
        return;
    };
    assert_eq!(run.records.len(), 2);
    let [first, second] = &run.records[..] else {
        unreachable!()
    };
    assert!(
        first.completion.complete && first.completion.ends_at_rest,
        "{:?}",
        first.completion
    );
    assert!(second.completion.ends_at_rest, "{:?}", second.completion);
    assert!(
        second.completion.reasons[0].contains("the log ended"),
        "{:?}",
        second.completion
    );
    assert!((seconds_before_trigger(first) - 35.0).abs() < 1e-9);
    assert!(first.health.gaps.is_empty() && second.health.gaps.is_empty());
}

#[test]
fn wid02_ends_in_the_rest_with_either_sensor() {
    for name in ["wid02", "wid02-consumer"] {
        let Some(run) = replayed(name, &[130.0]) else {
            return;
        };
        let record = &run.records[0];
        assert!(
            record.completion.complete && record.completion.ends_at_rest,
            "{name}: {:?}",
            record.completion
        );
    }
}

#[test]
fn rav4s_wheels_agree_with_the_reference_and_the_record_ends_moving() {
    let Some(run) = replayed("rav4", &[45.0]) else {
        return;
    };
    let record = &run.records[0];
    assert!(!record.completion.complete && !record.completion.ends_at_rest);
    assert!(
        record
            .completion
            .reasons
            .iter()
            .any(|reason| reason.contains("moving")),
        "{:?}",
        record.completion
    );
    let truth = fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/rav4.truth.csv"),
    )
    .unwrap();
    let truth: Vec<(f64, f64)> = truth
        .lines()
        .skip(1)
        .map(|line| {
            line.split(',')
                .map(|cell| cell.parse().unwrap_or(f64::NAN))
                .collect::<Vec<f64>>()
        })
        .map(|row| (row[0], row[6]))
        .collect();
    let (mut ratio, mut count) = (0.0, 0.0);
    for sample in record.samples() {
        let [Some(left), Some(right)] = sample.sample.wheels else {
            continue;
        };
        let t = record.monotonic_ns(sample.index) as f64 * 1e-9
            + record.header.clock.offset_ns as f64 * 1e-9
            - 1_533_224_087.0;
        let Some(pair) = truth
            .windows(2)
            .find(|pair| pair[0].0 <= t && t < pair[1].0)
        else {
            continue;
        };
        let part = (t - pair[0].0) / (pair[1].0 - pair[0].0);
        ratio += f64::midpoint(left, right) / (pair[0].1 + part * (pair[1].1 - pair[0].1));
        count += 1.0;
    }
    assert!(count > 1000.0);
    eprintln!(
        "rav4: wheels / reference = {:.4} over {count} samples",
        ratio / count
    );
    assert!((ratio / count - 1.0).abs() < 0.015, "{}", ratio / count);
    // 104 Hz by its counter.
    assert!(
        (record.header.periods.accel_ns as f64 - 9.59e6).abs() < 0.05e6,
        "{}",
        record.header.periods.accel_ns
    );
}

fn pulse_delta_v(run: &Run) -> f64 {
    let start = support::EPOCH as f64 + 59.95;
    let first_s = run.records[0].header.clock.offset_ns as f64 * 1e-9;
    let in_pulse = |index: u64| {
        let t = first_s + index as f64 * 0.01;
        (start..start + 0.30).contains(&t)
    };
    run.samples
        .iter()
        .filter(|(index, _)| in_pulse(*index))
        .filter_map(|(_, sample)| sample.accel[0])
        .sum::<f64>()
        * 0.01
}

#[test]
fn the_barrier_pulse_fires_within_30_ms_and_claims_no_class() {
    let Some(run) = replayed("nhtsa10146", &[]) else {
        return;
    };
    assert_eq!(run.records.len(), 1);
    let record = &run.records[0];
    assert!(
        record.completion.complete && record.completion.ends_at_rest,
        "{:?}",
        record.completion
    );
    assert_eq!(record.header.channel_frequency_class, None);
    assert!(
        record
            .health
            .notes
            .iter()
            .any(|note| note.contains("SAE J211"))
    );
    let trigger = &record.triggers[0];
    assert_eq!(
        (trigger.kind, trigger.source.as_str()),
        (TriggerKind::DeltaV, "x")
    );
    let after_contact =
        (trigger.monotonic_ns + record.header.clock.offset_ns) as f64 * 1e-9 - 1_700_000_060.0;
    eprintln!(
        "nhtsa10146: delta-V fires {:.1} ms after contact",
        after_contact * 1e3
    );
    assert!((0.0..0.030).contains(&after_contact), "{after_contact}");
    assert_eq!(
        record.triggers.len(),
        1,
        "one pulse, one delta-V trigger: {:?}",
        record.triggers
    );
    let change = pulse_delta_v(&run);
    assert!(
        (change.abs() / (66.6 / 3.6) - 1.0).abs() < 0.02,
        "{} km/h",
        change * 3.6
    );
}

/// The log's accelerations as (time, x): 1 kHz.
fn pulse_frames(log: &Path) -> Vec<(f64, [f64; 3])> {
    let text = fs::read_to_string(log).unwrap();
    text.lines()
        .filter(|line| line.contains(" 120#"))
        .map(|line| {
            let t: f64 = line[1..18].parse::<f64>().unwrap() - support::EPOCH as f64;
            let hex = &line[line.find('#').unwrap() + 1..];
            let mut bytes = [0; 8];
            for (at, byte) in bytes.iter_mut().enumerate() {
                *byte = u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap();
            }
            let bits = i64::from_le_bytes(bytes);
            let axis = |at: u32| ((bits << (44 - 20 * at)) >> 44) as f64 * 0.002;
            (t, [axis(0), axis(1), axis(2)])
        })
        .filter(|(t, _)| (40.0..66.0).contains(t))
        .collect()
}

/// The log's IMU thinned to 100 Hz frames that come `delay` late.
fn thinned(frames: &[(f64, [f64; 3])], mean: bool, mut delay: impl FnMut() -> f64) -> String {
    let mut log = Log::default();
    for (k, ten) in frames.chunks_exact(10).enumerate() {
        let (t, last) = ten[9];
        let value = |axis: usize| {
            if mean {
                ten.iter().map(|(_, a)| a[axis]).sum::<f64>() / 10.0
            } else {
                last[axis]
            }
        };
        let late = delay();
        log.accel(t + late, [value(0), value(1), value(2)], k as u64);
        log.rate(t + late, [0.0; 3], k as u64);
    }
    log.text()
}

#[test]
fn the_pulse_at_100_hz_survives_jitter_as_means_but_not_as_points() {
    let Some((path, settings)) = open("nhtsa10146") else {
        return;
    };
    let frames = pulse_frames(&path);
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("etc/recorder.toml"))
        .unwrap();
    let text = text.replace("front-left-up", "front-right-down");
    for counters in [true, false] {
        let text = if counters {
            text.clone()
        } else {
            text.replace("accel_counter = \"IMU_ACCEL.AccelCounter\"\n", "")
                .replace("rate_counter = \"IMU_RATE.RateCounter\"\n", "")
        };
        let settings_100 = Settings::from_toml_str(&text, &support::etc()).unwrap();
        let exact = pulse_delta_v(&run(&settings, fs::read(&path).unwrap(), &[]));
        let mut worst = [[0.0_f64; 2]; 3];
        for (level, milliseconds) in [0.001, 0.002, 0.003].into_iter().enumerate() {
            for (kind, low) in [(0, -milliseconds), (1, 0.0)] {
                for seed in 0..20 {
                    let mut rng = ChaCha8Rng::seed_from_u64(seed);
                    let log = thinned(&frames, true, || rng.random_range(low..=milliseconds));
                    let off =
                        (pulse_delta_v(&run(&settings_100, log, &[60.5])) / exact - 1.0).abs();
                    worst[level][kind] = worst[level][kind].max(off);
                    assert!(
                        off < 0.01,
                        "{milliseconds} s, from {low}, seed {seed}: {off}"
                    );
                }
            }
        }
        eprintln!(
            "worst of 20 seeds, jitter of 1, 2, 3 ms, symmetric and one-sided (counters {counters}): {worst:.4?}"
        );
    }
    let settings_100 = Settings::from_toml_str(&text, &support::etc()).unwrap();
    let exact = pulse_delta_v(&run(&settings, fs::read(&path).unwrap(), &[]));
    let mut points: Vec<f64> = Vec::new();
    for phase in 0..10 {
        let run = run(
            &settings_100,
            thinned(&frames[phase..], false, || 0.0),
            &[60.5],
        );
        points.push(pulse_delta_v(&run) / exact - 1.0);
        let notes = &run.records[0].health.notes;
        assert!(
            notes
                .iter()
                .any(|note| note.contains("point samples can miss up to half")),
            "{notes:?}"
        );
    }
    eprintln!("point samples, ten phases, relative error of delta-V: {points:.3?}");
}
