//! The slips.

/// One slip of the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slip {
    /// Where in S00.
    pub place: &'static str,
    /// What it says there.
    pub says: &'static str,
    /// What is right.
    pub right: &'static str,
    /// What is done by default.
    pub ours: &'static str,
    /// What changes it.
    pub switch: &'static str,
}

/// The slips.
pub const SLIPS: [Slip; 0] = [];
