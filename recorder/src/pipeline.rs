//! The pipeline from frames to records, the same for a live bus and a replayed log. It reads no clock: time is
//! what the frames say.

mod arrival;
mod gnss;
mod live;
mod seal;

use std::collections::VecDeque;
use std::sync::Arc;

use schema::num;
use schema::parts::Gap;
use schema::time::Grid;
use schema::{Packer, Record, Sample, Scales};

use crate::bins::index_of;
use crate::can::{ERR, Frame};
use crate::config::{RawFrames, Settings};
use crate::decode::{DecodeHealth, Decoder, Update};
use crate::event::{Ending, Event, Facts, GROUP_NAMES, GroupState};
use crate::gnss::Receiver;
use crate::pace::Pace;
use crate::ring::{RawRing, Ring, aux_group};
use crate::sampler::{Closed, Output, Sampler};
use crate::timebase::Timebase;
use crate::trigger::{Action, Fired, Input, Rules, State};

/// Triggers are known at the latest so long after they happened, ns: the raw window keeps that much more.
const TRIGGER_LAG_NS: i64 = 1_500_000_000;
/// A peak is decided when its frame is placed, some periods later: reading back, those of so many samples before the
/// first undecided one are decided again.
const REDECIDED: u64 = 100;
/// Triggers that wait to be told to the spool; a replay tells nobody.
const MOST_TOLD: usize = 256;

/// What the pipeline saw in all.
#[derive(Clone, Debug, Default)]
pub struct Totals {
    /// Frames of all interfaces.
    pub frames: u64,
    /// Error frames.
    pub error_frames: u64,
    /// Late and stray frames.
    pub late: u64,
    /// Gaps of a mapped signal.
    pub gaps: u64,
    /// Steps of the clock.
    pub clock_steps: u64,
    /// Largest change of speed within 150 ms, m/s.
    pub largest_delta_v: f64,
    /// Largest acceleration of a frame, m/s^2.
    pub largest_peak: f64,
    /// What was wrong with frames of mapped messages.
    pub decode: DecodeHealth,
    /// Monotonic time from the first to the newest frame, ns.
    pub span_ns: i64,
}

/// Called with every unrounded sample and its index.
pub type Observer<'a> = Box<dyn FnMut(u64, &Sample) + 'a>;

/// The pipeline.
pub struct Pipeline<'a> {
    settings: Arc<Settings>,
    rules: Rules,
    state: State,
    sampler: Sampler,
    decoder: Decoder,
    packer: Packer,
    ring: Ring,
    raw: RawRing,
    events: VecDeque<Event>,
    time: Option<Timebase>,
    first_ns: i64,
    held: Option<Frame>,
    paces: [Pace; 4],
    aux: VecDeque<(u64, Vec<Option<f64>>)>,
    out: Vec<Output>,
    ready: VecDeque<Record>,
    totals: Totals,
    notes: Vec<String>,
    /// What was told before the first frame.
    early: Vec<String>,
    manual: VecDeque<f64>,
    /// Manual triggers asked for while running, ns on the line.
    asked: VecDeque<i64>,
    /// The newest wheel reading: time and speed, m/s.
    rolling: Option<(i64, f64)>,
    /// Reading back: delta-V triggers fire by themselves from this bin of the line on, all others are known.
    recovering: Option<u64>,
    /// Triggers that fired and were not taken yet.
    fired: Vec<Fired>,
    /// UTC minus the line: the sum of the steps of the system clock.
    shift_ns: i64,
    facts: Option<Facts>,
    /// The satellite receiver, where one is configured.
    gnss: Option<Receiver>,
    observer: Option<Observer<'a>>,
}

impl<'a> Pipeline<'a> {
    /// A pipeline; `manual` are the times of manual triggers, seconds from the first frame.
    #[must_use]
    pub fn new(settings: Arc<Settings>, manual: &[f64], observer: Option<Observer<'a>>) -> Self {
        let mut manual: Vec<f64> = manual.to_vec();
        manual.sort_by(f64::total_cmp);
        let scales = Scales::default();
        Self {
            rules: Rules::of(&settings),
            state: State::default(),
            sampler: Sampler::new(&settings.plan, settings.mounting, settings.trigger.peak),
            decoder: Decoder::default(),
            packer: Packer::new(scales.wheel, scales.accel, scales.rate),
            ring: Ring::new(settings.ring.before + settings.ring.after),
            raw: RawRing::new(settings.raw.before_ns + TRIGGER_LAG_NS),
            events: VecDeque::new(),
            time: None,
            first_ns: 0,
            held: None,
            paces: [const { Pace::new() }; 4],
            aux: VecDeque::new(),
            out: Vec::new(),
            ready: VecDeque::new(),
            totals: Totals::default(),
            notes: Vec::new(),
            early: Vec::new(),
            manual: manual.into(),
            asked: VecDeque::new(),
            rolling: None,
            recovering: None,
            fired: Vec::new(),
            shift_ns: 0,
            facts: None,
            gnss: settings.gnss.as_ref().map(Receiver::new),
            observer,
            settings,
        }
    }

    /// The next sealed record, if any; number and origin are the caller's to set.
    pub fn take_ready(&mut self) -> Option<Record> {
        self.ready.pop_front()
    }

    /// What was seen so far.
    #[must_use]
    pub fn totals(&self) -> Totals {
        let mut totals = self.totals.clone();
        totals.late += self.sampler.late();
        totals.largest_delta_v = self.state.largest_delta_v();
        totals.largest_peak = self.sampler.largest_peak();
        totals.decode = self.decoder.health;
        totals.span_ns = self.time.map_or(0, |time| time.now_ns() - self.first_ns);
        totals
    }

    /// Seconds from the first to the newest frame.
    #[must_use]
    pub fn span_s(&self) -> f64 {
        num::real_i64(self.time.map_or(0, |time| time.now_ns() - self.first_ns)) / 1e9
    }

    /// Manual triggers whose time did not come.
    #[must_use]
    pub fn manual_left(&self) -> Vec<f64> {
        self.manual.iter().copied().collect()
    }

    /// The pace of each group: accel, rate, wheel left, wheel right.
    #[must_use]
    pub fn groups(&self) -> [GroupState; 4] {
        let mut groups = [GroupState::default(); 4];
        for (at, (group, pace)) in groups.iter_mut().zip(&self.paces).enumerate() {
            *group = GroupState {
                period: pace.period(),
                jitter: pace.jitter(),
                counted: false,
                last_ns: pace.last_ns(),
            };
            if let Some(stream) = self
                .sampler
                .streams()
                .iter()
                .find(|stream| at < 2 && stream.leads(at))
            {
                group.counted = stream.counted();
                if stream.timeline().period() > 0.0 {
                    group.period = stream.timeline().period();
                    group.jitter = stream.timeline().jitter();
                }
            }
        }
        groups
    }

    /// Time goes on: bins are closed, and manual triggers whose time has come fire.
    fn advance(&mut self, now_ns: i64) {
        self.sampler.advance(now_ns, &mut self.out);
        self.drain();
        while let Some(at) = self.manual.front().map(|at| self.manual_ns(*at))
            && at <= now_ns
        {
            self.manual.pop_front();
            self.step_machine(&Input::Manual(at));
        }
        self.fire_asked(now_ns);
        self.advance_gnss(now_ns);
    }

    /// One frame at its place in time.
    fn take(&mut self, frame: &Frame) {
        let Some(time) = self.time else { return };
        let (at_ns, now_ns) = (time.monotonic(frame.time_ns), time.now_ns());
        self.mute(index_of(at_ns), REDECIDED);
        self.advance(now_ns);
        if frame.id & ERR != 0 {
            self.totals.error_frames += 1;
        }
        if frame.interface == Frame::FOREIGN {
            return;
        }
        let settings = Arc::clone(&self.settings);
        let plan = if frame.carries_data() {
            settings.plan.find(frame.interface, frame.id)
        } else {
            None
        };
        let kept = match settings.raw.frames {
            RawFrames::Mapped => plan.is_some(),
            RawFrames::All => true,
            RawFrames::None => false,
        };
        if kept {
            let number = self.raw.push(at_ns, frame);
            for event in &mut self.events {
                event.take_raw(number, at_ns, frame);
            }
        }
        let Some(message) = plan else { return };
        let mut decoder = std::mem::take(&mut self.decoder);
        decoder.read(message, frame, at_ns, |update| self.update(at_ns, update));
        self.decoder = decoder;
        self.end_gnss_frame();
        self.drain();
    }

    fn manual_ns(&self, seconds: f64) -> i64 {
        self.first_ns.saturating_add(num::round_i64(seconds * 1e9))
    }

    fn update(&mut self, at_ns: i64, update: Update) {
        match update {
            Update::Imu(number, counter, values) => {
                for group in 0..2 {
                    if self
                        .sampler
                        .streams()
                        .get(number)
                        .is_some_and(|stream| stream.leads(group))
                    {
                        self.arrive(group, at_ns);
                    }
                }
                self.sampler
                    .imu(number, at_ns, counter, values, &mut self.out);
            }
            Update::Wheel(side, speed) => {
                self.arrive(2 + side, at_ns);
                self.rolling = Some((at_ns, speed));
                self.sampler.wheel(side, at_ns, speed);
            }
            Update::Aux(slot, value) => self.keep_aux(at_ns, slot, value),
            Update::Gnss(field, value) => self.gnss_signal(at_ns, field, value),
            Update::Can(slot, value) => self.step_machine(&Input::Can(slot, at_ns, value)),
        }
    }

    fn arrive(&mut self, group: usize, at_ns: i64) {
        let Some((from_ns, to_ns)) = self
            .paces
            .get_mut(group)
            .and_then(|pace| pace.arrive(at_ns))
        else {
            return;
        };
        self.totals.gaps += 1;
        let signal = GROUP_NAMES.get(group).copied().unwrap_or("").to_owned();
        let gap = Gap {
            signal,
            from_ns,
            to_ns,
        };
        for event in &mut self.events {
            event.tape.push_gap(gap.clone());
        }
        self.ring.push_gap(gap);
    }

    fn keep_aux(&mut self, at_ns: i64, slot: usize, value: f64) {
        let group = aux_group(at_ns);
        if self.aux.back().is_none_or(|(last, _)| *last < group) {
            let row = self.ring.aux_row(self.settings.plan.aux.len());
            self.aux.push_back((group, row));
        }
        let row = self.aux.iter_mut().rev().find(|(open, _)| *open == group);
        if let Some(entry) = row.and_then(|(_, row)| row.get_mut(slot)) {
            *entry = Some(value);
        }
    }

    fn drain(&mut self) {
        if self.out.is_empty() {
            return;
        }
        let mut out = std::mem::take(&mut self.out);
        for output in out.drain(..) {
            match output {
                Output::Peak(peak) => self.step_machine(&Input::Peak(peak)),
                Output::Bin(closed) => self.bin(&closed),
            }
        }
        self.out = out;
    }

    fn bin(&mut self, closed: &Closed) {
        if let Some(observer) = &mut self.observer {
            observer(closed.index, &closed.sample);
        }
        let offset_ns = self.time.map_or(0, |time| time.offset_ns());
        if (Grid {
            origin_ns: 0,
            utc_offset_ns: offset_ns,
        })
        .starts_second(closed.index)
        {
            self.packer.reset();
        }
        let packed = self.packer.packed(&closed.sample);
        self.ring.push(closed, packed);
        for event in &mut self.events {
            event.tape.push(closed, packed);
        }
        while self
            .aux
            .front()
            .is_some_and(|(group, _)| (group + 1) * crate::ring::AUX_SPAN <= closed.index + 1)
        {
            if let Some((group, row)) = self.aux.pop_front() {
                for event in &mut self.events {
                    event.tape.push_aux(group, row.clone());
                }
                self.ring.push_aux(group, row);
            }
        }
        let muted = self.rules.muted;
        self.mute(closed.index, 0);
        self.step_machine(&Input::Sample(closed.index, &closed.sample));
        self.rules.muted = muted;
    }

    fn step_machine(&mut self, input: &Input<'_>) {
        let (state, action) = self.state.step(input, &self.rules);
        self.state = state;
        match action {
            Action::None => {}
            Action::Open(fired) => {
                self.tell(fired);
                self.open(&fired);
            }
            Action::Mark(fired) => {
                self.tell(fired);
                self.mark(0, &fired);
            }
            Action::OpenNext(fired) => {
                self.tell(fired);
                if let Some(event) = self.events.front_mut() {
                    event.note("a later trigger, more than 5 s after the last of this event, began the next record".to_owned());
                }
                self.open(&fired);
            }
            Action::MarkNext(fired) => {
                self.tell(fired);
                self.mark(1, &fired);
            }
            Action::Seal { at_rest } => self.seal(Ending::Over { at_rest }),
        }
    }

    fn tell(&mut self, fired: Fired) {
        if self.fired.len() < MOST_TOLD {
            self.fired.push(fired);
        }
    }

    fn open(&mut self, fired: &Fired) {
        let offset_ns = self.time.map_or(0, |time| time.offset_ns());
        self.events.push_back(Event::open(
            &self.ring,
            &self.raw,
            fired,
            &self.settings,
            offset_ns.saturating_add(self.shift_ns),
        ));
    }

    fn mark(&mut self, at: usize, fired: &Fired) {
        if let Some(event) = self.events.get_mut(at) {
            event.mark(fired, &self.raw, &self.settings);
        }
    }
}
