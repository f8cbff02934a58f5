//! The final rest: when the car stood, how it lies, and how it got there from the first impact.

use nalgebra::Vector2;

use crate::error_model::{ATT, POS, VEL};
use crate::findings::Figure;
use crate::findings::crash::Evidence;
use crate::findings::reaction::way;
use crate::findings::rollover::lies_on;
use crate::rest::RestInterval;
use crate::trajectory::State;

/// The car stands once it stays slower than this over the ground, m/s: what follows is the rocking of its springs.
pub const CREEP_MPS: f64 = 0.1;
/// Length of the stretch whose deceleration tells how exactly that instant is known, s.
const LAST_S: f64 = 0.15;
/// A car about to stand loses at least this, m/s^2.
const LEAST_DECELERATION: f64 = 0.1;

/// The final rest.
#[derive(Clone, Debug, PartialEq)]
pub struct FinalRest {
    /// When the car last moved faster than 0.1 m/s over the ground, seconds from the trigger.
    pub stop_t_s: Figure,
    /// From here on it stood so still that levelling uses it, seconds from the trigger.
    pub settled_t_s: f64,
    /// From there to the end of the record, s.
    pub duration_s: Figure,
    /// Roll at rest, degrees; no number where the model has none.
    pub roll_deg: Figure,
    /// Pitch at rest, degrees.
    pub pitch_deg: Figure,
    /// Heading at rest, degrees: 0 by definition without a rest pose.
    pub heading_deg: Figure,
    /// `wheels`, `roof`, `left side`, `right side`, `nose`, `tail`, or `unknown` where the model has no roll and pitch.
    pub lies_on: &'static str,
    /// The way there from the first impact; `None` where there was none.
    pub from_impact: Option<FromImpact>,
}

/// From the onset of the first impact to the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FromImpact {
    /// In a straight line, m.
    pub straight_m: Figure,
    /// Along the path of the IMU, m.
    pub path_m: Figure,
    /// Turn of the forward axis seen from above, whole turns counted, degrees, positive to the right.
    pub rotation_deg: Figure,
    /// Time, s.
    pub duration_s: Figure,
}

/// The final rest; `None` where the record ends moving.
#[must_use]
pub fn of(evidence: &Evidence<'_>, rest: &RestInterval, states: &[State]) -> Option<FinalRest> {
    if !rest.found() {
        return None;
    }
    let list = &evidence.epochs.list;
    let q = evidence.quantile;
    let stop = stop(evidence, rest);
    let lying = &evidence.snapshots[rest.settled.min(evidence.snapshots.len() - 1)];
    let (roll, pitch, heading) = lying.nav.c_nb.euler();
    let jacobian = lying.nav.c_nb.euler_jacobian();
    let att = lying.p.fixed_view::<3, 3>(ATT, ATT);
    // Roll and pitch are the car's: how the sensor sits in it is known to its mounting's sd.
    let mounting = evidence.epochs.header.imu.mounting_sd;
    let sd = |i: usize| {
        let row = jacobian.row(i).into_owned();
        let own = (row * att * row.transpose())[0].max(0.0);
        (own + mounting[i].powi(2)).sqrt().to_degrees()
    };
    let attitude = |angle: f64, i: usize| {
        if evidence.wheels_only {
            Figure::NONE
        } else {
            Figure::new(angle.to_degrees(), sd(i), q)
        }
    };
    let end = list.last().map_or(0.0, |e| e.t_s);
    Some(FinalRest {
        stop_t_s: stop,
        settled_t_s: list.get(rest.settled).map_or(end, |e| e.t_s - e.dt),
        duration_s: Figure::non_negative(end - stop.value, stop.sd, q),
        roll_deg: attitude(roll, 0),
        pitch_deg: attitude(pitch, 1),
        heading_deg: Figure::new(heading.to_degrees().rem_euclid(360.0), 0.0, q),
        lies_on: if evidence.wheels_only {
            "unknown"
        } else {
            lies_on(&lying.nav)
        },
        from_impact: from_impact(evidence, rest, states, &stop),
    })
}

/// When the car stands: the end of the last sample above a creep.
fn stop(evidence: &Evidence<'_>, rest: &RestInterval) -> Figure {
    let list = &evidence.epochs.list;
    let speed = |k: usize| evidence.snapshots[k].nav.v_n.v.xy().norm();
    let q = evidence.quantile;
    let settled = rest.settled.min(list.len() - 1);
    let Some(k) = (0..=settled).rev().find(|&k| speed(k) > CREEP_MPS) else {
        // Never moved: it stood from the first sample on.
        return Figure::new(list[0].t_s - list[0].dt, 0.0, q);
    };
    let from = list.partition_point(|e| e.t_s < list[k].t_s - LAST_S);
    let span = (list[k].t_s - list[from].t_s).max(list[k].dt);
    let loss = ((speed(from) - speed(k)) / span).max(LEAST_DECELERATION);
    let p = &evidence.snapshots[k].p;
    let v = p[(VEL, VEL)].max(p[(VEL + 1, VEL + 1)]).max(0.0).sqrt();
    Figure::new(list[k].t_s, (v / loss).hypot(list[k].dt), q)
}

fn from_impact(
    evidence: &Evidence<'_>,
    rest: &RestInterval,
    states: &[State],
    stop: &Figure,
) -> Option<FromImpact> {
    let pulse = evidence.motion.impacts.first()?;
    let q = evidence.quantile;
    let last = rest.settled.min(evidence.snapshots.len() - 1);
    let (a, b) = (&evidence.snapshots[pulse.before], &evidence.snapshots[last]);
    if pulse.before >= last {
        return None;
    }
    let lead = pulse.onset_s - evidence.epochs.list[pulse.before].t_s;
    let apart: Vector2<f64> = (a.nav.r_n.v + a.nav.v_n.v * lead - b.nav.r_n.v).xy();
    let straight = apart.norm();
    let unit = if straight > 0.0 {
        apart / straight
    } else {
        Vector2::x()
    };
    let place = |s: &crate::filter::Snapshot| {
        let p = s.p.fixed_view::<2, 2>(POS, POS).into_owned();
        (unit.transpose() * p * unit)[0]
    };
    let timing = a.nav.v_n.v.xy().dot(&unit) * pulse.onset_sd_s;
    let sd = (place(a) + place(b) + timing * timing).max(0.0).sqrt();
    let row = a.nav.c_nb.euler_jacobian().row(2).into_owned();
    let att = a.p.fixed_view::<3, 3>(ATT, ATT);
    let turn_sd = (row * att * row.transpose())[0].max(0.0).sqrt();
    Some(FromImpact {
        straight_m: Figure::non_negative(straight, sd, q),
        path_m: {
            // The way driven while the onset is not sure.
            let path = way(states, pulse.onset_s, stop.value, q);
            let open = a.nav.v_n.v.xy().norm() * pulse.onset_sd_s;
            Figure::non_negative(path.value, path.sd.hypot(open), q)
        },
        rotation_deg: Figure::new(
            turned(evidence, pulse.before, last).to_degrees(),
            turn_sd.to_degrees(),
            q,
        ),
        duration_s: Figure::new(
            stop.value - pulse.onset_s,
            stop.sd.hypot(pulse.onset_sd_s),
            q,
        ),
    })
}

/// Heading turned from epoch `from` to `to`, whole turns counted; each step is below half a turn.
fn turned(evidence: &Evidence<'_>, from: usize, to: usize) -> f64 {
    let heading = |k: usize| evidence.snapshots[k].nav.c_nb.euler().2;
    (from + 1..=to)
        .map(|k| {
            let step = heading(k) - heading(k - 1);
            step - std::f64::consts::TAU * (step / std::f64::consts::TAU).round()
        })
        .sum()
}
