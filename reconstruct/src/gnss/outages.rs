//! The experiments of [S00, 3.7 and 3.8] on a drive with a reference: fixes are withheld for several lengths of time, and both
//! filters are measured against the reference.

use nalgebra::Vector3;
use schema::num::real;

use super::drive::{Drive, Speed};
use super::experiments::{Experiment, ExperimentError};
use super::forward::{Estimate, Start};
use super::plausible;
use super::published::constants::{GATE, GYRO_BIAS};
use super::published::{GnssFix, Initial, Input, Variant};
use super::reference::{Reference, Second, before, compare};
use super::sheet::Sheet;
use super::trial::{Trial, ours_smoothed, standing};

/// Least length of a window with fixes, and length of one without, s [S00, 3.7 and 3.8].
const LENGTHS_S: [f64; 2] = [30.0, 120.0];
/// Fixes each second before the first window, and between two without fixes, s.
const RUN_IN_S: [f64; 2] = [20.0, 30.0];

/// What a study takes.
#[derive(Clone, Copy, Debug)]
pub struct Material<'a> {
    /// The drive with all its fixes.
    pub whole: &'a Drive,
    /// The same as the published filter takes it.
    pub input: &'a Input,
    /// Noise of the drive.
    pub known: &'a Sheet,
    /// Reference receiver.
    pub reference: &'a Reference,
    /// Delay of the fixes, s.
    pub latency_s: f64,
}

/// One filter in one experiment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Deviations at the reference's marks in the windows, window by window.
    pub seconds: Vec<Vec<Second>>,
    /// Deviations just before the ends of the outages, m; missing where the reference is not known there.
    pub ends: Vec<f64>,
}

/// A mean with what it rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// Values.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// Standard error of the mean; infinite of one value.
    pub error: f64,
    /// The largest.
    pub largest: f64,
}

impl Mean {
    /// Of values; `None` of none.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let found = crate::validate::statistics::mean(values)?;
        Some(Self {
            count: values.len(),
            mean: found.value,
            error: (found.high - found.value) / crate::stats::two_sided_quantile(0.95),
            largest: values.iter().copied().fold(0.0, f64::max),
        })
    }
}

impl Curve {
    fn of(
        tracks: &[&[Estimate]],
        trial: &Trial<'_>,
        outages: &[[f64; 2]],
        m: &Material<'_>,
    ) -> Self {
        let mut out = Self::default();
        let all: Vec<Vec<Second>> = tracks.iter().map(|t| compare(t, m.reference)).collect();
        for (i, [begin, end]) in trial.windows.iter().enumerate() {
            let list = all.get(i).or(all.first()).map_or(&[][..], Vec::as_slice);
            let within = |s: &&Second| s.t_s > begin + 0.01 && s.t_s < end + 0.01;
            out.seconds
                .push(list.iter().filter(within).copied().collect());
        }
        for [_, end] in outages {
            let i = trial
                .windows
                .partition_point(|w| w[0] < end - 1e-3)
                .saturating_sub(1);
            let track = tracks.get(i).or(tracks.first()).copied().unwrap_or(&[]);
            out.ends
                .extend(before(track, m.reference, *end).map(|s| s.off_m));
        }
        out
    }

    /// Deviations at the ends of the outages.
    #[must_use]
    pub fn at_ends(&self) -> Option<Mean> {
        Mean::of(&self.ends)
    }

    /// Largest deviations of the windows.
    #[must_use]
    pub fn at_worst(&self) -> Option<Mean> {
        let most = |list: &Vec<Second>| list.iter().map(|s| s.off_m).reduce(f64::max);
        Mean::of(&self.seconds.iter().filter_map(most).collect::<Vec<f64>>())
    }

    /// Share of the seconds at which the reference lies in the ellipse of 95 %, its standard error over windows (seconds of
    /// one belong together; infinite of one window), and the seconds.
    #[must_use]
    pub fn inside(&self) -> Option<(f64, f64, usize)> {
        let counts: Vec<(f64, f64)> = self
            .seconds
            .iter()
            .filter(|list| !list.is_empty())
            .map(|list| {
                let held = list.iter().filter(|s| s.inside).count();
                (real(held), real(list.len()))
            })
            .collect();
        let n: f64 = counts.iter().map(|c| c.1).sum();
        if n < 1.0 {
            return None;
        }
        let share = counts.iter().map(|c| c.0).sum::<f64>() / n;
        let k = real(counts.len());
        let off: f64 = counts.iter().map(|(h, n)| (h - share * n).powi(2)).sum();
        let error = if counts.len() > 1 {
            (off * k / (k - 1.0)).sqrt() / n
        } else {
            f64::INFINITY
        };
        Some((share, error, schema::num::round_usize(n)))
    }
}

/// One experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Which.
    pub experiment: Experiment,
    /// Its windows, s.
    pub windows: Vec<[f64; 2]>,
    /// Spans in them without fixes, s.
    pub outages: Vec<[f64; 2]>,
    /// The published filter as its program is.
    pub published: Option<Curve>,
    /// Ours, running.
    pub ours: Option<Curve>,
    /// Ours, smoothed.
    pub smoothed: Option<Curve>,
}

/// All of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Study {
    /// Those that the drive is long enough for.
    pub rows: Vec<Row>,
    /// Why others are missing, and what else was in the way.
    pub notes: Vec<String>,
}

/// Runs the experiments; `wanted` are published filter and ours.
///
/// # Errors
/// [`ExperimentError`] where our filter fails, or no fix moves; where the published one does, the row says so in a note.
pub fn study(
    m: &Material<'_>,
    experiments: &[Experiment],
    wanted: [bool; 2],
) -> Result<Study, ExperimentError> {
    let still = standing(m.whole);
    let start = Start::at_first_course(m.whole, &still)?;
    let begin = m.whole.periods[start.first].t_s;
    let speeds = m.reference.speeds();
    let mut out = Study::default();
    for experiment in experiments.iter().copied() {
        let windows = windows(m, experiment, begin);
        let missing = |why: String| format!("{}: {why}", experiment.name());
        if windows.is_empty() {
            let end = m.whole.fixes.last().map_or(begin, |f| f.t_s);
            out.notes.push(missing(format!(
                "not done: expected {:.0} s with reference after a moving fix and {:.0} s from the start, found a drive of {:.0} s from there",
                window_s(experiment), RUN_IN_S[0], (end - begin).max(0.0) + 0.0
            )));
            continue;
        }
        if experiment == Experiment::ExactSpeed && speeds.is_empty() {
            out.notes
                .push(missing("not done: the reference has no speed".to_owned()));
            continue;
        }
        let row = row(
            m,
            experiment,
            windows,
            &speeds,
            &still,
            wanted,
            &mut out.notes,
        )?;
        out.rows.push(row);
    }
    Ok(out)
}

fn row(
    m: &Material<'_>,
    experiment: Experiment,
    windows: Vec<[f64; 2]>,
    speeds: &[Speed],
    still: &[bool],
    wanted: [bool; 2],
    notes: &mut Vec<String>,
) -> Result<Row, ExperimentError> {
    let trial = Trial {
        experiment,
        windows: &windows,
        speeds,
    };
    let outages = trial.outages(&m.whole.fixes);
    let mut published = None;
    if wanted[0] {
        let mut tracks: Vec<Vec<Estimate>> = Vec::new();
        for (i, [begin, _]) in windows.iter().enumerate() {
            let bias = bias(m.whole, still, *begin);
            let start = |fix: &GnssFix| {
                let near = m.reference.near(fix.t_s - m.latency_s, 0.6);
                let v = near.and_then(|mark| mark.v_n).unwrap_or(fix.v_ned);
                Initial {
                    bias,
                    ..Initial::from_reference(fix, &v)
                }
            };
            let found = trial.published(i, m.input, m.latency_s, &start, Variant::program());
            tracks.push(found.unwrap_or_else(|error| {
                notes.push(format!(
                    "{}: published filter, window from {begin:.1} s: {error}",
                    experiment.name()
                ));
                Vec::new()
            }));
        }
        let tracks: Vec<&[Estimate]> = tracks.iter().map(Vec::as_slice).collect();
        published = Some(Curve::of(&tracks, &trial, &outages, m));
    }
    let (mut running, mut smoothed) = (None, None);
    if wanted[1] {
        let (passed, later) = ours_smoothed(&trial.withheld(m.whole), m.known, None)?;
        let refused = plausible::refused(&passed.fixes);
        notes.extend(
            refused
                .iter()
                .map(|n| format!("{}: {n}", experiment.name())),
        );
        running = Some(Curve::of(&[&passed.estimates], &trial, &outages, m));
        smoothed = Some(Curve::of(&[&later], &trial, &outages, m));
    }
    Ok(Row {
        experiment,
        outages,
        published,
        ours: running,
        smoothed,
        windows,
    })
}

fn window_s(experiment: Experiment) -> f64 {
    match experiment {
        Experiment::Every(n) => {
            let n = real(n.max(1));
            n * (LENGTHS_S[0] / n).ceil()
        }
        Experiment::Blind | Experiment::ExactSpeed => LENGTHS_S[1],
    }
}

/// Windows from fixes that move, one after the other while fixes and reference last.
fn windows(m: &Material<'_>, experiment: Experiment, begin: f64) -> Vec<[f64; 2]> {
    let length = window_s(experiment);
    let pause = match experiment {
        Experiment::Every(_) => 0.0,
        Experiment::Blind | Experiment::ExactSpeed => RUN_IN_S[1],
    };
    let last = |t: f64| m.whole.fixes.last().map_or(t, |f| f.t_s);
    let known = m
        .reference
        .marks
        .last()
        .map_or(f64::NEG_INFINITY, |r| r.t_s);
    let mut free = begin + RUN_IN_S[0];
    let mut out = Vec::new();
    for fix in &m.whole.fixes {
        let moves = fix.v_n.is_some_and(|v| v.norm() > GATE);
        let end = fix.t_s + length;
        let room = end <= last(end).min(known) + 0.05;
        if fix.t_s >= free - 1e-6 && moves && room && m.reference.near(fix.t_s, 1.0).is_some() {
            out.push([fix.t_s, end]);
            free = end + pause;
        }
    }
    out
}

/// Gyro bias that the published filter is told: the mean of the stands before `t_s`, else of all, rad/s; where the car never
/// stands, that of its program.
fn bias(drive: &Drive, still: &[bool], t_s: f64) -> Vector3<f64> {
    let mean = |until: f64| {
        let list = drive.periods.iter().zip(still);
        let rates: Vec<Vector3<f64>> = list
            .filter(|(p, s)| **s && p.t_s < until)
            .map(|(p, _)| p.rate)
            .collect();
        (rates.len() > 25).then(|| rates.iter().sum::<Vector3<f64>>() / real(rates.len()))
    };
    mean(t_s)
        .or_else(|| mean(f64::INFINITY))
        .unwrap_or_else(|| Vector3::from(GYRO_BIAS))
}
