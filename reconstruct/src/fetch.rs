//! Records off a recorder, over a serial line [S03, 4.1: RS-232]. The protocol is [`schema::serial`], laid down in
//! `recorder/SERIAL.md`: [`link`] asks and repeats until it is answered, [`window`] reads one file with several
//! requests under way, [`part`] keeps what came and gives the whole file its name.
//!
//! No clock is read: time passes by the port's own read time-outs.

pub mod link;
pub mod part;
pub mod window;

use std::io;
use std::path::{Path, PathBuf};

use schema::serial::{Entry, Refusal, Request, Response};

use link::{Link, Port};
use part::{Part, Placed};

/// Times a file is begun anew after its session was lost or its list had changed, and as often the list.
const SESSIONS: u32 = 50;

/// Why something could not be fetched.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FetchError {
    /// The line failed.
    #[error("{device}: {source}")]
    Line {
        /// The device.
        device: String,
        /// What the system said.
        source: io::Error,
    },
    /// Nothing answers.
    #[error(
        "nothing answered for {seconds} s: expected a recorder that serves on this line at this speed"
    )]
    Silent {
        /// How long, s.
        seconds: u64,
    },
    /// The recorder refuses.
    #[error("refused: {0}")]
    Refused(#[from] Refusal),
    /// The other end does not know the token.
    #[error("what answers does not know the token: it is not this recorder")]
    NotTheRecorder,
    /// The system gives no random numbers.
    #[error("the system gives no random numbers")]
    Random,
    /// A response that does not fit its request.
    #[error("expected {expected} in the response, found something else")]
    Response {
        /// What was expected.
        expected: &'static str,
    },
    /// A file here.
    #[error("{}: {source}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// What came is not what was listed.
    #[error("SHA-256 listed {listed}, of the bytes that came {computed}")]
    Digest {
        /// Hexadecimal.
        listed: String,
        /// Hexadecimal.
        computed: String,
    },
    /// Another file has the name.
    #[error("{}: expected no other file of this name, found one; it is left as it is", path.display())]
    Taken {
        /// Its path.
        path: PathBuf,
    },
    /// A file larger than any record.
    #[error(
        "expected at most {} bytes, found {found} listed",
        schema::limits::MAX_FILE_BYTES
    )]
    TooLarge {
        /// Bytes listed.
        found: u64,
    },
}

impl FetchError {
    /// True where the line or the session is at fault, so that no other file can be fetched either.
    #[must_use]
    pub fn ends_all(&self) -> bool {
        matches!(
            self,
            Self::Line { .. } | Self::Silent { .. } | Self::NotTheRecorder | Self::Random
        ) || matches!(
            self,
            Self::Refused(Refusal::WrongToken(_) | Refusal::Wait(_))
        )
    }
}

/// What became of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// It was there already, the same to the byte.
    Had,
    /// It was fetched.
    Fetched {
        /// Bytes that an earlier, interrupted fetch had left.
        resumed: u64,
        /// What is wrong with its content, although it is the same as in the recorder.
        fault: Option<String>,
    },
}

/// The whole list.
///
/// # Errors
/// When the line fails or the recorder refuses.
pub fn list<P: Port>(link: &mut Link<P>) -> Result<Vec<Entry>, FetchError> {
    let mut tries = 0;
    loop {
        match list_once(link) {
            Err(FetchError::Refused(Refusal::NoSession)) if tries < SESSIONS => {
                tries += 1;
                link.connect()?;
            }
            other => return other,
        }
    }
}

fn list_once<P: Port>(link: &mut Link<P>) -> Result<Vec<Entry>, FetchError> {
    let mut all: Vec<Entry> = Vec::new();
    let mut first = 0;
    loop {
        match link.ask(&Request::List { first })? {
            Response::Page {
                files,
                next,
                entries,
            } => {
                all.extend(entries);
                if next >= files || next <= first || all.len() >= schema::serial::MAX_FILES {
                    return Ok(all);
                }
                first = next;
            }
            Response::Refused(refusal) => return Err(refusal.into()),
            _ => return Err(FetchError::Response { expected: "a page" }),
        }
    }
}

/// Fetches a file of the list into a folder, going on where an earlier fetch of the same bytes ended.
///
/// # Errors
/// When it could not be fetched; what came of it stays for the next time.
pub fn file<P: Port>(
    link: &mut Link<P>,
    entry: &Entry,
    out: &Path,
    progress: &mut dyn FnMut(u64),
) -> Result<State, FetchError> {
    if entry.length > schema::num::u64_of(schema::limits::MAX_FILE_BYTES) {
        return Err(FetchError::TooLarge {
            found: entry.length,
        });
    }
    if part::had(entry, out)? {
        return Ok(State::Had);
    }
    let mut part = Part::open(entry, out)?;
    let resumed = part.length();
    let (mut here, mut tries) = (entry.clone(), 0);
    loop {
        let done = window::read(link, &here, part.length(), &mut |bytes| {
            part.append(bytes)?;
            progress(part.length());
            Ok(())
        });
        match done {
            Ok(()) => break,
            Err(FetchError::Refused(refusal @ (Refusal::NoSession | Refusal::Changed)))
                if tries < SESSIONS =>
            {
                tries += 1;
                if refusal == Refusal::NoSession {
                    link.connect()?;
                }
                let listed = list(link)?;
                let same = |other: &&Entry| other.name == here.name && other.sha256 == here.sha256;
                let found = listed.iter().find(same).cloned();
                here = found.ok_or(FetchError::Refused(Refusal::Changed))?;
            }
            Err(error) => return Err(error),
        }
    }
    let Placed { fault } = part.place(entry, out)?;
    Ok(State::Fetched { resumed, fault })
}
