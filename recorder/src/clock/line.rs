//! The line of time: UTC of the system clock at the beginning, going on with the monotonic clock.
//!
//! Kernel stamps are read off a clock that may be set between a frame's receipt and its being read, so the clock
//! that a stamp was read off is not known by itself. It follows from where the frame can have been: not before the
//! frame in front of it in the queue, and not after now. Each setting of the clock was in force for a stretch of the
//! line, and a stamp belongs to the first setting that puts it within the stretch.

use super::{Clocks, Reading};

/// Smaller changes than this, ns, are no step; they add up until they are.
const STEP_NS: i64 = 1_000_000;
/// Stamps are trusted to so much, ns: a step too small to be noted, and processors that stamp side by side.
const SLACK_NS: i64 = 2_000_000;
/// A stamp that has to be moved farther than this, ns, was not explained by any setting of the clock.
const UNEXPLAINED_NS: i64 = 50_000_000;
/// Settings that are remembered beside the one in force.
const SETTINGS: usize = 8;
/// A change of UTC against TAI of about this much, ns, is a leap second.
const SECOND_NS: i64 = 1_000_000_000;

/// The system clock was set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// When it was seen, ns on the line.
    pub at_ns: i64,
    /// New minus old UTC, ns.
    pub step_ns: i64,
    /// It is a leap second: UTC stepped, TAI did not.
    pub leap: bool,
}

/// One setting of the clock, and when it was in force.
#[derive(Clone, Copy, Debug)]
struct Setting {
    /// UTC minus monotonic, ns.
    offset_ns: i64,
    /// Last reading before it, ns on the line.
    from: i64,
    /// First reading after it, ns on the line.
    until: i64,
}

/// A frame's place on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Time on the line, ns.
    pub time_ns: i64,
    /// False: no known setting of the clock explains the stamp, the nearest possible time was taken.
    pub explained: bool,
}

/// The line.
#[derive(Clone, Debug)]
pub struct Line {
    /// UTC minus monotonic at the beginning, ns: the line is the monotonic clock plus this.
    origin_ns: i64,
    /// Settings, oldest first; the last is in force.
    settings: Vec<Setting>,
    tai_offset_ns: i64,
    leap: bool,
    read_ns: i64,
}

impl Line {
    /// Begins now.
    #[must_use]
    pub fn new(clocks: &mut dyn Clocks) -> Self {
        let reading = clocks.read();
        let offset_ns = reading.realtime_ns - reading.monotonic_ns;
        let mut settings = Vec::with_capacity(SETTINGS + 1);
        settings.push(Setting {
            offset_ns,
            from: reading.realtime_ns,
            until: i64::MAX,
        });
        Self {
            origin_ns: offset_ns,
            settings,
            tai_offset_ns: clocks.tai_offset_ns(),
            leap: false,
            read_ns: reading.realtime_ns,
        }
    }

    fn offset_ns(&self) -> i64 {
        self.settings
            .last()
            .map_or(self.origin_ns, |setting| setting.offset_ns)
    }

    /// UTC minus the line, ns: the sum of all steps.
    #[must_use]
    pub fn utc_offset_ns(&self) -> i64 {
        self.offset_ns() - self.origin_ns
    }

    /// A leap second fell since the beginning.
    #[must_use]
    pub fn leap(&self) -> bool {
        self.leap
    }

    /// Time of a reading on the line, ns.
    #[must_use]
    pub fn of(&self, reading: Reading) -> i64 {
        reading.monotonic_ns.saturating_add(self.origin_ns)
    }

    /// Takes a reading; gives the time on the line, and the step if the clock was set since the last one.
    pub fn read(&mut self, clocks: &mut dyn Clocks) -> (i64, Option<Step>) {
        let reading = clocks.read();
        let now = self.of(reading);
        let last = std::mem::replace(&mut self.read_ns, now);
        let offset_ns = reading.realtime_ns - reading.monotonic_ns;
        let step_ns = offset_ns - self.offset_ns();
        if step_ns.abs() < STEP_NS.saturating_add(reading.width_ns) {
            return (now, None);
        }
        let tai_offset_ns = clocks.tai_offset_ns();
        let moved = self.tai_offset_ns - tai_offset_ns;
        self.tai_offset_ns = tai_offset_ns;
        let leap = moved.abs() == SECOND_NS && (step_ns - moved).abs() < SECOND_NS / 2;
        self.leap |= leap;
        if let Some(old) = self.settings.last_mut() {
            old.until = now;
        }
        if self.settings.len() > SETTINGS {
            self.settings.remove(0);
        }
        self.settings.push(Setting {
            offset_ns,
            from: last,
            until: i64::MAX,
        });
        let step = Step {
            at_ns: now,
            step_ns,
            leap,
        };
        (now, Some(step))
    }

    /// Follows the offset of TAI, which is set by hand some time after the start; now and then is enough.
    pub fn follow_tai(&mut self, clocks: &mut dyn Clocks) {
        let reading = clocks.read();
        let step = reading.realtime_ns - reading.monotonic_ns - self.offset_ns();
        // A step that is still to be noted must find the old offset.
        if step.abs() < STEP_NS.saturating_add(reading.width_ns) {
            self.tai_offset_ns = clocks.tai_offset_ns();
        }
    }

    /// Where a stamp (UTC of the system clock, ns) lies: after the frame in front of it, or after the queue was last
    /// seen empty (`after_ns`, on the line; the smallest number if nothing is known), and before `now_ns`.
    #[must_use]
    pub fn place(&self, stamp_ns: i64, after_ns: i64, now_ns: i64) -> Place {
        let mut nearest = None;
        for setting in &self.settings {
            let time_ns = stamp_ns.saturating_sub(setting.offset_ns - self.origin_ns);
            let low = after_ns.max(setting.from);
            let high = now_ns.min(setting.until);
            if time_ns >= low.saturating_sub(SLACK_NS) && time_ns <= high.saturating_add(SLACK_NS) {
                return Place {
                    time_ns,
                    explained: true,
                };
            }
            let clamped = time_ns.min(now_ns).max(after_ns.min(now_ns));
            let moved = clamped.saturating_sub(time_ns).saturating_abs();
            if nearest.is_none_or(|(least, _)| moved < least) {
                nearest = Some((moved, clamped));
            }
        }
        let (moved, time_ns) = nearest.unwrap_or((i64::MAX, now_ns));
        Place {
            time_ns,
            explained: moved <= UNEXPLAINED_NS,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::FakeClocks;
    use super::*;

    const MS: i64 = 1_000_000;
    const HOUR: i64 = 3_600_000 * MS;
    const UTC: i64 = 1_700_000_000_000 * MS;

    /// Frames every `period` ns, read every `every` frames; the clock is set by `steps` (after so many frames).
    /// Gives the greatest error of a frame's place and the steps noted.
    fn run(period: i64, every: usize, steps: &[(usize, i64)]) -> (i64, Vec<Step>) {
        let mut clocks = FakeClocks::new(5_000 * MS, UTC);
        let mut line = Line::new(&mut clocks);
        let (mut queue, mut noted, mut after, mut worst) = (Vec::new(), Vec::new(), i64::MIN, 0);
        let mut truth = UTC;
        for at in 0..1000 {
            clocks.pass(period);
            truth += period;
            for (_, step) in steps.iter().filter(|(when, _)| *when == at) {
                clocks.step(*step);
            }
            queue.push((clocks.read().realtime_ns, truth));
            if at % every == every - 1 {
                clocks.pass(period / 2);
                truth += period / 2;
                let (now, step) = line.read(&mut clocks);
                assert_eq!(now, truth, "the line does not step");
                noted.extend(step);
                for (stamp, expected) in queue.drain(..) {
                    let place = line.place(stamp, after, now);
                    assert!(place.explained);
                    worst = worst.max((place.time_ns - expected).abs());
                    after = place.time_ns;
                }
            }
        }
        (worst, noted)
    }

    #[test]
    fn without_a_step_a_frames_time_is_its_stamp() {
        assert_eq!(run(100_000, 10, &[]), (0, Vec::new()));
    }

    #[test]
    fn an_hour_back_and_a_day_forward_move_no_frame() {
        for every in [1, 7, 40] {
            let steps = [(300, -HOUR), (305, 24 * HOUR), (700, -HOUR), (703, HOUR)];
            let (worst, noted) = run(10 * MS, every, &steps[..1]);
            assert_eq!((worst, noted.len()), (0, 1));
            assert_eq!(noted[0].step_ns, -HOUR);
            assert!(!noted[0].leap);
            let spread = [(300, -HOUR), (400, 24 * HOUR), (700, -23 * HOUR)];
            let (worst, noted) = run(10 * MS, every, &spread);
            assert_eq!((worst, noted.len()), (0, 3), "every {every}");
        }
    }

    #[test]
    fn two_steps_between_two_readings_leave_frames_between_the_readings() {
        let mut clocks = FakeClocks::new(0, UTC);
        let mut line = Line::new(&mut clocks);
        clocks.pass(10 * MS);
        clocks.step(-HOUR);
        let lost = clocks.read().realtime_ns;
        clocks.step(2 * HOUR);
        clocks.pass(10 * MS);
        let (now, step) = line.read(&mut clocks);
        assert_eq!(step.unwrap().step_ns, HOUR);
        let place = line.place(lost, UTC, now);
        assert!(!place.explained);
        assert!((UTC..=now).contains(&place.time_ns));
    }

    #[test]
    fn small_steps_are_noted_once_they_add_up() {
        let mut clocks = FakeClocks::new(0, UTC);
        let mut line = Line::new(&mut clocks);
        for _ in 0..3 {
            clocks.pass(10 * MS);
            clocks.step(300_000);
            assert_eq!(line.read(&mut clocks).1, None);
        }
        clocks.step(300_000);
        assert_eq!(line.read(&mut clocks).1.unwrap().step_ns, 1_200_000);
        assert_eq!(line.utc_offset_ns(), 1_200_000);
        assert_eq!(line.read(&mut clocks).1, None);
    }

    #[test]
    fn a_leap_second_is_told_from_a_clock_set_by_a_second() {
        let mut clocks = FakeClocks::new(0, UTC);
        let mut line = Line::new(&mut clocks);
        clocks.pass(10 * MS);
        clocks.step(-1000 * MS);
        line.follow_tai(&mut clocks);
        let step = line.read(&mut clocks).1.unwrap();
        assert_eq!(
            (step.step_ns, step.leap, line.leap()),
            (-1000 * MS, false, false)
        );
        clocks.pass(10 * MS);
        clocks.leap();
        line.follow_tai(&mut clocks);
        let step = line.read(&mut clocks).1.unwrap();
        assert_eq!(
            (step.step_ns, step.leap, line.leap()),
            (-1000 * MS, true, true)
        );
        assert_eq!(line.utc_offset_ns(), -2000 * MS);
    }

    #[test]
    fn settings_are_bounded() {
        let mut clocks = FakeClocks::new(0, UTC);
        let mut line = Line::new(&mut clocks);
        for _ in 0..100 {
            clocks.pass(10 * MS);
            clocks.step(HOUR);
            assert!(line.read(&mut clocks).1.is_some());
        }
        assert!(line.settings.len() <= SETTINGS + 1);
        let (now, _) = line.read(&mut clocks);
        let place = line.place(clocks.read().realtime_ns, i64::MIN, now);
        assert_eq!((place.time_ns, place.explained), (now, true));
    }

    proptest! {
        /// Around a step that is smaller than the time between two readings a frame may be out by the step, no more.
        #[test]
        fn no_frame_is_out_by_more_than_a_step(
            step in prop_oneof![-50 * MS..-MS, MS..50 * MS], every in 1_usize..30, at in 100_usize..900,
        ) {
            let (worst, noted) = run(MS, every, &[(at, step)]);
            prop_assert_eq!(noted.len(), 1);
            prop_assert!(worst <= step.abs(), "{} of {}", worst, step);
        }

        /// Any stamp gives a time between the frame before it and now, or one that a setting explains.
        #[test]
        fn any_stamp_has_a_place(stamp: i64, after in any::<i64>()) {
            let mut clocks = FakeClocks::new(0, UTC);
            let mut line = Line::new(&mut clocks);
            let (now, _) = line.read(&mut clocks);
            let place = line.place(stamp, after, now);
            prop_assert!(place.time_ns <= now + SLACK_NS);
        }
    }
}
