//! An event from its freeze to the record that is sealed.

mod account;

use schema::block::{cut, thin_blocks};
use schema::gnss::Gnss;
use schema::header::{
    Clock, ClockSource, FORMAT_VERSION, Header, Interface, Layout, Origin, Periods,
};
use schema::num;
use schema::parts::{AuxChannel, Health, RawFrame, Trigger, TriggerKind};
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
    /// The frames ended while it ran.
    Ended {
        /// Why, as the beginning of a sentence: `the log ended`.
        why: &'static str,
        /// Index behind the last sample of the post-trigger time.
        post_trigger_end: u64,
        /// The car was at rest.
        at_rest: bool,
    },
}

/// What a live source says that frames do not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Facts {
    /// Source and quality of UTC; its offset is that of the event.
    pub clock: Clock,
    /// The interfaces.
    pub interfaces: Vec<Interface>,
    /// Frames that the kernel dropped since the start.
    pub dropped: u64,
    /// Error frames since the start.
    pub error_frames: u64,
    /// What the self-test found, and whatever else holds at sealing, one sentence each.
    pub notes: Vec<String>,
}

/// What the pipeline knows at sealing beyond the event.
#[derive(Clone, Debug)]
pub struct Surroundings {
    /// Counts since the start.
    pub health: Health,
    /// Measured periods and jitter of each group, ns, and lost frames known by a counter.
    pub groups: [GroupState; 4],
    /// Of a live source; a log has none.
    pub facts: Option<Facts>,
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
        let (gnss, gnss_note) = self.gnss(settings, first, end);
        self.notes.extend(gnss_note);
        let health = self.health(settings, around.health, &around.groups, first, end);
        let period = |group: usize| {
            around
                .groups
                .get(group)
                .map_or(0, |state| nanos(state.period))
        };
        let facts = around.facts;
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
            interfaces: facts
                .as_ref()
                .map_or_else(|| interfaces(settings), |facts| facts.interfaces.clone()),
            clock: Clock {
                offset_ns: self.offset_ns,
                ..facts.map_or(LOG_CLOCK, |facts| facts.clock)
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
            gnss,
            health,
            triggers: self
                .triggers
                .iter()
                .map(|fired| trigger(fired, settings))
                .collect(),
            completion,
        }
    }

    /// Fixes and sentences of the record's time, where the configuration asks for them, and what is to be said of them.
    fn gnss(&self, settings: &Settings, first: u64, end: u64) -> (Option<Gnss>, Option<String>) {
        let Some(gnss) = &settings.gnss else {
            return (None, None);
        };
        let (start_ns, end_ns) = (start_of(first), start_of(end));
        let (part, left_out) = self.tape.gnss.part(&gnss.sheet, start_ns, end_ns);
        let note = (left_out > 0).then(|| {
            format!("{left_out} sentences of the satellite receiver found no room in the record")
        });
        (Some(part), note)
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
}

/// What a log's stamps are worth is not known.
const LOG_CLOCK: Clock = Clock {
    source: ClockSource::LogStamps,
    offset_ns: 0,
    uncertainty_ns: None,
    leap_second: false,
};

/// The configured interfaces, with no offset of their clocks known.
pub(crate) fn interfaces(settings: &Settings) -> Vec<Interface> {
    let interface = |bus: &crate::config::Bus| Interface {
        name: bus.interface.clone(),
        offset_ns: 0,
        uncertainty_ns: None,
    };
    settings.buses.iter().map(interface).collect()
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
        TriggerKind::Manual | TriggerKind::PowerLoss => String::new(),
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
