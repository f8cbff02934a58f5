//! The states of the refined model and what they correct.
//!
//! The first nine are those of the nine-state model: estimate minus truth, navigation axes. The others are calibration:
//! truth minus the value applied, so that a correction is *added* to it. The 23 of the design are all here; the rest
//! earned its place by the coverage of the bounds: gyro scales of all axes (a roll-over turns about x), Coriolis where
//! latitude and heading are not known, the delay of the wheels, and the rear axle's sideslip as a gradient and a
//! correlated rest (as white noise of the same size it counts one fact several times), the track width (a tape measure
//! and a rolling tyre do not agree to a percent; a wrong entry shows here), and the IMU's place along the car. Four more
//! lay the path on satellite fixes: without fixes they touch nothing.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::error_model::STATES;
use crate::filter::corrected;
use crate::frame::{Body, Vec3, exp_so3};
use crate::mechanize::{Earth, Nav9};

/// All states.
pub const DIM: usize = 36;
/// Calibration states.
pub const PARAMS: usize = DIM - STATES;

/// Accelerometer bias, sensor axes, m/s^2.
pub const BA: usize = 9;
/// Accelerometer scale, per axis.
pub const SA: usize = 12;
/// Constant unknown horizontal acceleration, m/s^2: Coriolis where the heading is not known [S03, 3.3.1].
pub const CORIOLIS: usize = 15;
/// Mounting yaw of the IMU in the car, rad.
pub const MOUNT_YAW: usize = 17;
/// Mounting pitch of it, rad. Both turn specific force and rate into the car's own axes: on a slope across the road a
/// pitched sensor's x axis points beside the car's, and a heading taken for the car's would be off by their product.
pub const MOUNT_PITCH: usize = 18;
/// Gyro bias, sensor axes, rad/s.
pub const BG: usize = 19;
/// Gyro scale, per axis.
pub const SG: usize = 22;
/// Scale of the left wheel.
pub const WHEEL_LEFT: usize = 25;
/// Scale of the right wheel.
pub const WHEEL_RIGHT: usize = 26;
/// Delay of the wheel frames, s.
pub const LATENCY: usize = 27;
/// Sideslip of the rear axle per lateral acceleration, rad/(m/s^2), outwards.
pub const SLIP_GRADIENT: usize = 28;
/// Track width: true over configured, less one.
pub const TRACK: usize = 29;
/// How much farther ahead of the rear axle the IMU sits than it is said to, m: in a turn that is a sideways speed, and
/// the same in every turn.
pub const LEVER: usize = 30;
/// Turn of the path about its origin onto the satellite fixes, clockwise, rad, beside that of [`crate::anchor::Anchor`].
pub const TURN: usize = 31;
/// Place of the path's origin among the satellite fixes, north of the path's own axes, m, beside that of the anchor.
pub const PLACE: usize = 32;
/// What the fixes are later than they are said to be, s.
pub const LAG: usize = 34;
/// Sideslip of the rear axle beside that, rad: a Gauss-Markov process, and the last state: those before it from
/// [`BA`] on are constant but for the jump of the biases.
pub const SLIP: usize = 35;

/// Covariance of all states.
pub type Cov = SMatrix<f64, DIM, DIM>;
/// A vector of all states, or a row of sensitivities.
pub type Row = SVector<f64, DIM>;

/// The point about which everything is linear: motion and the calibration applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nominal {
    /// Position, velocity, attitude.
    pub nav: Nav9,
    /// Calibration applied: entry `i` belongs to state `STATES + i`.
    pub cal: SVector<f64, PARAMS>,
}

impl Nominal {
    /// The calibration value of a state from [`BA`] on.
    #[must_use]
    pub fn value(&self, state: usize) -> f64 {
        self.cal[state - STATES]
    }

    /// Three calibration values from a state on.
    #[must_use]
    pub fn triple(&self, state: usize) -> Vector3<f64> {
        self.cal.fixed_rows::<3>(state - STATES).into_owned()
    }

    /// The nominal after a correction of all states.
    #[must_use]
    pub fn corrected(&self, x: &Row) -> Self {
        Self {
            nav: corrected(&self.nav, &x.fixed_rows::<STATES>(0).into_owned()),
            cal: self.cal + x.fixed_rows::<PARAMS>(STATES),
        }
    }

    /// Specific force in body axes, the calibration taken out, m/s^2.
    #[must_use]
    pub fn force(&self, accel: &Vector3<f64>) -> Vec3<Body> {
        let f = unscaled(accel - self.triple(BA), self.triple(SA));
        Vec3::from(self.mounted(&f))
    }

    /// The same for a car that moves: the unknown constant acceleration is taken out too.
    #[must_use]
    pub fn moving_force(&self, accel: &Vector3<f64>) -> Vec3<Body> {
        let (north, east) = (self.value(CORIOLIS), self.value(CORIOLIS + 1));
        let extra = self.nav.c_nb.m.transpose() * Vector3::new(north, east, 0.0);
        Vec3::from(self.force(accel).v - extra)
    }

    /// Rate relative to the navigation frame in body axes, the calibration taken out, rad/s.
    #[must_use]
    pub fn rate(&self, rate: &Vector3<f64>, earth: &Earth) -> Vec3<Body> {
        let w = unscaled(rate - self.triple(BG), self.triple(SG));
        Vec3::from(self.mounted(&w) - self.nav.c_nb.m.transpose() * earth.rate_n.v)
    }
}

impl Nominal {
    /// From sensor axes to the car's.
    #[must_use]
    pub fn mounting(&self) -> Matrix3<f64> {
        exp_so3(&Vector3::new(
            0.0,
            -self.value(MOUNT_PITCH),
            -self.value(MOUNT_YAW),
        ))
    }

    fn mounted(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.mounting() * v
    }
}

fn unscaled(value: Vector3<f64>, scale: Vector3<f64>) -> Vector3<f64> {
    value.component_div(&scale.add_scalar(1.0))
}
