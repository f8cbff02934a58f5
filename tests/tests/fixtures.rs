//! The committed crash: replay gives the committed records, reconstruction the expected figures, twice the same bytes.
#![allow(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::print_stderr,
    reason = "tests"
)]

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use reconstruct::export::{ellipse, funnel, trajectory};
use reconstruct::findings::Reconstruction;
use reconstruct::report::case::{Case, Signature};
use reconstruct::report::pictures::Pictures;
use reconstruct::report::{page, summary};
use reconstruct::run::{Options, reconstruct};
use reconstruct::simulate::{Class, Scenario, simulate};
use recorder::config::Settings;
use recorder::replay::{LogInput, ReplayOptions, replay};
use schema::header::Layout;
use schema::seal::Hex;
use schema::{Record, num};
use serde_json::Value;
use sha2::{Digest, Sha256};

const LAYOUTS: [(&str, Layout); 2] = [
    ("oblique-1", Layout::Full),
    ("oblique-1-two-rate", Layout::TwoRate),
];

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures")
}

fn text(name: &str) -> String {
    fs::read_to_string(fixtures().join(name)).unwrap()
}

fn json(name: &str) -> Value {
    serde_json::from_str(&text(name)).unwrap()
}

/// The one record that a replay of the committed log seals.
fn replayed(config: &str) -> Record {
    let settings = Settings::load(&fixtures().join(format!("config/{config}.toml"))).unwrap();
    let log = LogInput::File(fixtures().join("can/oblique-1.log"));
    let records = RefCell::new(Vec::new());
    let options = ReplayOptions {
        sink: Some(Box::new(|record| {
            records.borrow_mut().push(record);
            Ok(())
        })),
        ..ReplayOptions::default()
    };
    assert!(replay(&settings, vec![log], options).unwrap().sound());
    let mut records = records.into_inner();
    assert_eq!(records.len(), 1);
    records.remove(0)
}

#[test]
fn replay_gives_the_committed_records_to_the_byte() {
    for (name, layout) in LAYOUTS {
        let committed = fs::read(fixtures().join(format!("record/{name}.svb"))).unwrap();
        let (before, _) = Record::read(&committed).unwrap();
        assert_eq!(before.header.layout, layout);
        let mut now = replayed(name);
        // The version of the program is the one thing a later version may write differently.
        now.header.software.clone_from(&before.header.software);
        assert_eq!(now.header, before.header, "{name}: header");
        assert!(now.blocks == before.blocks, "{name}: samples");
        assert_eq!(now.health, before.health, "{name}: health");
        assert!(now.to_bytes().unwrap() == committed, "{name}: bytes");
    }
}

#[test]
fn the_simulator_still_makes_the_committed_log() {
    let simulated = simulate(&Scenario::draw(Class::Oblique, 1)).unwrap();
    let (made, committed) = (simulated.candump(), text("can/oblique-1.log"));
    assert_eq!(made.lines().count(), committed.lines().count());
    // Another mathematics library may move a value across a rounding step, no more.
    let pairs = made.lines().zip(committed.lines());
    let differing = pairs.filter(|(a, b)| a != b).count();
    assert!(differing <= made.lines().count() / 1000, "{differing}");
    let dbc = simulated.dbc();
    assert_eq!(dbc, text("dbc/oblique-1.dbc"));
    assert_eq!(
        simulated.config("../dbc/oblique-1.dbc"),
        text("config/oblique-1.toml")
    );
}

/// Everything that a run writes, by name.
fn run(name: &str) -> (Reconstruction, Value, BTreeMap<&'static str, String>) {
    let file = format!("{name}.svb");
    let bytes = fs::read(fixtures().join("record").join(&file)).unwrap();
    let (record, seal) = Record::read(&bytes).unwrap();
    let case = Case {
        file: &file,
        bytes: bytes.len(),
        file_sha256: Sha256::digest(&bytes).into(),
        seal_sha256: Some(seal.sha256),
        signature: Signature::Unsigned,
        damage: &[],
        record: &record,
    };
    let result = reconstruct(&record, &Options::default()).unwrap();
    let outline = ellipse::outline(&result.states, None, result.confidence);
    let pictures = Pictures::draw(&result, &outline);
    let summary = summary::summary(&result, &case);
    let files = BTreeMap::from([
        ("trajectory.csv", trajectory::csv(&result.states)),
        ("summary.json", format!("{summary:#}\n")),
        ("funnel", funnel::collection(&result, &outline).to_string()),
        ("path.svg", pictures.path_file()),
        ("motion.svg", pictures.motion_file()),
        ("report.html", page::html(&result, &case, &pictures)),
    ]);
    (result, summary, files)
}

#[test]
fn reconstruction_gives_the_expected_figures() {
    let expected = json("expected/oblique-1.figures.json");
    for (name, _) in LAYOUTS {
        let (_, summary, _) = run(name);
        let mut wrong = String::new();
        for (figure, pair) in expected.as_object().unwrap() {
            let (value, tolerance) = (pair[0].as_f64().unwrap(), pair[1].as_f64().unwrap());
            let found = summary.pointer(figure).and_then(Value::as_f64);
            if found.is_none_or(|found| (found - value).abs() > tolerance) {
                writeln!(
                    wrong,
                    "{figure}: expected {value} +- {tolerance}, found {found:?}"
                )
                .unwrap();
            }
        }
        assert!(wrong.is_empty(), "{name}:\n{wrong}");
        assert_eq!(summary["sound"], true, "{name}");
    }
}

#[test]
fn the_true_figures_lie_within_the_stated_bounds() {
    let facts = json("expected/oblique-1.facts.json");
    let impact = &facts["impacts"][0];
    for (name, _) in LAYOUTS {
        let (_, summary, _) = run(name);
        for (path, truth) in [
            ("/impact/speed", &impact["speed_mps"]),
            ("/impact/heading", &impact["heading_deg"]),
            ("/delta_v/longitudinal", &impact["cg"]["longitudinal_mps"]),
            ("/delta_v/lateral", &impact["cg"]["lateral_mps"]),
            ("/delta_v/resultant", &impact["cg"]["resultant_mps"]),
            ("/delta_v/pdof", &impact["cg"]["pdof_deg"]),
        ] {
            let unit = if path.ends_with("heading") || path.ends_with("pdof") {
                "deg"
            } else {
                "mps"
            };
            let of = |bound| summary.pointer(&format!("{path}_{bound}_{unit}"));
            let [low, high] = ["low", "high"].map(|bound| of(bound).unwrap().as_f64().unwrap());
            let truth = truth.as_f64().unwrap();
            assert!(
                (low..=high).contains(&truth),
                "{name}: {path}: {truth} outside {low} to {high}"
            );
        }
    }
}

#[test]
fn the_start_of_the_path_is_where_the_car_was() {
    let truth = text("expected/oblique-1.truth.csv");
    let mut lines = truth
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let columns = ["unix_s", "north_m", "east_m"]
        .map(|name| head.iter().position(|column| *column == name).unwrap());
    let rows: Vec<[f64; 3]> = lines
        .map(|row| columns.map(|column| row[column].parse().unwrap()))
        .collect();
    for (name, _) in LAYOUTS {
        let (result, _, _) = run(name);
        let state = &result.states[0];
        let unix_s = num::real_i64(state.utc_ns.unwrap()) * 1e-9;
        let after = rows.iter().position(|row| row[0] >= unix_s).unwrap();
        let (a, b) = (rows[after - 1], rows[after]);
        let share = (unix_s - a[0]) / (b[0] - a[0]);
        let off = [0, 1]
            .map(|axis| state.position[axis] - (a[axis + 1] + share * (b[axis + 1] - a[axis + 1])));
        let off = off[0].hypot(off[1]);
        let percent = 100.0 * off / result.distance_m.value;
        eprintln!(
            "{name}: {off:.2} m off at t = {:.1} s, {percent:.2} %",
            state.t_s
        );
        assert!(percent < 1.0, "{name}: {off:.2} m, {percent:.2} %");
    }
}

#[test]
fn twice_the_same_bytes() {
    for (name, _) in LAYOUTS {
        let ((_, _, first), (_, _, second)) = (run(name), run(name));
        for (file, text) in &first {
            assert!(second[file] == *text, "{name}: {file} differs");
        }
    }
}

#[test]
fn the_digests_in_the_readme_are_true() {
    let readme = text("README.md");
    let mut listed = BTreeSet::new();
    for line in readme.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line
            .split('|')
            .map(|cell| cell.trim().trim_matches('`'))
            .collect();
        let bytes = fs::read(fixtures().join(cells[1])).unwrap();
        assert_eq!(cells[2], bytes.len().to_string(), "{line}");
        assert_eq!(cells[3], Hex(&Sha256::digest(&bytes)).to_string(), "{line}");
        listed.insert(cells[1].to_owned());
    }
    let mut present = BTreeSet::new();
    for folder in ["can", "dbc", "config", "record", "expected"] {
        for entry in fs::read_dir(fixtures().join(folder)).unwrap() {
            let name = entry.unwrap().file_name();
            present.insert(format!("{folder}/{}", name.to_string_lossy()));
        }
    }
    assert_eq!(listed, present);
}

#[test]
fn a_reader_in_another_language_reads_the_committed_records() {
    // Value by value in python_reader.rs; here that it meets these records at all.
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("reader.py");
    for (name, _) in LAYOUTS {
        let path = fixtures().join(format!("record/{name}.svb"));
        let (record, seal) = Record::read(&fs::read(&path).unwrap()).unwrap();
        let output = Command::new("python3")
            .arg(&script)
            .arg(&path)
            .output()
            .unwrap();
        let read: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(read["sha256"], Hex(&seal.sha256).to_string(), "{name}");
        let blocks = read["blocks"].as_array().unwrap();
        assert_eq!(blocks.len(), record.blocks.len(), "{name}");
    }
}
