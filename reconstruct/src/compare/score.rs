//! Errors, shares inside the bounds of the same instant, and normalised squared errors.

use schema::num;

use crate::compare::align::{Alignment, remaining, remaining_at};
use crate::compare::read::{Trajectory, Truth};
use crate::compare::time::{Pair, speed_like};
use crate::stats::{ellipse_radius, two_sided_quantile};

/// The confidences whose shares are counted.
pub const CONFIDENCES: [f64; 4] = [0.5, 0.8, 0.95, 0.99];

/// Errors at one instant: estimate minus truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Seconds from the first trigger.
    pub t_s: f64,
    /// Distance, m.
    pub position_m: Option<f64>,
    /// Along the track, m, positive ahead.
    pub along_m: Option<f64>,
    /// Across the track, m, positive to the right.
    pub across_m: Option<f64>,
    /// Squared error in units of the covariance, 2 degrees of freedom.
    pub position_squares: Option<f64>,
    /// Speed, m/s.
    pub speed_mps: Option<f64>,
    /// Speed in sigmas.
    pub speed_sigmas: Option<f64>,
    /// Heading, rad.
    pub heading: Option<f64>,
    /// Heading in sigmas.
    pub heading_sigmas: Option<f64>,
}

/// Spread of one kind of error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Instants compared.
    pub instants: usize,
    /// Median of the absolute error.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Share within the bounds at each of [`CONFIDENCES`]; `None` without a covariance.
    pub inside: Option<[f64; 4]>,
    /// Mean normalised squared error over the degrees of freedom (1 is honest); `None` without a covariance.
    pub nees: Option<f64>,
}

/// Error at the first instant with a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// When, s.
    pub t_s: f64,
    /// Distance from the truth, m.
    pub error_m: f64,
    /// Metres driven from there to the end.
    pub distance_m: f64,
    /// Error as a share of the distance; `None` where nothing was driven.
    pub share: Option<f64>,
    /// What one sigma of the alignment's turn makes of it, m.
    pub alignment_sd_m: Option<f64>,
}

/// The whole score.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Every instant compared, in order of time: while the car moves (all of them where it never does), for
    /// the rest after the drive is right by construction and would flatter every share.
    pub instants: Vec<Instant>,
    /// Position.
    pub position: Option<Spread>,
    /// Speed.
    pub speed: Option<Spread>,
    /// Heading (or course), rad.
    pub heading: Option<Spread>,
    /// The start.
    pub start: Option<Start>,
}

/// Scores every instant.
#[must_use]
pub fn score(
    trajectory: &Trajectory,
    truth: &Truth,
    pairs: &[Pair],
    alignment: Option<&Alignment>,
) -> Score {
    let pairs = moving(pairs);
    let mut direction: Option<f64> = None;
    let instants: Vec<Instant> = pairs
        .iter()
        .map(|pair| {
            if pair.row.ground_speed > 0.3 {
                direction = Some(pair.row.velocity[1].atan2(pair.row.velocity[0]));
            }
            instant(
                truth,
                pair,
                alignment,
                direction.unwrap_or(pair.row.heading),
            )
        })
        .collect();
    let z = CONFIDENCES.map(two_sided_quantile);
    let k2 = CONFIDENCES.map(|c| ellipse_radius(c).powi(2));
    let squares = |f: fn(&Instant) -> Option<f64>| move |i: &Instant| f(i).map(|s| s * s);
    let position = spread(&instants, |i| i.position_m, |i| i.position_squares, k2, 2.0);
    let speed = spread(
        &instants,
        |i| i.speed_mps,
        squares(|i| i.speed_sigmas),
        z.map(|z| z * z),
        1.0,
    );
    let heading = spread(
        &instants,
        |i| i.heading,
        squares(|i| i.heading_sigmas),
        z.map(|z| z * z),
        1.0,
    );
    let start = start(trajectory, pairs, &instants, alignment);
    Score {
        instants,
        position,
        speed,
        heading,
        start,
    }
}

/// The instants up to the last at which the car moves.
fn moving(pairs: &[Pair]) -> &[Pair] {
    let end = pairs
        .iter()
        .rposition(|p| p.row.ground_speed > 0.2)
        .map_or(pairs.len(), |last| last + 1);
    pairs.get(..end).unwrap_or(pairs)
}

fn instant(truth: &Truth, pair: &Pair, alignment: Option<&Alignment>, direction: f64) -> Instant {
    let row = &pair.row;
    let rotation = alignment.map_or(0.0, |a| a.rotation);
    let error = alignment.zip(pair.truth.position).map(|(a, t)| {
        let p = a.point(row.position);
        [p[0] - t[0], p[1] - t[1]]
    });
    let (s, c) = (direction + rotation).sin_cos();
    let positive = |sd: f64| (sd > 0.0 && sd.is_finite()).then_some(sd);
    let speed = pair.truth.speed.map(|v| speed_like(truth, row) - v);
    // A course says nothing of a car that hardly moves.
    let own = if truth.heading_is_course {
        row.velocity[1].atan2(row.velocity[0])
    } else {
        row.heading
    };
    let told = !truth.heading_is_course || row.ground_speed > 1.0;
    let heading = pair
        .truth
        .heading
        .filter(|_| told && (truth.same_frame || alignment.is_some()))
        .map(|h| {
            let d = own + rotation - h;
            d.sin().atan2(d.cos())
        });
    Instant {
        t_s: row.t_s,
        position_m: error.map(|[n, e]| n.hypot(e)),
        along_m: error.map(|[n, e]| c * n + s * e),
        across_m: error.map(|[n, e]| c * e - s * n),
        position_squares: error.and_then(|e| squares(e, row.covariance, rotation)),
        speed_mps: speed,
        speed_sigmas: speed.zip(positive(row.sd_speed)).map(|(e, sd)| e / sd),
        heading,
        // A course has the sideslip and an error of its own in it, which the heading's sigma does not know.
        heading_sigmas: heading
            .filter(|_| !truth.heading_is_course)
            .zip(positive(row.sd_heading))
            .map(|(e, sd)| e / sd),
    }
}

/// Squared error by the inverse of the covariance, turned into the truth's frame.
fn squares(error: [f64; 2], [vn, ve, c]: [f64; 3], rotation: f64) -> Option<f64> {
    let (s, co) = rotation.sin_cos();
    let (n, e) = (co * error[0] + s * error[1], co * error[1] - s * error[0]);
    let det = vn * ve - c * c;
    (det > 1e-12 * vn * ve && det > 0.0).then(|| (ve * n * n - 2.0 * c * n * e + vn * e * e) / det)
}

fn spread(
    instants: &[Instant],
    error: impl Fn(&Instant) -> Option<f64>,
    normalised: impl Fn(&Instant) -> Option<f64>,
    limits: [f64; 4],
    freedom: f64,
) -> Option<Spread> {
    let mut errors: Vec<f64> = instants.iter().filter_map(&error).map(f64::abs).collect();
    errors.sort_by(f64::total_cmp);
    let max = *errors.last()?;
    let at = |q: f64| {
        errors
            .get(num::round_usize(q * num::real(errors.len() - 1)))
            .copied()
            .unwrap_or(max)
    };
    let known: Vec<f64> = instants.iter().filter_map(normalised).collect();
    let count = num::real(known.len());
    let share = |limit: f64| num::real(known.iter().filter(|s| **s <= limit).count()) / count;
    Some(Spread {
        instants: errors.len(),
        median: at(0.5),
        p95: at(0.95),
        max,
        inside: (!known.is_empty()).then(|| limits.map(share)),
        nees: (!known.is_empty()).then(|| known.iter().sum::<f64>() / count / freedom),
    })
}

fn start(
    trajectory: &Trajectory,
    pairs: &[Pair],
    instants: &[Instant],
    alignment: Option<&Alignment>,
) -> Option<Start> {
    let (i, first) = instants
        .iter()
        .enumerate()
        .find(|(_, i)| i.position_m.is_some())?;
    let left = remaining(trajectory);
    let distance_m = remaining_at(trajectory, &left, first.t_s);
    let error_m = first.position_m?;
    let row = pairs.get(i)?.row;
    let end = trajectory.rows.last()?;
    let lever = (row.position[0] - end.position[0]).hypot(row.position[1] - end.position[1]);
    Some(Start {
        t_s: first.t_s,
        error_m,
        distance_m,
        share: (distance_m > 1.0).then(|| error_m / distance_m),
        alignment_sd_m: alignment.and_then(|a| a.rotation_sd).map(|sd| sd * lever),
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::score;
    use crate::compare::align::{Align, align};
    use crate::compare::read::{Row, Trajectory, Truth, TruthRow};
    use crate::compare::time::{base, pairs};
    use schema::num;

    pub(crate) fn drive(speed: impl Fn(f64) -> f64) -> Trajectory {
        let (mut north, mut east) = (0.0, 0.0);
        let rows = (0..4500)
            .map(|i| {
                let t = num::real(i) * 0.01;
                let (v, heading) = (speed(t), 0.02 * t);
                north += v * heading.cos() * 0.01;
                east += v * heading.sin() * 0.01;
                Row {
                    t_s: t,
                    position: [north, east],
                    velocity: [v * heading.cos(), v * heading.sin()],
                    speed: v,
                    ground_speed: v,
                    heading,
                    covariance: [4.0, 1.0, 0.5],
                    sd_speed: 0.1,
                    sd_heading: 0.01,
                }
            })
            .collect();
        Trajectory {
            rows,
            epoch_s: Some(1_700_000_000.0),
        }
    }

    pub(crate) fn truth_of(trajectory: &Trajectory, stride: usize) -> Truth {
        let rows = trajectory
            .rows
            .iter()
            .step_by(stride)
            .map(|r| TruthRow {
                t_s: r.t_s,
                position: Some(r.position),
                speed: Some(r.speed),
                heading: Some(r.heading),
            })
            .collect();
        Truth {
            rows,
            epoch_s: trajectory.epoch_s,
            same_frame: true,
            heading_is_course: false,
            speed_is_ground: false,
        }
    }

    #[test]
    fn a_known_offset_is_scored_in_metres_sigmas_and_shares() {
        let trajectory = drive(|_| 10.0);
        let mut truth = truth_of(&trajectory, 10);
        for row in &mut truth.rows {
            row.position = row.position.map(|[n, e]| [n - 3.0, e]);
            row.speed = row.speed.map(|v| v - 0.15);
            row.heading = row.heading.map(|h| h + std::f64::consts::TAU - 0.005);
        }
        let pairs = pairs(
            &trajectory,
            &truth,
            &base(&trajectory, &truth, None).unwrap(),
        )
        .unwrap();
        let none = align(&trajectory, &pairs, Align::None).unwrap();
        let s = score(&trajectory, &truth, &pairs, Some(&none));
        let position = s.position.unwrap();
        assert!((position.max - 3.0).abs() < 1e-9 && (position.median - 3.0).abs() < 1e-9);
        // e' P^-1 e = 9 * 1 / (4 - 0.25) = 2.4: inside 80 % (3.22) and outside 50 % (1.39).
        let inside = position
            .inside
            .unwrap()
            .map(|share| num::round_i64(share * 100.0));
        assert_eq!(inside, [0, 100, 100, 100]);
        assert!((position.nees.unwrap() - 1.2).abs() < 1e-9);
        assert!((s.speed.unwrap().nees.unwrap() - 2.25).abs() < 1e-6);
        assert!((s.heading.unwrap().median - 0.005).abs() < 1e-9);
        let start = s.start.unwrap();
        assert!(
            (start.share.unwrap() - 3.0 / start.distance_m).abs() < 1e-12
                && start.distance_m > 449.0
        );
        assert!((s.instants[0].along_m.unwrap() - 3.0).abs() < 1e-9);
    }
}
