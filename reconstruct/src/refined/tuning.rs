//! Figures of the refined model that no data sheet gives, each with its reason.

/// Spreads and gates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Part of a wheel's error that stays the same for `wheel_correlation_s`, m/s: road, rounding at constant speed.
    pub wheel_floor_mps: f64,
    /// How long, s.
    pub wheel_correlation_s: f64,
    /// Sideslip of the rear axle per lateral acceleration, rad/(m/s^2): mean and spread over cars (mass over cornering
    /// stiffness of the rear tyres).
    pub slip_gradient: [f64; 2],
    /// Sideslip beside that (road, wind, tyres), rad, one sigma, and its correlation time, s.
    pub slip_sd: f64,
    /// Its correlation time, s.
    pub slip_time_s: f64,
    /// White part of the lateral speed of the rear axle in one use, m/s.
    pub slip_white_mps: f64,
    /// Time between two uses of no-side-slip and no-jump, s.
    pub slip_interval_s: f64,
    /// Vertical speed of the rear axle as a share of the speed (springs lean), and a floor, m/s.
    pub jump: [f64; 2],
    /// Time over which that stays the same, s.
    pub jump_correlation_s: f64,
    /// No-side-slip ends so long before the first impact, s: a driver swerves.
    pub slip_hold_off_s: f64,
    /// Track width, as a share, one sigma.
    pub track_sd: f64,
    /// Gyro error that a scale does not explain, as a share of the rate (nonlinearity, unlike sides), the same for a
    /// second: a spin.
    pub rate_nonlinearity: f64,
    /// Gate of one innovation: chi-square with one degree.
    pub gate: f64,
    /// Refusals in a row after which a wheel that agrees with the other is taken in again with its residual as noise.
    pub patience: u32,
}

impl Default for Tuning {
    fn default() -> Self {
        Self {
            wheel_floor_mps: 0.02,
            wheel_correlation_s: 0.3,
            slip_gradient: [0.006, 0.0025],
            slip_sd: 0.005,
            slip_time_s: 1.2,
            slip_white_mps: 0.03,
            slip_interval_s: 0.1,
            jump: [0.006, 0.02],
            jump_correlation_s: 1.0,
            slip_hold_off_s: 4.0,
            track_sd: 0.02,
            rate_nonlinearity: 8e-4,
            gate: 10.83,
            patience: 50,
        }
    }
}
