//! `reconstruct validate` as a program.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skipped"
)]

mod support;

use std::path::Path;

use serde_json::Value;
use support::{crash, folder, reconstruct, stderr, stdout};

use ::reconstruct::simulate::Class;

fn json(args: &[&str]) -> Value {
    let output = reconstruct(args);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

fn numbers(value: &Value, path: &str) {
    match value {
        Value::Object(map) => map
            .iter()
            .for_each(|(k, v)| numbers(v, &format!("{path}.{k}"))),
        Value::Array(list) => list.iter().for_each(|v| numbers(v, path)),
        Value::String(text) => assert!(!text.contains("NaN"), "{path}: {text}"),
        _ => {}
    }
}

/// Same seeds, same bytes, on one thread and on two; page and JSON are whole.
#[test]
fn files_do_not_depend_on_the_number_of_threads() {
    let dirs = [folder("validate-one"), folder("validate-two")];
    for (dir, threads) in dirs.iter().zip(["1", "2"]) {
        let output = reconstruct(&[
            "validate",
            "--classes",
            "frontal,double",
            "--seeds",
            "1..2",
            "--model",
            "nine-state",
            "--model",
            "dead-reckoning",
            "--faults",
            "--fault-seeds",
            "1..1",
            "--threads",
            threads,
            "--out",
            dir.to_str().unwrap(),
            "--tables",
        ]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(
            stderr(&output).contains("4 of 4 crashes"),
            "{}",
            stderr(&output)
        );
        let text = stdout(&output);
        assert!(text.contains("impact speed, median error") && text.contains("scored 4 of 4"));
    }
    for name in ["validate.json", "validate.html"] {
        let [one, two] = dirs
            .each_ref()
            .map(|dir| std::fs::read(dir.join(name)).unwrap());
        assert!(one == two, "{name} differs");
    }
    let text = std::fs::read_to_string(dirs[0].join("validate.json")).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    numbers(&value, "");
    assert_eq!(value["format"], "svartboks-validation/1");
    assert_eq!(value["models"].as_array().unwrap().len(), 2);
    assert_eq!(value["faults"].as_array().unwrap().len(), 22);
    let rows = value["models"][0]["rows"].as_array().unwrap();
    let row = rows
        .iter()
        .find(|r| r["measure"] == "position" && r["at"] == "-30 s")
        .unwrap();
    assert_eq!(row["n"], 4);
    assert_eq!(row["coverage"][2]["of"], 4);
    assert!(row["median"]["low"].as_f64().unwrap() <= row["median"]["high"].as_f64().unwrap());
    let items: Vec<u64> = value["models"][0]["bars"]
        .as_array()
        .unwrap()
        .iter()
        .map(|b| b["item"].as_u64().unwrap())
        .collect();
    assert!((1..=6).all(|item| items.contains(&item)));
    let page = std::fs::read_to_string(dirs[0].join("validate.html")).unwrap();
    assert!(
        !page.contains("<script")
            && !page.contains("NaN")
            && page.contains("What limits this validation")
    );
}

#[test]
fn wrong_arguments_are_usage_errors() {
    for args in [
        &["validate", "--classes", "sideways"][..],
        &["validate", "--seeds", "7..3"],
        &["validate", "--seeds", "7"],
        &["validate", "--model", "best"],
        &["validate", "--threads", "0"],
    ] {
        let output = reconstruct(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(!stderr(&output).is_empty());
    }
    let output = reconstruct(&["validate", "--no-simulated", "--folder", "no/such/folder"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("no/such/folder"),
        "{}",
        stderr(&output)
    );
}

/// A folder of records with truth, some of which cannot be used: each is named with the reason.
#[test]
fn a_folder_is_scored_and_what_cannot_be_used_is_listed() {
    let dir = folder("validate-folder");
    let (simulated, record) = crash(Class::Frontal, 12);
    std::fs::write(dir.join("good.svb"), record.to_bytes().unwrap()).unwrap();
    std::fs::write(dir.join("good.truth.csv"), simulated.truth_csv()).unwrap();
    std::fs::write(dir.join("lonely.svb"), b"x").unwrap();
    std::fs::write(dir.join("broken.svb"), b"not a record").unwrap();
    std::fs::write(dir.join("broken.truth.csv"), simulated.truth_csv()).unwrap();
    std::fs::write(dir.join("odd.svb"), record.to_bytes().unwrap()).unwrap();
    std::fs::write(dir.join("odd.truth.csv"), "t_s,speed_mps\n1,x\n").unwrap();
    std::fs::write(dir.join("bare.log"), "(1.0) can0 120#00\n").unwrap();
    std::fs::write(dir.join("bare.truth.csv"), "t_s,speed_mps\n1,2\n").unwrap();
    std::fs::write(dir.join("played.log"), "(1.0) can0 120#00\n").unwrap();
    std::fs::write(dir.join("played.toml"), "").unwrap();
    std::fs::write(dir.join("played.truth.csv"), "t_s,speed_mps\n1,2\n").unwrap();
    let output = reconstruct(&[
        "validate",
        "--no-simulated",
        "--json",
        "--recorder",
        "no-such-recorder",
        "--folder",
        dir.to_str().unwrap(),
    ]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let value: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let windows = value["recordings"].as_array().unwrap();
    let models: Vec<_> = windows.iter().map(|w| &w["model"]).collect();
    assert_eq!(models, ["refined", "nine-state"], "{windows:?}");
    let good = &windows[0];
    assert_eq!(
        (&good["name"], &good["rest_found"]),
        (&"good".into(), &true.into())
    );
    assert!(
        good["start_percent_of_distance"].as_f64().unwrap() < 3.0,
        "{good}"
    );
    assert!(good["coverage"][2]["share"]["value"].as_f64().unwrap() > 0.5);
    let reasons: Vec<(String, String)> = value["unused"]
        .as_array()
        .unwrap()
        .iter()
        .map(|u| {
            (
                u["name"].as_str().unwrap().into(),
                u["reason"].as_str().unwrap().into(),
            )
        })
        .collect();
    for (name, word) in [
        ("lonely", "expected lonely.truth.csv"),
        ("broken", "broken.svb"),
        ("odd", "line 2, column speed_mps"),
        ("bare", "expected bare.toml"),
        ("played", "no-such-recorder"),
    ] {
        assert!(
            reasons.iter().any(|(n, r)| n == name && r.contains(word)),
            "{name}: {reasons:?}"
        );
    }
}

/// Bytes of the sidecar and the truth changed at random: an answer or a reason, never a crash of the program.
#[test]
fn mutated_sidecars_and_truths_are_survived() {
    let dir = folder("validate-mutated");
    let (simulated, record) = crash(Class::Frontal, 13);
    let bytes = record.to_bytes().unwrap();
    let csv = simulated.truth_csv();
    let truth = csv.lines().step_by(50).collect::<Vec<_>>().join("\n");
    let sidecar = "{\"trigger_at_s\": [1.0], \"truth_epoch_s\": 1700000000, \"fix_sd_m\": 0.1}";
    let mut state = 7_u64;
    let mut next = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).unwrap() % below
    };
    let mut mutate = |text: &str| {
        let mut bytes = text.as_bytes().to_vec();
        for _ in 0..=next(3) {
            let at = next(bytes.len());
            match next(3) {
                0 => bytes[at] = b"0123456789-.,e\"[]{}\n\xff"[next(21)],
                1 => bytes.truncate(at.max(1)),
                _ => bytes.insert(at, b'9'),
            }
        }
        bytes
    };
    for i in 0..12 {
        std::fs::write(dir.join(format!("m{i}.svb")), &bytes).unwrap();
        std::fs::write(dir.join(format!("m{i}.truth.csv")), mutate(&truth)).unwrap();
        std::fs::write(dir.join(format!("m{i}.validate.json")), mutate(sidecar)).unwrap();
    }
    let output = reconstruct(&[
        "validate",
        "--no-simulated",
        "--json",
        "--folder",
        dir.to_str().unwrap(),
    ]);
    assert!(
        matches!(output.status.code(), Some(0 | 3)),
        "{}",
        stderr(&output)
    );
    let value: Value = serde_json::from_str(&stdout(&output)).unwrap();
    // By two models each; what is used or not is named.
    let named: std::collections::BTreeSet<_> = ["recordings", "unused"]
        .iter()
        .flat_map(|key| value[key].as_array().unwrap())
        .map(|entry| entry["name"].as_str().unwrap())
        .map(|name| name.split(" by ").next().unwrap())
        .collect();
    assert_eq!(named.len(), 12, "{named:?}");
}

/// The recordings of others, if they and the recorder are here.
#[test]
fn real_recordings() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let data = root.join("../shared/data");
    let program = Path::new(env!("CARGO_BIN_EXE_reconstruct")).with_file_name("recorder");
    if !data.is_dir() || !program.is_file() {
        eprintln!(
            "skipped: the recordings (../shared/data beside the project) or the recorder are not here"
        );
        return;
    }
    let value = json(&[
        "validate",
        "--no-simulated",
        "--json",
        "--folder",
        data.to_str().unwrap(),
        "--configs",
        root.join("tests/config").to_str().unwrap(),
        "--recorder",
        program.to_str().unwrap(),
    ]);
    let windows = value["recordings"].as_array().unwrap();
    assert_eq!(windows.len(), 16, "{:?}", value["unused"]);
    let mut refined = Vec::new();
    for window in windows {
        let (name, model) = (&window["name"], &window["model"]);
        let off = window["start_percent_of_distance"].as_f64();
        if window["coverage"].is_null() {
            assert_eq!(name, "nhtsa10146", "{window}");
            continue;
        }
        let inside = window["coverage"][2]["share"]["value"].as_f64().unwrap();
        eprintln!("{name} {model}: {off:?} % off, {inside:.3} of the fixes inside");
        if name.as_str().unwrap().starts_with("wid") {
            let off = off.unwrap();
            assert!(off <= 1.0, "{window}");
            assert!(inside >= 0.85, "{name} {model}: {inside}");
            if model == "refined" {
                refined.push(off);
            }
        }
    }
    refined.sort_by(f64::total_cmp);
    assert_eq!(refined.len(), 4);
    let median = f64::midpoint(refined[1], refined[2]);
    assert!(median <= 0.5, "{median} % of the distance");
}
