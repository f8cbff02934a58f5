//! The pulse of a real barrier test: trigger, delta-V, and what slower or jittering frames do to it.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reconstruct::findings::Reconstruction;
use recorder::config::Settings;
use schema::num;
use schema::parts::TriggerKind;
use support::log::{self, Line};
use support::pipeline::{self, Replayed};
use support::recordings;

const NAME: &str = "nhtsa10146";
/// Contact, s of the log.
const CONTACT: f64 = 60.0;
const ZERO_NS: i64 = 1_700_000_000_000_000_000;
/// Step of the log's IMU signals.
const STEP: f64 = 0.002;
const NO_COUNTER: &[(&str, &str)] = &[
    ("accel_counter", "# accel_counter"),
    ("rate_counter", "# rate_counter"),
];

/// The true change of speed to separation: from just before contact to the fastest rebound.
fn true_change() -> Option<f64> {
    let rows = recordings::table("nhtsa10146.truth.csv", &["t_s", "speed_mps"])?;
    let before = recordings::at(&rows, CONTACT - 0.005, 1).unwrap();
    let after = rows
        .iter()
        .filter(|row| (CONTACT..CONTACT + 0.3).contains(&row[0]))
        .map(|row| row[1])
        .fold(f64::INFINITY, f64::min);
    Some(after - before)
}

fn seconds(line: &Line) -> f64 {
    num::real_i64(line.time_ns - ZERO_NS) * 1e-9
}

/// The log thinned to 100 Hz IMU frames: means of ten, or every tenth from `phase` on; `late` is each frame's delay.
fn thinned(lines: &[Line], mean: bool, phase: usize, mut late: impl FnMut() -> f64) -> String {
    let mut out = Vec::new();
    for id in ["120", "121"] {
        let frames: Vec<&Line> = lines.iter().filter(|line| line.id == id).collect();
        for (k, ten) in frames[phase..].chunks_exact(10).enumerate() {
            let last = ten[9];
            let values: Vec<[f64; 3]> = ten.iter().map(|l| log::unpack(&l.data, STEP).0).collect();
            let value = if mean {
                [0, 1, 2].map(|axis| values.iter().map(|v| v[axis]).sum::<f64>() / 10.0)
            } else {
                values[9]
            };
            out.push(Line {
                time_ns: last.time_ns + num::round_i64(late() * 1e9),
                data: log::pack(value, STEP, num::u64_of(k)),
                ..last.clone()
            });
        }
    }
    out.extend(lines.iter().filter(|line| line.id == "122").cloned());
    log::write(&log::sorted(out))
}

/// The lines from 45 s on: enough for the ring and quicker.
fn lines() -> Option<Vec<Line>> {
    let mut lines = log::read(&recordings::log(NAME)?);
    lines.retain(|line| (45.0..72.0).contains(&seconds(line)));
    Some(lines)
}

fn reconstructed(settings: &Settings, text: String) -> (Replayed, Reconstruction) {
    let replayed = pipeline::record(settings, text, &[]);
    assert_eq!(replayed.records.len(), 1);
    let result = pipeline::run(&replayed.records[0]);
    assert_eq!(result.impacts.len(), 1, "one contact is one impact");
    (replayed, result)
}

fn delta_v(result: &Reconstruction) -> f64 {
    result.impacts[0].delta_v.longitudinal_mps.value
}

#[test]
fn trigger_impact_and_delta_v() {
    let (Some(text), Some(truth)) = (recordings::log(NAME), true_change()) else {
        return;
    };
    let replayed = pipeline::record(&recordings::settings(NAME, &[]), text, &[]);
    let record = &replayed.records[0];
    let trigger = &record.triggers[0];
    assert_eq!(trigger.kind, TriggerKind::DeltaV);
    let utc = trigger.monotonic_ns + record.header.clock.offset_ns - ZERO_NS;
    let fired = num::real_i64(utc) * 1e-9 - CONTACT;
    assert!((0.0..=0.030).contains(&fired), "{fired} s after contact");
    assert_eq!(record.header.channel_frequency_class, None);
    assert!(
        record
            .health
            .notes
            .iter()
            .any(|n| n.contains("no channel frequency class"))
    );
    assert!(record.completion.complete && record.completion.ends_at_rest);

    let result = pipeline::run(record);
    let impact = &result.impacts[0];
    let onset = fired + impact.t_s.value;
    let found = impact.delta_v.longitudinal_mps;
    eprintln!(
        "nhtsa10146: fires {:.1} ms after contact, onset {:+.1} ms; impact speed {:.2} m/s (truth 15.86), \
         delta-V {:.3} m/s (truth {truth:.3}, {:+.2} %), from {:.1} to {:.1} ms, lateral {:.3}",
        fired * 1e3,
        onset * 1e3,
        impact.speed_mps.value,
        found.value,
        100.0 * (found.value / truth - 1.0),
        onset * 1e3,
        (fired + impact.delta_v.end_t_s) * 1e3,
        impact.delta_v.lateral_mps.value,
    );
    assert!(onset.abs() < 0.010, "{onset}");
    assert!((impact.speed_mps.value - 15.86).abs() < 0.16);
    assert!(found.value < 0.0, "a frontal impact slows the car");
    assert!(
        (found.value / truth - 1.0).abs() < 0.02,
        "{} of {truth}",
        found.value
    );
    assert!(impact.delta_v.lateral_mps.value.abs() < 0.3);
    assert!(impact.delta_v.pdof_deg.value.abs() < 2.0);
    assert!(!impact.delta_v.lower_bound);
    assert!(
        result
            .limits
            .iter()
            .any(|l| l.contains("no channel frequency class (SAE J211)")),
        "{:?}",
        result.limits
    );
}

#[test]
fn means_at_100_hz_with_jitter_keep_delta_v() {
    let Some(lines) = lines() else { return };
    let exact = delta_v(&reconstructed(&recordings::settings(NAME, &[]), log::write(&lines)).1);
    for (changes, counters) in [(&[][..], "with counters"), (NO_COUNTER, "without")] {
        let settings = recordings::settings(NAME, changes);
        for jitter in [0.001, 0.002, 0.003] {
            for low in [0.0, -jitter] {
                let mut worst: f64 = 0.0;
                for seed in 0..4 {
                    let mut rng = ChaCha8Rng::seed_from_u64(seed + 100);
                    let text = thinned(&lines, true, 0, || rng.random_range(low..=jitter));
                    let off = delta_v(&reconstructed(&settings, text).1) / exact - 1.0;
                    worst = worst.max(off.abs());
                }
                eprintln!(
                    "means, jitter {:+.0} to {:.0} ms, {counters}: delta-V off by at most {:.2} %",
                    low * 1e3,
                    jitter * 1e3,
                    worst * 100.0
                );
                assert!(worst < 0.01, "{jitter} {low} {counters}: {worst}");
            }
        }
    }
}

#[test]
fn points_at_100_hz_miss_delta_v_and_the_report_says_why() {
    let Some(lines) = lines() else { return };
    let exact = delta_v(&reconstructed(&recordings::settings(NAME, &[]), log::write(&lines)).1);
    let settings = recordings::settings(NAME, &[]);
    let mut errors = Vec::new();
    for phase in 0..10 {
        let (replayed, result) = reconstructed(&settings, thinned(&lines, false, phase, || 0.0));
        errors.push(100.0 * (delta_v(&result) / exact - 1.0));
        let says = |text: &str| {
            result.limits.iter().any(|line| line.contains(text))
                && replayed.records[0]
                    .health
                    .notes
                    .iter()
                    .any(|line| line.contains("point samples"))
        };
        assert!(
            says("if they are point samples and not means"),
            "{:?}",
            result.limits
        );
        assert!(says("may be off by as much as half"), "{:?}", result.limits);
    }
    eprintln!("point samples, ten phases: delta-V off by {errors:.1?} %");
    let worst = errors
        .iter()
        .fold(0.0_f64, |worst, off| worst.max(off.abs()));
    assert!(worst > 1.0 && worst < 60.0, "{worst} %");
}
