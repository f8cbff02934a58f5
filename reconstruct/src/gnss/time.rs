//! UTC and GPS time. GPS time has no leap seconds, so it is ahead of UTC by as many as there were since 1980:
//! 16 s in the logs of [S00, 3.1], from August 2013 to March 2014. How many is taken from a log that has both, never
//! from a table.

use schema::num::{real_i64, round_i64};
use schema::time::{SECOND_NS, Stamp};

/// UTC of the start of GPS time, 1980-01-06, ms since 1970-01-01.
pub const GPS_EPOCH_MS: i64 = 315_964_800_000;
/// Milliseconds of a week.
const WEEK_MS: i64 = 604_800_000;
const SECOND_MS: i64 = 1000;
const MS_NS: i64 = SECOND_NS / SECOND_MS;
/// Years that have nanoseconds since 1970 in 64 bits to their end.
const YEARS: std::ops::RangeInclusive<u16> = 1970..=2261;

/// A GPS time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GpsTime {
    /// Weeks since 1980-01-06, not cut to ten bits.
    pub week: u32,
    /// Seconds of the week, 0 to below 604800.
    pub tow_s: f64,
}

/// The GPS time of a UTC, ms since 1970-01-01, where GPS time is `leap_s` ahead; `None` before 1980-01-06.
#[must_use]
pub fn gps_time(utc_ms: i64, leap_s: i32) -> Option<GpsTime> {
    let ms = utc_ms
        .checked_sub(GPS_EPOCH_MS)?
        .checked_add(i64::from(leap_s) * SECOND_MS)?;
    Some(GpsTime {
        week: u32::try_from(ms.div_euclid(WEEK_MS)).ok()?,
        tow_s: real_i64(ms.rem_euclid(WEEK_MS)) / real_i64(SECOND_MS),
    })
}

/// The UTC of a GPS time, ms since 1970-01-01 to the nearest, where GPS time is `leap_s` ahead.
#[must_use]
pub fn utc_ms(gps: GpsTime, leap_s: i32) -> i64 {
    let tow_ms = round_i64(gps.tow_s.clamp(0.0, real_i64(WEEK_MS)) * real_i64(SECOND_MS));
    GPS_EPOCH_MS + i64::from(gps.week) * WEEK_MS + tow_ms - i64::from(leap_s) * SECOND_MS
}

/// GPS time less UTC, s: the leap seconds, and what the clocks disagree by.
#[must_use]
pub fn gps_minus_utc_s(week: u32, tow_s: f64, utc_ms: i64) -> f64 {
    let start = GPS_EPOCH_MS + i64::from(week) * WEEK_MS;
    real_i64(start.saturating_sub(utc_ms)) / real_i64(SECOND_MS) + tow_s
}

/// A date `yyyy-mm-dd` at midnight.
pub(super) fn date(text: &str) -> Option<Stamp> {
    let [year, month, day] = parts(text, '-')?;
    let stamp = Stamp {
        year: number(year, 4..=4)?,
        month: small(month)?,
        day: small(day)?,
        hour: 0,
        minute: 0,
        second: 0,
    };
    (YEARS.contains(&stamp.year) && stamp.is_valid()).then_some(stamp)
}

/// A date with a time `hh:mm:ss.fff`, ms since 1970-01-01; of more decimals the nearest millisecond. A leap
/// second has the number of the second after it.
pub(super) fn instant(date: Stamp, text: &str) -> Option<i64> {
    let [hour, minute, rest] = parts(text, ':')?;
    let (second, fraction) = rest.split_once(['.', ',']).unwrap_or((rest, "0"));
    let stamp = Stamp {
        hour: small(hour)?,
        minute: small(minute)?,
        second: small(second)?,
        ..date
    };
    if !stamp.is_valid() {
        return None;
    }
    let whole: u32 = number(fraction, 1..=9)?;
    let places = u32::try_from(fraction.len()).ok()?;
    let ns = i64::from(whole) * 10_i64.checked_pow(9_u32.checked_sub(places)?)?;
    Some(stamp.to_utc_s() * SECOND_MS + (ns + MS_NS / 2) / MS_NS)
}

/// Date and time of ms since 1970-01-01; `None` outside the years a date is read of.
pub(super) fn written(utc_ms: i64, point: char) -> Option<[String; 2]> {
    let stamp = Stamp::from_utc_ns(utc_ms.checked_mul(MS_NS)?);
    if !YEARS.contains(&stamp.year) {
        return None;
    }
    let ms = utc_ms.rem_euclid(SECOND_MS);
    Some([
        format!("{:04}-{:02}-{:02}", stamp.year, stamp.month, stamp.day),
        format!(
            "{:02}:{:02}:{:02}{point}{ms:03}",
            stamp.hour, stamp.minute, stamp.second
        ),
    ])
}

fn parts(text: &str, between: char) -> Option<[&str; 3]> {
    let mut parts = text.split(between);
    let three = [parts.next()?, parts.next()?, parts.next()?];
    parts.next().is_none().then_some(three)
}

/// Digits and nothing else.
fn number<T: std::str::FromStr>(text: &str, digits: std::ops::RangeInclusive<usize>) -> Option<T> {
    let sound = digits.contains(&text.len()) && text.bytes().all(|b| b.is_ascii_digit());
    if sound { text.parse().ok() } else { None }
}

fn small(text: &str) -> Option<u8> {
    number(text, 1..=2)
}

#[cfg(test)]
mod tests {
    use super::{GpsTime, date, gps_minus_utc_s, gps_time, instant, utc_ms, written};

    fn ms(day: &str, time: &str) -> Option<i64> {
        instant(date(day)?, time)
    }

    #[test]
    fn the_days_of_the_three_drives() {
        // GPS weeks by the calendar: 1755 began on Sunday 2013-08-25.
        for (day, week, tow_s) in [
            ("2013-08-26", 1755, 86_416.5),
            ("2014-02-11", 1779, 172_816.5),
            ("2014-03-04", 1782, 172_816.5),
        ] {
            let utc = ms(day, "00:00:00.500").unwrap();
            assert_eq!(gps_time(utc, 16), Some(GpsTime { week, tow_s }));
            assert_eq!(utc_ms(GpsTime { week, tow_s }, 16), utc);
            assert!((gps_minus_utc_s(week, tow_s, utc) - 16.0).abs() < 1e-9);
        }
    }

    #[test]
    fn edges_of_gps_time() {
        let start = ms("1980-01-06", "00:00:00").unwrap();
        assert_eq!(start, super::GPS_EPOCH_MS);
        assert_eq!(
            gps_time(start, 0),
            Some(GpsTime {
                week: 0,
                tow_s: 0.0
            })
        );
        assert_eq!(gps_time(start - 1, 0), None);
        assert_eq!(gps_time(i64::MIN, 0), None);
        assert_eq!(gps_time(i64::MAX, i32::MAX), None);
        let last = gps_time(start + 604_799_999, 0).unwrap();
        assert_eq!((last.week, last.tow_s), (0, 604_799.999));
    }

    #[test]
    fn dates_and_times_as_written() {
        let utc = ms("2013-08-26", "09:08:07.065").unwrap();
        assert_eq!(utc, 1_377_508_087_065);
        assert_eq!(
            written(utc, ',').unwrap(),
            ["2013-08-26".to_owned(), "09:08:07,065".to_owned()]
        );
        assert_eq!(ms("2013-08-26", "9:8:7,0650"), Some(utc));
        assert_eq!(ms("2013-08-26", "09:08:07.0645"), Some(utc));
        assert_eq!(
            ms("2013-08-26", "23:59:59.9996"),
            ms("2013-08-27", "00:00:00")
        );
        assert_eq!(
            ms("2015-06-30", "23:59:60.2"),
            ms("2015-07-01", "00:00:00.2")
        );
        assert!(ms("2012-02-29", "00:00:00").is_some());
        for day in [
            "2013-13-01",
            "2013-00-01",
            "2013-02-29",
            "2013-8-32",
            "13-08-26",
            "2013/08/26",
            "2013-08",
            "2013-08-26-1",
            "+013-08-26",
            "1969-12-31",
            "2262-01-01",
            "",
        ] {
            assert!(date(day).is_none(), "{day}");
        }
        for time in [
            "24:00:00",
            "00:60:00",
            "00:00:60",
            "00:00",
            "a:b:c",
            "00:00:00.",
            "00:00:-1",
            "1:2:3:4",
        ] {
            assert!(ms("2013-08-26", time).is_none(), "{time}");
        }
        assert!(written(i64::MAX, '.').is_none() && written(-1, '.').is_none());
    }
}
