//! What a trajectory cannot be: steeper than the road, faster than a wheel that reads nothing, softer than a sensor's limit.
//!
//! Each limit is one-sided and acts where the trajectory crosses it: the row then pulls to the limit with a narrow
//! standard deviation (a penalty that is quadratic beyond the limit, chosen anew at every linearisation). Such a row is no
//! measurement: at a hundred samples a second it would count one fact thousands of times. So the limits move the
//! *trajectory*, and its covariance is that without them, which is the wider one.

use nalgebra::{SVector, Vector3};

use super::problem::{Bound, LOCAL, Measured, Problem};
use super::relinear::Ground;
use crate::constraint::Geometry;
use crate::error_model::{ATT, VEL};
use crate::refined::measure::{self, WheelFrame};
use crate::refined::states::{Nominal, Row};
use crate::refined::tape::Source;

/// How closely a limit is kept: angle, rad; vertical speed, m/s; wheel, m/s; specific force, m/s^2; rate, rad/s.
const ANGLE_SD: f64 = 5e-4;
const VERTICAL_SD: f64 = 0.01;
const WHEEL_SD: f64 = 0.02;
const FORCE_SD: f64 = 0.2;
const RATE_SD: f64 = 2e-3;
/// What the springs add to the road's angles, rad, and to the vertical speed, m/s: as where states are reported.
const SPRING: f64 = 1.5 * std::f64::consts::PI / 180.0;
const VERTICAL: f64 = 0.1;
/// A wheel that reads nothing at a car this much faster than its cut-off is dead, m/s.
const DEAD: f64 = 1.0;

/// Where limits held the trajectory: numbers of epochs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LimitUse {
    /// Roll.
    pub roll: u64,
    /// Pitch.
    pub pitch: u64,
    /// Vertical speed.
    pub vertical: u64,
    /// Wheels below their cut-off.
    pub wheel: u64,
    /// Samples at a sensor's limit.
    pub clipped: u64,
}

impl LimitUse {
    /// All together.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.roll + self.pitch + self.vertical + self.wheel + self.clipped
    }
}

/// The problem with a row for each limit that `trajectory` nears or crosses, `soft` times less closely than it is to be
/// kept; `None` where it nears none.
pub(crate) fn hold(
    ground: &Ground<'_>,
    problem: &Problem,
    trajectory: &[Nominal],
    soft: f64,
) -> (LimitUse, Option<Problem>) {
    let mut used = LimitUse::default();
    let mut extra: Vec<(usize, Vec<Measured>, Vec<Bound>)> = Vec::new();
    for (i, (stage, nominal)) in problem.stages.iter().zip(trajectory).enumerate() {
        let bounds = clipped(ground, problem, trajectory, (i, soft), &mut used);
        let mut rows = Vec::new();
        road(ground, (stage.k, soft), nominal, &mut rows, &mut used);
        // A stand is told to stand still already.
        if stage.transition.is_some_and(|t| !t.stands()) {
            wheels(ground, (stage.k, soft), nominal, &mut rows, &mut used);
        }
        if !(rows.is_empty() && bounds.is_empty()) {
            extra.push((i, rows, bounds));
        }
    }
    if extra.is_empty() {
        return (used, None);
    }
    let mut held = problem.clone();
    held.rows.clear();
    let mut extra = extra.into_iter().peekable();
    for (i, stage) in held.stages.iter_mut().enumerate() {
        let from = held.rows.len();
        held.rows
            .extend_from_slice(&problem.rows[stage.rows.clone()]);
        if let Some((_, rows, bounds)) = extra.next_if(|e| e.0 == i) {
            held.rows.extend(rows);
            stage.bounds = bounds;
        }
        stage.rows = from..held.rows.len();
    }
    (used, Some(held))
}

/// A row of more weight than this bears on the trajectory.
const CROSSED: f64 = 0.05;

/// Residual and weight of a one-sided row whose value is `v` beyond its limit, all in standard deviations: quadratic far
/// beyond it, nothing far within it, and between them a cubic, so that a row joins and leaves by degrees.
fn one_sided(v: f64) -> Option<(f64, f64)> {
    if v <= -1.0 {
        None
    } else if v < 1.0 {
        let half = 0.5 * (v + 1.0);
        Some((half, half))
    } else {
        Some((v, 1.0))
    }
}

/// `value` at or beyond `top` on either side, as a row that pulls it back.
fn beyond(source: Source, value: f64, top: f64, h: &Row, sd: f64) -> Option<Measured> {
    let (residual, weight) = one_sided((value.abs() - top) / sd)?;
    Some(Measured {
        source,
        h: *h,
        residual: (residual * sd).copysign(value),
        r: sd * sd,
        weight,
    })
}

fn road(
    ground: &Ground<'_>,
    (k, soft): (usize, f64),
    nominal: &Nominal,
    rows: &mut Vec<Measured>,
    used: &mut LimitUse,
) {
    let setup = ground.given.setup;
    let Some(road) = setup.road else { return };
    let t_s = setup.reversed.forward().list[k].t_s;
    if setup
        .motion
        .impacts
        .first()
        .is_some_and(|p| t_s > p.onset_s - road.hold_off_s)
    {
        return;
    }
    for (index, top) in [road.roll_deg, road.pitch_deg].into_iter().enumerate() {
        let z = measure::road(nominal, index, 0.0, 1.0);
        let top = top.to_radians() + SPRING;
        if let Some(row) = beyond(Source::Road, z.residual, top, &z.h, ANGLE_SD * soft) {
            *(if index == 0 {
                &mut used.roll
            } else {
                &mut used.pitch
            }) += u64::from(row.weight > CROSSED);
            rows.push(row);
        }
    }
    let v = &nominal.nav.v_n.v;
    let top = v.xy().norm() * road.pitch_deg.to_radians().sin() + VERTICAL;
    let mut h = Row::zeros();
    h[VEL + 2] = 1.0;
    if let Some(row) = beyond(Source::Road, v.z, top, &h, VERTICAL_SD * soft) {
        used.vertical += u64::from(row.weight > CROSSED);
        rows.push(row);
    }
}

/// A wheel that reads less than it can tell turns no faster than its cut-off.
fn wheels(
    ground: &Ground<'_>,
    (k, soft): (usize, f64),
    nominal: &Nominal,
    rows: &mut Vec<Measured>,
    used: &mut LimitUse,
) {
    let setup = ground.given.setup;
    let epochs = setup.reversed.forward();
    let header = &epochs.header;
    let cutoff = header.wheels.cutoff_mps.max(header.wheel_scale.step);
    if setup.motion.wheels_bad[k] || setup.motion.after_impact[k] {
        return;
    }
    let rate = nominal.rate(&ground.passed.inputs.rate[k], &setup.earth).v;
    let geometry = Geometry::new(&header.vehicle);
    for side in 0..2 {
        if epochs.list[k].wheels[side].is_none_or(|speed| speed >= cutoff) {
            continue;
        }
        let frame = WheelFrame {
            side,
            speed: cutoff,
            age_s: 0.5 * epochs.list[k].dt,
            accel: setup.motion.smooth[k].x,
            variance: 0.0,
        };
        let z = measure::wheel(nominal, &rate, &geometry, &frame);
        if z.residual > DEAD + cutoff {
            continue;
        }
        let sd = WHEEL_SD * soft;
        if let Some((residual, weight)) = one_sided(z.residual / sd) {
            used.wheel += u64::from(weight > CROSSED);
            rows.push(Measured {
                source: Source::Wheel,
                h: z.h,
                residual: residual * sd,
                r: sd * sd,
                weight,
            });
        }
    }
}

/// Behind a sensor's limit the truth lies beyond it: the mean of a bin is at least as large as its clipped mean.
fn clipped(
    ground: &Ground<'_>,
    problem: &Problem,
    trajectory: &[Nominal],
    (i, soft): (usize, f64),
    used: &mut LimitUse,
) -> Vec<Bound> {
    let (Some(last), stage) = (i.checked_sub(1), &problem.stages[i]) else {
        return Vec::new();
    };
    if stage.transition.is_none_or(|t| t.stands()) {
        return Vec::new();
    }
    let k = problem.stages[last].k;
    let epoch = &ground.given.setup.reversed.forward().list[k];
    let inputs = &ground.passed.inputs;
    let c = &trajectory[last].nav.c_nb.m;
    let mut bounds = Vec::new();
    for (axis, share) in epoch.clipped.iter().enumerate() {
        if *share == 0.0 {
            continue;
        }
        let column: Vector3<f64> = c.column(axis % 3) / epoch.dt;
        // What was taken is the truth and an error of `-C' w / dt` (force) or `C' w / dt` (rate).
        let (at, column, value, sd) = if axis < 3 {
            (
                VEL,
                column,
                epoch.accel[axis] - inputs.accel[k][axis],
                FORCE_SD,
            )
        } else {
            let j = axis - 3;
            (ATT, -column, epoch.rate[j] - inputs.rate[k][j], RATE_SD)
        };
        let mut a = SVector::<f64, LOCAL>::zeros();
        a.fixed_rows_mut::<3>(at).copy_from(&column);
        let noise = column.dot(&stage.offset.fixed_rows::<3>(at));
        let (side, sd) = (share.signum(), sd * soft);
        if let Some((residual, weight)) = one_sided((value - noise) * side / sd) {
            used.clipped += u64::from(weight > CROSSED);
            bounds.push(Bound {
                a,
                value: noise + residual * sd * side,
                sd: sd / weight.sqrt(),
            });
        }
    }
    bounds
}
