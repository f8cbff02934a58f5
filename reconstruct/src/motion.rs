//! A first look at the motion: attitude from the gyros alone, acceleration free of gravity, and from them the
//! pulses and the stretches in which a sensor must not be believed.

#![allow(
    clippy::needless_range_loop,
    reason = "the index is an epoch or a row of several arrays at once"
)]

mod edges;

use nalgebra::Vector3;
use schema::num::real;
use schema::parts::{Trigger, TriggerKind};

use crate::epochs::{Epochs, Reversed};
use crate::frame::{Body, Nav, Rot, Vec3, exp_so3};
use crate::mechanize::free_of_gravity;
use crate::start::Start;

/// Length of the mean that tells braking and cornering from vibration, s.
pub(crate) const SMOOTH_S: f64 = 0.25;
/// Onset and end of a pulse: 0.8 km/h within 20 ms [49 CFR 563.5], as an acceleration, m/s^2.
const PULSE_ACCEL: f64 = 0.8 / 3.6 / 0.020;
/// A pulse is an impact if it changes the velocity by 8 km/h within 150 ms [49 CFR 563, UN R160], m/s.
const IMPACT_DELTA_V: f64 = 8.0 / 3.6;
const IMPACT_WINDOW_S: f64 = 0.150;
/// A peak or CAN trigger makes an impact of half that already.
const TRIGGERED_DELTA_V: f64 = 4.0 / 3.6;
/// The level after a pulse is the mean from and to so long after its last bin above the threshold, and the pulse
/// falls to it within [`TAIL_S`], s.
const LEVEL_S: [f64; 2] = [0.05, 0.12];
const TAIL_S: f64 = 0.03;
/// One sigma of a bin before the onset, share of what is clear of the level: the level itself drifts (brakes, a tow).
const DRIFT: f64 = 1.0 / 3.0;
/// Least noise of a bin's acceleration beside a pulse, m/s^2.
const LEAST_NOISE: f64 = 0.1;
/// A pulse that gives back more than this ends where it was largest, m/s.
const SWING_BACK: f64 = 0.1;
/// Quiet time that separates two pulses, s.
const PULSE_GAP_S: f64 = 0.050;

/// Deceleration (250 ms mean) above which a braked wheel slips, m/s^2, and how long before that slip begins, s.
const BRAKING: f64 = 2.0;
const SLIP_LEAD_S: f64 = 0.6;
/// Wheels are left alone for this long after a disturbance, s.
const SETTLE_S: f64 = 0.3;
/// Wheels are left alone for this long after an impact, s.
const SETTLE_IMPACT_S: f64 = 1.0;
/// Lateral acceleration (250 ms mean, m/s^2) and yaw rate (rad/s) of a car that no longer simply rolls.
const LATERAL: f64 = 6.0;
const SPIN: f64 = 1.0;
/// Share of gravity along body z below which a car does not stand on its wheels: they turn freely.
const UPRIGHT: f64 = 0.5;
/// Specific force of a car in the air, m/s^2.
const AIRBORNE: f64 = 3.0;

/// One pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// First and last epoch above the threshold.
    pub first: usize,
    /// Last epoch above the threshold.
    pub last: usize,
    /// Onset, interpolated within the sample, s.
    pub onset_s: f64,
    /// One sigma of the onset, s.
    pub onset_sd_s: f64,
    /// The last epoch that ends at or before the onset.
    pub before: usize,
    /// End of the pulse, interpolated within the sample, s.
    pub end_s: f64,
    /// One sigma of the end, s.
    pub end_sd_s: f64,
    /// Mean acceleration just before the onset, body axes, m/s^2.
    pub base: Vector3<f64>,
    /// Mean acceleration just after the end, body axes, m/s^2.
    pub level: Vector3<f64>,
}

/// The first look.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Acceleration free of gravity at mid-epoch, body axes, m/s^2.
    pub accel: Vec<Vector3<f64>>,
    /// Rate with the bias taken off, rad/s.
    pub rate: Vec<Vector3<f64>>,
    /// Variance of the rate beside noise: what a gyro at its limit hid, (rad/s)^2.
    pub rate_doubt: Vec<Vector3<f64>>,
    /// 250 ms mean of the acceleration.
    pub smooth: Vec<Vector3<f64>>,
    /// Impacts in order of time.
    pub impacts: Vec<Pulse>,
    /// Wheels must not be believed.
    pub wheels_bad: Vec<bool>,
    /// An impact lies before this epoch: a wheel may be bent.
    pub after_impact: Vec<bool>,
}

impl Motion {
    /// Looks at all epochs, backwards from the start.
    #[must_use]
    pub fn look(
        reversed: &Reversed<'_>,
        start: &Start,
        gravity: f64,
        triggers: &[Trigger],
    ) -> Self {
        let epochs = reversed.forward();
        let n = epochs.list.len();
        let mut accel = vec![Vector3::zeros(); n];
        let mut rate = vec![Vector3::zeros(); n];
        let mut rolled = vec![false; n];
        let mut c: Rot<Nav, Body> = start.nav.c_nb;
        for (k, epoch) in reversed.iter() {
            let w = Vec3::<Body>::from(epoch.rate - start.rate_bias);
            if k <= start.k {
                let turn = exp_so3(&(w.v * (-0.5 * epoch.dt)));
                let mid = Rot::from_matrix(c.m * turn);
                accel[k] = free_of_gravity(&(epoch.accel - start.accel_bias), &mid, gravity);
                c = Rot::from_matrix(mid.m * turn);
            } else {
                accel[k] = free_of_gravity(&(epoch.accel - start.accel_bias), &c, gravity);
            }
            rate[k] = w.v;
            rolled[k] = c.m[(2, 2)] < UPRIGHT;
        }
        let smooth = centred_mean(epochs, &accel, SMOOTH_S);
        let mut motion = Self {
            accel,
            rate,
            rate_doubt: vec![Vector3::zeros(); n],
            smooth,
            impacts: Vec::new(),
            wheels_bad: vec![false; n],
            after_impact: vec![false; n],
        };
        motion.impacts = motion.find_impacts(epochs, triggers);
        motion.mark_wheels(epochs, &rolled);
        motion
    }

    fn find_impacts(&self, epochs: &Epochs, triggers: &[Trigger]) -> Vec<Pulse> {
        let list = &epochs.list;
        let above: Vec<bool> = (0..list.len())
            .map(|k| {
                let previous = k.saturating_sub(1);
                if list[k].dt > 0.011 {
                    return self.accel[k].xy().norm() > PULSE_ACCEL;
                }
                ((self.accel[k] + self.accel[previous]) * 0.5).xy().norm() > PULSE_ACCEL
                    && self.accel[k].xy().norm() > 0.5 * PULSE_ACCEL
            })
            .collect();
        let mut pulses: Vec<(usize, usize)> = Vec::new();
        for k in (0..list.len()).filter(|&k| above[k]) {
            match pulses.last_mut() {
                Some(pulse) if list[k].t_s - list[pulse.1].t_s < PULSE_GAP_S => pulse.1 = k,
                _ => pulses.push((k, k)),
            }
        }
        pulses
            .into_iter()
            .filter(|&(first, last)| self.is_impact(epochs, triggers, first, last))
            .map(|(first, last)| self.pulse(epochs, first, last))
            .collect()
    }

    fn is_impact(&self, epochs: &Epochs, triggers: &[Trigger], first: usize, last: usize) -> bool {
        let list = &epochs.list;
        let mut best: f64 = 0.0;
        for from in first..=last {
            let mut sum = Vector3::zeros();
            let mut length = 0.0;
            for k in from..list.len() {
                length += list[k].dt;
                if length > IMPACT_WINDOW_S + 0.001 {
                    break;
                }
                sum += self.accel[k] * list[k].dt;
                best = best.max(sum.xy().norm());
            }
        }
        let zero_ns = triggers.first().map_or(0, |t| t.monotonic_ns);
        let triggered = triggers.iter().any(|t| {
            let t_s = schema::num::real_i64(t.monotonic_ns - zero_ns) * 1e-9;
            matches!(t.kind, TriggerKind::Peak | TriggerKind::Can)
                && t_s > list[first].t_s - 0.05
                && t_s < list[last].t_s + 0.2
        });
        best >= if triggered {
            TRIGGERED_DELTA_V
        } else {
            IMPACT_DELTA_V
        }
    }

    /// Onset and end of a pulse. The acceleration leaves its level before the pulse along a ramp; the onset is
    /// where that ramp, drawn back from the first two bins that stand clear of the level, meets it.
    fn pulse(&self, epochs: &Epochs, first: usize, last: usize) -> Pulse {
        let list = &epochs.list;
        let far = first.saturating_sub(12);
        let near = first.saturating_sub(3).max(far + 1).min(first.max(1));
        let mut base = Vector3::zeros();
        for a in &self.accel[far..near] {
            base += a / real(near - far);
        }
        let mut spread: f64 = self.accel[far..near]
            .iter()
            .map(|a| (a - base).xy().norm_squared())
            .sum();
        spread = (spread / real((near - far).max(1))).sqrt();
        let clear = (4.0 * spread).max(1.5);
        let departs = |k: usize| (self.accel[k] - base).xy().norm() > clear;
        let mut k = first;
        while k > near && departs(k - 1) {
            k -= 1;
        }
        let dt = list[k].dt;
        let noise = spread.max(LEAST_NOISE);
        let [onset_s, onset_sd_s] = edges::onset(self, epochs, k, &base, DRIFT * clear)
            .unwrap_or([list[k].t_s - dt, 0.35 * dt]);
        let before = list[..=k].partition_point(|e| e.t_s <= onset_s + 1e-9);
        let before = before.clamp(1, k.max(1)) - 1;
        let (last, level, end_s, end_sd_s) = self.end(epochs, [first, k], last, clear, noise);
        // A gap that ends in the pulse, or lies just before it, hides the onset.
        let near_gap = list[k.saturating_sub(2)..(k + 2).min(list.len())]
            .iter()
            .any(|e| e.measured[..2] != [true; 2]);
        let (before, onset_s, onset_sd_s) = if near_gap {
            hidden_onset(epochs, k)
        } else {
            (before, onset_s, onset_sd_s)
        };
        Pulse {
            first,
            last,
            onset_s,
            onset_sd_s,
            before,
            end_s,
            end_sd_s,
            base,
            level,
        }
    }

    /// Last epoch, level after it, end and its spread, of a pulse whose first bin clear of its level is `from` and whose
    /// first and last above the threshold are `first` and `last`.
    fn end(
        &self,
        epochs: &Epochs,
        [first, from]: [usize; 2],
        last: usize,
        clear: f64,
        noise: f64,
    ) -> (usize, Vector3<f64>, f64, f64) {
        let list = &epochs.list;
        let found = edges::end(self, epochs, [from, last], clear, noise);
        let (last, level) = match found {
            Some(end) => {
                let last = list.partition_point(|e| e.t_s < end.t_s - 1e-9);
                let last = last.clamp(first, list.len() - 1);
                let after = &self.accel[(last + 1).min(list.len() - 1)..(last + 4).min(list.len())];
                let level = after.iter().sum::<Vector3<f64>>() / real(after.len().max(1));
                (last, level)
            }
            None => self.tail(epochs, last, clear),
        };
        let dt = list[last].dt;
        if let Some(parting) = self.parting(epochs, from, last, level.xy().norm()) {
            return (parting, Vector3::zeros(), list[parting].t_s, 0.5 * dt);
        }
        match found {
            Some(end) => (last, level, end.t_s, end.sd_s),
            // The acceleration comes to no level.
            None => (last, level, list[last].t_s, 0.5 * dt),
        }
    }

    /// The bin in which the cars part, if the pulse goes on behind it: there the change of velocity is largest
    /// [49 CFR 563.5, maximum delta-V], and what follows is the structure that swings back. What tyres that pull with
    /// `tyres` (m/s^2) took back in that time is no swing.
    fn parting(&self, epochs: &Epochs, first: usize, last: usize, tyres: f64) -> Option<usize> {
        let mut turned = Rot::<Nav, Body>::identity();
        let mut change = Vector3::zeros();
        let mut largest = (0.0, last);
        for k in first..=last {
            let dt = epochs.list[k].dt;
            turned = Rot::from_matrix(turned.m * exp_so3(&(self.rate[k] * dt)));
            change += turned.m * self.accel[k] * dt;
            let size = change.xy().norm();
            if size > largest.0 {
                largest = (size, k);
            }
        }
        let taken = tyres * (epochs.list[last].t_s - epochs.list[largest.1].t_s);
        (largest.0 - change.xy().norm() > SWING_BACK + taken).then_some(largest.1)
    }

    /// Last bin of a pulse, and the mean acceleration behind it: after the last one above the threshold the acceleration still falls to its level
    /// after the pulse, for [`TAIL_S`] at most.
    fn tail(&self, epochs: &Epochs, last: usize, clear: f64) -> (usize, Vector3<f64>) {
        let list = &epochs.list;
        let after =
            |seconds: f64| list.partition_point(|e| e.t_s <= list[last].t_s + seconds + 1e-9);
        let (from, to) = (after(LEVEL_S[0]), after(LEVEL_S[1]));
        if to <= from {
            return (last, Vector3::zeros());
        }
        let mut level = Vector3::zeros();
        for a in &self.accel[from..to] {
            level += a / real(to - from);
        }
        let tail = (last + 1..after(TAIL_S))
            .take_while(|&k| (self.accel[k] - level).xy().norm() > clear)
            .last()
            .unwrap_or(last);
        (tail, level)
    }

    fn mark_wheels(&mut self, epochs: &Epochs, rolled: &[bool]) {
        let list = &epochs.list;
        let n = list.len();
        let mut mark = |centre: usize, before: f64, after: f64| {
            let t = list[centre].t_s;
            let from = list.partition_point(|e| e.t_s < t - before);
            let to = list.partition_point(|e| e.t_s <= t + after);
            self.wheels_bad[from..to].fill(true);
        };
        let after_impact = self.impacts.first().map_or(n, |pulse| pulse.first);
        for k in 0..n {
            let airborne = list[k].accel.norm() < AIRBORNE && list[k].measured[..3] == [true; 3];
            // After an impact a car may slide in any direction; before it, sideways is cornering.
            let sliding = k >= after_impact && self.smooth[k].xy().norm() > BRAKING;
            if self.smooth[k].x < -BRAKING
                || self.smooth[k].y.abs() > LATERAL
                || self.rate[k].z.abs() > SPIN
                || sliding
                || airborne
                || rolled[k]
            {
                mark(k, SLIP_LEAD_S, SETTLE_S);
            }
        }
        for pulse in &self.impacts {
            mark(pulse.first, SLIP_LEAD_S, SETTLE_IMPACT_S);
            mark(pulse.last, SLIP_LEAD_S, SETTLE_IMPACT_S);
        }
        self.after_impact[after_impact..].fill(true);
    }
}

/// Onset of a pulse that begins in or behind a gap next to epoch `k`: anywhere in the gap.
fn hidden_onset(epochs: &Epochs, k: usize) -> (usize, f64, f64) {
    let list = &epochs.list;
    let seen = |i: usize| list[i].measured[..2] == [true; 2];
    let mut end = (k + 2).min(list.len());
    while end > 0 && seen(end - 1) {
        end -= 1;
    }
    let mut from = end;
    while from > 0 && !seen(from - 1) {
        from -= 1;
    }
    let (begin, stop) = (list[from].t_s - list[from].dt, list[end.max(1) - 1].t_s);
    // Uniform in the gap.
    (
        from.saturating_sub(1),
        f64::midpoint(begin, stop),
        (stop - begin) / 12.0_f64.sqrt(),
    )
}

/// Mean over a window centred on each epoch, body axes.
pub(crate) fn centred_mean(
    epochs: &Epochs,
    values: &[Vector3<f64>],
    window_s: f64,
) -> Vec<Vector3<f64>> {
    let list = &epochs.list;
    let n = list.len();
    let mut out = Vec::with_capacity(n);
    let (mut from, mut to) = (0, 0);
    let mut sum = Vector3::zeros();
    let mut length = 0.0;
    for k in 0..n {
        let middle = list[k].t_s - 0.5 * list[k].dt;
        while to < n && list[to].t_s - 0.5 * list[to].dt <= middle + 0.5 * window_s {
            sum += values[to] * list[to].dt;
            length += list[to].dt;
            to += 1;
        }
        while list[from].t_s - 0.5 * list[from].dt < middle - 0.5 * window_s {
            sum -= values[from] * list[from].dt;
            length -= list[from].dt;
            from += 1;
        }
        out.push(if length > 0.0 {
            sum / length
        } else {
            values[k]
        });
    }
    out
}
