//! A reference receiver: where the car was, and how far a reckoned track is from it.

use nalgebra::{Vector2, Vector3};

use super::drive::Speed;
use super::forward::Estimate;
use super::logs;
use super::rows::Fix;
use crate::simulate::city::{CityDrive, IMU_HZ};
use crate::wgs84::Geodetic;

/// Below this speed of the reference the car stands, m/s [S00, 4.3].
pub const STILL_SPEED: f64 = 0.2;
/// An estimate stands for a mark this near to it, s.
const NEAR_S: f64 = 0.06;
/// Marks farther apart are not joined, s.
const JOINED_S: f64 = 2.5;

/// One row of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// s of the box's clock.
    pub t_s: f64,
    /// Place.
    pub place: Geodetic,
    /// Velocity north, east, down, m/s.
    pub v_n: Option<Vector3<f64>>,
    /// Speed over ground, m/s.
    pub speed: Option<f64>,
}

/// Its rows, in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reference {
    /// Each later than the one before.
    pub marks: Vec<Mark>,
}

/// A track beside the reference at one mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Second {
    /// s of the box's clock.
    pub t_s: f64,
    /// Horizontal deviation, m.
    pub off_m: f64,
    /// Radius of the circle of 95 % about the estimate, m.
    pub bound_m: f64,
    /// The reference lies in the estimate's ellipse of 95 %.
    pub inside: bool,
}

impl Reference {
    /// From rows of the fixes' format whose stamps are the instants they were true at. Rows that the receiver calls bad and
    /// those no later than the one before are left out.
    #[must_use]
    pub fn of_rows(rows: &[Fix]) -> Self {
        let mut marks: Vec<Mark> = Vec::with_capacity(rows.len());
        for row in rows.iter().filter(|row| row.good != Some(false)) {
            let v_n = row.velocity_ned.map(Vector3::from);
            if marks.last().is_none_or(|m| m.t_s < row.head.obu_s) {
                marks.push(Mark {
                    t_s: row.head.obu_s,
                    place: logs::place(row),
                    v_n,
                    speed: v_n.map(|v| v.xy().norm()).or(row.speed),
                });
            }
        }
        Self { marks }
    }

    /// The truth of a simulated drive at its full seconds.
    #[must_use]
    pub fn of_truth(city: &CityDrive) -> Self {
        let marks = city.truth.iter().step_by(IMU_HZ).map(|t| Mark {
            t_s: t.t_s,
            place: t.place,
            v_n: Some(t.v_n),
            speed: Some(t.speed),
        });
        Self {
            marks: marks.collect(),
        }
    }

    /// First mark of each full second of its clock.
    pub fn seconds(&self) -> impl Iterator<Item = &Mark> {
        let mut last = i64::MIN;
        self.marks.iter().filter(move |m| {
            let second = schema::num::floor_i64(m.t_s + 1e-3);
            std::mem::replace(&mut last, second) != second
        })
    }

    /// Its speeds once a second, as a speedometer would give them [S00, 3.8].
    #[must_use]
    pub fn speeds(&self) -> Vec<Speed> {
        self.seconds()
            .filter_map(|m| {
                Some(Speed {
                    t_s: m.t_s,
                    speed: m.speed?,
                    sd: 0.05,
                })
            })
            .collect()
    }

    /// The mark nearest to an instant, if it is within so many seconds.
    #[must_use]
    pub fn near(&self, t_s: f64, within_s: f64) -> Option<&Mark> {
        let at = self.marks.partition_point(|m| m.t_s < t_s);
        let before = at.checked_sub(1).and_then(|i| self.marks.get(i));
        let list = before.into_iter().chain(self.marks.get(at));
        list.min_by(|a, b| (a.t_s - t_s).abs().total_cmp(&(b.t_s - t_s).abs()))
            .filter(|m| (m.t_s - t_s).abs() <= within_s)
    }

    /// Place at an instant between two marks at most 2.5 s apart: a cubic by place and velocity, or a straight line between
    /// marks of a quarter of a second that have none.
    #[must_use]
    pub fn at(&self, t_s: f64) -> Option<Geodetic> {
        let i = self.marks.partition_point(|m| m.t_s <= t_s);
        let a = self.marks.get(i.checked_sub(1)?)?;
        if t_s - a.t_s < 1e-6 {
            return Some(a.place);
        }
        let b = self.marks.get(i)?;
        let h = b.t_s - a.t_s;
        let u = (t_s - a.t_s) / h;
        let way = a.place.to(&b.place);
        let moved = match (a.v_n, b.v_n) {
            (Some(va), Some(vb)) if h <= JOINED_S => {
                way * (u * u * (3.0 - 2.0 * u))
                    + va * (h * u * (1.0 - u).powi(2))
                    + vb * (h * u * u * (u - 1.0))
            }
            _ if h <= 0.25 => way * u,
            _ => return None,
        };
        Some(a.place.moved(&moved))
    }

    /// Spans in which it is slower than 0.2 m/s, s: from the first such mark to the last, joined where the marks are.
    #[must_use]
    pub fn stands(&self) -> Vec<[f64; 2]> {
        let mut out: Vec<[f64; 2]> = Vec::new();
        let mut open = false;
        let mut last = f64::NEG_INFINITY;
        for m in &self.marks {
            let still = m.speed.is_some_and(|v| v.abs() < STILL_SPEED);
            match out.last_mut() {
                Some(span) if still && open && m.t_s - last <= JOINED_S => span[1] = m.t_s,
                _ if still => out.push([m.t_s; 2]),
                _ => {}
            }
            open = still;
            last = m.t_s;
        }
        out
    }
}

/// From the reference to a track at each mark that an estimate meets: the one nearest in time, at most 60 ms off, taken to
/// the mark by its velocity. Estimates in order of time.
#[must_use]
pub fn compare(track: &[Estimate], reference: &Reference) -> Vec<Second> {
    let meet = |m: &Mark| {
        let at = track.partition_point(|e| e.t_s < m.t_s);
        let before = at.checked_sub(1).and_then(|i| track.get(i));
        let e = before
            .into_iter()
            .chain(track.get(at))
            .min_by(|a, b| (a.t_s - m.t_s).abs().total_cmp(&(b.t_s - m.t_s).abs()))
            .filter(|e| (e.t_s - m.t_s).abs() <= NEAR_S)?;
        let here = e.place.moved(&(e.v_n * (m.t_s - e.t_s)));
        let d = m.place.to(&here).xy();
        Some(second(m.t_s, &d, e))
    };
    reference.marks.iter().filter_map(meet).collect()
}

/// The last estimate before an instant, at most 60 ms before it, beside the reference there: what an outage that ends then
/// has made of the place.
#[must_use]
pub fn before(track: &[Estimate], reference: &Reference, t_s: f64) -> Option<Second> {
    let at = track.partition_point(|e| e.t_s < t_s - 1e-3);
    let e = track.get(at.checked_sub(1)?)?;
    if t_s - e.t_s > NEAR_S {
        return None;
    }
    let d = reference.at(e.t_s)?.to(&e.place).xy();
    Some(second(e.t_s, &d, e))
}

fn second(t_s: f64, d: &Vector2<f64>, e: &Estimate) -> Second {
    Second {
        t_s,
        off_m: d.norm(),
        bound_m: e.radius(0.95),
        inside: e.holds(d, 0.95),
    }
}
