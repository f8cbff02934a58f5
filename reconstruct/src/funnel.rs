//! The funnel: from snapshots to reported states, with the hard road limits truncating what is reported.

use nalgebra::{SMatrix, SVector, Vector3};
use schema::num::round_i64;

use crate::epochs::Epochs;
use crate::error_model::{ATT, POS, STATES, VEL};
use crate::filter::{Snapshot, corrected};
use crate::findings::RoadUse;
use crate::mechanize::Nav9;
use crate::motion::Motion;
use crate::road::RoadLimits;
use crate::stats::truncate;
use crate::trajectory::State;

/// Below this speed over ground a sideslip angle means nothing, m/s.
const SIDESLIP_FLOOR: f64 = 1.0;

/// What the states of one run are made from.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Epochs.
    pub epochs: &'a Epochs,
    /// First look at the motion.
    pub motion: &'a Motion,
    /// Gravity, m/s^2.
    pub gravity: f64,
    /// Road limits; `None`: none.
    pub road: Option<&'a RoadLimits>,
    /// UTC of t = 0, ns; `None` where unknown.
    pub utc_zero_ns: Option<i64>,
}

/// Reported states of the snapshots `from..to`, in recording order.
#[must_use]
pub fn states(
    source: &Source<'_>,
    snapshots: &[Snapshot],
    from: usize,
    to: usize,
) -> (Vec<State>, RoadUse) {
    let mut road_use = RoadUse::default();
    let states = (from..to)
        .map(|k| state(source, &snapshots[k], k, &mut road_use))
        .collect();
    (states, road_use)
}

fn state(source: &Source<'_>, snapshot: &Snapshot, k: usize, road_use: &mut RoadUse) -> State {
    let epoch = &source.epochs.list[k];
    let mut nav = snapshot.nav;
    let mut p = snapshot.p;
    let hold_off = source.motion.impacts.first().zip(source.road);
    let held = hold_off.is_some_and(|(pulse, road)| epoch.t_s > pulse.onset_s - road.hold_off_s);
    if let Some(road) = source.road.filter(|_| !held) {
        limit(road, &mut nav, &mut p, road_use);
    }
    let (roll, pitch, heading) = nav.c_nb.euler();
    let v = &nav.v_n.v;
    let ahead: Vector3<f64> = nav.c_nb.m.column(0).into_owned();
    let side: Vector3<f64> = nav.c_nb.m.column(1).into_owned();
    let ground_speed = v.xy().norm();
    let h = speed_row(&nav);
    let jacobian = nav.c_nb.euler_jacobian();
    let heading_row = jacobian.row(2);
    let att = p.fixed_view::<3, 3>(ATT, ATT);
    let free = source.motion.accel[k];
    let measured = &epoch.measured;
    let imu = &source.epochs.header.imu;
    let rate_noise = imu.rate_density.powi(2) + epoch.rate_psd;
    State {
        index: epoch.index,
        t_s: epoch.t_s,
        utc_ns: source
            .utc_zero_ns
            .map(|ns| ns.saturating_add(round_i64(epoch.t_s * 1e9))),
        position: nav.r_n.v.into(),
        velocity: nav.v_n.v.into(),
        roll,
        pitch,
        heading: heading.rem_euclid(std::f64::consts::TAU),
        speed: ahead.dot(v),
        ground_speed,
        sideslip: (ground_speed >= SIDESLIP_FLOOR).then(|| {
            // Seen in the horizontal plane, so that a rolled car has one too.
            let (s, c) = heading.sin_cos();
            (v.y * c - v.x * s).atan2(v.x * c + v.y * s)
        }),
        accel: [0, 1, 2].map(|i| (measured[i]).then_some(free[i])),
        yaw_rate: measured[5].then_some(source.motion.rate[k].z),
        sd_north: root(p[(POS, POS)]),
        sd_east: root(p[(POS + 1, POS + 1)]),
        cov_north_east: p[(POS, POS + 1)],
        sd_down: root(p[(POS + 2, POS + 2)]),
        sd_speed: root((h.transpose() * p * h)[0]),
        sd_heading: root((heading_row * att * heading_row.transpose())[0]),
        sd_accel: accel_spread(source, snapshot, k, &ahead, &side),
        sd_yaw_rate: root(
            rate_noise / epoch.dt + (0.01 * imu.rate_bias).powi(2) + imu.rate_vibration.powi(2),
        ),
        wheels_used: snapshot.wheels_used,
        on_earth: None,
        bridged: *measured != [true; 6] || epoch.clipped.iter().any(|c| *c != 0.0),
    }
}

/// Sensitivity of the forward speed along body x to the nine errors.
#[must_use]
pub fn speed_row(nav: &Nav9) -> SVector<f64, STATES> {
    let a: Vector3<f64> = nav.c_nb.m.column(0).into_owned();
    let mut h = SVector::<f64, STATES>::zeros();
    h.fixed_rows_mut::<3>(VEL).copy_from(&a);
    h.fixed_rows_mut::<3>(ATT).copy_from(&-a.cross(&nav.v_n.v));
    h
}

/// A model without accelerometer states still has the data sheet's spread.
fn accel_spread(
    source: &Source<'_>,
    snapshot: &Snapshot,
    k: usize,
    ahead: &Vector3<f64>,
    side: &Vector3<f64>,
) -> [f64; 2] {
    if snapshot.sd_accel.iter().all(|x| x.is_finite()) {
        return snapshot.sd_accel;
    }
    let epoch = &source.epochs.list[k];
    let imu = &source.epochs.header.imu;
    let att = snapshot.p.fixed_view::<3, 3>(ATT, ATT);
    [ahead, side].map(|a| {
        let h = Vector3::new(0.0, 0.0, source.gravity).cross(a);
        let noise = imu.accel_density.powi(2) + epoch.accel_psd;
        root(
            (h.transpose() * att * h)[0]
                + imu.accel_bias.powi(2)
                + imu.accel_vibration.powi(2)
                + noise / epoch.dt,
        )
    })
}

/// Truncates the reported roll, pitch and vertical speed to the road's limits, and with them, by their
/// covariances, the other states.
fn limit(
    road: &RoadLimits,
    nav: &mut Nav9,
    p: &mut SMatrix<f64, STATES, STATES>,
    road_use: &mut RoadUse,
) {
    road_use.samples += 1;
    // The springs lean on top of the road: a degree and a half at the hardest.
    let spring = 1.5_f64.to_radians();
    for index in 0..2 {
        let (roll, pitch, _) = nav.c_nb.euler();
        let mut h = SVector::<f64, STATES>::zeros();
        h.fixed_rows_mut::<3>(ATT)
            .copy_from(&nav.c_nb.euler_jacobian().row(index).transpose());
        let (value, top) = if index == 0 {
            (roll, road.roll_deg)
        } else {
            (pitch, road.pitch_deg)
        };
        let top = top.to_radians() + spring;
        if truncated(nav, p, &h, value, top) {
            *(if index == 0 {
                &mut road_use.roll
            } else {
                &mut road_use.pitch
            }) += 1;
        }
    }
    let top = nav.v_n.v.xy().norm() * road.pitch_deg.to_radians().sin() + 0.1;
    let mut h = SVector::<f64, STATES>::zeros();
    h[VEL + 2] = 1.0;
    if truncated(nav, p, &h, nav.v_n.v.z, top) {
        road_use.vertical += 1;
    }
}

fn truncated(
    nav: &mut Nav9,
    p: &mut SMatrix<f64, STATES, STATES>,
    h: &SVector<f64, STATES>,
    value: f64,
    top: f64,
) -> bool {
    let s = *p * h;
    let variance = h.dot(&s);
    let cut = truncate(value, variance, -top, top);
    if !cut.active || variance <= 0.0 {
        return false;
    }
    let gain = s / variance;
    *nav = corrected(nav, &(gain * (value - cut.mean)));
    *p -= gain * gain.transpose() * (variance - cut.variance);
    true
}

/// Root of a variance; rounding below zero is zero.
fn root(variance: f64) -> f64 {
    variance.max(0.0).sqrt()
}
