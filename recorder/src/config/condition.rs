//! A condition on the value of a signal.

/// When a CAN signal triggers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Condition {
    /// The signal equals this value.
    Equals(f64),
    /// The signal is above this value.
    Above(f64),
}

impl Condition {
    /// True for a value that meets it.
    #[must_use]
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::Equals(wanted) => (value - wanted).abs() <= 1e-9 * wanted.abs().max(1.0),
            Self::Above(limit) => value > limit,
        }
    }
}
