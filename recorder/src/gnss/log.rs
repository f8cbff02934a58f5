//! Sentences of a log, for a replay: one a line, behind a time stamp on the clock of the candump log,
//! `(1700000000.123456) $GPRMC,...`.

use schema::header::SourceLog;

use crate::can::{FrameSource, Interfaces, SourceHealth};
use crate::candump::stamp;
use crate::error::RecorderError;
use crate::log_source::{LogInput, LogSource};
use crate::nmea::{Framer, Heard};

/// The log. Memory does not depend on its length.
pub struct NmeaLog {
    source: LogSource,
    head: Option<(i64, Heard)>,
}

impl NmeaLog {
    /// Opens it.
    ///
    /// # Errors
    /// When it can not be read.
    pub fn open(input: LogInput) -> Result<Self, RecorderError> {
        let none = Interfaces::new(&[], &[])?;
        let mut log = Self {
            source: LogSource::open(input, none)?,
            head: None,
        };
        log.refill()?;
        Ok(log)
    }

    /// The next one that was received up to a time, ns, and when.
    ///
    /// # Errors
    /// When the log can not be read.
    pub fn upto(&mut self, time_ns: i64) -> Result<Option<(i64, Heard)>, RecorderError> {
        if self.head.is_none_or(|(at_ns, _)| at_ns > time_ns) {
            return Ok(None);
        }
        let head = self.head.take();
        self.refill()?;
        Ok(head)
    }

    /// The clock of the frames was set back: what was received by the clock before, between these times, will not come in
    /// its turn. Gives the next of it.
    ///
    /// # Errors
    /// When the log can not be read.
    pub fn left_behind(
        &mut self,
        after_ns: i64,
        until_ns: i64,
    ) -> Result<Option<(i64, Heard)>, RecorderError> {
        match self.head {
            Some((at_ns, _)) if at_ns > after_ns => self.upto(until_ns),
            _ => Ok(None),
        }
    }

    /// The log as the record names it.
    #[must_use]
    pub fn source_log(&self) -> SourceLog {
        self.source.source_log()
    }

    /// Lines that are none.
    #[must_use]
    pub fn health(&self) -> SourceHealth {
        self.source.health()
    }

    fn refill(&mut self) -> Result<(), RecorderError> {
        loop {
            let Some(line) = self.source.text()? else {
                return Ok(());
            };
            match sentence(line) {
                Ok(head) => {
                    self.head = Some(head);
                    return Ok(());
                }
                Err(expected) => self.source.malformed(expected, "another line"),
            }
        }
    }
}

/// Time and sentence of a line, or what was expected.
fn sentence(line: &[u8]) -> Result<(i64, Heard), &'static str> {
    let (time_ns, behind) = stamp(line).map_err(|error| error.expected)?;
    let mut framer = Framer::default();
    let rest = line.get(behind..).unwrap_or_default();
    rest.iter()
        .chain(b"\n")
        .find_map(|byte| framer.push(*byte, time_ns))
        .map(|heard| (time_ns, heard))
        .ok_or("a sentence from `$` to its checksum behind the time stamp")
}
