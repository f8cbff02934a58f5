//! The drive before the impact: speed, curvature, sideslip and wheel slip on a fine grid.

use std::f64::consts::PI;

use super::motion::STEP;
use super::process::{Correlated, Lag, smooth_step};
use super::random::Random;
use super::scenario::{Curve, Scenario};

/// Below this speed the last bit of a stop is exponential, m/s.
const STOP_SPEED: f64 = 0.3;
/// Correlation length of lane keeping, m.
const WANDER_LENGTH: f64 = 60.0;
/// ABS stops cycling below this speed, m/s.
const ABS_SPEED: f64 = 2.0;
/// `BrakingPlan::lock` of both wheels.
const BOTH_WHEELS: usize = 2;
/// Time constant of each of the two lags of a wheel that locks, s.
const LOCK_TIME: f64 = 0.05;

/// State of the driven car at the rear axle.
#[derive(Clone, Debug)]
pub(super) struct Driver {
    pub(super) speed: f64,
    pub(super) yaw_rate: f64,
    pub(super) sideslip: f64,
    /// Longitudinal acceleration, m/s^2.
    pub(super) accel: f64,
    /// Slip of the left and right wheel.
    pub(super) slip: [f64; 2],
    /// Distance from the log's start, m.
    pub(super) distance: f64,
    cruise: Lag,
    command: Lag,
    curvature: Lag,
    lateral: Lag,
    lock: Lag,
    reference_speed: f64,
    next_target: usize,
    next_curve: usize,
    target: f64,
    wander: Correlated,
    slip_angle: Correlated,
}

impl Driver {
    pub(super) fn new(scenario: &Scenario, random: &mut Random) -> Self {
        let plan = &scenario.manoeuvre;
        let start_speed = if plan.still.is_some() {
            0.0
        } else {
            plan.start_speed
        };
        Self {
            speed: start_speed,
            yaw_rate: 0.0,
            sideslip: 0.0,
            accel: 0.0,
            slip: [0.0; 2],
            distance: 0.0,
            cruise: Lag::new(0.4, STEP, 0.0),
            command: Lag::new(0.06, STEP, 0.0),
            curvature: Lag::new(0.2, STEP, 0.0),
            lateral: Lag::new(0.15, STEP, 0.0),
            lock: Lag::new(LOCK_TIME, STEP, 0.0),
            reference_speed: start_speed,
            next_target: 0,
            next_curve: 0,
            target: start_speed,
            wander: Correlated::new(plan.wander_sd, WANDER_LENGTH, random),
            slip_angle: Correlated::new(plan.sideslip.sd, plan.sideslip.time, random),
        }
    }

    /// One step to time `t` (s).
    pub(super) fn step(&mut self, scenario: &Scenario, t: f64, random: &mut Random) {
        let plan = &scenario.manoeuvre;
        if plan.still.is_some() {
            return;
        }
        let braking = plan.braking.as_ref().filter(|braking| t >= braking.t);
        while let Some(next) = plan.speeds.get(self.next_target).filter(|next| t >= next.t) {
            self.target = next.speed;
            self.next_target += 1;
        }
        let wanted = if self.target > 0.0 {
            ((self.target - self.speed) / 1.5).clamp(-plan.drive_decel, plan.drive_accel)
        } else {
            -plan.drive_decel
        };
        let cruise = self.cruise.step(wanted);
        let mut accel = self
            .command
            .step(braking.map_or(cruise, |braking| -braking.decel));
        let mut strength = 0.0;
        if let Some(braking) = braking {
            strength = (-self.command.value / braking.decel).clamp(0.0, 1.0);
            let cycle = (2.0 * PI * braking.abs_hz[0] * (t - braking.t)).sin();
            accel *= 1.0 + 0.15 * braking.abs_depth * strength * cycle;
        }
        if accel < 0.0 {
            accel *= (self.speed / STOP_SPEED).clamp(0.0, 1.0);
        }
        self.accel = accel;
        self.speed = (self.speed + accel * STEP).max(0.0);
        self.distance += self.speed * STEP;
        if let Some(braking) = braking {
            let cycling = (self.speed / ABS_SPEED).min(1.0) * strength;
            let locked = self.lock.step(1.0);
            for (wheel, slip) in self.slip.iter_mut().enumerate() {
                let phase = 2.0 * PI * braking.abs_hz[wheel] * (t - braking.t);
                let mean = braking.slip[wheel];
                *slip = (mean * cycling * (1.0 + braking.abs_depth * phase.sin())).clamp(0.0, 0.9);
                if braking
                    .lock
                    .is_some_and(|which| which == wheel || which == BOTH_WHEELS)
                {
                    *slip += (1.0 - *slip) * locked;
                }
            }
        } else {
            self.reference_speed += (self.speed.max(8.0) - self.reference_speed) * STEP / 1.0;
        }
        self.steer(scenario, random);
    }

    fn steer(&mut self, scenario: &Scenario, random: &mut Random) {
        let plan = &scenario.manoeuvre;
        while plan
            .curves
            .get(self.next_curve)
            .is_some_and(|c| self.distance > c.start + c.length)
        {
            self.next_curve += 1;
        }
        let curve = plan
            .curves
            .get(self.next_curve)
            .map_or(0.0, |curve| lateral(curve, self.distance));
        let wander = self.wander.step(self.speed * STEP, random);
        let square = self.reference_speed.max(8.0).powi(2);
        let curvature = self.curvature.step((curve + wander) / square);
        self.yaw_rate = curvature * self.speed;
        let lateral = self.lateral.step(self.yaw_rate * self.speed);
        let free = self.slip_angle.step(STEP, random) * (self.speed / 5.0).min(1.0);
        self.sideslip = free - plan.sideslip.per_lateral * lateral;
    }
}

/// Lateral acceleration the curve asks for at `distance`.
fn lateral(curve: &Curve, distance: f64) -> f64 {
    let x = (distance - curve.start) / curve.length;
    if !(0.0..=1.0).contains(&x) {
        return 0.0;
    }
    let ramp = curve.ramp.clamp(0.01, 0.5);
    curve.lateral * smooth_step((x / ramp).min((1.0 - x) / ramp))
}
