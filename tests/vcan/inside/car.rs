//! A car to be played on the bus: the frames of the example configuration, counted and at an even pace.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use schema::seal::Hex;
use support::log::pack;

use crate::bench::Lane;

/// Step of the IMU's values: m/s^2, deg/s.
const STEP: f64 = 0.002;

/// When in each round of a log it crashes, s.
pub(crate) const CRASH_S: f64 = 2.5;

/// Writes the log of a car on `can0`: 100 Hz IMU, 50 Hz wheels. It stands; or, again each `round` seconds, it drives
/// at 50 km/h, is stopped within 140 ms from [`CRASH_S`] on, and stands.
pub(crate) fn log(lane: &Lane, seconds: u32, round: Option<u32>) -> PathBuf {
    let mut text = String::new();
    for number in 0..seconds * 100 {
        let t = round.map(|round| f64::from(number % (round * 100)) / 100.0);
        let struck = t.is_some_and(|t| (CRASH_S..CRASH_S + 0.14).contains(&t));
        let drives = t.is_some_and(|t| t < CRASH_S);
        let forward = if struck { -100.0 } else { 0.0 };
        let mut line = |micros: u32, id: &str, data: &[u8]| {
            let (whole, part) = (number / 100, number % 100 * 10_000 + micros);
            let whole = 1_700_000_000 + whole;
            writeln!(text, "({whole}.{part:06}) can0 {id}#{}", Hex(data)).unwrap();
        };
        let counter = u64::from(number);
        line(0, "120", &pack([forward, 0.0, 9.806], STEP, counter));
        line(200, "121", &pack([0.0; 3], STEP, counter));
        if number.is_multiple_of(2) {
            let code: u16 = if drives { 5_000 } else { 0 };
            let [high, low] = code.to_be_bytes();
            line(400, "122", &[high, low, high, low, 0]);
        }
    }
    let path = lane.dir().join("car.log");
    fs::write(&path, text).unwrap();
    path
}
