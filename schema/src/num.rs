//! The few number conversions that `From` does not offer, each total, in one place.
#![allow(
    clippy::as_conversions,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "this module is where casts live, so that every other module can forbid them; \
              float-to-integer `as` saturates and maps NaN to 0, which is what the callers want"
)]

/// A count as a float; exact below 2^53, which no count here reaches.
#[must_use]
pub fn real(n: usize) -> f64 {
    n as f64
}

/// A 64-bit integer as a float; exact below 2^53, else rounded to the nearest.
#[must_use]
pub fn real_i64(n: i64) -> f64 {
    n as f64
}

/// A 64-bit count as a float; exact below 2^53, else rounded to the nearest.
#[must_use]
pub fn real_u64(n: u64) -> f64 {
    n as f64
}

/// The nearest integer, saturating; NaN gives 0.
#[must_use]
pub fn round_i64(x: f64) -> i64 {
    x.round() as i64
}

/// The nearest of 16 bits.
#[must_use]
pub fn saturate_i16(n: i64) -> i16 {
    i16::try_from(n).unwrap_or(if n < 0 { i16::MIN } else { i16::MAX })
}

/// The integer part towards minus infinity, saturating; NaN gives 0.
#[must_use]
pub fn floor_i64(x: f64) -> i64 {
    x.floor() as i64
}

/// The nearest index, saturating at 0 and `usize::MAX`; NaN gives 0.
#[must_use]
pub fn round_usize(x: f64) -> usize {
    x.round() as usize
}

/// A length or index as 64 bits (lossless on every supported target).
#[must_use]
pub fn u64_of(n: usize) -> u64 {
    n as u64
}

/// A 64-bit number as an index, saturating where `usize` is narrower.
#[must_use]
pub fn usize_of(n: u64) -> usize {
    usize::try_from(n).unwrap_or(usize::MAX)
}
