//! What is known before the first measurement: where the pass starts and how unsure every state is.

use nalgebra::Vector3;

use super::pass::{Given, REST_SPEED_SD};
use super::states::{
    BA, BG, CORIOLIS, Cov, LATENCY, LEVER, MOUNT_PITCH, MOUNT_YAW, Nominal, PARAMS, SA, SG, SLIP,
    SLIP_GRADIENT, TRACK, WHEEL_LEFT, WHEEL_RIGHT,
};
use crate::constraint::Geometry;
use crate::error_model::{ATT, POS, STATES, VEL};
use crate::mechanize::EARTH_RATE;

/// Place at rest, one sigma, m.
const REST_PLACE_SD: f64 = 0.005;
/// Tilt before levelling, rad: wide, levelling decides.
const REST_TILT_SD: f64 = 0.2;
/// Heading at rest is zero by definition; a number above zero keeps the prior invertible, rad.
const REST_HEADING_SD: f64 = 1e-6;
/// The mounting's prior is so many times that of the sheet: the drive tells it to 0.3 degrees, so that a width costs nothing
/// (coverage and errors of 100 crashes stay), and a sensor mounted off by three sigmas is not held back to two.
const MOUNTING_WIDER: f64 = 1.5;
/// Speed of a car of which neither rest nor wheels tell it, m/s.
const UNKNOWN_SPEED_SD: f64 = 20.0;
/// Sideways speed of the same after an impact, m/s.
const UNKNOWN_SIDE_SD: f64 = 12.0;

/// Where the pass starts.
pub(super) fn nominal(given: &Given<'_>) -> Nominal {
    let setup = given.setup;
    let mut cal = nalgebra::SVector::<f64, PARAMS>::zeros();
    cal[LATENCY - STATES] = setup.reversed.forward().header.wheels.latency_s;
    cal[SLIP_GRADIENT - STATES] = given.tuning.slip_gradient[0];
    Nominal {
        nav: given.again.unwrap_or(setup.start.nav),
        cal,
    }
}

/// What is known before the first measurement.
pub(super) fn covariance(given: &Given<'_>) -> Cov {
    let setup = given.setup;
    let epochs = setup.reversed.forward();
    let (imu, wheels) = (&epochs.header.imu, &epochs.header.wheels);
    let mut p = Cov::zeros();
    let mut set = |state: usize, sd: f64| p[(state, state)] = sd * sd;
    for axis in 0..3 {
        set(BA + axis, imu.accel_bias);
        set(SA + axis, imu.accel_scale);
        set(BG + axis, imu.rate_bias);
        set(SG + axis, imu.rate_scale);
    }
    let top = epochs
        .list
        .iter()
        .flat_map(|e| e.wheels)
        .flatten()
        .fold(30.0, f64::max);
    // The horizontal Coriolis acceleration is at most 2 Omega v; uniform within it [S03, 3.3.1].
    let unknown_earth = setup.earth.rate_n.v == Vector3::zeros();
    let coriolis = if unknown_earth {
        2.0 * EARTH_RATE * top / 3.0_f64.sqrt()
    } else {
        1e-6
    };
    set(CORIOLIS, coriolis);
    set(CORIOLIS + 1, coriolis);
    set(MOUNT_YAW, MOUNTING_WIDER * imu.mounting_sd[2].max(1e-6));
    set(MOUNT_PITCH, MOUNTING_WIDER * imu.mounting_sd[1].max(1e-6));
    set(LATENCY, wheels.latency_sd_s.max(1e-6));
    set(SLIP_GRADIENT, given.tuning.slip_gradient[1]);
    set(SLIP, given.tuning.slip_sd);
    set(TRACK, given.tuning.track_sd);
    let geometry = Geometry::new(&epochs.header.vehicle);
    set(LEVER, geometry.imu_sd.x.max(1e-6));
    for (state, sd) in crate::anchor::rows::spreads(setup.anchor) {
        set(state, sd);
    }
    if given.rest.found() {
        for axis in 0..3 {
            set(POS + axis, REST_PLACE_SD);
            set(VEL + axis, 10.0 * REST_SPEED_SD);
        }
        set(ATT, REST_TILT_SD);
        set(ATT + 1, REST_TILT_SD);
        set(ATT + 2, REST_HEADING_SD);
    } else {
        moving(given, &mut p);
    }
    let (common, half) = (
        wheels.scale_sd.powi(2),
        (0.5 * wheels.scale_difference_sd).powi(2),
    );
    for side in [WHEEL_LEFT, WHEEL_RIGHT] {
        p[(side, side)] = common + half;
    }
    p[(WHEEL_LEFT, WHEEL_RIGHT)] = common - half;
    p[(WHEEL_RIGHT, WHEEL_LEFT)] = common - half;
    p
}

/// A record that ends moving: as the nine-state model starts it, but after an impact no wheel and no direction counts;
/// the drive before the impact tells the speed.
fn moving(given: &Given<'_>, p: &mut Cov) {
    let setup = given.setup;
    let belief = &setup.start.belief;
    for i in 0..STATES {
        p[(i, i)] = belief.p_xx[(i, i)];
    }
    p[(ATT + 2, ATT + 2)] = REST_HEADING_SD * REST_HEADING_SD;
    let after = setup
        .motion
        .after_impact
        .get(setup.start.k)
        .copied()
        .unwrap_or(false);
    if after {
        p[(VEL, VEL)] = UNKNOWN_SPEED_SD * UNKNOWN_SPEED_SD;
        p[(VEL + 1, VEL + 1)] = UNKNOWN_SIDE_SD * UNKNOWN_SIDE_SD;
        p[(VEL + 2, VEL + 2)] = 1.0;
        p[(ATT, ATT)] = 0.1 * 0.1;
        p[(ATT + 1, ATT + 1)] = 0.1 * 0.1;
    }
}
