//! What the record says of itself: is it complete, what was missing, what happened beside the frames.

use schema::num;
use schema::parts::{Completion, Gap, Health, SignalHealth};

use super::{Ending, Event, GROUP_NAMES, GroupState, nanos};
use crate::bins::start_of;
use crate::config::Settings;
use crate::ring::MOST_RAW;

impl Event {
    pub(super) fn completion(
        &self,
        settings: &Settings,
        ending: Ending,
        first: u64,
        end: u64,
    ) -> Completion {
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
            Ending::Ended {
                why,
                post_trigger_end,
                at_rest,
            } => {
                if end < post_trigger_end {
                    let missing = seconds(post_trigger_end - end);
                    reasons.push(format!(
                        "{why} {missing:.2} s before the post-trigger time was over"
                    ));
                }
                if !at_rest {
                    reasons.push(format!(
                        "{why} before the car had been at rest for 2 s: it ends moving"
                    ));
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

    pub(super) fn health(
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
        let first_ns = self.triggers.first().map_or(0, |fired| fired.monotonic_ns);
        health.notes.extend(self.tape.notes().map(|(at_ns, text)| {
            let seconds = num::real_i64(at_ns.saturating_sub(first_ns)) / 1e9;
            format!("at {seconds:+.3} s: {text}")
        }));
        health.notes.append(&mut self.notes);
        health
    }
}
