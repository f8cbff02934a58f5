//! What a satellite receiver in a simulated car says: fixes with the errors that real ones have, and the true pose of rest.

use nalgebra::{Rotation3, Vector2, Vector3};
use schema::gnss::{Fix, FixQuality, Gnss, GnssSheet, GnssSource};
use schema::num::{real, round_i64};

use super::Simulated;
use super::random::{Random, Stream};
use crate::export::geodesy::TangentPlane;
use crate::findings::RestPose;

/// A receiver. One sigma where it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Receiver {
    /// Fixes a second.
    pub rate_hz: f64,
    /// Spread of north and east each, m: what stays for a while, and what is new in each fix.
    pub place_sd: [f64; 2],
    /// How long the first stays, s.
    pub slow_s: f64,
    /// Velocity north and east each, m/s.
    pub speed_sd: f64,
    /// From the instant of a fix to its receipt, s: as the sheet has it, its own error, jitter from fix to fix.
    pub latency_s: [f64; 3],
    /// Antenna from the rear axle's centre on the ground, m, body axes.
    pub antenna: [f64; 3],
    /// Error of that as said, m per axis.
    pub antenna_sd: f64,
    /// Share of fixes that lie tens of metres off.
    pub wild: f64,
    /// The receiver loses the sky from this time before the first impact on for so long, s.
    pub tunnel_s: Option<[f64; 2]>,
    /// The antenna is lost in the first impact.
    pub torn: bool,
    /// The receiver states its spreads.
    pub states_spread: bool,
    /// The receiver states UTC, and the recorder's clock is off by so much, s.
    pub clock_off_s: Option<f64>,
}

impl Default for Receiver {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            place_sd: [1.6, 0.8],
            slow_s: 60.0,
            speed_sd: 0.1,
            latency_s: [0.15, 0.03, 0.02],
            antenna: [1.6, 0.0, -1.4],
            antenna_sd: 0.1,
            wild: 0.0,
            tunnel_s: None,
            torn: false,
            states_spread: true,
            clock_off_s: None,
        }
    }
}

/// A receiver filter follows a sudden stop with this lag, s.
const FOLLOWS_S: f64 = 0.8;

/// What the record gets, and where the path's origin truly lies, its heading included.
#[derive(Clone, Debug)]
pub struct Received {
    /// Part of the record; receive times on a monotonic grid on which the log's zero is `zero_ns`.
    pub gnss: Gnss,
    /// True pose; sds are zero.
    pub pose: RestPose,
    /// True latency, s.
    pub latency_s: f64,
}

/// What `receiver` says over a simulated drive. `zero_ns` is the monotonic time of the log's zero, `utc_offset_ns` UTC less
/// monotonic.
#[must_use]
pub fn receive(
    simulated: &Simulated,
    receiver: &Receiver,
    seed: u64,
    zero_ns: i64,
    utc_offset_ns: i64,
) -> Received {
    let mut random = Random::new(
        simulated.scenario.class,
        seed ^ 0x5a7e_1117,
        Stream::Scenario,
    );
    let pose = RestPose {
        latitude_deg: random.range(-62.0, 68.0),
        longitude_deg: random.range(-170.0, 170.0),
        heading_deg: random.range(0.0, 360.0),
        sd_m: 0.0,
        sd_deg: 0.0,
    };
    let plane = TangentPlane::at(&pose);
    let sheet = sheet(receiver);
    let imu = Vector3::from(simulated.scenario.car.imu);
    let lever = Vector3::from_fn(|i, _| {
        receiver.antenna[i] + receiver.antenna_sd * random.normal() - imu[i]
    });
    let latency_s = receiver.latency_s[0] + receiver.latency_s[1] * random.normal();
    let impact = simulated.truth.facts.impacts.first().map(|i| i.t_s);
    let rows = &simulated.truth.rows;
    let step = 1.0 / receiver.rate_hz;
    let decay = (-step / receiver.slow_s).exp();
    let mut slow = Vector2::new(random.normal(), random.normal()) * receiver.place_sd[0];
    let mut t = random.range(0.0, step);
    let end = rows.last().map_or(0.0, |r| r.t_s);
    let mut fixes = Vec::new();
    while t < end {
        let new = Vector2::new(random.normal(), random.normal());
        slow = slow * decay + new * receiver.place_sd[0] * (1.0 - decay * decay).sqrt();
        let white = Vector2::new(random.normal(), random.normal()) * receiver.place_sd[1];
        let wild = random.chance(receiver.wild);
        let stray = Vector2::new(random.normal(), random.normal()) * 40.0;
        let speed_error = Vector2::new(random.normal(), random.normal()) * receiver.speed_sd;
        let jitter = receiver.latency_s[2] * random.normal().abs();
        let monotonic_ns = zero_ns + round_i64((t + latency_s + jitter) * 1e9);
        let after = impact.map_or(-1.0, |at| t - at);
        let dark = receiver.torn && after > 0.0
            || receiver
                .tunnel_s
                .is_some_and(|[before, long]| (0.0..long).contains(&(after + before)));
        let mut fix = Fix::new(monotonic_ns, FixQuality::None);
        fix.utc_ns = receiver
            .clock_off_s
            .map(|off| zero_ns + round_i64((t + off) * 1e9) + utc_offset_ns);
        if !dark {
            // A receiver's own filter drives on for a moment when the car is stopped within a tenth of a second.
            let from = if (0.0..3.0).contains(&after) {
                impact.unwrap_or(t) - 0.05
            } else {
                t
            };
            let (place, velocity) = antenna(simulated, &lever, t);
            let (_, before) = antenna(simulated, &lever, from);
            let lag = (-after.max(0.0) / FOLLOWS_S).exp();
            let share = if from < t { lag } else { 0.0 };
            let velocity = velocity + (before - velocity) * share;
            let place = place + slow + white + if wild { stray } else { Vector2::zeros() };
            say(
                &mut fix,
                receiver,
                &pose,
                &plane,
                &place,
                &(velocity + speed_error),
            );
        }
        fixes.push(fix);
        t += step;
    }
    fixes.sort_by_key(|f| f.monotonic_ns);
    Received {
        gnss: Gnss {
            sheet,
            fixes,
            sentences: Vec::new(),
        },
        pose,
        latency_s,
    }
}

fn sheet(receiver: &Receiver) -> GnssSheet {
    GnssSheet {
        source: GnssSource::Can,
        receiver: "simulated".to_owned(),
        antenna_position_m: Some(receiver.antenna),
        antenna_position_sd_m: [receiver.antenna_sd; 3],
        latency_s: receiver.latency_s[0],
        latency_sd_s: receiver.latency_s[1].max(0.001),
        horizontal_sd_m: receiver.place_sd[0].hypot(receiver.place_sd[1]),
        height_sd_m: 5.0,
        speed_sd_mps: receiver.speed_sd,
    }
}

/// True place of the antenna in the path's axes, m, and its velocity, m/s.
fn antenna(simulated: &Simulated, lever: &Vector3<f64>, t: f64) -> (Vector2<f64>, Vector2<f64>) {
    let rows = &simulated.truth.rows;
    let at = |k: usize| {
        let row = &rows[k.min(rows.len() - 1)];
        let turn = Rotation3::from_euler_angles(row.roll, row.pitch, row.heading);
        (Vector3::from(row.position) + turn * lever).xy()
    };
    let after = rows.partition_point(|r| r.t_s < t).max(1);
    let (a, b) = (at(after - 1), at(after));
    let share = (t - rows[after - 1].t_s) * 100.0;
    let place = a + (b - a) * share.clamp(0.0, 1.0);
    // A mean over a tenth of a second, as receivers have it.
    let (from, to) = (after.saturating_sub(5), (after + 5).min(rows.len() - 1));
    let speed = (at(to) - at(from)) / (0.01 * real((to - from).max(1)));
    (place, speed)
}

fn say(
    fix: &mut Fix,
    receiver: &Receiver,
    pose: &RestPose,
    plane: &TangentPlane,
    place: &Vector2<f64>,
    velocity: &Vector2<f64>,
) {
    let (s, c) = pose.heading_deg.to_radians().sin_cos();
    let earth = |v: &Vector2<f64>| Vector2::new(c * v.x - s * v.y, s * v.x + c * v.y);
    let there = earth(place);
    let [longitude, latitude] = plane.lon_lat(there.x, there.y);
    let v = earth(velocity);
    fix.quality = FixQuality::Autonomous;
    fix.satellites = Some(9);
    fix.position = Some([latitude.to_radians(), longitude.to_radians()]);
    fix.speed_mps = Some(v.norm());
    fix.course = Some(v.y.atan2(v.x).rem_euclid(std::f64::consts::TAU));
    fix.hdop = Some(0.9);
    if receiver.states_spread {
        let variance = receiver.place_sd[0].powi(2) + receiver.place_sd[1].powi(2);
        fix.horizontal_m2 = Some([variance, variance, 0.0]);
        fix.speed_sd_mps = Some(receiver.speed_sd);
    }
}
