//! Smoothers over the tape of a backward pass: every epoch from all data.
//!
//! The pass runs from rest to the beginning of the record, so its last epoch (the earliest) knows everything already; the
//! sweep back brings what was learnt late - calibration from the drive before the crash - to the crash itself.

pub mod arrow;
pub mod batch;
pub mod budget;
pub mod figures;
pub mod limits;
pub mod posterior;
pub mod problem;
pub mod relinear;
pub mod rts;
mod sample;

/// Which smoother runs behind the refined filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Smoother {
    /// Fixed-interval sweep.
    #[default]
    Rts,
    /// All epochs at once, linearised about the solution, with robust losses and limits.
    Batch,
    /// The filter's own answer.
    None,
}

impl Smoother {
    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rts => "rts",
            Self::Batch => "batch",
            Self::None => "none",
        }
    }
}
