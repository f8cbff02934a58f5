//! The whole way of a satellite fix: a crash on the bus, sentences of a receiver beside it, the recorder's record, and the
//! place of rest on the earth.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use std::cell::RefCell;
use std::io::Cursor;

use reconstruct::export::geodesy::TangentPlane;
use reconstruct::findings::RestPose;
use reconstruct::map::place;
use reconstruct::run::{Options, reconstruct};
use reconstruct::simulate::Class;
use reconstruct::simulate::fixes::{Receiver, receive};
use reconstruct::simulate::nmea::log;
use recorder::config::Settings;
use recorder::replay::{LogInput, ReplayOptions, replay};
use schema::Record;
use schema::gnss::GnssSource;
use support::crash;
use support::pipeline;

const SECOND: i64 = 1_000_000_000;
const TABLE: &str = "[gnss]\ndevice = \"/dev/none\"\nlatency_ms = 150\nlatency_sd_ms = 30\n\
     antenna_position_m = [1.6, 0.0, -1.4]\n\n[ring]";

/// The first record of a log and of the sentences beside it.
fn seal(settings: &Settings, log: Vec<LogInput>, nmea: LogInput) -> Record {
    let records = RefCell::new(Vec::new());
    let options = ReplayOptions {
        nmea: Some(nmea),
        sink: Some(Box::new(|record| {
            records.borrow_mut().push(record.to_bytes().unwrap());
            Ok(())
        })),
        ..ReplayOptions::default()
    };
    replay(settings, log, options).unwrap();
    let bytes = records.into_inner().remove(0);
    Record::read(&bytes).unwrap().0
}

/// Fixes used and offered, how far from the true place of rest the record is laid, m, and the square of that in units of its
/// covariance.
fn rests(record: &Record, rest: [f64; 2]) -> ([usize; 2], f64, f64) {
    let options = Options {
        alone: true,
        ..Options::default()
    };
    let mut r = reconstruct(record, &options).unwrap();
    place::lay(&mut r);
    let gnss = r.gnss.as_ref().unwrap();
    let pose = gnss.pose.as_ref().unwrap();
    let [latitude_deg, longitude_deg] = rest;
    let truth = RestPose {
        latitude_deg,
        longitude_deg,
        heading_deg: 0.0,
        sd_m: 0.0,
        sd_deg: 0.0,
    };
    let [north, east] =
        TangentPlane::at(&truth).north_east(pose.rest.latitude_deg, pose.rest.longitude_deg);
    let c = &pose.covariance;
    let chi = (c[(1, 1)] * north * north - 2.0 * c[(0, 1)] * north * east
        + c[(0, 0)] * east * east)
        / (c[(0, 0)] * c[(1, 1)] - c[(0, 1)].powi(2));
    ([gnss.used, gnss.offered], north.hypot(east), chi)
}

/// `reconstruct simulate --receiver`: log, configuration and sentences as files, the true place in the facts.
#[test]
fn the_files_of_a_simulated_receiver_lead_to_the_place_of_rest() {
    let crash = crash::draw(Class::Frontal, 90_104);
    let folder = std::env::temp_dir().join(format!("svartboks-receiver-{}", std::process::id()));
    let receiver = Receiver {
        clock_off_s: Some(0.0),
        ..Receiver::default()
    };
    let paths = crash.simulated.write(&folder, Some(&receiver)).unwrap();
    let [log, _, config, _, facts, nmea] = paths.as_slice() else {
        panic!("expected six files, found {paths:?}");
    };
    let settings = Settings::load(config).unwrap();
    let [log, nmea] = [log, nmea].map(|path| LogInput::File(path.clone()));
    let record = seal(&settings, vec![log], nmea);
    let facts: serde_json::Value = serde_json::from_slice(&std::fs::read(facts).unwrap()).unwrap();
    let rest = ["latitude_deg", "longitude_deg"].map(|k| facts["receiver"]["rest"][k].as_f64());
    let (used, off, chi) = rests(&record, rest.map(Option::unwrap));
    println!("{used:?} fixes used and offered, {off:.1} m off, chi-square {chi:.1}");
    assert!(used[0] > 30 && off < 9.0 && chi < 13.8);
    std::fs::remove_dir_all(&folder).unwrap();
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
            let text = log(&received.gnss.fixes, start * SECOND);
            let nmea = LogInput::Reader("receiver".to_owned(), Box::new(Cursor::new(text)));
            let record = seal(&settings, pipeline::input(crash.text()), nmea);
            let part = record.gnss.as_ref().unwrap();
            assert_eq!(part.sheet.source, GnssSource::Nmea);
            let placed = part.fixes.iter().filter(|f| f.position.is_some()).count();
            assert!(
                placed > 35 && part.sentences.len() >= 3 * placed,
                "{placed}"
            );
            let rest = [received.pose.latitude_deg, received.pose.longitude_deg];
            let (gnss, off, chi) = rests(&record, rest);
            println!(
                "{} {seed}: {} of {} fixes, {:.1} m off, chi-square {chi:.1}",
                class.name(),
                gnss[0],
                gnss[1],
                off
            );
            assert!(off < 9.0, "{off}");
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
