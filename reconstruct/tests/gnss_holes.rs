//! A hole in the inertial log that no drive bridges: what lies on its sides is reckoned, each for itself, and said; and a part of
//! a log that is chosen by time.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::path::{Path, PathBuf};
use std::process::Output;

use nalgebra::{Matrix2, Vector2};
use reconstruct::gnss::read::{Tolerance, read_fixes};
use reconstruct::gnss::reference::Reference;
use reconstruct::stats::ellipse_radius;
use reconstruct::wgs84::Geodetic;
use schema::num::real;
use serde_json::Value;
use support::{folder, gnss_logs, reconstruct, stderr};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Fixes, motions and reference of a simulated drive of 200 s from 1000 s on, the car's axes.
fn logs(dir: &Path, seed: u64) -> [PathBuf; 3] {
    gnss_logs(dir, &seed.to_string(), &["--axes", "car"])
}

/// The log without the rows whose stamp lies in one of the spans.
fn without(log: &Path, spans: &[[f64; 2]]) -> PathBuf {
    let whole = std::fs::read_to_string(log).unwrap();
    let keep = |line: &&str| {
        let stamp = line.split(',').nth(7).unwrap().parse::<f64>();
        stamp.map_or(true, |t| !spans.iter().any(|s| t > s[0] && t < s[1]))
    };
    let out: Vec<&str> = whole.lines().filter(keep).collect();
    let to = log.with_file_name("holes.txt");
    std::fs::write(&to, out.join("\n") + "\n").unwrap();
    to
}

struct Ran {
    done: Output,
    /// Time, latitude, longitude, covariance of the place, flags of the fixes.
    track: Vec<[f64; 7]>,
    summary: Value,
}

fn run(fixes: &Path, motions: &Path, more: &[&str]) -> Ran {
    let out = fixes.with_file_name("out");
    let _ = std::fs::remove_dir_all(&out);
    let mut args = vec!["gnss", "run", "--axes", "car", "--fixes", text(fixes)];
    args.extend(["--motions", text(motions), "--out", text(&out)]);
    args.extend(more);
    let done = reconstruct(&args);
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap_or_default();
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        [0, 1, 2, 10, 11, 12, 18].map(|i| cells[i])
    };
    Ran {
        done,
        track: read("track.csv").lines().skip(1).map(row).collect(),
        summary: serde_json::from_str(&read("summary.json")).unwrap_or_default(),
    }
}

/// Marks of the reference that the track meets, and those inside its ellipse of 95 %.
fn inside(ran: &Ran, reference: &Path) -> [usize; 2] {
    let text = std::fs::read(reference).unwrap();
    let rows = read_fixes(&mut text.as_slice(), "reference", Tolerance::Strict).unwrap();
    let mut out = [0; 2];
    for mark in Reference::of_rows(&rows.rows).marks {
        let at = ran.track.partition_point(|r| r[0] < mark.t_s - 0.011);
        let Some(r) = ran
            .track
            .get(at)
            .filter(|r| (r[0] - mark.t_s).abs() < 0.011)
        else {
            continue;
        };
        let here = Geodetic {
            latitude: r[1].to_radians(),
            longitude: r[2].to_radians(),
            height: mark.place.height,
        };
        let d: Vector2<f64> = mark.place.to(&here).xy();
        let p = Matrix2::new(r[3] * r[3], r[5], r[5], r[4] * r[4]);
        let square = (d.transpose() * p.try_inverse().unwrap() * d)[0];
        out[0] += 1;
        out[1] += usize::from(square < ellipse_radius(0.95).powi(2));
    }
    out
}

fn notes(ran: &Ran) -> String {
    ran.summary["notes"]["together"].to_string()
}

#[test]
fn both_sides_of_a_hole_are_reckoned_and_it_is_said() {
    let dir = folder("gnss-holes");
    let mut all = [0; 2];
    for seed in 90301..90307 {
        let [fixes, motions, reference] = logs(&dir, seed);
        let holes = [[1062.3, 1075.1], [1130.0, 1136.0]];
        let motions = without(&motions, &holes);
        let ran = run(&fixes, &motions, &["--every", "5"]);
        let said = stderr(&ran.done);
        assert_eq!(ran.done.status.code(), Some(3), "{said}");
        assert_eq!(
            said.matches("the track ends there and begins anew at")
                .count(),
            2
        );
        assert_eq!(notes(&ran).matches("no inertial sample for").count(), 2);
        // Nothing is told of a hole, and no estimate stands in it.
        assert!(
            ran.track
                .iter()
                .all(|r| !holes.iter().any(|h| r[0] > h[0] + 0.03 && r[0] < h[1]))
        );
        let gaps: Vec<[f64; 2]> = ran
            .track
            .windows(2)
            .filter(|w| w[1][0] - w[0][0] > 1.0)
            .map(|w| [w[0][0], w[1][0]])
            .collect();
        assert_eq!(gaps.len(), 2, "{gaps:?}");
        for (gap, hole) in gaps.iter().zip(holes) {
            assert!((gap[0] - hole[0]).abs() < 0.03, "{gap:?}");
            // Until the next fix that tells the course.
            assert!(gap[1] < hole[1] + 60.0, "{gap:?}");
        }
        let f = &ran.summary["fixes"];
        let count = |key: &str| f[key].as_u64().unwrap();
        assert!(count("in_holes") > 0);
        let fates = [
            "used",
            "refused",
            "forced",
            "withheld",
            "in_holes",
            "before_track",
            "after_track",
        ];
        assert_eq!(count("log"), fates.map(count).iter().sum::<u64>());
        let [n, hit] = inside(&ran, &reference);
        assert!(n > 90, "{n}");
        all = [all[0] + n, all[1] + hit];
    }
    let share = real(all[1]) / real(all[0]);
    println!(
        "a fix each 5 s, two holes in each of six drives: inside 95 %: {share:.3} of {}",
        all[0]
    );
    assert!((0.9..=1.0).contains(&share), "{share}");
}

#[test]
fn a_side_without_a_start_is_said_and_the_other_is_reckoned() {
    let dir = folder("gnss-holes-short");
    let [fixes, motions, reference] = logs(&dir, 90311);
    // Two seconds between two holes: no fix of theirs that moves is likely to have one after it; here none is theirs at all.
    let holes = [[1050.0, 1060.1], [1060.5, 1070.0]];
    let cut = without(&motions, &holes);
    let ran = run(
        &fixes,
        &cut,
        &["--every", "3", "--reference", text(&reference)],
    );
    assert_eq!(ran.done.status.code(), Some(3), "{}", stderr(&ran.done));
    assert!(
        notes(&ran).contains("no track from 1060."),
        "{}",
        notes(&ran)
    );
    assert!(ran.track.last().unwrap()[0] > 1190.0);
    // The page says it too.
    let page = std::fs::read_to_string(dir.join("out/report.html")).unwrap();
    assert!(page.contains("no track from 1060."));
    // The published filter has no clock: it goes on, and that is said.
    let ran = run(&fixes, &cut, &["--filter", "published"]);
    assert_eq!(ran.done.status.code(), Some(3), "{}", stderr(&ran.done));
    assert!(notes(&ran).contains("goes on as if that were no time"));
    // Many of them: some by name and the count of the others; before a track there is none to end.
    let many: Vec<[f64; 2]> = (0..14)
        .map(|i| 1002.0 + 13.0 * f64::from(i))
        .map(|t| [t, t + 6.0])
        .collect();
    let ran = run(&fixes, &without(&motions, &many), &[]);
    let said = notes(&ran);
    assert_eq!(ran.done.status.code(), Some(3), "{}", stderr(&ran.done));
    assert_eq!(
        said.matches("no inertial sample for 6.0 s").count(),
        if said.contains("no track from 1000.00") {
            11
        } else {
            12
        },
        "{said}"
    );
    assert!(said.contains(" more such holes"), "{said}");
}

#[test]
fn a_part_of_the_log_is_chosen_by_time() {
    let dir = folder("gnss-holes-part");
    let [fixes, motions, reference] = logs(&dir, 90312);
    let ran = run(&fixes, &motions, &["--from", "1080", "--to", "1150.5"]);
    assert_eq!(ran.done.status.code(), Some(0), "{}", stderr(&ran.done));
    let (first, last) = (ran.track[0][0], ran.track.last().unwrap()[0]);
    assert!(
        first >= 1080.0 && last <= 1150.5 && last > 1150.4,
        "{first} {last}"
    );
    assert_eq!(ran.summary["options"]["from_s"], 1080.0);
    assert_eq!(ran.summary["options"]["to_s"], 1150.5);
    let log = ran.summary["fixes"]["log"].as_u64().unwrap();
    assert!((70..=71).contains(&log), "{log}");
    for (more, expected) in [
        (["--from", "5000"], "expected rows from 5000 s to the end"),
        (["--to", "-3"], "expected rows from the begin to -3 s"),
        (
            ["--from", "NaN"],
            "expected seconds, the second after the first",
        ),
    ] {
        let ran = run(&fixes, &motions, &more);
        assert_eq!(ran.done.status.code(), Some(1));
        assert!(
            stderr(&ran.done).contains(expected),
            "{}",
            stderr(&ran.done)
        );
    }
    // Windows of an experiment need one drive: the error says how to have one.
    let holes = without(&motions, &[[1040.0, 1050.0]]);
    let out = dir.join("outages");
    let args = [
        "gnss",
        "outages",
        "--axes",
        "car",
        "--fixes",
        text(&fixes),
        "--motions",
        text(&holes),
        "--reference",
        text(&reference),
        "--lengths",
        "5",
        "--no-blind",
        "--filter",
        "refined",
        "--out",
        text(&out),
    ];
    let done = reconstruct(&args);
    assert_eq!(done.status.code(), Some(1));
    assert!(
        stderr(&done).contains("choose one with --from and --to"),
        "{}",
        stderr(&done)
    );
    let done = reconstruct(&[&args[..], &["--from", "1050"]].concat());
    assert_eq!(done.status.code(), Some(3), "{}", stderr(&done));
    // So is what `analyse` looks at.
    let stands = |more: &[&str]| -> Vec<[f64; 2]> {
        let mut args = vec!["gnss", "analyse", "--json", "--axes", "car"];
        args.extend(["--fixes", text(&fixes), "--motions", text(&motions)]);
        args.extend(more);
        let told: Value = serde_json::from_slice(&reconstruct(&args).stdout).unwrap();
        let list = told["situations"]["stands"].as_array().unwrap();
        let of = |s: &Value| ["from_s", "to_s"].map(|key| s[key].as_f64().unwrap());
        list.iter().map(of).collect()
    };
    let all = stands(&[]);
    assert!(all.len() > 1, "{all:?}");
    let [from, to] = [all[0][0] - 5.0, all[0][1] + 5.0].map(|t| t.to_string());
    let one = stands(&["--from", &from, "--to", &to]);
    assert!(
        one.len() == 1 && (one[0][0] - all[0][0]).abs() < 1.0,
        "{one:?} of {all:?}"
    );
}
