//! Figures from samples, each with its own uncertainty.

use schema::num::{real, round_usize};

use crate::stats::two_sided_quantile;

/// Confidence of the interval that every figure of a validation carries.
pub const INTERVAL: f64 = 0.95;

/// A figure and the interval that holds the true one with 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Best estimate.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Estimate {
    /// The same in another unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            low: self.low * factor,
            high: self.high * factor,
        }
    }
}

/// A share of counted cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Cases for which it holds.
    pub hits: usize,
    /// All cases.
    pub of: usize,
}

impl Share {
    /// Counts.
    pub fn count(flags: impl Iterator<Item = bool>) -> Self {
        let mut share = Self { hits: 0, of: 0 };
        for flag in flags {
            share.of += 1;
            share.hits += usize::from(flag);
        }
        share
    }

    /// The share; NaN of no cases.
    #[must_use]
    pub fn value(self) -> f64 {
        real(self.hits) / real(self.of)
    }

    /// The share with its Wilson score interval (Wilson 1927): the shares from which the counted one lies less than
    /// 1.96 of their own standard errors. `None` of no cases.
    #[must_use]
    pub fn estimate(self) -> Option<Estimate> {
        if self.of == 0 {
            return None;
        }
        let (n, p, z) = (real(self.of), self.value(), two_sided_quantile(INTERVAL));
        let shrink = 1.0 + z * z / n;
        let centre = (p + z * z / (2.0 * n)) / shrink;
        let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt() / shrink;
        Some(Estimate {
            value: p,
            low: (centre - half).max(0.0),
            high: (centre + half).min(1.0),
        })
    }
}

/// A count of rare events with the exact interval of a Poisson mean (Garwood 1936): the means under which so few, or so many,
/// have a probability of 2.5 %.
#[must_use]
pub fn poisson(count: usize) -> Estimate {
    let tail = 0.5 * (1.0 - INTERVAL);
    // Probability of `most` events or fewer under a mean.
    let below = |most: usize, mean: f64| {
        let mut term = -mean;
        let mut sum = term.exp();
        for k in 1..=most {
            term += (mean / real(k)).ln();
            sum += term.exp();
        }
        sum
    };
    let solve = |most: usize, wanted: f64| {
        let n = real(count);
        let (mut low, mut high) = (0.0, n + 10.0 * n.sqrt() + 10.0);
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            if below(most, middle) > wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    };
    Estimate {
        value: real(count),
        low: count.checked_sub(1).map_or(0.0, |n| solve(n, 1.0 - tail)),
        high: solve(count, tail),
    }
}

/// Quantile `part` (0 to 1) of sorted values, linear between the order statistics (type 7 of Hyndman and Fan); NaN of
/// no values.
#[must_use]
pub fn quantile(sorted: &[f64], part: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = part.clamp(0.0, 1.0) * real(last);
    let below = round_usize(place.floor()).min(last);
    let share = place - real(below);
    let (a, b) = (sorted[below], sorted[(below + 1).min(last)]);
    if share > 0.0 { a + share * (b - a) } else { a }
}

/// A quantile with its distribution-free interval: the order statistics whose ranks lie 1.96 binomial standard errors
/// to either side (clamped to the sample: with few values it is narrower than it says). `None` of no values.
#[must_use]
pub fn quantile_estimate(sorted: &[f64], part: f64) -> Option<Estimate> {
    let last = sorted.len().checked_sub(1)?;
    let n = real(sorted.len());
    let half = two_sided_quantile(INTERVAL) * (n * part * (1.0 - part)).sqrt();
    let low = round_usize((n * part - half).floor().max(0.0)).min(last);
    let high = round_usize((n * part + half).ceil().max(0.0)).min(last);
    let value = quantile(sorted, part);
    Some(Estimate {
        value,
        low: sorted[low].min(value),
        high: sorted[high].max(value),
    })
}

/// A mean, its interval from the standard error. `None` of no values; of one the interval is unbounded.
#[must_use]
pub fn mean(values: &[f64]) -> Option<Estimate> {
    if values.is_empty() {
        return None;
    }
    let n = real(values.len());
    let value = values.iter().sum::<f64>() / n;
    let half = if values.len() > 1 {
        let squares: f64 = values.iter().map(|x| (x - value).powi(2)).sum();
        two_sided_quantile(INTERVAL) * (squares / (n - 1.0) / n).sqrt()
    } else {
        f64::INFINITY
    };
    Some(Estimate {
        value,
        low: value - half,
        high: value + half,
    })
}

/// Root of the mean square, its interval from that of the mean square. `None` of no values.
#[must_use]
pub fn rms(values: &[f64]) -> Option<Estimate> {
    let squares: Vec<f64> = values.iter().map(|x| x * x).collect();
    mean(&squares).map(|m| Estimate {
        value: m.value.max(0.0).sqrt(),
        low: m.low.max(0.0).sqrt(),
        high: m.high.max(0.0).sqrt(),
    })
}

/// Sorted copy.
#[must_use]
pub fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

#[cfg(test)]
mod tests {
    use super::{Share, mean, quantile, quantile_estimate, rms, sorted};

    #[test]
    fn poisson_intervals_are_those_of_the_tables() {
        // Garwood's table: 0, 1, 5 and 13 events.
        for (n, low, high) in [
            (0, 0.0, 3.689),
            (1, 0.0253, 5.572),
            (5, 1.623, 11.668),
            (13, 6.922, 22.230),
        ] {
            let e = super::poisson(n);
            assert!(
                (e.low - low).abs() < 1e-3 && (e.high - high).abs() < 1e-3,
                "{e:?}"
            );
        }
        assert!(super::poisson(3000).low > 2890.0);
    }

    #[test]
    fn wilson_meets_the_published_example() {
        // Newcombe 1998, table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
        for (hits, of, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let found = Share { hits, of }.estimate().unwrap();
            assert!((found.low - low).abs() < 6e-5, "{hits} of {of}: {found:?}");
            assert!(
                (found.high - high).abs() < 6e-5,
                "{hits} of {of}: {found:?}"
            );
        }
        assert!(Share { hits: 0, of: 0 }.estimate().is_none());
    }

    #[test]
    fn quantiles_and_their_intervals() {
        let values = sorted(&[5.0, 1.0, 3.0, 2.0, 4.0]);
        assert!((quantile(&values, 0.5) - 3.0).abs() < 1e-12);
        assert!((quantile(&values, 0.9) - 4.6).abs() < 1e-12);
        assert!((quantile(&values, 1.0) - 5.0).abs() < 1e-12 && quantile(&[], 0.5).is_nan());
        let hundred: Vec<f64> = (1..=100).map(f64::from).collect();
        let median = quantile_estimate(&hundred, 0.5).unwrap();
        assert!((median.value - 50.5).abs() < 1e-12);
        assert!((median.low - 41.0).abs() < 1.1 && (median.high - 61.0).abs() < 1.1);
        assert!(quantile_estimate(&[], 0.5).is_none());
        assert!((quantile_estimate(&[2.0], 0.95).unwrap().high - 2.0).abs() < 1e-12);
    }

    #[test]
    fn means_and_roots() {
        let found = mean(&[1.0, 2.0, 3.0]).unwrap();
        assert!((found.value - 2.0).abs() < 1e-12);
        assert!((found.high - 2.0 - 1.959_964 / 3.0_f64.sqrt()).abs() < 1e-5);
        assert!((rms(&[3.0, -4.0]).unwrap().value - 12.5_f64.sqrt()).abs() < 1e-12);
        assert!(mean(&[]).is_none() && rms(&[]).is_none());
        assert!(mean(&[1.0]).unwrap().high.is_infinite());
    }
}
