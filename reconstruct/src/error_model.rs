//! The nine-state error model in navigation axes, block-sparse and exact.
//!
//! Errors are estimate minus truth, `C_hat = (I - [psi x]) C` (model section 1, [S03, 3.1-3.12] with full
//! coupling):
//!
//! ```text
//! dr' = dv        dv' = f_n x psi + C df        psi' = -C dw
//! ```
//!
//! Backward in time the transition over `h > 0` is `exp(-F h)` with positive noise. `F` is nilpotent
//! (`F^3 = 0`), so the exponential and van Loan's integral close; both are checked against the general ones.

#![allow(
    clippy::needless_range_loop,
    reason = "the index is an epoch or a row of several arrays at once"
)]

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::frame::{Body, Nav, Rot, Vec3, skew};
use crate::kalman::Belief;
use crate::mechanize::StepView;

/// Estimated errors: position, velocity, platform angles [S03, 3.1-3.6].
pub const STATES: usize = 9;
/// Position error, m.
pub const POS: usize = 0;
/// Velocity error, m/s.
pub const VEL: usize = 3;
/// Platform angles, rad.
pub const ATT: usize = 6;

/// Considered errors.
pub const CONSIDERED: usize = 19;
/// Accelerometer bias, body axes, m/s^2.
pub const BA: usize = 0;
/// Accelerometer scale, per axis.
pub const SA: usize = 3;
/// Constant unknown horizontal acceleration, m/s^2: Coriolis where the latitude is not known [S03, 3.3.1].
pub const CORIOLIS: usize = 6;
/// Mounting yaw of the IMU in the car, rad: turns specific force and rate alike.
pub const MOUNT_YAW: usize = 8;
/// Gyro bias, body axes, rad/s.
pub const BG: usize = 9;
/// Gyro scale, per axis.
pub const SG: usize = 12;
/// Scale common to both wheels (tyre radius).
pub const WHEEL: usize = 15;
/// Difference of scale, left minus right.
pub const WHEEL_DIFF: usize = 16;
/// Angle between the body's x axis and the path on a flat road (mounting pitch), rad.
pub const MOUNT_PITCH: usize = 17;
/// Delay of the wheel frames, s.
pub const LATENCY: usize = 18;

/// The filter's covariance.
pub type Nine = Belief<STATES, CONSIDERED>;
/// A scalar measurement of it.
pub type NineScalar = crate::kalman::Scalar<STATES, CONSIDERED>;

/// White noise of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Spectral density of the specific force, (m/s^2)^2/Hz.
    pub accel: f64,
    /// Spectral density of the rate, (rad/s)^2/Hz.
    pub rate: f64,
}

/// What the considered errors drive: columns of `B` in `v' = .. + B_v c` and `psi' = .. + B_psi c`. Columns up
/// to and with [`MOUNT_YAW`] drive the velocity, those from it up to [`WHEEL`] the angles.
pub(crate) struct Drive {
    pub(crate) velocity: [Vector3<f64>; MOUNT_YAW + 1],
    pub(crate) angle: [Vector3<f64>; WHEEL - MOUNT_YAW],
}

impl Drive {
    pub(crate) fn new(c: &Rot<Nav, Body>, f_b: &Vec3<Body>, w_b: &Vec3<Body>) -> Self {
        let [x, y, z]: [Vector3<f64>; 3] = [0, 1, 2].map(|i| c.m.column(i).into_owned());
        let (f, w) = (&f_b.v, &w_b.v);
        Self {
            velocity: [
                x,
                y,
                z,
                x * f.x,
                y * f.y,
                z * f.z,
                Vector3::x(),
                Vector3::y(),
                y * f.x - x * f.y,
            ],
            angle: [x * w.y - y * w.x, -x, -y, -z, x * -w.x, y * -w.y, z * -w.z],
        }
    }
}

/// Acceleration error in navigation axes for each considered error up to and with [`MOUNT_YAW`], per unit.
#[must_use]
pub fn velocity_drive(c_nb: &Rot<Nav, Body>, f_b: &Vec3<Body>) -> [Vector3<f64>; MOUNT_YAW + 1] {
    Drive::new(c_nb, f_b, &Vec3::zero()).velocity
}

/// One backward step of the covariance, block by block.
pub fn predict_backward(
    belief: &mut Nine,
    view: &StepView,
    f_b: &Vec3<Body>,
    w_b: &Vec3<Body>,
    h: f64,
    noise: &Noise,
) {
    let drive = Drive::new(&view.c_mid, f_b, w_b);
    predict_xx(&mut belief.p_xx, &view.f_n.v, h, noise);
    add_considered(belief, &drive, &view.f_n.v, h);
}

/// `[f x] m`, column by column: two thirds of the work of a general product.
fn cross_columns(f: &Vector3<f64>, m: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::new(
        f.y * m.m31 - f.z * m.m21,
        f.y * m.m32 - f.z * m.m22,
        f.y * m.m33 - f.z * m.m23,
        f.z * m.m11 - f.x * m.m31,
        f.z * m.m12 - f.x * m.m32,
        f.z * m.m13 - f.x * m.m33,
        f.x * m.m21 - f.y * m.m11,
        f.x * m.m22 - f.y * m.m12,
        f.x * m.m23 - f.y * m.m13,
    )
}

/// `P <- Phi P Phi' + Q` for the estimated block alone. With `A = [f_n x]`, `A M` is [`cross_columns`] and
/// `M A'` its transpose on `M'`.
fn predict_xx(p: &mut SMatrix<f64, STATES, STATES>, f: &Vector3<f64>, h: f64, noise: &Noise) {
    let block = |r: usize, c: usize| -> Matrix3<f64> { p.fixed_view::<3, 3>(r, c).into_owned() };
    let (r, x, y) = (block(POS, POS), block(POS, VEL), block(POS, ATT));
    let (v, z, w) = (block(VEL, VEL), block(VEL, ATT), block(ATT, ATT));
    let h2 = 0.5 * h * h;
    let turned = |m: &Matrix3<f64>| cross_columns(f, m);
    let aw = turned(&w);
    let azt = turned(&z.transpose());
    let z1 = z - aw * h;
    let z1at = turned(&z1.transpose()).transpose();
    let v1 = v - (azt + z1at) * h;
    let y1 = y - z * h + aw * h2;
    let y1at = turned(&y1.transpose()).transpose();
    let u = x - v * h + azt * h2;
    let x1 = u - y1at * h;
    let r1 = r - (x.transpose() + u) * h + (turned(&y.transpose()) + y1at) * h2;
    // Noise: van Loan's integral in closed form [S03, 2.28 and 2.29]; A A' = |f|^2 I - f f'.
    let (sa, sg) = (noise.accel, noise.rate);
    let id = Matrix3::identity();
    let a = skew(f);
    let aa = id * f.norm_squared() - f * f.transpose();
    let h3 = h * h2 / 3.0;
    let h4 = h * h3;
    let r1 = r1 + id * (sa * h3 * 2.0) + aa * (sg * h4 * h * 0.3);
    let x1 = x1 - id * (sa * h2) - aa * (sg * h4 * 0.75);
    let y1 = y1 + a * (sg * h3);
    let v1 = v1 + id * (sa * h) + aa * (sg * h3 * 2.0);
    let z1 = z1 - a * (sg * h2);
    let w1 = w + id * (sg * h);
    p.fixed_view_mut::<3, 3>(POS, POS).copy_from(&r1);
    p.fixed_view_mut::<3, 3>(POS, VEL).copy_from(&x1);
    p.fixed_view_mut::<3, 3>(VEL, POS)
        .copy_from(&x1.transpose());
    p.fixed_view_mut::<3, 3>(POS, ATT).copy_from(&y1);
    p.fixed_view_mut::<3, 3>(ATT, POS)
        .copy_from(&y1.transpose());
    p.fixed_view_mut::<3, 3>(VEL, VEL).copy_from(&v1);
    p.fixed_view_mut::<3, 3>(VEL, ATT).copy_from(&z1);
    p.fixed_view_mut::<3, 3>(ATT, VEL)
        .copy_from(&z1.transpose());
    p.fixed_view_mut::<3, 3>(ATT, ATT).copy_from(&w1);
}

/// Propagates the cross covariance and adds the considered errors' share.
///
/// A drive `b` of the velocity moves the states by `L_v b = (h^2/2, -h, 0) b`, one of the angles by
/// `L_a b = (-h^3/6 A, h^2/2 A, -h) b`; so the share is `S_v L_v' + S_a L_a'` with the sums `S` over all columns
/// of the propagated column (half its own step included) times `b'`.
fn add_considered(belief: &mut Nine, drive: &Drive, f_n: &Vector3<f64>, h: f64) {
    let h2 = 0.5 * h * h;
    let h3 = h * h2 / 3.0;
    let mut by_velocity = [[0.0; STATES]; 3];
    let mut by_angle = [[0.0; STATES]; 3];
    for j in 0..CONSIDERED {
        let mut column = belief.p_xc.column_mut(j);
        let psi: Vector3<f64> = column.fixed_rows::<3>(ATT).into_owned();
        let vel: Vector3<f64> = column.fixed_rows::<3>(VEL).into_owned();
        let turned = f_n.cross(&psi);
        let pos = column.fixed_rows::<3>(POS) - vel * h + turned * h2;
        let vel = vel - turned * h;
        let d = belief.p_cc[j];
        let (mut g_r, mut g_v, mut g_p) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        if j <= MOUNT_YAW {
            let b = &drive.velocity[j];
            g_r = b * h2;
            g_v = b * -h;
        }
        if (MOUNT_YAW..WHEEL).contains(&j) {
            let b = &drive.angle[j - MOUNT_YAW];
            let ab = f_n.cross(b);
            g_r -= ab * h3;
            g_v += ab * h2;
            g_p = b * -h;
        }
        let half = 0.5 * d;
        let m = stack(
            &(pos + g_r * half),
            &(vel + g_v * half),
            &(psi + g_p * half),
        );
        if j <= MOUNT_YAW {
            add_outer(&mut by_velocity, &m, &drive.velocity[j]);
        }
        if (MOUNT_YAW..WHEEL).contains(&j) {
            add_outer(&mut by_angle, &m, &drive.angle[j - MOUNT_YAW]);
        }
        column.copy_from_slice(&stack(&(pos + g_r * d), &(vel + g_v * d), &(psi + g_p * d)));
    }
    let mut sum = [[0.0; STATES]; STATES];
    for r in 0..STATES {
        let v = [0, 1, 2].map(|i| by_velocity[i][r]);
        let a = Vector3::from([0, 1, 2].map(|i| by_angle[i][r]));
        let turned = f_n.cross(&a);
        for i in 0..3 {
            sum[POS + i][r] = v[i] * h2 - turned[i] * h3;
            sum[VEL + i][r] = turned[i] * h2 - v[i] * h;
            sum[ATT + i][r] = a[i] * -h;
        }
    }
    for c in 0..STATES {
        for r in 0..STATES {
            belief.p_xx[(r, c)] += sum[c][r] + sum[r][c];
        }
    }
}

/// `sum += m b'`, 9 x 3, stored by columns.
fn add_outer(sum: &mut [[f64; STATES]; 3], m: &[f64; STATES], b: &Vector3<f64>) {
    for (column, x) in sum.iter_mut().zip(b.iter()) {
        for (entry, y) in column.iter_mut().zip(m) {
            *entry += x * y;
        }
    }
}

fn stack(r: &Vector3<f64>, v: &Vector3<f64>, p: &Vector3<f64>) -> [f64; STATES] {
    [r.x, r.y, r.z, v.x, v.y, v.z, p.x, p.y, p.z]
}

/// `F` (9 x 9) and `B` (9 x 19) of the continuous model, forward in time: the definition the sparse code above
/// is tested against.
#[must_use]
pub fn continuous(
    c_nb: &Rot<Nav, Body>,
    f_b: &Vec3<Body>,
    w_b: &Vec3<Body>,
) -> (
    SMatrix<f64, STATES, STATES>,
    SMatrix<f64, STATES, CONSIDERED>,
) {
    let mut f = SMatrix::<f64, STATES, STATES>::zeros();
    let f_n = c_nb.apply(*f_b);
    f.fixed_view_mut::<3, 3>(POS, VEL)
        .copy_from(&Matrix3::identity());
    f.fixed_view_mut::<3, 3>(VEL, ATT).copy_from(&skew(&f_n.v));
    let drive = Drive::new(c_nb, f_b, w_b);
    let mut b = SMatrix::<f64, STATES, CONSIDERED>::zeros();
    for (j, column) in drive.velocity.iter().enumerate() {
        b.fixed_view_mut::<3, 1>(VEL, j).copy_from(column);
    }
    for (j, column) in drive.angle.iter().enumerate() {
        b.fixed_view_mut::<3, 1>(ATT, MOUNT_YAW + j)
            .copy_from(column);
    }
    (f, b)
}
