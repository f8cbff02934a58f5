//! The bytes of the part, `FORMAT.md`, 6.7.

use super::{Fix, FixQuality, Gnss, GnssSheet, GnssSource, NO_COUNT, NO_TIME, PLACE, Sentence};
use crate::bytes::MISSING_VALUE;
use crate::error::{Fault, SchemaError};
use crate::limits;
use crate::num;
use crate::wire::{Cursor, length32, too_large};

/// Bytes of one fix.
const FIX_BYTES: usize = 8 + 8 + 1 + 1 + 13 * 8;
/// Bytes of a sentence without its text.
const SENTENCE_BYTES: usize = 9;

pub(crate) fn put(out: &mut Vec<u8>, gnss: &Gnss) -> Result<(), SchemaError> {
    let Gnss {
        sheet,
        fixes,
        sentences,
    } = gnss;
    let text: usize = sentences.iter().map(|s| s.text.len()).sum();
    let size = fixes.len().saturating_mul(FIX_BYTES)
        + sentences.len().saturating_mul(SENTENCE_BYTES)
        + text;
    if size > limits::MAX_GNSS_BYTES {
        let limit = num::u64_of(limits::MAX_GNSS_BYTES);
        return Err(too_large(PLACE, limit, size, "bytes"));
    }
    out.push(match sheet.source {
        GnssSource::Can => 0,
        GnssSource::Nmea => 1,
    });
    let length = u16::try_from(sheet.receiver.len()).map_err(|_| {
        too_large(
            "name of the receiver",
            u16::MAX.into(),
            sheet.receiver.len(),
            "bytes",
        )
    })?;
    out.extend(length.to_le_bytes());
    out.extend(sheet.receiver.as_bytes());
    let antenna = sheet.antenna_position_m.map_or([None; 3], |p| p.map(Some));
    for number in antenna {
        put_number(out, number);
    }
    for number in sheet.antenna_position_sd_m.into_iter().chain([
        sheet.latency_s,
        sheet.latency_sd_s,
        sheet.horizontal_sd_m,
        sheet.height_sd_m,
        sheet.speed_sd_mps,
    ]) {
        put_number(out, Some(number));
    }
    out.extend(length32(PLACE, fixes.len())?.to_le_bytes());
    for fix in fixes {
        put_fix(out, fix);
    }
    out.extend(length32(PLACE, sentences.len())?.to_le_bytes());
    for sentence in sentences {
        let length = u8::try_from(sentence.text.len())
            .map_err(|_| too_large("sentence", 255, sentence.text.len(), "bytes"))?;
        out.extend(sentence.monotonic_ns.to_le_bytes());
        out.push(length);
        out.extend(sentence.text.as_bytes());
    }
    Ok(())
}

fn put_number(out: &mut Vec<u8>, number: Option<f64>) {
    out.extend(number.map_or(MISSING_VALUE, f64::to_bits).to_le_bytes());
}

fn put_fix(out: &mut Vec<u8>, fix: &Fix) {
    out.extend(fix.monotonic_ns.to_le_bytes());
    out.extend(fix.utc_ns.unwrap_or(NO_TIME).to_le_bytes());
    out.push(fix.quality.number());
    out.push(fix.satellites.unwrap_or(NO_COUNT));
    let [latitude, longitude] = fix.position.map_or([None; 2], |p| p.map(Some));
    let [north, east, across] = fix.horizontal_m2.map_or([None; 3], |c| c.map(Some));
    for number in [
        latitude,
        longitude,
        fix.height_m,
        fix.speed_mps,
        fix.course,
        fix.climb_mps,
        north,
        east,
        across,
        fix.height_sd_m,
        fix.speed_sd_mps,
        fix.course_sd,
        fix.hdop,
    ] {
        put_number(out, number);
    }
}

/// The body at `at` of a file.
pub(crate) fn parse(body: &[u8], at: usize) -> Result<Gnss, SchemaError> {
    let mut cursor = Cursor::new(PLACE, body, at);
    let offset = Some(num::u64_of(at));
    let source = match cursor.u8()? {
        0 => GnssSource::Can,
        1 => GnssSource::Nmea,
        other => {
            let fault = Fault::new("source", "0 (CAN) or 1 (NMEA 0183)", other);
            return Err(fault.at(PLACE, offset));
        }
    };
    let length = cursor.u16()?;
    let receiver = text("receiver", cursor.take(length.into())?, offset)?;
    let antenna_position_m = whole("antenna", [(); 3].map(|()| number(&mut cursor)), offset)?;
    let mut figures = [0.0; 8];
    for figure in &mut figures {
        *figure = number(&mut cursor)?.unwrap_or(f64::NAN);
    }
    let [
        x,
        y,
        z,
        latency_s,
        latency_sd_s,
        horizontal_sd_m,
        height_sd_m,
        speed_sd_mps,
    ] = figures;
    let sheet = GnssSheet {
        source,
        receiver,
        antenna_position_m,
        antenna_position_sd_m: [x, y, z],
        latency_s,
        latency_sd_s,
        horizontal_sd_m,
        height_sd_m,
        speed_sd_mps,
    };
    let count = cursor.count(FIX_BYTES)?;
    let mut fixes = Vec::with_capacity(count.min(limits::MAX_FIXES));
    for index in 0..count {
        fixes.push(take_fix(&mut cursor, index, offset)?);
    }
    let count = cursor.count(SENTENCE_BYTES)?;
    let mut sentences = Vec::with_capacity(count.min(limits::MAX_FIXES));
    for index in 0..count {
        let monotonic_ns = cursor.i64()?;
        let length = cursor.u8()?;
        let text = text(
            &format!("sentence {index}"),
            cursor.take(length.into())?,
            offset,
        )?;
        sentences.push(Sentence { monotonic_ns, text });
    }
    cursor.end()?;
    Ok(Gnss {
        sheet,
        fixes,
        sentences,
    })
}

fn text(field: &str, bytes: &[u8], offset: Option<u64>) -> Result<String, SchemaError> {
    String::from_utf8(bytes.to_vec())
        .map_err(|e| Fault::new(field, "UTF-8", e.to_string()).at(PLACE, offset))
}

/// A number; that a value is finite is checked, the missing pattern apart, with the field's name by [`check`].
fn number(cursor: &mut Cursor) -> Result<Option<f64>, SchemaError> {
    let bits = cursor.u64()?;
    Ok((bits != MISSING_VALUE).then_some(f64::from_bits(bits)))
}

/// All of them or none.
fn whole<const N: usize>(
    field: &str,
    numbers: [Result<Option<f64>, SchemaError>; N],
    offset: Option<u64>,
) -> Result<Option<[f64; N]>, SchemaError> {
    let mut all = [0.0; N];
    let mut found = 0;
    for (place, number) in all.iter_mut().zip(numbers) {
        if let Some(value) = number? {
            *place = value;
            found += 1;
        }
    }
    match found {
        0 => Ok(None),
        _ if found == N => Ok(Some(all)),
        _ => {
            let expected = format!("all {N} numbers or none");
            Err(Fault::new(field, expected, found).at(PLACE, offset))
        }
    }
}

fn take_fix(cursor: &mut Cursor, index: usize, offset: Option<u64>) -> Result<Fix, SchemaError> {
    let monotonic_ns = cursor.i64()?;
    let utc_ns = cursor.i64()?;
    let number_of_quality = cursor.u8()?;
    let quality = FixQuality::from_number(number_of_quality).ok_or_else(|| {
        Fault::new(format!("fix {index}, quality"), "0 to 9", number_of_quality).at(PLACE, offset)
    })?;
    let satellites = cursor.u8()?;
    let field = |name: &str| format!("fix {index}, {name}");
    let position = whole(&field("position"), [(); 2].map(|()| number(cursor)), offset)?;
    let [height_m, speed_mps, course, climb_mps] = take_numbers(cursor)?;
    let horizontal_m2 = whole(
        &field("covariance"),
        [(); 3].map(|()| number(cursor)),
        offset,
    )?;
    let [height_sd_m, speed_sd_mps, course_sd, hdop] = take_numbers(cursor)?;
    Ok(Fix {
        monotonic_ns,
        utc_ns: (utc_ns != NO_TIME).then_some(utc_ns),
        quality,
        satellites: (satellites != NO_COUNT).then_some(satellites),
        position,
        height_m,
        speed_mps,
        course,
        climb_mps,
        horizontal_m2,
        height_sd_m,
        speed_sd_mps,
        course_sd,
        hdop,
    })
}

fn take_numbers<const N: usize>(cursor: &mut Cursor) -> Result<[Option<f64>; N], SchemaError> {
    let mut all = [None; N];
    for place in &mut all {
        *place = number(cursor)?;
    }
    Ok(all)
}
