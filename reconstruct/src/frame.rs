//! Frames as types: a vector carries the frame it is written in, a rotation the two it joins.
//!
//! `let f_n = c_nb.apply(f_b);` compiles, `c_nb.apply(f_n)` does not: adjacent letters must cancel.
//!
//! ```compile_fail
//! use reconstruct::frame::{Body, Nav, Rot, Vec3};
//! let c_nb: Rot<Nav, Body> = Rot::identity();
//! let g_n: Vec3<Nav> = Vec3::new(0.0, 0.0, 9.81);
//! let wrong = c_nb.apply(g_n); // a navigation vector where a body vector is needed
//! ```

use std::marker::PhantomData;
use std::ops::{Add, Neg, Sub};

use nalgebra::{Matrix3, Vector3};

/// Body frame: x forward, y right, z down [S03, 2.1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body;

/// Local north-east-down frame, origin at the final rest position [S03, 2.1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nav;

/// A 3-vector written in frame `F`.
#[derive(Debug, PartialEq)]
pub struct Vec3<F> {
    /// Components along the axes of `F`.
    pub v: Vector3<f64>,
    frame: PhantomData<F>,
}

// By hand: a derive would ask for `F: Copy`, and the frame is only a name.
impl<F> Clone for Vec3<F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for Vec3<F> {}

impl<F> Vec3<F> {
    /// From components.
    #[must_use]
    pub fn new(x: f64, y: f64, z: f64) -> Self {
        Self::from(Vector3::new(x, y, z))
    }

    /// The zero vector.
    #[must_use]
    pub fn zero() -> Self {
        Self::from(Vector3::zeros())
    }

    /// This vector times a number.
    #[must_use]
    pub fn scale(self, k: f64) -> Self {
        Self::from(self.v * k)
    }

    /// Cross product within one frame.
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        Self::from(self.v.cross(&other.v))
    }
}

impl<F> From<Vector3<f64>> for Vec3<F> {
    fn from(v: Vector3<f64>) -> Self {
        Self {
            v,
            frame: PhantomData,
        }
    }
}

impl<F> Add for Vec3<F> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::from(self.v + other.v)
    }
}

impl<F> Sub for Vec3<F> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::from(self.v - other.v)
    }
}

impl<F> Neg for Vec3<F> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::from(-self.v)
    }
}

/// The rotation that takes a vector written in `From` to the same vector written in `To`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rot<To, From> {
    /// Direction cosines, 3 x 3, orthonormal.
    pub m: Matrix3<f64>,
    frames: PhantomData<(To, From)>,
}

impl<To, Source> Rot<To, Source> {
    /// From a matrix of direction cosines; the caller vouches for its orthonormality.
    #[must_use]
    pub fn from_matrix(m: Matrix3<f64>) -> Self {
        Self {
            m,
            frames: PhantomData,
        }
    }

    /// The identity: both frames' axes coincide.
    #[must_use]
    pub fn identity() -> Self {
        Self::from_matrix(Matrix3::identity())
    }

    /// The vector in the target frame.
    #[must_use]
    pub fn apply(&self, v: Vec3<Source>) -> Vec3<To> {
        Vec3::from(self.m * v.v)
    }

    /// The inverse rotation.
    #[must_use]
    pub fn inverse(&self) -> Rot<Source, To> {
        Rot::from_matrix(self.m.transpose())
    }
}

impl Rot<Nav, Body> {
    /// From roll, pitch and yaw in radians: `Rz(yaw) Ry(pitch) Rx(roll)` [S03, 2.4 and 2.5].
    #[must_use]
    pub fn from_euler(roll: f64, pitch: f64, yaw: f64) -> Self {
        let (sr, cr) = roll.sin_cos();
        let (sp, cp) = pitch.sin_cos();
        let (sy, cy) = yaw.sin_cos();
        Self::from_matrix(Matrix3::new(
            cy * cp,
            -sy * cr + cy * sp * sr,
            sy * sr + cy * cr * sp,
            sy * cp,
            cy * cr + sr * sp * sy,
            -cy * sr + sp * sy * cr,
            -sp,
            cp * sr,
            cp * cr,
        ))
    }

    /// Roll, pitch and yaw in radians; at a pitch of +-90 degrees roll is taken as zero.
    #[must_use]
    pub fn euler(&self) -> (f64, f64, f64) {
        let m = &self.m;
        let pitch = (-m[(2, 0)]).clamp(-1.0, 1.0).asin();
        if pitch.cos() < 1e-9 {
            return (0.0, pitch, (-m[(0, 1)]).atan2(m[(1, 1)]));
        }
        (
            m[(2, 1)].atan2(m[(2, 2)]),
            pitch,
            m[(1, 0)].atan2(m[(0, 0)]),
        )
    }

    /// This attitude after the body turned by the rotation vector `angle` (radians, body axes).
    #[must_use]
    pub fn turned(&self, angle: Vec3<Body>) -> Self {
        Self::from_matrix(self.m * exp_so3(&angle.v))
    }

    /// This attitude corrected by the platform angle `psi` (radians, navigation axes):
    /// with `C_hat = (I - [psi x]) C` the better attitude is `Exp(psi) C_hat`.
    #[must_use]
    pub fn corrected(&self, psi: Vec3<Nav>) -> Self {
        Self::from_matrix(exp_so3(&psi.v) * self.m)
    }

    /// Derivatives of (roll, pitch, heading) *errors* (estimate minus truth) with respect to the platform
    /// angle `psi`, 3 x 3. From `C_hat = Exp(-psi) C` and [S03, 2.4].
    #[must_use]
    pub fn euler_jacobian(&self) -> Matrix3<f64> {
        let (_, pitch, yaw) = self.euler();
        let (sy, cy) = yaw.sin_cos();
        let (sp, cp) = pitch.sin_cos();
        // Rolls by rotation about the horizontal heading axis; a vertical car has no roll to speak of.
        let cp = if cp.abs() < 1e-6 { 1e-6 } else { cp };
        let roll = [-cy / cp, -sy / cp, 0.0];
        Matrix3::new(
            roll[0],
            roll[1],
            roll[2],
            sy,
            -cy,
            0.0,
            sp * roll[0],
            sp * roll[1],
            -1.0,
        )
    }
}

/// An angle between -pi and pi, rad.
#[must_use]
pub fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

/// The cross-product matrix `[v x]`.
#[must_use]
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// The exponential of `[v x]`: Rodrigues' formula, by its series where the angle is small.
///
/// The series keeps terms to the 8th power: its error is below 1e-17 up to 0.05 rad, which one sample
/// exceeds only above 280 deg/s.
#[must_use]
pub fn exp_so3(v: &Vector3<f64>) -> Matrix3<f64> {
    let t2 = v.norm_squared();
    let (a, b) = if t2 < 2.5e-3 {
        (
            1.0 - t2 / 6.0 * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0)),
            0.5 - t2 / 24.0 * (1.0 - t2 / 30.0 * (1.0 - t2 / 56.0)),
        )
    } else {
        let t = t2.sqrt();
        (t.sin() / t, (1.0 - t.cos()) / t2)
    };
    // I + a [v x] + b [v x]^2, with [v x]^2 = v v' - |v|^2 I.
    let d = 1.0 - b * t2;
    Matrix3::new(
        d + b * v.x * v.x,
        b * v.x * v.y - a * v.z,
        b * v.x * v.z + a * v.y,
        b * v.x * v.y + a * v.z,
        d + b * v.y * v.y,
        b * v.y * v.z - a * v.x,
        b * v.x * v.z - a * v.y,
        b * v.y * v.z + a * v.x,
        d + b * v.z * v.z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_is_orthonormal_and_continuous_across_the_series_limit() {
        for angle in [0.0, 1e-9, 0.01, 0.0499, 0.0501, 1.0, 3.0] {
            let m = exp_so3(&Vector3::new(0.6 * angle, -0.48 * angle, 0.64 * angle));
            assert!(
                (m * m.transpose() - Matrix3::identity()).norm() < 1e-14,
                "{angle}"
            );
        }
    }

    #[test]
    fn euler_angles_come_back_also_upside_down() {
        for (roll, pitch, yaw) in [(0.1, -0.2, 2.0), (3.0, 0.4, -2.5), (-1.6, 1.2, 0.0)] {
            let back = Rot::from_euler(roll, pitch, yaw).euler();
            assert!((back.0 - roll).abs() < 1e-12);
            assert!((back.1 - pitch).abs() < 1e-12);
            assert!((back.2 - yaw).abs() < 1e-12);
        }
    }

    #[test]
    fn euler_jacobian_meets_finite_differences() {
        let c = Rot::<Nav, Body>::from_euler(0.2, -0.3, 1.1);
        let jacobian = c.euler_jacobian();
        for axis in 0..3 {
            let mut psi = Vector3::zeros();
            psi[axis] = 1e-6;
            // The estimate is Exp(-psi) C; its Euler angles minus the truth's are the errors.
            let hat = Rot::<Nav, Body>::from_matrix(exp_so3(&(-psi)) * c.m).euler();
            let truth = c.euler();
            let found = Vector3::new(hat.0 - truth.0, hat.1 - truth.1, hat.2 - truth.2) / 1e-6;
            assert!(
                (found - jacobian.column(axis)).norm() < 1e-5,
                "axis {axis}: {found}"
            );
        }
    }
}
