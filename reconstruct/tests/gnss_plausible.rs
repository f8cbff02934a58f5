//! What wrong units, axes and signs make of the logs of a simulated drive is noted, and nothing of sound ones.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use reconstruct::gnss::logs::{self, Axes};
use reconstruct::gnss::plausible::look;
use reconstruct::gnss::rows::{Fix, Motion};
use reconstruct::gnss::sheet::Sheet;
use reconstruct::simulate::city::{self, BoxSheet};

/// A simulated drive as logs, each row changed, and what is noted of them.
fn noted(seed: u64, change: impl Fn(&mut Motion), change_fix: impl Fn(&mut Fix)) -> Vec<String> {
    let sheet = BoxSheet::default();
    let city = city::drive(seed, 200.0, &sheet).unwrap();
    let (mut fixes, mut motions, _) = logs::rows(&city, &sheet, &Axes::Car);
    motions.iter_mut().for_each(change);
    fixes.iter_mut().for_each(change_fix);
    let fixed = logs::fixes(&fixes, sheet.latency_s, &Sheet::default());
    let drive = logs::drive(&motions, &Axes::Car, fixed, Vec::new()).unwrap();
    look(&drive, &motions).notes()
}

#[test]
fn sound_logs_are_not_noted() {
    for seed in 1..=8 {
        assert_eq!(
            noted(seed, |_| (), |_| ()),
            Vec::<String>::new(),
            "seed {seed}"
        );
    }
}

#[test]
fn units_axes_and_stuck_sensors_are_noted() {
    let all = |notes: Vec<String>, parts: &[&str]| {
        assert!(
            parts.iter().all(|p| notes.iter().any(|n| n.contains(p))),
            "expected {parts:?}, found {notes:?}"
        );
    };
    let accel = |k: f64| move |m: &mut Motion| m.accel = m.accel.map(|a| k * a);
    let rate = |k: f64| move |m: &mut Motion| m.rate = m.rate.map(|w| k * w);
    let none = |_: &mut Fix| ();
    all(
        noted(3, accel(0.009_806_65), none),
        &["m/s^2 in place of milli-g"],
    );
    all(noted(3, accel(1e-3), none), &["with g in place of milli-g"]);
    all(noted(3, rate(1e-3), none), &["degrees a second in place"]);
    all(noted(3, rate(-1.0), none), &["the axis upside down"]);
    all(
        noted(3, rate(1e-3_f64.to_radians()), none),
        &["radians a second"],
    );
    all(
        noted(3, |m| m.rate = [0.0; 3], none),
        &["no turn of the sensor", "gyro_z"],
    );
    // Another axis, and the sensor the wrong way round in the car.
    all(noted(3, |m| m.rate.swap(1, 2), none), &["rates: expected"]);
    let turned = |m: &mut Motion| {
        m.accel = [-m.accel[0], -m.accel[1], m.accel[2]];
    };
    all(noted(3, turned, none), &["the axis the wrong way round"]);
    let over = |m: &mut Motion| m.accel = [m.accel[0], -m.accel[1], -m.accel[2]];
    all(noted(3, over, none), &["found it 17"]);
    let still = |m: &mut Motion| (m.accel, m.rate) = ([0.0, 0.0, -9.81], [0.0; 3]);
    all(noted(3, still, none), &["every column"]);
    all(
        noted(3, |m| m.accel[1] = 0.25, none),
        &["accel_y_mg the same for"],
    );
    let kmh = |f: &mut Fix| {
        f.velocity_ned = f.velocity_ned.map(|v| v.map(|x| 3.6 * x));
    };
    all(noted(3, |_| (), kmh), &["velocities in km/h"]);
}
