//! Short shocks as sums of simple waves, along the body's axes, gravity left out.

use std::f64::consts::PI;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use schema::units::STANDARD_GRAVITY as G;

/// The shape of one wave, s and Hz.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// One arch of a sine.
    Arch(f64),
    /// One arch up, one down.
    UpDown(f64),
    /// Haversine of unit area times its duration's inverse: a push.
    Push(f64),
    /// Decaying oscillation: frequency, damping ratio.
    Ring(f64, f64),
    /// Steady oscillation with soft ends: frequency, duration.
    Train(f64, f64),
    /// Held value with ramps of the given length: duration, ramp.
    Hold(f64, f64),
}

impl Shape {
    fn duration(self) -> f64 {
        match self {
            Self::Arch(d)
            | Self::UpDown(d)
            | Self::Push(d)
            | Self::Train(_, d)
            | Self::Hold(d, _) => d,
            Self::Ring(hz, damping) => 5.0 / (2.0 * PI * hz * damping),
        }
    }

    fn at(self, t: f64) -> f64 {
        match self {
            Self::Arch(d) => (PI * t / d).sin(),
            Self::UpDown(d) => (2.0 * PI * t / d).sin(),
            Self::Push(d) => 2.0 / d * (PI * t / d).sin().powi(2),
            Self::Ring(hz, damping) => {
                (-2.0 * PI * hz * damping * t).exp() * (2.0 * PI * hz * t).sin()
            }
            Self::Train(hz, d) => (2.0 * PI * hz * t).sin() * (t.min(d - t) / 0.1).clamp(0.0, 1.0),
            Self::Hold(d, ramp) => (t.min(d - t) / ramp).clamp(0.0, 1.0),
        }
    }
}

/// One wave: its begin after that of its event (s), its size on the three axes (m/s^2; m/s for a push).
#[derive(Clone, Copy, Debug)]
pub struct Wave {
    /// s after the event's begin.
    pub from: f64,
    /// Along x, y, z.
    pub size: [f64; 3],
    /// Over time.
    pub shape: Shape,
}

/// A wave whose size is given in g.
pub fn wave(from: f64, size_g: [f64; 3], shape: Shape) -> Wave {
    Wave {
        from,
        size: size_g.map(|g| g * G),
        shape,
    }
}

/// A push that changes the velocity by so much, km/h forward and right.
pub fn push(from: f64, kmh: [f64; 2], duration: f64) -> Wave {
    Wave {
        from,
        size: [kmh[0] / 3.6, kmh[1] / 3.6, 0.0],
        shape: Shape::Push(duration),
    }
}

/// Waves under way.
#[derive(Clone, Debug, Default)]
pub struct Waves(Vec<(f64, Wave)>);

impl Waves {
    /// Begins an event.
    pub fn begin(&mut self, t: f64, waves: &[Wave]) {
        self.0
            .extend(waves.iter().map(|wave| (t + wave.from, *wave)));
    }

    /// True if none is left; forgets those that ended before `t`.
    pub fn quiet(&mut self, t: f64) -> bool {
        self.0
            .retain(|(from, wave)| t < from + wave.shape.duration());
        self.0.is_empty()
    }

    /// Their sum.
    pub fn at(&self, t: f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (from, wave) in &self.0 {
            let own = t - from;
            if own > 0.0 && own < wave.shape.duration() {
                let value = wave.shape.at(own);
                for (sum, size) in sum.iter_mut().zip(wave.size) {
                    *sum += value * size;
                }
            }
        }
        sum
    }
}

/// Uniform between two values.
pub fn pick(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    random.random_range(low..high)
}

/// Plus or minus one.
pub fn sign(random: &mut ChaCha8Rng) -> f64 {
    if random.random_range(0.0..1.0) < 0.5 {
        -1.0
    } else {
        1.0
    }
}

/// Standard normal, near enough: the sum of six uniform numbers (to 4.2 sigma).
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let sum: f64 = (0..6).map(|_| random.random_range(-0.5..0.5)).sum();
    sum * std::f64::consts::SQRT_2
}
