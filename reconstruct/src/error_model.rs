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

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

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
struct Drive {
    velocity: [Vector3<f64>; MOUNT_YAW + 1],
    angle: [Vector3<f64>; WHEEL - MOUNT_YAW],
}

impl Drive {
    fn new(c: &Rot<Nav, Body>, f_b: &Vec3<Body>, w_b: &Vec3<Body>) -> Self {
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
    let a = skew(&view.f_n.v);
    let drive = Drive::new(&view.c_mid, f_b, w_b);
    predict_xx(&mut belief.p_xx, &a, h, noise);
    add_considered(belief, &drive, &a, h);
}

/// `P <- Phi P Phi' + Q` for the estimated block alone.
fn predict_xx(p: &mut SMatrix<f64, STATES, STATES>, a: &Matrix3<f64>, h: f64, noise: &Noise) {
    let block = |r: usize, c: usize| -> Matrix3<f64> { p.fixed_view::<3, 3>(r, c).into_owned() };
    let (r, x, y) = (block(POS, POS), block(POS, VEL), block(POS, ATT));
    let (v, z, w) = (block(VEL, VEL), block(VEL, ATT), block(ATT, ATT));
    let h2 = 0.5 * h * h;
    let at = a.transpose();
    let aw = a * w;
    let azt = a * z.transpose();
    let z1 = z - aw * h;
    let v1 = v - (azt + z1 * at) * h;
    let y1 = y - z * h + aw * h2;
    let u = x - v * h + azt * h2;
    let y1at = y1 * at;
    let x1 = u - y1at * h;
    let t = r - x.transpose() * h + a * y.transpose() * h2;
    let r1 = t - u * h + y1at * h2;
    // Noise: van Loan's integral in closed form [S03, 2.28 and 2.29].
    let (sa, sg) = (noise.accel, noise.rate);
    let aa = a * at;
    let id = Matrix3::identity();
    let (h3, h4, h5) = (h * h * h, h.powi(4), h.powi(5));
    let r1 = r1 + id * (sa * h3 / 3.0) + aa * (sg * h5 / 20.0);
    let x1 = x1 - id * (sa * h2) - aa * (sg * h4 / 8.0);
    let y1 = y1 + a * (sg * h3 / 6.0);
    let v1 = v1 + id * (sa * h) + aa * (sg * h3 / 3.0);
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
fn add_considered(belief: &mut Nine, drive: &Drive, a: &Matrix3<f64>, h: f64) {
    let h2 = 0.5 * h * h;
    let mut sum = SMatrix::<f64, STATES, STATES>::zeros();
    for j in 0..CONSIDERED {
        let mut column = belief.p_xc.column_mut(j);
        let psi: Vector3<f64> = column.fixed_rows::<3>(ATT).into_owned();
        let vel: Vector3<f64> = column.fixed_rows::<3>(VEL).into_owned();
        let apsi = a * psi;
        let pos = column.fixed_rows::<3>(POS) - vel * h + apsi * h2;
        let vel = vel - apsi * h;
        let d = belief.p_cc[j];
        if j < MOUNT_YAW {
            let b = drive.velocity[j];
            let (g_r, g_v) = (b * h2, b * -h);
            let (m_r, m_v) = (pos + g_r * (0.5 * d), vel + g_v * (0.5 * d));
            add_outer(&mut sum, POS, &m_r, VEL, &g_v);
            add_outer(&mut sum, POS, &m_r, POS, &g_r);
            add_outer(&mut sum, VEL, &m_v, VEL, &g_v);
            add_outer(&mut sum, VEL, &m_v, POS, &g_r);
            add_outer(&mut sum, ATT, &psi, VEL, &g_v);
            add_outer(&mut sum, ATT, &psi, POS, &g_r);
            column.fixed_rows_mut::<3>(POS).copy_from(&(pos + g_r * d));
            column.fixed_rows_mut::<3>(VEL).copy_from(&(vel + g_v * d));
        } else if j < WHEEL {
            let b = drive.angle[j - MOUNT_YAW];
            let ab = a * b;
            let mut gamma: SVector<f64, STATES> =
                stack(&(ab * (-h * h * h / 6.0)), &(ab * h2), &(b * -h));
            if j == MOUNT_YAW {
                let b = drive.velocity[j];
                gamma += stack(&(b * h2), &(b * -h), &Vector3::zeros());
            }
            let u = stack(&pos, &vel, &psi);
            sum += (u + gamma * (0.5 * d)) * gamma.transpose();
            column.copy_from(&(u + gamma * d));
        } else {
            column.copy_from(&stack(&pos, &vel, &psi));
        }
    }
    belief.p_xx += sum + sum.transpose();
}

fn stack(r: &Vector3<f64>, v: &Vector3<f64>, p: &Vector3<f64>) -> SVector<f64, STATES> {
    SVector::<f64, STATES>::from([r.x, r.y, r.z, v.x, v.y, v.z, p.x, p.y, p.z])
}

fn add_outer(
    sum: &mut SMatrix<f64, STATES, STATES>,
    row: usize,
    left: &Vector3<f64>,
    column: usize,
    right: &Vector3<f64>,
) {
    let mut view = sum.fixed_view_mut::<3, 3>(row, column);
    view += left * right.transpose();
}

/// `F` (9 x 9) and `B` (9 x 16) of the continuous model, forward in time: the definition the sparse code above
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
