//! The filter of [`super::Dense`] without its zeros.
//!
//! phi, Q, H and R couple nothing between the axes, so where P starts diagonal it stays six separate chains: position
//! and velocity on each ECEF axis, and angle, rate and bias about each body axis. R is diagonal, so rows may be taken
//! one at a time: no matrix is inverted, and the result is the same.

use super::error::PublishedError;
use super::matrices::{ATT, BIAS, Cov, Estimator, POS, RATE, Row, STATES, State, VEL};

/// Position and velocity on one axis: elements (0,0), (0,1), (1,1) of their covariance.
type Pair = [f64; 3];
/// Angle, rate and bias about one axis: elements (0,0), (0,1), (0,2), (1,1), (1,2), (2,2).
type Triple = [f64; 6];

/// Element (i, j) of a [`Triple`].
const PLACE: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// State and covariance in six chains.
#[derive(Clone, Debug, PartialEq)]
pub struct Chains {
    x: State,
    pairs: [Pair; 3],
    triples: [Triple; 3],
    /// Element (position, velocity) of phi, s.
    dt: [f64; 3],
    /// Elements (angle, rate) and (angle, bias) of phi, s.
    turn: [[f64; 2]; 3],
    q_pairs: [Pair; 3],
    q_triples: [Triple; 3],
}

fn pairs(m: &Cov) -> [Pair; 3] {
    [0, 1, 2].map(|i| {
        let (r, v) = (POS + i, VEL + i);
        [m[(r, r)], m[(r, v)], m[(v, v)]]
    })
}

fn triples(m: &Cov) -> [Triple; 3] {
    [0, 1, 2].map(|i| {
        let (a, w, b) = (ATT + i, RATE + i, BIAS + i);
        [
            m[(a, a)],
            m[(a, w)],
            m[(a, b)],
            m[(w, w)],
            m[(w, b)],
            m[(b, b)],
        ]
    })
}

/// Two states are in one chain.
fn together(i: usize, j: usize) -> bool {
    i % 3 == j % 3 && (i < ATT) == (j < ATT)
}

impl Chains {
    /// A filter at state `x` (15) with covariance `p`, transition `phi` and process noise `q` (15 x 15 each).
    ///
    /// # Errors
    /// [`PublishedError::Coupled`] where one of the three couples two axes, or `phi` has elements that (3.3) has not.
    pub fn new(x: State, p: &Cov, phi: &Cov, q: &Cov) -> Result<Self, PublishedError> {
        for matrix in [p, q] {
            for row in 0..STATES {
                for column in 0..STATES {
                    let found = matrix[(row, column)];
                    if found != 0.0 && !together(row, column) {
                        return Err(PublishedError::Coupled { row, column, found });
                    }
                }
            }
        }
        // What phi has beyond 1 on the diagonal and the elements of (3.3).
        let mut rest = phi - Cov::identity();
        for axis in 0..3 {
            rest[(POS + axis, VEL + axis)] = 0.0;
            rest[(ATT + axis, RATE + axis)] = 0.0;
            rest[(ATT + axis, BIAS + axis)] = 0.0;
        }
        for row in 0..STATES {
            for column in 0..STATES {
                if rest[(row, column)] != 0.0 {
                    let found = phi[(row, column)];
                    return Err(PublishedError::Coupled { row, column, found });
                }
            }
        }
        Ok(Self {
            x,
            pairs: pairs(p),
            triples: triples(p),
            dt: [0, 1, 2].map(|i| phi[(POS + i, VEL + i)]),
            turn: [0, 1, 2].map(|i| [phi[(ATT + i, RATE + i)], phi[(ATT + i, BIAS + i)]]),
            q_pairs: pairs(q),
            q_triples: triples(q),
        })
    }

    /// One row of position or velocity on one axis: `at` 0 or 1. `None`: variance not positive.
    fn pair(&mut self, axis: usize, at: usize, row: &Row) -> Option<()> {
        let p = &mut self.pairs[axis];
        let column = if at == 0 { [p[0], p[1]] } else { [p[1], p[2]] };
        let weight = weight(column[at] + row.r)?;
        let step = weight * (row.z - self.x[row.state]);
        self.x[POS + axis] += column[0] * step;
        self.x[VEL + axis] += column[1] * step;
        p[0] -= column[0] * column[0] * weight;
        p[1] -= column[0] * column[1] * weight;
        p[2] -= column[1] * column[1] * weight;
        Some(())
    }

    /// One row of angle, rate or bias about one axis: `at` 0, 1 or 2. `None`: variance not positive.
    fn triple(&mut self, axis: usize, at: usize, row: &Row) -> Option<()> {
        let p = &mut self.triples[axis];
        let column = PLACE[at].map(|k| p[k]);
        let weight = weight(column[at] + row.r)?;
        let step = weight * (row.z - self.x[row.state]);
        self.x[ATT + axis] += column[0] * step;
        self.x[RATE + axis] += column[1] * step;
        self.x[BIAS + axis] += column[2] * step;
        let k = column.map(|c| c * weight);
        p[0] -= k[0] * column[0];
        p[1] -= k[0] * column[1];
        p[2] -= k[0] * column[2];
        p[3] -= k[1] * column[1];
        p[4] -= k[1] * column[2];
        p[5] -= k[2] * column[2];
        Some(())
    }
}

/// `1 / s` of an innovation variance that is a positive number.
fn weight(s: f64) -> Option<f64> {
    (s > 0.0 && s.is_finite()).then(|| 1.0 / s)
}

impl Estimator for Chains {
    fn x(&self) -> &State {
        &self.x
    }

    fn x_mut(&mut self) -> &mut State {
        &mut self.x
    }

    fn predict(&mut self) {
        for i in 0..3 {
            let (dt, q) = (self.dt[i], &self.q_pairs[i]);
            self.x[POS + i] += dt * self.x[VEL + i];
            let p = &mut self.pairs[i];
            let cross = p[1] + dt * p[2];
            p[0] += dt * (p[1] + cross) + q[0];
            p[1] = cross + q[1];
            p[2] += q[2];
        }
        for i in 0..3 {
            let ([w, b], q) = (self.turn[i], &self.q_triples[i]);
            self.x[ATT + i] += w * self.x[RATE + i] + b * self.x[BIAS + i];
            let p = &mut self.triples[i];
            let by_rate = p[1] + w * p[3] + b * p[4];
            let by_bias = p[2] + w * p[4] + b * p[5];
            p[0] += w * (p[1] + by_rate) + b * (p[2] + by_bias) + q[0];
            p[1] = by_rate + q[1];
            p[2] = by_bias + q[2];
            p[3] += q[3];
            p[4] += q[4];
            p[5] += q[5];
        }
    }

    fn update(&mut self, rows: &[Row]) -> Result<(), PublishedError> {
        for row in rows {
            let axis = row.state % 3;
            let done = match row.state / 3 {
                at @ 0..=1 => self.pair(axis, at, row),
                at @ 2..=4 => self.triple(axis, at - 2, row),
                _ => return Err(PublishedError::Rows { found: rows.len() }),
            };
            done.ok_or(PublishedError::Innovation { step: 0 })?;
        }
        Ok(())
    }

    fn variances(&self) -> State {
        let mut p = State::zeros();
        for i in 0..3 {
            p[POS + i] = self.pairs[i][0];
            p[VEL + i] = self.pairs[i][2];
            p[ATT + i] = self.triples[i][0];
            p[RATE + i] = self.triples[i][3];
            p[BIAS + i] = self.triples[i][5];
        }
        p
    }

    fn covariance(&self) -> Cov {
        let mut p = Cov::zeros();
        for axis in 0..3 {
            for i in 0..2 {
                for j in 0..2 {
                    p[(POS + 3 * i + axis, POS + 3 * j + axis)] = self.pairs[axis][i + j];
                }
            }
            for i in 0..3 {
                for j in 0..3 {
                    p[(ATT + 3 * i + axis, ATT + 3 * j + axis)] = self.triples[axis][PLACE[i][j]];
                }
            }
        }
        p
    }
}
