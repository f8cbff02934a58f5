//! Lays the path on the truth: a turn and a shift by least squares (no stretch).

use crate::compare::CompareError;
use crate::compare::read::Trajectory;
use crate::compare::time::Pair;
use schema::num;

/// Which fixes the path is laid on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Those 3 to 30 m of driving before rest: place and heading of rest, and nothing of the drive.
    Rest,
    /// None: both have the same frame.
    None,
    /// All of them: shape alone is compared.
    Fit,
}

/// The turn and shift found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// How.
    pub how: Align,
    /// Turn from the trajectory's frame to the truth's, rad clockwise.
    pub rotation: f64,
    /// One sigma of the turn from the residuals, rad; `None` where nothing was fitted.
    pub rotation_sd: Option<f64>,
    /// Shift after the turn: north, east, m.
    pub shift: [f64; 2],
    /// Fixes used.
    pub fixes: usize,
    /// Root mean square residual of the fit, m.
    pub residual_m: Option<f64>,
}

impl Alignment {
    /// A trajectory's point in the truth's frame.
    #[must_use]
    pub fn point(&self, p: [f64; 2]) -> [f64; 2] {
        let [n, e] = self.vector(p);
        [n + self.shift[0], e + self.shift[1]]
    }

    /// A trajectory's vector in the truth's frame.
    #[must_use]
    pub fn vector(&self, [n, e]: [f64; 2]) -> [f64; 2] {
        let (s, c) = self.rotation.sin_cos();
        [c * n - s * e, s * n + c * e]
    }
}

/// Metres driven from each row to the end.
#[must_use]
pub fn remaining(trajectory: &Trajectory) -> Vec<f64> {
    let mut left = 0.0;
    let mut out: Vec<f64> = vec![0.0; trajectory.rows.len()];
    for (i, pair) in trajectory.rows.windows(2).enumerate().rev() {
        if let [a, b] = pair {
            left += (b.position[0] - a.position[0]).hypot(b.position[1] - a.position[1]);
        }
        if let Some(slot) = out.get_mut(i) {
            *slot = left;
        }
    }
    out
}

/// Metres driven from a time to the end.
#[must_use]
pub fn remaining_at(trajectory: &Trajectory, remaining: &[f64], t_s: f64) -> f64 {
    let i = trajectory.rows.partition_point(|r| r.t_s < t_s - 1e-9);
    remaining.get(i).copied().unwrap_or(0.0)
}

/// A place of the trajectory and the true one: north, east, m.
type Match = ([f64; 2], [f64; 2]);

/// Finds the turn and shift.
///
/// # Errors
/// [`CompareError::Fixes`] with fewer than three fixes, or fixes that all lie in one place.
pub fn align(
    trajectory: &Trajectory,
    pairs: &[Pair],
    how: Align,
) -> Result<Alignment, CompareError> {
    let left = remaining(trajectory);
    let place = match how {
        Align::None => {
            return Ok(Alignment {
                how,
                rotation: 0.0,
                rotation_sd: None,
                shift: [0.0; 2],
                fixes: 0,
                residual_m: None,
            });
        }
        Align::Rest => "3 to 30 m before rest",
        Align::Fit => "in the window",
    };
    let chosen: Vec<Match> = pairs
        .iter()
        .filter(|p| {
            how == Align::Fit || (3.0..=30.0).contains(&remaining_at(trajectory, &left, p.row.t_s))
        })
        .filter_map(|p| p.truth.position.map(|t| (p.row.position, t)))
        .collect();
    let fail = || CompareError::Fixes {
        needed: 3,
        found: chosen.len(),
        place,
    };
    if chosen.len() < 3 {
        return Err(fail());
    }
    let n = num::real(chosen.len());
    let mean = |pick: fn(&Match) -> [f64; 2]| {
        let sum = chosen
            .iter()
            .map(pick)
            .fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]]);
        [sum[0] / n, sum[1] / n]
    };
    let (own, other) = (mean(|c| c.0), mean(|c| c.1));
    let (mut dot, mut cross, mut spread) = (0.0, 0.0, 0.0);
    for (p, t) in &chosen {
        let (a, b) = (
            [p[0] - own[0], p[1] - own[1]],
            [t[0] - other[0], t[1] - other[1]],
        );
        dot += a[0] * b[0] + a[1] * b[1];
        cross += a[0] * b[1] - a[1] * b[0];
        spread += a[0] * a[0] + a[1] * a[1];
    }
    if spread < 0.5 * n.min(4.0) {
        return Err(fail());
    }
    let mut found = Alignment {
        how,
        rotation: cross.atan2(dot),
        rotation_sd: None,
        shift: [0.0; 2],
        fixes: chosen.len(),
        residual_m: None,
    };
    let turned = found.vector(own);
    found.shift = [other[0] - turned[0], other[1] - turned[1]];
    let squares: f64 = chosen
        .iter()
        .map(|(p, t)| {
            let q = found.point(*p);
            (q[0] - t[0]).powi(2) + (q[1] - t[1]).powi(2)
        })
        .sum();
    // Two coordinates a fix, three parameters.
    found.rotation_sd = Some((squares / (2.0 * n - 3.0) / spread).sqrt());
    found.residual_m = Some((squares / n).sqrt());
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::{Align, align};
    use crate::compare::score::tests::{drive, truth_of};
    use crate::compare::time::{base, pairs};

    #[test]
    fn a_turned_and_shifted_truth_is_found_again() {
        let trajectory = drive(|t| if t < 40.0 { 0.3 * (40.0 - t) } else { 0.0 });
        let mut truth = truth_of(&trajectory, 20);
        let (s, c) = 0.7_f64.sin_cos();
        for row in &mut truth.rows {
            row.position = row
                .position
                .map(|[n, e]| [c * n - s * e + 100.0, s * n + c * e - 50.0]);
        }
        let pairs = pairs(
            &trajectory,
            &truth,
            &base(&trajectory, &truth, None).unwrap(),
        )
        .unwrap();
        let found = align(&trajectory, &pairs, Align::Rest).unwrap();
        assert!((found.rotation - 0.7).abs() < 1e-9 && found.rotation_sd.unwrap() < 1e-9);
        assert!((found.shift[0] - 100.0).abs() < 1e-6 && (found.shift[1] + 50.0).abs() < 1e-6);
        assert!(align(&trajectory, &pairs[..1], Align::Rest).is_err());
    }
}
