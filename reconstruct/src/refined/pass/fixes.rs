//! Satellite fixes in the pass.

use super::Runner;
use crate::anchor::Anchor;
use crate::anchor::rows::{self, Doing};
use crate::refined::measure::Scalar;
use crate::refined::running::Running;

/// Gate of one axis of a satellite fix, chi-square with one degree.
const FIX_GATE: f64 = 16.0;

impl Runner<'_> {
    /// Satellite fixes of epoch `k`: place, and velocity where there is one.
    pub(super) fn fixes(&mut self, k: usize, anchor: &Anchor, standing: bool) {
        let setup = self.given.setup;
        for fix in anchor.at(k) {
            let nominal = &self.run.nominal;
            let (accel, rate) = (&self.inputs.accel[k], &self.inputs.rate[k]);
            let doing = Doing::of(nominal, standing, accel, rate, &setup.earth);
            let off = |run: &Running, z: &Scalar| {
                z.residual.powi(2) > FIX_GATE * (z.h.dot(&(run.p * z.h)) + z.r)
            };
            let place = rows::place(nominal, &doing, anchor, fix);
            if place.iter().any(|z| off(&self.run, z)) {
                self.fixes_refused.push(fix.number);
                continue;
            }
            for i in 0..2 {
                let z = rows::place(&self.run.nominal, &doing, anchor, fix)[i];
                self.run.apply(&z, f64::INFINITY);
            }
            for i in 0..2 {
                if let Some(z) = rows::velocity(&self.run.nominal, &doing, anchor, fix) {
                    self.run.apply(&z[i], FIX_GATE);
                }
            }
        }
    }
}
