//! Bad input from the log to the reconstruction: an answer with wide bounds or an error that says where, never a
//! panic and never a silent loss.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reconstruct::run::Options;
use reconstruct::simulate::Class;
use schema::{Record, num};
use support::crash::{self, Crash};
use support::log::{self, Line};
use support::{pipeline, recordings};

const IMU: &[&str] = &["120", "121"];
const WHEELS: &[&str] = &["122"];

/// Record and result of a changed log; the trigger is given by hand, so that it does not hang on what was changed.
fn play(crash: &Crash, text: String) -> (Record, reconstruct::findings::Reconstruction) {
    let mut replayed = pipeline::record(&crash.settings, text, &[crash.trigger_at()]);
    let record = replayed.records.remove(0);
    let result = pipeline::run(&record);
    (record, result)
}

#[test]
fn gaps_widen_the_bounds_and_the_truth_stays_inside() {
    let mut inside = Vec::new();
    for (what, ids) in [
        ("IMU", IMU),
        ("wheels", WHEELS),
        ("all", &["120", "121", "122"][..]),
    ] {
        for seconds in [0.1, 0.5, 1.0, 2.0, 5.0] {
            let (mut ratios, mut worst) = (Vec::new(), 0.0_f64);
            for seed in 0..4 {
                let crash = crash::draw(Class::CRASHES[seed % 4], 9000 + num::u64_of(seed));
                let (_, whole) = play(&crash, crash.text());
                let from = crash.trigger_at() - 12.0;
                let (record, result) = play(&crash, crash.without(ids, from, from + seconds));
                let listed = record.health.gaps.iter().any(|gap| {
                    let length = num::real_i64(gap.to_ns - gap.from_ns) * 1e-9;
                    (length - seconds).abs() < 0.1
                });
                assert!(listed, "{what} {seconds}: {:?}", record.health.gaps);
                let told = result.limits.iter().any(|limit| {
                    if what == "wheels" {
                        limit.contains("The wheel speeds have a gap")
                    } else {
                        limit.contains("without a whole IMU value")
                    }
                });
                assert!(told, "{what} {seconds}: {:?}", result.limits);
                assert!(result.gaps, "{what} {seconds}: exit code 3");
                let (a, b) = (crash.moment(&whole, -25.0), crash.moment(&result, -25.0));
                ratios.push(b.radius / a.radius);
                worst = worst.max(b.off);
                for back in [-28.0, -20.0, -13.0, -10.0, -1.0] {
                    inside.push(crash.moment(&result, back).inside());
                }
            }
            let ratio = recordings::median(&ratios);
            eprintln!(
                "gap of {seconds} s in {what}: the ellipse 25 s before the impact is {ratio:.2} times as long; \
                 at most {worst:.1} m off"
            );
            assert!(ratio > 0.99, "{what} {seconds}: {ratio}");
            assert!(what != "all" || seconds < 2.0 || ratio > 1.02, "{ratio}");
        }
    }
    let share = recordings::share(&inside);
    eprintln!(
        "{} instants, {share:.3} inside the 95 % ellipse",
        inside.len()
    );
    assert!(share >= 0.9, "{share}");
}

#[test]
fn truncated_and_flipped_records_give_an_answer_or_an_error() {
    let crash = crash::draw(Class::Frontal, 9100);
    let replayed = pipeline::record(&crash.settings, crash.text(), &[]);
    let bytes = &replayed.bytes[0];
    let look = |damaged: &[u8], what: &str| {
        assert!(Record::read(damaged).is_err(), "{what} went unseen");
        let Ok(salvaged) = Record::salvage(damaged) else {
            return false;
        };
        assert!(
            !salvaged.damage.is_empty()
                || !matches!(salvaged.seal, schema::seal::SealState::Sound(_)),
            "{what}: salvaged without a word"
        );
        let Ok(result) = pipeline::try_run(&salvaged.record, &Options::default()) else {
            return false;
        };
        assert!(!result.states.is_empty());
        true
    };
    let step = bytes.len() / 60;
    let lengths = (0..bytes.len())
        .step_by(step)
        .chain(bytes.len() - 40..bytes.len());
    let mut list: Vec<(Vec<u8>, String)> = lengths
        .map(|length| (bytes[..length].to_vec(), format!("cut to {length}")))
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..120 {
        let mut damaged = bytes.clone();
        let (at, bit) = (rng.random_range(0..bytes.len()), rng.random_range(0..8));
        damaged[at] ^= 1 << bit;
        list.push((damaged, format!("bit {bit} of byte {at}")));
    }
    // Every other one in a thread of its own: the longest test of this file would else end alone.
    let half = |odd: usize| {
        let own = list.iter().skip(odd).step_by(2);
        own.filter(|(damaged, what)| look(damaged, what)).count()
    };
    let answered = std::thread::scope(|threads| {
        let other = threads.spawn(|| half(1));
        half(0) + other.join().unwrap()
    });
    eprintln!("of 220 damaged records {answered} still gave an answer");
    assert!(answered > 100, "{answered}");
}

#[test]
fn time_that_goes_back_is_noted_and_survived() {
    let crash = crash::draw(Class::Oblique, 9200);
    let (_, whole) = play(&crash, crash.text());
    let at = crash.simulated.truth.facts.start_unix_s * 1_000_000_000
        + num::round_i64((crash.trigger_at() - 15.0) * 1e9);
    let back = |ns: i64, every_ns: i64| -> String {
        let changed: Vec<Line> = crash
            .lines
            .iter()
            .map(|line| {
                let steps = if line.time_ns < at {
                    0
                } else {
                    1 + (line.time_ns - at) / every_ns
                };
                Line {
                    time_ns: line.time_ns - steps.min(20) * ns,
                    ..line.clone()
                }
            })
            .collect();
        log::write(&changed)
    };
    let long = i64::MAX;
    for (what, text) in [
        ("20 ms", back(20_000_000, long)),
        ("1 s", back(1_000_000_000, long)),
        ("an hour", back(3_600_000_000_000, long)),
        ("twenty times 300 ms", back(300_000_000, 700_000_000)),
        ("to before 1970", back(1_700_000_000_000_000_000, long)),
    ] {
        // The stamps after a step do not count from the first frame any more: the crash itself triggers.
        let replayed = pipeline::record(&crash.settings, text, &[]);
        let record = &replayed.records[0];
        if what != "20 ms" {
            assert!(
                replayed.outcome.totals.clock_steps > 0 || replayed.outcome.totals.late > 0,
                "{what}: {:?}",
                replayed.outcome.totals
            );
            assert!(
                !record.health.clock_steps.is_empty(),
                "{what}: {:?}",
                record.health
            );
        }
        let result = pipeline::run(record);
        let (a, b) = (whole.impacts[0].speed_mps, result.impacts[0].speed_mps);
        eprintln!(
            "time goes back by {what}: impact speed {:.2} m/s, without {:.2}",
            b.value, a.value
        );
        assert!(
            (a.value - b.value).abs() < 0.3 + 2.0 * a.sd.hypot(b.sd),
            "{what}"
        );
    }
}

#[test]
fn frames_of_wrong_length() {
    let crash = crash::draw(Class::Frontal, 9300);
    let (_, whole) = play(&crash, crash.text());
    for (what, length, every) in [("short", 5, 50), ("short, all", 5, 1), ("empty", 0, 50)] {
        let mut lines = crash.lines.clone();
        for (k, line) in lines.iter_mut().enumerate() {
            if k % every == 0 && line.id == "120" {
                line.data.truncate(length);
            }
        }
        let replayed = pipeline::record(&crash.settings, log::write(&lines), &[crash.trigger_at()]);
        let record = &replayed.records[0];
        assert!(record.health.malformed > 0, "{what}: {:?}", record.health);
        let result = pipeline::try_run(record, &Options::default());
        if every == 1 {
            let message = result.err().map(|error| error.to_string());
            eprintln!("{what}: {message:?}");
            continue;
        }
        let result = result.unwrap();
        let off = result.impacts[0].speed_mps.value - whole.impacts[0].speed_mps.value;
        assert!(off.abs() < 0.5, "{what}: {off}");
    }
    // A frame that is longer than the DBC says carries the same signals: wheels padded to 8 bytes.
    let mut lines = crash.lines.clone();
    for line in lines.iter_mut().filter(|line| line.id == "122") {
        line.data.resize(8, 0xFF);
    }
    let (record, result) = play(&crash, log::write(&lines));
    assert!(record.health.gaps.is_empty());
    assert_eq!(result.wheels, whole.wheels);
}

#[test]
fn without_rest_wheels_or_motion() {
    let crash = crash::draw(Class::Drive, 9400);
    // The log ends in the drive.
    let zero = crash.simulated.truth.facts.start_unix_s * 1_000_000_000;
    let end = crash.simulated.truth.facts.rest_t_s - 6.0;
    let cut: Vec<Line> = crash
        .lines
        .iter()
        .filter(|line| num::real_i64(line.time_ns - zero) * 1e-9 < end)
        .cloned()
        .collect();
    let replayed = pipeline::record(&crash.settings, log::write(&cut), &[end - 3.0]);
    let result = pipeline::run(&replayed.records[0]);
    assert!(!result.rest.found && result.gaps);
    assert!(
        result.limits[0].contains("No rest was found"),
        "{:?}",
        result.limits
    );

    let crash = crash::draw(Class::Frontal, 9401);
    let (_, whole) = play(&crash, crash.text());
    let (_, result) = play(&crash, crash.without(WHEELS, 0.0, 1e9));
    assert!(
        result
            .limits
            .iter()
            .any(|l| l.contains("No wheel speed is recorded"))
    );
    assert_eq!(result.wheels.offered, 0);
    let (with, without) = (crash.moment(&whole, -25.0), crash.moment(&result, -25.0));
    eprintln!(
        "without wheels: {:.1} m off 25 s before the impact, 95 % ellipse {:.0} m long; with: {:.1} m, {:.1} m",
        without.off, without.radius, with.off, with.radius
    );
    assert!(without.radius > 2.0 * with.radius && without.inside());

    let crash = crash::draw(Class::Still, 9402);
    let (_, result) = play(&crash, crash.text());
    assert!(result.rest.found && result.impacts.is_empty() && result.braking.is_none());
    assert!(result.distance_m.value < 0.5, "{:?}", result.distance_m);

    let (mut on_roof, mut inside, mut lying) = (0, Vec::new(), Vec::new());
    for seed in 0..40 {
        let crash = crash::draw(Class::Roof, 9410 + seed);
        let (_, result) = play(&crash, crash.text());
        let rest = &result.states[result.states.len() - 1];
        if crash.simulated.truth.facts.rest_roll_deg.abs() > 120.0 {
            on_roof += 1;
            let off =
                rest.roll.to_degrees().abs() - crash.simulated.truth.facts.rest_roll_deg.abs();
            let sd = result.details.final_rest.as_ref().unwrap().roll_deg.sd;
            assert!(result.rest.found && sd < 2.0, "{sd}");
            lying.push(off.abs() < 1.96 * sd);
            assert!(
                result
                    .limits
                    .iter()
                    .any(|l| l.contains("not come to rest on its wheels"))
            );
        }
        for back in [-20.0, -5.0] {
            inside.push(crash.moment(&result, back).inside());
        }
    }
    assert!(on_roof >= 27, "{on_roof}");
    let [share, lying] = [&inside, &lying].map(|flags| recordings::share(flags));
    eprintln!(
        "{on_roof} cars on their roofs: {share:.2} of the places before the crash inside the 95 % ellipse, {lying:.2} of the angles of rest inside their bounds"
    );
    assert!(share >= 0.9 && lying >= 0.9, "{share} {lying}");
}

#[test]
fn factors_that_make_nan_and_logs_of_garbage() {
    let crash = crash::draw(Class::Frontal, 9500);
    let folder = std::env::temp_dir();
    for factor in ["NaN", "inf", "1e400", "0"] {
        let name = format!("svartboks-nan-{}-{factor}.dbc", std::process::id());
        let dbc = crash
            .simulated
            .dbc()
            .replacen("(0.002,0)", &format!("({factor},0)"), 1);
        let path = folder.join(&name);
        std::fs::write(&path, dbc).unwrap();
        let settings =
            recorder::config::Settings::from_toml_str(&crash.simulated.config(&name), &folder);
        std::fs::remove_file(path).unwrap();
        match settings {
            Err(error) => eprintln!("factor {factor}: {error}"),
            Ok(settings) => {
                let replayed = pipeline::record(&settings, crash.text(), &[crash.trigger_at()]);
                let result = pipeline::try_run(&replayed.records[0], &Options::default());
                eprintln!("factor {factor}: {:?}", result.map(|r| r.limits[0].clone()));
            }
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let garbage: Vec<u8> = (0..200_000).map(|_| rng.random_range(0..=255)).collect();
    for (what, bytes) in [
        ("empty", Vec::new()),
        ("blank", b"\n\n  \r\n".to_vec()),
        ("garbage", garbage),
        ("one long line", vec![b'x'; 3_000_000]),
        ("zeros", vec![0; 1_000_000]),
    ] {
        let error = pipeline::try_record(&crash.settings, bytes, &[])
            .err()
            .unwrap()
            .to_string();
        assert!(
            error.contains("no readable frame") && error.len() < 400,
            "{what}: {error}"
        );
    }
    // Garbage between good lines is counted, and changes nothing.
    let (_, whole) = play(&crash, crash.text());
    let mut text = Vec::new();
    for (k, line) in crash.text().lines().enumerate() {
        text.extend_from_slice(line.as_bytes());
        text.push(b'\n');
        if k % 100 == 0 {
            let noise: Vec<u8> = (0..60).map(|_| rng.random_range(11..=255)).collect();
            text.extend_from_slice(&noise);
            text.push(b'\n');
        }
    }
    let replayed = pipeline::record(&crash.settings, text, &[crash.trigger_at()]);
    assert!(replayed.outcome.source.malformed > 100);
    assert_eq!(pipeline::run(&replayed.records[0]).states, whole.states);
}
