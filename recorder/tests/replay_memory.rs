//! Memory of a replay does not depend on the length of the log: peak resident set of the program itself.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

mod support;

use std::fmt::Write as _;
use std::io::{Read, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};

use support::Log;

/// Peak resident set, KiB, of a replay of so many copies of a minute, each a minute later, fed by a pipe.
fn peak(minutes: i64) -> u64 {
    let mut log = Log::default();
    log.steady(0.0, 60.0, 100.0, 50.0);
    let minute = log.text();
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("memory-{minutes}"));
    let config = support::etc().join("recorder.toml");
    let mut child = Command::new(env!("CARGO_BIN_EXE_recorder"))
        .args([
            "replay",
            "--config",
            config.to_str().unwrap(),
            "-",
            "--out",
            out.to_str().unwrap(),
        ])
        .args(["--trigger-at", "45"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    for k in 0..minutes {
        let mut text = String::with_capacity(minute.len());
        for line in minute.lines() {
            let (seconds, rest) = line[1..].split_once('.').unwrap();
            let seconds = seconds.parse::<i64>().unwrap() + 60 * k;
            writeln!(text, "({seconds}.{rest}").unwrap();
        }
        pipe.write_all(text.as_bytes()).unwrap();
    }
    // All but the last pipe full has been read now.
    let mut status = String::new();
    std::fs::File::open(format!("/proc/{}/status", child.id()))
        .unwrap()
        .read_to_string(&mut status)
        .unwrap();
    drop(pipe);
    let code = child.wait().unwrap().code();
    assert!(matches!(code, Some(0 | 3)), "{code:?}");
    let line = status
        .lines()
        .find(|line| line.starts_with("VmHWM"))
        .unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

#[test]
fn memory_does_not_depend_on_the_length() {
    let (short, long) = (peak(2), peak(40));
    eprintln!("peak resident set: {short} KiB for 2 minutes of log, {long} KiB for 40");
    assert!(long < short + 2048, "{short} KiB, then {long} KiB");
}
