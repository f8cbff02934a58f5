//! Which records are never removed: those of a crash with a delta-V above 25 km/h; and which go first ([`weakness`]).
//!
//! The figure is the resultant of the horizontal change of speed over the 150 ms (UN R160) or the 300 ms (49 CFR
//! 563.5, "maximum delta-V") in which it is largest, from the record's own samples, with gravity, slope and bias taken
//! out as trigger 2 does ([`crate::level`]). Where an accelerometer stood at its limit in that time the figure is a
//! lower bound, by as much as one half; the limit is then half as high. It follows from the record alone.

use schema::Record;
use schema::ledger::{Flags, Weak};
use schema::parts::TriggerKind;
use schema::units::MetersPerSecond;

use crate::bins::BIN;
use crate::level::Level;

/// A record with more than this is never removed, m/s.
pub const LOCK_ABOVE: f64 = 25.0 / 3.6;
/// Windows in samples of 10 ms.
const WINDOWS: [usize; 2] = [15, 30];
/// Duration of a sample, s.
const STEP: f64 = BIN * 1e-9;

/// The largest change of speed in the record, and whether an accelerometer stood at its limit meanwhile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Severity {
    /// Resultant, horizontal.
    pub delta_v: MetersPerSecond,
    /// It is a lower bound.
    pub clipped: bool,
}

impl Severity {
    /// Finds it in the record's samples.
    #[must_use]
    pub fn of(record: &Record) -> Self {
        let (first, changes) = changes(record);
        let mut clipped = vec![false; changes.len()];
        for clip in record.clipping.iter().filter(|clip| clip.axis < 2) {
            let place = clip.index.checked_sub(first).map(schema::num::usize_of);
            if let Some(place) = place.and_then(|place| clipped.get_mut(place)) {
                *place = true;
            }
        }
        let mut largest = Self {
            delta_v: MetersPerSecond(0.0),
            clipped: false,
        };
        for window in WINDOWS {
            let mut sum = [0.0_f64; 2];
            let mut limits = 0_usize;
            for (end, change) in changes.iter().enumerate() {
                let old = end.checked_sub(window);
                let gone = old.and_then(|old| changes.get(old)).unwrap_or(&[0.0; 2]);
                sum = [sum[0] + change[0] - gone[0], sum[1] + change[1] - gone[1]];
                let at_limit = |place: Option<usize>| {
                    let there = place.and_then(|place| clipped.get(place));
                    usize::from(there.copied().unwrap_or(false))
                };
                limits = limits + at_limit(Some(end)) - at_limit(old);
                let found = Self {
                    delta_v: MetersPerSecond(sum[0].hypot(sum[1])),
                    clipped: limits > 0,
                };
                if found.reach() > largest.reach() {
                    largest = found;
                }
            }
        }
        largest
    }

    /// Whether such a record is never removed.
    #[must_use]
    pub fn locks(&self) -> bool {
        self.reach() > LOCK_ABOVE
    }

    /// What it may have been at most.
    fn reach(&self) -> f64 {
        let factor = if self.clipped { 2.0 } else { 1.0 };
        self.delta_v.0 * factor
    }
}

/// Whether a record gives way to those of crashes: it has triggers, and all are by hand or by a loss of power. It
/// follows from the record alone.
#[must_use]
pub fn weakness(record: &Record) -> Weak {
    let only = |kinds: &[TriggerKind]| {
        let mut triggers = record.triggers.iter();
        !record.triggers.is_empty() && triggers.all(|trigger| kinds.contains(&trigger.kind))
    };
    if only(&[TriggerKind::PowerLoss]) {
        Weak::PowerLoss
    } else if only(&[TriggerKind::PowerLoss, TriggerKind::Manual]) {
        Weak::Yes
    } else {
        Weak::No
    }
}

/// What the ledger is to say of a record.
pub(super) fn flags(record: &Record, encrypted: bool, adopted: bool) -> Flags {
    Flags {
        locked: Severity::of(record).locks(),
        encrypted,
        adopted,
        weak: weakness(record),
    }
}

/// Change of speed in each 10 ms along x and y, m/s, and the index of the first. What is missing changes nothing.
fn changes(record: &Record) -> (u64, Vec<[f64; 2]>) {
    let mut changes = Vec::new();
    let mut level = Level::default();
    for sample in record.samples() {
        let gap = schema::num::usize_of(sample.gap_before.min(100_000));
        changes.resize(changes.len() + gap, [0.0; 2]);
        for _ in 0..sample.span {
            let free;
            (level, free) = level.step(&sample.sample);
            changes.push(free.map(|free| free.unwrap_or(0.0) * STEP));
        }
    }
    (record.first_index(), changes)
}
