//! The confidence ellipse of one instant, and the funnel's outline: the union of all of them.
//!
//! The ellipse is the claim: of many crashes, the chosen share of true positions at time t lies in the ellipse
//! of time t (chi-square with two degrees of freedom). The outline is for drawing only.

use i_overlay::core::fill_rule::FillRule;
use i_overlay::float::simplify::SimplifyShape;
use schema::num;

use crate::findings::RestPose;
use crate::stats::ellipse_radius;
use crate::trajectory::State;

/// A point in the local level plane: north, east, m.
pub type Point = [f64; 2];

/// Covariance of north and east, m^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance {
    /// Variance of north.
    pub north: f64,
    /// Variance of east.
    pub east: f64,
    /// Covariance of north and east.
    pub cross: f64,
}

impl Covariance {
    /// Of a state, relative to the place and heading of rest.
    #[must_use]
    pub fn relative(state: &State) -> Self {
        Self {
            north: state.sd_north.powi(2),
            east: state.sd_east.powi(2),
            cross: state.cov_north_east,
        }
    }

    /// Of a state on the earth: the error of the rest point added. That of the heading at rest is in the
    /// state already, see [`crate::export::compass`].
    #[must_use]
    pub fn absolute(state: &State, pose: &RestPose) -> Self {
        let relative = Self::relative(state);
        let place = pose.sd_m.powi(2);
        let [north, east, cross] = state.on_earth.unwrap_or([place, place, 0.0]);
        Self {
            north: relative.north + north,
            east: relative.east + east,
            cross: relative.cross + cross,
        }
    }
}

/// A confidence ellipse in the level plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    /// Centre: north, east, m.
    pub centre: Point,
    /// Larger half axis, m.
    pub semi_major: f64,
    /// Smaller half axis, m.
    pub semi_minor: f64,
    /// Direction of the larger axis, rad clockwise from north.
    pub azimuth: f64,
}

impl Ellipse {
    /// The ellipse that holds the share `confidence` (0 to 1, exclusive) of a Gaussian; its axes are the
    /// covariance's eigenvectors scaled by sqrt(-2 ln(1 - confidence)).
    #[must_use]
    pub fn new(centre: Point, p: Covariance, confidence: f64) -> Self {
        let k = ellipse_radius(confidence);
        let mean = f64::midpoint(p.north, p.east);
        let spread = (0.5 * (p.north - p.east)).hypot(p.cross);
        Self {
            centre,
            semi_major: k * (mean + spread).max(0.0).sqrt(),
            semi_minor: k * (mean - spread).max(0.0).sqrt(),
            azimuth: 0.5 * (2.0 * p.cross).atan2(p.north - p.east),
        }
    }

    /// `n` points around the ellipse, clockwise on the map (north up), the first not repeated.
    #[must_use]
    pub fn points(&self, n: usize) -> Vec<Point> {
        let (sin_az, cos_az) = self.azimuth.sin_cos();
        (0..n)
            .map(|i| {
                let (s, c) = (std::f64::consts::TAU * num::real(i) / num::real(n)).sin_cos();
                let (along, across) = (self.semi_major * c, self.semi_minor * s);
                [
                    self.centre[0] + along * cos_az - across * sin_az,
                    self.centre[1] + along * sin_az + across * cos_az,
                ]
            })
            .collect()
    }
}

/// The covariance that belongs to a picture or file: with the rest pose's where there is one.
#[must_use]
pub fn covariance(state: &State, pose: Option<&RestPose>) -> Covariance {
    pose.map_or_else(
        || Covariance::relative(state),
        |p| Covariance::absolute(state, p),
    )
}

/// The ellipse of one state at the chosen confidence; with the rest pose's covariance where there is one.
#[must_use]
pub fn of_state(state: &State, pose: Option<&RestPose>, confidence: f64) -> Ellipse {
    Ellipse::new(
        [state.position[0], state.position[1]],
        covariance(state, pose),
        confidence,
    )
}

/// Every state a picture needs: each `stride`-th, and the last.
pub fn thinned(states: &[State], stride: usize) -> impl Iterator<Item = &State> {
    let last = states.len().saturating_sub(1);
    states
        .iter()
        .enumerate()
        .filter(move |(i, _)| i % stride.max(1) == 0 || *i == last)
        .map(|(_, s)| s)
}

/// One polygon of the outline: its outer ring first, then its holes; rings are not closed.
pub type Polygon = Vec<Vec<Point>>;

/// The funnel's outline: the union of the convex hulls of neighbouring ellipses, one every 0.2 s.
#[must_use]
pub fn outline(states: &[State], pose: Option<&RestPose>, confidence: f64) -> Vec<Polygon> {
    let rings: Vec<Vec<Point>> = thinned(states, 20)
        .map(|s| of_state(s, pose, confidence).points(36))
        .collect();
    let mut hulls: Vec<Vec<Point>> = rings.windows(2).map(|pair| hull(&pair.concat())).collect();
    if let ([only], true) = (rings.as_slice(), hulls.is_empty()) {
        hulls.push(only.clone());
    }
    hulls.retain(|h| h.len() > 2);
    hulls.simplify_shape_as::<i64>(FillRule::NonZero)
}

/// Convex hull by Andrew's monotone chain.
fn hull(points: &[Point]) -> Vec<Point> {
    let mut sorted: Vec<Point> = points
        .iter()
        .copied()
        .filter(|p| p[0].is_finite() && p[1].is_finite())
        .collect();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut lower = chain(sorted.iter());
    let mut upper = chain(sorted.iter().rev());
    lower.pop();
    upper.pop();
    lower.extend(upper);
    lower
}

fn chain<'a>(points: impl Iterator<Item = &'a Point>) -> Vec<Point> {
    let mut kept: Vec<Point> = Vec::new();
    for p in points {
        while let [.., a, b] = kept.as_slice() {
            let turn = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
            if turn > 0.0 {
                break;
            }
            kept.pop();
        }
        kept.push(*p);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::{Covariance, Ellipse, outline};
    use crate::report::sample_case;

    #[test]
    fn ellipse_of_a_diagonal_covariance() {
        let e = Ellipse::new(
            [1.0, 2.0],
            Covariance {
                north: 4.0,
                east: 1.0,
                cross: 0.0,
            },
            0.95,
        );
        let k = 5.991_464_547_f64.sqrt();
        assert!((e.semi_major - 2.0 * k).abs() < 1e-6 && (e.semi_minor - k).abs() < 1e-6);
        assert!(e.azimuth.abs() < 1e-12);
        let p = e.points(4)[0];
        assert!((p[0] - 1.0 - 2.0 * k).abs() < 1e-6 && (p[1] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn every_ellipse_point_satisfies_the_quadratic_form() {
        let (vn, ve, c) = (3.0, 2.0, -1.2);
        let e = Ellipse::new(
            [0.0; 2],
            Covariance {
                north: vn,
                east: ve,
                cross: c,
            },
            0.8,
        );
        for [n, m] in e.points(17) {
            let det = vn * ve - c * c;
            let d2 = (ve * n * n - 2.0 * c * n * m + vn * m * m) / det;
            assert!((d2 + 2.0 * 0.2_f64.ln()).abs() < 1e-9, "{d2}");
        }
    }

    #[test]
    fn outline_is_one_ring_that_holds_the_path() {
        let r = sample_case::reconstruction();
        let polygons = outline(&r.states, None, 0.95);
        assert_eq!(polygons.len(), 1);
        let ring = &polygons[0][0];
        for s in &r.states {
            let inside = ring
                .iter()
                .zip(ring.iter().cycle().skip(1))
                .fold(false, |odd, (a, b)| {
                    let crosses = (a[1] > s.position[1]) != (b[1] > s.position[1])
                        && s.position[0]
                            < (b[0] - a[0]) * (s.position[1] - a[1]) / (b[1] - a[1]) + a[0];
                    odd ^ crosses
                });
            assert!(inside, "t = {}", s.t_s);
        }
    }
}
