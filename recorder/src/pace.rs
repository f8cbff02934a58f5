//! How often a signal arrives: its period, its jitter, and when it was silent for too long.

/// Gaps the first period is the median of.
const FIRST: usize = 8;
/// Lost frames in a row, always as many, after which the period is taken to have changed.
const CHANGED: u32 = 12;
/// A signal silent for more than so many periods has a gap.
const GAP_PERIODS: f64 = 3.0;
/// ... and so many standard deviations of its receive times: a 1 kHz sensor's frames come some periods late without
/// one being lost.
const GAP_JITTERS: f64 = 6.0;

/// Frames after which the period is settled.
const SETTLED: f64 = 400.0;
/// Frames that come faster than this share of the settled period say that something else sends too.
const FASTER: f64 = 0.7;

impl Default for Pace {
    fn default() -> Self {
        Self::new()
    }
}

/// The pace of one signal.
#[derive(Clone, Debug)]
pub struct Pace {
    last_ns: Option<i64>,
    first: [f64; FIRST],
    count: usize,
    period: f64,
    weight: f64,
    variance: f64,
    slow: u32,
    frames: u64,
    settled: f64,
    fastest: f64,
}

impl Pace {
    /// Nothing has arrived yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            last_ns: None,
            first: [0.0; FIRST],
            count: 0,
            period: 0.0,
            weight: 0.0,
            variance: 0.0,
            slow: 0,
            frames: 0,
            settled: 0.0,
            fastest: f64::INFINITY,
        }
    }

    /// Receive time of the last frame, monotonic ns.
    #[must_use]
    pub fn last_ns(&self) -> Option<i64> {
        self.last_ns
    }

    /// The period, ns; 0 before nine frames.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Standard deviation of one receive time, ns, from the differences between neighbours.
    #[must_use]
    pub fn jitter(&self) -> f64 {
        (self.variance / 2.0).sqrt()
    }

    /// The longest settled period and the shortest one after it, ns, where the frames became clearly more than
    /// one sender with that period gives.
    #[must_use]
    pub fn crowded(&self) -> Option<(f64, f64)> {
        (self.fastest < FASTER * self.settled).then_some((self.settled, self.fastest))
    }

    /// Frames so far.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Silence longer than this is a gap, ns; infinite before the period is known.
    #[must_use]
    pub fn limit(&self) -> f64 {
        if self.period > 0.0 {
            GAP_PERIODS * self.period + GAP_JITTERS * self.jitter()
        } else {
            f64::INFINITY
        }
    }

    /// Notes a frame; gives the silence before it if that was a gap, as (from, to).
    pub fn arrive(&mut self, time_ns: i64) -> Option<(i64, i64)> {
        self.frames += 1;
        let last = self
            .last_ns
            .replace(time_ns.max(self.last_ns.unwrap_or(i64::MIN)))?;
        let step = schema::num::real_i64(time_ns.saturating_sub(last));
        if step <= 0.0 {
            return None;
        }
        if self.period == 0.0 {
            if let Some(slot) = self.first.get_mut(self.count) {
                *slot = step;
                self.count += 1;
            }
            if self.count == FIRST {
                self.first.sort_by(f64::total_cmp);
                self.period = self.first.get(FIRST / 2).copied().unwrap_or(step).max(1.0);
                self.weight = schema::num::real(FIRST);
            }
            return None;
        }
        let gap = step > self.limit();
        self.slow = if step > 1.5 * self.period && step < 20.0 * self.period {
            self.slow + 1
        } else {
            0
        };
        if self.slow >= CHANGED {
            (self.period, self.count, self.slow, self.variance) = (0.0, 0, 0, 0.0);
            return None;
        }
        if !gap {
            self.weight = (self.weight + 1.0).min(SETTLED);
            let error = step - self.period;
            self.period = (self.period + error / self.weight).max(1.0);
            self.variance += (error * error - self.variance) / self.weight;
            if self.weight >= SETTLED {
                if self.period > self.settled {
                    (self.settled, self.fastest) = (self.period, f64::INFINITY);
                }
                self.fastest = self.fastest.min(self.period);
            }
        }
        gap.then_some((last, time_ns))
    }

    /// Forgets the last frame: what follows is another stretch of time.
    pub fn pause(&mut self) {
        self.last_ns = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_more_than_three_periods() {
        let mut pace = Pace::default();
        for at in 0..50 {
            assert_eq!(pace.arrive(at * 20_000_000), None);
        }
        assert!((pace.period() - 2e7).abs() < 1.0);
        assert_eq!(
            pace.arrive(980_000_000 + 59_000_000),
            None,
            "three periods are none"
        );
        assert_eq!(
            pace.arrive(1_039_000_000 + 100_000_000),
            Some((1_039_000_000, 1_139_000_000))
        );
    }

    #[test]
    fn a_changed_period_is_followed() {
        let mut pace = Pace::default();
        let mut time = 0;
        for _ in 0..100 {
            time += 10_000_000;
            pace.arrive(time);
        }
        for _ in 0..100 {
            time += 20_000_000;
            pace.arrive(time);
        }
        assert!((pace.period() - 2e7).abs() < 1e3, "{}", pace.period());
    }
}
