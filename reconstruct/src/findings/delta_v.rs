//! Change of velocity over a pulse: in body axes at its onset and over the ground, with its covariance.
//!
//! `dv_b = C_s' (V_e - V_s)` with `V = v + C (w x arm)` the velocity of the centre of gravity, `s` the onset and `e`
//! the end of the pulse: what the car turned during the pulse is in it, and so is the arm from the IMU.

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::error_model::{ATT, STATES};
use crate::findings::change::{Arm, Change, Moment};
use crate::findings::crash::Evidence;
use crate::findings::curve;
use crate::findings::{DeltaV, Figure, pulse_times};
use crate::frame::skew;
use crate::motion::Pulse;

/// A pulse fades below the noise of its end: at least this acceleration is open over the end's timing, m/s^2.
const PULSE_FLOOR: f64 = 8.0;
/// What a weak last lobe of a pulse hides among the forces of the tyres: 1.5 m/s^2 that nothing tells from them, a
/// half-sine of 20 ms, m/s. It pushes where the pulse did.
const FADE: f64 = 0.02;
/// Epochs before the onset whose mean is the rate there.
const RATE_EPOCHS: usize = 5;
/// Epochs behind the end that tell the rate there: above 50 deg/s a stored rate is rounded to 9 deg/s, and only sums
/// over many are exact.
const RATE_AFTER: usize = 10;

/// What a smoother knows of one pulse: the joint covariance, 18 x 18, of the nine errors at the end of epoch
/// `pulse.before` and of those at the end of epoch `pulse.last`, in this order; position, velocity and platform
/// angles each, estimate minus truth, navigation axes.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPulse {
    /// The covariance, m, m/s, rad.
    pub covariance: SMatrix<f64, { 2 * STATES }, { 2 * STATES }>,
}

/// Rate at the end of epoch `k` (mean of the bins on both sides), and that before a pulse.
pub(crate) fn rate_at(evidence: &Evidence<'_>, k: usize) -> Vector3<f64> {
    let rate = &evidence.motion.rate;
    match rate.get(k + 1) {
        Some(next) => (rate[k] + next) * 0.5,
        None => rate[k],
    }
}

/// Rate at the end of a pulse: a line through the bins behind it, drawn back. The last bins of the pulse itself still
/// spin the car up.
fn rate_after(evidence: &Evidence<'_>, pulse: &Pulse, last: usize) -> Vector3<f64> {
    let rate = &evidence.motion.rate;
    let list = &evidence.epochs.list;
    let (from, to) = (last + 1, (last + 1 + RATE_AFTER).min(rate.len()));
    let next = evidence
        .motion
        .impacts
        .iter()
        .any(|p| (from..to).contains(&p.first));
    if from + RATE_AFTER > to || next {
        return rate_at(evidence, last);
    }
    let n = schema::num::real(to - from);
    let middle = |k: usize| list[k].t_s - 0.5 * list[k].dt;
    let at = (from..to).map(middle).sum::<f64>() / n;
    let mean = rate[from..to].iter().sum::<Vector3<f64>>() / n;
    let (mut slope, mut square) = (Vector3::zeros(), 0.0);
    for (k, rate) in rate.iter().enumerate().take(to).skip(from) {
        slope += rate * (middle(k) - at);
        square += (middle(k) - at).powi(2);
    }
    mean + slope * ((pulse.end_s - at) / square)
}

fn rate_before(evidence: &Evidence<'_>, k: usize) -> Vector3<f64> {
    let from = (k + 1).saturating_sub(RATE_EPOCHS);
    let window = &evidence.motion.rate[from..=k];
    window.iter().sum::<Vector3<f64>>() / schema::num::real(window.len())
}

/// Variance of a rate that is the mean over `seconds`, each axis: noise, vibration, and the scale.
fn rate_variance(evidence: &Evidence<'_>, rate: &Vector3<f64>, seconds: f64) -> Vector3<f64> {
    let imu = &evidence.epochs.header.imu;
    let noise = (imu.rate_density.powi(2) + imu.rate_vibration.powi(2) * 0.01) / seconds
        + imu.rate_bias_jump.powi(2);
    rate.map(|w| noise + (imu.rate_scale * w).powi(2))
}

/// The moment at the onset of a pulse.
pub(crate) fn onset<'a>(evidence: &Evidence<'a>, pulse: &Pulse) -> Moment<'a> {
    let lead = pulse.onset_s - evidence.epochs.list[pulse.before].t_s;
    Moment {
        nav: &evidence.snapshots[pulse.before].nav,
        rate: rate_before(evidence, pulse.before),
        step: pulse.base * lead,
    }
}

/// Covariance of a change of velocity, 3 x 3, body axes at the onset, from the data sheet: scale, bias, noise,
/// tilt against gravity, mounting, arm and the timing's variance of each axis.
pub(crate) fn by_sheet(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    last: usize,
    change: &Change,
    seconds: f64,
    timing: &Vector3<f64>,
) -> Matrix3<f64> {
    let epochs = evidence.epochs;
    let imu = &epochs.header.imu;
    let mut noise = (imu.accel_density.powi(2) + imu.accel_vibration.powi(2) * 0.01) * seconds;
    for epoch in &epochs.list[pulse.before..=last] {
        noise += epoch.accel_psd * epoch.dt;
    }
    let p = &evidence.snapshots[pulse.before].p;
    let tilt = p[(ATT, ATT)].max(p[(ATT + 1, ATT + 1)]);
    let bias = imu.accel_bias.powi(2) + imu.accel_bias_jump.powi(2);
    let shared = noise + (bias + tilt * 9.81 * 9.81) * seconds * seconds;
    let dv = &change.body;
    let own = dv.map(|x| shared + (imu.accel_scale * x).powi(2));
    // A mounting yaw turns the whole change across.
    let across = Vector3::new(-dv.y, dv.x, 0.0);
    Matrix3::from_diagonal(&(own + timing))
        + across * across.transpose() * imu.mounting_sd[2].powi(2)
        + lever(evidence, change, last)
}

fn lever(evidence: &Evidence<'_>, change: &Change, last: usize) -> Matrix3<f64> {
    let dt = evidence.epochs.list.last().map_or(0.01, |e| e.dt);
    change.lever_covariance(
        &Arm::of(evidence).sd,
        [
            rate_variance(
                evidence,
                &change.rate[0],
                dt * schema::num::real(RATE_EPOCHS),
            ),
            rate_variance(evidence, &change.rate[1], 2.0 * dt) + evidence.motion.rate_doubt[last],
        ],
    )
}

/// True if an accelerometer stood at its limit in the epochs from `from` to `to`.
pub(crate) fn clipped(evidence: &Evidence<'_>, from: usize, to: usize) -> bool {
    evidence.epochs.list[from..=to]
        .iter()
        .any(|e| e.clipped[..3].iter().any(|c| *c != 0.0))
}

/// Delta-V of one pulse; `joint` where a smoother knows its two sides together.
#[must_use]
pub fn delta_v(evidence: &Evidence<'_>, pulse: &Pulse, joint: Option<&JointPulse>) -> DeltaV {
    let Evidence {
        epochs,
        snapshots,
        quantile,
        ..
    } = *evidence;
    let arm = Arm::of(evidence);
    let last = pulse.last.min(snapshots.len() - 1);
    let over = epochs.list[last].t_s - pulse.end_s;
    let start = onset(evidence, pulse);
    let end = Moment {
        nav: &snapshots[last].nav,
        rate: rate_after(evidence, pulse, last),
        step: pulse.level * -over,
    };
    let change = Change::between(&start, &end, &arm.at);
    let after = (pulse.level.xy().norm().max(PULSE_FLOOR) * pulse.end_sd_s).powi(2);
    let timing = pulse
        .base
        .map(|a| (a * pulse.onset_sd_s).powi(2))
        .add_scalar(after);
    let (body, ground) = covariances(evidence, pulse, last, &change, &timing, joint);
    let clipped = clipped(evidence, pulse.before, last);
    let times = pulse_times::all(evidence, pulse);
    let doubt = pulse_times::end_doubt(&times).hypot(0.5 * epochs.list[last].dt);
    let turn = turn(evidence, pulse, last, &change, doubt);
    let plane = Plane {
        x: change.body.x,
        y: change.body.y,
        covariance: [body[(0, 0)], body[(1, 1)], body[(0, 1)]],
    };
    let over_ground = Plane {
        x: change.nav.x,
        y: change.nav.y,
        covariance: [ground[(0, 0)], ground[(1, 1)], ground[(0, 1)]],
    };
    // A clipped sensor leaves the other bound open, unless the velocity is known on both sides by other means.
    let open = clipped && joint.is_none();
    let mut result = plane.delta_v(&over_ground, quantile, open);
    if open {
        open_direction(evidence, pulse.before..=last, &mut result);
    }
    result.duration_s = Figure::non_negative(
        pulse.end_s - pulse.onset_s,
        pulse.onset_sd_s.hypot(doubt),
        quantile,
    );
    result.end_t_s = pulse.end_s;
    result.clipped = clipped;
    result.point = arm.point;
    result.yaw_rate_change_degps = turn;
    result.times = times;
    if evidence.wheels_only {
        // Wheel speeds lag and slip through an impact: their difference bounds nothing.
        result.without_bounds();
    } else {
        result.curve = curve::points(evidence, pulse, joint.is_some());
        result.maximum = curve::maximum(evidence, pulse, &result.curve);
    }
    result
}

/// The unseen part of a clipped axis turns the true direction towards that axis, by no more than all the way.
fn open_direction(evidence: &Evidence<'_>, epochs: RangeInclusive<usize>, result: &mut DeltaV) {
    for epoch in &evidence.epochs.list[epochs] {
        for (axis, share) in epoch.clipped[..2].iter().enumerate() {
            if *share == 0.0 {
                continue;
            }
            let force = -share.signum();
            let limit = if axis == 0 {
                0.0_f64.atan2(force)
            } else {
                force.atan2(0.0)
            };
            let turn = limit.to_degrees() - result.pdof_deg.value;
            let turn = turn - 360.0 * (turn / 360.0).round();
            // The direction over the ground turns with that in the car.
            for figure in [&mut result.pdof_deg, &mut result.azimuth_deg] {
                figure.low = figure.low.min(figure.value + turn);
                figure.high = figure.high.max(figure.value + turn);
            }
        }
    }
}

/// Covariances in body axes at the onset and in navigation axes.
fn covariances(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    last: usize,
    change: &Change,
    timing: &Vector3<f64>,
    joint: Option<&JointPulse>,
) -> (Matrix3<f64>, Matrix3<f64>) {
    let turned = |m: &Matrix3<f64>| change.c * m * change.c.transpose();
    let push = change.body.try_normalize(0.1).unwrap_or_default();
    let fade = push * push.transpose() * (FADE * FADE);
    if let Some(joint) = joint {
        let extra = Matrix3::from_diagonal(timing) + lever(evidence, change, last) + fade;
        let [nav, body] = change.jacobians();
        (
            body * joint.covariance * body.transpose() + extra,
            nav * joint.covariance * nav.transpose() + turned(&extra),
        )
    } else {
        let seconds = (pulse.end_s - pulse.onset_s).max(0.01);
        let body = by_sheet(evidence, pulse, last, change, seconds, timing) + fade;
        let p = &evidence.snapshots[pulse.before].p;
        let att = p.fixed_view::<3, 3>(ATT, ATT).into_owned();
        let across = skew(&change.nav);
        (body, turned(&body) + across * att * across.transpose())
    }
}

/// Change of yaw rate over the pulse, whose end is known to `doubt` (one sigma, s).
fn turn(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    last: usize,
    change: &Change,
    doubt: f64,
) -> Figure {
    let list = &evidence.epochs.list;
    let rate = &evidence.motion.rate;
    let dt = list[last].dt;
    let growth = [last, last + 1, last + 2]
        .iter()
        .filter_map(|&k| Some((rate.get(k)?.z - rate[k - 1].z) / dt))
        .fold(0.0, |m: f64, a| m.max(a.abs()));
    let variance = rate_variance(
        evidence,
        &change.rate[0],
        dt * schema::num::real(RATE_EPOCHS),
    )
    .z + rate_variance(evidence, &change.rate[1], 2.0 * dt).z
        + (growth * doubt).powi(2)
        + evidence.motion.rate_doubt[last].z
        + list[pulse.before..=last]
            .iter()
            .map(|e| e.rate_psd / e.dt)
            .fold(0.0, f64::max);
    Figure::new(
        (change.rate[1].z - change.rate[0].z).to_degrees(),
        variance.sqrt().to_degrees(),
        evidence.quantile,
    )
}

/// A change in a plane with its covariance: variances of x and y, and their covariance.
struct Plane {
    x: f64,
    y: f64,
    covariance: [f64; 3],
}

impl Plane {
    /// Size, its sd, and the sd of the direction, rad.
    fn polar(&self) -> (f64, f64, f64) {
        let [xx, yy, xy] = self.covariance;
        let size = self.x.hypot(self.y);
        let (c, s) = if size > 0.0 {
            (self.x / size, self.y / size)
        } else {
            (1.0, 0.0)
        };
        let along = c * c * xx + s * s * yy + 2.0 * c * s * xy;
        let across = s * s * xx + c * c * yy - 2.0 * c * s * xy;
        let turn = if size > 0.1 {
            across.max(0.0).sqrt() / size
        } else {
            std::f64::consts::PI
        };
        (size, along.max(0.0).sqrt(), turn)
    }

    fn components(&self, quantile: f64) -> [Figure; 2] {
        [(self.x, self.covariance[0]), (self.y, self.covariance[1])]
            .map(|(value, variance)| Figure::new(value, variance.max(0.0).sqrt(), quantile))
    }

    fn delta_v(&self, ground: &Self, quantile: f64, open: bool) -> DeltaV {
        let (size, sd_size, sd_pdof) = self.polar();
        let (_, _, sd_azimuth) = ground.polar();
        let wide = |figure: Figure| if open { widen(figure) } else { figure };
        let [longitudinal, lateral] = self.components(quantile);
        let [north, east] = ground.components(quantile);
        DeltaV {
            longitudinal_mps: wide(longitudinal),
            lateral_mps: wide(lateral),
            resultant_mps: wide(Figure::non_negative(size, sd_size, quantile)),
            pdof_deg: Figure::new(
                (-self.y).atan2(-self.x).to_degrees(),
                sd_pdof.to_degrees(),
                quantile,
            ),
            cov_longitudinal_lateral: self.covariance[2],
            north_mps: wide(north),
            east_mps: wide(east),
            cov_north_east: ground.covariance[2],
            azimuth_deg: Figure::new(
                ground.y.atan2(ground.x).to_degrees().rem_euclid(360.0),
                sd_azimuth.to_degrees(),
                quantile,
            ),
            lower_bound: open,
            ..DeltaV::default()
        }
    }
}

/// A clipped component is at least what was measured, away from zero: the other bound is open.
pub(crate) fn widen(figure: Figure) -> Figure {
    if figure.value < 0.0 {
        Figure {
            low: f64::NEG_INFINITY,
            ..figure
        }
    } else {
        Figure {
            high: f64::INFINITY,
            ..figure
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Clipping opens the bound away from zero, and a smoother that knows both sides closes it; wheels alone
    /// bound nothing.
    #[test]
    fn clipping_and_wheels_alone() {
        use crate::simulate::{Class, Scenario, simulate};
        let simulated = simulate(&Scenario::draw(Class::Frontal, 21)).unwrap();
        let samples: Vec<_> = simulated
            .samples()
            .into_iter()
            .enumerate()
            .skip(1000)
            .map(|(k, s)| (schema::num::u64_of(k), 100, s))
            .collect();
        let header = simulated.scenario.header();
        let mut epochs = crate::epochs::Epochs::from_samples(header, &samples, 9.99, &[]).unwrap();
        let earth = crate::mechanize::Earth::flat();
        let rest = crate::rest::find(&epochs, earth.gravity);
        let start = crate::start::at_rest(&epochs, &rest, &earth);
        let reversed = epochs.reversed();
        let motion = crate::motion::Motion::look(&reversed, &start, earth.gravity, &[]);
        let pass = crate::filter::run(&crate::filter::Setup {
            anchor: None,
            reversed,
            start: &start,
            motion: &motion,
            earth,
            road: None,
            tuning: crate::filter::Tuning::default(),
        })
        .unwrap();
        let pulse = motion.impacts[0];
        epochs.list[pulse.first + 2].clipped[0] = -0.5;
        let evidence = |wheels_only| Evidence {
            epochs: &epochs,
            motion: &motion,
            snapshots: &pass.snapshots,
            quantile: 1.96,
            joint: &[],
            wheels_only,
        };
        let joint = JointPulse {
            covariance: SMatrix::identity() * 1e-4,
        };
        let open = delta_v(&evidence(false), &pulse, None);
        assert!(open.lower_bound && open.clipped && open.resultant_mps.high.is_infinite());
        assert!(open.longitudinal_mps.low.is_infinite() && open.north_mps.low.is_infinite());
        // Clipped along x: the force may have come from straight ahead.
        let pdof = open.pdof_deg;
        assert!(pdof.low <= 0.0 && pdof.high >= 0.0, "{pdof:?}");
        let end = open.curve.iter().min_by(|a, b| {
            let off = |p: &crate::findings::curve::CurvePoint| {
                (p.after_onset_s - (pulse.end_s - pulse.onset_s)).abs()
            };
            off(a).total_cmp(&off(b))
        });
        let apart = end.unwrap().longitudinal_mps.value - open.longitudinal_mps.value;
        assert!(apart.abs() < 0.3, "{apart}");
        let most = open.maximum.unwrap().longitudinal.value_mps.value;
        assert!(most.abs() > open.longitudinal_mps.value.abs() - 0.3);
        let closed = delta_v(&evidence(false), &pulse, Some(&joint));
        assert!(!closed.lower_bound && closed.clipped && closed.resultant_mps.high.is_finite());
        let wheels = delta_v(&evidence(true), &pulse, None);
        assert!(wheels.resultant_mps.sd.is_infinite() && wheels.curve.is_empty());
    }
}
