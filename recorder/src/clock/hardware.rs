//! A CAN controller's own clock, mapped onto the line.
//!
//! A controller stamps a frame when it ends on the wire, by a clock that began at some moment and drifts; the kernel
//! stamps the same frame when the interrupt is served: later by a delay that jitters but has a floor. So the map is
//! the line *under* the pairs (hardware stamp, delay): of each second the least delay is kept, and the fit is the edge
//! of their lower convex hull that spans their middle - the line below all points that comes nearest to them in the
//! mean, as for clock skew over networks (Moon, Skelly, Towsley, INFOCOM 1999). What no fit can see is the constant
//! part of the delay; frames of one interface share it.

use schema::num;

/// One least delay is kept a second of the hardware's clock.
const BUCKET_NS: i64 = 1_000_000_000;
/// So many are kept: a minute and some.
const BUCKETS: usize = 64;
/// A frame is not stamped by the kernel before its end by more than this, ns: the clock jumped.
const EARLY_NS: f64 = 1e6;
/// Nor later by more than this, ns, save for single frames.
const LATE_NS: f64 = 50e6;
/// Without frames the clock may wander off by so much of the time that passed.
const WANDER: f64 = 1e-4;
/// So many frames in a row that do not fit: the clock jumped.
const JUMPED: u32 = 8;
/// No oscillator of a controller is farther off than this.
const DRIFT_LIMIT: f64 = 1e-3;
/// Uncertainty of a map by a single frame, ns.
const FIRST_NS: f64 = 1e6;
/// No map is better than this, ns.
const BEST_NS: f64 = 1e3;

/// What became of a frame's hardware stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapped {
    /// Time on the line, ns.
    pub time_ns: i64,
    /// With this frame it became certain that the hardware clock had jumped (a reset, a wrap), by so much, ns.
    pub jumped_ns: Option<i64>,
}

/// The map of one controller's clock.
#[derive(Clone, Debug)]
pub struct HardwareClock {
    /// Hardware time that the map is told from; delays are relative to `base_ns`.
    epoch_ns: i64,
    /// Line minus hardware at the first frame of this map.
    base_ns: i64,
    /// Least delay of past seconds: (hardware time from the epoch, delay above the base), ns.
    points: Vec<(f64, f64)>,
    /// The second in progress, and its least.
    bucket: Option<(i64, (f64, f64))>,
    /// Delay at the epoch, and its change a nanosecond.
    intercept: f64,
    slope: f64,
    uncertainty: f64,
    last_ns: i64,
    misfits: u32,
    hull: Vec<(f64, f64)>,
}

impl Default for HardwareClock {
    fn default() -> Self {
        Self::new()
    }
}

impl HardwareClock {
    /// Nothing is known yet.
    #[must_use]
    pub fn new() -> Self {
        Self {
            epoch_ns: 0,
            base_ns: 0,
            points: Vec::with_capacity(BUCKETS + 1),
            bucket: None,
            intercept: 0.0,
            slope: 0.0,
            uncertainty: FIRST_NS,
            last_ns: 0,
            misfits: 0,
            hull: Vec::with_capacity(BUCKETS + 1),
        }
    }

    /// Line minus hardware clock now (at its last frame), and one sigma of it, ns; `None` before the first frame.
    #[must_use]
    pub fn offset_ns(&self) -> Option<(i64, u64)> {
        self.bucket?;
        let x = num::real_i64(self.last_ns.saturating_sub(self.epoch_ns));
        let offset = self.base_ns.saturating_add(num::round_i64(self.delay(x)));
        let uncertainty = u64::try_from(num::round_i64(self.uncertainty)).unwrap_or_default();
        Some((offset, uncertainty))
    }

    /// Drift against the line: the hardware clock gains so much (0.00005 is 50 ppm).
    #[must_use]
    pub fn drift(&self) -> f64 {
        -self.slope
    }

    fn delay(&self, x: f64) -> f64 {
        self.slope.mul_add(x, self.intercept)
    }

    /// Begins anew at a frame; the drift is the oscillator's and stays.
    fn begin(&mut self, hardware_ns: i64, software_ns: i64) {
        self.epoch_ns = hardware_ns;
        self.base_ns = software_ns.saturating_sub(hardware_ns);
        self.points.clear();
        self.bucket = Some((0, (0.0, 0.0)));
        self.intercept = 0.0;
        self.uncertainty = FIRST_NS;
        self.last_ns = hardware_ns;
        self.misfits = 0;
    }

    /// Maps a frame's hardware stamp, and learns from the kernel's stamp of the same frame (on the line).
    pub fn map(&mut self, hardware_ns: i64, software_ns: i64) -> Mapped {
        if self.bucket.is_none() {
            self.begin(hardware_ns, software_ns);
            return Mapped {
                time_ns: software_ns,
                jumped_ns: None,
            };
        }
        let since = hardware_ns.saturating_sub(self.epoch_ns);
        let x = num::real_i64(since);
        let y = num::real_i64(
            software_ns
                .saturating_sub(hardware_ns)
                .saturating_sub(self.base_ns),
        );
        let late = y - self.delay(x);
        let silence = num::real_i64(hardware_ns.saturating_sub(self.last_ns)).abs();
        let wander = (WANDER * silence).min(LATE_NS);
        if late < -(EARLY_NS + wander) || late > LATE_NS + wander {
            return self.misfit(hardware_ns, software_ns, late);
        }
        self.misfits = 0;
        self.last_ns = hardware_ns;
        self.learn(since.div_euclid(BUCKET_NS), (x, y));
        let delay = num::round_i64(self.delay(x));
        Mapped {
            time_ns: hardware_ns
                .saturating_add(self.base_ns)
                .saturating_add(delay),
            jumped_ns: None,
        }
    }

    fn misfit(&mut self, hardware_ns: i64, software_ns: i64, late: f64) -> Mapped {
        self.misfits += 1;
        let jumped = self.misfits >= JUMPED;
        if jumped {
            self.begin(hardware_ns, software_ns);
        }
        Mapped {
            time_ns: software_ns,
            jumped_ns: jumped.then(|| num::round_i64(-late)),
        }
    }

    fn learn(&mut self, second: i64, point: (f64, f64)) {
        let Some((current, least)) = &mut self.bucket else {
            return;
        };
        if *current == second {
            // By what a frame came later than the map says, so that drift within the second counts for nothing.
            if point.1 - self.slope * point.0 < least.1 - self.slope * least.0 {
                *least = point;
                // Before the first fit the map is the least delay so far.
                if self.points.is_empty() {
                    self.intercept = point.1 - self.slope * point.0;
                }
            }
            return;
        }
        let done = std::mem::replace(least, point);
        *current = second;
        if self.points.len() == BUCKETS {
            self.points.remove(0);
        }
        self.points.push(done);
        self.fit();
    }

    /// The edge of the lower hull below the middle of the points.
    fn fit(&mut self) {
        self.hull.clear();
        for &point in &self.points {
            while let [.., a, b] = self.hull.as_slice() {
                let turn = (b.0 - a.0) * (point.1 - a.1) - (b.1 - a.1) * (point.0 - a.0);
                if turn > 0.0 {
                    break;
                }
                self.hull.pop();
            }
            self.hull.push(point);
        }
        let count = num::real(self.points.len());
        let middle = self.points.iter().map(|point| point.0).sum::<f64>() / count;
        let edge = self
            .hull
            .windows(2)
            .find(|edge| matches!(edge, [_, b] if b.0 >= middle));
        if let Some([a, b]) = edge
            && b.0 - a.0 >= num::real_i64(BUCKET_NS)
        {
            let slope = (b.1 - a.1) / (b.0 - a.0);
            self.slope = slope.clamp(-DRIFT_LIMIT, DRIFT_LIMIT);
            self.intercept = a.1 - self.slope * a.0;
        } else if let Some(point) = self.hull.first() {
            self.intercept = point.1 - self.slope * point.0;
        }
        // How far the seconds' least delays lie above the line: the floor is known to about that.
        let excess = self
            .points
            .iter()
            .map(|point| point.1 - self.slope.mul_add(point.0, self.intercept));
        let mean = excess.sum::<f64>() / count;
        let young = if self.points.len() < 3 { FIRST_NS } else { 0.0 };
        self.uncertainty = mean.max(BEST_NS) + young;
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const MS: i64 = 1_000_000;
    const FLOOR: i64 = 40_000;

    /// A controller whose clock gains 50 ppm and whose frames the kernel stamps late.
    struct Controller {
        random: ChaCha8Rng,
        truth: i64,
        reset: i64,
        wrap: i64,
        map: HardwareClock,
        jumps: Vec<i64>,
    }

    impl Controller {
        fn new() -> Self {
            Self {
                random: ChaCha8Rng::seed_from_u64(7),
                truth: 1_700_000_000_000 * MS,
                reset: 1_700_000_000_000 * MS - 12_345,
                wrap: i64::MAX,
                map: HardwareClock::new(),
                jumps: Vec::new(),
            }
        }

        fn hardware(&self) -> i64 {
            let passed = self.truth - self.reset;
            (passed + passed / 20_000).rem_euclid(self.wrap)
        }

        /// Runs for so many frames 1 ms apart; gives the worst error of a frame's time, the constant floor taken out.
        fn run(&mut self, frames: u32) -> i64 {
            let mut worst = 0;
            for _ in 0..frames {
                self.truth += MS;
                // Mostly tens of microseconds, now and then milliseconds.
                let unit: f64 = self.random.random_range(0.0..1.0);
                let mut delay = FLOOR + num::round_i64(-30_000.0 * (1.0 - unit).ln());
                if self.random.random_range(0..200) == 0 {
                    delay += self.random.random_range(0..20 * MS);
                }
                let mapped = self.map.map(self.hardware(), self.truth + delay);
                self.jumps.extend(mapped.jumped_ns);
                worst = worst.max((mapped.time_ns - self.truth - FLOOR).abs());
            }
            worst
        }
    }

    #[test]
    fn drift_and_jitter_are_taken_out() {
        let mut controller = Controller::new();
        controller.run(5_000);
        let worst = controller.run(120_000);
        assert!(worst < 20_000, "{worst} ns");
        let drift = controller.map.drift();
        assert!((drift - 50e-6).abs() < 1e-6, "{drift}");
        let (offset, uncertainty) = controller.map.offset_ns().unwrap();
        let truth = controller.truth + FLOOR - controller.hardware();
        assert!(
            (offset - truth).unsigned_abs() <= 5 * uncertainty,
            "{offset} {truth} {uncertainty}"
        );
        assert!((1_000..20_000).contains(&uncertainty), "{uncertainty}");
        assert!(controller.jumps.is_empty());
        assert!(controller.map.points.len() <= BUCKETS && controller.map.hull.len() <= BUCKETS);
    }

    #[test]
    fn the_first_second_is_no_worse_than_the_kernels_own_stamps() {
        let mut controller = Controller::new();
        let worst = controller.run(1_000);
        assert!(worst < 400_000, "{worst} ns");
    }

    #[test]
    fn a_reset_of_the_controller_is_found() {
        let mut controller = Controller::new();
        controller.run(20_000);
        controller.reset = controller.truth - 5;
        let during = controller.run(100);
        assert!(
            during < 25 * MS,
            "by the kernel's stamps meanwhile: {during} ns"
        );
        assert_eq!(controller.jumps.len(), 1);
        assert!(
            (controller.jumps[0] + 20_000 * MS).abs() < 200 * MS,
            "{:?}",
            controller.jumps
        );
        assert!(controller.run(5_000) < 200_000);
        assert!(controller.run(20_000) < 20_000);
        assert_eq!(controller.jumps.len(), 1);
    }

    #[test]
    fn a_counter_that_wraps_costs_eight_frames() {
        let mut controller = Controller::new();
        // 32 bits of microseconds would wrap each 71 minutes; 32 bits of nanoseconds each 4.3 s.
        controller.wrap = 1 << 32;
        let worst = controller.run(60_000);
        assert_eq!(controller.jumps.len(), 13);
        assert!(worst < 25 * MS, "{worst}");
        assert!((controller.map.drift() - 50e-6).abs() < 100e-6);
    }

    #[test]
    fn one_stray_stamp_is_no_jump() {
        let mut controller = Controller::new();
        controller.run(10_000);
        let stray = controller.map.map(7, controller.truth + MS);
        assert_eq!(
            (stray.time_ns, stray.jumped_ns),
            (controller.truth + MS, None)
        );
        assert!(controller.run(10_000) < 20_000);
        assert!(controller.jumps.is_empty());
    }

    #[test]
    fn silence_is_no_jump() {
        let mut controller = Controller::new();
        controller.run(20_000);
        controller.truth += 600_000 * MS;
        assert!(controller.run(1_000) < 1_000_000);
        assert!(controller.jumps.is_empty());
    }

    #[test]
    fn extreme_stamps_do_not_overflow() {
        let mut map = HardwareClock::new();
        for stamp in [i64::MIN, i64::MAX, 0, -1, i64::MAX, i64::MIN] {
            for software in [i64::MIN, 0, i64::MAX] {
                map.map(stamp, software);
            }
        }
        assert!(map.offset_ns().is_some());
    }
}
