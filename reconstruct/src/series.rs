//! Transition and noise of the published model by their series [S03, 2.27], and the covariance step by sparse
//! products: `F` has twelve entries.

use nalgebra::SMatrix;

use crate::error_model::STATES;

/// A 9 x 9 matrix by rows.
pub(crate) type Rows = [[f64; STATES]; STATES];

/// Terms of the series: `F h` is at most a few tenths and all but nilpotent (the Schuler loop is of order
/// h^2 g/R), so what follows the sixth term is below rounding.
const TERMS: u32 = 6;

/// The sparse product `F m`, entries of `F` as (row, column, value).
fn times(entries: &[(usize, usize, f64)], m: &Rows) -> Rows {
    let mut out = [[0.0; STATES]; STATES];
    for &(i, j, x) in entries {
        for (to, from) in out[i].iter_mut().zip(&m[j]) {
            *to += x * from;
        }
    }
    out
}

/// `exp(F h)` and the noise integral by their series [S03, 2.27], up to rounding. `w` is the spectral density
/// `G W G'`.
#[must_use]
pub(crate) fn series(
    f: &SMatrix<f64, STATES, STATES>,
    w: &SMatrix<f64, STATES, STATES>,
    h: f64,
) -> (Rows, Rows) {
    let mut entries = Vec::with_capacity(STATES * 2);
    for j in 0..STATES {
        for i in 0..STATES {
            if f[(i, j)] != 0.0 {
                entries.push((i, j, f[(i, j)] * h));
            }
        }
    }
    let mut phi: Rows = [[0.0; STATES]; STATES];
    let mut rate: Rows = [[0.0; STATES]; STATES];
    for i in 0..STATES {
        phi[i][i] = 1.0;
        for j in 0..STATES {
            rate[i][j] = w[(i, j)] * h;
        }
    }
    let mut term = phi;
    let mut q = rate;
    for n in 1..=TERMS {
        let share = 1.0 / f64::from(n);
        term = times(&entries, &term);
        let half = times(&entries, &rate);
        let next = 1.0 / f64::from(n + 1);
        for i in 0..STATES {
            for j in 0..STATES {
                term[i][j] *= share;
                phi[i][j] += term[i][j];
                rate[i][j] = (half[i][j] + half[j][i]) * next;
                q[i][j] += rate[i][j];
            }
        }
    }
    (phi, q)
}

/// `P <- Phi P Phi' + Q`, with the few entries that `Phi` has beside the identity.
pub(crate) fn propagate(p: &mut SMatrix<f64, STATES, STATES>, phi: &Rows, q: &Rows) {
    let mut entries = Vec::with_capacity(STATES * 3);
    for (i, row) in phi.iter().enumerate() {
        for (j, x) in row.iter().enumerate() {
            let x = if i == j { x - 1.0 } else { *x };
            if x != 0.0 {
                entries.push((i, j, x));
            }
        }
    }
    // P is symmetric, so its columns may be read as rows.
    let now: Rows = (*p).into();
    let moved = times(&entries, &now);
    let mut half = now;
    let mut turned = now;
    for i in 0..STATES {
        for j in 0..STATES {
            half[i][j] += moved[i][j];
            turned[j][i] = half[i][j];
        }
    }
    let back = times(&entries, &turned);
    for i in 0..STATES {
        for j in 0..STATES {
            p[(i, j)] = half[i][j] + back[j][i] + q[i][j];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::van_loan;
    use crate::published::{Signs, f_matrix};
    use nalgebra::{DMatrix, Vector3};
    use schema::num::real;

    #[test]
    fn series_meets_van_loan() {
        let f = f_matrix(
            &Vector3::new(-8.0, 3.0, 0.0),
            &Vector3::new(0.4, -0.2, 3.0),
            9.81,
            Signs::Corrected,
        );
        let w = SMatrix::<f64, STATES, STATES>::from_diagonal_element(0.3);
        let (phi, q) = series(&-f, &w, 0.05);
        let d =
            |m: &SMatrix<f64, STATES, STATES>| DMatrix::from_fn(STATES, STATES, |i, j| m[(i, j)]);
        let (want_phi, want_q) = van_loan(&d(&-f), &d(&w), 0.05).unwrap();
        let rows = |m: &Rows| SMatrix::<f64, STATES, STATES>::from_fn(|i, j| m[i][j]);
        assert!((d(&rows(&phi)) - &want_phi).norm() < 1e-13);
        assert!((d(&rows(&q)) - &want_q).norm() < 1e-14);
        // The sparse congruence and the turned covariance against dense products.
        let p = SMatrix::<f64, STATES, STATES>::from_fn(|i, j| {
            real(i + j).sin() + if i == j { 20.0 } else { 0.0 }
        });
        let mut moved = p;
        propagate(&mut moved, &phi, &q);
        let want = &want_phi * d(&p) * want_phi.transpose() + want_q;
        assert!((d(&moved) - want).norm() < 1e-11);
    }
}
