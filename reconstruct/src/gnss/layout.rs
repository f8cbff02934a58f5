//! How a log is laid out: delimiter, decimal sign, header. [S00, 6] lists columns and says nothing of this.

use std::fmt;

/// What stands between columns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Delimiter {
    /// A comma.
    #[default]
    Comma,
    /// A semicolon.
    Semicolon,
    /// A tab.
    Tab,
    /// Spaces and tabs in any number; an empty field is written [`EMPTY`].
    Spaces,
}

/// An empty field where columns are separated by spaces.
pub const EMPTY: &str = "-";

impl Delimiter {
    /// Those that are looked for, in this order.
    const ALL: [Self; 4] = [Self::Tab, Self::Semicolon, Self::Comma, Self::Spaces];

    /// What is written between columns.
    #[must_use]
    pub fn text(self) -> char {
        match self {
            Self::Comma => ',',
            Self::Semicolon => ';',
            Self::Tab => '\t',
            Self::Spaces => ' ',
        }
    }

    /// The fields of a line, trimmed; one delimiter behind the last of `columns` is let pass.
    pub(super) fn split(self, line: &str, columns: usize) -> Vec<&str> {
        if self == Self::Spaces {
            return line.split_whitespace().collect();
        }
        let mut cells: Vec<&str> = line.split(self.text()).map(str::trim).collect();
        if cells.len() == columns + 1 && cells.last() == Some(&"") {
            cells.pop();
        }
        cells
    }
}

impl fmt::Display for Delimiter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Comma => "comma",
            Self::Semicolon => "semicolon",
            Self::Tab => "tab",
            Self::Spaces => "spaces",
        })
    }
}

/// The sign before decimals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Decimal {
    /// A point.
    #[default]
    Point,
    /// A comma.
    Comma,
}

impl Decimal {
    /// The sign.
    #[must_use]
    pub fn text(self) -> char {
        match self {
            Self::Point => '.',
            Self::Comma => ',',
        }
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Point => "point",
            Self::Comma => "comma",
        })
    }
}

/// The layout of a log, as found or as to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Between columns.
    pub delimiter: Delimiter,
    /// Before decimals.
    pub decimal: Decimal,
    /// True with a line of column names before the data.
    pub header: bool,
}

impl Default for Layout {
    /// Comma, decimal point, header.
    fn default() -> Self {
        Self {
            delimiter: Delimiter::Comma,
            decimal: Decimal::Point,
            header: true,
        }
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let header = if self.header { "a" } else { "no" };
        write!(
            f,
            "columns separated by {}, decimal {}, {header} header",
            self.delimiter, self.decimal
        )
    }
}

/// The layout of lines that hold data, the first of which may be a header, for a format of `columns`.
pub(super) fn detect(lines: &[&str], columns: usize) -> Layout {
    let delimiter = delimiter(lines, columns);
    let header = lines
        .first()
        .is_some_and(|l| is_header(&delimiter.split(l, columns)));
    let data = lines.iter().skip(usize::from(header));
    let (mut points, mut commas) = (0_usize, 0_usize);
    if delimiter != Delimiter::Comma {
        for cell in data.flat_map(|l| delimiter.split(l, columns)) {
            // Times of day may have a sign of their own.
            if !cell.contains(':') && is_number(cell) {
                points += usize::from(cell.contains('.'));
                commas += usize::from(cell.contains(','));
            }
        }
    }
    let decimal = if commas > points {
        Decimal::Comma
    } else {
        Decimal::Point
    };
    Layout {
        delimiter,
        decimal,
        header,
    }
}

/// The delimiter that gives most lines the right number of columns; where none gives any, what comes nearest on
/// the first line among those it has, for the complaint that follows.
fn delimiter(lines: &[&str], columns: usize) -> Delimiter {
    let misses = |d: Delimiter| {
        let wrong = |l: &&&str| d.split(l, columns).len() != columns;
        lines.iter().filter(wrong).count()
    };
    let off = |d: Delimiter| {
        let cells = lines.first().map_or(0, |l| d.split(l, columns).len());
        (cells < 2, cells.abs_diff(columns))
    };
    // Of equals the first wins, as `min_by_key` has it.
    Delimiter::ALL
        .into_iter()
        .min_by_key(|&d| (misses(d), off(d)))
        .unwrap_or_default()
}

/// A header has letters, and numbers in fewer than half of its fields; a damaged line of data has more.
fn is_header(cells: &[&str]) -> bool {
    let filled = cells.iter().filter(|c| !c.is_empty()).count();
    let numbers = cells.iter().filter(|c| is_number(c)).count();
    let letters = cells.iter().any(|c| c.chars().any(char::is_alphabetic));
    letters && 2 * numbers < filled
}

fn is_number(cell: &str) -> bool {
    cell.contains(|c: char| c.is_ascii_digit()) && cell.replace(',', ".").parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::{Decimal, Delimiter, Layout, detect};

    fn found(lines: &[&str]) -> (Delimiter, Decimal, bool) {
        let Layout {
            delimiter,
            decimal,
            header,
        } = detect(lines, 4);
        (delimiter, decimal, header)
    }

    #[test]
    fn layouts_in_use() {
        use Decimal::{Comma as DecimalComma, Point};
        use Delimiter::{Comma, Semicolon, Spaces, Tab};
        for (lines, expected) in [
            (["1,2.5,3,4", "1,2,3,4"], (Comma, Point, false)),
            (["id, a b, c, d", "1, 2, 3, 4.5"], (Comma, Point, true)),
            (["1;2,5;3;4", "1;2;3;4"], (Semicolon, DecimalComma, false)),
            (["1;2.5;3;4,1", "1;2.5;3;4"], (Semicolon, Point, false)),
            (["a\tb\tc\td", "1\t\t3,5\t"], (Tab, DecimalComma, true)),
            (
                ["  1  2,5 3   4 ", "1 2,5 3,5 4"],
                (Spaces, DecimalComma, false),
            ),
            (["id (6 is x), b, c", "1 2 3 4.0"], (Spaces, Point, true)),
            (["1,2,3,4,", "1,2,3,,"], (Comma, Point, false)),
            (["x1,2,3,4", "1,2,3,4"], (Comma, Point, false)),
            (["1;2;3", "1;2;3"], (Semicolon, Point, false)),
            (["1;2;3;4;5;6;7;8;9", "1"], (Semicolon, Point, false)),
        ] {
            assert_eq!(found(&lines), expected, "{lines:?}");
        }
        assert_eq!(found(&[]), (Tab, Point, false));
    }

    #[test]
    fn told_to_a_person() {
        assert_eq!(
            Layout::default().to_string(),
            "columns separated by comma, decimal point, a header"
        );
    }
}
