//! The inertial log cut into stretches without a hole, and what the car did in them: rest, stop, drive.
//!
//! The stop detector ([`crate::gnss::stop`]) tells where the box stands still; the last second before it notices motion is
//! left out. Rest (engine off) and stop (engine on) differ by the level of vibration: where the stands of a log fall into two groups whose levels
//! lie apart by [`APART`] or more, the quieter is rest. Spans of rest that the user gives go before. A log in which the box is
//! laid on different sides, or never moves, is a bench log: all its stands are rest.

use nalgebra::Vector3;
use schema::num::real;

use crate::gnss::drive::{Drive, Fixed};
use crate::gnss::logs::{self, Axes};
use crate::gnss::rows::{Fix, Leg, Motion};
use crate::gnss::sheet::Sheet;
use crate::gnss::stop::Detector;

/// A stretch of the log ends where no sample came for more than this many periods.
const HOLE_PERIODS: f64 = 1.6;
/// Longest stretch bridged for the detector, s: that of [`Drive::new`].
const BRIDGED_S: f64 = 5.0;
/// Shortest stand looked at, s.
pub const SHORTEST_S: f64 = 2.0;
/// A stand begins so long before the detector notices it (it has heard a second by then, and the springs still settle), and ends so long
/// before it notices the end, s.
const TRIMMED_S: [f64; 2] = [-0.5, 1.0];
/// Ratio of the vibration's variances that makes two kinds of stands; of S00 it is 29 [S00, table 4.5].
pub const APART: f64 = 6.0;
/// Stands whose specific forces lie this far apart in direction, rad, are not those of a car.
const TURNED: f64 = 0.7;
/// Speed above which a fix says that the car drives, m/s.
const DRIVES: f64 = 1.0;
/// Age up to which a fix says so, s.
const AGE_S: f64 = 1.6;

/// A sample in the sensor's own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Line in the file, from 1.
    pub line: u64,
    /// s of the box's clock.
    pub t_s: f64,
    /// Specific force, m/s^2, then rate, rad/s, x, y, z each.
    pub axis: [f64; 6],
    /// Rate about the car's down axis, as far as the mounting is known, rad/s.
    pub turn: f64,
    /// True within a stand.
    pub still: bool,
    /// True where the car drives for certain: no stand near, and the nearest fix, if there is one, moves.
    pub driving: bool,
    /// True if samples before this one are missing.
    pub gap: bool,
}

/// The samples of a leg, in order of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// Leg.
    pub leg: Leg,
    /// Samples.
    pub samples: Vec<Sample>,
    /// Median step of the stamps, s.
    pub period_s: f64,
}

/// What the box did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Situation {
    /// Lies still, the engine off.
    Rest,
    /// Stands with the engine on.
    Stop,
    /// Drives straight ahead.
    Straight,
    /// Drives.
    Driving,
}

impl Situation {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Rest, Self::Stop, Self::Straight, Self::Driving];

    /// Name for a table.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rest => "at rest, engine off",
            Self::Stop => "stop, engine on",
            Self::Straight => "driving straight ahead",
            Self::Driving => "driving",
        }
    }
}

/// A stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    /// Stretch, an index.
    pub stretch: usize,
    /// First sample, and the one after the last.
    pub range: std::ops::Range<usize>,
    /// Begin, s of the box's clock.
    pub from_s: f64,
    /// End, s.
    pub to_s: f64,
    /// Variance of the specific force, the three axes together, half the mean square of the steps, (m/s^2)^2.
    pub level: f64,
    /// Mean specific force, the sensor's axes, m/s^2.
    pub force: [f64; 3],
    /// Rest or stop.
    pub situation: Situation,
}

/// The log, cut.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Spans {
    /// Stretches.
    pub stretches: Vec<Stretch>,
    /// Stands, in order of the log.
    pub stands: Vec<Stand>,
    /// How rest was told from stop, a sentence.
    pub told_by: String,
    /// True of a bench log.
    pub bench: bool,
    /// What is unsure about the cutting, sentences.
    pub notes: Vec<String>,
}

impl Spans {
    /// Samples of a stand.
    #[must_use]
    pub fn of(&self, stand: &Stand) -> &[Sample] {
        self.stretches
            .get(stand.stretch)
            .and_then(|s| s.samples.get(stand.range.clone()))
            .unwrap_or_default()
    }

    /// Cuts the log. `motions` with their lines, by leg and stamp; `fixes` of any equipment, `latency_s` late; `rest` spans
    /// that the user calls rest, s of the box's clock.
    #[must_use]
    pub fn cut(
        motions: &[(u64, Motion)],
        fixes: &[Fix],
        axes: &Axes,
        latency_s: f64,
        rest: &[[f64; 2]],
    ) -> Self {
        let mut spans = Self::default();
        let mut repeats = 0;
        let mut unheard = false;
        for leg in motions.chunk_by(|a, b| a.1.head.leg == b.1.head.leg) {
            let Some((_, first)) = leg.first() else {
                continue;
            };
            let id = first.head.leg;
            let heard = fixes_of(fixes, id, latency_s);
            unheard |= heard.is_empty();
            let mut rows: Vec<(u64, Motion)> = Vec::with_capacity(leg.len());
            for row in leg {
                if rows
                    .last()
                    .is_none_or(|l| row.1.head.obu_s > l.1.head.obu_s)
                {
                    rows.push(*row);
                } else {
                    repeats += 1;
                }
            }
            for rows in rows.chunk_by(|a, b| b.1.head.obu_s - a.1.head.obu_s <= BRIDGED_S) {
                if let Some(stretch) = stretch(id, rows, &heard, axes) {
                    spans.stretches.push(stretch);
                }
            }
        }
        if repeats > 0 {
            spans.notes.push(format!(
                "{repeats} inertial samples with the stamp of another are left out."
            ));
        }
        spans.stand(rest);
        for [from, to] in rest {
            let met = |s: &Stand| s.from_s <= *to && s.to_s >= *from;
            if !spans.stands.iter().any(met) {
                spans.notes.push(format!(
                    "--rest {from}..{to}: expected two seconds of samples in it, found fewer; it is not used."
                ));
            }
        }
        spans.tell(rest);
        if unheard && !spans.bench && !spans.stretches.is_empty() {
            spans.notes.push(
                "Without fixes, standing and driving are told by vibration alone: a smooth slow drive may pass for a stop."
                    .to_owned(),
            );
        }
        spans
    }

    /// Finds the stands.
    fn stand(&mut self, rest: &[[f64; 2]]) {
        let mut stands = Vec::new();
        for (index, stretch) in self.stretches.iter_mut().enumerate() {
            let given = |t: f64| rest.iter().position(|[from, to]| t >= *from && t <= *to);
            // A stand of one kind: the user's span by its number, or the detector's.
            let kind = |s: &Sample| {
                given(s.t_s).map_or(if s.still { -1 } else { -2 }, |i| {
                    i64::try_from(i).unwrap_or(0)
                })
            };
            let kinds: Vec<i64> = stretch.samples.iter().map(kind).collect();
            let mut k = 0;
            while k < kinds.len() {
                let mut end = k + 1;
                while end < kinds.len() && kinds[end] == kinds[k] && !stretch.samples[end].gap {
                    end += 1;
                }
                if kinds[k] > -2
                    && let Some(stand) = stand(index, stretch, k..end, kinds[k] >= 0)
                {
                    stands.push(stand);
                }
                k = end;
            }
            for (sample, kind) in stretch.samples.iter_mut().zip(kinds) {
                sample.still = kind > -2;
                sample.driving &= kind == -2;
            }
        }
        self.stands = stands;
    }

    /// Tells rest from stop.
    fn tell(&mut self, rest: &[[f64; 2]]) {
        let far =
            |a: &Stand, b: &Stand| Vector3::from(a.force).angle(&Vector3::from(b.force)) > TURNED;
        let turned = self
            .stands
            .iter()
            .any(|a| self.stands.first().is_some_and(|b| far(a, b)));
        let moves = self.stretches.iter().any(|s| {
            let moving = s.samples.iter().filter(|s| s.driving).count();
            real(moving) * s.period_s > 2.0
        });
        self.bench = !self.stands.is_empty() && (turned || !moves);
        if self.bench {
            // What moves there is a hand.
            for sample in self.stretches.iter_mut().flat_map(|s| &mut s.samples) {
                sample.driving = false;
            }
        }
        if !rest.is_empty() {
            "Rest is what --rest gives; every other stand counts as a stop."
                .clone_into(&mut self.told_by);
            return;
        }
        if self.bench {
            for stand in &mut self.stands {
                stand.situation = Situation::Rest;
            }
            if turned {
                "The box was laid on different sides: a bench log, all of its stands are rest."
            } else {
                "The box never moves: all of it is taken for rest; an engine that ran would be in it."
            }
            .clone_into(&mut self.told_by);
            return;
        }
        let mut levels: Vec<f64> = self.stands.iter().map(|s| s.level.max(1e-12)).collect();
        levels.sort_by(f64::total_cmp);
        let widest = levels
            .windows(2)
            .map(|w| (w[1] / w[0], (w[0] * w[1]).sqrt()))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match widest.filter(|(ratio, _)| *ratio >= APART) {
            Some((ratio, border)) => {
                for stand in &mut self.stands {
                    if stand.level < border {
                        stand.situation = Situation::Rest;
                    }
                }
                self.told_by = format!(
                    "The stands vibrate at two levels a factor of {ratio:.0} apart (variance of the specific force): the quieter, below {border:.2e} (m/s^2)^2, are taken for rest."
                );
            }
            None if self.stands.is_empty() => {}
            None if self.stands.len() == 1 => {
                "Cannot tell rest from stop: there is one stand only. It counts as a stop; --rest FROM..TO names spans with the engine off."
                    .clone_into(&mut self.told_by);
            }
            None => {
                "Cannot tell rest from stop: all stands vibrate alike. They count as stops; --rest FROM..TO names spans with the engine off."
                    .clone_into(&mut self.told_by);
            }
        }
    }
}

/// Good fixes of the leg, or of the only leg there is.
fn fixes_of(fixes: &[Fix], leg: Leg, latency_s: f64) -> Vec<Fixed> {
    let own: Vec<Fix> = fixes
        .iter()
        .filter(|f| f.head.leg == leg)
        .copied()
        .collect();
    let one = fixes.chunk_by(|a, b| a.head.leg == b.head.leg).count() == 1;
    let chosen: &[Fix] = if own.is_empty() && one { fixes } else { &own };
    // What rolls into a stand would be in its variance: rather fewer stands than such.
    let sheet = Sheet {
        fix_speed_floor: Vector3::repeat(STRICT_SPEED_SD),
        ..Sheet::default()
    };
    logs::fixes(chosen, latency_s, &sheet)
}

/// Spread that the detector takes the velocity of a fix to have, m/s.
const STRICT_SPEED_SD: f64 = 0.2;

/// Samples of rows without a long hole; `None` of fewer than two, which have no period.
fn stretch(leg: Leg, rows: &[(u64, Motion)], fixes: &[Fixed], axes: &Axes) -> Option<Stretch> {
    let motions: Vec<Motion> = rows.iter().map(|r| r.1).collect();
    let drive = logs::drive(&motions, axes, fixes.to_vec(), Vec::new()).ok()?;
    let mut steps: Vec<f64> = motions
        .windows(2)
        .map(|w| w[1].head.obu_s - w[0].head.obu_s)
        .collect();
    steps.sort_by(f64::total_cmp);
    let period_s = *steps.get(steps.len() / 2)?;
    let found = Detector::default().detect(&drive);
    let [entry, exit] = TRIMMED_S;
    let inside = Detector::hindsight(&drive, &found, entry, exit);
    // What drives for certain: not within a second of what was called a stand.
    let near = Detector::hindsight(&drive, &found, 2.0, -1.0);
    let measured = drive.periods.iter().enumerate().filter(|(_, p)| p.measured);
    let mut before = None::<f64>;
    let samples = measured
        .zip(rows)
        .map(|((k, period), (line, row))| {
            let t_s = row.head.obu_s;
            let gap = before.is_some_and(|b| t_s - b > HOLE_PERIODS * period_s);
            before = Some(t_s);
            let [x, y, z] = row.accel;
            let [p, q, r] = row.rate;
            Sample {
                line: *line,
                t_s,
                axis: [x, y, z, p, q, r],
                turn: period.rate.z,
                still: inside.get(k).copied().unwrap_or(false),
                driving: !near.get(k).copied().unwrap_or(false)
                    && speed_near(&drive, t_s).is_none_or(|v| v > DRIVES),
                gap,
            }
        })
        .collect();
    Some(Stretch {
        leg,
        samples,
        period_s,
    })
}

/// Speed of the nearest fix, m/s; `None` where none is near.
fn speed_near(drive: &Drive, t_s: f64) -> Option<f64> {
    let at = drive.fixes.partition_point(|f| f.t_s < t_s);
    let near = [at.checked_sub(1)?, at]
        .into_iter()
        .filter_map(|i| drive.fixes.get(i))
        .filter(|f| (f.t_s - t_s).abs() < AGE_S);
    near.filter_map(|f| f.v_n.map(|v| v.xy().norm()))
        .min_by(f64::total_cmp)
}

fn stand(
    index: usize,
    stretch: &Stretch,
    range: std::ops::Range<usize>,
    given: bool,
) -> Option<Stand> {
    let samples = stretch.samples.get(range.clone())?;
    let (from_s, to_s) = (samples.first()?.t_s, samples.last()?.t_s);
    if to_s - from_s < SHORTEST_S || samples.len() < 10 {
        return None;
    }
    let n = real(samples.len());
    let force = [0, 1, 2].map(|i| samples.iter().map(|s| s.axis[i]).sum::<f64>() / n);
    let steps: f64 = samples
        .windows(2)
        .map(|w| {
            (0..3)
                .map(|i| (w[1].axis[i] - w[0].axis[i]).powi(2))
                .sum::<f64>()
        })
        .sum();
    Some(Stand {
        stretch: index,
        range,
        from_s,
        to_s,
        level: 0.5 * steps / (n - 1.0),
        force,
        situation: if given {
            Situation::Rest
        } else {
            Situation::Stop
        },
    })
}
