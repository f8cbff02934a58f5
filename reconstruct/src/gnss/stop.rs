//! Does the car stand? The variance test of [S00, 3.5], and one that hears more.

use nalgebra::{Vector2, Vector3};
use schema::num::real;

use super::drive::{Drive, Period};

/// Threshold on the sum of the two level variances over a second, (m/s^2)^2 [S00, 4.3].
pub const PUBLISHED: f64 = 0.048;

/// Share of a window that may be held over holes.
const HELD: f64 = 0.1;

/// What [`Detector::hindsight`] is given for the filter, s: a car that still creeps must not be held.
pub const ENTRY_S: f64 = 0.5;
/// As [`ENTRY_S`], at the start.
pub const EXIT_S: f64 = 0.6;

/// The same for a report of when the car was slower than 0.2 m/s, entry and exit, s: on 20 simulated drives of 200 s with an
/// engine that idles quietly or shakes by 0.3 m/s^2, 0.7 missed and 0 false of 100 s, 0.5 with the smoothed track; set on ten others.
pub const REPORTED_S: [f64; 2] = [0.9, 0.3];

/// Settings of our detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detector {
    /// Length of the window, s.
    pub window_s: f64,
    /// Variances of the specific force, level together and along gravity, that an idling engine may shake, (m/s^2)^2:
    /// above them the car moves. First where a fix tells the speed or the car already stands, then where neither does and a
    /// smooth road must not look like a stand.
    pub accel: [[f64; 2]; 2],
    /// Variance of the rates together that it may, (rad/s)^2, in the same two cases: a rolling car pitches and yaws.
    pub rate: [f64; 2],
    /// A mean specific force or rate that differs from that of the stand so far by more than this, and three sigmas of its
    /// own noise, ends it: m/s^2 and rad/s. Over a second the first is the speed that the car has taken up.
    pub shift: [f64; 2],
    /// Speed of a fix up to which the car may stand: m/s, and one-sigma spreads of the fix's velocity on top. A stand ends
    /// at twice that.
    pub speed: [f64; 2],
    /// Without a fix a stand begins that shakes no more than this many times what it did at stands that fixes told: a car that rolls
    /// slowly on a smooth road is quiet, but not as quiet.
    pub idle: f64,
    /// A fix says nothing about instants more than this after it, s.
    pub speed_age_s: f64,
}

impl Default for Detector {
    fn default() -> Self {
        Self {
            window_s: 1.0,
            accel: [[1.0, 1.0], [PUBLISHED, 0.15]],
            rate: [4e-4, 6e-5],
            shift: [0.1, 0.01],
            speed: [0.1, 1.25],
            idle: 4.0,
            speed_age_s: 1.6,
        }
    }
}

/// Sums of one window, slid along.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f64,
    /// Of them held over a hole.
    held: f64,
    accel: Vector3<f64>,
    accel2: Vector3<f64>,
    rate: Vector3<f64>,
    rate2: Vector3<f64>,
}

impl Sums {
    fn add(&mut self, period: &Period, about: &Vector3<f64>, sign: f64) {
        let (accel, rate) = (period.accel - about, period.rate);
        self.n += sign;
        self.held += if period.measured { 0.0 } else { sign };
        self.accel += accel * sign;
        self.accel2 += accel.component_mul(&accel) * sign;
        self.rate += rate * sign;
        self.rate2 += rate.component_mul(&rate) * sign;
    }

    /// A held sample is as still as no stand is: a few do not matter, a hole tells nothing.
    fn measured(&self) -> bool {
        self.held < HELD * self.n
    }

    fn means(&self) -> [Vector3<f64>; 2] {
        let n = self.n.max(1.0);
        [self.accel / n, self.rate / n]
    }

    /// Sample variances per axis.
    fn variances(&self) -> [Vector3<f64>; 2] {
        let (n, free) = (self.n.max(1.0), (self.n - 1.0).max(1.0));
        let of = |sum: &Vector3<f64>, square: &Vector3<f64>| {
            ((square - sum.component_mul(sum) / n) / free).map(|v| v.max(0.0))
        };
        [of(&self.accel, &self.accel2), of(&self.rate, &self.rate2)]
    }
}

/// What the sums of a drive are counted from, m/s^2.
fn about(drive: &Drive) -> Vector3<f64> {
    drive
        .periods
        .first()
        .map_or_else(Vector3::zeros, |p| p.accel)
}

/// Means and variances over the window that ends with each period; gravity is taken off first, so that sums of squares
/// keep their digits.
fn windows(drive: &Drive, seconds: f64) -> Vec<Sums> {
    let mut out = Vec::with_capacity(drive.periods.len());
    let mut sums = Sums::default();
    let mut from = 0;
    let about = about(drive);
    for period in &drive.periods {
        sums.add(period, &about, 1.0);
        while drive.periods[from].t_s <= period.t_s - seconds + 1e-6 {
            let old = &drive.periods[from];
            sums.add(old, &about, -1.0);
            from += 1;
        }
        out.push(sums);
    }
    out
}

/// Sample variances of specific force, (m/s^2)^2, and rate, (rad/s)^2, per axis over the seconds that end with each period.
#[must_use]
pub fn variances(drive: &Drive, seconds: f64) -> Vec<[Vector3<f64>; 2]> {
    windows(drive, seconds)
        .iter()
        .map(Sums::variances)
        .collect()
}

/// The test of [S00, 3.5] at each period: variances of x and y over the last 51 samples together below [`PUBLISHED`].
#[must_use]
pub fn published(drive: &Drive) -> Vec<bool> {
    let dt = drive.periods.get(1).map_or(0.02, |p| p.dt);
    windows(drive, 51.0 * dt)
        .iter()
        .map(|w| {
            let [accel, _] = w.variances();
            w.n > 50.0 && w.measured() && accel.x + accel.y < PUBLISHED
        })
        .collect()
}

/// A car whose stand ended with another mean force has pulled off: a steady pull is as quiet as a stand, and an old fix says
/// nothing of it. It stands again once what it took up is taken back.
struct Gone {
    /// Mean force of the stand, m/s^2.
    force: Vector3<f64>,
    /// Level speed taken up since, m/s.
    speed: Vector2<f64>,
    /// For so long, s.
    since_s: f64,
}

impl Gone {
    /// What may be left of the speed of a car that is back: m/s, and m/s a second (the slope is another there).
    const LEFT: [f64; 2] = [0.1, 0.15];
    /// A stand so long has a mean that is no more that of the braking before it, s.
    const KNOWN_S: f64 = 2.0;
    /// After so long the sum says no more, s. With 2 s a car that rolled off at 1.2 m/s stood again, told so by the fix before;
    /// with 5 s soft stands that follow each other are missed.
    const TOLD_S: f64 = 3.0;

    fn new(force: &Vector3<f64>, now: &Vector3<f64>, window_s: f64) -> Self {
        Self {
            force: *force,
            speed: (now - force).xy() * window_s,
            since_s: 0.0,
        }
    }

    /// `accel` from where the means are counted.
    fn step(&mut self, accel: &Vector3<f64>, dt: f64) {
        self.speed += (accel - self.force).xy() * dt;
        self.since_s += dt;
    }

    fn may_be_back(&self) -> bool {
        self.since_s > Self::TOLD_S
            || self.speed.norm() < Self::LEFT[0] + Self::LEFT[1] * self.since_s
    }
}

impl Detector {
    /// Standing or not at each period. Looks back only; a whole window must have been still before it says so.
    #[must_use]
    pub fn detect(&self, drive: &Drive) -> Vec<bool> {
        self.detect_with(drive, &self.told(drive))
    }

    /// Level speed and its spread that the last fix tells at each period, m/s; `None` where it is too old.
    #[must_use]
    pub fn told(&self, drive: &Drive) -> Vec<Option<[f64; 2]>> {
        let mut next_fix = 0;
        let heard = |period: &Period| {
            while drive
                .fixes
                .get(next_fix)
                .is_some_and(|f| f.t_s <= period.t_s)
            {
                next_fix += 1;
            }
            next_fix
                .checked_sub(1)
                .and_then(|i| drive.fixes.get(i))
                .filter(|f| period.t_s - f.t_s <= self.speed_age_s)
                .and_then(|f| f.v_n.map(|v| [v.xy().norm(), f.v_sd.xy().norm()]))
        };
        drive.periods.iter().map(heard).collect()
    }

    /// The same where the speed of each period is heard from elsewhere: m/s and its spread.
    #[must_use]
    pub fn detect_with(&self, drive: &Drive, heard: &[Option<[f64; 2]>]) -> Vec<bool> {
        let mut out = Vec::with_capacity(drive.periods.len());
        let mut stand: Option<[Vector3<f64>; 2]> = None;
        let mut count: f64 = 0.0;
        let mut idle: Option<[f64; 3]> = None;
        let mut gone: Option<Gone> = None;
        let (list, about) = (windows(drive, self.window_s), about(drive));
        for ((window, period), heard) in list.iter().zip(&drive.periods).zip(heard) {
            let [accel, rate] = window.variances();
            let means = window.means();
            // A car that stands does not pull off without a pull: what else shakes it ends no stand.
            let strict = usize::from(heard.is_none() && stand.is_none());
            let [level, along] = self.accel[strict];
            let shaken = [accel.x + accel.y, accel.z, rate.sum()];
            let fixed = [level, along, self.rate[strict]];
            let quiet = (0..3).all(|i| {
                let known = idle.map_or(f64::INFINITY, |idle: [f64; 3]| self.idle * idle[i]);
                let bound = if strict == 1 {
                    fixed[i].min(known)
                } else {
                    fixed[i]
                };
                shaken[i] < bound
            });
            let whole = window.measured() && window.n * period.dt > 0.9 * self.window_s;
            let slow = heard.is_none_or(|[v, sd]| {
                let bound = self.speed[0] + self.speed[1] * sd;
                v < bound * if stand.is_some() { 2.0 } else { 1.0 }
            });
            let noise = [accel, rate].map(|v| (9.0 * v.sum() / window.n.max(1.0)).sqrt());
            let same = stand.as_ref().is_none_or(|[a, w]| {
                (means[0] - a).norm() < self.shift[0] + noise[0]
                    && (means[1] - w).norm() < self.shift[1] + noise[1]
            });
            if let Some(gone) = &mut gone {
                gone.step(&(period.accel - about), period.dt);
            }
            let there = gone.as_ref().is_none_or(Gone::may_be_back);
            if quiet && whole && slow && same && there {
                gone = None;
                count += 1.0;
                if heard.is_some() {
                    let mean = idle.get_or_insert(shaken);
                    for (mean, now) in mean.iter_mut().zip(shaken) {
                        *mean += 0.02 * (now - *mean);
                    }
                }
                let known = stand.get_or_insert(means);
                // The mean of the stand so far, led by its last ten seconds.
                let gain = 1.0 / count.min(real(500_usize));
                known[0] += (means[0] - known[0]) * gain;
                known[1] += (means[1] - known[1]) * gain;
                out.push(true);
            } else {
                if let Some([force, _]) = stand.take() {
                    let known = count * period.dt > Gone::KNOWN_S;
                    gone = known.then(|| Gone::new(&force, &means[0], self.window_s));
                }
                count = 0.0;
                out.push(false);
            }
        }
        out
    }

    /// The same known a second later, as one who waits for a late fix knows it anyway: within a window that was still
    /// throughout the car stood from `entry_s` before its end, and it began to move `exit_s` before that was noticed.
    #[must_use]
    pub fn hindsight(drive: &Drive, found: &[bool], entry_s: f64, exit_s: f64) -> Vec<bool> {
        let mut out = vec![false; drive.periods.len()];
        let mut k = 0;
        while k < found.len() {
            let end = k + found[k..].iter().take_while(|f| **f).count();
            if end == k {
                k += 1;
                continue;
            }
            let ends = |k: usize| drive.periods.get(k).map_or(f64::INFINITY, |p| p.t_s);
            let from = ends(k) - entry_s;
            let to = if end == found.len() {
                f64::INFINITY
            } else {
                ends(end) - exit_s
            };
            let first = drive.periods.partition_point(|p| p.t_s < from);
            let last = drive.periods.partition_point(|p| p.t_s < to);
            if let Some(stand) = out.get_mut(first..last.max(first)) {
                stand.fill(true);
            }
            k = end;
        }
        out
    }
}
