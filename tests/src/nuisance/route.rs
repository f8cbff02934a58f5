//! The car on its way: speed, curves, slopes, and what the driver does with it, in steps of 10 ms.

use rand_chacha::ChaCha8Rng;
use schema::units::STANDARD_GRAVITY as G;

use super::events::{Kind, waves};
use super::wave::{Waves, pick, sign};

/// One step, s.
pub const STEP: f64 = 0.01;

/// The car at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    /// Forward, m/s.
    pub speed: f64,
    /// Forward and to the right, without shocks, m/s^2.
    pub accel: [f64; 2],
    /// Slope upwards ahead, roll of the road to the right, rad.
    pub slope: [f64; 2],
    /// Vibration over that of a good road.
    pub rough: f64,
}

/// What the driver is about.
#[derive(Clone, Copy, Debug)]
enum Plan {
    Stand,
    Cruise,
    /// Full braking to a stop: deceleration.
    Brake(f64),
    /// Lane change: lateral acceleration, frequency.
    Swerve(f64, f64),
    /// Creeping to a knock.
    Park,
}

/// The way of one drive.
#[derive(Clone, Debug)]
pub struct Route {
    /// Shocks under way.
    pub waves: Waves,
    /// Events met so far, by [`Kind`].
    pub met: Vec<(f64, Kind)>,
    plan: Plan,
    since: f64,
    until: f64,
    now: Motion,
    target: f64,
    pull: f64,
    curve: [f64; 2],
    slope_target: [f64; 2],
    slope_rate: f64,
    rough_until: f64,
    gravel: f64,
    lasting: f64,
}

impl Route {
    /// A parked car, perhaps on a slope.
    pub fn new(r: &mut ChaCha8Rng) -> Self {
        let slope = [pick(r, -0.2, 0.2), pick(r, -0.06, 0.06)];
        Self {
            waves: Waves::default(),
            met: Vec::new(),
            plan: Plan::Stand,
            since: 0.0,
            until: pick(r, 5.0, 30.0),
            now: Motion {
                slope,
                rough: 1.0,
                ..Motion::default()
            },
            target: 0.0,
            pull: 2.0,
            curve: [0.0; 2],
            slope_target: slope,
            slope_rate: 0.02,
            rough_until: 0.0,
            gravel: 1.0,
            lasting: 0.0,
        }
    }

    fn meet(&mut self, t: f64, kind: Kind, r: &mut ChaCha8Rng) {
        let all = waves(kind, self.now.speed, r);
        self.waves.begin(t, &all);
        self.met.push((t, kind));
        match kind {
            // Up to 5 m/s^2 rms in a point.
            Kind::Gravel => {
                (self.rough_until, self.gravel) = (t + pick(r, 10.0, 60.0), pick(r, 3.0, 6.0));
            }
            // The car is tilted, and let down again by the next plan.
            Kind::Jack => self.tilt([pick(r, 0.02, 0.1), pick(r, -0.1, 0.1)], 0.01),
            Kind::Tow => self.tilt([pick(r, 0.15, 0.3), 0.0], pick(r, 0.01, 0.03)),
            _ => {}
        }
    }

    fn tilt(&mut self, slope: [f64; 2], rate: f64) {
        (self.slope_target, self.slope_rate) = (slope, rate);
    }

    /// The next 10 ms, up to `t`.
    pub fn step(&mut self, t: f64, r: &mut ChaCha8Rng) -> Motion {
        if t >= self.until {
            self.turn(t, r);
        }
        let moving = self.now.speed > 3.0;
        if moving {
            for (kind, hourly) in Kind::ON_THE_ROAD {
                if pick(r, 0.0, 1.0) < hourly * STEP / 3600.0 {
                    self.meet(t, kind, r);
                }
            }
        }
        let before = self.now.speed;
        let (mut forward, mut right) = (0.0, 0.0);
        match self.plan {
            Plan::Stand => self.now.speed = 0.0,
            Plan::Cruise | Plan::Park => {
                forward = (1.0 * (self.target - before)).clamp(-3.0, self.pull);
            }
            Plan::Brake(most) => {
                forward = if before > 0.0 {
                    -most * ((t - self.since) / 0.25).min(1.0)
                } else {
                    0.0
                };
                if before <= 0.0 {
                    self.until = self.until.min(t + 1.5);
                }
            }
            Plan::Swerve(size, hz) => {
                let phase = (t - self.since) * hz;
                right = size * (2.0 * std::f64::consts::PI * phase).sin();
            }
        }
        // Tyres and engine have their lag, but for a stop: the last moment of a braking is sudden.
        let lag = if matches!(self.plan, Plan::Brake(_)) {
            1.0
        } else {
            STEP / 0.2
        };
        self.now.accel[0] += lag * (forward - self.now.accel[0]);
        self.now.speed = (before + self.now.accel[0] * STEP).max(0.0);
        if self.now.speed <= 0.0 {
            self.now.accel[0] = 0.0;
        }
        // Curves: an angle of the wheel wanders; the lateral acceleration is kept below 0.4 g.
        if t >= self.lasting {
            self.lasting = t + pick(r, 3.0, 15.0);
            self.curve[1] = if pick(r, 0.0, 1.0) < 0.4 {
                0.0
            } else {
                sign(r) * pick(r, 0.3, 4.0)
            };
            if !matches!(self.plan, Plan::Stand) {
                let steep = if pick(r, 0.0, 1.0) < 0.1 { 0.2 } else { 0.08 };
                let banked = if pick(r, 0.0, 1.0) < 0.1 { 0.26 } else { 0.05 };
                let slope = [pick(r, -steep, steep), pick(r, -banked, banked)];
                self.tilt(slope, pick(r, 0.01, 0.15));
            }
        }
        self.curve[0] += STEP / 0.6 * (self.curve[1] - self.curve[0]);
        let share = (self.now.speed / 8.0).min(1.0);
        let calm = if matches!(self.plan, Plan::Cruise) {
            1.0
        } else {
            0.2
        };
        self.now.accel[1] = self.curve[0] * share * share * calm + right;
        for (slope, target) in self.now.slope.iter_mut().zip(self.slope_target) {
            let most = self.slope_rate * STEP;
            *slope += (target - *slope).clamp(-most, most);
        }
        self.now.rough = if t < self.rough_until {
            self.gravel
        } else {
            1.0
        };
        self.now
    }

    /// The next thing to do.
    fn turn(&mut self, t: f64, r: &mut ChaCha8Rng) {
        self.since = t;
        let speed = self.now.speed;
        let dice = pick(r, 0.0, 1.0);
        match self.plan {
            Plan::Park => {
                self.meet(t, Kind::Parking, r);
                (self.now.speed, self.now.accel) = (0.0, [0.0; 2]);
                self.stand(t, r);
            }
            Plan::Brake(_) => self.stand(t, r),
            Plan::Cruise if speed > 8.0 && dice < 0.35 => {
                // Gravel gives no more than 0.6 g.
                let grip = if t < self.rough_until { 0.6 } else { 1.0 };
                let (most, at) = (grip * pick(r, 0.8, 1.1) * G, t);
                self.meet(at, Kind::Braking, r);
                if pick(r, 0.0, 1.0) < 0.3 {
                    let what = [Kind::Pothole, Kind::Rails, Kind::Bump, Kind::Grid];
                    let which = schema::num::round_usize(pick(r, -0.5, 3.5).max(0.0));
                    self.meet(t + pick(r, 0.0, 1.0), what[which.min(3)], r);
                }
                self.plan = Plan::Brake(most);
                self.until = t + speed / most + 3.0;
            }
            Plan::Cruise if speed > 14.0 && dice < 0.6 => {
                self.meet(t, Kind::Swerve, r);
                let hz = pick(r, 0.4, 0.7);
                self.plan = Plan::Swerve(sign(r) * pick(r, 0.8, 0.95) * G, hz);
                self.until = t + if pick(r, 0.0, 1.0) < 0.5 { 1.0 } else { 2.0 } / hz;
            }
            Plan::Cruise if dice < 0.75 => {
                self.plan = Plan::Park;
                self.target = pick(r, 0.6, 1.4);
                self.until = t + 12.0 + speed / 2.0;
            }
            _ => {
                self.plan = Plan::Cruise;
                self.target = pick(r, 5.0, 36.0);
                // A racing start now and then.
                self.pull = if pick(r, 0.0, 1.0) < 0.1 {
                    6.0
                } else {
                    pick(r, 1.0, 3.0)
                };
                self.until = t + pick(r, 25.0, 90.0);
                // Who pulls a trailer starts gently.
                if pick(r, 0.0, 1.0) < 0.1 {
                    self.pull = self.pull.min(2.0);
                    let at = t + pick(r, 1.0, 20.0);
                    self.meet(at, Kind::Trailer, r);
                }
                self.tilt([pick(r, -0.08, 0.08), pick(r, -0.05, 0.05)], 0.05);
            }
        }
    }

    fn stand(&mut self, t: f64, r: &mut ChaCha8Rng) {
        self.plan = Plan::Stand;
        (self.now.speed, self.now.accel) = (0.0, [0.0; 2]);
        self.until = t + pick(r, 5.0, 30.0);
        for (kind, chance) in [
            (Kind::Door, 0.7),
            (Kind::Door, 0.4),
            (Kind::Boot, 0.3),
            (Kind::Trailer, 0.15),
            (Kind::Wash, 0.03),
            (Kind::Jack, 0.03),
            (Kind::Tow, 0.03),
        ] {
            if pick(r, 0.0, 1.0) < chance {
                let at = t + pick(r, 0.5, 5.0);
                if matches!(kind, Kind::Wash | Kind::Jack | Kind::Tow) {
                    self.until = self.until.max(t + 70.0);
                }
                self.meet(at, kind, r);
            }
        }
    }
}
