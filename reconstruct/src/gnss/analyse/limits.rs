//! Where a sensor came to the end of its range: gyro outputs that wrap, as those of S00 did at about 0.6 rad/s
//! [S00, 5.2], and values held at the limit.
//!
//! **Wrap.** Two neighbours of opposite sign, both within 30 % of the same size `L`, that no car connects: the step is more than ten times the
//! usual one, and taking it modulo `2 L` makes it and its neighbours small. `L` is half the median step; no value of the axis
//! may exceed it by more than a tenth, for a two's complement output cannot. A wrap into and one out of an excursion belong
//! together; the unwrapped value is unambiguous if both are seen in one stretch without a gap.
//!
//! **Saturation.** Three equal values or more in a row, two and more pairs, or a heap of values twice
//! that at either step next inside, at the largest or the smallest value of the axis, where
//! the steps of the output are small against its noise and the value stands far outside the bulk. An axis that never changes is said to be dead.

use schema::num::real;

use super::spans::{Sample, Spans, Stretch};
use crate::gnss::notes::median;
use crate::gnss::rows::Leg;

/// Names of the axes, in the order of [`Sample::axis`].
pub const AXES: [&str; 6] = [
    "accelerometer x",
    "accelerometer y",
    "accelerometer z",
    "gyro x",
    "gyro y",
    "gyro z",
];
/// Steps that no car makes, in usual ones, and the least, rad/s.
const STEPS: f64 = 10.0;
const LEAST_STEP: f64 = 0.2;
/// Two sizes that may be one limit.
const ALIKE: f64 = 0.7;
/// By how much a value may lie beyond the limit inferred.
const BEYOND: f64 = 1.1;
/// Longest excursion that a wrap explains, s.
const LONGEST_S: f64 = 20.0;
/// So many values at the limit, and so many times what lies at a step next to it, are a heap.
const PILE: [usize; 2] = [5, 2];
/// Samples at each side that must be smooth.
const SIDE: usize = 3;

/// How sure a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Confidence {
    /// A single one: something else can do it.
    Low,
    /// Several that do not agree closely.
    Medium,
    /// Several that agree.
    High,
}

impl Confidence {
    /// A word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }
}

/// What happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// The output wrapped; with the extreme of the excursion, unwrapped, rad/s, where it is unambiguous.
    Wrap {
        /// Unwrapped extreme, rad/s.
        unwrapped: Option<f64>,
        /// Why there is none.
        why: &'static str,
    },
    /// The output was held at its limit.
    Saturated,
    /// The axis shows one value throughout.
    Dead,
}

/// An event at the end of a sensor's range.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Kind.
    pub kind: Kind,
    /// Leg.
    pub leg: Leg,
    /// Axis, an index of [`AXES`].
    pub axis: usize,
    /// Line of the first sample concerned, from 1.
    pub line: u64,
    /// Begin and end, s of the box's clock.
    pub span_s: [f64; 2],
    /// Samples concerned.
    pub samples: usize,
    /// Values before and at the begin, SI.
    pub values: [f64; 2],
    /// The limit inferred, SI.
    pub limit: f64,
    /// Standard error of it, where several wraps tell it.
    pub limit_se: Option<f64>,
    /// How sure.
    pub confidence: Confidence,
}

/// A step from sample `at - 1` to `at` that may be a wrap.
#[derive(Clone, Copy)]
struct Jump {
    stretch: usize,
    at: usize,
    step: f64,
}

/// All events, by axis and time.
#[must_use]
pub fn events(spans: &Spans) -> Vec<Event> {
    let mut found = Vec::new();
    for axis in 0..AXES.len() {
        let values: Vec<f64> = spans
            .stretches
            .iter()
            .flat_map(|s| s.samples.iter().map(|s| s.axis[axis]))
            .collect();
        if values.len() < 20 {
            continue;
        }
        let steps = steps(spans, axis);
        let usual = 1.4826 * median(steps).unwrap_or(0.0);
        if axis >= 3 {
            found.extend(wraps(spans, axis, &values, usual));
        }
        found.extend(saturated(spans, axis, &values, usual));
    }
    found
}

/// Sizes of the steps between neighbours.
fn steps(spans: &Spans, axis: usize) -> Vec<f64> {
    let pairs = spans.stretches.iter().flat_map(|s| s.samples.windows(2));
    pairs
        .filter(|w| !w[1].gap)
        .map(|w| (w[1].axis[axis] - w[0].axis[axis]).abs())
        .collect()
}

fn wraps(spans: &Spans, axis: usize, values: &[f64], usual: f64) -> Vec<Event> {
    let most = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let mut jumps = Vec::new();
    for (index, stretch) in spans.stretches.iter().enumerate() {
        for (k, pair) in stretch.samples.windows(2).enumerate() {
            let [a, b] = [pair[0].axis[axis], pair[1].axis[axis]];
            let step = b - a;
            let alike = a.abs().min(b.abs()) >= ALIKE * a.abs().max(b.abs());
            if !pair[1].gap
                && a * b < 0.0
                && alike
                && step.abs() > LEAST_STEP.max(STEPS * usual)
                && step.abs() * 0.5 * BEYOND >= most
                && smooth(stretch, axis, k + 1, step.abs())
            {
                jumps.push(Jump {
                    stretch: index,
                    at: k + 1,
                    step,
                });
            }
        }
    }
    let Some(half) = median(jumps.iter().map(|j| 0.5 * j.step.abs()).collect()) else {
        return Vec::new();
    };
    let limit = half.max(most);
    let spread: Vec<f64> = jumps
        .iter()
        .map(|j| (0.5 * j.step.abs() - half).abs())
        .collect();
    let width = 1.4826 * median(spread).unwrap_or(0.0);
    let several = jumps.len() >= 2;
    let sure = if several && width < 0.05 * limit {
        Confidence::High
    } else if several {
        Confidence::Medium
    } else {
        Confidence::Low
    };
    let se = several.then(|| 1.2533 * width / real(jumps.len()).sqrt());
    excursions(spans, axis, &jumps, (limit, se), sure)
}

/// True if the steps about sample `at` are small once each is taken modulo the full range.
fn smooth(stretch: &Stretch, axis: usize, at: usize, range: f64) -> bool {
    let from = at.saturating_sub(SIDE);
    let to = (at + SIDE).min(stretch.samples.len().saturating_sub(1));
    let window = stretch.samples.get(from..=to).unwrap_or_default();
    window.windows(2).all(|w| {
        let step = w[1].axis[axis] - w[0].axis[axis];
        let folded = step - range * (step / range).round();
        folded.abs() < 0.25 * range
    })
}

/// Wraps in and out, put together.
fn excursions(
    spans: &Spans,
    axis: usize,
    jumps: &[Jump],
    (limit, limit_se): (f64, Option<f64>),
    confidence: Confidence,
) -> Vec<Event> {
    let mut out = Vec::new();
    let mut k = 0;
    while let Some(enter) = jumps.get(k) {
        let Some(stretch) = spans.stretches.get(enter.stretch) else {
            break;
        };
        let leave = jumps
            .get(k + 1)
            .filter(|j| j.stretch == enter.stretch && j.step * enter.step < 0.0);
        k += if leave.is_some() { 2 } else { 1 };
        let end = leave.map_or(enter.at + 1, |j| j.at);
        let within = stretch.samples.get(enter.at..end).unwrap_or_default();
        let (Some(first), Some(last)) = (within.first(), within.last()) else {
            continue;
        };
        // A step down by the range is a rise beyond the limit, and the other way round.
        let add = -2.0 * limit * enter.step.signum();
        let gap = within.iter().skip(1).any(|s| s.gap);
        let extreme = within
            .iter()
            .map(|s| s.axis[axis] + add)
            .max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let (unwrapped, why) = if leave.is_none() {
            (None, "the way back is not seen")
        } else if gap {
            (None, "samples are missing within")
        } else if last.t_s - first.t_s > LONGEST_S {
            (None, "too long for one turn")
        } else {
            (extreme, "")
        };
        let before = stretch
            .samples
            .get(enter.at - 1)
            .map_or(f64::NAN, |s| s.axis[axis]);
        out.push(Event {
            kind: Kind::Wrap { unwrapped, why },
            leg: stretch.leg,
            axis,
            line: first.line,
            span_s: [first.t_s, last.t_s],
            samples: within.len(),
            values: [before, first.axis[axis]],
            limit,
            limit_se,
            confidence,
        });
    }
    out
}

fn saturated(spans: &Spans, axis: usize, values: &[f64], usual: f64) -> Vec<Event> {
    let mut order = values.to_vec();
    order.sort_by(f64::total_cmp);
    let (Some(&least), Some(&most)) = (order.first(), order.last()) else {
        return Vec::new();
    };
    let middle = order[order.len() / 2];
    if most <= least {
        let first = spans.stretches.iter().find(|s| !s.samples.is_empty());
        return first
            .and_then(|s| event(s, axis, 0..s.samples.len(), most))
            .map(|e| Event {
                kind: Kind::Dead,
                confidence: Confidence::High,
                samples: values.len(),
                ..e
            })
            .into_iter()
            .collect();
    }
    // The step of the output: the smallest difference between values that differ by more than rounding of the text.
    let quantum = order
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 1e-9 * (most - least))
        .fold(f64::INFINITY, f64::min);
    let bulk = {
        let off: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
        1.4826 * median(off).unwrap_or(0.0)
    };
    let mut found = Vec::new();
    for limit in [most, least] {
        let far = (limit - middle).abs();
        if far < 2.0 * bulk || far < 10.0 * quantum || usual < 3.0 * quantum {
            continue;
        }
        let runs = runs_at(spans, axis, limit, 0.25 * quantum);
        let long = runs.iter().filter(|r| r.1.len() >= 3).count();
        let pairs = runs.iter().filter(|r| r.1.len() >= 2).count();
        let held: usize = runs.iter().map(|r| r.1.len()).sum();
        let piled = held >= PILE[0] && held > PILE[1] * crowd(&order, limit, quantum);
        if long == 0 && pairs < 2 && !piled {
            continue;
        }
        let least = if piled { 1 } else { 2 };
        let confidence = match (held, long) {
            (6.., 1..) | (20.., _) => Confidence::High,
            (4.., _) => Confidence::Medium,
            _ => Confidence::Low,
        };
        for (stretch, run) in runs.into_iter().filter(|r| r.1.len() >= least) {
            let Some(stretch) = spans.stretches.get(stretch) else {
                continue;
            };
            found.extend(event(stretch, axis, run, limit).map(|e| Event { confidence, ..e }));
        }
    }
    found
}

/// Most values at either of the two steps of the output next inside `limit`, at least one; `order` is sorted.
fn crowd(order: &[f64], limit: f64, quantum: f64) -> usize {
    let inward = if order.last().is_some_and(|m| *m <= limit) {
        -quantum
    } else {
        quantum
    };
    let at = |k: u8| {
        let centre = limit + inward * f64::from(k);
        let end = |x: f64| order.partition_point(|v| *v < x);
        end(centre + 0.5 * quantum) - end(centre - 0.5 * quantum)
    };
    (1..=2).map(at).max().unwrap_or(0).max(1)
}

/// Runs of samples at `limit`.
fn runs_at(
    spans: &Spans,
    axis: usize,
    limit: f64,
    tolerance: f64,
) -> Vec<(usize, std::ops::Range<usize>)> {
    let mut runs = Vec::new();
    for (index, stretch) in spans.stretches.iter().enumerate() {
        let at = |s: &Sample| (s.axis[axis] - limit).abs() <= tolerance;
        let mut k = 0;
        while k < stretch.samples.len() {
            let mut end = k;
            while end < stretch.samples.len()
                && at(&stretch.samples[end])
                && (end == k || !stretch.samples[end].gap)
            {
                end += 1;
            }
            if end > k {
                runs.push((index, k..end));
            }
            k = end.max(k + 1);
        }
    }
    runs
}

fn event(stretch: &Stretch, axis: usize, run: std::ops::Range<usize>, limit: f64) -> Option<Event> {
    let samples = stretch.samples.get(run.clone())?;
    let (first, last) = (samples.first()?, samples.last()?);
    let before = run
        .start
        .checked_sub(1)
        .and_then(|i| stretch.samples.get(i));
    Some(Event {
        kind: Kind::Saturated,
        leg: stretch.leg,
        axis,
        line: first.line,
        span_s: [first.t_s, last.t_s],
        samples: samples.len(),
        values: [before.map_or(f64::NAN, |s| s.axis[axis]), first.axis[axis]],
        limit,
        limit_se: None,
        confidence: Confidence::Low,
    })
}
