//! The direct path: what an ideal recorder would make of the sensors' output, without a bus between.

use schema::bridge::bridges;
use schema::{Sample, num};

use super::motion::{STEPS_PER_BIN, STEPS_PER_SECOND};
use super::sensors::{ImuFrame, WheelFrame};

/// A lost frame is bridged from its neighbours while no more than two periods lie between them, and not in a pulse.
const BRIDGED: usize = 1;
/// Least share of a bin that must be known for its mean to be given.
const KNOWN: f64 = 0.5;

/// Sums of one bin and the number of steps they cover.
#[derive(Clone, Copy, Default)]
struct Bin {
    sum: [f64; 3],
    steps: f64,
}

/// Lays each frame over its period and takes the mean of each of `bins` bins.
fn means(
    frames: &[ImuFrame],
    bins: usize,
    length: usize,
    first_axis: usize,
    value: impl Fn(&ImuFrame) -> Option<[f64; 3]>,
) -> Vec<[Option<f64>; 3]> {
    let mut sums = vec![Bin::default(); bins];
    let share = num::real(length) / num::real(STEPS_PER_BIN);
    for (j, frame) in frames.iter().enumerate() {
        let known = value(frame).or_else(|| {
            let before = j
                .checked_sub(BRIDGED)
                .and_then(|i| frames.get(i))
                .and_then(&value)?;
            let after = frames.get(j + BRIDGED).and_then(&value)?;
            let calm = (0..3).all(|i| bridges(share, first_axis + i, before[i], after[i]));
            calm.then_some([0, 1, 2].map(|i| f64::midpoint(before[i], after[i])))
        });
        let Some(known) = known else { continue };
        let mut begin = frame.end - length;
        while begin < frame.end {
            let bin = begin / STEPS_PER_BIN;
            let stop = frame.end.min((bin + 1) * STEPS_PER_BIN);
            let steps = num::real(stop - begin);
            if let Some(sum) = sums.get_mut(bin) {
                for (total, part) in sum.sum.iter_mut().zip(known) {
                    *total += steps * part;
                }
                sum.steps += steps;
            }
            begin = stop;
        }
    }
    sums.iter()
        .map(|bin| {
            let enough = bin.steps >= KNOWN * num::real(STEPS_PER_BIN);
            bin.sum.map(|sum| enough.then(|| sum / bin.steps))
        })
        .collect()
}

/// One sample a bin: sample `k` covers the 10 ms up to `k * 10 ms` of the log.
pub(super) fn samples(
    imu: &[ImuFrame],
    wheels: &[WheelFrame],
    bins: usize,
    imu_hz: usize,
) -> Vec<Sample> {
    let length = STEPS_PER_SECOND / imu_hz;
    let accel = means(imu, bins, length, 0, |frame| {
        (!frame.accel_lost).then_some(frame.accel)
    });
    let rate = means(imu, bins, length, 3, |frame| {
        (!frame.rate_lost).then_some(frame.rate)
    });
    let mut samples: Vec<Sample> = accel
        .into_iter()
        .zip(rate)
        .map(|(accel, rate)| Sample {
            wheels: [None; 2],
            accel,
            rate,
        })
        .collect();
    let mut counts = vec![0.0; bins];
    for frame in wheels.iter().filter(|frame| !frame.lost) {
        let bin = num::round_usize((frame.t * 100.0).ceil());
        if let (Some(sample), Some(count)) = (samples.get_mut(bin), counts.get_mut(bin)) {
            for (field, speed) in sample.wheels.iter_mut().zip(frame.speed) {
                *field = Some((field.unwrap_or(0.0) * *count + speed) / (*count + 1.0));
            }
            *count += 1.0;
        }
    }
    samples
}
