//! Roll-over: how far the car turned about its own axes between the first impact and the rest.
//!
//! The roll angle is where the vertical lies in the body's y-z plane. It is followed from sample to sample with
//! the body's roll rate, so that any number of turns counts and a car that stands on its nose, where Euler's roll
//! jumps, loses none.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::Vector3;

use crate::error_model::ATT;
use crate::filter::Snapshot;
use crate::findings::Figure;
use crate::findings::crash::Evidence;
use crate::mechanize::Nav9;

/// A car whose vertical axis leans by more than this has rolled over, degrees. No car on its springs comes near.
pub const TILT_DEG: f64 = 60.0;
/// Begin and end are where the roll leaves its value before and reaches its last, within this, degrees.
pub const MARGIN_DEG: f64 = 10.0;
/// Share of the vertical in the y-z plane below which its direction there is not trusted.
const IN_PLANE: f64 = 0.25;

/// A roll-over.
#[derive(Clone, Debug, PartialEq)]
pub struct RollOver {
    /// `roll` about the long axis, or `pitch` end over end.
    pub axis: &'static str,
    /// Angle turned between the first impact (or the start) and the rest, degrees; positive: right side down
    /// first (nose up for `pitch`).
    pub angle_deg: Figure,
    /// Largest angle on the way, degrees, same sign convention.
    pub largest_deg: Figure,
    /// Quarter turns between the two.
    pub quarter_turns: u32,
    /// False where a gyro's silence or limit leaves the count of turns open.
    pub certain: bool,
    /// Begin, seconds from the trigger.
    pub begin_t_s: Figure,
    /// End, seconds from the trigger.
    pub end_t_s: Figure,
}

/// Down as seen from the body.
fn down(nav: &Nav9) -> Vector3<f64> {
    nav.c_nb.m.row(2).transpose()
}

/// True if the car stands on its wheels, more or less.
#[must_use]
pub fn upright(nav: &Nav9) -> bool {
    nav.c_nb.m[(2, 2)] > 0.5
}

/// On what the car lies.
#[must_use]
pub fn lies_on(nav: &Nav9) -> &'static str {
    let d = down(nav);
    match d.iamax() {
        0 if d.x > 0.0 => "nose",
        0 => "tail",
        1 if d.y > 0.0 => "right side",
        1 => "left side",
        _ if d.z > 0.0 => "wheels",
        _ => "roof",
    }
}

/// The roll-over between epoch `from` and `to` (inclusive); `None` where the car never leaned beyond
/// [`TILT_DEG`].
#[must_use]
pub fn of(evidence: &Evidence<'_>, from: usize, to: usize) -> Option<RollOver> {
    let snapshots = evidence.snapshots.get(from..=to)?;
    let list = &evidence.epochs.list[from..=to];
    let lean = TILT_DEG.to_radians().cos();
    snapshots.iter().find(|s| down(&s.nav).z < lean)?;
    let rates = &evidence.motion.rate[from..=to];
    let mut turned = [0.0; 2];
    for (epoch, rate) in list.iter().zip(rates).skip(1) {
        turned[0] += (rate.x * epoch.dt).abs();
        turned[1] += (rate.y * epoch.dt).abs();
    }
    let axis = usize::from(turned[1] > 1.5 * turned[0]);
    let angles = if axis == 0 {
        let steps = list.iter().zip(rates).map(|(e, r)| r.x * e.dt);
        let downs: Vec<_> = snapshots.iter().map(|s| down(&s.nav)).collect();
        followed(&downs, &steps.collect::<Vec<_>>())
    } else {
        let steps = list.iter().zip(rates).map(|(e, r)| r.y * e.dt);
        // End over end: the same, about y; a nose-up turn takes down from z to -x.
        let downs = snapshots.iter().map(|s| down(&s.nav));
        let downs: Vec<_> = downs.map(|d| Vector3::new(d.y, -d.x, d.z)).collect();
        followed(&downs, &steps.collect::<Vec<_>>())
    };
    let (first, last) = (*angles.first()?, *angles.last()?);
    let total = last - first;
    let largest = angles
        .iter()
        .map(|a| a - first)
        .fold(0.0, |m: f64, a| if a.abs() > m.abs() { a } else { m });
    // The turn of unseen rates; a jump to a neighbouring whole turn is excluded while it is far below one.
    let unseen: f64 = list.iter().map(|e| e.rate_psd * e.dt).sum();
    let tilt = |s: &Snapshot| s.p[(ATT, ATT)].max(s.p[(ATT + 1, ATT + 1)]);
    let sd = (tilt(&snapshots[0]) + tilt(&snapshots[snapshots.len() - 1]))
        .max(0.0)
        .sqrt();
    let margin = MARGIN_DEG.to_radians();
    let begin = angles
        .iter()
        .rposition(|a| (a - first).abs() < margin && (total.abs() > FRAC_PI_2 / 2.0));
    let begin = begin.or_else(|| angles.iter().position(|a| (a - first).abs() > margin));
    let end = angles.iter().rposition(|a| (a - last).abs() > margin);
    let instant = |k: Option<usize>, edge: usize| {
        let k = k.unwrap_or(edge);
        let rate = rates[k][axis].abs().max(0.1);
        let sd = (tilt(&snapshots[k]).max(0.0).sqrt() / rate).hypot(0.5 * list[k].dt);
        Figure::new(list[k].t_s, sd, evidence.quantile)
    };
    Some(RollOver {
        axis: if axis == 0 { "roll" } else { "pitch" },
        angle_deg: Figure::new(total.to_degrees(), sd.to_degrees(), evidence.quantile),
        largest_deg: Figure::new(largest.to_degrees(), sd.to_degrees(), evidence.quantile),
        quarter_turns: quarters(total),
        certain: evidence.quantile * unseen.sqrt().hypot(sd) < FRAC_PI_2 / 2.0,
        begin_t_s: instant(begin, 0),
        end_t_s: instant(end, snapshots.len() - 1),
    })
}

fn quarters(angle: f64) -> u32 {
    u32::try_from(schema::num::round_i64(angle.abs() / FRAC_PI_2)).unwrap_or(u32::MAX)
}

/// Angle of the vertical in the y-z plane at the end of each step, without jumps. `steps[k]` is the turn about
/// body x that led to `downs[k]`.
fn followed(downs: &[Vector3<f64>], steps: &[f64]) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::with_capacity(downs.len());
    for (d, step) in downs.iter().zip(steps) {
        let seen = d.y.atan2(d.z);
        let Some(last) = out.last() else {
            out.push(seen);
            continue;
        };
        let expected = last + step;
        out.push(if d.y.hypot(d.z) < IN_PLANE {
            expected
        } else {
            expected + (seen - expected - TAU * ((seen - expected) / TAU).round())
        });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Body, Nav, Rot, Vec3};
    use std::f64::consts::PI;

    /// A car that turns about its own x axis by 2.5 turns while it pitches through the vertical and yaws.
    #[test]
    fn turns_are_counted_through_a_vertical_pitch() {
        for (turns, pitch) in [(5.0 * PI, 0.0), (-5.0 * PI, 0.3), (2.0 * PI, 1.6)] {
            let n = 400_u32;
            let mut c = Rot::<Nav, Body>::from_euler(0.0, 0.0, 0.4);
            let (mut downs, mut steps) = (vec![c.m.row(2).transpose()], vec![0.0]);
            for k in 0..n {
                // Pitch up and back down again in the first half, roll in the second.
                let half = f64::from(k) < f64::from(n) / 2.0;
                let quarter = f64::from(k) < f64::from(n) / 4.0;
                let w = if half {
                    Vector3::new(
                        0.0,
                        if quarter { pitch } else { -pitch } / f64::from(n) * 4.0,
                        0.0,
                    )
                } else {
                    Vector3::new(turns / f64::from(n) * 2.0, 0.0, 0.0)
                };
                c = c.turned(Vec3::from(w));
                downs.push(c.m.row(2).transpose());
                steps.push(w.x);
            }
            let angles = followed(&downs, &steps);
            let total = angles[angles.len() - 1] - angles[0];
            assert!((total - turns).abs() < 1e-6, "{total} for {turns}");
            let want = (turns.abs() / FRAC_PI_2).round();
            assert!((f64::from(quarters(total)) - want).abs() < 0.5);
        }
    }

    #[test]
    fn rest_attitudes_have_names() {
        let on = |roll: f64, pitch: f64| {
            lies_on(&Nav9 {
                r_n: Vec3::zero(),
                v_n: Vec3::zero(),
                c_nb: Rot::from_euler(roll, pitch, 1.0),
            })
        };
        assert_eq!(on(0.2, 0.1), "wheels");
        assert_eq!(on(PI - 0.2, 0.1), "roof");
        assert_eq!(on(FRAC_PI_2, 0.1), "right side");
        assert_eq!(on(-FRAC_PI_2, 0.1), "left side");
        assert_eq!(on(0.0, -1.4), "nose");
        assert_eq!(on(0.0, 1.4), "tail");
    }
}
