//! The daemon as a program, on logs at the pace of their stamps: its socket, its signals, sensors that die, a disk that
//! is full, memory.
#![allow(clippy::unwrap_used, reason = "tests")]

mod running;
mod support;

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use running::{Daemon, PATIENCE, folder, program, write_config};
use schema::header::Origin;
use schema::parts::TriggerKind;
use serde_json::Value;
use support::Log;

fn drive(seconds: f64) -> String {
    let mut log = Log::default();
    log.steady(0.0, seconds, 100.0, 50.0);
    log.text()
}

#[test]
fn it_tells_its_state_takes_a_trigger_and_seals_what_runs_when_it_is_stopped() {
    let mut daemon = Daemon::start(folder("trigger"), drive(60.0), &[]);
    let status = daemon.until("rates", |status| {
        status["signals"][0]["rate_hz"].as_f64() > Some(90.0)
    });
    for key in [
        "ring",
        "interfaces",
        "totals",
        "records",
        "spool",
        "alarms",
        "uptime_s",
    ] {
        assert!(!status[key].is_null(), "{key}");
    }
    daemon.until("the spool", |status| status["spool"]["running"] == true);
    let screen = program(&daemon.dir, &["status", "--config", "recorder.toml"]);
    let screen = String::from_utf8(screen.stdout).unwrap();
    assert!(
        screen.contains("signal    accel") && screen.contains("NOT signed"),
        "{screen}"
    );

    let done = program(&daemon.dir, &["trigger", "--config", "recorder.toml"]);
    assert!(done.status.success(), "{done:?}");
    daemon.until("the trigger", |status| {
        status["last_trigger"]["kind"] == "manual"
    });
    daemon.stop();
    let records = daemon.records();
    let [record] = records.as_slice() else {
        unreachable!("one record: {}", records.len());
    };
    assert_eq!(record.header.origin, Origin::Live);
    assert_eq!(record.triggers[0].kind, TriggerKind::Manual);
    let reasons = record.completion.reasons.join("; ");
    assert!(reasons.contains("the recorder was stopped"), "{reasons}");
    assert!(!daemon.dir.join("sock").exists(), "the socket is removed");
    // It was stopped on purpose: the next start has nothing to mend.
    daemon.child = Daemon::spawn(&daemon.dir);
    daemon.until("the next start", |status| status["state"] == "recording");
    assert_eq!(daemon.records().len(), 1);
    assert!(!daemon.said().contains("was cut"), "{}", daemon.said());
    daemon.stop();
}

#[test]
fn the_service_manager_hears_that_it_is_ready_alive_and_stopping() {
    use std::os::unix::net::UnixDatagram;
    let dir = folder("notify");
    let heard = UnixDatagram::bind(dir.join("notify")).unwrap();
    heard
        .set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    write_config(&dir, &[]);
    fs::write(dir.join("drive.log"), drive(60.0)).unwrap();
    let child = Command::new(env!("CARGO_BIN_EXE_recorder"))
        .args(["run", "--config", "recorder.toml", "--paced", "drive.log"])
        .current_dir(&dir)
        .env("NOTIFY_SOCKET", dir.join("notify"))
        .env("WATCHDOG_USEC", "600000")
        .env_remove("WATCHDOG_PID")
        .stdin(Stdio::null())
        .stderr(fs::File::create(dir.join("err.txt")).unwrap())
        .spawn()
        .unwrap();
    let mut daemon = Daemon { dir, child };
    let next = || {
        let mut bytes = [0; 256];
        let count = heard.recv(&mut bytes).unwrap();
        String::from_utf8_lossy(&bytes[..count]).trim().to_owned()
    };
    assert_eq!(next(), "READY=1");
    for _ in 0..5 {
        assert_eq!(next(), "WATCHDOG=1");
    }
    daemon.stop();
    while next() != "STOPPING=1" {}
}

#[test]
fn whatever_is_said_on_the_socket_it_goes_on() {
    use std::io::{Read, Write};
    use std::os::unix::net::UnixStream;
    let mut daemon = Daemon::start(folder("hostile"), drive(40.0), &[]);
    let junk: Vec<Vec<u8>> = vec![
        vec![],
        vec![0xFF; 100_000],
        b"status".to_vec(),
        b"format c:\n".to_vec(),
        vec![b'\n'; 1000],
    ];
    let mut open = Vec::new();
    for bytes in junk.iter().cycle().take(40) {
        let Ok(mut stream) = UnixStream::connect(daemon.dir.join("sock")) else {
            continue;
        };
        let _ = stream.write_all(bytes);
        open.push(stream);
    }
    // More than it serves at a time hang on; when they go it serves again.
    let mut answer = String::new();
    for mut stream in open {
        stream
            .set_read_timeout(Some(Duration::from_millis(10)))
            .unwrap();
        let _ = stream.read_to_string(&mut answer);
    }
    assert!(
        answer.contains("expected status, watch or trigger, found `format c:`"),
        "{answer}"
    );
    daemon.until("it answers", |status| status["state"] == "recording");
    daemon.stop();
}

#[test]
fn two_daemons_do_not_share_a_folder_and_nobody_answers_where_none_runs() {
    let mut daemon = Daemon::start(folder("two"), drive(30.0), &[]);
    let second = program(
        &daemon.dir,
        &["run", "--config", "recorder.toml", "--paced", "drive.log"],
    );
    assert_eq!(second.status.code(), Some(1));
    let said = String::from_utf8(second.stderr).unwrap();
    assert!(said.contains("another recorder"), "{said}");
    assert!(daemon.status().is_some(), "the first goes on");
    daemon.stop();
    let asked = program(&daemon.dir, &["status", "--socket", "sock"]);
    assert_eq!(asked.status.code(), Some(1));
    assert!(
        String::from_utf8(asked.stderr)
            .unwrap()
            .contains("is it running?")
    );
}

#[test]
fn the_configuration_is_read_again_and_the_ring_stays() {
    let mut daemon = Daemon::start(folder("reload"), drive(60.0), &[]);
    daemon.until("a ring", |status| {
        status["ring"]["held_s"].as_f64() > Some(3.0)
    });
    let before = daemon.status().unwrap()["config_sha256"].clone();
    // First a broken one, which is not taken over.
    let good = fs::read_to_string(daemon.dir.join("recorder.toml")).unwrap();
    fs::write(
        daemon.dir.join("recorder.toml"),
        good.replace("keep = 5", "keep = 1"),
    )
    .unwrap();
    daemon.signal("-HUP");
    for _ in 0..PATIENCE {
        if daemon.said().contains("not taken over") {
            break;
        }
        sleep(Duration::from_millis(50));
    }
    assert!(
        daemon.said().contains("not taken over"),
        "{}",
        daemon.said()
    );
    fs::write(
        daemon.dir.join("recorder.toml"),
        good.replace("id = \"bench-1\"", "id = \"bench-2\""),
    )
    .unwrap();
    let held = daemon.status().unwrap()["ring"]["held_s"].as_f64().unwrap();
    daemon.signal("-HUP");
    let status = daemon.until("the new one", |status| status["config_sha256"] != before);
    assert_eq!(status["device_id"], "bench-2");
    assert!(
        status["ring"]["held_s"].as_f64().unwrap() >= held - 0.2,
        "the ring stays"
    );
    program(&daemon.dir, &["trigger", "--config", "recorder.toml"]);
    daemon.until("the trigger", |status| {
        status["last_trigger"]["kind"] == "manual"
    });
    sleep(Duration::from_millis(300));
    daemon.stop();
    let records = daemon.records();
    let record = &records[0];
    assert_eq!(record.header.device_id, "bench-2");
    let trigger = record.triggers[0].index;
    assert!(
        trigger - record.first_index() > 300,
        "what lay before the change is in the record"
    );
    let notes = record.health.notes.join("\n");
    assert!(
        notes.contains("was read again") && notes.contains("could not be used"),
        "{notes}"
    );
}

#[test]
fn a_sensor_that_dies_is_told_within_a_second_and_recording_goes_on() {
    let mut log = Log::default();
    for number in 0_u32..2500 {
        let t = f64::from(number) / 100.0;
        log.accel(t, [0.0, 0.0, 9.806], u64::from(number));
        if !(3.0..=8.0).contains(&t) {
            log.rate(t + 0.0002, [0.0; 3], u64::from(number));
        }
        log.wheels(t + 0.0004, 30.0);
    }
    let mut daemon = Daemon::start(folder("dies"), log.text(), &[]);
    let alarm = |status: &Value| {
        let alarms = status["alarms"].as_array().unwrap();
        let found = alarms
            .iter()
            .find(|text| text.as_str().unwrap().starts_with("rate has been silent"));
        found.map(|text| text.as_str().unwrap().to_owned())
    };
    let status = daemon.until("the alarm", |status| alarm(status).is_some());
    assert_eq!(status["state"], "recording");
    daemon.until("it is back", |status| alarm(status).is_none());
    program(&daemon.dir, &["trigger", "--config", "recorder.toml"]);
    daemon.until("the trigger", |status| {
        status["last_trigger"]["kind"] == "manual"
    });
    sleep(Duration::from_millis(400));
    daemon.stop();
    let records = daemon.records();
    let record = &records[0];
    let gap = record
        .health
        .gaps
        .iter()
        .find(|gap| gap.signal == "rate")
        .unwrap();
    assert!((4_500_000_000..5_500_000_000).contains(&(gap.to_ns - gap.from_ns)));
    let notes = record.health.notes.join("\n");
    assert!(
        notes.contains("rate fell silent") && notes.contains("rate is back"),
        "{notes}"
    );
    // Said when the silence was 0.2 s old, as the log's stamps tell: not more than a second of the daemon's own time.
    let said = daemon.said();
    let time = |what: &str| {
        let line = said.lines().find(|line| line.contains(what)).unwrap();
        let seconds = line
            .split(['T', ' '])
            .nth(1)
            .unwrap()
            .trim_end_matches('Z')
            .split(':');
        seconds
            .map(|part| part.parse::<f64>().unwrap())
            .fold(0.0, |sum, part| sum * 60.0 + part)
    };
    let lasted = time("rate is back") - time("rate fell silent");
    assert!(
        lasted > 4.0,
        "5 s of silence were told after {:.2} s",
        5.0 - lasted
    );
}

/// A file system, unmounted when dropped.
struct Mounted(PathBuf);
impl Drop for Mounted {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

#[test]
fn a_full_disk_keeps_the_record_in_memory_until_there_is_room() {
    let dir = folder("full");
    let records = dir.join("records");
    fs::create_dir_all(&records).unwrap();
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=3m", "tmpfs"])
        .arg(&records)
        .stderr(Stdio::null())
        .status();
    if !mounted.is_ok_and(|status| status.success()) {
        println!("skipped: a small file system can not be mounted here");
        return;
    }
    let mounted = Mounted(records.clone());
    let mut daemon = Daemon::start(
        dir,
        drive(60.0),
        &[
            ("post_trigger_s = 10", "post_trigger_s = 1"),
            ("enabled = true", "enabled = false"),
        ],
    );
    // Everything but the last blocks is taken by something else.
    let junk = records.join("junk");
    let filler = fs::File::create(&junk).unwrap();
    let mut size = 0_u64;
    while std::os::unix::fs::FileExt::write_all_at(&filler, &[1; 4096], size).is_ok() {
        size += 4096;
    }
    program(&daemon.dir, &["trigger", "--config", "recorder.toml"]);
    let full = daemon.until("the alarm", |status| status["records"]["waiting"] == 1);
    assert!(
        full["alarms"]
            .as_array()
            .unwrap()
            .iter()
            .any(|text| text.as_str().unwrap().contains("wait")),
        "{full}"
    );
    assert_eq!(full["records"]["sealed"], 0);
    fs::remove_file(&junk).unwrap();
    drop(filler);
    let sealed = daemon.until("room", |status| status["records"]["sealed"] == 1);
    assert_eq!(sealed["records"]["waiting"], 0);
    assert_eq!(daemon.records().len(), 1);
    daemon.stop();
    drop(mounted);
}
