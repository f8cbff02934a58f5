//! The pictures and pages of `reconstruct gnss`, and what they say.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::panic,
    reason = "a test fails by panicking and prints what it measured"
)]

mod support;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use reconstruct::gnss::drive::{Drive, Fixed};
use reconstruct::gnss::forward::{Estimate, Fate};
use reconstruct::gnss::pictures::{self, Shot, Shown, page};
use reconstruct::gnss::reference::{Reference, compare};
use reconstruct::gnss::stands;
use reconstruct::gnss::{experiments, trial};
use reconstruct::simulate::city::{self, BoxSheet};
use schema::num::real;
use support::{folder, gnss_logs, reconstruct, stderr, stdout};

/// Elements of a text that an XML parser reads to its end.
fn elements(text: &str) -> usize {
    let mut reader = quick_xml::Reader::from_str(text);
    reader.config_mut().check_end_names = true;
    let mut count = 0;
    loop {
        match reader.read_event() {
            Ok(quick_xml::events::Event::Eof) => return count,
            Ok(_) => count += 1,
            Err(error) => panic!("{error} at {}", reader.error_position()),
        }
    }
}

fn gnss(command: &str, logs: &[PathBuf], out: &Path, more: &[&str]) -> std::process::Output {
    let mut args = vec!["gnss", command, "--out", out.to_str().unwrap()];
    for (name, path) in ["--fixes", "--motions", "--reference"].iter().zip(logs) {
        args.extend([name, path.to_str().unwrap()]);
    }
    args.extend(more);
    reconstruct(&args)
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn a_drive_is_drawn_with_and_without_a_reference() {
    let dir = folder("gnss-pictures");
    let files = gnss_logs(&dir, "90023", &[]);
    // A name that would be a tag.
    let hostile = dir.join("<b>&\"x.txt");
    std::fs::copy(&files[2], &hostile).unwrap();
    let with = [files[0].clone(), files[1].clone(), hostile];
    for filter in ["refined", "published"] {
        let [a, b] = ["a", "b"].map(|n| dir.join(format!("{filter}-{n}")));
        for out in [&a, &b] {
            let done = gnss("run", &with, out, &["--filter", filter, "--every", "5"]);
            assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
            assert!(stdout(&done).contains("variance test of S00"));
        }
        let report = text(&a.join("report.html"));
        assert!(report.contains("&lt;b&gt;&amp;") && !report.contains("<b>"));
        assert!(!report.contains("<script") && !report.contains("NaN"));
        assert_eq!(report, text(&b.join("report.html")));
        assert!(report.contains("standard error") && report.contains("before the track begins"));
        assert!(!report.contains(">1 outages"));
        for name in [
            "plan",
            "plan-close",
            "deviation",
            "motion",
            "stops",
            "biases",
        ] {
            let file = format!("pictures/{name}.svg");
            let svg = text(&a.join(&file));
            assert_eq!(svg, text(&b.join(&file)), "{name}");
            assert!(elements(&svg) > 30 && !svg.contains("NaN"), "{name}");
        }
        let summary: serde_json::Value =
            serde_json::from_str(&text(&a.join("summary.json"))).unwrap();
        let rows = summary["stop_errors"].as_array().unwrap();
        assert_eq!(rows.len(), 3);
        for row in rows {
            let rate = row["missed_in_100_s"].as_array().unwrap();
            let [value, low, high] = [0, 1, 2].map(|i| rate[i].as_f64().unwrap());
            assert!(low <= value && value < high);
        }
    }
    let out = dir.join("alone");
    let done = gnss("run", &files[..2], &out, &[]);
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    assert!(!out.join("pictures/deviation.svg").exists());
    let report = text(&out.join("report.html"));
    assert!(report.contains("Cannot tell: without a reference receiver"));
}

#[test]
fn outages_are_measured_and_drawn() {
    let dir = folder("gnss-outages");
    let files = gnss_logs(&dir, "90024", &[]);
    let out = dir.join("out");
    let done = gnss("outages", &files, &out, &["--json"]);
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    let told: serde_json::Value = serde_json::from_str(&stdout(&done)).unwrap();
    let mean = |i: usize| told["rows"][i]["at_ends_m"]["mean"].as_f64().unwrap();
    // Five experiments and one with exact speed, each by three.
    assert_eq!(told["rows"].as_array().unwrap().len(), 18);
    for i in 0..5 {
        println!(
            "{}: published {:.1} ours {:.1}",
            told["rows"][3 * i]["experiment"],
            mean(3 * i),
            mean(3 * i + 1)
        );
        assert!(mean(3 * i + 1) < mean(3 * i));
    }
    assert!(elements(&text(&out.join("pictures/outages.svg"))) > 100);
    let html = text(&out.join("outages.html"));
    assert!(html.contains("about 20") && html.contains(" % of "));
    // An error is not shown as none.
    assert!(!html.contains("\u{b1} 0.0<"));
    // Without a reference nothing can be told; a drive too short for a length says so.
    let alone = gnss("outages", &files[..2], &out, &[]);
    assert!(alone.status.code() == Some(1) && stderr(&alone).contains("--reference"));
    let long = gnss(
        "outages",
        &files,
        &out,
        &["--lengths", "5,400", "--no-blind"],
    );
    assert_eq!(long.status.code(), Some(3), "{}", stderr(&long));
    assert!(stderr(&long).contains("a fix each 400 s: not done"));
    let wrong = gnss("outages", &files, &out, &["--lengths", "0"]);
    assert!(wrong.status.code() == Some(1) && stderr(&wrong).contains("--lengths"));
}

#[test]
fn experiments_have_a_page() {
    let dir = folder("gnss-experiments-page");
    let to = dir.to_str().unwrap();
    let done = reconstruct(&["gnss", "experiments", "--seeds", "3..3", "--out", to]);
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    let html = text(&dir.join("experiments.html"));
    assert!(html.contains("120 s without fixes") && html.contains("<svg"));
}

/// Three hours at 50 Hz: the simulated drive again and again.
#[test]
fn long_logs_give_small_pictures_that_keep_the_extremes() {
    let sheet = BoxSheet::default();
    let city = city::drive(5, 200.0, &sheet).unwrap();
    let once = experiments::drive(&city, &sheet).unwrap();
    let length = once.periods[once.periods.len() - 1].t_s;
    let known = reconstruct::gnss::sheet::Sheet::default();
    let passed = trial::ours(&once, &known, None).unwrap();
    let (mut drive, mut track, mut shots) = (Drive::default(), Vec::new(), Vec::new());
    let mut reference = Reference::default();
    for round in 0..54 {
        let later = length * real(round);
        // Each round a few kilometres on, so that lines fill the picture.
        let moved = Vector3::new(300.0 * real(round % 7), 500.0 * real(round), 0.0);
        drive.periods.extend(
            once.periods
                .iter()
                .map(|p| reconstruct::gnss::drive::Period {
                    t_s: p.t_s + later,
                    ..*p
                }),
        );
        track.extend(passed.estimates.iter().map(|e| Estimate {
            t_s: e.t_s + later,
            place: e.place.moved(&moved),
            ..*e
        }));
        let fate = [Some(Fate::Used), Some(Fate::Refused), None][round % 3];
        shots.extend(once.fixes.iter().map(|f| Shot {
            fix: Fixed {
                t_s: f.t_s + later,
                place: f.place.moved(&moved),
                ..*f
            },
            fate,
        }));
        reference
            .marks
            .extend(Reference::of_truth(&city).marks.iter().map(|m| {
                reconstruct::gnss::reference::Mark {
                    t_s: m.t_s + later,
                    place: m.place.moved(&moved),
                    ..*m
                }
            }));
    }
    let middle = track.len() / 2;
    track[middle].v_n = Vector3::new(98.7, 0.0, 0.0);
    let found = stands::detectors(&drive, &[]);
    let counts = [stands::count(&drive, &found[0], &reference)];
    let outages = pictures::outages(&track, &shots);
    let seconds = compare(&track, &reference);
    let shown = Shown {
        filter: "ours",
        track: &track,
        shots: &shots,
        drive: &drive,
        found: &found,
        reference: &reference,
        seconds: &seconds,
        counts: &counts,
        outages: &outages,
    };
    let list = pictures::all(&shown);
    for (name, _, svg) in &list {
        println!("{name}: {} samples, {} kB", track.len(), svg.len() / 1000);
        assert!(svg.len() < 1_000_000 && elements(svg) > 30, "{name}");
    }
    // The spike of one sample is the top of the speed's scale.
    let motion = &list.iter().find(|l| l.0 == "motion").unwrap().2;
    assert!(motion.contains(">80</text>"));
    assert!(page::drive(&shown, &list, &page::Told::default()).len() < 3_000_000);
}
