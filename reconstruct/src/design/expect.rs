//! What one data sheet gives on one manoeuvre: the expected funnel.

use nalgebra::{Matrix2, Vector2};
use schema::num::{real, round_usize};
use schema::parts::{Clip, Completion};
use schema::{Sample, num};

use super::clips::clips;
use super::manoeuvre::Plan;
use super::parallel;
use super::sheet::DataSheet;
use super::source::{self, Share};
use super::{DesignError, Settings, TIMES_S};
use crate::epochs::Epochs;
use crate::export::ellipse::{Ellipse, of_state};
use crate::findings::Reconstruction;
use crate::run::{Facts, Model, Options, Road, from_epochs};
use crate::simulate::{Errors, Scenario, Simulated, Truth, TruthRow, simulate};
use crate::trajectory::State;

/// Rate of the IMU frames in a study, Hz: fast enough that clipping is the sensor's and not the frame's.
const IMU_HZ: usize = 1000;
/// Record before the impact, s.
const BEFORE_S: f64 = 30.0;
/// A state farther than this from a tabulated time does not stand for it, s.
const NEAR_S: f64 = 0.011;

/// The expected uncertainty at one instant, and what the method leaves without any sensor error.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Seconds from the impact, or from the begin of the rest.
    pub t_s: f64,
    /// Position ellipse of the study's confidence about the place at rest.
    pub ellipse: Ellipse,
    /// One sigma along and across the direction of travel, m.
    pub sd_along_m: f64,
    /// Across, m.
    pub sd_across_m: f64,
    /// One sigma of the forward speed, m/s.
    pub sd_speed_mps: f64,
    /// One sigma of the heading, rad.
    pub sd_heading_rad: f64,
    /// Distance from the truth with faultless sensors, m: slip, clipping and road are not the sensor's errors.
    pub off_m: f64,
    /// Forward speed less the truth with faultless sensors, m/s.
    pub off_speed_mps: f64,
    /// The truth lies in the ellipse.
    pub inside: bool,
}

/// Expected bounds of the findings, one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// Forward speed at the onset, m/s.
    pub speed_mps: f64,
    /// Its sigma, m/s.
    pub sd_speed_mps: f64,
    /// Resultant delta-V at the centre of gravity, m/s.
    pub delta_v_mps: f64,
    /// Its sigma, m/s.
    pub sd_delta_v_mps: f64,
    /// Sigma of the principal direction of force, degrees.
    pub sd_pdof_deg: f64,
    /// A sensor stood at its limit: delta-V is a lower bound.
    pub lower_bound: bool,
    /// Speed less the truth with faultless sensors, m/s.
    pub off_speed_mps: f64,
    /// Delta-V less the truth with faultless sensors, m/s: where the pulse begins and ends is the method's doubt.
    pub off_delta_v_mps: f64,
}

/// What one data sheet gives.
#[derive(Clone, Debug)]
pub struct Expected {
    /// The sheet.
    pub sheet: DataSheet,
    /// The tabulated times that the manoeuvre reaches.
    pub rows: Vec<Row>,
    /// First impact; `None`: none, or none found.
    pub impact: Option<Impact>,
    /// Samples in which a sensor stood at its limit.
    pub clipped_samples: u64,
    /// What each group of figures costs.
    pub shares: Vec<Share>,
    /// The same sheet with other aids: wheels and road limits, on and off.
    pub aids: Vec<Aid>,
    /// Reported states, for the picture; times from the impact.
    pub states: Vec<State>,
}

/// The result with one choice of aids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aid {
    /// Wheel speeds recorded.
    pub wheels: bool,
    /// Road limits applied.
    pub road: bool,
    /// Larger half axis of the ellipse at the first tabulated time, m.
    pub semi_major_m: f64,
    /// One sigma of the speed there, m/s.
    pub sd_speed_mps: f64,
    /// One sigma of the speed at impact, m/s; `None`: no impact.
    pub sd_impact_speed_mps: Option<f64>,
}

impl Impact {
    /// With faultless sensors the figure lies outside its own bounds, `quantile` sigmas away: speed, delta-V.
    #[must_use]
    pub fn outside(&self, quantile: f64) -> [bool; 2] {
        [
            self.off_speed_mps.abs() > quantile * self.sd_speed_mps,
            self.off_delta_v_mps.abs() > quantile * self.sd_delta_v_mps,
        ]
    }
}

/// A whole study.
#[derive(Clone, Debug)]
pub struct Study {
    /// What was driven.
    pub plan: Plan,
    /// The settings.
    pub settings: Settings,
    /// One entry a sheet, in the order asked for.
    pub expected: Vec<Expected>,
    /// Seconds of the log at which t = 0 lies.
    pub zero_s: f64,
    /// True if t = 0 is an impact, else the begin of the rest.
    pub has_impact: bool,
    /// Path length from the first state to rest, m.
    pub distance_m: f64,
    /// Sensors drawn against the prediction, one entry a sheet; empty if not asked for.
    pub trials: Vec<super::trial::Trial>,
}

/// Runs a study of several sheets.
///
/// # Errors
/// [`DesignError`] if the manoeuvre cannot be driven or the model cannot be run.
pub fn study(plan: Plan, sheets: &[DataSheet], settings: Settings) -> Result<Study, DesignError> {
    let driven = parallel::map(sheets, |sheet| {
        let drive = Drive::faultless(&plan.scenario, sheet)?;
        let facts = &drive.simulated.truth.facts;
        let about = (facts.trigger_at_s, !facts.impacts.is_empty());
        Ok::<_, DesignError>((expect(&drive, sheet, &settings)?, about))
    })?;
    let (zero_s, has_impact) = driven.first().map_or((0.0, false), |(_, about)| *about);
    let expected: Vec<Expected> = driven.into_iter().map(|(one, _)| one).collect();
    let distance_m = expected.first().map_or(0.0, |one| {
        one.states
            .windows(2)
            .map(|p| {
                (p[1].position[0] - p[0].position[0]).hypot(p[1].position[1] - p[0].position[1])
            })
            .sum()
    });
    Ok(Study {
        plan,
        settings,
        expected,
        zero_s,
        has_impact,
        distance_m,
        trials: Vec::new(),
    })
}

/// One sheet's prediction alone, without what each group and aid costs: a tenth of the time.
///
/// # Errors
/// As [`study`].
pub fn predict(
    plan: &Plan,
    sheet: &DataSheet,
    settings: &Settings,
) -> Result<Expected, DesignError> {
    let drive = Drive::faultless(&plan.scenario, sheet)?;
    let result = drive.reconstruct(sheet, settings)?;
    Ok(drive.expected(sheet, settings, result))
}

fn expect(drive: &Drive, sheet: &DataSheet, settings: &Settings) -> Result<Expected, DesignError> {
    let result = drive.reconstruct(sheet, settings)?;
    let mut aids = Vec::new();
    let road = match &settings.road {
        Road::None => Road::H1,
        other => other.clone(),
    };
    for (wheels, limits) in [(true, true), (true, false), (false, true), (false, false)] {
        // Dead reckoning has nothing but wheels.
        if !wheels && settings.model == Model::DeadReckoning {
            continue;
        }
        let choice = Settings {
            wheels,
            road: if limits { road.clone() } else { Road::None },
            ..settings.clone()
        };
        let with = drive.reconstruct(sheet, &choice)?;
        let rows = drive.rows(&with, settings.confidence);
        let Some(first) = rows.first() else { continue };
        aids.push(Aid {
            wheels,
            road: limits,
            semi_major_m: first.ellipse.semi_major,
            sd_speed_mps: first.sd_speed_mps,
            sd_impact_speed_mps: with.impacts.first().map(|i| i.speed_mps.sd),
        });
    }
    let shares = source::shares(drive, sheet, settings, &result)?;
    Ok(Expected {
        shares,
        aids,
        ..drive.expected(sheet, settings, result)
    })
}

/// A manoeuvre as some sensors saw it.
pub(super) struct Drive {
    pub(super) simulated: Simulated,
    samples: Vec<Sample>,
    clips: Vec<Clip>,
    from: usize,
}

impl Drive {
    /// The manoeuvre with sensors that do nothing wrong but end at their range, and wheel frames as late as the
    /// sheet says.
    pub(super) fn faultless(scenario: &Scenario, sheet: &DataSheet) -> Result<Self, DesignError> {
        let mut scenario = scenario.clone();
        scenario.imu_hz = IMU_HZ;
        scenario.car.imu = scenario.car.imu_nominal;
        scenario.car.cg = scenario.car.cg_nominal;
        scenario.errors = Errors {
            accel_range: sheet.imu.accel_range,
            rate_range: sheet.imu.rate_range,
            wheel_latency: sheet.wheels.latency_s,
            wheel_cutoff: sheet.wheels.cutoff_mps,
            ..Errors::none()
        };
        Self::of(&scenario)
    }

    /// The manoeuvre with sensors drawn from the sheet.
    pub(super) fn drawn(
        scenario: &Scenario,
        sheet: &DataSheet,
        seed: u64,
    ) -> Result<Self, DesignError> {
        let mut scenario = scenario.clone();
        scenario.imu_hz = IMU_HZ;
        scenario.redraw_sensors(&sheet.simulator(), seed);
        // The resolution of one CAN message is not on the sheet.
        scenario.errors.quantised = false;
        Self::of(&scenario)
    }

    fn of(scenario: &Scenario) -> Result<Self, DesignError> {
        let simulated = simulate(scenario)?;
        let first = (simulated.truth.facts.trigger_at_s - BEFORE_S) * 100.0;
        let from = round_usize(first.floor().max(1.0));
        let samples = simulated.samples();
        let clips = clips(&simulated.imu, scenario, from);
        Ok(Self {
            simulated,
            samples,
            clips,
            from,
        })
    }

    fn zero_s(&self) -> f64 {
        self.simulated.truth.facts.trigger_at_s
    }

    /// Reconstructs with the given sheet in the record's header.
    pub(super) fn reconstruct(
        &self,
        sheet: &DataSheet,
        settings: &Settings,
    ) -> Result<Reconstruction, DesignError> {
        let sheet = sheet.floored();
        let mut header = self.simulated.scenario.header();
        header.imu = sheet.imu;
        header.wheels = sheet.wheels;
        header.wheels.present = settings.wheels;
        header.vehicle.imu_position_sd_m = sheet.imu_place_sd;
        header.vehicle.cg_position_sd_m = sheet.cg_place_sd;
        let list: Vec<(u64, u8, Sample)> = self
            .samples
            .iter()
            .zip(0..)
            .skip(self.from)
            .map(|(sample, index)| {
                let mut sample = *sample;
                if !settings.wheels {
                    sample.wheels = [None; 2];
                }
                (index, 100, sample)
            })
            .collect();
        let start_s = (real(self.from) - 1.0) * 0.01 - self.zero_s();
        let epochs = Epochs::from_samples(header, &list, start_s, &self.clips)?;
        let completion = Completion {
            complete: true,
            reasons: Vec::new(),
            ends_at_rest: true,
        };
        let facts = Facts {
            triggers: &[],
            completion: &completion,
            utc_zero_ns: None,
        };
        let options = Options {
            model: settings.model,
            road: settings.road.clone(),
            confidence: settings.confidence,
            ..Options::default()
        };
        Ok(from_epochs(&epochs, &facts, &options)?)
    }

    /// What a result says; shares and aids are left empty.
    fn expected(&self, sheet: &DataSheet, settings: &Settings, result: Reconstruction) -> Expected {
        Expected {
            sheet: sheet.clone(),
            rows: self.rows(&result, settings.confidence),
            impact: self.impact(&result),
            clipped_samples: result.clipped_samples,
            shares: Vec::new(),
            aids: Vec::new(),
            states: result.states,
        }
    }

    /// The first impact: found by the reconstruction and true.
    fn impact(&self, result: &Reconstruction) -> Option<Impact> {
        let first = result.impacts.first()?;
        let truth = self.simulated.truth.facts.impacts.first()?;
        Some(Impact {
            speed_mps: first.speed_mps.value,
            sd_speed_mps: first.speed_mps.sd,
            delta_v_mps: first.delta_v.resultant_mps.value,
            sd_delta_v_mps: first.delta_v.resultant_mps.sd,
            sd_pdof_deg: first.delta_v.pdof_deg.sd,
            lower_bound: first.delta_v.lower_bound,
            off_speed_mps: first.speed_mps.value - truth.speed_mps,
            off_delta_v_mps: first.delta_v.resultant_mps.value - truth.cg.resultant_mps,
        })
    }

    /// The truth that belongs to a state.
    pub(super) fn truth(&self, state: &State) -> Option<&TruthRow> {
        let truth: &Truth = &self.simulated.truth;
        truth.rows.get(num::usize_of(state.index))
    }

    /// The tabulated rows of a result.
    pub(super) fn rows(&self, result: &Reconstruction, confidence: f64) -> Vec<Row> {
        TIMES_S
            .iter()
            .filter_map(|t_s| self.row(*t_s, state_at(&result.states, *t_s)?, confidence))
            .collect()
    }

    fn row(&self, t_s: f64, state: &State, confidence: f64) -> Option<Row> {
        let truth = self.truth(state)?;
        let off = off(state, truth);
        let course = state.velocity[1].atan2(state.velocity[0]);
        let heading = if state.ground_speed > 1.0 {
            course
        } else {
            state.heading
        };
        let p = covariance(state);
        let along = Vector2::new(heading.cos(), heading.sin());
        let across = Vector2::new(-along.y, along.x);
        Some(Row {
            t_s,
            ellipse: of_state(state, None, confidence),
            sd_along_m: along.dot(&(p * along)).max(0.0).sqrt(),
            sd_across_m: across.dot(&(p * across)).max(0.0).sqrt(),
            sd_speed_mps: state.sd_speed,
            sd_heading_rad: state.sd_heading,
            off_m: off.norm(),
            off_speed_mps: state.speed - truth.speed,
            inside: distance(&p, &off) <= crate::stats::ellipse_radius(confidence),
        })
    }
}

/// The last state at or before a time, if it is near enough to stand for it.
pub(super) fn state_at(states: &[State], t_s: f64) -> Option<&State> {
    let after = states.partition_point(|s| s.t_s <= t_s + 1e-6);
    states
        .get(after.checked_sub(1)?)
        .filter(|s| t_s - s.t_s < NEAR_S)
}

/// Covariance of north and east, m^2.
pub(super) fn covariance(state: &State) -> Matrix2<f64> {
    Matrix2::new(
        state.sd_north.powi(2),
        state.cov_north_east,
        state.cov_north_east,
        state.sd_east.powi(2),
    )
}

/// Estimate less truth in the level plane, m.
pub(super) fn off(state: &State, truth: &TruthRow) -> Vector2<f64> {
    Vector2::new(
        state.position[0] - truth.position[0],
        state.position[1] - truth.position[1],
    )
}

/// Distance in sigmas. A millimetre is added to each axis: a model may know one direction exactly, and no truth
/// is known better.
pub(super) fn distance(p: &Matrix2<f64>, off: &Vector2<f64>) -> f64 {
    (p + Matrix2::identity() * 1e-6)
        .try_inverse()
        .map_or(f64::INFINITY, |inverse| {
            off.dot(&(inverse * off)).max(0.0).sqrt()
        })
}
