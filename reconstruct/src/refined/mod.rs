//! The refined model: the nine states with everything that bends them estimated beside them, and smoothed.
//!
//! [`pass`] runs backwards from rest over [`states`] (36) with the rows of [`measure`] and the steps of [`transition`], and
//! writes a [`tape`]. [`crate::smooth`] sweeps back over it. The result is the same kind of snapshot that every model gives,
//! so findings, funnel and report do not know which model ran.

pub mod inputs;
pub mod measure;
pub mod pass;
mod prior;
pub(crate) mod running;
pub mod states;
pub mod tape;
pub mod transition;
pub mod tuning;

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::error::ReconstructError;
use crate::error_model::{ATT, POS, STATES};
use crate::filter::{Setup, Snapshot};
use crate::findings::WheelUse;
use crate::findings::delta_v::JointPulse;
use crate::mechanize::free_of_gravity;
use crate::motion::{Motion, SMOOTH_S, centred_mean};
use crate::rest::RestInterval;
use crate::smooth::batch::{self, Batch};
use crate::smooth::posterior::nine;
use crate::smooth::relinear::Ground;
use crate::smooth::rts::{Adjoint, cross_covariance};
use crate::smooth::{Smoother, product};
use inputs::Mounting;
use pass::{Given, Passed};
use states::{BA, Cov, Nominal, PLACE, Row, SA, TURN};
pub use tuning::Tuning;

/// Passes after the first where no rest was found.
const AGAIN: usize = 2;
/// Turn hidden by a gap or a gyro at its limit, one sigma, rad, beyond which the pass is not linear about the truth.
const HIDDEN_TURN: f64 = 0.005;
/// Cosine of the tilt beyond which a car rolls over: a tilt error then turns into one of the heading, and back.
const UPRIGHT: f64 = 0.7;

/// What the refined model gives.
#[derive(Clone, Debug)]
pub struct Refined {
    /// One snapshot an epoch, in recording order.
    pub snapshots: Vec<Snapshot>,
    /// Smoothed nominals in recording order; `None` behind the start.
    pub nominals: Vec<Option<Nominal>>,
    /// Covariance of the anchor's pose (place north, east, turn; truth less estimate) with north, east and the angle about
    /// down (estimate less truth) in recording order; empty without an anchor.
    pub shared: Vec<Matrix3<f64>>,
    /// Use of the wheels.
    pub wheels: WheelUse,
    /// Joint covariance at `pulse.before` and `pulse.last` of each impact.
    pub joint: Vec<Option<JointPulse>>,
    /// Calibration before the first impact (at the first epoch) and its covariance, all states.
    pub before: (Nominal, Cov),
    /// Calibration at the end of the record.
    pub after: (Nominal, Cov),
    /// The pass, for the batch solve, the error budget and the findings of faults.
    pub passed: Passed,
    /// The batch solve, if it ran: sample paths and error budgets.
    pub batch: Option<Box<Batch>>,
    /// Smoother that gave the answer.
    pub smoother: Smoother,
    /// Why the batch solve was needed and is not behind the answer: the bounds may be too narrow.
    pub unsettled: Option<String>,
}

impl Refined {
    /// The first look again, with the calibration and the attitude that the refined model found, and with what it made of
    /// a gyro at its limit.
    #[must_use]
    pub fn motion(&self, setup: &Setup<'_>) -> Motion {
        let epochs = setup.reversed.forward();
        let inputs = &self.passed.inputs;
        let gravity = setup.earth.gravity;
        let mut motion = setup.motion.clone();
        for (k, (epoch, nominal)) in epochs.list.iter().zip(&self.nominals).enumerate() {
            motion.rate_doubt[k] = inputs.rate_doubt[k];
            let Some(nominal) = nominal else { continue };
            let w = nominal.rate(&inputs.rate[k], &setup.earth);
            let mid = nominal.nav.c_nb.turned(w.scale(-0.5 * epoch.dt));
            // A sample that was lost or clipped is not made up: the pulse is as it was seen.
            let accel = if epoch.clipped[..3] == [0.0; 3] {
                inputs.accel[k]
            } else {
                epoch.accel
            };
            motion.accel[k] = free_of_gravity(&nominal.force(&accel).v, &mid, gravity);
            motion.rate[k] = w.v;
        }
        motion.smooth = centred_mean(epochs, &motion.accel, SMOOTH_S);
        motion
    }
}

/// Runs filter and smoother. Asked for the sweep, it takes the batch solve where the sweep is not linear about the truth:
/// without rest, where a gap or a gyro at its limit hides a turn, and in a roll-over.
///
/// # Errors
/// As [`pass::run`], and as [`batch::solve`] if that is asked for.
pub fn run(
    setup: &Setup<'_>,
    rest: &RestInterval,
    tuning: &Tuning,
    smoother: Smoother,
) -> Result<Refined, ReconstructError> {
    let mut given = Given {
        setup,
        rest,
        tuning,
        again: None,
        mounting: None,
    };
    let mut passed = pass::run(given)?;
    if !rest.found() {
        // Without rest the first guess of speed and tilt is far off, and what is linear about it is not about the
        // truth: the pass starts again from what the smoother made of it. The spread of the guess is so wide beside
        // the answer's that its middle does not matter.
        for _ in 0..AGAIN {
            given.again = smoothed_start(&passed).map(|nominal| nominal.nav);
            passed = pass::run(given)?;
        }
    }
    if passed.inputs.clipped_s[..3].iter().any(|s| *s > 0.0) {
        given.mounting = passed.tape.steps.last().map(Mounting::of);
        passed = pass::run(given)?;
    }
    let ground = Ground {
        given,
        passed: &passed,
    };
    let mut unsettled = None;
    // What the pass takes for knowledge where it changes its mind about the heading is none: in a record that ends
    // moving it put the gyro's bias at 0.06 deg/s, its own solution at 0.18 (rav4, 45 m off at 746 m with 19 m stated).
    let bent = !rest.found()
        || passed.inputs.hidden_turn(setup) > HIDDEN_TURN
        || passed
            .tape
            .steps
            .iter()
            .any(|step| step.nominal.nav.c_nb.m.m33 < UPRIGHT);
    let (used, answer) = match smoother {
        Smoother::Batch => (Smoother::Batch, by_batch(&ground)?),
        Smoother::Rts if bent => match by_batch(&ground) {
            Ok(answer) => (Smoother::Batch, answer),
            Err(error) => {
                unsettled = Some(error.to_string());
                (Smoother::Rts, by_sweep(setup, &passed, smoother))
            }
        },
        Smoother::Rts | Smoother::None => (smoother, by_sweep(setup, &passed, smoother)),
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
        nominals: answer.nominals,
        shared: answer.shared,
        wheels: passed.wheels,
        joint: answer.joint,
        before: answer.before.ok_or_else(missing)?,
        after: answer.after.ok_or_else(missing)?,
        batch: answer.batch,
        smoother: used,
        unsettled,
        passed,
    })
}

/// The smoothed nominal of the pass's first step.
fn smoothed_start(passed: &Passed) -> Option<Nominal> {
    let first = passed.tape.steps.first()?;
    let mut adjoint = Adjoint::last();
    for i in (1..passed.tape.steps.len()).rev() {
        adjoint.retreat(&passed.tape, i);
    }
    Some(adjoint.nominal(&first.nominal, &first.p))
}

/// What a smoother gives.
struct Answer {
    list: Vec<Option<Snapshot>>,
    shared: Vec<Matrix3<f64>>,
    nominals: Vec<Option<Nominal>>,
    joint: Vec<Option<JointPulse>>,
    before: Option<(Nominal, Cov)>,
    after: Option<(Nominal, Cov)>,
    batch: Option<Box<Batch>>,
}

/// States of the anchor's pose.
const POSE: [usize; 3] = [PLACE, PLACE + 1, TURN];
/// States of the path that lie in the level plane.
const WAY: [usize; 3] = [POS, POS + 1, ATT + 2];

/// Room for what pose and path share, where there is an anchor. What comes behind the start shares nothing with it.
fn none_shared(setup: &Setup<'_>) -> Vec<Matrix3<f64>> {
    let epochs = setup.reversed.forward().list.len();
    let count = setup.anchor.map_or(0, |_| epochs);
    vec![Matrix3::zeros(); count]
}

fn by_sweep(setup: &Setup<'_>, passed: &Passed, smoother: Smoother) -> Answer {
    let steps = &passed.tape.steps;
    let impacts = &setup.motion.impacts;
    let mut answer = Answer {
        list: vec![None; setup.reversed.forward().list.len()],
        shared: none_shared(setup),
        nominals: vec![None; setup.reversed.forward().list.len()],
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
        answer.nominals[step.k] = Some(nominal);
        if let Some(shared) = answer.shared.get_mut(step.k) {
            *shared = adjoint.between(&step.p, POSE, WAY);
        }
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
        shared: none_shared(setup),
        nominals: vec![None; setup.reversed.forward().list.len()],
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
        answer.nominals[k] = Some(nominal);
        if let Some(shared) = answer.shared.get_mut(k) {
            *shared = Matrix3::from_fn(|r, c| p[(POSE[r], WAY[c])]);
        }
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
fn joined(start: &Cov, end: &Cov, cross: &Cov) -> JointPulse {
    let mut covariance = SMatrix::<f64, { 2 * STATES }, { 2 * STATES }>::zeros();
    let mut put = |r: usize, c: usize, m: SMatrix<f64, STATES, STATES>| {
        covariance
            .fixed_view_mut::<STATES, STATES>(r, c)
            .copy_from(&m);
    };
    let block = nine(cross);
    put(0, 0, nine(start));
    put(STATES, STATES, nine(end));
    put(STATES, 0, block);
    put(0, STATES, block.transpose());
    JointPulse { covariance }
}

/// Joint covariance of step `late` (a pulse's start) and of the one `length` epochs after it in time.
fn joint_of(passed: &Passed, late: usize, length: usize, at_late: &Adjoint) -> Option<JointPulse> {
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
        accel_noise: [density.accel[0], density.accel[1]],
        wheels_used: passed.wheels_used[k],
    }
}
