//! Reading what is left of a damaged record: every structure whose checks hold, and a list of what does not.
//!
//! A damaged body is stepped over by its length if a sound head follows there. Else the reader searches on,
//! byte by byte, for the next structure whose checks hold; a second block is also found by its start sequence
//! and date, and kept if its checksum holds with the head it must have had.

use std::fmt;

use crate::block::FULL_HZ;
use crate::error::SchemaError;
use crate::frame::{self, Head};
use crate::limits::{self, BEFORE_STAMP};
use crate::num;
use crate::read::{self, Assembly};
use crate::record::Record;
use crate::sample::SAMPLE_BYTES;
use crate::seal::SealState;
use crate::time::{STAMP_BYTES, START_SEQUENCE, Stamp};
use crate::wire::too_large;

/// Damages that are listed one by one; what is beyond is counted.
pub const MAX_DAMAGES: usize = 1_000;

/// Where a block's body holds the number of its samples.
const COUNT_AT: usize = 16;

/// What a damaged record still gives.
#[derive(Debug)]
pub struct Salvaged {
    /// The structures whose checks hold. Parts that are lost are empty; if the completion part is lost, the
    /// record says that it is incomplete, and why.
    pub record: Record,
    /// What the seal is worth.
    pub seal: SealState,
    /// What does not hold, in order of the file; at most [`MAX_DAMAGES`]. Empty for a sound file.
    pub damage: Vec<Damage>,
    /// Damages beyond those listed.
    pub unlisted: u64,
}

/// A stretch of the file that could not be used.
#[derive(Debug)]
pub struct Damage {
    /// Its first byte.
    pub offset: u64,
    /// Its length; 0 where something is missing altogether.
    pub bytes: u64,
    /// What was wrong there.
    pub error: SchemaError,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} bytes at offset {} not used: {}",
            self.bytes, self.offset, self.error
        )
    }
}

impl Record {
    /// Reads what is left of a damaged file. Time is linear in the file's length.
    ///
    /// # Errors
    /// Only if the header cannot be read: without scales and clock no sample means anything.
    pub fn salvage(file: &[u8]) -> Result<Salvaged, SchemaError> {
        if file.len() > limits::MAX_FILE_BYTES {
            return Err(too_large(
                "file",
                num::u64_of(limits::MAX_FILE_BYTES),
                file.len(),
                "bytes",
            ));
        }
        let mut search = Search::new(file);
        let magic = read::magic(file);
        if matches!(magic, Err(SchemaError::Encrypted)) {
            return Err(SchemaError::Encrypted);
        }
        if let Err(error) = magic {
            search.damage(0, frame::MAGIC.len().min(file.len()), error);
        }
        let head = search.header()?;
        let parts = read::header(file, &head)?;
        Ok(search.run(head.end(), parts))
    }
}

/// What stands at an offset.
enum Step<'a> {
    /// A structure whose checks hold, and its body.
    Sound(Head, &'a [u8]),
    /// What is wrong, and where the next structure begins if that can be told.
    Bad(SchemaError, Option<usize>),
}

/// The search through a damaged file.
struct Search<'a> {
    file: &'a [u8],
    damage: Vec<Damage>,
    unlisted: u64,
    /// Bytes that may still be checksummed: bounds the time a hostile file can take.
    budget: usize,
}

impl<'a> Search<'a> {
    fn new(file: &'a [u8]) -> Self {
        Self {
            file,
            damage: Vec::new(),
            unlisted: 0,
            budget: file.len().saturating_mul(8).saturating_add(1 << 20),
        }
    }

    fn damage(&mut self, from: usize, to: usize, error: SchemaError) {
        if self.damage.len() >= MAX_DAMAGES {
            self.unlisted += 1;
            return;
        }
        self.damage.push(Damage {
            offset: num::u64_of(from),
            bytes: num::u64_of(to.saturating_sub(from)),
            error,
        });
    }

    /// True, and spent, if so many more bytes may be checksummed.
    fn spend(&mut self, bytes: usize) -> bool {
        let left = self.budget.checked_sub(bytes);
        self.budget = left.unwrap_or(0);
        left.is_some()
    }

    /// The head of a sound header: in its place, or wherever bytes were lost or added before it.
    fn header(&mut self) -> Result<Head, SchemaError> {
        let place = frame::MAGIC.len();
        let error = match frame::read_head(self.file, place) {
            Ok(head) => match read::header(self.file, &head) {
                Ok(_) => return Ok(head),
                Err(error) => error,
            },
            Err(error) => error,
        };
        let mut at = 0;
        while let Some(found) = find(self.file, at, frame::HEADER) {
            if let Ok(head) = frame::read_head(self.file, found)
                && self.spend(head.length)
                && read::header(self.file, &head).is_ok()
            {
                self.damage(place.min(found), found, error);
                return Ok(head);
            }
            at = found + 1;
        }
        Err(error)
    }

    fn run(mut self, mut at: usize, mut parts: Assembly) -> Salvaged {
        let mut seal = SealState::Missing;
        while at < self.file.len() {
            let (head, body) = match self.structure(at) {
                Step::Sound(head, body) => (head, body),
                Step::Bad(error, next) => {
                    let (next, healed) = next.map_or_else(|| self.resync(at), |next| (next, None));
                    self.damage(at, next, error);
                    at = next;
                    match healed {
                        Some(found) => found,
                        None => continue,
                    }
                }
            };
            at = head.end();
            if head.tag == frame::SEAL {
                match read::seal(self.file, &head, body) {
                    Ok(sound) => seal = SealState::Sound(sound),
                    Err(SchemaError::Digest {
                        stored, computed, ..
                    }) => {
                        seal = SealState::Broken { stored, computed };
                    }
                    Err(error) => self.damage(head.at, at, error),
                }
                break;
            }
            if let Err(error) = parts.add(&head, body) {
                self.damage(head.at, at, error);
            }
        }
        if at < self.file.len() {
            let error = SchemaError::Trailing {
                place: "file".to_owned(),
                offset: num::u64_of(at),
                found: num::u64_of(self.file.len() - at),
            };
            self.damage(at, self.file.len(), error);
        }
        let end = self.file.len();
        for lost in parts.lost() {
            let error = SchemaError::Order {
                offset: num::u64_of(end),
                expected: frame::name(lost),
                found: "no sound one in the file".to_owned(),
            };
            self.damage(end, end, error);
        }
        Salvaged {
            record: parts.salvage(),
            seal,
            damage: self.damage,
            unlisted: self.unlisted,
        }
    }

    /// The structure at `at`.
    fn structure(&mut self, at: usize) -> Step<'a> {
        let head = match frame::read_head(self.file, at) {
            Ok(head) => head,
            Err(error) => return Step::Bad(error, None),
        };
        if !self.spend(head.length) {
            return Step::Bad(self.exhausted(), None);
        }
        match frame::read_body(self.file, &head) {
            Ok(body) => Step::Sound(head, body),
            // A seal whose own check fails still shows whether the digest holds.
            Err(error) if head.tag == frame::SEAL => {
                self.damage(head.at, head.end(), error);
                Step::Sound(
                    head,
                    self.file
                        .get(head.body_at()..head.body_at() + head.length)
                        .unwrap_or(&[]),
                )
            }
            Err(error) => {
                let end = head.end();
                let steps_over = end == self.file.len() || frame::read_head(self.file, end).is_ok();
                Step::Bad(error, steps_over.then_some(end))
            }
        }
    }

    fn exhausted(&self) -> SchemaError {
        let limit = num::u64_of(self.file.len().saturating_mul(8).saturating_add(1 << 20));
        too_large(
            "search for sound structures",
            limit,
            self.file.len(),
            "bytes to check",
        )
    }

    /// The first byte behind `at` where a sound structure begins, or the end of the file; with the block
    /// itself if it was found by its stamp, its own head being damaged.
    fn resync(&mut self, at: usize) -> (usize, Option<(Head, &'a [u8])>) {
        for here in at + 1..self.file.len() {
            let known = self
                .file
                .get(here..here + 4)
                .and_then(|tag| tag.as_array().copied());
            if known.and_then(frame::rank).is_some()
                && let Ok(head) = frame::read_head(self.file, here)
                && self.spend(head.length)
                && (head.tag == frame::SEAL || frame::read_body(self.file, &head).is_ok())
            {
                return (here, None);
            }
            if let Some((head, body)) = self.block_by_stamp(here, at) {
                return (head.body_at(), Some((head, body)));
            }
            if self.budget == 0 {
                break;
            }
        }
        (self.file.len(), None)
    }

    /// The second block whose body begins at `from` or later and whose stamp stands at `stamp_at`, if its checksum holds with the head it must have had.
    fn block_by_stamp(&mut self, stamp_at: usize, from: usize) -> Option<(Head, &'a [u8])> {
        let stamp: [u8; STAMP_BYTES] = *self
            .file
            .get(stamp_at..stamp_at + STAMP_BYTES)?
            .as_array()?;
        if u16::from_be_bytes([stamp[0], stamp[1]]) >> 7 != START_SEQUENCE {
            return None;
        }
        Stamp::from_bytes(stamp)?;
        let body_at = stamp_at
            .checked_sub(BEFORE_STAMP)
            .filter(|&body_at| body_at >= from)?;
        let at = body_at.checked_sub(frame::HEAD_BYTES)?;
        let count_at = body_at + COUNT_AT;
        let count = u16::from_le_bytes(*self.file.get(count_at..count_at + 2)?.as_array()?);
        if count > u16::from(FULL_HZ) {
            return None;
        }
        let length = BEFORE_STAMP + STAMP_BYTES + usize::from(count) * SAMPLE_BYTES;
        let body = self.file.get(body_at..body_at + length)?;
        let stored = self
            .file
            .get(body_at + length..body_at + length + frame::TAIL_BYTES)?;
        if !self.spend(length) {
            return None;
        }
        let head = frame::head(frame::BLOCK, u32::try_from(length).ok()?);
        let check = crc32c::crc32c_append(crc32c::crc32c(&head), body);
        let head = Head {
            tag: frame::BLOCK,
            at,
            length,
        };
        (stored == check.to_le_bytes()).then_some((head, body))
    }
}

/// Offset of the first `needle` from `at` on.
fn find(file: &[u8], at: usize, needle: frame::Tag) -> Option<usize> {
    let rest = file.get(at..)?;
    rest.windows(needle.len())
        .position(|four| *four == needle)
        .map(|found| at + found)
}
