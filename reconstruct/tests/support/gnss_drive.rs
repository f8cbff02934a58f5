//! A simple drive for the GNSS filter: straights, turns, a stop, on the Earth of the filter's variant.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "not every user of the drive uses all of it"
)]

use nalgebra::Vector3;
use reconstruct::gnss::published::constants::{DT, GRAVITY, GYRO_BIAS, LATENCY};
use reconstruct::gnss::published::earth::{Earth, ecef_to_geographic};
use reconstruct::gnss::published::{GnssFix, ImuSample, Initial, Input, Variant};
use schema::num::{real, real_u64};

/// A small generator, so that the drives are the same everywhere (`SplitMix64`).
pub struct Random(pub u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        real_u64((z ^ z >> 31) >> 11) / real_u64(1 << 53)
    }

    /// Of mean 0 and standard deviation 1, nearly normal.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    pub fn vector(&mut self, sd: f64) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal()) * sd
    }
}

/// One leg: seconds, acceleration along the road (m/s^2), yaw rate (rad/s).
pub type Leg = (f64, f64, f64);

/// What to drive, and how well it is measured.
pub struct Plan {
    pub speed: f64,
    pub yaw: f64,
    pub legs: Vec<Leg>,
    pub bias: Vector3<f64>,
    /// Scale of all noises: 1 or 0.
    pub noise: f64,
    pub earth: Earth,
    pub latency: usize,
}

impl Plan {
    /// North at 12 m/s, a right turn, a left turn, a stop of 6 s, and off again: 44 s.
    pub fn town(earth: Earth) -> Self {
        Self {
            speed: 12.0,
            yaw: 0.1,
            legs: vec![
                (8.0, 0.2, 0.0),
                (4.0, 0.0, 0.4),
                (4.0, 0.0, 0.0),
                (5.0, 0.0, -0.35),
                (6.0, -13.6 / 6.0, 0.0),
                (6.0, 0.0, 0.0),
                (6.0, 1.5, 0.02),
                (5.0, 0.0, 0.45),
            ],
            bias: Vector3::from(GYRO_BIAS),
            noise: 1.0,
            earth,
            latency: LATENCY,
        }
    }
}

/// A drive: what was measured and what was true.
pub struct Drive {
    pub input: Input,
    /// ECEF position, speed and yaw at each inertial sample.
    pub truth: Vec<(Vector3<f64>, f64, f64)>,
    pub initial: Initial,
}

/// Three seconds of straight driving, then the legs.
pub fn drive(plan: &Plan, seed: u64) -> Drive {
    let mut random = Random(seed);
    let (mut speed, mut yaw) = (plan.speed, plan.yaw);
    let mut r = plan
        .earth
        .ecef(63.42_f64.to_radians(), 10.4_f64.to_radians(), 120.0);
    let mut legs = vec![(3.0, 0.0, 0.0)];
    legs.extend_from_slice(&plan.legs);
    let mut input = Input::default();
    let mut truth: Vec<(Vector3<f64>, f64, f64)> = Vec::new();
    let mut velocities = Vec::new();
    for (seconds, along, rate) in legs {
        let mut t = 0.0;
        while t < seconds - DT / 2.0 {
            let moving = speed > 0.05;
            let k = truth.len();
            let [lat, lon, _] = plan.earth.geodetic(&r);
            let v_ned = Vector3::new(speed * yaw.cos(), speed * yaw.sin(), 0.0);
            truth.push((r, speed, yaw));
            velocities.push(v_ned);
            let shake = plan.noise * if moving { 0.25 } else { 0.03 };
            let wobble = plan.noise * if moving { 0.01 } else { 0.0025 };
            let f = Vector3::new(if moving { along } else { 0.0 }, speed * rate, -GRAVITY);
            input.motions.push(ImuSample {
                t_s: real(k) * DT,
                accel_b: f + random.vector(shake),
                rate_b: Vector3::new(0.0, 0.0, rate) + plan.bias + random.vector(wobble),
            });
            // The middle of the step; exact enough to the second order.
            let middle = yaw + rate * DT / 2.0;
            let mean = (speed + along * DT / 2.0).max(0.0);
            let step = Vector3::new(mean * middle.cos(), mean * middle.sin(), 0.0) * DT;
            r += ecef_to_geographic(lat, lon).transpose() * step;
            speed = (speed + along * DT).max(0.0);
            yaw += rate * DT;
            t += DT;
        }
    }
    // A fix a second, of where the car was a latency ago; its stamp falls between two samples.
    let first = 150;
    for k in (first..truth.len()).step_by(50) {
        let (then, _, _) = truth[k - plan.latency];
        let [lat, lon, height] = plan
            .earth
            .geodetic(&(then + random.vector(3.0 * plan.noise)));
        input.fixes.push(GnssFix {
            t_s: real(k) * DT - DT / 4.0,
            lat,
            lon,
            height,
            v_ned: velocities[k - plan.latency] + random.vector(0.3 * plan.noise),
        });
    }
    let mut initial = Initial::from_reference(&input.fixes[0], &velocities[first - plan.latency]);
    initial.bias = plan.bias;
    Drive {
        input,
        truth,
        initial,
    }
}

/// The town drive on the Earth of a variant.
pub fn town(variant: Variant, seed: u64) -> Drive {
    drive(&Plan::town(Earth::of(variant.earth)), seed)
}
