//! Fixes and sentences of a stretch of recording, bounded.

use std::collections::VecDeque;

use schema::gnss::{Fix, Gnss, GnssSheet, Sentence};
use schema::limits::{MAX_FIXES, MAX_GNSS_BYTES};
use schema::num;

use crate::nmea::Text;

/// Most sentences that are kept: 120 s of a line that is full at 115,200 bit/s with short ones make as many.
const MOST_SENTENCES: usize = 32_768;
/// Bytes of a fix in the record.
const FIX_BYTES: usize = 122;
/// Bytes of a sentence beside its text.
const SENTENCE_BYTES: usize = 9;

/// A stretch of fixes and sentences, in the order they came.
#[derive(Clone, Debug, Default)]
pub struct GnssTape {
    fixes: VecDeque<Fix>,
    sentences: VecDeque<(i64, Text)>,
}

impl GnssTape {
    /// Adds a fix; of too many the oldest goes.
    pub fn push_fix(&mut self, fix: Fix) {
        if self.fixes.len() >= MAX_FIXES {
            self.fixes.pop_front();
        }
        self.fixes.push_back(fix);
    }

    /// Adds a sentence and when its first byte came; of too many the oldest goes.
    pub fn push_sentence(&mut self, monotonic_ns: i64, text: Text) {
        if self.sentences.len() >= MOST_SENTENCES {
            self.sentences.pop_front();
        }
        self.sentences.push_back((monotonic_ns, text));
    }

    /// Forgets what is older.
    pub fn trim(&mut self, start_ns: i64) {
        while self
            .fixes
            .front()
            .is_some_and(|fix| fix.monotonic_ns < start_ns)
        {
            self.fixes.pop_front();
        }
        while self
            .sentences
            .front()
            .is_some_and(|(at_ns, _)| *at_ns < start_ns)
        {
            self.sentences.pop_front();
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.fixes.clear();
        self.sentences.clear();
    }

    /// The part of a record that holds a stretch of time, and how many sentences found no room in it.
    #[must_use]
    pub fn part(&self, sheet: &GnssSheet, start_ns: i64, end_ns: i64) -> (Gnss, usize) {
        let within = |at_ns: i64| (start_ns..end_ns).contains(&at_ns);
        let mut fixes: Vec<Fix> = self
            .fixes
            .iter()
            .filter(|fix| within(fix.monotonic_ns))
            .cloned()
            .collect();
        // Frames of several buses come some milliseconds out of order.
        fixes.sort_by_key(|fix| fix.monotonic_ns);
        let mut room = MAX_GNSS_BYTES.saturating_sub(fixes.len() * FIX_BYTES);
        let mut sentences = Vec::new();
        let mut left_out = 0;
        for (at_ns, text) in self.sentences.iter().filter(|(at_ns, _)| within(*at_ns)) {
            let bytes = SENTENCE_BYTES + text.as_bytes().len();
            if let Some(rest) = room.checked_sub(bytes) {
                room = rest;
                sentences.push(Sentence {
                    monotonic_ns: *at_ns,
                    text: text.as_str().to_owned(),
                });
            } else {
                left_out += 1;
            }
        }
        sentences.sort_by_key(|sentence| sentence.monotonic_ns);
        let part = Gnss {
            sheet: sheet.clone(),
            fixes,
            sentences,
        };
        (part, left_out)
    }
}

const _: () = assert!(MAX_FIXES * FIX_BYTES < MAX_GNSS_BYTES);

/// Seconds between two times, ns.
pub(super) fn seconds(ns: i64) -> f64 {
    num::real_i64(ns) / 1e9
}
