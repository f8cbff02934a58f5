//! What gravity on a slope, body roll and the sensor's bias add to the horizontal accelerations.
//!
//! The estimate follows what is left of the measured acceleration when the car's own is taken out: forward the
//! change of the wheels' speed, to the right speed times yaw rate. Without that a low-pass takes a long
//! curve or a braking for a slope, and reads a blow up to 2 km/h too small or too large. Where wheels or gyro are
//! silent the low-pass is all there is; it is slow there.

use schema::Sample;

use crate::bins::BIN;

/// Duration of a sample, s.
const STEP: f64 = BIN * 1e-9;
/// Time constant with wheels (and gyro), s: a slope comes within about 100 m.
const AIDED: f64 = 3.0;
/// Time constant without, s: longer than curves and brakings.
const ALONE: f64 = 15.0;
/// While the estimate is younger than this it is a plain mean, s.
const YOUNG: f64 = 0.2;
/// A larger acceleration than this freezes the estimate, m/s^2: full braking, where wheels slip, or a blow.
const FREEZE: f64 = 4.0;
/// The estimate's own limit, m/s^2 (a slope of 45 %).
const MOST: f64 = 4.0;
/// No tyre gives more: a wheel that gains or loses speed faster slips or jumped, a gyro that says more is wrong, m/s^2.
const GRIP: f64 = 10.0;
/// A wheel is silent after so many samples (0.5 s) without a value.
const SILENT: u32 = 50;

/// A wheel's last value, m/s, and the samples since.
#[derive(Clone, Copy, Debug, Default)]
struct Wheel {
    speed: Option<f64>,
    age: u32,
}

/// The estimate, forward and to the right.
#[derive(Clone, Copy, Debug, Default)]
pub struct Level {
    slow: [f64; 2],
    /// Time each axis has been followed, s.
    followed: [f64; 2],
    wheels: [Wheel; 2],
}

impl Level {
    /// Takes the next sample; gives the accelerations freed of the estimate, m/s^2, where there are any.
    #[must_use]
    pub fn step(mut self, sample: &Sample) -> (Self, [Option<f64>; 2]) {
        let (speed, gain) = self.speed(sample.wheels);
        let [x, y, _] = sample.accel;
        let mut free = [None; 2];
        let axes = free.iter_mut().zip(&mut self.slow).zip(self.followed);
        for (((free, slow), followed), value) in axes.zip([x, y]) {
            // Sums of absurd floats may be no numbers.
            if let Some(value) = value.filter(|value| value.is_finite()) {
                if followed <= 0.0 {
                    *slow = value.clamp(-MOST, MOST);
                }
                *free = Some(value - *slow);
            }
        }
        if free.iter().flatten().any(|free| free.abs() > FREEZE) {
            return (self, free);
        }
        let [_, _, yaw] = sample.rate;
        // The car's own change of speed in this sample, m/s.
        let turn = speed.zip(yaw).map(|(speed, yaw)| speed * yaw);
        let turn = turn.filter(|turn| turn.abs() <= GRIP);
        let own = [gain, turn.map(|turn| turn * STEP)];
        let axes = self.slow.iter_mut().zip(&mut self.followed);
        for (((slow, followed), own), free) in axes.zip(own).zip(free) {
            let Some(free) = free else { continue };
            let time = if own.is_some() { AIDED } else { ALONE };
            let change = free * STEP - own.unwrap_or(0.0);
            *slow = (*slow + change / time.min(YOUNG + *followed)).clamp(-MOST, MOST);
            *followed += STEP;
        }
        (self, free)
    }

    /// Mean speed of the wheels that are not silent, and what they gained since the last sample; m/s.
    fn speed(&mut self, values: [Option<f64>; 2]) -> (Option<f64>, Option<f64>) {
        let (mut sum, mut gain, mut alive) = (0.0, 0.0, 0.0);
        for (wheel, value) in self.wheels.iter_mut().zip(values) {
            wheel.age = wheel.age.saturating_add(1);
            if wheel.age > SILENT {
                wheel.speed = None;
            }
            // Sums of absurd floats may be no numbers.
            if let Some(value) = value.filter(|value| value.is_finite()) {
                let before = wheel.speed.replace(value).unwrap_or(value);
                let most = GRIP * STEP * f64::from(wheel.age);
                if (value - before).abs() <= most {
                    gain += value - before;
                }
                wheel.age = 0;
            }
            if let Some(speed) = wheel.speed {
                sum += speed;
                alive += 1.0;
            }
        }
        if alive > 0.0 {
            (Some(sum / alive), Some(gain / alive))
        } else {
            (None, None)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = schema::units::STANDARD_GRAVITY;

    fn sample(accel: [f64; 2], wheel: Option<f64>, yaw: Option<f64>) -> Sample {
        Sample {
            wheels: [wheel; 2],
            accel: [Some(accel[0]), Some(accel[1]), Some(-G)],
            rate: [Some(0.0), Some(0.0), yaw],
        }
    }

    fn after(level: &mut Level, samples: impl IntoIterator<Item = Sample>) -> [f64; 2] {
        for sample in samples {
            *level = level.step(&sample).0;
        }
        level.slow
    }

    /// Wheels every 20 ms.
    fn wheel(k: u32, speed: f64) -> Option<f64> {
        k.is_multiple_of(2).then_some(speed)
    }

    #[test]
    fn a_braking_and_a_long_curve_are_no_slope() {
        let (slope, bank) = (0.6, -0.4);
        let mut level = Level::default();
        let steady = (0..500).map(|k| sample([slope, bank], wheel(k, 30.0), Some(0.0)));
        after(&mut level, steady);
        // 3 m/s^2 of braking for 5 s, then 3.5 m/s^2 to the right for 10 s.
        let braking = (0..500).map(|k| {
            let speed = 30.0 - 0.03 * f64::from(k);
            sample([slope - 3.0, bank], wheel(k, speed), Some(0.0))
        });
        let [x, y] = after(&mut level, braking);
        assert!(
            (x - slope).abs() < 0.15 && (y - bank).abs() < 0.05,
            "{x} {y}"
        );
        let curve =
            (0..1000).map(|k| sample([slope, bank + 3.5], wheel(k, 15.0), Some(3.5 / 15.0)));
        let [x, y] = after(&mut level, curve);
        assert!(
            (x - slope).abs() < 0.15 && (y - bank).abs() < 0.1,
            "{x} {y}"
        );
    }

    #[test]
    fn a_slope_comes_within_seconds_with_wheels_and_slowly_without() {
        let mut level = Level::default();
        after(
            &mut level,
            (0..1000).map(|k| sample([0.0, 0.0], wheel(k, 20.0), Some(0.0))),
        );
        let mut alone = level;
        let [x, _] = after(
            &mut level,
            (0..900).map(|k| sample([1.5, 0.0], wheel(k, 20.0), Some(0.0))),
        );
        assert!((x - 1.5).abs() < 0.1, "{x}");
        let [x, _] = after(&mut alone, (0..900).map(|_| sample([1.5, 0.0], None, None)));
        assert!((0.4..1.0).contains(&x), "{x}");
    }

    #[test]
    fn a_blow_full_braking_and_a_locked_wheel_change_nothing() {
        let mut level = Level::default();
        after(
            &mut level,
            (0..1000).map(|k| sample([0.2, 0.1], wheel(k, 20.0), Some(0.0))),
        );
        let blow = (0..30).map(|k| sample([-20.0 * G, 3.0 * G], wheel(k, 20.0), Some(2.0)));
        let [x, y] = after(&mut level, blow);
        assert!((x - 0.2).abs() < 1e-3 && (y - 0.1).abs() < 1e-3, "{x} {y}");
        let locked = (0..100).map(|k| sample([0.2, 0.1], wheel(k, 0.0), Some(0.0)));
        let [x, _] = after(&mut level, locked);
        assert!((x - 0.2).abs() < 0.01, "{x}");
    }

    #[test]
    fn what_is_no_number_leaves_it_sound() {
        let mut level = Level::default();
        let odd =
            [f64::NAN, f64::INFINITY, -1e300].map(|odd| sample([odd, odd], Some(odd), Some(odd)));
        after(&mut level, odd);
        let [x, y] = after(
            &mut level,
            (0..2000).map(|k| sample([0.5, 0.0], wheel(k, 20.0), Some(0.0))),
        );
        assert!((x - 0.5).abs() < 0.05 && y.abs() < 0.05, "{x} {y}");
    }
}
