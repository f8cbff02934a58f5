//! One message of the IMU: its waiting frames, their time line, and the stretch of time each stands for.

use std::collections::VecDeque;

use schema::bridge::bridges;
use schema::num;

use crate::bins::{AXES, BIN};
use crate::timeline::{AHEAD, Arrival, START, Timeline, Verdict};

/// A frame is placed at the latest so long after it came.
const WAIT_NS: i64 = 150_000_000;
/// A line is begun with fewer frames if no more came in this time.
const START_WAIT_NS: i64 = 350_000_000;

/// A frame with its stretch of time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedFrame {
    pub(crate) start: f64,
    pub(crate) end: f64,
    pub(crate) values: [f64; AXES],
    /// One lost frame before it, bridged: from when, with which values.
    pub(crate) bridge: Option<(f64, [f64; AXES])>,
    /// Lost frames before it that may hide a part of a pulse: from when. Their bins are missing.
    pub(crate) torn: Option<f64>,
    pub(crate) lost: u64,
}

/// What a rolling counter showed beside steps of one and plain losses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CounterHealth {
    /// Frames with the counter of the frame before.
    pub stale: u64,
    /// Frames whose counter went on by another number than their time says: a reset, or another sender.
    pub jumps: u64,
}

/// A counter and the time between frames disagree by more than so many frames (and three deviations of the jitter).
const DISAGREE: f64 = 2.0;

/// What becomes of the next waiting frame.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Next {
    /// It has its stretch of time.
    Placed(PlacedFrame),
    /// It can not be given a period at all, and is given up.
    Unplaced,
    /// It has to wait, or there is none.
    Wait,
}

/// The stream.
#[derive(Clone, Debug)]
pub struct ImuStream {
    timeline: Timeline,
    arrivals: Vec<Arrival>,
    values: VecDeque<[f64; AXES]>,
    previous: [f64; AXES],
    limits: [f64; AXES],
    carries: [bool; AXES],
    counted: bool,
    last_ns: Option<i64>,
    lost: u64,
    modulus: i64,
    last_count: Option<(i64, u32)>,
    counter: CounterHealth,
}

impl ImuStream {
    /// A stream with the limits of its axes (infinite: unknown) and those it carries.
    #[must_use]
    pub(crate) fn new(counter_bits: u32, limits: [f64; AXES], carries: [bool; AXES]) -> Self {
        Self {
            timeline: Timeline::new(counter_bits),
            arrivals: Vec::with_capacity(2 * START),
            values: VecDeque::with_capacity(2 * START),
            previous: [f64::NAN; AXES],
            limits,
            carries,
            counted: counter_bits > 0,
            last_ns: None,
            lost: 0,
            modulus: 1_i64 << counter_bits.min(31),
            last_count: None,
            counter: CounterHealth::default(),
        }
    }

    /// Its time line.
    #[must_use]
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// True if it has a rolling counter.
    #[must_use]
    pub fn counted(&self) -> bool {
        self.counted
    }

    /// The axes it carries.
    pub(crate) fn carries(&self) -> [bool; AXES] {
        self.carries
    }

    /// Frames lost so far.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// What its rolling counter showed.
    #[must_use]
    pub fn counter(&self) -> CounterHealth {
        self.counter
    }

    /// Compares the counter's step with the time since the last frame.
    fn count(&mut self, time_ns: i64, counter: u32) {
        let Some((last_ns, last)) = self.last_count.replace((time_ns, counter)) else {
            return;
        };
        let period = self.timeline.period();
        if !self.timeline.running() || period <= 0.0 {
            return;
        }
        let step = (i64::from(counter) - i64::from(last)).rem_euclid(self.modulus);
        let passed = num::real_i64(time_ns.saturating_sub(last_ns)) / period;
        let (modulus, allowed) = (
            num::real_i64(self.modulus),
            DISAGREE + 3.0 * self.timeline.jitter() / period,
        );
        let turned = (num::real_i64(step) - passed).rem_euclid(modulus);
        if step == 0 {
            // As many lost frames as the counter has steps give the same number again.
            self.counter.stale += u64::from(passed < 0.5 * modulus);
        } else if step != 1 && turned.min(modulus - turned) > allowed {
            self.counter.jumps += 1;
        }
    }

    /// True if it carries the x axis of a group (0 accelerometer, 1 gyro) and so counts for it.
    #[must_use]
    pub fn leads(&self, group: usize) -> bool {
        self.carries.get(group * 3).copied().unwrap_or(false)
    }

    pub(crate) fn leads_any_accel(&self) -> bool {
        self.carries.iter().take(3).any(|carried| *carried)
    }

    pub(crate) fn limit(&self, axis: usize) -> f64 {
        self.limits.get(axis).copied().unwrap_or(f64::INFINITY)
    }

    /// End of the last placed frame's period.
    pub(crate) fn tiled_ns(&self) -> Option<i64> {
        self.timeline.tiled().map(num::floor_i64)
    }

    /// Up to when this stream's part of the bins is there; `None` if it has been silent since `dead_ns`.
    pub(crate) fn behind(&self, dead_ns: i64) -> Option<i64> {
        let alive = !self.arrivals.is_empty() || self.last_ns.is_some_and(|last| last > dead_ns);
        alive.then(|| {
            if self.timeline.running() {
                self.tiled_ns().unwrap_or(0)
            } else {
                0
            }
        })
    }

    /// Adds a frame.
    pub(crate) fn push(&mut self, time_ns: i64, counter: Option<u32>, values: [f64; AXES]) {
        self.last_ns = Some(time_ns);
        if let Some(counter) = counter {
            self.count(time_ns, counter);
        }
        self.arrivals.push(Arrival {
            time: num::real_i64(time_ns),
            counter,
        });
        self.values.push_back(values);
    }

    /// Ends the line; see [`Timeline::stop`].
    pub(crate) fn restart(&mut self, until_ns: Option<i64>) {
        self.timeline.stop(until_ns.map(num::real_i64));
        self.previous = [f64::NAN; AXES];
        self.last_ns = None;
        self.last_count = None;
    }

    /// True if frames wait that time alone lets go.
    pub(crate) fn is_overdue(&self, now_ns: i64) -> bool {
        let wait = if self.timeline.running() {
            WAIT_NS
        } else {
            START_WAIT_NS
        };
        self.arrivals
            .first()
            .is_some_and(|head| num::real_i64(now_ns - wait) > head.time)
    }

    /// Places the next frame if it can be.
    pub(crate) fn next(&mut self, now_ns: i64, force: bool) -> Next {
        let overdue = force || self.is_overdue(now_ns);
        let mut fresh = false;
        if !self.timeline.running() {
            if self.arrivals.is_empty() || (self.arrivals.len() < START && !overdue) {
                return Next::Wait;
            }
            let count = self.arrivals.len().min(2 * START);
            if !self
                .timeline
                .start(self.arrivals.get(..count).unwrap_or_default())
            {
                self.pop();
                return Next::Unplaced;
            }
            fresh = true;
        } else if self.arrivals.is_empty() || (self.arrivals.len() <= AHEAD && !overdue) {
            return Next::Wait;
        }
        match self.timeline.place(&self.arrivals) {
            Verdict::Placed(placed) => {
                let values = self.pop();
                // Holes up to one period (and the drift of a quarter) are one lost frame.
                let one = placed.hole > 0.0 && placed.hole <= 1.25 * self.timeline.period();
                let calm = self
                    .previous
                    .iter()
                    .zip(values)
                    .enumerate()
                    .all(|(axis, (a, b))| bridges(placed.hole / BIN, axis, *a, b));
                let from = placed.start - placed.hole;
                let torn = (placed.hole > 0.0 && !calm).then_some(from);
                let bridge = (one && calm).then(|| {
                    let mut mean = self.previous;
                    for (mean, value) in mean.iter_mut().zip(values) {
                        *mean = f64::midpoint(*mean, value);
                    }
                    (from, mean)
                });
                self.previous = values;
                self.lost += placed.lost;
                let (start, end, lost) = (placed.start, placed.end, placed.lost);
                Next::Placed(PlacedFrame {
                    start,
                    end,
                    values,
                    bridge,
                    torn,
                    lost,
                })
            }
            Verdict::Restart => {
                self.timeline.stop(None);
                if fresh {
                    self.pop();
                    return Next::Unplaced;
                }
                self.next(now_ns, force)
            }
        }
    }

    fn pop(&mut self) -> [f64; AXES] {
        if !self.arrivals.is_empty() {
            self.arrivals.remove(0);
        }
        self.values.pop_front().unwrap_or([f64::NAN; AXES])
    }
}
