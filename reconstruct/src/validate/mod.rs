//! The whole validation: simulated sets against their truth, with figures an assessor can tick off.
//!
//! In the order the data flows:
//!
//! 1. [`sets`]: classes by seeds, simulated and reconstructed on all cores ([`workers`]).
//! 2. [`record`]: the record of a simulated crash, packed as the recorder packs it.
//! 3. [`score`]: one reconstruction against the truth.
//! 4. [`tables`], [`measure`]: error quantiles, coverage, NEES by class and instant; [`statistics`] gives each figure its own
//!    uncertainty.
//! 5. [`faults`], [`fault_runs`]: the same with a fault in each crash; [`folder`], [`fixes`]: recordings with truth.
//! 6. [`bars`], [`honesty`]: what must hold, and whether it does.
//! 7. [`text`]: the screen; [`json`]: `validate.json`; [`page`], [`pictures`]: `validate.html`.
//!
//! Same plan, same figures to the last bit, on any number of threads.

pub mod bars;
pub mod fault_runs;
pub mod faults;
pub mod fixes;
pub mod folder;
pub mod honesty;
pub mod json;
pub mod measure;
pub mod page;
mod page_tables;
pub mod pictures;
pub mod record;
pub mod score;
pub mod sets;
pub mod statistics;
pub mod tables;
pub mod text;
pub mod workers;

use crate::simulate::Class;
use score::Score;
use sets::{Case, Plan};
use statistics::{Estimate, Share, quantile_estimate, sorted};
use tables::{Row, rows};

/// The group of all crashes.
pub const ALL: &str = "all";

/// What was found at all, by group.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Class, or [`ALL`].
    pub group: String,
    /// Crashes scored of those simulated.
    pub scored: Share,
    /// True impacts that were found.
    pub impacts: Share,
    /// Impacts found that are none.
    pub false_impacts: usize,
    /// Records whose rest was found.
    pub rest: Share,
}

impl ModelTables {
    /// What the figures leave out: impacts that were not found are in none of those of an impact.
    #[must_use]
    pub fn left_out(&self) -> Option<String> {
        let f = self.found.iter().find(|f| f.group == ALL)?;
        (f.scored.of > 0).then(|| {
            format!(
                "Scored {} of {} crashes; rest found in {}; impacts found {} of {} (those not found are in no figure of \
                 the impact), false ones {}.",
                f.scored.hits, f.scored.of, f.rest.hits, f.impacts.hits, f.impacts.of, f.false_impacts
            )
        })
    }
}

/// The tables of one model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelTables {
    /// Name of the model.
    pub model: &'static str,
    /// What was found.
    pub found: Vec<Found>,
    /// Figures.
    pub rows: Vec<Row>,
    /// Median ratio of the long half axis of the ellipse at -30 s to the ideal filter's; `None` if none was run.
    pub width: Option<Estimate>,
}

/// A crash that could not be scored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Class and seed.
    pub crash: String,
    /// Model.
    pub model: &'static str,
    /// Why.
    pub reason: String,
}

/// Result of a simulated set.
#[derive(Clone, Debug, PartialEq)]
pub struct SetResult {
    /// One entry a model, in the order of the plan.
    pub models: Vec<ModelTables>,
    /// What could not be scored, never dropped silently.
    pub failures: Vec<Failure>,
}

/// What was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Classes simulated; empty: none.
    pub classes: Vec<&'static str>,
    /// First and last seed of each class.
    pub seeds: [u64; 2],
    /// Models.
    pub models: Vec<&'static str>,
    /// First and last seed of each fault; `None`: no faults.
    pub fault_seeds: Option<[u64; 2]>,
    /// Folders of recordings.
    pub folders: Vec<String>,
}

/// The whole validation.
#[derive(Clone, Debug, PartialEq)]
pub struct Validation {
    /// What was asked for.
    pub settings: Settings,
    /// The simulated set.
    pub set: SetResult,
    /// Faults, by model and fault.
    pub faults: Vec<fault_runs::FaultTables>,
    /// Windows of recordings.
    pub windows: Vec<fixes::Window>,
    /// Recordings that could not be used.
    pub unused: Vec<folder::Unused>,
}

impl Validation {
    /// The list of what must hold, for one model.
    #[must_use]
    pub fn bars(&self, tables: &ModelTables) -> Vec<bars::Bar> {
        bars::bars(tables, &self.faults, &self.windows)
    }

    /// True if everything asked for was scored.
    #[must_use]
    pub fn whole(&self) -> bool {
        self.set.failures.is_empty() && self.unused.is_empty()
    }
}

/// Tables of the cases of a plan.
#[must_use]
pub fn tabulate(plan: &Plan<'_>, cases: &[Case]) -> SetResult {
    let mut failures = Vec::new();
    let mut models = Vec::new();
    for (place, model) in plan.models.iter().enumerate() {
        let mut tables = ModelTables {
            model: model.name(),
            found: Vec::new(),
            rows: Vec::new(),
            width: width(cases, place),
        };
        let groups = std::iter::once(None).chain(plan.classes.iter().copied().map(Some));
        for group in groups {
            let members: Vec<&Case> = cases
                .iter()
                .filter(|case| group.is_none_or(|class| class == case.class))
                .collect();
            let scores: Vec<&Score> = members
                .iter()
                .filter_map(|case| case.scores.get(place)?.as_ref().ok())
                .collect();
            let name = group.map_or(ALL, Class::name);
            tables.found.push(found(name, members.len(), &scores));
            tables.rows.extend(rows(name, &scores));
        }
        for case in cases {
            if let Some(Err(reason)) = case.scores.get(place) {
                failures.push(Failure {
                    crash: format!("{}-{}", case.class, case.seed),
                    model: model.name(),
                    reason: reason.clone(),
                });
            }
        }
        models.push(tables);
    }
    SetResult { models, failures }
}

fn found(group: &str, of: usize, scores: &[&Score]) -> Found {
    Found {
        group: group.to_owned(),
        scored: Share {
            hits: scores.len(),
            of,
        },
        impacts: Share::count(
            scores
                .iter()
                .flat_map(|s| s.impacts.iter().map(Option::is_some)),
        ),
        false_impacts: scores.iter().map(|s| s.false_impacts).sum(),
        rest: Share::count(scores.iter().map(|s| s.rest_found)),
    }
}

fn width(cases: &[Case], place: usize) -> Option<Estimate> {
    let ratios: Vec<f64> = cases
        .iter()
        .filter_map(|case| {
            let own = case.scores.get(place)?.as_ref().ok()?.moments[0].axis_m?;
            let ideal = case.ideal_axis_m.as_ref()?[0]?;
            (ideal > 0.0).then_some(own / ideal)
        })
        .collect();
    quantile_estimate(&sorted(&ratios), 0.5)
}
