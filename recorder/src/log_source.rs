//! candump logs as a source of frames: bounded lines, several logs merged by time, digests of what was read.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use schema::header::SourceLog;
use schema::num;
use sha2::{Digest, Sha256};

use crate::can::{Frame, FrameSource, Interfaces, SourceHealth};
use crate::candump::parse;
use crate::error::RecorderError;

/// Bytes read at a time.
const CHUNK: usize = 1 << 18;
/// Longest line that can be a frame: CAN FD with 64 bytes takes some 200.
const LONGEST_LINE: usize = 512;
/// Malformed lines that are reported one by one.
const EXAMPLES: usize = 5;
/// Foreign interfaces that are listed.
const MOST_FOREIGN: usize = 32;

/// A log to be replayed.
pub enum LogInput {
    /// A file.
    File(PathBuf),
    /// Anything that can be read once, with the name the record is to give (`-` for standard input).
    Reader(String, Box<dyn Read>),
}

impl LogInput {
    /// The name the record gives.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.file_name().map_or_else(
                || path.display().to_string(),
                |name| name.to_string_lossy().into_owned(),
            ),
            Self::Reader(name, _) => name.clone(),
        }
    }
}

/// Digest of what was or will be read.
enum Origin {
    /// The whole file, digested before.
    Whole(SourceLog),
    /// What has been read so far.
    Running {
        name: String,
        bytes: u64,
        hash: Sha256,
    },
}

/// One log.
pub struct LogSource {
    name: String,
    path: PathBuf,
    reader: Box<dyn Read>,
    origin: Origin,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    at_end: bool,
    line: u64,
    skipping: bool,
    frames: u64,
    health: SourceHealth,
    interfaces: Interfaces,
    /// The last interface name and what it stands for: nearly always the next one too.
    last: (Vec<u8>, Option<u8>),
}

impl LogSource {
    /// Opens a log; a file is read once for its digest first.
    ///
    /// # Errors
    /// When the file can not be read.
    pub fn open(input: LogInput, interfaces: Interfaces) -> Result<Self, RecorderError> {
        let name = input.name();
        let (path, reader, origin): (_, Box<dyn Read>, _) = match input {
            LogInput::File(path) => {
                let origin = Origin::Whole(digest(&path, &name)?);
                let file = File::open(&path).map_err(RecorderError::io(&path, "open the log"))?;
                (path, Box::new(file), origin)
            }
            LogInput::Reader(name, reader) => (
                PathBuf::from(&name),
                reader,
                Origin::Running {
                    name,
                    bytes: 0,
                    hash: Sha256::new(),
                },
            ),
        };
        Ok(Self {
            name,
            path,
            reader,
            origin,
            buffer: vec![0; CHUNK],
            start: 0,
            end: 0,
            at_end: false,
            line: 0,
            skipping: false,
            frames: 0,
            health: SourceHealth::default(),
            interfaces,
            last: (Vec::new(), None),
        })
    }

    /// The log as the record names it.
    #[must_use]
    pub fn source_log(&self) -> SourceLog {
        match &self.origin {
            Origin::Whole(log) => log.clone(),
            Origin::Running { name, bytes, hash } => SourceLog {
                name: name.clone(),
                bytes: *bytes,
                sha256: hash.clone().finalize().into(),
            },
        }
    }

    /// Good frames so far.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Reads more behind what is there; the rest of a line is moved to the front.
    fn fill(&mut self) -> Result<(), RecorderError> {
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        let free = self.buffer.get_mut(self.end..).unwrap_or_default();
        let read = loop {
            match self.reader.read(free) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                other => break other.map_err(RecorderError::io(&self.path, "read the log"))?,
            }
        };
        if let (Origin::Running { bytes, hash, .. }, Some(new)) =
            (&mut self.origin, self.buffer.get(self.end..self.end + read))
        {
            hash.update(new);
            *bytes += num::u64_of(read);
        }
        self.end += read;
        self.at_end = read == 0;
        Ok(())
    }

    /// The next line as a stretch of the buffer, without its line feed; `None` at the end. Longer lines than can be a
    /// frame are counted and skipped.
    fn next_line(&mut self) -> Result<Option<(usize, usize)>, RecorderError> {
        loop {
            let waiting = self.buffer.get(self.start..self.end).unwrap_or_default();
            if let Some(length) = waiting.iter().position(|byte| *byte == b'\n') {
                let line = (self.start, self.start + length);
                self.start += length + 1;
                if std::mem::take(&mut self.skipping) {
                    continue;
                }
                self.line += 1;
                if length > LONGEST_LINE {
                    self.malformed(
                        &format!("a line of at most {LONGEST_LINE} bytes"),
                        &format!("{length} bytes"),
                    );
                    continue;
                }
                return Ok(Some(line));
            }
            if waiting.len() > LONGEST_LINE {
                if !std::mem::replace(&mut self.skipping, true) {
                    self.line += 1;
                    self.malformed(
                        &format!("a line of at most {LONGEST_LINE} bytes"),
                        "a longer one",
                    );
                }
                self.start = self.end;
            }
            if self.at_end {
                let line = (self.start, self.end);
                self.start = self.end;
                if line.0 == line.1 || self.skipping {
                    return Ok(None);
                }
                self.line += 1;
                return Ok(Some(line));
            }
            self.fill()?;
        }
    }

    /// The next line that is not blank, whatever it holds, without its line feed.
    ///
    /// # Errors
    /// When the log can not be read.
    pub(crate) fn text(&mut self) -> Result<Option<&[u8]>, RecorderError> {
        while let Some((start, end)) = self.next_line()? {
            let line = self.buffer.get(start..end).unwrap_or_default();
            if !line.iter().all(u8::is_ascii_whitespace) {
                return Ok(self.buffer.get(start..end));
            }
        }
        Ok(None)
    }

    /// Counts the last line as none.
    pub(crate) fn malformed(&mut self, expected: &str, found: &str) {
        self.health.malformed += 1;
        if self.health.examples.len() < EXAMPLES {
            self.health.examples.push(format!(
                "{}:{}: expected {expected}, found {found}",
                self.name, self.line
            ));
        }
    }

    fn bus(&mut self, range: (usize, usize), name_at: (usize, usize)) -> u8 {
        let line = self.buffer.get(range.0..range.1).unwrap_or_default();
        let name = line.get(name_at.0..name_at.1).unwrap_or_default();
        if self.last.0 != name {
            self.last.1 = self.interfaces.find(name);
            self.last.0.clear();
            self.last.0.extend_from_slice(name);
            if self.last.1.is_none() && self.health.foreign.len() < MOST_FOREIGN {
                let text = String::from_utf8_lossy(name).into_owned();
                if !self.health.foreign.contains(&text) {
                    self.health.foreign.push(text);
                }
            }
        }
        self.last.1.unwrap_or(Frame::FOREIGN)
    }
}

impl FrameSource for LogSource {
    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, RecorderError> {
        while let Some(range) = self.next_line()? {
            let line = self.buffer.get(range.0..range.1).unwrap_or_default();
            if line.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            match parse(line, frame) {
                Ok(name) => {
                    frame.interface = self.bus(range, name);
                    self.frames += 1;
                    return Ok(true);
                }
                Err(error) => {
                    let found = found(line, error.column);
                    self.malformed(
                        &format!("{} at column {}", error.expected, error.column + 1),
                        &found,
                    );
                }
            }
        }
        Ok(false)
    }

    fn health(&self) -> SourceHealth {
        self.health.clone()
    }
}

/// What stands at a column, short and printable.
fn found(line: &[u8], column: usize) -> String {
    let rest = line.get(column..).unwrap_or_default();
    if rest.is_empty() {
        return "the end of the line".to_owned();
    }
    let short: String = String::from_utf8_lossy(rest.get(..24).unwrap_or(rest))
        .escape_default()
        .collect();
    format!("`{short}`")
}

fn digest(path: &Path, name: &str) -> Result<SourceLog, RecorderError> {
    let mut file = File::open(path).map_err(RecorderError::io(path, "open the log"))?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; CHUNK];
    let mut bytes = 0;
    loop {
        let read = match file.read(&mut buffer) {
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            other => other.map_err(RecorderError::io(path, "read the log"))?,
        };
        if read == 0 {
            break;
        }
        hash.update(buffer.get(..read).unwrap_or_default());
        bytes += num::u64_of(read);
    }
    Ok(SourceLog {
        name: name.to_owned(),
        bytes,
        sha256: hash.finalize().into(),
    })
}

/// Several logs as one, merged by time stamp; each is read as it comes.
pub struct Merged {
    sources: Vec<LogSource>,
    heads: Vec<Option<Frame>>,
    started: bool,
}

impl Merged {
    /// Opens all of them.
    ///
    /// # Errors
    /// When one can not be read.
    pub fn open(inputs: Vec<LogInput>, interfaces: &Interfaces) -> Result<Self, RecorderError> {
        let sources: Vec<LogSource> = inputs
            .into_iter()
            .map(|input| LogSource::open(input, interfaces.clone()))
            .collect::<Result<_, _>>()?;
        let heads = vec![None; sources.len()];
        Ok(Self {
            sources,
            heads,
            started: false,
        })
    }

    /// The logs as the record names them, in the order they were named.
    #[must_use]
    pub fn source_logs(&self) -> Vec<SourceLog> {
        self.sources.iter().map(LogSource::source_log).collect()
    }

    /// Good frames so far.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.sources.iter().map(LogSource::frames).sum()
    }

    fn refill(&mut self, at: usize) -> Result<(), RecorderError> {
        if let (Some(source), Some(head)) = (self.sources.get_mut(at), self.heads.get_mut(at)) {
            let mut frame = Frame::empty();
            *head = source.next_frame(&mut frame)?.then_some(frame);
        }
        Ok(())
    }
}

impl FrameSource for Merged {
    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, RecorderError> {
        if let [only] = self.sources.as_mut_slice() {
            return only.next_frame(frame);
        }
        if !std::mem::replace(&mut self.started, true) {
            for at in 0..self.sources.len() {
                self.refill(at)?;
            }
        }
        let earliest = self
            .heads
            .iter()
            .enumerate()
            .filter_map(|(at, head)| head.as_ref().map(|head| (head.time_ns, at)))
            .min();
        let Some((_, at)) = earliest else {
            return Ok(false);
        };
        if let Some(head) = self.heads.get_mut(at).and_then(Option::take) {
            *frame = head;
        }
        self.refill(at)?;
        Ok(true)
    }

    fn health(&self) -> SourceHealth {
        let mut health = SourceHealth::default();
        for source in &self.sources {
            let one = source.health();
            health.malformed += one.malformed;
            health.dropped += one.dropped;
            health.examples.extend(one.examples);
            for name in one.foreign {
                if !health.foreign.contains(&name) {
                    health.foreign.push(name);
                }
            }
        }
        health
    }
}
