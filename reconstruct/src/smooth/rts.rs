//! The fixed-interval smoother of Rauch, Tung and Striebel in the form of Bryson and Frazier.
//!
//! Both forms give the same numbers. This one carries the adjoint `(lambda, Lambda)` back through the measurements and
//! transitions of the pass, so that no covariance is inverted (constant states have no process noise and would make the
//! inverse of the predicted covariance ill-conditioned), and each scalar measurement costs a rank-one update.
//! Its errors about the nominal are `x = -P lambda`, their covariance is `P - P Lambda P`.

use nalgebra::SMatrix;

use super::product;
use crate::refined::states::{Cov, DIM, Nominal, Row};
use crate::refined::tape::{Linear, Tape};

/// Smoothed state of one step.
#[derive(Clone, Copy, Debug)]
pub struct Adjoint {
    /// Adjoint of the mean.
    pub lambda: Row,
    /// Adjoint of the covariance.
    pub big: Cov,
}

impl Adjoint {
    /// Nothing learnt later: the last step of the pass.
    #[must_use]
    pub fn last() -> Self {
        Self {
            lambda: Row::zeros(),
            big: Cov::zeros(),
        }
    }

    /// Back over one measurement.
    fn unmeasure(&mut self, z: &Linear) {
        let (h, k) = (&z.h, &z.gain);
        // (I - K h')' y = y - h (K . y).
        let step = self.lambda.dot(k) + z.residual / z.s;
        self.lambda -= h * step;
        let lk = product(&self.big, k);
        let klk = k.dot(&lk) + 1.0 / z.s;
        // L - h (L K)' - (L K) h' + h h' (K' L K + 1/S), by columns; a row sees few states.
        let mut seen = [0; DIM];
        let mut count = 0;
        for (r, x) in h.iter().enumerate() {
            if *x != 0.0 {
                seen[count] = r;
                count += 1;
            }
        }
        for (c, column) in self.big.as_mut_slice().chunks_exact_mut(DIM).enumerate() {
            let (hc, lc) = (h[c], lk[c]);
            if hc != 0.0 {
                for (x, l) in column.iter_mut().zip(lk.iter()) {
                    *x -= hc * l;
                }
            }
            let by = klk * hc - lc;
            for &r in &seen[..count] {
                column[r] += by * h[r];
            }
        }
    }

    /// Back over all measurements of step `i` and the transition to it.
    pub fn retreat(&mut self, tape: &Tape, i: usize) {
        let step = &tape.steps[i];
        for z in tape.linear[step.measurements.clone()].iter().rev() {
            self.unmeasure(z);
        }
        if let Some(transition) = &step.transition {
            self.lambda = transition.apply_transposed(&self.lambda);
            transition.retract(&mut self.big);
        }
    }

    /// Errors of step `i` about its nominal, from all data.
    #[must_use]
    pub fn errors(&self, p: &Cov) -> Row {
        -product(p, &self.lambda)
    }

    /// The smoothed nominal.
    #[must_use]
    pub fn nominal(&self, nominal: &Nominal, p: &Cov) -> Nominal {
        nominal.corrected(&self.errors(p))
    }

    /// Smoothed covariance of the first `R` states.
    #[must_use]
    pub fn covariance<const R: usize>(&self, p: &Cov) -> SMatrix<f64, R, R> {
        let rows = p.fixed_view::<DIM, R>(0, 0).into_owned();
        let seen = product(&self.big, &rows);
        let mut out = p.fixed_view::<R, R>(0, 0) - product(&rows.transpose(), &seen);
        out = (out + out.transpose()) * 0.5;
        out
    }

    /// Smoothed covariance of some states (rows) with others (columns).
    #[must_use]
    pub fn between<const R: usize, const C: usize>(
        &self,
        p: &Cov,
        rows: [usize; R],
        columns: [usize; C],
    ) -> SMatrix<f64, R, C> {
        let seen = columns.map(|c| product(&self.big, &p.column(c).into_owned()));
        SMatrix::from_fn(|r, c| p[(rows[r], columns[c])] - p.column(rows[r]).dot(&seen[c]))
    }

    /// Smoothed covariance of all states.
    #[must_use]
    pub fn whole(&self, p: &Cov) -> Cov {
        self.covariance::<DIM>(p)
    }

    /// Smoothed variance of a linear function `a` of the errors.
    #[must_use]
    pub fn variance(&self, p: &Cov, a: &Row) -> f64 {
        let pa = product(p, a);
        a.dot(&pa) - pa.dot(&product(&self.big, &pa))
    }
}

/// Smoothed nominals of all steps, in the order of the pass, without their covariances.
#[must_use]
pub fn means(tape: &Tape) -> Vec<Nominal> {
    let mut lambda = Row::zeros();
    let mut out: Vec<Nominal> = Vec::with_capacity(tape.steps.len());
    for step in tape.steps.iter().rev() {
        out.push(step.nominal.corrected(&-product(&step.p, &lambda)));
        for z in tape.linear[step.measurements.clone()].iter().rev() {
            lambda -= z.h * (lambda.dot(&z.gain) + z.residual / z.s);
        }
        if let Some(transition) = &step.transition {
            lambda = transition.apply_transposed(&lambda);
        }
    }
    out.reverse();
    out
}

/// Covariance of the errors of two steps, from all data: rows step `early` of the pass (a later epoch), columns step
/// `late`, whose adjoint is `at_late`. Zero-based steps with `early <= late`.
///
/// `P_early Psi' (I - Lambda P_late)` with the closed-loop transition `Psi` from one to the other.
#[must_use]
pub fn cross_covariance(tape: &Tape, early: usize, late: usize, at_late: &Adjoint) -> Cov {
    // M = P_early Psi', carried forward: M' <- (I - K h') Phi M'.
    let mut m = tape.steps[early].p;
    for i in early + 1..=late {
        let step = &tape.steps[i];
        if let Some(transition) = &step.transition {
            let columns: Vec<Row> = (0..DIM)
                .map(|c| transition.apply(&m.column(c).into_owned()))
                .collect();
            m = Cov::from_columns(&columns);
        }
        for z in &tape.linear[step.measurements.clone()] {
            let seen = m.transpose() * z.h;
            m -= z.gain * seen.transpose();
        }
    }
    // Here m maps: column j is the error of `late` that goes with state j of `early`.
    let p = &tape.steps[late].p;
    m.transpose() - m.transpose() * at_late.big * p
}
