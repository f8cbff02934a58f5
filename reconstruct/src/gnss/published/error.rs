//! What can go wrong in the published filter: where, what was expected, what was found.

/// An error of the published filter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PublishedError {
    /// Too little of an input.
    #[error("{what}: expected at least {needed}, found {found}")]
    TooFew {
        /// Which input.
        what: &'static str,
        /// How many are needed.
        needed: usize,
        /// How many there are.
        found: usize,
    },
    /// A value that is not finite.
    #[error("{what} {index}: expected finite numbers, found one that is not")]
    NotFinite {
        /// Which input.
        what: &'static str,
        /// Index in it, from 0.
        index: usize,
    },
    /// Times that go back.
    #[error("{what} {index}: expected a time of at least {previous_s} s, found {found_s} s")]
    Order {
        /// Which input.
        what: &'static str,
        /// Index in it, from 0.
        index: usize,
        /// Time before it, s.
        previous_s: f64,
        /// Its time, s.
        found_s: f64,
    },
    /// No inertial sample at or after the first fix.
    #[error(
        "no inertial sample at or after the first fix, at {fix_s} s; the last is at {last_s} s"
    )]
    NoOverlap {
        /// Time of the first fix, s.
        fix_s: f64,
        /// Time of the last sample, s.
        last_s: f64,
    },
    /// Too few samples ahead of the first fix for the latency and the window of the stop detector.
    #[error("first fix: expected {needed} inertial samples ahead of it, found {found}")]
    Lead {
        /// Samples needed.
        needed: usize,
        /// Samples found.
        found: usize,
    },
    /// An option outside its range.
    #[error("{option}: expected {expected}, found {found}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// What it takes.
        expected: &'static str,
        /// What it got.
        found: String,
    },
    /// A matrix that couples what the chains keep apart, which only the dense filter carries.
    #[error("states {row} and {column}: expected no coupling but within an axis, found {found}")]
    Coupled {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// The element.
        found: f64,
    },
    /// A count of measurements the dense filter has no matrix for.
    #[error("measurement: expected 3, 5 or 8 to 15 rows of 15 states, found {found}")]
    Rows {
        /// Rows.
        found: usize,
    },
    /// An innovation covariance that is not positive definite.
    #[error("step {step}: innovation covariance expected positive definite")]
    Innovation {
        /// Step, from 0.
        step: usize,
    },
    /// A state that is not finite any more.
    #[error("step {step}: state expected finite, found one that is not")]
    Diverged {
        /// Step, from 0.
        step: usize,
    },
}
