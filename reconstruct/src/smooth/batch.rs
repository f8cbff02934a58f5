//! The batch smoother: all epochs at once, linearised about the solution, with robust losses and limits.
//!
//! Gauss-Newton from the fixed-interval smoother's trajectory. At each linearisation the rows of wheels, sideslip, no-jump
//! and road get Huber's weight for their residual. Where the solution crosses a limit it is sought again with a row for each
//! limit crossed ([`super::limits`]). It ends where no state would move by more than a hundredth of its standard deviation. One that does
//! not end is an error.
//!
//! The covariance is that of the last linearisation, with the robust weights and without the limits' rows: recursions over
//! the blocks of the factor give it for every epoch ([`super::posterior`]).

use super::arrow::{Factor, factor, factor_into};
use super::limits::{self, LimitUse};
use super::problem::Problem;
use super::relinear::Ground;
use super::rts;
use crate::error::ReconstructError;
use crate::error_model::ATT;
use crate::refined::states::{DIM, Nominal, Row};
use crate::refined::tape::{Source, Tape};

/// Huber's bound: residuals beyond so many of their own standard deviations count linearly.
const HUBER: f64 = 2.5;
/// Largest step that counts as none, in standard deviations of the filter.
const CONVERGED: f64 = 0.01;
/// Standard deviations below these count as these: a heading that is zero by definition need not settle to a nanoradian.
/// Position, m; velocity, m/s; angles, rad.
const FINE: [f64; 3] = [1e-3, 1e-3, 2e-4];
/// Largest turn of the attitude in one step, rad: rows are linear that far.
const TURN: f64 = 0.2;
/// Most linearisations.
const MOST: usize = 60;
/// The first linearisations with limits keep the limits so many times less closely: a set of limits chosen far from the solution is
/// the wrong one.
const FEW: u64 = 10;
const SOFT: [f64; 5] = [30.0, 12.0, 6.0, 3.0, 1.7];

/// A solved record.
#[derive(Clone, Debug)]
pub struct Batch {
    /// One nominal a step, in the order of the pass.
    pub trajectory: Vec<Nominal>,
    /// The problem of the last linearisation, without limits.
    pub problem: Problem,
    /// Its factor.
    pub factor: Factor,
    /// Linearisations needed.
    pub linearisations: usize,
    /// Largest step of any state that is left, in standard deviations of the filter.
    pub left: f64,
    /// Limits that held the trajectory.
    pub limits: LimitUse,
    /// Rows whose residual was beyond Huber's bound, by source.
    pub outlying: Vec<(Source, u64)>,
}

impl Batch {
    /// What the sweep solved, about its own answer: its error budget and sample paths. Nothing is weighed again and no
    /// limit holds.
    ///
    /// # Errors
    /// [`ReconstructError::Numeric`] if the arithmetic fails.
    pub fn about_sweep(ground: &Ground<'_>) -> Result<Self, ReconstructError> {
        let trajectory = rts::means(&ground.passed.tape);
        let problem = ground.problem(&trajectory);
        let factor = factor(&problem)?;
        Ok(Self {
            trajectory,
            problem,
            factor,
            linearisations: 1,
            left: 0.0,
            limits: LimitUse::default(),
            outlying: Vec::new(),
        })
    }
}

/// Solves a record: without the limits until it settles, then, where the trajectory crosses one, with them.
///
/// # Errors
/// [`ReconstructError::Numeric`] if the arithmetic fails or the solution does not settle.
pub fn solve(ground: &Ground<'_>) -> Result<Batch, ReconstructError> {
    let tape = &ground.passed.tape;
    let mut trajectory = rts::means(tape);
    let mut spare = Vec::new();
    let mut held_since = None;
    let mut last: Vec<Row> = Vec::new();
    let (mut step, mut left) = (f64::INFINITY, f64::INFINITY);
    for round in 1..=MOST {
        let mut plain = ground.problem(&trajectory);
        let outlying = weigh(&mut plain);
        let age = held_since.map(|since: usize| round.saturating_sub(since));
        let soft = age.map_or(1.0, |age| SOFT.get(age).copied().unwrap_or(1.0));
        let (used, held) = match age {
            Some(_) => limits::hold(ground, &plain, &trajectory, soft),
            None => (LimitUse::default(), None),
        };
        let solved = factor_into(held.as_ref().unwrap_or(&plain), spare)?;
        let before = step;
        let means = solved.means();
        let whole = !turns_back(&means, &last, tape);
        let share = if whole { 1.0 } else { 0.5 };
        step = advance(&mut trajectory, &means, tape, share);
        last = means;
        if !step.is_finite() {
            break;
        }
        // Steps shrink by a steady share where no limit joins or leaves: the next one is known before it is made.
        let shrinks = held.is_none() && before.is_finite();
        left = if shrinks {
            step * (step / before).min(1.0)
        } else {
            step
        };
        // After half a step nothing is known of the share.
        if !whole {
            step = f64::INFINITY;
        }
        if left < CONVERGED && whole && soft <= 1.0 {
            let crossed = limits::hold(ground, &plain, &trajectory, 1.0).0;
            if age.is_some() || crossed.total() == 0 {
                // With limits the covariance is that without them.
                let factor = if held.is_some() {
                    factor(&plain)?
                } else {
                    solved
                };
                return Ok(Batch {
                    trajectory,
                    problem: plain,
                    factor,
                    linearisations: round,
                    left,
                    limits: used,
                    outlying,
                });
            }
            // Few limits crossed are as good as known.
            let few = crossed.total() <= FEW;
            held_since = Some(if few {
                (round + 1).saturating_sub(SOFT.len() - 1)
            } else {
                round + 1
            });
        }
        spare = solved.links;
    }
    Err(ReconstructError::Numeric {
        place: "batch smoother",
        what: format!(
            "expected to settle within {MOST} linearisations, found a step of {left:.3} standard deviations left ({}); the sweep (rts) needs no settling",
            if held_since.is_some() {
                "held by the road's and the sensors' limits"
            } else {
                "without limits"
            }
        ),
    })
}

/// True if a step takes back most of the one before it: Gauss-Newton swings about a solution that lies between, and half
/// the step is near it (a gap swung by -0.99 a round). Measured in variances of the filter.
fn turns_back(means: &[Row], last: &[Row], tape: &Tape) -> bool {
    let (mut both, mut old) = (0.0, 0.0);
    for ((x, y), own) in means.iter().zip(last).zip(&tape.steps) {
        for s in 0..DIM {
            let variance = own.p[(s, s)].max(0.0) + fine(s).powi(2);
            both += x[s] * y[s] / variance;
            old += y[s] * y[s] / variance;
        }
    }
    both < -0.5 * old
}

/// Moves the trajectory by a share of the means, the attitude by no more than [`TURN`]; gives the largest whole step in
/// standard deviations of the filter.
fn advance(trajectory: &mut [Nominal], means: &[Row], tape: &Tape, share: f64) -> f64 {
    let turn = means
        .iter()
        .map(|x| x.fixed_rows::<3>(ATT).norm())
        .fold(0.0, f64::max);
    let share = share * if turn > TURN { TURN / turn } else { 1.0 };
    let mut step: f64 = 0.0;
    for ((x, nominal), own) in means.iter().zip(trajectory).zip(&tape.steps) {
        let size = largest(x, |s| own.p[(s, s)]);
        step = if size.is_nan() { size } else { step.max(size) };
        *nominal = nominal.corrected(&(x * share));
        if step.is_nan() {
            return step;
        }
    }
    step
}

/// Standard deviation below which one of a state counts as this.
fn fine(state: usize) -> f64 {
    FINE.get(state / 3).copied().unwrap_or(1e-9)
}

/// Largest entry over its standard deviation.
fn largest(x: &Row, variance: impl Fn(usize) -> f64) -> f64 {
    (0..DIM)
        .map(|s| x[s].abs() / variance(s).max(0.0).sqrt().max(fine(s)))
        .fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
}

/// Huber's weights at the residuals about the trajectory.
fn weigh(problem: &mut Problem) -> Vec<(Source, u64)> {
    let robust = [Source::Wheel, Source::SideSlip, Source::Jump, Source::Road];
    let mut outlying = robust.map(|source| (source, 0_u64)).to_vec();
    for row in &mut problem.rows {
        let Some((_, count)) = outlying
            .iter_mut()
            .find(|(source, _)| *source == row.source)
        else {
            continue;
        };
        let size = row.residual.abs() / row.r.sqrt();
        if size > HUBER {
            row.weight = HUBER / size;
            *count += 1;
        }
    }
    outlying
}
