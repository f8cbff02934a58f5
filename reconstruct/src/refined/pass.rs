//! The backward pass of the refined model: from rest (or from the end of a cut record) to the record's first sample.

mod fixes;

use schema::num::real_u64;

use super::inputs::{Inputs, Mounting};
use super::measure::{self, Scalar, WheelFrame};
use super::prior;
use super::running::Running;
use super::states::SLIP;
use super::tape::{Step, Tape};
use super::transition::Transition;
use super::tuning::Tuning;
use crate::constraint::Geometry;
use crate::epochs::{Epoch, Epochs};
use crate::error::ReconstructError;
use crate::error_model::{STATES, VEL};
use crate::filter::Setup;
use crate::findings::WheelUse;
use crate::mechanize::{Nav9, backward};
use crate::rest::{self, RestInterval, Stand};

/// Speed at rest, one sigma, m/s: what the springs leave once they have settled. A speed error lives on as a drift of
/// the place until the wheels tell it, so a careless centimetre a second is 4 cm at the impact.
pub(super) const REST_SPEED_SD: f64 = 0.002;
/// Gravity where the latitude is not known (and what the ground shakes), m/s^2.
const GRAVITY_SD: f64 = 0.015;
/// Mean of a level accelerometer at rest beside its noise, m/s^2.
const LEVEL_SD: f64 = 0.001;
/// In-run drift of a gyro bias within a minute, as a share of its turn-on bias.
const RATE_BIAS_DRIFT: f64 = 0.02;
/// Speed below which a car that looks still may be standing, beside the state's own spread, m/s.
const STAND_SPEED: f64 = 0.05;
/// Springs of a standing car, rad a second.
const STAND_ANGLE_SD: f64 = 2e-4;
/// A wheel that goes on after an impact may be bent or drag: share of its speed.
const BENT_SHARE: f64 = 0.05;

/// What the pass is given.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a> {
    /// Epochs, start, first look, Earth, road: as for the nine-state filter.
    pub setup: &'a Setup<'a>,
    /// The final rest.
    pub rest: &'a RestInterval,
    /// Spreads and gates.
    pub tuning: &'a Tuning,
    /// Motion to start from instead of the first guess.
    pub again: Option<Nav9>,
    /// Mounting that an earlier pass found (in the drive before the crash), for what a sensor at its limit hides.
    pub mounting: Option<Mounting>,
}

/// Tape and account of one pass.
#[derive(Clone, Debug)]
pub struct Passed {
    /// The linear problem.
    pub tape: Tape,
    /// What became of the wheels.
    pub wheels: WheelUse,
    /// A wheel was used at the end of this epoch, in recording order.
    pub wheels_used: Vec<bool>,
    /// Samples as they were taken.
    pub inputs: Inputs,
    /// Stands before the final rest.
    pub stands: Vec<Stand>,
    /// Refusals by innovation, left and right.
    pub refused: [u64; 2],
    /// Values of a moving car that the physics let through, left and right.
    pub offered: [u64; 2],
    /// Satellite fixes refused by innovation, by their numbers in the record.
    pub fixes_refused: Vec<usize>,
}

struct Runner<'a> {
    given: Given<'a>,
    epochs: &'a Epochs,
    geometry: Geometry,
    inputs: Inputs,
    run: Running,
    wheels: WheelUse,
    refused: [u64; 2],
    offered: [u64; 2],
    fixes_refused: Vec<usize>,
    refused_in_row: [u32; 2],
    since_slip_s: f64,
    since_road_m: f64,
    slip_end_t: f64,
    road_end_t: f64,
}

/// Runs the pass.
///
/// # Errors
/// [`ReconstructError::Innovation`] where an innovation variance is not a positive number.
pub fn run(given: Given<'_>) -> Result<Passed, ReconstructError> {
    let setup = given.setup;
    let epochs = setup.reversed.forward();
    let start_k = setup.start.k;
    let mut stands = rest::stands(epochs, setup.earth.gravity, first_moving_end(&given));
    let mut runner = Runner::new(given);
    let prior = runner.run.p;
    let mut steps: Vec<Step> = Vec::with_capacity(epochs.list.len());
    let mut wheels_used = vec![false; epochs.list.len()];
    let mut transition = None;
    let mut accepted = Vec::new();
    for (k, epoch) in setup.reversed.iter() {
        if k > start_k {
            continue;
        }
        let from = runner.run.linear.len();
        if stands
            .last()
            .is_some_and(|s| k + 1 == s.range.end && !runner.may_stand())
        {
            stands.pop();
        }
        let standing = stands.last().filter(|s| s.range.contains(&k)).cloned();
        match &standing {
            Some(stand) if k + 1 == stand.range.end => runner.stand(stand),
            Some(_) => {}
            None => wheels_used[k] = runner.measure(k, epoch),
        }
        if k == start_k {
            runner.begin();
        }
        if let Some(anchor) = setup.anchor {
            runner.fixes(k, anchor, standing.is_some());
        }
        if let Some(found) = runner.run.failed {
            return Err(ReconstructError::Innovation {
                index: epoch.index,
                found,
            });
        }
        steps.push(Step {
            k,
            transition: transition.take(),
            measurements: from..runner.run.linear.len(),
            nominal: runner.run.nominal,
            p: runner.run.p,
        });
        transition = Some(runner.step(k, epoch, standing.is_some()));
        if let Some(stand) = standing.filter(|s| s.range.start == k) {
            accepted.push(stand);
            stands.pop();
        }
    }
    Ok(Passed {
        tape: Tape {
            prior,
            steps,
            linear: runner.run.linear,
        },
        wheels: runner.wheels,
        wheels_used,
        inputs: runner.inputs,
        stands: accepted,
        refused: runner.refused,
        offered: runner.offered,
        fixes_refused: runner.fixes_refused,
    })
}

/// First epoch of the final rest, or the number of epochs.
fn first_moving_end(given: &Given<'_>) -> usize {
    if given.rest.found() {
        given.rest.range.start
    } else {
        given.setup.start.k + 1
    }
}

impl<'a> Runner<'a> {
    fn new(given: Given<'a>) -> Self {
        let setup = given.setup;
        let epochs = setup.reversed.forward();
        let first = setup.motion.impacts.first();
        let before = |seconds: f64| first.map_or(f64::INFINITY, |p| p.onset_s - seconds);
        Self {
            given,
            epochs,
            geometry: Geometry::new(&epochs.header.vehicle),
            inputs: Inputs::new(epochs, setup.motion).leaning(given.mounting.as_ref()),
            run: Running::new(&prior::nominal(&given), &prior::covariance(&given)),
            wheels: WheelUse::default(),
            refused: [0; 2],
            offered: [0; 2],
            fixes_refused: Vec::new(),
            refused_in_row: [0; 2],
            since_slip_s: 0.0,
            since_road_m: 0.0,
            slip_end_t: before(given.tuning.slip_hold_off_s),
            road_end_t: before(setup.road.map_or(4.0, |r| r.hold_off_s)),
        }
    }

    /// What the final rest says, or nothing where there is none.
    fn begin(&mut self) {
        let rest = self.given.rest;
        if !rest.found() {
            return;
        }
        let stand = Stand {
            range: rest.settled..rest.range.end,
            seconds: rest.settled_s,
            accel: rest.accel,
            rate: rest.rate,
        };
        self.stand(&stand);
    }

    /// True if the state allows that the car stands: locked wheels that slide steadily look like a stand to every sensor.
    fn may_stand(&self) -> bool {
        (0..3).all(|axis| {
            let sd = self.run.p[(VEL + axis, VEL + axis)].max(0.0).sqrt();
            self.run.nominal.nav.v_n.v[axis].abs() < STAND_SPEED + 4.0 * sd
        })
    }

    /// Rest: velocity zero, levelling, gyro bias from the mean rate.
    fn stand(&mut self, stand: &Stand) {
        let imu = &self.epochs.header.imu;
        let (earth, seconds) = (self.given.setup.earth, stand.seconds.max(0.01));
        let level = (imu.accel_density.powi(2) / seconds + LEVEL_SD * LEVEL_SD).sqrt();
        let quiet =
            (imu.rate_density.powi(2) / seconds + (RATE_BIAS_DRIFT * imu.rate_bias).powi(2)).sqrt();
        for axis in 0..3 {
            let z = measure::standstill(&self.run.nominal, axis, REST_SPEED_SD);
            self.run.apply(&z, f64::INFINITY);
        }
        for axis in 0..3 {
            let sd = if axis == 2 {
                level.hypot(GRAVITY_SD)
            } else {
                level
            };
            let z = measure::levelling(&self.run.nominal, &stand.accel, earth.gravity, axis, sd);
            self.run.apply(&z, f64::INFINITY);
        }
        for axis in 0..3 {
            let rate = self.run.nominal.rate(&stand.rate, &earth).v[axis];
            self.run
                .apply(&measure::rest_rate(rate, axis, quiet), f64::INFINITY);
        }
    }

    /// From the end of epoch `k` to its start.
    fn step(&mut self, k: usize, epoch: &Epoch, standing: bool) -> Transition {
        let setup = self.given.setup;
        let tuning = self.given.tuning;
        let transition = if standing {
            Transition::standing(STAND_ANGLE_SD * epoch.dt.sqrt())
        } else {
            let f_b = self.run.nominal.moving_force(&self.inputs.accel[k]);
            let w_b = self.run.nominal.rate(&self.inputs.rate[k], &setup.earth);
            let (next, view) = backward(&self.run.nominal.nav, f_b, w_b, epoch.dt, &setup.earth);
            let speed = self.run.nominal.nav.v_n.v.norm();
            let mut density = self.inputs.density(self.epochs, k, speed);
            density.rate += w_b.v.map(|w| (tuning.rate_nonlinearity * w).powi(2));
            let known = self.given.mounting.map(|m| m.axes);
            let mounting = known.unwrap_or_else(|| self.run.nominal.mounting());
            self.run.nominal.nav = next;
            self.since_slip_s += epoch.dt;
            self.since_road_m += next.v_n.v.xy().norm() * epoch.dt;
            Transition::moving(&view, &f_b, &w_b, epoch.dt, &density, &mounting)
        };
        let mut transition = transition.with_slip(tuning.slip_sd, tuning.slip_time_s, epoch.dt);
        if setup
            .motion
            .impacts
            .iter()
            .any(|p| usize::midpoint(p.first, p.last) == k)
        {
            let imu = &self.epochs.header.imu;
            transition =
                transition.with_jump([imu.accel_bias_jump.powi(2), imu.rate_bias_jump.powi(2)]);
        }
        transition.predict(&mut self.run.p);
        self.run.nominal.cal[SLIP - STATES] *= (-epoch.dt / tuning.slip_time_s).exp();
        transition
    }

    /// Everything that holds at the end of epoch `k`; true if a wheel was used.
    fn measure(&mut self, k: usize, epoch: &Epoch) -> bool {
        let used = self.measure_wheels(k, epoch);
        let tuning = self.given.tuning;
        let motion = self.given.setup.motion;
        let speed = self
            .run
            .nominal
            .nav
            .c_nb
            .m
            .column(0)
            .dot(&self.run.nominal.nav.v_n.v);
        if epoch.t_s <= self.slip_end_t
            && self.since_slip_s >= tuning.slip_interval_s - 1e-9
            && speed > 1.0
            && !motion.wheels_bad[k]
        {
            self.measure_slip(k, speed);
            self.since_slip_s = 0.0;
        }
        if let Some(road) = self.given.setup.road
            && epoch.t_s <= self.road_end_t
            && self.since_road_m >= 0.5 * road.correlation_m
        {
            self.measure_road(k);
            self.since_road_m = 0.0;
        }
        used
    }

    fn measure_wheels(&mut self, k: usize, epoch: &Epoch) -> bool {
        let header = &self.epochs.header;
        let (sheet, motion) = (&header.wheels, self.given.setup.motion);
        let tuning = self.given.tuning;
        let mut used = false;
        let cutoff = sheet.cutoff_mps.max(header.wheel_scale.step);
        let moving = self.run.nominal.nav.v_n.v.norm() > 2.0 * cutoff + 1.0;
        for side in 0..2 {
            let Some(speed) = epoch.wheels[side] else {
                continue;
            };
            self.wheels.offered += 1;
            if motion.wheels_bad[k] {
                self.wheels.refused_physics += 1;
                continue;
            }
            self.offered[side] += u64::from(moving);
            // Zero below the cut-off is one-sided: the car was slower than that, which the state knows.
            if speed < cutoff {
                self.wheels.below_cutoff += 1;
                continue;
            }
            let period = real_u64(header.periods.wheels_ns[side]) * 1e-9;
            let period = if period > 0.0 { period } else { 0.02 };
            let widened = (2.0 * tuning.wheel_correlation_s / period).max(1.0);
            let mut variance = sheet.noise_mps.powi(2)
                + header.wheel_scale.step.powi(2) / 12.0
                + tuning.wheel_floor_mps.powi(2) * widened;
            if motion.after_impact[k] {
                variance += (BENT_SHARE * speed).powi(2) * widened;
            }
            let rate = self
                .run
                .nominal
                .rate(&self.inputs.rate[k], &self.given.setup.earth)
                .v;
            let frame = WheelFrame {
                side,
                speed,
                age_s: 0.5 * epoch.dt,
                accel: motion.smooth[k].x,
                variance,
            };
            let z = measure::wheel(&self.run.nominal, &rate, &self.geometry, &frame);
            if self.run.apply(&z, tuning.gate) {
                self.refused_in_row[side] = 0;
                self.wheels.used += 1;
                used = true;
                continue;
            }
            self.wheels.refused_innovation += 1;
            self.refused[side] += 1;
            self.refused_in_row[side] += 1;
            // A gate must not lock out good data for ever: where both wheels are refused, it is the state that is off
            // (or both slip, which the physics sees). One wheel alone is the wheel's own fault. After an impact a
            // wheel that disagrees may be bent or spin freely: it is never forced in.
            let both = self.refused_in_row.iter().all(|n| *n > tuning.patience);
            if both && !motion.after_impact[k] {
                let wide = Scalar {
                    r: z.r + z.residual * z.residual,
                    ..z
                };
                used |= self.run.apply(&wide, f64::INFINITY);
            }
        }
        used
    }

    fn measure_slip(&mut self, k: usize, speed: f64) {
        let tuning = self.given.tuning;
        let rate = self
            .run
            .nominal
            .rate(&self.inputs.rate[k], &self.given.setup.earth)
            .v;
        let lateral = self.given.setup.motion.smooth[k].y;
        let z = measure::side_slip(
            &self.run.nominal,
            &rate,
            &self.geometry,
            lateral,
            tuning.slip_white_mps,
        );
        self.run.apply(&z, 2.0 * tuning.gate);
        let widened = (2.0 * tuning.jump_correlation_s / tuning.slip_interval_s)
            .max(1.0)
            .sqrt();
        let sd = (tuning.jump[0] * speed + tuning.jump[1]) * widened;
        let z = measure::no_jump(&self.run.nominal, &rate, &self.geometry, sd);
        self.run.apply(&z, 2.0 * tuning.gate);
    }

    /// Bank and grade: one prior each half correlation length, widened so that a whole length counts as one
    /// independent fact; the springs' roll and pitch are added.
    fn measure_road(&mut self, k: usize) {
        let Some(road) = self.given.setup.road else {
            return;
        };
        let widened = 4.0;
        let a = self.given.setup.motion.smooth[k];
        let mounting = self.epochs.header.imu.mounting_sd;
        let spring = |x: f64| (0.6 + 0.5 * x.abs()).to_radians().powi(2);
        let roll = (0.5 * road.roll_deg).to_radians().powi(2)
            + road.roll_mean_sd_deg.to_radians().powi(2)
            + mounting[0].powi(2)
            + spring(a.y);
        let pitch = (0.5 * road.pitch_deg).to_radians().powi(2) + mounting[1].powi(2) + spring(a.x);
        let gate = self.given.tuning.gate;
        let z = measure::road(
            &self.run.nominal,
            0,
            road.roll_mean_deg.to_radians(),
            (roll * widened).sqrt(),
        );
        self.run.apply(&z, gate);
        let z = measure::road(&self.run.nominal, 1, 0.0, (pitch * widened).sqrt());
        self.run.apply(&z, gate);
    }
}
