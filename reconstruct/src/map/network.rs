//! Centre lines in metres about the rough place of rest, and which of them a point of the path lies on.

use std::collections::BTreeMap;

use nalgebra::Vector2;
use schema::num::floor_i64;

use crate::export::geodesy::TangentPlane;
use crate::map::roads::{OneWay, RoadLine};

/// Side of a cell of the index, m; longer straights are cut to it.
const CELL_M: f64 = 50.0;
/// More pieces than this near one place are no road map.
pub const MAX_PIECES: usize = 2_000_000;
/// Width of a lane where the map says none, m.
const LANE_M: f64 = 3.5;
/// One sigma of a car's place in its half of the road, m: lanes differ, and some drive in the middle.
const LANE_SD_M: f64 = 1.5;
/// Angle between car and road for one sigma, rad.
const ANGLE_SD: f64 = 0.21;
/// A road that crosses the path at more than this is not the one driven on (cosine of 40 degrees).
const CROSSING: f64 = 0.766;
/// Cost of driving against a one-way street, in squared sigmas, where another road is as near.
const WRONG_WAY: f64 = 6.0;

/// Side of the road that traffic keeps to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Traffic {
    /// Right, as in Norway.
    #[default]
    Right,
    /// Left.
    Left,
}

/// A straight piece of a centre line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Its ends, north and east, m.
    pub ends: [Vector2<f64>; 2],
    /// Index of its road.
    pub road: usize,
    along: Vector2<f64>,
    length: f64,
}

/// What matters of a road beside its line.
#[derive(Clone, Debug, PartialEq)]
pub struct Road {
    /// Name; empty if none.
    pub name: String,
    oneway: OneWay,
    offset_m: f64,
    offset_sd_m: f64,
}

/// The roads near a place.
#[derive(Clone, Debug)]
pub struct Network {
    /// Roads, by index.
    pub roads: Vec<Road>,
    /// Straight pieces.
    pub pieces: Vec<Piece>,
    cells: BTreeMap<(i64, i64), Vec<usize>>,
    /// The tangent plane in which they are laid out.
    pub plane: TangentPlane,
}

/// The road under a point of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Index of the road.
    pub road: usize,
    /// Unit vector to the right of the direction of travel on it.
    pub right: Vector2<f64>,
    /// Distance to the right of the centre line, m.
    pub lateral: f64,
    /// Where a car would be, to the right of the centre line, m.
    pub offset: f64,
    /// One sigma of that, m.
    pub offset_sd: f64,
    /// The car drives against a one-way street.
    pub against: bool,
}

impl Network {
    /// The lines within `reach_m` of the origin of `plane`.
    ///
    /// # Errors
    /// What is wrong: no road there, or too many.
    pub fn near(
        lines: &[RoadLine],
        plane: TangentPlane,
        reach_m: f64,
        traffic: Traffic,
    ) -> Result<Self, String> {
        let side = match traffic {
            Traffic::Right => 1.0,
            Traffic::Left => -1.0,
        };
        let mut network = Self {
            roads: Vec::new(),
            pieces: Vec::new(),
            cells: BTreeMap::new(),
            plane,
        };
        let mut nearest = f64::INFINITY;
        for line in lines {
            let points: Vec<Vector2<f64>> = line
                .line
                .iter()
                .map(|[latitude, longitude]| plane.north_east(*latitude, *longitude).into())
                .collect();
            let before = network.pieces.len();
            for ends in points.windows(2) {
                let gap = gap(&ends[0], &ends[1]);
                nearest = nearest.min(gap);
                if gap <= reach_m {
                    network.add([ends[0], ends[1]], reach_m)?;
                }
            }
            if network.pieces.len() > before {
                network.roads.push(road(line, side));
            }
        }
        if network.pieces.is_empty() {
            return Err(format!(
                "no road lies within {reach_m:.0} m of the rest point; the nearest is {:.1} km away",
                nearest / 1000.0
            ));
        }
        Ok(network)
    }

    fn add(&mut self, [a, b]: [Vector2<f64>; 2], reach_m: f64) -> Result<(), String> {
        let whole = b - a;
        let length = whole.norm();
        if !(length > 1e-3 && length.is_finite()) {
            return Ok(());
        }
        let along = whole / length;
        let road = self.roads.len();
        // What of a long straight lies near, in cuts of a cell.
        let foot = -a.dot(&along);
        let from = (foot - 2.0 * reach_m).clamp(0.0, length);
        let to = (foot + 2.0 * reach_m).clamp(0.0, length);
        let mut at = from;
        while at < to {
            let end = (at + CELL_M).min(to);
            if self.pieces.len() >= MAX_PIECES {
                return Err(format!(
                    "more than {MAX_PIECES} pieces of road within {reach_m:.0} m of the rest point"
                ));
            }
            let piece = Piece {
                ends: [a + along * at, a + along * end],
                road,
                along,
                length: end - at,
            };
            for cell in cells(&piece.ends) {
                self.cells.entry(cell).or_default().push(self.pieces.len());
            }
            self.pieces.push(piece);
            at = end;
        }
        Ok(())
    }

    /// The road that a car at `place`, driving in direction `ahead`, most likely is on, if one lies within
    /// `gate_m` (at most a cell's side).
    #[must_use]
    pub fn under(&self, place: Vector2<f64>, ahead: Vector2<f64>, gate_m: f64) -> Option<Match> {
        let gate = gate_m.min(CELL_M);
        let margin = Vector2::new(gate, gate);
        let mut best: Option<(f64, Match)> = None;
        for cell in cells(&[place - margin, place + margin]) {
            for index in self.cells.get(&cell).into_iter().flatten() {
                let piece = &self.pieces[*index];
                if let Some((cost, found)) = self.judge(piece, place, ahead, gate)
                    && best.as_ref().is_none_or(|(least, _)| cost < *least)
                {
                    best = Some((cost, found));
                }
            }
        }
        best.map(|(_, found)| found)
    }

    fn judge(
        &self,
        piece: &Piece,
        place: Vector2<f64>,
        ahead: Vector2<f64>,
        gate: f64,
    ) -> Option<(f64, Match)> {
        let cosine = piece.along.dot(&ahead);
        if cosine.abs() < CROSSING {
            return None;
        }
        let way = if cosine > 0.0 {
            piece.along
        } else {
            -piece.along
        };
        let right = Vector2::new(-way.y, way.x);
        let from = place - piece.ends[0];
        let along = piece.along.dot(&from);
        let beyond = (-along).max(along - piece.length).max(0.0);
        let lateral = right.dot(&from);
        if lateral.abs() > gate || beyond > gate {
            return None;
        }
        let road = &self.roads[piece.road];
        let against = match road.oneway {
            OneWay::No => false,
            OneWay::Along => cosine < 0.0,
            OneWay::Against => cosine > 0.0,
        };
        let angle = cosine.abs().min(1.0).acos() / ANGLE_SD;
        let cost = ((lateral - road.offset_m) / road.offset_sd_m).powi(2)
            + angle * angle
            + (beyond / 2.0).powi(2)
            + if against { WRONG_WAY } else { 0.0 };
        // Beyond the end of a road there is none; between two pieces in a bend there is.
        (beyond <= 5.0).then_some((
            cost,
            Match {
                road: piece.road,
                right,
                lateral,
                offset: road.offset_m,
                offset_sd: road.offset_sd_m,
                against,
            },
        ))
    }
}

/// Distance of a segment from the origin.
fn gap(a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    let d = b - a;
    let t = if d.norm_squared() > 0.0 {
        (-a.dot(&d) / d.norm_squared()).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (a + d * t).norm()
}

/// Cells of the box about two points.
fn cells(ends: &[Vector2<f64>; 2]) -> impl Iterator<Item = (i64, i64)> + use<> {
    let range = |x: f64, y: f64| {
        let low = floor_i64(x.min(y) / CELL_M);
        let high = floor_i64(x.max(y) / CELL_M);
        low..=high
    };
    let rows = range(ends[0].x, ends[1].x);
    let columns = range(ends[0].y, ends[1].y);
    rows.flat_map(move |r| columns.clone().map(move |c| (r, c)))
}

fn road(line: &RoadLine, side: f64) -> Road {
    let both = line.oneway == OneWay::No;
    let lanes = line.lanes.unwrap_or(if both { 2.0 } else { 1.0 });
    let width = line.width_m.unwrap_or(lanes * LANE_M).clamp(2.5, 40.0);
    // The middle of the half that is driven on, or of all of it; the lane within is not known.
    let (offset_m, driven) = if both {
        (0.25 * width, 0.5 * width)
    } else {
        (0.0, width)
    };
    Road {
        name: line.name.clone(),
        oneway: line.oneway,
        offset_m: side * offset_m,
        offset_sd_m: LANE_SD_M.max(driven / 12.0_f64.sqrt()),
    }
}
