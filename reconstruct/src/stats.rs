//! Gaussian quantiles and the truncated Gaussian.

use std::f64::consts::{PI, SQRT_2};

/// Density of the standard normal distribution.
#[must_use]
pub fn normal_pdf(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * PI).sqrt()
}

/// Distribution function of the standard normal distribution.
#[must_use]
pub fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

/// Half-width, in sigmas, of the central interval that holds `confidence` of a normal distribution
/// (1.96 for 0.95). `confidence` in (0, 1); found by bisection to rounding.
#[must_use]
pub fn two_sided_quantile(confidence: f64) -> f64 {
    let (mut low, mut high) = (0.0_f64, 40.0_f64);
    for _ in 0..200 {
        let mid = 0.5 * (low + high);
        if libm::erf(mid / SQRT_2) < confidence {
            low = mid;
        } else {
            high = mid;
        }
    }
    0.5 * (low + high)
}

/// Radius, in sigmas, of the ellipse that holds `confidence` of a 2-dimensional normal distribution: the
/// root of the chi-square quantile with 2 degrees of freedom (2.448 for 0.95).
#[must_use]
pub fn ellipse_radius(confidence: f64) -> f64 {
    (-2.0 * (1.0 - confidence).ln()).sqrt()
}

/// A scalar Gaussian after truncation to an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truncated {
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
    /// True if the interval cut off more than one part in a thousand.
    pub active: bool,
}

/// Truncates N(mean, variance) to [low, high] (Simon and Simon 2010). Where the whole distribution lies
/// beyond a limit the nearer limit is returned with the exponential tail's spread.
#[must_use]
pub fn truncate(mean: f64, variance: f64, low: f64, high: f64) -> Truncated {
    let sd = variance.sqrt();
    let untouched = Truncated {
        mean,
        variance,
        active: false,
    };
    if !(sd > 0.0 && sd.is_finite() && mean.is_finite()) {
        return untouched;
    }
    let (a, b) = ((low - mean) / sd, (high - mean) / sd);
    let inside = normal_cdf(b) - normal_cdf(a);
    if inside > 0.999 {
        return untouched;
    }
    if inside < 1e-12 {
        // Far beyond a limit: the density falls off exponentially from it, with the scale sd / |distance|.
        let (limit, distance) = if a > 0.0 { (low, a) } else { (high, b) };
        let scale = sd / distance.abs().max(1.0);
        let mean = limit + scale.copysign(distance);
        return Truncated {
            mean: mean.clamp(low, high),
            variance: scale * scale,
            active: true,
        };
    }
    let (pa, pb) = (normal_pdf(a), normal_pdf(b));
    let shift = (pa - pb) / inside;
    let edge = |x: f64, p: f64| if x.is_finite() { x * p } else { 0.0 };
    let factor = 1.0 + (edge(a, pa) - edge(b, pb)) / inside - shift * shift;
    Truncated {
        mean: (mean + sd * shift).clamp(low, high),
        variance: variance * factor.clamp(1e-6, 1.0),
        active: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_meet_the_tables() {
        assert!((two_sided_quantile(0.95) - 1.959_963_984_540_054).abs() < 1e-12);
        assert!((two_sided_quantile(0.5) - 0.674_489_750_196_081_7).abs() < 1e-12);
        assert!((ellipse_radius(0.95) - 2.447_746_830_680_816).abs() < 1e-12);
    }

    #[test]
    fn truncation_meets_quadrature() {
        for (mean, sd, low, high) in [
            (0.0, 1.0, -1.0, 0.5),
            (3.0, 1.0, -1.0, 1.0),
            (-0.2, 2.0, -0.1, 0.1),
        ] {
            let n = 200_000;
            let (mut mass, mut first, mut second) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let x = low + (high - low) * (f64::from(i) + 0.5) / f64::from(n);
                let p = normal_pdf((x - mean) / sd);
                mass += p;
                first += p * x;
                second += p * x * x;
            }
            let want = first / mass;
            let found = truncate(mean, sd * sd, low, high);
            assert!((found.mean - want).abs() < 1e-6, "{found:?}");
            assert!((found.variance - (second / mass - want * want)).abs() < 1e-6);
            assert!(found.active);
        }
    }

    #[test]
    fn far_beyond_a_limit_stays_inside_it() {
        let found = truncate(50.0, 1.0, -1.0, 1.0);
        assert!(found.mean <= 1.0 && found.mean > 0.9 && found.variance > 0.0);
        assert!(!truncate(0.0, 1.0, -9.0, 9.0).active);
    }
}
