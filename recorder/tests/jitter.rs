//! Frames laid on their time line: jitter, losses, other periods; nothing is lost or invented.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    clippy::as_conversions,
    clippy::cast_precision_loss,
    reason = "tests"
)]

mod support;

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schema::Sample;
use support::{Log, Run, run, settings};

/// IMU frames with a half-sine pulse at 2 s; each frame the mean over its period, received `delay(k)` late.
fn pulse(hz: f64, seconds: f64, counters: bool, mut delay: impl FnMut(u64) -> Option<f64>) -> Log {
    let mut log = Log::default();
    let area = |t: f64| {
        // Integral of 300 sin(pi (t - 2) / 0.1) over the pulse from 2.0 to 2.1 s.
        let phase = ((t - 2.0) / 0.1).clamp(0.0, 1.0) * std::f64::consts::PI;
        300.0 * 0.1 / std::f64::consts::PI * (1.0 - phase.cos())
    };
    let count = schema::num::u64_of(schema::num::round_usize(seconds * hz));
    for k in 1..=count {
        let t = k as f64 / hz;
        let Some(late) = delay(k) else { continue };
        let mean = (area(t) - area(t - 1.0 / hz)) * hz;
        let counter = if counters { k } else { 0 };
        log.accel(t + late, [mean, 0.0, 9.806], counter);
        log.rate(t + late, [0.0; 3], counter);
    }
    log
}

fn without_counters() -> recorder::config::Settings {
    settings(&[
        ("accel_counter = \"IMU_ACCEL.AccelCounter\"\n", ""),
        ("rate_counter = \"IMU_RATE.RateCounter\"\n", ""),
    ])
}

fn delta_v(run: &Run) -> f64 {
    run.samples
        .iter()
        .filter_map(|(_, sample)| sample.accel[0])
        .sum::<f64>()
        * 0.01
}

fn missing(run: &Run) -> usize {
    run.samples
        .iter()
        .filter(|(_, sample): &&(u64, Sample)| sample.accel[0].is_none())
        .count()
}

#[test]
fn jitter_empties_no_bin_and_keeps_delta_v() {
    let truth = 300.0 * 0.2 / std::f64::consts::PI;
    for counters in [true, false] {
        let settings = if counters {
            settings(&[])
        } else {
            without_counters()
        };
        for hz in [50.0, 100.0, 104.0] {
            for seed in 0..6 {
                for (milliseconds, one_sided) in [
                    (1.0, false),
                    (2.0, false),
                    (3.0, false),
                    (1.0, true),
                    (3.0, true),
                ] {
                    let mut rng = ChaCha8Rng::seed_from_u64(seed);
                    let log = pulse(hz, 4.0, counters, |_| {
                        let low = if one_sided { 0.0 } else { -milliseconds };
                        Some(rng.random_range(low..=milliseconds) / 1000.0)
                    });
                    let run = run(&settings, log.text(), &[]);
                    let label = format!(
                        "{hz} Hz, {milliseconds} ms, one-sided {one_sided}, seed {seed}, {counters}"
                    );
                    assert_eq!(missing(&run), 0, "{label}");
                    let off = (delta_v(&run) / truth - 1.0).abs();
                    assert!(off < 0.01, "{label}: delta-V off by {off}");
                }
            }
        }
    }
}

#[test]
fn a_lost_frame_is_bridged_and_two_leave_a_hole() {
    for counters in [true, false] {
        let settings = if counters {
            settings(&[])
        } else {
            without_counters()
        };
        let one = run(
            &settings,
            pulse(100.0, 4.0, counters, |k| (k != 300).then_some(0.0)).text(),
            &[],
        );
        assert_eq!(missing(&one), 0, "a gap of two periods");
        let four = run(
            &settings,
            pulse(100.0, 4.0, counters, |k| {
                (!(300..304).contains(&k)).then_some(0.0)
            })
            .text(),
            &[],
        );
        assert_eq!(missing(&four), 4, "a gap of five periods");
        assert_eq!(
            four.outcome.totals.gaps, 2,
            "more than three periods, accel and rate"
        );
    }
}

#[test]
fn every_gap_from_a_tenth_to_five_seconds_is_missing_and_listed() {
    for gap in [0.1, 0.5, 1.0, 5.0] {
        let mut log = Log::default();
        log.steady(0.0, 3.0, 100.0, 50.0);
        log.steady(3.0 + gap, 6.0 + gap, 100.0, 50.0);
        let run = run(&settings(&[]), log.text(), &[5.9]);
        let absent = missing(&run) as f64;
        assert!(
            (absent - gap * 100.0).abs() <= 1.0,
            "{gap} s: {absent} missing"
        );
        let gaps = &run.records[0].health.gaps;
        assert_eq!(gaps.len(), 4, "{gap} s: {gaps:?}");
        assert!(!run.outcome.sound());
    }
}

#[test]
fn a_sensor_that_changes_its_pace_is_followed() {
    for (first, second) in [(100.0, 50.0), (50.0, 100.0), (100.0, 200.0)] {
        let mut log = Log::default();
        for k in 0..300 {
            log.accel(f64::from(k) / first, [1.0, 0.0, 9.806], 0);
        }
        for k in 0..300 {
            log.accel(300.0 / first + f64::from(k) / second, [1.0, 0.0, 9.806], 0);
        }
        let run = run(&without_counters(), log.text(), &[]);
        assert!(missing(&run) <= 1, "{first} to {second}: {}", missing(&run));
        assert!(
            run.samples
                .iter()
                .filter_map(|(_, sample)| sample.accel[0])
                .all(|x| (x - 1.0).abs() < 1e-9)
        );
        let period = run.outcome.groups[0].period;
        assert!(
            (period - 1e9 / second).abs() < 1e4,
            "{first} to {second}: {period}"
        );
    }
}

#[test]
fn a_counter_that_is_reset_or_stands_still_is_not_believed() {
    for reset in [true, false] {
        let mut log = Log::default();
        for k in 0..600_u64 {
            let counter = if reset && k >= 305 {
                k - 298
            } else if reset {
                k
            } else {
                7
            };
            log.accel(k as f64 * 0.01, [1.0, 0.0, 9.806], counter);
        }
        let run = run(&settings(&[]), log.text(), &[]);
        assert_eq!(missing(&run), 0, "reset {reset}");
        assert_eq!(run.outcome.totals.gaps, 0);
    }
}

#[test]
fn every_pace_works() {
    for hz in [1000.0, 400.0, 104.0, 100.0, 50.0, 26.0] {
        let mut log = Log::default();
        for k in 0..600_u64 {
            log.accel(k as f64 / hz, [2.0, 0.0, 9.806], k);
        }
        let run = run(&settings(&[]), log.text(), &[]);
        assert_eq!(missing(&run), 0, "{hz} Hz");
        let bins = run.samples.len() as f64;
        assert!(
            (bins - 600.0 / hz * 100.0).abs() <= 2.0,
            "{hz} Hz: {bins} bins"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Sum of samples times 10 ms is the sum of frames times their period, for any signal that begins and ends at zero.
    #[test]
    fn the_integral_is_kept(values in prop::collection::vec(-80_f64..80.0, 50..300), hz in 30_f64..1000.0) {
        let mut log = Log::default();
        let padding = vec![0.0; 60];
        let all: Vec<f64> = padding.iter().chain(&values).chain(&padding).map(|value| (value / 0.002_f64).round() * 0.002).collect();
        for (k, value) in all.iter().enumerate() {
            log.accel(1.0 + k as f64 / hz, [*value, 0.0, 9.806], k as u64);
        }
        let run = run(&settings(&[]), log.text(), &[]);
        let frames = all.iter().sum::<f64>() / hz;
        let scale = all.iter().map(|value| value.abs()).sum::<f64>() / hz;
        // The stamps are rounded to nanoseconds and the period is fitted to them.
        prop_assert!((delta_v(&run) - frames).abs() < 1e-4 * scale.max(1.0), "{} {frames}", delta_v(&run));
    }
}

/// A frame as long as a sample that is lost in a pulse is missing: its neighbours do not tell what it held. One of ten of
/// a sample is bridged, there too.
#[test]
fn a_frame_lost_in_a_pulse_leaves_a_hole() {
    for (hz, at, expected) in [(100.0, 300, 0), (100.0, 204, 1), (1000.0, 2045, 0)] {
        let log = pulse(hz, 4.0, true, |k| (k != at).then_some(0.0));
        let found = missing(&run(&settings(&[]), log.text(), &[]));
        // A frame that lies over two samples leaves both.
        assert!(
            (expected..=2 * expected).contains(&found),
            "{hz} {at}: {found}"
        );
    }
}
