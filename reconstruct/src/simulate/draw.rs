//! Drawing a scenario from a class and a seed.

use std::f64::consts::PI;

use schema::units::STANDARD_GRAVITY;

use super::SimulateError;
use super::class::{Class, Grade};
use super::errors::{Errors, Sheet};
use super::pulse::Pulse;
use super::random::{Random, Stream};
use super::scenario::{
    Axes, BrakingPlan, Car, Curve, ImpactPlan, Manoeuvre, Road, Rollover, Scenario, Sideslip,
    Slide, SpeedTarget,
};

/// Nominal time of the first impact, s: 30 s of record before it, and room before that.
const IMPACT_T: f64 = 40.0;
/// Speeds of the approach, m/s.
const SPEEDS: [f64; 2] = [20.0, 33.0];
/// Least speed left for an impact after the braking, m/s.
const LEAST_IMPACT_SPEED: f64 = 4.0;

impl Scenario {
    /// Everything drawn from the seed, consumer sensors at 100 Hz.
    #[must_use]
    pub fn draw(class: Class, seed: u64) -> Self {
        Self::draw_graded(class, seed, Grade::Consumer)
    }

    /// Everything drawn from the seed; motion and car are the same for each grade.
    #[must_use]
    pub fn draw_graded(class: Class, seed: u64, grade: Grade) -> Self {
        let mut random = Random::new(class, seed, Stream::Scenario);
        let mut sensors = Random::new(class, seed, Stream::Errors);
        let sheet = Sheet::of(grade);
        let manoeuvre = manoeuvre(class, &mut random);
        let imu_nominal = [
            random.range(1.15, 1.85),
            random.range(-0.25, 0.25),
            -random.range(0.3, 0.6),
        ];
        // About 0.5 m from the IMU in any direction on the floor.
        let bearing = random.range(0.0, 2.0 * PI);
        let cg_nominal = [
            imu_nominal[0] + 0.5 * bearing.cos(),
            0.1 * bearing.sin(),
            -random.range(0.5, 0.6),
        ];
        let placed = |nominal: [f64; 3], off: [f64; 3]| [0, 1, 2].map(|i| nominal[i] + off[i]);
        let car = Car {
            track_width: random.range(1.42, 1.60),
            imu_nominal,
            imu: placed(imu_nominal, sensors.normals(sheet.imu_place)),
            cg_nominal,
            cg: placed(cg_nominal, sensors.normals(sheet.cg_place)),
            roll_per_lateral: random.range(0.3, 0.6_f64).to_radians(),
            pitch_per_longitudinal: random.range(0.15, 0.3_f64).to_radians(),
            spring_hz: random.range(1.2, 1.8),
            spring_damping: random.range(0.4, 0.6),
        };
        let road = Road {
            roll_mean: 1.75_f64.to_radians(),
            roll_sd: random.range(0.5, 1.2_f64).to_radians(),
            roll_limit: 4.6_f64.to_radians(),
            pitch_sd: random.range(0.5, 2.0_f64).to_radians(),
            pitch_limit: 5.7_f64.to_radians(),
            correlation: random.range(100.0, 250.0),
        };
        let pick = random.unit();
        let wheel_hz = if pick < 0.5 {
            50.0
        } else if pick < 0.75 {
            25.0
        } else {
            20.0
        };
        let wheel_phase = random.range(0.001, 1.0 / wheel_hz);
        let errors = Errors::draw(&sheet, &mut sensors);
        Self {
            class,
            grade,
            seed,
            sensor_seed: seed,
            imu_hz: 100,
            wheel_hz,
            wheel_phase,
            start_unix_s: 1_700_000_000,
            axes: Axes::FrontLeftUp,
            gravity: STANDARD_GRAVITY,
            car,
            road,
            manoeuvre,
            sheet,
            errors,
        }
    }

    /// Puts another set of sensors, drawn from `sheet`, into the same car on the same drive.
    pub fn redraw_sensors(&mut self, sheet: &Sheet, sensor_seed: u64) {
        let mut sensors = Random::new(self.class, sensor_seed, Stream::Errors);
        let mut placed = |nominal: [f64; 3], sd: f64| {
            let off = sensors.normals(sd);
            [0, 1, 2].map(|i| nominal[i] + off[i])
        };
        self.car.imu = placed(self.car.imu_nominal, sheet.imu_place);
        self.car.cg = placed(self.car.cg_nominal, sheet.cg_place);
        self.errors = Errors::draw(sheet, &mut sensors);
        self.sheet = sheet.clone();
        self.sensor_seed = sensor_seed;
    }

    /// Refuses what cannot be simulated.
    pub(super) fn check(&self) -> Result<(), SimulateError> {
        if !(100..=1000).contains(&self.imu_hz) || 2000 % self.imu_hz != 0 {
            return Err(SimulateError::ImuRate(self.imu_hz));
        }
        let plan = &self.manoeuvre;
        let mut quantities = vec![
            ("wheel_hz", self.wheel_hz, 1.0, 200.0, "1 to 200 Hz"),
            ("gravity", self.gravity, 1.0, 20.0, "1 to 20 m/s^2"),
            ("track_width", self.car.track_width, 0.5, 4.0, "0.5 to 4 m"),
            ("spring_hz", self.car.spring_hz, 0.1, 20.0, "0.1 to 20 Hz"),
            (
                "road correlation",
                self.road.correlation,
                1.0,
                1e5,
                "1 m to 100 km",
            ),
            (
                "sideslip time",
                plan.sideslip.time,
                0.1,
                1e3,
                "0.1 to 1000 s",
            ),
            ("start_speed", plan.start_speed, 0.0, 100.0, "0 to 100 m/s"),
            ("rest", plan.rest, 0.0, 100.0, "0 to 100 s"),
            (
                "slide friction",
                plan.slide.friction,
                0.1,
                20.0,
                "0.1 to 20 m/s^2",
            ),
            (
                "spin_decel",
                plan.slide.spin_decel,
                0.01,
                100.0,
                "0.01 to 100 rad/s^2",
            ),
        ];
        for impact in &plan.impacts {
            quantities.push(("impact time", impact.t, 0.0, 200.0, "0 to 200 s"));
            quantities.push((
                "pulse duration",
                impact.pulse.duration,
                0.01,
                1.0,
                "0.01 to 1 s",
            ));
        }
        for (name, value, low, high, expected) in quantities {
            if !(low..=high).contains(&value) {
                return Err(SimulateError::Quantity {
                    name,
                    value,
                    expected,
                });
            }
        }
        Ok(())
    }
}

fn manoeuvre(class: Class, random: &mut Random) -> Manoeuvre {
    let impact_t = IMPACT_T + random.unit();
    let (start_speed, speeds) = speeds(class, impact_t, random);
    let last_speed = speeds.last().map_or(start_speed, |target| target.speed);
    let braking = braking(class, impact_t, last_speed, random);
    let impacts = impacts(class, impact_t, random);
    let friction = random.range(0.3, 0.7) * STANDARD_GRAVITY;
    let spin_decel = friction * random.range(0.6, 1.1);
    let slope_sd = 2.5_f64.to_radians();
    let limit = 6.0_f64.to_radians();
    let slope = [0, 1].map(|_| (random.normal() * slope_sd).clamp(-limit, limit));
    let slide = Slide {
        friction,
        spin_decel,
        slip: [random.range(0.0, 0.1), random.range(0.0, 0.1)],
        locked: [random.chance(0.3), random.chance(0.3)],
        slope,
        slope_distance: random.range(8.0, 20.0),
    };
    let rollover = (class == Class::Roof).then(|| Rollover {
        t: impact_t + random.range(0.2, 0.5),
        duration: random.range(1.4, 2.5),
        angle: PI * random.sign(),
        height: random.range(1.1, 1.4),
    });
    let curvy = if class == Class::Still { 0.0 } else { 1.0 };
    Manoeuvre {
        start_speed,
        speeds,
        drive_accel: if class == Class::Lights { 2.5 } else { 1.2 },
        drive_decel: if class == Class::Lights { 2.2 } else { 1.5 },
        curves: curves(random),
        wander_sd: random.range(0.1, 0.25) * curvy,
        sideslip: Sideslip {
            sd: random.range(0.15, 0.35_f64).to_radians(),
            time: random.range(0.6, 2.0),
            per_lateral: random.range(0.2, 0.45_f64).to_radians(),
        },
        braking,
        impacts,
        slide,
        rollover,
        rest: random.range(5.0, 7.0),
        still: (class == Class::Still).then_some(60.0),
    }
}

/// Speed at the start and the targets on the way.
fn speeds(class: Class, impact_t: f64, random: &mut Random) -> (f64, Vec<SpeedTarget>) {
    let [low, high] = SPEEDS;
    if class == Class::Lights {
        let start = random.range(12.0, 16.0);
        // The stand lies about 22 to 14 s before the impact.
        let stop_t = impact_t - random.range(30.0, 32.0);
        let go_t = impact_t - random.range(14.0, 16.0);
        let speed = random.range(low, low + 4.0);
        let targets = vec![
            SpeedTarget {
                t: stop_t,
                speed: 0.0,
            },
            SpeedTarget { t: go_t, speed },
        ];
        return (start, targets);
    }
    let start = random.range(low, high);
    let mut targets = Vec::new();
    let mut speed = start;
    let mut t = random.range(2.0, 10.0);
    while t < impact_t - 8.0 {
        speed = (speed * random.range(0.8, 1.2)).clamp(low, high);
        targets.push(SpeedTarget { t, speed });
        t += random.range(6.0, 15.0);
    }
    (start, targets)
}

fn curves(random: &mut Random) -> Vec<Curve> {
    let mut curves = Vec::new();
    let mut start = random.range(0.0, 120.0);
    while start < 1500.0 {
        let length = random.range(60.0, 250.0);
        let lateral = random.range(0.8, 3.5) * random.sign();
        curves.push(Curve {
            start,
            length,
            ramp: random.range(0.25, 0.45),
            lateral,
        });
        start += length + random.range(20.0, 200.0);
    }
    curves
}

fn braking(class: Class, impact_t: f64, speed: f64, random: &mut Random) -> Option<BrakingPlan> {
    let decel = random.range(0.5, 0.8) * STANDARD_GRAVITY;
    let longest = ((speed - LEAST_IMPACT_SPEED) / decel).max(0.5);
    let time = random.range(0.5, 2.5).min(longest);
    let slip = [random.range(0.05, 0.15), random.range(0.05, 0.15)];
    let abs_hz = [random.range(5.0, 12.0), random.range(5.0, 12.0)];
    let locks = random.chance(0.1);
    let locked = usize::from(random.chance(0.5));
    let easy = random.range(0.15, 0.3) * STANDARD_GRAVITY;
    let plan = BrakingPlan {
        t: impact_t - time,
        decel,
        slip,
        abs_hz,
        abs_depth: random.range(0.3, 0.7),
        lock: locks.then_some(locked),
    };
    match class {
        Class::Still => None,
        Class::Drive => Some(BrakingPlan {
            decel: easy,
            slip: [0.0; 2],
            abs_depth: 0.0,
            lock: None,
            ..plan
        }),
        _ => Some(plan),
    }
}

fn impacts(class: Class, t: f64, random: &mut Random) -> Vec<ImpactPlan> {
    let degrees = |low: f64, high: f64, random: &mut Random| random.range(low, high).to_radians();
    let side = random.sign();
    let (angle, spin) = match class {
        Class::Stop | Class::Drive | Class::Still => return Vec::new(),
        Class::Frontal | Class::Roof => (degrees(-15.0, 15.0, random), 60.0),
        Class::Oblique => (side * degrees(20.0, 60.0, random), 220.0),
        Class::Side => (side * degrees(60.0, 110.0, random), 220.0),
        Class::Rear => (PI + degrees(-20.0, 20.0, random), 150.0),
        Class::Double | Class::Lights => (side * degrees(0.0, 45.0, random), 150.0),
    };
    let first = impact(t, random.range(8.0, 80.0), angle, spin, random);
    let gap = random.range(1.0, 4.0);
    let second = impact(
        t + gap,
        random.range(8.0, 30.0),
        degrees(-180.0, 180.0, random),
        100.0,
        random,
    );
    if class == Class::Double {
        vec![first, second]
    } else {
        vec![first]
    }
}

/// An impact from `angle` (principal direction of force, 0 frontal, clockwise).
fn impact(t: f64, delta_v_kmh: f64, angle: f64, spin: f64, random: &mut Random) -> ImpactPlan {
    let size = delta_v_kmh / 3.6;
    let duration = random.range(0.06, 0.12);
    let kick =
        [random.normal(), random.normal()].map(|x| (25.0 * x).clamp(-60.0, 60.0).to_radians());
    ImpactPlan {
        t,
        delta_v: [-size * angle.cos(), -size * angle.sin()],
        spin: random.range(-spin, spin).to_radians(),
        kick,
        pulse: Pulse {
            duration,
            main: random.range(0.65, 0.85),
            exponent: random.range(1.0, 2.0),
            rebound: random.range(0.05, 0.15),
            ripple: random.range(0.0, 0.3),
            ripple_hz: random.range(40.0, 120.0),
        },
    }
}
