//! `reconstruct gnss` says what it was given, what it did with it, and what cannot be right.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::path::{Path, PathBuf};

use serde_json::Value;
use support::{folder, gnss_logs, reconstruct, stderr, stdout};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The same log with a cell of each line changed (columns from 0), and the lines that `keep` takes (from 0, the header first).
fn changed(
    path: &Path,
    name: &str,
    keep: impl Fn(usize) -> bool,
    change: impl Fn(usize, &str) -> Option<String>,
) -> PathBuf {
    let whole = std::fs::read_to_string(path).unwrap();
    let lines = whole.lines().enumerate().filter(|(i, _)| keep(*i));
    let out: String = lines
        .map(|(i, line)| {
            let cells = line.split(',').enumerate().map(|(c, cell)| {
                let new = if i == 0 { None } else { change(c, cell) };
                new.unwrap_or_else(|| cell.to_owned())
            });
            cells.collect::<Vec<String>>().join(",") + "\n"
        })
        .collect();
    let to = path.with_file_name(name);
    std::fs::write(&to, out).unwrap();
    to
}

/// One column scaled or moved.
fn column(wanted: usize, f: impl Fn(f64) -> f64) -> impl Fn(usize, &str) -> Option<String> {
    move |c, cell| (c == wanted).then(|| format!("{:.6}", f(cell.parse().unwrap())))
}

struct Ran {
    code: Option<i32>,
    said: String,
    summary: Value,
    page: String,
}

fn run(fixes: &Path, motions: &Path, more: &[&str]) -> Ran {
    let out = fixes.with_file_name("out");
    let _ = std::fs::remove_dir_all(&out);
    let mut args = vec!["gnss", "run", "--no-smoother", "--fixes", text(fixes)];
    args.extend(["--motions", text(motions), "--out", text(&out)]);
    args.extend(more);
    let done = reconstruct(&args);
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap_or_default();
    Ran {
        code: done.status.code(),
        said: stderr(&done),
        summary: serde_json::from_str(&read("summary.json")).unwrap_or_default(),
        page: read("report.html"),
    }
}

#[test]
fn what_was_taken_and_told_is_recorded() {
    let [fixes, motions, reference] = gnss_logs(&folder("honest-told"), "90031", &[]);
    let more = [
        "--reference",
        text(&reference),
        "--exact-speed",
        "--no-stop",
    ];
    let ran = run(&fixes, &motions, &more);
    assert_eq!(ran.code, Some(0), "{}", ran.said);
    let s = &ran.summary;
    assert!(s["software"].as_str().unwrap().starts_with("svartboks-"));
    for (what, path) in [
        ("fixes", &fixes),
        ("motions", &motions),
        ("reference", &reference),
    ] {
        use sha2::{Digest, Sha256};
        let digest = Sha256::digest(std::fs::read(path).unwrap());
        let hex = schema::seal::Hex(&digest).to_string();
        assert_eq!(s["inputs"][what]["sha256"], hex.as_str());
        assert_eq!(s["inputs"][what]["drive"], 1);
        assert!(ran.page.contains(&hex));
    }
    let o = &s["options"];
    assert!(o["axes"] == "tag" && o["exact_speed"] == true && o["stop_detector"] == false);
    assert!(o["smoother"] == false && o["latency_s"] == 1.24 && o["receiver_sd_m"].is_number());
    assert_eq!(s["deviation"]["speed_of_reference_fed_in"], true);
    assert!(
        ran.page.contains("with the reference&#39;s speed fed in")
            || ran.page.contains("with the reference's speed fed in")
    );
    // Zero is zero, and every fix has one fate.
    assert!(s["standing_s"].as_f64().unwrap().is_sign_positive());
    let f = |key: &str| s["fixes"][key].as_u64().unwrap();
    let all = f("used") + f("refused") + f("forced") + f("withheld");
    assert_eq!(f("log"), all + f("before_track") + f("after_track"));
    assert_eq!(f("offered"), f("used") + f("refused") + f("forced"));
    let out = text(fixes.parent().unwrap());
    let json = reconstruct(&[
        "gnss",
        "run",
        "--json",
        "--no-smoother",
        "--fixes",
        text(&fixes),
        "--motions",
        text(&motions),
        "--out",
        out,
    ]);
    let printed: Value = serde_json::from_str(&stdout(&json)).unwrap();
    assert_eq!(printed["inputs"]["fixes"], s["inputs"]["fixes"]);
    assert!(stdout(&reconstruct(&["gnss", "run", "--help"])).contains("Exit codes: 0 sound"));
}

#[test]
fn logs_that_cannot_be_right_are_noted() {
    let [fixes, motions, reference] = gnss_logs(&folder("honest-noted"), "90032", &[]);
    let noted = |ran: &Ran, what: &str| {
        assert_eq!(ran.code, Some(3), "{what}: {}", ran.said);
        let together = ran.summary["notes"]["together"].to_string();
        assert!(
            ran.said.contains(what) && together.contains(what),
            "{what}: {}",
            ran.said
        );
        let escaped = what.replace('\'', "&#39;");
        assert!(
            ran.page.contains(what) || ran.page.contains(&escaped),
            "{what}"
        );
    };
    let milli_g = |c: usize, cell: &str| {
        (8..11)
            .contains(&c)
            .then(|| format!("{:.5}", 0.009_806_65 * cell.parse::<f64>().unwrap()))
    };
    let si = changed(&motions, "si.txt", |_| true, milli_g);
    noted(&run(&fixes, &si, &[]), "m/s^2 in place of milli-g");
    noted(
        &run(&fixes, &motions, &["--axes", "car"]),
        "the vertical axis of --axes",
    );
    let early = changed(&fixes, "early.txt", |_| true, column(7, |t| t - 1.04));
    noted(&run(&early, &motions, &[]), "0.20 s behind GPS time");
    assert_eq!(run(&early, &motions, &["--latency", "0.2"]).code, Some(0));
    let late = changed(&reference, "late.txt", |_| true, column(7, |t| t + 30.0));
    let ran = run(&fixes, &motions, &["--reference", text(&late)]);
    noted(&ran, "later: another clock");
    let far = changed(&reference, "far.txt", |_| true, column(7, |t| t + 5000.0));
    let ran = run(&fixes, &motions, &["--reference", text(&far)]);
    noted(&ran, "expected one on the box's clock");
    let more = ["--reference", text(&far), "--exact-speed"];
    let ran = run(&fixes, &motions, &more);
    assert!(
        ran.code == Some(1) && ran.said.contains("--exact-speed: expected speeds"),
        "{}",
        ran.said
    );
    let part = changed(&reference, "part.txt", |i| i < 80, |_, _| None);
    let more = ["--reference", text(&part), "--exact-speed"];
    let ran = run(&fixes, &motions, &more);
    noted(
        &ran,
        "expected a speed of the reference each second, found none from",
    );
    let analyse = |reference: &Path| {
        let mut args = vec!["gnss", "analyse", "--fixes", text(&fixes)];
        args.extend(["--motions", text(&motions), "--reference", text(reference)]);
        reconstruct(&args)
    };
    assert!(stderr(&analyse(&late)).contains("later: another clock"));
    assert!(!stderr(&analyse(&reference)).contains("another clock"));
    // The motions of another drive; a reference that holds two.
    let other = changed(&motions, "other.txt", |_| true, column(1, |_| 9.0));
    let whole = std::fs::read_to_string(&other)
        .unwrap()
        .replace("9.000000", "9");
    std::fs::write(&other, whole).unwrap();
    noted(&run(&fixes, &other, &[]), "found equipment 2 drive 9 leg 1");
    let whole = std::fs::read_to_string(&reference).unwrap();
    let second: String = whole
        .lines()
        .skip(1)
        .map(|l| l.replacen("6,1,1,", "6,2,1,", 1) + "\n")
        .collect();
    let both = reference.with_file_name("both.txt");
    std::fs::write(&both, whole + &second).unwrap();
    let ran = run(&fixes, &motions, &["--reference", text(&both)]);
    let taken = &ran.summary["inputs"]["reference"];
    assert!(taken["drive"] == 1 && taken["rows"] == ran.summary["inputs"]["fixes"]["rows"]);
}

#[test]
fn refusals_say_what_is_missing() {
    let [fixes, motions, _] = gnss_logs(&folder("honest-refused"), "90033", &[]);
    let refused = |fixes: &Path, what: &str| {
        for filter in ["refined", "published"] {
            let ran = run(fixes, &motions, &["--filter", filter]);
            assert!(
                ran.code == Some(1) && ran.said.contains(what),
                "{what}: {}",
                ran.said
            );
        }
    };
    let far = changed(&fixes, "far.txt", |_| true, column(7, |t| t + 5000.0));
    refused(
        &far,
        "expected fixes within the time of the inertial samples",
    );
    let still = changed(
        &fixes,
        "still.txt",
        |_| true,
        |c, _| [14, 26, 27, 28].contains(&c).then(|| "0.5".to_owned()),
    );
    refused(&still, "the fastest at 0.71 m/s");
    let bare = changed(
        &fixes,
        "bare.txt",
        |_| true,
        |c, _| [14, 15, 26, 27, 28].contains(&c).then(String::new),
    );
    refused(&bare, "expected fixes with a velocity");
    let bad = changed(
        &fixes,
        "bad.txt",
        |_| true,
        |c, _| (c == 8).then(|| "0".to_owned()),
    );
    refused(&bad, "does not call bad");
}

#[test]
fn a_late_begin_and_held_samples_are_said() {
    let [fixes, motions, _] = gnss_logs(&folder("honest-late"), "90034", &[]);
    let late = changed(&fixes, "late.txt", |i| i == 0 || i > 40, |_, _| None);
    let ran = run(&late, &motions, &[]);
    assert_eq!(ran.code, Some(0), "{}", ran.said);
    let left = ran.summary["begin"]["left_out_s"].as_f64().unwrap();
    assert!((39.0..60.0).contains(&left), "{left}");
    assert!(ran.summary["begin"]["reason"].is_string());
    assert!(
        ran.page
            .contains(&format!("{left:.1} s of the drive before are left out"))
    );
    let whole = run(&fixes, &motions, &[]);
    assert!(!whole.page.contains("of the drive before are left out"));
    let holed = changed(
        &motions,
        "holed.txt",
        |i| !(5000..5050).contains(&i),
        |_, _| None,
    );
    let ran = run(&fixes, &holed, &[]);
    let count = |s: &Value, key: &str| s[key].as_u64().unwrap();
    assert_eq!(count(&ran.summary, "held"), 50);
    assert_eq!(
        count(&ran.summary, "samples") + 50,
        count(&whole.summary, "samples")
    );
}

/// `--every` is seconds in both filters: a log at two fixes a second is thinned to the same.
#[test]
fn every_is_seconds() {
    let [fixes, motions, _] = gnss_logs(&folder("honest-every"), "90035", &[]);
    let sparse = changed(&fixes, "sparse.txt", |i| i == 0 || i % 2 == 1, |_, _| None);
    let used = |fixes: &Path| {
        let ran = run(fixes, &motions, &["--filter", "published", "--every", "10"]);
        ran.summary["fixes"]["used"].as_u64().unwrap()
    };
    let [all, half] = [used(&fixes), used(&sparse)];
    assert!(all > 8 && all.abs_diff(half) <= 1, "{all} {half}");
}
