//! Guesses over the whole circle and all roads near, the rivals that are left, and what can be claimed.

use nalgebra::{Matrix3, Vector2, Vector3};
use schema::num;

use crate::map::align::{self, Fit, Held, Prior};
use crate::map::drift::Path;
use crate::map::network::{Network, Piece};

/// Distance between two guesses along a road, m.
const STEP_M: f64 = 6.0;
/// Headings tried about the road's own direction, rad: steps of 4 degrees to 24, then of 1 degree.
const SWEEP: f64 = 4.0 * RAD;
const FINE: f64 = RAD;
const RAD: f64 = std::f64::consts::PI / 180.0;
/// Points of the path nearest to rest that the first look takes.
const FIRST_LOOK: usize = 14;
/// Guesses kept after the first and the second look.
const KEPT: [usize; 2] = [1500, 150];
/// Guesses with headings within this share a quarter of the list, rad.
const SECTOR: f64 = 15.0 * RAD;
/// Fits that get the last steps, and the loss of log probability from which on one gets none.
const POLISHED: usize = 32;
const HOPELESS: f64 = 15.0;
/// Guesses are looked at no more than this; a denser map than that is thinned.
const MAX_GUESSES: usize = 60_000;
/// Squared sigmas that one point can cost in a look.
const CAP: f64 = 9.0;
/// Places along one road and headings closer than this are one answer.
const SAME_M: f64 = 40.0;
const SAME_RAD: f64 = 3.0 * RAD;
/// A rival less likely than this is not worth a line.
const NEGLIGIBLE: f64 = 1e-3;
/// A rival as likely as this makes the answer ambiguous.
pub const AMBIGUOUS: f64 = 0.05;
/// Errors of the map that the model does not know make likelihoods too sure: their logarithm counts so much.
const TRUST: f64 = 0.6;
/// Share of the path that must lie on roads, and the largest chi-square a point.
const ON_ROAD: f64 = 0.9;
const CHI_SQUARE: f64 = 1.5;
/// A place less sure than this along the road is the rough point's, not the map's, m.
const LOOSE_M: f64 = 10.0;

/// One answer.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The fit; its covariance holds the spread of near-by answers too.
    pub fit: Fit,
    /// Posterior probability among all answers.
    pub probability: f64,
}

/// What can be claimed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// One place.
    Placed,
    /// The best of several, or a place that the map does not fix.
    Ambiguous,
    /// The path fits no road.
    NoFit,
}

/// The outcome of one search.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What can be claimed.
    pub verdict: Verdict,
    /// Why not one place, sentences; empty where there is one.
    pub why: Vec<String>,
    /// Answers, the best first; of a path that fits nowhere the best tries.
    pub candidates: Vec<Candidate>,
}

/// Lays the path on the network.
#[must_use]
pub fn search(path: &Path, network: &Network, prior: &Prior) -> Outcome {
    let guesses = guesses(path, network, prior);
    let mut held: Vec<Held> = guesses
        .iter()
        .filter_map(|guess| align::refine(path, network, prior, *guess))
        .collect();
    held.sort_by(|a, b| b.fit.log_weight.total_cmp(&a.fit.log_weight));
    let best = held.first().map_or(0.0, |h| h.fit.log_weight);
    held.retain(|h| h.fit.log_weight > best - HOPELESS);
    let mut distinct: Vec<Held> = Vec::new();
    for h in held {
        let twin = |other: &Held| {
            let (metres, angle) = apart(&other.fit.pose, &h.fit.pose);
            metres < 1.0 && angle < 0.3 * RAD
        };
        if distinct.len() < POLISHED && !distinct.iter().any(twin) {
            distinct.push(h);
        }
    }
    let fits: Vec<Fit> = distinct
        .into_iter()
        .map(|h| align::polished(path, network, prior, h))
        .collect();
    let candidates = rivals(fits, path);
    judge(candidates, prior, path)
}

/// A guess: pose and cost a point.
type Guess = (f64, Vector3<f64>);

fn guesses(path: &Path, network: &Network, prior: &Prior) -> Vec<Vector3<f64>> {
    let spread = prior.place.symmetric_eigenvalues().max().max(0.0).sqrt();
    let radius = 3.5 * spread + path.points[0].norm() + 15.0;
    let near: Vec<&Piece> = network
        .pieces
        .iter()
        .filter(|p| p.ends.iter().any(|e| e.norm() < radius + 50.0))
        .collect();
    let length: f64 = near.iter().map(|p| (p.ends[1] - p.ends[0]).norm()).sum();
    let per_place = 2.0 * 13.0;
    let step = STEP_M.max(length * per_place / num::real(MAX_GUESSES) / 13.0);
    let looked: Vec<usize> = (0..path.len().min(FIRST_LOOK)).collect();
    let mut first: Vec<Guess> = Vec::new();
    for piece in near {
        let whole = piece.ends[1] - piece.ends[0];
        let long = whole.norm();
        let count = num::usize_of(u64::try_from(num::floor_i64(long / step)).unwrap_or(0)) + 1;
        for i in 0..count {
            let foot = piece.ends[0] + whole * ((num::real(i) + 0.5) / num::real(count));
            for way in [whole / long, -whole / long] {
                first.extend(best_about(path, network, prior, foot, way, radius, &looked));
            }
        }
    }
    let first = fairest(first, KEPT[0], 3.0);
    let every: Vec<usize> = (0..path.len()).step_by(2).collect();
    let second: Vec<Guess> = first
        .iter()
        .map(|(_, pose)| sharpened(path, network, pose, &every))
        .collect();
    fairest(second, KEPT[1], 6.0)
        .into_iter()
        .map(|(_, pose)| pose)
        .collect()
}

/// The best guesses, `apart_m` from each other, no more than a quarter of them in one sector of headings: a
/// long straight road would else fill the list with one of its two directions.
fn fairest(mut guesses: Vec<Guess>, count: usize, apart_m: f64) -> Vec<Guess> {
    guesses.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<Guess> = Vec::with_capacity(count);
    for (cost, pose) in guesses {
        if kept.len() >= count {
            break;
        }
        let near = |k: &&Guess| apart(&k.1, &pose).1 < SECTOR;
        let fresh = kept
            .iter()
            .map(|k| apart(&k.1, &pose))
            .all(|(metres, angle)| metres > apart_m || angle > SAME_RAD);
        if fresh && kept.iter().filter(near).count() * 4 < count {
            kept.push((cost, pose));
        }
    }
    kept
}

/// The best heading for the point nearest to rest lying at a place of a road, driven in a direction.
fn best_about(
    path: &Path,
    network: &Network,
    prior: &Prior,
    foot: Vector2<f64>,
    way: Vector2<f64>,
    radius: f64,
    looked: &[usize],
) -> Option<Guess> {
    let found = network.under(foot, way, 5.0)?;
    let place = foot + found.right * (found.offset - found.lateral);
    let bearing = way.y.atan2(way.x) - path.ahead[0].y.atan2(path.ahead[0].x);
    (-6..=6_i32)
        .map(|k| bearing + f64::from(k) * SWEEP)
        .filter(|heading| {
            prior.heading.is_none_or(|(mean, sd)| {
                let off = (heading - mean).sin().atan2((heading - mean).cos());
                off.abs() < 3.5 * sd + SWEEP
            })
        })
        .filter_map(|heading| {
            let pose = posed(path, place, heading);
            (pose.xy().norm() < radius).then(|| (cost(path, network, &pose, looked), pose))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

/// The pose that puts the first point of the path at a place.
fn posed(path: &Path, place: Vector2<f64>, heading: f64) -> Vector3<f64> {
    let (s, c) = heading.sin_cos();
    let p = path.points[0];
    Vector3::new(
        place.x - (c * p.x - s * p.y),
        place.y - (s * p.x + c * p.y),
        heading,
    )
}

fn sharpened(path: &Path, network: &Network, pose: &Vector3<f64>, every: &[usize]) -> Guess {
    let (s, c) = pose.z.sin_cos();
    let p = path.points[0];
    let place = pose.xy() + Vector2::new(c * p.x - s * p.y, s * p.x + c * p.y);
    (-4..=4_i32)
        .map(|k| {
            let turned = posed(path, place, pose.z + f64::from(k) * FINE);
            (cost(path, network, &turned, every), turned)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or((f64::INFINITY, *pose))
}

/// Mean capped square of the distances to where the car should be, in sigmas of path and lane.
fn cost(path: &Path, network: &Network, pose: &Vector3<f64>, points: &[usize]) -> f64 {
    let (s, c) = pose.z.sin_cos();
    let turned = |v: Vector2<f64>| Vector2::new(c * v.x - s * v.y, s * v.x + c * v.y);
    let sum: f64 = points
        .iter()
        .map(|i| {
            let spread = path.block(*i, *i).symmetric_eigenvalues().max().max(0.0);
            let gate = 8.0 + 2.0 * spread.sqrt();
            let place = pose.xy() + turned(path.points[*i]);
            network
                .under(place, turned(path.ahead[*i]), gate)
                .map_or(CAP, |m| {
                    let sd2 = m.offset_sd.powi(2) + 1.5 + spread;
                    ((m.lateral - m.offset).powi(2) / sd2).min(CAP)
                })
        })
        .sum();
    sum / num::real(points.len().max(1))
}

/// Distance and angle between two poses.
fn apart(a: &Vector3<f64>, b: &Vector3<f64>) -> (f64, f64) {
    let turn = a.z - b.z;
    ((a.xy() - b.xy()).norm(), turn.sin().atan2(turn.cos()).abs())
}

/// Whether two fits are one answer: beside each other along the same road, with the same heading. The errors of
/// the drawn line make several small best places there; together they are one place with a wider doubt.
fn same(a: &Fit, b: &Fit, ahead: Vector2<f64>) -> bool {
    let (metres, angle) = apart(&a.pose, &b.pose);
    let (s, c) = a.pose.z.sin_cos();
    let way = Vector2::new(c * ahead.x - s * ahead.y, s * ahead.x + c * ahead.y);
    let d = (a.pose - b.pose).xy();
    let across = way.perp(&d).abs();
    angle < SAME_RAD && metres < SAME_M && across < 3.0 + 0.2 * metres
}

/// Joins fits that are one answer, and weighs the answers.
fn rivals(mut fits: Vec<Fit>, path: &Path) -> Vec<Candidate> {
    fits.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    let best = fits.first().map_or(0.0, |f| f.log_weight);
    let mut groups: Vec<Vec<Fit>> = Vec::new();
    for fit in fits {
        if let Some(group) = groups.iter_mut().find(|g| same(&g[0], &fit, path.ahead[0])) {
            let twin = |f: &Fit| {
                let (metres, angle) = apart(&f.pose, &fit.pose);
                metres < 0.3 && angle < 0.1 * RAD
            };
            if !group.iter().any(twin) {
                group.push(fit);
            }
        } else {
            groups.push(vec![fit]);
        }
    }
    let weight = |f: &Fit| (TRUST * (f.log_weight - best)).exp();
    let total: f64 = groups.iter().map(|g| weight(&g[0])).sum();
    groups
        .iter()
        .map(|group| Candidate {
            fit: joined(group),
            probability: weight(&group[0]) / total,
        })
        .filter(|c| c.probability > NEGLIGIBLE)
        .collect()
}

/// The mean of a group, with the group's spread about it in its covariance.
fn joined(group: &[Fit]) -> Fit {
    let mut fit = group[0].clone();
    let weights: Vec<f64> = group
        .iter()
        .map(|f| (TRUST * (f.log_weight - fit.log_weight)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let away = |other: &Fit| {
        let mut d = other.pose - group[0].pose;
        d.z = d.z.sin().atan2(d.z.cos());
        d
    };
    let mean = group
        .iter()
        .zip(&weights)
        .fold(Vector3::zeros(), |m, (f, w)| m + away(f) * (w / sum));
    fit.covariance = group
        .iter()
        .zip(&weights)
        .fold(Matrix3::zeros(), |p, (f, w)| {
            let d = away(f) - mean;
            p + (f.covariance + d * d.transpose()) * (w / sum)
        });
    fit.pose += mean;
    fit
}

/// One sigma of the place along its worst direction, m.
#[must_use]
pub fn worst_place(fit: &Fit) -> f64 {
    let p = fit.covariance.fixed_view::<2, 2>(0, 0).into_owned();
    p.symmetric_eigenvalues().max().max(0.0).sqrt()
}

fn judge(candidates: Vec<Candidate>, prior: &Prior, path: &Path) -> Outcome {
    let fits = |f: &Fit| {
        num::real(f.on_road) >= ON_ROAD * num::real(f.points) && f.chi_square <= CHI_SQUARE
    };
    let Some(best) = candidates.iter().find(|c| fits(&c.fit)) else {
        let tried = candidates.first().map_or_else(String::new, |c| {
            format!(
                "; at best {} of {} points lie on a road",
                c.fit.on_road, c.fit.points
            )
        });
        return Outcome {
            verdict: Verdict::NoFit,
            why: vec![format!(
                "No road of the map near the rest point was found that the {:.0} m of path before the first impact \
                 fit{tried}.",
                path.length_m
            )],
            candidates,
        };
    };
    let mut why = Vec::new();
    let (metres, angle) = (best.fit.pose.xy(), best.fit.pose.z);
    for rival in &candidates {
        if std::ptr::eq(rival, best) || rival.probability < AMBIGUOUS {
            continue;
        }
        let turn = (rival.fit.pose.z - angle).to_degrees();
        let turn = (turn + 180.0).rem_euclid(360.0) - 180.0;
        why.push(format!(
            "Another place fits too (probability {:.0} %): {:.0} m away, turned by {:.0} degrees.",
            100.0 * rival.probability,
            (rival.fit.pose.xy() - metres).norm(),
            turn
        ));
    }
    let loose = worst_place(&best.fit);
    let rough = prior.place.symmetric_eigenvalues().max().max(0.0).sqrt();
    if loose > LOOSE_M.min(0.5 * rough).max(2.5) {
        why.push(format!(
            "The road is too straight to fix the place along it: one sigma of {loose:.0} m, most of it from the rough \
             rest point."
        ));
    }
    let verdict = if why.is_empty() {
        Verdict::Placed
    } else {
        Verdict::Ambiguous
    };
    let first = candidates.iter().position(|c| std::ptr::eq(c, best));
    let mut candidates = candidates.clone();
    if let Some(k) = first {
        candidates.swap(0, k);
    }
    Outcome {
        verdict,
        why,
        candidates,
    }
}
