//! `recorder replay`: logs through the pipeline, clocked by their own time stamps.

use std::sync::Arc;

use schema::Record;
use schema::header::Origin;

use crate::can::{Frame, FrameSource, Interfaces, SourceHealth};
use crate::config::Settings;
use crate::error::RecorderError;
use crate::event::GroupState;
use crate::gnss::GnssState;
use crate::gnss::log::NmeaLog;
pub use crate::log_source::LogInput;
use crate::log_source::Merged;
use crate::pipeline::{Observer, Pipeline, Totals};

/// Called with every sealed record.
pub type Sink<'a> = Box<dyn FnMut(Record) -> Result<(), RecorderError> + 'a>;

/// What a replay is asked for beside the configuration.
#[derive(Default)]
pub struct ReplayOptions<'a> {
    /// Manual triggers, seconds from the first frame.
    pub trigger_at: Vec<f64>,
    /// Pairs (interface in the log, configured interface).
    pub map: Vec<(String, String)>,
    /// Sentences of the satellite receiver, where the configuration names its device.
    pub nmea: Option<LogInput>,
    /// Stop so many seconds after the first frame.
    pub stop_after: Option<f64>,
    /// Takes the sealed records; without one they are only counted.
    pub sink: Option<Sink<'a>>,
    /// Sees every unrounded sample with its index.
    pub observer: Option<Observer<'a>>,
}

/// What a replay found.
#[derive(Clone, Debug)]
pub struct ReplayOutcome {
    /// Records sealed.
    pub records: u64,
    /// Those that are not complete.
    pub incomplete: u64,
    /// What the pipeline saw.
    pub totals: Totals,
    /// What the logs held beside good frames.
    pub source: SourceHealth,
    /// Manual triggers beyond the log's end.
    pub triggers_left: Vec<f64>,
    /// The measured pace of each signal group: accel, rate, wheel left, wheel right.
    pub groups: [GroupState; 4],
    /// The satellite receiver; `None` where none is configured.
    pub gnss: Option<GnssState>,
}

impl ReplayOutcome {
    /// True if every record is complete and nothing was missing in the log.
    #[must_use]
    pub fn sound(&self) -> bool {
        self.incomplete == 0 && self.totals.gaps == 0
    }
}

/// Replays the logs, merged by time stamp. Memory does not depend on their length.
///
/// # Errors
/// When a log can not be read or holds no frame at all, an interface is mapped to an unknown one, or the sink
/// fails.
pub fn replay(
    settings: &Settings,
    inputs: Vec<LogInput>,
    options: ReplayOptions<'_>,
) -> Result<ReplayOutcome, RecorderError> {
    let names: Vec<String> = settings
        .buses
        .iter()
        .map(|bus| bus.interface.clone())
        .collect();
    let interfaces = Interfaces::new(&names, &options.map)?;
    let logs: Vec<String> = inputs.iter().map(LogInput::name).collect();
    let mut source = Merged::open(inputs, &interfaces)?;
    let mut pipeline = Pipeline::new(
        Arc::new(settings.clone()),
        &options.trigger_at,
        options.observer,
    );
    let device = settings.gnss.as_ref().and_then(|gnss| gnss.device());
    let mut nmea = match (device, options.nmea) {
        (Some(_), Some(input)) => Some(NmeaLog::open(input)?),
        (Some(_), None) => {
            pipeline.without_receiver();
            None
        }
        (None, Some(input)) => return Err(RecorderError::NoReceiver { log: input.name() }),
        (None, None) => None,
    };
    let mut sealed = Sealed {
        records: 0,
        incomplete: 0,
        sink: options.sink,
    };
    let mut frame = Frame::empty();
    let mut heard_until_ns = i64::MIN;
    while source.next_frame(&mut frame)? {
        if let (Some(nmea), Some(until_ns)) = (&mut nmea, pipeline.hears_until_ns()) {
            let before_ns = std::mem::replace(&mut heard_until_ns, until_ns);
            while let Some((at_ns, heard)) = nmea.left_behind(until_ns, before_ns)? {
                pipeline.heard(at_ns, &heard);
            }
            // A stamp that is garbage must not read the sentences of hours to come over.
            while let Some((at_ns, heard)) = nmea.upto(frame.time_ns.min(until_ns))? {
                pipeline.heard(at_ns, &heard);
            }
        }
        pipeline.frame(&frame);
        sealed.take(&mut pipeline, &source, nmea.as_ref())?;
        if options
            .stop_after
            .is_some_and(|seconds| pipeline.span_s() > seconds)
        {
            break;
        }
    }
    pipeline.finish();
    sealed.take(&mut pipeline, &source, nmea.as_ref())?;
    let health = source_health(&source, nmea.as_ref());
    if source.frames() == 0 {
        let example = health
            .examples
            .first()
            .map_or_else(String::new, |example| format!(" ({example})"));
        return Err(RecorderError::NoFrames {
            logs: logs.join(", "),
            example,
        });
    }
    Ok(ReplayOutcome {
        records: sealed.records,
        incomplete: sealed.incomplete,
        totals: pipeline.totals(),
        source: health,
        triggers_left: pipeline.manual_left(),
        groups: pipeline.groups(),
        gnss: pipeline.gnss(),
    })
}

/// What the logs held beside good frames and sentences.
fn source_health(source: &Merged, nmea: Option<&NmeaLog>) -> SourceHealth {
    let mut health = source.health();
    if let Some(other) = nmea.map(NmeaLog::health) {
        health.malformed += other.malformed;
        health.examples.extend(other.examples);
    }
    health
}

/// Counts sealed records and hands them on.
struct Sealed<'a> {
    records: u64,
    incomplete: u64,
    sink: Option<Sink<'a>>,
}

impl Sealed<'_> {
    fn take(
        &mut self,
        pipeline: &mut Pipeline<'_>,
        source: &Merged,
        nmea: Option<&NmeaLog>,
    ) -> Result<(), RecorderError> {
        while let Some(mut record) = pipeline.take_ready() {
            self.records += 1;
            self.incomplete += u64::from(!record.completion.complete);
            record.header.number = self.records;
            let mut logs = source.source_logs();
            logs.extend(nmea.map(NmeaLog::source_log));
            record.header.origin = Origin::Replay { logs };
            let health = source_health(source, nmea);
            record.health.malformed += health.malformed;
            record.health.notes.extend(health.examples);
            if let Some(sink) = &mut self.sink {
                sink(record)?;
            }
        }
        Ok(())
    }
}
