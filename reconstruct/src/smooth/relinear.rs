//! The problem about another trajectory than the pass' own: every step mechanised again, every row predicted again.
//!
//! What was measured, how it was weighed and what was refused stays as the pass decided: a row's residual is that of the
//! tape plus the change of its prediction, so no figure of the pass is repeated here.

use nalgebra::{Matrix3, Vector3};

use super::problem::{Measured, Problem, Stage};
use crate::anchor::rows::{self, Doing};
use crate::constraint::Geometry;
use crate::error_model::{ATT, POS, STATES, VEL};
use crate::mechanize::backward;
use crate::refined::measure::{self, Scalar, WheelFrame};
use crate::refined::pass::{Given, Passed};
use crate::refined::states::{Nominal, PARAMS, Row, SLIP, WHEEL_LEFT};
use crate::refined::tape::{Linear, Source, Step};
use crate::refined::transition::Transition;

/// What a problem is made of.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// Record, rest, figures.
    pub given: Given<'a>,
    /// Tape and samples.
    pub passed: &'a Passed,
}

/// Rotation vector of a rotation.
fn log_so3(c: &Matrix3<f64>) -> Vector3<f64> {
    let axis = Vector3::new(c.m32 - c.m23, c.m13 - c.m31, c.m21 - c.m12) * 0.5;
    let (sine, cosine) = (axis.norm(), 0.5 * (c.trace() - 1.0));
    let angle = sine.atan2(cosine);
    if sine > 1e-8 {
        axis * (angle / sine)
    } else {
        axis
    }
}

/// The correction that leads from one nominal to another: `from.corrected(x) == to`.
#[must_use]
pub fn correction(from: &Nominal, to: &Nominal) -> Row {
    let mut x = Row::zeros();
    x.fixed_rows_mut::<3>(POS)
        .copy_from(&(from.nav.r_n - to.nav.r_n).v);
    x.fixed_rows_mut::<3>(VEL)
        .copy_from(&(from.nav.v_n - to.nav.v_n).v);
    let turn = to.nav.c_nb.m * from.nav.c_nb.m.transpose();
    x.fixed_rows_mut::<3>(ATT).copy_from(&log_so3(&turn));
    let cal = to.cal - from.cal;
    x.fixed_rows_mut::<PARAMS>(STATES).copy_from(&cal);
    x
}

impl Ground<'_> {
    /// The nominal before each measurement of a step, and before all of them.
    fn before(&self, step: &Step) -> Vec<Nominal> {
        let mut nominal = step.nominal;
        let mut out: Vec<Nominal> = self.passed.tape.linear[step.measurements.clone()]
            .iter()
            .rev()
            .map(|z| {
                nominal = nominal.corrected(&(z.gain * -z.residual));
                nominal
            })
            .collect();
        out.reverse();
        if out.is_empty() {
            out.push(step.nominal);
        }
        out
    }

    /// The problem about `trajectory`, one nominal a step in the order of the pass.
    #[must_use]
    pub fn problem(&self, trajectory: &[Nominal]) -> Problem {
        let tape = &self.passed.tape;
        let mut rows = Vec::with_capacity(tape.linear.len());
        let mut stages: Vec<Stage> = Vec::with_capacity(tape.steps.len());
        for (i, (step, here)) in tape.steps.iter().zip(trajectory).enumerate() {
            let before = self.before(step);
            let from = rows.len();
            let linear = &tape.linear[step.measurements.clone()];
            let mut levelled = 0;
            for (z, old) in linear.iter().zip(&before) {
                let axis = levelled;
                levelled += usize::from(z.source == Source::Levelling);
                rows.push(self.row(step.k, z, axis, old, here));
            }
            let (transition, missed) = match (&step.transition, i.checked_sub(1)) {
                (Some(transition), Some(last)) => {
                    let (transition, next) =
                        self.step(tape.steps[last].k, &trajectory[last], transition);
                    (Some(transition), next)
                }
                _ => (None, before[0]),
            };
            stages.push(Stage {
                k: step.k,
                transition,
                offset: correction(&missed, here),
                rows: from..rows.len(),
                bounds: Vec::new(),
            });
        }
        Problem {
            prior: tape.prior,
            stages,
            rows,
        }
    }

    /// From the end of epoch `k` to its start: the step about a nominal and where it leads.
    fn step(&self, k: usize, from: &Nominal, transition: &Transition) -> (Transition, Nominal) {
        let mut next = *from;
        next.cal[SLIP - STATES] *= transition.decay();
        if transition.stands() {
            return (*transition, next);
        }
        let setup = self.given.setup;
        let inputs = &self.passed.inputs;
        let f_b = from.moving_force(&inputs.accel[k]);
        let w_b = from.rate(&inputs.rate[k], &setup.earth);
        let dt = setup.reversed.forward().list[k].dt;
        let (nav, view) = backward(&from.nav, f_b, w_b, dt, &setup.earth);
        next.nav = nav;
        (transition.about(&view, &f_b, &w_b), next)
    }

    fn row(&self, k: usize, z: &Linear, axis: usize, old: &Nominal, here: &Nominal) -> Measured {
        let mut out = Measured {
            source: z.source,
            h: z.h,
            residual: z.residual - z.h.dot(&correction(old, here)),
            r: z.r,
            weight: 1.0,
        };
        if let Some((was, is)) = self.fix(k, z, old, here) {
            out.residual = z.residual + is.residual - was;
            out.h = is.h;
        } else if let (Some((was, _)), Some((is, h))) = (
            self.predicted(k, z, axis, old),
            self.predicted(k, z, axis, here),
        ) {
            out.residual = z.residual + is - was;
            out.h = h;
        }
        out
    }

    /// Residual of a row of a satellite fix about `old`, where the pass had it, and the same row about `here`.
    fn fix(&self, k: usize, z: &Linear, old: &Nominal, here: &Nominal) -> Option<(f64, Scalar)> {
        let setup = self.given.setup;
        let anchor = setup.anchor.filter(|_| z.source == Source::Fix)?;
        let (accel, rate) = (&self.passed.inputs.accel[k], &self.passed.inputs.rate[k]);
        let standing = self.passed.stands.iter().any(|s| s.range.contains(&k));
        let doing = |n: &Nominal| Doing::of(n, standing, accel, rate, &setup.earth);
        let all = |n: &Nominal| -> Vec<Scalar> {
            let doing = doing(n);
            anchor
                .at(k)
                .iter()
                .flat_map(|fix| {
                    let velocity = rows::velocity(n, &doing, anchor, fix);
                    let place = rows::place(n, &doing, anchor, fix);
                    place.into_iter().chain(velocity.into_iter().flatten())
                })
                .collect()
        };
        // The pass refused some: the row is known by its sensitivities and its residual.
        let was = all(old);
        let off = |row: &Scalar| (row.h - z.h).norm() + (row.residual - z.residual).abs();
        let (number, row) = was
            .iter()
            .enumerate()
            .min_by(|a, b| off(a.1).total_cmp(&off(b.1)))?;
        Some((row.residual, *all(here).get(number)?))
    }

    /// Prediction of a row about a nominal, up to a constant, and its sensitivity; `None` for one that is linear as it is.
    fn predicted(&self, k: usize, z: &Linear, axis: usize, n: &Nominal) -> Option<(f64, Row)> {
        let setup = self.given.setup;
        let epochs = setup.reversed.forward();
        let geometry = Geometry::new(&epochs.header.vehicle);
        let rate = || n.rate(&self.passed.inputs.rate[k], &setup.earth).v;
        let scalar = match z.source {
            Source::Rest | Source::RestRate | Source::Fix => return None,
            Source::Levelling => {
                let accel = self.stand_accel(k)?;
                measure::levelling(n, &accel, setup.earth.gravity, axis, 1.0)
            }
            Source::Wheel => {
                let side = usize::from(z.h[WHEEL_LEFT] == 0.0);
                let frame = WheelFrame {
                    side,
                    speed: 0.0,
                    age_s: 0.5 * epochs.list[k].dt,
                    accel: setup.motion.smooth[k].x,
                    variance: 0.0,
                };
                measure::wheel(n, &rate(), &geometry, &frame)
            }
            Source::SideSlip => {
                measure::side_slip(n, &rate(), &geometry, setup.motion.smooth[k].y, 0.0)
            }
            Source::Jump => measure::no_jump(n, &rate(), &geometry, 0.0),
            Source::Road => {
                let jacobian = n.nav.c_nb.euler_jacobian();
                let off =
                    |i: usize| (z.h.fixed_rows::<3>(ATT) - jacobian.row(i).transpose()).norm();
                measure::road(n, usize::from(off(1) < off(0)), 0.0, 1.0)
            }
        };
        Some((scalar.residual, scalar.h))
    }

    /// Mean specific force of the stand that ends with epoch `k`.
    fn stand_accel(&self, k: usize) -> Option<Vector3<f64>> {
        let rest = self.given.rest;
        if k == self.given.setup.start.k && rest.found() {
            return Some(rest.accel);
        }
        let stands = &self.passed.stands;
        stands
            .iter()
            .find(|s| s.range.end == k + 1)
            .map(|s| s.accel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::exp_so3;

    #[test]
    fn logarithm_undoes_the_exponential() {
        for v in [
            [0.0, 0.0, 0.0],
            [1e-9, 2e-9, 0.0],
            [0.3, -0.2, 0.1],
            [0.0, 0.0, 3.0],
        ] {
            let v = Vector3::from(v);
            assert!((log_so3(&exp_so3(&v)) - v).norm() < 1e-12, "{v}");
        }
    }
}
