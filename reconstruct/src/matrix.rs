//! Matrix exponential and van Loan's integral [S03, 2.27-2.29], exact to rounding.

use nalgebra::DMatrix;

use crate::error::ReconstructError;

/// Coefficients of the Pade approximant of order 13 (Higham 2005).
const PADE_13: [f64; 14] = [
    64_764_752_532_480_000.0,
    32_382_376_266_240_000.0,
    7_771_770_303_897_600.0,
    1_187_353_796_428_800.0,
    129_060_195_264_000.0,
    10_559_470_521_600.0,
    670_442_572_800.0,
    33_522_128_640.0,
    1_323_241_920.0,
    40_840_800.0,
    960_960.0,
    16_380.0,
    182.0,
    1.0,
];

/// Largest 1-norm for which the order-13 approximant is accurate to double precision.
const THETA_13: f64 = 5.371_920_351_148_152;

/// `exp(a)` of a square matrix by scaling, Pade approximation and squaring [S03, 2.27].
///
/// # Errors
/// [`ReconstructError::Numeric`] if `a` holds a value that is not finite, or is scaled beyond reason.
pub fn expm(a: &DMatrix<f64>) -> Result<DMatrix<f64>, ReconstructError> {
    let n = a.nrows();
    let norm = (0..n)
        .map(|j| a.column(j).iter().map(|x| x.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    if !a.iter().all(|x| x.is_finite()) || a.ncols() != n {
        return Err(ReconstructError::Numeric {
            place: "matrix exponential",
            what: format!(
                "a square finite matrix is needed, found {n} x {} of norm {norm}",
                a.ncols()
            ),
        });
    }
    let mut squarings = 0;
    let mut scale = 1.0;
    while norm * scale > THETA_13 {
        scale *= 0.5;
        squarings += 1;
    }
    let a = a * scale;
    let id = DMatrix::identity(n, n);
    let a2 = &a * &a;
    let a4 = &a2 * &a2;
    let a6 = &a4 * &a2;
    let c = &PADE_13;
    let odd = &a6 * (&a6 * c[13] + &a4 * c[11] + &a2 * c[9])
        + &a6 * c[7]
        + &a4 * c[5]
        + &a2 * c[3]
        + &id * c[1];
    let u = &a * odd;
    let v = &a6 * (&a6 * c[12] + &a4 * c[10] + &a2 * c[8])
        + &a6 * c[6]
        + &a4 * c[4]
        + &a2 * c[2]
        + &id * c[0];
    let mut e = (&v - &u)
        .lu()
        .solve(&(&v + &u))
        .ok_or_else(|| ReconstructError::Numeric {
            place: "matrix exponential",
            what: "the denominator is singular".to_owned(),
        })?;
    for _ in 0..squarings {
        e = &e * &e;
    }
    Ok(e)
}

/// Transition and process noise over `dt` seconds of `x' = F x + G u`, `W` the spectral density of `u`:
/// `(exp(F dt), Q)` by van Loan's block matrix [S03, 2.28 and 2.29]. `f` is n x n, `gwg` = `G W G'` n x n.
///
/// A backward step hands in `-F` and the same positive noise.
///
/// # Errors
/// As [`expm`].
pub fn van_loan(
    f: &DMatrix<f64>,
    gwg: &DMatrix<f64>,
    dt: f64,
) -> Result<(DMatrix<f64>, DMatrix<f64>), ReconstructError> {
    let n = f.nrows();
    let mut a = DMatrix::zeros(2 * n, 2 * n);
    a.view_mut((0, 0), (n, n)).copy_from(&(-f * dt));
    a.view_mut((0, n), (n, n)).copy_from(&(gwg * dt));
    a.view_mut((n, n), (n, n)).copy_from(&(f.transpose() * dt));
    let b = expm(&a)?;
    let phi = b.view((n, n), (n, n)).transpose();
    let q = &phi * b.view((0, n), (n, n));
    let q = (&q + q.transpose()) * 0.5;
    Ok((phi, q))
}

#[cfg(test)]
mod tests {
    use super::*;
    use schema::num::real;

    fn wave(n: usize, size: f64) -> DMatrix<f64> {
        DMatrix::from_fn(n, n, |i, j| size * (real(1 + 3 * i + 7 * j)).sin())
    }

    #[test]
    fn exponential_meets_nalgebra_and_its_own_inverse() {
        for (n, size) in [(1, 0.3), (4, 0.01), (9, 1.0), (18, 3.0)] {
            let a = wave(n, size);
            let e = expm(&a).unwrap();
            assert!((&e - a.exp()).norm() / e.norm() < 1e-12, "{n} {size}");
            let back = expm(&(-&a)).unwrap();
            let identity = DMatrix::identity(n, n);
            assert!(
                (&e * back - identity).norm() < 1e-9 * e.norm(),
                "{n} {size}"
            );
        }
    }

    #[test]
    fn van_loan_meets_its_identity() {
        // d/dt of the integral: F Q + Q F' + W - Phi W Phi' = 0, exactly, for every F and W.
        for (n, size, dt) in [(3, 1.0, 0.01), (9, 2.0, 0.05), (9, 0.5, 1.0)] {
            let f = wave(n, size);
            let w = &wave(n, 1.0) * wave(n, 1.0).transpose();
            let (phi, q) = van_loan(&f, &w, dt).unwrap();
            let rest = &f * &q + &q * f.transpose() + &w - &phi * &w * phi.transpose();
            assert!(
                rest.norm() / w.norm() < 1e-12,
                "{n} {size} {dt}: {}",
                rest.norm()
            );
        }
    }

    #[test]
    fn not_finite_is_an_error() {
        let a = DMatrix::from_element(2, 2, f64::NAN);
        assert!(expm(&a).is_err());
    }
}
