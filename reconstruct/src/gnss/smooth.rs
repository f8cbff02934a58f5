//! Every instant of a drive from all of its data: the sweep of [`crate::smooth::rts`] over a forward pass.

use super::forward::{Estimate, Passed, estimate};
use crate::error_model::STATES;
use crate::refined::states::{BG, Row};
use crate::smooth::rts::Adjoint;

/// The smoothed states, in order of time, one each period of the pass.
#[must_use]
pub fn smooth(passed: &Passed) -> Vec<Estimate> {
    let tape = &passed.tape;
    let mut adjoint = Adjoint::last();
    let mut out = passed.estimates.clone();
    for i in (0..tape.steps.len()).rev() {
        let step = &tape.steps[i];
        let nominal = adjoint.nominal(&step.nominal, &step.p);
        let p = adjoint.covariance::<STATES>(&step.p);
        let bias = [0, 1, 2].map(|axis| {
            let mut row = Row::zeros();
            row[BG + axis] = 1.0;
            adjoint.variance(&step.p, &row)
        });
        let filtered = &passed.estimates[i];
        out[i] = Estimate {
            standing: filtered.standing,
            fixed: filtered.fixed,
            ..estimate(
                filtered.t_s,
                &passed.anchors[i],
                &nominal,
                &p,
                bias,
                passed.mounting_roll,
            )
        };
        adjoint.retreat(tape, i);
    }
    out
}
