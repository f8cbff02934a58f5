//! One simulated crash as the refined pass takes it.

use reconstruct::epochs::Epochs;
use reconstruct::filter::{Setup, Tuning};
use reconstruct::mechanize::Earth;
use reconstruct::motion::Motion;
use reconstruct::refined::pass::{self, Given, Passed};
use reconstruct::rest::{self, RestInterval};
use reconstruct::road::RoadLimits;
use reconstruct::simulate::{Class, Scenario, TruthRow, simulate};
use reconstruct::smooth::relinear::Ground;
use reconstruct::start::{self, Start};
use schema::Sample;
use schema::num::round_usize;

/// Everything a [`Setup`] borrows.
pub(crate) struct Crash {
    pub(crate) epochs: Epochs,
    pub(crate) earth: Earth,
    pub(crate) rest: RestInterval,
    pub(crate) start: Start,
    pub(crate) motion: Motion,
    pub(crate) road: RoadLimits,
    pub(crate) tuning: reconstruct::refined::Tuning,
    /// What really happened, and the sample that the first epoch is.
    #[allow(dead_code, reason = "not every test looks at the truth")]
    pub(crate) rows: Vec<TruthRow>,
    from: usize,
}

impl Crash {
    /// From `before_s` before the event to the end.
    #[allow(dead_code, reason = "a benchmark has its own scenario")]
    pub(crate) fn draw(class: Class, seed: u64, before_s: f64) -> Self {
        Self::of(&Scenario::draw(class, seed), before_s)
    }

    pub(crate) fn of(scenario: &Scenario, before_s: f64) -> Self {
        let simulated = simulate(scenario).unwrap();
        let samples = simulated.samples();
        let from = round_usize((simulated.truth.facts.trigger_at_s - before_s).max(0.01) * 100.0);
        let list: Vec<(u64, u8, Sample)> = samples[from..]
            .iter()
            .zip(schema::num::u64_of(from)..)
            .map(|(sample, index)| (index, 100, *sample))
            .collect();
        let start_s = (schema::num::real(from) - 1.0) * 0.01;
        let epochs = Epochs::from_samples(scenario.header(), &list, start_s, &[]).unwrap();
        Self::from_epochs(epochs, simulated.truth.rows.clone(), from)
    }

    /// Keeps the first `n` epochs.
    #[allow(dead_code, reason = "not every test cuts")]
    pub(crate) fn cut(&mut self, n: usize) {
        let mut epochs = self.epochs.clone();
        epochs.list.truncate(n);
        *self = Self::from_epochs(epochs, std::mem::take(&mut self.rows), self.from);
    }

    /// Looks again after the epochs were changed.
    #[allow(dead_code, reason = "not every test changes them")]
    pub(crate) fn look_again(&mut self) {
        self.cut(usize::MAX);
    }

    fn from_epochs(epochs: Epochs, rows: Vec<TruthRow>, from: usize) -> Self {
        let earth = Earth::flat();
        let rest = rest::find(&epochs, earth.gravity);
        let start = if rest.found() {
            start::at_rest(&epochs, &rest, &earth)
        } else {
            start::moving(&epochs, &earth)
        };
        let motion = Motion::look(&epochs.reversed(), &start, earth.gravity, &[]);
        Self {
            epochs,
            earth,
            rest,
            start,
            motion,
            road: RoadLimits::default(),
            tuning: reconstruct::refined::Tuning::default(),
            rows,
            from,
        }
    }

    /// The truth at the end of an epoch.
    #[allow(dead_code, reason = "not every test looks at the truth")]
    pub(crate) fn truth(&self, k: usize) -> &TruthRow {
        &self.rows[self.from + k]
    }

    pub(crate) fn setup(&self) -> Setup<'_> {
        Setup {
            anchor: None,
            reversed: self.epochs.reversed(),
            start: &self.start,
            motion: &self.motion,
            earth: self.earth,
            road: Some(&self.road),
            tuning: Tuning::default(),
        }
    }

    #[allow(dead_code, reason = "not every test stops there")]
    pub(crate) fn pass(&self) -> Passed {
        pass::run(Given {
            setup: &self.setup(),
            rest: &self.rest,
            tuning: &self.tuning,
            again: None,
            mounting: None,
        })
        .unwrap()
    }
}

/// Runs `test` with everything a ground borrows.
#[allow(dead_code, reason = "not every test takes the parts")]
pub(crate) fn with<T>(crash: &Crash, test: impl FnOnce(&Ground<'_>) -> T) -> T {
    let passed: Passed = crash.pass();
    let setup = crash.setup();
    let given = Given {
        setup: &setup,
        rest: &crash.rest,
        tuning: &crash.tuning,
        again: None,
        mounting: None,
    };
    test(&Ground {
        given,
        passed: &passed,
    })
}
