//! A reconstructed drive against satellite fixes.

use reconstruct::findings::Reconstruction;
use reconstruct::trajectory::State;
use schema::num;

use crate::recordings::share;

/// At a fix: time, its place, ours, metres left to the rest, the state behind it.
type AtFix<'a> = (f64, [f64; 2], [f64; 2], f64, &'a State);

/// Noise of a fix, one sigma per axis, m.
const FIX_SD: f64 = 0.1;
/// Squared radius of the 95 % ellipse (chi-square, 2 degrees).
const CHI_95: f64 = 5.991;
/// The path is laid on the fixes so many metres before rest.
const LAID_M: (f64, f64) = (3.0, 30.0);

/// A fix: seconds, north, east.
pub type Fix = (f64, [f64; 2]);

/// The path at one fix.
#[derive(Clone, Copy, Debug)]
pub struct Miss {
    /// Time on the fixes' clock.
    pub t: f64,
    /// Metres still to be driven by the path.
    pub left: f64,
    /// Distance from the fix, m.
    pub off: f64,
    /// Squared distance over the covariance of path and fix.
    pub chi: f64,
}

/// A scored drive.
#[derive(Clone, Debug)]
pub struct Score {
    /// One entry a fix, in order of time.
    pub misses: Vec<Miss>,
    /// Share of the fixes inside the 95 % ellipse of their instant.
    pub inside: f64,
    /// The same of those farther from rest than the path was laid on.
    pub inside_far: f64,
    /// Time of the rest's begin on the fixes' clock.
    pub rest: f64,
}

impl Score {
    /// The fix nearest to so many seconds before rest; infinite seconds: the earliest in the window.
    pub fn back(&self, seconds: f64) -> Option<Miss> {
        if seconds == f64::INFINITY {
            return self.misses.first().copied();
        }
        let at = self.rest - seconds;
        self.misses
            .iter()
            .min_by(|a, b| (a.t - at).abs().total_cmp(&(b.t - at).abs()))
            .filter(|miss| (miss.t - at).abs() < 0.5)
            .copied()
    }
}

impl Miss {
    /// Error in percent of the distance driven since.
    pub fn percent(&self) -> f64 {
        100.0 * self.off / self.left
    }
}

/// Turns the path onto the fixes 3 to 30 m before rest and scores it at every fix while it moved. `zero_utc_s` is the
/// UTC of the fixes' time 0; clocks of the result come from its states' UTC.
pub fn score(result: &Reconstruction, fixes: &[Fix], zero_utc_s: i64) -> Score {
    let times: Vec<f64> = result
        .states
        .iter()
        .map(|s| num::real_i64(s.utc_ns.unwrap() - zero_utc_s * 1_000_000_000) * 1e-9)
        .collect();
    let mut left = vec![0.0; times.len()];
    for k in (1..times.len()).rev() {
        let (a, b) = (&result.states[k - 1].position, &result.states[k].position);
        left[k - 1] = left[k] + (b[0] - a[0]).hypot(b[1] - a[1]);
    }
    let shift = times[0] - result.states[0].t_s;
    let rest = result
        .rest
        .t_s
        .map_or(times[times.len() - 1], |t| t + shift);
    let pairs: Vec<AtFix<'_>> = fixes
        .iter()
        .filter(|(t, _)| *t >= times[0] && *t <= rest)
        .filter_map(|(t, fix)| {
            let k = times.partition_point(|time| time <= t);
            let (a, b) = (k.checked_sub(1)?, k.min(times.len() - 1));
            let part = if b > a {
                (t - times[a]) / (times[b] - times[a])
            } else {
                0.0
            };
            let mix = |i: usize| {
                let (p, q) = (&result.states[a].position, &result.states[b].position);
                p[i] + part * (q[i] - p[i])
            };
            Some((*t, *fix, [mix(0), mix(1)], left[a], &result.states[b]))
        })
        .collect();
    let laid: Vec<([f64; 2], [f64; 2])> = pairs
        .iter()
        .filter(|(.., left, _)| (LAID_M.0..=LAID_M.1).contains(left))
        .map(|(_, fix, path, ..)| (*path, *fix))
        .collect();
    assert!(
        laid.len() >= 5,
        "only {} fixes to lay the path on",
        laid.len()
    );
    let (turn, own, other) = lay(&laid);
    let (sin, cos) = turn.sin_cos();
    let misses: Vec<Miss> = pairs
        .iter()
        .map(|(t, fix, path, left, state)| {
            // The fix in the path's own frame, where the covariance is.
            let d = [fix[0] - other[0], fix[1] - other[1]];
            let north = cos * d[0] + sin * d[1] + own[0] - path[0];
            let east = -sin * d[0] + cos * d[1] + own[1] - path[1];
            let (nn, ee, ne) = (
                state.sd_north.powi(2) + FIX_SD.powi(2),
                state.sd_east.powi(2) + FIX_SD.powi(2),
                state.cov_north_east,
            );
            let chi = (ee * north * north - 2.0 * ne * north * east + nn * east * east)
                / (nn * ee - ne * ne);
            Miss {
                t: *t,
                left: *left,
                off: north.hypot(east),
                chi,
            }
        })
        .collect();
    let of = |far: bool| {
        let flags: Vec<bool> = misses
            .iter()
            .filter(|miss| !far || miss.left > LAID_M.1)
            .map(|miss| miss.chi <= CHI_95)
            .collect();
        share(&flags)
    };
    Score {
        inside: of(false),
        inside_far: of(true),
        misses,
        rest,
    }
}

/// Turn (clockwise from north) and the two centres that lay the first points on the second, by least squares.
fn lay(pairs: &[([f64; 2], [f64; 2])]) -> (f64, [f64; 2], [f64; 2]) {
    let count = num::real(pairs.len());
    let mut centres = [[0.0; 2]; 2];
    for (p, q) in pairs {
        for i in 0..2 {
            centres[0][i] += p[i] / count;
            centres[1][i] += q[i] / count;
        }
    }
    let [own, other] = centres;
    let (mut dot, mut cross) = (0.0, 0.0);
    for (p, q) in pairs {
        let (a, b) = (
            [p[0] - own[0], p[1] - own[1]],
            [q[0] - other[0], q[1] - other[1]],
        );
        dot += a[0] * b[0] + a[1] * b[1];
        cross += a[0] * b[1] - a[1] * b[0];
    }
    (cross.atan2(dot), own, other)
}
