//! Impact speed, delta-V, direction of force, braking and distance, each with its uncertainty.

use nalgebra::{Vector2, Vector3};

use crate::epochs::Epochs;
use crate::filter::Snapshot;
use crate::findings::{Braking, DeltaV, Figure, Impact};
use crate::funnel::speed_row;
use crate::mechanize::Nav9;
use crate::motion::{Motion, Pulse};
use crate::trajectory::State;

/// A pulse fades below the noise of its end: at least this acceleration is open over the end's timing, m/s^2.
const PULSE_FLOOR: f64 = 8.0;
/// Deceleration (250 ms mean) that counts as braking, and the level it must have come from, m/s^2.
const BRAKING: f64 = 2.0;
const BRAKING_ONSET: f64 = 1.0;
/// Braking that ended longer than this before the impact is not the braking before it, s.
const BRAKING_GAP_S: f64 = 1.0;
/// Time over which the onset of braking is blurred by the 250 ms mean, one sigma, s.
const BRAKING_ONSET_SD_S: f64 = 0.06;

/// What the findings are made from.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// Epochs.
    pub epochs: &'a Epochs,
    /// First look.
    pub motion: &'a Motion,
    /// Filtered states.
    pub snapshots: &'a [Snapshot],
    /// Sigmas to a bound of the run's confidence.
    pub quantile: f64,
}

/// Every impact.
#[must_use]
pub fn impacts(evidence: &Evidence<'_>) -> Vec<Impact> {
    evidence
        .motion
        .impacts
        .iter()
        .map(|pulse| impact(evidence, pulse))
        .collect()
}

/// Forward speed at the onset of `pulse` by one model's snapshots, with the timing's share in its spread.
#[must_use]
pub fn speed_at(evidence: &Evidence<'_>, pulse: &Pulse) -> Figure {
    let before = &evidence.snapshots[pulse.before];
    let lead = pulse.onset_s - evidence.epochs.list[pulse.before].t_s;
    let nav = &before.nav;
    let speed = nav.c_nb.m.column(0).dot(&nav.v_n.v) + pulse.base.x * lead;
    let h = speed_row(nav);
    let timing = pulse.base.x * pulse.onset_sd_s;
    let sd = ((h.transpose() * before.p * h)[0] + timing * timing)
        .max(0.0)
        .sqrt();
    Figure::new(speed, sd, evidence.quantile)
}

fn impact(evidence: &Evidence<'_>, pulse: &Pulse) -> Impact {
    let q = evidence.quantile;
    let before = &evidence.snapshots[pulse.before];
    let lead = pulse.onset_s - evidence.epochs.list[pulse.before].t_s;
    let yaw_rate = evidence.motion.rate[pulse.before].z;
    let heading = before.nav.c_nb.euler().2 + yaw_rate * lead;
    let row = before.nav.c_nb.euler_jacobian().row(2).into_owned();
    let att = before
        .p
        .fixed_view::<3, 3>(crate::error_model::ATT, crate::error_model::ATT);
    let heading_sd = (row * att * row.transpose())[0].max(0.0).sqrt();
    Impact {
        t_s: Figure::new(pulse.onset_s, pulse.onset_sd_s, q),
        speed_mps: speed_at(evidence, pulse),
        heading_deg: Figure::new(
            heading.to_degrees().rem_euclid(360.0),
            heading_sd.to_degrees(),
            q,
        ),
        delta_v: delta_v(evidence, pulse),
    }
}

/// Velocity of a point fixed to the car, `arm` (body axes) from the IMU.
fn velocity_at(nav: &Nav9, rate: &Vector3<f64>, arm: &Vector3<f64>) -> Vector3<f64> {
    nav.v_n.v + nav.c_nb.m * rate.cross(arm)
}

/// Delta-V from the velocities before and after the pulse, in body axes at its onset: what the car turned
/// during the pulse is in it, and so is the arm from the IMU to the centre of gravity.
fn delta_v(evidence: &Evidence<'_>, pulse: &Pulse) -> DeltaV {
    let Evidence {
        epochs,
        motion,
        snapshots,
        quantile,
    } = *evidence;
    let vehicle = &epochs.header.vehicle;
    let arm = vehicle.imu_position_m.zip(vehicle.cg_position_m);
    let (point, arm, arm_sd) = match arm {
        Some((imu, cg)) => {
            let spread = |i: usize| vehicle.imu_position_sd_m[i].hypot(vehicle.cg_position_sd_m[i]);
            (
                "cg",
                Vector3::from(cg) - Vector3::from(imu),
                [spread(0), spread(1)],
            )
        }
        None => ("imu", Vector3::zeros(), [0.0, 0.0]),
    };
    let last = pulse.last.min(snapshots.len() - 1);
    let (start, end) = (&snapshots[pulse.before].nav, &snapshots[last].nav);
    let from = pulse.before.saturating_sub(4);
    let count = schema::num::real(pulse.before + 1 - from);
    let rate_start: Vector3<f64> = motion.rate[from..=pulse.before]
        .iter()
        .sum::<Vector3<f64>>()
        / count;
    let rate_end = match motion.rate.get(last + 1) {
        Some(next) => (motion.rate[last] + next) * 0.5,
        None => motion.rate[last],
    };
    let lead = pulse.onset_s - epochs.list[pulse.before].t_s;
    let v_start = velocity_at(start, &rate_start, &arm) + start.c_nb.m * pulse.base * lead;
    let over = epochs.list[last].t_s - pulse.end_s;
    let v_end = velocity_at(end, &rate_end, &arm) - end.c_nb.m * pulse.level * over;
    let dv = start.c_nb.m.transpose() * (v_end - v_start);
    let [sd_x, sd_y] = spread(evidence, pulse, last, &dv, &(rate_end - rate_start), arm_sd);
    let resultant = dv.xy().norm();
    let unit = if resultant > 0.0 {
        dv.xy() / resultant
    } else {
        Vector2::x()
    };
    let sd_resultant = (unit.x * sd_x).hypot(unit.y * sd_y);
    let sd_pdof = if resultant > 0.1 {
        (unit.x * sd_y).hypot(unit.y * sd_x) / resultant
    } else {
        std::f64::consts::PI
    };
    let clipped = epochs.list[pulse.before..=last]
        .iter()
        .any(|e| e.clipped[..3].iter().any(|c| *c != 0.0));
    let duration = pulse.end_s - pulse.onset_s;
    let open = |figure: Figure| if clipped { widen(figure) } else { figure };
    DeltaV {
        longitudinal_mps: open(Figure::new(dv.x, sd_x, quantile)),
        lateral_mps: open(Figure::new(dv.y, sd_y, quantile)),
        resultant_mps: if clipped {
            Figure {
                high: f64::INFINITY,
                ..Figure::non_negative(resultant, sd_resultant, quantile)
            }
        } else {
            Figure::non_negative(resultant, sd_resultant, quantile)
        },
        pdof_deg: Figure::new(
            (-dv.y).atan2(-dv.x).to_degrees(),
            sd_pdof.to_degrees(),
            quantile,
        ),
        duration_s: Figure::non_negative(
            duration,
            pulse.onset_sd_s.hypot(0.5 * epochs.list[last].dt),
            quantile,
        ),
        end_t_s: pulse.end_s,
        lower_bound: clipped,
        point,
    }
}

/// A clipped component is at least what was measured, away from zero: the other bound is open.
fn widen(figure: Figure) -> Figure {
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

/// One sigma of delta-V along body x and y: scale, bias, noise, tilt against gravity, mounting, lever arm, and
/// the onset's and end's timing.
fn spread(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    last: usize,
    dv: &Vector3<f64>,
    turn: &Vector3<f64>,
    arm_sd: [f64; 2],
) -> [f64; 2] {
    let Evidence {
        epochs, snapshots, ..
    } = *evidence;
    let imu = &epochs.header.imu;
    let seconds = (pulse.end_s - pulse.onset_s).max(0.01);
    let mut noise = (imu.accel_density.powi(2) + imu.accel_vibration.powi(2) * 0.01) * seconds;
    for epoch in &epochs.list[pulse.before..=last] {
        noise += epoch.accel_psd * epoch.dt;
    }
    let att = crate::error_model::ATT;
    let p = &snapshots[pulse.before].p;
    let tilt = p[(att, att)].max(p[(att + 1, att + 1)]);
    let bias = imu.accel_bias.powi(2) + imu.accel_bias_jump.powi(2);
    let shared = noise + (bias + tilt * 9.81 * 9.81) * seconds * seconds;
    let timing = |axis: usize| {
        (pulse.base[axis] * pulse.onset_sd_s).powi(2)
            + (pulse.level.xy().norm().max(PULSE_FLOOR) * pulse.end_sd_s).powi(2)
    };
    let along = |axis: usize, across: usize, lever: f64| {
        (shared
            + (imu.accel_scale * dv[axis]).powi(2)
            + (imu.mounting_sd[2] * dv[across]).powi(2)
            + (turn.z * lever).powi(2)
            + timing(axis))
        .sqrt()
    };
    [along(0, 1, arm_sd[1]), along(1, 0, arm_sd[0])]
}

/// Braking before the first impact, or before the final stop where there was none.
#[must_use]
pub fn braking(evidence: &Evidence<'_>, rest_from: Option<usize>) -> Option<Braking> {
    let Evidence {
        epochs,
        motion,
        quantile,
        ..
    } = *evidence;
    let list = &epochs.list;
    let pulse = motion.impacts.first();
    let end = match (pulse, rest_from) {
        (Some(pulse), _) => pulse.before,
        (None, Some(rest)) => rest.min(list.len() - 1),
        (None, None) => list.len() - 1,
    };
    // The 250 ms mean reaches past the onset of the pulse: look at the mean of what lies before it only.
    let mean = |k: usize| -> f64 {
        if pulse.is_some() && list[end].t_s - list[k].t_s < 0.13 {
            let from = (0..=k)
                .rev()
                .take_while(|&i| list[k].t_s - list[i].t_s < 0.13)
                .last()
                .unwrap_or(k);
            let window = &motion.accel[from..=end];
            window.iter().map(|a| a.x).sum::<f64>() / schema::num::real(window.len())
        } else {
            motion.smooth[k].x
        }
    };
    let last = (0..=end)
        .rev()
        .take_while(|&k| list[end].t_s - list[k].t_s <= BRAKING_GAP_S)
        .find(|&k| mean(k) < -BRAKING)?;
    let first = (0..=last)
        .rev()
        .take_while(|&k| mean(k) < -BRAKING_ONSET)
        .last()
        .unwrap_or(last);
    let stretch = first..=last;
    let seconds: f64 = list[stretch.clone()].iter().map(|e| e.dt).sum();
    let sum: f64 = stretch
        .clone()
        .map(|k| motion.accel[k].x * list[k].dt)
        .sum();
    let peak = stretch.clone().map(|k| -mean(k)).fold(0.0, f64::max);
    let sd = stretch
        .clone()
        .map(|k| evidence.snapshots[k].sd_accel[0])
        .filter(|x| x.is_finite())
        .fold(0.0, f64::max);
    Some(Braking {
        onset_t_s: Figure::new(
            list[first].t_s - list[first].dt,
            BRAKING_ONSET_SD_S,
            quantile,
        ),
        mean_mps2: Figure::non_negative(-sum / seconds.max(0.01), sd, quantile),
        peak_mps2: Figure::non_negative(peak, sd, quantile),
    })
}

/// Distance over ground of the states, m. Its spread takes the speed errors as one and the same throughout,
/// which they at most are.
#[must_use]
pub fn distance(states: &[State], quantile: f64) -> Figure {
    let mut sum = 0.0;
    let mut sd = 0.0;
    for pair in states.windows(2) {
        let dt = pair[1].t_s - pair[0].t_s;
        sum += 0.5 * (pair[0].ground_speed + pair[1].ground_speed) * dt;
        sd += 0.5 * (pair[0].sd_speed + pair[1].sd_speed) * dt;
    }
    Figure::non_negative(sum, sd, quantile)
}
