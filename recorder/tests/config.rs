//! A wrong configuration is an error that names file, line, and the nearest valid name.
#![allow(
    clippy::unwrap_used,
    clippy::too_many_lines,
    reason = "tests, whose cases are tables"
)]

mod support;

use std::fs;
use std::path::Path;

use recorder::config::{ConfigError, Settings};
use schema::header::Layout;
use support::etc;

fn text() -> String {
    fs::read_to_string(etc().join("recorder.toml")).unwrap()
}

fn error(from: &str, to: &str) -> ConfigError {
    let text = text();
    assert!(text.contains(from), "{from}");
    Settings::from_toml_str(&text.replacen(from, to, 1), &etc()).unwrap_err()
}

#[test]
fn the_example_is_valid_and_in_si() {
    let settings = Settings::load(&etc().join("recorder.toml")).unwrap();
    assert_eq!(settings.device_id, "bench-1");
    assert_eq!(
        (
            settings.ring.before,
            settings.ring.after,
            settings.ring.layout
        ),
        (3000, 1000, Layout::Full)
    );
    assert!((settings.imu.rate_bias - 0.5_f64.to_radians()).abs() < 1e-15);
    assert!((settings.imu.accel_range.unwrap() - 980.665).abs() < 1e-9);
    assert!((settings.wheels.cutoff_mps - 3.0 / 3.6).abs() < 1e-12);
    assert_eq!(settings.store.dir, etc().join("records"));
    assert_eq!(settings.plan.messages.len(), 4);
}

#[test]
fn what_is_wrong_is_named_with_its_line_and_the_nearest_name() {
    let line = |needle: &str| {
        text()
            .lines()
            .position(|line| line.contains(needle))
            .unwrap()
            + 1
    };
    let cases = [
        (
            "track_width_m = 1.5",
            "track_width = 1.5",
            line("track_width_m"),
            "`track_width_m`",
        ),
        (
            "post_trigger_s = 10",
            "post_triger_s = 10",
            line("post_trigger_s"),
            "`post_trigger_s`",
        ),
        (
            "IMU_ACCEL.Left",
            "IMU_ACEL.Left",
            line("accel = ["),
            "`IMU_ACCEL`",
        ),
        (
            "IMU_ACCEL.Left",
            "IMU_ACCEL.Lefft",
            line("accel = ["),
            "`Left`",
        ),
        (
            "IMU_RATE.YawRate",
            "IMU_ACCEL.Up",
            line("rate = ["),
            "deg/s",
        ),
        (
            "WHEELS.RearLeft",
            "PULSES.NoUnit",
            line("left = "),
            "set [wheels] unit",
        ),
        (
            "WHEELS.RearLeft",
            "PULSES.CountLeft",
            line("[wheels]"),
            "wheels.radius_m",
        ),
        (
            "WHEELS.RearLeft",
            "WHEELS.RearRight",
            line("right = "),
            "wheels.left has already",
        ),
        (
            "IMU_ACCEL.Left",
            "IMU_ACCEL.Forward",
            line("accel = ["),
            "imu.accel[0] has already",
        ),
        ("peak_g = 50", "peak_g = 90", line("peak_g"), "50 to 80"),
        (
            "accel_range_g = 100",
            "accel_range_g = 16",
            line("peak_g"),
            "sensor's range",
        ),
        (
            "seconds = 40",
            "seconds = 20",
            line("seconds = 40"),
            "30 to 120",
        ),
        (
            "post_trigger_s = 10",
            "post_trigger_s = 41",
            line("post_trigger_s"),
            "less than ring.seconds",
        ),
        (
            "dbc = \"example.dbc\"",
            "dbc = \"nowhere.dbc\"",
            line("dbc = "),
            "nowhere.dbc",
        ),
        (
            "equals = 1",
            "",
            line("[[trigger.can]]"),
            "one of equals and above",
        ),
        (
            "track_width_m = 1.5",
            "track_width_m = nan",
            line("track_width_m"),
            "0.3 to 5",
        ),
        ("[vehicle]", "[vehicle", line("[vehicle]"), ""),
        (
            "AccelCounter\"",
            "Forwad\"",
            line("accel_counter"),
            "`Forward`",
        ),
    ];
    for (from, to, line, expected) in cases {
        let message = error(from, to).to_string();
        assert!(
            message.starts_with(&format!("configuration:{line}: ")),
            "{to}: line {line} in: {message}"
        );
        assert!(message.contains(expected), "{to}: {expected} in: {message}");
    }
}

#[test]
fn the_same_interface_twice_and_a_missing_bus_name_are_errors() {
    let second = "dbc = \"example.dbc\"\n\n[[bus]]\ninterface = \"can0\"\ndbc = \"example.dbc\"";
    assert!(matches!(
        error("dbc = \"example.dbc\"", second),
        ConfigError::Overlap { .. }
    ));
    let other = second.replace("can0", "can1");
    let message = error("dbc = \"example.dbc\"", &other).to_string();
    assert!(message.contains("BUS:MESSAGE.SIGNAL"), "{message}");
    let mut all = text().replacen("dbc = \"example.dbc\"", &other, 1);
    for message in ["IMU_ACCEL.", "IMU_RATE.", "WHEELS.", "AIRBAG_STATE."] {
        all = all.replace(message, &format!("can1:{message}"));
    }
    let settings = Settings::from_toml_str(&all, &etc()).unwrap();
    assert!(
        settings
            .plan
            .messages
            .iter()
            .all(|message| message.bus == 1)
    );
    let wrong = all.replace("can1:IMU_RATE.YawRate", "cam1:IMU_RATE.YawRate");
    let message = Settings::from_toml_str(&wrong, &etc())
        .unwrap_err()
        .to_string();
    assert!(message.contains("nearest valid name is `can"), "{message}");
}

#[test]
fn a_unit_the_dbc_lacks_can_be_set() {
    let text = text()
        .replace("WHEELS.RearLeft", "PULSES.NoUnit")
        .replace("WHEELS.RearRight\"", "PULSES.CountRight\"\nunit = \"m/s\"");
    assert!(Settings::from_toml_str(&text, &etc()).is_ok());
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = Settings::load(Path::new("/nowhere/recorder.toml"))
        .unwrap_err()
        .to_string();
    assert!(error.starts_with("/nowhere/recorder.toml"), "{error}");
}

#[test]
fn pulse_counters_wrap() {
    let text = text()
        .replace("WHEELS.RearLeft", "PULSES.CountLeft")
        .replace(
            "WHEELS.RearRight\"",
            "PULSES.CountRight\"\npulses_per_rev = 48\nradius_m = 0.3",
        );
    let settings = Settings::from_toml_str(&text, &etc()).unwrap();
    let mut log = support::Log::default();
    // 20 m/s: 10.186 pulses of 39.27 mm in 20 ms.
    for k in 0..500_u32 {
        let t = f64::from(k) * 0.02;
        let count =
            schema::num::floor_i64(20.0 * t / (std::f64::consts::TAU * 0.3 / 48.0)).rem_euclid(256);
        let count = u8::try_from(count).unwrap();
        log.frame(t, "123", &[count, count, 0, 0]);
    }
    let run = support::run(&settings, log.text(), &[]);
    let speeds: Vec<f64> = run
        .samples
        .iter()
        .filter_map(|(_, sample)| sample.wheels[0])
        .collect();
    let mean = speeds.iter().sum::<f64>() / schema::num::real(speeds.len());
    assert!(
        speeds.len() > 450 && (mean - 20.0).abs() < 0.05,
        "{mean} of {}",
        speeds.len()
    );
    assert!(
        speeds.iter().all(|speed| (speed - 20.0).abs() < 2.1),
        "one pulse is 2 m/s"
    );
}
