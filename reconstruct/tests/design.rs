//! The design study on the command line.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::path::{Path, PathBuf};

use serde_json::Value;
use support::{folder, reconstruct, stderr, stdout};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn json(args: &[&str]) -> Value {
    let mut all = vec!["design", "--json"];
    all.extend(args);
    let result = reconstruct(&all);
    assert_eq!(result.status.code(), Some(0), "{}", stderr(&result));
    serde_json::from_str(&stdout(&result)).unwrap()
}

fn write(dir: &Path, name: &str, content: &str) -> PathBuf {
    let path = dir.join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn five_grades_three_files_and_a_screen() {
    let dir = folder("design");
    let out = dir.join("out");
    let result = reconstruct(&["design", "--out", text(&out)]);
    assert_eq!(result.status.code(), Some(0), "{}", stderr(&result));
    let screen = stdout(&result);
    for word in [
        "navigation",
        "automotive",
        "ellipse (m)",
        "what dominates",
        "15,887 m; the source: 1,620 m is a slip",
        "63,547 m; the source: 6,480 m is a slip",
        "7.6 m; the source: 9.5 m is a slip",
        "0.941 cm/s^2; the source: 0.95 cm/s^2 agrees",
        "design.html",
    ] {
        assert!(screen.contains(word), "{word}: {screen}");
    }
    let value: Value =
        serde_json::from_slice(&std::fs::read(out.join("design.json")).unwrap()).unwrap();
    let sensors = value["sensors"].as_array().unwrap();
    assert_eq!(sensors.len(), 5);
    for sensor in sensors {
        let at = sensor["at"].as_array().unwrap();
        let times: Vec<f64> = at.iter().map(|r| number(&r["t_s"])).collect();
        assert_eq!(times, [-30.0, -10.0, -5.0, -1.0, 0.0]);
        // A funnel: narrowest at the impact, wider the longer before it.
        let axes: Vec<f64> = at.iter().map(|r| number(&r["semi_major_m"])).collect();
        assert!(axes.windows(2).all(|p| p[0] > p[1]), "{axes:?}");
        assert!(number(&sensor["impact"]["sd_speed_mps"]) > 0.0);
        assert_eq!(sensor["aids"].as_array().unwrap().len(), 4);
        assert_eq!(sensor["shares"].as_array().unwrap().len(), 5);
    }
    let heading = |i: usize| number(&sensors[i]["at"][0]["sd_heading_deg"]);
    assert!((0..4).all(|i| heading(i) <= heading(i + 1)));
    let picture = std::fs::read_to_string(out.join("design.svg")).unwrap();
    let page = std::fs::read_to_string(out.join("design.html")).unwrap();
    for drawn in [&picture, &page] {
        assert!(!drawn.contains("NaN") && !drawn.contains("inf "));
        assert!(!drawn.contains("<script"));
        let outside = drawn
            .match_indices("http")
            .filter(|(i, _)| {
                !drawn[*i..].starts_with("http://www.w3.org/2000/svg")
                    && !drawn[*i..].starts_with("http-equiv")
            })
            .count();
        assert_eq!(outside, 0);
    }
    assert!(page.contains("The figures of the source, computed again"));
}

#[test]
fn the_same_study_gives_the_same_bytes() {
    let args = [
        "design", "--json", "--class", "side", "--seed", "4", "--grade", "consumer",
    ];
    assert_eq!(reconstruct(&args).stdout, reconstruct(&args).stdout);
}

#[test]
fn examples_come_back_as_files() {
    let dir = folder("design-examples");
    let print = |args: &[&str]| stdout(&reconstruct(&[&["design", "--example"], args].concat()));
    for (suffix, more) in [("toml", &[][..]), ("json", &["--json"][..])] {
        let manoeuvre = print(&[&["manoeuvre"], more].concat());
        let sheet = print(&[&["sheet"], more].concat());
        let manoeuvre = write(&dir, &format!("m.{suffix}"), &manoeuvre);
        let sheet = write(&dir, &format!("s.{suffix}"), &sheet);
        let value = json(&[
            "--model",
            "nine-state",
            "--manoeuvre",
            text(&manoeuvre),
            "--sheet",
            text(&sheet),
        ]);
        assert_eq!(value["manoeuvre"]["name"], "rural road, oblique impact");
        assert_eq!(value["sensors"][0]["name"], "bench MEMS");
        // 45 km/h clip a 16 g sensor: a lower bound, and it is said.
        assert_eq!(value["sensors"][0]["impact"]["lower_bound"], true);
        assert!(number(&value["sensors"][0]["clipped_samples"]) > 0.0);
    }
}

#[test]
fn a_configuration_of_the_recorder_is_a_sheet() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recorder/etc/recorder.toml");
    let value = json(&["--class", "stop", "--sheet", text(&file)]);
    assert_eq!(value["sensors"][0]["name"], "recorder");
    assert_eq!(value["manoeuvre"]["zero"], "begin of the rest");
    assert!(value["sensors"][0]["impact"].is_null());
}

#[test]
fn without_wheels_and_road_the_funnel_is_wider() {
    let args = ["--grade", "consumer", "--class", "frontal", "--seed", "5"];
    let with = json(&args);
    let without = json(&[&args[..], &["--no-wheels", "--road", "none"]].concat());
    let axis = |v: &Value| number(&v["sensors"][0]["at"][0]["semi_major_m"]);
    assert!(axis(&without) > 1.5 * axis(&with));
    assert_eq!(without["wheels"], false);
    assert_eq!(without["road"], "none");
    // The table of aids holds the same number.
    let neither = &with["sensors"][0]["aids"][3];
    assert_eq!(neither["wheels"], false);
    assert!((number(&neither["semi_major_m"]) / axis(&without) - 1.0).abs() < 1e-9);
}

#[test]
fn trials_are_reported() {
    let value = json(&["--grade", "tactical", "--trials", "3"]);
    let trial = &value["trials"][0];
    assert_eq!(trial["sets"], 3);
    assert_eq!(trial["coverage"].as_array().unwrap().len(), 5);
}

#[test]
fn bad_input_says_where_and_exits() {
    let dir = folder("design-bad");
    let unknown = write(&dir, "unknown.toml", "[imu.noise]\naccel_biass = 0.1\n");
    let negative = write(&dir, "negative.toml", "[imu.noise]\naccel_bias = -0.1\n");
    let infinite = write(&dir, "infinite.toml", "[wheels]\nscale_sd = inf\n");
    let endless = write(&dir, "endless.toml", "start_kmh = 80\n");
    let text_file = write(&dir, "text.toml", "start_kmh = \"fast\"\n");
    let bytes = dir.join("bytes.toml");
    std::fs::write(&bytes, [0xff, 0xfe, 0x00]).unwrap();
    let big = write(&dir, "big.toml", &"#".repeat(1 << 21));
    let cases: [(&[&str], i32, &str); 14] = [
        (&["--grade", "military"], 2, "no grade `military`"),
        (&["--class", "flight"], 2, "no class `flight`"),
        (&["--confidence", "1.5"], 2, "expected a share"),
        (&["--trials", "10001"], 2, "10001 is not in"),
        (&["--example", "car"], 2, "possible values"),
        (
            &[
                "--model",
                "dead-reckoning",
                "--no-wheels",
                "--grade",
                "consumer",
            ],
            2,
            "dead-reckoning without a wheel speed",
        ),
        (&["--road", "nowhere.json"], 1, "nowhere.json"),
        (
            &["--sheet", "nowhere.toml"],
            1,
            "nowhere.toml: No such file",
        ),
        (
            &["--sheet", text(&unknown)],
            1,
            "unknown field `accel_biass`",
        ),
        (
            &["--sheet", text(&negative)],
            1,
            "imu.noise.accel_bias: expected 0 to 50, found -0.1",
        ),
        (
            &["--sheet", text(&infinite)],
            1,
            "wheels.scale_sd: expected 0 to 1, found inf",
        ),
        (
            &["--manoeuvre", text(&endless)],
            1,
            "that brings the car to rest",
        ),
        (
            &["--manoeuvre", text(&text_file)],
            1,
            "invalid type: string",
        ),
        (&["--manoeuvre", text(&bytes)], 1, "expected UTF-8"),
    ];
    for (args, code, expected) in cases {
        let result = reconstruct(&[&["design"], args].concat());
        let found = stderr(&result);
        assert_eq!(result.status.code(), Some(code), "{args:?}: {found}");
        assert!(found.contains(expected), "{args:?}: {found}");
        assert!(stdout(&result).is_empty());
    }
    let result = reconstruct(&["design", "--sheet", text(&big)]);
    assert!(stderr(&result).contains("at most 1 MiB"));
}

#[test]
fn hostile_names_are_disarmed() {
    let dir = folder("design-hostile");
    let sheet = write(
        &dir,
        "s.toml",
        "name = \"<script>alert(1)</script>\"\ntypical_of = \"'><img src=x>\"\n",
    );
    let manoeuvre = write(
        &dir,
        "m.toml",
        "name = \"<b>&\"\nstart_kmh = 60\n[braking]\nt_s = 32\ndecel_mps2 = 6\n",
    );
    let out = dir.join("out");
    let result = reconstruct(&[
        "design",
        "--sheet",
        text(&sheet),
        "--sheet",
        text(&sheet),
        "--manoeuvre",
        text(&manoeuvre),
        "--out",
        text(&out),
    ]);
    assert_eq!(result.status.code(), Some(0), "{}", stderr(&result));
    for name in ["design.svg", "design.html"] {
        let drawn = std::fs::read_to_string(out.join(name)).unwrap();
        assert!(!drawn.contains("<script>") && !drawn.contains("<img") && !drawn.contains("<b>&"));
        assert!(drawn.contains("&lt;script&gt;"));
    }
    assert!(stdout(&result).contains("<script>alert"));
}
