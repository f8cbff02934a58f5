//! From the sensor's axes to the body's, once, at this edge.
//!
//! `front-left-up` (ISO 8855) becomes front-right-down by the signs (+, -, -). Then `mounting_deg = [roll, pitch,
//! yaw]` is the attitude of the IMU's front-right-down case in the vehicle: the case is brought from the
//! vehicle's axes to its own by yaw about z (down, positive to the right), then pitch about the new y (positive
//! nose up), then roll about the new x (positive right side down), and `C = Rz(yaw) Ry(pitch) Rx(roll)` takes
//! a vector's components along the IMU's axes to those along the vehicle's: `f_vehicle = C f_imu`.

/// The linear map from sensor axes to body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    matrix: [[f64; 3]; 3],
    /// No rotation: every body axis comes from one sensor axis alone.
    aligned: bool,
}

impl Mounting {
    /// From the flip (true: the sensor gives front-left-up) and roll, pitch, yaw in radians.
    #[must_use]
    pub fn new(flip: bool, [roll, pitch, yaw]: [f64; 3]) -> Self {
        let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
        let rotation = [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ];
        let signs = if flip { [1.0, -1.0, -1.0] } else { [1.0; 3] };
        let matrix = rotation.map(|row| {
            let mut out = [0.0; 3];
            for ((into, value), sign) in out.iter_mut().zip(row).zip(signs) {
                *into = value * sign;
            }
            out
        });
        let aligned = [roll, pitch, yaw].iter().all(|angle| *angle == 0.0);
        Self { matrix, aligned }
    }

    /// Body components of a vector given along the sensor's axes. A rotated vector needs all three.
    #[must_use]
    pub fn apply(&self, sensor: [Option<f64>; 3]) -> [Option<f64>; 3] {
        if self.aligned {
            let mut body = sensor;
            for (axis, value) in body.iter_mut().enumerate() {
                let sign = self
                    .matrix
                    .get(axis)
                    .and_then(|row| row.get(axis))
                    .copied()
                    .unwrap_or(1.0);
                *value = value.map(|value| value * sign);
            }
            return body;
        }
        let [Some(x), Some(y), Some(z)] = sensor else {
            return [None; 3];
        };
        self.matrix.map(|[a, b, c]| Some(a * x + b * y + c * z))
    }

    /// The body axis (0 to 2) most aligned with a sensor axis, and true if they point the same way.
    #[must_use]
    pub fn nearest(&self, sensor_axis: usize) -> (usize, bool) {
        let column = self
            .matrix
            .map(|row| row.get(sensor_axis).copied().unwrap_or(0.0));
        let mut best = (0, 0.0_f64);
        for (axis, value) in column.into_iter().enumerate() {
            if value.abs() > best.1.abs() {
                best = (axis, value);
            }
        }
        (best.0, best.1 >= 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: [Option<f64>; 3], expected: [f64; 3]) {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!(
                (found.unwrap() - expected).abs() < 1e-12,
                "{found:?} {expected}"
            );
        }
    }

    #[test]
    fn a_level_car_at_rest_feels_minus_g_down() {
        let up = Mounting::new(true, [0.0; 3]);
        close(
            up.apply([Some(1.0), Some(2.0), Some(9.8)]),
            [1.0, -2.0, -9.8],
        );
        assert_eq!(
            up.apply([None, Some(2.0), Some(9.8)]),
            [None, Some(-2.0), Some(-9.8)]
        );
        assert_eq!(up.nearest(1), (1, false));
    }

    #[test]
    fn yaw_turns_the_imus_front_to_the_cars_right() {
        let turned = Mounting::new(false, [0.0, 0.0, 90_f64.to_radians()]);
        close(
            turned.apply([Some(1.0), Some(0.0), Some(0.0)]),
            [0.0, 1.0, 0.0],
        );
        assert_eq!(turned.apply([Some(1.0), None, Some(0.0)]), [None; 3]);
        assert_eq!(turned.nearest(0), (1, true));
    }

    #[test]
    fn pitch_is_nose_up_and_roll_right_side_down() {
        // With the nose up, the IMU's front points up, so its x is the car's -z in part.
        let pitched = Mounting::new(false, [0.0, 30_f64.to_radians(), 0.0]);
        close(
            pitched.apply([Some(1.0), Some(0.0), Some(0.0)]),
            [0.75_f64.sqrt(), 0.0, -0.5],
        );
        let rolled = Mounting::new(false, [30_f64.to_radians(), 0.0, 0.0]);
        close(
            rolled.apply([Some(0.0), Some(1.0), Some(0.0)]),
            [0.0, 0.75_f64.sqrt(), 0.5],
        );
    }
}
