//! Begin and end of a pulse, finer than the 10 ms means show them.
//!
//! An edge is where a rise, drawn back, leaves the level beside the pulse. How steeply a pulse leaves it is not known:
//! `size ~ (t - t0)^n` with `n` from 1 (half-sine) to 2 (haversine). The mean over each bin of such a rise is compared
//! with the bins about the edge; the answer is the mean of `t0` over all of them, weighed by how well they fit, and its
//! spread is the doubt.

use nalgebra::{Matrix3, Vector3};
use schema::num::real;

use super::Motion;
use crate::epochs::Epochs;
use crate::frame::exp_so3;

/// Exponents of a rise.
const EXPONENTS: [f64; 2] = [1.0, 1.4];
const END_EXPONENTS: [f64; 1] = [1.0];
/// A rise follows no power exactly (ripple of the structure): share of a bin's size, one sigma.
const SHAPE_SD: f64 = 0.10;
/// And less from the third bin of it on, which averages the rounding of the first two: so many times that.
const DEEP: f64 = 2.0;
/// Bins looked at outside the first that departs from the level.
const OUTSIDE: usize = 2;
/// Steps of the search within a bin.
const FINE: u32 = 40;
/// A pulse is over once the acceleration stays at one level for so many bins.
const QUIET: usize = 8;
/// And changes by no more than this from one bin to the next, m/s^2.
const STEADY: f64 = 1.0;
/// So many bins behind the last one above the threshold a level is looked for.
const REACH: usize = 6;
/// Least spread of an edge, share of a bin: receive jitter and the grid of the bins.
const LEAST_SD: f64 = 0.1;

/// One bin beside an edge, counted from outside the pulse inwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bin {
    /// Its outer side, s; grows inwards.
    pub(super) outer: f64,
    /// Its length, s.
    pub(super) dt: f64,
    /// Departure from the level, in the direction of the pulse, m/s^2.
    pub(super) size: f64,
    /// Noise of it, one sigma; infinite where nothing was measured.
    pub(super) noise: f64,
    /// What the rounding at its inner side carries into the next bin, one sigma.
    pub(super) carried: f64,
}

/// Place and spread of the edge, s; `None` where the bins do not rise inwards.
///
/// Compared are the changes of velocity from outside to each bin's inner side: what rounding leaves of one stored
/// value is in the next one, so that a single coarse value is off by metres a second squared and their sum is not.
pub(super) fn edge(bins: &[Bin], powers: &[f64]) -> Option<[f64; 2]> {
    let (first, inner) = (bins.first()?, bins.last()?);
    let (mut change, mut noise) = (0.0, 0.0);
    // Inner side, change, weight.
    let sums: Vec<[f64; 3]> = bins
        .iter()
        .enumerate()
        .map(|(i, b)| {
            change += b.size * b.dt;
            noise += (b.noise * b.dt).powi(2);
            let shape = SHAPE_SD * if i < OUTSIDE + 2 { 1.0 } else { DEEP };
            let variance = noise + (b.carried * b.dt).powi(2) + (shape * change).powi(2);
            [b.outer + b.dt, change, 1.0 / variance]
        })
        .collect();
    let step = inner.dt / f64::from(FINE);
    let count = schema::num::round_usize((inner.outer + 0.5 * inner.dt - first.outer) / step);
    let mut tried = Vec::with_capacity(powers.len() * (count + 1));
    for &power in powers {
        for i in 0..=count {
            let at = first.outer + real(i) * step;
            let unit = inner.outer + inner.dt - at;
            let (mut square, mut along, mut own) = (0.0, 0.0, 0.0);
            for [side, change, weight] in &sums {
                let shape = ((side - at).max(0.0) / unit).powf(power + 1.0);
                square += weight * shape * shape;
                along += weight * shape * change;
                own += weight * change * change;
            }
            if along > 0.0 && square > 0.0 {
                let log = -0.5 * (own - along * along / square) - 0.5 * square.ln();
                tried.push((at, log));
            }
        }
    }
    let top = tried.iter().fold(f64::NEG_INFINITY, |m, t| m.max(t.1));
    let (mut sum, mut first_moment, mut second_moment) = (0.0, 0.0, 0.0);
    for (at, log) in &tried {
        let weight = (log - top).exp();
        let off = at - inner.outer;
        sum += weight;
        first_moment += weight * off;
        second_moment += weight * off * off;
    }
    if sum <= 0.0 {
        return None;
    }
    let middle = first_moment / sum;
    let variance = (second_moment / sum - middle * middle).max(0.0);
    Some([
        inner.outer + middle,
        variance.sqrt().hypot(LEAST_SD * inner.dt),
    ])
}

/// One sigma of what the rounding of epoch `k` carries into the next, m/s^2.
fn carried(epochs: &Epochs, k: usize) -> f64 {
    let (scale, accel) = (&epochs.header.accel_scale, &epochs.list[k].accel);
    let coarse = accel.xy().amax() > scale.fine_step * f64::from(scale.fine_steps);
    let step = if coarse {
        scale.coarse_step
    } else {
        scale.fine_step
    };
    step / 12.0_f64.sqrt()
}

/// The end of a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct End {
    /// s.
    pub(super) t_s: f64,
    /// One sigma, s.
    pub(super) sd_s: f64,
}

/// Acceleration of the epochs `from..to` in axes that stand still, without what the IMU feels for being carried round
/// the centre of gravity. What the tyres do to a spinning car is steady only there: at an IMU half a metre off, in axes
/// that turn at 200 deg/s, it turns and fades and looks like a pulse that goes on. The growth of the spin is left in: it
/// is steady as well once the pulse is over, and no derivative of a coarsely rounded rate is needed.
pub(super) fn still(motion: &Motion, epochs: &Epochs, from: usize, to: usize) -> Vec<Vector3<f64>> {
    let vehicle = &epochs.header.vehicle;
    let arm = match vehicle.imu_position_m.zip(vehicle.cg_position_m) {
        Some((imu, cg)) => Vector3::from(cg) - Vector3::from(imu),
        None => Vector3::zeros(),
    };
    let rate = &motion.rate;
    let mut turned = Matrix3::<f64>::identity();
    (from..to)
        .map(|k| {
            let near = &rate[k.saturating_sub(1)..(k + 2).min(rate.len())];
            let w = near.iter().sum::<Vector3<f64>>() / real(near.len());
            let half = exp_so3(&(rate[k] * (0.5 * epochs.list[k].dt)));
            let middle = turned * half;
            turned = middle * half;
            middle * (motion.accel[k] + w.cross(&w.cross(&arm)))
        })
        .collect()
}

/// The acceleration after a pulse, a straight line: springs swing the centre of gravity at 1 to 2 Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Level {
    middle: f64,
    mean: Vector3<f64>,
    slope: Vector3<f64>,
}

impl Level {
    /// Least squares over the bins `from..=to`.
    fn of(accel: &[Vector3<f64>], from: usize, to: usize) -> Self {
        let window = &accel[from..=to];
        let n = real(window.len());
        let middle = 0.5 * real(from + to);
        let mean = window.iter().sum::<Vector3<f64>>() / n;
        let mut slope = Vector3::zeros();
        for (i, a) in window.iter().enumerate() {
            slope += a * (real(from + i) - middle);
        }
        slope *= 12.0 / (n * (n * n - 1.0));
        Self {
            middle,
            mean,
            slope,
        }
    }

    fn at(&self, i: usize) -> Vector3<f64> {
        self.mean + self.slope * (real(i) - self.middle)
    }
}

/// The end of the pulse that begins with epoch `first` and is last above the threshold in `last`: where its fall meets
/// the level that the acceleration then keeps. `clear`: departure from a level that is no noise; `noise`: one sigma.
/// `None` where it comes to no level.
pub(super) fn end(
    motion: &Motion,
    epochs: &Epochs,
    [first, last]: [usize; 2],
    clear: f64,
    noise: f64,
) -> Option<End> {
    let list = &epochs.list;
    let to = (last + REACH + QUIET + 2).min(list.len());
    let accel = still(motion, epochs, first, to);
    let size = |i: &usize| accel[*i].xy().norm();
    let top = (0..=last - first).max_by(|a, b| size(a).total_cmp(&size(b)))?;
    let stop = accel.len().checked_sub(QUIET + 1)?;
    // The first bin behind which everything keeps one level.
    let (at, level) = (top..stop).find_map(|i| {
        let level = Level::of(&accel, i + 2, i + QUIET);
        let keeps = |j: usize| (accel[j] - level.at(j)).xy().norm() < clear;
        (level.slope.xy().norm() < STEADY && (i + 1..=i + QUIET).all(keeps) && !keeps(i))
            .then_some((i, level))
    })?;
    let inner = at.checked_sub(1)?;
    let departs = |i: usize| (accel[i] - level.at(i)).xy();
    let push = (departs(at) + departs(inner)).try_normalize(1e-6)?;
    let bins: Vec<Bin> = (inner..=at + 2)
        .rev()
        .map(|i| {
            let epoch = &list[first + i];
            let seen = epoch.measured[..2] == [true; 2];
            Bin {
                outer: -epoch.t_s,
                dt: epoch.dt,
                size: departs(i).dot(&push),
                noise: if seen { noise } else { f64::INFINITY },
                carried: carried(epochs, first + i.saturating_sub(1)),
            }
        })
        .collect();
    let [t, sd_s] = edge(&bins, &END_EXPONENTS)?;
    Some(End { t_s: -t, sd_s })
}

/// Onset of a pulse whose first bin clear of the level `base` is `k`: place and spread, s.
pub(super) fn onset(
    motion: &Motion,
    epochs: &Epochs,
    k: usize,
    base: &Vector3<f64>,
    noise: f64,
) -> Option<[f64; 2]> {
    let list = &epochs.list;
    let to = (k + 2).min(list.len());
    let push = motion.accel[k..to]
        .iter()
        .fold(Vector3::zeros(), |sum, a| sum + a - base)
        .xy()
        .try_normalize(1e-6)?;
    let bins: Vec<Bin> = (k.saturating_sub(OUTSIDE)..(k + 3).min(list.len()))
        .map(|i| Bin {
            outer: list[i].t_s - list[i].dt,
            dt: list[i].dt,
            size: (motion.accel[i] - base).xy().dot(&push),
            noise,
            carried: carried(epochs, i),
        })
        .collect();
    edge(&bins, &EXPONENTS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Class, Scenario};
    use schema::Sample;
    use schema::num::u64_of;

    const LENGTH: f64 = 0.09;
    const BRAKING: f64 = -6.0;

    type Shape = fn(f64) -> f64;

    /// Uniform numbers with unit variance.
    struct Draws(u64);

    impl Draws {
        fn next(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let unit = schema::num::real_u64(self.0 >> 11) / 9_007_199_254_740_992.0;
            (unit - 0.5) * 12.0_f64.sqrt()
        }
    }

    /// A pulse on braking, the car sliding afterwards.
    struct Crash {
        /// Change of velocity share after a share of the pulse.
        shape: Shape,
        delta_v: f64,
        begin: f64,
        friction: f64,
        spin: f64,
        noise: f64,
    }

    fn sine(x: f64) -> f64 {
        0.5 * (1.0 - (std::f64::consts::PI * x).cos())
    }

    /// Steep rise, long fall: 85 % by a lobe over the first two thirds, the rest by one over the last 55 %.
    fn skewed(x: f64) -> f64 {
        let lobe = |x: f64| sine(x.clamp(0.0, 1.0));
        0.85 * lobe(x / 0.67) + 0.15 * lobe((x - 0.45) / 0.55)
    }

    impl Crash {
        /// The first look at 10 ms means of it, and its pulse's onset and end as found.
        fn found(&self) -> (f64, f64, super::super::Pulse) {
            let scenario = Scenario::draw(Class::Frontal, 1);
            let sample = Sample {
                accel: [Some(0.0), Some(0.0), Some(-9.81)],
                rate: [Some(0.0); 3],
                wheels: [None; 2],
            };
            let samples: Vec<_> = (0..300).map(|k| (u64_of(k), 100, sample)).collect();
            let epochs = Epochs::from_samples(scenario.header(), &samples, 0.0, &[]).unwrap();
            let header = &epochs.header.vehicle;
            let arm = Vector3::from(header.cg_position_m.unwrap())
                - Vector3::from(header.imu_position_m.unwrap());
            let mut draws = Draws(11);
            let (mut turned, mut motion) = (0.0_f64, empty(300));
            for (k, epoch) in epochs.list.iter().enumerate() {
                let share = |t: f64| ((t - self.begin) / LENGTH).clamp(0.0, 1.0);
                let from = epoch.t_s - epoch.dt;
                let along = |t: f64| {
                    self.delta_v * (self.shape)(share(t))
                        + BRAKING * t.min(self.begin)
                        + self.friction * (t - self.begin).max(0.0)
                };
                let turn = |t: f64| self.spin * (self.shape)(share(t));
                let force = (along(epoch.t_s) - along(from)) / epoch.dt;
                let w = Vector3::z() * (0.5 * (turn(epoch.t_s) + turn(from)));
                // The push keeps its direction over the ground; the car turns under it.
                let middle = turned + 0.5 * w.z * epoch.dt;
                turned += w.z * epoch.dt;
                motion.accel[k] = Vector3::new(middle.cos(), -middle.sin(), 0.0) * force
                    - w.cross(&w.cross(&arm))
                    + Vector3::new(draws.next(), draws.next(), 0.0) * self.noise;
                motion.rate[k] = w;
            }
            let pulse = motion.find_impacts(&epochs, &[])[0];
            (
                1e3 * (pulse.onset_s - self.begin),
                1e3 * (pulse.end_s - self.begin - LENGTH),
                pulse,
            )
        }
    }

    fn empty(n: usize) -> Motion {
        Motion {
            accel: vec![Vector3::zeros(); n],
            rate: vec![Vector3::zeros(); n],
            rate_doubt: vec![Vector3::zeros(); n],
            smooth: vec![Vector3::zeros(); n],
            impacts: Vec::new(),
            wheels_bad: vec![false; n],
            after_impact: vec![false; n],
        }
    }

    /// Onset within 2 ms (no power of the rise is assumed) and less on average, end within 1 ms, or 2 with noise,
    /// wherever in a bin they lie, with the tyres' friction
    /// after them or none, with noise, and in a spin seen from an IMU off the centre of gravity.
    #[test]
    fn edges_of_known_pulses() {
        let cases: [(&str, Shape, f64, f64, f64, f64); 6] = [
            ("half-sine", sine, 0.0, 0.0, 0.0, 1.0),
            ("friction after", sine, -6.0, 0.0, 0.0, 1.0),
            ("skewed", skewed, -6.0, 0.0, 0.0, 1.0),
            ("friction against", skewed, 6.0, 0.0, 0.0, 1.0),
            ("noise", skewed, -6.0, 0.0, 0.3, 2.0),
            ("spin", skewed, -6.0, 3.5, 0.2, 2.0),
        ];
        for (name, shape, friction, spin, noise, most) in cases {
            let shifts = [0.0, 0.0013, 0.0035, 0.005, 0.0077, 0.0096];
            let mut sum = 0.0;
            for shift in shifts {
                let crash = Crash {
                    shape,
                    delta_v: -12.0,
                    begin: 1.5 + shift,
                    friction,
                    spin,
                    noise,
                };
                let (onset, end, pulse) = crash.found();
                let place = format!("{name}, {shift}: onset {onset} end {end} ms, {pulse:?}");
                assert!(onset.abs() < 2.0 && end.abs() < most, "{place}");
                // The spread that is claimed covers it.
                assert!(onset.abs() < 2e3 * pulse.onset_sd_s, "{place}");
                assert!(end.abs() < 2e3 * pulse.end_sd_s, "{place}");
                assert!(
                    pulse.onset_sd_s < 0.003 && pulse.end_sd_s < 0.002,
                    "{place}"
                );
                sum += onset;
            }
            assert!((sum / real(shifts.len())).abs() < 1.0, "{name}: {sum}");
        }
    }
}
