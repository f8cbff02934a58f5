//! The command line as a person and a script meet it.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use reconstruct::simulate::Class;
use serde_json::Value;
use support::json_schema::violations;
use support::{crash, folder, reconstruct, stderr, stdout};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// A record on disk, and the truth beside it.
fn on_disk(name: &str, class: Class, seed: u64) -> (PathBuf, PathBuf, Vec<u8>) {
    let dir = folder(name);
    let (simulated, record) = crash(class, seed);
    let bytes = record.to_bytes().unwrap();
    std::fs::write(dir.join("crash.svb"), &bytes).unwrap();
    std::fs::write(dir.join("truth.csv"), simulated.truth_csv()).unwrap();
    (dir.join("crash.svb"), dir, bytes)
}

#[test]
fn run_writes_every_file_and_a_screen() {
    let (record, dir, _) = on_disk("run", Class::Oblique, 3);
    let out = dir.join("out");
    let result = reconstruct(&["run", text(&record), "--out", text(&out)]);
    assert_eq!(result.status.code(), Some(0), "{}", stderr(&result));
    let screen = stdout(&result);
    assert!(
        screen.lines().count() <= 24 && screen.lines().all(|l| l.len() <= 80 || l.contains('/')),
        "{screen}"
    );
    for word in [
        "Impact speed",
        "Delta-V",
        "o'clock",
        "Braking",
        "What limits",
        "report.html",
        "exit 0",
    ] {
        assert!(screen.contains(word), "{word}: {screen}");
    }
    let mut names: Vec<_> = std::fs::read_dir(&out)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "funnel.local.json",
            "motion.svg",
            "path.svg",
            "report.html",
            "sample_paths.csv",
            "summary.json",
            "trajectory.csv"
        ]
    );
    let summary = json(&out.join("summary.json"));
    assert_eq!(summary["record"]["signature"], "unsigned");
    assert_eq!(summary["sound"], true);
    let speed = summary["impact"]["speed_mps"].as_f64().unwrap();
    assert!(summary["impact"]["speed_low_mps"].as_f64().unwrap() < speed);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("&lt;b&gt;bench&lt;/b&gt;") && !page.contains("<b>bench"));
}

#[test]
fn summaries_fit_the_printed_schema() {
    let schema: Value = serde_json::from_str(&stdout(&reconstruct(&["schema"]))).unwrap();
    let mut last = Value::Null;
    for (class, seed) in [
        (Class::Frontal, 1),
        (Class::Double, 2),
        (Class::Drive, 3),
        (Class::Still, 4),
    ] {
        let (record, dir, bytes) = on_disk(&format!("schema-{seed}"), class, seed);
        for (name, extra) in [
            ("a", "--confidence=0.8"),
            ("b", "--rest-pose=-33.86,151.2,270"),
        ] {
            let out = dir.join(name);
            let result = reconstruct(&["run", text(&record), "--out", text(&out), extra, "--json"]);
            assert!(
                matches!(result.status.code(), Some(0 | 3)),
                "{}",
                stderr(&result)
            );
            let summary = json(&out.join("summary.json"));
            assert_eq!(violations(&schema, &summary), Vec::<String>::new());
            last = summary.clone();
            let printed: Value = serde_json::from_str(&stdout(&result)).unwrap();
            assert_eq!(printed["impact"], summary["impact"]);
            assert_eq!(printed["files"].as_array().unwrap().len(), 7);
            let digest = <sha2::Sha256 as sha2::Digest>::digest(&bytes);
            assert_eq!(
                summary["record"]["sha256"],
                reconstruct::export::fixed::hex(&digest)
            );
        }
    }
    let mut wrong = last;
    wrong["confidence"] = serde_json::json!("high");
    wrong.as_object_mut().unwrap().remove("limits");
    assert_eq!(violations(&schema, &wrong).len(), 2);
}

#[test]
fn the_same_input_gives_the_same_bytes_and_a_stale_funnel_goes() {
    let (record, dir, _) = on_disk("bytes", Class::Side, 5);
    let (a, b) = (dir.join("a"), dir.join("b"));
    reconstruct(&["run", text(&record), "--out", text(&a)]);
    assert!(a.join("funnel.local.json").exists());
    for out in [&a, &b] {
        let pose = ["--rest-pose", "-33.8,-70.1,123.5,0.2,1.5"];
        let result = reconstruct(&["run", text(&record), "--out", text(out), pose[0], pose[1]]);
        assert_eq!(result.status.code(), Some(0), "{}", stderr(&result));
    }
    assert!(!a.join("funnel.local.json").exists());
    for name in [
        "trajectory.csv",
        "summary.json",
        "funnel.geojson",
        "path.svg",
        "motion.svg",
        "report.html",
        "sample_paths.csv",
    ] {
        assert!(
            std::fs::read(a.join(name)).unwrap() == std::fs::read(b.join(name)).unwrap(),
            "{name}"
        );
    }
    // Sample paths are of the refined model alone: those of an earlier run go.
    let nine = ["--model", "nine-state"];
    reconstruct(&["run", text(&record), "--out", text(&b), nine[0], nine[1]]);
    assert!(a.join("sample_paths.csv").exists() && !b.join("sample_paths.csv").exists());
    let csv = std::fs::read_to_string(a.join("trajectory.csv")).unwrap();
    let heading = csv
        .lines()
        .last()
        .unwrap()
        .split(',')
        .nth(11)
        .unwrap()
        .parse::<f64>()
        .unwrap();
    assert!((heading - 123.5).abs() < 0.1, "{heading}");
    let funnel = json(&a.join("funnel.geojson"));
    let rest = funnel["features"]
        .as_array()
        .unwrap()
        .iter()
        .find(|f| f["properties"]["kind"] == "rest")
        .unwrap();
    assert!((rest["geometry"]["coordinates"][1].as_f64().unwrap() + 33.8).abs() < 1e-6);
}

#[test]
fn a_damaged_record_is_salvaged_loudly() {
    let (record, dir, bytes) = on_disk("damaged", Class::Frontal, 6);
    let mut broken = bytes.clone();
    let middle = broken.len() / 2;
    broken[middle] ^= 0x10;
    for (name, content) in [
        ("flipped", broken),
        ("cut", bytes[..bytes.len() * 3 / 4].to_vec()),
    ] {
        std::fs::write(&record, &content).unwrap();
        let out = dir.join(name);
        let result = reconstruct(&["run", text(&record), "--out", text(&out)]);
        assert_eq!(result.status.code(), Some(3), "{name}: {}", stderr(&result));
        assert!(stderr(&result).contains("BROKEN") && stderr(&result).contains("offset"));
        assert!(stdout(&result).contains("SEAL BROKEN") && stdout(&result).contains("broken seal"));
        let summary = json(&out.join("summary.json"));
        assert_eq!(summary["record"]["signature"], "broken");
        assert!(!summary["record"]["damage"].as_array().unwrap().is_empty());
        assert!(
            std::fs::read_to_string(out.join("report.html"))
                .unwrap()
                .contains("The seal of this record is broken.")
        );
        let inspected = reconstruct(&["inspect", text(&record)]);
        assert_eq!(inspected.status.code(), Some(3));
        assert!(stdout(&inspected).contains("DAMAGE"));
        assert_eq!(
            reconstruct(&["export", text(&record), "--to", "csv"])
                .status
                .code(),
            Some(3)
        );
        assert!(stdout(&reconstruct(&["verify", text(&record)])).contains("BROKEN"));
    }
}

#[test]
fn what_is_no_record_fails_in_one_line() {
    let dir = folder("no-record");
    let path = dir.join("x.svb");
    let out = dir.join("out");
    for content in [&b""[..], b"hello", &[0xff; 5000]] {
        std::fs::write(&path, content).unwrap();
        for args in [
            vec!["run", text(&path), "--out", text(&out)],
            vec!["inspect", text(&path)],
            vec!["verify", text(&path)],
        ] {
            let result = reconstruct(&args);
            assert_eq!(result.status.code(), Some(1), "{args:?}");
            let complaint = stderr(&result);
            assert!(
                complaint.starts_with("error: ") && complaint.lines().count() == 1,
                "{complaint}"
            );
            assert!(!complaint.contains("panicked"));
        }
    }
    assert_eq!(
        reconstruct(&["run", "nowhere.svb", "--out", text(&out)])
            .status
            .code(),
        Some(1)
    );
}

#[test]
fn usage_errors_are_2() {
    let (record, dir, _) = on_disk("usage", Class::Frontal, 7);
    let (record, out) = (text(&record), dir.join("out"));
    let run = |extra: &[&str]| {
        let result = reconstruct(&[&["run", record, "--out", text(&out)], extra].concat());
        (result.status.code(), stderr(&result))
    };
    let (code, message) = run(&["--model", "best"]);
    assert_eq!(code, Some(2));
    assert!(
        message.contains("expected refined, nine-state"),
        "{message}"
    );
    for wrong in [
        ["--model", "best"],
        ["--rest-pose", "91,0,0"],
        ["--rest-pose", "1,2"],
        ["--confidence", "95"],
        ["--from", "soon"],
        ["--from", "1000"],
        ["--colour", "red"],
    ] {
        assert_eq!(run(&wrong).0, Some(2), "{wrong:?}");
    }
    assert_eq!(run(&["--road", "no-such-file.json"]).0, Some(1));
    let help = stdout(&reconstruct(&["run", "--help"]));
    assert!(help.contains("refined") && help.contains("nine-state"));
    assert_eq!(reconstruct(&[]).status.code(), Some(2));
    assert_eq!(reconstruct(&["--version"]).status.code(), Some(0));
}

#[test]
fn windows_and_models() {
    let (record, dir, _) = on_disk("window", Class::Frontal, 8);
    let out = dir.join("out");
    for model in ["dead-reckoning", "published", "nine-state", "refined"] {
        let args = [
            "run",
            text(&record),
            "--out",
            text(&out),
            "--from",
            "-10",
            "--to",
            "2.5",
            "--model",
            model,
        ];
        let result = reconstruct(&args);
        assert!(
            matches!(result.status.code(), Some(0 | 3)),
            "{model}: {}",
            stderr(&result)
        );
        assert_eq!(json(&out.join("summary.json"))["model"], model);
        let csv = std::fs::read_to_string(out.join("trajectory.csv")).unwrap();
        assert_eq!(csv.split("\r\n").count() - 2, 1250, "{model}");
        assert!(csv.starts_with("t_s,utc,north_m,east_m,down_m,v_north_mps,v_east_mps,v_down_mps,speed_mps,roll_deg,pitch_deg,heading_deg,yaw_rate_degps,accel_forward_mps2,accel_right_mps2,sd_north_m,sd_east_m,cov_north_east_m2,sd_down_m,sd_speed_mps,sd_heading_deg,ground_speed_mps,sideslip_deg,"));
        assert!(!csv.contains("NaN") && !csv.contains("inf"));
    }
}

#[test]
fn compare_with_the_simulators_truth() {
    let (record, dir, _) = on_disk("compare", Class::Drive, 9);
    let (out, truth) = (dir.join("out"), dir.join("truth.csv"));
    reconstruct(&["run", text(&record), "--out", text(&out)]);
    let trajectory = out.join("trajectory.csv");
    let result = reconstruct(&["compare", text(&trajectory), text(&truth), "--json"]);
    assert_eq!(result.status.code(), Some(0), "{}", stderr(&result));
    let c: Value = serde_json::from_str(&stdout(&result)).unwrap();
    assert_eq!(c["time"]["source"], "utc");
    assert_eq!(c["alignment"]["how"], "none");
    assert!(
        c["start"]["percent_of_distance"].as_f64().unwrap() < 5.0,
        "{}",
        c["start"]
    );
    assert_eq!(c["position"]["inside"].as_array().unwrap().len(), 4);
    let by_speed = dir.join("no-epoch.csv");
    let lines = std::fs::read_to_string(&truth).unwrap();
    let without = lines.lines().fold(String::new(), |mut out, line| {
        let cells: Vec<&str> = line.split(',').collect();
        out.push_str(
            &[&cells[..1], &cells[2..9], &cells[11..12]]
                .concat()
                .join(","),
        );
        out.push('\n');
        out
    });
    std::fs::write(&by_speed, without).unwrap();
    let matched = reconstruct(&[
        "compare",
        text(&trajectory),
        text(&by_speed),
        "--align",
        "fit",
    ]);
    assert_eq!(matched.status.code(), Some(0), "{}", stderr(&matched));
    assert!(stdout(&matched).contains("matching speeds") && stdout(&matched).contains("turned"));
    std::fs::write(&by_speed, "t_s,speed_mps\n0,fast\n").unwrap();
    let wrong = reconstruct(&["compare", text(&trajectory), text(&by_speed)]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(
        stderr(&wrong).contains("line 2, column speed_mps"),
        "{}",
        stderr(&wrong)
    );
}

#[test]
fn inspect_export_verify() {
    let (record, dir, _) = on_disk("show", Class::Rear, 10);
    let record = text(&record);
    let shown = reconstruct(&[
        "inspect", record, "--hex", "--from", "-0.05", "--to", "0.05", "--every", "2",
    ]);
    assert_eq!(shown.status.code(), Some(0));
    let lines = stdout(&shown);
    assert!(lines.contains("stored bytes") && lines.contains("origin"));
    assert_eq!(
        lines
            .lines()
            .skip_while(|l| !l.contains("stored bytes"))
            .skip(1)
            .count(),
        5,
        "{lines}"
    );
    let machine: Value =
        serde_json::from_str(&stdout(&reconstruct(&["inspect", record, "--json"]))).unwrap();
    assert_eq!(machine["signature"], "unsigned");
    let verified = reconstruct(&["verify", record]);
    assert_eq!(verified.status.code(), Some(3));
    assert!(stdout(&verified).contains("identity unproven"));
    let csv = stdout(&reconstruct(&["export", record, "--to", "csv"]));
    let rows = csv.lines().count() - 1;
    assert_eq!(
        Some(rows),
        machine["end_sample"]
            .as_u64()
            .zip(machine["first_sample"].as_u64())
            .map(|(b, a)| schema::num::usize_of(b - a))
    );
    let candump = dir.join("frames.log");
    assert_eq!(
        reconstruct(&["export", record, "--to", "candump", "--out", text(&candump)])
            .status
            .code(),
        Some(0)
    );
    assert!(
        std::fs::read_to_string(&candump)
            .unwrap()
            .trim_end()
            .ends_with("can0 120#01020304")
    );
    let all: Value =
        serde_json::from_str(&stdout(&reconstruct(&["export", record, "--to", "json"]))).unwrap();
    assert_eq!(all["samples"].as_array().unwrap().len(), rows);
}

#[test]
fn a_reader_that_goes_away_is_no_panic() {
    let (record, _, _) = on_disk("pipe", Class::Frontal, 11);
    let mut child = Command::new(env!("CARGO_BIN_EXE_reconstruct"))
        .args(["export", text(&record), "--to", "json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
}

#[test]
fn simulate_is_wired_in() {
    let dir = folder("simulate");
    let result = reconstruct(&[
        "simulate",
        "--class",
        "frontal",
        "--seed",
        "3",
        "--out",
        text(&dir),
    ]);
    assert_eq!(result.status.code(), Some(0), "{}", stderr(&result));
    assert!(std::fs::read_dir(&dir).unwrap().count() >= 4);
    assert_eq!(
        reconstruct(&["simulate", "--class", "nothing"])
            .status
            .code(),
        Some(2)
    );
}
