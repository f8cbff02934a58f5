//! Is the prediction honest? Sensors drawn from the same sheet, on the same manoeuvre, against the truth.
//!
//! The bounds tried are the *predicted* ones, of the run without sensor errors; the record of each drawn set is
//! reconstructed like any other and only its error counts.

use std::f64::consts::PI;

use schema::num::{real, round_usize};

use super::expect::{Drive, Expected, covariance, distance, off, state_at};
use super::manoeuvre::Plan;
use super::parallel;
use super::{DesignError, Settings, TIMES_S};
use crate::stats::{ellipse_radius, two_sided_quantile};

/// One tabulated time of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialRow {
    /// Seconds from the impact (or the rest).
    pub t_s: f64,
    /// Errors in sigmas of the prediction: position (two axes), speed, heading; sorted, one entry a set.
    pub position: Vec<f64>,
    /// Speed.
    pub speed: Vec<f64>,
    /// Heading.
    pub heading: Vec<f64>,
}

/// All times of one sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Name of the sheet.
    pub name: String,
    /// Sets of sensors drawn.
    pub sets: u64,
    /// The tabulated times.
    pub rows: Vec<TrialRow>,
    /// Speed at impact in sigmas of the prediction, sorted.
    pub impact_speed: Vec<f64>,
    /// Resultant delta-V in sigmas of the prediction, sorted.
    pub delta_v: Vec<f64>,
}

impl TrialRow {
    /// Share of the sets within the predicted bounds: position, speed, heading.
    #[must_use]
    pub fn coverage(&self, confidence: f64) -> [f64; 3] {
        let (k, q) = (ellipse_radius(confidence), two_sided_quantile(confidence));
        [
            share_within(&self.position, k),
            share_within(&self.speed, q),
            share_within(&self.heading, q),
        ]
    }

    /// The factor by which the predicted ellipse would have to grow to hold the share `confidence` of the sets:
    /// one where the prediction is exact, below one where it is cautious.
    #[must_use]
    pub fn spread(&self, confidence: f64) -> f64 {
        quantile(&self.position, confidence) / ellipse_radius(confidence)
    }
}

/// Share of sorted values up to `most`.
#[must_use]
pub fn share_within(sorted: &[f64], most: f64) -> f64 {
    if sorted.is_empty() {
        return f64::NAN;
    }
    real(sorted.partition_point(|x| *x <= most)) / real(sorted.len())
}

/// The value below which the share `p` of sorted values lies (nearest rank); not a number if there are none.
#[must_use]
pub fn quantile(sorted: &[f64], p: f64) -> f64 {
    let rank = round_usize((p * real(sorted.len())).ceil()).clamp(1, sorted.len().max(1));
    sorted.get(rank - 1).copied().unwrap_or(f64::NAN)
}

/// Errors of one set in sigmas of the prediction.
struct Set {
    /// Time; position, speed, heading.
    rows: Vec<(f64, [f64; 3])>,
    /// Speed at impact and delta-V.
    impact: Option<[f64; 2]>,
}

fn one(
    plan: &Plan,
    expected: &Expected,
    settings: &Settings,
    seed: u64,
) -> Result<Set, DesignError> {
    let drive = Drive::drawn(&plan.scenario, &expected.sheet, seed)?;
    let result = drive.reconstruct(&expected.sheet, settings)?;
    let row = |t_s: f64| {
        let predicted = state_at(&expected.states, t_s)?;
        let state = state_at(&result.states, t_s)?;
        let truth = drive.truth(state)?;
        let turned = (state.heading - truth.heading + PI).rem_euclid(2.0 * PI) - PI;
        Some((
            t_s,
            [
                distance(&covariance(predicted), &off(state, truth)),
                (state.speed - truth.speed).abs() / predicted.sd_speed,
                turned.abs() / predicted.sd_heading,
            ],
        ))
    };
    let truth = drive.simulated.truth.facts.impacts.first();
    let impact =
        expected
            .impact
            .zip(result.impacts.first().zip(truth))
            .map(|(sd, (found, truth))| {
                let change = found.delta_v.resultant_mps.value - truth.cg.resultant_mps;
                [
                    (found.speed_mps.value - truth.speed_mps).abs() / sd.sd_speed_mps,
                    change.abs() / sd.sd_delta_v_mps,
                ]
            });
    Ok(Set {
        rows: TIMES_S.iter().filter_map(|t| row(*t)).collect(),
        impact,
    })
}

/// Draws `sets` sets of sensors from the seed `first` on and compares each with the prediction.
///
/// # Errors
/// [`DesignError`] as [`super::expect::study`].
pub fn trial(
    plan: &Plan,
    expected: &Expected,
    settings: &Settings,
    first: u64,
    sets: u64,
) -> Result<Trial, DesignError> {
    let seeds: Vec<u64> = (first..first.saturating_add(sets)).collect();
    let tried = parallel::map(&seeds, |seed| one(plan, expected, settings, *seed))?;
    let mut rows: Vec<TrialRow> = TIMES_S
        .iter()
        .filter(|t| state_at(&expected.states, **t).is_some())
        .map(|t_s| TrialRow {
            t_s: *t_s,
            position: Vec::new(),
            speed: Vec::new(),
            heading: Vec::new(),
        })
        .collect();
    let (mut impact_speed, mut delta_v) = (Vec::new(), Vec::new());
    for set in tried {
        for row in &mut rows {
            let found = set.rows.iter().find(|(t, _)| (t - row.t_s).abs() < 1e-9);
            if let Some((_, [position, speed, heading])) = found {
                row.position.push(*position);
                row.speed.push(*speed);
                row.heading.push(*heading);
            }
        }
        if let Some([speed, change]) = set.impact {
            impact_speed.push(speed);
            delta_v.push(change);
        }
    }
    for row in &mut rows {
        for list in [&mut row.position, &mut row.speed, &mut row.heading] {
            list.sort_by(f64::total_cmp);
        }
    }
    impact_speed.sort_by(f64::total_cmp);
    delta_v.sort_by(f64::total_cmp);
    Ok(Trial {
        name: expected.sheet.name.clone(),
        sets,
        rows,
        impact_speed,
        delta_v,
    })
}
