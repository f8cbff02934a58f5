//! Change of velocity over a pulse: in body axes at its onset and over the ground, with its covariance.
//!
//! `dv_b = C_s' (V_e - V_s)` with `V = v + C (w x arm)` the velocity of the centre of gravity, `s` the onset and `e`
//! the end of the pulse: what the car turned during the pulse is in it, and so is the arm from the IMU.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::error_model::{ATT, STATES, VEL};
use crate::findings::crash::Evidence;
use crate::findings::curve;
use crate::findings::{DeltaV, Figure, pulse_times};
use crate::frame::skew;
use crate::mechanize::Nav9;
use crate::motion::Pulse;

/// A pulse fades below the noise of its end: at least this acceleration is open over the end's timing, m/s^2.
const PULSE_FLOOR: f64 = 8.0;
/// Epochs before the onset whose mean is the rate there.
const RATE_EPOCHS: usize = 5;

/// What a smoother knows of one pulse: the joint covariance, 18 x 18, of the nine errors at the end of epoch
/// `pulse.before` and of those at the end of epoch `pulse.last`, in this order; position, velocity and platform
/// angles each, estimate minus truth, navigation axes.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPulse {
    /// The covariance, m, m/s, rad.
    pub covariance: SMatrix<f64, { 2 * STATES }, { 2 * STATES }>,
}

/// The arm from the IMU to the point that delta-V is given for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arm {
    /// `cg`, or `imu` where the centre of gravity is not known.
    pub(crate) point: &'static str,
    /// Body axes, m.
    pub(crate) at: Vector3<f64>,
    /// One sigma, body axes, m.
    pub(crate) sd: Vector3<f64>,
}

impl Arm {
    pub(crate) fn of(evidence: &Evidence<'_>) -> Self {
        let vehicle = &evidence.epochs.header.vehicle;
        match vehicle.imu_position_m.zip(vehicle.cg_position_m) {
            Some((imu, cg)) => Self {
                point: "cg",
                at: Vector3::from(cg) - Vector3::from(imu),
                sd: Vector3::from_fn(|i, _| {
                    vehicle.imu_position_sd_m[i].hypot(vehicle.cg_position_sd_m[i])
                }),
            },
            None => Self {
                point: "imu",
                at: Vector3::zeros(),
                sd: Vector3::zeros(),
            },
        }
    }
}

/// A moment of the pulse: where the velocity is known, how fast the car turns, and how far it is to the instant meant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment<'a> {
    /// State.
    pub(crate) nav: &'a Nav9,
    /// Rate, body axes, rad/s.
    pub(crate) rate: Vector3<f64>,
    /// Change of velocity from the state's instant to the one meant, body axes, m/s.
    pub(crate) step: Vector3<f64>,
}

/// A change of velocity between two moments, and what its errors need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    /// Attitude at the onset.
    c: Matrix3<f64>,
    /// From the body axes at the end to those at the onset.
    turned: Matrix3<f64>,
    /// Change, navigation axes, m/s.
    pub(crate) nav: Vector3<f64>,
    /// Change, body axes at the onset, m/s.
    pub(crate) body: Vector3<f64>,
    /// `C (w x arm + step)` at the onset and at the end.
    lever: [Vector3<f64>; 2],
    rate: [Vector3<f64>; 2],
    arm: Vector3<f64>,
}

impl Change {
    pub(crate) fn between(start: &Moment<'_>, end: &Moment<'_>, arm: &Vector3<f64>) -> Self {
        let lever = [start, end].map(|m| m.nav.c_nb.m * (m.rate.cross(arm) + m.step));
        let c = start.nav.c_nb.m;
        let nav = (end.nav.v_n.v + lever[1]) - (start.nav.v_n.v + lever[0]);
        Self {
            c,
            turned: c.transpose() * end.nav.c_nb.m,
            nav,
            body: c.transpose() * nav,
            lever,
            rate: [start.rate, end.rate],
            arm: *arm,
        }
    }

    /// Sensitivities (3 x 18) of the change in navigation axes and in body axes to the nine errors at the onset
    /// and the nine at the end. With `C_hat = (I - [psi x]) C`: `d(C u) = [C u x] psi` and
    /// `d(C' V) = C' (dV - [V x] psi)`.
    fn jacobians(&self) -> [SMatrix<f64, 3, { 2 * STATES }>; 2] {
        let mut nav = SMatrix::<f64, 3, { 2 * STATES }>::zeros();
        let identity = Matrix3::identity();
        nav.fixed_view_mut::<3, 3>(0, VEL).copy_from(&-identity);
        nav.fixed_view_mut::<3, 3>(0, STATES + VEL)
            .copy_from(&identity);
        nav.fixed_view_mut::<3, 3>(0, ATT)
            .copy_from(&-skew(&self.lever[0]));
        nav.fixed_view_mut::<3, 3>(0, STATES + ATT)
            .copy_from(&skew(&self.lever[1]));
        let mut body = nav;
        let mut block = body.fixed_view_mut::<3, 3>(0, ATT);
        block -= skew(&self.nav);
        [nav, self.c.transpose() * body]
    }

    /// Share of the arm's doubt and of the two rates' (variances, (rad/s)^2), body axes at the onset.
    fn lever_covariance(&self, arm_sd: &Vector3<f64>, rate: [Vector3<f64>; 2]) -> Matrix3<f64> {
        let by_arm = self.turned * skew(&self.rate[1]) - skew(&self.rate[0]);
        let by_rate = [skew(&self.arm), self.turned * skew(&self.arm)];
        let square = |m: &Matrix3<f64>, variance: &Vector3<f64>| {
            m * Matrix3::from_diagonal(variance) * m.transpose()
        };
        square(&by_arm, &arm_sd.map(|x| x * x))
            + square(&by_rate[0], &rate[0])
            + square(&by_rate[1], &rate[1])
    }
}

/// Rate at the end of epoch `k` (mean of the bins on both sides), and that before a pulse.
pub(crate) fn rate_at(evidence: &Evidence<'_>, k: usize) -> Vector3<f64> {
    let rate = &evidence.motion.rate;
    match rate.get(k + 1) {
        Some(next) => (rate[k] + next) * 0.5,
        None => rate[k],
    }
}

fn rate_before(evidence: &Evidence<'_>, k: usize) -> Vector3<f64> {
    let from = (k + 1).saturating_sub(RATE_EPOCHS);
    let window = &evidence.motion.rate[from..=k];
    window.iter().sum::<Vector3<f64>>() / schema::num::real(window.len())
}

/// Variance of a rate that is the mean over `seconds`, each axis: noise, vibration, and the scale.
fn rate_variance(evidence: &Evidence<'_>, rate: &Vector3<f64>, seconds: f64) -> Vector3<f64> {
    let imu = &evidence.epochs.header.imu;
    let noise = (imu.rate_density.powi(2) + imu.rate_vibration.powi(2) * 0.01) / seconds
        + imu.rate_bias_jump.powi(2);
    rate.map(|w| noise + (imu.rate_scale * w).powi(2))
}

/// The moment at the onset of a pulse.
pub(crate) fn onset<'a>(evidence: &Evidence<'a>, pulse: &Pulse) -> Moment<'a> {
    let lead = pulse.onset_s - evidence.epochs.list[pulse.before].t_s;
    Moment {
        nav: &evidence.snapshots[pulse.before].nav,
        rate: rate_before(evidence, pulse.before),
        step: pulse.base * lead,
    }
}

/// Covariance of a change of velocity, 3 x 3, body axes at the onset, from the data sheet: scale, bias, noise,
/// tilt against gravity, mounting, arm and the timing's variance of each axis.
pub(crate) fn by_sheet(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    last: usize,
    change: &Change,
    seconds: f64,
    timing: &Vector3<f64>,
) -> Matrix3<f64> {
    let epochs = evidence.epochs;
    let imu = &epochs.header.imu;
    let mut noise = (imu.accel_density.powi(2) + imu.accel_vibration.powi(2) * 0.01) * seconds;
    for epoch in &epochs.list[pulse.before..=last] {
        noise += epoch.accel_psd * epoch.dt;
    }
    let p = &evidence.snapshots[pulse.before].p;
    let tilt = p[(ATT, ATT)].max(p[(ATT + 1, ATT + 1)]);
    let bias = imu.accel_bias.powi(2) + imu.accel_bias_jump.powi(2);
    let shared = noise + (bias + tilt * 9.81 * 9.81) * seconds * seconds;
    let dv = &change.body;
    let own = dv.map(|x| shared + (imu.accel_scale * x).powi(2));
    // A mounting yaw turns the whole change across.
    let across = Vector3::new(-dv.y, dv.x, 0.0);
    Matrix3::from_diagonal(&(own + timing))
        + across * across.transpose() * imu.mounting_sd[2].powi(2)
        + lever(evidence, change)
}

fn lever(evidence: &Evidence<'_>, change: &Change) -> Matrix3<f64> {
    let dt = evidence.epochs.list.last().map_or(0.01, |e| e.dt);
    change.lever_covariance(
        &Arm::of(evidence).sd,
        [
            rate_variance(
                evidence,
                &change.rate[0],
                dt * schema::num::real(RATE_EPOCHS),
            ),
            rate_variance(evidence, &change.rate[1], 2.0 * dt),
        ],
    )
}

/// True if an accelerometer stood at its limit in the epochs from `from` to `to`.
pub(crate) fn clipped(evidence: &Evidence<'_>, from: usize, to: usize) -> bool {
    evidence.epochs.list[from..=to]
        .iter()
        .any(|e| e.clipped[..3].iter().any(|c| *c != 0.0))
}

/// Delta-V of one pulse; `joint` where a smoother knows its two sides together.
#[must_use]
pub fn delta_v(evidence: &Evidence<'_>, pulse: &Pulse, joint: Option<&JointPulse>) -> DeltaV {
    let Evidence {
        epochs,
        snapshots,
        quantile,
        ..
    } = *evidence;
    let arm = Arm::of(evidence);
    let last = pulse.last.min(snapshots.len() - 1);
    let over = epochs.list[last].t_s - pulse.end_s;
    let start = onset(evidence, pulse);
    let end = Moment {
        nav: &snapshots[last].nav,
        rate: rate_at(evidence, last),
        step: pulse.level * -over,
    };
    let change = Change::between(&start, &end, &arm.at);
    let after = (pulse.level.xy().norm().max(PULSE_FLOOR) * pulse.end_sd_s).powi(2);
    let timing = pulse
        .base
        .map(|a| (a * pulse.onset_sd_s).powi(2))
        .add_scalar(after);
    let (body, ground) = covariances(evidence, pulse, last, &change, &timing, joint);
    let clipped = clipped(evidence, pulse.before, last);
    let times = pulse_times::all(evidence, pulse);
    let doubt = pulse_times::end_doubt(&times).hypot(0.5 * epochs.list[last].dt);
    let turn = turn(evidence, pulse, last, &change, doubt);
    let plane = Plane {
        x: change.body.x,
        y: change.body.y,
        covariance: [body[(0, 0)], body[(1, 1)], body[(0, 1)]],
    };
    let over_ground = Plane {
        x: change.nav.x,
        y: change.nav.y,
        covariance: [ground[(0, 0)], ground[(1, 1)], ground[(0, 1)]],
    };
    // A clipped sensor leaves the other bound open, unless the velocity is known on both sides by other means.
    let open = clipped && joint.is_none();
    let mut result = plane.delta_v(&over_ground, quantile, open);
    result.duration_s = Figure::non_negative(
        pulse.end_s - pulse.onset_s,
        pulse.onset_sd_s.hypot(doubt),
        quantile,
    );
    result.end_t_s = pulse.end_s;
    result.clipped = clipped;
    result.point = arm.point;
    result.yaw_rate_change_degps = turn;
    result.times = times;
    if evidence.wheels_only {
        // Wheel speeds lag and slip through an impact: their difference bounds nothing.
        result.without_bounds();
    } else {
        result.curve = curve::points(evidence, pulse, joint.is_some());
        result.maximum = curve::maximum(evidence, pulse, &result.curve);
    }
    result
}

/// Covariances in body axes at the onset and in navigation axes.
fn covariances(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    last: usize,
    change: &Change,
    timing: &Vector3<f64>,
    joint: Option<&JointPulse>,
) -> (Matrix3<f64>, Matrix3<f64>) {
    let turned = |m: &Matrix3<f64>| change.c * m * change.c.transpose();
    if let Some(joint) = joint {
        let extra = Matrix3::from_diagonal(timing) + lever(evidence, change);
        let [nav, body] = change.jacobians();
        (
            body * joint.covariance * body.transpose() + extra,
            nav * joint.covariance * nav.transpose() + turned(&extra),
        )
    } else {
        let seconds = (pulse.end_s - pulse.onset_s).max(0.01);
        let body = by_sheet(evidence, pulse, last, change, seconds, timing);
        let p = &evidence.snapshots[pulse.before].p;
        let att = p.fixed_view::<3, 3>(ATT, ATT).into_owned();
        let across = skew(&change.nav);
        (body, turned(&body) + across * att * across.transpose())
    }
}

/// Change of yaw rate over the pulse, whose end is known to `doubt` (one sigma, s).
fn turn(
    evidence: &Evidence<'_>,
    pulse: &Pulse,
    last: usize,
    change: &Change,
    doubt: f64,
) -> Figure {
    let list = &evidence.epochs.list;
    let rate = &evidence.motion.rate;
    let dt = list[last].dt;
    let growth = [last, last + 1, last + 2]
        .iter()
        .filter_map(|&k| Some((rate.get(k)?.z - rate[k - 1].z) / dt))
        .fold(0.0, |m: f64, a| m.max(a.abs()));
    let variance = rate_variance(
        evidence,
        &change.rate[0],
        dt * schema::num::real(RATE_EPOCHS),
    )
    .z + rate_variance(evidence, &change.rate[1], 2.0 * dt).z
        + (growth * doubt).powi(2)
        + list[pulse.before..=last]
            .iter()
            .map(|e| e.rate_psd / e.dt)
            .fold(0.0, f64::max);
    Figure::new(
        (change.rate[1].z - change.rate[0].z).to_degrees(),
        variance.sqrt().to_degrees(),
        evidence.quantile,
    )
}

/// A change in a plane with its covariance: variances of x and y, and their covariance.
struct Plane {
    x: f64,
    y: f64,
    covariance: [f64; 3],
}

impl Plane {
    /// Size, its sd, and the sd of the direction, rad.
    fn polar(&self) -> (f64, f64, f64) {
        let [xx, yy, xy] = self.covariance;
        let size = self.x.hypot(self.y);
        let (c, s) = if size > 0.0 {
            (self.x / size, self.y / size)
        } else {
            (1.0, 0.0)
        };
        let along = c * c * xx + s * s * yy + 2.0 * c * s * xy;
        let across = s * s * xx + c * c * yy - 2.0 * c * s * xy;
        let turn = if size > 0.1 {
            across.max(0.0).sqrt() / size
        } else {
            std::f64::consts::PI
        };
        (size, along.max(0.0).sqrt(), turn)
    }

    fn components(&self, quantile: f64) -> [Figure; 2] {
        [(self.x, self.covariance[0]), (self.y, self.covariance[1])]
            .map(|(value, variance)| Figure::new(value, variance.max(0.0).sqrt(), quantile))
    }

    fn delta_v(&self, ground: &Self, quantile: f64, open: bool) -> DeltaV {
        let (size, sd_size, sd_pdof) = self.polar();
        let (_, _, sd_azimuth) = ground.polar();
        let wide = |figure: Figure| if open { widen(figure) } else { figure };
        let [longitudinal, lateral] = self.components(quantile);
        let [north, east] = ground.components(quantile);
        DeltaV {
            longitudinal_mps: wide(longitudinal),
            lateral_mps: wide(lateral),
            resultant_mps: wide(Figure::non_negative(size, sd_size, quantile)),
            pdof_deg: Figure::new(
                (-self.y).atan2(-self.x).to_degrees(),
                sd_pdof.to_degrees(),
                quantile,
            ),
            cov_longitudinal_lateral: self.covariance[2],
            north_mps: wide(north),
            east_mps: wide(east),
            cov_north_east: ground.covariance[2],
            azimuth_deg: Figure::new(
                ground.y.atan2(ground.x).to_degrees().rem_euclid(360.0),
                sd_azimuth.to_degrees(),
                quantile,
            ),
            lower_bound: open,
            ..DeltaV::default()
        }
    }
}

/// A clipped component is at least what was measured, away from zero: the other bound is open.
pub(crate) fn widen(figure: Figure) -> Figure {
    if figure.value < 0.0 {
        Figure {
            low: f64::NEG_INFINITY,
            ..figure
        }
    } else {
        Figure {
            high: f64::INFINITY,
            ..figure
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Nav, Rot, Vec3};
    use nalgebra::SVector;

    /// Normal numbers of a seed (splitmix64, Box and Muller).
    struct Draws(u64);

    impl Draws {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            (schema::num::real_u64((z ^ (z >> 31)) >> 11) + 0.5) / 9_007_199_254_740_992.0
        }

        fn normal(&mut self) -> f64 {
            let radius = (-2.0 * self.unit().ln()).sqrt();
            radius * (std::f64::consts::TAU * self.unit()).cos()
        }
    }

    fn nav(v: [f64; 3], euler: [f64; 3]) -> Nav9 {
        Nav9 {
            r_n: Vec3::zero(),
            v_n: Vec3::from(Vector3::from(v)),
            c_nb: Rot::from_euler(euler[0], euler[1], euler[2]),
        }
    }

    /// The estimate that has these errors: `C_hat = Exp(-psi) C`.
    fn wrong(truth: &Nav9, e: &[f64]) -> Nav9 {
        let at = |i: usize| Vec3::<Nav>::new(e[i], e[i + 1], e[i + 2]);
        Nav9 {
            r_n: truth.r_n + at(0),
            v_n: truth.v_n + at(VEL),
            c_nb: truth.c_nb.corrected(-at(ATT)),
        }
    }

    struct Setting {
        start: Nav9,
        end: Nav9,
        rate: [Vector3<f64>; 2],
        step: [Vector3<f64>; 2],
        arm: Vector3<f64>,
    }

    impl Setting {
        fn new() -> Self {
            Self {
                start: nav([14.0, -3.0, 0.2], [0.03, -0.02, 0.8]),
                end: nav([3.0, -6.0, 0.1], [0.06, 0.01, 1.0]),
                rate: [Vector3::new(0.1, -0.05, 0.3), Vector3::new(-0.4, 0.2, 3.4)],
                step: [
                    Vector3::new(-0.04, 0.01, 0.0),
                    Vector3::new(0.02, -0.03, 0.0),
                ],
                arm: Vector3::new(0.5, -0.2, -0.1),
            }
        }

        fn change(&self, e: &SVector<f64, 18>, arm: &Vector3<f64>) -> Change {
            let (start, end) = (
                wrong(&self.start, &e.as_slice()[..9]),
                wrong(&self.end, &e.as_slice()[9..]),
            );
            let moment = |nav, i: usize| Moment {
                nav,
                rate: self.rate[i],
                step: self.step[i],
            };
            Change::between(&moment(&start, 0), &moment(&end, 1), arm)
        }
    }

    #[test]
    fn jacobians_meet_finite_differences() {
        let s = Setting::new();
        let [nav, body] = s.change(&SVector::zeros(), &s.arm).jacobians();
        for i in 0..18 {
            let mut e = SVector::zeros();
            e[i] = 1e-5;
            let (up, down) = (s.change(&e, &s.arm), s.change(&-e, &s.arm));
            let by = |a: Vector3<f64>, b: Vector3<f64>| (a - b) / 2e-5;
            assert!((by(up.nav, down.nav) - nav.column(i)).norm() < 1e-8, "{i}");
            assert!(
                (by(up.body, down.body) - body.column(i)).norm() < 1e-8,
                "{i}"
            );
        }
        for i in 0..3 {
            let mut d = Vector3::zeros();
            d[i] = 1e-4;
            let zero = SVector::zeros();
            let moved =
                (s.change(&zero, &(s.arm + d)).body - s.change(&zero, &(s.arm - d)).body) / 2e-4;
            let found = s
                .change(&zero, &s.arm)
                .lever_covariance(&(d * 1e4), [Vector3::zeros(); 2]);
            assert!((found - moved * moved.transpose()).norm() < 1e-8);
        }
    }

    /// 20,000 draws of correlated errors of realistic size against the formula.
    #[test]
    fn the_joint_covariance_meets_a_monte_carlo() {
        let s = Setting::new();
        let mut draws = Draws(7);
        // The two sides share most of their error, as a smoother's do.
        let sd = |i: usize| match i % 9 {
            0..=2 => 0.5,
            3..=5 => 0.08,
            _ => 0.006,
        };
        let mut root = SMatrix::<f64, 18, 18>::zeros();
        for i in 0..18 {
            for j in 0..18 {
                let own = if i == j { 0.3 } else { 0.0 };
                let same = if i % 9 == j % 9 {
                    0.9
                } else {
                    0.15 * draws.normal()
                };
                root[(i, j)] = sd(i) * (own + if j < 9 { same } else { 0.0 });
            }
        }
        let covariance = root * root.transpose();
        let truth = s.change(&SVector::zeros(), &s.arm);
        let [nav, body] = truth.jacobians();
        let arm_sd = Vector3::new(0.05, 0.04, 0.03);
        let by_arm = truth.lever_covariance(&arm_sd, [Vector3::zeros(); 2]);
        let want_body = body * covariance * body.transpose() + by_arm;
        let want_nav = nav * covariance * nav.transpose() + truth.c * by_arm * truth.c.transpose();
        let (mut found_body, mut found_nav) = (Matrix3::zeros(), Matrix3::zeros());
        let n = 20_000_u32;
        for _ in 0..n {
            let white = SVector::<f64, 18>::from_fn(|_, _| draws.normal());
            let arm = s.arm + Vector3::from_fn(|i, _| arm_sd[i] * draws.normal());
            let got = s.change(&(root * white), &arm);
            let (a, b) = (got.body - truth.body, got.nav - truth.nav);
            found_body += a * a.transpose() / f64::from(n);
            found_nav += b * b.transpose() / f64::from(n);
        }
        for (found, want) in [(found_body, want_body), (found_nav, want_nav)] {
            assert!((found - want).norm() < 0.05 * want.norm(), "{found} {want}");
        }
    }

    /// Clipping opens the bound away from zero, and a smoother that knows both sides closes it; wheels alone
    /// bound nothing.
    #[test]
    fn clipping_and_wheels_alone() {
        use crate::simulate::{Class, Scenario, simulate};
        let simulated = simulate(&Scenario::draw(Class::Frontal, 21)).unwrap();
        let samples: Vec<_> = simulated
            .samples()
            .into_iter()
            .enumerate()
            .skip(1000)
            .map(|(k, s)| (schema::num::u64_of(k), 100, s))
            .collect();
        let header = simulated.scenario.header();
        let mut epochs = crate::epochs::Epochs::from_samples(header, &samples, 9.99, &[]).unwrap();
        let earth = crate::mechanize::Earth::flat();
        let rest = crate::rest::find(&epochs, earth.gravity);
        let start = crate::start::at_rest(&epochs, &rest, &earth);
        let reversed = epochs.reversed();
        let motion = crate::motion::Motion::look(&reversed, &start, earth.gravity, &[]);
        let pass = crate::filter::run(&crate::filter::Setup {
            reversed,
            start: &start,
            motion: &motion,
            earth,
            road: None,
            tuning: crate::filter::Tuning::default(),
        })
        .unwrap();
        let pulse = motion.impacts[0];
        epochs.list[pulse.first + 2].clipped[0] = -0.5;
        let evidence = |wheels_only| Evidence {
            epochs: &epochs,
            motion: &motion,
            snapshots: &pass.snapshots,
            quantile: 1.96,
            joint: &[],
            wheels_only,
        };
        let joint = JointPulse {
            covariance: SMatrix::identity() * 1e-4,
        };
        let open = delta_v(&evidence(false), &pulse, None);
        assert!(open.lower_bound && open.clipped && open.resultant_mps.high.is_infinite());
        assert!(open.longitudinal_mps.low.is_infinite() && open.north_mps.low.is_infinite());
        let end = open.curve.iter().min_by(|a, b| {
            let off = |p: &crate::findings::curve::CurvePoint| {
                (p.after_onset_s - (pulse.end_s - pulse.onset_s)).abs()
            };
            off(a).total_cmp(&off(b))
        });
        let apart = end.unwrap().longitudinal_mps.value - open.longitudinal_mps.value;
        assert!(apart.abs() < 0.3, "{apart}");
        let most = open.maximum.unwrap().longitudinal.value_mps.value;
        assert!(most.abs() > open.longitudinal_mps.value.abs() - 0.3);
        let closed = delta_v(&evidence(false), &pulse, Some(&joint));
        assert!(!closed.lower_bound && closed.clipped && closed.resultant_mps.high.is_finite());
        let wheels = delta_v(&evidence(true), &pulse, None);
        assert!(wheels.resultant_mps.sd.is_infinite() && wheels.curve.is_empty());
    }
}
