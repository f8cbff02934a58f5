//! What a simulated satellite receiver puts on its line: sentences of NMEA 0183, and their log beside the frames.

use std::fmt::Write;

use schema::gnss::Fix;
use schema::num::{real_i64, round_i64};
use schema::time::Stamp;

const SECOND: i64 = 1_000_000_000;

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

/// RMC, GGA and GST of a fix without `$` and checksum; RMC and GGA that say so where there is no position. Its time is the UTC
/// it states, else that of its receipt, `utc_offset_ns` beside the monotonic.
fn sentences(fix: &Fix, utc_offset_ns: i64) -> Vec<String> {
    let utc = fix.utc_ns.unwrap_or(fix.monotonic_ns + utc_offset_ns);
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
    let knots = fix
        .speed_mps
        .map_or_else(String::new, |v| format!("{:.3}", v * 3600.0 / 1852.0));
    let course = fix
        .course
        .map_or_else(String::new, |c| format!("{:.2}", c.to_degrees()));
    let mut out = vec![
        format!("GPRMC,{time},A,{place},{knots},{course},{date},,,A"),
        format!("GPGGA,{time},{place},1,09,0.9,150.0,M,40.0,M,,"),
    ];
    out.extend(fix.horizontal_m2.map(|p| {
        let sd = p[0].max(0.0).sqrt();
        format!("GPGST,{time},1.0,,,,{sd:.2},{sd:.2},5.0")
    }));
    out
}

/// Fixes as the log that `recorder replay --nmea` takes, `(seconds.fraction) $...` a line; `utc_offset_ns` is UTC less
/// monotonic time.
#[must_use]
pub fn log(fixes: &[Fix], utc_offset_ns: i64) -> String {
    let mut out = String::new();
    for fix in fixes {
        let at = fix.monotonic_ns + utc_offset_ns;
        let (seconds, micros) = (at.div_euclid(SECOND), at.rem_euclid(SECOND) / 1000);
        for body in sentences(fix, utc_offset_ns) {
            let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
            // Writing to a String cannot fail.
            let _ = writeln!(out, "({seconds}.{micros:06}) ${body}*{sum:02X}");
        }
    }
    out
}
