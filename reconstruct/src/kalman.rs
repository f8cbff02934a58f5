//! A Schmidt-Kalman filter: N estimated errors, M considered ones. It knows no vehicles.
//!
//! Considered parameters (biases, scales) are never estimated, but their share in every error is carried as a
//! cross covariance, so that the covariance of the estimated states stays honest.

use nalgebra::{SMatrix, SVector};

/// Covariance of N estimated and M considered errors. The considered ones are independent of each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Belief<const N: usize, const M: usize> {
    /// Covariance of the estimated errors, N x N.
    pub p_xx: SMatrix<f64, N, N>,
    /// Cross covariance, N x M.
    pub p_xc: SMatrix<f64, N, M>,
    /// Variances of the considered errors, M.
    pub p_cc: SVector<f64, M>,
}

/// A scalar pseudo-measurement of the errors: `residual = h_x x + h_c c + noise`, where the residual is the
/// predicted value minus the measured one and errors are estimate minus truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scalar<const N: usize, const M: usize> {
    /// Predicted minus measured.
    pub residual: f64,
    /// Sensitivity to the estimated errors.
    pub h_x: SVector<f64, N>,
    /// Sensitivity to the considered errors.
    pub h_c: SVector<f64, M>,
    /// Variance of the noise.
    pub r: f64,
}

impl<const N: usize, const M: usize> Belief<N, M> {
    /// Variance of the residual, `S = H P H' + R`.
    #[must_use]
    pub fn innovation_variance(&self, z: &Scalar<N, M>) -> f64 {
        let (s_x, s_c) = self.projections(z);
        z.h_x.dot(&s_x) + z.h_c.dot(&s_c) + z.r
    }

    /// `P H'`, split into the estimated and the considered rows. Most of `h_c` is zero.
    fn projections(&self, z: &Scalar<N, M>) -> (SVector<f64, N>, SVector<f64, M>) {
        let mut s_x = self.p_xx * z.h_x;
        let mut s_c = SVector::<f64, M>::zeros();
        for j in 0..M {
            let column = self.p_xc.column(j);
            s_c[j] = column.dot(&z.h_x);
            let h = z.h_c[j];
            if h != 0.0 {
                s_x += column * h;
                s_c[j] += self.p_cc[j] * h;
            }
        }
        (s_x, s_c)
    }

    /// Measurement update with gain on the estimated errors only [S03, 2.20-2.22, after Schmidt].
    ///
    /// Returns the estimated errors (to be taken off the state), or `None`, with nothing changed, where the
    /// innovation variance is not a positive number or `residual^2 / S` exceeds `gate`.
    pub fn update(&mut self, z: &Scalar<N, M>, gate: f64) -> Option<SVector<f64, N>> {
        let (s_x, s_c) = self.projections(z);
        let s = z.h_x.dot(&s_x) + z.h_c.dot(&s_c) + z.r;
        let within = z.residual * z.residual <= gate * s;
        if !(s > 0.0 && s.is_finite() && z.residual.is_finite() && within) {
            return None;
        }
        let k = s_x / s;
        // With the gain K = s_x / S on x alone: P_xx - K S K', P_xc - K (H P)_c; P_cc stays.
        self.p_xx -= k * s_x.transpose();
        self.p_xc -= k * s_c.transpose();
        Some(k * z.residual)
    }

    /// Time update `x <- Phi x + Gamma c + w` [S03, 2.23 and 2.24], dense; the reference for the sparse one.
    pub fn predict(
        &mut self,
        phi: &SMatrix<f64, N, N>,
        gamma: &SMatrix<f64, N, M>,
        q: &SMatrix<f64, N, N>,
    ) {
        let u = phi * self.p_xc;
        let d = SMatrix::<f64, M, M>::from_diagonal(&self.p_cc);
        let cross = u * gamma.transpose();
        self.p_xx = phi * self.p_xx * phi.transpose()
            + cross
            + cross.transpose()
            + gamma * d * gamma.transpose()
            + q;
        self.p_xc = u + gamma * d;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix3, Vector1, Vector2};

    /// The full joint filter of the same problem, gain on the considered part forced to zero.
    #[test]
    fn update_meets_the_joint_covariance_with_a_masked_gain() {
        let mut belief = Belief::<2, 1> {
            p_xx: Matrix2::new(2.0, 0.3, 0.3, 1.0),
            p_xc: Vector2::new(0.2, -0.1),
            p_cc: Vector1::new(0.5),
        };
        let joint = Matrix3::new(2.0, 0.3, 0.2, 0.3, 1.0, -0.1, 0.2, -0.1, 0.5);
        let h = nalgebra::Vector3::new(1.0, 0.5, 2.0);
        let s = (h.transpose() * joint * h)[0] + 0.1;
        let mut k = joint * h / s;
        k[2] = 0.0;
        let i = Matrix3::identity() - k * h.transpose();
        let want = i * joint * i.transpose() + k * k.transpose() * 0.1;
        let z = Scalar {
            residual: 0.7,
            h_x: Vector2::new(1.0, 0.5),
            h_c: Vector1::new(2.0),
            r: 0.1,
        };
        let correction = belief.update(&z, f64::INFINITY).unwrap();
        assert!((correction - k.fixed_rows::<2>(0) * 0.7).norm() < 1e-12);
        assert!((belief.p_xx - want.fixed_view::<2, 2>(0, 0)).norm() < 1e-12);
        assert!((belief.p_xc - want.fixed_view::<2, 1>(0, 2)).norm() < 1e-12);
    }

    #[test]
    fn a_wild_residual_changes_nothing() {
        let mut belief = Belief::<2, 1> {
            p_xx: Matrix2::identity(),
            p_xc: Vector2::zeros(),
            p_cc: Vector1::new(0.5),
        };
        let before = belief.clone();
        let z = Scalar {
            residual: 100.0,
            h_x: Vector2::new(1.0, 0.0),
            h_c: Vector1::zeros(),
            r: 0.1,
        };
        assert!(belief.update(&z, 10.0).is_none());
        let z = Scalar {
            residual: f64::NAN,
            ..z
        };
        assert!(belief.update(&z, f64::INFINITY).is_none());
        let z = Scalar {
            residual: 0.0,
            r: f64::NAN,
            ..z
        };
        assert!(belief.update(&z, 10.0).is_none());
        assert_eq!(belief, before);
    }
}
