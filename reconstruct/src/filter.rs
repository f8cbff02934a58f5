//! The nine-state filter: backwards from the start, one sample after the other.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::anchor::Anchor;
use crate::constraint::{self, Geometry, WheelReading};
use crate::epochs::{Epoch, Reversed};
use crate::error::ReconstructError;
use crate::error_model::{
    ATT, BA, Nine, NineScalar, Noise, POS, SA, STATES, VEL, predict_backward,
};
use crate::findings::WheelUse;
use crate::frame::{Body, Nav, Vec3};
use crate::mechanize::{Earth, Nav9, backward};
use crate::motion::Motion;
use crate::road::RoadLimits;
use crate::start::Start;

/// Vibration grows with speed up to this one, m/s, where the data sheet's figure holds.
pub(crate) const VIBRATION_SPEED: f64 = 12.0;

/// Sideways speed of a slow car that simply rolls: 0.4 degrees of its speed, and a floor, m/s. Wider, and tilt and
/// bias bend the last metres before rest, where the lateral speed is not yet known: measured drives were then off by
/// 0.4 to 3 % of the distance, now by 0.02 to 0.5 %.
const SLIP_SHARE: f64 = 0.007;
const SLIP_FLOOR_MPS: f64 = 0.02;

/// The state at the end of one epoch and its covariance.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// State.
    pub nav: Nav9,
    /// Covariance of position, velocity and platform angles, 9 x 9.
    pub p: SMatrix<f64, STATES, STATES>,
    /// One sigma of the forward and rightward acceleration free of gravity, m/s^2.
    pub sd_accel: [f64; 2],
    /// Density of the noise in it, which a mean averages out, (m/s^2)^2/Hz; NaN where `sd_accel` is.
    pub accel_noise: [f64; 2],
    /// A wheel was used here.
    pub wheels_used: bool,
}

/// How the measurements are weighed: figures that are not on a data sheet, each with its reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Time over which a wheel's error stays the same (slip, quantisation), s: white noise of a frame is
    /// widened by it.
    pub wheel_correlation_s: f64,
    /// Part of a wheel's error that does not average out within that time, m/s.
    pub wheel_floor_mps: f64,
    /// Sideways speed of the rear axle of a fast car on a straight road, m/s.
    pub side_slip_mps: f64,
    /// Sideways speed for each m/s^2 of lateral acceleration at 25 m/s, m/s.
    pub side_slip_per_accel: f64,
    /// Vertical speed of the rear axle, m/s.
    pub jump_mps: f64,
    /// Time over which side-slip stays the same, s.
    pub slip_correlation_s: f64,
    /// Time between two uses of no-side-slip and no-jump, s.
    pub slip_interval_s: f64,
    /// Gate of one innovation: chi-square with one degree (10.83: one in a thousand good values refused).
    pub gate: f64,
    /// So many good-looking wheel values refused in a row, and the next one is taken with its own residual as
    /// noise: a gate must not lock out good data for ever.
    pub patience: u32,
}

impl Default for Tuning {
    fn default() -> Self {
        Self {
            wheel_correlation_s: 0.3,
            wheel_floor_mps: 0.05,
            side_slip_mps: 0.2,
            side_slip_per_accel: 0.15,
            jump_mps: 0.2,
            slip_correlation_s: 1.0,
            slip_interval_s: 0.2,
            gate: 10.83,
            patience: 50,
        }
    }
}

/// The result of one backward pass.
#[derive(Clone, Debug)]
pub struct Pass {
    /// One snapshot an epoch, in recording order.
    pub snapshots: Vec<Snapshot>,
    /// What became of the wheels.
    pub wheels: WheelUse,
}

/// Everything one pass needs.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// The epochs, last first.
    pub reversed: Reversed<'a>,
    /// Where to start.
    pub start: &'a Start,
    /// First look.
    pub motion: &'a Motion,
    /// Earth.
    pub earth: Earth,
    /// Road limits; `None`: not applied.
    pub road: Option<&'a RoadLimits>,
    /// Weights.
    pub tuning: Tuning,
    /// Satellite fixes about the path, for the refined model.
    pub anchor: Option<&'a Anchor>,
}

struct Runner<'a> {
    setup: &'a Setup<'a>,
    geometry: Geometry,
    nav: Nav9,
    belief: Nine,
    use_of_wheels: WheelUse,
    refused_in_row: u32,
    since_slip_s: f64,
    since_road_m: f64,
    hold_off_t: f64,
    /// An innovation variance that is not a positive number: the pass ends there and says so.
    not_positive: Option<f64>,
}

/// Runs the nine-state filter backwards over all epochs.
///
/// # Errors
/// [`ReconstructError::Innovation`] where an innovation variance is not a positive number.
pub fn run(setup: &Setup<'_>) -> Result<Pass, ReconstructError> {
    let epochs = setup.reversed.forward();
    let hold_off = setup.road.map_or(4.0, |r| r.hold_off_s);
    let mut runner = Runner {
        setup,
        geometry: Geometry::new(&epochs.header.vehicle),
        nav: setup.start.nav,
        belief: setup.start.belief.clone(),
        use_of_wheels: WheelUse::default(),
        refused_in_row: 0,
        since_slip_s: 0.0,
        since_road_m: 0.0,
        hold_off_t: setup
            .motion
            .impacts
            .first()
            .map_or(f64::INFINITY, |p| p.onset_s - hold_off),
        not_positive: None,
    };
    let mut snapshots: Vec<Snapshot> = Vec::with_capacity(epochs.list.len());
    for (k, epoch) in setup.reversed.iter() {
        let used = k <= setup.start.k && runner.measure(k, epoch);
        if let Some(found) = runner.not_positive {
            return Err(ReconstructError::Innovation {
                index: epoch.index,
                found,
            });
        }
        snapshots.push(runner.snapshot(epoch, used));
        if k <= setup.start.k {
            runner.step(k, epoch);
        }
    }
    snapshots.reverse();
    Ok(Pass {
        snapshots,
        wheels: runner.use_of_wheels,
    })
}

impl Runner<'_> {
    /// Takes the state from the end of epoch `k` to its start.
    fn step(&mut self, k: usize, epoch: &Epoch) {
        let setup = self.setup;
        if setup.motion.impacts.iter().any(|p| p.last == k) {
            self.jump_biases();
        }
        let f_b = Vec3::<Body>::from(epoch.accel - setup.start.accel_bias);
        let w_b = Vec3::<Body>::from(self.rate(epoch));
        let (next, view) = backward(&self.nav, f_b, w_b, epoch.dt, &setup.earth);
        let noise = self.noise(epoch);
        predict_backward(&mut self.belief, &view, &f_b, &w_b, epoch.dt, &noise);
        self.nav = next;
        self.since_slip_s += epoch.dt;
        self.since_road_m += self.nav.v_n.v.xy().norm() * epoch.dt;
    }

    /// Rate relative to the navigation frame: the bias at rest holds the Earth's rate as the resting body saw
    /// it; what a turned body sees instead is put right where the Earth is known.
    fn rate(&self, epoch: &Epoch) -> Vector3<f64> {
        let w = epoch.rate - self.setup.start.rate_bias;
        if self.setup.earth.rate_n.v == Vector3::zeros() {
            return w;
        }
        w + self.setup.start.rest_earth_b - self.nav.c_nb.m.transpose() * self.setup.earth.rate_n.v
    }

    /// Sensor noise, and the vibration of a moving car, as spectral densities.
    fn noise(&self, epoch: &Epoch) -> Noise {
        let imu = &self.setup.reversed.forward().header.imu;
        let speed = self.nav.v_n.v.norm();
        let driving = (speed / VIBRATION_SPEED).min(1.0);
        let vibration = |sd: f64| (sd * driving).powi(2) * 0.01;
        Noise {
            accel: imu.accel_density.powi(2) + vibration(imu.accel_vibration) + epoch.accel_psd,
            rate: imu.rate_density.powi(2) + vibration(imu.rate_vibration) + epoch.rate_psd,
        }
    }

    /// Going backwards through an impact: before it the biases were others, by the shift of the data sheet.
    fn jump_biases(&mut self) {
        let imu = &self.setup.reversed.forward().header.imu;
        for axis in 0..3 {
            self.belief.p_cc[BA + axis] += imu.accel_bias_jump.powi(2);
            self.belief.p_cc[crate::error_model::BG + axis] += imu.rate_bias_jump.powi(2);
        }
    }

    /// Applies the measurements that hold at the end of epoch `k`; true if a wheel was used.
    fn measure(&mut self, k: usize, epoch: &Epoch) -> bool {
        let used = self.measure_wheels(k, epoch);
        let tuning = &self.setup.tuning;
        if epoch.t_s > self.hold_off_t {
            return used;
        }
        let speed = self.nav.c_nb.m.column(0).dot(&self.nav.v_n.v);
        if self.since_slip_s >= tuning.slip_interval_s
            && speed > 1.0
            && !self.setup.motion.wheels_bad[k]
        {
            self.measure_slip(k, epoch, speed);
            self.since_slip_s = 0.0;
        }
        if let Some(road) = self.setup.road
            && self.since_road_m >= 0.5 * road.correlation_m
        {
            self.measure_road(k, road);
            self.since_road_m = 0.0;
        }
        used
    }

    fn measure_wheels(&mut self, k: usize, epoch: &Epoch) -> bool {
        let header = &self.setup.reversed.forward().header;
        let sheet = &header.wheels;
        let tuning = &self.setup.tuning;
        let rate = self.rate(epoch);
        let accel = self.setup.motion.smooth[k].x;
        let mut used = false;
        for (i, side) in [(0, -1.0), (1, 1.0)] {
            let Some(speed) = epoch.wheels[i] else {
                continue;
            };
            self.use_of_wheels.offered += 1;
            if self.setup.motion.wheels_bad[k] {
                self.use_of_wheels.refused_physics += 1;
                continue;
            }
            // Zero below the cut-off is one-sided: the car was slower than that, which the state knows.
            if speed < sheet.cutoff_mps.max(header.wheel_scale.step) {
                self.use_of_wheels.below_cutoff += 1;
                continue;
            }
            let period = schema::num::real_u64(header.periods.wheels_ns[i]) * 1e-9;
            let period = if period > 0.0 { period } else { 0.02 };
            let widened = (2.0 * tuning.wheel_correlation_s / period).max(1.0);
            let mut variance = sheet.noise_mps.powi(2)
                + header.wheel_scale.step.powi(2) / 12.0
                + tuning.wheel_floor_mps.powi(2) * widened;
            if self.setup.motion.after_impact[k] {
                variance += (0.05 * speed).powi(2) * widened;
            }
            let z = constraint::wheel(
                &self.nav,
                &rate,
                &self.geometry,
                &WheelReading {
                    side,
                    speed,
                    shift_s: sheet.latency_s + 0.5 * epoch.dt,
                    accel,
                    noise: variance.sqrt(),
                },
            );
            if self.apply(&z, tuning.gate) {
                self.refused_in_row = 0;
                self.use_of_wheels.used += 1;
                used = true;
                continue;
            }
            self.use_of_wheels.refused_innovation += 1;
            self.refused_in_row += 1;
            // After an impact a wheel that disagrees may be bent or spin freely: it is never forced in.
            if self.refused_in_row > tuning.patience && !self.setup.motion.after_impact[k] {
                let wide = NineScalar {
                    r: z.r + z.residual * z.residual,
                    ..z
                };
                used |= self.apply(&wide, f64::INFINITY);
            }
        }
        used
    }

    fn measure_slip(&mut self, k: usize, epoch: &Epoch, speed: f64) {
        let tuning = self.setup.tuning;
        let rate = self.rate(epoch);
        let widened = (2.0 * tuning.slip_correlation_s / tuning.slip_interval_s)
            .max(1.0)
            .sqrt();
        let lateral = self.setup.motion.smooth[k].y.abs();
        let sd = tuning
            .side_slip_mps
            .min(SLIP_SHARE * speed + SLIP_FLOOR_MPS)
            + tuning.side_slip_per_accel * lateral * (speed / 25.0);
        let z = constraint::no_side_slip(&self.nav, &rate, &self.geometry, sd * widened);
        self.apply(&z, 2.0 * tuning.gate);
        let sd = tuning.jump_mps.min(0.02 * speed + 0.05);
        let z = constraint::no_jump(&self.nav, &rate, &self.geometry, sd * widened);
        self.apply(&z, 2.0 * tuning.gate);
    }

    /// Bank and grade: one prior each half correlation length, widened so that a whole length counts as one
    /// independent fact; the springs' roll and pitch are added.
    fn measure_road(&mut self, k: usize, road: &RoadLimits) {
        let widened = 4.0;
        let a = self.setup.motion.smooth[k];
        let spring = |x: f64| (0.6 + 0.5 * x.abs()).to_radians().powi(2);
        let roll = (0.5 * road.roll_deg).to_radians().powi(2)
            + road.roll_mean_sd_deg.to_radians().powi(2)
            + spring(a.y);
        let pitch = (0.5 * road.pitch_deg).to_radians().powi(2)
            + self.setup.reversed.forward().header.imu.mounting_sd[1].powi(2)
            + spring(a.x);
        let gate = self.setup.tuning.gate;
        let z = constraint::road_angle(
            &self.nav,
            0,
            road.roll_mean_deg.to_radians(),
            (roll * widened).sqrt(),
        );
        self.apply(&z, gate);
        let z = constraint::road_angle(&self.nav, 1, 0.0, (pitch * widened).sqrt());
        self.apply(&z, gate);
    }

    fn apply(&mut self, z: &NineScalar, gate: f64) -> bool {
        let Some(x) = self.belief.update(z, gate) else {
            let s = self.belief.innovation_variance(z);
            if !(s > 0.0 && s.is_finite()) {
                self.not_positive = Some(s);
            }
            return false;
        };
        self.nav = corrected(&self.nav, &x);
        true
    }

    fn snapshot(&self, epoch: &Epoch, wheels_used: bool) -> Snapshot {
        Snapshot {
            nav: self.nav,
            p: self.belief.p_xx,
            sd_accel: [0, 1].map(|axis| self.sd_accel(epoch, axis)),
            accel_noise: [self.noise(epoch).accel; 2],
            wheels_used,
        }
    }

    /// Spread of the acceleration along a body axis free of gravity: `e . (C' (psi x g) + ba + sa f)` and noise.
    fn sd_accel(&self, epoch: &Epoch, axis: usize) -> f64 {
        let belief = &self.belief;
        let a: Vector3<f64> = self.nav.c_nb.m.column(axis).into_owned();
        let h = Vector3::new(0.0, 0.0, self.setup.earth.gravity).cross(&a);
        let f = epoch.accel[axis];
        let att = belief.p_xx.fixed_view::<3, 3>(ATT, ATT);
        let cross = belief.p_xc.fixed_view::<3, 1>(ATT, BA + axis);
        let noise = self.noise(epoch).accel / epoch.dt;
        let variance = (h.transpose() * att * h)[0]
            + 2.0 * h.dot(&cross)
            + belief.p_cc[BA + axis]
            + belief.p_cc[SA + axis] * f * f
            + noise;
        variance.max(0.0).sqrt()
    }
}

/// The state less its estimated errors: `r -= dr`, `v -= dv`, `C <- Exp(psi) C`.
#[must_use]
pub fn corrected(nav: &Nav9, x: &SVector<f64, STATES>) -> Nav9 {
    let block = |at: usize| Vec3::<Nav>::new(x[at], x[at + 1], x[at + 2]);
    Nav9 {
        r_n: nav.r_n - block(POS),
        v_n: nav.v_n - block(VEL),
        c_nb: nav.c_nb.corrected(block(ATT)),
    }
}
