//! Drives that others recorded, from the log to the path, against their satellite fixes.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use support::drive::{Fix, Score, score};
use support::{pipeline, recordings};

use reconstruct::findings::Reconstruction;

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
    }
}
