//! One reconstruction against the truth of its simulated crash.
//!
//! Every error is estimate minus truth. The truth is seen in the reconstruction's own frame: origin at the place of the
//! record's last sample, north along the car's forward axis there, which is the rest where the record reaches it.

use schema::num::{real_i64, round_usize, usize_of};

use crate::findings::{Figure, Impact, Reconstruction};
use crate::frame::wrapped;
use crate::simulate::truth::TrueImpact;
use crate::simulate::{Simulated, TruthRow};
use crate::trajectory::State;

/// Seconds before the onset of the first impact (before rest without one) at which the states are scored.
pub const BACK_S: [f64; 5] = [30.0, 10.0, 5.0, 1.0, 0.0];
/// A found impact belongs to a true one if its onset is no farther off, s.
const SAME_IMPACT_S: f64 = 0.15;

/// Error of one scalar with the sigma that was claimed for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Estimate less truth.
    pub error: f64,
    /// Claimed sigma; `None` where the model claims none (infinite or zero).
    pub sd: Option<f64>,
    /// The claim is one-sided: the truth may be lower, higher than the value by any amount.
    pub open: [bool; 2],
}

impl Deviation {
    fn new(error: f64, sd: f64) -> Self {
        Self {
            error,
            sd: (sd.is_finite() && sd > 0.0).then_some(sd),
            open: [false; 2],
        }
    }

    fn of(figure: &Figure, error: f64) -> Self {
        Self {
            open: [
                figure.low == f64::NEG_INFINITY,
                figure.high == f64::INFINITY,
            ],
            ..Self::new(error, figure.sd)
        }
    }

    /// Squared error in units of the claimed variance; `None` without a two-sided claim.
    #[must_use]
    pub fn nees(&self) -> Option<f64> {
        let sd = self.sd.filter(|_| self.open == [false; 2])?;
        Some((self.error / sd).powi(2))
    }

    /// Whether the truth lies within `quantile` claimed sigmas, or on the open side.
    #[must_use]
    pub fn inside(&self, quantile: f64) -> Option<bool> {
        let sd = self.sd?;
        let open = if self.error > 0.0 {
            self.open[0]
        } else {
            self.open[1]
        };
        Some(open || (self.error / sd).abs() <= quantile)
    }
}

/// The states at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Distance from the true place, m.
    pub position_m: f64,
    /// Metres truly driven from here to the record's last sample.
    pub distance_m: f64,
    /// Squared position error by the inverse of its covariance (2 degrees of freedom); `None` without one.
    pub nees: Option<f64>,
    /// Long half axis of the 1-sigma ellipse, m; `None` without a covariance.
    pub axis_m: Option<f64>,
    /// Forward speed, m/s.
    pub speed: Deviation,
    /// Heading, rad, wrapped to -pi to pi.
    pub heading: Deviation,
}

/// One true impact that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpactScore {
    /// Onset, s.
    pub onset: Deviation,
    /// Forward speed at the onset, m/s.
    pub speed: Deviation,
    /// Heading at the onset, rad.
    pub heading: Deviation,
    /// Delta-V at the centre of gravity, forward, m/s.
    pub longitudinal: Deviation,
    /// To the right, m/s.
    pub lateral: Deviation,
    /// Horizontal resultant, m/s.
    pub resultant: Deviation,
    /// Principal direction of force, degrees, wrapped.
    pub pdof: Deviation,
    /// True delta-V at the centre of gravity: forward, right, resultant, m/s.
    pub truth: [f64; 3],
    /// True speed at the onset, m/s.
    pub true_speed: f64,
}

/// One crash by one model.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Moments at [`BACK_S`].
    pub moments: [Moment; 5],
    /// True impacts in order of time; `None`: not found.
    pub impacts: Vec<Option<ImpactScore>>,
    /// Impacts found that are none.
    pub false_impacts: usize,
    /// The rest was found.
    pub rest_found: bool,
}

/// Scores a reconstruction. Its states' indices are rows of the truth.
///
/// `trigger_s` is the log's time of the record's t = 0. `None` for a result without states within the truth.
#[must_use]
pub fn score(simulated: &Simulated, result: &Reconstruction, trigger_s: f64) -> Option<Score> {
    let truth = &simulated.truth;
    let last = usize_of(result.states.last()?.index);
    let base = truth.rows.get(last)?;
    let left = driven(&truth.rows, last);
    let event_s = truth.facts.trigger_at_s - trigger_s;
    let moment = |back: f64| -> Option<Moment> {
        let state = at(&result.states, event_s - back, back <= 0.0)?;
        let row = usize_of(state.index);
        Some(moment(
            state,
            truth.rows.get(row)?,
            base,
            left.get(row).copied()?,
        ))
    };
    let [a, b, c, d, e] = BACK_S.map(moment);
    let own_heading = |impact: &TrueImpact| impact.heading_deg.to_radians() - base.heading;
    let found = |true_impact: &TrueImpact| -> Option<&Impact> {
        let onset = true_impact.t_s - trigger_s;
        result
            .impacts
            .iter()
            .filter(|i| (i.t_s.value - onset).abs() <= SAME_IMPACT_S)
            .min_by(|i, j| {
                let off = |x: &Impact| (x.t_s.value - onset).abs();
                off(i).total_cmp(&off(j))
            })
    };
    let impacts: Vec<Option<ImpactScore>> = truth
        .facts
        .impacts
        .iter()
        .map(|t| found(t).map(|i| impact(i, t, t.t_s - trigger_s, own_heading(t))))
        .collect();
    let matched = impacts.iter().flatten().count();
    Some(Score {
        moments: [a?, b?, c?, d?, e?],
        impacts,
        false_impacts: result.impacts.len().saturating_sub(matched),
        rest_found: result.rest.found,
    })
}

/// Time of the record's t = 0 in the log, s.
#[must_use]
pub fn trigger_s(simulated: &Simulated, record: &schema::Record) -> f64 {
    let zero = record.triggers.first().map_or(0, |t| t.monotonic_ns);
    let utc = zero.saturating_add(record.header.clock.offset_ns);
    real_i64(utc - simulated.truth.facts.start_unix_s * 1_000_000_000) * 1e-9
}

/// The state nearest to a time; the last one at or before it if `before`.
fn at(states: &[State], t_s: f64, before: bool) -> Option<&State> {
    let after = states.partition_point(|s| s.t_s <= t_s + 1e-9);
    let earlier = after.checked_sub(1).and_then(|k| states.get(k));
    if before {
        return earlier;
    }
    match (earlier, states.get(after)) {
        (Some(a), Some(b)) if b.t_s - t_s < t_s - a.t_s => Some(b),
        (a, b) => a.or(b),
    }
}

/// Metres driven from each row to the row `last`.
fn driven(rows: &[TruthRow], last: usize) -> Vec<f64> {
    let mut left = vec![0.0; rows.len()];
    for k in (1..=last.min(rows.len().saturating_sub(1))).rev() {
        let (a, b) = (&rows[k - 1].position, &rows[k].position);
        left[k - 1] = left[k] + (b[0] - a[0]).hypot(b[1] - a[1]);
    }
    left
}

fn moment(state: &State, row: &TruthRow, base: &TruthRow, distance_m: f64) -> Moment {
    let (s, c) = base.heading.sin_cos();
    let d = [0, 1].map(|i| row.position[i] - base.position[i]);
    let north = state.position[0] - (c * d[0] + s * d[1]);
    let east = state.position[1] - (c * d[1] - s * d[0]);
    let (nn, ee, ne) = (
        state.sd_north.powi(2),
        state.sd_east.powi(2),
        state.cov_north_east,
    );
    let determinant = nn * ee - ne * ne;
    let known = nn.is_finite() && ee.is_finite() && determinant > 0.0;
    let long = f64::midpoint(nn, ee) + (0.25 * (nn - ee).powi(2) + ne * ne).sqrt();
    Moment {
        position_m: north.hypot(east),
        distance_m,
        nees: known.then(|| {
            (ee * north * north - 2.0 * ne * north * east + nn * east * east) / determinant
        }),
        axis_m: known.then(|| long.sqrt()),
        speed: Deviation::new(state.speed - row.speed, state.sd_speed),
        heading: Deviation::new(
            wrapped(state.heading - (row.heading - base.heading)),
            state.sd_heading,
        ),
    }
}

fn impact(found: &Impact, truth: &TrueImpact, onset_s: f64, heading: f64) -> ImpactScore {
    let dv = &found.delta_v;
    let own = if dv.point == "imu" {
        &truth.imu
    } else {
        &truth.cg
    };
    let off = |figure: &Figure, truth: f64| Deviation::of(figure, figure.value - truth);
    let degrees = wrapped((dv.pdof_deg.value - own.pdof_deg).to_radians()).to_degrees();
    ImpactScore {
        onset: off(&found.t_s, onset_s),
        speed: off(&found.speed_mps, truth.speed_mps),
        heading: Deviation::new(
            wrapped(found.heading_deg.value.to_radians() - heading),
            found.heading_deg.sd.to_radians(),
        ),
        longitudinal: off(&dv.longitudinal_mps, own.longitudinal_mps),
        lateral: off(&dv.lateral_mps, own.lateral_mps),
        resultant: off(&dv.resultant_mps, own.resultant_mps),
        pdof: Deviation::of(&dv.pdof_deg, degrees),
        truth: [own.longitudinal_mps, own.lateral_mps, own.resultant_mps],
        true_speed: truth.speed_mps,
    }
}

/// Row of the truth that belongs to a time of the log.
#[must_use]
pub fn row_at(rows: &[TruthRow], log_s: f64) -> Option<&TruthRow> {
    rows.get(round_usize(log_s * 100.0))
}

#[cfg(test)]
mod tests {
    use super::{BACK_S, Deviation, score, trigger_s};
    use crate::run::{Options, reconstruct};
    use crate::simulate::{Class, Grade, Scenario, simulate};
    use crate::validate::record::record;

    #[test]
    fn perfect_sensors_score_near_zero() {
        let simulated = simulate(&Scenario::draw_graded(Class::Double, 8, Grade::Perfect)).unwrap();
        let made = record(&simulated, simulated.scenario.header(), None);
        let result = reconstruct(&made, &Options::default()).unwrap();
        let found = score(&simulated, &result, trigger_s(&simulated, &made)).unwrap();
        for (moment, back) in found.moments.iter().zip(BACK_S) {
            assert!(moment.position_m < 0.5, "-{back} s: {moment:?}");
            assert!(moment.speed.error.abs() < 0.05, "-{back} s: {moment:?}");
            assert!(moment.heading.error.abs() < 0.01, "-{back} s: {moment:?}");
        }
        assert_eq!((found.impacts.len(), found.false_impacts), (2, 0));
        for impact in &found.impacts {
            let impact = impact.unwrap();
            assert!(impact.speed.error.abs() < 0.1, "{impact:?}");
            assert!(impact.heading.error.abs() < 0.02, "{impact:?}");
            assert!(impact.resultant.error.abs() < 0.2, "{impact:?}");
        }
    }

    #[test]
    fn open_bounds_hold_on_their_side() {
        let low = Deviation {
            error: -9.0,
            sd: Some(1.0),
            open: [false, true],
        };
        assert_eq!(low.inside(2.0), Some(true));
        assert_eq!(Deviation { error: 9.0, ..low }.inside(2.0), Some(false));
        assert!(low.nees().is_none());
        assert_eq!(Deviation::new(1.0, f64::INFINITY).inside(2.0), None);
    }
}
