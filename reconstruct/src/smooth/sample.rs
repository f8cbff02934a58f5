//! Sample paths from the joint posterior of all epochs.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use schema::num::real_u64;

use super::batch::Batch;
use super::posterior::Rhs;

/// Normal numbers whose way from the generator is fixed here, so that the same seed gives the same bytes.
struct Normal {
    generator: ChaCha8Rng,
    spare: Option<f64>,
}

impl Normal {
    fn new(seed: u64) -> Self {
        let mut key = [0_u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[24..].copy_from_slice(b"svartpth");
        Self {
            generator: ChaCha8Rng::from_seed(key),
            spare: None,
        }
    }

    /// In (0, 1].
    fn uniform(&mut self) -> f64 {
        (real_u64(self.generator.next_u64() >> 11) + 1.0) / real_u64(1 << 53)
    }

    /// Box and Muller's pair, one after the other.
    fn next(&mut self) -> f64 {
        if let Some(x) = self.spare.take() {
            return x;
        }
        let radius = (-2.0 * libm::log(self.uniform())).sqrt();
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * self.uniform());
        self.spare = Some(radius * sine);
        radius * cosine
    }
}

/// Standard normal numbers; the same seed gives the same.
pub(crate) fn normals(count: usize, seed: u64) -> Vec<f64> {
    let mut normal = Normal::new(seed);
    (0..count).map(|_| normal.next()).collect()
}

impl Batch {
    /// `count` paths drawn from the joint posterior: north, east and down (m) of the IMU at the end of each epoch from the
    /// first to the one the pass started from, in recording order. The same seed gives the same paths.
    #[must_use]
    pub fn paths(&self, count: usize, seed: u64) -> Vec<Vec<[f64; 3]>> {
        let mut normal = Normal::new(seed);
        (0..count).map(|_| self.path(&mut normal)).collect()
    }

    fn path(&self, normal: &mut Normal) -> Vec<[f64; 3]> {
        // About the trajectory, which is the mean: every row of the factor gets a noise of one.
        let mut rhs: Rhs = self.factor.rhs();
        for z in &mut rhs.noise {
            z.apply(|x| *x = normal.next());
        }
        for (z, link) in rhs.jump.iter_mut().zip(&self.factor.links) {
            if link.leap.is_some() {
                z.apply(|x| *x = normal.next());
            }
        }
        rhs.last.apply(|x| *x = normal.next());
        let errors = self.factor.solve(&rhs, false).states;
        errors
            .iter()
            .zip(&self.trajectory)
            .rev()
            .map(|(x, nominal)| nominal.corrected(x).nav.r_n.v.into())
            .collect()
    }
}
