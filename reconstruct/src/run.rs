//! One run: from a record to the reconstruction.

use schema::Record;
use schema::num::real_u64;
use schema::parts::{Completion, Trigger};

use crate::dead_reckoning;
use crate::epochs::{Epoch, Epochs};
use crate::error::ReconstructError;
use crate::filter::{self, Setup, Snapshot, Tuning};
use crate::findings::crash::{self, Evidence};
use crate::findings::{Figure, ModelAnswer, Reconstruction, Rest, RestPose, WheelUse, limits};
use crate::funnel::{self, Source};
use crate::mechanize::{Earth, gravity};
use crate::motion::Motion;
use crate::published;
use crate::rest;
use crate::road::RoadLimits;
use crate::start;
use crate::stats::two_sided_quantile;

/// The models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Model {
    /// Wheels alone [S03, 2.11-2.17].
    DeadReckoning,
    /// The nine states of S03 in vehicle axes [S03, 3.10], signs corrected.
    Published,
    /// Nine states in navigation axes with full coupling and considered biases: the default.
    NineState,
}

impl Model {
    /// Name on the command line and in the outputs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DeadReckoning => "dead-reckoning",
            Self::Published => "published",
            Self::NineState => "nine-state",
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
    /// Weights of the nine-state filter.
    pub tuning: Tuning,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            model: Model::NineState,
            road: Road::H1,
            rest_pose: None,
            latitude_deg: None,
            confidence: 0.95,
            from_s: None,
            to_s: None,
            tuning: Tuning::default(),
        }
    }
}

impl Options {
    fn check(&self) -> Result<(), ReconstructError> {
        if !(self.confidence > 0.0 && self.confidence < 1.0) {
            return Err(ReconstructError::Option {
                option: "confidence",
                expected: "a number between 0 and 1",
                found: self.confidence.to_string(),
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

/// What a run knows beside the epochs.
#[derive(Clone, Debug)]
pub struct Facts<'a> {
    /// Triggers in order of time.
    pub triggers: &'a [Trigger],
    /// Completion of the record.
    pub completion: &'a Completion,
    /// UTC of t = 0, ns.
    pub utc_zero_ns: Option<i64>,
}

/// Reconstructs a record.
///
/// # Errors
/// [`ReconstructError`] if the record has too few samples, the options are out of range or the window is empty.
pub fn reconstruct(record: &Record, options: &Options) -> Result<Reconstruction, ReconstructError> {
    let epochs = Epochs::read(record)?;
    let zero = record.triggers.first().map_or_else(
        || record.monotonic_ns(record.first_index()),
        |t| t.monotonic_ns,
    );
    let facts = Facts {
        triggers: &record.triggers,
        completion: &record.completion,
        utc_zero_ns: zero.checked_add(record.header.clock.offset_ns),
    };
    from_epochs(&epochs, &facts, options)
}

/// Reconstructs from epochs: what [`reconstruct`] does once the samples are on one time line.
///
/// # Errors
/// As [`reconstruct`].
pub fn from_epochs(
    epochs: &Epochs,
    facts: &Facts<'_>,
    options: &Options,
) -> Result<Reconstruction, ReconstructError> {
    options.check()?;
    let (from, to) = window(epochs, options)?;
    let earth = match (options.rest_pose, options.latitude_deg) {
        (Some(pose), _) => Earth::at(
            pose.latitude_deg.to_radians(),
            pose.heading_deg.to_radians(),
        ),
        (None, Some(latitude_deg)) => Earth {
            gravity: gravity(latitude_deg.to_radians()),
            ..Earth::flat()
        },
        (None, None) => Earth::flat(),
    };
    let rest = rest::find(epochs, earth.gravity);
    let start = if rest.found() {
        start::at_rest(epochs, &rest, &earth)
    } else {
        start::moving(epochs, &earth)
    };
    let reversed = epochs.reversed();
    let motion = Motion::look(&reversed, &start, earth.gravity, facts.triggers);
    let road = match &options.road {
        Road::H1 => Some(RoadLimits::default()),
        Road::None => None,
        Road::File(limits) => Some(limits.clone()),
    };
    let setup = Setup {
        reversed,
        start: &start,
        motion: &motion,
        earth,
        road: road.as_ref(),
        tuning: options.tuning,
    };
    let quantile = two_sided_quantile(options.confidence);
    let ran = run_models(&setup, options.model, quantile, from)?;
    let source = Source {
        epochs,
        motion: &motion,
        gravity: earth.gravity,
        road: road.as_ref().filter(|_| options.model == Model::NineState),
        utc_zero_ns: facts.utc_zero_ns,
    };
    let (states, road_use) = funnel::states(&source, &ran.snapshots, from, to);
    let evidence = Evidence {
        epochs,
        motion: &motion,
        snapshots: &ran.snapshots,
        quantile,
    };
    let rest_from = rest.found().then_some(rest.range.start);
    let first = &states[0];
    let top = states
        .iter()
        .fold(first, |a, b| if b.speed > a.speed { b } else { a });
    let count = |bad: fn(&Epoch) -> bool| {
        schema::num::u64_of(epochs.list[from..to].iter().filter(|e| bad(e)).count())
    };
    let missing = count(|e| e.measured != [true; 6]);
    let mut result = Reconstruction {
        model: options.model.name(),
        confidence: options.confidence,
        rest: Rest {
            found: rest.found(),
            t_s: rest_from.map(|k| epochs.list[k].t_s - epochs.list[k].dt),
            duration_s: rest.duration_s,
            reason: rest.reason.clone(),
        },
        impacts: crash::impacts(&evidence),
        braking: crash::braking(&evidence, rest_from),
        distance_m: crash::distance(&states, quantile),
        start_speed_mps: Figure::new(first.speed, first.sd_speed, quantile),
        top_speed_mps: Figure::new(top.speed, top.sd_speed, quantile),
        top_speed_t_s: top.t_s,
        models: ran.answers,
        road: road_use,
        wheels: ran.wheels,
        missing_samples: missing,
        clipped_samples: count(|e| e.clipped.iter().any(|c| *c != 0.0)),
        rest_pose: options.rest_pose,
        map: None,
        limits: Vec::new(),
        gaps: missing > 0
            || limits::wheel_gaps(epochs).0 > 0
            || !facts.completion.complete
            || !rest.found(),
        states,
    };
    result.limits = limits::sentences(&result, epochs, &motion, facts);
    Ok(result)
}

/// What the models gave.
struct Ran {
    /// Side by side, in the order of [`Model`].
    answers: Vec<ModelAnswer>,
    /// Snapshots of the model asked for.
    snapshots: Vec<Snapshot>,
    /// Its use of the wheels.
    wheels: WheelUse,
}

/// Runs every model; only the snapshots of the one asked for are kept.
fn run_models(
    setup: &Setup<'_>,
    asked: Model,
    quantile: f64,
    from: usize,
) -> Result<Ran, ReconstructError> {
    let mut answers = Vec::new();
    let mut kept = None;
    let mut wheels = WheelUse::default();
    for model in [Model::DeadReckoning, Model::Published, Model::NineState] {
        let snapshots = match model {
            Model::DeadReckoning => dead_reckoning::run(&setup.reversed, setup.motion),
            Model::Published => Some(published::run(
                &setup.reversed,
                setup.start,
                setup.motion,
                &setup.earth,
            )),
            Model::NineState => {
                let pass = filter::run(setup)?;
                if asked == Model::NineState {
                    wheels = pass.wheels;
                }
                Some(pass.snapshots)
            }
        };
        let Some(snapshots) = snapshots else { continue };
        let evidence = Evidence {
            epochs: setup.reversed.forward(),
            motion: setup.motion,
            snapshots: &snapshots,
            quantile,
        };
        answers.push(answer(model, &evidence, from));
        if model == asked {
            kept = Some(snapshots);
        }
    }
    let snapshots = kept.ok_or(ReconstructError::Option {
        option: "model",
        expected: "a model the record can feed",
        found: format!("{} without a wheel speed in the record", asked.name()),
    })?;
    Ok(Ran {
        answers,
        snapshots,
        wheels,
    })
}

/// First and one-past-last epoch of the window asked for.
fn window(epochs: &Epochs, options: &Options) -> Result<(usize, usize), ReconstructError> {
    let list = &epochs.list;
    let from_s = options.from_s.unwrap_or(f64::NEG_INFINITY);
    let to_s = options.to_s.unwrap_or(f64::INFINITY);
    let from = list.partition_point(|e| e.t_s < from_s - 1e-9);
    let to = list.partition_point(|e| e.t_s <= to_s + 1e-9);
    let span = list
        .first()
        .zip(list.last())
        .map_or((0.0, 0.0), |(a, b)| (a.t_s, b.t_s));
    if from >= to || from_s.is_nan() || to_s.is_nan() {
        return Err(ReconstructError::Window {
            from_s,
            to_s,
            first_s: span.0,
            last_s: span.1,
        });
    }
    Ok((from, to))
}

fn answer(model: Model, evidence: &Evidence<'_>, from: usize) -> ModelAnswer {
    let snapshot = &evidence.snapshots[from];
    let sd = |i: usize| snapshot.p[(i, i)].max(0.0).sqrt();
    ModelAnswer {
        name: model.name(),
        start_north_m: Figure::new(snapshot.nav.r_n.v.x, sd(0), evidence.quantile),
        start_east_m: Figure::new(snapshot.nav.r_n.v.y, sd(1), evidence.quantile),
        impact_speed_mps: evidence
            .motion
            .impacts
            .first()
            .map(|pulse| crash::speed_at(evidence, pulse)),
    }
}

/// Seconds of a count of 10 ms samples.
#[must_use]
pub fn seconds(samples: u64) -> f64 {
    real_u64(samples) * 0.01
}
