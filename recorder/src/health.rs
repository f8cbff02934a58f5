//! What a reader of the record must hear, in sentences.

use crate::config::Settings;
use crate::event::{GROUP_NAMES, GroupState};

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
