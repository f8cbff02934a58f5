//! An event from its freeze to the record that is sealed.

use schema::block::{cut, thin_blocks};
use schema::header::{
    Clock, ClockSource, FORMAT_VERSION, Header, Interface, Layout, Origin, Periods,
};
use schema::num;
use schema::parts::{
    AuxChannel, Completion, Gap, Health, RawFrame, SignalHealth, Trigger, TriggerKind,
};
use schema::time::Grid;
use schema::{Packed, Record, Scales};

use crate::bins::start_of;
use crate::can::Frame;
use crate::config::Settings;
use crate::ring::{AUX_SPAN, MOST_RAW, RawRing, Ring};
use crate::trigger::Fired;

/// Names of the signal groups, in the order of their frame counts.
pub const GROUP_NAMES: [&str; 4] = ["accel", "rate", "wheel-left", "wheel-right"];

/// A frozen event that still grows.
#[derive(Clone, Debug)]
pub struct Event {
    /// Samples and what belongs to them, from the freeze on.
    pub tape: Ring,
    triggers: Vec<Fired>,
    wanted_first: u64,
    raw: Vec<(i64, Frame)>,
    raw_next: u64,
    raw_until_ns: i64,
    raw_cut: bool,
    offset_ns: i64,
    notes: Vec<String>,
}

/// Why an event is sealed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Its time was over.
    Over {
        /// The car was at rest.
        at_rest: bool,
    },
    /// The frames ended at this time while it ran.
    LogEnded {
        /// Index behind the last sample of the post-trigger time.
        post_trigger_end: u64,
        /// The car was at rest.
        at_rest: bool,
    },
}

/// What the pipeline knows at sealing beyond the event.
#[derive(Clone, Debug)]
pub struct Surroundings {
    /// Counts since the start.
    pub health: Health,
    /// Measured periods and jitter of each group, ns, and lost frames known by a counter.
    pub groups: [GroupState; 4],
}

/// State of a signal group.
#[derive(Clone, Copy, Debug, Default)]
pub struct GroupState {
    /// Its frame period, ns; 0: never seen.
    pub period: f64,
    /// Jitter of the receive times, ns.
    pub jitter: f64,
    /// It has a rolling counter.
    pub counted: bool,
    /// Receive time of its last frame.
    pub last_ns: Option<i64>,
}

impl Event {
    /// Freezes what lies before a trigger.
    #[must_use]
    pub fn open(
        ring: &Ring,
        raw: &RawRing,
        fired: &Fired,
        settings: &Settings,
        offset_ns: i64,
    ) -> Self {
        let wanted_first = fired.index.saturating_sub(settings.ring.before);
        let mut event = Self {
            tape: ring.copy_from(wanted_first),
            triggers: Vec::new(),
            wanted_first,
            raw: Vec::new(),
            raw_next: 0,
            raw_until_ns: i64::MIN,
            raw_cut: false,
            offset_ns,
            notes: Vec::new(),
        };
        event.mark(fired, raw, settings);
        event
    }

    /// Adds a trigger and the raw frames about it.
    pub fn mark(&mut self, fired: &Fired, raw: &RawRing, settings: &Settings) {
        if self.triggers.len() < 200 {
            self.triggers.push(*fired);
        }
        let start_ns = fired.monotonic_ns - settings.raw.before_ns;
        self.raw_until_ns = self
            .raw_until_ns
            .max(fired.monotonic_ns + settings.raw.after_ns);
        for (number, time_ns, frame) in raw.between(self.raw_next, start_ns, self.raw_until_ns) {
            self.raw_next = number + 1;
            if self.raw.len() < MOST_RAW {
                self.raw.push((*time_ns, *frame));
            } else {
                self.raw_cut = true;
            }
        }
    }

    /// A further sentence for the reader.
    pub fn note(&mut self, text: String) {
        self.notes.push(text);
    }

    /// Takes a frame of the raw window, if it is near enough to a trigger.
    pub fn take_raw(&mut self, number: u64, time_ns: i64, frame: &Frame) {
        if time_ns > self.raw_until_ns || number < self.raw_next {
            return;
        }
        self.raw_next = number + 1;
        if self.raw.len() < MOST_RAW {
            self.raw.push((time_ns, *frame));
        } else {
            self.raw_cut = true;
        }
    }

    /// The record. Number and origin are the caller's.
    #[must_use]
    pub fn seal(mut self, settings: &Settings, ending: Ending, around: Surroundings) -> Record {
        let scales = Scales::default();
        if self.tape.is_empty() {
            // A trigger before any sample: one missing sample, so that the record has a place in time.
            let index = self.triggers.first().map_or(0, |fired| fired.index);
            self.tape.push_missing(index);
        }
        let (first, end) = (self.tape.first(), self.tape.end());
        let grid = Grid {
            origin_ns: 0,
            utc_offset_ns: self.offset_ns,
        };
        let mut blocks = cut(
            self.tape.slots().map(|(index, slot)| (index, slot.packed)),
            &grid,
        );
        self.triggers.sort_by_key(|fired| fired.monotonic_ns);
        if settings.ring.layout == Layout::TwoRate {
            let at: Vec<u64> = self.triggers.iter().map(|fired| fired.index).collect();
            thin_blocks(&mut blocks, &at, &scales);
        }
        let completion = self.completion(settings, ending, first, end);
        let health = self.health(settings, around.health, &around.groups, first, end);
        let period = |group: usize| {
            around
                .groups
                .get(group)
                .map_or(0, |state| nanos(state.period))
        };
        let header = Header {
            number: 1,
            previous_sha256: [0; 32],
            parent_sha256: None,
            origin: Origin::Live,
            device_id: settings.device_id.clone(),
            software: concat!("svartboks recorder ", env!("CARGO_PKG_VERSION")).to_owned(),
            config_sha256: settings.config_sha256,
            vehicle: settings.vehicle.clone(),
            imu: settings.imu.clone(),
            wheels: settings.wheels.clone(),
            wheel_scale: scales.wheel,
            accel_scale: scales.accel,
            rate_scale: scales.rate,
            layout: settings.ring.layout,
            channel_frequency_class: None,
            periods: Periods {
                accel_ns: period(0),
                rate_ns: period(1),
                wheels_ns: [period(2), period(3)],
            },
            interfaces: settings
                .buses
                .iter()
                .map(|bus| Interface {
                    name: bus.interface.clone(),
                    offset_ns: 0,
                    uncertainty_ns: None,
                })
                .collect(),
            clock: Clock {
                source: ClockSource::LogStamps,
                offset_ns: self.offset_ns,
                uncertainty_ns: None,
                leap_second: false,
            },
        };
        Record {
            header,
            blocks,
            clipping: self
                .tape
                .clips(end)
                .filter(|clip| clip.index >= first)
                .copied()
                .collect(),
            raw: self.raw_frames(),
            aux: self.aux(settings, first, end),
            health,
            triggers: self
                .triggers
                .iter()
                .map(|fired| trigger(fired, settings))
                .collect(),
            completion,
        }
    }

    fn raw_frames(&self) -> Vec<RawFrame> {
        let frame = |(monotonic_ns, frame): &(i64, Frame)| RawFrame {
            monotonic_ns: *monotonic_ns,
            interface: frame.interface,
            id: frame.id,
            flags: frame.flags,
            data: frame.data().to_vec(),
        };
        self.raw.iter().map(frame).collect()
    }

    fn aux(&self, settings: &Settings, first: u64, end: u64) -> Vec<AuxChannel> {
        let groups = first / AUX_SPAN..end.div_ceil(AUX_SPAN);
        let channel = |(slot, name): (usize, &crate::plan::AuxName)| {
            let mut values = vec![None; num::usize_of(groups.end - groups.start)];
            for (group, row) in self.tape.aux() {
                let at = group.checked_sub(groups.start).map(num::usize_of);
                if let (Some(value), Some(found)) =
                    (at.and_then(|at| values.get_mut(at)), row.get(slot))
                {
                    *value = *found;
                }
            }
            AuxChannel {
                name: name.name.clone(),
                signal: name.signal.clone(),
                unit: name.unit.clone(),
                first_index: groups.start * AUX_SPAN,
                values,
            }
        };
        settings.plan.aux.iter().enumerate().map(channel).collect()
    }

    fn completion(&self, settings: &Settings, ending: Ending, first: u64, end: u64) -> Completion {
        let seconds = |samples: u64| num::real_u64(samples) / 100.0;
        let mut reasons = Vec::new();
        if first > self.wanted_first {
            let trigger = self.triggers.first().map_or(0, |fired| fired.index);
            reasons.push(format!(
                "the ring was not full: {:.2} s before the first trigger are stored, {:.2} s were asked for",
                seconds(trigger.saturating_sub(first)),
                seconds(settings.ring.before)
            ));
        }
        let at_rest = match ending {
            Ending::Over { at_rest } => {
                if !at_rest {
                    reasons.push(
                        "the car was still moving at the end, 20 s after the post-trigger time"
                            .to_owned(),
                    );
                }
                at_rest
            }
            Ending::LogEnded {
                post_trigger_end,
                at_rest,
            } => {
                if end < post_trigger_end {
                    let missing = seconds(post_trigger_end - end);
                    reasons.push(format!(
                        "the log ended {missing:.2} s before the post-trigger time was over"
                    ));
                }
                if !at_rest {
                    reasons.push(
                        "the log ended before the car had been at rest for 2 s: it ends moving"
                            .to_owned(),
                    );
                }
                at_rest
            }
        };
        Completion {
            complete: reasons.is_empty(),
            reasons,
            ends_at_rest: at_rest,
        }
    }

    fn health(
        &mut self,
        settings: &Settings,
        mut health: Health,
        groups: &[GroupState; 4],
        first: u64,
        end: u64,
    ) -> Health {
        let (start_ns, end_ns) = (start_of(first), start_of(end));
        health.gaps = self
            .tape
            .gaps()
            .filter(|gap| gap.to_ns > start_ns && gap.from_ns < end_ns)
            .cloned()
            .collect();
        health.clock_steps = self
            .tape
            .steps()
            .filter(|step| step.monotonic_ns < end_ns)
            .cloned()
            .collect();
        let wanted = if settings.wheels.present { 4 } else { 2 };
        for (group, (name, state)) in GROUP_NAMES.iter().zip(groups).enumerate().take(wanted) {
            let count =
                |slot: &crate::ring::Slot| u64::from(slot.frames.get(group).copied().unwrap_or(0));
            let frames: u64 = self.tape.slots().map(|(_, slot)| count(slot)).sum();
            let lost: u64 = self
                .tape
                .slots()
                .map(|(_, slot)| u64::from(slot.lost.get(group).copied().unwrap_or(0)))
                .sum();
            health.signals.push(SignalHealth {
                signal: (*name).to_owned(),
                frames,
                lost_by_counter: state.counted.then_some(lost),
                period_ns: nanos(state.period),
                jitter_ns: nanos(state.jitter),
            });
            // Silence that lasts to the record's end was not over when it was written.
            let silent_from = state.last_ns.unwrap_or(start_ns).max(start_ns);
            let limit = if state.period > 0.0 {
                3.0 * state.period
            } else {
                0.0
            };
            if num::real_i64(end_ns - silent_from) > limit && silent_from < end_ns {
                health.gaps.push(Gap {
                    signal: (*name).to_owned(),
                    from_ns: silent_from,
                    to_ns: end_ns,
                });
            }
        }
        health.gaps.sort_by_key(|gap| gap.from_ns);
        health
            .notes
            .extend(crate::health::standing_notes(settings, groups));
        if self.raw_cut {
            health.notes.push(format!("more than {MOST_RAW} raw frames lay about the triggers; the later ones are not stored"));
        }
        health.notes.append(&mut self.notes);
        health
    }
}

fn trigger(fired: &Fired, settings: &Settings) -> Trigger {
    let source = match fired.kind {
        TriggerKind::Peak | TriggerKind::DeltaV => ["x", "y", "z"]
            .get(fired.source)
            .copied()
            .unwrap_or("")
            .to_owned(),
        TriggerKind::Can => settings
            .trigger
            .can
            .get(fired.source)
            .map_or_else(String::new, |can| can.signal.clone()),
        TriggerKind::Manual => String::new(),
    };
    Trigger {
        kind: fired.kind,
        monotonic_ns: fired.monotonic_ns,
        index: fired.index,
        value: fired.value,
        threshold: fired.threshold,
        source,
    }
}

fn nanos(value: f64) -> u64 {
    u64::try_from(num::round_i64(value)).unwrap_or(0)
}

impl Ring {
    /// One missing sample at an index, where nothing was recorded at all.
    fn push_missing(&mut self, index: u64) {
        let closed = crate::sampler::Closed {
            index,
            sample: schema::Sample::default(),
            frames: [0; 4],
            lost: [0; 2],
            clips: [None; 6],
        };
        self.push(&closed, Packed::default());
    }
}

const _: () = assert!(FORMAT_VERSION.0 == 1);
