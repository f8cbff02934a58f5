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
/// A wheel that gains or loses speed faster slips or jumped, m/s^2.
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
            if let Some(value) = value {
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
        let own = [gain, speed.zip(yaw).map(|(speed, yaw)| speed * yaw * STEP)];
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
            if let Some(value) = value {
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
