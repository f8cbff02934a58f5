//! Frames as they arrive: strays dropped, steps of the clock and long silences bridged, the end.

use schema::num;
use schema::parts::ClockStep;

use super::Pipeline;
use crate::bins::start_of;
use crate::can::Frame;
use crate::event::Ending;
use crate::pace::Pace;
use crate::timebase::{Judgement, Timebase};

/// Silence longer than this leaves the ring behind (200 s: every running event is over by then).
const LONG_SILENCE_NS: i64 = 200_000_000_000;
/// Most gaps that are counted one by one in the totals.
const MOST_NOTES: usize = 20;

impl Pipeline<'_> {
    /// Takes a frame, in the order of arrival.
    pub fn frame(&mut self, frame: &Frame) {
        self.totals.frames += 1;
        let Some(time) = &mut self.time else {
            let time = Timebase::new(frame.time_ns);
            self.first_ns = time.now_ns();
            self.sampler.begin(self.first_ns);
            self.time = Some(time);
            for text in std::mem::take(&mut self.early) {
                self.remark(frame.time_ns, &text);
            }
            self.take(frame);
            return;
        };
        match time.judge(frame.time_ns) {
            Judgement::Good => self.take(frame),
            Judgement::Drop => self.totals.late += 1,
            Judgement::Hold => self.held = Some(*frame),
            Judgement::DropHeld => {
                self.held = None;
                self.totals.late += 1;
                self.take(frame);
            }
            Judgement::Replace => {
                self.held = Some(*frame);
                self.totals.late += 1;
            }
            Judgement::Step => {
                if let Some(held) = self.held.take() {
                    self.step(held.time_ns);
                    self.take(&held);
                }
                // The frame agrees with the held one, so it is in time now.
                if let Some(time) = &mut self.time {
                    time.judge(frame.time_ns);
                }
                self.take(frame);
            }
        }
    }

    /// No more frames come: closes every bin and seals what runs.
    pub fn finish(&mut self) {
        if let Some(held) = self.held.take() {
            // Nothing contradicts the last frame: forwards it stands, backwards it is a stray.
            if self
                .time
                .is_some_and(|time| held.time_ns > time.now_ns() + time.offset_ns())
            {
                self.step(held.time_ns);
                self.take(&held);
            } else {
                self.totals.late += 1;
            }
        }
        self.cut("the log ended");
    }

    /// Seals what runs.
    pub(super) fn end(&mut self, why: &'static str) {
        while let Some(post_trigger_end) = self.state.post_trigger_end() {
            let at_rest = self.state.at_rest();
            self.state = self.state.sealed();
            self.seal(Ending::Ended {
                why,
                post_trigger_end,
                at_rest,
            });
        }
    }

    /// Time steps to a confirmed stamp: backwards over a seam, or forwards over a long silence.
    fn step(&mut self, stamp_ns: i64) {
        let Some(mut time) = self.time else { return };
        let before_ns = time.now_ns();
        self.sampler.flush(before_ns, &mut self.out);
        self.drain();
        let moved = time.step(stamp_ns);
        let now_ns = time.now_ns();
        if let Some((moved_ns, seam_end_ns)) = moved {
            self.totals.clock_steps += 1;
            self.note(format!(
                "the clock of the frames stepped by {:.3} s",
                num::real_i64(moved_ns) / 1e9
            ));
            let step = ClockStep {
                monotonic_ns: seam_end_ns,
                step_ns: moved_ns,
            };
            for event in &mut self.events {
                event.tape.push_step(step.clone());
            }
            self.ring.push_step(step);
            self.paces.iter_mut().for_each(Pace::pause);
            self.sampler.seam(seam_end_ns, &mut self.out);
            self.drain();
            self.time = Some(time);
            return;
        }
        let silent_ns = now_ns - before_ns;
        self.note(format!(
            "no frame for {:.1} s, or the clock was set forward",
            num::real_i64(silent_ns) / 1e9
        ));
        let ring_ns = start_of(self.ring.capacity().unwrap_or(0));
        let bridged_ns = if self.events.is_empty() {
            ring_ns
        } else {
            LONG_SILENCE_NS
        };
        if silent_ns <= bridged_ns {
            self.sampler.seam(now_ns, &mut self.out);
            self.drain();
        } else {
            if !self.events.is_empty() {
                self.sampler
                    .seam(before_ns + LONG_SILENCE_NS, &mut self.out);
                self.drain();
            }
            self.ring.clear();
            self.aux.clear();
            self.sampler.begin(now_ns);
        }
        self.time = Some(time);
    }

    fn note(&mut self, text: String) {
        if self.notes.len() < MOST_NOTES {
            self.notes.push(text);
        }
    }
}
