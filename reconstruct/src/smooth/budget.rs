//! The error budget: how much of a figure's variance comes from which source.
//!
//! With whitened rows `A` and `u = (A'A)^-1 a` the variance of a linear figure `a . x` is `a' (A'A)^-1 a = sum (row . u)^2`:
//! the error of the estimate is `sum (row . u) noise_row`, each noise with a variance of one. Turning a source off with the
//! gains kept takes exactly its rows out of the sum, so the shares add up to one. The noise of a step is one row for several
//! sources (sensor, vibration, gaps); it is divided by their parts of its covariance, and a wheel's by its parts of the
//! variance.
//!
//! Packing of the samples adds no source of its own: it is far below the sensor's noise [FORMAT.md]. A wheel's step is
//! "quantisation".

use nalgebra::{SMatrix, SVector, Vector3};

use super::arrow::{Factor, jumping};
use super::posterior::Solution;
use super::problem::{Measured, Problem, Stage};
use super::relinear::Ground;
use crate::error::ReconstructError;
use crate::error_model::STATES;
use crate::mechanize::backward;
use crate::refined::states::{
    BA, BG, CORIOLIS, DIM, LATENCY, LEVER, MOUNT_YAW, Nominal, Row, SA, SG, SLIP, TRACK, TURN,
    WHEEL_LEFT,
};
use crate::refined::tape::Source;
use crate::refined::transition::{Density, Transition};

/// A source of error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Cause {
    /// White noise of the accelerometer.
    AccelNoise,
    /// Vibration of the driving car in the accelerometer.
    AccelVibration,
    /// Accelerometer bias and its jump at an impact.
    AccelBias,
    /// Accelerometer scale.
    AccelScale,
    /// White noise of the gyro.
    GyroNoise,
    /// Vibration of the driving car in the gyro.
    GyroVibration,
    /// Gyro bias and its jump at an impact.
    GyroBias,
    /// Gyro scale and nonlinearity.
    GyroScale,
    /// Missing samples and samples at a sensor's limit.
    GapsAndLimits,
    /// Mounting angles.
    Mounting,
    /// Coriolis acceleration where latitude or heading is not known.
    Coriolis,
    /// Noise of the wheels.
    WheelNoise,
    /// Steps of the wheels' readings.
    Quantisation,
    /// Scale of the wheels.
    WheelScale,
    /// Delay of the wheels.
    WheelDelay,
    /// Track width.
    TrackWidth,
    /// Place of the IMU in the car.
    ImuPlace,
    /// Sideslip of the rear axle.
    SideSlip,
    /// The rear axle's vertical speed.
    NoJump,
    /// Road limits.
    RoadLimits,
    /// Satellite fixes.
    Fixes,
    /// Levelling at rest: noise of the mean, gravity.
    Levelling,
    /// Rest: springs, velocity, rate.
    Rest,
    /// Place, speed and direction at the start of the pass.
    Start,
}

impl Cause {
    /// Every cause.
    pub const ALL: [Self; 24] = [
        Self::AccelNoise,
        Self::AccelVibration,
        Self::AccelBias,
        Self::AccelScale,
        Self::GyroNoise,
        Self::GyroVibration,
        Self::GyroBias,
        Self::GyroScale,
        Self::GapsAndLimits,
        Self::Mounting,
        Self::Coriolis,
        Self::WheelNoise,
        Self::Quantisation,
        Self::WheelScale,
        Self::WheelDelay,
        Self::TrackWidth,
        Self::ImuPlace,
        Self::SideSlip,
        Self::NoJump,
        Self::RoadLimits,
        Self::Fixes,
        Self::Levelling,
        Self::Rest,
        Self::Start,
    ];

    /// Name in the outputs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::AccelNoise => "accelerometer noise",
            Self::AccelVibration => "accelerometer vibration",
            Self::AccelBias => "accelerometer bias",
            Self::AccelScale => "accelerometer scale",
            Self::GyroNoise => "gyro noise",
            Self::GyroVibration => "gyro vibration",
            Self::GyroBias => "gyro bias",
            Self::GyroScale => "gyro scale",
            Self::GapsAndLimits => "gaps and clipping",
            Self::Mounting => "mounting",
            Self::Coriolis => "Coriolis",
            Self::WheelNoise => "wheel noise",
            Self::Quantisation => "quantisation",
            Self::WheelScale => "wheel scale",
            Self::WheelDelay => "wheel delay",
            Self::TrackWidth => "track width",
            Self::ImuPlace => "place of the IMU",
            Self::SideSlip => "sideslip",
            Self::NoJump => "no jump",
            Self::RoadLimits => "road limits",
            Self::Fixes => "satellite fixes",
            Self::Levelling => "levelling",
            Self::Rest => "rest",
            Self::Start => "start",
        }
    }

    /// What the prior of a state belongs to.
    #[must_use]
    pub const fn of_state(state: usize) -> Self {
        match state {
            0..STATES => Self::Start,
            BA..SA => Self::AccelBias,
            SA..CORIOLIS => Self::AccelScale,
            CORIOLIS..MOUNT_YAW => Self::Coriolis,
            MOUNT_YAW..BG => Self::Mounting,
            BG..SG => Self::GyroBias,
            SG..WHEEL_LEFT => Self::GyroScale,
            LATENCY => Self::WheelDelay,
            TRACK => Self::TrackWidth,
            LEVER => Self::ImuPlace,
            TURN..SLIP => Self::Fixes,
            WHEEL_LEFT..LATENCY => Self::WheelScale,
            _ => Self::SideSlip,
        }
    }
}

/// A linear figure of the trajectory: the sum of `a . x` over some stages.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Its name.
    pub name: String,
    /// Stage in the order of the pass, sensitivity to the errors there.
    pub terms: Vec<(usize, Row)>,
}

/// Where the variance of a figure comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget {
    /// The figure.
    pub figure: String,
    /// Its standard deviation, in its own unit.
    pub sd: f64,
    /// Sources and their shares of the variance, the largest first; they add up to one.
    pub shares: Vec<(Cause, f64)>,
}

/// Sum of variances by cause.
struct Account([f64; Cause::ALL.len()]);

impl Account {
    fn add(&mut self, cause: Cause, variance: f64) {
        if let Some(at) = Cause::ALL.iter().position(|c| *c == cause) {
            self.0[at] += variance;
        }
    }
}

/// What the samples are believed to, part by part.
struct Parts<'a> {
    ground: &'a Ground<'a>,
    /// Density of an epoch without a gap at no speed.
    bare: Density,
}

impl<'a> Parts<'a> {
    fn new(ground: &'a Ground<'a>) -> Self {
        let epochs = ground.given.setup.reversed.forward();
        let most = Vector3::repeat(f64::INFINITY);
        let mut bare = Density {
            accel: most,
            rate: most,
        };
        for k in 0..epochs.list.len() {
            let density = ground.passed.inputs.density(epochs, k, 0.0);
            bare.accel = bare.accel.inf(&density.accel);
            bare.rate = bare.rate.inf(&density.rate);
        }
        Self { ground, bare }
    }

    /// Covariances of the noise of the step over epoch `k`, from the nominal at its end.
    fn of(&self, k: usize, from: &Nominal) -> [(Cause, SMatrix<f64, STATES, STATES>); 6] {
        let setup = self.ground.given.setup;
        let epochs = setup.reversed.forward();
        let inputs = &self.ground.passed.inputs;
        let imu = &epochs.header.imu;
        let f_b = from.moving_force(&inputs.accel[k]);
        let w_b = from.rate(&inputs.rate[k], &setup.earth);
        let dt = epochs.list[k].dt;
        let (_, view) = backward(&from.nav, f_b, w_b, dt, &setup.earth);
        let speed = from.nav.v_n.v.norm();
        let whole = inputs.density(epochs, k, speed);
        let still = inputs.density(epochs, k, 0.0);
        let extra = Density {
            accel: still.accel - self.bare.accel,
            rate: still.rate - self.bare.rate,
        };
        let zero = Vector3::zeros();
        let sheet = [imu.accel_density.powi(2), imu.rate_density.powi(2)].map(Vector3::repeat);
        let share = self.ground.given.tuning.rate_nonlinearity;
        let bent = w_b.v.map(|w| (share * w).powi(2));
        let q = |accel: Vector3<f64>, rate: Vector3<f64>| {
            let positive = |v: Vector3<f64>| v.map(|x| x.max(0.0));
            let density = Density {
                accel: positive(accel),
                rate: positive(rate),
            };
            Transition::moving(&view, &f_b, &w_b, dt, &density, &from.mounting()).q
        };
        [
            (Cause::AccelNoise, q(sheet[0], zero)),
            (
                Cause::AccelVibration,
                q(whole.accel - extra.accel - sheet[0], zero),
            ),
            (Cause::GyroNoise, q(zero, sheet[1])),
            (
                Cause::GyroVibration,
                q(zero, whole.rate - extra.rate - sheet[1]),
            ),
            (Cause::GapsAndLimits, q(extra.accel, extra.rate)),
            (Cause::GyroScale, q(zero, bent)),
        ]
    }
}

/// The budget of a figure about `trajectory`.
///
/// # Errors
/// [`ReconstructError::Numeric`] if the figure has no variance.
pub fn budget(
    ground: &Ground<'_>,
    problem: &Problem,
    factor: &Factor,
    trajectory: &[Nominal],
    figure: &Linear,
) -> Result<Budget, ReconstructError> {
    let mut account = Account([0.0; Cause::ALL.len()]);
    let solution = factor.solve(&factor.spread_of(&figure.terms), false);
    if let Some(first) = solution.states.first() {
        let nu = factor
            .prior_root
            .solve_lower_triangular(first)
            .unwrap_or_else(Row::zeros);
        for state in 0..DIM {
            account.add(Cause::of_state(state), nu[state] * nu[state]);
        }
    }
    let parts = Parts::new(ground);
    for (i, stage) in problem.stages.iter().enumerate() {
        if let Some(last) = i.checked_sub(1) {
            let from = (problem.stages[last].k, &trajectory[last]);
            step(&mut account, &parts, factor, &solution, last, stage, from);
        }
        for row in &problem.rows[stage.rows.clone()] {
            let by = row.h.dot(&solution.states[i]) * row.root_weight();
            measured(&mut account, ground, row, by * by);
        }
    }
    let total: f64 = account.0.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return Err(ReconstructError::Numeric {
            place: "error budget",
            what: format!(
                "{}: expected a positive variance, found {total}",
                figure.name
            ),
        });
    }
    let mut shares: Vec<(Cause, f64)> = Cause::ALL
        .iter()
        .zip(account.0)
        .map(|(cause, v)| (*cause, v / total))
        .collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    Ok(Budget {
        figure: figure.name.clone(),
        sd: total.sqrt(),
        shares,
    })
}

/// Noise of the step behind link `i` and the jump in it.
fn step(
    account: &mut Account,
    parts: &Parts<'_>,
    factor: &Factor,
    solution: &Solution,
    i: usize,
    stage: &Stage,
    (k, from): (usize, &Nominal),
) {
    let w = &solution.noise[i];
    let link = &factor.links[i];
    if link.leap.is_some() {
        for (j, v) in solution.jump[i].iter().enumerate() {
            account.add(Cause::of_state(jumping(j)), v * v);
        }
    }
    account.add(Cause::SideSlip, w[STATES] * w[STATES]);
    let w: SVector<f64, STATES> = w.fixed_rows::<STATES>(0).into_owned();
    let own = w.norm_squared();
    if own == 0.0 {
        return;
    }
    let whole = stage.transition.is_some_and(|t| !t.stands()).then(|| {
        let l = link.l.fixed_view::<STATES, STATES>(0, 0).into_owned();
        l.tr_solve_lower_triangular(&w)
    });
    match whole.flatten() {
        Some(s) => {
            let by = parts
                .of(k, from)
                .map(|(cause, q)| (cause, s.dot(&(q * s)).max(0.0)));
            let sum: f64 = by.iter().map(|(_, v)| v).sum();
            for (cause, v) in by {
                account.add(cause, if sum > 0.0 { own * v / sum } else { 0.0 });
            }
        }
        // Nothing moves but the springs.
        None => account.add(Cause::Rest, own),
    }
}

fn measured(account: &mut Account, ground: &Ground<'_>, row: &Measured, variance: f64) {
    let cause = match row.source {
        Source::Rest | Source::RestRate => Cause::Rest,
        Source::Levelling => Cause::Levelling,
        Source::SideSlip => Cause::SideSlip,
        Source::Jump => Cause::NoJump,
        Source::Road => Cause::RoadLimits,
        Source::Fix => Cause::Fixes,
        Source::Wheel => {
            let header = &ground.given.setup.reversed.forward().header;
            let share = (header.wheel_scale.step.powi(2) / 12.0 / row.r).min(1.0);
            account.add(Cause::Quantisation, variance * share);
            account.add(Cause::WheelNoise, variance * (1.0 - share));
            return;
        }
    };
    account.add(cause, variance);
}
