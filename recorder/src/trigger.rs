//! When to freeze and when to seal: a pure machine. `let (next, action) = state.step(&input, &rules);`
//!
//! Triggers at most 5 s apart are one event; each is marked in it and extends its post-trigger time, to at most
//! 120 s in all. After that time the event is sealed at two seconds of rest, at the latest 20 s on. A
//! trigger more than 5 s after the last, while an event still runs, begins the next event, which is
//! frozen at once and becomes the running one when the first is sealed.

use schema::Sample;
use schema::num;
use schema::parts::TriggerKind;

use crate::bins::{index_of, start_of};
use crate::config::{Condition, Settings};
use crate::delta_v::DeltaV;
use crate::rest::{Rest, RestLimits};
use crate::sampler::Peak;

/// Impacts at most so far apart are one event, ns.
const ONE_EVENT_NS: i64 = 5_000_000_000;
/// Most samples after the first trigger (120 s) before the tail.
const MOST_AFTER: u64 = 12_000;
/// Most samples of the tail (20 s).
pub const MOST_TAIL: u64 = 2000;
/// A peak or CAN condition must be false for so long before it can fire again, ns.
const REARM_NS: i64 = 200_000_000;
/// Most CAN triggers.
const MOST_CAN: usize = 16;

/// The thresholds and times in force.
#[derive(Clone, Debug)]
pub struct Rules {
    /// Trigger 1, m/s^2.
    pub peak: Option<f64>,
    /// Trigger 2, m/s.
    pub delta_v: Option<f64>,
    /// Trigger 4.
    pub can: Vec<Condition>,
    /// Samples after the last trigger.
    pub after: u64,
    /// When the car is at rest.
    pub rest: RestLimits,
    /// No trigger fires by itself, though each is followed as ever: what fired is known ([`Input::Known`]).
    pub muted: bool,
}

impl Rules {
    /// The rules of a configuration.
    #[must_use]
    pub fn of(settings: &Settings) -> Self {
        Self {
            peak: settings.trigger.peak,
            delta_v: settings.trigger.delta_v,
            can: settings
                .trigger
                .can
                .iter()
                .map(|trigger| trigger.condition)
                .collect(),
            after: settings.ring.after,
            rest: RestLimits {
                accel_bias: settings.imu.accel_bias,
                rate_bias: settings.imu.rate_bias,
                wheel_cutoff: settings
                    .wheels
                    .present
                    .then_some(settings.wheels.cutoff_mps),
            },
            muted: false,
        }
    }
}

/// What the machine is told.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// The next sample.
    Sample(u64, &'a Sample),
    /// A frame at or above the peak threshold.
    Peak(Peak),
    /// A value of a trigger signal: slot, time, value.
    Can(usize, i64, f64),
    /// A manual trigger at a time.
    Manual(i64),
    /// A trigger that fired before the recording was cut, and is read back.
    Known(Fired),
}

/// What fired.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fired {
    /// Which.
    pub kind: TriggerKind,
    /// When, monotonic ns.
    pub monotonic_ns: i64,
    /// The sample it fell in.
    pub index: u64,
    /// Value and threshold, SI.
    pub value: f64,
    /// See `value`.
    pub threshold: f64,
    /// Body axis, or slot of the CAN signal.
    pub source: usize,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Nothing.
    None,
    /// Freeze: an event begins.
    Open(Fired),
    /// Another trigger of the running event.
    Mark(Fired),
    /// Freeze: the next event begins while one still runs.
    OpenNext(Fired),
    /// Another trigger of the next event.
    MarkNext(Fired),
    /// Seal the running event with what there is; it ends at rest or moving.
    Seal {
        /// The car has been at rest for two seconds.
        at_rest: bool,
    },
}

/// A running event.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Phase {
    last_ns: i64,
    limit: u64,
    end: u64,
}

impl Phase {
    fn new(fired: &Fired, after: u64) -> Self {
        Self {
            last_ns: fired.monotonic_ns,
            limit: fired.index + MOST_AFTER,
            end: fired.index + 1 + after,
        }
    }

    fn extend(&mut self, fired: &Fired, after: u64) {
        self.last_ns = self.last_ns.max(fired.monotonic_ns);
        self.end = self.end.max((fired.index + 1 + after).min(self.limit));
    }
}

/// The state of a CAN condition: the last time it held, and whether it was ever seen not to.
#[derive(Clone, Copy, Debug, Default)]
struct CanState {
    since_false: bool,
    held_ns: Option<i64>,
}

/// The machine's state.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    delta_v: DeltaV,
    rest: Rest,
    peak_ns: Option<i64>,
    can: [CanState; MOST_CAN],
    current: Option<Phase>,
    next: Option<Phase>,
}

impl State {
    /// True while an event runs.
    #[must_use]
    pub fn running(&self) -> bool {
        self.current.is_some()
    }

    /// True after two seconds of rest.
    #[must_use]
    pub fn at_rest(&self) -> bool {
        self.rest.at_rest()
    }

    /// Index behind the last sample before the tail of the running event.
    #[must_use]
    pub fn post_trigger_end(&self) -> Option<u64> {
        self.current.map(|phase| phase.end)
    }

    /// The largest change of speed within 150 ms so far, m/s.
    #[must_use]
    pub fn largest_delta_v(&self) -> f64 {
        self.delta_v.largest()
    }

    /// The running event is sealed from outside (the frames ended): the next one, if any, becomes it.
    #[must_use]
    pub fn sealed(mut self) -> Self {
        self.current = self.next.take();
        self
    }

    /// The signals mean something else from now on: running events go on, what was estimated of the signals is
    /// forgotten.
    #[must_use]
    pub fn restarted(self) -> Self {
        Self {
            current: self.current,
            next: self.next,
            ..Self::default()
        }
    }

    /// One step.
    #[must_use]
    pub fn step(mut self, input: &Input<'_>, rules: &Rules) -> (Self, Action) {
        match *input {
            Input::Sample(index, sample) => {
                self.rest = self.rest.step(sample, &rules.rest);
                let (delta_v, crossing) = self.delta_v.step(sample, rules.delta_v);
                self.delta_v = delta_v;
                if let Some(crossing) = crossing.filter(|_| !rules.muted) {
                    let within = num::round_i64(crossing.part * crate::bins::BIN);
                    return self.fire(
                        rules,
                        Fired {
                            kind: TriggerKind::DeltaV,
                            monotonic_ns: start_of(index).saturating_add(within),
                            index,
                            value: crossing.value,
                            threshold: rules.delta_v.unwrap_or(0.0),
                            source: crossing.axis,
                        },
                    );
                }
                self.finish(index)
            }
            Input::Peak(peak) => {
                let threshold = rules.peak.unwrap_or(f64::INFINITY);
                if peak.value < threshold {
                    return (self, Action::None);
                }
                let last = self.peak_ns.replace(peak.time_ns);
                if rules.muted || last.is_some_and(|last| peak.time_ns - last < REARM_NS) {
                    return (self, Action::None);
                }
                // A frame stands for the time up to its stamp, so one at a bin's very start belongs to the bin before.
                self.fire(
                    rules,
                    Fired {
                        kind: TriggerKind::Peak,
                        monotonic_ns: peak.time_ns,
                        index: index_of(peak.time_ns - 1),
                        value: peak.value,
                        threshold,
                        source: peak.axis,
                    },
                )
            }
            Input::Known(fired) => self.fire(rules, fired),
            Input::Can(slot, time_ns, value) => self.can(rules, slot, time_ns, value),
            Input::Manual(time_ns) => self.fire(
                rules,
                Fired {
                    kind: TriggerKind::Manual,
                    monotonic_ns: time_ns,
                    index: index_of(time_ns),
                    value: 0.0,
                    threshold: 0.0,
                    source: 0,
                },
            ),
        }
    }

    fn can(mut self, rules: &Rules, slot: usize, time_ns: i64, value: f64) -> (Self, Action) {
        let (Some(condition), Some(state)) = (rules.can.get(slot), self.can.get_mut(slot)) else {
            return (self, Action::None);
        };
        let (Condition::Equals(threshold) | Condition::Above(threshold)) = *condition;
        if !condition.holds(value) {
            if state.held_ns.is_none_or(|held| time_ns - held >= REARM_NS) {
                state.since_false = true;
            }
            return (self, Action::None);
        }
        let edge = state.since_false;
        state.since_false = false;
        state.held_ns = Some(time_ns);
        if !edge || rules.muted {
            return (self, Action::None);
        }
        let (kind, index) = (TriggerKind::Can, index_of(time_ns));
        self.fire(
            rules,
            Fired {
                kind,
                monotonic_ns: time_ns,
                index,
                value,
                threshold,
                source: slot,
            },
        )
    }

    fn fire(mut self, rules: &Rules, fired: Fired) -> (Self, Action) {
        let action = match (&mut self.current, &mut self.next) {
            (None, _) => {
                self.current = Some(Phase::new(&fired, rules.after));
                Action::Open(fired)
            }
            (Some(phase), _)
                if fired.monotonic_ns - phase.last_ns <= ONE_EVENT_NS
                    && fired.index < phase.limit =>
            {
                phase.extend(&fired, rules.after);
                Action::Mark(fired)
            }
            (Some(_), None) => {
                self.next = Some(Phase::new(&fired, rules.after));
                Action::OpenNext(fired)
            }
            (Some(_), Some(phase)) => {
                phase.extend(&fired, rules.after);
                Action::MarkNext(fired)
            }
        };
        (self, action)
    }

    fn finish(mut self, index: u64) -> (Self, Action) {
        let Some(phase) = self.current else {
            return (self, Action::None);
        };
        let at_rest = self.rest.at_rest();
        if index + 1 >= phase.end && (at_rest || index + 1 >= phase.end + MOST_TAIL) {
            self.current = self.next.take();
            return (self, Action::Seal { at_rest });
        }
        (self, Action::None)
    }
}
