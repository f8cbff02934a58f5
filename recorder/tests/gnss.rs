//! Satellite fixes: sentences decoded, replayed from CAN and from NMEA 0183, read back from the spool; wrong tables.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::cell::RefCell;
use std::fmt::Write as _;
use std::io::Cursor;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recorder::config::Settings;
use recorder::nmea::{Framer, Heard, Message, Reading, Text, checksum, read};
use recorder::replay::{LogInput, ReplayOptions, replay};
use schema::Record;
use schema::gnss::FixQuality;
use support::{EPOCH, Log, etc, input};

fn sentence(body: &str) -> String {
    format!("${body}*{:02X}", checksum(body.as_bytes()))
}

fn hear(bytes: &[u8]) -> Vec<Heard> {
    let mut framer = Framer::default();
    bytes.iter().filter_map(|b| framer.push(*b, 0)).collect()
}

const STREAM: &str = "\u{0}junk$GPRMC,1$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n\
    $GPGGA,123519,A*00\r\n$GPXXX,1*no\r\n$GNGST,123519.00,1.0,,,,2.0,3.0,4.0*7F\r\n";

#[test]
fn split_and_mutated_streams_give_sentences_or_counts() {
    let whole = hear(STREAM.as_bytes());
    assert!(whole.len() >= 4, "{whole:?}");
    let Heard::Sentence { text, .. } = whole[1] else {
        unreachable!("{whole:?}");
    };
    let Reading::Message(talker, Message::Rmc(rmc)) = read(&text) else {
        unreachable!("{text:?}");
    };
    assert_eq!((talker, rmc.valid), (*b"GP", true));
    let [latitude, longitude] = rmc.position.unwrap();
    assert!((latitude.to_degrees() - (48.0 + 7.038 / 60.0)).abs() < 1e-12);
    assert!((longitude.to_degrees() - (11.0 + 31.0 / 60.0)).abs() < 1e-12);
    assert!((rmc.speed.unwrap() - 22.4 * 1852.0 / 3600.0).abs() < 1e-12);
    let mut random = ChaCha8Rng::seed_from_u64(91_001);
    for round in 0..20_000 {
        let mut bytes = STREAM.as_bytes().to_vec();
        for _ in 0..random.random_range(0..6) {
            let at = random.random_range(0..bytes.len());
            bytes[at] = random.random();
        }
        bytes.truncate(random.random_range(0..=bytes.len()));
        let heard = hear(&bytes);
        for heard in heard {
            if let Heard::Sentence { text, .. } = heard {
                let _ = read(&text);
            }
        }
        // A field changed under a checksum put right again reaches the decoder.
        let mut body = text.body().to_vec();
        let at = random.random_range(0..body.len());
        body[at] = random.random_range(0x20..0x7f);
        let body = String::from_utf8(body).unwrap();
        if let Some(text) = Text::new(sentence(&body).as_bytes()) {
            let _ = read(&text);
        }
        assert!(round < 20_000);
    }
}

const CAN: &str = "[gnss]\nlatitude = \"POS.Lat\"\nlongitude = \"POS2.Lon\"\nspeed = \"POS2.Speed\"\nvalid = \"POS2.Valid\"\nvalid_equals = 1\n";
const NMEA: &str = "[gnss]\ndevice = \"/dev/none\"\n";

/// What the example in the sample configuration names.
const EXAMPLE: &str = r#"
BO_ 774 GPS: 16 SENSOR
 SG_ Latitude : 0|32@1- (0.0000001,0) [-90|90] "" BRAKES
 SG_ Longitude : 32|32@1- (0.0000001,0) [-180|180] "" BRAKES
 SG_ Height : 64|24@1- (0.01,0) [0|0] "m" BRAKES
 SG_ North : 88|16@1- (0.01,0) [0|0] "m/s" BRAKES
 SG_ East : 104|16@1- (0.01,0) [0|0] "m/s" BRAKES

BO_ 775 GPS_TIME: 8 SENSOR
 SG_ Utc : 0|42@1+ (1,0) [0|0] "ms" BRAKES
 SG_ Quality : 42|4@1+ (1,0) [0|15] "" BRAKES
 SG_ Valid : 46|1@1+ (1,0) [0|1] "" BRAKES
 SG_ Satellites : 47|8@1+ (1,0) [0|255] "" BRAKES
"#;

fn settings(table: &str) -> Result<Settings, recorder::config::ConfigError> {
    let dir = std::env::temp_dir().join(format!("recorder-gnss-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let dbc = std::fs::read_to_string(etc().join("example.dbc")).unwrap();
    let dbc = format!(
        "{dbc}\nBO_ 768 POS: 4 SENSOR\n SG_ Lat : 0|32@1- (0.0000001,0) [0|0] \"deg\" BRAKES\n\
         \nBO_ 769 POS2: 7 SENSOR\n SG_ Lon : 0|32@1- (0.0000001,0) [0|0] \"deg\" BRAKES\n \
         SG_ Speed : 32|16@1+ (0.01,0) [0|0] \"m/s\" BRAKES\n SG_ Valid : 48|1@1+ (1,0) [0|1] \"\" BRAKES\n{EXAMPLE}"
    );
    let path = dir.join("gnss.dbc");
    if !path.exists() {
        let part = dir.join(format!("{:?}.part", std::thread::current().id()));
        std::fs::write(&part, dbc).unwrap();
        std::fs::rename(&part, &path).unwrap();
    }
    let text = std::fs::read_to_string(etc().join("recorder.toml")).unwrap();
    let text = text.replace("example.dbc\"", "gnss.dbc\"") + "\n" + table;
    Settings::from_toml_str(&text, &dir)
}

fn seal(settings: &Settings, log: Log, nmea: Option<String>) -> Record {
    seal_text(settings, log.text(), nmea)
}

fn seal_text(settings: &Settings, log: String, nmea: Option<String>) -> Record {
    let records = RefCell::new(Vec::new());
    let options = ReplayOptions {
        trigger_at: vec![5.0],
        nmea: nmea.map(|text| LogInput::Reader("gnss".to_owned(), Box::new(Cursor::new(text)))),
        sink: Some(Box::new(|record| {
            records.borrow_mut().push(record);
            Ok(())
        })),
        ..ReplayOptions::default()
    };
    replay(settings, input(log), options).unwrap();
    let record = records.into_inner().remove(0);
    assert_eq!(Record::read(&record.to_bytes().unwrap()).unwrap().0, record);
    record
}

fn drive() -> Log {
    let mut log = Log::default();
    log.steady(0.0, 8.0, 100.0, 50.0);
    log
}

#[test]
fn fixes_of_can_are_kept_and_halves_of_two_epochs_never_meet() {
    let mut log = drive();
    for k in 0..70_i32 {
        let t = 0.5 + f64::from(k) * 0.1;
        // Both count with the epoch; the latitude of each seventh is lost, each fifth is not valid.
        if k % 7 != 3 {
            log.frame(t, "300", &(480_000_000 + k).to_le_bytes());
        }
        let mut data = (110_000_000 + k).to_le_bytes().to_vec();
        data.extend([0xE8, 0x03, u8::from(k % 5 != 0)]);
        log.frame(t + 0.004, "301", &data);
    }
    let record = seal(&settings(CAN).unwrap(), log, None);
    let part = record.gnss.unwrap();
    assert_eq!((part.fixes.len(), part.sentences.len()), (60, 0));
    for fix in &part.fixes {
        let Some([latitude, longitude]) = fix.position else {
            assert_eq!(fix.quality, FixQuality::None);
            continue;
        };
        let epoch = |angle: f64, base: f64| ((angle.to_degrees() - base) * 1e7).round();
        assert!((epoch(latitude, 48.0) - epoch(longitude, 11.0)).abs() < 0.5);
        assert!((fix.speed_mps.unwrap() - 10.0).abs() < 1e-9);
    }
    let valid = part.fixes.iter().filter(|fix| fix.position.is_some());
    assert_eq!(valid.count(), 48);
}

#[test]
fn sentences_are_replayed_and_what_is_no_fix_has_no_position() {
    let mut text = String::new();
    for k in 1..8 {
        // 1700000000 is 2023-11-14 22:13:20 UTC.
        let (status, quality) = if k == 4 { ("V", 0) } else { ("A", 4) };
        let time = format!("2213{}.00", 20 + k);
        for body in [
            format!("GNRMC,{time},{status},4807.0380,N,01131.0000,E,019.4,084.4,141123,,,R,V"),
            format!("GNGGA,{time},4807.0380,N,01131.0000,E,{quality},12,0.7,500.0,M,46.0,M,,"),
            format!("GNGST,{time},1.0,,,,0.5,0.4,0.9"),
        ] {
            writeln!(text, "({}.100000) {}", EPOCH + k, sentence(&body)).unwrap();
        }
    }
    let nmea = settings(NMEA).unwrap();
    let record = seal(&nmea, drive(), Some(text));
    let part = record.gnss.unwrap();
    assert_eq!((part.fixes.len(), part.sentences.len()), (7, 21));
    for (fix, k) in part.fixes.iter().zip(1_i64..) {
        assert_eq!(fix.utc_ns, Some((EPOCH + k) * 1_000_000_000));
        assert_eq!(fix.position.is_some(), k != 4);
        if k != 4 {
            assert_eq!(fix.quality, FixQuality::RtkFixed);
            assert!((fix.height_m.unwrap() - 546.0).abs() < 1e-9);
            assert!((fix.horizontal_m2.unwrap()[0] - 0.25).abs() < 1e-12);
        }
    }
    let silent = seal(&nmea, drive(), None);
    assert!(silent.gnss.unwrap().fixes.is_empty());
    let notes = silent.health.notes.join("\n");
    assert!(notes.contains("was not replayed"), "{notes}");
    assert!(seal(&settings("").unwrap(), drive(), None).gnss.is_none());
}

/// One frame whose stamp is garbage is dropped; the sentences that come before that time are not read over for it.
#[test]
fn a_stray_frame_takes_no_sentence_away() {
    let mut text = String::new();
    for k in 1..30 {
        let body = format!(
            "GNRMC,2213{}.00,A,4807.0380,N,01131.0000,E,0,,141123,,,A",
            20 + k
        );
        writeln!(text, "({}.100000) {}", EPOCH + k, sentence(&body)).unwrap();
    }
    let nmea = settings(NMEA).unwrap();
    for (stray, place) in [(9000.0, 400), (30.0, 400), (-9000.0, 400), (9000.0, 0)] {
        let mut stamp = Log::default();
        stamp.frame(stray, "120", &[0; 8]);
        let mut drive = Log::default();
        drive.steady(0.0, 40.0, 100.0, 50.0);
        let mut lines: Vec<String> = drive.text().lines().map(str::to_owned).collect();
        lines.insert(place, stamp.text().trim_end().to_owned());
        let record = seal_text(&nmea, lines.join("\n") + "\n", Some(text.clone()));
        let part = record.gnss.unwrap();
        assert_eq!(
            (part.fixes.len(), part.sentences.len()),
            (29, 29),
            "{stray} s, line {place}"
        );
    }
}

/// The clock of the logs is set back by an hour while a sentence is on its way: it is lost, what follows is not.
#[test]
fn a_clock_set_back_holds_up_no_sentence() {
    let shift = |seconds: i64| if seconds < 15 { 0 } else { -3600 };
    let mut frames = String::new();
    let mut drive = Log::default();
    drive.steady(0.0, 40.0, 100.0, 50.0);
    for line in drive.text().lines() {
        let (stamp, rest) = line[1..].split_once(')').unwrap();
        let (s, ns) = stamp.split_once('.').unwrap();
        let s: i64 = s.parse().unwrap();
        writeln!(frames, "({}.{ns}){rest}", s + shift(s - EPOCH)).unwrap();
    }
    let mut text = String::new();
    for k in 1..30 {
        let body = format!(
            "GNRMC,2213{}.00,A,4807.0380,N,01131.0000,E,0,,141123,,,A",
            20 + k
        );
        // The one of the fifteenth second comes behind the last frame of the clock before.
        let at = if k == 15 {
            "14.999999".to_owned()
        } else {
            format!("{}.1", k + shift(k))
        };
        let (s, part) = at.split_once('.').unwrap();
        let s = EPOCH + s.parse::<i64>().unwrap();
        writeln!(text, "({s}.{part}) {}", sentence(&body)).unwrap();
    }
    let record = seal_text(&settings(NMEA).unwrap(), frames, Some(text));
    let part = record.gnss.unwrap();
    assert_eq!((part.fixes.len(), part.sentences.len()), (28, 28));
    assert_eq!(record.health.clock_steps.len(), 1);
}

#[test]
fn a_wrong_table_is_named() {
    let cases = [
        ("[gnss]\n", "found neither"),
        (
            "[gnss]\ndevice = \"/dev/x\"\nlatitude = \"POS.Lat\"\n",
            "found both",
        ),
        ("[gnss]\nlatitude = \"POS.Lat\"\n", "longitude beside it"),
        ("[gnss]\ndevise = \"/dev/x\"\n", "`device`"),
        ("[gnss]\ndevice = \"/dev/x\"\nbaud = 7\n", "1200 to 921600"),
        (
            "[gnss]\nlatitude = \"POS.Lat\"\nlongitude = \"POS2.Speed\"\n",
            "angle",
        ),
        (
            "[gnss]\nlatitude = \"POS.Lat\"\nlongitude = \"POS2.Lon\"\nvalid = \"POS2.Valid\"\n",
            "valid_equals",
        ),
    ];
    for (table, expected) in cases {
        let message = settings(table).unwrap_err().to_string();
        assert!(message.contains(expected), "{table}: {message}");
    }
}

/// The example in the sample configuration, with so many marks of a comment taken off.
fn example(marks: usize) -> String {
    let text = std::fs::read_to_string(etc().join("recorder.toml")).unwrap();
    let lines = text
        .lines()
        .skip_while(|line| !line.starts_with("# [gnss]"));
    let bare = |line: &str| {
        let mut line = line;
        for _ in 0..marks {
            line = line.strip_prefix("# ").unwrap_or(line);
        }
        line.to_owned() + "\n"
    };
    lines.map(bare).collect()
}

#[test]
fn the_example_of_the_sample_configuration_is_sound_and_shows_the_defaults() {
    let shown = settings(&example(1)).unwrap().gnss.unwrap();
    let plain = "[gnss]\ndevice = \"/dev/ttyS1\"\nantenna_position_m = [0.4, 0.0, -1.5]\n";
    assert_eq!(shown, settings(plain).unwrap().gnss.unwrap());
    assert!(settings(&example(0)).unwrap().gnss.is_none());

    let of_signals: String = example(2)
        .lines()
        .filter(|line| !line.starts_with("device") && !line.starts_with("baud"))
        .fold(String::new(), |text, line| text + line + "\n");
    let shown = settings(&of_signals).unwrap().gnss.unwrap();
    let receiver = &shown.sheet.receiver;
    for signal in [
        "latitude GPS.Latitude",
        "longitude GPS.Longitude",
        "height GPS.Height",
        "v_north GPS.North",
        "v_east GPS.East",
        "utc GPS_TIME.Utc",
        "quality GPS_TIME.Quality",
        "valid GPS_TIME.Valid",
        "satellites GPS_TIME.Satellites",
    ] {
        assert!(receiver.contains(signal), "{receiver}");
    }
    let without = of_signals.replace("pair_ms = 20", "");
    assert_eq!(shown, settings(&without).unwrap().gnss.unwrap());
}
