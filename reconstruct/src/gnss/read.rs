//! Text to rows. Lines come one at a time, so a file of any size takes the memory of its rows and no more.

use std::io::BufRead;

use crate::gnss::error::GnssError;
use crate::gnss::fields::{Fields, Parse};
use crate::gnss::layout::{self, Layout};
use crate::gnss::lines::{LINE_BYTES, Line, LineFault, Lines};
use crate::gnss::notes::{self, Count, Note, NoteKind};
use crate::gnss::rows::{Fix, Leg, Motion, Row};

/// Lines of data that the layout is told from.
const SAMPLE: usize = 32;

/// What becomes of a line that cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tolerance {
    /// It is an error.
    #[default]
    Strict,
    /// It is skipped, counted and noted; an error only if no line is left.
    SkipBroken,
}

/// A log.
#[derive(Clone, Debug, PartialEq)]
pub struct Read<T> {
    /// Rows by leg, in the order the legs appear, and by on-board stamp within each.
    pub rows: Vec<T>,
    /// Line of each row, from 1.
    pub lines: Vec<u64>,
    /// The layout found.
    pub layout: Layout,
    /// What there is to say of the log.
    pub notes: Vec<Note>,
}

impl<T: Row> Read<T> {
    /// The rows of an equipment, a drive, a leg; `None` is any.
    #[must_use]
    pub fn select(&self, equipment: Option<u32>, drive: Option<u32>, leg: Option<u32>) -> Vec<T> {
        let numbered = self.numbered(equipment, drive, leg);
        numbered.into_iter().map(|(_, row)| row).collect()
    }

    /// As [`Self::select`], each row behind the number of its line, from 1.
    #[must_use]
    pub fn numbered(
        &self,
        equipment: Option<u32>,
        drive: Option<u32>,
        leg: Option<u32>,
    ) -> Vec<(u64, T)> {
        let wanted = |choice: Option<u32>, id: u32| choice.is_none_or(|c| c == id);
        let chosen = |(_, row): &(u64, T)| {
            let found = row.head().leg;
            wanted(equipment, found.equipment)
                && wanted(drive, found.drive)
                && wanted(leg, found.leg)
        };
        let rows = self.lines.iter().copied().zip(self.rows.iter().copied());
        rows.filter(chosen).collect()
    }

    /// The legs of the log with the number of their rows, in the order they appear.
    #[must_use]
    pub fn legs(&self) -> Vec<(Leg, usize)> {
        self.rows
            .chunk_by(|a, b| a.head().leg == b.head().leg)
            .filter_map(|rows| Some((rows.first()?.head().leg, rows.len())))
            .collect()
    }

    /// GPS time less UTC, s: the median over the rows that have both; of a sound log the leap seconds.
    #[must_use]
    pub fn gps_minus_utc_s(&self) -> Option<f64> {
        notes::median(
            self.rows
                .iter()
                .filter_map(|r| r.head().gps_minus_utc_s())
                .collect(),
        )
    }
}

/// Rows with the first of each stamp only, of rows in the order of [`Read::rows`].
#[must_use]
pub fn without_repeats<T: Row>(rows: &[T]) -> Vec<T> {
    rows.chunk_by(|a, b| a.head().leg == b.head().leg && a.head().obu_s >= b.head().obu_s)
        .filter_map(|same| same.first().copied())
        .collect()
}

/// Reads a log of fixes [S00, 6.1]; `name` stands in complaints.
///
/// # Errors
/// [`GnssError`] with line and column of the first thing that is not as it should be.
pub fn read_fixes<R: BufRead>(
    input: R,
    name: &str,
    tolerance: Tolerance,
) -> Result<Read<Fix>, GnssError> {
    read(input, name, tolerance)
}

/// Reads a log of accelerations and rates [S00, 6.2]; `name` stands in complaints.
///
/// # Errors
/// [`GnssError`] with line and column of the first thing that is not as it should be.
pub fn read_motions<R: BufRead>(
    input: R,
    name: &str,
    tolerance: Tolerance,
) -> Result<Read<Motion>, GnssError> {
    read(input, name, tolerance)
}

fn read<T: Parse, R: BufRead>(
    input: R,
    name: &str,
    tolerance: Tolerance,
) -> Result<Read<T>, GnssError> {
    let io = |error| GnssError::Io {
        file: name.to_owned(),
        error,
    };
    let mut lines = Lines::new(input);
    let mut sample: Vec<Line> = Vec::new();
    while sample.len() < SAMPLE
        && let Some(line) = lines.next_line().map_err(io)?
    {
        if !line.is_idle() {
            sample.push(line);
        }
    }
    let texts: Vec<&str> = sample
        .iter()
        .filter_map(|l| l.text.as_deref().ok())
        .collect();
    let mut layout = layout::detect(&texts, T::COLUMNS.len());
    // A first line that is no text is no header either, and nor is what follows it.
    layout.header &= sample.first().is_some_and(|l| l.text.is_ok());
    let mut log = Log {
        name,
        layout,
        tolerance,
        rows: Vec::new(),
        lines: Vec::new(),
        tally: Tally::default(),
    };
    for line in sample.iter().skip(usize::from(layout.header)) {
        log.take(line)?;
    }
    while let Some(line) = lines.next_line().map_err(io)? {
        if !line.is_idle() {
            log.take(&line)?;
        }
    }
    log.finish()
}

#[derive(Default)]
struct Tally {
    bad: Count,
    no_position: Count,
    broken: Count,
    unended: Count,
    /// What was wrong with the first line that gave no row.
    first: Option<String>,
}

struct Log<'a, T> {
    name: &'a str,
    layout: Layout,
    tolerance: Tolerance,
    rows: Vec<T>,
    lines: Vec<u64>,
    tally: Tally,
}

impl<T: Parse> Log<'_, T> {
    fn take(&mut self, line: &Line) -> Result<(), GnssError> {
        match self.row(line) {
            Ok(row) => {
                if !line.ended {
                    self.tally.unended.add(line.number);
                }
                let Some(row) = row else {
                    self.tally.no_position.add(line.number);
                    return Ok(());
                };
                if row.is_bad() {
                    self.tally.bad.add(line.number);
                }
                self.rows.push(row);
                self.lines.push(line.number);
                Ok(())
            }
            Err(error) if self.tolerance == Tolerance::Strict => Err(error),
            Err(error) => {
                self.tally.broken.add(line.number);
                self.tally.first.get_or_insert_with(|| error.to_string());
                Ok(())
            }
        }
    }

    /// The row of a line.
    fn row(&self, line: &Line) -> Result<Option<T>, GnssError> {
        let (file, number) = (|| self.name.to_owned(), line.number);
        let text = match &line.text {
            Ok(text) => text,
            Err(LineFault::TooLong) => {
                return Err(GnssError::LineLength {
                    file: file(),
                    line: number,
                    limit: LINE_BYTES,
                });
            }
            Err(LineFault::NotText) => {
                return Err(GnssError::Encoding {
                    file: file(),
                    line: number,
                });
            }
        };
        let expected = T::COLUMNS.len();
        let cells = self.layout.delimiter.split(text, expected);
        let cut_off = |found: String| GnssError::CutOff {
            file: file(),
            line: number,
            expected,
            found,
        };
        if cells.len() < expected && !line.ended {
            return Err(cut_off(format!("{} columns", cells.len())));
        }
        if cells.len() != expected {
            return Err(GnssError::Columns {
                file: file(),
                line: number,
                expected,
                delimiter: self.layout.delimiter,
                found: cells.len(),
            });
        }
        let row = T::parse(&Fields {
            file: self.name,
            line: number,
            cells: &cells,
            layout: self.layout,
            columns: T::COLUMNS,
        });
        match row {
            Err(GnssError::Cell { column, found, .. }) if column == expected && !line.ended => {
                Err(cut_off(format!("{found} in the last column")))
            }
            row => row,
        }
    }

    fn finish(mut self) -> Result<Read<T>, GnssError> {
        let Tally {
            bad,
            no_position,
            broken,
            unended,
            first,
        } = self.tally;
        if self.rows.is_empty() {
            let file = self.name.to_owned();
            let unusable = broken.count() + no_position.count();
            return Err(if unusable == 0 {
                GnssError::Empty {
                    file,
                    columns: T::COLUMNS.len(),
                }
            } else {
                let first = first.unwrap_or_else(|| "a fix without a position".to_owned());
                GnssError::NoRows {
                    file,
                    unusable,
                    first,
                }
            });
        }
        let mut notes = notes::order(&mut self.rows, &mut self.lines);
        let first = first.unwrap_or_default();
        notes.extend(bad.note(NoteKind::BadFix));
        notes.extend(no_position.note(NoteKind::NoPosition));
        notes.extend(broken.note(NoteKind::Broken { first }));
        notes.extend(unended.note(NoteKind::Unended));
        Ok(Read {
            rows: self.rows,
            lines: self.lines,
            layout: self.layout,
            notes,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Read, Tolerance, read_motions, without_repeats};
    use crate::gnss::rows::Motion;

    fn motions(text: &str) -> Read<Motion> {
        read_motions(text.as_bytes(), "imu.txt", Tolerance::Strict).unwrap()
    }

    #[test]
    fn a_sample_in_si() {
        let log =
            motions("6 1 2 2013-08-26 10:00:00,500 1755 122416,5 17,02 -3,9 0 1000 -180000 0 90\n");
        let row = log.rows[0];
        assert_eq!(row.head.utc_ms, Some(1_377_511_200_500));
        assert_eq!(
            (row.head.week, row.head.tow_s),
            (Some(1755), Some(122_416.5))
        );
        assert!(
            (row.accel[2] - 9.806_65).abs() < 1e-12 && (row.accel[0] + 0.038_245_935).abs() < 1e-12
        );
        assert!((row.rate[0] + std::f64::consts::PI).abs() < 1e-12);
        assert!((row.rate[2] - 0.09_f64.to_radians()).abs() < 1e-15);
        assert!((log.gps_minus_utc_s().unwrap() - 16.0).abs() < 1e-9);
        assert!(log.notes.is_empty());
    }

    #[test]
    fn legs_are_listed_and_chosen() {
        let line = |equipment: u32, leg: u32, obu: u32| {
            format!("{equipment},1,{leg},,,,,{obu},0,0,1000,0,0,0\n")
        };
        let log = motions(
            &[
                line(6, 1, 5),
                line(2, 1, 0),
                line(2, 2, 9),
                line(2, 1, 0),
                line(2, 1, 1),
            ]
            .concat(),
        );
        let legs: Vec<_> = log
            .legs()
            .iter()
            .map(|(l, n)| (l.equipment, l.leg, *n))
            .collect();
        assert_eq!(legs, [(6, 1, 1), (2, 1, 3), (2, 2, 1)]);
        assert_eq!(log.select(Some(2), None, None).len(), 4);
        assert_eq!(log.select(None, Some(1), Some(2)).len(), 1);
        assert!(log.select(None, Some(7), None).is_empty());
        assert_eq!(
            without_repeats(&log.select(Some(2), None, Some(1))).len(),
            2
        );
        assert_eq!(without_repeats(&log.rows).len(), 4);
        assert!(log.gps_minus_utc_s().is_none());
    }
}
