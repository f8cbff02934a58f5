//! Bounds for counted things: shares (Clopper and Pearson) and rates (Garwood's exact bounds of a Poisson mean).

use schema::num::real;

/// One less the confidence of every bound here.
const ALPHA: f64 = 0.05;

/// Two-sided 95 % interval of a share, `hits` of `of`.
pub fn share_bounds(hits: usize, of: usize) -> (f64, f64) {
    let low = if hits == 0 {
        0.0
    } else {
        root(|p| 1.0 - binomial(hits - 1, of, p) > ALPHA / 2.0)
    };
    let high = if hits >= of {
        1.0
    } else {
        root(|p| binomial(hits, of, p) < ALPHA / 2.0)
    };
    (low, high)
}

/// One-sided 95 % upper bound of the mean of a Poisson count: 3.0 for none.
pub fn count_bound(count: usize) -> f64 {
    let most = 20.0 + 4.0 * real(count);
    most * root(|part| poisson(count, most * part) < ALPHA)
}

/// Where a condition that is false at 0 and true at 1 becomes true.
fn root(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if holds(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// Probability of at most `hits` of `of`.
fn binomial(hits: usize, of: usize, p: f64) -> f64 {
    let mut log = real(of) * (1.0 - p).ln();
    let mut sum = log.exp();
    for k in 1..=hits {
        log += ((real(of - k) + 1.0) / real(k)).ln() + p.ln() - (1.0 - p).ln();
        sum += log.exp();
    }
    sum
}

/// Probability of at most `count` where `mean` are expected.
fn poisson(count: usize, mean: f64) -> f64 {
    let mut term = (-mean).exp();
    let mut sum = term;
    for k in 1..=count {
        term *= mean / real(k);
        sum += term;
    }
    sum
}

/// The value below which the share `part` of the values lies (nearest rank).
pub fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = schema::num::round_usize((part * real(sorted.len())).ceil().max(1.0));
    sorted.get(rank - 1).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_those_of_the_tables() {
        assert!((count_bound(0) - 2.996).abs() < 1e-3);
        assert!((count_bound(1) - 4.744).abs() < 1e-3);
        assert!((count_bound(5) - 10.513).abs() < 1e-3);
        let (low, high) = share_bounds(500, 500);
        assert!((low - 0.992_65).abs() < 1e-4 && high >= 1.0, "{low} {high}");
        let (low, high) = share_bounds(8, 10);
        assert!(
            (low - 0.443_9).abs() < 1e-3 && (high - 0.974_8).abs() < 1e-3,
            "{low} {high}"
        );
        assert!((quantile(&[3.0, 1.0, 2.0], 0.5) - 2.0).abs() < 1e-12);
    }
}
