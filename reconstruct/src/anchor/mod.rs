//! Satellite fixes in the crash path: they lay the path on the earth, in place, heading and time.
//!
//! The path is reckoned in its own axes: origin at the final rest, north along the car's forward axis there. Fixes are on
//! the earth. Between the two stand a place, a turn and a delay, which nobody knows before: four states of the refined
//! model, estimated with the path, so that fixes bend the path and the path's own doubt is in the place it is laid to.
//!
//! 1. [`fixes`]: what of the record's fixes can be used, when each held and how sure it is.
//! 2. [`rough`]: turn and place from a path without fixes, against outliers.
//! 3. [`Anchor`]: both for the pass, which takes each fix as [`rows`] of place and velocity.
//! 4. [`laid`]: the answer: pose at rest, its covariance, what became of each fix, the clock.

pub mod fixes;
pub mod laid;
pub mod rough;
pub mod rows;

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::epochs::Epoch;
use crate::export::geodesy::TangentPlane;
use fixes::Heard;
use rough::Rough;

/// One sigma of the turn before the fixes, rad, about the rough one.
const TURN_SD: f64 = 0.5;
/// One sigma of the place before the fixes, m, about the rough one.
const PLACE_SD: f64 = 100.0;
/// Two fixes stand at least so far apart, s: what comes faster is not news.
pub(crate) const CLOSEST_S: f64 = 0.05;

/// A fix as the pass takes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laid {
    /// Its number in the record.
    pub number: usize,
    /// Epoch, in recording order, at whose end it is used.
    pub k: usize,
    /// The end of that epoch less the instant it holds for, s.
    pub age_s: f64,
    /// North and east of the anchor, in its axes, m.
    pub place: Vector2<f64>,
    /// Its covariance in the same axes, m^2, correlation in time allowed for.
    pub covariance: Matrix2<f64>,
    /// Velocity in the same axes, m/s, and its standard deviation per axis.
    pub velocity: Option<(Vector2<f64>, f64)>,
}

/// Where the path lies on the earth, roughly, and the fixes about it.
#[derive(Clone, Debug)]
pub struct Anchor {
    /// Touches the ellipsoid at the rough place of rest.
    pub plane: TangentPlane,
    /// Rough heading of the path's north axis, rad clockwise from north.
    pub heading: f64,
    /// IMU to antenna, body axes, m.
    pub lever: Vector3<f64>,
    /// Spread of turn (rad), place (m) and delay (s) before the fixes.
    pub spread: [f64; 3],
    /// Fixes in order of time.
    pub fixes: Vec<Laid>,
}

impl Anchor {
    /// From the fixes that can be used and the rough pose. `epochs` are those up to the one the pass
    /// starts from; a fix behind them holds there if `rests`.
    #[must_use]
    pub fn new(heard: &Heard, rough: &Rough, epochs: &[Epoch], rests: bool) -> Self {
        let ends: Vec<f64> = epochs.iter().map(|e| e.t_s).collect();
        let plane = TangentPlane::at(&rough.pose);
        let heading = rough.pose.heading_deg.to_radians();
        let (s, c) = heading.sin_cos();
        let into = Matrix2::new(c, s, -s, c);
        let mut laid: Vec<Laid> = Vec::new();
        let mut last: Option<f64> = None;
        for (fix, _) in heard
            .fixes
            .iter()
            .zip(&rough.kept)
            .filter(|(_, kept)| **kept)
        {
            let since = last.map_or(f64::INFINITY, |t| fix.t_s - t);
            if since < CLOSEST_S {
                continue;
            }
            let behind = ends.last().is_some_and(|end| fix.t_s > *end);
            let k = ends.partition_point(|end| *end < fix.t_s);
            let (k, age_s) = match ends.get(k) {
                Some(end) => (k, end - fix.t_s),
                None if behind && rests => (ends.len().saturating_sub(1), 0.0),
                None => continue,
            };
            // What lies a whole epoch and more before its end came before the first one.
            if k == 0 && age_s > 0.1 {
                continue;
            }
            last = Some(fix.t_s);
            let place = plane.north_east(fix.degrees[0], fix.degrees[1]);
            let widened = fixes::widened(since) * rough.scale * rough.scale;
            let speed = fixes::widened_speed(since).sqrt();
            laid.push(Laid {
                number: fix.number,
                k,
                age_s,
                place: into * Vector2::from(place),
                covariance: into
                    * (fix.covariance * widened + heard.lever_doubt)
                    * into.transpose(),
                velocity: fix
                    .velocity
                    .map(|(v, sd)| (into * v, sd * speed * rough.scale)),
            });
        }
        Self {
            plane,
            heading,
            lever: heard.lever,
            spread: [
                rough.known.map_or(TURN_SD, |known| known[0].max(1e-6)),
                rough.known.map_or(PLACE_SD, |known| known[1].max(1e-3)),
                heard.lag_sd.max(1e-3),
            ],
            fixes: laid,
        }
    }

    /// The fixes of one epoch.
    #[must_use]
    pub fn at(&self, k: usize) -> &[Laid] {
        let from = self.fixes.partition_point(|f| f.k < k);
        let to = self.fixes.partition_point(|f| f.k <= k);
        &self.fixes[from..to]
    }
}
