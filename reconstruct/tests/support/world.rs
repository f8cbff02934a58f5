//! Road maps about a simulated crash: the road it happened on, with lane and drawing errors, and other roads.

use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reconstruct::export::geodesy::TangentPlane;
use reconstruct::findings::RestPose;
use reconstruct::map::roads::RoadLine;
use reconstruct::simulate::Simulated;

pub(crate) type Line = Vec<Vector2<f64>>;

/// Drawn errors of a world.
pub(crate) struct Draw(ChaCha8Rng);

impl Draw {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed ^ 0x006d_6170))
    }

    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let (a, b) = (self.uniform(1e-12, 1.0), self.uniform(0.0, 1.0));
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

/// The true path before the first impact, north and east of rest, one point a metre and a half or so.
pub(crate) fn driven(simulated: &Simulated) -> Line {
    let facts = &simulated.truth.facts;
    let until = facts.impacts.first().map_or(f64::INFINITY, |i| i.t_s);
    let mut line: Line = Vec::new();
    for row in simulated.truth.rows.iter().take_while(|r| r.t_s <= until) {
        let here = Vector2::new(row.position[0], row.position[1]);
        if line.last().is_none_or(|l| (here - l).norm() > 1.5) {
            line.push(here);
        }
    }
    line
}

/// One point each `step` metres.
pub(crate) fn every(line: &Line, step: f64) -> Line {
    let mut out: Line = Vec::new();
    for p in line {
        if out.last().is_none_or(|l| (p - l).norm() >= step) {
            out.push(*p);
        }
    }
    out
}

/// A line with straight ends of `metres` more.
pub(crate) fn extended(line: &Line, metres: f64) -> Line {
    let n = line.len();
    let mut out = vec![line[0] + (line[0] - line[4]).normalize() * metres];
    out.extend(line.iter().copied());
    out.push(line[n - 1] + (line[n - 1] - line[n - 5]).normalize() * metres);
    out
}

/// The centre line of a road driven along `path`: `offset` to its left, drawn with an error of one sigma
/// `sd` that fades over 40 m, a vertex each 12 m.
pub(crate) fn centre_line(path: &Line, offset: f64, sd: f64, draw: &mut Draw) -> Line {
    let path = extended(&every(path, 12.0), 150.0);
    let mut error = sd * draw.normal();
    (0..path.len())
        .map(|i| {
            let (a, b) = (path[i.saturating_sub(1)], path[(i + 1).min(path.len() - 1)]);
            let ahead = (b - a).normalize();
            let left = Vector2::new(ahead.y, -ahead.x);
            let keep = (-12.0_f64 / 40.0).exp();
            error = keep * error + sd * (1.0 - keep * keep).sqrt() * draw.normal();
            path[i] + left * (offset + error)
        })
        .collect()
}

/// Turned by `angle` (clockwise from north) about the origin, then moved.
pub(crate) fn moved(line: &Line, angle: f64, by: Vector2<f64>) -> Line {
    let (s, c) = angle.sin_cos();
    line.iter()
        .map(|p| Vector2::new(c * p.x - s * p.y, s * p.x + c * p.y) + by)
        .collect()
}

/// A road of its own making: smooth bends, from `from` in direction `heading`.
pub(crate) fn wandering(from: Vector2<f64>, heading: f64, metres: f64, draw: &mut Draw) -> Line {
    let (mut at, mut heading, mut bend) = (from, heading, 0.0_f64);
    let mut line = vec![at];
    let mut left = metres;
    while left > 0.0 {
        bend = 0.93 * bend + 0.0015 * draw.normal();
        heading += bend * 12.0;
        at += Vector2::new(heading.cos(), heading.sin()) * 12.0;
        line.push(at);
        left -= 12.0;
    }
    line
}

pub(crate) fn pose(latitude_deg: f64, longitude_deg: f64) -> RestPose {
    RestPose {
        latitude_deg,
        longitude_deg,
        heading_deg: 0.0,
        sd_m: 0.0,
        sd_deg: 0.0,
    }
}

/// Lines in metres about a place as a map holds them.
pub(crate) fn on_earth(lines: &[Line], plane: &TangentPlane) -> Vec<RoadLine> {
    lines
        .iter()
        .map(|line| RoadLine {
            line: line
                .iter()
                .map(|p| {
                    let [longitude, latitude] = plane.lon_lat(p.x, p.y);
                    [latitude, longitude]
                })
                .collect(),
            ..RoadLine::default()
        })
        .collect()
}
