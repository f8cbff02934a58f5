//! Where the filter starts and how unsure it is there.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::error_model::{ATT, POS, VEL};
use crate::gnss::drive::{Drive, Fixed, Period, ReckonError};
use crate::gnss::sheet::Sheet;
use crate::refined::states::{
    BA, BG, Cov, LEVER, MOUNT_PITCH, MOUNT_YAW, Nominal, PLACE, SA, SG, SLIP, SLIP_GRADIENT,
};
use crate::wgs84::Geodetic;

/// Where the filter starts: the state at the end of the period `first`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Index of the period.
    pub first: usize,
    /// Place: that of a fix.
    pub place: Geodetic,
    /// One sigma of it, north, east, down, m; not less than the sheet's.
    pub place_sd: Vector3<f64>,
    /// Velocity, m/s.
    pub v_n: Vector3<f64>,
    /// One sigma, m/s.
    pub v_sd: Vector3<f64>,
    /// Roll, pitch, heading, rad.
    pub angles: [f64; 3],
    /// One sigma of each, rad; that of the heading beside what `by_course` adds.
    pub angles_sd: [f64; 3],
    /// The heading is the course of `v_n`: what that is wrong across, the heading is with it.
    pub by_course: bool,
    /// Gyro bias in the axes of the periods, rad/s, and one sigma; `None`: zero within the sheet.
    pub rate_bias: Option<(Vector3<f64>, f64)>,
}

/// Least speed of a fix whose course tells the heading, m/s [S00, 3.6].
const COURSE_SPEED: f64 = 3.0;

impl Start {
    /// At the first fix that moves and agrees with those after it (the first that moves, where none does): its place, its
    /// velocity, its course as heading; the car level. The gyro bias is the median of the stands before it, where there are any.
    ///
    /// # Errors
    /// [`ReckonError::Drive`] if no fix within the drive moves at 3 m/s or more.
    pub fn at_first_course(drive: &Drive, standing: &[bool]) -> Result<Self, ReckonError> {
        let fail = || ReckonError::Drive {
            what: format!(
                "expected a fix that moves at {COURSE_SPEED} m/s or more to start from, found none of {}",
                drive.fixes.len()
            ),
        };
        let [begin, end] = drive.span().unwrap_or([f64::INFINITY, f64::NEG_INFINITY]);
        let moving = |i: &usize| {
            drive.fixes.get(*i).is_some_and(|f| {
                let within = f.t_s >= begin && f.t_s <= end + 1e-6;
                within && f.v_n.is_some_and(|v| v.xy().norm() >= COURSE_SPEED)
            })
        };
        let all = || (0..drive.fixes.len()).filter(moving);
        let chosen = all().find(|i| agrees(drive, *i)).or(all().next());
        let Some((fix, v_n)) = chosen.and_then(|i| Some((&drive.fixes[i], drive.fixes[i].v_n?)))
        else {
            return Err(fail());
        };
        let first = drive.periods.partition_point(|p| p.t_s < fix.t_s - 1e-6);
        let course = v_n.y.atan2(v_n.x);
        Ok(Self {
            first,
            place: fix.place,
            place_sd: fix.place_sd,
            v_n,
            v_sd: fix.v_sd,
            angles: [0.0, 0.0, course],
            angles_sd: [LEVEL_ANGLE_SD, LEVEL_ANGLE_SD, COURSE_SD],
            by_course: true,
            rate_bias: bias(&drive.periods[..first], standing),
        })
    }
}

/// The gyro bias that stands tell, rad/s, and one sigma: about each axis the median over blocks of half a second, since the
/// last of what is taken for a stand may be a car that already rolls and turns. Their spread is that of the noise and of such
/// ends.
fn bias(periods: &[Period], standing: &[bool]) -> Option<(Vector3<f64>, f64)> {
    let mut blocks: Vec<Vector3<f64>> = Vec::new();
    let (mut sum, mut count, mut length) = (Vector3::zeros(), 0_usize, 0.0);
    for (period, still) in periods.iter().zip(standing) {
        if !(*still && period.measured) {
            (sum, count, length) = (Vector3::zeros(), 0, 0.0);
            continue;
        }
        sum += period.rate;
        count += 1;
        length += period.dt;
        if length > BLOCK_S - 1e-6 {
            blocks.push(sum / schema::num::real(count));
            (sum, count, length) = (Vector3::zeros(), 0, 0.0);
        }
    }
    let middle = |mut list: Vec<f64>| {
        list.sort_by(f64::total_cmp);
        list.get(list.len() / 2).copied()
    };
    let of = |axis: usize| middle(blocks.iter().map(|b| b[axis]).collect());
    let mean = Vector3::new(of(0)?, of(1)?, of(2)?);
    let spread = |axis: usize| {
        middle(
            blocks
                .iter()
                .map(|b| (b[axis] - mean[axis]).abs())
                .collect(),
        )
        .unwrap_or(0.0)
    };
    // Of a median: 1.48 of the middle deviation is a sigma, and 1.25 that over the root of their number.
    let sd = 1.25 * 1.48 * spread(0).max(spread(1)).max(spread(2));
    let n = schema::num::real(blocks.len());
    Some((mean, STAND_BIAS_SD.hypot(sd / n.sqrt())))
}

/// A fix is held against so many after it, within so many seconds.
const COMPANY: usize = 5;
const COMPANY_S: f64 = 5.5;
/// What an untold slope and biases make of the speed that the accelerometer tells, m/s a second, and a floor, m/s.
const SPEED_DRIFT: [f64; 2] = [0.7, 0.5];

/// Does a fix agree with most of those that come soon after it, in place and velocity? Where none comes it must.
fn agrees(drive: &Drive, i: usize) -> bool {
    let Some((first, rest)) = drive.fixes.get(i..).and_then(<[Fixed]>::split_first) else {
        return false;
    };
    let soon = |f: &&Fixed| f.t_s - first.t_s <= COMPANY_S;
    let (mut good, mut of) = (0, 0);
    for fix in rest.iter().take(COMPANY).take_while(soon) {
        of += 1;
        good += u32::from(fits(drive, first, fix));
    }
    2 * good > of || of == 0
}

/// Could the car come from one fix to the other, as its forward accelerometer and its vertical gyro felt it?
fn fits(drive: &Drive, a: &Fixed, b: &Fixed) -> bool {
    let dt = b.t_s - a.t_s;
    let (Some(va), Some(vb)) = (a.v_n, b.v_n) else {
        return false;
    };
    let at = |t: f64| drive.periods.partition_point(|p| p.t_s <= t);
    let (mut speed, mut course) = (va.xy().norm(), va.y.atan2(va.x));
    let mut way = Vector2::zeros();
    for period in &drive.periods[at(a.t_s)..at(b.t_s)] {
        course += period.rate.z * period.dt;
        speed += period.accel.x * period.dt;
        way += Vector2::new(course.cos(), course.sin()) * (speed * period.dt);
    }
    let come = Vector2::new(course.cos(), course.sin()) * speed;
    let drift = SPEED_DRIFT[0] * dt + SPEED_DRIFT[1];
    let place_sd = a.place_sd.xy().norm().hypot(b.place_sd.xy().norm());
    let speed_sd = a.v_sd.xy().norm().hypot(b.v_sd.xy().norm());
    (a.place.to(&b.place).xy() - way).norm() < 3.0 * place_sd + (3.0 * speed_sd + drift) * dt
        && (vb.xy() - come).norm() < 3.0 * speed_sd + drift
}

/// Roll and pitch of a car on a road, rad.
const LEVEL_ANGLE_SD: f64 = 0.04;
/// Course against heading, rad: sideslip.
const COURSE_SD: f64 = 0.02;
/// Length of a block, s.
const BLOCK_S: f64 = 0.5;
/// Gyro bias from a stand some time ago, rad/s.
const STAND_BIAS_SD: f64 = 5e-4;

/// What is known at the start.
pub(super) fn prior(sheet: &Sheet, start: &Start, nominal: &Nominal) -> Cov {
    let place_sd = start.place_sd.zip_map(&sheet.fix_floor, f64::max);
    let mut p = Cov::from_diagonal_element(1e-12);
    let mut set = |state: usize, sd: f64| p[(state, state)] = (sd * sd).max(1e-12);
    for axis in 0..3 {
        set(POS + axis, place_sd[axis]);
        set(PLACE + axis, 1.0);
        set(VEL + axis, start.v_sd[axis]);
        set(BA + axis, sheet.accel_bias);
        set(SA + axis, sheet.accel_scale);
        set(BG + axis, start.rate_bias.map_or(sheet.rate_bias, |b| b.1));
        set(SG + axis, sheet.rate_scale);
    }
    set(MOUNT_YAW, sheet.mounting[2]);
    set(MOUNT_PITCH, sheet.mounting[1]);
    set(SLIP_GRADIENT, sheet.tuning.slip_gradient[1]);
    set(SLIP, sheet.tuning.slip_sd);
    set(LEVER, sheet.geometry.imu_sd.x);
    // The place is that of a fix: what this shares with the next is an error of both.
    for axis in 0..3 {
        let shared = sheet.fix_correlated.sqrt() * place_sd[axis];
        p[(POS + axis, PLACE + axis)] = shared;
        p[(PLACE + axis, POS + axis)] = shared;
    }
    // Errors of roll, pitch and heading as platform angles: euler error = J psi.
    let jacobian = nominal.nav.c_nb.euler_jacobian();
    let mut angles = Matrix3::from_diagonal(&Vector3::from(start.angles_sd.map(|sd| sd * sd)));
    let mut with_velocity = Matrix3::zeros();
    let speed2 = start.v_n.xy().norm_squared();
    if start.by_course && speed2 > 0.0 {
        let across = Vector3::new(-start.v_n.y, start.v_n.x, 0.0) / speed2;
        let variances = start.v_sd.component_mul(&start.v_sd);
        let with = across.component_mul(&variances);
        angles[(2, 2)] += with.dot(&across);
        with_velocity.set_row(2, &with.transpose());
    }
    if let Some(inverse) = jacobian.try_inverse() {
        let block = inverse * angles * inverse.transpose();
        p.fixed_view_mut::<3, 3>(ATT, ATT).copy_from(&block);
        let block = inverse * with_velocity;
        p.fixed_view_mut::<3, 3>(ATT, VEL).copy_from(&block);
        p.fixed_view_mut::<3, 3>(VEL, ATT)
            .copy_from(&block.transpose());
    }
    p
}
