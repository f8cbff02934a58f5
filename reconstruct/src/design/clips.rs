//! Which frames of a simulated drive stand at their sensor's limit.

use schema::num::{round_usize, u64_of};
use schema::parts::Clip;

use crate::simulate::{ImuFrame, Scenario};

/// The clipping part of the record: frames at their sensor's range, by bin and axis.
pub(super) fn clips(frames: &[ImuFrame], scenario: &Scenario, from: usize) -> Vec<Clip> {
    let per_bin = u16::try_from(scenario.imu_hz / 100).unwrap_or(1);
    let ranges = [scenario.errors.accel_range, scenario.errors.rate_range];
    let mut clips: Vec<Clip> = Vec::new();
    for frame in frames.iter().filter(|frame| frame.clipped) {
        let index = u64_of(round_usize((frame.t * 100.0 - 1e-6).ceil()));
        if index < u64_of(from) {
            continue;
        }
        for axis in 0..6_u8 {
            let i = usize::from(axis % 3);
            let (value, range) = if axis < 3 {
                (frame.accel[i], ranges[0])
            } else {
                (frame.rate[i], ranges[1])
            };
            if range.is_none_or(|range| value.abs() < range) {
                continue;
            }
            let sign = if value < 0.0 { -1 } else { 1 };
            match clips
                .iter_mut()
                .rev()
                .take(12)
                .find(|clip| clip.index == index && clip.axis == axis && clip.sign == sign)
            {
                Some(clip) => clip.clipped = clip.clipped.saturating_add(1),
                None => clips.push(Clip {
                    index,
                    axis,
                    sign,
                    clipped: 1,
                    frames: per_bin,
                }),
            }
        }
    }
    clips
}
