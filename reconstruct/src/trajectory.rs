//! The reconstructed motion: one state a sample, in recording order.

/// The state of the car at the end of one 10 ms bin, with the marginal uncertainties a reader needs.
///
/// Position and velocity are the IMU's, in the local north-east-down frame with its origin at the final rest
/// position; without a rest pose north is the car's forward axis at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Index of the sample on the 100 Hz grid.
    pub index: u64,
    /// Seconds from the first trigger.
    pub t_s: f64,
    /// UTC, ns since 1970; `None` where the clock is not known.
    pub utc_ns: Option<i64>,
    /// North, east, down, m.
    pub position: [f64; 3],
    /// North, east, down, m/s.
    pub velocity: [f64; 3],
    /// Roll, rad.
    pub roll: f64,
    /// Pitch, rad.
    pub pitch: f64,
    /// Heading, rad, 0 to 2 pi.
    pub heading: f64,
    /// Forward speed along body x, signed, m/s.
    pub speed: f64,
    /// Horizontal speed over ground, m/s, not negative.
    pub ground_speed: f64,
    /// Angle from body x to the horizontal velocity, rad, positive to the right; `None` below 1 m/s.
    pub sideslip: Option<f64>,
    /// Acceleration free of gravity in body axes, m/s^2; `None` where the sample is missing.
    pub accel: [Option<f64>; 3],
    /// Yaw rate about body z, rad/s, positive to the right; `None` where the sample is missing.
    pub yaw_rate: Option<f64>,
    /// One sigma of north, m.
    pub sd_north: f64,
    /// One sigma of east, m.
    pub sd_east: f64,
    /// Covariance of north and east, m^2.
    pub cov_north_east: f64,
    /// One sigma of down, m.
    pub sd_down: f64,
    /// One sigma of the forward speed, m/s.
    pub sd_speed: f64,
    /// One sigma of the heading, rad.
    pub sd_heading: f64,
    /// One sigma of the forward and rightward acceleration, m/s^2.
    pub sd_accel: [f64; 2],
    /// One sigma of the yaw rate, rad/s.
    pub sd_yaw_rate: f64,
    /// What the position's error on the earth has beyond that relative to the place of rest, where a fit to a
    /// map says so: variance of north, of east, covariance, m^2. `None`: the variance of the rest pose.
    pub on_earth: Option<[f64; 3]>,
    /// True where a wheel speed was used at this sample.
    pub wheels_used: bool,
    /// True where the sample was missing or clipped and was bridged with wide noise.
    pub bridged: bool,
}
