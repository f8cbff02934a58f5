//! Turn and place of a path among its fixes: weighted least squares that a share of wild fixes does not move.

use nalgebra::Vector2;
use schema::num::real;

use super::fixes::Heard;
use crate::export::geodesy::TangentPlane;
use crate::findings::RestPose;
use crate::trajectory::State;

/// Least number of fixes.
const LEAST: usize = 3;
/// One sigma of the turn beyond which nothing linear can be said about it, rad.
const WORST_TURN: f64 = 0.2;
/// Scale of Cauchy's weight, from round to round, in sigmas: wide first, so that the start decides nothing.
const SCALES: [f64; 12] = [
    64.0, 32.0, 16.0, 8.0, 5.0, 4.0, 3.0, 2.4, 2.4, 2.4, 2.4, 2.4,
];
/// A fix farther off than so many sigmas is left out.
const OFF: f64 = 4.0;

/// The rough pose, and what it says of the fixes.
#[derive(Clone, Debug)]
pub struct Rough {
    /// Pose of the path's origin; its sds are those of the fit.
    pub pose: RestPose,
    /// The fix may take part, one entry each of [`Heard::fixes`].
    pub kept: Vec<bool>,
    /// Spread of the residuals over what is said of it, 1 or more.
    pub scale: f64,
    /// One sigma of heading (rad) and place (m) where the pose was measured at the scene: then it is more than a start.
    pub known: Option<[f64; 2]>,
}

/// Fix and path at its instant, m.
struct Pair {
    path: Vector2<f64>,
    fix: Vector2<f64>,
    variance: f64,
    moves: Option<(Vector2<f64>, Vector2<f64>, f64)>,
}

/// Lays the path on the fixes.
///
/// # Errors
/// A sentence that says why it cannot.
pub fn lay(heard: &Heard, states: &[State]) -> Result<Rough, String> {
    if heard.fixes.len() < LEAST {
        return Err(format!(
            "{} of {} satellite fixes can be used, and a place takes {LEAST}",
            heard.fixes.len(),
            heard.offered
        ));
    }
    let first = &heard.fixes[0];
    let plane = TangentPlane::at(&RestPose {
        latitude_deg: first.degrees[0],
        longitude_deg: first.degrees[1],
        heading_deg: 0.0,
        sd_m: 0.0,
        sd_deg: 0.0,
    });
    let pairs = pairs(heard, states, &plane)
        .ok_or_else(|| "the path has no point to lay the satellite fixes to".to_owned())?;
    let mut fit = Fit {
        turn: 0.0,
        place: Vector2::zeros(),
        turn_variance: f64::INFINITY,
        weight: 0.0,
    };
    let mut weights = vec![[1.0; 2]; pairs.len()];
    for scale in SCALES {
        fit = solve(&pairs, &weights);
        for (pair, weight) in pairs.iter().zip(&mut weights) {
            let off = fit.off(pair).norm_squared() / (2.0 * pair.variance);
            weight[0] = 1.0 / (1.0 + off / (scale * scale));
            if let Some((path, fix, variance)) = &pair.moves {
                let off = (turned(path, fit.turn) - fix).norm_squared() / (2.0 * variance);
                weight[1] = 1.0 / (1.0 + off / (scale * scale));
            }
        }
    }
    // No variance (fixes in one point) is no number below it either.
    if fit.turn_variance.is_nan() || fit.turn_variance.sqrt() >= WORST_TURN {
        return Err(format!(
            "the satellite fixes lie too close together to tell a heading (one sigma {:.0} degrees)",
            fit.turn_variance.sqrt().to_degrees().min(180.0)
        ));
    }
    let (kept, scale) = judge(&pairs, &fit);
    let used = kept.iter().filter(|k| **k).count();
    if used < LEAST || 2 * used < pairs.len() {
        return Err(format!(
            "only {used} of {} satellite fixes agree with the path",
            pairs.len()
        ));
    }
    let [longitude_deg, latitude_deg] = plane.lon_lat(fit.place.x, fit.place.y);
    Ok(Rough {
        pose: RestPose {
            latitude_deg,
            longitude_deg,
            heading_deg: fit.turn.to_degrees().rem_euclid(360.0),
            sd_m: (scale / fit.weight.sqrt()).max(1.0),
            sd_deg: (scale * fit.turn_variance.sqrt()).to_degrees(),
        },
        kept,
        scale,
        known: None,
    })
}

/// Which fixes lie on the path, and how far they scatter.
fn judge(pairs: &[Pair], fit: &Fit) -> (Vec<bool>, f64) {
    let offs: Vec<f64> = pairs
        .iter()
        .map(|p| (fit.off(p).norm_squared() / (2.0 * p.variance)).sqrt())
        .collect();
    let mut sorted = offs.clone();
    sorted.sort_by(f64::total_cmp);
    // The median of a Rayleigh variable of two axes, each with a variance of one half, is 0.83.
    let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let scale = (middle / 0.833).max(1.0);
    (offs.iter().map(|off| *off < OFF * scale).collect(), scale)
}

/// Judges the fixes anew about a pose that is already known, by a path in its own axes.
#[must_use]
pub fn screen(heard: &Heard, states: &[State], about: &Rough) -> Rough {
    let plane = TangentPlane::at(&about.pose);
    let Some(pairs) = pairs(heard, states, &plane) else {
        return about.clone();
    };
    let fit = Fit {
        turn: about.pose.heading_deg.to_radians(),
        place: Vector2::zeros(),
        turn_variance: 0.0,
        weight: 0.0,
    };
    let (kept, scale) = judge(&pairs, &fit);
    Rough {
        kept,
        scale,
        ..about.clone()
    }
}

fn turned(v: &Vector2<f64>, by: f64) -> Vector2<f64> {
    let (s, c) = by.sin_cos();
    Vector2::new(c * v.x - s * v.y, s * v.x + c * v.y)
}

struct Fit {
    turn: f64,
    place: Vector2<f64>,
    turn_variance: f64,
    weight: f64,
}

impl Fit {
    fn off(&self, pair: &Pair) -> Vector2<f64> {
        turned(&pair.path, self.turn) + self.place - pair.fix
    }
}

/// The turn is the direction of the sum of products, as in the problem of Procrustes.
fn solve(pairs: &[Pair], weights: &[[f64; 2]]) -> Fit {
    let mut sum = 0.0;
    let (mut path, mut fix) = (Vector2::zeros(), Vector2::zeros());
    for (pair, weight) in pairs.iter().zip(weights) {
        let w = weight[0] / pair.variance;
        sum += w;
        path += pair.path * w;
        fix += pair.fix * w;
    }
    let (path, fix) = (path / sum, fix / sum);
    let (mut dot, mut cross, mut lever) = (0.0, 0.0, 0.0);
    let mut add = |a: Vector2<f64>, b: Vector2<f64>, w: f64| {
        dot += w * a.dot(&b);
        cross += w * a.perp(&b);
        lever += w * a.norm_squared();
    };
    for (pair, weight) in pairs.iter().zip(weights) {
        add(pair.path - path, pair.fix - fix, weight[0] / pair.variance);
        if let Some((a, b, variance)) = &pair.moves {
            add(*a, *b, weight[1] / variance);
        }
    }
    let turn = cross.atan2(dot);
    Fit {
        turn,
        place: fix - turned(&path, turn),
        turn_variance: 1.0 / lever,
        weight: sum / real(pairs.len()),
    }
}

fn pairs(heard: &Heard, states: &[State], plane: &TangentPlane) -> Option<Vec<Pair>> {
    let last = states.len().checked_sub(1)?;
    let pairs = heard.fixes.iter().map(|fix| {
        let at = states.partition_point(|s| s.t_s < fix.t_s).min(last);
        let state = &states[at];
        let age = (state.t_s - fix.t_s).clamp(-0.1, 0.1);
        let (s, c) = state.heading.sin_cos();
        let lever = Vector2::new(
            c * heard.lever.x - s * heard.lever.y,
            s * heard.lever.x + c * heard.lever.y,
        );
        let velocity = Vector2::new(state.velocity[0], state.velocity[1]);
        let path = Vector2::new(state.position[0], state.position[1]) + lever - velocity * age;
        let own = 0.5 * (state.sd_north.powi(2) + state.sd_east.powi(2));
        let variance = 0.5 * (fix.covariance + heard.lever_doubt).trace() + own;
        let doubt = state.sd_speed.powi(2) + (state.sd_heading * velocity.norm()).powi(2);
        Pair {
            path,
            fix: Vector2::from(plane.north_east(fix.degrees[0], fix.degrees[1])),
            variance,
            moves: fix
                .velocity
                .map(|(v, sd)| (velocity, v, sd * sd + doubt + 0.04)),
        }
    });
    Some(pairs.collect())
}

#[cfg(test)]
mod tests {
    use super::{Fit, Pair, solve, turned};
    use nalgebra::Vector2;
    use schema::num::real;

    #[test]
    fn a_turn_and_a_place_are_found_back() {
        let pairs: Vec<Pair> = (0..20)
            .map(|i| {
                let path = Vector2::new(-20.0 * real(i), (real(i) * 0.3).sin() * 15.0);
                Pair {
                    path,
                    fix: turned(&path, 2.5) + Vector2::new(7.0, -3.0),
                    variance: 4.0,
                    moves: Some((
                        Vector2::new(20.0, 1.0),
                        turned(&Vector2::new(20.0, 1.0), 2.5),
                        0.1,
                    )),
                }
            })
            .collect();
        let Fit { turn, place, .. } = solve(&pairs, &[[1.0; 2]; 20]);
        assert!((turn - 2.5).abs() < 1e-12);
        assert!((place - Vector2::new(7.0, -3.0)).norm() < 1e-9);
    }
}
