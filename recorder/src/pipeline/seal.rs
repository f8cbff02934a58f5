//! An event is over: what the pipeline knows beside its samples, and the record.

use schema::parts::Health;

use super::Pipeline;
use crate::event::{Ending, Surroundings};

impl Pipeline<'_> {
    pub(super) fn seal(&mut self, ending: Ending) {
        let Some(mut event) = self.events.pop_front() else {
            return;
        };
        let decode = self.decoder.health;
        let mut notes = self.notes.clone();
        if let Some(facts) = &self.facts {
            notes.extend(facts.notes.iter().cloned());
        }
        if decode.not_finite > 0 {
            notes.push(format!(
                "{} values were not finite after factor and offset, and are missing",
                decode.not_finite
            ));
        }
        if self.sampler.unplaced() > 0 {
            notes.push(format!(
                "{} single IMU frames could not be given a period",
                self.sampler.unplaced()
            ));
        }
        notes.extend(crate::health::sender_notes(
            self.sampler.streams(),
            &self.paces,
        ));
        if let Some(receiver) = &self.gnss {
            // The newest fix may still grow: as it stands it is worth more than none.
            if let Some(fix) = receiver.preview() {
                event.tape.gnss.push_fix(fix);
            }
            notes.extend(receiver.notes());
        }
        let health = Health {
            frames_seen: self.totals.frames,
            frames_dropped: self.facts.as_ref().map_or(0, |facts| facts.dropped),
            error_frames: self
                .facts
                .as_ref()
                .map_or(0, |facts| facts.error_frames)
                .max(self.totals.error_frames),
            malformed: decode.too_short,
            late_frames: self.totals.late + self.sampler.late(),
            out_of_range: decode.out_of_range,
            notes,
            ..Health::default()
        };
        let around = Surroundings {
            health,
            groups: self.groups(),
            facts: self.facts.clone(),
        };
        self.ready
            .push_back(event.seal(&self.settings, ending, around));
    }
}
