//! What follows from the factor: means, covariances, the influence of every row, sample paths.

use nalgebra::{SMatrix, SVector};

use super::arrow::{Factor, JUMPING, Leap, Link, Local, jumping, local};
use super::problem::{LOCAL, ordered, unordered};
use super::product;
use crate::error_model::STATES;
use crate::refined::states::{Cov, DIM, Row};

/// A right-hand side of the factor, or noises: one entry for each of its rows.
#[derive(Clone, Debug)]
pub(crate) struct Rhs {
    pub(crate) noise: Vec<SVector<f64, LOCAL>>,
    pub(crate) jump: Vec<SVector<f64, JUMPING>>,
    pub(crate) last: Row,
}

/// A solution: errors of every stage and the whitened noises.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub(crate) states: Vec<Row>,
    pub(crate) noise: Vec<SVector<f64, LOCAL>>,
    pub(crate) jump: Vec<SVector<f64, JUMPING>>,
}

impl Link {
    /// `x_i` before the jump, and the jump's noise.
    fn unleap(&self, x: &Row, rhs: &SVector<f64, JUMPING>) -> (Row, SVector<f64, JUMPING>) {
        let Some(leap) = &self.leap else {
            return (*x, SVector::zeros());
        };
        let w = leap
            .rw
            .solve_upper_triangular(&(rhs - leap.ry * x))
            .unwrap_or_else(SVector::zeros);
        let mut before = *x;
        for j in 0..JUMPING {
            before[jumping(j)] -= leap.sd[j / 3] * w[j];
        }
        (before, w)
    }

    /// `x_{i-1}` of `x_i` before the jump, and the step's noise.
    fn back(&self, x: &Row, rhs: &SVector<f64, LOCAL>, offset: bool) -> (Row, SVector<f64, LOCAL>) {
        let w = self
            .rw
            .solve_upper_triangular(&(rhs - product(&self.ry, x)))
            .unwrap_or_else(SVector::zeros);
        let mut y = if offset { x + self.offset } else { *x };
        let moved = self.l * w;
        for j in 0..LOCAL {
            y[local(j)] -= moved[j];
        }
        (self.inverse.apply(&y), w)
    }

    /// `[L K]` and `L R_w^-1`: what `x_i` tells of the step's noise, and what it leaves.
    fn learnt(&self) -> (SMatrix<f64, LOCAL, DIM>, Local) {
        let left = product(&self.l, &inverted(&self.rw));
        (-product(&left, &self.ry), left)
    }

    /// Columns of `x_i` to columns of `x_{i-1}`: the part of the latter that follows from the former.
    fn carry(&self, m: &mut Cov) {
        if let Some(leap) = &self.leap {
            let k = leap.learnt().0;
            let moved = k * *m;
            for j in 0..JUMPING {
                let mut row = m.row_mut(jumping(j));
                row -= moved.row(j);
            }
        }
        let moved = self.learnt().0 * *m;
        for j in 0..LOCAL {
            let mut row = m.row_mut(local(j));
            row -= moved.row(j);
        }
        for c in 0..DIM {
            let column = self.inverse.apply(&m.column(c).into_owned());
            m.set_column(c, &column);
        }
    }

    /// Covariance of `x_{i-1}` from that of `x_i`.
    fn covariance(&self, p: &mut Cov) {
        if let Some(leap) = &self.leap {
            let (k, left) = leap.learnt();
            spread(p, &k, &left, jumping);
        }
        let (k, left) = self.learnt();
        spread(p, &k, &left, local);
        self.inverse.predict(p);
        // What is not symmetric would grow from step to step; the rest is written twice from one number.
        for c in 0..STATES {
            for r in 0..c {
                let mean = 0.5 * (p[(r, c)] + p[(c, r)]);
                p[(r, c)] = mean;
                p[(c, r)] = mean;
            }
        }
    }
}

/// Inverse of an upper triangle.
fn inverted<const N: usize>(upper: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let mut out = SMatrix::<f64, N, N>::zeros();
    for j in 0..N {
        for i in (0..=j).rev() {
            let mut x = if i == j { 1.0 } else { 0.0 };
            for k in i + 1..=j {
                x -= upper[(i, k)] * out[(k, j)];
            }
            out[(i, j)] = x / upper[(i, i)];
        }
    }
    out
}

impl Leap {
    fn learnt(&self) -> (SMatrix<f64, JUMPING, DIM>, SMatrix<f64, JUMPING, JUMPING>) {
        let mut left = inverted(&self.rw);
        for j in 0..JUMPING {
            let mut row = left.row_mut(j);
            row *= self.sd[j / 3];
        }
        (-(left * self.ry), left)
    }
}

/// `(I - E K) P (I - E K)' + E G G' E'`, where `E` puts entry `j` into state `place(j)`.
fn spread<const N: usize>(
    p: &mut Cov,
    k: &SMatrix<f64, N, DIM>,
    left: &SMatrix<f64, N, N>,
    place: impl Fn(usize) -> usize,
) {
    let v = product(k, p);
    let own = product(&v, &k.transpose()) + product(left, &left.transpose());
    let mut moved = [false; DIM];
    let mut block = SMatrix::<f64, N, N>::zeros();
    for c in 0..N {
        moved[place(c)] = true;
        for r in 0..=c {
            let (pr, pc) = (place(r), place(c));
            let spread = 0.5 * (own[(r, c)] + own[(c, r)]);
            block[(r, c)] = p[(pr, pc)] - v[(r, pc)] - v[(c, pr)] + spread;
        }
    }
    for j in 0..N {
        for (c, moved) in moved.iter().enumerate() {
            if !moved {
                let x = p[(c, place(j))] - v[(j, c)];
                p[(c, place(j))] = x;
                p[(place(j), c)] = x;
            }
        }
    }
    for c in 0..N {
        for r in 0..=c {
            p[(place(r), place(c))] = block[(r, c)];
            p[(place(c), place(r))] = block[(r, c)];
        }
    }
}

impl Factor {
    /// Number of stages.
    #[must_use]
    pub fn stages(&self) -> usize {
        self.links.len() + 1
    }

    /// The factor's own right-hand side: its solution is the mean.
    pub(crate) fn rhs(&self) -> Rhs {
        Rhs {
            noise: self.links.iter().map(|l| l.z).collect(),
            jump: self
                .links
                .iter()
                .map(|l| l.leap.as_ref().map_or_else(SVector::zeros, |leap| leap.z))
                .collect(),
            last: self.z,
        }
    }

    /// Solves with a right-hand side; `offset`: about the trajectory, else homogeneous.
    pub(crate) fn solve(&self, rhs: &Rhs, offset: bool) -> Solution {
        let n = self.links.len();
        let mut out = Solution {
            states: vec![Row::zeros(); n + 1],
            noise: vec![SVector::zeros(); n],
            jump: vec![SVector::zeros(); n],
        };
        let mut x = unordered(
            &self
                .last
                .solve_upper_triangular(&rhs.last)
                .unwrap_or_else(Row::zeros),
        );
        out.states[n] = x;
        for (i, link) in self.links.iter().enumerate().rev() {
            let (before, jump) = link.unleap(&x, &rhs.jump[i]);
            let (next, noise) = link.back(&before, &rhs.noise[i], offset);
            x = next;
            out.states[i] = x;
            out.noise[i] = noise;
            out.jump[i] = jump;
        }
        out
    }

    /// Mean errors of every stage about the trajectory, in the order of the pass.
    #[must_use]
    pub fn means(&self) -> Vec<Row> {
        self.solve(&self.rhs(), true).states
    }

    /// Covariance of every stage, from the last of the pass to its first: calls `visit(stage, covariance)`.
    pub fn covariances(&self, mut visit: impl FnMut(usize, &Cov)) {
        let root = self
            .last
            .solve_upper_triangular(&Cov::identity())
            .unwrap_or_else(Cov::zeros);
        let ordered_p = root * root.transpose();
        let mut p = Cov::zeros();
        for c in 0..DIM {
            let column = unordered(&ordered_p.column(c).into_owned());
            p.set_column(c, &column);
        }
        for r in 0..DIM {
            let row = unordered(&p.row(r).transpose());
            p.set_row(r, &row.transpose());
        }
        visit(self.links.len(), &p);
        for (i, link) in self.links.iter().enumerate().rev() {
            link.covariance(&mut p);
            visit(i, &p);
        }
    }

    /// Covariance of two stages: rows stage `early` of the pass, columns stage `late`, whose own covariance is `p_late`.
    #[must_use]
    pub fn cross(&self, early: usize, late: usize, p_late: &Cov) -> Cov {
        let mut m = *p_late;
        for link in self.links[early.min(late)..late].iter().rev() {
            link.carry(&mut m);
        }
        m
    }

    /// `R'^-1 a` of a linear figure: the sum over its terms `a . x` at stages in rising order.
    pub(crate) fn spread_of(&self, figure: &[(usize, Row)]) -> Rhs {
        let n = self.links.len();
        let mut out = Rhs {
            noise: vec![SVector::zeros(); n],
            jump: vec![SVector::zeros(); n],
            last: Row::zeros(),
        };
        let at = |i: usize| -> Row {
            figure
                .iter()
                .filter(|(s, _)| *s == i)
                .map(|(_, a)| *a)
                .sum()
        };
        let mut g = at(0);
        for (i, link) in self.links.iter().enumerate() {
            if g.iter().any(|x| *x != 0.0) {
                g = link.inverse.apply_transposed(&g);
                let by_noise =
                    link.l.transpose() * SVector::<f64, LOCAL>::from_fn(|j, _| -g[local(j)]);
                let v = link
                    .rw
                    .tr_solve_upper_triangular(&by_noise)
                    .unwrap_or_else(SVector::zeros);
                g -= link.ry.transpose() * v;
                out.noise[i] = v;
                if let Some(leap) = &link.leap {
                    let by =
                        SVector::<f64, JUMPING>::from_fn(|j, _| -leap.sd[j / 3] * g[jumping(j)]);
                    let v = leap
                        .rw
                        .tr_solve_upper_triangular(&by)
                        .unwrap_or_else(SVector::zeros);
                    g -= leap.ry.transpose() * v;
                    out.jump[i] = v;
                }
            }
            g += at(i + 1);
        }
        out.last = self
            .last
            .tr_solve_upper_triangular(&ordered(&g))
            .unwrap_or_else(Row::zeros);
        out
    }

    /// Variance of a linear figure.
    #[must_use]
    pub fn variance(&self, figure: &[(usize, Row)]) -> f64 {
        let v = self.spread_of(figure);
        v.noise.iter().map(SVector::norm_squared).sum::<f64>()
            + v.jump.iter().map(SVector::norm_squared).sum::<f64>()
            + v.last.norm_squared()
    }
}

/// The nine of motion out of all states.
#[must_use]
pub fn nine(p: &Cov) -> SMatrix<f64, STATES, STATES> {
    p.fixed_view::<STATES, STATES>(0, 0).into_owned()
}
