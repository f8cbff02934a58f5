//! What the investigator asks: impact speed, delta-V, braking, distance, and what limits the answer.

use crate::map::place::Placing;
use crate::trajectory::State;

pub mod crash;
pub mod limits;

impl Figure {
    /// A value with its sigma and the bounds `quantile` sigmas away.
    #[must_use]
    pub fn new(value: f64, sd: f64, quantile: f64) -> Self {
        Self {
            value,
            sd,
            low: value - quantile * sd,
            high: value + quantile * sd,
        }
    }

    /// The same, for a quantity that cannot be negative.
    #[must_use]
    pub fn non_negative(value: f64, sd: f64, quantile: f64) -> Self {
        let figure = Self::new(value, sd, quantile);
        Self {
            low: figure.low.max(0.0),
            ..figure
        }
    }
}

/// A number with its uncertainty: nothing is printed without it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Best estimate.
    pub value: f64,
    /// One sigma.
    pub sd: f64,
    /// Lower bound at the confidence of the run.
    pub low: f64,
    /// Upper bound at the confidence of the run.
    pub high: f64,
}

/// The rest the backward pass starts from.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// True if the record ends at rest.
    pub found: bool,
    /// Start of the final rest, seconds from the trigger; `None` if there is none.
    pub t_s: Option<f64>,
    /// Length of the rest interval, s.
    pub duration_s: f64,
    /// Why it is or is not believed, one sentence.
    pub reason: String,
}

/// One impact: the onset of a pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Impact {
    /// Onset of the pulse, seconds from the trigger.
    pub t_s: Figure,
    /// Forward speed at the onset, m/s.
    pub speed_mps: Figure,
    /// Heading at the onset, degrees.
    pub heading_deg: Figure,
    /// Delta-V of the pulse.
    pub delta_v: DeltaV,
}

/// Change of velocity over one pulse, at the centre of gravity if its place is known, in body axes at the onset.
#[derive(Clone, Debug, PartialEq)]
pub struct DeltaV {
    /// Along body x, m/s (negative in a frontal crash).
    pub longitudinal_mps: Figure,
    /// Along body y, m/s.
    pub lateral_mps: Figure,
    /// Horizontal resultant, m/s.
    pub resultant_mps: Figure,
    /// Principal direction of force, degrees: 0 frontal, positive clockwise (from the right).
    pub pdof_deg: Figure,
    /// Length of the pulse, s.
    pub duration_s: Figure,
    /// End of the pulse, seconds from the trigger.
    pub end_t_s: f64,
    /// True where sensors were clipped: the true delta-V is at least this.
    pub lower_bound: bool,
    /// `cg` if referred to the centre of gravity, `imu` if its place is not known.
    pub point: &'static str,
}

/// Braking before the impact (or before the final stop where there was no impact).
#[derive(Clone, Debug, PartialEq)]
pub struct Braking {
    /// Onset, seconds from the trigger.
    pub onset_t_s: Figure,
    /// Mean deceleration, m/s^2, positive.
    pub mean_mps2: Figure,
    /// Largest deceleration (100 ms mean), m/s^2, positive.
    pub peak_mps2: Figure,
}

/// The answer of one model, for the comparison side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelAnswer {
    /// `dead-reckoning`, `published`, `nine-state`.
    pub name: &'static str,
    /// North at the start of the window, m; `sd` infinite (bounds empty) where the model has no covariance.
    pub start_north_m: Figure,
    /// East at the start of the window, m.
    pub start_east_m: Figure,
    /// Speed at the first impact; `None` where there was none.
    pub impact_speed_mps: Option<Figure>,
}

/// How often a road limit bit.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct RoadUse {
    /// Samples to which the limits applied (outside the hold-off).
    pub samples: u64,
    /// Samples whose reported roll was truncated.
    pub roll: u64,
    /// Samples whose reported pitch was truncated.
    pub pitch: u64,
    /// Samples whose reported vertical speed was truncated.
    pub vertical: u64,
}

/// Use of the wheels.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct WheelUse {
    /// Wheel values in the window (left and right).
    pub offered: u64,
    /// Believed.
    pub used: u64,
    /// Refused on physics (braking, spin, pulse, airborne).
    pub refused_physics: u64,
    /// Refused on their innovation.
    pub refused_innovation: u64,
    /// At or below the cut-off: one-sided information only.
    pub below_cutoff: u64,
}

/// The whole result of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Model of the states below.
    pub model: &'static str,
    /// Confidence of every `low`, `high` and of the funnel (0.95).
    pub confidence: f64,
    /// States in recording order, first to last of the window.
    pub states: Vec<State>,
    /// The rest.
    pub rest: Rest,
    /// Impacts in order of time; empty where there was none.
    pub impacts: Vec<Impact>,
    /// Braking before the first impact (or the final stop); `None` where none was found.
    pub braking: Option<Braking>,
    /// Distance driven over the window, m.
    pub distance_m: Figure,
    /// Forward speed at the start of the window, m/s.
    pub start_speed_mps: Figure,
    /// Largest forward speed in the window, m/s, and when.
    pub top_speed_mps: Figure,
    /// Time of the largest speed, seconds from the trigger.
    pub top_speed_t_s: f64,
    /// Answers side by side.
    pub models: Vec<ModelAnswer>,
    /// Road limits.
    pub road: RoadUse,
    /// Wheels.
    pub wheels: WheelUse,
    /// Samples of the window missing at least one of the six IMU fields, and clipped samples.
    pub missing_samples: u64,
    /// Clipped samples.
    pub clipped_samples: u64,
    /// Rest pose if one was given: latitude, longitude, heading (degrees), sd (m, deg).
    pub rest_pose: Option<RestPose>,
    /// What became of laying the path on a map, if that was asked for.
    pub map: Option<Box<Placing>>,
    /// What this result cannot tell: sentences, the weightiest first.
    pub limits: Vec<String>,
    /// True if the result has gaps (exit code 3).
    pub gaps: bool,
}

/// Rest pose measured at the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestPose {
    /// Latitude, degrees, north positive (WGS 84).
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// Heading of the car's forward axis at rest, degrees clockwise from north.
    pub heading_deg: f64,
    /// One sigma of the position, m per axis.
    pub sd_m: f64,
    /// One sigma of the heading, degrees.
    pub sd_deg: f64,
}
