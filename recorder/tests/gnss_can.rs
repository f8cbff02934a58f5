//! Satellite fixes of signals on a CAN bus: velocities, UTC and quality, values that are marked as none, messages that are
//! multiplexed, late, short, or sent again.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::cell::RefCell;
use std::f64::consts::TAU;

use recorder::config::Settings;
use recorder::replay::{ReplayOptions, replay};
use schema::Record;
use schema::gnss::{Fix, FixQuality};
use schema::num;
use support::{EPOCH, Log, etc, input};

const S: i64 = 1_000_000_000;
const DBC: &str = r#"
BO_ 768 POS: 8 SENSOR
 SG_ Lat : 0|32@1- (0.0000001,0) [-90|90] "deg" BRAKES
 SG_ Lon : 32|32@1- (0.0000001,0) [-180|180] "deg" BRAKES

BO_ 769 VEL: 8 SENSOR
 SG_ North : 0|16@1- (0.01,0) [-100|100] "m/s" BRAKES
 SG_ East : 16|16@1- (0.01,0) [-100|100] "m/s" BRAKES
 SG_ Down : 32|16@1- (0.01,0) [-50|50] "m/s" BRAKES
 SG_ Speed : 48|16@1+ (0.01,0) [0|0] "m/s" BRAKES

BO_ 770 CLOCK: 8 SENSOR
 SG_ Utc : 0|64@1+ (1,0) [0|0] "ms" BRAKES

BO_ 771 STATE: 8 SENSOR
 SG_ Quality : 0|8@1+ (1,0) [0|0] "" BRAKES
 SG_ Satellites : 8|8@1+ (1,0) [0|64] "" BRAKES
 SG_ Hdop : 16|16@1+ (0.01,0) [0|99.99] "" BRAKES
 SG_ Sd : 32|16@1+ (0.01,0) [0|0] "m" BRAKES

BO_ 772 PAGES: 8 SENSOR
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" BRAKES
 SG_ Height m1 : 8|32@1- (0.001,0) [-1000|10000] "m" BRAKES
 SG_ Course m2 : 8|16@1+ (0.01,0) [0|360] "deg" BRAKES

BO_ 773 FLOATS: 8 SENSOR
 SG_ Height : 0|32@1- (1,0) [0|0] "m" BRAKES

SIG_VALTYPE_ 773 Height : 1;
"#;

const POSITION: &str = "[gnss]\nlatitude = \"POS.Lat\"\nlongitude = \"POS.Lon\"\n";

fn settings(keys: &str) -> Settings {
    let thread = format!("{:?}", std::thread::current().id());
    let dir = std::env::temp_dir().join(format!(
        "recorder-gnss-can-{}-{}",
        std::process::id(),
        thread.replace(['(', ')'], "")
    ));
    std::fs::create_dir_all(&dir).unwrap();
    let dbc = std::fs::read_to_string(etc().join("example.dbc")).unwrap();
    std::fs::write(dir.join("example.dbc"), dbc + DBC).unwrap();
    let text = std::fs::read_to_string(etc().join("recorder.toml")).unwrap();
    let text = format!("{text}\n{POSITION}{keys}");
    let settings = Settings::from_toml_str(&text, &dir).unwrap_or_else(|error| {
        unreachable!("{keys}: {error}");
    });
    std::fs::remove_dir_all(&dir).unwrap();
    settings
}

/// The record of a log of 8 s, all of it before and after a trigger at 4 s.
fn record(settings: &Settings, mut log: Log) -> Record {
    log.steady(0.0, 8.0, 100.0, 50.0);
    let records = RefCell::new(Vec::new());
    let options = ReplayOptions {
        trigger_at: vec![4.0],
        sink: Some(Box::new(|record| {
            records.borrow_mut().push(record);
            Ok(())
        })),
        ..ReplayOptions::default()
    };
    replay(settings, input(log.text()), options).unwrap();
    let record = records.into_inner().remove(0);
    assert_eq!(Record::read(&record.to_bytes().unwrap()).unwrap().0, record);
    record
}

fn fixes(record: &Record) -> &[Fix] {
    &record.gnss.as_ref().unwrap().fixes
}

fn notes(record: &Record) -> String {
    record.health.notes.join("\n")
}

/// Codes of a latitude near 48 and a longitude near 11 degrees.
fn position(number: i32) -> Vec<u8> {
    let codes = [480_000_000 + number, 110_000_000 + number];
    codes.iter().flat_map(|code| code.to_le_bytes()).collect()
}

/// Times of 60 fixes, each 100 ms, with their numbers.
fn epochs() -> impl Iterator<Item = (i32, f64)> {
    (0..60).map(|k| (k, 1.0 + f64::from(k) * 0.1))
}

fn shorts(values: &[i16]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

fn near(found: Option<f64>, expected: f64) {
    let found = found.unwrap();
    assert!((found - expected).abs() < 1e-6, "{found}, not {expected}");
}

#[test]
fn velocities_give_speed_course_and_climb() {
    let settings =
        settings("v_north = \"VEL.North\"\nv_east = \"VEL.East\"\nv_down = \"VEL.Down\"\n");
    let mut log = Log::default();
    let (mut directions, mut expected) = (
        [(3, 4), (-3, 4), (-3, -4), (3, -4), (0, 0)].iter().cycle(),
        vec![],
    );
    for (k, t) in epochs() {
        let (north, east) = *directions.next().unwrap();
        expected.push((f64::from(north), f64::from(east)));
        log.frame(t, "300", &position(k));
        log.frame(
            t + 0.003,
            "301",
            &shorts(&[north * 100, east * 100, -50, 0]),
        );
    }
    let record = record(&settings, log);
    assert_eq!(fixes(&record).len(), 60);
    for (fix, (north, east)) in fixes(&record).iter().zip(expected) {
        assert_eq!(fix.quality, FixQuality::Unstated);
        near(fix.climb_mps, 0.5);
        near(fix.speed_mps, north.hypot(east));
        if north.hypot(east) > 0.0 {
            near(fix.course, east.atan2(north).rem_euclid(TAU));
        } else {
            assert_eq!(fix.course, None, "a car that stands has none");
        }
    }
    assert!(notes(&record).contains("neither valid nor quality is configured"));
}

#[test]
fn utc_quality_and_slow_messages_are_of_the_fix() {
    let settings = settings(
        "utc = \"CLOCK.Utc\"\nquality = \"STATE.Quality\"\nsatellites = \"STATE.Satellites\"\nhdop = \"STATE.Hdop\"\n\
         horizontal_sd = \"STATE.Sd\"\n",
    );
    let mut log = Log::default();
    for (k, t) in epochs() {
        log.frame(t, "300", &position(k));
        // UTC is 80 ms behind the receive time, in its own message before or after.
        let utc_ms = EPOCH * 1000 + num::round_i64(t * 1000.0) - 80;
        let at = if k % 2 == 0 { t - 0.006 } else { t + 0.006 };
        log.frame(at, "302", &utc_ms.to_le_bytes());
        // The state each 500 ms, of the next five fixes; it ends after 3 s.
        if k % 5 == 0 && k < 30 {
            let quality = [4, 5, 0, 9, 255, 8][usize::try_from(k / 5).unwrap()];
            log.frame(t - 0.05, "303", &[quality, 11, 0x46, 0, 0x64, 0, 0, 0]);
        }
    }
    let record = record(&settings, log);
    assert_eq!(fixes(&record).len(), 60);
    let mut seen = Vec::new();
    for (fix, (k, t)) in fixes(&record).iter().zip(epochs()) {
        let utc_ns = EPOCH * S + num::round_i64(t * 1000.0 - 80.0) * 1_000_000;
        assert!((fix.utc_ns.unwrap() - utc_ns).abs() < 1000, "{k}");
        // Numbers that are no quality, and a word older than 2 s, are no fix.
        let quality = match k / 5 {
            0 => FixQuality::RtkFixed,
            1 => FixQuality::RtkFloat,
            5..=8 => FixQuality::Simulated,
            9 if k == 44 => FixQuality::Simulated,
            _ => FixQuality::None,
        };
        assert_eq!(fix.quality, quality, "{k}");
        assert_eq!(fix.position.is_some(), quality != FixQuality::None);
        seen.push(quality);
        if quality != FixQuality::None {
            assert_eq!(fix.satellites, Some(11));
            near(fix.hdop, 0.7);
            near(fix.horizontal_m2.map(|[north, _, _]| north), 1.0);
        }
    }
    assert!(seen.contains(&FixQuality::None));
}

#[test]
fn values_that_are_marked_as_none_are_missing_and_no_position_is_no_fix() {
    let settings = settings(
        "v_north = \"VEL.North\"\nv_east = \"VEL.East\"\nv_down = \"VEL.Down\"\nheight = \"FLOATS.Height\"\n\
         quality = \"STATE.Quality\"\nsatellites = \"STATE.Satellites\"\nhdop = \"STATE.Hdop\"\n",
    );
    let mut log = Log::default();
    let none = i16::MIN;
    for (k, t) in epochs() {
        let there = k % 2 == 0;
        let nowhere = [0x7FFF_FFFF_u32, 0x7FFF_FFFF]
            .map(u32::to_le_bytes)
            .concat();
        log.frame(t, "300", &if k % 6 == 5 { nowhere } else { position(k) });
        let velocity = if there {
            [1000, 0, 100, 0]
        } else {
            [none, none, none, 0]
        };
        log.frame(t + 0.001, "301", &shorts(&velocity));
        let height = if there { 520.5_f32 } else { f32::NAN };
        log.frame(t + 0.002, "305", &height.to_le_bytes());
        let state = if there {
            [1, 9, 0x46, 0]
        } else {
            [1, 255, 0xFF, 0xFF]
        };
        log.frame(t + 0.003, "303", &[&state[..], &[0; 4]].concat());
    }
    let record = record(&settings, log);
    assert_eq!(fixes(&record).len(), 60, "that there is no fix is told too");
    for (fix, (k, _)) in fixes(&record).iter().zip(epochs()) {
        let there = k % 2 == 0;
        assert_eq!(fix.position.is_some(), k % 6 != 5, "{k}");
        assert_eq!(fix.satellites.is_some(), there, "{k}");
        assert_eq!(fix.hdop.is_some(), there, "{k}");
        if k % 6 == 5 {
            assert_eq!(fix.quality, FixQuality::None);
            continue;
        }
        assert_eq!(fix.quality, FixQuality::Autonomous);
        for value in [fix.speed_mps, fix.course, fix.climb_mps, fix.height_m] {
            assert_eq!(value.is_some(), there, "{k}: {fix:?}");
        }
    }
    let notes = notes(&record);
    assert!(notes.contains("values are marked as none"), "{notes}");
    assert!(
        notes.contains("50 fixes with a position and 10 epochs"),
        "{notes}"
    );
}

#[test]
fn what_no_car_does_is_missing_where_the_dbc_states_no_range() {
    let settings = settings("speed = \"VEL.Speed\"\ncourse = \"PAGES.Course\"\n");
    let mut log = Log::default();
    for (k, t) in epochs() {
        log.frame(t, "300", &position(k));
        let speed = if k % 2 == 0 { 1400 } else { -1 };
        log.frame(t + 0.001, "301", &shorts(&[0, 0, 0, speed]));
        let course = if k % 2 == 0 { 27_000_u16 } else { u16::MAX };
        log.frame(
            t + 0.002,
            "304",
            &[&[2], &course.to_le_bytes()[..], &[0; 5]].concat(),
        );
    }
    let record = record(&settings, log);
    for (fix, (k, _)) in fixes(&record).iter().zip(epochs()) {
        assert!(fix.position.is_some());
        let expected = (k % 2 == 0).then_some(14.0);
        assert_eq!(fix.speed_mps.map(f64::round), expected);
        assert_eq!(fix.course.is_some(), k % 2 == 0, "{fix:?}");
    }
}

#[test]
fn pages_of_a_multiplexed_message_and_late_messages_find_their_fix_or_none() {
    let settings =
        settings("height = \"PAGES.Height\"\ncourse = \"PAGES.Course\"\nspeed = \"VEL.Speed\"\n");
    let mut log = Log::default();
    for (k, t) in epochs() {
        log.frame(t, "300", &position(k));
        // Height and course on pages of their own, a third page that carries neither, each with other bytes behind.
        let height = (500_000 + k).to_le_bytes();
        let course = 9000_u16.to_le_bytes();
        log.frame(t + 0.002, "304", &[&[1], &height[..], &[0xFF; 3]].concat());
        log.frame(t + 0.004, "304", &[&[2], &course[..], &[0xFF; 5]].concat());
        log.frame(t + 0.006, "304", &[3, 1, 2, 3, 4, 5, 6, 7]);
        // Each third speed comes 40 ms late: it is of no fix, least of all of the next.
        let late = if k % 3 == 0 { 0.04 } else { 0.01 };
        log.frame(
            t + late,
            "301",
            &shorts(&[0, 0, 0, 100 + i16::try_from(k).unwrap()]),
        );
        // A page that is cut short says nothing.
        log.frame(t + 0.05, "304", &[1, 0]);
    }
    let record = record(&settings, log);
    assert_eq!(fixes(&record).len(), 60);
    for (fix, (k, t)) in fixes(&record).iter().zip(epochs()) {
        near(fix.height_m, 500.0 + f64::from(k) / 1000.0);
        near(fix.course, TAU / 4.0);
        match fix.speed_mps {
            None => assert_eq!(k % 3, 0),
            speed => near(speed, 1.0 + f64::from(k) / 100.0),
        }
        let at_ns = fix.monotonic_ns + record.header.clock.offset_ns - EPOCH * S;
        assert!((at_ns - num::round_i64(t * 1e9)).abs() < 1000, "{k}");
    }
    assert_eq!(record.health.malformed, 60, "of short frames");
}

#[test]
fn a_fix_that_is_sent_again_is_one_and_a_clock_that_shows_seconds_loses_none() {
    let settings = settings("utc = \"CLOCK.Utc\"\nutc_unit = \"s\"\n");
    for again in [true, false] {
        let mut log = Log::default();
        for (k, t) in epochs() {
            // A gateway that repeats each second's fix ten times, or a receiver of 10 Hz whose clock shows seconds.
            log.frame(t, "300", &position(if again { k / 10 } else { k }));
            let seconds = EPOCH + 1 + i64::from(k / 10);
            log.frame(t + 0.001, "302", &seconds.to_le_bytes());
        }
        let record = record(&settings, log);
        assert_eq!(fixes(&record).len(), if again { 6 } else { 60 });
        let notes = notes(&record);
        assert_eq!(
            notes.contains("54 fixes repeat UTC and place"),
            again,
            "{notes}"
        );
    }
}

/// Without a date UTC is of the day that the recorder's clock is nearest to.
#[test]
fn a_time_of_day_passes_midnight() {
    let settings = settings("time_of_day = \"CLOCK.Utc\"\n");
    let mut log = Log::default();
    // The log begins at 22:13:20; the receiver says that it is 2 s before midnight then.
    for (k, t) in epochs() {
        log.frame(t, "300", &position(k));
        let ms = (86_398_000 + num::round_i64(t * 1000.0)) % 86_400_000;
        log.frame(t + 0.001, "302", &ms.to_le_bytes());
    }
    let record = record(&settings, log);
    let midnight = EPOCH / 86_400 * 86_400 + 86_400;
    for (fix, (_, t)) in fixes(&record).iter().zip(epochs()) {
        let utc_ns = (midnight - 2) * S + num::round_i64(t * 1000.0) * 1_000_000;
        assert!((fix.utc_ns.unwrap() - utc_ns).abs() < 1000);
    }
    assert!(notes(&record).contains("UTC and the recorder's clock differ by up to +6398"));
}
