//! Everything beyond the main figures, put together from one run's evidence.

use crate::findings::Figure;
use crate::findings::crash::Evidence;
use crate::findings::extremes::{self, Extremes};
use crate::findings::final_rest::{self, FinalRest};
use crate::findings::reaction::{self, Reaction, Reference, way};
use crate::findings::rollover::{self, RollOver};
use crate::rest::RestInterval;
use crate::smooth::Smoother;
use crate::trajectory::State;

/// Events that begin not more than this apart are one crash of several events [49 CFR 563.5], s.
pub const MULTI_EVENT_S: f64 = 5.0;

/// From the onset of one impact to that of the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Time, s.
    pub duration_s: Figure,
    /// Way along the path, m.
    pub path_m: Figure,
}

/// How much of one figure's variance comes from each source.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget {
    /// Which figure.
    pub figure: String,
    /// Unit of its spread.
    pub unit: &'static str,
    /// Its standard deviation in that unit.
    pub sd: f64,
    /// Source and its share of the variance, 0 to 1, the largest first and small ones added up; the sum is one.
    pub sources: Vec<(String, f64)>,
}

/// Paths drawn from the joint posterior of all epochs: each is one way that the car may have come.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct SamplePaths {
    /// Seconds from the trigger of each point.
    pub t_s: Vec<f64>,
    /// Of each path the places at these times, north and east of the rest, m.
    pub places: Vec<Vec<[f64; 2]>>,
}

impl SamplePaths {
    /// The points of a window of time, its ends included.
    #[must_use]
    pub fn within(mut self, from_s: f64, to_s: f64) -> Self {
        let from = self.t_s.partition_point(|t| *t < from_s - 1e-9);
        let to = self.t_s.partition_point(|t| *t <= to_s + 1e-9).max(from);
        self.t_s = self.t_s[from..to].to_vec();
        for path in &mut self.places {
            *path = path.get(from..to).unwrap_or_default().to_vec();
        }
        self
    }
}

/// The findings beyond the main figures.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Details {
    /// The last seconds before the impact.
    pub reaction: Reaction,
    /// Extremes before the first impact (or of the whole window where there was none).
    pub before: Extremes,
    /// Extremes after the first impact; `None` where there was none or the model cannot tell.
    pub after: Option<Extremes>,
    /// True where the model has no roll and pitch: it cannot tell a roll-over.
    pub no_attitude: bool,
    /// Roll-over; `None` where there was none.
    pub rollover: Option<RollOver>,
    /// Final rest; `None` where the record ends moving.
    pub final_rest: Option<FinalRest>,
    /// Between each impact and the next.
    pub intervals: Vec<Interval>,
    /// Impacts that begin within 5 s of the first one, itself included.
    pub multi_event: u32,
    /// Smoother behind the states; `None` where the model has none.
    pub smoother: Option<Smoother>,
    /// Error budgets; empty where the model gives none.
    pub budgets: Vec<Budget>,
    /// Sample paths; empty where the model gives none.
    pub paths: SamplePaths,
}

/// The details of a run; `states` are those of the whole record, `from..to` is the window of the extremes, `seconds`
/// the length of the reaction window.
#[must_use]
pub fn of(
    evidence: &Evidence<'_>,
    rest: &RestInterval,
    states: &[State],
    [from, to]: [usize; 2],
    seconds: f64,
) -> Details {
    let impacts = &evidence.motion.impacts;
    let final_rest = final_rest::of(evidence, rest, states);
    let first = impacts.first();
    let reference = match (first, &final_rest) {
        (Some(pulse), _) => {
            let onset = Figure::new(pulse.onset_s, pulse.onset_sd_s, evidence.quantile);
            Some((Reference::Impact, onset))
        }
        (None, Some(lying)) => Some((Reference::Stop, lying.stop_t_s)),
        (None, None) => None,
    };
    let reaction = reference.map_or_else(Reaction::default, |(reference, end)| Reaction {
        reference,
        rows: reaction::rows(evidence, states, seconds, &end),
        brake_unit: None,
    });
    let split = first.map_or(to, |pulse| (pulse.before + 1).clamp(from, to));
    let turned_from = first.map_or(0, |pulse| pulse.before);
    let turned_to = if rest.found() {
        rest.settled
    } else {
        evidence.snapshots.len() - 1
    };
    let turned_to = turned_to.min(evidence.snapshots.len() - 1);
    let rollover = (!evidence.wheels_only)
        .then(|| rollover::of(evidence, turned_from, turned_to))
        .flatten();
    let intervals = impacts
        .windows(2)
        .map(|pair| Interval {
            duration_s: Figure::new(
                pair[1].onset_s - pair[0].onset_s,
                pair[0].onset_sd_s.hypot(pair[1].onset_sd_s),
                evidence.quantile,
            ),
            path_m: way(states, pair[0].onset_s, pair[1].onset_s, evidence.quantile),
        })
        .collect();
    let together = first.map_or(0, |first| {
        let near = |p: &&crate::motion::Pulse| p.onset_s - first.onset_s <= MULTI_EVENT_S;
        impacts.iter().filter(near).count()
    });
    Details {
        reaction,
        before: extremes::of(evidence, from, split),
        after: first
            .filter(|_| !evidence.wheels_only)
            .map(|_| extremes::of(evidence, split, to)),
        no_attitude: evidence.wheels_only,
        rollover,
        final_rest,
        intervals,
        multi_event: u32::try_from(together).unwrap_or(u32::MAX),
        smoother: None,
        budgets: Vec::new(),
        paths: SamplePaths::default(),
    }
}
