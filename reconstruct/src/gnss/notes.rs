//! What is said of a log that can be read and is not as it should be: gaps, repeats, disorder, bad fixes.

use std::collections::HashMap;
use std::fmt;

use crate::gnss::rows::{Leg, Row};

/// Periods between two stamps that make a gap.
const GAP_PERIODS: f64 = 1.5;
/// Stamps have milliseconds; less than this is rounding.
const ROUNDING_S: f64 = 1e-6;

/// What was noticed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum NoteKind {
    /// Steps of the on-board clock of more than 1.5 periods within a leg.
    Gap {
        /// Median step of the leg with the longest gap, s.
        period_s: f64,
        /// Longest step, s.
        longest_s: f64,
    },
    /// Lines with the stamp of another line of the same leg; the rows are kept.
    Repeated,
    /// Lines with a stamp before one already read of the same leg; the rows are sorted.
    Unordered,
    /// Fixes with good flag 0; the rows are kept.
    BadFix,
    /// Fixes with good flag 0 and neither latitude nor longitude; there is no row.
    NoPosition,
    /// Lines of another equipment, drive or leg than the line before.
    LegChange,
    /// Lines that could not be read and were skipped.
    Broken {
        /// What was wrong with the first.
        first: String,
    },
    /// The last line has no line end; its last value may lack digits.
    Unended,
}

/// A thing noticed, how often, and where first.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// What.
    pub kind: NoteKind,
    /// How many lines.
    pub count: u64,
    /// The first line, from 1; of a gap the line behind it.
    pub first_line: u64,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match &self.kind {
            NoteKind::Gap { .. } => "gaps in the on-board stamps",
            NoteKind::Repeated => "repeated stamps",
            NoteKind::Unordered => "lines out of order",
            NoteKind::BadFix => "fixes marked bad",
            NoteKind::NoPosition => "fixes without a position",
            NoteKind::LegChange => "changes of equipment, drive or leg",
            NoteKind::Broken { .. } => "broken lines skipped",
            NoteKind::Unended => "last line without an end",
        };
        write!(
            f,
            "{what}: {}, first at line {}",
            self.count, self.first_line
        )?;
        match &self.kind {
            NoteKind::Gap {
                period_s,
                longest_s,
            } => write!(
                f,
                ", longest {longest_s:.3} s at a period of {period_s:.3} s"
            ),
            NoteKind::Broken { first } => write!(f, " ({first})"),
            _ => Ok(()),
        }
    }
}

/// Lines counted, and the first of them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Count {
    count: u64,
    first_line: u64,
}

impl Count {
    pub(super) fn add(&mut self, line: u64) {
        self.first_line = if self.count == 0 {
            line
        } else {
            self.first_line.min(line)
        };
        self.count += 1;
    }

    pub(super) fn count(self) -> u64 {
        self.count
    }

    /// The note, if there is anything to note.
    pub(super) fn note(self, kind: NoteKind) -> Option<Note> {
        (self.count > 0).then_some(Note {
            kind,
            count: self.count,
            first_line: self.first_line,
        })
    }
}

/// Sorts rows by leg, in the order the legs appear, and by stamp within each; rows of one stamp stay in the order
/// of the file. `lines` goes along. Returns what there was to note.
pub(super) fn order<T: Row>(rows: &mut Vec<T>, lines: &mut Vec<u64>) -> Vec<Note> {
    let mut legs: HashMap<Leg, (usize, f64)> = HashMap::new();
    let mut keys: Vec<(usize, f64)> = Vec::with_capacity(rows.len());
    let (mut unordered, mut changes) = (Count::default(), Count::default());
    let mut before: Option<Leg> = None;
    for (row, &line) in rows.iter().zip(&*lines) {
        let head = row.head();
        let next = legs.len();
        let (index, latest) = legs.entry(head.leg).or_insert((next, head.obu_s));
        if head.obu_s < *latest {
            unordered.add(line);
        }
        *latest = latest.max(head.obu_s);
        if before.is_some_and(|b| b != head.leg) {
            changes.add(line);
        }
        before = Some(head.leg);
        keys.push((*index, head.obu_s));
    }
    let later = |a: &(usize, f64), b: &(usize, f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
    if !keys.is_sorted_by(|a, b| later(a, b).is_le()) {
        let mut order: Vec<usize> = (0..keys.len()).collect();
        order.sort_by(|&a, &b| later(&keys[a], &keys[b]));
        *rows = order.iter().map(|&i| rows[i]).collect();
        *lines = order.iter().map(|&i| lines[i]).collect();
    }
    let mut notes = Vec::new();
    notes.extend(changes.note(NoteKind::LegChange));
    notes.extend(unordered.note(NoteKind::Unordered));
    notes.extend(steps(rows, lines));
    notes
}

/// Repeats and gaps of rows in order.
fn steps<T: Row>(rows: &[T], lines: &[u64]) -> Vec<Note> {
    let (mut repeated, mut gaps) = (Count::default(), Count::default());
    let (mut period_s, mut longest_s) = (0.0, 0.0);
    let mut start = 0;
    for leg in rows.chunk_by(|a, b| a.head().leg == b.head().leg) {
        let lines = &lines[start..start + leg.len()];
        start += leg.len();
        let steps: Vec<f64> = leg
            .windows(2)
            .map(|w| w[1].head().obu_s - w[0].head().obu_s)
            .collect();
        let Some(median) = median(steps.iter().copied().filter(|&s| s > 0.0).collect()) else {
            steps
                .iter()
                .zip(&lines[1..])
                .for_each(|(_, &line)| repeated.add(line));
            continue;
        };
        for (&step, &line) in steps.iter().zip(&lines[1..]) {
            if step > GAP_PERIODS * median + ROUNDING_S {
                gaps.add(line);
                if step > longest_s {
                    (period_s, longest_s) = (median, step);
                }
            } else if step <= 0.0 {
                repeated.add(line);
            }
        }
    }
    let gap = NoteKind::Gap {
        period_s,
        longest_s,
    };
    let notes = [repeated.note(NoteKind::Repeated), gaps.note(gap)];
    notes.into_iter().flatten().collect()
}

/// The middle value; of an even number the lower of the two.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len().checked_sub(1)? / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::{Note, NoteKind, median, order};
    use crate::gnss::rows::{Head, Leg, Row};

    #[derive(Clone, Copy)]
    struct Tick(Head);

    impl Row for Tick {
        fn head(&self) -> &Head {
            &self.0
        }
    }

    fn ticks(rows: &[(u32, f64)]) -> (Vec<f64>, Vec<Note>) {
        let tick = |&(equipment, obu_s)| {
            Tick(Head {
                leg: Leg {
                    equipment,
                    drive: 1,
                    leg: 1,
                },
                utc_ms: None,
                week: None,
                tow_s: None,
                obu_s,
            })
        };
        let mut rows: Vec<Tick> = rows.iter().map(tick).collect();
        let mut lines: Vec<u64> = (1..).take(rows.len()).collect();
        let notes = order(&mut rows, &mut lines);
        (rows.iter().map(|t| t.0.obu_s).collect(), notes)
    }

    fn note(kind: NoteKind, count: u64, first_line: u64) -> Note {
        Note {
            kind,
            count,
            first_line,
        }
    }

    #[test]
    fn even_stamps_are_not_noted() {
        let stamps: Vec<(u32, f64)> = (0..200).map(|k| (1, f64::from(k) * 0.02)).collect();
        assert!(ticks(&stamps).1.is_empty());
        assert!(ticks(&[]).1.is_empty() && ticks(&[(1, 5.0)]).1.is_empty());
        // One and a half periods to the millisecond are no gap yet.
        assert!(
            ticks(&[(1, 0.0), (1, 0.02), (1, 0.05), (1, 0.07)])
                .1
                .is_empty()
        );
    }

    #[test]
    fn gaps_repeats_and_disorder() {
        let (stamps, notes) = ticks(&[(1, 0.0), (1, 2.0), (1, 1.0), (1, 2.0), (1, 5.0), (1, 6.0)]);
        assert_eq!(stamps, [0.0, 1.0, 2.0, 2.0, 5.0, 6.0]);
        let gap = NoteKind::Gap {
            period_s: 1.0,
            longest_s: 3.0,
        };
        assert_eq!(
            notes,
            [
                note(NoteKind::Unordered, 1, 3),
                note(NoteKind::Repeated, 1, 4),
                note(gap, 1, 5)
            ]
        );
        let (_, notes) = ticks(&[(1, 3.0), (1, 3.0), (1, 3.0)]);
        assert_eq!(notes, [note(NoteKind::Repeated, 2, 2)]);
    }

    #[test]
    fn units_have_clocks_of_their_own() {
        let (stamps, notes) = ticks(&[
            (6, 100.0),
            (2, 0.0),
            (6, 101.0),
            (2, 0.5),
            (6, 102.0),
            (2, 1.0),
        ]);
        assert_eq!(stamps, [100.0, 101.0, 102.0, 0.0, 0.5, 1.0]);
        assert_eq!(notes, [note(NoteKind::LegChange, 5, 2)]);
    }

    #[test]
    fn medians() {
        assert_eq!(median(vec![]), None);
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.0));
    }

    #[test]
    fn told_to_a_person() {
        let gap = NoteKind::Gap {
            period_s: 0.02,
            longest_s: 1.2,
        };
        assert_eq!(
            note(gap, 3, 17).to_string(),
            "gaps in the on-board stamps: 3, first at line 17, longest 1.200 s at a period of 0.020 s"
        );
    }
}
