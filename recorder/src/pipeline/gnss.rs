//! Satellite fixes on their way onto the ring.

use schema::gnss::Fix;

use super::Pipeline;
use crate::gnss::can::Field;
use crate::gnss::{GnssState, Receiver};
use crate::nmea::Heard;

/// A sentence farther from the frames than this can not be placed among them, ns.
const STRAY_NS: i64 = 10_000_000_000;

impl Pipeline<'_> {
    /// What came over the line of the satellite receiver, in the order it came, at a time on the line of the frames.
    pub fn heard(&mut self, line_ns: i64, heard: &Heard) {
        let placed = self
            .time
            .map(|time| (time.monotonic(line_ns), time.now_ns()))
            .filter(|(at_ns, now_ns)| at_ns.saturating_sub(*now_ns).saturating_abs() <= STRAY_NS)
            .map(|(at_ns, _)| at_ns);
        self.set_gnss_clock();
        let Some(receiver) = &mut self.gnss else {
            return;
        };
        receiver.count(heard);
        let Heard::Sentence { text, .. } = heard else {
            return;
        };
        let (kept, fix) = receiver.sentence(line_ns, placed, text);
        if let Some(at_ns) = kept {
            for event in &mut self.events {
                event.tape.gnss.push_sentence(at_ns, *text);
            }
            self.ring.gnss.push_sentence(at_ns, *text);
        }
        self.keep_fix(fix);
    }

    /// Sentences up to this time on the line can be placed among the frames; `None` before the first frame.
    #[must_use]
    pub fn hears_until_ns(&self) -> Option<i64> {
        self.line_ns()
            .map(|line_ns| line_ns.saturating_add(STRAY_NS))
    }

    /// The configured satellite receiver was not given to this replay: the record says so.
    pub fn without_receiver(&mut self) {
        if let Some(receiver) = &mut self.gnss {
            receiver.keep_silent();
        }
    }

    /// The state of the satellite receiver; `None` where none is configured.
    #[must_use]
    pub fn gnss(&self) -> Option<GnssState> {
        self.gnss.as_ref().map(Receiver::state)
    }

    pub(super) fn gnss_signal(&mut self, at_ns: i64, field: Field, value: f64) {
        if let Some(receiver) = &mut self.gnss {
            receiver.signal(at_ns, field, value);
        }
    }

    pub(super) fn end_gnss_frame(&mut self) {
        let fix = self.gnss.as_mut().and_then(Receiver::frame);
        self.keep_fix(fix);
    }

    pub(super) fn advance_gnss(&mut self, now_ns: i64) {
        self.set_gnss_clock();
        let fix = self
            .gnss
            .as_mut()
            .and_then(|receiver| receiver.advance(now_ns));
        self.keep_fix(fix);
    }

    fn set_gnss_clock(&mut self) {
        let offset_ns = self.time.map_or(0, |time| time.offset_ns());
        let offset_ns = offset_ns.saturating_add(self.shift_ns);
        if let Some(receiver) = &mut self.gnss {
            receiver.set_clock(offset_ns);
        }
    }

    fn keep_fix(&mut self, fix: Option<Fix>) {
        let Some(fix) = fix else { return };
        for event in &mut self.events {
            event.tape.gnss.push_fix(fix.clone());
        }
        self.ring.gnss.push_fix(fix);
    }
}
