//! Every fault by every model: are the bounds kept, and is the fault named?

use std::ops::RangeInclusive;

use crate::run::Model;
use crate::simulate::Scenario;
use crate::validate::faults::Fault;
use crate::validate::score::Score;
use crate::validate::sets::{Prepared, options};
use crate::validate::statistics::Share;
use crate::validate::tables::{Row, rows};
use crate::validate::{Failure, Found, found, workers};

/// What to put in and how to reconstruct it.
#[derive(Clone, Debug)]
pub struct FaultPlan {
    /// Faults.
    pub faults: Vec<Fault>,
    /// Seeds of each.
    pub seeds: RangeInclusive<u64>,
    /// Models.
    pub models: Vec<Model>,
    /// Threads.
    pub threads: usize,
}

/// One fault by one model.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultTables {
    /// Which.
    pub fault: Fault,
    /// Model.
    pub model: &'static str,
    /// What was found.
    pub found: Found,
    /// Figures; the group is the fault's name.
    pub rows: Vec<Row>,
    /// Runs whose limits name the fault.
    pub named: Share,
    /// Runs of the same seeds without any fault whose limits have the same words.
    pub named_without: Share,
}

/// One run: score and whether the fault was named, by model.
type Run = Vec<Result<(Score, Vec<bool>), String>>;

/// Runs every fault; `progress` hears how many runs of how many are done.
pub fn run(
    plan: &FaultPlan,
    mut progress: impl FnMut(usize, usize),
) -> (Vec<FaultTables>, Vec<Failure>) {
    let sound = plan.seeds.clone().map(|seed| (None, seed));
    let faulty = plan
        .faults
        .iter()
        .flat_map(|fault| plan.seeds.clone().map(|seed| (Some(*fault), seed)));
    let jobs: Vec<(Option<Fault>, u64)> = sound.chain(faulty).collect();
    let all = jobs.len();
    let runs: Vec<Run> = workers::run(
        &jobs,
        plan.threads,
        |(fault, seed)| one(plan, *fault, *seed),
        |done| progress(done, all),
    );
    let mut tables = Vec::new();
    let mut failures = Vec::new();
    for (place, model) in plan.models.iter().enumerate() {
        let of = |wanted: Option<Fault>| {
            let chosen = jobs
                .iter()
                .zip(&runs)
                .filter(move |(job, _)| job.0 == wanted);
            chosen.filter_map(move |(job, run)| run.get(place).map(|r| (job.1, r)))
        };
        for (number, fault) in plan.faults.iter().enumerate() {
            let good: Vec<&(Score, Vec<bool>)> = of(Some(*fault))
                .filter_map(|(_, r)| r.as_ref().ok())
                .collect();
            let scores: Vec<&Score> = good.iter().map(|g| &g.0).collect();
            let word = |flags: &[bool]| flags.get(number).copied().unwrap_or(false);
            let clean = of(None).filter_map(|(_, r)| r.as_ref().ok());
            tables.push(FaultTables {
                fault: *fault,
                model: model.name(),
                found: found(fault.name(), of(Some(*fault)).count(), &scores),
                rows: rows(fault.name(), &scores),
                named: Share::count(good.iter().map(|g| word(&g.1))),
                named_without: Share::count(clean.map(|g| word(&g.1))),
            });
        }
        for wanted in std::iter::once(None).chain(plan.faults.iter().copied().map(Some)) {
            for (seed, result) in of(wanted) {
                if let Err(reason) = result {
                    let name = wanted.map_or("no fault", Fault::name);
                    failures.push(Failure {
                        crash: format!("{name}-{seed}"),
                        model: model.name(),
                        reason: reason.clone(),
                    });
                }
            }
        }
    }
    (tables, failures)
}

fn one(plan: &FaultPlan, fault: Option<Fault>, seed: u64) -> Run {
    // Without a fault: any that changes neither scenario nor record has the seed's own class.
    let prepared = match fault {
        Some(fault) => fault.prepare(seed),
        None => Prepared::new(&Scenario::draw(Fault::LockOne.class(seed), seed), None),
    };
    plan.models
        .iter()
        .map(|model| {
            let prepared = prepared.as_ref().map_err(Clone::clone)?;
            let result = prepared.run(&options(*model))?;
            let words = plan.faults.iter().map(|f| f.named(&result.limits));
            Ok((prepared.score(&result)?, words.collect()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{FaultPlan, run};
    use crate::run::Model;
    use crate::validate::faults::Fault;

    #[test]
    fn every_fault_is_scored_and_the_obvious_ones_named() {
        let plan = FaultPlan {
            faults: Fault::ALL.to_vec(),
            seeds: 1..=2,
            models: vec![Model::NineState],
            threads: 2,
        };
        let (tables, failures) = run(&plan, |_, _| ());
        assert!(failures.is_empty(), "{failures:?}");
        assert_eq!(tables.len(), Fault::ALL.len());
        for table in &tables {
            assert_eq!(table.found.scored.hits, 2, "{:?}", table.fault);
            let obvious = matches!(
                table.fault,
                Fault::Dropout
                    | Fault::GyroClip
                    | Fault::AccelClip
                    | Fault::Gap
                    | Fault::PowerCut
                    | Fault::Roof
            );
            assert!(
                !obvious || table.named.hits == 2,
                "{:?}: {:?}",
                table.fault,
                table.named
            );
        }
    }
}
