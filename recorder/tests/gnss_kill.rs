//! The daemon with a satellite receiver, ended by SIGKILL in an event and without one: the record that is sealed at the
//! next start has every fix that was known to be on disk.
#![allow(clippy::unwrap_used, reason = "tests")]

mod receiver;
mod running;
mod support;

use std::thread::sleep;
use std::time::Duration;

use receiver::{Receiver, texts};
use recorder::clock::realtime_ns;
use recorder::recovery::recover;
use recorder::storage::Disk;
use running::{Daemon, PATIENCE, folder};
use schema::num;
use schema::parts::TriggerKind;
use serde_json::Value;
use support::Log;

/// A car at 50 km/h, which is hit after so many seconds and stands.
fn drive(crash_s: f64) -> String {
    let mut log = Log::default();
    for number in 0_u32..6000 {
        let t = f64::from(number) / 100.0;
        let hit = (crash_s..crash_s + 0.14).contains(&t);
        let forward = if hit { -100.0 } else { 0.0 };
        log.accel(t, [forward, 0.0, 9.806], u64::from(number));
        log.rate(t + 0.0002, [0.0; 3], u64::from(number));
        if number.is_multiple_of(2) {
            log.wheels(t + 0.0004, if t < crash_s { 50.0 } else { 0.0 });
        }
    }
    log.text()
}

fn number(status: &Value, part: &str, key: &str) -> u64 {
    status[part][key].as_u64().unwrap()
}

/// Sends fixes until the state is as wanted.
fn fixes_until(daemon: &Daemon, receiver: &mut Receiver, wanted: impl Fn(&Value) -> bool) -> Value {
    for _ in 0..PATIENCE {
        receiver.fix();
        sleep(Duration::from_millis(50));
        if let Some(status) = daemon.status()
            && wanted(&status)
        {
            return status;
        }
    }
    unreachable!("{:?}\n{}", daemon.status(), daemon.said());
}

/// Kills a daemon, looks at what it left, starts it again; gives what there was to see.
fn killed(name: &str, crash_s: f64, kind: TriggerKind) -> String {
    let dir = folder(name);
    let mut receiver = Receiver::new(&dir.join("gps"));
    let table = format!(
        "[gnss]\ndevice = \"{}\"\nbaud = 115200\n\n[run]",
        receiver.device()
    );
    let mut daemon = Daemon::start(dir, drive(crash_s), &[("[run]", &table)]);
    receiver.plug_in();
    daemon.until("the line", |status| status["gnss"]["open"] == true);
    let event = kind == TriggerKind::DeltaV;
    fixes_until(&daemon, &mut receiver, |status| {
        number(status, "gnss", "fixes") >= 20 && (!event || status["state"] == "event")
    });
    let status = fixes_until(&daemon, &mut receiver, |status| {
        number(status, "gnss", "fixes") >= 30
    });
    // What was heard by now is on disk two flushes later; the spool's state is looked at once a second.
    let heard = num::usize_of(number(&status, "gnss", "sentences"));
    let flushes = number(&status, "spool", "flushes");
    let looked = fixes_until(&daemon, &mut receiver, |status| {
        number(status, "spool", "flushes") > flushes
    });
    let flushes = number(&looked, "spool", "flushes");
    fixes_until(&daemon, &mut receiver, |status| {
        number(status, "spool", "flushes") > flushes + 2
    });
    daemon.child.kill().unwrap();
    let killed_ns = realtime_ns();
    daemon.child.wait().unwrap();

    let spool = daemon.dir.join("records/spool.svs");
    let back = recover(&Disk, &spool).unwrap();
    assert!(back.notes.is_empty(), "{:?}", back.notes);
    let [record] = back.records.as_slice() else {
        unreachable!("one event: {}", back.records.len());
    };
    assert_eq!(record.triggers[0].kind, kind);
    let part = record.gnss.as_ref().unwrap();
    let kept = texts(&part.sentences);
    let sent = receiver.texts();
    assert!(kept.len() >= heard, "{} of {heard}", kept.len());
    assert!(sent.starts_with(&kept));
    // Three sentences a fix, the last of which may still have grown.
    assert_eq!(part.fixes.len(), kept.len().div_ceil(3));
    for (fix, utc_ns) in part.fixes.iter().zip(&receiver.fixes) {
        assert_eq!(fix.utc_ns, Some(*utc_ns));
        assert!(fix.position.is_some());
    }
    let last = part.sentences.last().unwrap();
    let last_ns = last.monotonic_ns + record.header.clock.offset_ns;
    let seen = format!(
        "{name}: {} of {} sentences kept, {heard} known to be on disk; the last {:.1} ms before the kill",
        kept.len(),
        sent.len(),
        num::real_i64(killed_ns - last_ns) / 1e6
    );

    // The next start seals it, the same, with the receiver not there.
    receiver.pull();
    daemon.child = Daemon::spawn(&daemon.dir);
    daemon.until("the next start", |status| status["state"] == "recording");
    let sealed = daemon.records().remove(0);
    assert_eq!(sealed.gnss, record.gnss);
    assert!(!sealed.completion.complete);
    let notes = sealed.health.notes.join("\n");
    assert!(
        notes.contains("is open, 115200 bits") && notes.contains("only whole sentences"),
        "{notes}"
    );
    daemon.stop();
    seen
}

#[test]
fn fixes_of_an_event_that_was_killed_are_in_its_record() {
    println!("{}", killed("gnss-kill-event", 3.0, TriggerKind::DeltaV));
}

#[test]
fn fixes_of_a_drive_that_was_killed_are_in_its_record() {
    println!(
        "{}",
        killed("gnss-kill-drive", 100.0, TriggerKind::PowerLoss)
    );
}
