//! The reference receiver between its fixes, and the delay of another receiver behind it.
//!
//! Between two fixes no further apart than 1.6 periods the place follows Hermite's cubic through both places and velocities (where
//! there are velocities; else a straight line), and the velocity the cubic of Catmull and Rom through four of them.
//!
//! The delay is the shift of the reference that leaves the least sum of squares of velocity (north and east, mean difference
//! taken off), and of place. Its standard error is `sqrt(n) se(u) sqrt(n) / sum a^2` of the score `u = rest * a`, `a` the
//! reference's change a second, with [`super::correlated::mean`] for the error of the mean of `u`: rests that stay the same for a
//! while are allowed for.

use nalgebra::Vector3;
use schema::num::real;

use super::correlated::mean;
use super::distribution::student_half;
use crate::gnss::logs::place;
use crate::gnss::notes::median;
use crate::gnss::read::without_repeats;
use crate::gnss::rows::Fix;
use crate::wgs84::Geodetic;

/// Delays tried, s either way, and the step.
const REACH_S: f64 = 5.0;
const STEP_S: f64 = 0.1;
/// Share of the pairs that must be left at a delay.
const LEFT: f64 = 0.8;
/// Least pairs.
pub(super) const PAIRS: usize = 10;
/// A delay less sure than this is none, s.
const UNSURE_S: f64 = 1.0;

/// Which clock pairs receiver and reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The on-board unit's.
    Obu,
    /// GPS week and time of week: a delay does not show.
    Gps,
}

impl Clock {
    /// s on this clock, counted from the log's first GPS week.
    #[must_use]
    pub fn time(self, fix: &Fix) -> Option<f64> {
        match self {
            Self::Obu => Some(fix.head.obu_s),
            Self::Gps => Some(f64::from(fix.head.week?) * 604_800.0 + fix.head.tow_s?),
        }
    }
}

/// A fix of the reference.
#[derive(Clone, Copy, Debug)]
struct Knot {
    t_s: f64,
    ned: Vector3<f64>,
    v: Option<Vector3<f64>>,
    row: Fix,
}

/// The reference over time.
#[derive(Clone, Debug)]
pub struct Reference {
    knots: Vec<Knot>,
    origin: Geodetic,
    hole_s: f64,
}

impl Reference {
    /// From the good rows of a reference; `None` of fewer than two.
    #[must_use]
    pub fn new(rows: &[Fix], clock: Clock) -> Option<Self> {
        let good: Vec<Fix> = without_repeats(rows)
            .into_iter()
            .filter(|r| r.good != Some(false))
            .collect();
        let origin = place(good.first()?);
        let mut knots: Vec<Knot> = good
            .iter()
            .filter_map(|row| {
                Some(Knot {
                    t_s: clock.time(row)?,
                    ned: origin.to(&place(row)),
                    v: row.velocity_ned.map(Vector3::from),
                    row: *row,
                })
            })
            .collect();
        knots.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        knots.dedup_by(|b, a| b.t_s <= a.t_s);
        let period = median(knots.windows(2).map(|w| w[1].t_s - w[0].t_s).collect())?;
        Some(Self {
            knots,
            origin,
            hole_s: 1.6 * period,
        })
    }

    /// Knots about `t_s` and the share of the way between them.
    fn between(&self, t_s: f64) -> Option<(usize, f64)> {
        let next = self.knots.partition_point(|k| k.t_s < t_s);
        let first = self.knots.first()?;
        if next == 0 {
            return ((first.t_s - t_s).abs() < 1e-6).then_some((0, 0.0));
        }
        let (a, b) = (self.knots.get(next - 1)?, self.knots.get(next)?);
        let step = b.t_s - a.t_s;
        (step <= self.hole_s && step > 0.0).then(|| (next - 1, (t_s - a.t_s) / step))
    }

    /// Place, m from the origin, north, east, down.
    fn ned(&self, t_s: f64) -> Option<Vector3<f64>> {
        let (i, x) = self.between(t_s)?;
        let a = self.knots.get(i)?;
        let Some(b) = self.knots.get(i + 1) else {
            return Some(a.ned);
        };
        let (Some(va), Some(vb)) = (a.v, b.v) else {
            return Some(a.ned + (b.ned - a.ned) * x);
        };
        let h = b.t_s - a.t_s;
        let (x2, x3) = (x * x, x * x * x);
        Some(
            a.ned * (2.0 * x3 - 3.0 * x2 + 1.0)
                + va * (h * (x3 - 2.0 * x2 + x))
                + b.ned * (3.0 * x2 - 2.0 * x3)
                + vb * (h * (x3 - x2)),
        )
    }

    /// Place.
    #[must_use]
    pub fn place(&self, t_s: f64) -> Option<Geodetic> {
        self.ned(t_s).map(|ned| self.origin.moved(&ned))
    }

    /// Velocity north, east, down, m/s.
    #[must_use]
    pub fn velocity(&self, t_s: f64) -> Option<Vector3<f64>> {
        let (i, x) = self.between(t_s)?;
        let v = |i: usize| self.knots.get(i).and_then(|k| k.v);
        let a = v(i)?;
        let Some(b) = v(i + 1) else {
            return (x == 0.0).then_some(a);
        };
        let before = i.checked_sub(1).and_then(v).unwrap_or(a);
        let after = v(i + 2).unwrap_or(b);
        let (ma, mb) = ((b - before) * 0.5, (after - a) * 0.5);
        let (x2, x3) = (x * x, x * x * x);
        Some(
            a * (2.0 * x3 - 3.0 * x2 + 1.0)
                + ma * (x3 - 2.0 * x2 + x)
                + b * (3.0 * x2 - 2.0 * x3)
                + mb * (x3 - x2),
        )
    }

    /// The row of the reference nearest to `t_s`.
    #[must_use]
    pub fn row(&self, t_s: f64) -> Option<&Fix> {
        let (i, x) = self.between(t_s)?;
        self.knots
            .get(if x > 0.5 { i + 1 } else { i })
            .map(|k| &k.row)
    }

    /// What is compared at a delay: the receiver's and the reference's, m or m/s, north and east.
    fn pair(&self, what: Aligned, fix: &Fix, t_s: f64) -> Option<[[f64; 2]; 2]> {
        let flat = |v: Vector3<f64>| [v.x, v.y];
        match what {
            Aligned::Velocity => {
                let [n, e, _] = fix.velocity_ned?;
                Some([[n, e], flat(self.velocity(t_s)?)])
            }
            Aligned::Place => Some([flat(self.origin.to(&place(fix))), flat(self.ned(t_s)?)]),
        }
    }

    /// Receiver less reference at a delay, and the reference's change a second; means not yet taken off.
    fn rests(&self, what: Aligned, fixes: &[(f64, Fix)], delay: f64) -> Vec<[[f64; 2]; 2]> {
        const H: f64 = 0.05;
        fixes
            .iter()
            .filter_map(|(t, fix)| {
                let [ours, here] = self.pair(what, fix, t - delay)?;
                let ahead = self.pair(what, fix, t - delay + H);
                let behind = self.pair(what, fix, t - delay - H);
                let change = match (behind, ahead) {
                    (Some(a), Some(b)) => [0, 1].map(|i| (b[1][i] - a[1][i]) / (2.0 * H)),
                    (Some(a), None) => [0, 1].map(|i| (here[i] - a[1][i]) / H),
                    (None, Some(b)) => [0, 1].map(|i| (b[1][i] - here[i]) / H),
                    (None, None) => return None,
                };
                Some([[0, 1].map(|i| ours[i] - here[i]), change])
            })
            .collect()
    }

    /// The delay of a receiver behind the reference, fixes with their stamps.
    ///
    /// # Errors
    /// A sentence why it cannot be told.
    pub fn delay(&self, what: Aligned, fixes: &[(f64, Fix)]) -> Result<Delay, String> {
        let whole = self.rests(what, fixes, 0.0).len().max(PAIRS);
        let cost = |delay: f64| -> Option<f64> {
            let rests = centred(self.rests(what, fixes, delay));
            (real(rests.len()) >= LEFT * real(whole)).then(|| {
                let sum = |r: &[[f64; 2]; 2]| r[0][0].powi(2) + r[0][1].powi(2);
                rests.iter().map(sum).sum::<f64>() / real(rests.len())
            })
        };
        let mut best: Option<(f64, f64)> = None;
        let mut t = -REACH_S;
        while t <= REACH_S + 1e-9 {
            if let Some(c) = cost(t)
                && best.is_none_or(|(least, _)| c < least)
            {
                best = Some((c, t));
            }
            t += STEP_S;
        }
        let Some((_, mut delay)) = best else {
            return Err(format!(
                "Cannot tell the delay from the {}: fewer than {PAIRS} pairs.",
                what.name()
            ));
        };
        if delay.abs() > REACH_S - 1.5 * STEP_S {
            return Err(format!(
                "Cannot tell the delay from the {}: none within {REACH_S} s fits best.",
                what.name()
            ));
        }
        let near = delay;
        let mut found = None;
        for _ in 0..8 {
            let rests = centred(self.rests(what, fixes, delay));
            let inner = |a: usize, b: usize| -> f64 {
                let each = rests
                    .iter()
                    .map(|r| (0..2).map(|i| r[a][i] * r[b][i]).sum::<f64>());
                each.sum()
            };
            let (push, square) = (inner(0, 1), inner(1, 1));
            let score: Vec<f64> = rests
                .iter()
                .map(|r| (0..2).map(|i| r[0][i] * r[1][i]).sum())
                .collect();
            found = mean(&score)
                .filter(|_| square > 0.0)
                .map(|u| (u, u.se * real(score.len()) / square));
            let step = if square > 0.0 { push / square } else { 0.0 };
            // The rests grow by `a` a second of delay.
            delay = (delay - step).clamp(near - STEP_S, near + STEP_S);
            if step.abs() < 1e-6 {
                break;
            }
        }
        let unsure = |se: f64| {
            format!(
                "Cannot tell the delay from the {}: standard error {se:.1} s, too little changes.",
                what.name()
            )
        };
        let (score, se) = found.ok_or_else(|| unsure(f64::INFINITY))?;
        if se.is_nan() || se >= UNSURE_S {
            return Err(unsure(se));
        }
        let half = student_half(score.dof) * se;
        Ok(Delay {
            value_s: delay,
            se_s: se,
            ends_s: [delay - half, delay + half],
            pairs: score.count,
            short: score.short,
        })
    }
}

/// Rests and changes with their means taken off.
fn centred(mut rests: Vec<[[f64; 2]; 2]>) -> Vec<[[f64; 2]; 2]> {
    let n = real(rests.len().max(1));
    for what in 0..2 {
        for axis in 0..2 {
            let mean = rests.iter().map(|r| r[what][axis]).sum::<f64>() / n;
            for r in &mut rests {
                r[what][axis] -= mean;
            }
        }
    }
    rests
}

/// What is laid over the reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aligned {
    /// Velocity north and east.
    Velocity,
    /// Place.
    Place,
}

impl Aligned {
    /// A word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Place => "position",
        }
    }
}

/// A delay behind the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delay {
    /// s, positive: the receiver's stamps are late.
    pub value_s: f64,
    /// Standard error, s.
    pub se_s: f64,
    /// Interval of 95 %, s.
    pub ends_s: [f64; 2],
    /// Pairs.
    pub pairs: usize,
    /// True if the rests stay alike for so long that the interval may be too narrow.
    pub short: bool,
}
