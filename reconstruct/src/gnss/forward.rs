//! Our filter over fixes and inertial periods: the refined model's states, rows and steps, forwards in time on WGS 84.
//!
//! The motion is kept in the local north-east-down axes of an anchor that travels with the car: after every step the
//! anchor is moved to the car and the axes turn to it, so that Earth rate, transport rate and Coriolis are exact. Satellite
//! errors change slowly: what fixes share is a Gauss-Markov process along each axis, in the three states from [`PLACE`] on (the
//! crash path holds the pose of its fixes there), in units of what a fix says of itself.

mod estimate;
mod fix;
mod stand;
mod start;

use nalgebra::Vector3;

use super::drive::{Drive, Period, ReckonError};
use super::sheet::Sheet;
use crate::error_model::{ATT, STATES, VEL};
use crate::frame::{Rot, Vec3};
use crate::mechanize::{Earth, Nav9, forward};
use crate::refined::measure::{self, Scalar};
use crate::refined::running::Running;
use crate::refined::states::{BG, Cov, Nominal, PARAMS, PLACE, Row, SLIP, SLIP_GRADIENT};
use crate::refined::tape::{Step, Tape};
use crate::refined::transition::{Density, SHARED, Transition};
use crate::wgs84::Geodetic;
pub(super) use estimate::estimate;
pub use estimate::{Estimate, Fate, FixUse};
use stand::STAND_INTERVAL_S;
pub use start::Start;
use start::prior;

/// Gate of one innovation: chi-square with one degree.
const GATE: f64 = 13.8;
/// White specific force along the car's vertical on the move beside its noise, m/s^2/sqrt(Hz). What it tells of the pitch is of
/// second order, `g theta^2 / 2`; rows about an estimate of the pitch that moves take it for first. With a fix each 30 s from a
/// moving start (seeds 1 to 40) the pitch was surer than it was right, 1.6 sigma after 25 s, and 4 of 40 drives were lost; so
/// 0.7 sigma and none, together with [`Runner::second_order`].
const UPRIGHT_DENSITY: f64 = 0.3;
/// A car that the state says is faster than this beside its spread does not stand, m/s.
const STAND_SPEED: f64 = 1.0;

/// A finished pass.
#[derive(Clone, Debug)]
pub struct Passed {
    /// First period of the pass.
    pub first: usize,
    /// The filter's own answer, one entry a period from `first` on.
    pub estimates: Vec<Estimate>,
    /// Fixes.
    pub fixes: FixUse,
    /// What became of each fix of the pass: the instant it was true, s, in order of time.
    pub fates: Vec<(f64, Fate)>,
}

/// Some periods of a pass as a linear problem, for the smoother.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    pub(super) tape: Tape,
    /// Anchor of each step's axes.
    pub(super) anchors: Vec<Geodetic>,
}

impl Stretch {
    pub(super) fn empty() -> Self {
        let tape = Tape {
            prior: Cov::zeros(),
            steps: Vec::new(),
            linear: Vec::new(),
        };
        let anchors = Vec::new();
        Self { tape, anchors }
    }
}

/// A pass between two periods.
#[derive(Clone)]
pub(super) struct Runner<'a> {
    drive: &'a Drive,
    standing: &'a [bool],
    sheet: &'a Sheet,
    run: Running,
    anchor: Geodetic,
    earth: Earth,
    refused: u32,
    speeds_refused: u32,
    inflate: f64,
    since_slip_s: f64,
    since_stand_s: f64,
    stood_s: f64,
    use_of: FixUse,
    fates: Vec<(f64, Fate)>,
    /// First period of the pass, and of what is told beside the periods that which comes next: fix, speed, heading.
    first: usize,
    next: [usize; 3],
    /// What a turn of everything about the vertical since the last fix is, as the pass carried it: see [`Runner::bind`].
    turned: Row,
}

/// Runs the filter from `start` to the end of the drive. `standing` has one entry a period ([`super::stop`]).
///
/// # Errors
/// [`ReckonError::Drive`] where the start is not in the drive; [`ReckonError::Numeric`] where the arithmetic fails.
pub fn run(
    drive: &Drive,
    standing: &[bool],
    sheet: &Sheet,
    start: &Start,
) -> Result<Passed, ReckonError> {
    let mut runner = Runner::new(drive, standing, sheet, start)?;
    let list = start.first..drive.periods.len();
    let estimates = list
        .map(|k| runner.epoch(k, None))
        .collect::<Result<_, _>>()?;
    Ok(runner.passed(estimates))
}

impl<'a> Runner<'a> {
    pub(super) fn new(
        drive: &'a Drive,
        standing: &'a [bool],
        sheet: &'a Sheet,
        start: &Start,
    ) -> Result<Self, ReckonError> {
        if start.first >= drive.periods.len() || standing.len() != drive.periods.len() {
            return Err(ReckonError::Drive {
                what: format!(
                    "start: expected a period below {}, found {}",
                    drive.periods.len().min(standing.len()),
                    start.first
                ),
            });
        }
        let [roll, pitch, heading] = start.angles;
        let mut cal = nalgebra::SVector::<f64, PARAMS>::zeros();
        cal[SLIP_GRADIENT - STATES] = sheet.tuning.slip_gradient[0];
        if let Some((bias, _)) = start.rate_bias {
            cal.fixed_rows_mut::<3>(BG - STATES).copy_from(&bias);
        }
        let nominal = Nominal {
            nav: Nav9 {
                r_n: Vec3::zero(),
                v_n: Vec3::from(start.v_n),
                c_nb: Rot::from_euler(roll, pitch, heading),
            },
            cal,
        };
        let t_start = drive.periods[start.first].t_s;
        Ok(Self {
            drive,
            standing,
            sheet,
            run: Running::new(&nominal, &prior(sheet, start, &nominal)),
            anchor: start.place,
            earth: Earth::at(start.place.latitude, 0.0),
            refused: 0,
            speeds_refused: 0,
            inflate: 1.0,
            since_slip_s: 0.0,
            since_stand_s: 0.0,
            stood_s: 0.0,
            use_of: FixUse::default(),
            fates: Vec::new(),
            first: start.first,
            next: [
                // The start is that of a fix, whose stamp may miss the period's by rounding.
                drive.fixes.partition_point(|f| f.t_s <= t_start + 1e-6),
                drive.speeds.partition_point(|s| s.t_s <= t_start),
                drive.headings.partition_point(|h| h.t_s <= t_start),
            ],
            turned: turn_of(&nominal),
        })
    }

    /// Ends the pass.
    pub(super) fn passed(self, estimates: Vec<Estimate>) -> Passed {
        Passed {
            first: self.first,
            estimates,
            fixes: self.use_of,
            fates: self.fates,
        }
    }

    /// Period `k`: those before have been taken. What it is to the smoother is added to `taken`.
    ///
    /// # Errors
    /// [`ReckonError::Numeric`] where the arithmetic fails.
    pub(super) fn epoch(
        &mut self,
        k: usize,
        taken: Option<&mut Stretch>,
    ) -> Result<Estimate, ReckonError> {
        let drive = self.drive;
        let period = &drive.periods[k];
        let stands = self.standing[k] && (k == self.first || self.may_stand());
        let transition = (k > self.first).then(|| self.step(k, stands));
        let before = self.use_of.used + self.use_of.forced;
        let due = |t_s: f64| t_s <= period.t_s;
        while let Some(fix) = drive.fixes.get(self.next[0]).filter(|f| due(f.t_s)) {
            self.fix(fix, period.t_s);
            self.next[0] += 1;
        }
        while let Some(speed) = drive.speeds.get(self.next[1]).filter(|s| due(s.t_s)) {
            self.speed(k, speed.speed, speed.sd);
            self.next[1] += 1;
        }
        while let Some(headed) = drive.headings.get(self.next[2]).filter(|h| due(h.t_s)) {
            self.heading(headed, k);
            self.next[2] += 1;
        }
        self.constrain(k, stands);
        if let Some(found) = self.run.failed {
            return Err(ReckonError::Numeric {
                t_s: period.t_s,
                what: format!("innovation variance: expected a positive number, found {found}"),
            });
        }
        let mut told = estimate(
            period.t_s,
            &self.anchor,
            &self.run.nominal,
            &self.run.p.fixed_view::<STATES, STATES>(0, 0).into_owned(),
            [0, 1, 2].map(|i| self.run.p[(BG + i, BG + i)]),
            self.sheet.mounting[0],
        );
        told.standing = stands;
        told.fixed = self.use_of.used + self.use_of.forced > before;
        if let Some(taken) = taken {
            let from = taken.tape.linear.len();
            taken.tape.linear.append(&mut self.run.linear);
            taken.tape.steps.push(Step {
                k,
                transition,
                measurements: from..taken.tape.linear.len(),
                nominal: self.run.nominal,
                p: self.run.p,
            });
            taken.anchors.push(self.anchor);
        }
        self.run.linear.clear();
        Ok(told)
    }

    /// The row of something that a car obeys, which tells nothing of where north is.
    ///
    /// About the true state it would not: a turn of attitude and velocity together is no residual. The filter carries that
    /// turn on from estimates that it has since changed, and rows about the new ones see it: a second of a bend then makes the
    /// heading surer without cause (120 s without fixes: squared error of the heading twice the variance). The row's share of
    /// the heading is set to what leaves the carried turn unseen.
    fn bind(&mut self, mut z: Scalar, gate: f64) -> bool {
        let seen = z.h.dot(&self.turned);
        z.h[ATT + 2] -= seen / self.turned[ATT + 2];
        self.run.apply(&z, gate)
    }

    /// Locked wheels or a smooth road may look like a stand: the state must allow it.
    fn may_stand(&self) -> bool {
        let v = &self.run.nominal.nav.v_n.v;
        let sd = (self.run.p[(VEL, VEL)] + self.run.p[(VEL + 1, VEL + 1)])
            .max(0.0)
            .sqrt();
        v.xy().norm() < STAND_SPEED + 4.0 * sd
    }

    /// From the start of period `k` to its end.
    fn step(&mut self, k: usize, stands: bool) -> Transition {
        let period = &self.drive.periods[k];
        let tuning = &self.sheet.tuning;
        let nominal = &self.run.nominal;
        let f_b = nominal.moving_force(&period.accel);
        let w_b = nominal.rate(&period.rate, &self.earth);
        let (next, view) = forward(&nominal.nav, f_b, w_b, period.dt, &self.earth);
        let mut density = self.density(period, stands);
        density.rate += w_b.v.map(|w| (tuning.rate_nonlinearity * w).powi(2));
        let mounting = nominal.mounting();
        self.run.nominal.nav = next;
        self.since_slip_s += period.dt;
        let transition = Transition::ahead(&view, &f_b, &w_b, period.dt, &density, &mounting);
        let drift = [
            self.sheet.accel_drift.powi(2) * period.dt,
            self.sheet.rate_drift.powi(2) * period.dt,
        ];
        let transition = transition
            .with_slip(tuning.slip_sd, tuning.slip_time_s, period.dt)
            .with_shared(self.sheet.fix_time_s, period.dt)
            .with_jump(drift);
        transition.predict(&mut self.run.p);
        self.turned = transition.apply(&self.turned);
        self.run.nominal.cal[SLIP - STATES] *= transition.decay();
        let mut shared = self
            .run
            .nominal
            .cal
            .fixed_rows_mut::<SHARED>(PLACE - STATES);
        shared *= transition.shared();
        self.travel();
        transition
    }

    /// Moves the anchor to the car; the axes turn with it.
    fn travel(&mut self) {
        let nav = &mut self.run.nominal.nav;
        let here = self.anchor.moved(&nav.r_n.v);
        let turn = here.turn_from(&self.anchor);
        *nav = Nav9 {
            r_n: Vec3::zero(),
            v_n: Vec3::from(turn * nav.v_n.v),
            c_nb: Rot::from_matrix(turn * nav.c_nb.m),
        };
        self.anchor = here;
        self.earth = Earth::at(here.latitude, 0.0);
    }

    fn density(&self, period: &Period, stands: bool) -> Density {
        let sheet = self.sheet;
        let square = |v: &Vector3<f64>| v.component_mul(v);
        let mut out = if stands {
            Density {
                accel: square(&sheet.still_accel) * period.dt,
                rate: square(&sheet.still_rate) * period.dt,
            }
        } else {
            Density {
                accel: square(&sheet.accel_density)
                    + Vector3::new(0.0, 0.0, UPRIGHT_DENSITY.powi(2)),
                rate: square(&sheet.rate_density),
            }
        };
        if !period.measured {
            // What a held sample hides: a second of braking or of a bend.
            out.accel += Vector3::repeat(4.0);
            out.rate += Vector3::repeat(0.04);
        }
        out
    }

    fn speed(&mut self, k: usize, speed: f64, sd: f64) {
        let rate = self
            .run
            .nominal
            .rate(&self.drive.periods[k].rate, &self.earth)
            .v;
        let z = measure::forward_speed(&self.run.nominal, &rate, &self.sheet.geometry, speed, sd);
        self.bind(z, 4.0 * GATE);
    }

    /// What a car obeys: it stands, or its rear axle goes where it points.
    fn constrain(&mut self, k: usize, stands: bool) {
        let period = &self.drive.periods[k];
        if stands {
            self.stood_s += period.dt;
            self.since_stand_s += period.dt;
            if self.since_stand_s >= STAND_INTERVAL_S - 1e-9 {
                self.since_stand_s = 0.0;
                self.stand(k);
            }
            return;
        }
        self.stood_s = 0.0;
        self.since_stand_s = STAND_INTERVAL_S;
        let nav = &self.run.nominal.nav;
        let speed = nav.c_nb.m.column(0).dot(&nav.v_n.v);
        let tuning = &self.sheet.tuning;
        if speed < 1.0 || self.since_slip_s < tuning.slip_interval_s - 1e-9 {
            return;
        }
        self.since_slip_s = 0.0;
        let rate = self.run.nominal.rate(&period.rate, &self.earth).v;
        let lateral = (speed * rate.z).clamp(-8.0, 8.0);
        let z = measure::side_slip(
            &self.run.nominal,
            &rate,
            &self.sheet.geometry,
            lateral,
            tuning.slip_white_mps.hypot(self.second_order()),
        );
        self.bind(z, 2.0 * GATE);
        let widened = (2.0 * tuning.jump_correlation_s / tuning.slip_interval_s)
            .max(1.0)
            .sqrt();
        let sd = (tuning.jump[0] * speed + tuning.jump[1]) * widened;
        let z = measure::no_jump(&self.run.nominal, &rate, &self.sheet.geometry, sd);
        self.bind(z, 2.0 * GATE);
    }

    /// What a row of the sideslip leaves out while speed and heading are unsure together: the product of both errors, m/s, one
    /// sigma. It is the same for about a second and counts as that many uses.
    fn second_order(&self) -> f64 {
        let p = &self.run.p;
        let product = (p[(VEL, VEL)] + p[(VEL + 1, VEL + 1)]) * p[(ATT + 2, ATT + 2)];
        (product / self.sheet.tuning.slip_interval_s)
            .max(0.0)
            .sqrt()
    }
}

/// A turn of the whole motion about the vertical by a radian, as errors: `psi = z`, `dv = -z x v`.
fn turn_of(nominal: &Nominal) -> Row {
    let mut turn = Row::zeros();
    let v = -Vector3::z().cross(&nominal.nav.v_n.v);
    turn.fixed_rows_mut::<3>(VEL).copy_from(&v);
    turn[ATT + 2] = 1.0;
    turn
}
