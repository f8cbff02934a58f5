//! The filter by the textbook's five equations [S00, 2.8], dense: the reference for [`super::Chains`].
#![allow(
    non_snake_case,
    reason = "matrices keep the names they have in the literature"
)]

use nalgebra::{SMatrix, SVector};

use super::error::PublishedError;
use super::matrices::{Cov, Estimator, Row, STATES, State, selection};

/// State and covariance, with the model's matrices.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    x: State,
    P: Cov,
    phi: Cov,
    Q: Cov,
}

impl Dense {
    /// A filter at state `x` (15) with covariance `P`, transition `phi` and process noise `Q` (15 x 15 each).
    #[must_use]
    pub fn new(x: State, P: Cov, phi: Cov, Q: Cov) -> Self {
        Self { x, P, phi, Q }
    }

    /// (2.8c) to (2.8e) for M rows; the inverse by Cholesky's factor.
    fn rows<const M: usize>(&mut self, rows: &[Row]) -> Result<(), PublishedError> {
        let mut states = [0; M];
        let (mut z, mut r) = (SVector::<f64, M>::zeros(), SVector::<f64, M>::zeros());
        for (i, row) in rows.iter().take(M).enumerate() {
            (states[i], z[i], r[i]) = (row.state, row.z, row.r);
        }
        let H = selection(&states);
        let R = SMatrix::<f64, M, M>::from_diagonal(&r);
        let PH = self.P * H.transpose();
        let inverse = (H * PH + R)
            .cholesky()
            .ok_or(PublishedError::Innovation { step: 0 })?
            .inverse();
        let K = PH * inverse;
        self.x += K * (z - H * self.x);
        self.P = (Cov::identity() - K * H) * self.P;
        Ok(())
    }
}

impl Estimator for Dense {
    fn x(&self) -> &State {
        &self.x
    }

    fn x_mut(&mut self) -> &mut State {
        &mut self.x
    }

    fn predict(&mut self) {
        self.x = self.phi * self.x;
        self.P = self.phi * self.P * self.phi.transpose() + self.Q;
    }

    fn update(&mut self, rows: &[Row]) -> Result<(), PublishedError> {
        if rows.iter().any(|row| row.state >= STATES) {
            return Err(PublishedError::Rows { found: rows.len() });
        }
        match rows.len() {
            3 => self.rows::<3>(rows),
            5 => self.rows::<5>(rows),
            8 => self.rows::<8>(rows),
            9 => self.rows::<9>(rows),
            10 => self.rows::<10>(rows),
            11 => self.rows::<11>(rows),
            12 => self.rows::<12>(rows),
            13 => self.rows::<13>(rows),
            14 => self.rows::<14>(rows),
            15 => self.rows::<15>(rows),
            found => Err(PublishedError::Rows { found }),
        }
    }

    fn variances(&self) -> State {
        self.P.diagonal()
    }

    fn covariance(&self) -> Cov {
        self.P
    }
}
