//! The second seed: satellite fixes and inertial sensors of a box behind the windscreen [S00].

pub mod drive;
pub mod forward;
pub mod sheet;
pub mod smooth;
pub mod stop;

/// Why a drive could not be reckoned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GnssError {
    /// The drive does not hold what is needed.
    #[error("drive: {what}")]
    Drive {
        /// Expected and found.
        what: String,
    },
    /// The arithmetic failed.
    #[error("filter at {t_s} s: {what}")]
    Numeric {
        /// s of the box's clock.
        t_s: f64,
        /// Expected and found.
        what: String,
    },
}
