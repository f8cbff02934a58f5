//! The refined model: the nine states with everything that bends them estimated beside them, and smoothed.
//!
//! [`pass`] runs backwards from rest over [`states`] (30) with the rows of [`measure`] and the steps of [`transition`], and
//! writes a [`tape`]. [`crate::smooth`] sweeps back over it. The result is the same kind of snapshot that every model gives,
//! so findings, funnel and report do not know which model ran.

pub mod inputs;
pub mod measure;
pub mod pass;
pub mod states;
pub mod tape;
pub mod transition;
pub mod tuning;

use nalgebra::{SMatrix, Vector3};

use crate::error::ReconstructError;
use crate::error_model::{ATT, STATES};
use crate::filter::{Setup, Snapshot};
use crate::findings::WheelUse;
use crate::rest::RestInterval;
use crate::smooth::{Smoother, product};
use crate::smooth::batch::{self, Batch};
use crate::smooth::posterior::nine;
use crate::smooth::relinear::Ground;
use crate::smooth::rts::{Adjoint, cross_covariance};
use pass::{Given, Passed};
use states::{BA, Cov, Nominal, Row, SA};
pub use tuning::Tuning;

/// Nine errors at the start of a pulse and nine at its end, estimate minus truth.
pub type Joint = SMatrix<f64, { 2 * STATES }, { 2 * STATES }>;

/// What the refined model gives.
#[derive(Clone, Debug)]
pub struct Refined {
    /// One snapshot an epoch, in recording order.
    pub snapshots: Vec<Snapshot>,
    /// Use of the wheels.
    pub wheels: WheelUse,
    /// Joint covariance at `pulse.before` and `pulse.last` of each impact.
    pub joint: Vec<Option<Joint>>,
    /// Calibration before the first impact (at the first epoch) and its covariance, all states.
    pub before: (Nominal, Cov),
    /// Calibration at the end of the record.
    pub after: (Nominal, Cov),
    /// The pass, for the batch solve, the error budget and the findings of faults.
    pub passed: Passed,
    /// The batch solve, if it was asked for: sample paths and error budgets.
    pub batch: Option<Box<Batch>>,
}

/// Runs filter and smoother.
///
/// # Errors
/// As [`pass::run`] and [`batch::solve`].
pub fn run(
    setup: &Setup<'_>,
    rest: &RestInterval,
    tuning: &Tuning,
    smoother: Smoother,
) -> Result<Refined, ReconstructError> {
    let given = Given {
        setup,
        rest,
        tuning,
    };
    let passed = pass::run(given)?;
    let answer = match smoother {
        Smoother::Batch => by_batch(&Ground {
            given,
            passed: &passed,
        })?,
        Smoother::Rts | Smoother::None => by_sweep(setup, &passed, smoother),
    };
    let missing = || ReconstructError::Numeric {
        place: "refined model",
        what: "the record has no sample to start from".to_owned(),
    };
    // What comes behind the start stands still, or was not heard.
    let list = answer.list;
    let held = list
        .iter()
        .rev()
        .flatten()
        .next()
        .cloned()
        .ok_or_else(missing)?;
    let snapshots = list
        .into_iter()
        .map(|s| s.unwrap_or_else(|| held.clone()))
        .collect();
    Ok(Refined {
        snapshots,
        wheels: passed.wheels,
        joint: answer.joint,
        before: answer.before.ok_or_else(missing)?,
        after: answer.after.ok_or_else(missing)?,
        batch: answer.batch,
        passed,
    })
}

/// What a smoother gives.
struct Answer {
    list: Vec<Option<Snapshot>>,
    joint: Vec<Option<Joint>>,
    before: Option<(Nominal, Cov)>,
    after: Option<(Nominal, Cov)>,
    batch: Option<Box<Batch>>,
}

fn by_sweep(setup: &Setup<'_>, passed: &Passed, smoother: Smoother) -> Answer {
    let steps = &passed.tape.steps;
    let impacts = &setup.motion.impacts;
    let mut answer = Answer {
        list: vec![None; setup.reversed.forward().list.len()],
        joint: vec![None; impacts.len()],
        before: None,
        after: None,
        batch: None,
    };
    let mut adjoint = Adjoint::last();
    for (i, step) in steps.iter().enumerate().rev() {
        let nominal = adjoint.nominal(&step.nominal, &step.p);
        let nine = adjoint.covariance::<STATES>(&step.p);
        let variance = |h: &Row| adjoint.variance(&step.p, h);
        answer.list[step.k] = Some(snapshot(setup, passed, step.k, &nominal, &nine, variance));
        for (pulse, joint) in impacts.iter().zip(&mut answer.joint) {
            // The pulse's end is passed first, on the way back from rest.
            if pulse.before == step.k && pulse.last <= setup.start.k && pulse.last > pulse.before {
                *joint = joint_of(passed, i, pulse.last - pulse.before, &adjoint);
            }
        }
        if i + 1 == steps.len() {
            answer.before = Some((nominal, adjoint.whole(&step.p)));
        }
        if i == 0 {
            answer.after = Some((nominal, adjoint.whole(&step.p)));
        }
        if smoother == Smoother::Rts {
            adjoint.retreat(&passed.tape, i);
        }
    }
    answer
}

fn by_batch(ground: &Ground<'_>) -> Result<Answer, ReconstructError> {
    let setup = ground.given.setup;
    let impacts = &setup.motion.impacts;
    let solved = batch::solve(ground)?;
    let steps = &ground.passed.tape.steps;
    let mut answer = Answer {
        list: vec![None; setup.reversed.forward().list.len()],
        joint: vec![None; impacts.len()],
        before: None,
        after: None,
        batch: None,
    };
    // Of each impact: stage and covariance of the pulse's start, until its end is reached.
    let mut open: Vec<Option<(usize, Cov)>> = vec![None; impacts.len()];
    solved.factor.covariances(|i, p| {
        let k = steps[i].k;
        let nominal = solved.trajectory[i];
        let variance = |h: &Row| h.dot(&product(p, h));
        answer.list[k] = Some(snapshot(
            setup,
            ground.passed,
            k,
            &nominal,
            &nine(p),
            variance,
        ));
        for ((pulse, open), joint) in impacts.iter().zip(&mut open).zip(&mut answer.joint) {
            if pulse.before == k && pulse.last <= setup.start.k && pulse.last > pulse.before {
                *open = Some((i, *p));
            }
            if pulse.last == k
                && let Some((late, p_late)) = open.take()
            {
                let cross = solved.factor.cross(i, late, &p_late);
                *joint = Some(joined(&p_late, p, &cross));
            }
        }
        if i + 1 == steps.len() {
            answer.before = Some((nominal, *p));
        }
        if i == 0 {
            answer.after = Some((nominal, *p));
        }
    });
    answer.batch = Some(Box::new(solved));
    Ok(answer)
}

/// From the covariances of the pulse's start and end and their cross covariance (rows: the end).
fn joined(start: &Cov, end: &Cov, cross: &Cov) -> Joint {
    let mut joint = Joint::zeros();
    let block = nine(cross);
    joint
        .fixed_view_mut::<STATES, STATES>(0, 0)
        .copy_from(&nine(start));
    joint
        .fixed_view_mut::<STATES, STATES>(STATES, STATES)
        .copy_from(&nine(end));
    joint
        .fixed_view_mut::<STATES, STATES>(STATES, 0)
        .copy_from(&block);
    joint
        .fixed_view_mut::<STATES, STATES>(0, STATES)
        .copy_from(&block.transpose());
    joint
}

/// Joint covariance of step `late` (a pulse's start) and of the one `length` epochs after it in time.
fn joint_of(passed: &Passed, late: usize, length: usize, at_late: &Adjoint) -> Option<Joint> {
    let tape = &passed.tape;
    let early = late.checked_sub(length)?;
    // The adjoint of the pulse's end: further back over the steps of the pulse.
    let mut at_early = *at_late;
    for i in (early + 1..=late).rev() {
        at_early.retreat(tape, i);
    }
    let cross = cross_covariance(tape, early, late, at_late);
    Some(joined(
        &at_late.whole(&tape.steps[late].p),
        &at_early.whole(&tape.steps[early].p),
        &cross,
    ))
}

fn snapshot(
    setup: &Setup<'_>,
    passed: &Passed,
    k: usize,
    nominal: &Nominal,
    p: &SMatrix<f64, STATES, STATES>,
    variance: impl Fn(&Row) -> f64,
) -> Snapshot {
    let epochs = setup.reversed.forward();
    let epoch = &epochs.list[k];
    let speed = nominal.nav.v_n.v.norm();
    let density = passed.inputs.density(epochs, k, speed);
    // Acceleration along a body axis free of gravity: `e . (C' (psi x g) + ba + sa f)` and noise.
    let sd_accel = [0, 1].map(|axis| {
        let a: Vector3<f64> = nominal.nav.c_nb.m.column(axis).into_owned();
        let tilt = Vector3::new(0.0, 0.0, setup.earth.gravity).cross(&a);
        let mut h = Row::zeros();
        h.fixed_rows_mut::<3>(ATT).copy_from(&tilt);
        h[BA + axis] = 1.0;
        h[SA + axis] = epoch.accel[axis];
        (variance(&h) + density.accel[axis] / epoch.dt)
            .max(0.0)
            .sqrt()
    });
    Snapshot {
        nav: nominal.nav,
        p: *p,
        sd_accel,
        wheels_used: passed.wheels_used[k],
    }
}
