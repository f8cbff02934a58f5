//! What can go wrong in a reconstruction: where, what was expected, what was found.

use schema::SchemaError;

/// An error of the reconstruction.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReconstructError {
    /// The record could not be read.
    #[error(transparent)]
    Record(#[from] SchemaError),
    /// The record holds no samples to reconstruct from.
    #[error("record: expected at least {needed} samples with acceleration and rate, found {found}")]
    NoSamples {
        /// Samples needed.
        needed: usize,
        /// Samples found.
        found: usize,
    },
    /// The window asked for lies outside the record.
    #[error("window {from_s} to {to_s} s: the record spans {first_s} to {last_s} s")]
    Window {
        /// Start asked for, s.
        from_s: f64,
        /// End asked for, s.
        to_s: f64,
        /// First time in the record, s.
        first_s: f64,
        /// Last time in the record, s.
        last_s: f64,
    },
    /// An option is outside its range.
    #[error("{option}: expected {expected}, found {found}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// What it takes.
        expected: &'static str,
        /// What it got.
        found: String,
    },
    /// A road file could not be used.
    #[error("road file {file}: {what}")]
    Road {
        /// The file.
        file: String,
        /// What is wrong with it.
        what: String,
    },
    /// A map file could not be used.
    #[error("map {file}: {what}")]
    Map {
        /// The file.
        file: String,
        /// What is wrong with it.
        what: String,
    },
    /// An innovation variance that is not a positive number.
    #[error("sample {index}: innovation variance expected positive, found {found}")]
    Innovation {
        /// Index of the sample.
        index: u64,
        /// Its value.
        found: f64,
    },
    /// The arithmetic failed; it is reported, never patched.
    #[error("{place}: {what}")]
    Numeric {
        /// Where.
        place: &'static str,
        /// What happened.
        what: String,
    },
}
