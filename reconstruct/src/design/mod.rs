//! The design study [S03, 3.4.1]: how narrow will the funnel of a given sensor be, before anything is recorded?
//!
//! S03 observes that the analysis of errors needs no measurements, only the sensors' data sheet: the covariance
//! of the filter answers. So here a [`Plan`] is driven by the simulator without any error of a sensor, the record
//! it would give carries the [`DataSheet`] asked about, and [`crate::run::from_epochs`] reconstructs it like any
//! other: its covariance is the expected funnel. In the order of the flow:
//!
//! 1. [`manoeuvre`]: what is driven. [`sheet`], [`grades`]: what it is measured with.
//! 2. [`expect`]: one sheet on one manoeuvre: the expected funnel and figures, and what the method itself leaves.
//! 3. [`source`]: which group of figures matters: each is set to zero in turn.
//! 4. [`trial`]: is the prediction honest? Sensors drawn from the same sheet, many times, against the truth.
//! 5. [`slips`]: the figures of S03's own error analysis, computed again.
//! 6. [`json`], [`table`], [`picture`], [`page`]: what a person and a program get.

mod chart;
mod clips;
pub mod expect;
mod file;
pub mod grades;
pub mod json;
pub mod manoeuvre;
mod manoeuvre_file;
pub mod page;
mod page_tables;
mod parallel;
pub mod picture;
pub mod sheet;
pub mod slips;
pub mod source;
pub mod table;
pub mod trial;

pub use expect::{Expected, Row, Study};
pub use manoeuvre::Plan;
pub use sheet::DataSheet;

use crate::error::ReconstructError;
use crate::run::{Model, Road};
use crate::simulate::SimulateError;

/// Seconds before the impact (or the rest, where there is none) that are tabulated.
pub const TIMES_S: [f64; 5] = [-30.0, -10.0, -5.0, -1.0, 0.0];

/// Why a study failed.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// A manoeuvre or data sheet file.
    #[error("{file}: {what}")]
    File {
        /// The file.
        file: String,
        /// What is wrong with it.
        what: String,
    },
    /// No such grade.
    #[error(
        "grade: no grade `{0}`, expected navigation, tactical, industrial, consumer or automotive"
    )]
    UnknownGrade(String),
    /// The manoeuvre.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The reconstruction.
    #[error(transparent)]
    Reconstruct(#[from] ReconstructError),
}

impl DesignError {
    /// Exit code of the program: 2 where an argument names nothing known or cannot be, else 1.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::UnknownGrade(_)
            | Self::Simulate(SimulateError::UnknownClass(_))
            | Self::Reconstruct(ReconstructError::Option { .. }) => 2,
            _ => 1,
        }
    }
}

/// How the record of a study is reconstructed.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Model whose covariance is read.
    pub model: Model,
    /// Road limits.
    pub road: Road,
    /// The car's wheel speeds are recorded.
    pub wheels: bool,
    /// Confidence of every bound, in (0, 1).
    pub confidence: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            model: Model::Refined,
            road: Road::H1,
            wheels: true,
            confidence: 0.95,
        }
    }
}
