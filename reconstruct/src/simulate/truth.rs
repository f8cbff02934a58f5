//! The truth: motion at 100 Hz and the facts of the events.

use std::f64::consts::PI;
use std::fmt::Write;

use nalgebra::{Rotation3, Vector3};
use schema::num;
use serde::Serialize;

use super::motion::{Motion, STEP, STEPS_PER_BIN, node_time};
use super::rigid::{Rigid, rotation};
use super::scenario::Scenario;

/// True state at the end of a sample's bin.
///
/// The place is the IMU's. Frame: north-east-down with its origin at the IMU's last place and north along
/// the car's forward axis at rest, so the last row is the origin with heading 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthRow {
    /// Seconds from the log's first frame: a multiple of 10 ms.
    pub t_s: f64,
    /// North, east, down, m.
    pub position: [f64; 3],
    /// North, east, down, m/s.
    pub velocity: [f64; 3],
    /// Roll of the body, rad, -pi to pi.
    pub roll: f64,
    /// Pitch of the body, rad.
    pub pitch: f64,
    /// Heading of the body, rad, 0 to 2 pi.
    pub heading: f64,
    /// Velocity along body x, signed, m/s.
    pub speed: f64,
    /// Rate about body z, rad/s.
    pub yaw_rate: f64,
    /// Acceleration free of gravity at this instant, body axes, m/s^2.
    pub accel: [f64; 3],
}

/// Change of velocity over a pulse, in the body axes at its onset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrueDeltaV {
    /// Forward, m/s.
    pub longitudinal_mps: f64,
    /// To the right, m/s.
    pub lateral_mps: f64,
    /// Horizontal resultant, m/s.
    pub resultant_mps: f64,
    /// `atan2(-lateral, -longitudinal)`, degrees: 0 frontal, positive clockwise.
    pub pdof_deg: f64,
}

/// One impact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrueImpact {
    /// Onset of the pulse, s of the log.
    pub t_s: f64,
    /// Length of the pulse, s.
    pub duration_s: f64,
    /// Velocity of the IMU along body x at the onset, m/s.
    pub speed_mps: f64,
    /// Heading at the onset, degrees, 0 to 360.
    pub heading_deg: f64,
    /// Yaw rate at the end of the pulse less that at the onset, degrees/s.
    pub spin_degps: f64,
    /// At the IMU.
    pub imu: TrueDeltaV,
    /// At the centre of gravity.
    pub cg: TrueDeltaV,
}

/// The last braking.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrueBraking {
    /// Onset, s of the log.
    pub onset_t_s: f64,
    /// Mean deceleration to the impact or to rest, m/s^2, positive.
    pub mean_mps2: f64,
}

/// What happened, as numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Facts {
    /// Class of the scenario.
    pub class: String,
    /// Grade of the sensors.
    pub grade: String,
    /// Seed.
    pub seed: u64,
    /// UTC of the log's first frame, s since 1970.
    pub start_unix_s: i64,
    /// Length of the log, s.
    pub duration_s: f64,
    /// Impacts in order of time.
    pub impacts: Vec<TrueImpact>,
    /// The last braking; `None`: none.
    pub braking: Option<TrueBraking>,
    /// Begin of the last rest, s of the log.
    pub rest_t_s: f64,
    /// Roll at rest, degrees.
    pub rest_roll_deg: f64,
    /// Pitch at rest, degrees.
    pub rest_pitch_deg: f64,
    /// Path length of the IMU over the whole log, m.
    pub distance_m: f64,
    /// Gravity, m/s^2.
    pub gravity_mps2: f64,
    /// A good moment for a manual trigger: the first impact, else the begin of the rest (40 s if the car never
    /// moved), s of the log.
    pub trigger_at_s: f64,
}

/// The whole truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// 100 Hz; row `k` is the state at `k * 10 ms` of the log, the end of sample `k`'s bin.
    pub rows: Vec<TruthRow>,
    /// Events.
    pub facts: Facts,
}

fn wrap(angle: f64) -> f64 {
    let turned = (angle + PI).rem_euclid(2.0 * PI) - PI;
    if turned <= -PI {
        turned + 2.0 * PI
    } else {
        turned
    }
}

fn full_circle(angle: f64) -> f64 {
    let turned = angle.rem_euclid(2.0 * PI);
    if turned >= 2.0 * PI { 0.0 } else { turned }
}

/// Truth of a motion; `bins` rows.
pub(super) fn truth(
    scenario: &Scenario,
    motion: &Motion,
    imu: &Rigid,
    cg: Vector3<f64>,
    bins: usize,
) -> Truth {
    let last = bins * STEPS_PER_BIN;
    // Roll and pitch beyond a quarter turn (roof) still leave yaw the direction of the forward axis.
    let rest_yaw = motion.nodes.get(last).map_or(0.0, |node| node.angles[2]);
    let level = Rotation3::from_axis_angle(&Vector3::z_axis(), -rest_yaw);
    let accel = |k: usize| {
        let (low, high) = (k.saturating_sub(1), (k + 1).min(imu.velocity.len() - 1));
        (imu.velocity[high] - imu.velocity[low]) / (num::real(high - low) * STEP)
    };
    let mut place = Vector3::zeros();
    let mut distance = 0.0;
    let mut rows = Vec::with_capacity(bins);
    let mut before = accel(0);
    for k in 1..=last {
        let after = accel(k);
        let (v0, v1) = (imu.velocity[k - 1], imu.velocity[k]);
        let path = (v0 + v1) * (STEP / 2.0) + (before - after) * (STEP * STEP / 12.0);
        place += path;
        if k > STEPS_PER_BIN {
            distance += path.xy().norm();
        }
        before = after;
        if k % STEPS_PER_BIN != 0 {
            continue;
        }
        let node = &motion.nodes[k];
        let c_nb = rotation(node.angles);
        rows.push(TruthRow {
            t_s: num::real(k / STEPS_PER_BIN - 1) / 100.0,
            position: place.into(),
            velocity: (level * v1).into(),
            roll: wrap(node.angles[0]),
            pitch: node.angles[1],
            heading: full_circle(node.angles[2] - rest_yaw),
            speed: c_nb.column(0).dot(&v1),
            yaw_rate: imu.rate[k].z,
            accel: (c_nb.transpose() * after).into(),
        });
    }
    for row in &mut rows {
        row.position = (level * (Vector3::from(row.position) - place)).into();
    }
    let facts = facts(scenario, motion, imu, cg, &rows, rest_yaw, distance);
    Truth { rows, facts }
}

fn facts(
    scenario: &Scenario,
    motion: &Motion,
    imu: &Rigid,
    cg: Vector3<f64>,
    rows: &[TruthRow],
    rest_yaw: f64,
    distance: f64,
) -> Facts {
    let plan = &scenario.manoeuvre;
    let state = |t: f64| State::at(motion, imu, cg, t);
    let impacts: Vec<TrueImpact> = plan
        .impacts
        .iter()
        .map(|impact| {
            let (a, b) = (state(impact.t), state(impact.t + impact.pulse.duration));
            let c_bn = rotation(a.angles).transpose();
            TrueImpact {
                t_s: impact.t,
                duration_s: impact.pulse.duration,
                speed_mps: (c_bn * a.imu).x,
                heading_deg: full_circle(a.angles[2] - rest_yaw).to_degrees(),
                spin_degps: (b.yaw_rate - a.yaw_rate).to_degrees(),
                imu: delta_v(c_bn * (b.imu - a.imu)),
                cg: delta_v(c_bn * (b.cg - a.cg)),
            }
        })
        .collect();
    let braking = plan.braking.as_ref().map(|braking| {
        let end = plan
            .impacts
            .first()
            .map_or(motion.rest_t, |impact| impact.t);
        let forward = |t: f64| {
            let state = state(t);
            (rotation(state.angles).transpose() * state.imu).x
        };
        let time = (end - braking.t).max(STEP);
        TrueBraking {
            onset_t_s: braking.t,
            mean_mps2: (forward(braking.t) - forward(end)) / time,
        }
    });
    let last = rows.last();
    let rest_or_middle = if plan.still.is_some() {
        40.0
    } else {
        motion.rest_t
    };
    Facts {
        class: scenario.class.name().to_owned(),
        grade: scenario.grade.name().to_owned(),
        seed: scenario.seed,
        start_unix_s: scenario.start_unix_s,
        duration_s: last.map_or(0.0, |row| row.t_s),
        trigger_at_s: impacts.first().map_or(rest_or_middle, |impact| impact.t_s),
        impacts,
        braking,
        rest_t_s: motion.rest_t,
        rest_roll_deg: last.map_or(0.0, |row| row.roll.to_degrees()),
        rest_pitch_deg: last.map_or(0.0, |row| row.pitch.to_degrees()),
        distance_m: distance,
        gravity_mps2: scenario.gravity,
    }
}

/// The motion at any time, linear between grid points.
struct State {
    angles: [f64; 3],
    imu: Vector3<f64>,
    cg: Vector3<f64>,
    yaw_rate: f64,
}

impl State {
    fn at(motion: &Motion, imu: &Rigid, lever: Vector3<f64>, t: f64) -> Self {
        let x = ((t - node_time(0)) / STEP).max(0.0);
        let k = num::round_usize(x.floor()).min(motion.nodes.len() - 2);
        let share = (x - num::real(k)).clamp(0.0, 1.0);
        let (a, b) = (&motion.nodes[k], &motion.nodes[k + 1]);
        let angles = [0, 1, 2].map(|i| a.angles[i] + share * (b.angles[i] - a.angles[i]));
        let rate = imu.rate[k].lerp(&imu.rate[k + 1], share);
        let ground = a.velocity.lerp(&b.velocity, share);
        Self {
            angles,
            imu: imu.velocity[k].lerp(&imu.velocity[k + 1], share),
            cg: ground + rotation(angles) * rate.cross(&lever),
            yaw_rate: rate.z,
        }
    }
}

fn delta_v(dv: Vector3<f64>) -> TrueDeltaV {
    TrueDeltaV {
        longitudinal_mps: dv.x,
        lateral_mps: dv.y,
        resultant_mps: dv.xy().norm(),
        pdof_deg: (-dv.y).atan2(-dv.x).to_degrees(),
    }
}

impl Truth {
    /// The truth as CSV (RFC 4180), one row each 10 ms.
    ///
    /// Columns as `trajectory.csv` has them, with `unix_s` and, last, `t_from_impact_s`: seconds from the
    /// onset of the first impact, empty where there is none.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = String::with_capacity(self.rows.len() * 190);
        text.push_str(
            "t_s,unix_s,north_m,east_m,down_m,v_north_mps,v_east_mps,v_down_mps,speed_mps,roll_deg,\
             pitch_deg,heading_deg,yaw_rate_degps,accel_forward_mps2,accel_right_mps2,t_from_impact_s\r\n",
        );
        for row in &self.rows {
            let unix = num::real_i64(self.facts.start_unix_s) + row.t_s;
            // Writing to a String cannot fail.
            let _ = write!(text, "{:.2},{unix:.2}", row.t_s);
            let [n, e, d] = row.position;
            let [vn, ve, vd] = row.velocity;
            let (roll, pitch) = (row.roll.to_degrees(), row.pitch.to_degrees());
            let (heading, rate) = (row.heading.to_degrees(), row.yaw_rate.to_degrees());
            let [forward, right, _] = row.accel;
            for value in [
                n, e, d, vn, ve, vd, row.speed, roll, pitch, heading, rate, forward, right,
            ] {
                // Adding zero turns -0 into 0.
                let _ = write!(text, ",{:.5}", (value * 1e5).round() / 1e5 + 0.0);
            }
            text.push(',');
            if let Some(impact) = self.facts.impacts.first() {
                let _ = write!(text, "{:.5}", row.t_s - impact.t_s);
            }
            text.push_str("\r\n");
        }
        text
    }
}
