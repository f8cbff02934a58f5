//! Dead reckoning from the two wheels alone [S03, 2.11-2.17], backwards from the end.
//!
//! `v = (v_left + v_right) / 2`, `w = (v_left - v_right) / d`. In this form the turning radius never appears,
//! so the straight road of [S03, 2.14] needs no condition against a division by zero.

use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

use crate::constraint::Geometry;
use crate::epochs::{Epochs, Reversed};
use crate::error_model::{ATT, POS, STATES, VEL};
use crate::filter::Snapshot;
use crate::frame::{Rot, Vec3};
use crate::kalman::Belief;
use crate::mechanize::Nav9;
use crate::motion::Motion;

/// Share of the speed that slip may hide while the wheels are not to be believed.
const SLIP_SHARE: f64 = 0.10;
/// Time over which slip stays the same, s.
const SLIP_CORRELATION_S: f64 = 0.5;

/// One wheel's speed at the end of each epoch, m/s: straight lines between frames, each put back by the
/// latency; the outermost values are held.
fn wheel_line(epochs: &Epochs, wheel: usize) -> Option<Vec<f64>> {
    let latency = epochs.header.wheels.latency_s;
    let frames: Vec<(f64, f64)> = epochs
        .list
        .iter()
        .filter_map(|e| e.wheels[wheel].map(|v| (e.t_s - 0.5 * e.dt - latency, v)))
        .collect();
    let first = frames.first()?;
    let mut at = 0;
    let mut line = Vec::with_capacity(epochs.list.len());
    for epoch in &epochs.list {
        while at + 1 < frames.len() && frames[at + 1].0 <= epoch.t_s {
            at += 1;
        }
        let (t0, v0) = frames[at];
        let value = match frames.get(at + 1) {
            _ if epoch.t_s < first.0 => first.1,
            Some(&(t1, v1)) if t1 > t0 => v0 + (v1 - v0) * ((epoch.t_s - t0) / (t1 - t0)),
            _ => v0,
        };
        line.push(value);
    }
    Some(line)
}

/// Runs dead reckoning; `None` where a wheel was never heard.
#[must_use]
pub fn run(reversed: &Reversed<'_>, motion: &Motion) -> Option<Vec<Snapshot>> {
    let epochs = reversed.forward();
    let (left, right) = (wheel_line(epochs, 0)?, wheel_line(epochs, 1)?);
    let sheet = &epochs.header.wheels;
    let track = epochs.header.vehicle.track_width_m;
    let geometry = Geometry::new(&epochs.header.vehicle);
    let lever = geometry.imu.xy();
    let white = sheet.noise_mps.powi(2) + epochs.header.wheel_scale.step.powi(2) / 12.0;
    let mut heading = 0.0_f64;
    let mut axle = Vector2::zeros();
    // Errors north, east, heading; considered: common scale, difference of scale.
    let mut belief = Belief::<3, 2> {
        p_xx: SMatrix::zeros(),
        p_xc: SMatrix::zeros(),
        p_cc: nalgebra::Vector2::new(sheet.scale_sd.powi(2), sheet.scale_difference_sd.powi(2)),
    };
    let mut out = Vec::with_capacity(epochs.list.len());
    for (k, epoch) in reversed.iter() {
        let v = 0.5 * (left[k] + right[k]);
        let w = (left[k] - right[k]) / track;
        let slip = if motion.wheels_bad[k] {
            SLIP_SHARE * v
        } else {
            0.0
        };
        out.push(snapshot(
            heading,
            &axle,
            &lever,
            v,
            white.sqrt() + slip,
            sheet.scale_sd * v,
            &belief,
        ));
        let h = epoch.dt;
        let middle = heading - 0.5 * w * h;
        let along = Vector2::new(middle.cos(), middle.sin());
        let across = Vector2::new(-middle.sin(), middle.cos());
        axle -= along * (v * h);
        heading -= w * h;
        // dr' = along dv + across v dpsi, dpsi' = dw; scale errors k v and kd v / d.
        let mut phi = Matrix3::identity();
        phi.fixed_view_mut::<2, 1>(0, 2)
            .copy_from(&(-across * (v * h)));
        let mut gamma = SMatrix::<f64, 3, 2>::zeros();
        gamma
            .fixed_view_mut::<2, 1>(0, 0)
            .copy_from(&(-along * (v * h)));
        gamma[(2, 1)] = -v / track * h;
        let period = 0.02;
        let speed_psd = 0.5 * white * period + slip * slip * 2.0 * SLIP_CORRELATION_S;
        let turn_psd =
            (2.0 * white * period + slip * slip * 2.0 * SLIP_CORRELATION_S) / (track * track);
        let mut q = Matrix3::zeros();
        q.fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&(along * along.transpose() * (speed_psd * h)));
        q[(2, 2)] = turn_psd * h;
        belief.predict(&phi, &gamma, &q);
    }
    out.reverse();
    Some(out)
}

fn snapshot(
    heading: f64,
    axle: &Vector2<f64>,
    lever: &Vector2<f64>,
    v: f64,
    sd_white: f64,
    sd_scale: f64,
    belief: &Belief<3, 2>,
) -> Snapshot {
    let (s, c) = heading.sin_cos();
    let imu = axle + Vector2::new(c * lever.x - s * lever.y, s * lever.x + c * lever.y) - lever;
    let mut p = SMatrix::<f64, STATES, STATES>::zeros();
    p.fixed_view_mut::<2, 2>(POS, POS)
        .copy_from(&belief.p_xx.fixed_view::<2, 2>(0, 0));
    let variance = sd_white * sd_white + sd_scale * sd_scale;
    for axis in 0..3 {
        p[(VEL + axis, VEL + axis)] = variance;
    }
    p[(POS + 2, POS + 2)] = 1e4;
    p[(ATT, ATT)] = 2.5e-3;
    p[(ATT + 1, ATT + 1)] = 2.5e-3;
    p[(ATT + 2, ATT + 2)] = belief.p_xx[(2, 2)];
    Snapshot {
        nav: Nav9 {
            r_n: Vec3::from(Vector3::new(imu.x, imu.y, 0.0)),
            v_n: Vec3::new(v * c, v * s, 0.0),
            c_nb: Rot::from_euler(0.0, 0.0, heading),
        },
        p,
        sd_accel: [f64::NAN; 2],
        accel_noise: [f64::NAN; 2],
        wheels_used: true,
    }
}
