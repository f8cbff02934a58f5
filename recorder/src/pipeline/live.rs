//! What a live source tells beside frames: silence, steps of the clock, triggers asked for, changed settings; and a
//! recording that was cut and is read back.

use std::sync::Arc;

use schema::num;
use schema::parts::{ClockStep, TriggerKind};
use schema::sample::SAMPLE_NS;

use super::{Pipeline, TRIGGER_LAG_NS};
use crate::bins::index_of;
use crate::config::Settings;
use crate::decode::Decoder;
use crate::event::Facts;
use crate::gnss::Receiver;
use crate::pace::Pace;
use crate::ring::RawRing;
use crate::sampler::Sampler;
use crate::trigger::{Fired, Input, Rules};

/// With no frame for so long time goes on without them, so much behind, ns. Longer than any frame is ever late.
const QUIET_NS: i64 = 300_000_000;
/// Two decisions on one trigger differ by less, ns.
const SAME_NS: i64 = 20_000_000;
/// A sharp frame keeps the spool alert for so long, ns.
const ALERT_NS: i64 = 1_000_000_000;
/// A car that was hit may stand when the power goes: so long after a sharp frame, ns.
const HIT_NS: i64 = 5_000_000_000;
/// The car moves, m/s.
const ROLLING: f64 = 2.0;
/// Sentences that are kept until the first frame at most.
const MOST_EARLY: usize = 20;
/// Triggers asked for at once.
const MOST_ASKED: usize = 16;

impl Pipeline<'_> {
    /// A pipeline that reads back a recording. Triggers that had fired are known; those that the cut came before
    /// the decision on, delta-V in samples from `undecided_ns` on the line on, fire by themselves.
    #[must_use]
    pub fn recovered(settings: Arc<Settings>, shift_ns: i64, undecided_ns: i64) -> Self {
        let mut pipeline = Pipeline::new(settings, &[], None);
        pipeline.recovering = u64::try_from(undecided_ns.div_euclid(SAMPLE_NS)).ok();
        pipeline.rules.muted = true;
        pipeline.shift_ns = shift_ns;
        pipeline
    }

    /// Number of a bin on the line, in steps of 10 ms since 1970.
    pub(super) fn line_bin(&self, index: u64) -> u64 {
        let offset = self
            .time
            .map_or(0, |time| time.offset_ns())
            .div_euclid(SAMPLE_NS);
        let index = i64::try_from(index).unwrap_or(i64::MAX);
        u64::try_from(index.saturating_add(offset)).unwrap_or(0)
    }

    /// Start of the first bin that the triggers have not looked at, ns on the line.
    #[must_use]
    pub fn undecided_ns(&self) -> i64 {
        let bin = i64::try_from(self.line_bin(self.sampler.next_index())).unwrap_or(i64::MAX);
        bin.saturating_mul(SAMPLE_NS)
    }

    /// Reading back, no trigger fires by itself up to the first undecided sample, less so many.
    pub(super) fn mute(&mut self, index: u64, less: u64) {
        if let Some(from) = self.recovering {
            self.rules.muted = self.line_bin(index).saturating_add(less) < from;
        }
    }

    /// A trigger that fired before the cut, in the order it was told: its time on the line, its index there in steps of
    /// 10 ms, and UTC minus the line then. One that fired already is no other.
    pub fn known(&mut self, fired: &Fired, shift_ns: i64) {
        if self.time.is_none() {
            return;
        }
        let fired = self.place(fired);
        let same = |other: &Fired| {
            other.kind == fired.kind && (other.monotonic_ns - fired.monotonic_ns).abs() <= SAME_NS
        };
        if self.fired.iter().any(same) {
            return;
        }
        let now = std::mem::replace(&mut self.shift_ns, shift_ns);
        self.step_machine(&Input::Known(fired));
        self.shift_ns = now;
    }

    /// Now on the line, ns, while no frame comes: bins are closed and events end all the same.
    pub fn tick(&mut self, line_ns: i64) {
        let Some(time) = &mut self.time else { return };
        if !time.pass(line_ns.saturating_sub(QUIET_NS)) {
            return;
        }
        let now_ns = time.now_ns();
        self.advance(now_ns);
    }

    /// Asks for a manual trigger at a time on the line. False where no frame was ever received, or too many are
    /// waiting.
    pub fn trigger_at(&mut self, line_ns: i64) -> bool {
        if self.time.is_none() || self.asked.len() >= MOST_ASKED {
            return false;
        }
        self.asked.push_back(line_ns);
        true
    }

    pub(super) fn fire_asked(&mut self, now_ns: i64) {
        while let Some(at) = self.asked.front().map(|at| self.monotonic(*at))
            && at <= now_ns
        {
            self.asked.pop_front();
            self.step_machine(&Input::Manual(at));
        }
    }

    /// A time of the line on the monotonic grid; its beginning where there was no frame yet.
    fn monotonic(&self, line_ns: i64) -> i64 {
        self.time.map_or(0, |time| time.monotonic(line_ns))
    }

    /// A trigger from the line onto this pipeline's own grid.
    fn place(&self, fired: &Fired) -> Fired {
        let bin_ns = i64::try_from(fired.index)
            .unwrap_or(i64::MAX)
            .saturating_mul(SAMPLE_NS);
        Fired {
            monotonic_ns: self.monotonic(fired.monotonic_ns),
            index: index_of(self.monotonic(bin_ns)),
            ..*fired
        }
    }

    /// The triggers that fired since the last call, on the line, as [`Pipeline::known`] takes them.
    pub fn take_fired(&mut self, mut take: impl FnMut(Fired)) {
        let offset_ns = self.time.map_or(0, |time| time.offset_ns());
        let fired = std::mem::take(&mut self.fired);
        for fired in &fired {
            take(Fired {
                monotonic_ns: fired.monotonic_ns.saturating_add(offset_ns),
                index: self.line_bin(fired.index),
                ..*fired
            });
        }
        self.fired = fired;
        self.fired.clear();
    }

    /// The system clock was set at a time on the line. Running events keep their UTC.
    pub fn clock_step(&mut self, line_ns: i64, step_ns: i64) {
        self.shift_ns = self.shift_ns.saturating_add(step_ns);
        self.totals.clock_steps += 1;
        let step = ClockStep {
            monotonic_ns: self.monotonic(line_ns),
            step_ns,
        };
        let seconds = num::real_i64(step_ns) / 1e9;
        for event in &mut self.events {
            event.tape.push_step(step.clone());
        }
        self.ring.push_step(step);
        self.remark(
            line_ns,
            &format!(
                "the system clock was set by {seconds:+.3} s; times within a record go on as if it had not been"
            ),
        );
    }

    /// UTC minus the line, ns.
    #[must_use]
    pub fn shift_ns(&self) -> i64 {
        self.shift_ns
    }

    /// A sentence for records that hold this time on the line.
    pub fn remark(&mut self, line_ns: i64, text: &str) {
        if self.time.is_none() {
            // There is no grid yet to lay it on.
            if self.early.len() < MOST_EARLY {
                self.early.push(text.to_owned());
            }
            return;
        }
        let at_ns = self.monotonic(line_ns);
        for event in &mut self.events {
            event.tape.push_note(at_ns, text.to_owned());
        }
        self.ring.push_note(at_ns, text.to_owned());
    }

    /// What a live source says of its clock, interfaces and losses; in force for events sealed from now on.
    pub fn set_facts(&mut self, facts: Facts) {
        self.facts = Some(facts);
    }

    /// True while every frame may be one of a crash: an event runs, or a frame of the last second had more than 1 g
    /// beside gravity. A trigger is decided 60 ms after the sample that it fires in, this as soon as the
    /// frame has its place, some periods of the sensor later.
    #[must_use]
    pub fn alert(&self) -> bool {
        let sharp = self.sampler.sharp_ns();
        self.state.running() || sharp.is_some_and(|sharp| self.now_ns() - sharp < ALERT_NS)
    }

    /// True while an event runs.
    #[must_use]
    pub fn running(&self) -> bool {
        self.state.running()
    }

    /// The newest time on the line, ns; `None` before the first frame.
    #[must_use]
    pub fn line_ns(&self) -> Option<i64> {
        self.time
            .map(|time| time.now_ns().saturating_add(time.offset_ns()))
    }

    /// The newest time on the monotonic grid, ns.
    #[must_use]
    pub fn now_ns(&self) -> i64 {
        self.time.map_or(0, |time| time.now_ns())
    }

    /// The time on the line of a record's first trigger, ns.
    #[must_use]
    pub fn trigger_line_ns(&self, record: &schema::Record) -> i64 {
        let first = record
            .triggers
            .first()
            .map_or(0, |first| first.monotonic_ns);
        first.saturating_add(self.time.map_or(0, |time| time.offset_ns()))
    }

    /// Samples in the ring, and how many it holds.
    #[must_use]
    pub fn fill(&self) -> (u64, u64) {
        let held = self.ring.end().saturating_sub(self.ring.first());
        (held, self.ring.capacity().unwrap_or(0))
    }

    /// The recording ends here: what runs is sealed as far as it goes. `why` begins a sentence.
    pub fn cut(&mut self, why: &'static str) {
        self.settle();
        self.end(why);
    }

    /// No frame comes any more: closes every bin, so that all triggers that can be decided are.
    pub fn settle(&mut self) {
        let Some(time) = self.time else { return };
        self.sampler.flush(time.now_ns(), &mut self.out);
        self.drain();
    }

    /// The recording was cut here and nothing runs: if the car moved, or was hit a moment ago, that is a trigger of its
    /// own, for a crash may take the power before any other can fire.
    pub fn power_lost(&mut self) {
        let Some(time) = self.time else { return };
        if !self.settings.trigger.power_loss || self.state.running() {
            return;
        }
        let now_ns = time.now_ns();
        let sharp = self.sampler.sharp_ns();
        let hit = sharp.is_some_and(|sharp| now_ns - sharp < HIT_NS);
        let lately = |at_ns: i64| now_ns - at_ns < ALERT_NS;
        let speed = self
            .rolling
            .filter(|(at_ns, _)| lately(*at_ns))
            .map(|(_, speed)| speed);
        let [accel, ..] = &self.paces;
        let moving = match speed {
            Some(speed) => speed >= ROLLING,
            // Without wheels only two seconds of rest say that it stands; a bus that sleeps says nothing.
            None => accel.last_ns().is_some_and(lately) && !self.state.at_rest(),
        };
        if moving || hit {
            self.step_machine(&Input::Known(Fired {
                kind: TriggerKind::PowerLoss,
                monotonic_ns: now_ns,
                index: index_of(now_ns),
                value: speed.unwrap_or(0.0),
                threshold: ROLLING,
                source: 0,
            }));
        }
    }

    /// Other settings from a time on the line on; the ring stays. To be called while no event runs; one that the last
    /// samples under the old settings begin goes on.
    pub fn reconfigure(&mut self, settings: Arc<Settings>, line_ns: i64) {
        let digest = schema::seal::Hex(&self.settings.config_sha256).to_string();
        // Under the old rules first: what is decided now belongs to them.
        self.settle();
        self.rules = Rules::of(&settings);
        self.rules.muted = self.recovering.is_some();
        self.sampler = Sampler::new(&settings.plan, settings.mounting, settings.trigger.peak);
        if let Some(time) = self.time {
            self.sampler.begin(time.now_ns());
        }
        // Conditions and the level of gravity belong to the old signals.
        self.state = self.state.restarted();
        self.decoder = Decoder::default();
        self.raw = RawRing::new(settings.raw.before_ns + TRIGGER_LAG_NS);
        self.rolling = None;
        self.paces = [const { Pace::new() }; 4];
        self.aux.clear();
        self.ring.forget_aux();
        if settings.gnss != self.settings.gnss {
            // Another receiver, or none: what is there would be told under the wrong name, or at all.
            self.ring.gnss.clear();
            self.gnss = settings.gnss.as_ref().map(Receiver::new);
        }
        self.ring
            .set_capacity(settings.ring.before + settings.ring.after);
        self.settings = settings;
        self.remark(
            line_ns,
            &format!("the configuration was read again; what lies before was recorded under the one with SHA-256 {digest}"),
        );
    }
}
