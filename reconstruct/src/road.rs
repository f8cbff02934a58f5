//! Road geometry as bounded knowledge [S03, 2.4 and 3.3.3].
//!
//! In the filter the limits act as a stationary Gauss-Markov prior on the road's angles, one independent fact
//! every correlation length; truncating the Gaussian at every sample would count one fact thousands of times.
//! The hard limits truncate what is *reported* and nothing else.

use std::path::Path;

use serde::Deserialize;

use crate::error::ReconstructError;

/// The limits of a road.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RoadLimits {
    /// Largest bank, degrees.
    pub roll_deg: f64,
    /// Mean bank, degrees: the crown, positive (right side down) where traffic keeps right.
    pub roll_mean_deg: f64,
    /// One sigma of that mean, degrees.
    pub roll_mean_sd_deg: f64,
    /// Steepest grade, degrees.
    pub pitch_deg: f64,
    /// Distance over which bank and grade stay what they are, m; at least 100.
    pub correlation_m: f64,
    /// The limits do not hold later than this before the first impact, s.
    pub hold_off_s: f64,
}

impl Default for RoadLimits {
    /// Norwegian main road H1 [S03, table 2.2].
    fn default() -> Self {
        Self {
            roll_deg: 4.6,
            roll_mean_deg: 1.7,
            roll_mean_sd_deg: 1.7,
            pitch_deg: 5.7,
            correlation_m: 100.0,
            hold_off_s: 4.0,
        }
    }
}

impl RoadLimits {
    /// Reads a road file (JSON with the fields of this type, all optional).
    ///
    /// # Errors
    /// [`ReconstructError::Road`] if it cannot be read or a value is out of range.
    pub fn load(path: &Path) -> Result<Self, ReconstructError> {
        let fail = |what: String| ReconstructError::Road {
            file: path.display().to_string(),
            what,
        };
        let text = std::fs::read_to_string(path).map_err(|e| fail(e.to_string()))?;
        let limits: Self = serde_json::from_str(&text).map_err(|e| fail(e.to_string()))?;
        for (name, value, low, high) in [
            ("roll_deg", limits.roll_deg, 0.1, 45.0),
            (
                "roll_mean_deg",
                limits.roll_mean_deg,
                -limits.roll_deg,
                limits.roll_deg,
            ),
            ("roll_mean_sd_deg", limits.roll_mean_sd_deg, 0.0, 45.0),
            ("pitch_deg", limits.pitch_deg, 0.1, 45.0),
            ("correlation_m", limits.correlation_m, 100.0, 1e5),
            ("hold_off_s", limits.hold_off_s, 0.0, 120.0),
        ] {
            if !(low..=high).contains(&value) {
                return Err(fail(format!(
                    "{name}: expected {low} to {high}, found {value}"
                )));
            }
        }
        Ok(limits)
    }
}
