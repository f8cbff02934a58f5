//! Impact speed, delta-V, direction of force, braking and distance, each with its uncertainty.

use crate::epochs::Epochs;
use crate::error_model::{ATT, POS};
use crate::filter::Snapshot;
use crate::findings::delta_v::{JointPulse, delta_v};
use crate::findings::{Braking, Figure, Impact};
use crate::funnel::speed_row;
use crate::motion::{Motion, Pulse};
use crate::trajectory::State;

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
    /// One entry an impact, in their order, where a smoother knows both sides of the pulse together; may be
    /// empty: none is known.
    pub joint: &'a [Option<JointPulse>],
    /// The snapshots come from the wheels alone, which say nothing about a pulse.
    pub wheels_only: bool,
}

/// Every impact.
#[must_use]
pub fn impacts(evidence: &Evidence<'_>) -> Vec<Impact> {
    let pulses = evidence.motion.impacts.iter().enumerate();
    pulses
        .map(|(i, pulse)| impact(evidence, i, pulse))
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

/// Impact `index`, whose pulse is `pulse`.
#[must_use]
pub fn impact(evidence: &Evidence<'_>, index: usize, pulse: &Pulse) -> Impact {
    let q = evidence.quantile;
    let before = &evidence.snapshots[pulse.before];
    let lead = pulse.onset_s - evidence.epochs.list[pulse.before].t_s;
    let yaw_rate = evidence.motion.rate[pulse.before].z;
    let heading = before.nav.c_nb.euler().2 + yaw_rate * lead;
    let row = before.nav.c_nb.euler_jacobian().row(2).into_owned();
    let att = before.p.fixed_view::<3, 3>(ATT, ATT);
    let heading_sd = (row * att * row.transpose())[0].max(0.0).sqrt();
    let place = before.nav.r_n.v + before.nav.v_n.v * lead;
    let sd = |i: usize| {
        let timing = before.nav.v_n.v[i] * pulse.onset_sd_s;
        (before.p[(POS + i, POS + i)] + timing * timing)
            .max(0.0)
            .sqrt()
    };
    let joint = evidence.joint.get(index).and_then(Option::as_ref);
    Impact {
        t_s: Figure::new(pulse.onset_s, pulse.onset_sd_s, q),
        speed_mps: speed_at(evidence, pulse),
        heading_deg: Figure::new(
            heading.to_degrees().rem_euclid(360.0),
            heading_sd.to_degrees(),
            q,
        ),
        north_m: Figure::new(place.x, sd(0), q),
        east_m: Figure::new(place.y, sd(1), q),
        cov_north_east_m2: before.p[(POS, POS + 1)]
            + before.nav.v_n.v.x * before.nav.v_n.v.y * pulse.onset_sd_s.powi(2),
        delta_v: delta_v(evidence, pulse, joint),
    }
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
        .map(|k| {
            let snapshot = &evidence.snapshots[k];
            let tilt = snapshot.p[(ATT, ATT)].max(snapshot.p[(ATT + 1, ATT + 1)]);
            // A model without accelerometer states still has the data sheet's bias and its own tilt.
            let sheet = epochs
                .header
                .imu
                .accel_bias
                .hypot(tilt.max(0.0).sqrt() * 9.81);
            let own = snapshot.sd_accel[0];
            if own.is_finite() { own } else { sheet }
        })
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
