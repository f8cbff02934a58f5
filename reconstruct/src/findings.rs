//! What the investigator asks: impact speed, delta-V, braking, distance, and what limits the answer.

use crate::anchor::laid::Anchored;
use crate::findings::agreement::Comparison;
use crate::findings::curve::{CurvePoint, Maximum};
use crate::findings::details::Details;
use crate::findings::pulse_times::PulseTimes;
use crate::map::place::Placing;
use crate::trajectory::State;

pub mod agreement;
pub(crate) mod change;
pub mod crash;
pub mod curve;
pub mod delta_v;
pub mod details;
pub mod extremes;
pub mod faults;
pub mod final_rest;
pub mod limits;
pub mod pulse_times;
pub mod reaction;
pub mod rollover;
pub mod uncertainty;

impl Figure {
    /// No number at all.
    pub const NONE: Self = Self {
        value: f64::NAN,
        sd: f64::NAN,
        low: f64::NAN,
        high: f64::NAN,
    };

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
    /// When the car last moved, seconds from the trigger; `None` if the record ends moving. The quiet interval may
    /// begin earlier, while the car still creeps.
    pub t_s: Option<f64>,
    /// Length of the quiet interval, s.
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
    /// Place of the IMU at the onset, north, m.
    pub north_m: Figure,
    /// East, m.
    pub east_m: Figure,
    /// Covariance of the two, m^2.
    pub cov_north_east_m2: f64,
    /// Delta-V of the pulse.
    pub delta_v: DeltaV,
}

/// Change of velocity over one pulse, at the centre of gravity if its place is known.
#[derive(Clone, Debug, PartialEq)]
pub struct DeltaV {
    /// Along body x at the onset, m/s (negative in a frontal crash).
    pub longitudinal_mps: Figure,
    /// Along body y at the onset, m/s.
    pub lateral_mps: Figure,
    /// Covariance of the two, (m/s)^2.
    pub cov_longitudinal_lateral: f64,
    /// Horizontal resultant, m/s.
    pub resultant_mps: Figure,
    /// Principal direction of force, degrees: 0 frontal, positive clockwise (from the right).
    pub pdof_deg: Figure,
    /// Over the ground, north, m/s.
    pub north_mps: Figure,
    /// Over the ground, east, m/s.
    pub east_mps: Figure,
    /// Covariance of the two, (m/s)^2.
    pub cov_north_east: f64,
    /// Direction over the ground into which the velocity changed, degrees clockwise from north.
    pub azimuth_deg: Figure,
    /// Yaw rate at the end of the pulse less that at its onset, degrees/s.
    pub yaw_rate_change_degps: Figure,
    /// Length of the pulse, s.
    pub duration_s: Figure,
    /// End of the pulse, seconds from the trigger.
    pub end_t_s: f64,
    /// True where sensors were clipped and nothing else tells: the true delta-V is at least this.
    pub lower_bound: bool,
    /// True where an accelerometer stood at its limit in the pulse.
    pub clipped: bool,
    /// `cg` if referred to the centre of gravity, `imu` if its place is not known.
    pub point: &'static str,
    /// Begin and end after each named rule.
    pub times: Vec<PulseTimes>,
    /// Cumulative delta-V at the record's samples; empty where the model gives none.
    pub curve: Vec<CurvePoint>,
    /// Maximum within 300 ms; `None` where the model gives none.
    pub maximum: Option<Maximum>,
}

impl DeltaV {
    /// Opens every bound that rests on the velocities.
    pub(crate) fn without_bounds(&mut self) {
        for figure in [
            &mut self.longitudinal_mps,
            &mut self.lateral_mps,
            &mut self.resultant_mps,
            &mut self.pdof_deg,
            &mut self.north_mps,
            &mut self.east_mps,
            &mut self.azimuth_deg,
        ] {
            *figure = Figure::new(figure.value, f64::INFINITY, 1.0);
        }
    }
}

impl Default for DeltaV {
    fn default() -> Self {
        let none = Figure::NONE;
        Self {
            longitudinal_mps: none,
            lateral_mps: none,
            cov_longitudinal_lateral: 0.0,
            resultant_mps: none,
            pdof_deg: none,
            north_mps: none,
            east_mps: none,
            cov_north_east: 0.0,
            azimuth_deg: none,
            yaw_rate_change_degps: none,
            duration_s: none,
            end_t_s: 0.0,
            lower_bound: false,
            clipped: false,
            point: "imu",
            times: Vec::new(),
            curve: Vec::new(),
            maximum: None,
        }
    }
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
    /// `dead-reckoning`, `published`, `nine-state`, `refined`.
    pub name: &'static str,
    /// North at the start of the window, m; `sd` infinite (bounds empty) where the model has no covariance.
    pub start_north_m: Figure,
    /// East at the start of the window, m.
    pub start_east_m: Figure,
    /// Covariance of the two, m^2.
    pub start_cov_north_east_m2: f64,
    /// Speed at the first impact; `None` where there was none.
    pub impact_speed_mps: Option<Figure>,
    /// The rest of its answer at the first impact; `None` where there was none.
    pub impact: Option<AtImpact>,
}

/// What one model says of the first impact beside its speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtImpact {
    /// North of the IMU at the onset, m.
    pub north_m: Figure,
    /// East, m.
    pub east_m: Figure,
    /// Covariance of the two, m^2.
    pub cov_north_east_m2: f64,
    /// Heading at the onset, degrees.
    pub heading_deg: Figure,
    /// Delta-V along body x at the onset, m/s.
    pub longitudinal_mps: Figure,
    /// Along body y, m/s.
    pub lateral_mps: Figure,
    /// Covariance of the two, (m/s)^2.
    pub cov_longitudinal_lateral: f64,
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
    /// Tests of their differences.
    pub comparisons: Vec<Comparison>,
    /// Everything beyond the main figures.
    pub details: Details,
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
    /// What became of satellite fixes, if the record has any and they were not left out.
    pub gnss: Option<Box<Anchored>>,
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
