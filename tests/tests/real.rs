//! Drives that others recorded, from the log to the path, against their satellite fixes.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use support::drive::{Fix, Score, score};
use support::{pipeline, recordings};

use reconstruct::findings::Reconstruction;
use reconstruct::trajectory::State;
use schema::{Record, num};

const ZERO: i64 = 1_700_000_000;

/// One way to record and reconstruct a drive.
#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    /// Manual trigger, s from the log's first frame.
    trigger: f64,
    changes: &'static [(&'static str, &'static str)],
    /// Of several records the one with this number.
    what: &'static str,
}

const fn case(
    name: &'static str,
    trigger: f64,
    changes: &'static [(&'static str, &'static str)],
    what: &'static str,
) -> Case {
    Case {
        name,
        trigger,
        changes,
        what,
    }
}

fn fixes(name: &str) -> Option<Vec<Fix>> {
    let rows = recordings::table(&format!("{name}.truth.csv"), &["t_s", "ref_n_m", "ref_e_m"])?;
    Some(
        rows.iter()
            .filter(|row| row.iter().all(|x| x.is_finite()))
            .map(|row| (row[0], [row[1], row[2]]))
            .collect(),
    )
}

fn play(case: &Case) -> Option<(Reconstruction, Score)> {
    let text = recordings::log(case.name)?;
    let settings = recordings::settings(case.name, case.changes);
    let replayed = pipeline::record(&settings, text, &[case.trigger]);
    assert_eq!(replayed.records.len(), 1, "{}", case.name);
    let result = pipeline::run(&replayed.records[0]);
    assert!(result.rest.found, "{}: {}", case.name, result.rest.reason);
    assert!(
        result.impacts.is_empty(),
        "{}: an impact in a drive",
        case.name
    );
    let score = score(&result, &fixes(case.name)?, ZERO);
    Some((result, score))
}

fn row(case: &Case, result: &Reconstruction, score: &Score) -> String {
    let cell = |seconds: f64| {
        score.back(seconds).map_or_else(
            || "             -".to_owned(),
            |miss| format!("{:6.2} m {:5.2}%", miss.off, miss.percent()),
        )
    };
    let first = score.misses[0];
    format!(
        "{:15} {:6.1} {:34} {:5.1} s {:6.1} m | {} {} {} {} | {:5.2} {:5.2} | sd {:.2} m",
        case.name,
        case.trigger,
        case.what,
        score.rest - first.t,
        first.left,
        cell(f64::INFINITY),
        cell(30.0),
        cell(20.0),
        cell(10.0),
        score.inside,
        score.inside_far,
        result.states[0].sd_north.hypot(result.states[0].sd_east),
    )
}

/// At most this part of the distance driven; a fix itself is off by some centimetres.
fn check(case: &Case, score: &Score) {
    for seconds in [f64::INFINITY, 30.0, 20.0, 10.0] {
        let Some(miss) = score.back(seconds) else {
            continue;
        };
        let allowed = 0.01 * miss.left + if seconds == f64::INFINITY { 0.0 } else { 0.1 };
        assert!(
            miss.off <= allowed,
            "{} triggered at {} ({}), {seconds} s before rest: {:.2} m off after {:.1} m",
            case.name,
            case.trigger,
            case.what,
            miss.off,
            miss.left
        );
    }
    assert!(score.inside >= 0.9, "{}: {}", case.name, score.inside);
}

fn all(cases: &[Case]) {
    let mut lines = vec![
        "recording       trigger how                                 back    driven | at the start   30 s back      20 s back      10 s back      | inside, far"
            .to_owned(),
    ];
    let mut scores = Vec::new();
    for case in cases {
        let Some((result, score)) = play(case) else {
            return;
        };
        lines.push(row(case, &result, &score));
        scores.push((case, score));
    }
    eprintln!("{}", lines.join("\n"));
    for (case, score) in scores {
        check(case, &score);
    }
}

const POST_3: &[(&str, &str)] = &[("post_trigger_s = 5", "post_trigger_s = 3")];
const POST_5: &[(&str, &str)] = &[("post_trigger_s = 3", "post_trigger_s = 5")];
const POST_10: &[(&str, &str)] = &[("post_trigger_s = 3", "post_trigger_s = 10")];
const POST_10_WID08: &[(&str, &str)] = &[("post_trigger_s = 5", "post_trigger_s = 10")];
const TWO_RATE: &[(&str, &str)] = &[(
    "post_trigger_s = 3",
    "post_trigger_s = 3\nlayout = \"two-rate\"",
)];
const TWO_RATE_WID08: &[(&str, &str)] = &[(
    "post_trigger_s = 5",
    "post_trigger_s = 5\nlayout = \"two-rate\"",
)];
const LONG: &[(&str, &str)] = &[("post_trigger_s = 3", "post_trigger_s = 3\nseconds = 120")];
const LONG_WID08: &[(&str, &str)] = &[("post_trigger_s = 5", "post_trigger_s = 5\nseconds = 60")];
const NO_COUNTER: &[(&str, &str)] = &[
    ("accel_counter", "# accel_counter"),
    ("rate_counter", "# rate_counter"),
];

#[test]
fn forty_seconds_back_from_each_stop() {
    all(&[
        case("wid08", 58.0, &[], "first stop"),
        case("wid08", 121.8, &[], "second stop"),
        case("wid02", 130.0, &[], ""),
        case("wid02-consumer", 130.0, &[], ""),
    ]);
}

#[test]
fn the_result_hangs_on_no_one_choice() {
    all(&[
        case("wid08", 56.3, &[], "1 s before the stop"),
        case("wid08", 60.3, &[], "3 s after the stop"),
        case("wid08", 57.3, POST_3, "3 s after the trigger"),
        case("wid08", 56.3, POST_10_WID08, "10 s after the trigger"),
        case("wid08", 58.0, TWO_RATE_WID08, "two rates"),
        case("wid08", 58.0, LONG_WID08, "ring of 60 s"),
        case("wid08", 58.0, NO_COUNTER, "no counters"),
        case("wid08", 120.6, &[], "1 s before the stop"),
        case(
            "wid08",
            120.6,
            TWO_RATE_WID08,
            "1 s before the stop, two rates",
        ),
        case("wid08", 124.0, &[], "2.4 s after the stop"),
        case("wid08", 121.8, LONG_WID08, "ring of 60 s"),
        case("wid02", 127.9, &[], "1 s before the stop"),
        case("wid02", 131.9, &[], "3 s after the stop"),
        case("wid02", 129.5, POST_5, "5 s after the trigger"),
        case("wid02", 129.0, POST_10, "10 s after the trigger, log ends"),
        case("wid02", 130.0, TWO_RATE, "two rates"),
        case("wid02", 130.0, NO_COUNTER, "no counters"),
        case("wid02-consumer", 127.9, &[], "1 s before the stop"),
        case("wid02-consumer", 131.9, &[], "3 s after the stop"),
        case(
            "wid02-consumer",
            129.0,
            POST_10,
            "10 s after the trigger, log ends",
        ),
        case("wid02-consumer", 130.0, TWO_RATE, "two rates"),
        case("wid02-consumer", 130.0, NO_COUNTER, "no counters"),
    ]);
}

#[test]
fn two_minutes_back() {
    let cases = [
        case("wid02", 130.0, LONG, "ring of 120 s"),
        case("wid02-consumer", 130.0, LONG, "ring of 120 s"),
    ];
    for case in cases {
        let Some((result, score)) = play(&case) else {
            return;
        };
        eprintln!("{}", row(&case, &result, &score));
        let first = score.misses[0];
        assert!(
            first.off <= 0.01 * first.left,
            "{}: {} m",
            case.name,
            first.off
        );
        assert!(score.inside >= 0.8, "{}: {}", case.name, score.inside);
    }
}

/// Mean wheel speed over the reference speed, wherever both wheels were heard.
fn wheel_ratios(record: &Record, truth: &[Vec<f64>], utc_s: impl Fn(i64) -> f64) -> Vec<f64> {
    let ratio = |index: u64, wheels: [Option<f64>; 2]| {
        let (left, right) = wheels[0].zip(wheels[1])?;
        let t = utc_s(record.monotonic_ns(index));
        Some(f64::midpoint(left, right) / recordings::at(truth, t, 3)?)
    };
    record
        .samples()
        .filter_map(|sample| ratio(sample.index, sample.sample.wheels))
        .collect()
}

/// The car's own bus: wheels by its public DBC, and a record that ends moving, with wide but honest bounds.
#[test]
fn a_real_bus_and_a_record_that_ends_moving() {
    let Some(text) = recordings::log("rav4") else {
        return;
    };
    let columns = [
        "t_s",
        "ref_n_m",
        "ref_e_m",
        "ref_speed_mps",
        "ref_yaw_enu_rad",
    ];
    let truth = recordings::table("rav4.truth.csv", &columns).unwrap();
    for trigger in [45.0, 49.0, 58.0] {
        let replayed =
            pipeline::record(&recordings::settings("rav4", &[]), text.clone(), &[trigger]);
        let record = &replayed.records[0];
        assert!(!record.completion.complete && !record.completion.ends_at_rest);
        let moving = |lines: &[String]| lines.iter().any(|line| line.contains("ends moving"));
        assert!(
            moving(&record.completion.reasons),
            "{:?}",
            record.completion
        );
        let utc_s = |monotonic: i64| {
            num::real_i64(monotonic + record.header.clock.offset_ns - 1_533_224_087_000_000_000)
                * 1e-9
        };
        let ratios = wheel_ratios(record, &truth, utc_s);
        let ratio = recordings::median(&ratios);
        assert!(
            ratios.len() > 1000 && (ratio - 1.0).abs() < 0.015,
            "{ratio}"
        );

        let result = pipeline::run(record);
        assert!(!result.rest.found && result.gaps, "{:?}", result.rest);
        assert!(moving(&result.limits), "{:?}", result.limits);
        // Both paths as seen from the last state: place and heading there are the frame.
        let last = result.states.last().unwrap();
        let end = utc_s(last.utc_ns.unwrap() - record.header.clock.offset_ns);
        let place = |t: f64| Some([recordings::at(&truth, t, 1)?, recordings::at(&truth, t, 2)?]);
        let (origin, yaw) = (
            place(end - 0.1).unwrap(),
            recordings::at(&truth, end - 0.1, 4).unwrap(),
        );
        let at = |t: f64| {
            result
                .states
                .iter()
                .min_by(|a, b| {
                    let off = |s: &State| (s.t_s - last.t_s - (t - end)).abs();
                    off(a).total_cmp(&off(b))
                })
                .unwrap()
        };
        let base = at(end - 0.1);
        let (mut inside, mut speeds, mut worst) = (Vec::new(), Vec::new(), (0.0, 0.0, 0.0));
        let mut back = 1.0;
        while let Some(fix) = place(end - back) {
            let state = at(end - back);
            if (state.t_s - last.t_s + back).abs() > 0.011 {
                break;
            }
            // The truth's heading is counterclockwise from east.
            let (east, north) = (fix[1] - origin[1], fix[0] - origin[0]);
            let forward = yaw.cos() * east + yaw.sin() * north;
            let right = yaw.sin() * east - yaw.cos() * north;
            let d = [
                state.position[0] - base.position[0] - forward,
                state.position[1] - base.position[1] - right,
            ];
            // The reference's own heading is off by some tenths of a degree.
            let doubt = 0.01 * forward.hypot(right);
            let (nn, ee, ne) = (
                state.sd_north.powi(2) + doubt.powi(2) + 0.25,
                state.sd_east.powi(2) + doubt.powi(2) + 0.25,
                state.cov_north_east,
            );
            let chi = (ee * d[0] * d[0] - 2.0 * ne * d[0] * d[1] + nn * d[1] * d[1])
                / (nn * ee - ne * ne);
            inside.push(chi < 5.991);
            let speed = recordings::at(&truth, end - back, 3).unwrap();
            speeds.push((state.ground_speed - speed).abs() < 1.96 * state.sd_speed);
            worst = (back, d[0].hypot(d[1]), forward.hypot(right));
            back += 1.0;
        }
        eprintln!(
            "rav4 triggered at {trigger}: wheels {ratio:.4} of the reference; {:.0} s back {:.1} m off, {:.0} m away \
             (sd {:.1} m); places inside {:.2}, speeds inside {:.2}",
            worst.0,
            worst.1,
            worst.2,
            result.states[0].sd_north.hypot(result.states[0].sd_east),
            recordings::share(&inside),
            recordings::share(&speeds),
        );
        assert!(recordings::share(&inside) >= 0.9);
        assert!(recordings::share(&speeds) >= 0.9);
    }
}
