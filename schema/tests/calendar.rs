//! The time stamp: its bits, and the calendar against jiff's.
#![allow(clippy::unwrap_used, reason = "tests")]

use jiff::civil::DateTime;
use jiff::tz::TimeZone;
use proptest::prelude::*;
use schema::time::{Grid, START_SEQUENCE, Stamp};

const DAY_NS: i64 = 86_400_000_000_000;

fn stamp(year: u16, month: u8, day: u8, hour: u8, minute: u8, second: u8) -> Stamp {
    Stamp {
        year,
        month,
        day,
        hour,
        minute,
        second,
    }
}

fn jiff_of(utc_ns: i64) -> Stamp {
    let time: DateTime = jiff::Timestamp::from_nanosecond(utc_ns.into())
        .unwrap()
        .to_zoned(TimeZone::UTC)
        .datetime();
    let small = |n: i8| u8::try_from(n).unwrap();
    stamp(
        u16::try_from(time.year()).unwrap(),
        small(time.month()),
        small(time.day()),
        small(time.hour()),
        small(time.minute()),
        small(time.second()),
    )
}

#[test]
fn the_calendar_is_that_of_jiff() {
    // A prime number of days and nanoseconds apart, over all that 64 bits of nanoseconds hold.
    let mut utc_ns = i64::MIN;
    while let Some(next) = utc_ns.checked_add(7 * DAY_NS + 12_345_678_901) {
        let here = Stamp::from_utc_ns(utc_ns);
        assert_eq!(here, jiff_of(utc_ns));
        assert_eq!(here.to_utc_s(), utc_ns.div_euclid(1_000_000_000));
        assert_eq!(Stamp::from_bits48(here.to_bits48()), Some(here));
        utc_ns = next;
    }
    assert_eq!(Stamp::from_utc_ns(i64::MAX), jiff_of(i64::MAX));
}

#[test]
fn all_days_of_8192_years_follow_each_other() {
    let mut last = stamp(0, 1, 1, 0, 0, 0).to_utc_s() - 86_400;
    for year in 0..8192 {
        for month in 1..=12 {
            for day in 1..=31 {
                let here = stamp(year, month, day, 0, 0, 0);
                let exists = jiff::civil::Date::new(
                    year.cast_signed(),
                    month.cast_signed(),
                    day.cast_signed(),
                )
                .is_ok();
                assert_eq!(here.is_valid(), exists, "{here:?}");
                if exists {
                    assert_eq!(here.to_utc_s(), last + 86_400, "{here:?}");
                    last = here.to_utc_s();
                }
            }
        }
    }
}

#[test]
fn leap_seconds_end_a_month() {
    let leap = stamp(2016, 12, 31, 23, 59, 60);
    assert_eq!(Stamp::from_bits48(leap.to_bits48()), Some(leap));
    assert_eq!(leap.to_utc_s(), stamp(2017, 1, 1, 0, 0, 0).to_utc_s());
    for wrong in [
        stamp(2016, 12, 30, 23, 59, 60),
        stamp(2016, 12, 31, 23, 58, 60),
        stamp(2016, 12, 31, 22, 59, 60),
        stamp(2016, 12, 31, 23, 59, 61),
        stamp(2015, 2, 29, 0, 0, 0),
        stamp(2016, 0, 1, 0, 0, 0),
        stamp(2016, 13, 1, 0, 0, 0),
        stamp(2016, 1, 0, 0, 0, 0),
        stamp(2016, 1, 1, 24, 0, 0),
        stamp(2016, 1, 1, 0, 60, 0),
        stamp(8192, 1, 1, 0, 0, 0),
    ] {
        assert!(!wrong.is_valid(), "{wrong:?}");
        assert_eq!(
            Stamp::from_bits48(wrong.to_bits48()).filter(|back| *back == wrong),
            None
        );
    }
}

#[test]
fn the_start_sequence_cannot_match_its_own_shift() {
    for shift in 1..9 {
        assert_ne!(
            START_SEQUENCE >> shift,
            START_SEQUENCE & ((1 << (9 - shift)) - 1)
        );
    }
}

#[test]
fn a_second_begins_once() {
    let grid = Grid {
        origin_ns: 1_234_567,
        utc_offset_ns: 1_773_500_966_004_000_000,
    };
    let starts: Vec<u64> = (0..1000).filter(|&k| grid.starts_second(k)).collect();
    assert_eq!(starts.len(), 10);
    for k in 1..1000 {
        let new = grid.utc_second(k) != grid.utc_second(k - 1);
        assert_eq!(grid.starts_second(k), new, "{k}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_48_bits_are_a_stamp_or_none(bits in 0_u64..1 << 48) {
        let with_start = (bits & !(0x1FF << 39)) | (u64::from(START_SEQUENCE) << 39);
        if let Some(stamp) = Stamp::from_bits48(with_start) {
            prop_assert!(stamp.is_valid());
            prop_assert_eq!(stamp.to_bits48(), with_start);
        }
        prop_assert_eq!(Stamp::from_bits48(bits).is_some(), Stamp::from_bits48(with_start).is_some() && bits == with_start);
        prop_assert_eq!(Stamp::from_bits48(with_start | 1 << 48), None);
    }
}
