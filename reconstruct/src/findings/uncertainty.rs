//! Where the uncertainty of the refined model's figures comes from, and paths drawn from its joint posterior.
//!
//! The budget is that of the model's states. What the figure adds to them (the time of the onset, the pulse's edges, the
//! way from the sensor to the centre of gravity) is a source of its own: the rest of the variance shown.

use crate::error::ReconstructError;
use crate::filter::Setup;
use crate::findings::details::{Budget, SamplePaths};
use crate::findings::{Figure, Reconstruction};
use crate::refined::{Refined, Tuning};
use crate::rest::RestInterval;
use crate::smooth::batch::Batch;
use crate::smooth::budget;
use crate::smooth::relinear::Ground;

/// Sources below this share of the variance are added up.
const SMALL: f64 = 0.01;
/// Paths drawn.
const PATHS: usize = 24;
/// One point of a path in so many epochs.
const EVERY: usize = 10;
/// Seed of the paths: the same record gives the same bytes.
const SEED: u64 = 1;

/// Budgets of the states and sample paths.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    budgets: Vec<budget::Budget>,
    paths: SamplePaths,
}

/// Of a refined run; about the batch's solution where it has one, else about the sweep's.
///
/// # Errors
/// [`ReconstructError::Numeric`] if the arithmetic fails.
pub fn of(
    refined: &Refined,
    setup: &Setup<'_>,
    rest: &RestInterval,
    tuning: &Tuning,
) -> Result<Uncertainty, ReconstructError> {
    let ground = Ground {
        given: crate::refined::pass::Given {
            setup,
            rest,
            tuning,
            again: None,
            mounting: None,
        },
        passed: &refined.passed,
    };
    let own;
    let batch = if let Some(batch) = &refined.batch {
        batch.as_ref()
    } else {
        own = Batch::about_sweep(&ground)?;
        &own
    };
    Ok(Uncertainty {
        budgets: batch.budgets(&ground)?,
        paths: paths(batch, setup),
    })
}

fn paths(batch: &Batch, setup: &Setup<'_>) -> SamplePaths {
    let list = &setup.reversed.forward().list;
    let drawn = batch.paths(PATHS, SEED);
    let length = drawn.first().map_or(0, Vec::len);
    // The last point is kept: there the paths meet.
    let kept: Vec<usize> = (0..length)
        .filter(|k| k % EVERY == 0 || k + 1 == length)
        .collect();
    SamplePaths {
        t_s: kept.iter().map(|&k| list[k].t_s).collect(),
        places: drawn
            .iter()
            .map(|path| kept.iter().map(|&k| [path[k][0], path[k][1]]).collect())
            .collect(),
    }
}

/// Puts what is known into a result; says so where nothing is.
pub fn complete(known: Option<Result<Uncertainty, ReconstructError>>, r: &mut Reconstruction) {
    match known {
        Some(Ok(known)) => known.complete(r),
        Some(Err(error)) => r.limits.push(format!(
            "No error budget and no sample paths are given: {error}."
        )),
        None => {}
    }
}

impl Uncertainty {
    /// Puts both into a result, the paths cut to its window.
    fn complete(self, r: &mut Reconstruction) {
        let window = r.states.first().zip(r.states.last());
        if let Some((first, last)) = window {
            r.details.paths = self.paths.within(first.t_s, last.t_s);
        }
        let shown = r.impacts.first().map(|i| {
            let dv = &i.delta_v;
            (i.speed_mps, dv.longitudinal_mps, dv.lateral_mps)
        });
        r.details.budgets = self
            .budgets
            .into_iter()
            .map(|own| {
                let beside = shown.and_then(|(speed, ahead, across)| {
                    let edges = "pulse edges and way to the centre of gravity";
                    match own.figure.as_str() {
                        "impact speed" => Some((speed, "time of the onset")),
                        "delta-V longitudinal" => Some((ahead, edges)),
                        "delta-V lateral" => Some((across, edges)),
                        _ => None,
                    }
                });
                beside_states(own, beside)
            })
            .collect();
    }
}

/// A budget with what the shown figure adds to the states' variance.
fn beside_states(own: budget::Budget, shown: Option<(Figure, &'static str)>) -> Budget {
    let (unit, factor) = if own.figure.contains("heading") {
        ("deg", 1_f64.to_degrees())
    } else if own.figure.contains("position") {
        ("m", 1.0)
    } else {
        ("m/s", 1.0)
    };
    let states = (own.sd * factor).powi(2);
    let added = shown.map_or(0.0, |(figure, _)| (figure.sd.powi(2) - states).max(0.0));
    let added = if added.is_finite() { added } else { 0.0 };
    let total = states + added;
    let part = |variance: f64| if total > 0.0 { variance / total } else { 0.0 };
    let mut sources: Vec<(String, f64)> = own
        .shares
        .iter()
        .map(|(cause, share)| (cause.name().to_owned(), part(share * states)))
        .collect();
    if let Some((_, name)) = shown {
        sources.push((name.to_owned(), part(added)));
    }
    let (mut large, small): (Vec<_>, Vec<_>) = sources.into_iter().partition(|s| s.1 >= SMALL);
    large.sort_by(|a, b| b.1.total_cmp(&a.1));
    let others: f64 = small.iter().map(|s| s.1).sum();
    if others > 0.0 {
        large.push(("all others together".to_owned(), others));
    }
    Budget {
        figure: own.figure,
        unit,
        sd: total.sqrt(),
        sources: large,
    }
}
