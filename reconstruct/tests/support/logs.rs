//! Logs of both formats [S00, 6.1 and 6.2] to write, read and damage.

use reconstruct::gnss::layout::{Decimal, Delimiter, Layout};
use reconstruct::gnss::notes::{Note, NoteKind};
use reconstruct::gnss::read::{Read, Tolerance, read_fixes, read_motions};
use reconstruct::gnss::rows::{Fix, Head, Leg, MILLI_G, Motion};
use reconstruct::gnss::time::{GpsTime, gps_time};
use reconstruct::gnss::write::{write_fixes, write_motions};

/// 2013-08-26 10:00:00 UTC.
const START_MS: i64 = 1_377_511_200_000;
const LEAP_S: i32 = 16;

pub(crate) fn head(k: i32, step_ms: i32) -> Head {
    let utc_ms = START_MS + i64::from(k * step_ms);
    let GpsTime { week, tow_s } = gps_time(utc_ms, LEAP_S).unwrap();
    let leg = Leg {
        equipment: 2,
        drive: 1,
        leg: 3,
    };
    Head {
        utc_ms: Some(utc_ms),
        week: Some(week),
        tow_s: Some(tow_s),
        ..Head::bare(leg, 17.02 + f64::from(k * step_ms) / 1000.0)
    }
}

pub(crate) fn fixes() -> Vec<Fix> {
    let fix = |k: i32| {
        let x = f64::from(k);
        Fix {
            head: head(k, 1000),
            good: Some(k % 7 != 6),
            fix_type: Some(3),
            latitude: (63.415 + 1.234_567_8e-4 * x).to_radians(),
            longitude: (10.41 - 2.345_678_9e-4 * x).to_radians(),
            ellipsoid_height: Some(81.25 + x),
            sea_height: Some(41.75 + x),
            speed: Some(0.31 * x),
            course: Some((17.0 * x).to_radians()),
            yaw: Some((x - 6.0).to_radians()),
            pitch: Some((-0.25 * x).to_radians()),
            roll: Some((0.125 * x).to_radians()),
            horizontal_error: Some(2.5),
            vertical_error: Some(4.25),
            sd_ned: [Some(1.5), Some(1.25), Some(3.125)],
            hdop: Some(0.9),
            pdop: Some(1.7),
            velocity_ned: Some([0.3 * x, -0.1 * x, -0.0125]),
            satellites: Some(9),
            signal: Some(38.5),
            sbas: Some(k % 2 == 0),
            integrity_ned: [Some(7.5), Some(7.25), Some(11.0)],
        }
    };
    (0..20).map(fix).collect()
}

/// A fix with nothing that may be left out.
pub(crate) fn bare(k: i32) -> Fix {
    let full = fixes()[0];
    let Head { leg, obu_s, .. } = head(k, 1000);
    Fix {
        sea_height: Some(-0.5),
        ..Fix::bare(Head::bare(leg, obu_s), -full.latitude, -full.longitude)
    }
}

pub(crate) fn motions() -> Vec<Motion> {
    let motion = |k: i32| {
        let x = f64::from(k);
        Motion {
            head: head(k, 20),
            accel: [3.904 * x, -1000.125, 999.5 - x].map(|mg| mg * MILLI_G),
            rate: [8.75 * x, -0.01, -70.25].map(|md: f64| (md / 1000.0).to_radians()),
        }
    };
    (0..50).map(motion).collect()
}

/// Every layout that can be written.
pub(crate) fn layouts() -> Vec<Layout> {
    let mut all = Vec::new();
    for delimiter in [
        Delimiter::Comma,
        Delimiter::Semicolon,
        Delimiter::Tab,
        Delimiter::Spaces,
    ] {
        for decimal in [Decimal::Point, Decimal::Comma] {
            for header in [true, false] {
                all.push(Layout {
                    delimiter,
                    decimal,
                    header,
                });
            }
        }
    }
    all.retain(|l| l.delimiter != Delimiter::Comma || l.decimal != Decimal::Comma);
    all
}

pub(crate) const BARE: Layout = Layout {
    delimiter: Delimiter::Semicolon,
    decimal: Decimal::Point,
    header: false,
};

pub(crate) fn fix_text(rows: &[Fix], layout: Layout) -> String {
    let mut out = Vec::new();
    write_fixes(&mut out, "out", rows, layout).unwrap();
    String::from_utf8(out).unwrap()
}

pub(crate) fn motion_text(rows: &[Motion], layout: Layout) -> String {
    let mut out = Vec::new();
    write_motions(&mut out, "out", rows, layout).unwrap();
    String::from_utf8(out).unwrap()
}

pub(crate) fn fixes_of(text: &str) -> Result<Read<Fix>, String> {
    read_fixes(text.as_bytes(), "gps.txt", Tolerance::Strict).map_err(|e| e.to_string())
}

pub(crate) fn motions_of(text: &str) -> Result<Read<Motion>, String> {
    read_motions(text.as_bytes(), "imu.txt", Tolerance::Strict).map_err(|e| e.to_string())
}

/// The numbers of a row in the order of its columns, in the units of the file, absent ones NaN.
pub(crate) fn numbers(fix: &Fix) -> Vec<f64> {
    let mut all = vec![fix.head.obu_s, fix.head.tow_s.unwrap_or(f64::NAN)];
    all.extend([fix.latitude, fix.longitude].map(f64::to_degrees));
    let angles = [fix.course, fix.yaw, fix.pitch, fix.roll].map(|a| a.map(f64::to_degrees));
    let rest = [
        fix.ellipsoid_height,
        fix.sea_height,
        fix.speed,
        fix.horizontal_error,
        fix.vertical_error,
        fix.hdop,
        fix.pdop,
        fix.signal,
    ];
    let triples = [
        fix.sd_ned,
        fix.velocity_ned.map_or([None; 3], |v| v.map(Some)),
        fix.integrity_ned,
    ];
    let maybe = angles.into_iter().chain(rest).chain(triples.concat());
    all.extend(maybe.map(|x| x.unwrap_or(f64::NAN)));
    all
}

pub(crate) fn motion_numbers(motion: &Motion) -> Vec<f64> {
    let mut all = vec![motion.head.obu_s];
    all.extend(motion.accel_milli_g());
    all.extend(motion.rate_milli_deg());
    all
}

/// A line with one field replaced.
pub(crate) fn with(line: &str, column: usize, text: &str) -> String {
    let mut cells: Vec<&str> = line.trim_end().split(';').collect();
    cells[column - 1] = text;
    cells.join(";") + "\n"
}

pub(crate) fn fix_line() -> String {
    fix_text(&fixes()[..1], BARE)
}

pub(crate) fn motion_line() -> String {
    motion_text(&motions()[..1], BARE)
}

pub(crate) fn note(kind: NoteKind, count: u64, first_line: u64) -> Note {
    Note {
        kind,
        count,
        first_line,
    }
}
