//! The explicit byte layouts: second blocks, clipping, raw frames and auxiliary signals, which are hot or
//! large and therefore never go through a general encoder.

use crate::block::Block;
use crate::error::{Fault, SchemaError};
use crate::limits::{self, CLIP_BYTES, RAW_FRAME_BYTES};
use crate::num;
use crate::parts::{AuxChannel, Clip, RawFrame};
use crate::sample::{AXES, Codes, SAMPLE_BYTES};
use crate::time::Stamp;
use crate::wire::{Cursor, length32, too_large};

/// What stands for a missing number: the quiet NaN without payload.
pub(crate) const MISSING_VALUE: u64 = 0x7ff8_0000_0000_0000;

pub(crate) fn put_block(out: &mut Vec<u8>, block: &Block) -> Result<(), SchemaError> {
    let count = u16::try_from(block.samples.len())
        .map_err(|_| too_large("second block", 100, block.samples.len(), "samples"))?;
    out.extend(block.first_index.to_le_bytes());
    out.extend(block.monotonic_ns.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.push(block.rate_hz);
    for part in block.remainder {
        out.extend(part.to_le_bytes());
    }
    out.extend(block.stamp.to_bytes());
    for codes in &block.samples {
        out.extend(codes.to_bytes());
    }
    Ok(())
}

pub(crate) fn block(place: &str, body: &[u8], at: usize) -> Result<Block, SchemaError> {
    let mut cursor = Cursor::new(place, body, at);
    let first_index = cursor.u64()?;
    let monotonic_ns = cursor.i64()?;
    let count = usize::from(cursor.u16()?);
    let rate_hz = cursor.u8()?;
    let mut remainder = [0; AXES];
    for part in &mut remainder {
        *part = i16::from_le_bytes(cursor.array()?);
    }
    let stamp: [u8; 6] = cursor.array()?;
    let stamp = Stamp::from_bytes(stamp).ok_or_else(|| {
        let expected = "the start sequence and a date and time";
        Fault::new("stamp", expected, crate::seal::Hex(&stamp)).at(place, Some(num::u64_of(at)))
    })?;
    let samples = cursor.take(count * SAMPLE_BYTES)?;
    cursor.end()?;
    let (samples, _) = samples.as_chunks();
    Ok(Block {
        stamp,
        rate_hz,
        first_index,
        monotonic_ns,
        remainder,
        samples: samples.iter().map(Codes::from_bytes).collect(),
    })
}

pub(crate) fn put_clipping(out: &mut Vec<u8>, clips: &[Clip]) -> Result<(), SchemaError> {
    if clips.len() > limits::MAX_CLIPS {
        let limit = num::u64_of(limits::MAX_CLIPS);
        return Err(too_large("clipping", limit, clips.len(), "bins"));
    }
    out.extend(length32("clipping", clips.len())?.to_le_bytes());
    for clip in clips {
        out.extend(clip.index.to_le_bytes());
        out.push(clip.axis);
        out.extend(clip.sign.to_le_bytes());
        out.extend(clip.clipped.to_le_bytes());
        out.extend(clip.frames.to_le_bytes());
    }
    Ok(())
}

pub(crate) fn clipping(body: &[u8], at: usize) -> Result<Vec<Clip>, SchemaError> {
    let mut cursor = Cursor::new("clipping", body, at);
    let count = cursor.count(CLIP_BYTES)?;
    let mut clips = Vec::with_capacity(count);
    for _ in 0..count {
        clips.push(Clip {
            index: cursor.u64()?,
            axis: cursor.u8()?,
            sign: i8::from_le_bytes(cursor.array()?),
            clipped: cursor.u16()?,
            frames: cursor.u16()?,
        });
    }
    cursor.end()?;
    Ok(clips)
}

pub(crate) fn put_raw(out: &mut Vec<u8>, frames: &[RawFrame]) -> Result<(), SchemaError> {
    let payload: usize = frames.iter().map(|frame| frame.data.len()).sum();
    let bytes = payload.saturating_add(frames.len().saturating_mul(RAW_FRAME_BYTES));
    if bytes > limits::MAX_RAW_BYTES {
        let limit = num::u64_of(limits::MAX_RAW_BYTES);
        return Err(too_large("raw frames", limit, bytes, "bytes"));
    }
    out.reserve(bytes + 4);
    out.extend(length32("raw frames", frames.len())?.to_le_bytes());
    for frame in frames {
        let length = u8::try_from(frame.data.len())
            .map_err(|_| too_large("payload of a raw frame", 64, frame.data.len(), "bytes"))?;
        out.extend(frame.monotonic_ns.to_le_bytes());
        out.extend(frame.id.to_le_bytes());
        out.extend([frame.interface, frame.flags, length]);
        out.extend(&frame.data);
    }
    Ok(())
}

pub(crate) fn raw(body: &[u8], at: usize) -> Result<Vec<RawFrame>, SchemaError> {
    let mut cursor = Cursor::new("raw frames", body, at);
    let count = cursor.count(RAW_FRAME_BYTES)?;
    let mut frames = Vec::with_capacity(count);
    for _ in 0..count {
        let monotonic_ns = cursor.i64()?;
        let id = cursor.u32()?;
        let [interface, flags, length] = cursor.array()?;
        frames.push(RawFrame {
            monotonic_ns,
            interface,
            id,
            flags,
            data: cursor.take(length.into())?.to_vec(),
        });
    }
    cursor.end()?;
    Ok(frames)
}

pub(crate) fn put_aux(out: &mut Vec<u8>, channels: &[AuxChannel]) -> Result<(), SchemaError> {
    const PLACE: &str = "auxiliary signals";
    out.extend(length32(PLACE, channels.len())?.to_le_bytes());
    for channel in channels {
        for text in [&channel.name, &channel.signal, &channel.unit] {
            let length = u16::try_from(text.len()).map_err(|_| {
                too_large(
                    "name of an auxiliary signal",
                    u16::MAX.into(),
                    text.len(),
                    "bytes",
                )
            })?;
            out.extend(length.to_le_bytes());
            out.extend(text.as_bytes());
        }
        out.extend(channel.first_index.to_le_bytes());
        out.extend(length32(PLACE, channel.values.len())?.to_le_bytes());
        for value in &channel.values {
            let bits = value
                .filter(|value| value.is_finite())
                .map_or(MISSING_VALUE, f64::to_bits);
            out.extend(bits.to_le_bytes());
        }
        if out.len() > limits::MAX_AUX_BYTES {
            let limit = num::u64_of(limits::MAX_AUX_BYTES);
            return Err(too_large(PLACE, limit, out.len(), "bytes"));
        }
    }
    Ok(())
}

pub(crate) fn aux(body: &[u8], at: usize) -> Result<Vec<AuxChannel>, SchemaError> {
    const PLACE: &str = "auxiliary signals";
    /// A channel with empty names and no values.
    const LEAST: usize = 3 * 2 + 8 + 4;
    let mut cursor = Cursor::new(PLACE, body, at);
    let count = cursor.count(LEAST)?;
    let mut channels = Vec::with_capacity(count);
    for channel in 0..count {
        let fault = |field: &str, expected: &str, found: String| {
            Fault::new(format!("channel {channel}, {field}"), expected, found)
                .at(PLACE, Some(num::u64_of(at)))
        };
        let mut text = |field: &str| {
            let length = cursor.u16()?;
            let bytes = cursor.take(length.into())?;
            String::from_utf8(bytes.to_vec()).map_err(|e| fault(field, "UTF-8", e.to_string()))
        };
        let (name, signal, unit) = (text("name")?, text("signal")?, text("unit")?);
        let first_index = cursor.u64()?;
        let length = cursor.count(8)?;
        let mut values = Vec::with_capacity(length);
        for _ in 0..length {
            let bits = cursor.u64()?;
            let value = f64::from_bits(bits);
            values.push(match bits {
                MISSING_VALUE => None,
                _ if value.is_finite() => Some(value),
                _ => {
                    return Err(fault(
                        "value",
                        "a finite number or the missing pattern",
                        format!("{bits:#018x}"),
                    ));
                }
            });
        }
        channels.push(AuxChannel {
            name,
            signal,
            unit,
            first_index,
            values,
        });
    }
    cursor.end()?;
    Ok(channels)
}
