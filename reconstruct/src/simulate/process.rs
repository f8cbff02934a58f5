//! Small filters over time or distance: lags, a spring, a correlated process, the vibration of a driving car.

use std::f64::consts::PI;

use super::random::Random;

/// Two equal first-order lags in series: the output has a continuous slope.
#[derive(Clone, Debug)]
pub(super) struct Lag {
    gain: f64,
    first: f64,
    pub(super) value: f64,
}

impl Lag {
    /// Time constant of each lag `tau` (s), step `dt` (s), at rest at `start`.
    pub(super) fn new(tau: f64, dt: f64, start: f64) -> Self {
        Self {
            gain: (dt / tau).min(1.0),
            first: start,
            value: start,
        }
    }

    pub(super) fn step(&mut self, input: f64) -> f64 {
        self.first += self.gain * (input - self.first);
        self.value += self.gain * (self.first - self.value);
        self.value
    }
}

/// A damped spring: the suspension's answer to an acceleration.
#[derive(Clone, Debug)]
pub(super) struct Spring {
    stiffness: f64,
    damping: f64,
    pub(super) value: f64,
    pub(super) speed: f64,
}

impl Spring {
    /// Natural frequency (Hz) and damping ratio.
    pub(super) fn new(frequency: f64, ratio: f64) -> Self {
        let omega = 2.0 * PI * frequency;
        Self {
            stiffness: omega * omega,
            damping: 2.0 * ratio * omega,
            value: 0.0,
            speed: 0.0,
        }
    }

    /// One step of `dt` towards `target`, with an extra acceleration `push`.
    pub(super) fn step(&mut self, target: f64, push: f64, dt: f64) -> f64 {
        let accel = self.stiffness * (target - self.value) - self.damping * self.speed + push;
        self.speed += dt * accel;
        self.value += dt * self.speed;
        self.value
    }
}

/// Three equal lags driven by white noise: a stationary process, twice differentiable, with the
/// autocorrelation `(1 + d/L + d^2/(3 L^2)) exp(-d/L)`, which falls to 1/e at about 2.9 `L`.
#[derive(Clone, Debug)]
pub(super) struct Correlated {
    lag: f64,
    noise: f64,
    state: [f64; 3],
    held: f64,
    left: u8,
}

/// Steps for which one draw of the driving noise is held; short against every correlation length.
const HOLD: u8 = 10;

impl Correlated {
    /// Stationary standard deviation `sd`; 1/e at `correlation` (m or s, whatever the steps are in). It
    /// starts stationary.
    pub(super) fn new(sd: f64, correlation: f64, random: &mut Random) -> Self {
        let lag = correlation / 2.9;
        // Variance of white noise of density q behind 1/(1 + sL)^3 is 3 q / (16 L).
        let noise = sd * (16.0 * lag / 3.0).sqrt();
        let mut process = Self {
            lag,
            noise,
            state: [0.0; 3],
            held: 0.0,
            left: 0,
        };
        for _ in 0..2000 {
            process.step(lag / 125.0, random);
        }
        process
    }

    /// One step of length `ds` (not negative).
    pub(super) fn step(&mut self, ds: f64, random: &mut Random) -> f64 {
        let gain = ds / self.lag;
        if self.left == 0 {
            self.held = random.normal();
            self.left = HOLD;
        }
        self.left -= 1;
        // Held for n steps, white noise of variance q ds a step becomes one of n q ds, spread over n.
        let drive = self.noise * (ds / f64::from(HOLD)).sqrt() / self.lag * self.held;
        self.state[0] += drive - gain * self.state[0];
        self.state[1] += gain * (self.state[0] - self.state[1]);
        self.state[2] += gain * (self.state[1] - self.state[2]);
        self.state[2]
    }
}

/// Share of the variance of a 10 ms mean that is white.
const WHITE: f64 = 0.6;
/// Share with a correlation time of [`SLOW_TIME`].
const SLOW: f64 = 0.1;
/// Correlation time of the slow part, s.
const SLOW_TIME: f64 = 0.02;
/// Share of the wheel hop, a resonance.
const HOP: f64 = 0.3;

/// Vibration on one axis, of unit variance in a 10 ms mean: white, a part correlated over 20 ms, and a
/// resonance (wheel hop). The density at frequency zero is that of white noise of the same variance a
/// sample, so a filter told the sample's standard deviation is told the truth about its sums.
#[derive(Clone, Debug)]
pub(super) struct Vibration {
    slow_keep: f64,
    slow_drive: f64,
    slow: f64,
    hop: [f64; 2],
    hop_step: [f64; 2],
    hop_drive: f64,
}

impl Vibration {
    /// For frames of `period` (s) and a wheel-hop frequency `hop` (Hz).
    pub(super) fn new(period: f64, hop: f64) -> Self {
        let slow_keep = (-period / SLOW_TIME).exp();
        let radius = (-2.0 * PI * hop * 0.25 * period).exp();
        let turn = 2.0 * PI * hop * period;
        Self {
            slow_keep,
            slow_drive: (SLOW * (1.0 - slow_keep * slow_keep)).sqrt(),
            slow: 0.0,
            hop: [0.0; 2],
            hop_step: [radius * turn.cos(), radius * turn.sin()],
            hop_drive: (HOP * (1.0 - radius * radius)).sqrt(),
        }
    }

    /// Variance of the white part of one frame of `period`.
    pub(super) fn white_variance(period: f64) -> f64 {
        WHITE * 0.01 / period
    }

    /// The correlated parts of the next frame.
    pub(super) fn step(&mut self, random: &mut Random) -> f64 {
        self.slow = self.slow_keep * self.slow + self.slow_drive * random.normal();
        let [c, s] = self.hop_step;
        let [x, y] = self.hop;
        // A damped rotation driven on both axes keeps each at the wanted variance.
        self.hop = [
            c * x - s * y + self.hop_drive * random.normal(),
            s * x + c * y + self.hop_drive * random.normal(),
        ];
        self.slow + self.hop[0]
    }
}

/// 0 to 1 as `x` goes from 0 to 1, with zero slope and curvature at both ends.
pub(super) fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 + x * (6.0 * x - 15.0))
}

#[cfg(test)]
mod tests {
    use super::super::class::Class;
    use super::super::random::Stream;
    use super::*;

    #[test]
    fn correlated_process_has_its_deviation_and_length() {
        let mut random = Random::new(Class::Side, 3, Stream::Motion);
        let mut square = 0.0;
        let mut product = 0.0;
        let mut count = 0.0;
        for _ in 0..300 {
            let mut process = Correlated::new(2.0, 100.0, &mut random);
            let a = process.state[2];
            let mut b = a;
            for _ in 0..1000 {
                b = process.step(0.1, &mut random);
            }
            square += a * a;
            product += a * b;
            count += 1.0;
        }
        let sd = f64::sqrt(square / count);
        assert!((sd - 2.0).abs() < 0.25, "sd {sd}");
        let correlation = product / square;
        assert!(
            (correlation - 0.37).abs() < 0.15,
            "correlation after 100 m {correlation}"
        );
    }

    #[test]
    fn vibration_has_unit_variance_in_ten_milliseconds() {
        for (period, frames) in [(0.01, 1), (0.001, 10)] {
            let mut random = Random::new(Class::Side, 5, Stream::Imu);
            let mut vibration = Vibration::new(period, 12.0);
            let white = Vibration::white_variance(period).sqrt();
            let (mut square, mut second) = (0.0, 0.0);
            for _ in 0..200 {
                let mut total = 0.0;
                for _ in 0..100 {
                    let mut mean = 0.0;
                    for _ in 0..frames {
                        mean += white * random.normal() + vibration.step(&mut random);
                    }
                    mean /= f64::from(frames);
                    square += mean * mean;
                    total += mean;
                }
                second += total * total;
            }
            let variance = square / 20_000.0;
            assert!(
                (variance - 1.0).abs() < 0.08,
                "{period}: variance {variance}"
            );
            // Sums over a second grow like white noise: the filter's view of it is honest.
            let density = second / 200.0 / 100.0;
            assert!(
                (0.75..1.35).contains(&density),
                "{period}: density ratio {density}"
            );
        }
    }
}
