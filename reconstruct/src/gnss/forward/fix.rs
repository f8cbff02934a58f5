//! What a fix tells: place and velocity, with the share of news that its distance from the last one gives.

use nalgebra::Vector3;

use super::{Fate, GATE, Runner, turn_of};
use crate::error_model::{ATT, POS, VEL};
use crate::frame::{skew, wrapped};
use crate::gnss::drive::{Fixed, Headed};
use crate::refined::measure::Scalar;
use crate::refined::running::Running;
use crate::refined::states::{PLACE, Row};
use crate::refined::tape::Source;

/// Refusals of a position, or of a velocity, in a row after which it is taken in with its residual as noise: a filter must not lock itself out.
const PATIENCE: u32 = 3;

/// Square of an innovation in units of its variance.
fn square(run: &Running, z: &Scalar) -> f64 {
    z.residual.powi(2) / (z.h.dot(&(run.p * z.h)) + z.r)
}

impl Runner<'_> {
    /// Position and velocity of a fix, true `age` before the state.
    pub(super) fn fix(&mut self, fix: &Fixed, t_s: f64) {
        self.use_of.offered += 1;
        let age = t_s - fix.t_s;
        let lever = self.run.nominal.nav.c_nb.m * self.sheet.antenna;
        let wanted = self.anchor.to(&fix.place);
        let sd = fix.place_sd.zip_map(&self.sheet.fix_floor, f64::max);
        let share = self.sheet.fix_correlated;
        let inflate = self.inflate;
        let row = |run: &Running, axis: usize| {
            let nav = &run.nominal.nav;
            let shared = share.sqrt() * sd[axis];
            let mut h = Row::zeros();
            h[POS + axis] = 1.0;
            h[VEL + axis] = -age;
            h[PLACE + axis] = -shared;
            h.fixed_rows_mut::<3>(ATT)
                .copy_from(&skew(&lever).row(axis).transpose());
            Scalar {
                source: Source::Fix,
                residual: nav.r_n.v[axis] + lever[axis] - nav.v_n.v[axis] * age
                    + shared * run.nominal.value(PLACE + axis)
                    - wanted[axis],
                h,
                r: sd[axis].powi(2) * (inflate - share),
            }
        };
        let mut worst: f64 = 0.0;
        for axis in 0..3 {
            worst = worst.max(square(&self.run, &row(&self.run, axis)));
        }
        let forced = worst > GATE && self.refused >= PATIENCE;
        if worst > GATE && !forced {
            self.refused += 1;
            self.use_of.refused += 1;
            self.fates.push((fix.t_s, Fate::Refused));
        } else {
            self.refused = 0;
            self.use_of.forced += u64::from(forced);
            self.use_of.used += u64::from(!forced);
            let fate = if forced { Fate::Forced } else { Fate::Used };
            self.fates.push((fix.t_s, fate));
            for axis in 0..3 {
                let mut z = row(&self.run, axis);
                if forced {
                    z.r += z.residual.powi(2);
                }
                self.run.apply(&z, f64::INFINITY);
            }
        }
        self.adapt(worst);
        self.fix_velocity(fix, age);
        self.turned = turn_of(&self.run.nominal);
    }

    /// The noise of fixes grows where they jump more than they say, and comes back. The largest of three squares of one
    /// sigma is 2.4 in the mean.
    fn adapt(&mut self, worst: f64) {
        let off = (worst / 2.4 - 1.0).clamp(-0.5, 4.0);
        self.inflate = (self.inflate * (1.0 + 0.2 * off)).clamp(1.0, 25.0);
    }

    fn fix_velocity(&mut self, fix: &Fixed, age: f64) {
        let Some(v_n) = fix.v_n else {
            return;
        };
        // The car's acceleration takes the velocity back to the fix's instant.
        let k = self
            .drive
            .periods
            .partition_point(|p| p.t_s < fix.t_s)
            .min(self.drive.periods.len() - 1);
        let period = &self.drive.periods[k];
        let nominal = &self.run.nominal;
        let f_n = nominal.nav.c_nb.m * nominal.moving_force(&period.accel).v;
        let a_n = f_n + Vector3::new(0.0, 0.0, self.earth.gravity);
        let rate = nominal.rate(&period.rate, &self.earth).v;
        let lever = nominal.nav.c_nb.m * rate.cross(&self.sheet.antenna);
        let sd = fix.v_sd.zip_map(&self.sheet.fix_speed_floor, f64::max);
        let inflate = self.inflate;
        let row = |run: &Running, axis: usize| {
            let mut h = Row::zeros();
            h[VEL + axis] = 1.0;
            h.fixed_rows_mut::<3>(ATT)
                .copy_from(&skew(&lever).row(axis).transpose());
            Scalar {
                source: Source::Fix,
                residual: run.nominal.nav.v_n.v[axis] + lever[axis] - a_n[axis] * age - v_n[axis],
                h,
                r: sd[axis].powi(2) * inflate + (0.3 * age).powi(2),
            }
        };
        // Of a velocity that is not the car's one part may fit by chance: all go in or none.
        let worst = (0..3)
            .map(|axis| square(&self.run, &row(&self.run, axis)))
            .fold(0.0, f64::max);
        let forced = worst > GATE && self.speeds_refused >= PATIENCE;
        if worst > GATE && !forced {
            self.speeds_refused += 1;
            self.use_of.speeds_refused += 1;
            return;
        }
        self.speeds_refused = 0;
        self.use_of.speeds_forced += u64::from(forced);
        if forced {
            // So many in a row are right and the state is not, and with the velocity the heading and the place.
            let off = Vector3::from_fn(|axis, _| row(&self.run, axis).residual);
            self.reopen(&off);
        }
        for axis in 0..3 {
            let z = row(&self.run, axis);
            self.run.apply(&z, f64::INFINITY);
        }
    }

    /// Velocity and heading are unsure by so much, m/s, and the place by what that made since it was last agreed with.
    fn reopen(&mut self, off: &Vector3<f64>) {
        let speed = self.run.nominal.nav.v_n.v.xy().norm();
        let since = f64::from(self.refused.max(PATIENCE));
        for axis in 0..3 {
            self.run.p[(VEL + axis, VEL + axis)] += off[axis].powi(2);
            self.run.p[(POS + axis, POS + axis)] += (off[axis] * since).powi(2);
        }
        let turn = off.xy().norm() / speed.max(off.xy().norm()).max(1.0);
        self.run.p[(ATT + 2, ATT + 2)] += turn.powi(2);
    }

    /// Where north is, from elsewhere.
    pub(super) fn heading(&mut self, headed: &Headed, k: usize) {
        let period = &self.drive.periods[k];
        let nominal = &self.run.nominal;
        let (_, _, heading) = nominal.nav.c_nb.euler();
        let since = nominal.rate(&period.rate, &self.earth).v.z * (period.t_s - headed.t_s);
        let mut h = Row::zeros();
        h.fixed_rows_mut::<3>(ATT)
            .copy_from(&nominal.nav.c_nb.euler_jacobian().row(2).transpose());
        let z = Scalar {
            source: Source::Fix,
            residual: wrapped(heading - since - headed.heading),
            h,
            r: headed.sd.powi(2),
        };
        self.run.apply(&z, f64::INFINITY);
        self.turned = turn_of(&self.run.nominal);
    }
}
