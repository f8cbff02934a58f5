//! Turns a reconstruction from the axes of the car at rest to true north, by the heading measured at the scene.
//!
//! The error of that heading turns the whole path about the rest point, so it enters every north and east and
//! every heading. The error of the rest point itself does not: positions count from there. It enters where the
//! path is laid on the earth, see [`crate::export::ellipse`].

use crate::findings::details::SamplePaths;
use crate::findings::{Figure, ModelAnswer, Reconstruction, RestPose};
use crate::smooth::sample;
use crate::stats::two_sided_quantile;
use crate::trajectory::State;

/// Seed of the headings of sample paths: the same record gives the same bytes.
const SEED: u64 = 2;

/// Turns everything that has a direction; does nothing without a rest pose.
pub fn to_true_north(r: &mut Reconstruction) {
    let Some(pose) = r.rest_pose else { return };
    let quantile = two_sided_quantile(r.confidence);
    for state in &mut r.states {
        turn_state(state, &pose);
    }
    let turn = Turn::new(&pose, quantile);
    for impact in &mut r.impacts {
        turn.heading(&mut impact.heading_deg);
        turn.pair(
            &mut impact.north_m,
            &mut impact.east_m,
            &mut impact.cov_north_east_m2,
        );
        let dv = &mut impact.delta_v;
        turn.pair(&mut dv.north_mps, &mut dv.east_mps, &mut dv.cov_north_east);
        turn.heading(&mut dv.azimuth_deg);
    }
    for row in &mut r.details.reaction.rows {
        turn.heading(&mut row.heading_deg);
        turn.pair(
            &mut row.north_m,
            &mut row.east_m,
            &mut row.cov_north_east_m2,
        );
    }
    if let Some(rest) = &mut r.details.final_rest {
        turn.heading(&mut rest.heading_deg);
    }
    turn_paths(&mut r.details.paths, &pose);
    for model in &mut r.models {
        turn_answer(model, &turn);
    }
}

fn turned([north, east]: [f64; 2], heading: f64) -> [f64; 2] {
    let (s, c) = heading.sin_cos();
    [c * north - s * east, s * north + c * east]
}

/// Each sample path by a heading drawn from the doubt of the one measured.
fn turn_paths(paths: &mut SamplePaths, pose: &RestPose) {
    let drawn = sample::normals(paths.places.len(), SEED);
    for (path, z) in paths.places.iter_mut().zip(drawn) {
        let heading = (pose.heading_deg + pose.sd_deg * z).to_radians();
        for place in path {
            *place = turned(*place, heading);
        }
    }
}

fn turn_state(state: &mut State, pose: &RestPose) {
    let heading = pose.heading_deg.to_radians();
    let [north, east, down] = state.position;
    let [north, east] = turned([north, east], heading);
    state.position = [north, east, down];
    let [v_north, v_east, v_down] = state.velocity;
    let [v_north, v_east] = turned([v_north, v_east], heading);
    state.velocity = [v_north, v_east, v_down];
    state.heading = (state.heading + heading).rem_euclid(std::f64::consts::TAU);
    let (s, c) = heading.sin_cos();
    let (vn, ve, cov) = (
        state.sd_north.powi(2),
        state.sd_east.powi(2),
        state.cov_north_east,
    );
    let doubt = pose.sd_deg.to_radians().powi(2);
    let var_north = c * c * vn + s * s * ve - 2.0 * s * c * cov + doubt * east * east;
    let var_east = s * s * vn + c * c * ve + 2.0 * s * c * cov + doubt * north * north;
    state.sd_north = var_north.max(0.0).sqrt();
    state.sd_east = var_east.max(0.0).sqrt();
    state.cov_north_east = s * c * (vn - ve) + (c * c - s * s) * cov - doubt * north * east;
    state.sd_heading = state.sd_heading.hypot(pose.sd_deg.to_radians());
}

fn turn_answer(model: &mut ModelAnswer, turn: &Turn) {
    turn.pair(
        &mut model.start_north_m,
        &mut model.start_east_m,
        &mut model.start_cov_north_east_m2,
    );
    if let Some(impact) = &mut model.impact {
        turn.heading(&mut impact.heading_deg);
        turn.pair(
            &mut impact.north_m,
            &mut impact.east_m,
            &mut impact.cov_north_east_m2,
        );
    }
}

/// A turn by the heading at rest, with its doubt.
pub(crate) struct Turn {
    heading: f64,
    doubt: f64,
    quantile: f64,
}

impl Turn {
    /// By the pose's heading.
    pub(crate) fn new(pose: &RestPose, quantile: f64) -> Self {
        Self {
            heading: pose.heading_deg.to_radians(),
            doubt: pose.sd_deg.to_radians(),
            quantile,
        }
    }

    /// Turns a heading, degrees.
    pub(crate) fn heading(&self, figure: &mut Figure) {
        *figure = Figure::new(
            (figure.value + self.heading.to_degrees()).rem_euclid(360.0),
            figure.sd.hypot(self.doubt.to_degrees()),
            self.quantile,
        );
    }

    /// Turns a vector north and east with its covariance; an open bound leaves both open.
    pub(crate) fn pair(&self, north: &mut Figure, east: &mut Figure, covariance: &mut f64) {
        let (s, c) = self.heading.sin_cos();
        let (vn, ve, cov) = (north.sd.powi(2), east.sd.powi(2), *covariance);
        let open = [north.low, north.high, east.low, east.high]
            .iter()
            .any(|x| !x.is_finite());
        let [n, e] = turned([north.value, east.value], self.heading);
        let doubt = self.doubt * self.doubt;
        let root = |variance: f64| {
            if open {
                f64::INFINITY
            } else {
                variance.max(0.0).sqrt()
            }
        };
        let sd_n = root(c * c * vn + s * s * ve - 2.0 * s * c * cov + doubt * e * e);
        let sd_e = root(s * s * vn + c * c * ve + 2.0 * s * c * cov + doubt * n * n);
        *covariance = s * c * (vn - ve) + (c * c - s * s) * cov - doubt * n * e;
        if !covariance.is_finite() {
            *covariance = 0.0;
        }
        *north = Figure::new(n, sd_n, self.quantile);
        *east = Figure::new(e, sd_e, self.quantile);
    }
}

#[cfg(test)]
mod tests {
    use super::to_true_north;
    use crate::export::ellipse::{Covariance, Ellipse};
    use crate::findings::RestPose;
    use crate::report::sample_case;

    #[test]
    fn a_quarter_turn_makes_north_east_and_keeps_the_ellipse() {
        let before = sample_case::reconstruction();
        let mut after = before.clone();
        after.rest_pose = Some(RestPose {
            latitude_deg: 59.9,
            longitude_deg: 10.7,
            heading_deg: 90.0,
            sd_m: 0.0,
            sd_deg: 0.0,
        });
        to_true_north(&mut after);
        let (a, b) = (&before.impacts[0].delta_v, &after.impacts[0].delta_v);
        assert!((a.north_mps.value - b.east_mps.value).abs() < 1e-9);
        assert!((a.east_mps.value + b.north_mps.value).abs() < 1e-9);
        assert!((a.north_mps.sd - b.east_mps.sd).abs() < 1e-9);
        let row = |r: &crate::findings::Reconstruction| r.details.reaction.rows[0];
        assert!((row(&before).north_m.value - row(&after).east_m.value).abs() < 1e-9);
        let (a, b) = (&before.states[500], &after.states[500]);
        assert!((a.position[0] - b.position[1]).abs() < 1e-9);
        assert!((a.position[1] + b.position[0]).abs() < 1e-9);
        assert!((a.sd_north - b.sd_east).abs() < 1e-9 && (a.sd_east - b.sd_north).abs() < 1e-9);
        assert!((a.cov_north_east + b.cov_north_east).abs() < 1e-9);
        let axes = |s: &crate::trajectory::State| {
            let e = Ellipse::new([0.0; 2], Covariance::relative(s), 0.95);
            (e.semi_major, e.semi_minor)
        };
        assert!((axes(a).0 - axes(b).0).abs() < 1e-9 && (axes(a).1 - axes(b).1).abs() < 1e-9);
        let last = after.states.last().unwrap();
        assert!((last.heading - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
        let turned = (after.impacts[0].heading_deg.value - before.impacts[0].heading_deg.value)
            .rem_euclid(360.0);
        assert!((turned - 90.0).abs() < 1e-9);
    }

    #[test]
    fn doubt_of_the_heading_widens_across_the_way_to_rest() {
        let mut r = sample_case::reconstruction();
        let narrow = r.states[0].clone();
        r.rest_pose = Some(RestPose {
            latitude_deg: 0.0,
            longitude_deg: 0.0,
            heading_deg: 0.0,
            sd_m: 3.0,
            sd_deg: 2.0,
        });
        to_true_north(&mut r);
        let wide = &r.states[0];
        let lever = 2.0_f64.to_radians() * wide.position[0];
        let expected = (narrow.sd_east.powi(2) + lever * lever).sqrt();
        assert!((wide.sd_east - expected).abs() < 1e-9);
    }
}
