//! Mean and standard deviation of values as they come.

/// Welford's sums, which keep their digits where the mean is large.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    count: f64,
    mean: f64,
    square: f64,
}

impl Moments {
    /// Takes a value.
    pub fn add(&mut self, value: f64) {
        self.count += 1.0;
        let off = value - self.mean;
        self.mean += off / self.count;
        self.square += off * (value - self.mean);
    }

    /// Values so far.
    #[must_use]
    pub fn count(&self) -> f64 {
        self.count
    }

    /// Their mean; 0 without any.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Their standard deviation; 0 with fewer than two.
    #[must_use]
    pub fn sd(&self) -> f64 {
        (self.square / (self.count - 1.0).max(1.0)).max(0.0).sqrt()
    }
}
