//! Numbers as text with fixed decimals, and time as ISO 8601: the same input gives the same bytes.

use std::fmt::Write as _;

use schema::num;

const POWERS: [f64; 10] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];

/// Appends `x` with `decimals` (at most 9) digits behind the point, halves away from zero, never `-0`.
/// Appends nothing if `x` is not finite: a missing value is an empty field.
pub fn push(out: &mut String, x: f64, decimals: usize) {
    if !x.is_finite() {
        return;
    }
    let decimals = decimals.min(9);
    let scaled = x * POWERS.get(decimals).copied().unwrap_or(1.0);
    if scaled.abs() >= 9e15 {
        let _ = write!(out, "{x:.decimals$}");
        return;
    }
    let whole = num::round_i64(scaled);
    // Written from the end: at most 16 digits, a point and a sign.
    let mut text = [b'0'; 24];
    let mut rest = whole.unsigned_abs();
    let mut place = text.len();
    let mut written = 0;
    while rest > 0 || written <= decimals {
        if written == decimals && decimals > 0 {
            place -= 1;
            text[place] = b'.';
        }
        place -= 1;
        text[place] = b'0' + u8::try_from(rest % 10).unwrap_or(0);
        rest /= 10;
        written += 1;
    }
    if whole < 0 {
        place -= 1;
        text[place] = b'-';
    }
    out.push_str(std::str::from_utf8(&text[place..]).unwrap_or(""));
}

/// `x` with fixed decimals; empty if it is not finite.
#[must_use]
pub fn fixed(x: f64, decimals: usize) -> String {
    let mut out = String::new();
    push(&mut out, x, decimals);
    out
}

/// UTC nanoseconds since 1970 as ISO 8601 with milliseconds and `Z`; empty if the calendar does not reach there.
#[must_use]
pub fn utc(ns: i64) -> String {
    let ms = ns.div_euclid(1_000_000) + i64::from(ns.rem_euclid(1_000_000) >= 500_000);
    jiff::Timestamp::from_millisecond(ms).map_or_else(|_| String::new(), |t| format!("{t:.3}"))
}

/// Bytes as lower-case hexadecimal digits.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    let mut out = String::with_capacity(bytes.len() * 2);
    for byte in bytes {
        let _ = write!(out, "{byte:02x}");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{fixed, hex, utc};

    #[test]
    fn numbers_are_padded_rounded_and_never_minus_zero() {
        assert_eq!(fixed(-0.000_01, 3), "0.000");
        assert_eq!(fixed(-0.05, 1), "-0.1");
        assert_eq!(fixed(12.345_6, 2), "12.35");
        assert_eq!(fixed(7.0, 0), "7");
        assert_eq!(fixed(0.0, 0), "0");
        assert_eq!(fixed(-1234.5, 4), "-1234.5000");
        assert_eq!(fixed(f64::NAN, 2), "");
        assert_eq!(fixed(f64::INFINITY, 2), "");
        assert_eq!(fixed(3e20, 1), "300000000000000000000.0");
    }

    #[test]
    fn time_has_milliseconds_and_zulu() {
        assert_eq!(utc(1_700_000_000_123_456_789), "2023-11-14T22:13:20.123Z");
        assert_eq!(utc(1_700_000_000_999_600_000), "2023-11-14T22:13:21.000Z");
        assert_eq!(hex(&[0, 171, 255]), "00abff");
    }
}
