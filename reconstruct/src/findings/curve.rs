//! The cumulative delta-V curve and its maximum, in the manner of the 49 CFR 563 data elements.

use nalgebra::Vector3;

use crate::findings::Figure;
use crate::findings::change::{Arm, Change, Moment};
use crate::findings::crash::Evidence;
use crate::findings::delta_v::{by_sheet, clipped, onset, rate_at, widen};
use crate::motion::Pulse;

/// The curve runs to 250 ms or to 30 ms after the end of the pulse, whichever is shorter; the maximum is looked
/// for within 300 ms or the same [49 CFR 563.7], s.
const CURVE_S: f64 = 0.250;
const MAXIMUM_S: f64 = 0.300;
const AFTER_END_S: f64 = 0.030;

/// Cumulative change of velocity at the end of one of the record's samples, body axes at the onset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Seconds after the onset.
    pub after_onset_s: f64,
    /// Forward, m/s.
    pub longitudinal_mps: Figure,
    /// To the right, m/s.
    pub lateral_mps: Figure,
    /// Horizontal resultant, m/s.
    pub resultant_mps: Figure,
}

/// A largest value and when it was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// The value, signed, m/s.
    pub value_mps: Figure,
    /// Seconds after the onset.
    pub after_onset_s: Figure,
}

/// Maximum delta-V within 300 ms of the onset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maximum {
    /// Forward.
    pub longitudinal: Peak,
    /// To the right.
    pub lateral: Peak,
    /// Horizontal resultant.
    pub resultant: Peak,
}

/// Points from the onset to the end of the search for the maximum; `known`: a smoother knows the velocity on both
/// sides, so that clipping opens no bound.
#[must_use]
pub(crate) fn points(evidence: &Evidence<'_>, pulse: &Pulse, known: bool) -> Vec<CurvePoint> {
    let list = &evidence.epochs.list;
    let arm = Arm::of(evidence);
    let start = onset(evidence, pulse);
    let until = pulse.onset_s + MAXIMUM_S.min(pulse.end_s - pulse.onset_s + AFTER_END_S);
    let to = list.partition_point(|e| e.t_s <= until + 1e-6);
    (pulse.before + 1..to.min(evidence.snapshots.len()))
        .filter(|&k| list[k].t_s > pulse.onset_s)
        .map(|k| {
            let end = Moment {
                nav: &evidence.snapshots[k].nav,
                rate: rate_at(evidence, k),
                step: Vector3::zeros(),
            };
            let change = Change::between(&start, &end, &arm.at);
            let after = list[k].t_s - pulse.onset_s;
            // The time counts from the onset: its doubt moves the point along the curve.
            let timing =
                (evidence.motion.accel[k] - pulse.base).map(|a| (a * pulse.onset_sd_s).powi(2));
            let p = by_sheet(evidence, pulse, k, &change, after, &timing);
            let open = !known && clipped(evidence, pulse.before, k);
            let (x, y) = (change.body.x, change.body.y);
            let size = x.hypot(y);
            let (c, s) = if size > 0.0 {
                (x / size, y / size)
            } else {
                (1.0, 0.0)
            };
            let along = c * c * p[(0, 0)] + s * s * p[(1, 1)] + 2.0 * c * s * p[(0, 1)];
            let figure = |value: f64, variance: f64| {
                let f = Figure::new(value, variance.max(0.0).sqrt(), evidence.quantile);
                if open { widen(f) } else { f }
            };
            CurvePoint {
                after_onset_s: after,
                longitudinal_mps: figure(x, p[(0, 0)]),
                lateral_mps: figure(y, p[(1, 1)]),
                resultant_mps: Figure {
                    low: figure(size, along).low.max(0.0),
                    ..figure(size, along)
                },
            }
        })
        .collect()
}

/// The part of the curve that is reported.
#[must_use]
pub fn reported(points: &[CurvePoint]) -> &[CurvePoint] {
    let to = points.partition_point(|p| p.after_onset_s <= CURVE_S + 1e-6);
    points.get(..to).unwrap_or(points)
}

/// The maxima; `None` without a point.
#[must_use]
pub(crate) fn maximum(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    points: &[CurvePoint],
) -> Option<Maximum> {
    Some(Maximum {
        longitudinal: peak(evidence, pulse, points, |p| p.longitudinal_mps)?,
        lateral: peak(evidence, pulse, points, |p| p.lateral_mps)?,
        resultant: peak(evidence, pulse, points, |p| p.resultant_mps)?,
    })
}

/// The largest size. It may as well have been reached wherever the curve stays below it by no more than the
/// doubt of the difference: noise, bias and scale between the two instants.
fn peak(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    points: &[CurvePoint],
    of: impl Fn(&CurvePoint) -> Figure,
) -> Option<Peak> {
    let imu = &evidence.epochs.header.imu;
    let size = |p: &CurvePoint| of(p).value.abs();
    let top = points.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    let noise = imu.accel_density.powi(2) + imu.accel_vibration.powi(2) * 0.01;
    let bias = imu.accel_bias.powi(2) + imu.accel_bias_jump.powi(2);
    let as_large = |p: &&CurvePoint| {
        let apart = (p.after_onset_s - top.after_onset_s).abs();
        let less = size(top) - size(p);
        let sd = (noise * apart + bias * apart * apart + (imu.accel_scale * less).powi(2)).sqrt();
        less <= evidence.quantile * sd
    };
    let half = evidence.epochs.list[pulse.before].dt + evidence.quantile * pulse.onset_sd_s;
    let near: Vec<f64> = points
        .iter()
        .filter(as_large)
        .map(|p| p.after_onset_s)
        .collect();
    let low = near.first().copied().unwrap_or(top.after_onset_s) - half;
    let high = near.last().copied().unwrap_or(top.after_onset_s) + half;
    Some(Peak {
        value_mps: of(top),
        after_onset_s: Figure {
            value: top.after_onset_s,
            sd: (high - low) / (2.0 * evidence.quantile),
            low: low.max(0.0),
            high,
        },
    })
}
