//! What a simulated crash is made of. Every field is public, so that a test can make one cause visible.
//!
//! SI and radians; body axes x forward, y right, z down; places from the rear axle's centre on the ground;
//! times in seconds of the log.

use super::class::{Class, Grade};
use super::errors::{Errors, Sheet};
use super::pulse::Pulse;

/// A whole scenario: the motion, the car, the sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// What happens.
    pub class: Class,
    /// Grade the sensor errors were drawn for.
    pub grade: Grade,
    /// Seed of every random process.
    pub seed: u64,
    /// Seed of what the sensors do: [`Self::seed`], unless other sensors were put into the same car.
    pub sensor_seed: u64,
    /// Rate of the IMU frames, Hz: a divisor of 2000 from 100 to 1000.
    pub imu_hz: usize,
    /// Rate of the wheel frames, Hz.
    pub wheel_hz: f64,
    /// Moment of the first wheel frame, s.
    pub wheel_phase: f64,
    /// UTC of the log's first frame, a full second, s since 1970.
    pub start_unix_s: i64,
    /// Axes in which the IMU frames are sent.
    pub axes: Axes,
    /// Gravity, m/s^2.
    pub gravity: f64,
    /// The car.
    pub car: Car,
    /// The road before the crash.
    pub road: Road,
    /// What driver and impact do.
    pub manoeuvre: Manoeuvre,
    /// What the configuration says of the sensors: statistics, never the drawn values.
    pub sheet: Sheet,
    /// What the sensors really do wrong.
    pub errors: Errors,
}

/// Axes of the IMU signals on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// ISO 8855: y and z carry the opposite sign.
    FrontLeftUp,
    /// Body axes as used inside.
    FrontRightDown,
}

/// Lengths and springs of the car.
#[derive(Clone, Debug, PartialEq)]
pub struct Car {
    /// Track width of the undriven (rear) wheels, m.
    pub track_width: f64,
    /// IMU, as configured, m.
    pub imu_nominal: [f64; 3],
    /// IMU, true, m.
    pub imu: [f64; 3],
    /// Centre of gravity, as configured, m.
    pub cg_nominal: [f64; 3],
    /// Centre of gravity, true, m.
    pub cg: [f64; 3],
    /// Roll of the body against the road per lateral acceleration, rad/(m/s^2); leaning outwards.
    pub roll_per_lateral: f64,
    /// Pitch of the body against the road per longitudinal acceleration, rad/(m/s^2); nose down when braking.
    pub pitch_per_longitudinal: f64,
    /// Natural frequency of the body on its springs, Hz.
    pub spring_hz: f64,
    /// Damping ratio of it.
    pub spring_damping: f64,
}

/// The road before the crash: stationary processes over distance, soft-limited to H1 [S03, 2.4].
#[derive(Clone, Debug, PartialEq)]
pub struct Road {
    /// Mean roll (crown), rad.
    pub roll_mean: f64,
    /// Standard deviation of roll about it, rad.
    pub roll_sd: f64,
    /// Largest roll, rad.
    pub roll_limit: f64,
    /// Standard deviation of pitch, rad.
    pub pitch_sd: f64,
    /// Largest pitch, rad.
    pub pitch_limit: f64,
    /// Distance over which both correlations fall to 1/e, m.
    pub correlation: f64,
}

/// What driver and impact do.
#[derive(Clone, Debug, PartialEq)]
pub struct Manoeuvre {
    /// Speed at the log's start, m/s.
    pub start_speed: f64,
    /// Speeds to drive at: from this time on, this speed.
    pub speeds: Vec<SpeedTarget>,
    /// Largest acceleration of the driver, m/s^2.
    pub drive_accel: f64,
    /// Largest deceleration of the driver before the braking, m/s^2, positive.
    pub drive_decel: f64,
    /// Curves along the road.
    pub curves: Vec<Curve>,
    /// Standard deviation of the lateral acceleration of lane keeping, m/s^2.
    pub wander_sd: f64,
    /// Sideslip at the rear axle.
    pub sideslip: Sideslip,
    /// The last braking; `None`: none.
    pub braking: Option<BrakingPlan>,
    /// Impacts in order of time.
    pub impacts: Vec<ImpactPlan>,
    /// After the first impact.
    pub slide: Slide,
    /// Roll-over after the impact.
    pub rollover: Option<Rollover>,
    /// Rest kept at the end, s.
    pub rest: f64,
    /// The car never moves, and stands so long, s.
    pub still: Option<f64>,
}

/// From `t` on, drive at `speed`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedTarget {
    /// s.
    pub t: f64,
    /// m/s.
    pub speed: f64,
}

/// A curve: lateral acceleration ramping up, held, ramping down (clothoid, arc, clothoid).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// Distance from the log's start, m.
    pub start: f64,
    /// m.
    pub length: f64,
    /// Share of the length of each ramp.
    pub ramp: f64,
    /// Lateral acceleration of the arc, m/s^2, positive to the right.
    pub lateral: f64,
}

/// Sideslip at the rear axle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sideslip {
    /// Standard deviation of the correlated part, rad.
    pub sd: f64,
    /// Its correlation time, s.
    pub time: f64,
    /// Part that grows with lateral acceleration, outwards, rad/(m/s^2).
    pub per_lateral: f64,
}

/// The last braking.
#[derive(Clone, Debug, PartialEq)]
pub struct BrakingPlan {
    /// Onset, s.
    pub t: f64,
    /// Deceleration, m/s^2, positive.
    pub decel: f64,
    /// Mean slip of the left and right wheel, fraction.
    pub slip: [f64; 2],
    /// Frequency of the ABS cycle of each wheel, Hz.
    pub abs_hz: [f64; 2],
    /// Depth of the ABS cycle, share of the slip.
    pub abs_depth: f64,
    /// A wheel that locks: 0 left, 1 right, 2 both.
    pub lock: Option<usize>,
}

/// One impact.
#[derive(Clone, Debug, PartialEq)]
pub struct ImpactPlan {
    /// Onset of the pulse, s.
    pub t: f64,
    /// Velocity the pulse adds to the centre of gravity, forward and right in the body axes at the onset, m/s.
    pub delta_v: [f64; 2],
    /// Yaw rate the pulse adds, rad/s.
    pub spin: f64,
    /// Roll and pitch rate the pulse gives the body on its springs, rad/s.
    pub kick: [f64; 2],
    /// Shape.
    pub pulse: Pulse,
}

/// The way to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Slide {
    /// Friction, m/s^2, opposing the velocity.
    pub friction: f64,
    /// Deceleration of the spin, rad/s^2.
    pub spin_decel: f64,
    /// Slip of the wheels that still roll, fraction.
    pub slip: [f64; 2],
    /// Wheels that stand still after the impact.
    pub locked: [bool; 2],
    /// Slope of the place of rest on top of the road, up along and up to the right of the road, rad.
    pub slope: [f64; 2],
    /// Distance over which that slope is reached, m.
    pub slope_distance: f64,
}

/// A roll-over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rollover {
    /// Begin, s.
    pub t: f64,
    /// Duration, s.
    pub duration: f64,
    /// Angle, rad: pi onto the roof; the sign is the direction.
    pub angle: f64,
    /// Height by which the wheels' side has risen when on the roof, m.
    pub height: f64,
}
