//! Which part of the sheet matters: each group of figures is set to zero in turn, and the funnel told again.
//!
//! The shares need not add up to one: a filter that knows one sensor better also makes more of the others.

use super::expect::{Drive, state_at};
use super::sheet::DataSheet;
use super::{DesignError, Settings};
use crate::export::ellipse::of_state;
use crate::findings::Reconstruction;

/// A group of figures of a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Noise, bias, its shift and scale of the accelerometers.
    Accelerometer,
    /// The same of the gyros.
    Gyro,
    /// Vibration of the driving car.
    Vibration,
    /// How the box sits in the car: angles, and the places of box and centre of gravity.
    Mounting,
    /// Wheel speeds: tyre radius, latency, noise.
    Wheels,
}

impl Source {
    /// Every group.
    pub const ALL: [Self; 5] = [
        Self::Accelerometer,
        Self::Gyro,
        Self::Vibration,
        Self::Mounting,
        Self::Wheels,
    ];

    /// Name in the outputs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accelerometer => "accelerometer",
            Self::Gyro => "gyro",
            Self::Vibration => "vibration",
            Self::Mounting => "mounting",
            Self::Wheels => "wheels",
        }
    }

    fn silenced(self, sheet: &DataSheet) -> DataSheet {
        let mut sheet = sheet.clone();
        let (imu, wheels) = (&mut sheet.imu, &mut sheet.wheels);
        match self {
            Self::Accelerometer => {
                imu.accel_density = 0.0;
                imu.accel_bias = 0.0;
                imu.accel_bias_jump = 0.0;
                imu.accel_scale = 0.0;
            }
            Self::Gyro => {
                imu.rate_density = 0.0;
                imu.rate_bias = 0.0;
                imu.rate_bias_jump = 0.0;
                imu.rate_scale = 0.0;
            }
            Self::Vibration => {
                imu.accel_vibration = 0.0;
                imu.rate_vibration = 0.0;
            }
            Self::Mounting => {
                imu.mounting_sd = [0.0; 3];
                sheet.imu_place_sd = [0.0; 3];
                sheet.cg_place_sd = [0.0; 3];
            }
            Self::Wheels => {
                wheels.scale_sd = 0.0;
                wheels.scale_difference_sd = 0.0;
                wheels.latency_sd_s = 0.0;
                wheels.noise_mps = 0.0;
            }
        }
        sheet
    }
}

/// What a group costs: the share of the variance that goes when it is without error (negative: none goes).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The group.
    pub source: Source,
    /// Of the larger half axis of the position ellipse 30 s before (or at the first state).
    pub position: f64,
    /// Of the heading there.
    pub heading: f64,
    /// Of the speed at impact; `None`: no impact.
    pub impact_speed: Option<f64>,
    /// Of the resultant delta-V; `None`: no impact.
    pub delta_v: Option<f64>,
}

/// Below this share no group can be called the one that dominates.
pub const LEAST_SHARE: f64 = 0.1;

/// The group with the largest share of one quantity; `None`: no group has a share worth naming, what is left is
/// the method's own (side-slip, road, wheel slip).
#[must_use]
pub fn dominant(shares: &[Share], of: impl Fn(&Share) -> Option<f64>) -> Option<(Source, f64)> {
    shares
        .iter()
        .filter_map(|share| Some((share.source, of(share)?)))
        .filter(|(_, value)| *value >= LEAST_SHARE)
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Four variances of one result.
struct Variances {
    position: f64,
    heading: f64,
    impact_speed: Option<f64>,
    delta_v: Option<f64>,
}

fn variances(result: &Reconstruction, confidence: f64) -> Option<Variances> {
    let state = state_at(&result.states, super::TIMES_S[0]).or(result.states.first())?;
    let impact = result.impacts.first();
    Some(Variances {
        position: of_state(state, None, confidence).semi_major.powi(2),
        heading: state.sd_heading.powi(2),
        impact_speed: impact.map(|i| i.speed_mps.sd.powi(2)),
        delta_v: impact.map(|i| i.delta_v.resultant_mps.sd.powi(2)),
    })
}

/// The shares of every group.
pub(super) fn shares(
    drive: &Drive,
    sheet: &DataSheet,
    settings: &Settings,
    result: &Reconstruction,
) -> Result<Vec<Share>, DesignError> {
    let Some(all) = variances(result, settings.confidence) else {
        return Ok(Vec::new());
    };
    let mut shares = Vec::new();
    for source in Source::ALL {
        if source == Source::Wheels && !settings.wheels {
            continue;
        }
        let without = drive.reconstruct(&source.silenced(sheet), settings)?;
        let Some(left) = variances(&without, settings.confidence) else {
            continue;
        };
        let gone = |left: f64, all: f64| if all > 0.0 { 1.0 - left / all } else { 0.0 };
        let both = |left: Option<f64>, all: Option<f64>| Some(gone(left?, all?));
        shares.push(Share {
            source,
            position: gone(left.position, all.position),
            heading: gone(left.heading, all.heading),
            impact_speed: both(left.impact_speed, all.impact_speed),
            delta_v: both(left.delta_v, all.delta_v),
        });
    }
    Ok(shares)
}
