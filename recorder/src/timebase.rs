//! From the stamps of the frames to a monotonic time that never goes back.
//!
//! Frames of several buses come some milliseconds out of order; a clock may be set; a stamp may be garbage. A
//! frame that is more than 50 ms earlier or 10 s later than the newest so far is held back: if the next
//! one agrees with it, time itself stepped, else it was one stray frame and is dropped.

use schema::sample::SAMPLE_NS;

/// Frames may be earlier than the newest by so much, ns.
const EARLIER_NS: i64 = 50_000_000;
/// A longer silence of all interfaces than this must be confirmed by a second frame, ns.
const LATER_NS: i64 = 10_000_000_000;

/// A longer silence than a day is no silence: the clock was set.
const CLOCK_SET_NS: i64 = 86_400_000_000_000;
/// The monotonic line ends here (126 years): later stamps are strays, so that no time can overflow.
const END_NS: i64 = 4_000_000_000_000_000_000;

/// What to do with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// It is in time.
    Good,
    /// Hold it back until the next one.
    Hold,
    /// The held frame was a stray; this one is in time.
    DropHeld,
    /// The held frame was a stray; hold this one.
    Replace,
    /// A stray that can not be taken at all.
    Drop,
    /// The held frame was right: time stepped back, or was silent for long. Step first, then take both.
    Step,
}

/// The monotonic line.
#[derive(Clone, Copy, Debug)]
pub struct Timebase {
    offset_ns: i64,
    newest_ns: i64,
    held: Option<i64>,
}

impl Timebase {
    /// Begins at the first frame: monotonic time 0 is a full UTC second one to two seconds earlier.
    #[must_use]
    pub fn new(first_ns: i64) -> Self {
        let offset_ns = (first_ns.div_euclid(1_000_000_000) - 1) * 1_000_000_000;
        Self {
            offset_ns,
            newest_ns: first_ns,
            held: None,
        }
    }

    /// UTC minus monotonic time, ns; always full bins.
    #[must_use]
    pub fn offset_ns(&self) -> i64 {
        self.offset_ns
    }

    /// Monotonic time of a stamp.
    #[must_use]
    pub fn monotonic(&self, stamp_ns: i64) -> i64 {
        stamp_ns.saturating_sub(self.offset_ns)
    }

    /// Monotonic time of the newest frame.
    #[must_use]
    pub fn now_ns(&self) -> i64 {
        self.monotonic(self.newest_ns)
    }

    /// Time has come to this stamp without a frame; false if a frame was later.
    pub fn pass(&mut self, stamp_ns: i64) -> bool {
        let later = stamp_ns > self.newest_ns && self.monotonic(stamp_ns) <= END_NS;
        if later {
            self.newest_ns = stamp_ns;
        }
        later
    }

    /// Judges a stamp.
    pub fn judge(&mut self, stamp_ns: i64) -> Judgement {
        if self.monotonic(stamp_ns) > END_NS {
            return Judgement::Drop;
        }
        let near = |to: i64| (-EARLIER_NS..=LATER_NS).contains(&stamp_ns.saturating_sub(to));
        let held = self.held.take();
        match (near(self.newest_ns), held) {
            (true, held) => {
                self.newest_ns = self.newest_ns.max(stamp_ns);
                if held.is_some() {
                    Judgement::DropHeld
                } else {
                    Judgement::Good
                }
            }
            (false, Some(held)) if near(held) => Judgement::Step,
            (false, held) => {
                self.held = Some(stamp_ns);
                if held.is_some() {
                    Judgement::Replace
                } else {
                    Judgement::Hold
                }
            }
        }
    }

    /// Time goes on at a stamp that was confirmed. Forwards (by up to a day) the line simply goes on; else it is
    /// moved so that one bin is left out. Gives the change of the offset and the end of that bin.
    pub fn step(&mut self, stamp_ns: i64) -> Option<(i64, i64)> {
        let before = self.newest_ns;
        self.newest_ns = stamp_ns;
        if stamp_ns >= before && stamp_ns - before <= CLOCK_SET_NS {
            return None;
        }
        let seam_end =
            (before.saturating_sub(self.offset_ns).div_euclid(SAMPLE_NS) + 2) * SAMPLE_NS;
        let old = self.offset_ns;
        self.offset_ns = stamp_ns.div_euclid(SAMPLE_NS) * SAMPLE_NS - seam_end;
        Some((self.offset_ns - old, seam_end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    #[test]
    fn strays_are_dropped_and_steps_confirmed() {
        let mut line = Timebase::new(100 * S + 5);
        assert_eq!(line.now_ns(), S + 5);
        assert_eq!(line.judge(100 * S + 20_000_000), Judgement::Good);
        assert_eq!(
            line.judge(100 * S),
            Judgement::Good,
            "20 ms earlier is another bus"
        );
        assert_eq!(line.judge(5000 * S), Judgement::Hold);
        assert_eq!(line.judge(100 * S + 30_000_000), Judgement::DropHeld);
        assert_eq!(line.judge(50 * S), Judgement::Hold);
        assert_eq!(line.judge(70 * S), Judgement::Replace);
        assert_eq!(line.judge(70 * S + 1), Judgement::Step);
        let now = line.now_ns();
        let (moved, seam_end) = line.step(70 * S).unwrap();
        assert_eq!(moved % SAMPLE_NS, 0);
        assert!(line.now_ns() >= seam_end && seam_end - now <= 2 * SAMPLE_NS);
    }
}
