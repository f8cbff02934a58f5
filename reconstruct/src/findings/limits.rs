//! What a result cannot tell: sentences, the weightiest first.

use crate::epochs::Epochs;
use crate::findings::{Reconstruction, agreement};
use crate::motion::Motion;
use crate::run::{Facts, seconds};

/// Frames slower than this leave the band-width error of delta-V open, ns (1 kHz and a twentieth).
const FAST_FRAME_NS: u64 = 1_050_000;
/// Frames about as slow as the samples may be point samples, ns.
const SLOW_FRAME_NS: u64 = 8_000_000;
/// Two or three wheel frames lost in a row, which happens on any bus, are no gap, s.
const SHORT_GAP_S: f64 = 0.1;
/// A rest shorter than this levels badly, s.
const SHORT_REST_S: f64 = 1.5;

/// The sentences of one result.
#[must_use]
pub fn sentences(
    result: &Reconstruction,
    epochs: &Epochs,
    motion: &Motion,
    facts: &Facts<'_>,
) -> Vec<String> {
    let mut out = Vec::new();
    start(result, epochs, &mut out);
    pulse(result, epochs, motion, &mut out);
    sensors(result, epochs, &mut out);
    for reason in &facts.completion.reasons {
        out.push(format!("The record is incomplete: {reason}."));
    }
    frame_of_reference(result, epochs, &mut out);
    out.extend(agreement::sentences(&result.comparisons, result.model));
    out
}

fn start(result: &Reconstruction, epochs: &Epochs, out: &mut Vec<String>) {
    if result.rest.found {
        if result.rest.duration_s < SHORT_REST_S {
            out.push(format!(
                "The rest at the end lasts only {:.1} s; tilt and gyro bias are known from that alone.",
                result.rest.duration_s
            ));
        }
        if let Some(state) = result.states.last()
            && state.roll.cos() * state.pitch.cos() < 0.5
        {
            out.push(format!(
                "The car did not come to rest on its wheels (roll {:.0} degrees).",
                state.roll.to_degrees()
            ));
        }
        return;
    }
    let wheels = epochs
        .list
        .iter()
        .flat_map(|e| e.wheels)
        .flatten()
        .next()
        .is_some();
    out.push(if wheels {
        format!(
            "No rest was found ({}): the path is computed back from the last wheel speeds, not from standstill, \
             and its bounds are wide.",
            result.rest.reason
        )
    } else {
        format!(
            "No rest was found ({}) and no wheel speed is recorded: speed and path cannot be told; only \
             changes of speed can.",
            result.rest.reason
        )
    });
}

fn pulse(result: &Reconstruction, epochs: &Epochs, motion: &Motion, out: &mut Vec<String>) {
    let Some(impact) = result.impacts.first() else {
        return;
    };
    if result.impacts.iter().any(|i| i.delta_v.lower_bound) {
        let range = epochs.header.imu.accel_range.map_or(String::new(), |r| {
            format!(" (range {:.0} g)", r / schema::units::STANDARD_GRAVITY)
        });
        out.push(format!(
            "An accelerometer stood at its limit during the pulse{range}: delta-V is a lower bound, and the \
             speed at impact may have been higher."
        ));
    } else if epochs.header.imu.accel_range.is_none() {
        out.push(
            "The accelerometer's range is not configured: clipping cannot be told, so delta-V may be too small."
                .to_owned(),
        );
    }
    let period = epochs.header.periods.accel_ns;
    if period > SLOW_FRAME_NS {
        out.push(
            "The accelerometer frames are no faster than the samples: if they are point samples and not means, \
             delta-V may be off by as much as half, and no bound here covers it."
                .to_owned(),
        );
    } else if period > FAST_FRAME_NS {
        out.push(
            "The accelerometer frames are slower than 1 kHz: the band-width error of delta-V cannot be bounded."
                .to_owned(),
        );
    }
    out.push(
        "Samples are 10 ms means: no channel frequency class (SAE J211) is claimed, and peak accelerations are \
         not given."
            .to_owned(),
    );
    if impact.delta_v.point == "imu" {
        out.push(
            "Delta-V is that of the IMU's place: the centre of gravity is not configured, and in a spin the two \
             differ."
                .to_owned(),
        );
    }
    if let Some(pulse) = motion.impacts.first() {
        let mut k = pulse.before;
        while k > 0 && motion.wheels_bad[k] {
            k -= 1;
        }
        let lead = pulse.onset_s - epochs.list[k].t_s;
        if lead > 1.0 {
            out.push(format!(
                "The wheels are not believed in the {lead:.1} s before the impact (braking slip): the speed there \
                 rests on the accelerometers."
            ));
        }
    }
    if result.impacts.len() > 1 {
        out.push(format!(
            "There are {} impacts: the figures named first are those of the first one; each has its own further down.",
            result.impacts.len()
        ));
    }
}

fn sensors(result: &Reconstruction, epochs: &Epochs, out: &mut Vec<String>) {
    if result.missing_samples > 0 {
        out.push(format!(
            "{} ({:.2} s) without a whole IMU value: bridged by straight lines, and the bounds are wider.",
            samples(result.missing_samples),
            seconds(result.missing_samples)
        ));
    }
    if result.clipped_samples > 0 {
        out.push(format!(
            "{} with frames at a sensor's limit.",
            samples(result.clipped_samples)
        ));
    }
    let (count, longest_s) = wheel_gaps(epochs);
    if count > 0 {
        out.push(format!(
            "The wheel speeds have {}, the longest of {longest_s:.2} s: there the path rests on the inertial \
             sensors alone.",
            if count == 1 {
                "a gap".to_owned()
            } else {
                format!("{count} gaps")
            }
        ));
    }
    let heard = epochs
        .list
        .iter()
        .flat_map(|e| e.wheels)
        .flatten()
        .next()
        .is_some();
    if !heard && result.rest.found {
        out.push(
            "No wheel speed is recorded: speed and path rest on the inertial sensors alone and drift away \
             from the rest."
                .to_owned(),
        );
    } else if heard
        && matches!(result.model, "nine-state" | "refined")
        && result.wheels.used == 0
        && result.distance_m.value > 5.0
    {
        out.push("No wheel speed could be used.".to_owned());
    }
    if epochs.header.vehicle.imu_position_m.is_none() {
        out.push(
            "The IMU's place in the car is not configured: in turns the wheels' speed is referred to it with a \
             wide doubt."
                .to_owned(),
        );
    }
}

/// Stretches without any wheel speed, longer than three of the wheels' periods and a tenth of a second, and the longest, s; none where no
/// wheel was heard at all.
#[must_use]
pub fn wheel_gaps(epochs: &Epochs) -> (usize, f64) {
    let period = epochs.header.periods.wheels_ns.into_iter().max();
    let period_s = schema::num::real_u64(period.unwrap_or(0)) * 1e-9;
    let mut gaps = (0, 0.0_f64);
    let mut last: Option<f64> = None;
    for epoch in &epochs.list {
        if epoch.wheels == [None, None] {
            continue;
        }
        if let Some(last) = last {
            let silent_s = epoch.t_s - last;
            if silent_s > (3.0 * period_s.max(epoch.dt) + 2.0 * epoch.dt).max(SHORT_GAP_S) {
                gaps = (gaps.0 + 1, gaps.1.max(silent_s));
            }
        }
        last = Some(epoch.t_s);
    }
    gaps
}

/// A count of samples in words.
fn samples(n: u64) -> String {
    if n == 1 {
        "1 sample".to_owned()
    } else {
        format!("{n} samples")
    }
}

fn frame_of_reference(result: &Reconstruction, epochs: &Epochs, out: &mut Vec<String>) {
    if result.rest_pose.is_none() {
        out.push(
            "No rest pose is given: the path is relative to the car at rest (north is its forward axis), and \
             says nothing of where on the map it lies."
                .to_owned(),
        );
    }
    if epochs.header.clock.uncertainty_ns.is_none() {
        out.push("UTC is as the record's clock had it; its error cannot be told.".to_owned());
    }
}
