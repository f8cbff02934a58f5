//! The svartboks reconstructor: a sealed record back into what happened, with its uncertainty.

pub mod export;
pub mod findings;
pub mod report;
pub mod simulate;
pub mod trajectory;
