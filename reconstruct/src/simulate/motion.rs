//! One smooth motion on a 2 kHz grid: the driven car, the impacts, the slide, the rest.
//!
//! The reference point is the centre of gravity's place on the ground. Its horizontal velocity and the
//! heading are integrated; the ground is a plane that follows the road's pitch and roll before the impact
//! and turns into the slope of the place of rest after it; the body moves on its springs against the ground.

use nalgebra::Vector3;
use schema::num;

use super::SimulateError;
use super::driver::Driver;
use super::process::{Correlated, Spring, smooth_step};
use super::pulse::PreparedPulse;
use super::random::{Random, Stream};
use super::scenario::{Road, Scenario};

/// Steps a second.
pub(super) const STEPS_PER_SECOND: usize = 2000;
/// One step, s.
pub(super) const STEP: f64 = 1.0 / 2000.0;
/// Steps in a 10 ms bin.
pub(super) const STEPS_PER_BIN: usize = 20;
/// Seconds driven before the log so that every lag and spring has settled.
const WARM_UP: f64 = 4.0;
/// Longest simulation, s.
const LONGEST: f64 = 300.0;
/// Time over which tyres take over after an impact, s.
const TAKE_OVER: f64 = 0.08;
/// Time over which the ground stops turning with the car after an impact, s.
const RELEASE: f64 = 0.15;
/// Below this speed friction is viscous, m/s.
const FRICTION_SPEED: f64 = 0.15;
/// Below this yaw rate the spin's friction is viscous, rad/s.
const FRICTION_RATE: f64 = 0.1;
/// Time a log goes on after the last impact, or after the stop, s: the recorder's 10 s and its rest.
const AFTER_EVENT: f64 = 12.5;
/// Time constant of a wheel that follows the road, s.
const WHEEL_TIME: f64 = 0.015;
/// Run-down of a wheel in the air, s.
const AIRBORNE_TIME: f64 = 1.5;

/// The motion at one grid point. Frame: level, z down, with any heading (the truth turns it).
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Velocity of the reference point, m/s.
    pub(super) velocity: Vector3<f64>,
    /// Roll, pitch, yaw of the body, rad (yaw and roll not wrapped).
    pub(super) angles: [f64; 3],
    /// Circumferential speed of the left and right wheel, m/s.
    pub(super) wheels: [f64; 2],
}

/// The whole motion. Node `k` is the state at `(k - STEPS_PER_BIN) * STEP` seconds of the log.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    pub(super) nodes: Vec<Node>,
    /// Begin of the last rest, s; 0 if the car never moved.
    pub(super) rest_t: f64,
}

/// Time of a node, s.
pub(super) fn node_time(k: usize) -> f64 {
    (num::real(k) - num::real(STEPS_PER_BIN)) * STEP
}

/// The car after its first impact.
struct Thrown {
    t: f64,
    accel: [f64; 2],
    yaw_accel: f64,
    travelled: f64,
}

struct Blow {
    t: f64,
    pulse: PreparedPulse,
    accel: Option<[f64; 2]>,
}

struct Ground {
    pitch: Correlated,
    roll: Correlated,
    along: f64,
}

impl Ground {
    fn new(road: &Road, random: &mut Random) -> Self {
        Self {
            pitch: Correlated::new(road.pitch_sd, road.correlation, random),
            roll: Correlated::new(road.roll_sd, road.correlation, random),
            along: 0.0,
        }
    }

    /// Slope upwards to north and east after `ds` metres.
    fn step(&mut self, road: &Road, ds: f64, extra: [f64; 2], random: &mut Random) -> [f64; 2] {
        let soft = |x: f64, limit: f64| {
            if limit > 0.0 {
                limit * (x / limit).tanh()
            } else {
                0.0
            }
        };
        let pitch = soft(self.pitch.step(ds, random), road.pitch_limit);
        let roll = soft(road.roll_mean + self.roll.step(ds, random), road.roll_limit);
        let (up_along, up_right) = (
            pitch.tan() + extra[0].tan(),
            -roll.tan() / pitch.cos() + extra[1].tan(),
        );
        let (s, c) = self.along.sin_cos();
        [up_along * c - up_right * s, up_along * s + up_right * c]
    }
}

struct Simulation<'a> {
    scenario: &'a Scenario,
    random: Random,
    driver: Driver,
    thrown: Option<Thrown>,
    ground: Ground,
    blows: Vec<Blow>,
    roll: Spring,
    pitch: Spring,
    velocity: [f64; 2],
    yaw: f64,
    yaw_rate: f64,
    wheels: [f64; 2],
    over: f64,
}

/// Integrates the scenario from its start to the end of the rest.
pub(super) fn integrate(scenario: &Scenario) -> Result<Motion, SimulateError> {
    let mut simulation = Simulation::new(scenario);
    let warm = num::round_usize(WARM_UP / STEP);
    for k in (1..=warm).rev() {
        simulation.step(node_time(0) - num::real(k) * STEP, false);
    }
    simulation.driver.distance = 0.0;
    let mut nodes = Vec::with_capacity(70 * STEPS_PER_SECOND);
    let mut rest_t = 0.0;
    let plan = &scenario.manoeuvre;
    let last_event = plan
        .impacts
        .iter()
        .map(|impact| impact.t)
        .fold(0.0, f64::max);
    loop {
        let t = node_time(nodes.len());
        let (node, settled) = simulation.step(t, true);
        nodes.push(node);
        if !settled {
            rest_t = t + STEP;
        }
        let event = if plan.impacts.is_empty() {
            rest_t
        } else {
            last_event
        };
        let end = plan
            .still
            .unwrap_or_else(|| (rest_t + plan.rest).max(event + AFTER_EVENT));
        let whole_bin = nodes.len() % STEPS_PER_BIN == 2;
        if t > end && whole_bin {
            return Ok(Motion { nodes, rest_t });
        }
        if t > LONGEST {
            return Err(SimulateError::NoRest { seconds: LONGEST });
        }
    }
}

impl<'a> Simulation<'a> {
    fn new(scenario: &'a Scenario) -> Self {
        let mut random = Random::new(scenario.class, scenario.seed, Stream::Motion);
        let driver = Driver::new(scenario, &mut random);
        let ground = Ground::new(&scenario.road, &mut random);
        let car = &scenario.car;
        let blows = scenario.manoeuvre.impacts.iter();
        Self {
            scenario,
            random,
            ground,
            thrown: None,
            blows: blows
                .map(|impact| Blow {
                    t: impact.t,
                    pulse: impact.pulse.prepared(),
                    accel: None,
                })
                .collect(),
            roll: Spring::new(car.spring_hz, car.spring_damping),
            pitch: Spring::new(car.spring_hz, car.spring_damping),
            velocity: [0.0; 2],
            yaw: 0.0,
            yaw_rate: 0.0,
            wheels: [driver.speed; 2],
            over: 0.0,
            driver,
        }
    }

    /// Advances to time `t`; gives the state there and whether nothing moves any more.
    fn step(&mut self, t: f64, events: bool) -> (Node, bool) {
        let plan = &self.scenario.manoeuvre;
        let before = (self.velocity, self.yaw_rate);
        let first = plan.impacts.first().filter(|impact| events && t > impact.t);
        if let (Some(impact), None) = (first, &self.thrown) {
            self.thrown = Some(Thrown {
                t: impact.t,
                accel: self.driven_accel(),
                yaw_accel: 0.0,
                travelled: 0.0,
            });
        }
        let tyres = if self.thrown.is_some() {
            self.fly(t)
        } else {
            self.drive(t)
        };
        let (s, c) = self.yaw.sin_cos();
        let ds = self.velocity[0].hypot(self.velocity[1]) * STEP;
        let mut extra = [0.0; 2];
        if let Some(thrown) = &mut self.thrown {
            thrown.travelled += ds;
            let share = smooth_step(thrown.travelled / plan.slide.slope_distance.max(1.0));
            extra = plan.slide.slope.map(|slope| slope * share);
            let free = 1.0 - smooth_step((t - thrown.t) / RELEASE);
            self.ground.along += self.yaw_rate * STEP * free;
        } else {
            self.ground.along = self.yaw;
        }
        let slope = self
            .ground
            .step(&self.scenario.road, ds, extra, &mut self.random);
        let along = slope[0] * c + slope[1] * s;
        let right = -slope[0] * s + slope[1] * c;
        let road_pitch = along.atan();
        let road_roll = (-right * road_pitch.cos()).atan();
        self.spring(t, tyres, (s, c));
        let lift = self.roll_over(t);
        self.turn_wheels(road_pitch.cos(), (s, c));
        let down = -(slope[0] * self.velocity[0] + slope[1] * self.velocity[1]) - lift;
        let node = Node {
            velocity: Vector3::new(self.velocity[0], self.velocity[1], down),
            angles: [
                road_roll + self.roll.value + self.over,
                road_pitch + self.pitch.value,
                self.yaw,
            ],
            wheels: self.wheels,
        };
        let still = self.velocity[0].hypot(self.velocity[1]) < 5e-4
            && before.0[0].hypot(before.0[1]) < 5e-4
            && self.yaw_rate.abs() < 1e-4
            && self.roll.speed.abs().max(self.pitch.speed.abs()) < 1e-3
            && lift.abs() < 1e-4;
        let waiting = plan
            .impacts
            .last()
            .is_some_and(|impact| t < impact.t + impact.pulse.duration)
            || plan.rollover.is_some_and(|over| t < over.t + over.duration)
            || plan.braking.as_ref().is_some_and(|braking| t < braking.t);
        (node, still && !waiting)
    }

    /// Acceleration of the driven car's reference point, level axes, m/s^2.
    fn driven_accel(&self) -> [f64; 2] {
        let lateral = self.driver.speed * self.driver.yaw_rate;
        let (s, c) = self.yaw.sin_cos();
        [
            self.driver.accel * c - lateral * s,
            self.driver.accel * s + lateral * c,
        ]
    }

    fn drive(&mut self, t: f64) -> [f64; 2] {
        self.driver.step(self.scenario, t, &mut self.random);
        self.yaw_rate = self.driver.yaw_rate;
        self.yaw += self.yaw_rate * STEP;
        let (s, c) = self.yaw.sin_cos();
        let forward = self.driver.speed;
        let right = forward * self.driver.sideslip.tan() + self.yaw_rate * self.scenario.car.cg[0];
        self.velocity = [forward * c - right * s, forward * s + right * c];
        self.driven_accel()
    }

    fn fly(&mut self, t: f64) -> [f64; 2] {
        let plan = &self.scenario.manoeuvre;
        let middle = t - STEP / 2.0;
        let Some(thrown) = &self.thrown else {
            return [0.0; 2];
        };
        let share = smooth_step((middle - thrown.t) / TAKE_OVER);
        let speed = self.velocity[0].hypot(self.velocity[1]).max(FRICTION_SPEED);
        let mut tyres = [0.0; 2];
        for (axis, tyre) in tyres.iter_mut().enumerate() {
            let friction = -plan.slide.friction * self.velocity[axis] / speed;
            *tyre = (1.0 - share) * thrown.accel[axis] + share * friction;
        }
        let held = self.yaw_rate / self.yaw_rate.abs().max(FRICTION_RATE);
        let mut yaw_accel = (1.0 - share) * thrown.yaw_accel - share * plan.slide.spin_decel * held;
        let mut accel = tyres;
        for (blow, impact) in self.blows.iter_mut().zip(&plan.impacts) {
            if middle <= blow.t {
                continue;
            }
            let (s, c) = self.yaw.sin_cos();
            let [forward, right] = impact.delta_v;
            // The direction is fixed over the ground at the onset: the obstacle does not turn with the car.
            let direction = *blow
                .accel
                .get_or_insert([forward * c - right * s, forward * s + right * c]);
            let shape = blow.pulse.at(middle - blow.t);
            accel[0] += direction[0] * shape;
            accel[1] += direction[1] * shape;
            yaw_accel += impact.spin * shape;
        }
        self.velocity[0] += accel[0] * STEP;
        self.velocity[1] += accel[1] * STEP;
        let before = self.yaw_rate;
        self.yaw_rate += yaw_accel * STEP;
        self.yaw += f64::midpoint(before, self.yaw_rate) * STEP;
        tyres
    }

    fn spring(&mut self, t: f64, tyres: [f64; 2], (s, c): (f64, f64)) {
        let car = &self.scenario.car;
        let forward = tyres[0] * c + tyres[1] * s;
        let right = -tyres[0] * s + tyres[1] * c;
        let mut push = [0.0; 2];
        for (blow, impact) in self.blows.iter().zip(&self.scenario.manoeuvre.impacts) {
            let shape = blow.pulse.at(t - STEP / 2.0 - blow.t);
            push[0] += impact.kick[0] * shape;
            push[1] += impact.kick[1] * shape;
        }
        self.roll.step(-car.roll_per_lateral * right, push[0], STEP);
        self.pitch
            .step(car.pitch_per_longitudinal * forward, push[1], STEP);
    }

    /// Sets the angle of the roll-over; gives the upward speed of the reference point, m/s.
    fn roll_over(&mut self, t: f64) -> f64 {
        let Some(plan) = self.scenario.manoeuvre.rollover else {
            return 0.0;
        };
        let before = self.over;
        self.over = plan.angle * smooth_step((t - plan.t) / plan.duration);
        let height = |angle: f64| plan.height * (1.0 - angle.cos()) / 2.0;
        (height(self.over) - height(before)) / STEP
    }

    fn turn_wheels(&mut self, road_cos: f64, (s, c): (f64, f64)) {
        let car = &self.scenario.car;
        let forward = self.velocity[0] * c + self.velocity[1] * s;
        let airborne = self.over.abs() > 0.5;
        for wheel in 0..2 {
            let side = if wheel == 0 { 1.0 } else { -1.0 };
            let ground = (forward + side * self.yaw_rate * car.track_width / 2.0) / road_cos;
            let (target, time) = if airborne {
                (0.0, AIRBORNE_TIME)
            } else if self.thrown.is_some() {
                let slide = &self.scenario.manoeuvre.slide;
                let locked = slide.locked[wheel];
                (
                    if locked {
                        0.0
                    } else {
                        ground * (1.0 - slide.slip[wheel])
                    },
                    2.0 * WHEEL_TIME,
                )
            } else {
                (ground * (1.0 - self.driver.slip[wheel]), 0.0)
            };
            let gain = if time > 0.0 {
                (STEP / time).min(1.0)
            } else {
                1.0
            };
            self.wheels[wheel] += gain * (target - self.wheels[wheel]);
        }
    }
}
