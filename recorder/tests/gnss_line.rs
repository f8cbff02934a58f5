//! The daemon and a satellite receiver on a serial line: what it says is in the record with its times, a device that goes
//! away and comes back, a line of noise, a receiver that falls silent, a reload, a line that is too fast.
#![allow(clippy::unwrap_used, reason = "tests")]

mod receiver;
mod running;
mod support;

use std::fs;
use std::thread::sleep;
use std::time::Duration;

use receiver::{Receiver, texts};
use running::{Daemon, PATIENCE, folder, program};
use schema::Record;
use serde_json::Value;
use support::Log;

const BAUD: i64 = 115_200;

/// A car that stands, so that an event is over soon.
fn parked(seconds: f64) -> String {
    let mut log = Log::default();
    log.steady(0.0, seconds, 100.0, 0.0);
    log.text()
}

fn table(device: &str) -> String {
    format!("[gnss]\ndevice = \"{device}\"\nbaud = {BAUD}\n\n[run]")
}

/// A daemon that listens to a receiver under this name.
fn listening(name: &str, seconds: f64) -> (Daemon, Receiver) {
    let dir = folder(name);
    let receiver = Receiver::new(&dir.join("gps"));
    let daemon = Daemon::start(
        dir,
        parked(seconds),
        &[("[run]", &table(receiver.device()))],
    );
    (daemon, receiver)
}

fn count(status: &Value, key: &str) -> u64 {
    status["gnss"][key].as_u64().unwrap()
}

fn alarm(status: &Value, what: &str) -> bool {
    let alarms = status["alarms"].as_array().unwrap();
    alarms
        .iter()
        .any(|text| text.as_str().unwrap().contains(what))
}

/// Any alarm that is of the receiver.
fn any_alarm(status: &Value) -> bool {
    alarm(status, "satellite receiver")
}

/// Fixes are sent until the state is as wanted.
fn fixes_until(
    daemon: &Daemon,
    receiver: &mut Receiver,
    what: &str,
    wanted: impl Fn(&Value) -> bool,
) -> Value {
    for _ in 0..PATIENCE / 2 {
        receiver.fix();
        sleep(Duration::from_millis(100));
        if let Some(status) = daemon.status()
            && wanted(&status)
        {
            return status;
        }
    }
    unreachable!("{what}: {:?}\n{}", daemon.status(), daemon.said());
}

/// Triggers by hand, goes on for a moment, and gives the record of what there is.
fn record(daemon: &mut Daemon, receiver: Option<&mut Receiver>) -> Record {
    let before = daemon.records().len();
    assert!(
        program(&daemon.dir, &["trigger", "--config", "recorder.toml"])
            .status
            .success()
    );
    daemon.until("the trigger", |status| status["state"] == "event");
    if let Some(receiver) = receiver {
        let fixes = count(&daemon.until("an answer", |_| true), "fixes");
        fixes_until(daemon, receiver, "fixes after the trigger", |status| {
            count(status, "fixes") > fixes + 3
        });
    }
    daemon.stop();
    daemon.records().remove(before)
}

#[test]
fn what_a_receiver_says_is_in_the_record_with_the_time_it_came() {
    let (mut daemon, mut receiver) = listening("gnss-times", 60.0);
    receiver.plug_in();
    daemon.until("the line", |status| status["gnss"]["open"] == true);
    let status = fixes_until(&daemon, &mut receiver, "fixes", |status| {
        count(status, "fixes") >= 15
    });
    assert_eq!(status["gnss"]["quality"], "RTK fixed");
    assert_eq!(status["gnss"]["satellites"], 12);
    assert!(!any_alarm(&status), "{status}");
    let screen = program(&daemon.dir, &["status", "--config", "recorder.toml"]);
    let screen = String::from_utf8(screen.stdout).unwrap();
    assert!(
        screen.contains("gnss      last fix") && screen.contains("on an open line"),
        "{screen}"
    );
    let record = record(&mut daemon, Some(&mut receiver));
    let part = record.gnss.as_ref().unwrap();
    let offset = record.header.clock.offset_ns;

    // Everything that was sent is there, in order, but for what still waited at the end.
    let (kept, sent) = (texts(&part.sentences), receiver.texts());
    assert!(kept.len() > 50 && sent.starts_with(&kept), "{kept:?}");
    let byte_ns = 10_000_000_000 / BAUD;
    let mut late: Vec<i64> = Vec::new();
    for (sentence, sent) in part.sentences.iter().zip(&receiver.sent) {
        let at_ns = sentence.monotonic_ns + offset;
        // Its first byte came before its last, and what was sent with it may have been read with it.
        let line_ns = 250 * byte_ns;
        assert!(at_ns >= sent.from_ns - line_ns, "{sent:?}: {at_ns}");
        late.push(at_ns - sent.to_ns);
    }
    late.sort_unstable();
    let (median, worst) = (late[late.len() / 2], late[late.len() - 1]);
    println!(
        "{} sentences, {:.1} ms after they were sent in the median, {:.1} at most",
        late.len(),
        schema::num::real_i64(median) / 1e6,
        schema::num::real_i64(worst) / 1e6
    );
    // On a machine that stands still any of them may come late, but not all.
    assert!(median < 100_000_000 && worst < 3_000_000_000);

    // Each fix has its own UTC and place.
    assert!(part.fixes.len() >= 15);
    for (number, (fix, utc_ns)) in (0_u32..).zip(part.fixes.iter().zip(&receiver.fixes)) {
        assert_eq!(fix.utc_ns, Some(*utc_ns));
        let [latitude, _] = fix.position.unwrap();
        let minutes = (latitude.to_degrees() - 48.0) * 60.0;
        assert!((minutes * 1000.0 - f64::from(number)).abs() < 0.06);
        assert!((fix.speed_mps.unwrap() - 19.4 * 1852.0 / 3600.0).abs() < 1e-9);
        let delay = fix.monotonic_ns + offset - utc_ns;
        assert!((-25_000_000..3_000_000_000).contains(&delay), "{delay}");
    }
    assert_whole(&record);
    let notes = record.health.notes.join("\n");
    assert!(
        notes.contains("is open, 115200 bits") && notes.contains(" 0 too late for their epoch"),
        "{notes}"
    );
}

/// No frame of the car's own is missing.
fn assert_whole(record: &Record) {
    assert!(record.health.gaps.is_empty(), "{:?}", record.health.gaps);
    let lost = |signal: &schema::parts::SignalHealth| signal.lost_by_counter.unwrap_or(0);
    assert_eq!(record.health.signals.iter().map(lost).sum::<u64>(), 0);
}

#[test]
fn a_device_that_goes_away_and_comes_back_is_told_and_read_on() {
    let (mut daemon, mut receiver) = listening("gnss-away", 90.0);
    // Not there at the start.
    let status = daemon.until("the alarm", |status| {
        alarm(status, "device can not be opened")
    });
    assert_eq!(status["gnss"]["open"], false);
    assert_eq!(
        count(&status, "outages"),
        0,
        "what was never there did not go away"
    );
    let screen = program(&daemon.dir, &["status", "--config", "recorder.toml"]);
    assert_eq!(screen.status.code(), Some(3));
    let screen = String::from_utf8(screen.stdout).unwrap();
    assert!(screen.contains("NOT OPEN"), "{screen}");

    receiver.plug_in();
    let status = fixes_until(&daemon, &mut receiver, "the first", |status| {
        count(status, "fixes") >= 3
    });
    assert!(!any_alarm(&status), "{status}");
    for outage in 1..=2 {
        receiver.pull();
        let status = daemon.until("the outage", |status| {
            count(status, "outages") == outage && alarm(status, "device can not be opened")
        });
        assert_eq!(status["gnss"]["open"], false);
        assert_eq!(status["state"], "recording");
        let fixes = count(&status, "fixes");
        receiver.plug_in();
        let status = fixes_until(&daemon, &mut receiver, "it is back", |status| {
            count(status, "fixes") >= fixes + 3
        });
        assert_eq!(count(&status, "outages"), outage);
        assert!(!any_alarm(&status), "{status}");
    }
    let record = record(&mut daemon, Some(&mut receiver));
    assert_whole(&record);
    let notes = &record.health.notes;
    let told = |what: &str| {
        let of = |note: &&String| note.contains("satellite receiver: ") && note.contains(what);
        notes.iter().filter(of).count()
    };
    assert_eq!(told("is open"), 3, "{notes:?}");
    assert_eq!(told("the device is gone"), 2, "{notes:?}");
    assert!(told("open the device") >= 1, "{notes:?}");
    // What came in each of the three stretches.
    let part = record.gnss.unwrap();
    let sent = receiver.texts();
    let mut at = 0;
    for text in texts(&part.sentences) {
        let found = sent.iter().skip(at).position(|other| *other == text);
        at += found.unwrap() + 1;
    }
    assert!(part.fixes.len() >= 12);
}

#[test]
fn noise_silence_and_a_receiver_without_a_fix_are_told() {
    let (mut daemon, mut receiver) = listening("gnss-silent", 120.0);
    receiver.plug_in();
    daemon.until("it never spoke", |status| {
        alarm(status, "never said anything")
    });
    // As at another pace: bytes, and no sentence.
    let noise: Vec<u8> = (0..250_u32)
        .map(|k| u8::try_from(k * 37 % 251).unwrap() | 0x80)
        .collect();
    for _ in 0..12 {
        receiver.send(&noise);
    }
    daemon.until("the noise", |status| alarm(status, "is [gnss] baud right?"));
    let status = fixes_until(&daemon, &mut receiver, "sentences", |status| {
        count(status, "fixes") > 0 && !any_alarm(status)
    });
    assert_eq!(count(&status, "outages"), 0);

    // It spoke, and speaks no more.
    let status = daemon.until("silent", |status| alarm(status, "has said nothing new for"));
    assert_eq!(status["gnss"]["open"], true);
    fixes_until(&daemon, &mut receiver, "it speaks again", |status| {
        !any_alarm(status)
    });
    // That there is no fix is a word too.
    let fixes = count(&daemon.until("an answer", |_| true), "fixes");
    for k in 0.. {
        let utc_ns = recorder::clock::realtime_ns();
        receiver.say(&receiver::epoch(utc_ns, 0.0, 0));
        sleep(Duration::from_millis(200));
        let status = daemon.until("an answer", |_| true);
        if count(&status, "no_fix") >= 12 {
            assert_eq!(status["gnss"]["quality"], "no fix");
            assert!(status["gnss"]["last_fix_s"].as_f64() > Some(1.0));
            assert!(!any_alarm(&status), "{status}");
            assert!(count(&status, "fixes") <= fixes + 1);
            break;
        }
        assert!(k < PATIENCE, "{status}");
    }
    let record = record(&mut daemon, Some(&mut receiver));
    let notes = record.health.notes.join("\n");
    assert!(
        notes.contains("the satellite receiver fell silent")
            && notes.contains("the satellite receiver is back"),
        "{notes}"
    );
    let part = record.gnss.unwrap();
    let nowhere = part.fixes.iter().filter(|fix| fix.position.is_none());
    assert!(nowhere.count() >= 11);
}

/// The table of `[gnss]`, or none, is written and read again.
fn reload(daemon: &Daemon, from: &str, to: &str) {
    let path = daemon.dir.join("recorder.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(&path, text.replacen(from, to, 1)).unwrap();
    let before = daemon.until("an answer", |_| true)["config_sha256"].clone();
    daemon.signal("-HUP");
    daemon.until("the new configuration", |status| {
        status["config_sha256"] != before
    });
}

#[test]
fn a_reload_adds_changes_and_removes_the_receiver() {
    let dir = folder("gnss-reload");
    let mut daemon = Daemon::start(
        dir,
        parked(120.0),
        &[("post_trigger_s = 10", "post_trigger_s = 1")],
    );
    let [mut first, mut second] =
        ["first", "second"].map(|name| Receiver::new(&daemon.dir.join(name)));
    first.plug_in();
    second.plug_in();
    let status = daemon.until("some time", |status| {
        status["uptime_s"].as_f64() > Some(6.0)
    });
    assert!(status["gnss"].is_null());
    reload(&daemon, "[run]", &table(first.device()));
    // It was not there before: it has its time to speak.
    let status = daemon.until("the line", |status| status["gnss"]["open"] == true);
    assert!(!any_alarm(&status), "{status}");
    fixes_until(&daemon, &mut first, "fixes of the first", |status| {
        count(status, "fixes") >= 5
    });

    // Another key of the table: the line stays, the count begins again, and nothing is wrong.
    reload(&daemon, "[gnss]", "[gnss]\nlatency_ms = 150");
    first.send(&[b'x'; 3000]);
    first.fix();
    let status = fixes_until(&daemon, &mut first, "fixes of the first", |status| {
        count(status, "fixes") >= 3
    });
    assert_eq!(count(&status, "outages"), 0);
    assert!(!any_alarm(&status), "{status}");
    assert!(!daemon.said().contains("the device is gone"));

    reload(&daemon, first.device(), second.device());
    let status = daemon.until("the other line", |status| status["gnss"]["open"] == true);
    assert!(!any_alarm(&status), "{status}");
    fixes_until(&daemon, &mut second, "fixes of the second", |status| {
        count(status, "fixes") >= 5
    });
    program(&daemon.dir, &["trigger", "--config", "recorder.toml"]);
    fixes_until(&daemon, &mut second, "the record", |status| {
        status["records"]["sealed"] == 1
    });
    // None of the first, which would stand under the name of the second.
    let part = daemon.records()[0].gnss.clone().unwrap();
    let sent = second.texts();
    assert!(part.sentences.len() > 15);
    assert!(
        texts(&part.sentences)
            .iter()
            .all(|text| sent.contains(text))
    );
    assert!(part.sheet.receiver.contains(second.device()));

    let text = fs::read_to_string(daemon.dir.join("recorder.toml")).unwrap();
    let start = text.find("[gnss]").unwrap();
    let end = text.find("[run]").unwrap();
    reload(&daemon, &text[start..end], "");
    let status = daemon.until("no receiver", |status| status["gnss"].is_null());
    assert!(!any_alarm(&status), "{status}");
    program(&daemon.dir, &["trigger", "--config", "recorder.toml"]);
    daemon.until("the record", |status| status["records"]["sealed"] == 2);
    daemon.stop();
    let records = daemon.records();
    assert!(
        records[1].gnss.is_none(),
        "no position where none is asked for"
    );
    records.iter().for_each(assert_whole);
}

#[test]
fn a_line_that_is_too_fast_holds_up_no_frame() {
    let (mut daemon, mut receiver) = listening("gnss-flood", 60.0);
    receiver.plug_in();
    daemon.until("the line", |status| status["gnss"]["open"] == true);
    let flood = receiver::epoch(recorder::clock::realtime_ns(), 0.0, 4);
    let flood = flood.join("\r\n").repeat(30);
    let writer = std::thread::spawn(move || {
        let mut bytes = 0;
        while bytes < 60_000_000 && receiver.send(flood.as_bytes()) {
            bytes += flood.len();
        }
        receiver
    });
    let mut seen = 0;
    let mut slowest: f64 = 0.0;
    while !writer.is_finished() || seen < 5 {
        let Some(status) = daemon.status() else {
            continue;
        };
        slowest = slowest.max(status["signals"][0]["silent_s"].as_f64().unwrap());
        seen += 1;
        assert_eq!(status["state"], "recording");
        sleep(Duration::from_millis(50));
    }
    println!("{seen} looks, the newest frame was {slowest:.3} s old at most");
    assert!(slowest < 5.0);
    let mut receiver = writer.join().unwrap();
    let fixes = count(&daemon.until("an answer", |_| true), "fixes");
    let status = fixes_until(&daemon, &mut receiver, "fixes", |status| {
        count(status, "fixes") > fixes + 5
    });
    println!("{} sentences found no room", status["gnss"]["lost"]);
    let record = record(&mut daemon, None);
    assert_whole(&record);
    record.to_bytes().unwrap();
}

/// Over CAN there is no line; a gateway that repeats its last fix for ever says nothing new.
#[test]
fn signals_that_stop_or_only_repeat_are_told() {
    let messages = "\nBO_ 768 POS: 8 SENSOR\n SG_ Lat : 0|32@1- (0.0000001,0) [-90|90] \"deg\" BRAKES\n \
        SG_ Lon : 32|32@1- (0.0000001,0) [-180|180] \"deg\" BRAKES\n\
        \nBO_ 770 CLOCK: 8 SENSOR\n SG_ Utc : 0|64@1+ (1,0) [0|0] \"ms\" BRAKES\n";
    let table =
        "[gnss]\nlatitude = \"POS.Lat\"\nlongitude = \"POS.Lon\"\nutc = \"CLOCK.Utc\"\n\n[run]";
    let dir = folder("gnss-signals");
    let dbc = support::etc().join("example.dbc");
    let own = dir.join("own.dbc");
    fs::write(&own, fs::read_to_string(&dbc).unwrap() + messages).unwrap();
    let mut log = Log::default();
    log.steady(0.0, 60.0, 100.0, 0.0);
    for k in 0..550_i32 {
        let t = 0.5 + f64::from(k) * 0.1;
        // After 3 s the same again and again.
        let k = k.min(30);
        let place = [480_000_000 + k, 110_000_000].map(i32::to_le_bytes);
        log.frame(t, "300", &place.concat());
        let utc_ms = support::EPOCH * 1000 + i64::from(k) * 100;
        log.frame(t + 0.001, "302", &utc_ms.to_le_bytes());
    }
    let changes = [
        (dbc.to_str().unwrap(), own.to_str().unwrap()),
        ("[run]", table),
    ];
    let mut daemon = Daemon::start(dir, log.text(), &changes);
    let status = daemon.until("fixes", |status| count(status, "fixes") > 5);
    assert!(
        status["gnss"]["open"].is_null() && !any_alarm(&status),
        "{status}"
    );
    let status = daemon.until("silence", |status| alarm(status, "said nothing new for"));
    assert_eq!(count(&status, "fixes"), 31);
    let screen = program(&daemon.dir, &["status", "--config", "recorder.toml"]);
    let screen = String::from_utf8(screen.stdout).unwrap();
    assert!(
        screen.contains("31 fixes, 0 without") && !screen.contains("sentences "),
        "{screen}"
    );
    daemon.stop();
}
