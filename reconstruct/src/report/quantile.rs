//! Half widths of two-sided Gaussian intervals.

/// Half width, in standard deviations, of the central interval that holds the share `confidence` of a Gaussian
/// (0.95 gives 1.96). Infinite for 1 or more, 0 for 0 or less.
#[must_use]
pub fn half_width(confidence: f64) -> f64 {
    if confidence >= 1.0 {
        return f64::INFINITY;
    }
    let (mut low, mut high) = (0.0, 9.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if central_share(middle) < confidence {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Share of a Gaussian within `z` standard deviations: the series 2 phi(z) (z + z^3/3 + z^5/15 + ...).
fn central_share(z: f64) -> f64 {
    let (mut term, mut sum, mut odd) = (z, z, 1.0);
    while term > sum * 1e-17 {
        odd += 2.0;
        term *= z * z / odd;
        sum += term;
    }
    sum * 2.0 * (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt()
}

#[cfg(test)]
mod tests {
    use super::half_width;

    #[test]
    fn tabulated_values() {
        for (share, z) in [
            (0.5, 0.674_489_750),
            (0.8, 1.281_551_566),
            (0.95, 1.959_963_985),
            (0.99, 2.575_829_304),
        ] {
            assert!((half_width(share) - z).abs() < 1e-8, "{share}");
        }
        assert!(half_width(0.0) < 1e-12 && half_width(1.0).is_infinite());
    }
}
