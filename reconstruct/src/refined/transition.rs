//! One backward step of all states, by its few entries, and its transpose.
//!
//! Over `h > 0` the transition is `exp(-F h)` with `r' = v`, `v' = f_n x psi + B_v c`, `psi' = B_psi c`; `F` is nilpotent,
//! so the exponential ends after three terms. Both products are tested against the general exponential.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::states::{BA, BG, Cov, DIM, MOUNT_PITCH, MOUNT_YAW, PLACE, Row, SLIP, WHEEL_LEFT};
use crate::error_model::{ATT, Drive, POS, STATES, VEL};
use crate::frame::{Body, Nav, Rot, Vec3, skew};
use crate::mechanize::StepView;

/// States that drive the velocity: biases, scales, Coriolis, mounting.
const BY_VELOCITY: usize = MOUNT_PITCH + 1 - BA;
/// States that drive the angles: mounting, gyro biases and scales.
const BY_ANGLE: usize = WHEEL_LEFT - MOUNT_YAW;

/// Errors that fixes share.
pub const SHARED: usize = 3;

/// Transition of one backward step and its noise.
#[derive(Clone, Copy, Debug)]
pub struct Transition {
    /// Length, s; 0 while the car stands.
    h: f64,
    f_n: Vector3<f64>,
    velocity: [Vector3<f64>; BY_VELOCITY],
    angle: [Vector3<f64>; BY_ANGLE],
    /// Factor of the sideslip process.
    decay: f64,
    /// Factor of the errors that fixes share, [`PLACE`] and the two after it: 1 where they stay as they are.
    shared: f64,
    /// Noise of position, velocity and angles.
    pub q: SMatrix<f64, STATES, STATES>,
    /// Variance added to the sideslip.
    pub q_slip: f64,
    /// Variance added to each accelerometer and each gyro bias: an impact lies in this step.
    pub jump: [f64; 2],
}

/// Change of the acceleration in navigation axes with each calibration state from [`BA`] to the mounting, per unit.
#[must_use]
pub fn velocity_drive(c_nb: &Rot<Nav, Body>, f_b: &Vec3<Body>) -> [Vector3<f64>; BY_VELOCITY] {
    drives(c_nb, f_b, &Vec3::zero()).0
}

fn drives(
    c_nb: &Rot<Nav, Body>,
    f_b: &Vec3<Body>,
    w_b: &Vec3<Body>,
) -> ([Vector3<f64>; BY_VELOCITY], [Vector3<f64>; BY_ANGLE]) {
    let drive = Drive::new(c_nb, f_b, w_b);
    // A pitched sensor shows `f + angle (y x f)`, and the same of the rate.
    let pitched = |v: &Vector3<f64>| c_nb.m * Vector3::new(v.z, 0.0, -v.x);
    let at = MOUNT_PITCH - BA;
    let mut velocity = [Vector3::zeros(); BY_VELOCITY];
    velocity[..at].copy_from_slice(&drive.velocity);
    velocity[at] = pitched(&f_b.v);
    let mut angle = [Vector3::zeros(); BY_ANGLE];
    angle[0] = drive.angle[0];
    angle[1] = -pitched(&w_b.v);
    angle[2..].copy_from_slice(&drive.angle[1..]);
    (velocity, angle)
}

/// Spectral densities of one step, sensor axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Density {
    /// Specific force, per axis, (m/s^2)^2/Hz.
    pub accel: Vector3<f64>,
    /// Rate, per axis, (rad/s)^2/Hz.
    pub rate: Vector3<f64>,
}

impl Transition {
    /// A step of a moving car. `density` is along the axes of the sensor, `mounting` turns them into the car's: what a
    /// sensor at its limit hides lies along its own axis, and two degrees of 6 m/s are 0.2 m/s across.
    #[must_use]
    pub fn moving(
        view: &StepView,
        f_b: &Vec3<Body>,
        w_b: &Vec3<Body>,
        h: f64,
        density: &Density,
        mounting: &Matrix3<f64>,
    ) -> Self {
        let (velocity, angle) = drives(&view.c_mid, f_b, w_b);
        let c = &(view.c_mid.m * mounting);
        let spread = |d: &Vector3<f64>| c * Matrix3::from_diagonal(d) * c.transpose();
        let (sa, sg) = (spread(&density.accel), spread(&density.rate));
        Self {
            h,
            f_n: view.f_n.v,
            velocity,
            angle,
            decay: 1.0,
            shared: 1.0,
            q: noise(&view.f_n.v, &sa, &sg, h),
            q_slip: 0.0,
            jump: [0.0; 2],
        }
    }

    /// The same forwards in time. `F` is nilpotent, so the step is that with the opposite sign of `h`, and so is van Loan's
    /// integral, less its own sign.
    #[must_use]
    pub fn ahead(
        view: &StepView,
        f_b: &Vec3<Body>,
        w_b: &Vec3<Body>,
        h: f64,
        density: &Density,
        mounting: &Matrix3<f64>,
    ) -> Self {
        let step = Self::moving(view, f_b, w_b, -h, density, mounting);
        Self { q: -step.q, ..step }
    }

    /// A step in which nothing moves: every state stays, the angles are unsure by `angle_sd` (the springs).
    #[must_use]
    pub fn standing(angle_sd: f64) -> Self {
        let mut q = SMatrix::zeros();
        for i in ATT..ATT + 3 {
            q[(i, i)] = angle_sd * angle_sd;
        }
        Self {
            h: 0.0,
            f_n: Vector3::zeros(),
            velocity: [Vector3::zeros(); BY_VELOCITY],
            angle: [Vector3::zeros(); BY_ANGLE],
            decay: 1.0,
            shared: 1.0,
            q,
            q_slip: 0.0,
            jump: [0.0; 2],
        }
    }

    /// Lets the sideslip process of the given spread and correlation time run for `dt` seconds; its reversed law is
    /// the same.
    #[must_use]
    pub fn with_slip(mut self, sd: f64, time_s: f64, dt: f64) -> Self {
        self.decay = (-dt / time_s).exp();
        self.q_slip = sd * sd * (1.0 - self.decay * self.decay);
        self
    }

    /// Lets the three errors that fixes share, of unit variance, run for `dt` seconds with their correlation time.
    #[must_use]
    pub fn with_shared(mut self, time_s: f64, dt: f64) -> Self {
        self.shared = (-dt / time_s).exp();
        self
    }

    /// Puts an impact into the step: variances added to the accelerometer and the gyro biases.
    #[must_use]
    pub fn with_jump(mut self, jump: [f64; 2]) -> Self {
        self.jump = jump;
        self
    }

    /// True if the car stands in this step.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.h == 0.0
    }

    /// The same step of a moving car about another trajectory; noise and process stay.
    #[must_use]
    pub fn about(&self, view: &StepView, f_b: &Vec3<Body>, w_b: &Vec3<Body>) -> Self {
        let (velocity, angle) = drives(&view.c_mid, f_b, w_b);
        Self {
            f_n: view.f_n.v,
            velocity,
            angle,
            ..*self
        }
    }

    /// Factor of the sideslip process.
    #[must_use]
    pub fn decay(&self) -> f64 {
        self.decay
    }

    /// Factor of the errors that fixes share.
    #[must_use]
    pub fn shared(&self) -> f64 {
        self.shared
    }

    /// The way back: `Phi^-1` without noise. `F` is nilpotent, so it is the same step with the opposite sign.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self {
            h: -self.h,
            decay: 1.0 / self.decay,
            shared: 1.0 / self.shared,
            q: SMatrix::zeros(),
            q_slip: 0.0,
            jump: [0.0; 2],
            ..*self
        }
    }

    /// `Phi x`.
    #[must_use]
    pub fn apply(&self, x: &Row) -> Row {
        let mut out = *x;
        self.forward(out.as_mut_slice());
        out
    }

    /// `Phi' x`.
    #[must_use]
    pub fn apply_transposed(&self, x: &Row) -> Row {
        let mut out = *x;
        self.adjoint(out.as_mut_slice());
        out
    }

    /// `Phi P Phi' + Q`. Constants stay, so the second product changes the rows of the nine only, and of those the nine.
    pub fn predict(&self, p: &mut Cov) {
        for column in p.as_mut_slice().chunks_exact_mut(DIM) {
            self.forward(column);
        }
        for x in p.column_mut(SLIP).iter_mut() {
            *x *= self.decay;
        }
        let kept = self.shared * self.shared;
        if kept < 1.0 {
            p.fixed_columns_mut::<SHARED>(PLACE).scale_mut(self.shared);
            for i in PLACE..PLACE + SHARED {
                p[(i, i)] += 1.0 - kept;
            }
        }
        for r in 0..STATES {
            let mut row = [0.0; DIM];
            for (x, c) in row.iter_mut().zip(0..DIM) {
                *x = p[(r, c)];
            }
            for (c, x) in row.iter().enumerate().skip(STATES) {
                p[(c, r)] = *x;
            }
            self.forward(&mut row);
            for (c, x) in row[..STATES].iter().enumerate() {
                p[(r, c)] = x + self.q[(r, c)];
            }
        }
        p[(SLIP, SLIP)] += self.q_slip;
        for axis in 0..3 {
            p[(BA + axis, BA + axis)] += self.jump[0];
            p[(BG + axis, BG + axis)] += self.jump[1];
        }
    }

    /// `Phi' L Phi`.
    pub fn retract(&self, l: &mut Cov) {
        self.congruence(l, Self::adjoint);
    }

    /// `M S M'` of a symmetric `S`, `M` given by its action on a column.
    fn congruence(&self, s: &mut Cov, act: impl Fn(&Self, &mut [f64])) {
        for column in s.as_mut_slice().chunks_exact_mut(DIM) {
            act(self, column);
        }
        s.transpose_mut();
        for column in s.as_mut_slice().chunks_exact_mut(DIM) {
            act(self, column);
        }
    }

    fn forward(&self, x: &mut [f64]) {
        let h = self.h;
        let (r, v, p) = nine(x);
        let mut by_v = self.f_n.cross(&p);
        for (b, c) in self.velocity.iter().zip(&x[BA..]) {
            by_v += b * *c;
        }
        let mut by_p = Vector3::zeros();
        for (b, c) in self.angle.iter().zip(&x[MOUNT_YAW..]) {
            by_p += b * *c;
        }
        let turned = self.f_n.cross(&by_p);
        let h2 = 0.5 * h * h;
        let r = r - v * h + by_v * h2 - turned * (h * h2 / 3.0);
        let v = v - by_v * h + turned * h2;
        let p = p - by_p * h;
        put(x, &r, &v, &p);
        x[SLIP] *= self.decay;
        for x in &mut x[PLACE..PLACE + SHARED] {
            *x *= self.shared;
        }
    }

    fn adjoint(&self, x: &mut [f64]) {
        let h = self.h;
        let (r, v, p) = nine(x);
        let h2 = 0.5 * h * h;
        // [f x]' y = y x f.
        let by_v = v * -h + r * h2;
        let by_p = p * -h + (v * h2 - r * (h * h2 / 3.0)).cross(&self.f_n);
        for (b, c) in self.velocity.iter().zip(&mut x[BA..]) {
            *c += b.dot(&by_v);
        }
        for (b, c) in self.angle.iter().zip(&mut x[MOUNT_YAW..]) {
            *c += b.dot(&by_p);
        }
        let p = p + by_v.cross(&self.f_n);
        let v = v - r * h;
        put(x, &r, &v, &p);
        x[SLIP] *= self.decay;
        for x in &mut x[PLACE..PLACE + SHARED] {
            *x *= self.shared;
        }
    }
}

/// Position, velocity and angles of a column.
fn nine(x: &[f64]) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
    (
        Vector3::new(x[POS], x[POS + 1], x[POS + 2]),
        Vector3::new(x[VEL], x[VEL + 1], x[VEL + 2]),
        Vector3::new(x[ATT], x[ATT + 1], x[ATT + 2]),
    )
}

fn put(x: &mut [f64], r: &Vector3<f64>, v: &Vector3<f64>, p: &Vector3<f64>) {
    x[POS..POS + 3].copy_from_slice(r.as_slice());
    x[VEL..VEL + 3].copy_from_slice(v.as_slice());
    x[ATT..ATT + 3].copy_from_slice(p.as_slice());
}

/// Van Loan's integral [S03, 2.28 and 2.29] in closed form, densities in navigation axes.
fn noise(
    f_n: &Vector3<f64>,
    sa: &Matrix3<f64>,
    sg: &Matrix3<f64>,
    h: f64,
) -> SMatrix<f64, STATES, STATES> {
    let a = skew(f_n);
    let ag = a * sg;
    let aga = ag * a.transpose();
    let mut q = SMatrix::<f64, STATES, STATES>::zeros();
    let h2 = h * h;
    let mut set = |r: usize, c: usize, m: Matrix3<f64>| {
        q.fixed_view_mut::<3, 3>(r, c).copy_from(&m);
        if r != c {
            q.fixed_view_mut::<3, 3>(c, r).copy_from(&m.transpose());
        }
    };
    set(POS, POS, sa * (h2 * h / 3.0) + aga * (h2 * h2 * h / 20.0));
    set(POS, VEL, sa * (-h2 / 2.0) - aga * (h2 * h2 / 8.0));
    set(POS, ATT, ag * (h2 * h / 6.0));
    set(VEL, VEL, sa * h + aga * (h2 * h / 3.0));
    set(VEL, ATT, ag * (-h2 / 2.0));
    set(ATT, ATT, sg * h);
    q
}

#[cfg(test)]
mod tests;
