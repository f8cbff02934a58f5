//! What can go wrong with a raw log: where, what was expected, what was found.

/// An error of the raw logs.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GnssError {
    /// A file could not be read or written.
    #[error("{file}: {error}")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        error: std::io::Error,
    },
    /// No line of data.
    #[error("{file}: expected lines of {columns} columns, found no line of data")]
    Empty {
        /// The file.
        file: String,
        /// Columns of the format.
        columns: usize,
    },
    /// Lines, and not one to be used.
    #[error(
        "{file}: expected at least one usable line, found {unusable} unusable; the first: {first}"
    )]
    NoRows {
        /// The file.
        file: String,
        /// Lines that gave no row.
        unusable: u64,
        /// What was wrong with the first of them.
        first: String,
    },
    /// A line too long for any row of these formats.
    #[error("{file}: line {line}: expected at most {limit} bytes, found more")]
    LineLength {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Bytes allowed.
        limit: usize,
    },
    /// A line that is not text.
    #[error("{file}: line {line}: expected text in UTF-8, found other bytes")]
    Encoding {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
    },
    /// A line with too few or too many columns.
    #[error(
        "{file}: line {line}: expected {expected} columns separated by {delimiter}, found {found}"
    )]
    Columns {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Columns of the format.
        expected: usize,
        /// The delimiter in use.
        delimiter: super::layout::Delimiter,
        /// Columns in the line.
        found: usize,
    },
    /// A field that is not what its column holds.
    #[error("{file}: line {line}, column {column} ({name}): expected {expected}, found {found}")]
    Cell {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Number of the column, from 1.
        column: usize,
        /// Name of the column.
        name: &'static str,
        /// What belongs there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A value no car meets.
    #[error("{file}: line {line}, column {column} ({name}): expected {expected}, found {found}")]
    Range {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Number of the column, from 1.
        column: usize,
        /// Name of the column.
        name: &'static str,
        /// The range, with its unit.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// The last line stops half way.
    #[error(
        "{file}: line {line}: the file is cut off: expected {expected} columns and a line end, found {found}"
    )]
    CutOff {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Columns of the format.
        expected: usize,
        /// What the line holds.
        found: String,
    },
    /// A delimiter and a decimal sign that cannot be told apart.
    #[error("{file}: expected a delimiter other than the decimal sign, found a comma for both")]
    Layout {
        /// The file.
        file: String,
    },
    /// A row that the format cannot hold.
    #[error("{file}: row {row}, column {column} ({name}): expected {expected}, found {found}")]
    Value {
        /// The file.
        file: String,
        /// Row, from 1.
        row: usize,
        /// Number of the column, from 1.
        column: usize,
        /// Name of the column.
        name: &'static str,
        /// What the column takes.
        expected: String,
        /// What it got.
        found: String,
    },
}
