//! `reconstruct gnss analyse` as a person and a script meet it.
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a test fails by panicking"
)]

mod support;

use std::path::{Path, PathBuf};

use support::{folder, reconstruct, stderr, stdout};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn simulated(dir: &Path, more: &[&str]) {
    let mut args = vec!["gnss", "simulate", "--seed", "90031", "--out", text(dir)];
    args.extend(more);
    let made = reconstruct(&args);
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
}

fn analyse(args: &[&str]) -> (Option<i32>, String, String) {
    let all: Vec<&str> = ["gnss", "analyse"].iter().chain(args).copied().collect();
    let result = reconstruct(&all);
    (result.status.code(), stdout(&result), stderr(&result))
}

#[test]
fn a_drive_is_told_on_screen_as_json_and_on_a_page() {
    let dir = folder("gnss-analyse");
    simulated(&dir, &[]);
    let [fixes, motions, reference]: [PathBuf; 3] =
        ["fixes", "motions", "reference"].map(|n| dir.join(format!("{n}-90031.txt")));
    let out = dir.join("out");
    let all = [
        "--fixes",
        text(&fixes),
        "--motions",
        text(&motions),
        "--reference",
        text(&reference),
        "--out",
        text(&out),
    ];
    let (code, told, said) = analyse(&all);
    assert_eq!(code, Some(0), "{said}");
    for part in [
        "Receiver against reference",
        "delay behind the reference by velocity",
        "S00, table 4.4",
        "S00, table 4.6",
        "Welch's F",
        "1.0283",
        "None found",
        "White noise",
    ] {
        assert!(told.to_lowercase().contains(&part.to_lowercase()), "{part}");
    }
    let page = std::fs::read_to_string(out.join("analysis.html")).unwrap();
    assert!(!page.contains("<script") && !page.contains("NaN") && !page.contains("src="));
    for picture in [
        "deviation",
        "variance",
        "bias",
        "allan-gyro",
        "allan-accelerometer",
    ] {
        let svg = std::fs::read_to_string(out.join(format!("{picture}.svg"))).unwrap();
        assert!(
            svg.starts_with("<?xml") && page.contains("<figcaption>"),
            "{picture}"
        );
    }
    let (code, printed, _) = analyse(&[&all[..], &["--json"]].concat());
    assert_eq!(code, Some(0));
    let json: serde_json::Value = serde_json::from_str(&printed).unwrap();
    let file: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("analysis.json")).unwrap()).unwrap();
    assert_eq!(json, file);
    let delay = &json["receivers"][0]["delay_by_velocity"];
    assert!(
        (delay["value_s"].as_f64().unwrap() - 1.24).abs() < 0.1,
        "{delay}"
    );
    // The same input, the same bytes.
    let (_, again, _) = analyse(&all);
    assert_eq!(told, again);
}

#[test]
fn six_positions_from_the_command_line() {
    let dir = folder("gnss-positions");
    simulated(&dir, &["--six-positions"]);
    let motions = dir.join("positions-90031.txt");
    let truth: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("positions-90031.truth.json")).unwrap())
            .unwrap();
    let (code, printed, said) = analyse(&[
        "--motions",
        text(&motions),
        "--axes",
        "car",
        "--latitude",
        "63.42",
        "--json",
    ]);
    assert_eq!(code, Some(0), "{said}");
    let json: serde_json::Value = serde_json::from_str(&printed).unwrap();
    let fit = &json["positions"]["calibration"];
    for axis in 0..3 {
        let found = fit["scale"][axis]["value"].as_f64().unwrap();
        let known = truth["scale"][axis].as_f64().unwrap();
        assert!((found - known).abs() < 5e-4, "{found} {known}");
        assert!(fit["misalignment_xy_xz_yz"][axis]["se"].as_f64().unwrap() > 0.0);
    }
    assert!(
        json["receivers"]["cannot_tell"]
            .as_str()
            .unwrap()
            .contains("no log of fixes")
    );
}

#[test]
fn what_is_wrong_is_said() {
    let dir = folder("gnss-analyse-wrong");
    simulated(&dir, &["--seconds", "60"]);
    let [fixes, motions]: [PathBuf; 2] =
        ["fixes", "motions"].map(|n| dir.join(format!("{n}-90031.txt")));
    let (code, _, said) = analyse(&[]);
    assert!(code == Some(2), "{said}");
    let (code, _, said) = analyse(&["--fixes", text(&motions)]);
    assert!(code == Some(1) && said.contains("35"), "{said}");
    let (code, _, said) = analyse(&["--motions", text(&motions), "--equipment", "7"]);
    assert!(
        code == Some(1) && said.contains("found equipment 2"),
        "{said}"
    );
    let (code, _, said) = analyse(&["--motions", text(&motions), "--latitude", "91"]);
    assert!(code == Some(1) && said.contains("--latitude"), "{said}");
    let (code, _, said) = analyse(&["--motions", text(&motions), "--rest", "7..3"]);
    assert!(code == Some(2) && said.contains("FROM..TO"), "{said}");
    let (code, told, _) = analyse(&["--fixes", text(&fixes)]);
    assert!(
        code == Some(0) && told.contains("Cannot tell: no reference"),
        "{told}"
    );
    let (code, told, _) = analyse(&["--motions", text(&motions), "--rest", "1..9"]);
    assert!(
        code == Some(3) && told.contains("--rest 1..9: expected two seconds"),
        "{told}"
    );
    // A gap: said, and exit code 3.
    let whole = std::fs::read_to_string(&motions).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let holed = [&lines[..1000], &lines[1400..]].concat().join("\n") + "\n";
    let hole = dir.join("hole.txt");
    std::fs::write(&hole, holed).unwrap();
    let (code, _, said) = analyse(&["--fixes", text(&fixes), "--motions", text(&hole)]);
    assert!(code == Some(3) && said.contains("gap"), "{code:?} {said}");
    // A wrap: found, told with its line, exit code 3.
    let wrapped: Vec<String> = lines
        .iter()
        .enumerate()
        .map(|(k, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if (1500..1560).contains(&k) {
                cells[13] = format!(
                    "{}",
                    if (1520..1540).contains(&k) {
                        -33900
                    } else {
                        33900
                    }
                );
            }
            cells.join(",")
        })
        .collect();
    std::fs::write(&hole, wrapped.join("\n") + "\n").unwrap();
    let out = dir.join("wrap");
    let (code, told, _) = analyse(&["--motions", text(&hole), "--out", text(&out)]);
    assert!(
        code == Some(3) && told.contains("wrap") && told.contains("1521"),
        "{told}"
    );
    assert!(out.join("limits.svg").is_file());
}

/// Exit code 1, not 3: what cannot be read is bad input, whichever log it is and whatever the others tell.
#[test]
fn a_log_that_is_missing_is_an_error() {
    let dir = folder("gnss-analyse-missing");
    simulated(&dir, &["--seconds", "60"]);
    let [fixes, motions, reference]: [PathBuf; 3] =
        ["fixes", "motions", "reference"].map(|n| dir.join(format!("{n}-90031.txt")));
    let missing = dir.join("nowhere.txt");
    let empty = dir.join("empty.txt");
    std::fs::write(&empty, "").unwrap();
    let out = dir.join("out");
    for at in 0..3 {
        for (bad, why) in [
            (&missing, "nowhere.txt: No such file"),
            (&empty, "empty.txt: expected lines of"),
        ] {
            let mut paths = [&fixes, &motions, &reference];
            paths[at] = bad;
            let named = ["--fixes", "--motions", "--reference"]
                .into_iter()
                .zip(paths);
            let mut args: Vec<&str> = named.flat_map(|(n, p)| [n, text(p)]).collect();
            args.extend(["--out", text(&out)]);
            for args in [&args[..], &args[2 * at..2 * at + 2]] {
                // A reference alone is no log to analyse.
                let alone = args.len() == 2 && at == 2;
                let (code, told, said) = analyse(args);
                assert_eq!(code, Some(if alone { 2 } else { 1 }), "{args:?} {said}");
                assert!(alone || said.contains(why), "{said}");
                assert!(told.is_empty() && !out.exists(), "{told}");
            }
        }
    }
}
