//! Largest lateral acceleration, sideslip and yaw rate, before the first impact and after it.

use nalgebra::{SVector, Vector3};

use crate::error_model::{ATT, STATES, VEL};
use crate::filter::{Snapshot, VIBRATION_SPEED};
use crate::findings::Figure;
use crate::findings::crash::Evidence;
use crate::findings::rollover::upright;
use crate::mechanize::Nav9;

/// Below this speed over ground no sideslip is given, m/s.
pub const SIDESLIP_MPS: f64 = 5.0;
/// Length of the mean of the lateral acceleration, s.
pub const MEAN_S: f64 = 0.25;
/// A mean keeps so far away from a pulse: half its length, s.
const CLEAR_S: f64 = 0.5 * MEAN_S + 0.005;

/// A value and when it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extreme {
    /// The value, with its sign: to the right is positive.
    pub value: Figure,
    /// Seconds from the trigger.
    pub t_s: f64,
}

/// The largest of a stretch of time; `None` where nothing could be measured.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Extremes {
    /// Lateral acceleration at the IMU, body y, free of gravity, 250 ms mean, m/s^2.
    pub lateral_mps2: Option<Extreme>,
    /// Angle from the forward axis to the direction of motion at the IMU, above 5 m/s, degrees.
    pub sideslip_deg: Option<Extreme>,
    /// Yaw rate, one sample, degrees/s.
    pub yaw_rate_degps: Option<Extreme>,
}

/// Extremes of the epochs `from..to` on which the car stands on its wheels, outside of the pulses.
#[must_use]
pub fn of(evidence: &Evidence<'_>, from: usize, to: usize) -> Extremes {
    let list = &evidence.epochs.list;
    let q = evidence.quantile;
    let outside = |k: usize, margin: f64| {
        let t = list[k].t_s - 0.5 * list[k].dt;
        let away = |p: &crate::motion::Pulse| t < p.onset_s - margin || t > p.end_s + margin;
        evidence.motion.impacts.iter().all(away)
    };
    let mut out = Extremes::default();
    let larger =
        |old: &Option<Extreme>, value: f64| old.is_none_or(|o| value.abs() > o.value.value.abs());
    // A slow car's sideslip is hardly known: the largest is the one that is surely so large.
    let surer = |old: &Option<Extreme>, value: f64, sd: f64| {
        old.is_none_or(|o| value.abs() - q * sd > o.value.value.abs() - q * o.value.sd)
    };
    for (k, epoch) in list.iter().enumerate().take(to).skip(from) {
        let snapshot = &evidence.snapshots[k];
        if !upright(&snapshot.nav) {
            continue;
        }
        if epoch.measured[1]
            && outside(k, CLEAR_S)
            && let Some(lateral) = lateral_mean(evidence, k)
            && larger(&out.lateral_mps2, lateral)
        {
            let middle = epoch.t_s - 0.5 * epoch.dt;
            out.lateral_mps2 = Some(Extreme {
                value: Figure::new(lateral, sd_mean(evidence, k), q),
                t_s: middle,
            });
        }
        if !outside(k, 0.0) {
            continue;
        }
        if let Some((value, sd)) = sideslip(snapshot)
            && surer(&out.sideslip_deg, value.to_degrees(), sd.to_degrees())
        {
            out.sideslip_deg = Some(Extreme {
                value: Figure::new(value.to_degrees(), sd.to_degrees(), q),
                t_s: epoch.t_s,
            });
        }
        let rate = evidence.motion.rate[k].z.to_degrees();
        if epoch.measured[5] && larger(&out.yaw_rate_degps, rate) {
            let imu = &evidence.epochs.header.imu;
            let variance = (imu.rate_density.powi(2) + epoch.rate_psd) / epoch.dt
                + imu.rate_vibration.powi(2)
                + imu.rate_bias_jump.powi(2)
                + (0.01 * imu.rate_bias).powi(2);
            let scale = imu.rate_scale * rate;
            out.yaw_rate_degps = Some(Extreme {
                value: Figure::new(rate, variance.sqrt().to_degrees().hypot(scale), q),
                t_s: epoch.t_s,
            });
        }
    }
    out
}

/// The mean over 250 ms about epoch `k`, free of gravity, with the calibration of the model where it has one.
fn lateral_mean(evidence: &Evidence<'_>, k: usize) -> Option<f64> {
    let list = &evidence.epochs.list;
    let middle = list[k].t_s - 0.5 * list[k].dt;
    let half = 0.5 * MEAN_S + 1e-6;
    let from = list.partition_point(|e| e.t_s - 0.5 * e.dt < middle - half);
    let to = list.partition_point(|e| e.t_s - 0.5 * e.dt <= middle + half);
    let (mut sum, mut length) = (0.0, 0.0);
    for (epoch, accel) in list[from..to].iter().zip(&evidence.motion.accel[from..to]) {
        sum += accel.y * epoch.dt;
        length += epoch.dt;
    }
    (length > 0.9 * MEAN_S).then(|| sum / length)
}

/// One sigma of the 250 ms mean of the lateral acceleration: what stays the same over it, and the noise's rest.
fn sd_mean(evidence: &Evidence<'_>, k: usize) -> f64 {
    let imu = &evidence.epochs.header.imu;
    let epoch = &evidence.epochs.list[k];
    let snapshot = &evidence.snapshots[k];
    let single = snapshot.sd_accel[1];
    let (constant, noise) = if single.is_finite() {
        let noise = snapshot.accel_noise[1];
        ((single * single - noise / epoch.dt).max(0.0), noise)
    } else {
        let p = &snapshot.p;
        let driving = (snapshot.nav.v_n.v.norm() / VIBRATION_SPEED).min(1.0);
        (
            imu.accel_bias.powi(2) + p[(ATT, ATT)].max(p[(ATT + 1, ATT + 1)]) * 9.81 * 9.81,
            imu.accel_density.powi(2)
                + (imu.accel_vibration * driving).powi(2) * 0.01
                + epoch.accel_psd,
        )
    };
    let across = imu.mounting_sd[2] * evidence.motion.smooth[k].x;
    // The largest of many noisy means lies above the truth by about the noise of one.
    (constant + 2.0 * noise / MEAN_S + across * across).sqrt()
}

/// Sideslip of one snapshot and its sd, rad; `None` below [`SIDESLIP_MPS`].
fn sideslip(snapshot: &Snapshot) -> Option<(f64, f64)> {
    let nav = &snapshot.nav;
    let v = &nav.v_n.v;
    let speed = v.xy().norm();
    if speed < SIDESLIP_MPS {
        return None;
    }
    let heading = nav.c_nb.euler().2;
    let (s, c) = heading.sin_cos();
    let value = (v.y * c - v.x * s).atan2(v.x * c + v.y * s);
    let h = sideslip_row(nav);
    Some((value, (h.transpose() * snapshot.p * h)[0].max(0.0).sqrt()))
}

/// Sensitivity of the sideslip (course less heading) to the nine errors.
fn sideslip_row(nav: &Nav9) -> SVector<f64, STATES> {
    let v = &nav.v_n.v;
    let square = v.xy().norm_squared();
    let mut h = SVector::<f64, STATES>::zeros();
    h.fixed_rows_mut::<3>(VEL)
        .copy_from(&Vector3::new(-v.y / square, v.x / square, 0.0));
    let heading = nav.c_nb.euler_jacobian().row(2).transpose();
    h.fixed_rows_mut::<3>(ATT).copy_from(&-heading);
    h
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Rot, Vec3};
    use nalgebra::SMatrix;

    #[test]
    fn sideslip_meets_finite_differences() {
        let base = Nav9 {
            r_n: Vec3::zero(),
            v_n: Vec3::new(14.0, 6.0, 0.1),
            c_nb: Rot::from_euler(0.05, -0.02, 0.9),
        };
        let at = |nav: Nav9| {
            let snapshot = Snapshot {
                nav,
                p: SMatrix::zeros(),
                sd_accel: [0.0; 2],
                accel_noise: [0.0; 2],
                wheels_used: false,
            };
            sideslip(&snapshot).unwrap().0
        };
        let h = sideslip_row(&base);
        for i in 0..STATES {
            let mut e = SVector::<f64, STATES>::zeros();
            e[i] = -1e-6;
            // Taking an error of -1e-6 off adds 1e-6 of it.
            let moved = at(crate::filter::corrected(&base, &e));
            assert!(((moved - at(base)) / 1e-6 - h[i]).abs() < 1e-5, "{i}");
        }
        assert!((at(base) - (6.0_f64.atan2(14.0) - 0.9)).abs() < 1e-9);
    }
}
