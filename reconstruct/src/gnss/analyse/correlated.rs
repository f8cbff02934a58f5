//! Figures from samples that are correlated in time, each with the interval that this leaves.
//!
//! The standard error of a mean is that of batch means. The integrated autocorrelation time `tau` (Geyer's initial positive
//! sequence, 1992) sets their length to at least 4 `tau`, so that neighbouring batches are nearly independent; there are 5 to 50 of
//! them, and the interval is Student's with one degree of freedom less than there are batches. Of fewer than 20 batches the plain
//! estimate `s^2 tau / n` is taken where it is larger. A series shorter than 20 `tau` has batches shorter than that: it says so
//! ([`Figure::short`]). The effective number of samples is the variance over the squared standard error, at most the number
//! counted. Mean absolute values, root mean squares and standard deviations take theirs on a logarithmic scale, the last two that of the mean
//! square; quantiles that of the share of
//! samples below them.

use schema::num::{real, round_usize};

use super::distribution::student_half;
use crate::validate::statistics::{quantile, sorted};

/// Batches of a mean, least and most.
const BATCHES: [usize; 2] = [5, 50];
/// From so many the plain estimate is not asked.
const ENOUGH: usize = 20;
/// Integrated autocorrelation times in a batch.
const TIMES: f64 = 4.0;
/// Lags looked at.
const LAGS: usize = 1000;

/// A figure with standard error and interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Estimate.
    pub value: f64,
    /// Standard error; infinite where nothing tells.
    pub se: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Samples.
    pub count: usize,
    /// How many independent ones they are worth.
    pub effective: f64,
    /// Degrees of freedom of the standard error.
    pub dof: f64,
    /// True if the series is short against its own correlation: the interval may be too narrow.
    pub short: bool,
}

impl Figure {
    /// Value, standard error and ends in another unit; a negative factor turns the ends round.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        let ends = [self.low * factor, self.high * factor];
        self.value *= factor;
        self.se *= factor.abs();
        self.low = ends[0].min(ends[1]);
        self.high = ends[0].max(ends[1]);
        self
    }

    /// The interval of a figure that cannot be negative: as far by its logarithm as the plain one to first order.
    #[must_use]
    pub fn positive(mut self) -> Self {
        if self.value > 0.0 && self.se > 0.0 {
            let factor = ((self.high - self.value) / self.value).exp();
            self.low = self.value / factor;
            self.high = self.value * factor;
        }
        self
    }

    /// The root of a mean square.
    fn root(self) -> Self {
        let mut out = self.positive();
        let value = out.value.max(0.0).sqrt();
        out.se = if value > 0.0 {
            0.5 * out.se / value
        } else {
            out.se.sqrt()
        };
        out.value = value;
        out.low = out.low.max(0.0).sqrt();
        out.high = out.high.max(0.0).sqrt();
        out
    }
}

/// Integrated autocorrelation time of a series, samples, at least 1 (Geyer's initial positive sequence: pairs of
/// autocorrelations are summed up to the first that is not positive).
#[must_use]
pub fn autocorrelation_time(x: &[f64]) -> f64 {
    let n = x.len();
    if n < 4 {
        return 1.0;
    }
    let mean = x.iter().sum::<f64>() / real(n);
    let lag = |k: usize| -> f64 {
        x.iter()
            .zip(&x[k.min(n)..])
            .map(|(a, b)| (a - mean) * (b - mean))
            .sum()
    };
    let zero = lag(0);
    if zero.is_nan() || zero <= 0.0 {
        return 1.0;
    }
    let mut sum = -1.0;
    let mut k = 0;
    while k + 1 < (n / 2).min(LAGS) {
        let pair = (lag(k) + lag(k + 1)) / zero;
        if pair <= 0.0 {
            break;
        }
        sum += 2.0 * pair;
        k += 2;
    }
    sum.clamp(1.0, real(n))
}

/// Mean of a series in order of time; `None` of no values.
#[must_use]
pub fn mean(x: &[f64]) -> Option<Figure> {
    let n = x.len();
    if n == 0 {
        return None;
    }
    let value = x.iter().sum::<f64>() / real(n);
    let unknown = Figure {
        value,
        se: f64::INFINITY,
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
        count: n,
        effective: 1.0,
        dof: 0.0,
        short: true,
    };
    if n < 2 {
        return Some(unknown);
    }
    let variance = x.iter().map(|v| (v - value).powi(2)).sum::<f64>() / real(n - 1);
    let tau = autocorrelation_time(x);
    let wanted = real(n) / (TIMES * tau);
    let batches = round_usize(wanted.floor())
        .clamp(BATCHES[0], BATCHES[1])
        .min(n);
    let short = wanted < real(BATCHES[0]);
    let cut = |b: usize| b * n / batches;
    let means: Vec<f64> = (0..batches)
        .filter_map(|b| x.get(cut(b)..cut(b + 1)))
        .map(|part| part.iter().sum::<f64>() / real(part.len().max(1)))
        .collect();
    let scatter = means.iter().map(|m| (m - value).powi(2)).sum::<f64>() / real(batches - 1);
    let plain = variance * tau / real(n);
    let own = scatter / real(batches);
    // Many batches know better: what swings to and fro (an engine) has a mean far surer than its samples alone would make it.
    let square = if batches < ENOUGH {
        own.max(plain)
    } else {
        own
    };
    let (se, dof) = (square.sqrt(), real(batches - 1));
    let half = student_half(dof) * se;
    Some(Figure {
        value,
        se,
        low: value - half,
        high: value + half,
        effective: if square > 0.0 {
            (variance / square).min(real(n))
        } else {
            real(n)
        },
        dof,
        short,
        ..unknown
    })
}

/// Mean of the absolute values.
#[must_use]
pub fn mean_abs(x: &[f64]) -> Option<Figure> {
    mean(&x.iter().map(|v| v.abs()).collect::<Vec<f64>>()).map(Figure::positive)
}

/// Root mean square.
#[must_use]
pub fn rms(x: &[f64]) -> Option<Figure> {
    mean(&x.iter().map(|v| v * v).collect::<Vec<f64>>()).map(Figure::root)
}

/// Standard deviation about the series' own mean. The squares are enlarged by what that mean takes, one effective sample.
#[must_use]
pub fn sd(x: &[f64]) -> Option<Figure> {
    let centre = mean(x)?;
    if x.len() < 2 {
        return None;
    }
    let grown = centre.effective / (centre.effective - 1.0).max(1.0);
    let squares: Vec<f64> = x
        .iter()
        .map(|v| grown * (v - centre.value).powi(2))
        .collect();
    mean(&squares).map(Figure::root)
}

/// Quantile `part` (0 to 1): ends are the quantiles at the ends of the interval of the share below; an end that lies beyond
/// the sample is infinite, or 0 below, since the values are distances.
#[must_use]
pub fn quantile_of(x: &[f64], part: f64) -> Option<Figure> {
    let order = sorted(x);
    let value = quantile(&order, part);
    let below: Vec<f64> = x
        .iter()
        .map(|v| if *v <= value { 1.0 } else { 0.0 })
        .collect();
    let share = mean(&below)?;
    // Never less than what as many independent samples would leave.
    let n = real(x.len());
    let se = share.se.max((part * (1.0 - part) / n).sqrt());
    let half = student_half(share.dof) * se;
    let [low, high] = [part - half, part + half];
    let ends = [
        if low * n < 1.0 {
            0.0
        } else {
            quantile(&order, low)
        },
        if (1.0 - high) * n < 1.0 {
            f64::INFINITY
        } else {
            quantile(&order, high)
        },
    ];
    Some(Figure {
        value,
        se: (ends[1] - ends[0]) / (2.0 * student_half(share.dof)),
        low: ends[0],
        high: ends[1],
        ..share
    })
}
