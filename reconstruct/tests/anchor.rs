//! Satellite fixes in a record lay the path on the earth: truth inside the bounds over many crashes and faults of receivers.
//!
//! The figures were set on seeds 1 to 20; these are others.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use std::path::Path;
use std::process::Command;

use nalgebra::{Matrix2, Vector2};
use reconstruct::export::geodesy::TangentPlane;
use reconstruct::findings::{Reconstruction, RestPose};
use reconstruct::map::place;
use reconstruct::run::{Options, reconstruct};
use reconstruct::simulate::fixes::{Received, Receiver};
use reconstruct::simulate::{Class, Scenario, Simulated, simulate};
use reconstruct::validate::record::{since_trigger, with_fixes};
use schema::Record;
use schema::num::real;

const CLASSES: [Class; 5] = [
    Class::Frontal,
    Class::Oblique,
    Class::Side,
    Class::Rear,
    Class::Roof,
];

fn alone() -> Options {
    Options {
        alone: true,
        ..Options::default()
    }
}

fn crash(
    class: Class,
    seed: u64,
    receiver: &Receiver,
    cut_s: Option<f64>,
) -> (Simulated, Record, Received) {
    let simulated = simulate(&Scenario::draw(class, seed)).unwrap();
    let header = simulated.scenario.header();
    let (record, received) = with_fixes(&simulated, header, cut_s, receiver, seed);
    (simulated, record, received)
}

fn laid(record: &Record, options: &Options) -> Reconstruction {
    let mut r = reconstruct(record, options).unwrap();
    place::lay(&mut r);
    r
}

/// Squared errors over their variances: of a place on the earth (two degrees of freedom) and of a heading.
struct Score {
    name: &'static str,
    places: Vec<f64>,
    headings: Vec<f64>,
    off_m: Vec<f64>,
}

impl Score {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            places: Vec::new(),
            headings: Vec::new(),
            off_m: Vec::new(),
        }
    }

    fn add(
        &mut self,
        simulated: &Simulated,
        record: &Record,
        truth: &RestPose,
        r: &Reconstruction,
    ) {
        let pose = r.gnss.as_ref().unwrap().pose.as_ref();
        let pose = pose.map(|p| p.rest).unwrap();
        let (true_plane, plane) = (TangentPlane::at(truth), TangentPlane::at(&pose));
        let rows = &simulated.truth.rows;
        let turn = truth.heading_deg.to_radians();
        for from in [-25.0, -10.0, -1.0, 1e9] {
            let at = r.states.partition_point(|s| s.t_s < from);
            let state = &r.states[at.min(r.states.len() - 1)];
            let log_s = state.t_s - since_trigger(record, 0.0);
            let k = rows.partition_point(|x| x.t_s < log_s - 1e-6);
            let row = &rows[k.min(rows.len() - 1)];
            let (s, c) = turn.sin_cos();
            let [n, e, _] = row.position;
            let there = Vector2::new(c * n - s * e, s * n + c * e);
            let [longitude, latitude] = plane.lon_lat(state.position[0], state.position[1]);
            let here = Vector2::from(true_plane.north_east(latitude, longitude));
            let on = state.on_earth.unwrap();
            let cross = state.cov_north_east + on[2];
            let covariance = Matrix2::new(
                state.sd_north.powi(2) + on[0],
                cross,
                cross,
                state.sd_east.powi(2) + on[1],
            );
            let off = here - there;
            let inverse = covariance.try_inverse().unwrap();
            self.places.push(off.dot(&(inverse * off)));
            self.off_m.push(off.norm());
            let heading = (state.heading - row.heading - turn + 3.0 * std::f64::consts::PI)
                .rem_euclid(std::f64::consts::TAU)
                - std::f64::consts::PI;
            self.headings.push((heading / state.sd_heading).powi(2));
        }
    }

    /// Shares inside the 95 % bounds, and mean squares over degrees of freedom.
    fn hold(&self, least: f64) {
        let share = |all: &[f64], most: f64| {
            real(all.iter().filter(|q| **q < most).count()) / real(all.len())
        };
        let mean = |all: &[f64]| all.iter().sum::<f64>() / real(all.len());
        let (places, headings) = (share(&self.places, 5.991), share(&self.headings, 3.841));
        let (place, heading) = (0.5 * mean(&self.places), mean(&self.headings));
        let mut off = self.off_m.clone();
        off.sort_by(f64::total_cmp);
        println!(
            "{}: {} places, inside {places:.3} and {headings:.3}, NEES {place:.2} and {heading:.2}, off {:.2} m (median)",
            self.name,
            off.len(),
            off[off.len() / 2]
        );
        assert!(places > least && headings > least, "{}", self.name);
        assert!(
            (0.2..1.5).contains(&place) && (0.4..1.5).contains(&heading),
            "{}",
            self.name
        );
    }
}

fn score(
    name: &'static str,
    seeds: std::ops::RangeInclusive<u64>,
    receiver: &Receiver,
    cut_s: Option<f64>,
) -> Score {
    let mut score = Score::new(name);
    for seed in seeds {
        for class in CLASSES {
            let (simulated, record, received) = crash(class, seed, receiver, cut_s);
            let r = laid(&record, &alone());
            score.add(&simulated, &record, &received.pose, &r);
        }
    }
    score
}

#[test]
fn the_truth_lies_inside_the_bounds_on_the_earth() {
    score(
        "a fix a second",
        90_001..=90_012,
        &Receiver::default(),
        None,
    )
    .hold(0.9);
}

#[test]
fn so_it_does_with_every_fault_of_a_receiver() {
    let faults = [
        (
            "one in ten wild",
            Receiver {
                wild: 0.1,
                ..Receiver::default()
            },
        ),
        (
            "ten a second",
            Receiver {
                rate_hz: 10.0,
                ..Receiver::default()
            },
        ),
        (
            "one in five seconds, no spread stated",
            Receiver {
                rate_hz: 0.2,
                states_spread: false,
                ..Receiver::default()
            },
        ),
        (
            "antenna lost in the impact, tunnel before it",
            Receiver {
                torn: true,
                tunnel_s: Some([10.0, 9.0]),
                ..Receiver::default()
            },
        ),
    ];
    for (name, receiver) in faults {
        score(name, 90_021..=90_024, &receiver, None).hold(0.85);
    }
}

#[test]
fn a_record_that_was_cut_in_the_crash_is_laid_too() {
    score("cut", 90_031..=90_034, &Receiver::default(), Some(0.2)).hold(0.88);
}

#[test]
fn fixes_make_a_cut_record_surer_than_it_is_alone() {
    let mut better = 0;
    for seed in 90_041..=90_044 {
        let (_, record, _) = crash(Class::Frontal, seed, &Receiver::default(), Some(0.2));
        let with = laid(&record, &alone());
        let without = laid(
            &record,
            &Options {
                fixes: false,
                ..alone()
            },
        );
        assert!(without.gnss.is_none() && without.rest_pose.is_none());
        let [a, b] = [&with, &without].map(|r| r.states[0].sd_north.hypot(r.states[0].sd_east));
        better += usize::from(a < 0.5 * b);
    }
    assert!(better >= 3, "{better}");
}

#[test]
fn what_the_fixes_can_not_tell_is_said() {
    let (_, mut record, _) = crash(Class::Frontal, 90_051, &Receiver::default(), None);
    let sound = record.gnss.clone().unwrap();
    let why = |record: &Record| {
        let r = laid(record, &alone());
        let gnss = r.gnss.as_ref().unwrap();
        assert!(gnss.pose.is_none() && r.rest_pose.is_none());
        let why = gnss.why.clone().unwrap();
        assert!(r.limits.iter().any(|l| l.contains(&why)), "{:?}", r.limits);
        why
    };
    let gnss = record.gnss.as_mut().unwrap();
    gnss.fixes.clear();
    assert!(why(&record).contains("0 of 0"));
    // All from where the car stands: no heading.
    let gnss = record.gnss.as_mut().unwrap();
    let last = sound.fixes.last().unwrap().clone();
    gnss.fixes = (0..6)
        .map(|i| schema::gnss::Fix {
            monotonic_ns: last.monotonic_ns - 1_000_000_000 * (6 - i),
            speed_mps: Some(0.0),
            ..last.clone()
        })
        .collect();
    let reason = why(&record);
    assert!(
        reason.contains("heading") || reason.contains("agree"),
        "{reason}"
    );
    // Positions of another drive.
    let gnss = record.gnss.as_mut().unwrap();
    gnss.fixes = sound.fixes.clone();
    for (i, fix) in gnss.fixes.iter_mut().enumerate() {
        fix.position = fix.position.map(|[a, b]| {
            [
                a + 1e-4 * (real(i) * 1.7).sin(),
                b - 1e-4 * (real(i) * 0.9).cos(),
            ]
        });
        fix.speed_mps = None;
        fix.horizontal_m2 = Some([4.0, 4.0, 0.0]);
    }
    let r = laid(&record, &alone());
    let gnss = r.gnss.as_ref().unwrap();
    assert!(gnss.pose.is_none() || gnss.scale > 5.0, "{:?}", gnss.scale);
}

#[test]
fn a_pose_measured_at_the_scene_and_fixes_go_together() {
    let (_, record, received) = crash(Class::Side, 90_061, &Receiver::default(), None);
    let measured = RestPose {
        sd_m: 0.3,
        sd_deg: 0.5,
        ..received.pose
    };
    let r = laid(
        &record,
        &Options {
            rest_pose: Some(measured),
            ..alone()
        },
    );
    let pose = r.gnss.as_ref().unwrap().pose.as_ref().unwrap();
    assert!(pose.rest.sd_m <= 0.301 && pose.rest.sd_deg <= 0.501);
    let off = TangentPlane::at(&received.pose)
        .north_east(pose.rest.latitude_deg, pose.rest.longitude_deg);
    assert!(off[0].hypot(off[1]) < 1.0, "{off:?}");
}

#[test]
fn the_clock_of_the_fixes_replaces_one_whose_error_cannot_be_told() {
    let receiver = Receiver {
        clock_off_s: Some(3.0),
        ..Receiver::default()
    };
    let (_, mut record, _) = crash(Class::Rear, 90_071, &receiver, None);
    record.header.clock.uncertainty_ns = None;
    let plain = laid(
        &record,
        &Options {
            fixes: false,
            ..alone()
        },
    );
    let r = laid(&record, &alone());
    let gnss = r.gnss.as_ref().unwrap();
    let [off, sd] = gnss.clock_off_s.unwrap();
    assert!(
        gnss.clock_used && (off - 3.0).abs() < 4.0 * sd && sd < 0.1,
        "{off} {sd}"
    );
    let moved = r.states[0].utc_ns.unwrap() - plain.states[0].utc_ns.unwrap();
    assert!((schema::num::real_i64(moved) * 1e-9 - off).abs() < 1e-6);
    // A clock that is known to be good stays.
    record.header.clock.uncertainty_ns = Some(1_000);
    let r = laid(&record, &alone());
    assert!(!r.gnss.as_ref().unwrap().clock_used);
    assert!(
        r.limits.iter().any(|l| l.contains("differ by")),
        "{:?}",
        r.limits
    );
}

#[test]
fn the_command_writes_a_funnel_on_the_earth_and_says_what_became_of_the_fixes() {
    let receiver = Receiver {
        wild: 0.05,
        clock_off_s: Some(1.5),
        ..Receiver::default()
    };
    let (_, mut record, received) = crash(Class::Oblique, 90_081, &receiver, None);
    record.header.origin = schema::header::Origin::Live;
    record.header.clock.uncertainty_ns = None;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("anchor");
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("fixes.svb");
    std::fs::write(&file, record.to_bytes().unwrap()).unwrap();
    let run = |extra: &[&str], out: &str| {
        let out = folder.join(out);
        let output = Command::new(env!("CARGO_BIN_EXE_reconstruct"))
            .args([
                "run".as_ref(),
                file.as_os_str(),
                "--out".as_ref(),
                out.as_os_str(),
            ])
            .args(extra)
            .output()
            .unwrap();
        assert!(
            matches!(output.status.code(), Some(0 | 3)),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let text = std::fs::read_to_string(out.join("summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
        (out, summary, String::from_utf8(output.stdout).unwrap())
    };
    let (out, summary, screen) = run(&[], "with");
    assert!(out.join("funnel.geojson").is_file() && !out.join("funnel.local.json").exists());
    assert!(screen.contains("On the earth"), "{screen}");
    assert_eq!(summary["fixes"]["placed"], true);
    assert!(summary["fixes"]["used"].as_u64().unwrap() > 20);
    let pose = &summary["rest"]["pose"];
    let off = TangentPlane::at(&received.pose).north_east(
        pose["latitude_deg"].as_f64().unwrap(),
        pose["longitude_deg"].as_f64().unwrap(),
    );
    assert!(off[0].hypot(off[1]) < 8.0, "{off:?}");
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("Satellite fixes") && page.contains("true north"));
    let (out, summary, _) = run(&["--no-fixes"], "without");
    assert!(out.join("funnel.local.json").is_file() && summary["fixes"].is_null());
}
