//! Orthogonal factor of the batch problem: a chain of small blocks with twenty global columns.
//!
//! The unknowns are taken as whitened noises `w_i` of the steps and the state of the last step; `x_{i-1}` follows from
//! `x_i` and `w_i` by the step's inverse. That is the same least-squares problem, but without the rows of a step, whose
//! weights reach `1e6`: normal equations with them are off by 5e-4 of a standard deviation where this factor and another
//! library's sparse QR agree to 1e-10 (`tests/batch.rs`), and a step without noise needs no care. Householder reflections
//! carry the triangle `[R_xx R_xg; 0 R_gg | z]` from step to step; what they leave in the rows of `w_i` is the factor
//! (Bierman's square-root information smoother as a sparse QR).

use nalgebra::{SMatrix, SVector};

use super::problem::{Bound, LOCAL, Problem, Stage, noise_root, ordered, semi_root, unordered};
use crate::error::ReconstructError;
use crate::refined::states::{BA, BG, Cov, DIM, Row, SLIP};
use crate::refined::transition::Transition;

/// States that an impact moves.
pub const JUMPING: usize = 6;
/// A standard deviation of zero in the prior is taken as this: known exactly.
const EXACT: f64 = 1e-12;

pub(crate) type Local = SMatrix<f64, LOCAL, LOCAL>;
type Wide = SMatrix<f64, LOCAL, DIM>;
type Line = [f64; DIM + 1];
const STEP: usize = LOCAL + DIM + 1;
const LEAP: usize = JUMPING + DIM + 1;

/// Rows of the factor that belong to one step: `R_w w + R_y x_i = z`.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    /// From the step back to the one before it, in the pass' order.
    pub(crate) inverse: Transition,
    pub(crate) offset: Row,
    /// Root of the noise.
    pub(crate) l: Local,
    /// Upper.
    pub(crate) rw: Local,
    /// Columns in the order of the states.
    pub(crate) ry: Wide,
    pub(crate) z: SVector<f64, LOCAL>,
    pub(crate) leap: Option<Box<Leap>>,
}

/// The same of the jump of the biases at an impact: `R_w w + R_y x_i = z`, the jump being `sd w`.
#[derive(Clone, Debug)]
pub(crate) struct Leap {
    pub(crate) sd: [f64; 2],
    pub(crate) rw: SMatrix<f64, JUMPING, JUMPING>,
    pub(crate) ry: SMatrix<f64, JUMPING, DIM>,
    pub(crate) z: SVector<f64, JUMPING>,
}

/// State moved by noise `j` of a jump.
pub(crate) const fn jumping(j: usize) -> usize {
    if j < 3 { BA + j } else { BG + j - 3 }
}

/// The factor of a problem.
#[derive(Clone, Debug)]
pub struct Factor {
    /// One for each stage but the first.
    pub(crate) links: Vec<Link>,
    /// Triangle of the last stage, columns in the order of [`ordered`].
    pub(crate) last: SMatrix<f64, DIM, DIM>,
    pub(crate) z: Row,
    /// Root of the prior, lower: `prior_root nu = x_0 + c_0`.
    pub(crate) prior_root: Cov,
    /// Sum of the squares left at the solution.
    pub chi2: f64,
}

/// Reflects column `col` of `rest` into `pivot`.
fn reflect<const W: usize>(pivot: &mut [f64; W], rest: &mut [[f64; W]], col: usize) {
    let below: f64 = rest.iter().map(|r| r[col] * r[col]).sum();
    if below == 0.0 {
        return;
    }
    let top = pivot[col];
    let norm = (top * top + below).sqrt();
    let alpha = if top > 0.0 { -norm } else { norm };
    let v = top - alpha;
    let scale = 1.0 / (norm * norm - top * alpha);
    let mut sum = [0.0; W];
    for (s, p) in sum[col..].iter_mut().zip(&pivot[col..]) {
        *s = v * p;
    }
    for row in rest.iter() {
        let f = row[col];
        for (s, p) in sum[col..].iter_mut().zip(&row[col..]) {
            *s += f * p;
        }
    }
    for (s, p) in sum[col..].iter().zip(&mut pivot[col..]) {
        *p -= scale * v * s;
    }
    for row in rest {
        let f = scale * row[col];
        for (s, p) in sum[col..].iter().zip(&mut row[col..]) {
            *p -= f * s;
        }
        row[col] = 0.0;
    }
    pivot[col] = alpha;
}

fn line(h: &Row, rhs: f64, scale: f64) -> Line {
    let mut out = [0.0; DIM + 1];
    for (o, x) in out.iter_mut().zip(ordered(h).iter()) {
        *o = x * scale;
    }
    out[DIM] = rhs * scale;
    out
}

/// A bound on the noise as a row of the step.
fn hold(bound: &Bound, l: &Local) -> [f64; STEP] {
    let mut row = [0.0; STEP];
    let a = l.transpose() * bound.a / bound.sd;
    row[..LOCAL].copy_from_slice(a.as_slice());
    row[STEP - 1] = bound.value / bound.sd;
    row
}

struct Chain {
    /// Upper triangle with the right-hand side behind it.
    r: Box<[Line; DIM]>,
    chi2: f64,
}

impl Chain {
    fn absorb(&mut self, lines: &mut [Line]) {
        for (j, pivot) in self.r.iter_mut().enumerate() {
            reflect(pivot, lines, j);
        }
        self.chi2 += lines.iter().map(|l| l[DIM] * l[DIM]).sum::<f64>();
    }

    fn measure(&mut self, problem: &Problem, stage: &Stage) {
        // residual = h x + n.
        let mut lines: Vec<Line> = problem.rows[stage.rows.clone()]
            .iter()
            .filter(|z| z.weight > 0.0)
            .map(|z| line(&z.h, z.residual, z.root_weight()))
            .collect();
        if !lines.is_empty() {
            self.absorb(&mut lines);
        }
    }

    fn step(&mut self, transition: &Transition, offset: &Row, bounds: &[Bound]) -> Link {
        let inverse = transition.inverse();
        let l = noise_root(transition);
        let shift = inverse.apply(offset);
        // x_{i-1} = Phi^-1 (x_i + c - L w).
        let shifted = ordered(&shift);
        for row in self.r.iter_mut() {
            let moved: f64 = row[..DIM]
                .iter()
                .zip(shifted.iter())
                .map(|(a, b)| a * b)
                .sum();
            row[DIM] -= moved;
        }
        let mut a = [[0.0; STEP]; 2 * LOCAL];
        for (j, row) in a[..LOCAL].iter_mut().enumerate() {
            row[j] = 1.0;
        }
        for (row, old) in a[LOCAL..].iter_mut().zip(self.r.iter()) {
            let old_row = unordered(&Row::from_column_slice(&old[..DIM]));
            let moved = ordered(&inverse.apply_transposed(&old_row));
            for c in 0..LOCAL {
                let by: f64 = (c..LOCAL).map(|k| moved[k] * l[(k, c)]).sum();
                row[c] = -by;
            }
            row[LOCAL..LOCAL + DIM].copy_from_slice(moved.as_slice());
            row[STEP - 1] = old[DIM];
        }
        let mut held: Vec<[f64; STEP]> = bounds.iter().map(|b| hold(b, &l)).collect();
        let (top, bottom) = a.split_at_mut(LOCAL);
        for (j, pivot) in top.iter_mut().enumerate() {
            reflect(pivot, &mut held, j);
        }
        for (j, pivot) in top.iter_mut().enumerate() {
            reflect(pivot, bottom, j);
        }
        for j in 0..LOCAL {
            let (pivot, rest) = bottom[j..].split_at_mut(1);
            reflect(&mut pivot[0], rest, LOCAL + j);
        }
        for (new, old) in bottom.iter().zip(self.r.iter_mut()) {
            old.copy_from_slice(&new[LOCAL..]);
        }
        let mut link = Link {
            inverse,
            offset: *offset,
            l,
            rw: Local::zeros(),
            ry: Wide::zeros(),
            z: SVector::zeros(),
            leap: None,
        };
        for (j, row) in top.iter().enumerate() {
            for (c, x) in row[..LOCAL].iter().enumerate().skip(j) {
                link.rw[(j, c)] = *x;
            }
            let y = unordered(&Row::from_column_slice(&row[LOCAL..LOCAL + DIM]));
            link.ry.set_row(j, &y.transpose());
            link.z[j] = row[STEP - 1];
        }
        link
    }

    /// The biases before a jump are those behind it less the jump.
    fn leap(&mut self, sd: [f64; 2]) -> Leap {
        let mut top = [[0.0; LEAP]; JUMPING];
        let mut bottom = [[0.0; LEAP]; DIM];
        for (j, row) in top.iter_mut().enumerate() {
            row[j] = 1.0;
        }
        for (row, old) in bottom.iter_mut().zip(self.r.iter()) {
            for j in 0..JUMPING {
                // Behind the local ones, see `ordered`.
                row[j] = -old[jumping(j) + 1] * sd[j / 3];
            }
            row[JUMPING..].copy_from_slice(old);
        }
        for (j, pivot) in top.iter_mut().enumerate() {
            reflect(pivot, &mut bottom, j);
        }
        for j in 0..DIM {
            let (pivot, rest) = bottom[j..].split_at_mut(1);
            reflect(&mut pivot[0], rest, JUMPING + j);
        }
        for (new, old) in bottom.iter().zip(self.r.iter_mut()) {
            old.copy_from_slice(&new[JUMPING..]);
        }
        let mut leap = Leap {
            sd,
            rw: SMatrix::zeros(),
            ry: SMatrix::zeros(),
            z: SVector::zeros(),
        };
        for (j, row) in top.iter().enumerate() {
            for (c, x) in row[..JUMPING].iter().enumerate().skip(j) {
                leap.rw[(j, c)] = *x;
            }
            let y = unordered(&Row::from_column_slice(&row[JUMPING..JUMPING + DIM]));
            leap.ry.set_row(j, &y.transpose());
            leap.z[j] = row[LEAP - 1];
        }
        leap
    }
}

/// Root of a prior covariance; a zero variance is one of [`EXACT`].
fn prior_root(prior: &Cov) -> Cov {
    let mut p = *prior;
    for i in 0..DIM {
        p[(i, i)] = p[(i, i)].max(EXACT * EXACT);
    }
    semi_root(&p)
}

/// Factors a problem.
///
/// # Errors
/// [`ReconstructError::Numeric`] if the problem leaves a state open or holds a value that is not a number.
pub fn factor(problem: &Problem) -> Result<Factor, ReconstructError> {
    factor_into(problem, Vec::new())
}

/// The same, in the memory of an earlier factor's links.
pub(crate) fn factor_into(
    problem: &Problem,
    mut links: Vec<Link>,
) -> Result<Factor, ReconstructError> {
    let fail = |what: String| ReconstructError::Numeric {
        place: "batch smoother",
        what,
    };
    let root = prior_root(&problem.prior);
    let whiten = root
        .solve_lower_triangular(&Cov::identity())
        .ok_or_else(|| fail("the prior is not a covariance".to_owned()))?;
    let first_offset = problem.stages.first().map_or_else(Row::zeros, |s| s.offset);
    let mut chain = Chain {
        r: Box::new([[0.0; DIM + 1]; DIM]),
        chi2: 0.0,
    };
    let mut lines: Vec<Line> = (0..DIM)
        .map(|i| {
            let h: Row = whiten.row(i).transpose();
            line(&h, -h.dot(&first_offset), 1.0)
        })
        .collect();
    chain.absorb(&mut lines);
    chain.chi2 = 0.0;
    links.clear();
    links.reserve(problem.stages.len());
    for stage in &problem.stages {
        if let Some(transition) = &stage.transition {
            let mut link = chain.step(transition, &stage.offset, &stage.bounds);
            if transition.jump.iter().any(|v| *v > 0.0) {
                link.leap = Some(Box::new(chain.leap(transition.jump.map(f64::sqrt))));
            }
            links.push(link);
        }
        chain.measure(problem, stage);
    }
    let last = SMatrix::from_fn(|i, j| if j < i { 0.0 } else { chain.r[i][j] });
    let z = Row::from_fn(|i, _| chain.r[i][DIM]);
    let sound = (0..DIM).all(|i| last[(i, i)].is_finite() && last[(i, i)] != 0.0)
        && z.iter().all(|x| x.is_finite());
    if !sound {
        return Err(fail(format!(
            "the factor of {} epochs and {} measurements is not a finite triangle",
            problem.stages.len(),
            problem.rows.len()
        )));
    }
    Ok(Factor {
        links,
        last,
        z,
        prior_root: root,
        chi2: chain.chi2,
    })
}

/// Place of noise `j` of a step among the states.
pub(crate) const fn local(j: usize) -> usize {
    if j + 1 < LOCAL { j } else { SLIP }
}
