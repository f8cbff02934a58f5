//! The nine-state filter as published [S03, 3.1-3.12], with its slips put right, for comparison.
//!
//! States in vehicle axes: `(dx, dvx, theta, dy, dvy, phi, dz, dvz, psi)`. What the source leaves out stays left
//! out: terms in `wz`, `psi' = wy phi - wx theta`, `dvz' = Ax theta - Ay phi`, the turning of the axes, biases and
//! scales as considered errors. Its covariance is therefore too small, most of all through a spin; use
//! the nine-state model for bounds.
//!
//! Departures from the source, each with a test that fails with the source's sign:
//! - `Ax` in row 5 of (3.8), (3.10), (3.11): (3.3) has minus, and minus is right;
//! - `wx` in row 3 of (3.10), (3.11): (3.2) and (3.7) have plus, and plus is right;
//! - `dvy/R` in (3.4), (3.8), (3.10): with (3.3) it grows without bound; plus gives Schuler's oscillation;
//! - noise: the mixed signs of `e` are one and the same, `-dw` on every axis;
//! - row 2 of H (3.12) takes a rate for an angle: the wheels' yaw rate is fused with the gyro's instead.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::epochs::Reversed;
use crate::error_model::{ATT, POS, STATES, VEL};
use crate::filter::{Snapshot, VIBRATION_SPEED};
use crate::frame::{Body, Nav, Rot, Vec3};
use crate::kalman::{Belief, Scalar};
use crate::mechanize::{Earth, Nav9, backward};
use crate::motion::Motion;
use crate::series::{propagate, series};
use crate::start::Start;

/// Radius of the Earth, m.
const EARTH_RADIUS: f64 = 6_371_000.0;

/// Order of S03's states as (block, axis) of ours: position, velocity, angle about x, y, z.
const ORDER: [(usize, usize); STATES] = [
    (POS, 0),
    (VEL, 0),
    (ATT, 1),
    (POS, 1),
    (VEL, 1),
    (ATT, 0),
    (POS, 2),
    (VEL, 2),
    (ATT, 2),
];

/// Signs of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signs {
    /// As derived.
    Corrected,
    /// As printed in [S03, 3.10].
    Source,
}

/// `F` of [S03, 3.10], 9 x 9, for the level acceleration `a` (m/s^2) and rate `w` (rad/s) in vehicle axes.
#[must_use]
pub fn f_matrix(
    a: &Vector3<f64>,
    w: &Vector3<f64>,
    gravity: f64,
    signs: Signs,
) -> SMatrix<f64, STATES, STATES> {
    let s = if signs == Signs::Corrected { 1.0 } else { -1.0 };
    let mut f = SMatrix::<f64, STATES, STATES>::zeros();
    f[(0, 1)] = 1.0;
    f[(1, 2)] = gravity;
    f[(1, 8)] = a.y;
    f[(2, 1)] = -1.0 / EARTH_RADIUS;
    f[(2, 8)] = s * w.x;
    f[(3, 4)] = 1.0;
    f[(4, 5)] = -gravity;
    f[(4, 8)] = -s * a.x;
    f[(5, 4)] = s / EARTH_RADIUS;
    f[(5, 8)] = -w.y;
    f[(6, 7)] = 1.0;
    f
}

/// Runs the published filter backwards.
#[must_use]
pub fn run(
    reversed: &Reversed<'_>,
    start: &Start,
    motion: &Motion,
    earth: &Earth,
) -> Vec<Snapshot> {
    let epochs = reversed.forward();
    let (imu, sheet) = (&epochs.header.imu, &epochs.header.wheels);
    let mut nav = start.nav;
    let mut belief = Belief::<STATES, 1> {
        p_xx: SMatrix::from_fn(|i, j| start.belief.p_xx[(place(i), place(j))]),
        p_xc: SMatrix::zeros(),
        p_cc: SVector::zeros(),
    };
    let mut out = Vec::with_capacity(epochs.list.len());
    for (k, epoch) in reversed.iter() {
        let mut used = false;
        if k <= start.k
            && !motion.wheels_bad[k]
            && let [Some(left), Some(right)] = epoch.wheels
            && left.min(right) > sheet.cutoff_mps
        {
            used = measure_speed(
                &mut nav,
                &mut belief,
                epochs,
                motion,
                k,
                0.5 * (left + right),
            );
        }
        out.push(snapshot(&nav, &belief, used));
        if k > start.k {
            continue;
        }
        let mut w_b = Vec3::<Body>::from(epoch.rate - start.rate_bias);
        if !motion.wheels_bad[k] {
            w_b.v.z = fused_rate(epochs, epoch, w_b.v.z);
        }
        let f_b = Vec3::<Body>::from(epoch.accel - start.accel_bias);
        let (next, view) = backward(&nav, f_b, w_b, epoch.dt, earth);
        let heading = nav.c_nb.euler().2;
        let level = Rot::<Nav, Body>::from_euler(0.0, 0.0, heading);
        let a = level.m.transpose() * view.a_n.v;
        let f = -f_matrix(&a, &w_b.v, earth.gravity, Signs::Corrected);
        let driving = (nav.v_n.v.norm() / VIBRATION_SPEED).min(1.0);
        let accel = imu.accel_density.powi(2)
            + (imu.accel_vibration * driving).powi(2) * 0.01
            + epoch.accel_psd;
        let rate = imu.rate_density.powi(2)
            + (imu.rate_vibration * driving).powi(2) * 0.01
            + epoch.rate_psd;
        let mut density = SMatrix::zeros();
        for (i, (block, _)) in ORDER.iter().enumerate() {
            density[(i, i)] = match *block {
                VEL => accel,
                ATT => rate,
                _ => 0.0,
            };
        }
        let (phi, q) = series(&f, &density, epoch.dt);
        propagate(&mut belief.p_xx, &phi, &q);
        nav = next;
    }
    out.reverse();
    out
}

/// Row 1 of H [S03, 3.12]: the mean of the wheels observes `dvx`.
fn measure_speed(
    nav: &mut Nav9,
    belief: &mut Belief<STATES, 1>,
    epochs: &crate::epochs::Epochs,
    motion: &Motion,
    k: usize,
    speed: f64,
) -> bool {
    let sheet = &epochs.header.wheels;
    let heading = nav.c_nb.euler().2;
    let (s, c) = heading.sin_cos();
    let forward = nav.v_n.v.x * c + nav.v_n.v.y * s;
    let shift = sheet.latency_s + 0.5 * epochs.list[k].dt;
    let mut h_x = SVector::<f64, STATES>::zeros();
    h_x[1] = 1.0;
    let spread = sheet.noise_mps.powi(2) + (sheet.scale_sd * speed).powi(2) + 0.05_f64.powi(2);
    let z = Scalar {
        residual: forward - motion.smooth[k].x * shift - speed,
        h_x,
        h_c: SVector::zeros(),
        r: spread * 10.0,
    };
    let Some(x) = belief.update(&z, 10.83) else {
        return false;
    };
    let ours = to_nav(&x, heading);
    *nav = crate::filter::corrected(nav, &ours);
    true
}

/// Row 2 of H [S03, 3.12] put right: the wheels' yaw rate [S03, 2.17] against the gyro's, rate against rate,
/// weighted by their variances before the angle is integrated.
fn fused_rate(epochs: &crate::epochs::Epochs, epoch: &crate::epochs::Epoch, gyro: f64) -> f64 {
    let (imu, sheet) = (&epochs.header.imu, &epochs.header.wheels);
    let track = epochs.header.vehicle.track_width_m;
    let [Some(left), Some(right)] = epoch.wheels else {
        return gyro;
    };
    if left.min(right) <= sheet.cutoff_mps {
        return gyro;
    }
    let white = 2.0 * (sheet.noise_mps.powi(2) + epochs.header.wheel_scale.step.powi(2) / 12.0);
    let scale = (sheet.scale_difference_sd * 0.5 * (left + right)).powi(2);
    let wheels = (white + scale) / (track * track);
    let own = imu.rate_density.powi(2) / epoch.dt + imu.rate_vibration.powi(2);
    (gyro * wheels + (left - right) / track * own) / (wheels + own).max(f64::MIN_POSITIVE)
}

/// Place of S03's state `i` in our order.
fn place(i: usize) -> usize {
    let (block, axis) = ORDER[i];
    block + axis
}

/// S03's errors in vehicle axes as ours in navigation axes.
fn to_nav(x: &SVector<f64, STATES>, heading: f64) -> SVector<f64, STATES> {
    rotation(heading) * x
}

/// 9 x 9: reorders S03's states and turns their axes by the heading.
fn rotation(heading: f64) -> SMatrix<f64, STATES, STATES> {
    let c = Rot::<Nav, Body>::from_euler(0.0, 0.0, heading).m;
    let mut m = SMatrix::<f64, STATES, STATES>::zeros();
    for (i, (block, axis)) in ORDER.iter().enumerate() {
        for row in 0..3 {
            m[(block + row, i)] = c[(row, *axis)];
        }
    }
    m
}

/// The covariance of S03's states in navigation axes and in our order: block by block `C P C'`.
fn turned_covariance(
    p: &SMatrix<f64, STATES, STATES>,
    heading: f64,
) -> SMatrix<f64, STATES, STATES> {
    let c = Rot::<Nav, Body>::from_euler(0.0, 0.0, heading).m;
    let mut ours = SMatrix::<f64, STATES, STATES>::zeros();
    for i in 0..STATES {
        for j in 0..STATES {
            ours[(place(i), place(j))] = p[(i, j)];
        }
    }
    for block in [POS, VEL, ATT] {
        for other in [POS, VEL, ATT].into_iter().filter(|other| *other >= block) {
            let turned = c * ours.fixed_view::<3, 3>(block, other) * c.transpose();
            ours.fixed_view_mut::<3, 3>(other, block)
                .copy_from(&turned.transpose());
            ours.fixed_view_mut::<3, 3>(block, other).copy_from(&turned);
        }
    }
    ours
}

fn snapshot(nav: &Nav9, belief: &Belief<STATES, 1>, used: bool) -> Snapshot {
    Snapshot {
        nav: *nav,
        p: turned_covariance(&belief.p_xx, nav.c_nb.euler().2),
        sd_accel: [f64::NAN; 2],
        accel_noise: [f64::NAN; 2],
        wheels_used: used,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::exp_so3;
    use crate::matrix::van_loan;
    use crate::mechanize::forward;
    use nalgebra::DMatrix;

    /// `F` by finite differences of the mechanisation, in the vehicle axes of the instant, on a level car.
    fn found(a: &Vector3<f64>, w: &Vector3<f64>, row: usize, column: usize) -> f64 {
        let earth = Earth {
            gravity: 9.81,
            ..Earth::flat()
        };
        let f = Vec3::<Body>::new(a.x, a.y, a.z - 9.81);
        let truth = Nav9 {
            r_n: Vec3::zero(),
            v_n: Vec3::zero(),
            c_nb: Rot::<Nav, Body>::identity(),
        };
        let mut x = SVector::<f64, STATES>::zeros();
        x[place(column)] = 1e-5;
        let psi = Vector3::new(x[ATT], x[ATT + 1], x[ATT + 2]);
        let hat = Nav9 {
            r_n: Vec3::new(x[0], x[1], x[2]),
            v_n: Vec3::new(x[3], x[4], x[5]),
            c_nb: Rot::from_matrix(exp_so3(&-psi)),
        };
        let dt = 1e-4;
        let w = Vec3::<Body>::from(*w);
        let after = (
            forward(&truth, f, w, dt, &earth).0,
            forward(&hat, f, w, dt, &earth).0,
        );
        let c = after.0.c_nb.m.transpose();
        let dv = c * (after.1.v_n - after.0.v_n).v;
        let error = after.1.c_nb.m * after.0.c_nb.m.transpose();
        // C_hat C' = I - [psi x], turned into the vehicle's axes after the step.
        let psi =
            c * Vector3::new(
                error[(1, 2)] - error[(2, 1)],
                error[(2, 0)] - error[(0, 2)],
                error[(0, 1)] - error[(1, 0)],
            ) * 0.5;
        let (block, axis) = ORDER[row];
        let now = if block == VEL { dv[axis] } else { psi[axis] };
        (now - x[place(row)]) / dt / 1e-5
    }

    #[test]
    fn signs_meet_finite_differences_where_the_source_slips() {
        let (a, w) = (Vector3::new(3.0, 2.0, 0.0), Vector3::new(0.3, 0.2, 0.0));
        let (ours, source) = (
            f_matrix(&a, &w, 9.81, Signs::Corrected),
            f_matrix(&a, &w, 9.81, Signs::Source),
        );
        // g, Ay, Ax, wx, wy: (row, column) in S03's order.
        for (row, column, slips) in [
            (1, 2, false),
            (1, 8, false),
            (4, 5, false),
            (4, 8, true),
            (2, 8, true),
            (5, 8, false),
        ] {
            let derived = found(&a, &w, row, column);
            assert!(
                (derived - ours[(row, column)]).abs() < 1e-2,
                "({row},{column}): {derived} {}",
                ours[(row, column)]
            );
            assert_eq!(
                (derived - source[(row, column)]).abs() > 0.1,
                slips,
                "({row},{column})"
            );
        }
    }

    #[test]
    fn schuler_oscillates_with_our_sign_and_grows_with_the_source_s() {
        let still = Vector3::zeros();
        for (signs, bounded) in [(Signs::Corrected, true), (Signs::Source, false)] {
            let f = f_matrix(&still, &still, 9.81, signs);
            let f = DMatrix::from_fn(STATES, STATES, |i, j| f[(i, j)]);
            // An hour and a half: one Schuler period. A lateral speed error of 1 m/s.
            let (phi, _) = van_loan(&f, &DMatrix::zeros(STATES, STATES), 5400.0).unwrap();
            assert_eq!(
                phi[(4, 4)].abs() < 1.5,
                bounded,
                "{signs:?}: {}",
                phi[(4, 4)]
            );
            assert!(phi[(1, 1)].abs() < 1.5);
        }
    }

    #[test]
    fn turned_covariance_meets_the_dense_product() {
        let p = SMatrix::<f64, STATES, STATES>::from_fn(|i, j| {
            schema::num::real(i + j).sin() + if i == j { 20.0 } else { 0.0 }
        });
        let turn = rotation(0.7);
        let want = turn * p * turn.transpose();
        assert!((turned_covariance(&p, 0.7) - want).norm() < 1e-12);
    }

    /// The figures of [S03, 1.2.1 and 3.3.1], with g put in.
    #[test]
    fn bias_figures_of_the_source_are_put_right() {
        let path = |a: f64, t: f64| 0.5 * a * t * t;
        assert!((path(9.806_65e-3, 1800.0) - 15_887.0).abs() < 1.0);
        assert!((path(9.806_65e-3, 3600.0) - 63_547.0).abs() < 1.0);
        assert!((path(0.0095, 40.0) - 7.6).abs() < 0.01);
    }
}
