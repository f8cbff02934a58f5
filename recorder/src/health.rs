//! What a reader of the record must hear, in sentences.

use crate::config::Settings;
use crate::event::{GROUP_NAMES, GroupState};
use crate::imu_stream::ImuStream;
use crate::pace::Pace;

/// A slower IMU than 1 kHz leaves the band-width error of delta-V open, ns (with some slack).
const FAST_NS: f64 = 1.1e6;
/// A period near or above 10 ms: one frame a sample.
const SLOW_NS: f64 = 8e6;

/// Sentences that follow from the configuration and the measured periods.
#[must_use]
pub fn standing_notes(settings: &Settings, groups: &[GroupState; 4]) -> Vec<String> {
    let mut notes = vec![
        "no channel frequency class (SAE J211) is claimed: the samples are means over 10 ms, at 100 Hz".to_owned(),
    ];
    let [accel, ..] = groups;
    if accel.period > FAST_NS {
        notes.push(format!(
            "the accelerometer's frames come every {:.2} ms, slower than 1 kHz: the band-width error of delta-V can not \
             be bounded from this record",
            accel.period / 1e6
        ));
    }
    if accel.period > SLOW_NS {
        notes.push(
            "at about 100 Hz or less it matters how the sensor makes its frames: means over the frame's period keep \
             delta-V, point samples can miss up to half of a pulse's delta-V"
                .to_owned(),
        );
    }
    if settings.imu.accel_range.is_none() {
        notes.push(
            "the accelerometer's range is not configured: its clipping can not be told".to_owned(),
        );
    }
    if settings.imu.rate_range.is_none() {
        notes.push("the gyros' range is not configured: their clipping can not be told".to_owned());
    }
    let wanted = if settings.wheels.present { 4 } else { 2 };
    for (name, state) in GROUP_NAMES.iter().zip(groups).take(wanted) {
        if state.last_ns.is_none() {
            notes.push(format!("no frame of {name} was ever received"));
        }
    }
    notes
}

/// Sentences about senders that do not behave: counters that stand still or jump, frames of two senders.
#[must_use]
pub fn sender_notes(streams: &[ImuStream], paces: &[Pace; 4]) -> Vec<String> {
    let mut notes = Vec::new();
    for stream in streams {
        let name = match (stream.leads(0), stream.leads(1)) {
            (true, _) => "accelerometer",
            (_, true) => "gyro",
            _ => "IMU",
        };
        let counter = stream.counter();
        if counter.stale > 0 {
            notes.push(format!(
                "the rolling counter of the {name}'s frames stood still in {} frames",
                counter.stale
            ));
        }
        if counter.jumps > 0 {
            notes.push(format!(
                "the rolling counter of the {name}'s frames jumped in {} frames by more than time allows: it was reset, or \
                 a second sender uses the identifier",
                counter.jumps
            ));
        }
    }
    for (name, pace) in GROUP_NAMES.iter().zip(paces) {
        if let Some((settled, fastest)) = pace.crowded() {
            notes.push(format!(
                "frames of {name} came every {:.2} ms, before that every {:.2} ms: its rate changed, or a second sender uses \
                 the identifier",
                fastest / 1e6,
                settled / 1e6
            ));
        }
    }
    notes
}
