//! What a run is asked for: model, road, rest pose, confidence, window.

use crate::error::ReconstructError;
use crate::filter::Tuning;
use crate::findings::RestPose;
use crate::mechanize::{Earth, gravity};
use crate::refined;
use crate::road::RoadLimits;
use crate::smooth::Smoother;

/// The models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Model {
    /// Wheels alone [S03, 2.11-2.17].
    DeadReckoning,
    /// The nine states of S03 in vehicle axes [S03, 3.10], signs corrected.
    Published,
    /// Nine states in navigation axes with full coupling and considered biases.
    NineState,
    /// Nine states and the calibration beside them, smoothed: the default.
    Refined,
}

impl Model {
    /// Every model, the simplest first.
    pub const ALL: [Self; 4] = [
        Self::DeadReckoning,
        Self::Published,
        Self::NineState,
        Self::Refined,
    ];

    /// Name on the command line and in the outputs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DeadReckoning => "dead-reckoning",
            Self::Published => "published",
            Self::NineState => "nine-state",
            Self::Refined => "refined",
        }
    }
}

/// Which road limits apply.
#[derive(Clone, Debug, PartialEq)]
pub enum Road {
    /// Norwegian main road H1 [S03, table 2.2].
    H1,
    /// None.
    None,
    /// From a road file.
    File(RoadLimits),
}

impl Road {
    /// The limits; `None` for none.
    pub(super) fn limits(&self) -> Option<RoadLimits> {
        match self {
            Self::H1 => Some(RoadLimits::default()),
            Self::None => None,
            Self::File(limits) => Some(limits.clone()),
        }
    }
}

/// Options of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Model whose states are reported.
    pub model: Model,
    /// Road limits.
    pub road: Road,
    /// Rest pose measured at the scene.
    pub rest_pose: Option<RestPose>,
    /// Latitude where no rest pose is known, degrees: it gives gravity.
    pub latitude_deg: Option<f64>,
    /// Confidence of every bound, in (0, 1).
    pub confidence: f64,
    /// Start of the window, seconds from the trigger.
    pub from_s: Option<f64>,
    /// End of the window.
    pub to_s: Option<f64>,
    /// Length of the reaction window before the impact, s; 0 to 30.
    pub reaction_s: f64,
    /// Weights of the nine-state filter.
    pub tuning: Tuning,
    /// Spreads and gates of the refined model.
    pub refined: refined::Tuning,
    /// Smoother of the refined model.
    pub smoother: Smoother,
    /// Lay the path on the record's satellite fixes, if it has any (refined model).
    pub fixes: bool,
    /// Run no other model beside the one asked for: for sets of many crashes.
    pub alone: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            model: Model::Refined,
            road: Road::H1,
            rest_pose: None,
            latitude_deg: None,
            confidence: 0.95,
            from_s: None,
            to_s: None,
            reaction_s: 5.0,
            tuning: Tuning::default(),
            refined: refined::Tuning::default(),
            smoother: Smoother::default(),
            fixes: true,
            alone: false,
        }
    }
}

impl Options {
    /// The Earth as far as place and heading are known.
    pub(super) fn earth(&self) -> Earth {
        match (self.rest_pose, self.latitude_deg) {
            (Some(pose), _) => Earth::at(
                pose.latitude_deg.to_radians(),
                pose.heading_deg.to_radians(),
            ),
            (None, Some(latitude_deg)) => Earth {
                gravity: gravity(latitude_deg.to_radians()),
                ..Earth::flat()
            },
            (None, None) => Earth::flat(),
        }
    }

    pub(super) fn check(&self) -> Result<(), ReconstructError> {
        if !(self.confidence > 0.0 && self.confidence < 1.0) {
            return Err(ReconstructError::Option {
                option: "confidence",
                expected: "a number between 0 and 1",
                found: self.confidence.to_string(),
            });
        }
        if !(0.0..=30.0).contains(&self.reaction_s) {
            return Err(ReconstructError::Option {
                option: "reaction window",
                expected: "0 to 30 seconds",
                found: self.reaction_s.to_string(),
            });
        }
        if let Some(pose) = self.rest_pose
            && !(pose.latitude_deg.abs() <= 90.0
                && pose.longitude_deg.abs() <= 180.0
                && pose.heading_deg.is_finite()
                && pose.sd_m >= 0.0
                && pose.sd_deg >= 0.0)
        {
            return Err(ReconstructError::Option {
                option: "rest pose",
                expected: "latitude -90 to 90, longitude -180 to 180, a heading and no negative sd",
                found: format!(
                    "{},{},{}",
                    pose.latitude_deg, pose.longitude_deg, pose.heading_deg
                ),
            });
        }
        Ok(())
    }
}
