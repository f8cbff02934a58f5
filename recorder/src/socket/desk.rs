//! What the links share: clocks, the line of time, and the notes that wait to be asked for.

use std::collections::VecDeque;

use crate::clock::{Clocks, Line};
use crate::live::Note;

/// Notes that wait; of more than that in one go the oldest are not kept.
const NOTES: usize = 256;

/// Clocks, line and notes.
pub(super) struct Desk {
    /// The clocks.
    pub clocks: Box<dyn Clocks>,
    /// The line.
    pub line: Line,
    /// Frames stamped before this, on the line, have been read: what comes now is younger.
    pub drained_ns: i64,
    notes: VecDeque<Note>,
}

impl Desk {
    pub(super) fn new(mut clocks: Box<dyn Clocks>) -> Self {
        let line = Line::new(&mut *clocks);
        Self {
            clocks,
            line,
            drained_ns: i64::MIN,
            notes: VecDeque::with_capacity(NOTES),
        }
    }

    /// Now on the line, ns; steps of the system clock are noted.
    pub(super) fn now(&mut self) -> i64 {
        let (now, step) = self.line.read(&mut *self.clocks);
        if let Some(step) = step {
            self.push(Note::ClockStep {
                at_ns: step.at_ns,
                step_ns: step.step_ns,
            });
            if step.leap {
                self.note(now, "the step of UTC is a leap second".to_owned());
            }
        }
        now
    }

    pub(super) fn note(&mut self, at_ns: i64, text: String) {
        self.push(Note::Text { at_ns, text });
    }

    fn push(&mut self, note: Note) {
        if self.notes.len() == NOTES {
            self.notes.pop_front();
        }
        self.notes.push_back(note);
    }

    pub(super) fn next_note(&mut self) -> Option<Note> {
        self.notes.pop_front()
    }
}
