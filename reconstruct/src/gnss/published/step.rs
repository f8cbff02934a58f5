//! What the filter tells of each step.

use nalgebra::Vector3;

use super::matrices::{ATT, BIAS, Cov, POS, RATE, State, VEL};

/// What a step used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Used {
    /// The inertial sample.
    Imu,
    /// The inertial sample and a fix.
    Gnss,
    /// Nothing: the car stands.
    Stop,
}

/// The estimate after one inertial sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Time by the stamps of the fixes, s: what a fix of this time tells of.
    pub t_s: f64,
    /// Index of the inertial sample, the latency taken off.
    pub sample: usize,
    /// Latitude, rad.
    pub lat: f64,
    /// Longitude, rad.
    pub lon: f64,
    /// Height, m.
    pub height: f64,
    /// The states (3.1), 15.
    pub x: State,
    /// Diagonal of P, 15, in the squares of the states' units.
    pub variances: State,
    /// P, 15 x 15, where it was asked for.
    pub covariance: Option<Box<Cov>>,
    /// What was used.
    pub used: Used,
}

impl Step {
    fn three(&self, at: usize) -> Vector3<f64> {
        self.x.fixed_rows::<3>(at).into_owned()
    }

    /// ECEF position, m.
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.three(POS)
    }

    /// ECEF velocity, m/s.
    #[must_use]
    pub fn velocity(&self) -> Vector3<f64> {
        self.three(VEL)
    }

    /// Roll, pitch, yaw, rad; yaw is not wrapped.
    #[must_use]
    pub fn angles(&self) -> Vector3<f64> {
        self.three(ATT)
    }

    /// Rates about x, y, z, biases included, rad/s.
    #[must_use]
    pub fn rates(&self) -> Vector3<f64> {
        self.three(RATE)
    }

    /// Gyro biases about x, y, z, rad/s.
    #[must_use]
    pub fn bias(&self) -> Vector3<f64> {
        self.three(BIAS)
    }
}
