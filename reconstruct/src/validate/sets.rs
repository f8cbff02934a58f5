//! Sets of simulated crashes: classes by seeds, each reconstructed by every model asked for.

use std::ops::RangeInclusive;

use schema::header::Header;

use crate::epochs::Epochs;
use crate::findings::Reconstruction;
use crate::run::{Facts, Model, Options, from_epochs};
use crate::simulate::{Class, Scenario, Simulated, simulate};
use crate::validate::score::{BACK_S, Score, score, trigger_s};
use crate::validate::{record, workers};

/// Changes what a run is told of a scenario: the header and the options.
///
/// The simulator's [`Scenario`] holds what the sensors really do wrong; a filter that is told so is the ideal to
/// which the width of an honest one is compared.
pub type Change<'a> = &'a (dyn Fn(&Scenario, &mut Header, &mut Options) + Sync);

/// What to simulate and how to reconstruct it.
#[derive(Clone)]
pub struct Plan<'a> {
    /// Classes.
    pub classes: Vec<Class>,
    /// Seeds of each class.
    pub seeds: RangeInclusive<u64>,
    /// Models, each scored for itself.
    pub models: Vec<Model>,
    /// Threads.
    pub threads: usize,
    /// Run beside the models, of which only the ellipses are kept: see [`Change`].
    pub ideal: Option<Change<'a>>,
}

/// The ideal filter of a scenario: the refined model told the true spreads of this very car and drive (vibration, wheel
/// noise, sideslip), and that beside them nothing is wrong (no wheel floor, no gyro error but bias and scale, an exact
/// track width). Biases, scales, mounting and delay stay unknown: they are what a filter is there to find.
pub fn told(scenario: &Scenario, header: &mut Header, options: &mut Options) {
    let errors = &scenario.errors;
    let slip = &scenario.manoeuvre.sideslip;
    header.imu.accel_vibration = errors.accel_vibration.max(1e-6);
    header.imu.rate_vibration = errors.rate_vibration.max(1e-8);
    header.wheels.noise_mps = errors.wheel_noise.max(1e-6);
    options.model = Model::Refined;
    options.alone = true;
    options.refined.wheel_floor_mps = 0.0;
    options.refined.slip_sd = slip.sd.max(1e-6);
    // The simulator states when the correlation falls to 1/e; of its law the integral is 0.92 of that.
    options.refined.slip_time_s = 0.92 * slip.time;
    options.refined.slip_gradient = [slip.per_lateral, 1e-6];
    options.refined.rate_nonlinearity = 0.0;
    options.refined.track_sd = 1e-6;
}

impl Plan<'_> {
    /// Every class and seed, class by class.
    #[must_use]
    pub fn jobs(&self) -> Vec<(Class, u64)> {
        self.classes
            .iter()
            .flat_map(|class| self.seeds.clone().map(|seed| (*class, seed)))
            .collect()
    }
}

/// One crash by every model.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Class.
    pub class: Class,
    /// Seed.
    pub seed: u64,
    /// One entry a model of the plan; why not, where it could not be scored.
    pub scores: Vec<Result<Score, String>>,
    /// Long half axes (1 sigma) of the ideal filter at [`BACK_S`], m.
    pub ideal_axis_m: Option<[Option<f64>; 5]>,
}

/// A crash ready to be reconstructed.
pub struct Prepared {
    /// The simulation.
    pub simulated: Simulated,
    /// Its record.
    pub record: schema::Record,
    /// Its samples on one time line.
    pub epochs: Epochs,
}

impl Prepared {
    /// Simulates and records; the power goes `cut_s` after the onset, if given.
    ///
    /// # Errors
    /// A sentence on what failed.
    pub fn new(scenario: &Scenario, cut_s: Option<f64>) -> Result<Self, String> {
        let simulated = simulate(scenario).map_err(|e| e.to_string())?;
        let record = record::record(&simulated, scenario.header(), cut_s);
        let epochs = Epochs::read(&record).map_err(|e| e.to_string())?;
        Ok(Self {
            simulated,
            record,
            epochs,
        })
    }

    /// Reconstructs.
    ///
    /// # Errors
    /// A sentence on what failed.
    pub fn run(&self, options: &Options) -> Result<Reconstruction, String> {
        self.run_on(&self.epochs, options)
    }

    fn run_on(&self, epochs: &Epochs, options: &Options) -> Result<Reconstruction, String> {
        let facts = Facts {
            triggers: &self.record.triggers,
            completion: &self.record.completion,
            utc_zero_ns: None,
        };
        from_epochs(epochs, &facts, options).map_err(|e| e.to_string())
    }

    /// Scores a reconstruction of it.
    ///
    /// # Errors
    /// A sentence on what is missing.
    pub fn score(&self, result: &Reconstruction) -> Result<Score, String> {
        score(
            &self.simulated,
            result,
            trigger_s(&self.simulated, &self.record),
        )
        .ok_or_else(|| "the states do not reach 30 s back from the event".to_owned())
    }

    fn ideal(&self, change: Change<'_>) -> Result<[Option<f64>; 5], String> {
        let mut epochs = self.epochs.clone();
        let mut options = Options::default();
        change(&self.simulated.scenario, &mut epochs.header, &mut options);
        let score = self.score(&self.run_on(&epochs, &options)?)?;
        Ok(score.moments.map(|m| m.axis_m))
    }
}

/// Options of a model, everything else as `run` has it.
#[must_use]
pub fn options(model: Model) -> Options {
    Options {
        model,
        ..Options::default()
    }
}

/// Simulates and scores one crash.
#[must_use]
pub fn case(class: Class, seed: u64, plan: &Plan<'_>) -> Case {
    let prepared = Prepared::new(&Scenario::draw(class, seed), None);
    let scores = plan
        .models
        .iter()
        .map(|model| {
            let prepared = prepared.as_ref().map_err(Clone::clone)?;
            let alone = Options {
                alone: true,
                ..options(*model)
            };
            prepared.score(&prepared.run(&alone)?)
        })
        .collect();
    let ideal_axis_m = plan.ideal.and_then(|change| {
        let prepared = prepared.as_ref().ok()?;
        prepared.ideal(change).ok()
    });
    Case {
        class,
        seed,
        scores,
        ideal_axis_m,
    }
}

/// Runs the whole plan; `progress` hears how many crashes of how many are done.
pub fn run(plan: &Plan<'_>, mut progress: impl FnMut(usize, usize)) -> Vec<Case> {
    let jobs = plan.jobs();
    let all = jobs.len();
    workers::run(
        &jobs,
        plan.threads,
        |(class, seed)| case(*class, *seed, plan),
        |done| progress(done, all),
    )
}

/// Number of instants scored.
pub const INSTANTS: usize = BACK_S.len();

#[cfg(test)]
mod tests {
    use super::{Plan, run};
    use crate::run::Model;
    use crate::simulate::Class;

    #[test]
    fn one_and_two_threads_give_the_same_scores() {
        let plan = |threads| Plan {
            classes: vec![Class::Frontal, Class::Double],
            seeds: 3..=4,
            models: vec![Model::DeadReckoning, Model::NineState],
            threads,
            ideal: Some(&|scenario, header, options| {
                header.imu.accel_density = scenario.errors.accel_density.max(1e-6);
                options.model = Model::NineState;
            }),
        };
        let mut heard = 0;
        let one = run(&plan(1), |done, all| heard = done * 10 + all);
        let two = run(&plan(2), |_, _| ());
        assert_eq!(heard, 44);
        assert_eq!(one, two);
        for case in &one {
            assert!(case.scores.iter().all(Result::is_ok), "{case:?}");
            let own = case.scores[1].as_ref().unwrap().moments[0].axis_m.unwrap();
            let ideal = case.ideal_axis_m.unwrap()[0].unwrap();
            assert!((own - ideal).abs() < 1e-9, "{own} {ideal}");
        }
    }
}
