//! What the spool costs: bytes written a day, and how long flash lasts.

use schema::num;

use super::block::BLOCK_BYTES;

/// Flash cells are written in pages of about so much, whatever is asked for, bytes.
pub const FLASH_PAGE: u64 = 16 * 1024;
/// Erase cycles that a cell of a consumer's card stands.
pub const CYCLES: u64 = 3000;
const DAY_S: f64 = 86_400.0;
const YEAR_DAYS: f64 = 365.25;

/// The cost of a flush interval while the car is in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wear {
    /// Bytes that are handed to the device a day (24 h of use).
    pub bytes_a_day: f64,
    /// Bytes that flash with pages of [`FLASH_PAGE`] writes for them.
    pub flash_bytes_a_day: f64,
    /// Years until so much flash has seen [`CYCLES`] cycles, with the wear spread evenly.
    pub years: f64,
}

/// The cost of one flush of `blocks` blocks each `flush_ns`, on `flash_bytes` of flash, `hours` a day.
#[must_use]
pub fn wear(flush_ns: i64, blocks: u64, flash_bytes: u64, hours: f64) -> Wear {
    let flushes = DAY_S * (hours / 24.0) * 1e9 / num::real_i64(flush_ns.max(1));
    let bytes = num::real_u64(blocks * num::u64_of(BLOCK_BYTES));
    let pages =
        num::real_u64((blocks * num::u64_of(BLOCK_BYTES)).div_ceil(FLASH_PAGE) * FLASH_PAGE);
    let flash = flushes * pages;
    Wear {
        bytes_a_day: flushes * bytes,
        flash_bytes_a_day: flash,
        years: num::real_u64(flash_bytes) * num::real_u64(CYCLES) / flash / YEAR_DAYS,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8 GB of flash, in use all day: 0.9 years at 20 ms and 4.6 at 100 ms.
    #[test]
    fn flash_lasts_as_long_as_calculated() {
        let years = |ms: i64| wear(ms * 1_000_000, 1, 8_000_000_000, 24.0).years;
        assert!((years(20) - 0.93).abs() < 0.02, "{}", years(20));
        assert!((years(100) - 4.6).abs() < 0.1, "{}", years(100));
        assert!((years(1000) / years(100) - 10.0).abs() < 1e-9);
        assert!((wear(40_000_000, 1, 8_000_000_000, 24.0).bytes_a_day / 8.85e9 - 1.0).abs() < 1e-3);
    }
}
