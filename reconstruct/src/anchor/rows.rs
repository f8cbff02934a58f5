//! A fix as rows over the states of the refined model.
//!
//! In the axes of the anchor a fix shows `q + R(turn) (r + C l)`: place of the origin, turn about it, path, antenna. Held at
//! its instant, `age` before the state, and the delay of the fixes beside what they are said to have, the path was
//! `(age - lag) v` behind.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::{Anchor, Laid};
use crate::error_model::{ATT, POS, STATES, VEL};
use crate::frame::skew;
use crate::mechanize::Earth;
use crate::refined::measure::Scalar;
use crate::refined::states::{LAG, Nominal, PLACE, Row, TURN};
use crate::refined::tape::Source;

/// What the car does at the state.
#[derive(Clone, Copy, Debug)]
pub struct Doing {
    /// Acceleration free of gravity, navigation axes, m/s^2.
    pub accel: Vector3<f64>,
    /// Rate, body axes, rad/s.
    pub rate: Vector3<f64>,
}

impl Doing {
    /// Of a car that stands, or of one that the sensors show `accel` and `rate` in.
    #[must_use]
    pub fn of(
        nominal: &Nominal,
        standing: bool,
        accel: &Vector3<f64>,
        rate: &Vector3<f64>,
        earth: &Earth,
    ) -> Self {
        if standing {
            return Self {
                accel: Vector3::zeros(),
                rate: Vector3::zeros(),
            };
        }
        let force = nominal.nav.c_nb.m * nominal.moving_force(accel).v;
        Self {
            accel: force + Vector3::new(0.0, 0.0, earth.gravity),
            rate: nominal.rate(rate, earth).v,
        }
    }
}

/// Two rows along the axes of a covariance: of a vector whose prediction less measurement is `residual` and whose
/// sensitivities are `rows`.
fn along(residual: &Vector2<f64>, rows: &[Row; 2], covariance: &Matrix2<f64>) -> [Scalar; 2] {
    let axes = covariance.symmetric_eigen();
    [0, 1].map(|i| {
        let u = axes.eigenvectors.column(i);
        Scalar {
            source: Source::Fix,
            residual: u.dot(residual),
            h: rows[0] * u[0] + rows[1] * u[1],
            r: axes.eigenvalues[i].max(1e-6),
        }
    })
}

/// Turn and its derivative.
fn turn(nominal: &Nominal) -> (Matrix2<f64>, Matrix2<f64>) {
    let (s, c) = nominal.value(TURN).sin_cos();
    (Matrix2::new(c, -s, s, c), Matrix2::new(-s, -c, c, -s))
}

/// Rows of a vector of the path `v`, turned: `by` maps the states of the nine to it.
fn rows(nominal: &Nominal, v: &Vector2<f64>, by: &[(usize, nalgebra::Matrix3<f64>)]) -> [Row; 2] {
    let (turn, slope) = turn(nominal);
    let turned = slope * v;
    [0, 1].map(|i| {
        let mut h = Row::zeros();
        for (state, m) in by {
            for axis in 0..3 {
                h[state + axis] = turn[(i, 0)] * m[(0, axis)] + turn[(i, 1)] * m[(1, axis)];
            }
        }
        h[TURN] = -turned[i];
        h
    })
}

/// Place of a fix.
#[must_use]
pub fn place(nominal: &Nominal, doing: &Doing, anchor: &Anchor, fix: &Laid) -> [Scalar; 2] {
    let nav = &nominal.nav;
    let (turn, _) = turn(nominal);
    let lever = nav.c_nb.m * anchor.lever;
    // A longer delay means an earlier instant.
    let before = fix.age_s + nominal.value(LAG);
    let path = nav.r_n.v + lever - nav.v_n.v * before + doing.accel * (0.5 * before * before);
    let offset = Vector2::new(nominal.value(PLACE), nominal.value(PLACE + 1));
    let path = path.xy();
    let mut h = rows(
        nominal,
        &path,
        &[
            (POS, nalgebra::Matrix3::identity()),
            (VEL, nalgebra::Matrix3::identity() * -before),
            (ATT, skew(&lever)),
        ],
    );
    let speed = turn * (nav.v_n.v - doing.accel * before).xy();
    for (i, h) in h.iter_mut().enumerate() {
        h[PLACE + i] = -1.0;
        h[LAG] = speed[i];
    }
    along(&(offset + turn * path - fix.place), &h, &fix.covariance)
}

/// Velocity of a fix, if it has one.
#[must_use]
pub fn velocity(
    nominal: &Nominal,
    doing: &Doing,
    anchor: &Anchor,
    fix: &Laid,
) -> Option<[Scalar; 2]> {
    let (measured, sd) = fix.velocity?;
    let nav = &nominal.nav;
    let (turn, _) = turn(nominal);
    let lever = nav.c_nb.m * doing.rate.cross(&anchor.lever);
    let before = fix.age_s + nominal.value(LAG);
    let path = (nav.v_n.v + lever - doing.accel * before).xy();
    let mut h = rows(
        nominal,
        &path,
        &[(VEL, nalgebra::Matrix3::identity()), (ATT, skew(&lever))],
    );
    let change = turn * doing.accel.xy();
    for (i, h) in h.iter_mut().enumerate() {
        h[LAG] = change[i];
    }
    // The speed of a receiver is a mean over the time since its last fix or so.
    let smooth = (0.25 * doing.accel.xy().norm()).powi(2);
    Some(along(
        &(turn * path - measured),
        &h,
        &(Matrix2::identity() * (sd * sd + smooth)),
    ))
}

/// Prior spreads of the four states of an anchor; without one they stand alone and touch nothing.
#[must_use]
pub fn spreads(anchor: Option<&Anchor>) -> [(usize, f64); 4] {
    let [turn, place, lag] = anchor.map_or([1.0; 3], |a| a.spread);
    [(TURN, turn), (PLACE, place), (PLACE + 1, place), (LAG, lag)]
}

const _: () = assert!(TURN >= STATES && LAG == PLACE + 2);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::geodesy::TangentPlane;
    use crate::findings::RestPose;
    use crate::frame::{Body, Nav, Rot, Vec3};
    use crate::mechanize::Nav9;
    use crate::refined::states::{DIM, PARAMS};
    use nalgebra::SVector;

    /// Each row against a difference of its own residual, and a fix of a known pose against none.
    #[test]
    fn rows_meet_finite_differences() {
        let mut cal = SVector::<f64, PARAMS>::zeros();
        cal[TURN - STATES] = 0.08;
        cal[PLACE - STATES] = 3.0;
        cal[PLACE + 1 - STATES] = -2.0;
        cal[LAG - STATES] = 0.04;
        let nominal = Nominal {
            nav: Nav9 {
                r_n: Vec3::new(-140.0, 35.0, 1.0),
                v_n: Vec3::new(18.0, 9.0, -0.4),
                c_nb: Rot::<Nav, Body>::from_euler(0.06, -0.04, 0.45),
            },
            cal,
        };
        let doing = Doing {
            accel: Vector3::new(-2.0, 1.0, 0.1),
            rate: Vector3::new(0.02, -0.05, 0.4),
        };
        let pose = RestPose {
            latitude_deg: 63.4,
            longitude_deg: 10.4,
            heading_deg: 30.0,
            sd_m: 0.0,
            sd_deg: 0.0,
        };
        let anchor = Anchor {
            plane: TangentPlane::at(&pose),
            heading: 0.5,
            lever: Vector3::new(0.4, 0.3, -0.9),
            spread: [0.5, 100.0, 0.1],
            fixes: Vec::new(),
        };
        let fix = Laid {
            number: 0,
            k: 0,
            age_s: 0.006,
            place: Vector2::new(-138.0, 20.0),
            covariance: Matrix2::new(4.0, 1.0, 1.0, 9.0),
            velocity: Some((Vector2::new(17.0, 10.0), 0.2)),
        };
        let build = |n: &Nominal, i: usize| {
            let [a, b] = place(n, &doing, &anchor, &fix);
            let [c, d] = velocity(n, &doing, &anchor, &fix).unwrap();
            [a, b, c, d][i]
        };
        for i in 0..4 {
            let base = build(&nominal, i);
            for s in POS..DIM {
                let mut x = Row::zeros();
                x[s] = -1e-6;
                let found = (build(&nominal.corrected(&x), i).residual - base.residual) / 1e-6;
                let want = base.h[s];
                assert!(
                    (found - want).abs() < 1e-4 * (1.0 + want.abs()),
                    "{i} state {s}: {found} {want}"
                );
            }
        }
    }
}
