//! What the spool kept of a recording that was cut goes through the pipeline again, and gives the records of events
//! that were not sealed.

use std::path::Path;
use std::sync::Arc;

use schema::Record;
use schema::header::{Clock, ClockSource, Interface};

use crate::config::Settings;
use crate::error::RecorderError;
use crate::event::{Facts, interfaces};
use crate::nmea::Heard;
use crate::pipeline::Pipeline;
use crate::spool::{self, Entry, Found};
use crate::storage::Storage;

/// How a record that was read back begins the sentence on its end.
const CUT: &str = "the recording was cut (loss of power, or the recorder was killed)";

/// What such a record lacks.
const READ_BACK: &str = "this record was read back from the spool after a cut: of raw frames only those of mapped \
    messages were kept, of a satellite receiver's line only whole sentences; offsets of the interfaces' clocks, an \
    announced leap second and the self-test were not";

/// Records that are kept in memory while the spool is read: more can not be unsealed at a time unless the disk was
/// full for long.
const MOST_RECORDS: usize = 16;

/// What was found.
#[derive(Debug, Default)]
pub struct Recovered {
    /// Records of events that the spool does not know to be sealed, oldest first. Number and chain are the store's.
    pub records: Vec<Record>,
    /// Frames read.
    pub frames: u64,
    /// Time of the last entry on the line of that session, ns; UTC as far as its clock knew.
    pub last_ns: Option<i64>,
    /// The recorder was stopped on purpose.
    pub ended: bool,
    /// What could not be read, one sentence each.
    pub notes: Vec<String>,
    /// Frames are there whose settings are not: they can not be understood.
    pub unreadable: bool,
    /// The spool as found: the next session writes behind it.
    pub found: Found,
}

/// The reading pipeline and what it has been told.
struct Reader<'a> {
    storage: &'a dyn Storage,
    spool: &'a Path,
    pipeline: Option<Pipeline<'static>>,
    undecided_ns: i64,
    bundle: [u8; 32],
    /// Bundles that could not be loaded, so that each is told of once.
    failed: Vec<[u8; 32]>,
    interfaces: Vec<Interface>,
    /// First and last trigger of events that are sealed.
    sealed: Vec<(i64, i64)>,
    /// Records, with their first trigger's time on the line.
    records: Vec<(i64, Record)>,
    out: Recovered,
}

/// Reads back the newest session of a spool.
///
/// # Errors
/// When the file can not be read at all. What of it can not be used is told in the notes.
pub fn recover(storage: &dyn Storage, spool: &Path) -> Result<Recovered, RecorderError> {
    let found = spool::scan(storage, spool)?;
    let undecided = |entry: &Entry| match entry {
        Entry::Closed { at_ns } => Some(*at_ns),
        _ => None,
    };
    let undecided_ns = spool::last_of(storage, spool, &found, undecided).unwrap_or(i64::MAX);
    let mut reader = Reader {
        undecided_ns,
        storage,
        spool,
        pipeline: None,
        bundle: [0; 32],
        failed: Vec::new(),
        interfaces: Vec::new(),
        sealed: Vec::new(),
        records: Vec::new(),
        out: Recovered::default(),
    };
    spool::read_session(storage, spool, &found, &mut |entry| reader.take(entry));
    if found.missing > 0 && found.missing < found.total {
        reader.out.notes.push(format!(
            "{} of the {} blocks of the spool's last round could not be read",
            found.missing,
            found.newest().min(found.total)
        ));
    }
    let mut out = reader.finish();
    out.found = found;
    Ok(out)
}

impl Reader<'_> {
    fn take(&mut self, entry: Entry) {
        self.out.last_ns = Some(entry.time_ns().max(self.out.last_ns.unwrap_or(i64::MIN)));
        match entry {
            Entry::Session {
                at_ns,
                bundle,
                utc_offset_ns,
            } => self.settings(at_ns, &bundle, utc_offset_ns),
            Entry::Counts {
                at_ns,
                bundle,
                clock,
                uncertainty_ns,
                dropped,
                error_frames,
                utc_offset_ns,
            } => {
                self.settings(at_ns, &bundle, utc_offset_ns);
                let facts = Facts {
                    clock: Clock {
                        source: source(clock),
                        offset_ns: 0,
                        uncertainty_ns,
                        leap_second: false,
                    },
                    interfaces: self.interfaces.clone(),
                    dropped,
                    error_frames,
                    notes: Vec::new(),
                };
                if let Some(pipeline) = &mut self.pipeline {
                    pipeline.set_facts(facts);
                    // Live, time went on without frames too.
                    pipeline.tick(at_ns);
                }
                self.collect();
            }
            Entry::Sealed { first_ns, last_ns } => {
                self.sealed.push((first_ns, last_ns));
                self.forget_sealed();
            }
            Entry::End { .. } => self.out.ended = true,
            other => {
                let Some(pipeline) = &mut self.pipeline else {
                    return;
                };
                match other {
                    Entry::Frame(frame) => {
                        self.out.frames += 1;
                        pipeline.frame(&frame);
                    }
                    Entry::Trigger {
                        fired,
                        utc_offset_ns,
                    } => pipeline.known(&fired, utc_offset_ns),
                    Entry::ClockStep { at_ns, step_ns } => pipeline.clock_step(at_ns, step_ns),
                    Entry::Note { at_ns, text } => pipeline.remark(at_ns, &text),
                    Entry::Sentence { at_ns, text } => {
                        pipeline.heard(at_ns, &Heard::Sentence { at_ns, text });
                    }
                    _ => {}
                }
                self.collect();
            }
        }
    }

    /// The settings that what follows was received under.
    fn settings(&mut self, at_ns: i64, bundle: &[u8; 32], shift_ns: i64) {
        if (self.pipeline.is_some() && self.bundle == *bundle) || self.failed.contains(bundle) {
            return;
        }
        let loaded = spool::bundles::load(self.storage, self.spool, bundle)
            .and_then(|bundle| Ok(bundle.settings()?));
        let settings: Arc<Settings> = match loaded {
            Ok(settings) => Arc::new(settings),
            Err(error) => {
                self.failed.push(*bundle);
                self.out
                    .notes
                    .push(format!("the spool can not be read: {error}"));
                return;
            }
        };
        self.bundle = *bundle;
        self.interfaces = interfaces(&settings);
        match &mut self.pipeline {
            Some(pipeline) => pipeline.reconfigure(settings, at_ns),
            None => {
                self.pipeline = Some(Pipeline::recovered(settings, shift_ns, self.undecided_ns));
            }
        }
    }

    fn collect(&mut self) {
        let Some(pipeline) = &mut self.pipeline else {
            return;
        };
        while let Some(record) = pipeline.take_ready() {
            let trigger_ns = pipeline.trigger_line_ns(&record);
            self.records.push((trigger_ns, record));
            if self.records.len() > MOST_RECORDS {
                self.records.remove(0);
                self.out.notes.push(
                    "more unsealed events than can be read back: the oldest is lost".to_owned(),
                );
            }
        }
        self.forget_sealed();
    }

    fn forget_sealed(&mut self) {
        let sealed = &self.sealed;
        let known = |at: i64| {
            sealed
                .iter()
                .any(|(first, last)| (*first..=*last).contains(&at))
        };
        self.records.retain(|(trigger_ns, _)| !known(*trigger_ns));
    }

    fn finish(mut self) -> Recovered {
        if let (Some(pipeline), Some(last_ns)) = (&mut self.pipeline, self.out.last_ns) {
            pipeline.tick(last_ns);
            pipeline.settle();
            if !self.out.ended {
                pipeline.power_lost();
            }
            pipeline.cut(CUT);
        }
        self.collect();
        self.out.unreadable = !self.failed.is_empty();
        for (_, mut record) in self.records {
            record.health.notes.push(READ_BACK.to_owned());
            record.health.notes.extend(self.out.notes.iter().cloned());
            self.out.records.push(record);
        }
        self.out
    }
}

fn source(number: u8) -> ClockSource {
    match number {
        0 => ClockSource::LogStamps,
        2 => ClockSource::Disciplined,
        3 => ClockSource::Gnss,
        _ => ClockSource::SystemClock,
    }
}

/// The number that [`Entry::Counts`] gives a source of UTC.
#[must_use]
pub fn source_number(source: ClockSource) -> u8 {
    match source {
        ClockSource::LogStamps => 0,
        ClockSource::SystemClock => 1,
        ClockSource::Disciplined => 2,
        ClockSource::Gnss => 3,
    }
}
