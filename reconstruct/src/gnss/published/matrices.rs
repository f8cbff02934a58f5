//! The model of the filter: phi, H, R, Q and the initial P [S00, 3.2 to 3.10].
#![allow(
    non_snake_case,
    reason = "matrices keep the names they have in the literature"
)]

use nalgebra::{SMatrix, SVector};

use super::constants::{Noise, P0, Process};
use super::variant::{Reading, Source};

/// States of the filter.
pub const STATES: usize = 15;
/// First of three ECEF positions, m.
pub const POS: usize = 0;
/// First of three ECEF velocities, m/s.
pub const VEL: usize = 3;
/// First of roll, pitch, yaw, rad.
pub const ATT: usize = 6;
/// Yaw, rad.
pub const YAW: usize = 8;
/// First of three body rates, rad/s.
pub const RATE: usize = 9;
/// First of three gyro biases, rad/s.
pub const BIAS: usize = 12;

/// The states (3.1), 15.
pub type State = SVector<f64, STATES>;
/// A matrix over the states, 15 x 15.
pub type Cov = SMatrix<f64, STATES, STATES>;

/// State that each row of `H1` measures (3.4): fix position, fix velocity, inertial velocity, roll, pitch, yaw, rates.
///
/// (3.6) prints 13 rows: those of the rates about y and z are missing. The program prints 14: that about z is
/// missing. `z1` and `R1` have 15.
pub const H1_STATES: [usize; 15] = [0, 1, 2, 3, 4, 5, 3, 4, 5, 6, 7, 8, 9, 10, 11];
/// State that each row of `H2` measures (3.5): inertial velocity, roll, pitch, rates.
///
/// (3.7) prints a ninth row, of yaw, which `z2` and `R2` do not have.
pub const H2_STATES: [usize; 8] = [3, 4, 5, 6, 7, 9, 10, 11];

/// F of `x' = F x + w` behind (3.2), 15 x 15: position by velocity, angle by rate less bias.
#[must_use]
pub fn f_matrix() -> Cov {
    let mut F = Cov::zeros();
    for axis in 0..3 {
        F[(POS + axis, VEL + axis)] = 1.0;
        F[(ATT + axis, RATE + axis)] = 1.0;
        F[(ATT + axis, BIAS + axis)] = -1.0;
    }
    F
}

/// phi over `dt` seconds (3.3), 15 x 15; `exp(F dt)`, exact, as F squared is 0.
///
/// [`Source::Text`] keeps row 9 as printed, a plain 1: (3.2i) and the program have `+dt` of the rate and `-dt` of the
/// bias there, and without them yaw never follows the gyro.
#[must_use]
pub fn phi(dt: f64, source: Source) -> Cov {
    let mut phi = Cov::identity() + f_matrix() * dt;
    if source == Source::Text {
        phi[(YAW, RATE + 2)] = 0.0;
        phi[(YAW, BIAS + 2)] = 0.0;
    }
    phi
}

/// A matrix of M x 15 whose row i takes state `states[i]`.
#[must_use]
pub fn selection<const M: usize>(states: &[usize; M]) -> SMatrix<f64, M, STATES> {
    SMatrix::from_fn(|row, column| if states[row] == column { 1.0 } else { 0.0 })
}

/// `H1` (3.6) with a fix, 15 x 15, the rows that print dropped put back.
#[must_use]
pub fn h1() -> SMatrix<f64, 15, STATES> {
    selection(&H1_STATES)
}

/// `H2` (3.7) without a fix, 8 x 15, the row that print added left out.
#[must_use]
pub fn h2() -> SMatrix<f64, 8, STATES> {
    selection(&H2_STATES)
}

/// Variances of the rows of `H1` (3.9), 15.
#[must_use]
pub fn r1_diagonal(noise: &Noise) -> SVector<f64, 15> {
    let (p, g, i, w) = (
        noise.position,
        noise.velocity_gnss,
        noise.velocity_imu,
        noise.rate,
    );
    SVector::from([
        p,
        p,
        p,
        g,
        g,
        g,
        i,
        i,
        i,
        noise.roll,
        noise.pitch,
        noise.yaw,
        w[0],
        w[1],
        w[2],
    ])
}

/// Variances of the rows of `H2` (3.10), 8.
#[must_use]
pub fn r2_diagonal(noise: &Noise) -> SVector<f64, 8> {
    let (i, w) = (noise.velocity_imu, noise.rate);
    SVector::from([i, i, i, noise.roll, noise.pitch, w[0], w[1], w[2]])
}

/// `R1` (3.9), 15 x 15.
#[must_use]
pub fn r1(noise: &Noise) -> SMatrix<f64, 15, 15> {
    SMatrix::from_diagonal(&r1_diagonal(noise))
}

/// `R2` (3.10), 8 x 8.
#[must_use]
pub fn r2(noise: &Noise) -> SMatrix<f64, 8, 8> {
    SMatrix::from_diagonal(&r2_diagonal(noise))
}

/// Q over `dt` seconds in closed form, 15 x 15 [S00, 3.8 and the program].
///
/// Published, the bias enters the angle's variance as `-q5 dt^3 / 3`; the integral gives plus, whatever the sign of
/// the bias in (3.2g). Corrected is the integral, term by term.
#[must_use]
pub fn q(process: &Process, dt: f64, reading: Reading) -> Cov {
    let (second, third) = (dt * dt / 2.0, dt * dt * dt / 3.0);
    let sign = match reading {
        Reading::Published => -1.0,
        Reading::Corrected => 1.0,
    };
    let mut Q = Cov::zeros();
    for axis in 0..3 {
        let (r, v) = (POS + axis, VEL + axis);
        Q[(r, r)] = process.position * dt + process.velocity * third;
        Q[(r, v)] = process.velocity * second;
        Q[(v, r)] = Q[(r, v)];
        Q[(v, v)] = process.velocity * dt;
        let (a, w, b) = (ATT + axis, RATE + axis, BIAS + axis);
        let rate = process.rate[axis];
        Q[(a, a)] = process.angle[axis] * dt + rate * third + sign * process.bias * third;
        Q[(a, w)] = rate * second;
        Q[(w, a)] = Q[(a, w)];
        Q[(w, w)] = rate * dt;
        Q[(a, b)] = -process.bias * second;
        Q[(b, a)] = Q[(a, b)];
        Q[(b, b)] = process.bias * dt;
    }
    Q
}

/// Nodes on (-1, 1) and weights of Gauss and Legendre's rule of order 5, exact to degree 9.
fn gauss_legendre() -> [(f64, f64); 5] {
    let root = 2.0 * (10.0_f64 / 7.0).sqrt();
    let (near, far) = ((5.0 - root).sqrt() / 3.0, (5.0 + root).sqrt() / 3.0);
    let part = 13.0 * 70.0_f64.sqrt();
    let (w_near, w_far) = ((322.0 + part) / 900.0, (322.0 - part) / 900.0);
    [
        (-far, w_far),
        (-near, w_near),
        (0.0, 128.0 / 225.0),
        (near, w_near),
        (far, w_far),
    ]
}

/// Q over `dt` seconds by quadrature of (3.8), 15 x 15, for `G G'` the diagonal of the densities.
///
/// (3.8) prints `phi(t_k, eta)'` on the right; it must be `phi(t_k+1, eta)'` as on the left, else Q is not symmetric.
#[must_use]
pub fn q_quadrature(process: &Process, dt: f64) -> Cov {
    let GG = Cov::from_diagonal(&State::from(process.densities()));
    let mut Q = Cov::zeros();
    for (node, weight) in gauss_legendre() {
        let eta = 0.5 * dt * (1.0 + node);
        let phi = phi(dt - eta, Source::Program);
        Q += phi * GG * phi.transpose() * (0.5 * dt * weight);
    }
    Q
}

/// Initial P, 15 x 15, diagonal [S00, 6.5].
#[must_use]
pub fn p0() -> Cov {
    Cov::from_diagonal(&State::from(P0))
}

/// One row of a measurement: `z` of one state, with variance `r`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// The state it measures.
    pub state: usize,
    /// The measurement, in the unit of the state.
    pub z: f64,
    /// Its variance.
    pub r: f64,
}

/// What both forms of the filter do.
pub trait Estimator {
    /// The states.
    fn x(&self) -> &State;
    /// The states, to be set.
    fn x_mut(&mut self) -> &mut State;
    /// Time update (2.8a, 2.8b).
    fn predict(&mut self);
    /// Measurement update (2.8c to 2.8e).
    ///
    /// # Errors
    /// [`super::PublishedError::Rows`] for a count of rows there is no matrix for,
    /// [`super::PublishedError::Innovation`], of step 0, for an innovation covariance that is not positive definite:
    /// the estimate is unusable then.
    fn update(&mut self, rows: &[Row]) -> Result<(), super::PublishedError>;
    /// Diagonal of P, 15.
    fn variances(&self) -> State;
    /// P, 15 x 15.
    fn covariance(&self) -> Cov;
}

/// Steady gain of a state that only its own measurement (variance `r` each step) and its process noise (variance `q`
/// each step) move: `p / (p + r)` with `p = q/2 + sqrt(q^2/4 + q r)`. Its reciprocal is the time constant in steps.
#[must_use]
pub fn steady_gain(q: f64, r: f64) -> f64 {
    let p = 0.5 * q + (0.25 * q * q + q * r).sqrt();
    p / (p + r)
}
