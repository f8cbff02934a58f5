//! The 48-bit time stamp of [S03, 3.2.1] and the calendar behind it.

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
