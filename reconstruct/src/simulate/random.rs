//! Random numbers that stay the same: `ChaCha8`, with the distributions written out here.
//!
//! The generator's stream is fixed by its definition; the way to a uniform and a normal number is fixed by
//! this file, so a new version of a distribution crate cannot change a scenario.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use schema::num;

use super::class::Class;

/// Independent streams of one seed: switching one cause off leaves the others' draws as they were.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stream {
    /// Manoeuvre, impact, car.
    Scenario = 1,
    /// Constant sensor errors.
    Errors = 2,
    /// Road, lane keeping and sideslip over time.
    Motion = 3,
    /// White noise and vibration of the IMU.
    Imu = 4,
    /// Noise of the wheel sensors.
    Wheels = 5,
    /// Lost frames.
    Bus = 6,
    /// Receive jitter.
    Jitter = 7,
}

/// One stream of random numbers.
#[derive(Clone, Debug)]
pub(super) struct Random {
    generator: ChaCha8Rng,
    spare: Option<f64>,
}

impl Random {
    /// Stream `stream` of a class and `seed`.
    pub(super) fn new(class: Class, seed: u64, stream: Stream) -> Self {
        let number: u64 = match stream {
            Stream::Scenario => 1,
            Stream::Errors => 2,
            Stream::Motion => 3,
            Stream::Imu => 4,
            Stream::Wheels => 5,
            Stream::Bus => 6,
            Stream::Jitter => 7,
        };
        let mut key = [0_u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&number.to_le_bytes());
        key[16..24].copy_from_slice(b"svartsim");
        for (byte, letter) in key[24..].iter_mut().zip(class.name().bytes()) {
            *byte = letter;
        }
        Self {
            generator: ChaCha8Rng::from_seed(key),
            spare: None,
        }
    }

    /// Uniform in `[0, 1)`, 53 bits.
    pub(super) fn unit(&mut self) -> f64 {
        const TWO_TO_MINUS_53: f64 = 1.0 / 9_007_199_254_740_992.0;
        num::real_u64(self.generator.next_u64() >> 11) * TWO_TO_MINUS_53
    }

    /// Uniform in `[low, high)`.
    pub(super) fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Plus or minus one.
    pub(super) fn sign(&mut self) -> f64 {
        if self.unit() < 0.5 { -1.0 } else { 1.0 }
    }

    /// True with probability `p`; always takes one number.
    pub(super) fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    /// Standard normal (Marsaglia's polar method, second value kept).
    pub(super) fn normal(&mut self) -> f64 {
        if let Some(value) = self.spare.take() {
            return value;
        }
        loop {
            let (a, b) = (2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0);
            let s = a * a + b * b;
            if s > 0.0 && s < 1.0 {
                let scale = (-2.0 * s.ln() / s).sqrt();
                self.spare = Some(b * scale);
                return a * scale;
            }
        }
    }

    /// Three independent normals of standard deviation `sd`.
    pub(super) fn normals(&mut self, sd: f64) -> [f64; 3] {
        [self.normal() * sd, self.normal() * sd, self.normal() * sd]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_fixed_and_differ() {
        let mut a = Random::new(Class::Side, 1, Stream::Imu);
        let mut b = Random::new(Class::Side, 1, Stream::Imu);
        let mut c = Random::new(Class::Side, 1, Stream::Bus);
        let first = a.unit();
        assert_eq!(first.to_bits(), b.unit().to_bits());
        assert_ne!(first.to_bits(), c.unit().to_bits());
    }

    #[test]
    fn normal_has_its_moments() {
        let mut random = Random::new(Class::Side, 7, Stream::Imu);
        let n = 200_000;
        let (mut sum, mut square, mut fourth) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let x = random.normal();
            sum += x;
            square += x * x;
            fourth += x.powi(4);
        }
        let n = f64::from(n);
        assert!((sum / n).abs() < 0.01, "mean {}", sum / n);
        assert!((square / n - 1.0).abs() < 0.02, "variance {}", square / n);
        assert!(
            (fourth / n - 3.0).abs() < 0.15,
            "fourth moment {}",
            fourth / n
        );
    }
}
