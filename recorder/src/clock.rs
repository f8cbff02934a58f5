//! The only reader of clocks.

use nix::time::{ClockId, clock_gettime};

fn read(clock: ClockId) -> i64 {
    clock_gettime(clock).map_or(0, |time| {
        time.tv_sec()
            .saturating_mul(1_000_000_000)
            .saturating_add(time.tv_nsec())
    })
}

/// A clock that never steps, ns since some fixed instant.
#[must_use]
pub fn monotonic_ns() -> i64 {
    read(ClockId::CLOCK_MONOTONIC)
}

/// The system clock, UTC, ns since 1970.
#[must_use]
pub fn realtime_ns() -> i64 {
    read(ClockId::CLOCK_REALTIME)
}
