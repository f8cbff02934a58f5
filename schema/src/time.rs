//! The 48-bit time stamp of [S03, 3.2.1], the calendar behind it, and the grid of samples on the two clocks.

use crate::error::Fault;
use crate::sample::SAMPLE_NS;

/// The nine bits every second block begins with. No end of them is also their beginning, so they cannot match
/// a shifted copy of themselves; and neither runs of missing codes (ones) or of zero values (code 511) nor
/// erased memory contain them.
pub const START_SEQUENCE: u16 = 0b1_0111_0000;
/// Bytes of a stored stamp.
pub const STAMP_BYTES: usize = 6;
/// Nanoseconds of a second.
pub const SECOND_NS: i64 = 1_000_000_000;

const SECONDS_A_DAY: i64 = 86_400;
const WIDTHS: [u32; 7] = [9, 13, 4, 5, 5, 6, 6];

const _: () = assert!(
    WIDTHS[0] + WIDTHS[1] + WIDTHS[2] + WIDTHS[3] + WIDTHS[4] + WIDTHS[5] + WIDTHS[6] == 48
        && STAMP_BYTES == 6
);

/// UTC to the second, as stored: year 13 bits, month 4, day 5, hour 5, minute 6, second 6 (0 to 60).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Stamp {
    /// Year, 0 to 8191.
    pub year: u16,
    /// Month, 1 to 12.
    pub month: u8,
    /// Day, 1 to 31.
    pub day: u8,
    /// Hour, 0 to 23.
    pub hour: u8,
    /// Minute, 0 to 59.
    pub minute: u8,
    /// Second, 0 to 59, or 60 in a leap second.
    pub second: u8,
}

impl Stamp {
    /// The UTC second that holds an instant, nanoseconds since 1970-01-01 (years 1677 to 2262, no leap seconds).
    #[must_use]
    pub fn from_utc_ns(utc_ns: i64) -> Self {
        let seconds = utc_ns.div_euclid(SECOND_NS);
        let (year, month, day) = civil(seconds.div_euclid(SECONDS_A_DAY));
        let second_of_day = seconds.rem_euclid(SECONDS_A_DAY);
        Self {
            year: u16::try_from(year).unwrap_or(0),
            month,
            day,
            hour: small(second_of_day / 3600),
            minute: small(second_of_day / 60 % 60),
            second: small(second_of_day % 60),
        }
    }

    /// Seconds since 1970-01-01 as POSIX counts them; a leap second has the number of the second after it.
    #[must_use]
    pub fn to_utc_s(&self) -> i64 {
        let days = days(
            i64::from(self.year),
            i64::from(self.month),
            i64::from(self.day),
        );
        days * SECONDS_A_DAY
            + i64::from(self.hour) * 3600
            + i64::from(self.minute) * 60
            + i64::from(self.second)
    }

    /// The 48 bits, start sequence first, in the low end of the result. Fields beyond their width are cut;
    /// [`Stamp::is_valid`] tells.
    #[must_use]
    pub fn to_bits48(&self) -> u64 {
        let fields = [
            START_SEQUENCE,
            self.year,
            self.month.into(),
            self.day.into(),
            self.hour.into(),
            self.minute.into(),
            self.second.into(),
        ];
        fields.iter().zip(WIDTHS).fold(0, |bits, (&field, width)| {
            (bits << width) | (u64::from(field) & ((1 << width) - 1))
        })
    }

    /// The stamp in the low 48 bits; `None` without the start sequence or if it is no date and time.
    #[must_use]
    pub fn from_bits48(bits: u64) -> Option<Self> {
        let mut rest = bits;
        let mut fields = [0_u16; 7];
        for (field, width) in fields.iter_mut().zip(WIDTHS).rev() {
            *field = u16::try_from(rest & ((1 << width) - 1)).ok()?;
            rest >>= width;
        }
        let [start, year, rest @ ..] = fields;
        let [month, day, hour, minute, second] =
            rest.map(|field| u8::try_from(field).unwrap_or(u8::MAX));
        let stamp = Self {
            year,
            month,
            day,
            hour,
            minute,
            second,
        };
        (rest_is_empty(bits) && start == START_SEQUENCE && stamp.is_valid()).then_some(stamp)
    }

    /// The six stored bytes, most significant first.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; STAMP_BYTES] {
        let [_, _, bytes @ ..] = self.to_bits48().to_be_bytes();
        bytes
    }

    /// The stamp of six stored bytes; `None` as in [`Stamp::from_bits48`].
    #[must_use]
    pub fn from_bytes([a, b, c, d, e, f]: [u8; STAMP_BYTES]) -> Option<Self> {
        Self::from_bits48(u64::from_be_bytes([0, 0, a, b, c, d, e, f]))
    }

    /// True for a date of the Gregorian calendar and a time of day; second 60 only ends the last minute of a
    /// month, where leap seconds are inserted.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let leap_second = self.second == 60
            && self.minute == 59
            && self.hour == 23
            && self.day == days_of_month(self.year, self.month);
        self.year < 1 << WIDTHS[1]
            && (1..=12).contains(&self.month)
            && (1..=days_of_month(self.year, self.month)).contains(&self.day)
            && self.hour < 24
            && self.minute < 60
            && (self.second < 60 || leap_second)
    }
}

/// Nothing stands above the low 48 bits.
fn rest_is_empty(bits: u64) -> bool {
    bits >> 48 == 0
}

fn small(n: i64) -> u8 {
    u8::try_from(n).unwrap_or(u8::MAX)
}

fn days_of_month(year: u16, month: u8) -> u8 {
    let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    match month {
        2 if leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days from 1970-01-01 to a date, with years that begin in March so that the leap day comes last.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let (era, year_of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - 719_468
}

/// Year, month and day of a number of days from 1970-01-01: the inverse of [`days`].
fn civil(days: i64) -> (i64, u8, u8) {
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = (march_month + 2) % 12 + 1;
    let year = era * 400 + year_of_era + i64::from(month <= 2);
    (year, small(month), small(day))
}

/// The grid of 10 ms bins: where it lies on the monotonic clock, and that clock's offset to UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Monotonic time of the start of bin 0, ns.
    pub origin_ns: i64,
    /// UTC minus monotonic, ns, as frozen for the event.
    pub utc_offset_ns: i64,
}

impl Grid {
    /// The grid on which bin `index` starts at `monotonic_ns`; an error if bin 0 would lie outside 64 bits.
    pub(crate) fn through(
        index: u64,
        monotonic_ns: i64,
        utc_offset_ns: i64,
    ) -> Result<Self, Fault> {
        let origin = i128::from(monotonic_ns) - i128::from(index) * i128::from(SAMPLE_NS);
        let origin_ns = i64::try_from(origin).map_err(|_| {
            Fault::new(
                "first_index",
                "an index whose grid begins within 64 bits of ns",
                index,
            )
        })?;
        Ok(Self {
            origin_ns,
            utc_offset_ns,
        })
    }

    /// Start of bin `index` on the monotonic clock, ns; saturating.
    #[must_use]
    pub fn monotonic_ns(&self, index: u64) -> i64 {
        saturate(i128::from(self.origin_ns) + i128::from(index) * i128::from(SAMPLE_NS))
    }

    /// Start of bin `index` in UTC, ns since 1970; saturating.
    #[must_use]
    pub fn utc_ns(&self, index: u64) -> i64 {
        self.monotonic_ns(index).saturating_add(self.utc_offset_ns)
    }

    /// The UTC second that bin `index` starts in: samples with the same second form one block.
    #[must_use]
    pub fn utc_second(&self, index: u64) -> i64 {
        self.utc_ns(index).div_euclid(SECOND_NS)
    }

    /// True if bin `index` is the first that starts in its UTC second.
    #[must_use]
    pub fn starts_second(&self, index: u64) -> bool {
        self.utc_ns(index).rem_euclid(SECOND_NS) < SAMPLE_NS
    }
}

fn saturate(ns: i128) -> i64 {
    i64::try_from(ns).unwrap_or(if ns < 0 { i64::MIN } else { i64::MAX })
}
