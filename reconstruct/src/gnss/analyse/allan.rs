//! Overlapping Allan deviation of each axis over the still spans, and what it tells of the noise (IEEE 952-2020, annex C).
//!
//! With the output summed to `theta` at steps `t0`, the variance at `tau = m t0` is the mean of
//! `(theta[k + 2m] - 2 theta[k + m] + theta[k])^2 / (2 tau^2)`; over several spans numerators and counts are added. The band is
//! that of a chi-square with the degrees of freedom that Howe, Allan and Barnes (1981) give for white noise, flicker or
//! random walk, whichever the slope at that `tau` is nearest to.
//!
//! White noise `N` is read off the longest run of octaves whose slope is -1/2 within what its errors allow, random walk `K` off those
//! behind the minimum with slope +1/2 (white part taken off), and the bias instability `B` off the minimum, over 0.664, if it lies above what
//! white noise makes there. What the spans are too short for stays untold.

use schema::num::real;

use super::distribution::variance_interval;
use super::spans::{Sample, Situation, Spans};

/// Shortest span, s, and number of samples.
const SHORTEST_S: f64 = 8.0;
const FEWEST: usize = 100;
/// Fewest degrees of freedom of a point shown.
const FEWEST_DOF: f64 = 2.0;
/// Floor of flicker over its bias instability: the root of 2 ln 2 / pi.
const FLICKER: f64 = 0.664_28;

/// A point of the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Averaging time, s.
    pub tau_s: f64,
    /// Deviation, the axis' unit.
    pub deviation: f64,
    /// Ends of the band of 95 %.
    pub band: [f64; 2],
    /// Degrees of freedom.
    pub dof: f64,
}

/// A coefficient with its interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The curve of an axis and what it tells; an `Err` is a sentence why it does not.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Points at octaves.
    pub points: Vec<Point>,
    /// White noise, unit/sqrt(Hz), the deviation at 1 s.
    pub white: Result<Coefficient, String>,
    /// Bias instability, the unit.
    pub floor: Result<Coefficient, String>,
    /// Random walk, unit/sqrt(s).
    pub walk: Result<Coefficient, String>,
}

/// The Allan deviations of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Allan {
    /// What the spans are.
    pub situation: Situation,
    /// Their number.
    pub spans: usize,
    /// Longest, s.
    pub longest_s: f64,
    /// All together, s.
    pub total_s: f64,
    /// Specific force x, y, z, m/s^2, rate x, y, z, rad/s.
    pub curves: Vec<Curve>,
}

/// Over the rest spans if there are any, else over the stops.
///
/// # Errors
/// A sentence, if no span is long enough.
pub fn allan(spans: &Spans) -> Result<Allan, String> {
    for situation in [Situation::Rest, Situation::Stop] {
        let chosen: Vec<(f64, &[Sample])> = spans
            .stands
            .iter()
            .filter(|s| s.situation == situation)
            .filter_map(|s| Some((spans.stretches.get(s.stretch)?.period_s, spans.of(s))))
            .filter(|(p, s)| s.len() >= FEWEST && real(s.len()) * p >= SHORTEST_S)
            .collect();
        let Some(period) = chosen.first().map(|c| c.0) else {
            continue;
        };
        // Spans of another period would have other octaves.
        let like: Vec<&[Sample]> = chosen
            .iter()
            .filter(|(p, _)| (p / period - 1.0).abs() < 0.02)
            .map(|c| c.1)
            .collect();
        let lengths = || like.iter().map(|s| real(s.len()) * period);
        let curve = |axis: usize| {
            let series: Vec<Vec<f64>> = like
                .iter()
                .map(|s| s.iter().map(|s| s.axis[axis]).collect())
                .collect();
            curve(&series, period)
        };
        return Ok(Allan {
            situation,
            spans: like.len(),
            longest_s: lengths().fold(0.0, f64::max),
            total_s: lengths().sum(),
            curves: (0..6).map(curve).collect(),
        });
    }
    Err(format!(
        "Cannot tell: no stand without a gap of at least {SHORTEST_S:.0} s."
    ))
}

/// The curve of one axis: `series` one a span, evenly `period_s` apart.
#[must_use]
pub fn curve(series: &[Vec<f64>], period_s: f64) -> Curve {
    let points = points(series, period_s);
    let (white, run) = white(&points);
    let longest = points.last().map_or(0.0, |p| p.tau_s);
    let floor = floor(&points, white.as_ref().ok(), longest);
    let walk = walk(&points, white.as_ref().ok(), run, longest);
    Curve {
        points,
        white,
        floor,
        walk,
    }
}

/// Deviation at octaves of the period, up to where fewer than two degrees of freedom are left.
#[must_use]
pub fn points(series: &[Vec<f64>], period_s: f64) -> Vec<Point> {
    let sums: Vec<Vec<f64>> = series
        .iter()
        .map(|x| {
            let centre = x.iter().sum::<f64>() / real(x.len().max(1));
            let mut theta = 0.0;
            std::iter::once(0.0)
                .chain(x.iter().map(|v| {
                    theta += (v - centre) * period_s;
                    theta
                }))
                .collect()
        })
        .collect();
    let longest = sums.iter().map(Vec::len).max().unwrap_or(0);
    let mut raw: Vec<(usize, f64)> = Vec::new();
    let mut m = 1;
    while 2 * m < longest {
        let (mut sum, mut count) = (0.0, 0);
        for theta in sums.iter().filter(|t| t.len() > 2 * m) {
            for k in 0..theta.len() - 2 * m {
                sum += (theta[k + 2 * m] - 2.0 * theta[k + m] + theta[k]).powi(2);
            }
            count += theta.len() - 2 * m;
        }
        let tau = real(m) * period_s;
        raw.push((m, sum / (2.0 * tau * tau * real(count))));
        m *= 2;
    }
    let at = |i: usize| raw.get(i).map(|r| r.1.max(1e-300).log2());
    raw.iter()
        .enumerate()
        .map(|(i, (m, variance))| {
            // Slope of the variance an octave: -1 white, 0 flicker, 1 random walk.
            let ends = [i.saturating_sub(1), (i + 1).min(raw.len() - 1)];
            let slope = match (at(ends[0]), at(ends[1])) {
                (Some(a), Some(b)) if ends[1] > ends[0] => (b - a) / real(ends[1] - ends[0]),
                _ => -1.0,
            };
            let dof: f64 = sums
                .iter()
                .filter(|t| t.len() > 2 * m)
                .map(|t| freedom(t.len(), *m, slope))
                .sum();
            let [low, high] = variance_interval(*variance, dof);
            Point {
                tau_s: real(*m) * period_s,
                deviation: variance.sqrt(),
                band: [low.sqrt(), high.sqrt()],
                dof,
            }
        })
        .take_while(|p| p.dof >= FEWEST_DOF && p.deviation > 0.0)
        .collect()
}

/// Degrees of freedom of the overlapping estimate with `n` sums and averages of `m` (Howe, Allan and Barnes 1981).
fn freedom(n: usize, m: usize, slope: f64) -> f64 {
    let (n, m) = (real(n), real(m));
    let dof = if slope < -0.5 {
        (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m * m / (4.0 * m * m + 5.0)
    } else if slope < 0.5 {
        if m < 2.0 {
            2.0 * (n - 2.0).powi(2) / (2.3 * n - 4.9)
        } else {
            5.0 * n * n / (4.0 * m * (n + 3.0 * m))
        }
    } else {
        (n - 2.0) / m * ((n - 1.0).powi(2) - 3.0 * m * (n - 1.0) + 4.0 * m * m) / (n - 3.0).powi(2)
    };
    dof.max(0.5)
}

/// Slope of the deviation from point `i` to the next, and its standard error.
fn slope(points: &[Point], i: usize) -> Option<(f64, f64)> {
    let (a, b) = (points.get(i)?, points.get(i + 1)?);
    let slope = (b.deviation / a.deviation).log2();
    let se = (0.5 / a.dof + 0.5 / b.dof).sqrt() / std::f64::consts::LN_2;
    Some((slope, se))
}

/// Longest run of octaves whose slope is `wanted` within 0.05 or two standard errors, the error at most 0.3: first and last point.
fn run_of(points: &[Point], wanted: f64, from: usize) -> Option<[usize; 2]> {
    let fits = |i: usize| {
        slope(points, i)
            .is_some_and(|(s, se)| se < 0.3 && (s - wanted).abs() < 0.05_f64.max(2.0 * se))
    };
    let mut best: Option<[usize; 2]> = None;
    let mut i = from;
    while i + 1 < points.len() {
        let end = i + (i..points.len()).take_while(|k| fits(*k)).count();
        if end > i && best.is_none_or(|[a, b]| end - i > b - a) {
            best = Some([i, end]);
        }
        i = end.max(i + 1);
    }
    best
}

/// Squares averaged with their degrees of freedom, and the interval of the best of them.
fn pooled(squares: &[(f64, f64)]) -> Option<Coefficient> {
    let all: f64 = squares.iter().map(|s| s.1).sum();
    let value = squares.iter().map(|s| s.0 * s.1).sum::<f64>() / all;
    let dof = squares.iter().map(|s| s.1).fold(0.0, f64::max);
    if !(value > 0.0 && dof > 0.0) {
        return None;
    }
    let [low, high] = variance_interval(value, dof);
    Some(Coefficient {
        value: value.sqrt(),
        low: low.sqrt(),
        high: high.sqrt(),
    })
}

fn white(points: &[Point]) -> (Result<Coefficient, String>, Option<[usize; 2]>) {
    let run = run_of(points, -0.5, 0).filter(|[a, b]| b - a >= 2);
    let none = || "cannot tell: no two octaves with a slope of -1/2".to_owned();
    let Some([from, to]) = run else {
        return (Err(none()), None);
    };
    let squares: Vec<(f64, f64)> = points[from..=to]
        .iter()
        .map(|p| (p.deviation.powi(2) * p.tau_s, p.dof))
        .collect();
    (pooled(&squares).ok_or_else(none), run)
}

fn least(points: &[Point]) -> Option<(usize, &Point)> {
    points
        .iter()
        .enumerate()
        .min_by(|a, b| a.1.deviation.total_cmp(&b.1.deviation))
}

fn floor(
    points: &[Point],
    white: Option<&Coefficient>,
    longest: f64,
) -> Result<Coefficient, String> {
    let Some((at, least)) = least(points) else {
        return Err("cannot tell: no curve".to_owned());
    };
    let most = least.band[1] / FLICKER;
    let Some(n) = white else {
        return Err(format!(
            "cannot tell: no white noise to set the least against, at most {most:.2e}"
        ));
    };
    // The least lies at the end, or where white noise alone would have it.
    if at + 1 == points.len() || least.band[0] <= n.value / least.tau_s.sqrt() {
        return Err(format!(
            "cannot tell: still falling at {longest:.2} s, at most {most:.2e}"
        ));
    }
    let [low, high] = least.band.map(|b| b / FLICKER);
    Ok(Coefficient {
        value: least.deviation / FLICKER,
        low,
        high,
    })
}

fn walk(
    points: &[Point],
    white: Option<&Coefficient>,
    run: Option<[usize; 2]>,
    longest: f64,
) -> Result<Coefficient, String> {
    let none = || format!("cannot tell: no rise up to {longest:.2} s");
    let start = least(points)
        .map_or(0, |l| l.0)
        .max(run.map_or(0, |r| r[1]));
    let base = points.get(start).map_or(f64::INFINITY, |p| p.band[1]);
    let noise = white.map_or(0.0, |n| n.value * n.value);
    // A rise is seen where the band of a later point lies above that of the least.
    if !points.iter().skip(start + 1).any(|p| p.band[0] > base) {
        return Err(none());
    }
    let Some([from, to]) = run_of(points, 0.5, start) else {
        return Err(none());
    };
    // What is left once the white part is off is less sure by as much as it is less.
    let inside: Vec<(f64, f64)> = points[from..=to]
        .iter()
        .map(|p| (p.deviation.powi(2), p))
        .map(|(all, p)| ((all - noise / p.tau_s).max(0.0), all, p))
        .map(|(rest, all, p)| (3.0 * rest / p.tau_s, p.dof * (rest / all).powi(2)))
        .collect();
    pooled(&inside).ok_or_else(none)
}
