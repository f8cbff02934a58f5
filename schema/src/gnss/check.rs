//! What the values of the part must satisfy.

use super::{Fix, FixQuality, Gnss, NO_COUNT, NO_TIME};
use crate::error::Fault;
use crate::limits;

/// What the values must satisfy, before writing and after reading.
pub(crate) fn check(gnss: &Gnss) -> Result<(), Fault> {
    let Gnss {
        sheet,
        fixes,
        sentences,
    } = gnss;
    for &x in sheet.antenna_position_m.iter().flatten() {
        within("antenna_position_m", x, -100.0, 100.0)?;
    }
    for sd in sheet.antenna_position_sd_m {
        within("antenna_position_sd_m", sd, 0.0, 100.0)?;
    }
    within("latency_s", sheet.latency_s, -60.0, 60.0)?;
    within("latency_sd_s", sheet.latency_sd_s, 0.0, 60.0)?;
    for (field, sd) in [
        ("horizontal_sd_m", sheet.horizontal_sd_m),
        ("height_sd_m", sheet.height_sd_m),
        ("speed_sd_mps", sheet.speed_sd_mps),
    ] {
        within(field, sd, f64::MIN_POSITIVE, 1e6)?;
    }
    if fixes.len() > limits::MAX_FIXES {
        let expected = format!("at most {}", limits::MAX_FIXES);
        return Err(Fault::new("fixes", expected, fixes.len()));
    }
    let mut before = i64::MIN;
    for (index, fix) in fixes.iter().enumerate() {
        check_fix(index, fix)?;
        in_order(&format!("fix {index}"), &mut before, fix.monotonic_ns)?;
    }
    let mut before = i64::MIN;
    for (index, sentence) in sentences.iter().enumerate() {
        let field = format!("sentence {index}");
        in_order(&field, &mut before, sentence.monotonic_ns)?;
        let printable = sentence.text.bytes().all(|b| (0x20..0x7f).contains(&b));
        if !printable || sentence.text.len() > 255 {
            let expected = "printable ASCII, at most 255 bytes";
            return Err(Fault::new(field, expected, sentence.text.escape_debug()));
        }
    }
    Ok(())
}

fn in_order(field: &str, before: &mut i64, here: i64) -> Result<(), Fault> {
    if here < *before {
        let expected = format!("{before} or later");
        return Err(Fault::new(format!("{field}, time"), expected, here));
    }
    *before = here;
    Ok(())
}

fn within(field: &str, value: f64, least: f64, most: f64) -> Result<(), Fault> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let expected = format!("a number from {least:e} to {most:e}");
    Err(Fault::new(field, expected, value))
}

fn check_fix(index: usize, fix: &Fix) -> Result<(), Fault> {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};
    let field = |name: &str| format!("fix {index}, {name}");
    if fix.satellites == Some(NO_COUNT) {
        return Err(Fault::new(field("satellites"), "at most 254", NO_COUNT));
    }
    if fix.utc_ns == Some(NO_TIME) {
        return Err(Fault::new(field("UTC"), "a time since 1677", NO_TIME));
    }
    if fix.quality == FixQuality::None && fix.position.is_some() {
        let expected = "no position where the receiver says that it has no fix";
        return Err(Fault::new(field("position"), expected, "one"));
    }
    let [latitude, longitude] = fix.position.map_or([None; 2], |p| p.map(Some));
    let [north, east, across] = fix.horizontal_m2.map_or([None; 3], |c| c.map(Some));
    for (name, value, least, most) in [
        ("latitude", latitude, -FRAC_PI_2, FRAC_PI_2),
        ("longitude", longitude, -PI, PI),
        ("height_m", fix.height_m, -1e6, 1e8),
        ("speed_mps", fix.speed_mps, 0.0, 1e5),
        ("course", fix.course, 0.0, TAU),
        ("climb_mps", fix.climb_mps, -1e5, 1e5),
        ("north variance", north, 0.0, 1e12),
        ("east variance", east, 0.0, 1e12),
        ("north-east covariance", across, -1e12, 1e12),
        ("height_sd_m", fix.height_sd_m, 0.0, 1e6),
        ("speed_sd_mps", fix.speed_sd_mps, 0.0, 1e6),
        ("course_sd", fix.course_sd, 0.0, 1e3),
        ("hdop", fix.hdop, 0.0, 1e4),
    ] {
        value.map_or(Ok(()), |value| within(&field(name), value, least, most))?;
    }
    if let Some([n, e, ne]) = fix.horizontal_m2
        && ne * ne > n * e * (1.0 + 1e-9)
    {
        let expected = "a covariance: its square at most the product of the variances";
        return Err(Fault::new(field("north-east covariance"), expected, ne));
    }
    Ok(())
}
