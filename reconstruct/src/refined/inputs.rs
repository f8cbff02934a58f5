//! What the sensors gave, and how far it is believed: noise of the driving car, gaps, samples at a sensor's limit.
//!
//! A gap or a clipped stretch hides one and the same unknown over its length, not fresh noise in each sample: its density
//! is the variance of that unknown times the length, so that the integral has the right spread.

use nalgebra::{Matrix3, Vector3};

use super::states::{MOUNT_PITCH, MOUNT_YAW};
use super::tape::Step;
use super::transition::Density;
use crate::epochs::{Epoch, Epochs, gap_density};
use crate::filter::Setup;
use crate::motion::Motion;

/// Beyond a limit the true value lies higher by this share of it on average, and by so much more or less: no more is
/// known of an exponential tail than its mean.
const EXCESS_ACCEL: [f64; 2] = [0.3, 0.5];
/// Stretches at the limit closer than this are one, s.
const CLIP_JOIN_S: f64 = 0.03;
/// Time behind a clipped rate over which its decay is measured, s.
const DECAY_S: f64 = 0.15;
/// Share of the extrapolated excess that is unsure, and a floor as a share of the range.
const EXCESS_RATE: [f64; 2] = [0.35, 0.02];
/// Speed at which the data sheet's vibration holds, m/s; it grows with the speed up to so many times that.
pub(crate) const VIBRATION_SPEED: f64 = 25.0;
const VIBRATION_MOST: f64 = 1.2;
const VIBRATION_LEAST: f64 = 0.1;

/// The mounting as a pass found it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// From sensor axes to the car's.
    pub axes: Matrix3<f64>,
    /// One sigma of yaw and pitch, rad.
    pub sd: [f64; 2],
}

impl Mounting {
    /// Of a step that has seen the drive.
    #[must_use]
    pub fn of(step: &Step) -> Self {
        Self {
            axes: step.nominal.mounting(),
            sd: [MOUNT_YAW, MOUNT_PITCH].map(|s| step.p[(s, s)].max(0.0).sqrt()),
        }
    }
}

/// Samples as the refined filter takes them.
#[derive(Clone, Debug)]
pub struct Inputs {
    /// Specific force, body axes as sent, m/s^2.
    pub accel: Vec<Vector3<f64>>,
    /// Rate, body axes as sent, rad/s.
    pub rate: Vec<Vector3<f64>>,
    /// Density beside sensor noise and vibration: gaps and limits.
    extra: Vec<Density>,
    /// Seconds at the limit: accelerometer x, y, z, gyro x, y, z.
    pub clipped_s: [f64; 6],
    /// Variance of what a gyro at its limit hid, (rad/s)^2.
    pub rate_doubt: Vec<Vector3<f64>>,
}

impl Inputs {
    /// From the epochs; `motion` tells where impacts are.
    #[must_use]
    pub fn new(epochs: &Epochs, motion: &Motion) -> Self {
        let list = &epochs.list;
        let none = Density {
            accel: Vector3::zeros(),
            rate: Vector3::zeros(),
        };
        let mut inputs = Self {
            accel: list.iter().map(|e| e.accel).collect(),
            rate: list.iter().map(|e| e.rate).collect(),
            extra: vec![none; list.len()],
            clipped_s: [0.0; 6],
            rate_doubt: vec![Vector3::zeros(); list.len()],
        };
        for axis in 0..6 {
            inputs.gaps(list, axis);
            inputs.limits(epochs, motion, axis);
        }
        inputs
    }

    /// Densities of epoch `k` of a car at `speed` (m/s).
    #[must_use]
    pub fn density(&self, epochs: &Epochs, k: usize, speed: f64) -> Density {
        let imu = &epochs.header.imu;
        let share = (speed / VIBRATION_SPEED).clamp(VIBRATION_LEAST, VIBRATION_MOST);
        let vibration = |sd: f64| (sd * share).powi(2) * 0.01;
        let extra = &self.extra[k];
        Density {
            accel: extra
                .accel
                .add_scalar(imu.accel_density.powi(2) + vibration(imu.accel_vibration)),
            rate: extra
                .rate
                .add_scalar(imu.rate_density.powi(2) + vibration(imu.rate_vibration)),
        }
    }

    /// What is hidden along one axis shows along the others by the doubt of the mounting.
    #[must_use]
    pub fn leaning(mut self, mounting: Option<&Mounting>) -> Self {
        let Some(Mounting {
            sd: [yaw, pitch], ..
        }) = mounting
        else {
            return self;
        };
        for extra in &mut self.extra {
            let own = extra.accel;
            extra.accel += Vector3::new(
                yaw * yaw * own.y + pitch * pitch * own.z,
                yaw * yaw * own.x,
                pitch * pitch * own.x,
            );
        }
        self
    }

    /// Turn that gaps and limits hide from the gyros up to the start, about the axis that hides most: one sigma, rad.
    #[must_use]
    pub fn hidden_turn(&self, setup: &Setup<'_>) -> f64 {
        let list = &setup.reversed.forward().list;
        let variance = list
            .iter()
            .zip(&self.extra)
            .take(setup.start.k + 1)
            .fold(Vector3::zeros(), |sum: Vector3<f64>, (epoch, extra)| {
                sum + extra.rate * epoch.dt
            });
        variance.max().sqrt()
    }

    fn widen(&mut self, k: usize, axis: usize, density: f64) {
        let extra = &mut self.extra[k];
        if axis < 3 {
            extra.accel[axis] += density;
        } else {
            extra.rate[axis - 3] += density;
        }
    }

    fn gaps(&mut self, list: &[Epoch], axis: usize) {
        for (from, to) in runs(list, 0.0, |e| !e.measured[axis]) {
            let seconds: f64 = list[from..to].iter().map(|e| e.dt).sum();
            let value = |e: &Epoch| {
                if axis < 3 {
                    e.accel[axis]
                } else {
                    e.rate[axis - 3]
                }
            };
            let after = list.get(to).map(value);
            let before = from.checked_sub(1).map(|k| value(&list[k])).or(after);
            let (before, after) = (before.unwrap_or(0.0), after.or(before).unwrap_or(0.0));
            let density = gap_density(axis, before, after, seconds);
            for k in from..to {
                self.widen(k, axis, density);
            }
        }
    }

    fn limits(&mut self, epochs: &Epochs, motion: &Motion, axis: usize) {
        let list = &epochs.list;
        let imu = &epochs.header.imu;
        let range = if axis < 3 {
            imu.accel_range
        } else {
            imu.rate_range
        };
        for (from, to) in runs(list, CLIP_JOIN_S, |e| e.clipped[axis] != 0.0) {
            let seconds: f64 = list[from..to]
                .iter()
                .map(|e| e.clipped[axis].abs() * e.dt)
                .sum();
            self.clipped_s[axis] += seconds;
            let largest = |e: &Epoch| {
                if axis < 3 {
                    e.accel[axis].abs()
                } else {
                    e.rate[axis - 3].abs()
                }
            };
            let range =
                range.unwrap_or_else(|| list[from..to].iter().map(largest).fold(0.0, f64::max));
            if axis < 3 {
                for (k, epoch) in list.iter().enumerate().take(to).skip(from) {
                    let share = epoch.clipped[axis];
                    self.accel[k][axis] += EXCESS_ACCEL[0] * range * share;
                    self.widen(
                        k,
                        axis,
                        (EXCESS_ACCEL[1] * range).powi(2) * share.abs() * seconds,
                    );
                }
            } else {
                self.decayed_rate(list, motion, axis - 3, (from, to), range);
            }
        }
    }

    /// A spin that clips the gyro is thrown on by the impact and then dies away: what was hidden is the line of that
    /// decay drawn back to the impact.
    fn decayed_rate(
        &mut self,
        list: &[Epoch],
        motion: &Motion,
        axis: usize,
        (from, to): (usize, usize),
        range: f64,
    ) {
        let begin = motion
            .impacts
            .iter()
            .map(|pulse| list[pulse.first.min(list.len() - 1)].t_s)
            .filter(|t| *t <= list[from].t_s + 0.2)
            .fold(list[from].t_s, |a, b| if b > a { b } else { a });
        let after = to..list.partition_point(|e| e.t_s <= list[to - 1].t_s + DECAY_S);
        let slope = slope(list, after, |e| e.rate[axis].abs()).min(0.0);
        let end_s = list[to - 1].t_s;
        let mut sum = 0.0;
        let mut seconds = 0.0;
        let mut excess = vec![0.0; to - from];
        for k in from..to {
            let share = list[k].clipped[axis + 3];
            let back = (end_s - list[k].t_s.max(begin)).max(0.0);
            excess[k - from] = -slope * back * share;
            sum += excess[k - from].abs() * list[k].dt;
            seconds += share.abs() * list[k].dt;
        }
        let mean = if seconds > 0.0 { sum / seconds } else { 0.0 };
        let sd = EXCESS_RATE[0] * mean + EXCESS_RATE[1] * range;
        for k in from..to {
            self.rate[k][axis] += excess[k - from];
            let own = EXCESS_RATE[0] * excess[k - from] + EXCESS_RATE[1] * range;
            self.rate_doubt[k][axis] += own * own;
            self.widen(
                k,
                axis + 3,
                sd * sd * list[k].clipped[axis + 3].abs() * seconds,
            );
        }
    }
}

/// Runs of epochs for which `is` holds, joined over pauses of up to `join_s`.
fn runs(list: &[Epoch], join_s: f64, is: impl Fn(&Epoch) -> bool) -> Vec<(usize, usize)> {
    let mut out: Vec<(usize, usize)> = Vec::new();
    for (k, epoch) in list.iter().enumerate() {
        if !is(epoch) {
            continue;
        }
        match out.last_mut() {
            Some(run) if epoch.t_s - epoch.dt - list[run.1 - 1].t_s <= join_s + 1e-9 => {
                run.1 = k + 1;
            }
            _ => out.push((k, k + 1)),
        }
    }
    out
}

/// Least-squares slope of a value over time, per second.
fn slope(list: &[Epoch], range: std::ops::Range<usize>, value: impl Fn(&Epoch) -> f64) -> f64 {
    let points: Vec<(f64, f64)> = list
        .get(range)
        .unwrap_or_default()
        .iter()
        .map(|e| (e.t_s, value(e)))
        .collect();
    let n = schema::num::real(points.len());
    if points.len() < 3 {
        return 0.0;
    }
    let (mt, mv) = points
        .iter()
        .fold((0.0, 0.0), |(a, b), (t, v)| (a + t / n, b + v / n));
    let (top, bottom) = points.iter().fold((0.0, 0.0), |(a, b), (t, v)| {
        (a + (t - mt) * (v - mv), b + (t - mt).powi(2))
    });
    if bottom > 0.0 { top / bottom } else { 0.0 }
}
