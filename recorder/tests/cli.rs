//! The program: what it prints where, its exit codes, its files.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use schema::Record;
use schema::header::Origin;
use sha2::{Digest, Sha256};
use support::{Log, etc};

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("recorder-cli-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn log(&self, log: Log) -> PathBuf {
        let path = self.0.join("drive.log");
        fs::write(&path, log.text()).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn recorder(args: &[&str], config: &Path, logs: &[&Path], stdin: &[u8]) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_recorder"))
        .arg(args[0])
        .arg("--config")
        .arg(config)
        .args(&args[1..])
        .args(logs)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A program that fails before it reads closes the pipe; that is not what is tested here.
    let _ = child.stdin.take().unwrap().write_all(stdin);
    child.wait_with_output().unwrap()
}

fn drive() -> Log {
    let mut log = Log::default();
    log.steady(0.0, 60.0, 100.0, 0.0);
    log
}

fn read(path: &str) -> Record {
    Record::read(&fs::read(path).unwrap()).unwrap().0
}

#[test]
fn a_sound_replay_prints_the_path_and_gives_0() {
    let folder = Folder::new("sound");
    let log = folder.log(drive());
    let out = folder.0.join("records");
    let config = etc().join("recorder.toml");
    let args = [
        "replay",
        "--trigger-at",
        "40",
        "--out",
        out.to_str().unwrap(),
    ];
    let run = recorder(&args, &config, &[&log], b"");
    let stdout = String::from_utf8(run.stdout).unwrap();
    let stderr = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(0), "{stderr}");
    assert_eq!(stdout.lines().count(), 1);
    assert!(
        stdout.trim_end().ends_with("20231114T221400Z-0001.svb"),
        "{stdout}"
    );
    let record = read(stdout.trim_end());
    let Origin::Replay { logs } = &record.header.origin else {
        unreachable!()
    };
    let digest: [u8; 32] = Sha256::digest(fs::read(&log).unwrap()).into();
    assert_eq!(
        (logs[0].name.as_str(), logs[0].sha256),
        ("drive.log", digest)
    );
    assert!(record.completion.complete && !record.raw.is_empty() && record.aux.len() == 1);
    // A second replay writes beside the first, never over it; no temporary file is left.
    let before = fs::read(stdout.trim_end()).unwrap();
    let again = recorder(&args, &config, &[&log], b"");
    assert!(
        String::from_utf8(again.stdout)
            .unwrap()
            .trim_end()
            .ends_with("Z-0002.svb")
    );
    assert_eq!(fs::read(stdout.trim_end()).unwrap(), before);
    assert_eq!(fs::read_dir(&out).unwrap().count(), 2);
}

#[test]
fn standard_input_and_a_renamed_interface_with_json() {
    let folder = Folder::new("stdin");
    let config = etc().join("recorder.toml");
    let text = drive().text().replace("can0", "vcan7");
    let out = folder.0.to_str().unwrap();
    let args = [
        "replay",
        "--map",
        "vcan7=can0",
        "--json",
        "--trigger-at",
        "30",
        "--out",
        out,
    ];
    let run = recorder(&args, &config, &[Path::new("-")], text.as_bytes());
    let stdout = String::from_utf8(run.stdout).unwrap();
    assert_eq!(
        run.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    let line: serde_json::Value = serde_json::from_str(stdout.trim_end()).unwrap();
    assert_eq!(line["triggers"][0]["kind"], "manual");
    assert_eq!(line["complete"], true);
    let file = fs::read(line["path"].as_str().unwrap()).unwrap();
    assert!(Record::read(&file).is_ok());
    assert_eq!(line["sha256"].as_str().unwrap().len(), 64);
}

#[test]
fn exit_codes() {
    let folder = Folder::new("codes");
    let log = folder.log(drive());
    let config = etc().join("recorder.toml");
    let out = folder.0.to_str().unwrap();
    // The log ends before the post-trigger time: 3, and the reason on standard error.
    let run = recorder(
        &["replay", "--trigger-at", "55", "--out", out],
        &config,
        &[&log],
        b"",
    );
    assert_eq!(run.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&run.stderr).contains("before the post-trigger time was over"));
    // Nothing fired: 0, no record, and what was largest.
    let run = recorder(&["replay", "--out", out], &config, &[&log], b"");
    assert_eq!((run.status.code(), run.stdout.len()), (Some(0), 0));
    assert!(String::from_utf8_lossy(&run.stderr).contains("no trigger fired"));
    // An interface that no bus names is listed.
    let run = recorder(
        &["replay", "--out", out],
        &config,
        &[Path::new("-")],
        b"(1.0) can9 123#00\n",
    );
    assert!(String::from_utf8_lossy(&run.stderr).contains("can9"));
    let failures: [(&[&str], &Path, &[u8]); 3] = [
        (&["replay"], Path::new("/nowhere.log"), b""),
        (&["replay"], Path::new("-"), b""),
        (
            &["replay", "--map", "a=b"],
            Path::new("-"),
            b"(1.0) can0 123#00\n",
        ),
    ];
    for (args, log, stdin) in failures {
        let run = recorder(args, &config, &[log], stdin);
        assert_eq!(
            (run.status.code(), run.stdout.len()),
            (Some(1), 0),
            "{args:?}"
        );
        assert!(!run.stderr.is_empty());
    }
    assert_eq!(
        recorder(&["replay", "--trigger-at", "x"], &config, &[&log], b"")
            .status
            .code(),
        Some(2)
    );
    assert_eq!(
        recorder(&["replay"], &config, &[], b"").status.code(),
        Some(2)
    );
}

#[test]
fn check_says_what_arrives() {
    let folder = Folder::new("check");
    let log = folder.log(drive());
    let config = etc().join("recorder.toml");
    assert_eq!(
        recorder(&["check"], &config, &[], b"").status.code(),
        Some(0)
    );
    let run = recorder(&["check", "--for", "20", "--json"], &config, &[&log], b"");
    assert_eq!(
        run.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&run.stdout)
    );
    let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert!((report["signals"][0]["rate_hz"].as_f64().unwrap() - 100.0).abs() < 0.1);
    assert!(report["signals"][1]["noise_at_rest"].as_f64().unwrap() < 0.01);
    assert!((report["seconds"].as_f64().unwrap() - 20.0).abs() < 0.5);
}
