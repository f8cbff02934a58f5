//! The whole way of a satellite fix: a crash on the bus, sentences of a receiver beside it, the recorder's record, and the
//! place of rest on the earth.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use std::cell::RefCell;
use std::fmt::Write;
use std::io::Cursor;

use reconstruct::export::geodesy::TangentPlane;
use reconstruct::map::place;
use reconstruct::run::{Options, reconstruct};
use reconstruct::simulate::Class;
use reconstruct::simulate::fixes::{Receiver, receive};
use recorder::config::Settings;
use recorder::nmea::checksum;
use recorder::replay::{LogInput, ReplayOptions, replay};
use schema::Record;
use schema::gnss::{Fix, GnssSource};
use schema::num::{real_i64, round_i64};
use schema::time::Stamp;
use support::crash::{self, Crash};
use support::pipeline;

const SECOND: i64 = 1_000_000_000;
const TABLE: &str = "[gnss]\ndevice = \"/dev/none\"\nlatency_ms = 150\nlatency_sd_ms = 30\n\
     antenna_position_m = [1.6, 0.0, -1.4]\n\n[ring]";

/// Degrees and minutes, and the hemisphere.
fn angle(rad: f64, digits: usize, letters: [&str; 2]) -> String {
    let degrees = rad.abs().to_degrees();
    let whole = round_i64(degrees.floor());
    let minutes = (degrees - real_i64(whole)) * 60.0;
    format!(
        "{whole:0digits$}{minutes:010.7},{}",
        letters[usize::from(rad < 0.0)]
    )
}

/// RMC, GGA and GST of a fix.
fn sentences(fix: &Fix) -> Vec<String> {
    let utc = fix.utc_ns.unwrap();
    let stamp = Stamp::from_utc_ns(utc);
    let time = format!(
        "{:02}{:02}{:02}.{:03}",
        stamp.hour,
        stamp.minute,
        stamp.second,
        utc.rem_euclid(SECOND) / 1_000_000
    );
    let date = format!("{:02}{:02}{:02}", stamp.day, stamp.month, stamp.year % 100);
    let Some([latitude, longitude]) = fix.position else {
        return vec![
            format!("GPRMC,{time},V,,,,,,,{date},,,N"),
            format!("GPGGA,{time},,,,,0,00,,,M,,M,,"),
        ];
    };
    let place = format!(
        "{},{}",
        angle(latitude, 2, ["N", "S"]),
        angle(longitude, 3, ["E", "W"])
    );
    let knots = fix.speed_mps.unwrap() * 3600.0 / 1852.0;
    let course = fix.course.unwrap().to_degrees();
    let sd = fix.horizontal_m2.unwrap()[0].sqrt();
    vec![
        format!("GPRMC,{time},A,{place},{knots:.3},{course:.2},{date},,,A"),
        format!("GPGGA,{time},{place},1,09,0.9,150.0,M,40.0,M,,"),
        format!("GPGST,{time},1.0,,,,{sd:.2},{sd:.2},5.0"),
    ]
}

/// Sentences as a log on the clock of the frames.
fn log(fixes: &[Fix], start_unix_s: i64) -> String {
    let mut out = String::new();
    for fix in fixes {
        let at = fix.monotonic_ns + start_unix_s * SECOND;
        for body in sentences(fix) {
            let sum = checksum(body.as_bytes());
            let (seconds, rest) = (at.div_euclid(SECOND), at.rem_euclid(SECOND) / 1000);
            writeln!(out, "({seconds}.{rest:06}) ${body}*{sum:02X}").unwrap();
        }
    }
    out
}

fn seal(crash: &Crash, settings: &Settings, nmea: &str) -> Record {
    let records = RefCell::new(Vec::new());
    let options = ReplayOptions {
        nmea: Some(LogInput::Reader(
            "receiver".to_owned(),
            Box::new(Cursor::new(nmea.to_owned())),
        )),
        sink: Some(Box::new(|record| {
            records.borrow_mut().push(record.to_bytes().unwrap());
            Ok(())
        })),
        ..ReplayOptions::default()
    };
    replay(settings, pipeline::input(crash.text()), options).unwrap();
    let bytes = records.into_inner().remove(0);
    Record::read(&bytes).unwrap().0
}

#[test]
fn a_crash_with_a_receiver_comes_to_rest_where_it_did() {
    let receiver = Receiver {
        clock_off_s: Some(0.0),
        ..Receiver::default()
    };
    let mut inside = 0;
    let mut count = 0;
    for class in [Class::Frontal, Class::Side, Class::Double, Class::Oblique] {
        for seed in 90_101..=90_102 {
            let crash = crash::draw(class, seed);
            let start = crash.simulated.truth.facts.start_unix_s;
            let received = receive(&crash.simulated, &receiver, seed, 0, start * SECOND);
            let settings = crash::settings(&crash.simulated, &[("[ring]", TABLE)]);
            let record = seal(&crash, &settings, &log(&received.gnss.fixes, start));
            let part = record.gnss.as_ref().unwrap();
            assert_eq!(part.sheet.source, GnssSource::Nmea);
            let placed = part.fixes.iter().filter(|f| f.position.is_some()).count();
            assert!(
                placed > 35 && part.sentences.len() >= 3 * placed,
                "{placed}"
            );
            let mut r = reconstruct(
                &record,
                &Options {
                    alone: true,
                    ..Options::default()
                },
            )
            .unwrap();
            place::lay(&mut r);
            let gnss = r.gnss.as_ref().unwrap();
            let pose = gnss.pose.as_ref().unwrap();
            let [north, east] = TangentPlane::at(&received.pose)
                .north_east(pose.rest.latitude_deg, pose.rest.longitude_deg);
            let c = &pose.covariance;
            let chi = (c[(1, 1)] * north * north - 2.0 * c[(0, 1)] * north * east
                + c[(0, 0)] * east * east)
                / (c[(0, 0)] * c[(1, 1)] - c[(0, 1)].powi(2));
            println!(
                "{} {seed}: {} of {} fixes, {:.1} m off, chi-square {chi:.1}",
                class.name(),
                gnss.used,
                gnss.offered,
                north.hypot(east)
            );
            assert!(north.hypot(east) < 9.0, "{north} {east}");
            count += 1;
            inside += usize::from(chi < 5.991);
        }
    }
    assert!(inside + 1 >= count, "{inside} of {count}");
}

#[test]
fn without_a_table_no_position_is_kept() {
    let crash = crash::draw(Class::Rear, 90_103);
    let record = pipeline::record(&crash.settings, crash.text(), &[])
        .records
        .remove(0);
    assert!(record.gnss.is_none());
}
