//! Turns a reconstruction from the axes of the car at rest to true north, by the heading measured at the scene.
//!
//! The error of that heading turns the whole path about the rest point, so it enters every north and east and
//! every heading. The error of the rest point itself does not: positions count from there. It enters where the
//! path is laid on the earth, see [`crate::export::ellipse`].

use crate::findings::{Figure, ModelAnswer, Reconstruction, RestPose};
use crate::stats::two_sided_quantile;
use crate::trajectory::State;

/// Turns everything that has a direction; does nothing without a rest pose.
pub fn to_true_north(r: &mut Reconstruction) {
    let Some(pose) = r.rest_pose else { return };
    let quantile = two_sided_quantile(r.confidence);
    for state in &mut r.states {
        turn_state(state, &pose);
    }
    for impact in &mut r.impacts {
        let heading = &impact.heading_deg;
        impact.heading_deg = Figure::new(
            (heading.value + pose.heading_deg).rem_euclid(360.0),
            heading.sd.hypot(pose.sd_deg),
            quantile,
        );
    }
    for model in &mut r.models {
        turn_answer(model, &pose, quantile);
    }
}

fn turned([north, east]: [f64; 2], heading: f64) -> [f64; 2] {
    let (s, c) = heading.sin_cos();
    [c * north - s * east, s * north + c * east]
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

/// The answer of a model has no covariance of north and east; the widest it could have is taken.
fn turn_answer(model: &mut ModelAnswer, pose: &RestPose, quantile: f64) {
    let heading = pose.heading_deg.to_radians();
    let (s, c) = heading.sin_cos();
    let (sd_n, sd_e) = (model.start_north_m.sd, model.start_east_m.sd);
    let [north, east] = turned(
        [model.start_north_m.value, model.start_east_m.value],
        heading,
    );
    let doubt = pose.sd_deg.to_radians();
    let widest = |a: f64, b: f64| {
        if a.is_finite() && b.is_finite() {
            a + b
        } else {
            f64::INFINITY
        }
    };
    let sd_north = widest((c * sd_n).abs(), (s * sd_e).abs()).hypot(doubt * east);
    let sd_east = widest((s * sd_n).abs(), (c * sd_e).abs()).hypot(doubt * north);
    model.start_north_m = Figure::new(north, sd_north, quantile);
    model.start_east_m = Figure::new(east, sd_east, quantile);
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
