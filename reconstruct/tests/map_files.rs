//! Map files from outside: damaged ones give a value or an error, and the command line says where.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

mod support;
#[allow(dead_code, reason = "shared with the tests of the fit")]
#[path = "support/world.rs"]
mod world;

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reconstruct::map::roads::Roads;
use reconstruct::simulate::Class;
use serde_json::Value;
use support::json_schema::violations;
use support::{crash, folder, reconstruct, stderr, stdout};

const GEOJSON: &str = r#"{"type":"FeatureCollection","features":[
{"type":"Feature","properties":{"name":"Fv 40","lanes":"2","oneway":"no"},"geometry":
{"type":"LineString","coordinates":[[10.7,59.9],[10.701,59.901],[10.703,59.9022]]}},
{"type":"Feature","properties":null,"geometry":{"type":"GeometryCollection","geometries":[
{"type":"MultiLineString","coordinates":[[[10.7,59.9],[10.71,59.91]]]},{"type":"Point","coordinates":[1,2]}]}}]}"#;
const OSM: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<osm version="0.6"><bounds minlat="59.8" minlon="10.6" maxlat="60" maxlon="11"/>
<node id="1" lat="59.9" lon="10.7"/><node id="2" lat="59.901" lon="10.701"/><node id="3" lat="59.903" lon="10.7"/>
<way id="10"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="highway" v="residential"/>
<tag k="name" v="S&#248;r &amp; Nord"/><tag k="oneway" v="-1"/><tag k="width" v="5.5 m"/></way></osm>"#;

fn mutated(text: &str, rng: &mut ChaCha8Rng) -> Vec<u8> {
    const WORDS: [&str; 12] = [
        "1e999", "-", "[", "]", "{", "\"", "<way>", "</osm>", "<!--", "&x;", "NaN", "\u{0}",
    ];
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..rng.random_range(1..5) {
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..5) {
            0 => bytes[at] ^= 1 << rng.random_range(0..8),
            1 => {
                let end = (at + rng.random_range(1..30)).min(bytes.len());
                bytes.drain(at..end);
            }
            2 => {
                let word = WORDS[rng.random_range(0..WORDS.len())];
                bytes.splice(at..at, word.bytes());
            }
            3 => {
                let end = (at + rng.random_range(1..60)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            _ => bytes[at] = b'0' + rng.random_range(0..10_u8),
        }
        if bytes.is_empty() {
            bytes.push(b'{');
        }
    }
    bytes
}

/// `MUTATIONS=1000000` runs as many as it says.
#[test]
fn mutated_maps_give_a_value_or_an_error() {
    let count = std::env::var("MUTATIONS").map_or(40_000, |n| n.parse().unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(40);
    let (mut read, mut refused) = (0_u32, 0_u32);
    for i in 0..count {
        let text = if i % 2 == 0 { GEOJSON } else { OSM };
        match Roads::read("map", &mutated(text, &mut rng)) {
            Ok(roads) => {
                read += 1;
                for line in &roads.lines {
                    assert!(line.line.len() > 1);
                    assert!(line.line.iter().flatten().all(|x| x.abs() <= 180.0));
                }
            }
            Err(what) => {
                refused += 1;
                assert!(!what.is_empty());
            }
        }
    }
    println!("{count} mutated maps: {read} read, {refused} refused");
    assert!(read > 1000 && refused > 1000);
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn files() -> (PathBuf, PathBuf) {
    let dir = folder("map-files");
    let record = dir.join("crash.svb");
    std::fs::write(&record, crash(Class::Frontal, 22).1.to_bytes().unwrap()).unwrap();
    (dir, record)
}

#[test]
fn the_command_line_says_what_is_wrong_and_writes_the_block() {
    let (dir, record) = files();
    let out = dir.join("out");
    let run = |extra: &[&str]| {
        let result = reconstruct(
            &[
                &["run", text(&record), "--out", text(&out), "--json"],
                extra,
            ]
            .concat(),
        );
        assert!(!stderr(&result).contains("panicked"), "{}", stderr(&result));
        (result.status.code(), stderr(&result), stdout(&result))
    };
    let map = dir.join("map.osm");
    std::fs::write(&map, OSM).unwrap();
    let broken = dir.join("broken.json");
    std::fs::write(&broken, &GEOJSON[..200]).unwrap();
    let (map, broken) = (text(&map), text(&broken));
    for usage in [
        &["--map", map][..],
        &["--rest-point=59.9,10.7"],
        &["--map", map, "--rest-point=95,0"],
        &["--map", map, "--rest-point=59.9,10.7,0"],
        &["--map", map, "--rest-point=59.9,10.7", "--traffic=up"],
        &["--map", map, "--rest-point=59.9,10.7", "--rest-heading=x"],
        &[
            "--map",
            map,
            "--rest-point=59.9,10.7",
            "--rest-pose=59.9,10.7,0",
        ],
    ] {
        assert_eq!(run(usage).0, Some(2), "{usage:?}");
    }
    for (file, point, want) in [
        ("no-such-map.json", "59.9,10.7", "no-such-map.json"),
        (broken, "59.9,10.7", "line 3"),
        (map, "-59.9,-10.7", "no road lies within"),
        (text(&dir), "59.9,10.7", "error: map"),
    ] {
        let (code, message, _) = run(&["--map", file, "--rest-point", point]);
        assert_eq!(code, Some(1), "{message}");
        assert!(message.contains(want), "{message}");
    }
    // A few hundred metres of other roads: the path fits nowhere, and the summary says so.
    let (code, message, printed) = run(&[
        "--map",
        map,
        "--rest-point=59.9,10.7,20",
        "--rest-heading=-10",
    ]);
    assert!(matches!(code, Some(0 | 3)), "{message}");
    let schema: Value = serde_json::from_str(&stdout(&reconstruct(&["schema"]))).unwrap();
    let file = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&file).unwrap();
    assert_eq!(violations(&schema, &summary), Vec::<String>::new());
    let printed: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(printed["map"], summary["map"]);
    assert_ne!(summary["map"]["verdict"], "placed");
    assert!(summary["map"]["fit"].is_null());
    assert!(summary["limits"][0].as_str().unwrap().contains("map"));
    assert!(out.join("funnel.local.json").is_file());
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("Where on the map") && page.contains("map.osm"));
}

/// A place that is found: on the earth in every file, and the same bytes again.
#[test]
fn a_placed_path_stands_on_the_earth_in_every_file() {
    let dir = folder("map-placed");
    let (simulated, record) = crash(Class::Rear, 5);
    let path = dir.join("crash.svb");
    std::fs::write(&path, record.to_bytes().unwrap()).unwrap();
    let mut draw = world::Draw::new(1);
    let road = world::centre_line(&world::driven(&simulated), 1.9, 0.7, &mut draw);
    let turned = world::moved(&road, 2.0, nalgebra::Vector2::new(11.0, -8.0));
    let plane = reconstruct::export::geodesy::TangentPlane::at(&world::pose(-33.86, 151.2));
    let line = &world::on_earth(&[turned], &plane)[0].line;
    let points: Vec<[f64; 2]> = line.iter().map(|p| [p[1], p[0]]).collect();
    let map = dir.join("road.json");
    let geometry = serde_json::json!({"type": "LineString", "coordinates": points});
    let feature = serde_json::json!({"type": "Feature", "properties": {"name": "<b>Rd"}, "geometry": geometry});
    std::fs::write(&map, feature.to_string()).unwrap();
    let run = |name: &str| {
        let out = dir.join(name);
        let place = "--rest-point=-33.86,151.2,25";
        let result = reconstruct(&[
            "run",
            text(&path),
            "--out",
            text(&out),
            "--map",
            text(&map),
            place,
            "--rest-heading=115,30",
        ]);
        assert!(
            matches!(result.status.code(), Some(0 | 3)),
            "{}",
            stderr(&result)
        );
        assert!(
            stdout(&result).contains("On the map"),
            "{}",
            stdout(&result)
        );
        assert!(stdout(&result).lines().count() <= 24);
        out
    };
    let out = run("a");
    let schema: Value = serde_json::from_str(&stdout(&reconstruct(&["schema"]))).unwrap();
    let file = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&file).unwrap();
    assert_eq!(violations(&schema, &summary), Vec::<String>::new());
    let map = &summary["map"];
    assert_eq!(map["verdict"], "placed", "{map}");
    let number = |name: &str| map["fit"][name].as_f64().unwrap();
    let truth = 2.0_f64.to_degrees();
    assert!((number("heading_deg") - truth).abs() < 3.0, "{map}");
    assert!(number("heading_low_deg") < number("heading_high_deg"));
    let [north, east] = plane.north_east(number("latitude_deg"), number("longitude_deg"));
    assert!((north - 11.0).hypot(east + 8.0) < 15.0, "{north} {east}");
    let pose = &summary["rest"]["pose"]["heading_deg"];
    assert!((pose.as_f64().unwrap() - number("heading_deg")).abs() < 1e-6);
    assert!(out.join("funnel.geojson").is_file());
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("&lt;b&gt;Rd") && !page.contains("<b>Rd"));
    let again = run("b");
    for name in [
        "summary.json",
        "funnel.geojson",
        "report.html",
        "trajectory.csv",
    ] {
        let bytes = |dir: &Path| std::fs::read(dir.join(name)).unwrap();
        assert_eq!(bytes(&out), bytes(&again), "{name}");
    }
}
