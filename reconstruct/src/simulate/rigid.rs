//! From the motion to what an IMU at its place feels, step by step, without any error.
//!
//! Within a step of 0.5 ms the body turns at a constant rate and feels a constant specific force in the axes
//! of the middle of the step. The truth's velocity at the grid points is exact for that motion, so
//! integrating the steps gives the truth back.

use nalgebra::{Matrix3, Vector3};

use super::motion::{Motion, Node, STEP};

/// What the IMU feels over one step, body axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Felt {
    /// Mean specific force, m/s^2.
    pub(super) force: Vector3<f64>,
    /// Mean rate, rad/s.
    pub(super) rate: Vector3<f64>,
}

/// The IMU's motion: states at the grid points, and what is felt between them.
#[derive(Clone, Debug)]
pub(super) struct Rigid {
    /// Velocity of the IMU at each node, m/s, level axes with any heading.
    pub(super) velocity: Vec<Vector3<f64>>,
    /// Rate of the body at each node, rad/s, body axes.
    pub(super) rate: Vec<Vector3<f64>>,
    /// One fewer than nodes; step `k` lies between node `k` and `k + 1`.
    pub(super) felt: Vec<Felt>,
}

/// `C_nb = Rz(yaw) Ry(pitch) Rx(roll)` [S03, 2.5]: takes body axes into north-east-down.
pub(super) fn rotation([roll, pitch, yaw]: [f64; 3]) -> Matrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
}

/// Rate about body axes from the rates of roll, pitch and yaw.
fn body_rate([roll, pitch, _]: [f64; 3], d: [f64; 3]) -> Vector3<f64> {
    let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
    Vector3::new(
        d[0] - d[2] * sp,
        d[1] * cr + d[2] * sr * cp,
        -d[1] * sr + d[2] * cr * cp,
    )
}

/// Turn vector of a rotation matrix near identity (angle below 0.1 rad).
fn turn(r: &Matrix3<f64>) -> Vector3<f64> {
    let v = Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12) / 2.0;
    let square = v.norm_squared();
    v * (1.0 + square / 6.0 + 3.0 * square * square / 40.0)
}

/// Rotation by a small turn vector, to fourth order.
fn small_rotation(v: &Vector3<f64>) -> Matrix3<f64> {
    let x = v.cross_matrix();
    let square = v.norm_squared();
    Matrix3::identity() + x * (1.0 - square / 6.0) + x * x * (0.5 - square / 24.0)
}

/// The motion at `lever` (from the reference point, body axes, m).
pub(super) fn at(motion: &Motion, lever: Vector3<f64>, gravity: f64) -> Rigid {
    let nodes = &motion.nodes;
    let g = Vector3::new(0.0, 0.0, gravity);
    let mut velocity = Vec::with_capacity(nodes.len());
    let mut rate = Vec::with_capacity(nodes.len());
    let mut felt = Vec::with_capacity(nodes.len());
    let mut last: Option<Matrix3<f64>> = None;
    for (k, node) in nodes.iter().enumerate() {
        let c_nb = rotation(node.angles);
        let w = body_rate(node.angles, slope(nodes, k));
        let v = node.velocity + c_nb * w.cross(&lever);
        if let (Some(c_before), Some(v_before)) = (last, velocity.last()) {
            let turned = turn(&(c_before.transpose() * c_nb));
            let middle = c_before * small_rotation(&(turned / 2.0));
            let dv: Vector3<f64> = v - v_before;
            felt.push(Felt {
                force: middle.transpose() * (dv / STEP - g),
                rate: turned / STEP,
            });
        }
        velocity.push(v);
        rate.push(w);
        last = Some(c_nb);
    }
    Rigid {
        velocity,
        rate,
        felt,
    }
}

/// Rates of roll, pitch and yaw at node `k`, central differences.
fn slope(nodes: &[Node], k: usize) -> [f64; 3] {
    let (low, high) = (k.saturating_sub(1), (k + 1).min(nodes.len() - 1));
    let (Some(a), Some(b)) = (nodes.get(low), nodes.get(high)) else {
        return [0.0; 3];
    };
    let time = schema::num::real(high - low).max(1.0) * STEP;
    [0, 1, 2].map(|i| (b.angles[i] - a.angles[i]) / time)
}
