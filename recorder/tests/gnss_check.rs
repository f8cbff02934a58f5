//! `recorder check` and `recorder replay` with a satellite receiver: rates of its signals and sentences in logs, live on a
//! line, and by the program with `--nmea`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod receiver;
mod support;

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use receiver::{log, sentence};
use recorder::check::{CheckReport, GnssReport, check_live, check_with};
use recorder::config::Settings;
use recorder::daemon::paced::Paced;
use recorder::replay::{LogInput, ReplayOptions};
use schema::Record;
use serde_json::Value;
use serialport::{SerialPort, TTYPort};
use support::{Log, etc, input};

const DBC: &str = r#"
BO_ 768 POS: 8 SENSOR
 SG_ Lat : 0|32@1- (0.0000001,0) [-90|90] "deg" BRAKES
 SG_ Lon : 32|32@1- (0.0000001,0) [-180|180] "deg" BRAKES

BO_ 771 STATE: 8 SENSOR
 SG_ Quality : 0|8@1+ (1,0) [0|8] "" BRAKES
 SG_ Hdop : 16|16@1+ (0.01,0) [0|99.99] "" BRAKES
"#;
const SIGNALS: &str = "[gnss]\nlatitude = \"POS.Lat\"\nlongitude = \"POS.Lon\"\nquality = \"STATE.Quality\"\n\
    hdop = \"STATE.Hdop\"\n";

struct Folder(PathBuf);

impl Folder {
    /// With a configuration that has this table.
    fn new(name: &str, table: &str) -> Self {
        let dir =
            std::env::temp_dir().join(format!("recorder-check-{name}-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let dbc = fs::read_to_string(etc().join("example.dbc")).unwrap() + DBC;
        fs::write(dir.join("example.dbc"), dbc).unwrap();
        let text = fs::read_to_string(etc().join("recorder.toml")).unwrap();
        fs::write(dir.join("recorder.toml"), format!("{text}\n{table}")).unwrap();
        Self(dir)
    }

    fn settings(&self) -> Settings {
        Settings::load(&self.0.join("recorder.toml")).unwrap()
    }

    fn program(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_recorder"))
            .args(args)
            .current_dir(&self.0)
            .output()
            .unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn device(path: &str) -> String {
    format!("[gnss]\ndevice = \"{path}\"\nbaud = 115200\n")
}

fn drive(seconds: f64) -> Log {
    let mut log = Log::default();
    log.steady(0.0, seconds, 100.0, 0.0);
    log
}

/// Sentences of each second from the log's time `from` on: RMC, GGA five times a second, GSV.
fn lines(from: i32, seconds: i32) -> String {
    let mut lines = Vec::new();
    for second in from..from + seconds {
        let t = f64::from(second);
        // 1700000000 is 22:13:20.
        let clock = 80_000 + second;
        let time = format!("{:02}{:02}{:02}", clock / 3600, clock / 60 % 60, clock % 60);
        let place = "4807.0380,N,01131.0000,E";
        lines.push((t + 0.1, format!("GNRMC,{time},A,{place},10,90,141123,,,A")));
        for fifth in 0..5 {
            let t = t + 0.11 + f64::from(fifth) * 0.2;
            lines.push((
                t,
                format!(
                    "GNGGA,{time}.{},{place},1,12,0.7,500.0,M,46.0,M,,",
                    fifth * 2
                ),
            ));
        }
        lines.push((t + 0.95, "GPGSV,1,1,01,23,38,230,44".to_owned()));
    }
    log(&lines)
}

fn rate(report: &GnssReport, name: &str) -> Option<f64> {
    let of = |arrival: &&recorder::check::ArrivalReport| arrival.name == name;
    report
        .arrivals
        .iter()
        .find(of)
        .map(|arrival| arrival.rate_hz)
}

fn warns(report: &CheckReport, what: &str) -> bool {
    report.warnings.iter().any(|warning| warning.contains(what))
}

#[test]
fn signals_have_rates_and_what_never_comes_is_told() {
    let folder = Folder::new("signals", SIGNALS);
    let mut can = drive(10.0);
    for k in 0..90_i32 {
        let t = 0.5 + f64::from(k) * 0.1;
        let place = [480_000_000_i32 + k, 110_000_000]
            .map(i32::to_le_bytes)
            .concat();
        can.frame(t, "300", &place);
        if k % 5 == 0 {
            // The dilution is marked as not available all the time.
            can.frame(t + 0.001, "303", &[1, 0, 0xFF, 0xFF, 0, 0, 0, 0]);
        }
    }
    let report = check_with(
        &folder.settings(),
        input(can.text()),
        ReplayOptions::default(),
    );
    let report = report.unwrap();
    let gnss = report.gnss.as_ref().unwrap();
    assert_eq!((gnss.fixes, gnss.no_fix), (90, 0));
    for (name, expected) in [("latitude", 10.0), ("longitude", 10.0), ("quality", 2.0)] {
        let found = rate(gnss, name).unwrap();
        assert!((found - expected).abs() < 0.01, "{name}: {found}");
    }
    assert_eq!(rate(gnss, "hdop"), None);
    assert!(
        warns(&report, "gnss.hdop never arrived"),
        "{:?}",
        report.warnings
    );
    assert!(warns(&report, "18 values outside the DBC's range"));
    assert!(!warns(&report, "no fix"));
}

#[test]
fn sentences_of_a_log_have_rates_also_where_it_began_before_the_frames() {
    let folder = Folder::new("sentences", &device("/dev/none"));
    for (from, seconds) in [(0, 10), (-60, 70)] {
        let nmea = Cursor::new(lines(from, seconds));
        let options = ReplayOptions {
            nmea: Some(LogInput::Reader("gnss".to_owned(), Box::new(nmea))),
            ..ReplayOptions::default()
        };
        let report = check_with(&folder.settings(), input(drive(10.0).text()), options).unwrap();
        let gnss = report.gnss.as_ref().unwrap();
        for (name, expected) in [("RMC", 1.0), ("GGA", 5.0)] {
            let found = rate(gnss, name).unwrap();
            assert!((found - expected).abs() < 0.05, "{from} {name}: {found}");
        }
        assert!(gnss.fixes >= 45 && gnss.arrivals.len() == 2, "{gnss:?}");
        assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    }
}

#[test]
fn the_program_checks_and_replays_with_the_sentences_of_a_file() {
    let folder = Folder::new("program", &device("/dev/none"));
    fs::write(folder.0.join("drive.log"), drive(10.0).text()).unwrap();
    fs::write(folder.0.join("gps.log"), lines(0, 10)).unwrap();
    let check = [
        "check",
        "--config",
        "recorder.toml",
        "drive.log",
        "--nmea",
        "gps.log",
    ];
    let run = folder.program(&check);
    let out = String::from_utf8(run.stdout).unwrap();
    assert_eq!(run.status.code(), Some(0), "{out}");
    for line in ["gnss RMC: 1.00 Hz", "gnss GGA: 5.00 Hz", "fixes, 0 epochs"] {
        assert!(out.contains(line), "{out}");
    }
    let run = folder.program(&[&check[..], &["--json"]].concat());
    let json: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(json["gnss"]["arrivals"][0]["name"], "RMC");
    assert_eq!(json["gnss"]["arrivals"][0]["count"], 10);

    // Without the file nothing is known of the receiver, which is not its fault.
    let run = folder.program(&check[..4]);
    let out = String::from_utf8(run.stdout).unwrap();
    assert_eq!(run.status.code(), Some(3), "{out}");
    assert!(
        out.contains("was not given (--nmea)") && !out.contains("no fix"),
        "{out}"
    );

    // Noise in the file is counted, and told.
    let noisy = format!("{}(1700000005.5) $GPRMC,1*00\nnonsense\n", lines(0, 5));
    fs::write(folder.0.join("noisy.log"), noisy).unwrap();
    let run = folder.program(&[&check[..5], &["noisy.log"]].concat());
    let out = String::from_utf8(run.stdout).unwrap();
    assert!(
        out.contains("warning: 1 sentences with a wrong checksum"),
        "{out}"
    );
    assert!(out.contains("warning: 1 lines that are no frame"), "{out}");

    let replay = [
        "replay",
        "--config",
        "recorder.toml",
        "--trigger-at",
        "5",
        "--out",
        "records",
    ];
    let args = [&replay[..], &["drive.log", "--nmea", "gps.log"]].concat();
    let run = folder.program(&args);
    assert_eq!(run.status.code(), Some(3), "the log is short: {run:?}");
    let path = String::from_utf8(run.stdout).unwrap();
    let bytes = fs::read(folder.0.join(path.trim_end())).unwrap();
    let (record, _) = Record::read(&bytes).unwrap();
    let part = record.gnss.unwrap();
    assert_eq!(part.sentences.len(), 60);
    assert!(part.fixes.len() >= 45);

    // A file of sentences, and no device that they are of.
    let plain = Folder::new("plain", "");
    for name in ["drive.log", "gps.log"] {
        fs::copy(folder.0.join(name), plain.0.join(name)).unwrap();
    }
    let run = plain.program(&check);
    assert_eq!(run.status.code(), Some(1));
    let err = String::from_utf8(run.stderr).unwrap();
    assert!(err.contains("gps.log"), "{err}");
}

/// A file to write a log to, as a source at the pace of its stamps.
fn paced(folder: &Path, settings: &Settings, log: Log) -> Paced {
    let path = folder.join("live.log");
    fs::write(&path, log.text()).unwrap();
    Paced::open(settings, vec![LogInput::File(path)], &[]).unwrap()
}

#[test]
fn a_live_check_hears_the_line_beside_the_bus_and_says_what_is_missing() {
    let (mut ours, theirs) = TTYPort::pair().unwrap();
    ours.set_timeout(Duration::from_secs(5)).unwrap();
    let folder = Folder::new("live", &device(&theirs.name().unwrap()));
    let settings = folder.settings();
    let writer = std::thread::spawn(move || {
        for k in 0..60_u32 {
            let clock = 80_000 + k / 10;
            let time = format!(
                "{:02}{:02}{:02}.{}",
                clock / 3600,
                clock / 60 % 60,
                clock % 60,
                k % 10
            );
            let body = format!("GNGGA,{time},4807.0380,N,01131.0000,E,1,12,0.7,500.0,M,46.0,M,,");
            ours.write_all(format!("{}\r\n", sentence(&body)).as_bytes())
                .unwrap();
            std::thread::sleep(Duration::from_millis(100));
        }
        ours
    });
    let mut source = paced(&folder.0, &settings, drive(8.0));
    let report = check_live(&settings, &mut source, 4.0).unwrap();
    let gnss = report.gnss.as_ref().unwrap();
    let found = rate(gnss, "GGA").unwrap();
    // Ten, on a machine that is not busy.
    assert!((2.0..20.0).contains(&found), "{found}");
    assert!(gnss.fixes >= 5, "{gnss:?}");
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    drop(writer.join().unwrap());

    // The device is gone.
    let mut source = paced(&folder.0, &settings, drive(3.0));
    let report = check_live(&settings, &mut source, 1.0).unwrap();
    assert!(
        warns(&report, "device can not be opened"),
        "{:?}",
        report.warnings
    );
    assert!(warns(&report, "open the device"), "{:?}", report.warnings);

    // The bus is silent but for one frame: the line has its rates all the same.
    let (mut ours, theirs) = TTYPort::pair().unwrap();
    ours.set_timeout(Duration::from_secs(5)).unwrap();
    let folder = Folder::new("quiet", &device(&theirs.name().unwrap()));
    let settings = folder.settings();
    let writer = std::thread::spawn(move || {
        for _ in 0..25 {
            ours.write_all(b"$GPZDA,,,,,,*48\r\n").unwrap();
            std::thread::sleep(Duration::from_millis(100));
        }
        ours
    });
    let mut log = Log::default();
    log.frame(0.0, "555", &[1]);
    log.frame(60.0, "555", &[1]);
    let mut source = paced(&folder.0, &settings, log);
    let report = check_live(&settings, &mut source, 2.0).unwrap();
    let found = rate(report.gnss.as_ref().unwrap(), "ZDA").unwrap();
    assert!((2.0..20.0).contains(&found), "{found}");
    assert!(warns(&report, "accel never arrived") && warns(&report, "had no fix"));
    drop(writer.join().unwrap());
}
