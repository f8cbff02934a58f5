//! `recorder check`: is the configuration valid, and does each mapped signal arrive, how often, with which noise?

use std::sync::Arc;
use std::time::Duration;

use schema::Sample;
use schema::num;
use serde::Serialize;

use crate::can::SourceHealth;
use crate::clock::monotonic_ns;
use crate::config::Settings;
use crate::error::RecorderError;
use crate::event::{GROUP_NAMES, GroupState};
use crate::gnss::GnssState;
use crate::gnss::line::{Line, LineState, Told};
use crate::live::{LiveSource, Note};
use crate::moments::Moments;
use crate::pipeline::{Pipeline, Totals};
use crate::replay::{LogInput, ReplayOptions, replay};
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

/// One signal of the satellite receiver, or one kind of its sentences.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArrivalReport {
    /// Key in `[gnss]`, or the sentence's three letters.
    pub name: String,
    /// Times it came.
    pub count: u64,
    /// A second, from the first to the last; 0 where it came once.
    pub rate_hz: f64,
}

/// The satellite receiver as it arrives.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GnssReport {
    /// Device or signals.
    pub receiver: String,
    /// Fixes with a position.
    pub fixes: u64,
    /// Epochs without a fix.
    pub no_fix: u64,
    /// Each signal, or each kind of sentence that came.
    pub arrivals: Vec<ArrivalReport>,
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
    /// The satellite receiver, where one is configured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gnss: Option<GnssReport>,
    /// Sentences on what is wrong or doubtful.
    pub warnings: Vec<String>,
}

/// The settings with no trigger: a check seals nothing.
fn quiet(settings: &Settings) -> Settings {
    let mut quiet = settings.clone();
    quiet.trigger.peak = None;
    quiet.trigger.delta_v = None;
    quiet.trigger.can.clear();
    quiet
}

/// What the samples told.
struct Seen {
    limits: RestLimits,
    rest: Rest,
    noise: [Moments; 6],
    samples: u64,
    at_rest: u64,
}

impl Seen {
    fn new(settings: &Settings) -> Self {
        Self {
            limits: Rules::of(settings).rest,
            rest: Rest::default(),
            noise: [Moments::default(); 6],
            samples: 0,
            at_rest: 0,
        }
    }

    fn sample(&mut self, sample: &Sample) {
        self.samples += 1;
        self.rest = self.rest.step(sample, &self.limits);
        if !self.rest.at_rest() {
            return;
        }
        self.at_rest += 1;
        let values = sample.accel.iter().chain(&sample.rate);
        for (moments, value) in self.noise.iter_mut().zip(values) {
            if let Some(value) = value {
                moments.add(*value);
            }
        }
    }

    /// The largest noise at rest of these axes; `None` without rest.
    fn noise(&self, axes: std::ops::Range<usize>) -> Option<f64> {
        let axes = self.noise.get(axes).unwrap_or_default().iter();
        let enough = axes.filter(|moments| moments.count() > 50.0);
        enough.map(Moments::sd).reduce(f64::max)
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
    let options = ReplayOptions {
        map,
        stop_after: seconds,
        ..ReplayOptions::default()
    };
    check_with(settings, inputs, options)
}

/// As [`check`], with what a replay can be asked for: sentences of the satellite receiver, a map, an end.
///
/// # Errors
/// As [`replay`].
pub fn check_with(
    settings: &Settings,
    inputs: Vec<LogInput>,
    options: ReplayOptions<'_>,
) -> Result<CheckReport, RecorderError> {
    let mut seen = Seen::new(settings);
    let outcome = replay(
        &quiet(settings),
        inputs,
        ReplayOptions {
            map: options.map,
            stop_after: options.stop_after,
            nmea: options.nmea,
            observer: Some(Box::new(|_, sample| seen.sample(sample))),
            ..ReplayOptions::default()
        },
    )?;
    let heard = Heard {
        groups: outcome.groups,
        gnss: outcome.gnss.as_ref(),
        line: None,
    };
    Ok(report(
        settings,
        &heard,
        &outcome.totals,
        &outcome.source,
        &seen,
    ))
}

/// Listens to a live source for so many seconds.
///
/// # Errors
/// When the source fails; an interface that is down is a warning.
pub fn check_live(
    settings: &Settings,
    source: &mut dyn LiveSource,
    seconds: f64,
) -> Result<CheckReport, RecorderError> {
    let mut seen = Seen::new(settings);
    let observer = Box::new(|_: u64, sample: &Sample| seen.sample(sample));
    let mut pipeline = Pipeline::new(Arc::new(quiet(settings)), &[], Some(observer));
    let until = source
        .now_ns()
        .saturating_add(num::round_i64(seconds * 1e9));
    let mut health = SourceHealth::default();
    let device = settings.gnss.as_ref().and_then(|gnss| gnss.device());
    let line = device.map(Line::start).transpose()?;
    while source.now_ns() < until && source.open() {
        source.read(Duration::from_millis(50), &mut |frame| {
            pipeline.frame(frame);
        })?;
        let (now, clock) = (source.now_ns(), monotonic_ns());
        pipeline.tick(now);
        while let Some(told) = line.as_ref().and_then(Line::next) {
            match told {
                // That it is open is as it should be.
                Told::Note { loss: false, .. } => {}
                Told::Note { text, .. } => health.examples.push(text),
                Told::Heard(heard) => {
                    let at = match &heard {
                        crate::nmea::Heard::Sentence { at_ns, .. } => now - clock + at_ns,
                        _ => now,
                    };
                    pipeline.heard(at, &heard);
                }
            }
        }
        while let Some(note) = source.next_note() {
            match note {
                Note::ClockStep { at_ns, step_ns } => pipeline.clock_step(at_ns, step_ns),
                Note::Text { text, .. } => health.examples.push(text),
            }
        }
    }
    for interface in source.interfaces() {
        let mut warn = |count: u64, what: &str| {
            if count > 0 {
                health
                    .examples
                    .push(format!("{}: {count} {what}", interface.name));
            }
        };
        warn(interface.dropped, "frames dropped by the kernel");
        warn(interface.bus_off, "times bus-off");
        warn(interface.malformed, "datagrams that are no frame");
        warn(interface.error_frames, "error frames");
        warn(u64::from(!interface.up), "(down)");
    }
    let (groups, totals, gnss) = (pipeline.groups(), pipeline.totals(), pipeline.gnss());
    drop(pipeline);
    let heard = Heard {
        groups,
        gnss: gnss.as_ref(),
        line: line.map(|line| line.state()),
    };
    Ok(report(settings, &heard, &totals, &health, &seen))
}

/// What arrived.
struct Heard<'a> {
    groups: [GroupState; 4],
    gnss: Option<&'a GnssState>,
    line: Option<LineState>,
}

/// The satellite receiver, and what is wrong with it.
fn receiver(
    settings: &Settings,
    heard: &Heard<'_>,
    warnings: &mut Vec<String>,
) -> Option<GnssReport> {
    let (configured, state) = (settings.gnss.as_ref()?, heard.gnss?);
    let device = configured.device().is_some();
    if state.silent {
        warnings.push(
            "what the satellite receiver said was not given (--nmea), so nothing is known of it"
                .to_owned(),
        );
    } else if state.fixes == 0 {
        warnings.push("the satellite receiver had no fix".to_owned());
    }
    if heard.line.is_some_and(|line| !line.open) {
        warnings.push("the satellite receiver's device can not be opened".to_owned());
    }
    let counts = [
        (state.counts.bad_checksum, "with a wrong checksum"),
        (state.counts.malformed, "malformed"),
    ];
    for (count, what) in counts {
        if count > 0 {
            warnings.push(format!("{count} sentences {what}"));
        }
    }
    let mut arrivals = Vec::new();
    for arrival in &state.arrivals {
        // Of sentences some kinds are enough, of signals all were asked for.
        if arrival.count == 0 {
            if !device {
                warnings.push(format!("gnss.{} never arrived", arrival.name));
            }
            continue;
        }
        arrivals.push(ArrivalReport {
            name: arrival.name.clone(),
            count: arrival.count,
            rate_hz: arrival.rate_hz,
        });
    }
    Some(GnssReport {
        receiver: configured.sheet.receiver.clone(),
        fixes: state.fixes,
        no_fix: state.no_fix,
        arrivals,
    })
}

fn report(
    settings: &Settings,
    heard: &Heard<'_>,
    totals: &Totals,
    source: &SourceHealth,
    seen: &Seen,
) -> CheckReport {
    let wanted = if settings.wheels.present { 4 } else { 2 };
    let mut warnings = Vec::new();
    let mut signals = Vec::new();
    for (group, (name, state)) in GROUP_NAMES
        .iter()
        .zip(heard.groups)
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
                0 => seen.noise(0..3),
                1 => seen.noise(3..6).map(f64::to_degrees),
                _ => None,
            },
        });
    }
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
            "values outside the DBC's range (missing with range_check = true, and where they are of [gnss])",
        ),
        (source.malformed, "lines that are no frame"),
    ];
    for (count, what) in counts {
        if count > 0 {
            warnings.push(format!("{count} {what}"));
        }
    }
    warnings.extend(source.examples.iter().cloned());
    for name in &source.foreign {
        warnings.push(format!(
            "interface {name} is in the log and no bus names it"
        ));
    }
    let seconds = |samples: u64| num::real_u64(samples) / 100.0;
    let gnss = receiver(settings, heard, &mut warnings);
    CheckReport {
        seconds: seconds(seen.samples),
        rest_seconds: seconds(seen.at_rest),
        signals,
        gnss,
        warnings,
    }
}
