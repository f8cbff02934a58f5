//! Distribution functions of chi-square, Student's t and F, by the incomplete gamma and beta functions (Numerical Recipes,
//! 6.2 and 6.4), and their quantiles by bisection.

use crate::validate::statistics::INTERVAL;

/// Terms after which a series or a continued fraction has converged, or never will.
const TERMS: u32 = 3000;
const SMALL: f64 = 1e-300;

/// Share of a chi-square distribution with `dof` degrees of freedom below `x`; NaN for `dof` not above 0.
#[must_use]
pub fn chi_square_cdf(x: f64, dof: f64) -> f64 {
    if !(dof > 0.0 && dof.is_finite()) || x.is_nan() {
        return f64::NAN;
    }
    if x <= 0.0 {
        return 0.0;
    }
    // Beyond this Wilson and Hilferty's cube root is closer than 1e-7, and the series too long.
    if dof > 1e5 {
        let spread = 2.0 / (9.0 * dof);
        return crate::stats::normal_cdf(((x / dof).cbrt() - 1.0 + spread) / spread.sqrt());
    }
    let (a, x) = (0.5 * dof, 0.5 * x);
    let front = (a * x.ln() - x - libm::lgamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        for _ in 0..TERMS {
            n += 1.0;
            term *= x / n;
            sum += term;
            if term < sum * 1e-15 {
                break;
            }
        }
        return (front * sum).clamp(0.0, 1.0);
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1.0 / SMALL, 1.0 / b);
    let mut h = d;
    for i in 1..TERMS {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / nonzero(an * d + b);
        c = nonzero(b + an / c);
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    (1.0 - front * h).clamp(0.0, 1.0)
}

/// Quantile `p` of the chi-square distribution with `dof` degrees of freedom.
#[must_use]
pub fn chi_square_quantile(p: f64, dof: f64) -> f64 {
    let mut high = dof.max(1.0);
    while chi_square_cdf(high, dof) < p && high < 1e12 {
        high *= 2.0;
    }
    bisect(0.0, high, |x| chi_square_cdf(x, dof) < p)
}

/// Half-width, in standard errors, of the interval that holds 95 % of Student's t with `dof` degrees of freedom.
#[must_use]
pub fn student_half(dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::INFINITY;
    }
    if dof > 1e6 {
        return crate::stats::two_sided_quantile(INTERVAL);
    }
    let outside = 1.0 - INTERVAL;
    bisect(0.0, 1e4, |t| {
        beta(0.5 * dof, 0.5, dof / (dof + t * t)) > outside
    })
}

/// Probability of an F with (`d1`, `d2`) degrees of freedom above `f`.
#[must_use]
pub fn f_tail(f: f64, d1: f64, d2: f64) -> f64 {
    if f <= 0.0 {
        return 1.0;
    }
    beta(0.5 * d2, 0.5 * d1, d2 / (d2 + d1 * f))
}

/// Variance's interval of 95 % from its estimate and its degrees of freedom, in the estimate's unit squared.
#[must_use]
pub fn variance_interval(variance: f64, dof: f64) -> [f64; 2] {
    let tail = 0.5 * (1.0 - INTERVAL);
    [1.0 - tail, tail].map(|p| {
        let q = chi_square_quantile(p, dof);
        if q > 0.0 {
            variance * dof / q
        } else {
            f64::INFINITY
        }
    })
}

fn bisect(mut low: f64, mut high: f64, below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..100 {
        let mid = 0.5 * (low + high);
        if below(mid) {
            low = mid;
        } else {
            high = mid;
        }
    }
    0.5 * (low + high)
}

fn nonzero(x: f64) -> f64 {
    if x.abs() < SMALL { SMALL } else { x }
}

/// Regularised incomplete beta function.
fn beta(a: f64, b: f64, x: f64) -> f64 {
    if !(a > 0.0 && b > 0.0) || x.is_nan() {
        return f64::NAN;
    }
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    let log = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    let front = (log + a * x.ln() + b * (-x).ln_1p()).exp();
    let share = if x < (a + 1.0) / (a + b + 2.0) {
        front * fraction(a, b, x) / a
    } else {
        1.0 - front * fraction(b, a, 1.0 - x) / b
    };
    share.clamp(0.0, 1.0)
}

/// Lentz's continued fraction of the incomplete beta function.
fn fraction(a: f64, b: f64, x: f64) -> f64 {
    let (mut c, mut d) = (1.0, 1.0 / nonzero(1.0 - (a + b) * x / (a + 1.0)));
    let mut h = d;
    for m in 1..TERMS {
        let m = f64::from(m);
        for step in [
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0)),
        ] {
            d = 1.0 / nonzero(1.0 + step * d);
            c = nonzero(1.0 + step / c);
            h *= d * c;
        }
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles as every printed table has them.
    #[test]
    fn quantiles_meet_the_tables() {
        for (p, dof, table) in [
            (0.95, 1.0, 3.841_46),
            (0.05, 3.0, 0.351_85),
            (0.975, 10.0, 20.483_2),
            (0.025, 100.0, 74.221_9),
            (0.99, 1000.0, 1106.97),
            (0.975, 1e6, 1_002_773.0),
        ] {
            let q = chi_square_quantile(p, dof);
            assert!((q / table - 1.0).abs() < 1e-4, "{p} {dof}: {q}");
        }
        for (dof, table) in [
            (1.0, 12.706),
            (4.0, 2.7764),
            (30.0, 2.0423),
            (1e7, 1.959_96),
        ] {
            let t = student_half(dof);
            assert!((t / table - 1.0).abs() < 1e-4, "{dof}: {t}");
        }
        // F of (3, 10) has 5 % above 3.7083, of (4, 20) 1 % above 4.4307.
        assert!((f_tail(3.7083, 3.0, 10.0) - 0.05).abs() < 1e-5);
        assert!((f_tail(4.4307, 4.0, 20.0) - 0.01).abs() < 1e-5);
        assert!(chi_square_cdf(1.0, 0.0).is_nan() && student_half(0.0).is_infinite());
    }
}
