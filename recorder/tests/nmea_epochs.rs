//! Sentences become fixes: random ones there and back, what belongs together, midnight, leap day and leap second, week
//! numbers that begin again, a receiver that says the same again and again.
#![allow(clippy::unwrap_used, reason = "tests")]

mod receiver;
mod support;

use std::cell::RefCell;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::io::Cursor;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use receiver::{log, sentence};
use recorder::nmea::{Epochs, Message, Reading, Text, read};
use recorder::replay::{LogInput, ReplayOptions, replay};
use schema::Record;
use schema::gnss::{Fix, FixQuality};
use schema::num;
use schema::time::Stamp;
use support::{EPOCH, Log, input, settings};

const S: i64 = 1_000_000_000;
const MS: i64 = 1_000_000;
const DAY: i64 = 86_400 * S;
const KNOT: f64 = 1852.0 / 3600.0;

fn message(body: &str) -> ([u8; 2], Message) {
    let text = sentence(body);
    let text = Text::new(text.as_bytes()).unwrap_or_else(|| unreachable!("{text}"));
    match read(&text) {
        Reading::Message(talker, message) => (talker, message),
        other => unreachable!("{body}: {other:?}"),
    }
}

/// The fixes of bodies that come at these times, ms, by a receiver of a recorder whose clock says this at 0.
fn fixes(clock_ns: i64, bodies: &[(i64, String)]) -> Vec<Fix> {
    let mut epochs = Epochs::default();
    epochs.clock_offset_ns = clock_ns;
    let mut fixes = Vec::new();
    for (at_ms, body) in bodies {
        let (talker, message) = message(body);
        let at_ns = at_ms * MS;
        fixes.extend(epochs.take((at_ns, at_ns + 10 * MS), talker, &message));
    }
    let preview = epochs.preview();
    let last = epochs.advance(i64::MAX / 2);
    assert_eq!(preview, last, "what still grows is shown as it stands");
    fixes.extend(last);
    fixes
}

fn utc(date: (u16, u8, u8), seconds: i64) -> i64 {
    let (year, month, day) = date;
    let stamp = Stamp {
        year,
        month,
        day,
        hour: 0,
        minute: 0,
        second: 0,
    };
    (stamp.to_utc_s() + seconds) * S
}

fn times(fixes: &[Fix]) -> Vec<i64> {
    fixes.iter().map(|fix| fix.utc_ns.unwrap()).collect()
}

fn rmc(time: &str, date: &str) -> String {
    format!("GNRMC,{time},A,4807.0380,N,01131.0000,E,10,90,{date},,,A")
}

fn gga(time: &str) -> String {
    format!("GNGGA,{time},4807.0380,N,01131.0000,E,1,12,0.7,500.0,M,46.0,M,,")
}

/// A value as a receiver writes it, or an empty field one time of five.
fn field(random: &mut ChaCha8Rng, low: f64, high: f64, digits: usize) -> (String, Option<f64>) {
    if random.random_bool(0.2) {
        return (String::new(), None);
    }
    let text = format!("{:.digits$}", random.random_range(low..high));
    let value = text.parse().unwrap();
    (text, Some(value))
}

fn angle(random: &mut ChaCha8Rng, most: i64, letters: [char; 2], width: usize) -> (String, f64) {
    // In units of 1e-5 minutes, so that the text is exact.
    let units = random.random_range(0..=most * 6_000_000);
    let (degrees, minutes) = (units / 6_000_000, units % 6_000_000);
    let negative = random.random_bool(0.5);
    let letter = letters[usize::from(negative)];
    let text = format!(
        "{degrees:0width$}{:02}.{:05},{letter}",
        minutes / 100_000,
        minutes % 100_000
    );
    let degrees = num::real_i64(units) / 6e6;
    (text, if negative { -degrees } else { degrees })
}

fn same(found: Option<f64>, written: Option<f64>, size: f64, what: &str) {
    match (found, written) {
        (None, None) => {}
        (Some(found), Some(written)) => {
            assert!(
                (found - written * size).abs() < 1e-9,
                "{what}: {found}, {written}"
            );
        }
        other => unreachable!("{what}: {other:?}"),
    }
}

#[test]
fn what_is_written_at_random_is_read_as_it_was_written() {
    let mut random = ChaCha8Rng::seed_from_u64(96_001);
    for _ in 0..3000 {
        let utc_ns = random.random_range(0..(2079 - 1970) * 365 * DAY) / (10 * MS) * 10 * MS;
        let at = Stamp::from_utc_ns(utc_ns);
        let centi = utc_ns.rem_euclid(S) / (10 * MS);
        let time = format!("{:02}{:02}{:02}.{centi:02}", at.hour, at.minute, at.second);
        // Two digits of the year: 80 to 99 are of the last century.
        let date = format!("{:02}{:02}{:02}", at.day, at.month, at.year % 100);
        let (north, latitude) = angle(&mut random, 90, ['N', 'S'], 2);
        let (east, longitude) = angle(&mut random, 180, ['E', 'W'], 3);
        let (knots_text, knots) = field(&mut random, 0.0, 150.0, 3);
        let (course_text, course) = field(&mut random, 0.0, 360.0, 2);
        let (hdop_text, hdop) = field(&mut random, 0.5, 50.0, 2);
        let (altitude_text, altitude) = field(&mut random, -400.0, 6000.0, 1);
        let (separation_text, separation) = field(&mut random, -105.0, 85.0, 1);
        let sd = [(); 3].map(|()| random.random_range(1..2000));
        let quality = random.random_range(1..=8_u8);
        let satellites = random.random_range(0..40_u8);
        let [north_sd, east_sd, up_sd] =
            sd.map(|centi| format!("{}.{:02}", centi / 100, centi % 100));
        let bodies = [
            format!("GNRMC,{time},A,{north},{east},{knots_text},{course_text},{date},,,A,V"),
            format!(
                "GNGGA,{time},{north},{east},{quality},{satellites:02},{hdop_text},{altitude_text},M,{separation_text},M,,"
            ),
            format!("GNGST,{time},1.1,,,,{north_sd},{east_sd},{up_sd}"),
        ];
        let lines: Vec<(i64, String)> = (0..).zip(bodies).map(|(k, body)| (k * 20, body)).collect();
        let fixes = fixes(0, &lines);
        let [fix] = fixes.as_slice() else {
            unreachable!("{lines:?}: {fixes:?}")
        };
        let expected = if (1980..2080).contains(&at.year) {
            utc_ns
        } else {
            utc((at.year + 100, at.month, at.day), 0) + utc_ns.rem_euclid(DAY)
        };
        assert_eq!(fix.utc_ns, Some(expected), "{lines:?}");
        assert_eq!(fix.quality, FixQuality::from_number(quality).unwrap());
        assert_eq!(fix.satellites, Some(satellites));
        let [found_north, found_east] = fix.position.unwrap();
        assert!(found_north.abs() <= FRAC_PI_2 && found_east.abs() <= PI);
        same(
            Some(found_north.to_degrees()),
            Some(latitude),
            1.0,
            "latitude",
        );
        same(
            Some(found_east.to_degrees()),
            Some(longitude),
            1.0,
            "longitude",
        );
        same(fix.speed_mps, knots, KNOT, "speed");
        same(fix.course, course, TAU / 360.0, "course");
        same(fix.hdop, hdop, 1.0, "hdop");
        let height = altitude.zip(separation).map(|(above, below)| above + below);
        same(fix.height_m, height, 1.0, "height");
        let [north_sd, east_sd, up_sd] = sd.map(|centi| f64::from(centi) / 100.0);
        let [nn, ee, ne] = fix.horizontal_m2.unwrap();
        same(Some(nn.sqrt()), Some(north_sd), 1.0, "north sd");
        same(Some(ee.sqrt()), Some(east_sd), 1.0, "east sd");
        assert!(ne.abs() < 1e-12);
        same(fix.height_sd_m, Some(up_sd), 1.0, "height sd");
    }
}

#[test]
fn midnight_is_passed_with_a_date_and_without_one() {
    let eve = utc((2023, 12, 31), 86_399);
    let expected = [eve, eve + S, eve + 2 * S];
    let dated = [
        (0, rmc("235959", "311223")),
        (1000, rmc("000000", "010124")),
        (2000, rmc("000001", "010124")),
    ];
    // A date once, before midnight; and by the recorder's clock alone, which is some seconds off.
    let once = [
        (0, "GNZDA,235959,31,12,2023,00,00".to_owned()),
        (10, gga("235959")),
        (1000, gga("000000")),
        (2000, gga("000001")),
    ];
    let never = [
        (0, gga("235959")),
        (1000, gga("000000")),
        (2000, gga("000001")),
    ];
    assert_eq!(times(&fixes(eve, &dated)), expected);
    assert_eq!(
        times(&fixes(0, &once)),
        expected,
        "whatever the recorder's clock says"
    );
    for off in [-30 * S, 0, 30 * S] {
        assert_eq!(times(&fixes(eve + off, &never)), expected);
    }
    // A day after its last date: midnight was passed without a word.
    let late = [(0, rmc("120000", "290224")), (86_400_000, gga("120000.5"))];
    let noon = utc((2024, 2, 29), 43_200);
    assert_eq!(times(&fixes(0, &late)), [noon, noon + DAY + S / 2]);
}

#[test]
fn leap_days_and_a_leap_second_have_their_place() {
    let leap = [
        (0, rmc("235959", "280224")),
        (1000, rmc("000000", "290224")),
        (86_401_000, rmc("000000", "010324")),
    ];
    let day = utc((2024, 2, 29), 0);
    assert_eq!(times(&fixes(0, &leap)), [day - S, day, day + DAY]);
    assert_eq!(
        times(&fixes(0, &[(0, rmc("000000", "290200"))])),
        [utc((2000, 2, 29), 0)]
    );
    // 2016-12-31 had 86,401 seconds. UTC as a count of seconds has no name for the last: it is that of midnight.
    let second = [
        (0, rmc("235959", "311216")),
        (1000, rmc("235960", "311216")),
        (2000, rmc("000000", "010117")),
    ];
    let new_year = utc((2017, 1, 1), 0);
    assert_eq!(
        times(&fixes(0, &second)),
        [new_year - S, new_year, new_year]
    );
}

#[test]
fn what_belongs_together_is_one_fix_whatever_the_order() {
    let time = "120000.20";
    let vtg = || "GNVTG,45,T,,M,20,N,37.04,K,A".to_owned();
    let gsa = |talker: &str| format!("{talker}GSA,A,3,23,29,07,,,,,,,,,,1.9,1.2,1.5");
    let gll = || format!("GNGLL,4807.0380,N,01131.0000,E,{time},A,A");
    let orders = [
        vec![
            rmc(time, "010124"),
            vtg(),
            gga(time),
            gsa("GP"),
            gsa("GL"),
            gll(),
        ],
        vec![vtg(), gga(time), rmc(time, "010124"), gsa("GA"), gll()],
        vec![
            gll(),
            gsa("GN"),
            gsa("GN"),
            gga(time),
            vtg(),
            rmc(time, "010124"),
        ],
    ];
    for order in orders {
        let mut lines = Vec::new();
        for second in 0..3 {
            for (at, body) in (0..).zip(&order) {
                let body = body.replace("120000", &format!("12000{second}"));
                lines.push((second * 1000 + at * 60, body));
            }
        }
        let fixes = fixes(0, &lines);
        let noon = utc((2024, 1, 1), 43_200) + S / 5;
        assert_eq!(times(&fixes), [noon, noon + S, noon + 2 * S], "{order:?}");
        for fix in &fixes {
            assert!(fix.position.is_some() && fix.height_m.is_some() && fix.hdop == Some(0.7));
            assert!(
                (fix.speed_mps.unwrap() - 10.0 * KNOT).abs() < 1e-9,
                "of RMC"
            );
        }
    }
    // The same instant of two systems is one fix; a sentence that denies it makes none of it.
    let twice = [
        (0, rmc(time, "010124")),
        (50, rmc(time, "010124").replace("GNRMC", "GLRMC")),
    ];
    assert_eq!(fixes(0, &twice).len(), 1);
    let denied = [
        (0, rmc(time, "010124")),
        (50, gga(time).replace(",E,1,", ",E,0,")),
    ];
    let fix = &fixes(0, &denied)[0];
    assert!(fix.position.is_none() && fix.quality == FixQuality::None);
    for (letter, quality) in [
        ('A', FixQuality::Autonomous),
        ('D', FixQuality::Differential),
        ('E', FixQuality::Estimated),
        ('F', FixQuality::RtkFloat),
        ('M', FixQuality::Manual),
        ('P', FixQuality::Precise),
        ('R', FixQuality::RtkFixed),
        ('S', FixQuality::Simulated),
    ] {
        let body = rmc(time, "010124").replace(",,,A", &format!(",,,{letter}"));
        assert_eq!(fixes(0, &[(0, body)])[0].quality, quality, "{letter}");
    }
    let none = rmc(time, "010124").replace(",,,A", ",,,N");
    assert_eq!(fixes(0, &[(0, none)])[0].position, None);
}

fn record(nmea: String) -> Record {
    let table = "[gnss]\ndevice = \"/dev/none\"\n\n[run]";
    let settings = settings(&[("[run]", table)]);
    let mut frames = Log::default();
    frames.steady(0.0, 12.0, 100.0, 50.0);
    let records = RefCell::new(Vec::new());
    let options = ReplayOptions {
        trigger_at: vec![5.0],
        nmea: Some(LogInput::Reader(
            "gnss".to_owned(),
            Box::new(Cursor::new(nmea)),
        )),
        sink: Some(Box::new(|record| {
            records.borrow_mut().push(record);
            Ok(())
        })),
        ..ReplayOptions::default()
    };
    replay(&settings, input(frames.text()), options).unwrap();
    records.into_inner().remove(0)
}

/// The record of a receiver that sends a fix each second, dated by so many days more than the recorder's clock.
fn dated(days: i64) -> Record {
    let mut lines = Vec::new();
    for second in 1..10_i64 {
        let at = Stamp::from_utc_ns((EPOCH + second) * S + days * DAY);
        let time = format!("{:02}{:02}{:02}", at.hour, at.minute, at.second);
        let date = format!("{:02}{:02}{:02}", at.day, at.month, at.year % 100);
        let t = num::real_i64(second) + 0.1;
        lines.push((t, rmc(&time, &date)));
        lines.push((t + 0.05, gga(&time)));
    }
    record(log(&lines))
}

#[test]
fn a_date_of_1024_weeks_ago_is_not_believed_and_any_other_difference_is_told() {
    for (weeks, note) in [
        (-1024, "dated 1024 weeks before"),
        (-2048, "dated 2048 weeks before"),
        (1024, "which of both is wrong can not be told"),
        (-1, "which of both is wrong can not be told"),
        (0, ""),
    ] {
        let record = dated(weeks * 7);
        let fixes = record.gnss.unwrap().fixes;
        assert_eq!(fixes.len(), 9, "{weeks}");
        let old = weeks <= -1024;
        for (fix, second) in fixes.iter().zip(1..) {
            let stated = (EPOCH + second) * S + weeks * 7 * DAY;
            assert_eq!(fix.utc_ns, Some(stated).filter(|_| !old), "{weeks}");
            assert!(fix.position.is_some());
        }
        let notes = record.health.notes.join("\n");
        assert!(notes.contains(note), "{weeks}: {notes}");
        assert_eq!(notes.contains("differ by"), !old && weeks != 0, "{notes}");
    }
}

/// Some receivers send their last fix on and on when they have no new one.
#[test]
fn a_fix_that_is_said_again_is_no_further_fix() {
    let mut lines = Vec::new();
    for second in 1..10 {
        let t = f64::from(second) + 0.1;
        let time = format!("2213{}", 20 + second.min(4));
        lines.push((t, rmc(&time, "141123")));
        lines.push((t + 0.05, gga(&time)));
    }
    let record = record(log(&lines));
    let part = record.gnss.as_ref().unwrap();
    assert_eq!(part.sentences.len(), 18, "what was said is kept");
    let expected: Vec<i64> = (1..5).map(|second| (EPOCH + second) * S).collect();
    assert_eq!(times(&part.fixes), expected);
    let notes = record.health.notes.join("\n");
    assert!(notes.contains("5 fixes repeat"), "{notes}");
}
