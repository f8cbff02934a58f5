//! What a stand tells: no velocity, gravity alone, and the gyros' bias.

use nalgebra::Vector3;

use super::{GATE, Runner, turn_of};
use crate::refined::measure;

/// Standstill, one sigma of one use, m/s.
const STAND_SPEED_SD: f64 = 0.02;
/// Time between two uses of standstill, s.
pub(super) const STAND_INTERVAL_S: f64 = 0.2;
/// Time at either end of a stand in which the car may rock or still or already roll, s: the detector hears that no better.
/// Speed, force and rate count the less the nearer the end, see [`near`].
const SPRINGS_S: f64 = 1.5;
/// Speed that the detector may take for a stand, m/s, one sigma at its very end: a car creeps that fast on a smooth road.
const CREEP_SD: f64 = 0.3;
/// What it brakes or pulls off with there, m/s^2, and how fast its body nods as it pulls off, rad/s.
const PULL_SD: f64 = 0.5;
const NOD_SD: f64 = 0.01;
/// What the body of a standing car turns, rad/s.
const STILL_RATE_SD: f64 = 5e-4;
/// Mean of a level accelerometer at rest beside its noise, m/s^2.
const LEVEL_SD: f64 = 0.02;
impl Runner<'_> {
    /// Time from `k` to the nearer end of its stand, s, up to [`SPRINGS_S`]; the end of the drive is one.
    fn edge(&self, k: usize) -> f64 {
        let t_s = self.drive.periods[k].t_s;
        let left = self.drive.periods[k..]
            .iter()
            .zip(&self.standing[k..])
            .take_while(|(p, still)| **still && p.t_s < t_s + SPRINGS_S)
            .last()
            .map_or(0.0, |(p, _)| p.t_s + p.dt - t_s);
        self.stood_s.min(left).min(SPRINGS_S)
    }

    /// Zero velocity; the mean force since the last use is gravity; once the springs are still, the mean rate is the gyros'
    /// bias.
    pub(super) fn stand(&mut self, k: usize) {
        let near = near(self.edge(k));
        for axis in 0..3 {
            let z = measure::standstill(
                &self.run.nominal,
                axis,
                STAND_SPEED_SD.hypot(CREEP_SD * near),
            );
            self.run.apply(&z, f64::INFINITY);
        }
        self.turned = turn_of(&self.run.nominal);
        let from = self.drive.periods[..=k]
            .iter()
            .rposition(|p| p.t_s <= self.drive.periods[k].t_s - STAND_INTERVAL_S + 1e-6)
            .map_or(0, |i| i + 1);
        let window = &self.drive.periods[from..=k];
        let n = schema::num::real(window.len());
        let accel = window.iter().map(|p| p.accel).sum::<Vector3<f64>>() / n;
        let rate = window.iter().map(|p| p.rate).sum::<Vector3<f64>>() / n;
        for axis in 0..3 {
            let sd = (self.sheet.still_accel[axis] / n.sqrt())
                .hypot(LEVEL_SD)
                .hypot(PULL_SD * near);
            let z = measure::levelling(&self.run.nominal, &accel, self.earth.gravity, axis, sd);
            self.bind(z, 4.0 * GATE);
        }
        if self.stood_s < SPRINGS_S {
            return;
        }
        for axis in 0..3 {
            let found = self.run.nominal.rate(&rate, &self.earth).v[axis];
            let sd = (self.sheet.still_rate[axis] / n.sqrt())
                .hypot(STILL_RATE_SD)
                .hypot(NOD_SD * near);
            let z = measure::rest_rate(found, axis, sd);
            self.bind(z, 4.0 * GATE);
        }
    }
}

/// How much of what a car may do at the very end of a stand counts `edge` s from it. The uses near an end are wrong
/// together: each is a share of one.
fn near(edge: f64) -> f64 {
    (1.0 - edge / SPRINGS_S).max(0.0) * (SPRINGS_S / STAND_INTERVAL_S).sqrt()
}
