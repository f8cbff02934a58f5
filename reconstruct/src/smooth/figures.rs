//! The figures of an error budget, as linear functions of the errors.

use nalgebra::Vector3;

use super::batch::Batch;
use super::budget::{Budget, Linear, budget};
use super::problem::Problem;
use super::relinear::Ground;
use crate::error::ReconstructError;
use crate::error_model::{ATT, POS, STATES, VEL};
use crate::funnel::speed_row;
use crate::refined::states::{Nominal, Row};

/// Time before the event at which the position is looked at beside the record's start, s.
const BEFORE_S: f64 = -5.0;

fn velocity(axis: &Vector3<f64>) -> Row {
    let mut a = Row::zeros();
    a.fixed_rows_mut::<3>(VEL).copy_from(axis);
    a
}

/// Along the path and across it, to the right.
fn place(name: &str, stage: usize, nominal: &Nominal) -> [Linear; 2] {
    let v = nominal.nav.v_n.v.xy();
    let ahead = v.try_normalize(0.5).unwrap_or_else(|| {
        let x = nominal.nav.c_nb.m.column(0).into_owned();
        x.xy()
            .try_normalize(1e-6)
            .unwrap_or_else(nalgebra::Vector2::x)
    });
    [
        ("along the path", [ahead.x, ahead.y]),
        ("across the path", [-ahead.y, ahead.x]),
    ]
    .map(|(which, axis)| {
        let mut a = Row::zeros();
        a[POS] = axis[0];
        a[POS + 1] = axis[1];
        Linear {
            name: format!("position {which} {name}"),
            terms: vec![(stage, a)],
        }
    })
}

fn heading(name: &str, stage: usize, nominal: &Nominal) -> Linear {
    let mut a = Row::zeros();
    let row = nominal.nav.c_nb.euler_jacobian().row(2).transpose();
    a.fixed_rows_mut::<3>(ATT).copy_from(&row);
    Linear {
        name: format!("heading {name}"),
        terms: vec![(stage, a)],
    }
}

/// Impact speed, delta-V at the IMU, heading and position at the first impact; position at -5 s; position and heading at the start of the record. Figures whose
/// epoch the pass did not reach are left out.
#[must_use]
pub fn figures(ground: &Ground<'_>, problem: &Problem, trajectory: &[Nominal]) -> Vec<Linear> {
    let setup = ground.given.setup;
    let list = &setup.reversed.forward().list;
    let at = |k: usize| problem.stages.iter().position(|s| s.k == k);
    let mut out = Vec::new();
    let pulse = setup.motion.impacts.first();
    if let Some((before, pulse)) = pulse.and_then(|p| at(p.before).map(|i| (i, p))) {
        let nominal = &trajectory[before];
        let mut speed = Row::zeros();
        speed
            .fixed_rows_mut::<STATES>(0)
            .copy_from(&speed_row(&nominal.nav));
        out.push(Linear {
            name: "impact speed".to_owned(),
            terms: vec![(before, speed)],
        });
        if let Some(last) = at(pulse.last).filter(|last| *last < before) {
            let change = trajectory[last].nav.v_n.v - nominal.nav.v_n.v;
            for (axis, name) in ["longitudinal", "lateral"].into_iter().enumerate() {
                let a: Vector3<f64> = nominal.nav.c_nb.m.column(axis).into_owned();
                let mut early = velocity(&-a);
                early.fixed_rows_mut::<3>(ATT).copy_from(&-a.cross(&change));
                out.push(Linear {
                    name: format!("delta-V {name}"),
                    terms: vec![(last, velocity(&a)), (before, early)],
                });
            }
        }
        out.push(heading("at impact", before, nominal));
        out.extend(place("at impact", before, nominal));
    }
    let early = list
        .partition_point(|e| e.t_s <= BEFORE_S + 1e-9)
        .checked_sub(1)
        .and_then(at);
    if let Some(i) = early {
        out.extend(place("at -5 s", i, &trajectory[i]));
    }
    if let Some(i) = trajectory.len().checked_sub(1) {
        out.extend(place("at the start", i, &trajectory[i]));
        out.push(heading("at the start", i, &trajectory[i]));
    }
    out
}

impl Batch {
    /// The error budgets of [`figures`].
    ///
    /// # Errors
    /// As [`budget`].
    pub fn budgets(&self, ground: &Ground<'_>) -> Result<Vec<Budget>, ReconstructError> {
        figures(ground, &self.problem, &self.trajectory)
            .iter()
            .map(|f| budget(ground, &self.problem, &self.factor, &self.trajectory, f))
            .collect()
    }
}
