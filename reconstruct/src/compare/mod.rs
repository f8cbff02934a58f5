//! A reconstruction against the truth: how far off, how often inside its own bounds.
//!
//! 1. [`read`]: the two tables, with line and column in every complaint.
//! 2. [`time`]: both onto one time line: by UTC, by a stated epoch, or by matching the speed profiles.
//! 3. [`align`]: both into one frame: turned and shifted onto the fixes just before rest, where the truth has
//!    a frame of its own.
//! 4. [`score`]: errors, shares inside the ellipse of the same instant, normalised squared errors.
//! 5. [`show`]: the result for a person and for a machine.

pub mod align;
pub mod read;
pub mod score;
pub mod show;
pub mod time;

use align::{Align, Alignment};
use read::{Trajectory, Truth};
use score::Score;
use time::TimeBase;

/// What can go wrong in a comparison: where, what was expected, what was found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A file could not be read.
    #[error("{file}: {error}")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        error: std::io::Error,
    },
    /// A table is not as it should be.
    #[error("{file}: line {line}, column {column}: expected {expected}, found {found}")]
    Cell {
        /// The file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// What belongs there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// The table as a whole.
    #[error("{file}: expected {expected}, found {found}")]
    Table {
        /// The file.
        file: String,
        /// What belongs there.
        expected: String,
        /// What was found.
        found: String,
    },
    /// The two tables share no instant.
    #[error("time: expected the truth to overlap the trajectory, found {0}")]
    NoOverlap(String),
    /// The offset between the two clocks cannot be told from the speeds.
    #[error(
        "time: cannot tell the offset between the two clocks from the speeds ({0}); give --truth-epoch"
    )]
    Ambiguous(String),
    /// Too few fixes to lay one path on the other.
    #[error(
        "alignment: expected at least {needed} fixes {place}, found {found}; --align none or fit may serve"
    )]
    Fixes {
        /// Fixes needed.
        needed: usize,
        /// Fixes found.
        found: usize,
        /// Where they were looked for.
        place: &'static str,
    },
}

/// How to compare.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Unix time of the truth's `t_s` = 0, s; `None`: from the truth's own `unix_s`, else from the speeds.
    pub truth_epoch_s: Option<f64>,
    /// How to lay the path on the truth; `None`: as the truth's frame asks for.
    pub align: Option<Align>,
}

/// The whole result.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// How the two were brought onto one time line.
    pub time: TimeBase,
    /// How the path was laid on the truth; `None` where the truth has no position.
    pub alignment: Option<Alignment>,
    /// Errors and shares.
    pub score: Score,
}

/// Compares a trajectory with the truth.
///
/// # Errors
/// [`CompareError`] if the two share no time, the offset is ambiguous or the path cannot be aligned.
pub fn compare(
    trajectory: &Trajectory,
    truth: &Truth,
    options: &Options,
) -> Result<Comparison, CompareError> {
    let time = time::base(trajectory, truth, options.truth_epoch_s)?;
    let pairs = time::pairs(trajectory, truth, &time)?;
    let alignment = if pairs.iter().any(|p| p.truth.position.is_some()) {
        let how = options.align.unwrap_or(if truth.same_frame {
            Align::None
        } else {
            Align::Rest
        });
        Some(align::align(trajectory, &pairs, how)?)
    } else {
        None
    };
    let score = score::score(trajectory, truth, &pairs, alignment.as_ref());
    Ok(Comparison {
        time,
        alignment,
        score,
    })
}
