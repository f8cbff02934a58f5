//! The final rest: when the car stood, how it lies, and how it got there from the first impact.

use nalgebra::Vector2;

use crate::error_model::{ATT, POS};
use crate::findings::Figure;
use crate::findings::crash::Evidence;
use crate::findings::reaction::way;
use crate::findings::rollover::lies_on;
use crate::rest::RestInterval;
use crate::trajectory::State;

/// A car slower than this is about to stand, m/s; its last moments are drawn on at its own deceleration.
const CREEP_MPS: f64 = 0.25;
/// Length of the stretch whose deceleration is drawn on, s.
const LAST_S: f64 = 0.15;
/// A car about to stand loses at least this, m/s^2.
const LEAST_DECELERATION: f64 = 0.3;
/// One sigma of where in a swaying stop the car stands, s.
const STOP_SD_S: f64 = 0.05;

/// The final rest.
#[derive(Clone, Debug, PartialEq)]
pub struct FinalRest {
    /// When the car last moved over the ground, seconds from the trigger.
    pub stop_t_s: Figure,
    /// From there to the end of the record, s.
    pub duration_s: f64,
    /// Roll at rest, degrees.
    pub roll_deg: Figure,
    /// Pitch at rest, degrees.
    pub pitch_deg: Figure,
    /// Heading at rest, degrees: 0 by definition without a rest pose.
    pub heading_deg: Figure,
    /// `wheels`, `roof`, `left side`, `right side`, `nose` or `tail`.
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
    let sd = |i: usize| {
        let row = jacobian.row(i).into_owned();
        (row * att * row.transpose())[0]
            .max(0.0)
            .sqrt()
            .to_degrees()
    };
    let end = list.last().map_or(0.0, |e| e.t_s);
    Some(FinalRest {
        stop_t_s: stop,
        duration_s: end - stop.value,
        roll_deg: Figure::new(roll.to_degrees(), sd(0), q),
        pitch_deg: Figure::new(pitch.to_degrees(), sd(1), q),
        heading_deg: Figure::new(heading.to_degrees().rem_euclid(360.0), 0.0, q),
        lies_on: lies_on(&lying.nav),
        from_impact: from_impact(evidence, rest, states, &stop),
    })
}

/// When the car stands: the last moment above a creep, drawn on by the deceleration there.
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
    let v = p[(3, 3)].max(p[(4, 4)]).max(0.0).sqrt();
    let on = speed(k) / loss;
    // How the last bit of speed is lost is not known: a third of the time it takes.
    let sd = (v / loss).hypot(STOP_SD_S).hypot(on / 3.0);
    Figure::new(list[k].t_s + on, sd, q)
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
        path_m: way(states, pulse.onset_s, stop.value, q),
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
