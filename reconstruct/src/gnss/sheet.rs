//! What the filter takes for granted of sensors, receiver and car.

use nalgebra::Vector3;
use schema::num::real;

use super::drive::Drive;
use crate::constraint::Geometry;
use crate::refined::Tuning;

/// White part of the lateral speed of the rear axle in one use, m/s: eight times that of the crash path. Over minutes what
/// a model of the sideslip leaves is the same in every bend of a kind, and told the gyros a scale: with exact speed and
/// perfect gyros the heading was 0.43 deg off after 120 s, with ten times as much 0.17. On seeds 1 to 20 every row of the
/// experiments is 2 to 8 % better; 120 s without fixes are 26.9 m instead of 29.1, smoothed 15.6 instead of 19.9.
const SLIP_WHITE_MPS: f64 = 0.25;

/// Spreads, one sigma, and places.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Specific force on the move as white noise, m/s^2/sqrt(Hz).
    pub accel_density: Vector3<f64>,
    /// Rate on the move as white noise, rad/s/sqrt(Hz).
    pub rate_density: Vector3<f64>,
    /// One sample of specific force of a standing car, m/s^2.
    pub still_accel: Vector3<f64>,
    /// One sample of rate of a standing car, rad/s.
    pub still_rate: Vector3<f64>,
    /// Accelerometer bias, m/s^2.
    pub accel_bias: f64,
    /// Accelerometer scale.
    pub accel_scale: f64,
    /// Gyro bias where none is given, rad/s [S00, table 4.6].
    pub rate_bias: f64,
    /// Gyro scale.
    pub rate_scale: f64,
    /// Random walk of the accelerometer bias, m/s^2/sqrt(s).
    pub accel_drift: f64,
    /// Random walk of the gyro bias, rad/s/sqrt(s).
    pub rate_drift: f64,
    /// Mounting roll, pitch and yaw that the rough mounting leaves, rad. The roll is no state: it is in the bounds of the
    /// car's roll alone.
    pub mounting: [f64; 3],
    /// Place of the sensor on the car.
    pub geometry: Geometry,
    /// Antenna from the sensor, body axes, m.
    pub antenna: Vector3<f64>,
    /// Least spread of a fix, north, east, down, m.
    pub fix_floor: Vector3<f64>,
    /// Least spread of its velocity, m/s.
    pub fix_speed_floor: Vector3<f64>,
    /// Correlation time of the satellite error that fixes share, s.
    pub fix_time_s: f64,
    /// Its share of the variance of a fix.
    pub fix_correlated: f64,
    /// Sideslip, jump, nonlinearity.
    pub tuning: Tuning,
}

impl Default for Sheet {
    /// The prototypes of S00: tables 4.1 (receiver 2), 4.4 to 4.7; behind the windscreen.
    fn default() -> Self {
        Self {
            accel_density: Vector3::new(0.045, 0.031, 0.064),
            rate_density: Vector3::new(1.9e-3, 3.3e-3, 7.6e-4),
            still_accel: Vector3::new(0.045, 0.033, 0.14),
            still_rate: Vector3::new(2.6e-3, 2.3e-3, 2.7e-3),
            accel_bias: 0.1,
            accel_scale: 0.01,
            rate_bias: 0.005,
            rate_scale: 0.005,
            accel_drift: 2e-3,
            rate_drift: 3e-5,
            mounting: [0.02, 0.02, 0.03],
            geometry: Geometry {
                imu: Vector3::new(1.8, 0.0, -1.0),
                imu_sd: Vector3::new(0.5, 0.3, 0.3),
                half_track: 0.75,
            },
            antenna: Vector3::zeros(),
            fix_floor: Vector3::new(2.0, 2.0, 3.0),
            fix_speed_floor: Vector3::new(0.35, 0.35, 0.7 * 0.35),
            fix_time_s: 40.0,
            fix_correlated: 0.8,
            tuning: Tuning {
                slip_white_mps: SLIP_WHITE_MPS,
                ..Tuning::default()
            },
        }
    }
}

impl Sheet {
    /// With the noise that this drive shows, on the move and at its stands: half the variance of the differences from
    /// sample to sample, in which what the car does has little part.
    #[must_use]
    pub fn heard(mut self, drive: &Drive, standing: &[bool]) -> Self {
        let mut sums = [[Vector3::<f64>::zeros(); 2]; 2];
        let mut counts = [0_usize; 2];
        let mut length = 0.0;
        for (pair, now) in drive.periods.windows(2).zip(standing.windows(2)) {
            if now[0] != now[1] || !pair[0].measured || !pair[1].measured {
                continue;
            }
            let at = usize::from(now[0]);
            let (a, w) = (pair[1].accel - pair[0].accel, pair[1].rate - pair[0].rate);
            sums[at][0] += a.component_mul(&a);
            sums[at][1] += w.component_mul(&w);
            counts[at] += 1;
            length += pair[1].dt;
        }
        let dt = length / real((counts[0] + counts[1]).max(1));
        let sd = |at: usize, of: usize| {
            let sum: Vector3<f64> = sums[at][of];
            sum.map(|s| (0.5 * s / real(counts[at].max(1))).sqrt())
        };
        let floor = |v: Vector3<f64>, least: f64| v.map(|x| x.max(least));
        if counts[0] > 100 {
            self.accel_density = floor(sd(0, 0) * dt.sqrt(), 2e-3);
            self.rate_density = floor(sd(0, 1) * dt.sqrt(), 5e-5);
        }
        if counts[1] > 100 {
            self.still_accel = floor(sd(1, 0), 5e-3);
            self.still_rate = floor(sd(1, 1), 2e-4);
        }
        self
    }
}
