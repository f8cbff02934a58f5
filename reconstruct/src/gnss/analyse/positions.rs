//! The accelerometer in six positions [S00, table 4.7]: still spans with gravity along each axis, both ways, and from all still
//! spans scale, bias and cross-axis misalignment.
//!
//! The mean of a position is that of the axis that gravity lies along, to 15 degrees, over the spans that lie best. Scale and bias come from every still span: the reading `m` is
//! `force = K (m - b)`, and the force's size is gravity's, whichever way the box lies, so a table that is not level does not
//! matter. `K` is diagonal (the inverse scales) with six spans, upper triangular (the misalignment too) where the spans lie askew
//! enough to tell it to 0.02 rad. Least squares by Gauss and Newton, weighted with the standard errors of the means; where more spans than
//! unknowns do not agree within these, the errors grow by what they disagree.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use schema::num::real;

use super::correlated::{Figure, mean};
use super::distribution::student_half;
use super::spans::Spans;
use crate::mechanize::{MEAN_GRAVITY, gravity};

/// Largest angle between gravity and the axis of a position, rad, 15 degrees.
const ALONG: f64 = 0.261_799;
/// Spans further off than the best of their position and this, rad, are others, laid askew.
const ALIKE: f64 = 0.02;
/// What gravity differs from the formula's by at most, one sigma, m/s^2: height and anomaly; and where no latitude is known.
const GRAVITY_SD: [f64; 2] = [5e-4, 0.015];
/// Misalignment told to this, rad, is worth telling.
const TOLD: f64 = 0.02;
/// Of a position without repeats: names in the order of S00's table.
pub const POSITIONS: [(&str, usize, f64); 6] = [
    ("x down", 0, -1.0),
    ("x up", 0, 1.0),
    ("y up", 1, 1.0),
    ("y down", 1, -1.0),
    ("z down", 2, -1.0),
    ("z up", 2, 1.0),
];

/// A position.
#[derive(Clone, Debug, PartialEq)]
pub struct Position {
    /// Name: the axis, and which way it points.
    pub name: &'static str,
    /// Axis, 0 to 2.
    pub axis: usize,
    /// Sign of the reading.
    pub sign: f64,
    /// Still spans.
    pub spans: usize,
    /// Largest angle between gravity and the axis, as read, rad.
    pub off: f64,
    /// Mean reading of the axis, m/s^2; `None`: the log has no such position.
    pub reading: Option<Figure>,
}

/// A value with its standard error and interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fitted {
    /// Estimate.
    pub value: f64,
    /// Standard error.
    pub se: f64,
    /// Interval.
    pub ends: [f64; 2],
}

/// Scale, bias and misalignment.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Reading over force, x, y, z.
    pub scale: [Fitted; 3],
    /// Reading without force, m/s^2.
    pub bias: [Fitted; 3],
    /// Cross terms of `K`, xy, xz, yz, rad; or a sentence why they are not told.
    pub misalignment: Result<[Fitted; 3], String>,
    /// Spans used.
    pub spans: usize,
    /// Spans more than unknowns.
    pub spare: usize,
    /// Chi-square of the residuals over `spare`; `None` without spare ones.
    pub chi_square: Option<f64>,
}

/// The table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Six positions.
    pub positions: Vec<Position>,
    /// Gravity, m/s^2, one sigma.
    pub gravity: [f64; 2],
    /// Where it is from.
    pub gravity_from: String,
    /// The fit; an `Err` is a sentence why there is none.
    pub calibration: Result<Calibration, String>,
}

/// Gravity, its sigma and where it is from.
#[must_use]
pub fn pull(latitude: Option<f64>) -> ([f64; 2], String) {
    match latitude {
        Some(latitude) => (
            [gravity(latitude), GRAVITY_SD[0]],
            format!(
                "Somigliana's formula (WGS 84) at {:.2} degrees of latitude",
                latitude.to_degrees()
            ),
        ),
        None => (
            [MEAN_GRAVITY, GRAVITY_SD[1]],
            "the Earth's mean, no latitude being known (--latitude)".to_owned(),
        ),
    }
}

/// The table of a log; `latitude` in rad.
#[must_use]
pub fn table(spans: &Spans, latitude: Option<f64>) -> Table {
    let readings: Vec<[Figure; 3]> = spans
        .stands
        .iter()
        .filter_map(|stand| {
            let own = spans.of(stand);
            let figure =
                |axis: usize| mean(&own.iter().map(|s| s.axis[axis]).collect::<Vec<f64>>());
            Some([figure(0)?, figure(1)?, figure(2)?])
        })
        .filter(|r| r.iter().all(|f| f.se.is_finite() && f.se > 0.0))
        .collect();
    // Angle between gravity and the axis, rad; the biases of all axes are in it.
    let off = |r: &[Figure; 3], axis: usize, sign: f64| {
        let v = Vector3::from(r.each_ref().map(|f| f.value));
        (v[axis] * sign / v.norm()).clamp(-1.0, 1.0).acos()
    };
    let positions: Vec<Position> = POSITIONS
        .into_iter()
        .map(|(name, axis, sign)| {
            let angles = || readings.iter().map(|r| off(r, axis, sign));
            let bound = (angles().fold(ALONG, f64::min) + ALIKE).min(ALONG);
            let own: Vec<Figure> = readings
                .iter()
                .filter(|r| off(r, axis, sign) < bound)
                .map(|r| r[axis])
                .collect();
            let off = angles().filter(|a| *a < bound).fold(0.0, f64::max);
            Position {
                name,
                axis,
                sign,
                spans: own.len(),
                off,
                reading: together(&own),
            }
        })
        .collect();
    let (pull, gravity_from) = pull(latitude);
    let missing: Vec<&str> = positions
        .iter()
        .filter(|p| p.reading.is_none())
        .map(|p| p.name)
        .collect();
    let calibration = if missing.is_empty() {
        calibrate(&readings, pull)
    } else {
        Err(format!(
            "Cannot tell scale and bias: no still span with {}.",
            missing.join(", ")
        ))
    };
    Table {
        positions,
        gravity: pull,
        gravity_from,
        calibration,
    }
}

/// Several spans of one position: their plain mean, with the larger of what their errors and their scatter make.
fn together(own: &[Figure]) -> Option<Figure> {
    let first = *own.first()?;
    if own.len() == 1 {
        return Some(first);
    }
    let n = real(own.len());
    let value = own.iter().map(|f| f.value).sum::<f64>() / n;
    let within = own.iter().map(|f| f.se * f.se).sum::<f64>().sqrt() / n;
    let scatter =
        (own.iter().map(|f| (f.value - value).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    let (se, dof) = if scatter > within {
        (scatter, n - 1.0)
    } else {
        (within, own.iter().map(|f| f.dof).sum())
    };
    let half = student_half(dof) * se;
    Some(Figure {
        value,
        se,
        low: value - half,
        high: value + half,
        count: own.iter().map(|f| f.count).sum(),
        effective: own.iter().map(|f| f.effective).sum(),
        dof,
        short: own.iter().any(|f| f.short),
    })
}

/// Scale and bias of one axis from its two readings, as S00 might have had them: they are exact only if gravity lay exactly along
/// the axis.
#[must_use]
pub fn from_pair(plus: f64, minus: f64, gravity: f64) -> [f64; 2] {
    [(plus - minus) / (2.0 * gravity), 0.5 * (plus + minus)]
}

/// Unknowns as a vector: inverse scales, biases, then cross terms.
struct Fit {
    x: DVector<f64>,
    cov: DMatrix<f64>,
    chi_square: f64,
}

fn k_of(x: &DVector<f64>) -> Matrix3<f64> {
    let cross = |i: usize| if x.len() > 6 { x[6 + i] } else { 0.0 };
    Matrix3::new(
        x[0],
        cross(0),
        cross(1),
        0.0,
        x[1],
        cross(2),
        0.0,
        0.0,
        x[2],
    )
}

fn calibrate(readings: &[[Figure; 3]], [g, g_sd]: [f64; 2]) -> Result<Calibration, String> {
    let plain = fit(readings, g, 6)
        .ok_or("Cannot tell scale and bias: the still spans do not determine them.")?;
    let full = if readings.len() < 9 {
        Err(format!(
            "cannot tell: {} still spans, nine are needed, some of them askew",
            readings.len()
        ))
    } else {
        fit(readings, g, 9)
            .filter(|f| (6..9).all(|i| f.cov[(i, i)].sqrt() < TOLD))
            .ok_or_else(|| "cannot tell: too few still spans lie askew".to_owned())
    };
    let (used, cross) = match &full {
        Ok(fit) => (fit, true),
        Err(_) => (&plain, false),
    };
    let spare = readings.len() - used.x.len();
    let ratio = used.chi_square / real(spare.max(1));
    let grown = if spare > 0 { ratio.max(1.0) } else { 1.0 };
    let half = if grown > 1.0 {
        student_half(real(spare))
    } else {
        student_half(f64::INFINITY)
    };
    let fitted = |value: f64, se: f64| Fitted {
        value,
        se,
        ends: [value - half * se, value + half * se],
    };
    let sd = |i: usize| (grown * used.cov[(i, i)].max(0.0)).sqrt();
    let scale = [0, 1, 2].map(|i| {
        let s = 1.0 / used.x[i];
        // Gravity's own error is common to all of them.
        fitted(s, (s * s * sd(i)).hypot(s * g_sd / g))
    });
    let bias = [0, 1, 2].map(|i| fitted(used.x[3 + i], sd(3 + i)));
    let misalignment = if cross {
        Ok([0, 1, 2].map(|i| fitted(used.x[6 + i], sd(6 + i))))
    } else {
        Err(full.err().unwrap_or_default())
    };
    Ok(Calibration {
        scale,
        bias,
        misalignment,
        spans: readings.len(),
        spare,
        chi_square: (spare > 0).then_some(ratio),
    })
}

/// Gauss-Newton on `|K (m - b)| = g`; `None` where the spans leave an unknown open or it does not settle.
fn fit(readings: &[[Figure; 3]], g: f64, unknowns: usize) -> Option<Fit> {
    if readings.len() < unknowns {
        return None;
    }
    let mut x = DVector::zeros(unknowns);
    for i in 0..3 {
        x[i] = 1.0;
    }
    let (mut normal, mut chi_square) = (DMatrix::zeros(unknowns, unknowns), 0.0);
    for _ in 0..30 {
        let k = k_of(&x);
        normal.fill(0.0);
        chi_square = 0.0;
        let mut right = DVector::zeros(unknowns);
        for reading in readings {
            let m = Vector3::from(reading.each_ref().map(|f| f.value));
            let off = m - Vector3::new(x[3], x[4], x[5]);
            let force = k * off;
            let size = force.norm();
            if !(size > 0.1 * g && size.is_finite()) {
                return None;
            }
            let u = force / size;
            let back = k.transpose() * u;
            let variance: f64 = (0..3).map(|i| (back[i] * reading[i].se).powi(2)).sum();
            let mut row = DVector::zeros(unknowns);
            for i in 0..3 {
                row[i] = u[i] * off[i];
                row[3 + i] = -back[i];
            }
            if unknowns > 6 {
                row[6] = u[0] * off[1];
                row[7] = u[0] * off[2];
                row[8] = u[1] * off[2];
            }
            let rest = g - size;
            normal += &row * row.transpose() / variance;
            right += &row * (rest / variance);
            chi_square += rest * rest / variance;
        }
        let step = normal.clone().cholesky()?.solve(&right);
        x += &step;
        if !x.iter().all(|v| v.is_finite()) {
            return None;
        }
        if step.norm() < 1e-12 {
            break;
        }
    }
    // An unknown that is left open shows as a condition of the scaled normal equations.
    let sizes: Vec<f64> = (0..unknowns).map(|i| normal[(i, i)].sqrt()).collect();
    let scaled = DMatrix::from_fn(unknowns, unknowns, |i, j| {
        normal[(i, j)] / (sizes[i] * sizes[j])
    });
    let values = scaled.symmetric_eigenvalues();
    (values.min() > 1e-9).then_some(())?;
    let cov = normal.cholesky()?.inverse();
    Some(Fit { x, cov, chi_square })
}
