//! One reconstructed window against the fixes of another instrument.

use schema::num::real;

use crate::compare::align::{self, Align, Alignment, remaining, remaining_at};
use crate::compare::read::{Trajectory, Truth};
use crate::compare::time::{self, Pair, speed_like};
use crate::findings::Reconstruction;
use crate::stats::{ellipse_radius, two_sided_quantile};
use crate::validate::statistics::{Estimate, Share, mean, quantile, sorted};
use crate::validate::tables::LEVELS;

/// The path is laid on the fixes so many metres before rest (see [`align`]).
const LAID_M: [f64; 2] = [3.0, 30.0];
/// Instants before the event for which the error is told, s.
pub const BACK_S: [f64; 4] = [30.0, 20.0, 10.0, 5.0];
/// A fix is of an instant if it lies so near, s.
const NEAR_S: f64 = 0.5;

/// One window by one model.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// Recording and trigger.
    pub name: String,
    /// Model.
    pub model: &'static str,
    /// The record ends at rest.
    pub rest_found: bool,
    /// The truth is in the reconstruction's own frame: no alignment was needed.
    pub same_frame: bool,
    /// Metres driven from the first fix to the end.
    pub distance_m: f64,
    /// How the clocks were matched: `utc`, `epoch`, `speed`.
    pub clock: &'static str,
    /// Fixes with a place, while the car moves.
    pub fixes: usize,
    /// Error at the first fix of the window, m.
    pub start_m: Option<f64>,
    /// The same in percent of the metres driven since.
    pub start_percent: Option<f64>,
    /// Error in percent of the metres driven since, at [`BACK_S`] before the last fix of the drive.
    pub back_percent: [Option<f64>; 4],
    /// Fixes inside the ellipse of their instant at each of [`LEVELS`], with the noise of the fix and the covariance of
    /// the alignment added.
    pub coverage: Option<[Share; 4]>,
    /// The same of fixes farther than 30 m of driving from the end, on which the path was not laid.
    pub coverage_far: Option<[Share; 4]>,
    /// Mean NEES/n of the positions. Errors of one drive belong together, so its interval is too narrow.
    pub nees: Option<Estimate>,
    /// Median and 95th percentile of the absolute speed error, m/s.
    pub speed: Option<[f64; 2]>,
    /// Speeds inside the bounds at each of [`LEVELS`], the truth taken as exact.
    pub speed_coverage: Option<[Share; 4]>,
    /// What the result says it cannot tell: sentences.
    pub limits: usize,
}

/// Scores a window.
///
/// # Errors
/// A sentence on why truth and path cannot be compared.
pub fn window(
    name: &str,
    result: &Reconstruction,
    trajectory: &Trajectory,
    truth: &Truth,
    epoch_s: Option<f64>,
    fix_sd_m: f64,
) -> Result<Window, String> {
    let base = time::base(trajectory, truth, epoch_s).map_err(|e| e.to_string())?;
    let pairs = time::pairs(trajectory, truth, &base).map_err(|e| e.to_string())?;
    let end = pairs
        .iter()
        .rposition(|p| p.row.ground_speed > 0.2)
        .map_or(pairs.len(), |last| last + 1);
    let left = remaining(trajectory);
    let placed = pairs.iter().any(|p| p.truth.position.is_some());
    let how = if truth.same_frame {
        Align::None
    } else {
        Align::Rest
    };
    let laid = if placed {
        let alignment = align::align(trajectory, &pairs, how).map_err(|e| e.to_string())?;
        Some(Laid::new(alignment, &pairs, trajectory, &left, fix_sd_m))
    } else {
        None
    };
    let moving = pairs.get(..end).unwrap_or(&pairs);
    let misses: Vec<Miss> = laid.as_ref().map_or(Vec::new(), |laid| {
        moving
            .iter()
            .filter_map(|p| laid.miss(p, remaining_at(trajectory, &left, p.row.t_s)))
            .collect()
    });
    let squares: Vec<f64> = misses.iter().filter_map(|m| m.squares).collect();
    let halves: Vec<f64> = squares.iter().map(|x| 0.5 * x).collect();
    let far = misses
        .iter()
        .filter(|m| m.left_m > LAID_M[1])
        .filter_map(|m| m.squares);
    let first = misses.first();
    let last_s = moving.last().map_or(0.0, |p| p.row.t_s);
    let speeds: Vec<(f64, f64)> = moving
        .iter()
        .filter_map(|p| Some((speed_like(truth, &p.row) - p.truth.speed?, p.row.sd_speed)))
        .collect();
    let sizes = sorted(&speeds.iter().map(|s| s.0.abs()).collect::<Vec<_>>());
    let scaled = speeds
        .iter()
        .filter(|s| s.1.is_finite() && s.1 > 0.0)
        .map(|s| (s.0 / s.1).powi(2));
    let z = LEVELS.map(|level| two_sided_quantile(level).powi(2));
    Ok(Window {
        name: name.to_owned(),
        model: result.model,
        rest_found: result.rest.found,
        same_frame: truth.same_frame,
        distance_m: first.map_or_else(|| left.first().copied().unwrap_or(0.0), |m| m.left_m),
        clock: base.source,
        fixes: misses.len(),
        start_m: first.map(|m| m.off_m),
        start_percent: first.and_then(Miss::percent),
        back_percent: BACK_S.map(|back| nearest(&misses, last_s - back)?.percent()),
        coverage: coverage(squares.iter().copied()),
        coverage_far: coverage(far),
        nees: mean(&halves),
        speed: (!sizes.is_empty()).then(|| [quantile(&sizes, 0.5), quantile(&sizes, 0.95)]),
        speed_coverage: within(scaled, z),
        limits: result.limits.len(),
    })
}

fn nearest(misses: &[Miss], t_s: f64) -> Option<&Miss> {
    misses
        .iter()
        .min_by(|a, b| (a.t_s - t_s).abs().total_cmp(&(b.t_s - t_s).abs()))
        .filter(|m| (m.t_s - t_s).abs() <= NEAR_S)
}

fn coverage(squares: impl Iterator<Item = f64>) -> Option<[Share; 4]> {
    within(squares, LEVELS.map(|level| ellipse_radius(level).powi(2)))
}

fn within(squares: impl Iterator<Item = f64>, limits: [f64; 4]) -> Option<[Share; 4]> {
    let list: Vec<f64> = squares.collect();
    (!list.is_empty()).then(|| limits.map(|limit| Share::count(list.iter().map(|x| *x <= limit))))
}

/// The path at one fix.
struct Miss {
    t_s: f64,
    left_m: f64,
    off_m: f64,
    squares: Option<f64>,
}

impl Miss {
    fn percent(&self) -> Option<f64> {
        (self.left_m > 1.0).then(|| 100.0 * self.off_m / self.left_m)
    }
}

/// The path laid on the fixes, with what the laying itself leaves open.
struct Laid {
    alignment: Alignment,
    /// Centre of the path's points it was laid by.
    centre: [f64; 2],
    /// Variance of the turn, rad^2, and of the shift per axis, m^2.
    turn: f64,
    shift: f64,
    fix: f64,
}

impl Laid {
    fn new(
        alignment: Alignment,
        pairs: &[Pair],
        trajectory: &Trajectory,
        left: &[f64],
        fix_sd_m: f64,
    ) -> Self {
        let exact = Self {
            alignment,
            centre: [0.0; 2],
            turn: 0.0,
            shift: 0.0,
            // A truth in the path's own frame is the simulator's: without noise.
            fix: 0.0,
        };
        if alignment.how == Align::None {
            return exact;
        }
        let points: Vec<[f64; 2]> = pairs
            .iter()
            .filter(|p| p.truth.position.is_some())
            .filter(|p| {
                (LAID_M[0]..=LAID_M[1]).contains(&remaining_at(trajectory, left, p.row.t_s))
            })
            .map(|p| p.row.position)
            .collect();
        let n = real(points.len().max(1));
        let sum = points
            .iter()
            .fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]]);
        let centre = sum.map(|x| x / n);
        let spread: f64 = points
            .iter()
            .map(|p| (p[0] - centre[0]).powi(2) + (p[1] - centre[1]).powi(2))
            .sum();
        let fix = fix_sd_m.powi(2);
        let residual = alignment.residual_m.unwrap_or(0.0).powi(2) / 2.0;
        Self {
            centre,
            turn: alignment
                .rotation_sd
                .unwrap_or(0.0)
                .powi(2)
                .max(fix / spread.max(1e-9)),
            shift: residual.max(fix) / n,
            fix,
            ..exact
        }
    }

    /// Error and its square by the covariance of path, fix and alignment, in the path's frame.
    fn miss(&self, pair: &Pair, left_m: f64) -> Option<Miss> {
        let truth = pair.truth.position?;
        let [n, e] = self.alignment.point(pair.row.position);
        let (s, c) = self.alignment.rotation.sin_cos();
        let off = [n - truth[0], e - truth[1]];
        let (north, east) = (c * off[0] + s * off[1], c * off[1] - s * off[0]);
        let [pn, pe, pc] = pair.row.covariance;
        let arm = [
            pair.row.position[0] - self.centre[0],
            pair.row.position[1] - self.centre[1],
        ];
        // A small turn moves a point across its arm.
        let plain = self.fix + self.shift;
        let nn = pn + plain + self.turn * arm[1] * arm[1];
        let ee = pe + plain + self.turn * arm[0] * arm[0];
        let ne = pc - self.turn * arm[0] * arm[1];
        let determinant = nn * ee - ne * ne;
        let known = determinant.is_finite() && determinant > 0.0;
        Some(Miss {
            t_s: pair.row.t_s,
            left_m,
            off_m: north.hypot(east),
            squares: known.then(|| {
                (ee * north * north - 2.0 * ne * north * east + nn * east * east) / determinant
            }),
        })
    }
}
