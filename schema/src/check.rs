//! What a record's values must satisfy beyond being decodable, so that no reader hands a NaN scale or an
//! impossible grid to the mathematics. The same checks stand before writing and after reading.

use crate::block::{Block, FULL_HZ, THIN_HZ, THIN_SPAN};
use crate::error::{Fault, SchemaError};
use crate::gnss;
use crate::header::{Header, Layout, Origin};
use crate::limits;
use crate::parts::{Clip, RawFrame, Trigger};
use crate::record::Record;
use crate::sample::{FIELDS, MISSING};
use crate::scale::{TwoSlope, ZERO_CODE};
use crate::time::{Grid, SECOND_NS, Stamp};
use crate::wire::too_large;

/// No length, speed or noise figure of a header is larger: products of a few of them stay finite.
const LARGEST: f64 = 1e9;

pub(crate) fn header(header: &Header) -> Result<(), Fault> {
    let Header {
        vehicle,
        imu,
        wheels,
        ..
    } = header;
    if header.number == 0 {
        return Err(Fault::new("number", "1 or more", 0));
    }
    if header.interfaces.len() > 256 {
        return Err(Fault::new(
            "interfaces",
            "at most 256",
            header.interfaces.len(),
        ));
    }
    if let Origin::Replay { logs } = &header.origin
        && logs.is_empty()
    {
        return Err(Fault::new("origin", "at least one log of a replay", 0));
    }
    positive("wheel_scale.step", header.wheel_scale.step)?;
    two_slope("accel_scale", &header.accel_scale)?;
    two_slope("rate_scale", &header.rate_scale)?;
    positive("vehicle.track_width_m", vehicle.track_width_m)?;
    for (field, position) in [
        ("vehicle.imu_position_m", vehicle.imu_position_m),
        ("vehicle.cg_position_m", vehicle.cg_position_m),
        ("imu.mounting", Some(imu.mounting)),
    ] {
        position
            .iter()
            .flatten()
            .try_for_each(|&x| finite(field, x))?;
    }
    for (field, sds) in [
        ("vehicle.imu_position_sd_m", vehicle.imu_position_sd_m),
        ("vehicle.cg_position_sd_m", vehicle.cg_position_sd_m),
        ("imu.mounting_sd", imu.mounting_sd),
    ] {
        sds.iter().try_for_each(|&sd| not_negative(field, sd))?;
    }
    imu.accel_range
        .map_or(Ok(()), |range| positive("imu.accel_range", range))?;
    imu.rate_range
        .map_or(Ok(()), |range| positive("imu.rate_range", range))?;
    for (field, value) in [
        ("imu.accel_density", imu.accel_density),
        ("imu.rate_density", imu.rate_density),
        ("imu.accel_bias", imu.accel_bias),
        ("imu.rate_bias", imu.rate_bias),
        ("imu.accel_bias_jump", imu.accel_bias_jump),
        ("imu.rate_bias_jump", imu.rate_bias_jump),
        ("imu.accel_scale", imu.accel_scale),
        ("imu.rate_scale", imu.rate_scale),
        ("imu.accel_vibration", imu.accel_vibration),
        ("imu.rate_vibration", imu.rate_vibration),
        ("wheels.latency_s", wheels.latency_s),
        ("wheels.latency_sd_s", wheels.latency_sd_s),
        ("wheels.cutoff_mps", wheels.cutoff_mps),
        ("wheels.scale_sd", wheels.scale_sd),
        ("wheels.scale_difference_sd", wheels.scale_difference_sd),
        ("wheels.noise_mps", wheels.noise_mps),
    ] {
        not_negative(field, value)?;
    }
    Ok(())
}

fn two_slope(field: &str, scale: &TwoSlope) -> Result<(), Fault> {
    positive(&format!("{field}.fine_step"), scale.fine_step)?;
    positive(&format!("{field}.coarse_step"), scale.coarse_step)?;
    not_negative(&format!("{field}.carry_limit"), scale.carry_limit)?;
    let steps = u32::from(scale.fine_steps) + u32::from(scale.coarse_steps);
    if steps != u32::from(ZERO_CODE) {
        return Err(Fault::new(
            format!("{field} steps"),
            "511 on each side of zero",
            steps,
        ));
    }
    Ok(())
}

fn finite(field: &str, value: f64) -> Result<(), Fault> {
    if value.abs() <= LARGEST {
        return Ok(());
    }
    Err(Fault::new(field, "a finite number up to 1e9", value))
}

fn not_negative(field: &str, value: f64) -> Result<(), Fault> {
    if (0.0..=LARGEST).contains(&value) {
        return Ok(());
    }
    Err(Fault::new(field, "a number from 0 to 1e9", value))
}

fn positive(field: &str, value: f64) -> Result<(), Fault> {
    if value.is_normal() && (0.0..=LARGEST).contains(&value) {
        return Ok(());
    }
    Err(Fault::new(field, "a number above 0, up to 1e9", value))
}

/// A block by itself and under its header.
pub(crate) fn block(block: &Block, header: &Header) -> Result<(), Fault> {
    let most = match (header.layout, block.rate_hz) {
        (_, FULL_HZ) => FULL_HZ,
        (Layout::TwoRate, THIN_HZ) => THIN_HZ,
        (Layout::Full, rate) => return Err(Fault::new("rate", "100 Hz in the full layout", rate)),
        (Layout::TwoRate, rate) => return Err(Fault::new("rate", "100 or 20 Hz", rate)),
    };
    if !(1..=usize::from(most)).contains(&block.samples.len()) {
        let expected = format!("1 to {most} at {most} Hz");
        return Err(Fault::new("samples", expected, block.samples.len()));
    }
    let beyond = |codes: &[u16; FIELDS]| codes.iter().copied().find(|&code| code > MISSING);
    if let Some(code) = block.samples.iter().find_map(|codes| beyond(&codes.0)) {
        return Err(Fault::new("samples", "codes of ten bits", code));
    }
    let mut unplaced = block.remainder.iter().zip(block.last_present());
    if let Some((part, _)) = unplaced.find(|(part, last)| **part != 0 && last.is_none()) {
        return Err(Fault::new(
            "remainder",
            "0 on an axis that is missing throughout the block",
            part,
        ));
    }
    if !block.stamp.is_valid() {
        return Err(Fault::new(
            "stamp",
            "a date and time",
            format!("{:?}", block.stamp),
        ));
    }
    let utc_ns = i128::from(block.monotonic_ns) + i128::from(header.clock.offset_ns);
    let clock = utc_ns.div_euclid(SECOND_NS.into());
    let apart = (i128::from(block.stamp.to_utc_s()) - clock).abs();
    if apart > i128::from(header.clock.leap_second) {
        let expected = i64::try_from(utc_ns).map(|ns| format!("{:?}", Stamp::from_utc_ns(ns)));
        let expected =
            expected.unwrap_or_else(|_| "a clock within the years 1677 to 2262".to_owned());
        return Err(Fault::new("stamp", expected, format!("{:?}", block.stamp)));
    }
    Ok(())
}

/// A block after the one before it: later, and on the same grid.
pub(crate) fn follows(before: Option<&Block>, block: &Block) -> Result<(), Fault> {
    let grid = |block: &Block| Grid::through(block.first_index, block.monotonic_ns, 0);
    let here = grid(block)?;
    let Some(before) = before else {
        return Ok(());
    };
    if block.first_index < before.end_index() {
        let expected = format!("{} or more", before.end_index());
        return Err(Fault::new("first_index", expected, block.first_index));
    }
    let there = grid(before)?;
    if here != there {
        let expected = there.monotonic_ns(block.first_index);
        return Err(Fault::new(
            "monotonic_ns",
            expected.to_string(),
            block.monotonic_ns,
        ));
    }
    Ok(())
}

pub(crate) fn clip(number: usize, clip: &Clip) -> Result<(), Fault> {
    let field = |name: &str| format!("bin {number}, {name}");
    if clip.axis > 5 {
        return Err(Fault::new(field("axis"), "0 to 5", clip.axis));
    }
    if !matches!(clip.sign, -1 | 1) {
        return Err(Fault::new(field("sign"), "-1 or 1", clip.sign));
    }
    if clip.clipped == 0 || clip.clipped > clip.frames {
        let expected = format!("1 to {} of the bin's frames", clip.frames);
        return Err(Fault::new(field("clipped"), expected, clip.clipped));
    }
    Ok(())
}

pub(crate) fn raw(number: usize, frame: &RawFrame, header: &Header) -> Result<(), Fault> {
    let field = |name: &str| format!("frame {number}, {name}");
    if usize::from(frame.interface) >= header.interfaces.len() {
        let expected = format!("one of the header's {} interfaces", header.interfaces.len());
        return Err(Fault::new(field("interface"), expected, frame.interface));
    }
    if frame.data.len() > limits::MAX_FRAME_DATA {
        return Err(Fault::new(
            field("payload"),
            "at most 64 bytes",
            frame.data.len(),
        ));
    }
    Ok(())
}

pub(crate) fn trigger(number: usize, trigger: &Trigger) -> Result<(), Fault> {
    for (name, value) in [("value", trigger.value), ("threshold", trigger.threshold)] {
        if !value.is_finite() {
            return Err(Fault::new(
                format!("trigger {number}, {name}"),
                "a finite number",
                value,
            ));
        }
    }
    Ok(())
}

/// The whole record in memory, before it is written.
pub(crate) fn record(record: &Record) -> Result<(), SchemaError> {
    header(&record.header).map_err(|fault| fault.at("header", None))?;
    if record.blocks.len() > limits::MAX_BLOCKS {
        let limit = crate::num::u64_of(limits::MAX_BLOCKS);
        return Err(too_large("record", limit, record.blocks.len(), "blocks"));
    }
    if record.blocks.is_empty() {
        return Err(Fault::new("blocks", "at least one second block", 0).at("record", None));
    }
    let mut before = None;
    for (number, here) in record.blocks.iter().enumerate() {
        block(here, &record.header)
            .and_then(|()| follows(before, here))
            .map_err(|fault| fault.at(format!("block {number}"), None))?;
        before = Some(here);
    }
    each(&record.clipping, clip).map_err(|fault| fault.at("clipping", None))?;
    each(&record.raw, |number, frame| {
        raw(number, frame, &record.header)
    })
    .map_err(|fault| fault.at("raw frames", None))?;
    if let Some(part) = &record.gnss {
        gnss::check(part).map_err(|fault| fault.at("satellite fixes", None))?;
    }
    each(&record.triggers, trigger).map_err(|fault| fault.at("triggers", None))
}

/// Checks every element.
pub(crate) fn each<T>(
    items: &[T],
    check: impl Fn(usize, &T) -> Result<(), Fault>,
) -> Result<(), Fault> {
    items
        .iter()
        .enumerate()
        .try_for_each(|(number, item)| check(number, item))
}

const _: () = assert!(FULL_HZ == THIN_HZ * THIN_SPAN);
