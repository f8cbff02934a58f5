//! The record of a simulated crash, made as the recorder makes it: packed samples, clipping, trigger.
//!
//! The recorder itself is another program; what it does to the samples is the schema's
//! [`schema::packer::Packer`] and [`schema::block::cut`], which are used here too.

use schema::header::Header;
use schema::num::{real, real_u64, round_i64, round_usize, u64_of};
use schema::packer::Packer;
use schema::parts::{Clip, Completion, Health, Trigger, TriggerKind};
use schema::time::Grid;
use schema::{Record, block};

use crate::simulate::Simulated;
use crate::simulate::fixes::{self, Received, Receiver};

/// Monotonic time of the log's zero, s.
const MONOTONIC_S: i64 = 100;
/// The record begins so long before the trigger, s.
pub const BEFORE_S: f64 = 30.0;
/// Change of velocity along one body axis that fires the trigger, m/s [49 CFR 563, UN R160].
const TRIGGER_DELTA_V: f64 = 8.0 / 3.6;
/// Window of that change, s.
const TRIGGER_WINDOW_S: f64 = 0.150;
/// A frame counts as clipped that stands within this of the range: rounding on the bus, m/s^2 and rad/s.
const CLIP_SLACK: [f64; 2] = [0.002, 6e-5];

/// The record from 30 s before the trigger to the end of the log.
///
/// `cut_s`: the power goes so many seconds after the first impact's onset (after the rest's begin without one).
#[must_use]
pub fn record(simulated: &Simulated, header: Header, cut_s: Option<f64>) -> Record {
    let facts = &simulated.truth.facts;
    let grid = Grid {
        origin_ns: MONOTONIC_S * 1_000_000_000 - 10_000_000,
        utc_offset_ns: (facts.start_unix_s - MONOTONIC_S) * 1_000_000_000,
    };
    let mut header = header;
    header.clock.offset_ns = grid.utc_offset_ns;
    let (kind, trigger_s, value) = trigger(simulated);
    let first = round_usize((trigger_s - BEFORE_S).max(0.0) * 100.0).max(1);
    let end = cut_s.map_or(usize::MAX, |s| {
        round_usize(((facts.trigger_at_s + s) * 100.0).floor())
    });
    let mut packer = Packer::new(header.wheel_scale, header.accel_scale, header.rate_scale);
    let samples = simulated.samples();
    let packed: Vec<_> = samples
        .iter()
        .enumerate()
        .take(end)
        .skip(first)
        .map(|(k, sample)| {
            let index = u64_of(k);
            if grid.starts_second(index) {
                packer.reset();
            }
            (index, packer.packed(sample))
        })
        .collect();
    let last = packed.last().map_or(0, |(index, _)| *index);
    let clipping = clips(simulated, &header)
        .into_iter()
        .filter(|clip| (u64_of(first)..=last).contains(&clip.index))
        .collect();
    Record {
        blocks: block::cut(packed, &grid),
        clipping,
        raw: Vec::new(),
        aux: Vec::new(),
        gnss: None,
        health: Health::default(),
        triggers: vec![Trigger {
            kind,
            monotonic_ns: MONOTONIC_S * 1_000_000_000 + round_i64(trigger_s * 1e9),
            index: u64_of(round_usize((trigger_s * 100.0).ceil())),
            value,
            threshold: value,
            source: String::new(),
        }],
        completion: Completion {
            complete: cut_s.is_none(),
            reasons: cut_s.map(|_| CUT.to_owned()).into_iter().collect(),
            ends_at_rest: cut_s.is_none(),
        },
        header,
    }
}

/// [`record`] with what a satellite receiver says, and the true pose of the path on the earth.
///
/// The recorder's clock is off by [`Receiver::clock_off_s`] where that is given.
#[must_use]
pub fn with_fixes(
    simulated: &Simulated,
    header: Header,
    cut_s: Option<f64>,
    receiver: &Receiver,
    seed: u64,
) -> (Record, Received) {
    let mut made = record(simulated, header, cut_s);
    let zero_ns = MONOTONIC_S * 1_000_000_000;
    let received = fixes::receive(
        simulated,
        receiver,
        seed,
        zero_ns,
        made.header.clock.offset_ns,
    );
    let mut gnss = received.gnss.clone();
    // The recorder keeps what came while it recorded.
    let from = made.monotonic_ns(made.first_index());
    let to = made.monotonic_ns(made.end_index());
    gnss.fixes
        .retain(|fix| (from..=to).contains(&fix.monotonic_ns));
    made.gnss = Some(gnss);
    (made, received)
}

/// What the recorder says of a record that lost its power.
const CUT: &str = "the recording was cut (loss of power, or the recorder was killed) before the car had been at rest \
                   for 2 s: it ends moving";

/// Kind, time (s of the log) and value of the trigger: the first 10 ms bin behind the onset at whose end the IMU's
/// velocity has changed by 8 km/h along a body axis within 150 ms, else by hand 20 ms after the onset; by hand at the
/// rest's begin where there is no impact.
fn trigger(simulated: &Simulated) -> (TriggerKind, f64, f64) {
    let facts = &simulated.truth.facts;
    let Some(impact) = facts.impacts.first() else {
        return (TriggerKind::Manual, facts.trigger_at_s, 0.0);
    };
    let mut change = [0.0; 2];
    for row in &simulated.truth.rows {
        let after = row.t_s - impact.t_s;
        if after <= 0.0 {
            continue;
        }
        if after > TRIGGER_WINDOW_S {
            break;
        }
        for (sum, accel) in change.iter_mut().zip(row.accel) {
            *sum += accel * after.min(0.01);
        }
        if change.iter().any(|x| x.abs() >= TRIGGER_DELTA_V) {
            return (TriggerKind::DeltaV, row.t_s, TRIGGER_DELTA_V);
        }
    }
    (TriggerKind::Manual, impact.t_s + 0.02, 0.0)
}

/// Clipped frames by bin and axis, in order of bins.
fn clips(simulated: &Simulated, header: &Header) -> Vec<Clip> {
    let period = 1.0 / real(simulated.scenario.imu_hz);
    let mut out: Vec<Clip> = Vec::new();
    let mut frames: Vec<(u64, u16)> = Vec::new();
    for frame in &simulated.imu {
        let index = u64_of(round_usize(
            ((frame.t - 0.5 * period) * 100.0).ceil().max(0.0),
        ));
        match frames.last_mut() {
            Some((last, count)) if *last == index => *count = count.saturating_add(1),
            _ => frames.push((index, 1)),
        }
        if !frame.clipped {
            continue;
        }
        let sensors = [
            (frame.accel, header.imu.accel_range, frame.accel_lost),
            (frame.rate, header.imu.rate_range, frame.rate_lost),
        ];
        for (sensor, (values, range, lost)) in sensors.into_iter().enumerate() {
            let Some(limit) = range.filter(|_| !lost).map(|r| r - CLIP_SLACK[sensor]) else {
                continue;
            };
            for (i, value) in values.into_iter().enumerate() {
                if value.abs() < limit {
                    continue;
                }
                let axis = u8::try_from(3 * sensor + i).unwrap_or(0);
                let sign = if value < 0.0 { -1 } else { 1 };
                match out
                    .iter_mut()
                    .rev()
                    .take(12)
                    .find(|c| c.index == index && c.axis == axis)
                {
                    Some(clip) => clip.clipped = clip.clipped.saturating_add(1),
                    None => out.push(Clip {
                        index,
                        axis,
                        sign,
                        clipped: 1,
                        frames: 1,
                    }),
                }
            }
        }
    }
    for clip in &mut out {
        let place = frames.partition_point(|(index, _)| *index < clip.index);
        clip.frames = frames.get(place).map_or(1, |f| f.1);
    }
    out
}

/// Seconds from the record's trigger (its t = 0) of a time of the log.
#[must_use]
pub fn since_trigger(record: &Record, log_s: f64) -> f64 {
    let zero = record.triggers.first().map_or(0, |t| t.monotonic_ns);
    log_s - (schema::num::real_i64(zero - MONOTONIC_S * 1_000_000_000)) * 1e-9
}

/// Length of a record, s.
#[must_use]
pub fn length_s(record: &Record) -> f64 {
    real_u64(record.end_index().saturating_sub(record.first_index())) * 0.01
}

#[cfg(test)]
mod tests {
    use super::{record, since_trigger};
    use crate::simulate::{Class, Scenario, simulate};
    use schema::Record;
    use schema::header::Origin;
    use schema::parts::TriggerKind;

    #[test]
    fn the_record_can_be_sealed_and_starts_30_s_before_its_trigger() {
        let simulated = simulate(&Scenario::draw(Class::Frontal, 5)).unwrap();
        let mut made = record(&simulated, simulated.scenario.header(), None);
        made.header.origin = Origin::Live;
        let bytes = made.to_bytes().unwrap();
        let (read, _) = Record::read(&bytes).unwrap();
        assert_eq!(read.triggers, made.triggers);
        let onset = since_trigger(&made, simulated.truth.facts.impacts[0].t_s);
        assert!((-0.1..0.0).contains(&onset), "{onset}");
        assert_eq!(made.triggers[0].kind, TriggerKind::DeltaV);
        let start = made.time_s(made.first_index());
        assert!((start + 30.0).abs() < 0.02, "{start}");
    }

    #[test]
    fn clipped_frames_are_counted_by_bin_and_axis() {
        let mut scenario = Scenario::draw(Class::Side, 5);
        let range = 0.3;
        scenario.errors.rate_range = Some(range);
        scenario.sheet.rate_range = Some(range);
        scenario.imu_hz = 500;
        let simulated = simulate(&scenario).unwrap();
        let mut made = record(&simulated, scenario.header(), None);
        made.header.origin = Origin::Live;
        assert!(made.clipping.iter().any(|c| c.axis == 5));
        for clip in &made.clipping {
            assert!(clip.axis >= 3 && clip.clipped <= clip.frames && clip.frames == 5);
        }
        assert!(made.to_bytes().is_ok());
    }

    #[test]
    fn a_cut_record_says_so() {
        let simulated = simulate(&Scenario::draw(Class::Oblique, 5)).unwrap();
        let made = record(&simulated, simulated.scenario.header(), Some(0.3));
        assert!(!made.completion.complete && !made.completion.ends_at_rest);
        let onset = since_trigger(&made, simulated.truth.facts.impacts[0].t_s);
        let end = made.time_s(made.end_index());
        assert!((end - onset - 0.3).abs() < 0.02, "{end} {onset}");
    }
}
