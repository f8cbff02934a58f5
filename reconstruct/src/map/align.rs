//! The best move from one guess: Gauss-Newton on place, heading and drift together.
//!
//! Unknown are the place of rest (north, east), the heading at rest and the drift of every point of the path
//! ([`crate::map::drift`]). Each point that lies on a road says how far it is to the right of the centre line;
//! it should be half a lane. The error of that is shared by all points (the car's place in its lane) and
//! otherwise fades along the road (to 1/e over 40 m), so the road's information counts once a correlation length
//! and not once a point.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Vector2, Vector3};

use crate::map::drift::Path;
use crate::map::network::{Match, Network};

/// One sigma of what is between car and map besides the lane: drawn line and keeping of the lane, m.
const ROAD_SD_M: f64 = 1.2;
/// Distance over which that fades to 1/e, m.
const ROAD_FADE_M: f64 = 40.0;
/// The part of it that differs from point to point, m.
const POINT_SD_M: f64 = 0.3;
/// A point farther off than this many sigmas is an outlier: it brings its own doubt.
const OUTLIER: f64 = 2.5;
/// Points farther from every road are not on one, m.
const GATE_M: f64 = 15.0;
/// Steps of one stage, and for all points; the last ones settle.
const STEPS: usize = 5;
const LAST_STEPS: usize = 15;
/// A polished fit farther than this from the one before, or this much less likely, is not believed.
const POLISH_M: f64 = 30.0;
const POLISH_COST: f64 = 3.0;
/// What an outlier costs besides its width, in units of log probability: about one point in twenty is one.
const OUTLIER_COST: f64 = 3.0;
/// What a point on no road costs: as an outlier of the gate's width.
const UNMATCHED_COST: f64 = 6.0;
/// What driving the whole path against one-way streets costs.
const WRONG_WAY_COST: f64 = 7.0;

/// What is known of the rest before the map is looked at. North and east of the rough point; a later source
/// of places (fixes of a satellite receiver) enters here, with a tighter covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Covariance of north and east, m^2.
    pub place: Matrix2<f64>,
    /// Heading and its sd, rad; `None`: anything on the circle.
    pub heading: Option<(f64, f64)>,
}

/// A move that fits as well as any near it.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// North, east of the rough point (m) and heading (rad) of the car at rest.
    pub pose: Vector3<f64>,
    /// Their covariance.
    pub covariance: Matrix3<f64>,
    /// Covariance of the pose's error with the error of each point of the path, 3 x 2 a point (path axes).
    pub cross: Vec<nalgebra::Matrix3x2<f64>>,
    /// Logarithm of the posterior weight, up to a constant.
    pub log_weight: f64,
    /// Chi-square of the points on a road, over their number.
    pub chi_square: f64,
    /// Points of the path, points on a road within the bounds, of these against a one-way street.
    pub points: usize,
    /// Points on a road.
    pub on_road: usize,
    /// Points against a one-way street.
    pub against: usize,
    /// Index of the road under each point; `None` where there is none.
    pub roads: Vec<Option<usize>>,
}

/// One observation: point, row, residual.
struct Seen {
    point: usize,
    found: Match,
    extra: f64,
}

#[derive(Clone, Debug)]
struct State {
    pose: Vector3<f64>,
    /// Minus the error of each point, path axes.
    shift: DVector<f64>,
}

struct Solved {
    state: State,
    covariance: Matrix3<f64>,
    cross: Vec<nalgebra::Matrix3x2<f64>>,
    log_det: f64,
    chi_square: f64,
}

/// A fit, and what the last steps start from.
#[derive(Clone, Debug)]
pub struct Held {
    /// The fit.
    pub fit: Fit,
    about: f64,
    state: State,
}

/// Refines a guess of the pose; `None` if the path does not hold on to a road there.
#[must_use]
pub fn refine(path: &Path, network: &Network, prior: &Prior, guess: Vector3<f64>) -> Option<Held> {
    let all = path.len();
    let mut state = State {
        pose: guess,
        shift: DVector::zeros(2 * all),
    };
    let mut used = 6.min(all);
    loop {
        let steps = if used == all { LAST_STEPS } else { STEPS };
        for step in 0..steps {
            let seen = look(path, network, &state, used);
            if seen.len() < 3 {
                return None;
            }
            let before = state.pose;
            state = solve(path, prior, guess.z, state, &seen, Slope::Drawn)?.state;
            let moved = state.pose - before;
            if step > 1 && moved.xy().norm() < 0.02 && moved.z.abs() < 1e-5 {
                break;
            }
        }
        if used == all {
            break;
        }
        used = (used * 2).min(all);
        if look(path, network, &state, used).len() * 2 < used {
            return None;
        }
    }
    let fit = settle(path, network, prior, guess.z, &state)?;
    Some(Held {
        fit,
        about: guess.z,
        state,
    })
}

/// The last steps of a fit.
#[must_use]
pub fn polished(path: &Path, network: &Network, prior: &Prior, held: Held) -> Fit {
    let drawn = held.fit;
    polish(path, network, prior, held.about, held.state)
        .filter(|p| {
            let d = p.pose - drawn.pose;
            d.xy().norm() < POLISH_M && p.log_weight > drawn.log_weight - POLISH_COST
        })
        .unwrap_or(drawn)
}

/// Steps with the smooth slope only: out of the small hollows that the jitter of the drawn line makes. It may
/// run away, so it counts only where it ends near and fits as well.
fn polish(path: &Path, network: &Network, prior: &Prior, about: f64, state: State) -> Option<Fit> {
    let mut state = state;
    for _ in 0..LAST_STEPS {
        let seen = look(path, network, &state, path.len());
        let before = state.pose;
        state = solve(path, prior, about, state, &seen, Slope::Bent)?.state;
        let moved = state.pose - before;
        if moved.xy().norm() < 0.05 && moved.z.abs() < 1e-4 {
            break;
        }
    }
    settle(path, network, prior, about, &state)
}

/// What is known at the end of the steps.
fn settle(path: &Path, network: &Network, prior: &Prior, about: f64, state: &State) -> Option<Fit> {
    let seen = look(path, network, state, path.len());
    if seen.len() < 3 {
        return None;
    }
    let solved = solve(path, prior, about, state.clone(), &seen, Slope::End)?;
    Some(finish(&solved, &seen, path.len()))
}

/// Which direction the rows lie across, and whether the state moves.
#[derive(Clone, Copy, PartialEq)]
enum Slope {
    /// That of the drawn line: the true slope of the residuals.
    Drawn,
    /// That of the path as bent onto the road.
    Bent,
    /// The same, at the end: the state stays, covariances are made.
    End,
}

fn turn(heading: f64) -> Matrix2<f64> {
    let (s, c) = heading.sin_cos();
    Matrix2::new(c, -s, s, c)
}

fn placed(path: &Path, state: &State, i: usize) -> Vector2<f64> {
    let shift = Vector2::new(state.shift[2 * i], state.shift[2 * i + 1]);
    state.pose.xy() + turn(state.pose.z) * (path.points[i] + shift)
}

/// Direction of travel at a point of the path as bent onto the road. It is smooth; the drawn line's own
/// direction jitters, and would seem to say where along the road the car was.
fn bent(path: &Path, state: &State, i: usize) -> Vector2<f64> {
    let shift = |k: usize| Vector2::new(state.shift[2 * k], state.shift[2 * k + 1]);
    let (near, far) = (i.saturating_sub(1), (i + 1).min(path.len() - 1));
    let chord = path.points[near] - path.points[far];
    let moved = chord + shift(near) - shift(far);
    let angle = chord.perp(&moved).atan2(chord.dot(&moved));
    turn(angle) * path.ahead[i]
}

fn look(path: &Path, network: &Network, state: &State, used: usize) -> Vec<Seen> {
    let rotation = turn(state.pose.z);
    (0..used)
        .filter_map(|point| {
            let ahead = rotation * path.ahead[point];
            let found = network.under(placed(path, state, point), ahead, GATE_M)?;
            // The lane is common to all points, so its sd is no excuse for a single one far off.
            let off = found.lateral - found.offset;
            let bound = OUTLIER * (found.offset_sd.powi(2) + ROAD_SD_M.powi(2)).sqrt();
            let extra = (off * off - bound * bound).max(0.0);
            Some(Seen {
                point,
                found,
                extra,
            })
        })
        .collect()
}

/// Rows of the measurements: on north, east, heading; and on the shift of the row's own point.
fn rows(
    path: &Path,
    state: &State,
    seen: &[Seen],
    slope: Slope,
) -> Vec<(Vector3<f64>, Vector2<f64>)> {
    let rotation = turn(state.pose.z);
    let turned = turn(state.pose.z + std::f64::consts::FRAC_PI_2);
    seen.iter()
        .map(|s| {
            let i = s.point;
            let shift = Vector2::new(state.shift[2 * i], state.shift[2 * i + 1]);
            // On the way down the slope is the drawn line's own; what is known in the end is not.
            let right = if slope == Slope::Drawn {
                s.found.right
            } else {
                let ahead = rotation * bent(path, state, i);
                Vector2::new(-ahead.y, ahead.x)
            };
            let lever = right.dot(&(turned * (path.points[i] + shift)));
            (
                Vector3::new(right.x, right.y, lever),
                rotation.transpose() * right,
            )
        })
        .collect()
}

fn solve(
    path: &Path,
    prior: &Prior,
    about: f64,
    state: State,
    seen: &[Seen],
    slope: Slope,
) -> Option<Solved> {
    let last = slope == Slope::End;
    let n = seen.len();
    let rows = rows(path, &state, seen, slope);
    let mut p = Matrix3::zeros();
    p.fixed_view_mut::<2, 2>(0, 0).copy_from(&prior.place);
    let (heading, sd) = prior
        .heading
        .map_or((about, 3.0), |(h, sd)| (h, sd.max(1e-4)));
    p[(2, 2)] = sd * sd;
    let away = state.pose.z - heading;
    let mean_heading = heading + std::f64::consts::TAU * (away / std::f64::consts::TAU).round();
    let mean = Vector3::new(0.0, 0.0, mean_heading);
    let entry = |a: usize, b: usize| {
        let ((x, u), (y, v)) = (&rows[a], &rows[b]);
        let (i, j) = (seen[a].point, seen[b].point);
        let apart = (path.points[i] - path.points[j]).norm();
        let lane = seen[a].found.offset_sd * seen[b].found.offset_sd;
        let road = ROAD_SD_M.powi(2) * (-apart / ROAD_FADE_M).exp();
        let own = if a == b {
            POINT_SD_M.powi(2) + seen[a].extra
        } else {
            0.0
        };
        x.dot(&(p * y)) + u.dot(&(path.block(i, j) * v)) + lane + road + own
    };
    // Cholesky reads the lower triangle only.
    let s = DMatrix::from_fn(n, n, |a, b| if a < b { 0.0 } else { entry(a, b) });
    let residual = DVector::from_fn(n, |a, _| {
        let i = seen[a].point;
        let (x, u) = &rows[a];
        let shift = Vector2::new(state.shift[2 * i], state.shift[2 * i + 1]);
        seen[a].found.offset - seen[a].found.lateral + x.dot(&(state.pose - mean)) + u.dot(&shift)
    });
    let cholesky = s.cholesky()?;
    let log_det = 2.0
        * cholesky
            .l_dirty()
            .diagonal()
            .iter()
            .map(|d| d.ln())
            .sum::<f64>();
    let weighted = cholesky.solve(&residual);
    // Columns of P0 H': on the pose and on the shifts.
    let on_pose = DMatrix::from_fn(3, n, |r, a| (p * rows[a].0)[r]);
    let all = path.len();
    let mut on_shift = DMatrix::<f64>::zeros(2 * all, n);
    for (a, (_, u)) in rows.iter().enumerate() {
        let i = seen[a].point;
        for j in 0..all {
            let column = path.block(j, i) * u;
            on_shift[(2 * j, a)] = column.x;
            on_shift[(2 * j + 1, a)] = column.y;
        }
    }
    let gained = cholesky.solve(&on_pose.transpose());
    let pose = if last {
        state.pose
    } else {
        mean + fixed3(&(&on_pose * &weighted))
    };
    let reduced = &on_pose * &gained;
    let covariance = p - Matrix3::from_fn(|r, c| reduced[(r, c)]);
    let shift = if last {
        state.shift
    } else {
        &on_shift * &weighted
    };
    // Shift is minus the error of the path.
    let with_shift = if last {
        &on_shift * &gained
    } else {
        DMatrix::zeros(0, 0)
    };
    let points = if last { all } else { 0 };
    let cross = (0..points)
        .map(|i| nalgebra::Matrix3x2::from_fn(|r, c| with_shift[(2 * i + c, r)]))
        .collect();
    let finite = pose.iter().all(|x| x.is_finite()) && log_det.is_finite();
    finite.then(|| Solved {
        state: State { pose, shift },
        covariance: 0.5 * (covariance + covariance.transpose()),
        cross,
        log_det,
        chi_square: residual.dot(&weighted),
    })
}

fn fixed3(v: &DVector<f64>) -> Vector3<f64> {
    Vector3::new(v[0], v[1], v[2])
}

fn finish(solved: &Solved, seen: &[Seen], all: usize) -> Fit {
    let outliers = seen.iter().filter(|s| s.extra > 0.0).count();
    let against = seen.iter().filter(|s| s.found.against).count();
    let real = schema::num::real;
    let cost = OUTLIER_COST * real(outliers)
        + UNMATCHED_COST * real(all - seen.len())
        + WRONG_WAY_COST * real(against) / real(all);
    let mut roads = vec![None; all];
    for s in seen {
        roads[s.point] = Some(s.found.road);
    }
    Fit {
        pose: solved.state.pose,
        covariance: solved.covariance,
        cross: solved.cross.clone(),
        log_weight: -0.5
            * (solved.chi_square + solved.log_det + real(seen.len()) * std::f64::consts::TAU.ln())
            - cost,
        chi_square: solved.chi_square / real(seen.len().max(1)),
        points: all,
        on_road: seen.len() - outliers,
        against,
        roads,
    }
}
