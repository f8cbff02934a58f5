//! One run: from a record to the reconstruction.

mod anchored;
mod options;

use schema::Record;
use schema::num::real_u64;
use schema::parts::{Completion, Trigger};

use crate::anchor::Anchor;
use crate::anchor::fixes::Heard;
use crate::anchor::laid;
use crate::anchor::rough::Rough;
use crate::dead_reckoning;
use crate::epochs::{Epoch, Epochs};
use crate::error::ReconstructError;
use crate::filter::{self, Setup, Snapshot};
use crate::findings::crash::{self, Evidence};
use crate::findings::delta_v::JointPulse;
use crate::findings::uncertainty::{self, Uncertainty};
use crate::findings::{
    Figure, ModelAnswer, Reconstruction, Rest, WheelUse, agreement, details, faults, limits,
};
use crate::funnel::{self, Source};
use crate::motion::Motion;
use crate::published;
use crate::refined;
use crate::rest;
use crate::smooth::Smoother;
use crate::start;
use crate::stats::two_sided_quantile;

pub use options::{Model, Options, Road};

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
    let facts = Facts {
        triggers: &record.triggers,
        completion: &record.completion,
        utc_zero_ns: record.zero_ns().checked_add(record.header.clock.offset_ns),
    };
    let fixes = record.gnss.as_ref().filter(|_| options.fixes);
    let mut result = match fixes {
        Some(gnss) => anchored::run(record, gnss, &epochs, &facts, options)?,
        None => from_epochs(&epochs, &facts, options)?,
    };
    result.details.reaction.fill_brake(&record.aux);
    Ok(result)
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
    about(epochs, facts, options, None).map(|(result, _)| result)
}

/// As [`from_epochs`], with satellite fixes about a rough pose, and then the pose.
fn about(
    epochs: &Epochs,
    facts: &Facts<'_>,
    options: &Options,
    fixes: Option<(&Heard, &Rough)>,
) -> Result<(Reconstruction, Option<Answer>), ReconstructError> {
    options.check()?;
    let (from, to) = window(epochs, options)?;
    let earth = options.earth();
    let rest = rest::find(epochs, earth.gravity);
    let start = if rest.found() {
        start::at_rest(epochs, &rest, &earth)
    } else {
        start::moving(epochs, &earth)
    };
    let reversed = epochs.reversed();
    let motion = Motion::look(&reversed, &start, earth.gravity, facts.triggers);
    let road = options.road.limits();
    let anchor = fixes
        .map(|(heard, rough)| Anchor::new(heard, rough, &epochs.list[..=start.k], rest.found()));
    let setup = Setup {
        reversed,
        start: &start,
        motion: &motion,
        earth,
        road: road.as_ref(),
        tuning: options.tuning,
        anchor: anchor.as_ref(),
    };
    let quantile = two_sided_quantile(options.confidence);
    let ran = run_models(&setup, &rest, options, quantile, from..to)?;
    let motion = ran.motion.as_ref().unwrap_or(&motion);
    let source = Source {
        epochs,
        motion,
        gravity: earth.gravity,
        road: road
            .as_ref()
            .filter(|_| matches!(options.model, Model::NineState | Model::Refined)),
        utc_zero_ns: facts.utc_zero_ns,
    };
    let (states, road_use) = funnel::states(&source, &ran.snapshots, from, to);
    let evidence = Evidence {
        epochs,
        motion,
        snapshots: &ran.snapshots,
        quantile,
        joint: &ran.joint,
        wheels_only: options.model == Model::DeadReckoning,
    };
    // The way to the impact and to the rest is that of the record, whatever window is shown.
    let all = 0..epochs.list.len();
    let whole =
        (all != (from..to)).then(|| funnel::states(&source, &ran.snapshots, all.start, all.end).0);
    let details = details::of(
        &evidence,
        &rest,
        whole.as_ref().unwrap_or(&states),
        [from, to],
        options.reaction_s,
    );
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
            t_s: details.final_rest.as_ref().map(|r| r.stop_t_s.value),
            duration_s: rest.duration_s,
            reason: rest.reason.clone(),
        },
        impacts: crash::impacts(&evidence),
        braking: crash::braking(&evidence, rest_from),
        distance_m: crash::distance(&states, quantile),
        start_speed_mps: Figure::new(first.speed, first.sd_speed, quantile),
        top_speed_mps: Figure::new(top.speed, top.sd_speed, quantile),
        top_speed_t_s: top.t_s,
        comparisons: agreement::compare(&ran.answers, options.confidence),
        models: ran.answers,
        details,
        road: road_use,
        wheels: ran.wheels,
        missing_samples: missing,
        clipped_samples: count(|e| e.clipped.iter().any(|c| *c != 0.0)),
        rest_pose: options.rest_pose,
        map: None,
        gnss: None,
        limits: Vec::new(),
        gaps: missing > 0
            || limits::wheel_gaps(epochs).0 > 0
            || !facts.completion.complete
            || !rest.found(),
        states,
    };
    result.limits = limits::sentences(&result, epochs, motion, facts);
    result.limits.extend(ran.faults);
    result.details.smoother = ran.smoother;
    uncertainty::complete(ran.uncertainty, &mut result);
    Ok((result, ran.answer))
}

/// Where a path lies among satellite fixes.
struct Answer {
    pose: laid::Pose,
    /// Numbers of the fixes that the pass was given.
    taken: Vec<usize>,
    /// Of these, those it refused.
    refused: Vec<usize>,
}

/// What the models gave.
struct Ran {
    /// Side by side, in the order of [`Model`].
    answers: Vec<ModelAnswer>,
    /// Snapshots of the model asked for.
    snapshots: Vec<Snapshot>,
    /// Its joint covariances of the pulses, where it has them.
    joint: Vec<Option<JointPulse>>,
    /// The first look as it saw it, where it saw more.
    motion: Option<Motion>,
    /// What the refined model says of the sensors.
    faults: Vec<String>,
    /// Its use of the wheels.
    wheels: WheelUse,
    /// Its smoother.
    smoother: Option<Smoother>,
    /// Where it lies among satellite fixes.
    answer: Option<Answer>,
    /// Its error budgets and sample paths.
    uncertainty: Option<Result<Uncertainty, ReconstructError>>,
}

/// Runs every model; only the snapshots of the one asked for are kept.
fn run_models(
    setup: &Setup<'_>,
    rest: &rest::RestInterval,
    options: &Options,
    quantile: f64,
    range: std::ops::Range<usize>,
) -> Result<Ran, ReconstructError> {
    let mut answers = Vec::new();
    let mut kept = None;
    let mut wheels = WheelUse::default();
    let mut faults = Vec::new();
    let (mut known, mut smoother, mut laid) = (None, None, None);
    let asked = options.model;
    for model in Model::ALL {
        if options.alone && model != asked {
            continue;
        }
        let mut motion = None;
        let mut joint = Vec::new();
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
            Model::Refined => {
                let refined = match refined::run(setup, rest, &options.refined, options.smoother) {
                    Err(error) if asked != Model::Refined => {
                        faults.push(format!("The refined model gives no answer: {error}."));
                        continue;
                    }
                    refined => refined?,
                };
                if asked == Model::Refined {
                    (wheels, smoother) = (refined.wheels, Some(refined.smoother));
                    laid = setup.anchor.map(|anchor| Answer {
                        pose: laid::pose(&refined, anchor, range.clone()),
                        taken: anchor.fixes.iter().map(|f| f.number).collect(),
                        refused: refined.passed.fixes_refused.clone(),
                    });
                    known = (!options.alone && options.smoother != Smoother::None)
                        .then(|| uncertainty::of(&refined, setup, rest, &options.refined));
                }
                let epochs = setup.reversed.forward();
                faults = faults::sentences(&refined, epochs, setup.motion, setup.road);
                motion = Some(refined.motion(setup));
                joint = refined.joint;
                Some(refined.snapshots)
            }
        };
        let Some(snapshots) = snapshots else { continue };
        let evidence = Evidence {
            epochs: setup.reversed.forward(),
            motion: motion.as_ref().unwrap_or(setup.motion),
            snapshots: &snapshots,
            quantile,
            joint: &joint,
            wheels_only: model == Model::DeadReckoning,
        };
        answers.push(agreement::answer(model.name(), &evidence, range.start));
        if model == asked {
            kept = Some((snapshots, joint, motion));
        }
    }
    let (snapshots, joint, motion) = kept.ok_or(ReconstructError::Option {
        option: "model",
        expected: "a model the record can feed",
        found: format!("{} without a wheel speed in the record", asked.name()),
    })?;
    Ok(Ran {
        answers,
        snapshots,
        joint,
        motion,
        faults,
        wheels,
        smoother,
        answer: laid,
        uncertainty: known,
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

/// Seconds of a count of 10 ms samples.
#[must_use]
pub fn seconds(samples: u64) -> f64 {
    real_u64(samples) * 0.01
}
