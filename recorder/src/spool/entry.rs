//! What stands in the spool, entry by entry. Little-endian; times of frames relative to their block's base.

use schema::parts::TriggerKind;

use crate::can::{Frame, MAX_DATA};
use crate::nmea::Text;
use crate::trigger::Fired;

/// Longest text of a note or name, bytes; longer ones are cut.
pub(super) const LONGEST_TEXT: usize = 600;

/// One entry. All times are ns on the session's line ([`crate::live`]).
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A frame of a mapped message.
    Frame(Frame),
    /// A session begins, or goes on under other settings: digest of the settings' bundle.
    Session {
        /// When.
        at_ns: i64,
        /// Names the bundle ([`crate::config::Bundle`]).
        bundle: [u8; 32],
        /// UTC minus the line, ns.
        utc_offset_ns: i64,
    },
    /// A trigger fired, as [`crate::pipeline::Pipeline::take_fired`] gives it. While its event runs it is written again
    /// and again, so that no one block holds the only word of it.
    Trigger {
        /// The trigger.
        fired: Fired,
        /// UTC minus the line that its event began with, ns.
        utc_offset_ns: i64,
    },
    /// The system clock was set.
    ClockStep {
        /// When.
        at_ns: i64,
        /// New minus old UTC, ns.
        step_ns: i64,
    },
    /// A sentence for the record.
    Note {
        /// When.
        at_ns: i64,
        /// What.
        text: String,
    },
    /// A sentence of the satellite receiver, of any kind: also of one that the record does not keep it tells that the line
    /// was not quiet. Of version 1 of the spool like all others: a program
    /// that does not know it can not read the configuration that asks for it either.
    Sentence {
        /// When its first byte came.
        at_ns: i64,
        /// The sentence.
        text: Text,
    },
    /// The event whose triggers fell between these times is sealed and on disk.
    Sealed {
        /// Time of its first trigger on the line.
        first_ns: i64,
        /// Time of its last trigger on the line.
        last_ns: i64,
    },
    /// The state of session, sockets and clock, once a second: whatever the circle has left, this is in it.
    Counts {
        /// When.
        at_ns: i64,
        /// Names the bundle in force.
        bundle: [u8; 32],
        /// Source of UTC: number of the variant of [`schema::header::ClockSource`].
        clock: u8,
        /// Its uncertainty, ns; `None`: can not be told.
        uncertainty_ns: Option<u64>,
        /// Frames that the kernel dropped.
        dropped: u64,
        /// Error frames.
        error_frames: u64,
        /// UTC minus the line, ns.
        utc_offset_ns: i64,
    },
    /// Samples before this time were looked at by the triggers; written with each flush.
    Closed {
        /// Start of the first bin that was still open, ns.
        at_ns: i64,
    },
    /// The recorder was stopped on purpose.
    End {
        /// When.
        at_ns: i64,
    },
}

impl Entry {
    /// Its time, ns.
    #[must_use]
    pub fn time_ns(&self) -> i64 {
        match self {
            Self::Frame(frame) => frame.time_ns,
            Self::Trigger { fired, .. } => fired.monotonic_ns,
            Self::Session { at_ns, .. }
            | Self::ClockStep { at_ns, .. }
            | Self::Note { at_ns, .. }
            | Self::Sentence { at_ns, .. }
            | Self::Counts { at_ns, .. }
            | Self::Closed { at_ns }
            | Self::End { at_ns } => *at_ns,
            Self::Sealed { last_ns, .. } => *last_ns,
        }
    }
}

const FRAME: u8 = 1;
const SESSION: u8 = 2;
const TRIGGER: u8 = 3;
const CLOCK_STEP: u8 = 4;
const NOTE: u8 = 5;
const SEALED: u8 = 6;
const COUNTS: u8 = 7;
const END: u8 = 8;
const CLOSED: u8 = 9;
const SENTENCE: u8 = 10;

/// Bytes of a frame's entry before its payload.
const FRAME_HEAD: usize = 12;

/// The frame's entry at the end of `out`; false (and nothing written) where its time is more than 2 s from the base.
pub(super) fn put_frame(out: &mut Vec<u8>, base_ns: i64, frame: &Frame) -> bool {
    let Ok(delta) = i32::try_from(frame.time_ns.saturating_sub(base_ns)) else {
        return false;
    };
    out.extend([FRAME, frame.interface, frame.flags, frame.len()]);
    out.extend(frame.id.to_le_bytes());
    out.extend(delta.to_le_bytes());
    out.extend(frame.data());
    true
}

/// Bytes of a frame's entry.
pub(super) fn frame_bytes(frame: &Frame) -> usize {
    FRAME_HEAD + usize::from(frame.len())
}

/// Any other entry at the end of `out`.
pub(super) fn put(out: &mut Vec<u8>, entry: &Entry) {
    match entry {
        // Frames go by `put_frame`: only it knows the base.
        Entry::Frame(_) => {}
        Entry::Session {
            at_ns,
            bundle,
            utc_offset_ns,
        } => {
            head(out, SESSION, *at_ns);
            out.extend(bundle);
            out.extend(utc_offset_ns.to_le_bytes());
        }
        Entry::Trigger {
            fired,
            utc_offset_ns,
        } => {
            head(out, TRIGGER, fired.monotonic_ns);
            out.push(match fired.kind {
                TriggerKind::Peak => 0,
                TriggerKind::DeltaV => 1,
                TriggerKind::Manual => 2,
                TriggerKind::Can => 3,
                TriggerKind::PowerLoss => 4,
            });
            out.push(u8::try_from(fired.source).unwrap_or(u8::MAX));
            out.extend(utc_offset_ns.to_le_bytes());
            out.extend(fired.index.to_le_bytes());
            out.extend(fired.value.to_le_bytes());
            out.extend(fired.threshold.to_le_bytes());
        }
        Entry::ClockStep { at_ns, step_ns } => {
            head(out, CLOCK_STEP, *at_ns);
            out.extend(step_ns.to_le_bytes());
        }
        Entry::Note { at_ns, text } => {
            head(out, NOTE, *at_ns);
            let mut end = text.len().min(LONGEST_TEXT);
            while !text.is_char_boundary(end) {
                end -= 1;
            }
            let bytes = text.as_bytes().get(..end).unwrap_or_default();
            out.extend(u16::try_from(bytes.len()).unwrap_or(0).to_le_bytes());
            out.extend(bytes);
        }
        Entry::Sentence { at_ns, text } => {
            head(out, SENTENCE, *at_ns);
            let bytes = text.as_bytes();
            out.push(u8::try_from(bytes.len()).unwrap_or(0));
            out.extend(bytes);
        }
        Entry::Sealed { first_ns, last_ns } => {
            head(out, SEALED, *first_ns);
            out.extend(last_ns.to_le_bytes());
        }
        Entry::Counts {
            at_ns,
            bundle,
            clock,
            uncertainty_ns,
            dropped,
            error_frames,
            utc_offset_ns,
        } => {
            head(out, COUNTS, *at_ns);
            out.extend(bundle);
            out.push(*clock);
            out.extend(uncertainty_ns.unwrap_or(u64::MAX).to_le_bytes());
            out.extend(dropped.to_le_bytes());
            out.extend(error_frames.to_le_bytes());
            out.extend(utc_offset_ns.to_le_bytes());
        }
        Entry::Closed { at_ns } => head(out, CLOSED, *at_ns),
        Entry::End { at_ns } => head(out, END, *at_ns),
    }
}

fn head(out: &mut Vec<u8>, kind: u8, at_ns: i64) {
    out.push(kind);
    out.extend(at_ns.to_le_bytes());
}

/// Reads the entries of a block's payload; stops where one can not be read (the block's checksum held, so that is
/// an entry of a later version).
pub(super) struct Entries<'a> {
    rest: &'a [u8],
    base_ns: i64,
}

impl<'a> Entries<'a> {
    pub(super) fn new(payload: &'a [u8], base_ns: i64) -> Self {
        Self {
            rest: payload,
            base_ns,
        }
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        Some(*first)
    }

    fn long(&mut self) -> Option<i64> {
        self.take().map(i64::from_le_bytes)
    }

    fn count(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn entry(&mut self) -> Option<Entry> {
        let [kind] = self.take()?;
        if kind == FRAME {
            let [interface, flags, length] = self.take()?;
            let id = u32::from_le_bytes(self.take()?);
            let delta = i32::from_le_bytes(self.take()?);
            let length = usize::from(length);
            if length > MAX_DATA {
                return None;
            }
            let (data, rest) = self.rest.split_at_checked(length)?;
            self.rest = rest;
            let time_ns = self.base_ns.saturating_add(i64::from(delta));
            return Some(Entry::Frame(Frame::new(
                time_ns, interface, id, flags, data,
            )));
        }
        let at_ns = self.long()?;
        Some(match kind {
            SESSION => Entry::Session {
                at_ns,
                bundle: self.take()?,
                utc_offset_ns: self.long()?,
            },
            TRIGGER => {
                let [kind, source] = self.take()?;
                let utc_offset_ns = self.long()?;
                let index = self.count()?;
                let value = f64::from_le_bytes(self.take()?);
                let threshold = f64::from_le_bytes(self.take()?);
                if !value.is_finite() || !threshold.is_finite() {
                    return None;
                }
                let fired = Fired {
                    kind: match kind {
                        0 => TriggerKind::Peak,
                        1 => TriggerKind::DeltaV,
                        2 => TriggerKind::Manual,
                        3 => TriggerKind::Can,
                        4 => TriggerKind::PowerLoss,
                        _ => return None,
                    },
                    monotonic_ns: at_ns,
                    index,
                    value,
                    threshold,
                    source: usize::from(source),
                };
                Entry::Trigger {
                    fired,
                    utc_offset_ns,
                }
            }
            CLOCK_STEP => Entry::ClockStep {
                at_ns,
                step_ns: self.long()?,
            },
            NOTE => {
                let length = usize::from(u16::from_le_bytes(self.take()?));
                let (text, rest) = self.rest.split_at_checked(length)?;
                self.rest = rest;
                Entry::Note {
                    at_ns,
                    text: String::from_utf8_lossy(text).into_owned(),
                }
            }
            SENTENCE => {
                let [length] = self.take()?;
                let (text, rest) = self.rest.split_at_checked(usize::from(length))?;
                self.rest = rest;
                Entry::Sentence {
                    at_ns,
                    text: Text::new(text)?,
                }
            }
            SEALED => Entry::Sealed {
                first_ns: at_ns,
                last_ns: self.long()?,
            },
            COUNTS => Entry::Counts {
                at_ns,
                bundle: self.take()?,
                clock: self.take::<1>()?[0],
                uncertainty_ns: Some(self.count()?).filter(|ns| *ns != u64::MAX),
                dropped: self.count()?,
                error_frames: self.count()?,
                utc_offset_ns: self.long()?,
            },
            CLOSED => Entry::Closed { at_ns },
            END => Entry::End { at_ns },
            _ => return None,
        })
    }
}

impl Iterator for Entries<'_> {
    type Item = Entry;

    fn next(&mut self) -> Option<Entry> {
        let entry = self.entry();
        if entry.is_none() {
            self.rest = &[];
        }
        entry
    }
}

/// Most bytes of an entry.
pub(super) const LARGEST: usize = 1 + 8 + 2 + LONGEST_TEXT;

const _: () = assert!(LARGEST >= FRAME_HEAD + MAX_DATA);

#[cfg(test)]
mod tests;
