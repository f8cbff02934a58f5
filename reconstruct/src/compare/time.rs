//! Both tables onto one time line.

use schema::num;

use crate::compare::CompareError;
use crate::compare::read::{Row, Trajectory, Truth, TruthRow};

/// How the offset between the two clocks was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeBase {
    /// Trajectory time minus truth time, s.
    pub offset_s: f64,
    /// `utc`, `epoch` (stated) or `speed` (matched).
    pub source: &'static str,
    /// Root mean square of the speed difference at the offset found, m/s; only for `speed`.
    pub rms_mps: Option<f64>,
    /// The same at the best offset more than one second away; only for `speed`.
    pub runner_up_mps: Option<f64>,
}

/// One instant of the truth with the trajectory interpolated to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The trajectory at the truth's instant.
    pub row: Row,
    /// The truth.
    pub truth: TruthRow,
}

/// The offset: from UTC where both have it, from a stated epoch, else from the speeds.
///
/// # Errors
/// [`CompareError::Ambiguous`] if the speeds cannot tell.
pub fn base(
    trajectory: &Trajectory,
    truth: &Truth,
    epoch_s: Option<f64>,
) -> Result<TimeBase, CompareError> {
    let source = if epoch_s.is_some() { "epoch" } else { "utc" };
    match (trajectory.epoch_s, epoch_s.or(truth.epoch_s)) {
        (Some(own), Some(other)) => Ok(TimeBase {
            offset_s: other - own,
            source,
            rms_mps: None,
            runner_up_mps: None,
        }),
        (None, Some(_)) if epoch_s.is_some() => Err(CompareError::NoOverlap(
            "no UTC in the trajectory, so an epoch of the truth does not help".to_owned(),
        )),
        _ => match_speeds(trajectory, truth),
    }
}

/// Trajectory row at a time, between two rows; `None` outside or within a hole of more than 0.25 s.
#[must_use]
pub fn at(rows: &[Row], t_s: f64) -> Option<Row> {
    let after = rows.partition_point(|r| r.t_s < t_s);
    let b = rows.get(after)?;
    if b.t_s - t_s < 1e-9 {
        return Some(*b);
    }
    let a = rows.get(after.checked_sub(1)?)?;
    if b.t_s - a.t_s > 0.25 {
        return None;
    }
    let w = (t_s - a.t_s) / (b.t_s - a.t_s);
    let mix = |x: f64, y: f64| x + w * (y - x);
    let turn = (b.heading - a.heading)
        .sin()
        .atan2((b.heading - a.heading).cos());
    Some(Row {
        t_s,
        position: [
            mix(a.position[0], b.position[0]),
            mix(a.position[1], b.position[1]),
        ],
        velocity: [
            mix(a.velocity[0], b.velocity[0]),
            mix(a.velocity[1], b.velocity[1]),
        ],
        speed: mix(a.speed, b.speed),
        ground_speed: mix(a.ground_speed, b.ground_speed),
        heading: a.heading + w * turn,
        covariance: [0, 1, 2].map(|i| mix(a.covariance[i], b.covariance[i])),
        sd_speed: mix(a.sd_speed, b.sd_speed),
        sd_heading: mix(a.sd_heading, b.sd_heading),
    })
}

/// Every instant of the truth within the trajectory.
///
/// # Errors
/// [`CompareError::NoOverlap`] if there is none.
pub fn pairs(
    trajectory: &Trajectory,
    truth: &Truth,
    time: &TimeBase,
) -> Result<Vec<Pair>, CompareError> {
    let pairs: Vec<Pair> = truth
        .rows
        .iter()
        .filter_map(|t| {
            at(&trajectory.rows, t.t_s + time.offset_s).map(|row| Pair { row, truth: *t })
        })
        .collect();
    if pairs.is_empty() {
        let span = |a: Option<f64>, b: Option<f64>| {
            format!("{:.1} to {:.1} s", a.unwrap_or(0.0), b.unwrap_or(0.0))
        };
        let own = span(
            trajectory.rows.first().map(|r| r.t_s),
            trajectory.rows.last().map(|r| r.t_s),
        );
        let other = span(
            truth.rows.first().map(|r| r.t_s + time.offset_s),
            truth.rows.last().map(|r| r.t_s + time.offset_s),
        );
        return Err(CompareError::NoOverlap(format!("{own} and {other}")));
    }
    Ok(pairs)
}

/// The speed a truth states, from the trajectory.
#[must_use]
pub fn speed_like(truth: &Truth, row: &Row) -> f64 {
    if truth.speed_is_ground {
        row.ground_speed
    } else {
        row.speed
    }
}

const COARSE_S: f64 = 0.05;
const FINE_S: f64 = 0.005;

/// The offset at which the speeds differ least, if no other comes near it.
fn match_speeds(trajectory: &Trajectory, truth: &Truth) -> Result<TimeBase, CompareError> {
    let known: Vec<TruthRow> = truth
        .rows
        .iter()
        .filter(|r| r.speed.is_some())
        .copied()
        .collect();
    let ends = trajectory
        .rows
        .first()
        .zip(trajectory.rows.last())
        .zip(known.first().zip(known.last()));
    let Some(((first, last), (known_first, known_last))) = ends else {
        return Err(CompareError::Ambiguous("the truth has no speed".to_owned()));
    };
    // Half of the shorter table must be under the other; fewer fixes would match anything.
    let shortest = (last.t_s - first.t_s).min(known_last.t_s - known_first.t_s);
    let (low, high) = (
        first.t_s - known_last.t_s + 0.5 * shortest,
        last.t_s - known_first.t_s - 0.5 * shortest,
    );
    let tracks = Speeds::new(trajectory, truth);
    let steps = num::round_usize(((high - low) / COARSE_S).ceil()).min(200_000);
    let least = num::real(known.len()).clamp(5.0, 20.0);
    let costs: Vec<(f64, f64)> = (0..=steps)
        .map(|i| low + num::real(i) * COARSE_S)
        .filter_map(|offset| {
            tracks
                .rms(&known, offset, 0.5 * shortest, least)
                .map(|rms| (offset, rms))
        })
        .collect();
    let Some((coarse, _)) = costs.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)) else {
        return Err(CompareError::Ambiguous(
            "the two overlap too little".to_owned(),
        ));
    };
    let fine = (-20..=20_i32)
        .map(|i| coarse + f64::from(i) * FINE_S)
        .filter_map(|offset| {
            tracks
                .rms(&known, offset, 0.4 * shortest, least)
                .map(|rms| (offset, rms))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let (offset_s, rms) = fine.unwrap_or((coarse, f64::INFINITY));
    let runner_up = costs
        .iter()
        .filter(|(o, _)| (o - offset_s).abs() > 1.0)
        .map(|(_, c)| *c)
        .fold(f64::INFINITY, f64::min);
    let text = |x: f64| format!("{x:.2} m/s");
    if rms > 2.0 {
        return Err(CompareError::Ambiguous(format!(
            "at the best offset they still differ by {}",
            text(rms)
        )));
    }
    if runner_up < (1.5 * rms).max(rms + 0.1) {
        let message = format!(
            "they differ by {} at {offset_s:.2} s and by {} elsewhere",
            text(rms),
            text(runner_up)
        );
        return Err(CompareError::Ambiguous(message));
    }
    let finite = runner_up.is_finite().then_some(runner_up);
    Ok(TimeBase {
        offset_s,
        source: "speed",
        rms_mps: Some(rms),
        runner_up_mps: finite,
    })
}

/// The trajectory's speed on an even grid, for quick lookup.
struct Speeds {
    first_s: f64,
    values: Vec<f64>,
}

impl Speeds {
    fn new(trajectory: &Trajectory, truth: &Truth) -> Self {
        let first_s = trajectory.rows.first().map_or(0.0, |r| r.t_s);
        let last = trajectory.rows.last().map_or(0.0, |r| r.t_s);
        let count = num::round_usize((last - first_s) / 0.01).min(1_000_000);
        let values = (0..=count)
            .map(|i| {
                at(&trajectory.rows, first_s + num::real(i) * 0.01)
                    .map_or(f64::NAN, |r| speed_like(truth, &r))
            })
            .collect();
        Self { first_s, values }
    }

    /// Root mean square difference; `None` with less than `overlap_s` or fewer than `least` speeds in common.
    fn rms(&self, known: &[TruthRow], offset: f64, overlap_s: f64, least: f64) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0.0);
        let mut span: Option<(f64, f64)> = None;
        for (t, v) in known
            .iter()
            .filter_map(|r| r.speed.map(|v| (r.t_s + offset, v)))
        {
            let place = (t - self.first_s) / 0.01;
            if place < -0.5 {
                continue;
            }
            let Some(own) = self.values.get(num::round_usize(place)) else {
                break;
            };
            if own.is_finite() {
                sum += (own - v).powi(2);
                count += 1.0;
                span = Some((span.map_or(t, |s| s.0), t));
            }
        }
        let long = span.is_some_and(|(a, b)| b - a >= overlap_s - 1e-9);
        (long && count >= least).then(|| (sum / count).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::{base, pairs};
    use crate::compare::score::tests::{drive, truth_of};

    #[test]
    fn speeds_tell_the_offset_of_a_lively_drive() {
        let trajectory = drive(|t| 12.0 + 5.0 * (t * 0.7).sin() + 2.0 * (t * 0.23).cos());
        let mut truth = truth_of(&trajectory, 20);
        for row in &mut truth.rows {
            row.t_s += 1234.5;
        }
        truth.epoch_s = None;
        let time = base(&trajectory, &truth, None).unwrap();
        assert!((time.offset_s + 1234.5).abs() < 0.011, "{time:?}");
        assert_eq!(time.source, "speed");
        assert!(!pairs(&trajectory, &truth, &time).unwrap().is_empty());
    }

    #[test]
    fn a_steady_drive_cannot_be_told() {
        let trajectory = drive(|_| 15.0);
        let mut truth = truth_of(&trajectory, 20);
        truth.epoch_s = None;
        assert!(
            base(&trajectory, &truth, None)
                .unwrap_err()
                .to_string()
                .contains("cannot tell")
        );
    }

    #[test]
    fn stated_epochs_and_no_overlap() {
        let trajectory = drive(|_| 15.0);
        let truth = truth_of(&trajectory, 20);
        let time = base(&trajectory, &truth, Some(1_700_000_100.0)).unwrap();
        assert!((time.offset_s - 100.0).abs() < 1e-6 && time.source == "epoch");
        assert!(pairs(&trajectory, &truth, &time).is_err());
    }
}
