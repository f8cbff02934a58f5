//! Figures of the source: tables 4.9 and 4.10, the program of appendix 6.5, and where they differ.

use super::variant::Source;

/// Gravity, m/s^2, straight down everywhere [S00, 6.5].
pub const GRAVITY: f64 = 9.821_71;
/// Rate of the Earth about its axis, rad/s [S00, 6.5].
pub const EARTH_RATE: f64 = 7_292_115e-11;
/// Radius of the Earth, m, a sphere [S00, 6.5].
pub const RADIUS: f64 = 6_371_000.0;
/// Interval of the inertial samples, s [S00, 6.5].
pub const DT: f64 = 1.0 / 50.0;
/// Samples by which the fixes are late: 1.24 s [S00, 3.3 and 6.5].
pub const LATENCY: usize = 62;
/// Speed above which a fix is used, m/s [S00, 6.5].
pub const GATE: f64 = 3.0;
/// Bound on var(ax) + var(ay) at a stop, (m/s^2)^2 [S00, 4.3].
pub const STOP_VARIANCE: f64 = 0.048;
/// Samples of the stop detector's window, the newest included [S00, 6.5: k - 50 to k].
pub const STOP_WINDOW: usize = 51;
/// Fixes from one update to the next, of the program as printed [S00, 6.5].
pub const EVERY: usize = 5;
/// Scale of the accelerometer: raw to true [S00, 6.5]. The mean of table 4.7, 10.1018 m/s^2, gives 0.97227.
pub const ACCEL_SCALE: f64 = 0.973_96;
/// Pitch and roll of the tag in the car, rad: (2.6) of its accelerometer at rest on level ground [S00, 6.5].
pub const TAG_PITCH: f64 = 0.438_057_067_391_664;
/// Roll of the tag in the car, rad [S00, 6.5].
pub const TAG_ROLL: f64 = -0.018_167_281_156_47;
/// Gyro biases about x, y, z the program starts from, rad/s [S00, 6.5; table 4.6, first row, rounded].
pub const GYRO_BIAS: [f64; 3] = [-0.004_225_4, 0.003_310_0, -0.003_820_8];
/// Variances of the initial states: 3 of position, 3 of velocity, angles, rates, biases [S00, 6.5]. The program prints
/// 14 for 15 states; it is the third position that is missing (see [`super::SLIPS`]).
pub const P0: [f64; 15] = [
    3.0, 3.0, 3.0, 0.36, 0.36, 0.36, 1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4, 0.1, 0.1, 0.1,
];

/// Variances of the measurements [S00, 3.9, 3.10].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Position of a fix, each ECEF axis, m^2.
    pub position: f64,
    /// Velocity of a fix, each axis, (m/s)^2.
    pub velocity_gnss: f64,
    /// Inertial velocity, each axis, (m/s)^2.
    pub velocity_imu: f64,
    /// Roll from the accelerometers, rad^2.
    pub roll: f64,
    /// Pitch from the accelerometers, rad^2.
    pub pitch: f64,
    /// Yaw from the velocity of a fix, rad^2.
    pub yaw: f64,
    /// Rates about x, y, z, (rad/s)^2.
    pub rate: [f64; 3],
}

impl Noise {
    /// Table 4.9 or the program.
    ///
    /// The table has (100 rad)^2 for roll, pitch and yaw, the program 1e4, 1e5 and 1e10; the table's rates are
    /// the roots of the program's, cut to three digits.
    #[must_use]
    pub fn of(source: Source) -> Self {
        let common = Self {
            position: 6.0 * 6.0,
            velocity_gnss: 0.43 * 0.43,
            velocity_imu: 1.0,
            roll: 1e4,
            pitch: 1e5,
            yaw: 1e10,
            rate: [1.8e-4, 5.5e-4, 2.9e-5],
        };
        match source {
            Source::Program => common,
            Source::Text => Self {
                pitch: 1e4,
                yaw: 1e4,
                rate: TABLE_RATES,
                ..common
            },
        }
    }
}

/// (0.0134, 0.0234, 0.0053 rad/s)^2 of tables 4.9 and 4.10.
const TABLE_RATES: [f64; 3] = [0.0134 * 0.0134, 0.0234 * 0.0234, 0.0053 * 0.0053];

/// Spectral densities of the process noise. The source gives them the units of variances; by (3.8) they are
/// variances per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Process {
    /// `q1`: position, each axis, m^2/s.
    pub position: f64,
    /// `q2`: velocity, each axis, (m/s)^2/s.
    pub velocity: f64,
    /// `q3`: roll, pitch, yaw, rad^2/s.
    pub angle: [f64; 3],
    /// `q4`: rates about x, y, z, (rad/s)^2/s.
    pub rate: [f64; 3],
    /// `q5`: gyro biases, each axis, (rad/s)^2/s.
    pub bias: f64,
}

impl Process {
    /// Table 4.10 or the program: `q1` is (2.2 m)^2 = 4.84 in the one and 5 in the other, `q3` of yaw
    /// (3.16 rad)^2 = 9.9856 and 10.
    #[must_use]
    pub fn of(source: Source) -> Self {
        let common = Self {
            position: 5.0,
            velocity: 4.0,
            angle: [1.0, 1.0, 10.0],
            rate: [1.8e-4, 5.5e-4, 2.9e-5],
            bias: 1e-6,
        };
        match source {
            Source::Program => common,
            Source::Text => Self {
                position: 2.2 * 2.2,
                angle: [1.0, 1.0, 3.16 * 3.16],
                rate: TABLE_RATES,
                ..common
            },
        }
    }

    /// Densities in the order of the states, 15.
    #[must_use]
    pub fn densities(&self) -> [f64; 15] {
        let (p, v, a, r, b) = (
            self.position,
            self.velocity,
            self.angle,
            self.rate,
            self.bias,
        );
        [
            p, p, p, v, v, v, a[0], a[1], a[2], r[0], r[1], r[2], b, b, b,
        ]
    }
}
