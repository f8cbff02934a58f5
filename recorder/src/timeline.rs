//! The time line a sensor's frames were made on, from the times they were received at.
//!
//! A sensor samples at an even pace; the bus and the receiver delay its frames by some milliseconds, each
//! by another amount. The line `end(n) = phase + n * period` is fitted to the receive times by least squares
//! whose memory grows to some seconds and then fades (gains `2(2n-1)/(n(n+1))` and `6/(n(n+1))`). Frame `n`
//! stands for the period that ends at `end(n)`: the periods tile the time without overlap. A lost frame leaves a
//! hole of one period and does not stretch its neighbours.
//!
//! Whether a frame is late or its predecessor lost shows only in the frames behind it, so a frame is placed when
//! [`AHEAD`] more have come. A rolling counter, where there is one, says it at once.

use schema::num;

/// Frames that are waited for before one is placed.
pub const AHEAD: usize = 4;
/// Frames a new line is fitted to.
pub const START: usize = 16;
/// More lost frames than this end the line; the next frame begins a new one.
const MAX_LOST: i64 = 16;
/// Frames in a row that contradict the period end the line.
const CONTRADICTIONS: u32 = 12;
/// Longest period of a sensor whose frames can still be laid on a line (4 Hz), ns.
const SLOWEST_NS: f64 = 2.5e8;
/// A line this far ahead of the receive times is broken, ns beyond four periods.
const AHEAD_NS: f64 = 1e8;
/// Frames that are early by more than this part of a period were numbered too high.
const STEP_BACK: f64 = 0.75;
/// Memory of the fit, ns, and its bounds in frames.
const MEMORY_NS: f64 = 5e9;
const MEMORY_FRAMES: (f64, f64) = (50.0, 5000.0);

/// A received frame as the line needs it.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Receive time, monotonic ns.
    pub time: f64,
    /// Rolling counter.
    pub counter: Option<u32>,
}

/// Where a frame lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Start of its period, ns.
    pub start: f64,
    /// End of its period, ns.
    pub end: f64,
    /// Time before `start` that no frame stands for, ns; 0 where the frames touch.
    pub hole: f64,
    /// Frames lost before it.
    pub lost: u64,
}

/// What [`Timeline::place`] says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The frame has its place.
    Placed(Placed),
    /// The line is broken (a gap, another period): fit a new one to what is there and what comes.
    Restart,
}

/// The fit.
#[derive(Clone, Debug)]
pub struct Timeline {
    /// Counts of the rolling counter before it wraps; 0 without one.
    modulus: i64,
    period: f64,
    /// End of the last frame's period by the fit, ns.
    line: f64,
    /// End of the last placed period (never goes back), ns.
    tiled: Option<f64>,
    /// Frames in the fit so far.
    weight: f64,
    last_counter: Option<u32>,
    spread: f64,
    variance: f64,
    skipping: (i64, u32),
    early: u32,
    running: bool,
}

impl Timeline {
    /// An empty line; `counter_bits` is the size of the rolling counter, 0 without one.
    #[must_use]
    pub fn new(counter_bits: u32) -> Self {
        Self {
            modulus: if counter_bits == 0 {
                0
            } else {
                1_i64 << counter_bits.min(31)
            },
            period: 0.0,
            line: 0.0,
            tiled: None,
            weight: 0.0,
            last_counter: None,
            spread: 0.0,
            variance: 0.0,
            skipping: (0, 0),
            early: 0,
            running: false,
        }
    }

    /// True once a line is fitted.
    #[must_use]
    pub fn running(&self) -> bool {
        self.running
    }

    /// The period, ns; 0 before the first fit.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Standard deviation of the receive times about the line, ns.
    #[must_use]
    pub fn jitter(&self) -> f64 {
        self.variance.sqrt()
    }

    /// End of the last placed period, ns.
    #[must_use]
    pub fn tiled(&self) -> Option<f64> {
        self.tiled
    }

    /// Ends the line. Time up to `until` is closed: nothing will be placed before it.
    pub fn stop(&mut self, until: Option<f64>) {
        self.running = false;
        self.last_counter = None;
        self.skipping = (0, 0);
        self.early = 0;
        if until.is_some() {
            self.tiled = until;
        }
    }

    /// Fits a new line to the waiting frames (two or more, or one if a period is known). False if it can not.
    pub fn start(&mut self, waiting: &[Arrival]) -> bool {
        let [first, rest @ ..] = waiting else {
            return false;
        };
        let count = waiting.len();
        if count >= 3 || (self.period == 0.0 && count == 2) {
            let span = rest.last().map_or(0.0, |last| last.time - first.time);
            if span <= 0.0 {
                return false;
            }
            let numbers = self.number(waiting);
            let (at, period) = fit(waiting, &numbers);
            if !(1.0..=SLOWEST_NS).contains(&period) {
                return false;
            }
            self.period = period;
            self.line = at;
        } else if self.period > 0.0 {
            self.line = first.time;
        } else {
            return false;
        }
        // The line now stands where the first frame's period ends; step back so that placing it leads there.
        self.line -= self.period;
        self.weight = num::real(count.min(START));
        self.spread = self.spread.clamp(0.05 * self.period, self.period);
        self.running = true;
        true
    }

    /// Numbers of the waiting frames on the new line, from 0.
    fn number(&self, waiting: &[Arrival]) -> Vec<f64> {
        let mut gaps: Vec<f64> = waiting.windows(2).map(|pair| step(pair).0).collect();
        let counted: Option<Vec<i64>> = waiting
            .windows(2)
            .map(|pair| {
                step(pair)
                    .1
                    .map(|count| count.rem_euclid(self.modulus.max(1)))
                    .filter(|count| *count != 0)
            })
            .collect();
        if self.modulus > 0
            && let Some(steps) = counted
            && steps.iter().sum::<i64>() <= 2 * i64::try_from(steps.len()).unwrap_or(0)
        {
            return cumulate(&steps);
        }
        let plain: Vec<i64> = vec![1; gaps.len()];
        let total: f64 = gaps.iter().sum();
        gaps.sort_by(f64::total_cmp);
        let median = gaps.get(gaps.len() / 2).copied().unwrap_or(0.0);
        // Frames in bursts have a median far below the mean and no losses to be seen.
        if median < 0.5 * total / num::real(gaps.len().max(1))
            && gaps.last().copied().unwrap_or(0.0) < 0.5 * total
        {
            return cumulate(&plain);
        }
        let jumps: Vec<i64> = waiting
            .windows(2)
            .map(|pair| step(pair).0)
            .map(|gap| {
                if gap > 1.8 * median {
                    num::round_i64(gap / median.max(1.0)).clamp(1, 1 << 40)
                } else {
                    1
                }
            })
            .collect();
        let (plain, jumps) = (cumulate(&plain), cumulate(&jumps));
        if misfit(waiting, &plain) <= misfit(waiting, &jumps) {
            plain
        } else {
            jumps
        }
    }

    /// Places the first of the waiting frames.
    pub fn place(&mut self, waiting: &[Arrival]) -> Verdict {
        let Some(head) = waiting.first() else {
            return Verdict::Restart;
        };
        let late = (head.time - self.line) / self.period - 1.0;
        let mut lateness = [0.0; AHEAD + 1];
        let mut count = 0;
        let mut due = 1.0;
        for (slot, arrival) in lateness.iter_mut().zip(waiting) {
            *slot = (arrival.time - self.line) / self.period - due;
            due += 1.0;
            count += 1;
        }
        let median = lateness.get_mut(..count).map_or(0.0, |known| {
            known.sort_by(f64::total_cmp);
            known.get(count / 2).copied().unwrap_or(0.0)
        });
        let lost = self.lost(head, late, median);
        let runaway = self.line - head.time > 4.0 * self.period + AHEAD_NS;
        if lost > MAX_LOST || runaway || self.contradicted(lost, median) {
            return Verdict::Restart;
        }
        self.last_counter = head.counter;
        // An earlier frame was taken for lost but was late: step back.
        if lost == 0 && median < -STEP_BACK {
            self.line += self.period * median.round();
        }
        let steps = num::real_i64(lost + 1);
        let due = self.line + steps * self.period;
        let bound = (3.0 * self.spread).max(0.02 * self.period);
        let residual = head.time - due;
        let bounded = residual.clamp(-bound, bound);
        self.weight = (self.weight + 1.0)
            .min((MEMORY_NS / self.period).clamp(MEMORY_FRAMES.0, MEMORY_FRAMES.1));
        let n = self.weight;
        let (phase_gain, period_gain) = (
            2.0 * (2.0 * n - 1.0) / (n * (n + 1.0)),
            6.0 / (n * (n + 1.0)),
        );
        self.line = due + phase_gain * bounded;
        self.period = (self.period + period_gain * bounded / steps).max(1.0);
        self.spread += (residual.abs().min(self.period) - self.spread) / n.min(100.0);
        self.variance += (residual.powi(2).min(self.period.powi(2)) - self.variance) / n;
        Verdict::Placed(self.tile(lost))
    }

    /// Frames lost before the head, by its counter or by its time and that of the frames behind it.
    fn lost(&self, head: &Arrival, late: f64, median: f64) -> i64 {
        let by_time = num::round_i64(late).min(num::round_i64(median)).max(0);
        let (Some(last), Some(now)) = (self.last_counter, head.counter) else {
            return by_time;
        };
        if self.modulus < 2 {
            return by_time;
        }
        let counted = (i64::from(now) - i64::from(last) - 1).rem_euclid(self.modulus);
        // The counter knows the number but for whole turns; time says which turn. Where they disagree by more
        // than jitter can explain, the counter was reset (or stands still) and time decides.
        let turns =
            num::round_i64((late - num::real_i64(counted)) / num::real_i64(self.modulus)).max(0);
        let counted = counted + turns * self.modulus;
        let allowed =
            (1.5 + 3.0 * self.spread / self.period).min(0.45 * num::real_i64(self.modulus));
        if (num::real_i64(counted) - late).abs() <= allowed {
            counted
        } else {
            by_time
        }
    }

    /// True if frame after frame says that the period is another.
    fn contradicted(&mut self, lost: i64, median: f64) -> bool {
        if lost > 0 && lost == self.skipping.0 {
            self.skipping.1 += 1;
        } else {
            self.skipping = (lost, u32::from(lost > 0));
        }
        // One step back mends a false loss; step after step means that frames come faster than thought.
        self.early = if lost == 0 && median.abs() > STEP_BACK {
            self.early + 4
        } else {
            self.early.saturating_sub(1)
        };
        let counted = self.modulus > 1 && self.skipping.0 > 0;
        (self.skipping.1 >= CONTRADICTIONS && !counted) || self.early >= 2 * CONTRADICTIONS
    }

    /// The head's period on the tiling: touching its predecessor's unless frames were lost between.
    fn tile(&mut self, lost: i64) -> Placed {
        let Some(tiled) = self.tiled else {
            self.tiled = Some(self.line);
            return Placed {
                start: self.line - self.period,
                end: self.line,
                hole: 0.0,
                lost: 0,
            };
        };
        // Where the line was stepped back, later periods are shortened until it has caught up.
        let end = self.line.max(tiled + 0.5 * self.period);
        let own = end - self.period;
        // A new line begins anywhere behind the last: that is a hole; half a period of it may be drift.
        let hole = own - tiled;
        self.tiled = Some(end);
        if (lost > 0 && hole > 0.0) || hole > 0.75 * self.period {
            Placed {
                start: own,
                end,
                hole,
                lost: lost.unsigned_abs(),
            }
        } else {
            Placed {
                start: tiled,
                end,
                hole: 0.0,
                lost: lost.unsigned_abs(),
            }
        }
    }
}

/// Time and counter from one frame to the next.
fn step(pair: &[Arrival]) -> (f64, Option<i64>) {
    match pair {
        [before, after] => (
            after.time - before.time,
            before
                .counter
                .zip(after.counter)
                .map(|(before, after)| i64::from(after) - i64::from(before)),
        ),
        _ => (0.0, None),
    }
}

fn cumulate(steps: &[i64]) -> Vec<f64> {
    let mut at = 0;
    std::iter::once(0.0)
        .chain(steps.iter().map(|step| {
            at += step;
            num::real_i64(at)
        }))
        .collect()
}

/// Least squares of time on number: the time of number 0 and the period.
fn fit(waiting: &[Arrival], numbers: &[f64]) -> (f64, f64) {
    let count = num::real(waiting.len().max(1));
    let mean_time = waiting.iter().map(|arrival| arrival.time).sum::<f64>() / count;
    let mean_number = numbers.iter().sum::<f64>() / count;
    let (mut across, mut along) = (0.0, 0.0);
    for (arrival, number) in waiting.iter().zip(numbers) {
        across += (number - mean_number) * (arrival.time - mean_time);
        along += (number - mean_number).powi(2);
    }
    let period = if along > 0.0 { across / along } else { 0.0 };
    (mean_time - period * mean_number, period)
}

/// Sum of squares about the fit, in squared periods.
fn misfit(waiting: &[Arrival], numbers: &[f64]) -> f64 {
    let (at, period) = fit(waiting, numbers);
    let squares = waiting
        .iter()
        .zip(numbers)
        .map(|(arrival, number)| (arrival.time - at - period * number).powi(2));
    squares.sum::<f64>() / period.powi(2).max(1.0)
}
