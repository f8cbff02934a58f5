//! The ring: the last seconds as packed samples, with what belongs to them. Oldest overwritten, all bounded.
//!
//! An event takes a copy of the ring from some index on and lets it grow; the ring itself never stops.

use std::collections::VecDeque;

use schema::num;
use schema::parts::{Clip, ClockStep, Gap};
use schema::{Packed, Sample};

use crate::bins::{GROUPS, index_of, start_of};
use crate::can::Frame;
use crate::gnss::GnssTape;
use crate::sampler::Closed;

/// Most gaps, clock steps or notes that are kept.
const MOST_NOTES: usize = 2000;
/// Samples that one auxiliary value stands for.
pub const AUX_SPAN: u64 = 10;

/// One packed sample with its frame counts.
#[derive(Clone, Copy, Debug)]
pub struct Slot {
    /// The codes, and what they leave out.
    pub packed: Packed,
    /// Frames of each group.
    pub frames: [u16; GROUPS],
    /// Lost frames: accel, rate.
    pub lost: [u16; 2],
}

/// A stretch of recording.
#[derive(Clone, Debug, Default)]
pub struct Ring {
    first: u64,
    slots: VecDeque<Slot>,
    clips: VecDeque<Clip>,
    gaps: VecDeque<Gap>,
    steps: VecDeque<ClockStep>,
    notes: VecDeque<(i64, String)>,
    /// Groups of ten samples (index / 10) and their auxiliary values.
    aux: VecDeque<(u64, Vec<Option<f64>>)>,
    /// A row of auxiliary values that is no longer needed, to be filled again.
    spare: Option<Vec<Option<f64>>>,
    /// Satellite fixes and sentences.
    pub gnss: GnssTape,
    capacity: Option<u64>,
}

impl Ring {
    /// A ring that holds so many samples.
    #[must_use]
    pub fn new(capacity: u64) -> Self {
        Self {
            capacity: Some(capacity),
            ..Self::default()
        }
    }

    /// Samples it holds at most; `None` for an event's copy.
    #[must_use]
    pub fn capacity(&self) -> Option<u64> {
        self.capacity
    }

    /// Index of the oldest sample.
    #[must_use]
    pub fn first(&self) -> u64 {
        self.first
    }

    /// Index behind the newest sample.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.first + num::u64_of(self.slots.len())
    }

    /// True without samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Adds the next sample. One that does not follow (time jumped) empties a ring; an event fills with missing.
    pub fn push(&mut self, closed: &Closed, packed: Packed) {
        if self.slots.is_empty() {
            self.first = closed.index;
        } else if closed.index != self.end() && self.capacity.is_some() {
            self.clear();
            self.first = closed.index;
        }
        while self.end() < closed.index {
            self.slots.push_back(Slot {
                packed: Packed::default(),
                frames: [0; GROUPS],
                lost: [0; 2],
            });
        }
        if self.end() > closed.index {
            return;
        }
        self.slots.push_back(Slot {
            packed,
            frames: closed.frames,
            lost: closed.lost,
        });
        for clip in closed.clips.iter().flatten() {
            self.clips.push_back(Clip {
                index: closed.index,
                axis: clip.axis,
                sign: clip.sign,
                clipped: clip.clipped,
                frames: clip.frames,
            });
        }
        if let Some(capacity) = self.capacity {
            while num::u64_of(self.slots.len()) > capacity {
                self.slots.pop_front();
                self.first += 1;
            }
            self.trim();
        }
    }

    /// Adds the auxiliary values of a group of ten samples.
    pub fn push_aux(&mut self, group: u64, values: Vec<Option<f64>>) {
        self.aux.push_back((group, values));
    }

    /// Notes a gap.
    pub fn push_gap(&mut self, gap: Gap) {
        if self.gaps.len() < MOST_NOTES {
            self.gaps.push_back(gap);
        }
    }

    /// Notes a step of the clock.
    pub fn push_step(&mut self, step: ClockStep) {
        if self.steps.len() < MOST_NOTES {
            self.steps.push_back(step);
        }
    }

    /// Notes what happened at a time, in one sentence.
    pub fn push_note(&mut self, monotonic_ns: i64, text: String) {
        if self.notes.len() < MOST_NOTES {
            self.notes.push_back((monotonic_ns, text));
        }
    }

    /// Holds so many samples from now on.
    pub fn set_capacity(&mut self, capacity: u64) {
        self.capacity = Some(capacity);
    }

    /// Forgets the auxiliary values, as their columns mean something else from now on.
    pub fn forget_aux(&mut self) {
        self.aux.clear();
    }

    /// Empties it.
    pub fn clear(&mut self) {
        self.slots.clear();
        self.clips.clear();
        self.gaps.clear();
        self.steps.clear();
        self.notes.clear();
        self.aux.clear();
        self.gnss.clear();
    }

    /// A copy that begins at an index (or at the oldest sample) and grows.
    #[must_use]
    pub fn copy_from(&self, index: u64) -> Self {
        let skip = num::usize_of(index.saturating_sub(self.first)).min(self.slots.len());
        let mut copy = Self {
            first: self.first + num::u64_of(skip),
            slots: self.slots.iter().skip(skip).copied().collect(),
            capacity: None,
            clips: self.clips.clone(),
            gaps: self.gaps.clone(),
            steps: self.steps.clone(),
            notes: self.notes.clone(),
            aux: self.aux.clone(),
            spare: None,
            gnss: self.gnss.clone(),
        };
        copy.trim();
        copy
    }

    /// Drops what belongs to samples that are no longer there.
    fn trim(&mut self) {
        let (first, start_ns) = (self.first, start_of(self.first));
        while self.clips.front().is_some_and(|clip| clip.index < first) {
            self.clips.pop_front();
        }
        while self.gaps.front().is_some_and(|gap| gap.to_ns < start_ns) {
            self.gaps.pop_front();
        }
        while self
            .steps
            .front()
            .is_some_and(|step| step.monotonic_ns < start_ns)
        {
            self.steps.pop_front();
        }
        self.gnss.trim(start_ns);
        while self.notes.front().is_some_and(|(at, _)| *at < start_ns) {
            self.notes.pop_front();
        }
        while self
            .aux
            .front()
            .is_some_and(|(group, _)| (group + 1) * AUX_SPAN <= first)
        {
            self.spare = self.aux.pop_front().map(|(_, row)| row);
        }
    }

    /// A row for so many auxiliary values, none of them known.
    pub fn aux_row(&mut self, values: usize) -> Vec<Option<f64>> {
        let mut row = self.spare.take().unwrap_or_default();
        row.clear();
        row.resize(values, None);
        row
    }

    /// Samples in order.
    pub fn slots(&self) -> impl Iterator<Item = (u64, &Slot)> {
        (self.first..).zip(&self.slots)
    }

    /// Clipped bins up to an index.
    pub fn clips(&self, end: u64) -> impl Iterator<Item = &Clip> {
        self.clips.iter().take_while(move |clip| clip.index < end)
    }

    /// Gaps noted.
    pub fn gaps(&self) -> impl Iterator<Item = &Gap> {
        self.gaps.iter()
    }

    /// Clock steps noted.
    pub fn steps(&self) -> impl Iterator<Item = &ClockStep> {
        self.steps.iter()
    }

    /// What was noted: time and sentence.
    pub fn notes(&self) -> impl Iterator<Item = &(i64, String)> {
        self.notes.iter()
    }

    /// Auxiliary values: group and values.
    pub fn aux(&self) -> impl Iterator<Item = &(u64, Vec<Option<f64>>)> {
        self.aux.iter()
    }

    /// Cuts an event's copy at an index.
    pub fn cut(&mut self, end: u64) {
        self.slots
            .truncate(num::usize_of(end.saturating_sub(self.first)));
    }
}

/// The last frames as received.
#[derive(Clone, Debug)]
pub struct RawRing {
    frames: VecDeque<(u64, i64, Frame)>,
    keep_ns: i64,
    next: u64,
}

/// Most frames of the raw window, and of one event: three times what a full bus of 1 Mbit/s sends in 2 s, so that a
/// flood of a mapped identifier costs no memory without bound.
pub const MOST_RAW: usize = 60_000;

impl RawRing {
    /// A window of so many nanoseconds.
    #[must_use]
    pub fn new(keep_ns: i64) -> Self {
        Self {
            frames: VecDeque::new(),
            keep_ns,
            next: 0,
        }
    }

    /// Adds a frame; gives its number.
    pub fn push(&mut self, monotonic_ns: i64, frame: &Frame) -> u64 {
        let number = self.next;
        self.next += 1;
        self.frames.push_back((number, monotonic_ns, *frame));
        while self.frames.len() > MOST_RAW
            || self
                .frames
                .front()
                .is_some_and(|(_, time, _)| *time < monotonic_ns - self.keep_ns)
        {
            self.frames.pop_front();
        }
        number
    }

    /// Frames received between two times, both included, with numbers from `from` on.
    pub fn between(
        &self,
        from: u64,
        start_ns: i64,
        end_ns: i64,
    ) -> impl Iterator<Item = &(u64, i64, Frame)> {
        self.frames
            .iter()
            .filter(move |(number, time, _)| *number >= from && (start_ns..=end_ns).contains(time))
    }
}

/// A sample with its index, as the observer of a replay sees it.
pub type Observed<'a> = (u64, &'a Sample);

/// The group of ten samples a time lies in.
#[must_use]
pub fn aux_group(time_ns: i64) -> u64 {
    index_of(time_ns) / AUX_SPAN
}
