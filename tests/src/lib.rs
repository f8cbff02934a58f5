//! Support for the tests that cross the crates: recordings, logs that can be changed, the way from a log to a
//! reconstruction, and scores against the truth.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::missing_panics_doc,
    clippy::must_use_candidate,
    reason = "support of tests: what fails here fails the test"
)]

pub mod crash;
pub mod drive;
pub mod graded;
pub mod log;
pub mod nuisance;
pub mod pipeline;
pub mod recordings;
pub mod serial;
pub mod statistics;
pub mod trigger_report;
