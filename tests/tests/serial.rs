//! The read-out with both built programs at the ends of a line of pseudo-terminals that loses, doubles and changes
//! bytes, is cut, and carries garbage.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "tests"
)]

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Output;
use std::sync::atomic::Ordering;
use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;
use support::serial::{Bench, Line, Noise, Server, TOKEN, end, fetch};

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{error}: {}", String::from_utf8_lossy(&output.stderr));
    })
}

fn states(json: &Value) -> Vec<&str> {
    let files = json["files"].as_array().unwrap();
    files
        .iter()
        .map(|file| file["state"].as_str().unwrap())
        .collect()
}

/// Runs `reconstruct fetch` over a line of its own.
fn over(
    server: &serialport::TTYPort,
    noise: &Noise,
    seed: u64,
    out: &Path,
    token: &str,
    more: &[&str],
) -> Output {
    let (client, device) = end();
    let _line = Line::join(server, &client, noise, seed);
    fetch(&device, out, token, more).output().unwrap()
}

fn sound(output: &Output) {
    let err = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{err}");
}

#[test]
fn every_record_comes_the_same_to_the_byte_over_a_line_that_loses_doubles_and_changes_bytes() {
    let bench = Bench::new("noise");
    let (line, device) = end();
    let mut server = Server::start(&bench.folder, &device, &[]);
    server.wait_for("open");
    for (k, (rate, burst)) in [(0.0, 0.0), (1e-4, 1e-4), (1e-3, 1e-4), (2e-3, 1e-3)]
        .into_iter()
        .enumerate()
    {
        let out = bench.folder.join(format!("out-{k}"));
        let noise = Noise {
            rate,
            burst,
            ..Noise::default()
        };
        let output = over(
            &line,
            &noise,
            40 + k as u64,
            &out,
            TOKEN,
            &["--baud", "921600", "--patience", "120"],
        );
        sound(&output);
        bench.assert_fetched(&out);
        let result = json(&output);
        assert_eq!(states(&result), ["fetched"; 4]);
        let whole: usize = bench.files.iter().map(|(_, bytes)| bytes.len()).sum();
        println!(
            "each fault {rate} a byte, bursts {burst}: {whole} bytes of files in {} of line",
            result["line_bytes"]
        );
        // What is there is not fetched again.
        let again = over(&line, &Noise::default(), 0, &out, TOKEN, &[]);
        sound(&again);
        assert_eq!(states(&json(&again)), ["had"; 4]);
        assert!(json(&again)["line_bytes"].as_u64().unwrap() < 2000);
    }
    assert_eq!(server.terminate(), Some(0));
}

#[test]
fn a_line_that_is_cut_for_a_while_loses_nothing() {
    let bench = Bench::new("cut");
    let (line, device) = end();
    let mut server = Server::start(&bench.folder, &device, &["--once"]);
    server.wait_for("open");
    let (client, device) = end();
    let slow = Noise {
        pause: Duration::from_millis(2),
        ..Noise::default()
    };
    let joined = Line::join(&line, &client, &slow, 1);
    let out = bench.folder.join("out");
    let fetching = fetch(&device, &out, TOKEN, &["--patience", "120"])
        .spawn()
        .unwrap();
    for stop in [10_000, 40_000] {
        while joined.forward.load(Ordering::Relaxed) < stop {
            sleep(Duration::from_millis(5));
        }
        joined.cut.store(true, Ordering::Relaxed);
        sleep(Duration::from_millis(1500));
        joined.cut.store(false, Ordering::Relaxed);
    }
    sound(&fetching.wait_with_output().unwrap());
    bench.assert_fetched(&out);
    // Asked to serve one session, it ended with it.
    assert_eq!(server.ended(), Some(0));
}

#[test]
fn a_killed_fetch_goes_on_where_it_was_and_fetches_nothing_twice() {
    let bench = Bench::new("killed");
    let (line, device) = end();
    let mut server = Server::start(&bench.folder, &device, &[]);
    server.wait_for("open");
    let out = bench.folder.join("out");
    {
        let (client, device) = end();
        let slow = Noise {
            pause: Duration::from_millis(2),
            ..Noise::default()
        };
        let _line = Line::join(&line, &client, &slow, 1);
        let mut fetching = fetch(&device, &out, TOKEN, &[]).spawn().unwrap();
        let part = out.join("20261103T120000Z-0001.svb.part");
        while fs::metadata(&part).map_or(0, |about| about.len()) < 20_000 {
            sleep(Duration::from_millis(2));
        }
        fetching.kill().unwrap();
        fetching.wait().unwrap();
    }
    // The session of the killed one is still open; the new one takes its place.
    let output = over(&line, &Noise::default(), 0, &out, TOKEN, &[]);
    sound(&output);
    bench.assert_fetched(&out);
    let result = json(&output);
    let resumed = result["files"][0]["resumed_bytes"].as_u64().unwrap();
    let whole: usize = bench.files.iter().map(|(_, bytes)| bytes.len()).sum();
    let came = result["line_bytes"].as_u64().unwrap();
    assert!(resumed >= 19_000, "{resumed}");
    assert!(came < (whole as u64 - resumed) * 11 / 10 + 4_000, "{came}");
    server.wait_for("another began");
}

#[test]
fn a_wrong_token_is_told_nothing_and_attempts_are_spaced_out() {
    let bench = Bench::new("token");
    let (line, device) = end();
    let mut server = Server::start(&bench.folder, &device, &[]);
    server.wait_for("open");
    let out = bench.folder.join("out");
    let quiet = Noise::default();
    // Three in a row, so that the wait after them is long on a slow machine too.
    let mut wrong = 0;
    while wrong < 3 {
        let token = "incorrect horse battery";
        let output = over(&line, &quiet, 0, &out, token, &["--list"]);
        assert_eq!(output.status.code(), Some(1));
        assert!(output.stdout.is_empty());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        if said.contains("the token is wrong") {
            wrong += 1;
        } else {
            assert!(said.contains("too many wrong tokens"), "{said}");
            sleep(Duration::from_millis(500));
        }
    }
    server.wait_for("a wrong token, number 3");
    // Even who knows it has to wait.
    let soon = over(&line, &quiet, 0, &out, TOKEN, &["--list"]);
    let said = String::from_utf8_lossy(&soon.stderr).into_owned();
    assert_eq!(soon.status.code(), Some(1), "{said}");
    assert!(said.contains("too many wrong tokens"), "{said}");
    assert!(soon.stdout.is_empty() && !out.exists());
    let mut tries = 0;
    let listed = loop {
        sleep(Duration::from_millis(500));
        let output = over(&line, &quiet, 0, &out, TOKEN, &["--list"]);
        tries += 1;
        if output.status.success() || tries > 60 {
            break output;
        }
    };
    sound(&listed);
    let names: Vec<Value> = json(&listed)["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|file| file["file"].clone())
        .collect();
    assert_eq!(
        names,
        bench
            .files
            .iter()
            .map(|(name, _)| name.as_str())
            .collect::<Vec<_>>()
    );
    assert!(!out.exists());
}

#[test]
fn a_flood_of_garbage_neither_fills_the_memory_nor_wedges_the_server() {
    let bench = Bench::new("garbage");
    let (mut line, device) = end();
    let mut server = Server::start(&bench.folder, &device, &[]);
    server.wait_for("open");
    sound(&over(
        &line,
        &Noise::default(),
        0,
        &bench.folder.join("one"),
        TOKEN,
        &["--record", "2"],
    ));
    let before = server.peak_kb();
    let mut state = 1_u32;
    for block in 0..2_000 {
        let garbage: Vec<u8> = (0..1024)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // Now and then nothing but borders, or none at all.
                match block % 3 {
                    0 => (state >> 24) as u8,
                    1 => (state >> 24) as u8 | 1,
                    _ => (state >> 28) as u8 / 8,
                }
            })
            .collect();
        let mut rest = &garbage[..];
        while !rest.is_empty() {
            match line.write(rest) {
                Ok(count) => rest = &rest[count..],
                Err(_) => sleep(Duration::from_millis(1)),
            }
        }
    }
    let out = bench.folder.join("out");
    sound(&over(&line, &Noise::default(), 0, &out, TOKEN, &[]));
    bench.assert_fetched(&out);
    let after = server.peak_kb();
    println!("2 MB of garbage: peak memory {before} kB before, {after} kB after");
    assert!(
        after < before + 2_000,
        "{before} kB before, {after} kB after"
    );
}

#[test]
fn a_device_that_is_not_there_yet_or_goes_away_is_waited_for() {
    let bench = Bench::new("unplugged");
    let link = bench.folder.join("tty");
    let mut server = Server::start(&bench.folder, link.to_str().unwrap(), &[]);
    server.wait_for("trying again");
    for round in ["first", "second"] {
        let (line, device) = end();
        std::os::unix::fs::symlink(&device, &link).unwrap();
        server.wait_for("open, 115200");
        let out = bench.folder.join(round);
        sound(&over(&line, &Noise::default(), 0, &out, TOKEN, &[]));
        bench.assert_fetched(&out);
        fs::remove_file(&link).unwrap();
        drop(line);
        server.wait_for("trying again");
    }
    assert_eq!(server.terminate(), Some(0));
}

#[test]
fn a_different_file_of_the_same_name_is_left_as_it_is_and_a_ledger_may_grow() {
    let bench = Bench::new("taken");
    let (line, device) = end();
    let mut server = Server::start(&bench.folder, &device, &[]);
    server.wait_for("open");
    let out = bench.folder.join("out");
    fs::create_dir(&out).unwrap();
    let (name, _) = &bench.files[1];
    fs::write(out.join(name), "mine").unwrap();
    let (ledger, bytes) = &bench.files[3];
    fs::write(out.join(ledger), &bytes[..200]).unwrap();
    let output = over(&line, &Noise::default(), 0, &out, TOKEN, &[]);
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(
        states(&json(&output)),
        ["fetched", "failed", "fetched", "fetched"]
    );
    assert_eq!(fs::read(out.join(name)).unwrap(), b"mine");
    assert_eq!(&fs::read(out.join(ledger)).unwrap(), bytes);
    // A record of a number that is not there is a gap.
    let output = over(
        &line,
        &Noise::default(),
        0,
        &out,
        TOKEN,
        &["--record", "1", "77"],
    );
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(states(&json(&output)), ["had"]);
}
