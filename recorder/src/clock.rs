//! The only reader of clocks, and what is made of their readings: the [line](mod@line) that frames' times are on, and the
//! map of a controller's own clock onto it ([`hardware`]).
//!
//! The system has two clocks that matter: `CLOCK_MONOTONIC`, which never steps, and `CLOCK_REALTIME` (UTC), which
//! the kernel stamps frames with and which can be set at any moment. Both are slewed alike by NTP, so that their
//! difference is constant but for steps: a step is seen as a change of the difference, drift never is.

pub mod hardware;
pub mod line;

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::time::{ClockId, clock_gettime};

pub use hardware::HardwareClock;
pub use line::{Line, Step};

/// Two readings of the monotonic clock farther apart than this, ns, were torn by the scheduler: read again.
const TIGHT_NS: i64 = 20_000;
/// So often at most; the tightest is taken.
const TRIES: usize = 4;
/// systemd-timesyncd touches this file at each successful synchronisation (systemd-timesyncd.service(8)).
const TIMESYNC: &str = "/run/systemd/timesync/synchronized";

/// Both clocks at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// `CLOCK_MONOTONIC`, ns.
    pub monotonic_ns: i64,
    /// `CLOCK_REALTIME`: UTC, ns since 1970.
    pub realtime_ns: i64,
    /// The two were read at most so far apart, ns.
    pub width_ns: i64,
}

/// Whatever reads clocks.
pub trait Clocks: Send {
    /// Both clocks, as nearly at once as can be had.
    fn read(&mut self) -> Reading;

    /// `CLOCK_TAI` minus `CLOCK_REALTIME`, ns. A leap second changes it, setting the clock does not: it is how one is
    /// told from the other.
    fn tai_offset_ns(&mut self) -> i64;

    /// UTC is known to be disciplined. The kernel's own word on it (adjtimex) can not be had without unsafe code, so
    /// this is what systemd-timesyncd says; false where it cannot be told.
    fn disciplined(&mut self) -> bool;

    /// Waits.
    fn sleep(&mut self, time: Duration);
}

/// The machine's clocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct SystemClocks;

/// A time as nanoseconds, saturating.
#[must_use]
pub fn nanoseconds(time: TimeSpec) -> i64 {
    time.tv_sec()
        .saturating_mul(1_000_000_000)
        .saturating_add(time.tv_nsec())
}

fn now(clock: ClockId) -> i64 {
    // It fails only for clocks that the kernel does not know, and it knows these three.
    clock_gettime(clock).map_or(0, nanoseconds)
}

/// `CLOCK_MONOTONIC`, ns: a clock that never steps.
#[must_use]
pub fn monotonic_ns() -> i64 {
    now(ClockId::CLOCK_MONOTONIC)
}

/// `CLOCK_REALTIME`: UTC, ns since 1970.
#[must_use]
pub fn realtime_ns() -> i64 {
    now(ClockId::CLOCK_REALTIME)
}

impl Clocks for SystemClocks {
    fn read(&mut self) -> Reading {
        let mut best = Reading {
            width_ns: i64::MAX,
            ..Reading::default()
        };
        for _ in 0..TRIES {
            let before = now(ClockId::CLOCK_MONOTONIC);
            let realtime_ns = now(ClockId::CLOCK_REALTIME);
            let width_ns = now(ClockId::CLOCK_MONOTONIC) - before;
            if width_ns < best.width_ns {
                best = Reading {
                    monotonic_ns: before + width_ns / 2,
                    realtime_ns,
                    width_ns,
                };
            }
            if width_ns <= TIGHT_NS {
                break;
            }
        }
        best
    }

    fn tai_offset_ns(&mut self) -> i64 {
        // Offsets are whole seconds: the time between the two readings is rounded away.
        let difference = now(ClockId::CLOCK_TAI) - now(ClockId::CLOCK_REALTIME);
        (difference + 500_000_000).div_euclid(1_000_000_000) * 1_000_000_000
    }

    fn disciplined(&mut self) -> bool {
        Path::new(TIMESYNC).exists()
    }

    fn sleep(&mut self, time: Duration) {
        std::thread::sleep(time);
    }
}

/// Clocks that are set by hand; clones are the same clocks.
#[derive(Clone, Debug, Default)]
pub struct FakeClocks(Arc<Mutex<(Reading, i64)>>);

impl FakeClocks {
    /// Clocks that show this.
    #[must_use]
    pub fn new(monotonic_ns: i64, realtime_ns: i64) -> Self {
        let reading = Reading {
            monotonic_ns,
            realtime_ns,
            width_ns: 0,
        };
        Self(Arc::new(Mutex::new((reading, 37_000_000_000))))
    }

    fn change(&self, change: impl FnOnce(&mut (Reading, i64))) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Time passes, ns.
    pub fn pass(&self, ns: i64) {
        self.change(|(reading, _)| {
            reading.monotonic_ns += ns;
            reading.realtime_ns += ns;
        });
    }

    /// UTC is set by so much, ns.
    pub fn step(&self, ns: i64) {
        self.change(|(reading, _)| reading.realtime_ns += ns);
    }

    /// A second is inserted: UTC shows it twice.
    pub fn leap(&self) {
        self.change(|(reading, tai)| {
            reading.realtime_ns -= 1_000_000_000;
            *tai += 1_000_000_000;
        });
    }
}

impl Clocks for FakeClocks {
    fn read(&mut self) -> Reading {
        let mut read = Reading::default();
        self.change(|(reading, _)| read = *reading);
        read
    }

    fn tai_offset_ns(&mut self) -> i64 {
        let mut offset = 0;
        self.change(|(_, tai)| offset = *tai);
        offset
    }

    fn disciplined(&mut self) -> bool {
        false
    }

    fn sleep(&mut self, time: Duration) {
        self.pass(i64::try_from(time.as_nanos()).unwrap_or(i64::MAX));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machines_clocks_agree_and_run_forwards() {
        let mut clocks = SystemClocks;
        let first = clocks.read();
        clocks.sleep(Duration::from_millis(2));
        let second = clocks.read();
        assert!(second.monotonic_ns - first.monotonic_ns >= 2_000_000);
        assert!(first.realtime_ns > 1_600_000_000_000_000_000);
        assert_eq!(clocks.tai_offset_ns() % 1_000_000_000, 0);
    }
}
