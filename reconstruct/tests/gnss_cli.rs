//! `reconstruct gnss` as a person and a script meet it.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured"
)]

mod support;

use std::path::Path;

use reconstruct::gnss::logs::place;
use reconstruct::gnss::read::{Tolerance, read_fixes};
use reconstruct::wgs84::Geodetic;
use schema::num::real;
use support::{folder, reconstruct, stderr, stdout};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Mean horizontal deviation of a track from the reference at the reference's seconds, m, and the seconds compared.
fn deviation(track: &Path, reference: &Path) -> (f64, usize) {
    let rows = read_fixes(
        std::fs::read_to_string(reference).unwrap().as_bytes(),
        "reference",
        Tolerance::Strict,
    )
    .unwrap()
    .rows;
    let table = std::fs::read_to_string(track).unwrap();
    let mut sum = 0.0;
    let mut count = 0;
    for line in table.lines().skip(1) {
        let cell: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        let found = Geodetic {
            latitude: cell[1].to_radians(),
            longitude: cell[2].to_radians(),
            height: cell[3],
        };
        if let Some(row) = rows.iter().find(|r| (r.head.obu_s - cell[0]).abs() < 0.002) {
            sum += place(row).to(&found).xy().norm();
            count += 1;
        }
    }
    (sum / real(count), count)
}

#[test]
fn a_simulated_drive_goes_through_both_filters() {
    let dir = folder("gnss-run");
    for axes in ["tag", "car"] {
        let logs = dir.join(axes);
        let made = reconstruct(&[
            "gnss",
            "simulate",
            "--seed",
            "90021",
            "--axes",
            axes,
            "--out",
            text(&logs),
        ]);
        assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
        let [fixes, motions, reference] =
            ["fixes", "motions", "reference"].map(|n| logs.join(format!("{n}-90021.txt")));
        let mut off = Vec::new();
        for more in [
            &["--filter", "refined"][..],
            &["--filter", "refined", "--no-smoother"],
            &["--filter", "refined", "--every", "10"],
            &["--filter", "published", "--every", "10"],
            &["--filter", "refined", "--every", "10", "--exact-speed"],
            &["--filter", "published", "--every", "10", "--exact-speed"],
        ] {
            let out = logs.join(more.concat());
            let mut args = vec![
                "gnss",
                "run",
                "--fixes",
                text(&fixes),
                "--motions",
                text(&motions),
                "--axes",
                axes,
                "--out",
                text(&out),
                "--reference",
                text(&reference),
            ];
            args.extend(more);
            let result = reconstruct(&args);
            assert_eq!(result.status.code(), Some(0), "{}", stderr(&result));
            assert!(stdout(&result).contains("track.csv"));
            let (mean, seconds) = deviation(&out.join("track.csv"), &reference);
            let summary: serde_json::Value =
                serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
            let said = &summary["deviation"];
            println!("{axes} {more:?}: {mean:.1} m over {seconds} s; {said}");
            assert!((said["mean_m"].as_f64().unwrap() - mean).abs() < 0.2);
            assert!(said["p95_m"].as_f64().unwrap() <= said["largest_m"].as_f64().unwrap());
            assert!(seconds > 150);
            off.push(mean);
        }
        assert!(off[0] < 6.0 && off[1] < 8.0 && off[2] < 10.0, "{off:?}");
        assert!(off[3] > off[2] && off[5] > off[4], "{off:?}");
    }
}

#[test]
fn what_is_wrong_is_said() {
    let dir = folder("gnss-wrong");
    let made = reconstruct(&[
        "gnss",
        "simulate",
        "--seed",
        "90022",
        "--seconds",
        "60",
        "--out",
        text(&dir),
    ]);
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    let [fixes, motions] = ["fixes", "motions"].map(|n| dir.join(format!("{n}-90022.txt")));
    let out = dir.join("out");
    let run = |fixes: &Path, motions: &Path, more: &[&str]| {
        let mut args = vec![
            "gnss",
            "run",
            "--fixes",
            text(fixes),
            "--motions",
            text(motions),
            "--out",
            text(&out),
        ];
        args.extend(more);
        let result = reconstruct(&args);
        (result.status.code(), stderr(&result))
    };
    let (code, said) = run(&dir.join("none.txt"), &motions, &[]);
    assert!(code == Some(1) && said.contains("none.txt"), "{said}");
    // The logs the wrong way round.
    let (code, said) = run(&motions, &fixes, &[]);
    assert!(code == Some(1) && said.contains("35"), "{said}");
    let (code, said) = run(&fixes, &motions, &["--equipment", "7"]);
    assert!(
        code == Some(1) && said.contains("expected one leg"),
        "{said}"
    );
    let (code, said) = run(&fixes, &motions, &["--every", "NaN"]);
    assert!(code == Some(1) && said.contains("--every"), "{said}");
    // A log that is cut, and one with a hole: said, and done where it can be.
    let whole = std::fs::read_to_string(&motions).unwrap();
    let cut = dir.join("cut.txt");
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let (code, said) = run(&fixes, &cut, &[]);
    assert!(code == Some(1) && said.contains("cut"), "{said}");
    let lines: Vec<&str> = whole.lines().collect();
    let holed = [&lines[..1000], &lines[1060..]].concat().join("\n") + "\n";
    let hole = dir.join("hole.txt");
    std::fs::write(&hole, holed).unwrap();
    let (code, said) = run(&fixes, &hole, &[]);
    assert!(code == Some(3) && said.contains("gap"), "{code:?} {said}");
    let long = [&lines[..1000], &lines[1400..]].concat().join("\n") + "\n";
    std::fs::write(&hole, long).unwrap();
    let (code, said) = run(&fixes, &hole, &[]);
    // Longer than is bridged: reckoned on either side, see `gnss_holes.rs`.
    assert!(
        code == Some(3) && said.contains("no inertial sample for"),
        "{code:?} {said}"
    );
}

#[test]
fn slips_and_experiments_are_listed() {
    let slips = reconstruct(&["gnss", "slips"]);
    assert_eq!(slips.status.code(), Some(0));
    assert!(stdout(&slips).contains("(2.4)") && stdout(&slips).matches("right:").count() > 30);
    let table = reconstruct(&["gnss", "experiments", "--seeds", "1..1", "--json"]);
    assert_eq!(table.status.code(), Some(0), "{}", stderr(&table));
    let json: serde_json::Value = serde_json::from_str(&stdout(&table)).unwrap();
    assert_eq!(json["rows"].as_array().unwrap().len(), 6);
    let wrong = reconstruct(&["gnss", "experiments", "--seeds", "5..1"]);
    assert_eq!(wrong.status.code(), Some(2));
}

/// A better receiver is believed: the track follows it closer and its bounds are narrower.
#[test]
fn the_receiver_can_be_told() {
    let dir = folder("gnss-receiver");
    let to = text(&dir);
    let made = reconstruct(&["gnss", "simulate", "--seed", "90025", "--out", to]);
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    let [reference, motions] = ["reference", "motions"].map(|n| dir.join(format!("{n}-90025.txt")));
    let run = |out: &Path, more: &[&str]| {
        let mut args = vec!["gnss", "run", "--fixes", text(&reference), "--motions"];
        args.extend([text(&motions), "--reference", text(&reference), "--latency"]);
        args.extend(["0", "--no-smoother", "--out", text(out)]);
        args.extend(more);
        reconstruct(&args)
    };
    // Fixes without error, and nothing said of their accuracy.
    let [plain, sharp] = ["plain", "sharp"].map(|n| dir.join(n));
    let told = [
        "--receiver-sd",
        "0.3",
        "--receiver-speed-sd",
        "0.05",
        "--receiver-slow-share",
        "0",
        "--receiver-slow-time",
        "1",
    ];
    for (out, more) in [(&plain, &[][..]), (&sharp, &told)] {
        let done = run(out, more);
        assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    }
    let sd = |out: &Path| {
        let table = std::fs::read_to_string(out.join("track.csv")).unwrap();
        let cell = |line: &str| line.split(',').nth(10).unwrap().parse::<f64>().unwrap();
        table.lines().skip(2000).map(cell).fold(0.0, f64::max)
    };
    let off = |out: &Path| deviation(&out.join("track.csv"), &reference).0;
    println!(
        "largest standard deviation north {:.2} and {:.2} m, mean deviation {:.2} and {:.2} m",
        sd(&plain),
        sd(&sharp),
        off(&plain),
        off(&sharp)
    );
    assert!(sd(&sharp) < 0.5 * sd(&plain) && off(&sharp) < off(&plain));
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(sharp.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["receiver"]["sd_m"], 0.3);
    let page = std::fs::read_to_string(sharp.join("report.html")).unwrap();
    assert!(page.contains("at least 0.3 m north and east"));
    for (option, value) in [
        ("--receiver-sd", "0"),
        ("--receiver-speed-sd", "nan"),
        ("--receiver-slow-share", "1.5"),
        ("--receiver-slow-time", "-3"),
    ] {
        let wrong = run(&plain, &[&format!("{option}={value}")]);
        let said = stderr(&wrong);
        assert!(
            wrong.status.code() == Some(1) && said.contains(&format!("{option}: expected")),
            "{said}"
        );
    }
    let help = stdout(&reconstruct(&["gnss", "run", "--help"]));
    for part in ["north and east, m", "[default: 2]", "[default: 40]"] {
        assert!(help.contains(part), "{help}");
    }
}
