//! `recorder check`: is the configuration valid, and does each mapped signal arrive, how often, with which noise?

use schema::Sample;
use schema::num;
use serde::Serialize;

use crate::config::Settings;
use crate::error::RecorderError;
use crate::event::GROUP_NAMES;
use crate::replay::{LogInput, ReplayOptions, ReplayOutcome, replay};
use crate::rest::{Rest, RestLimits};
use crate::trigger::Rules;

/// One signal group as it arrives.
#[derive(Clone, Debug, Serialize)]
pub struct GroupReport {
    /// `accel`, `rate`, `wheel-left`, `wheel-right`.
    pub signal: String,
    /// It arrived.
    pub arrives: bool,
    /// Frames a second, by the fitted period; 0 if it never arrived.
    pub rate_hz: f64,
    /// Standard deviation of the receive times about the fitted time line, ms.
    pub jitter_ms: f64,
    /// Standard deviation of the 10 ms samples at rest, largest of the axes (m/s^2, deg/s); `None` without rest.
    pub noise_at_rest: Option<f64>,
}

/// What a check found.
#[derive(Clone, Debug, Serialize)]
pub struct CheckReport {
    /// Seconds of log that were looked at.
    pub seconds: f64,
    /// Seconds of them at rest.
    pub rest_seconds: f64,
    /// The signal groups.
    pub signals: Vec<GroupReport>,
    /// Sentences on what is wrong or doubtful.
    pub warnings: Vec<String>,
}

/// Sums over the samples at rest.
#[derive(Clone, Copy, Default)]
struct Noise {
    count: [f64; 6],
    mean: [f64; 6],
    square: [f64; 6],
}

impl Noise {
    fn add(&mut self, sample: &Sample) {
        let sums = self
            .count
            .iter_mut()
            .zip(&mut self.mean)
            .zip(&mut self.square);
        for (((count, mean), square), value) in sums.zip(sample.accel.iter().chain(&sample.rate)) {
            if let Some(value) = value {
                // Welford's update keeps its digits where the mean is large.
                *count += 1.0;
                let off = value - *mean;
                *mean += off / *count;
                *square += off * (value - *mean);
            }
        }
    }

    fn largest(&self, axes: std::ops::Range<usize>) -> Option<f64> {
        let sds = axes.filter_map(|axis| {
            let (count, square) = (self.count.get(axis)?, self.square.get(axis)?);
            (*count > 50.0).then(|| (square / (count - 1.0)).sqrt())
        });
        sds.reduce(f64::max)
    }
}

/// Runs the logs through the pipeline without sealing anything; looks at the first `seconds` if given.
///
/// # Errors
/// As [`replay`].
pub fn check(
    settings: &Settings,
    inputs: Vec<LogInput>,
    map: Vec<(String, String)>,
    seconds: Option<f64>,
) -> Result<CheckReport, RecorderError> {
    let mut quiet = settings.clone();
    quiet.trigger.peak = None;
    quiet.trigger.delta_v = None;
    quiet.trigger.can.clear();
    let limits: RestLimits = Rules::of(settings).rest;
    let (mut rest, mut noise, mut at_rest, mut seen) =
        (Rest::default(), Noise::default(), 0_u64, 0_u64);
    let outcome = {
        let observer = Box::new(|_: u64, sample: &Sample| {
            seen += 1;
            rest = rest.step(sample, &limits);
            if rest.at_rest() {
                at_rest += 1;
                noise.add(sample);
            }
        });
        replay(
            &quiet,
            inputs,
            ReplayOptions {
                map,
                stop_after: seconds,
                observer: Some(observer),
                ..ReplayOptions::default()
            },
        )?
    };
    Ok(report(settings, &outcome, &noise, seen, at_rest))
}

fn report(
    settings: &Settings,
    outcome: &ReplayOutcome,
    noise: &Noise,
    seen: u64,
    at_rest: u64,
) -> CheckReport {
    let wanted = if settings.wheels.present { 4 } else { 2 };
    let mut warnings = Vec::new();
    let mut signals = Vec::new();
    for (group, (name, state)) in GROUP_NAMES
        .iter()
        .zip(outcome.groups)
        .enumerate()
        .take(wanted)
    {
        let arrives = state.last_ns.is_some();
        if !arrives {
            warnings.push(format!("{name} never arrived"));
        }
        signals.push(GroupReport {
            signal: (*name).to_owned(),
            arrives,
            rate_hz: if state.period > 0.0 {
                1e9 / state.period
            } else {
                0.0
            },
            jitter_ms: state.jitter / 1e6,
            noise_at_rest: match group {
                0 => noise.largest(0..3),
                1 => noise.largest(3..6).map(f64::to_degrees),
                _ => None,
            },
        });
    }
    let totals = &outcome.totals;
    let counts = [
        (totals.gaps, "gaps of a mapped signal"),
        (totals.clock_steps, "steps of the clock"),
        (totals.late, "late or stray frames"),
        (totals.error_frames, "error frames"),
        (
            totals.decode.too_short,
            "frames too short for a mapped signal",
        ),
        (totals.decode.not_finite, "values that are not finite"),
        (
            totals.decode.out_of_range,
            "values outside the DBC's range (missing only with range_check = true)",
        ),
        (outcome.source.malformed, "lines that are no frame"),
    ];
    for (count, what) in counts {
        if count > 0 {
            warnings.push(format!("{count} {what}"));
        }
    }
    warnings.extend(outcome.source.examples.iter().cloned());
    for name in &outcome.source.foreign {
        warnings.push(format!(
            "interface {name} is in the log and no bus names it"
        ));
    }
    let seconds = |samples: u64| num::real_u64(samples) / 100.0;
    CheckReport {
        seconds: seconds(seen),
        rest_seconds: seconds(at_rest),
        signals,
        warnings,
    }
}
