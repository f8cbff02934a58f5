//! A receiver against the reference [S00, tables 4.1 to 4.3], and whether it knows its own errors.
//!
//! Deviations are receiver less reference at the receiver's stamp, as it stands and with the delay found taken off. Figures
//! and their intervals are those of [`super::correlated`]. The course is compared above 3 m/s, the gate of S00 [S00, 4.4].
//!
//! Where the log states sigmas (columns 22 to 24, else the errors of columns 20 and 21), the mean of the squared deviations
//! over the stated variances (NEES, per axis) should be one, and 95 % of the fixes should lie in their ellipses.

use nalgebra::Vector3;

use super::correlated::{self as figures, Figure};
use super::reference::{Aligned, Clock, Delay, PAIRS, Reference};
use crate::gnss::logs::place;
use crate::gnss::read::without_repeats;
use crate::gnss::rows::{Fix, Leg};
use crate::stats::ellipse_radius;

/// Speed from which a course is one, m/s [S00, 6.5].
const COURSE_SPEED: f64 = 3.0;

/// An interval of the squared deviation over the stated variance that reaches so far from 1 and holds it tells nothing.
const OPEN: f64 = 4.0;

/// Names and units of the quantities.
pub const QUANTITIES: [(&str, &str); 7] = [
    ("north", "m"),
    ("east", "m"),
    ("height", "m"),
    ("velocity north", "m/s"),
    ("velocity east", "m/s"),
    ("velocity down", "m/s"),
    ("course", "deg"),
];

/// Figures of one quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Mean absolute deviation: what S00's tables have.
    pub mean_abs: Figure,
    /// Mean.
    pub bias: Figure,
    /// Standard deviation about the mean; `None` of one value.
    pub sd: Option<Figure>,
    /// Root mean square.
    pub rms: Figure,
    /// Largest size.
    pub largest: f64,
}

impl Figures {
    /// Of deviations in order of time; `None` of none.
    #[must_use]
    pub fn of(x: &[f64]) -> Option<Self> {
        Some(Self {
            mean_abs: figures::mean_abs(x)?,
            bias: figures::mean(x)?,
            sd: figures::sd(x),
            rms: figures::rms(x)?,
            largest: x.iter().fold(0.0, |m, v| v.abs().max(m)),
        })
    }
}

/// Deviations at one instant: the quantities of [`QUANTITIES`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Off {
    /// s of the receiver's clock.
    pub t_s: f64,
    /// Values; `None` where one of both has none.
    pub value: [Option<f64>; 7],
    /// Horizontal deviation, m.
    pub flat: f64,
    /// Squared deviation over the stated variance, horizontal (two axes) and vertical.
    pub stated: [Option<f64>; 2],
    /// True outside of the stated bounds of integrity (columns 33 to 35), any axis.
    pub breach: Option<bool>,
}

/// Deviations of a receiver, summed up.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// One a quantity.
    pub quantities: [Option<Figures>; 7],
    /// Quantiles 50 % and 95 % of the horizontal deviation, m.
    pub flat: Option<[Figure; 2]>,
}

/// Whether a stated accuracy holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Honesty {
    /// Squared deviation over the stated variance, a degree of freedom: 1 if it holds.
    pub nees: Figure,
    /// Share within the stated 95 %.
    pub inside: Figure,
}

impl Honesty {
    /// What it comes to.
    #[must_use]
    pub fn verdict(&self) -> &'static str {
        if self.nees.low > 1.0 {
            "too small: the receiver is less accurate than it says"
        } else if self.nees.high < 1.0 {
            "too large: the receiver is more accurate than it says"
        } else if self.nees.high > OPEN || self.nees.low < 1.0 / OPEN {
            "is not to be judged by these fixes"
        } else {
            "agrees with the deviations, within what these fixes tell"
        }
    }
}

/// A receiver on one leg.
#[derive(Clone, Debug, PartialEq)]
pub struct Receiver {
    /// Who.
    pub leg: Leg,
    /// Good fixes.
    pub fixes: usize,
    /// Those that meet the reference.
    pub paired: usize,
    /// Clock they meet on.
    pub clock: Clock,
    /// Delay by velocity, and by place.
    pub delay: [Result<Delay, String>; 2],
    /// Deviations as stamped.
    pub stamped: Summary,
    /// With the delay taken off; `None` where it is not told.
    pub shifted: Option<Summary>,
    /// The deviations that the pictures show: shifted, or as stamped.
    pub series: Vec<Off>,
    /// Mean speed of the reference over ground at these fixes, m/s.
    pub speed: Option<f64>,
    /// Horizontal and vertical, over all delays within the interval of the one taken off; an `Err` is a sentence.
    pub honesty: [Result<Honesty, String>; 2],
    /// Fixes beyond the stated bounds of integrity, and fixes that state some.
    pub breaches: Option<[usize; 2]>,
}

impl Receiver {
    /// The delay that is taken off.
    #[must_use]
    pub fn taken(&self) -> Option<Delay> {
        self.delay.iter().find_map(|d| d.as_ref().ok().copied())
    }
}

/// Every receiver of the log but the reference, by leg.
///
/// # Errors
/// A sentence, if there is no reference or no fix.
pub fn receivers(
    fixes: &[Fix],
    reference: &[Fix],
    reference_id: u32,
) -> Result<Vec<Result<Receiver, String>>, String> {
    let own: Vec<Fix> = reference_rows(fixes, reference, reference_id);
    if fixes.is_empty() {
        return Err("Cannot tell: no log of fixes.".to_owned());
    }
    if own.is_empty() {
        return Err(format!(
            "Cannot tell: no reference (--reference, or equipment {reference_id} among the fixes)."
        ));
    }
    let legs = fixes.chunk_by(|a, b| a.head.leg == b.head.leg);
    let of = |rows: &[Fix]| -> Option<Result<Receiver, String>> {
        let leg = rows.first()?.head.leg;
        let same: Vec<Fix> = own
            .iter()
            .filter(|r| r.head.leg.drive == leg.drive && r.head.leg.leg == leg.leg)
            .copied()
            .collect();
        let chosen = if same.is_empty() { &own } else { &same };
        Some(receiver(leg, rows, chosen))
    };
    let list: Vec<_> = legs
        .filter(|rows| {
            // The reference beside others in one log is no receiver to be judged.
            !(reference.is_empty() && rows.iter().any(|r| r.head.leg.equipment == reference_id))
        })
        .filter_map(of)
        .collect();
    if list.is_empty() {
        return Err(format!(
            "Cannot tell: the log of fixes holds those of the reference alone (equipment {reference_id})."
        ));
    }
    Ok(list)
}

fn reference_rows(fixes: &[Fix], reference: &[Fix], id: u32) -> Vec<Fix> {
    if !reference.is_empty() {
        return reference.to_vec();
    }
    let mut rows: Vec<Fix> = fixes.to_vec();
    rows.retain(|r| r.head.leg.equipment == id);
    rows
}

fn receiver(leg: Leg, rows: &[Fix], reference: &[Fix]) -> Result<Receiver, String> {
    let good: Vec<Fix> = without_repeats(rows)
        .into_iter()
        .filter(|r| r.good != Some(false))
        .collect();
    let (clock, path, stamped) = [Clock::Obu, Clock::Gps]
        .into_iter()
        .find_map(|clock| {
            let path = Reference::new(reference, clock)?;
            let stamped = offs(&path, &good, clock, 0.0);
            (stamped.len() >= PAIRS).then_some((clock, path, stamped))
        })
        .ok_or_else(|| {
            format!(
                "Equipment {} drive {} leg {}: cannot tell: fewer than {PAIRS} of {} fixes meet the reference on the on-board clock or in GPS time.",
                leg.equipment,
                leg.drive,
                leg.leg,
                good.len()
            )
        })?;
    let timed: Vec<(f64, Fix)> = good
        .iter()
        .filter_map(|f| Some((clock.time(f)?, *f)))
        .collect();
    let delay = [Aligned::Velocity, Aligned::Place].map(|what| path.delay(what, &timed));
    let off = delay.iter().find_map(|d| d.as_ref().ok().copied());
    let shifted = off.map(|d| offs(&path, &good, clock, d.value_s));
    let series = shifted.clone().unwrap_or_else(|| stamped.clone());
    let tried: Vec<Vec<Off>> = off.map_or_else(
        || vec![series.clone()],
        |d| {
            let share = |s: f64| d.ends_s[0] + s * (d.ends_s[1] - d.ends_s[0]);
            let delays = [d.value_s, share(0.0), share(0.25), share(0.75), share(1.0)];
            delays
                .into_iter()
                .filter(|d| d.is_finite())
                .map(|d| offs(&path, &good, clock, d))
                .collect()
        },
    );
    let speeds: Vec<f64> = series
        .iter()
        .filter_map(|o| Some(path.velocity(o.t_s)?.xy().norm()))
        .collect();
    let bounds: Vec<bool> = series.iter().filter_map(|o| o.breach).collect();
    Ok(Receiver {
        leg,
        fixes: good.len(),
        paired: stamped.len(),
        clock,
        delay,
        stamped: summary(&stamped),
        shifted: shifted.as_deref().map(summary),
        speed: figures::mean(&speeds).map(|f| f.value),
        honesty: [over(&tried, 0), over(&tried, 1)],
        breaches: (!bounds.is_empty())
            .then(|| [bounds.iter().filter(|b| **b).count(), bounds.len()]),
        series,
    })
}

fn summary(offs: &[Off]) -> Summary {
    let of = |i: usize| {
        let x: Vec<f64> = offs.iter().filter_map(|o| o.value[i]).collect();
        Figures::of(&x)
    };
    let flat: Vec<f64> = offs.iter().map(|o| o.flat).collect();
    let both = || {
        Some([
            figures::quantile_of(&flat, 0.5)?,
            figures::quantile_of(&flat, 0.95)?,
        ])
    };
    Summary {
        quantities: [0, 1, 2, 3, 4, 5, 6].map(of),
        flat: both(),
    }
}

/// Honesty at the first of several delays, horizontal or vertical, its intervals as wide as all of them make it: a delay that is
/// not surely known must not be held against the receiver.
fn over(tried: &[Vec<Off>], which: usize) -> Result<Honesty, String> {
    let axes = if which == 0 { 2.0 } else { 1.0 };
    let mut all = tried.iter().map(|series| {
        let squares: Vec<f64> = series.iter().filter_map(|o| o.stated[which]).collect();
        honesty(&squares, axes)
    });
    let mut first = all
        .next()
        .unwrap_or_else(|| Err("cannot tell: no fix meets the reference".to_owned()))?;
    for other in all.flatten() {
        for (own, more) in [
            (&mut first.nees, other.nees),
            (&mut first.inside, other.inside),
        ] {
            own.low = own.low.min(more.low);
            own.high = own.high.max(more.high);
        }
    }
    Ok(first)
}

fn honesty(squares: &[f64], axes: f64) -> Result<Honesty, String> {
    let each: Vec<f64> = squares.iter().map(|s| s / axes).collect();
    // The quantile of chi-square with one degree, and with two.
    let bound = if axes > 1.0 {
        ellipse_radius(0.95)
    } else {
        crate::stats::two_sided_quantile(0.95)
    };
    let inside: Vec<f64> = squares
        .iter()
        .map(|s| if *s <= bound * bound { 1.0 } else { 0.0 })
        .collect();
    let both = figures::mean(&each).zip(figures::mean(&inside));
    let (nees, mut inside) =
        both.ok_or("cannot tell: the log states no sigma (columns 20 to 24)")?;
    inside.low = inside.low.max(0.0);
    inside.high = inside.high.min(1.0);
    let nees = nees.positive();
    // All inside, or none: what as many independent fixes as these are worth leave open (exact, of 95 %).
    let open = 0.025_f64.powf(1.0 / nees.effective.max(1.0));
    if inside.value >= 1.0 {
        inside.low = inside.low.min(open);
    } else if inside.value <= 0.0 {
        inside.high = inside.high.max(1.0 - open);
    }
    Ok(Honesty { nees, inside })
}

/// Deviations from the reference of `delay_s` before each stamp.
fn offs(path: &Reference, fixes: &[Fix], clock: Clock, delay_s: f64) -> Vec<Off> {
    fixes
        .iter()
        .filter_map(|fix| {
            let t_s = clock.time(fix)?;
            off(path, fix, t_s, t_s - delay_s)
        })
        .collect()
}

fn off(path: &Reference, fix: &Fix, t_s: f64, at_s: f64) -> Option<Off> {
    let there = path.place(at_s)?;
    let row = path.row(at_s)?;
    let d = there.to(&place(fix));
    // Heights of one kind only: the geoid lies tens of metres off the ellipsoid.
    let kind = |f: &Fix| (f.ellipsoid_height.is_some(), f.sea_height.is_some());
    let up = if kind(fix).0 && kind(row).0 {
        Some(-d.z)
    } else if kind(fix) == (false, true) && kind(row) == (false, true) {
        Some(fix.sea_height? - there.height)
    } else {
        None
    };
    let v = fix
        .velocity_ned
        .map(Vector3::from)
        .zip(path.velocity(at_s))
        .map(|(a, b)| a - b);
    let stated = stated(fix, row, &d);
    let bounds = fix.integrity_ned;
    let breach = bounds
        .iter()
        .any(Option::is_some)
        .then(|| (0..3).any(|i| bounds[i].is_some_and(|b| d[i].abs() > b)));
    Some(Off {
        t_s,
        value: [
            Some(d.x),
            Some(d.y),
            up,
            v.map(|v| v.x),
            v.map(|v| v.y),
            v.map(|v| v.z),
            course(fix, path, at_s),
        ],
        flat: d.xy().norm(),
        stated: [stated[0], stated[1].filter(|_| up.is_some())],
        breach,
    })
}

/// Difference of the courses, deg, -180 to 180.
fn course(fix: &Fix, path: &Reference, at_s: f64) -> Option<f64> {
    let there = path.velocity(at_s)?;
    let own = fix.velocity_ned.map(Vector3::from);
    let speed = fix.speed.or(own.map(|v| v.xy().norm()))?;
    let course = fix.course.or(own.map(|v| v.y.atan2(v.x)))?;
    (speed > COURSE_SPEED && there.xy().norm() > COURSE_SPEED).then(|| {
        let turn = course - there.y.atan2(there.x);
        turn.sin().atan2(turn.cos()).to_degrees()
    })
}

/// Squared deviation over the stated variances, horizontal and vertical; the reference's own are added where it states some.
fn stated(fix: &Fix, row: &Fix, d: &Vector3<f64>) -> [Option<f64>; 2] {
    let variance = |f: &Fix, i: usize| -> Option<f64> {
        let said = if i < 2 {
            f.horizontal_error.map(|e| e / std::f64::consts::SQRT_2)
        } else {
            f.vertical_error
        };
        f.sd_ned[i].or(said).filter(|s| *s > 0.0).map(|s| s * s)
    };
    let part = |i: usize| -> Option<f64> {
        let all = variance(fix, i)? + variance(row, i).unwrap_or(0.0);
        Some(d[i] * d[i] / all)
    };
    [part(0).zip(part(1)).map(|(n, e)| n + e), part(2)]
}
