//! The spool's file: laid out once, written block by block, read after a cut.

use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::Arc;

use schema::num;

use super::block::{self, BLOCK_BYTES, Head};
use super::entry::Entry;
use crate::error::RecorderError;
use crate::storage::{Storage, Stored, beside};

/// Blocks that are read or zeroed at a time.
const AT_ONCE: u64 = 64;
/// Blocks from the newest within which the last entry of a kind is looked for: one flush is at most 1,024.
const LOOK_BACK: usize = 4096;
/// Blocks from the newest within which a missing one matters: the triggers of a running event are written each second.
const HOLES: usize = 256;

/// The open file.
pub struct SpoolFile {
    file: Box<dyn Stored>,
    blocks: u64,
    next: u64,
    session: u64,
}

/// Where the blocks of the file stand, oldest first.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Sequence number, place and session of each sound block of the last round.
    blocks: Vec<(u64, u64, u64)>,
    /// Blocks of the file.
    pub total: u64,
    /// Sequence numbers between the oldest and the newest that are not there.
    pub missing: u64,
}

impl Found {
    /// The highest sequence number, or 0.
    #[must_use]
    pub fn newest(&self) -> u64 {
        self.blocks.last().map_or(0, |(sequence, _, _)| *sequence)
    }

    /// Session of the newest block, or 0.
    #[must_use]
    pub fn session(&self) -> u64 {
        self.blocks.last().map_or(0, |(_, _, session)| *session)
    }
}

fn offset(place: u64) -> u64 {
    place * num::u64_of(BLOCK_BYTES)
}

/// Looks for sound blocks: those of the newest round, in order of their numbers.
///
/// # Errors
/// When the file can not be read; one that is not there holds nothing.
pub fn scan(storage: &dyn Storage, path: &Path) -> Result<Found, RecorderError> {
    let read = RecorderError::io(path, "read the spool");
    let length = match storage.length(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Found::default()),
        other => other.map_err(read)?,
    };
    let total = length / num::u64_of(BLOCK_BYTES);
    let mut heads: Vec<(u64, u64, u64)> = Vec::new();
    let mut place = 0;
    while place < total {
        let count = AT_ONCE.min(total - place);
        let at_once = storage.read_range(path, offset(place), num::usize_of(offset(count)));
        // One page that can not be read must not cost the others.
        let bytes = at_once.unwrap_or_else(|_| one_by_one(storage, path, place, count));
        for (at, bytes) in (place..).zip(bytes.chunks_exact(BLOCK_BYTES)) {
            if let Some(head) = block::read(bytes)
                && head.sequence % total == at
            {
                heads.push((head.sequence, at, head.session));
            }
        }
        place += count;
    }
    heads.sort_unstable();
    let newest = heads.last().map_or(0, |(sequence, _, _)| *sequence);
    // What an earlier round left where a later write did not get through.
    heads.retain(|(sequence, _, _)| *sequence + total > newest);
    let oldest = heads.first().map_or(0, |(sequence, _, _)| *sequence);
    let missing = if heads.is_empty() {
        0
    } else {
        newest + 1 - oldest - num::u64_of(heads.len())
    };
    Ok(Found {
        blocks: heads,
        total,
        missing,
    })
}

/// Blocks read one by one; one that can not be read is zeros, which is no block.
fn one_by_one(storage: &dyn Storage, path: &Path, place: u64, count: u64) -> Vec<u8> {
    let mut out = Vec::new();
    for at in place..place + count {
        let read = storage.read_range(path, offset(at), BLOCK_BYTES);
        out.extend(read.unwrap_or_default());
        out.resize(num::usize_of(offset(at + 1 - place)), 0);
    }
    out
}

/// The last entry of the newest session that `wanted` gives something for, of those before the first block that is
/// missing from its end.
pub fn last_of<T>(
    storage: &dyn Storage,
    path: &Path,
    found: &Found,
    wanted: impl Fn(&Entry) -> Option<T>,
) -> Option<T> {
    let session = found.session();
    // What stands behind a missing block may have been decided on what was in it.
    let mut sound = 0;
    for (at, (sequence, _, _)) in found.blocks.iter().enumerate().rev().take(HOLES) {
        let before = at.checked_sub(1).and_then(|at| found.blocks.get(at));
        if before.is_some_and(|(before, _, _)| before + 1 != *sequence) {
            sound = found.blocks.len() - at;
        }
    }
    for (sequence, place, of) in found.blocks.iter().rev().skip(sound).take(LOOK_BACK) {
        if *of != session {
            break;
        }
        let bytes = one_by_one(storage, path, *place, 1);
        let head: Option<Head> = block::read(&bytes).filter(|head| head.sequence == *sequence);
        let last = head.and_then(|head| {
            block::entries(&bytes, &head)
                .filter_map(|entry| wanted(&entry))
                .last()
        });
        if last.is_some() {
            return last;
        }
    }
    None
}

/// Hands on every entry of the newest session, oldest first. A block that can not be read any more is left out.
pub fn read_session(
    storage: &dyn Storage,
    path: &Path,
    found: &Found,
    take: &mut dyn FnMut(Entry),
) {
    let session = found.session();
    for (sequence, place, of) in &found.blocks {
        if *of != session {
            continue;
        }
        let bytes = one_by_one(storage, path, *place, 1);
        let head: Option<Head> = block::read(&bytes).filter(|head| head.sequence == *sequence);
        if let Some(head) = head {
            block::entries(&bytes, &head).for_each(&mut *take);
        }
    }
}

impl SpoolFile {
    /// Opens the file for a new session, whose blocks follow those that were found. A file of another size is laid
    /// out anew (what it held must have been recovered before).
    ///
    /// # Errors
    /// When it can not be made or written, as on a full disk.
    pub fn begin(
        storage: &Arc<dyn Storage>,
        path: &Path,
        blocks: u64,
        found: &Found,
        session: u64,
    ) -> Result<Self, RecorderError> {
        let error = |action| RecorderError::io(path, action);
        let mut next = found.newest() + 1;
        if found.total != blocks {
            lay_out(storage.as_ref(), path, blocks).map_err(error("lay out the spool"))?;
            // Numbers go on, so that no old number is ever used twice.
            next = next.max(1);
        }
        let file = storage.open(path).map_err(error("open the spool"))?;
        Ok(Self {
            file,
            blocks,
            next,
            session,
        })
    }

    /// Writes whole blocks; they are durable after [`SpoolFile::sync`].
    ///
    /// # Errors
    /// The file's own; the blocks may then be there in part, and the next call writes behind them.
    pub fn write(&mut self, bytes: &mut [u8]) -> io::Result<()> {
        for block in bytes.chunks_exact_mut(BLOCK_BYTES) {
            block::finish(block, self.next, self.session);
            self.next += 1;
        }
        // As few writes as there are stretches between two ends of the file: one or two.
        let count = num::u64_of(bytes.len() / BLOCK_BYTES);
        let first = self.next - count;
        let mut done = 0;
        while done < count {
            let place = (first + done) % self.blocks;
            let run = (self.blocks - place).min(count - done);
            let part = num::usize_of(offset(done))..num::usize_of(offset(done + run));
            let part = bytes.get(part).unwrap_or_default();
            self.file.write_at(offset(place), part)?;
            done += run;
        }
        Ok(())
    }

    /// Returns when everything written is durable.
    ///
    /// # Errors
    /// The file's own.
    pub fn sync(&mut self) -> io::Result<()> {
        self.file.sync()
    }
}

/// Fills the file with zeros beside it and gives it its name.
fn lay_out(storage: &dyn Storage, path: &Path, blocks: u64) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let temporary = beside(path, "part");
    storage.create_folder(folder)?;
    let mut file = storage.create(&temporary)?;
    let zeros = vec![0; num::usize_of(offset(AT_ONCE))];
    let mut place = 0;
    while place < blocks {
        let count = AT_ONCE.min(blocks - place);
        let part = zeros
            .get(..num::usize_of(offset(count)))
            .unwrap_or_default();
        if let Err(error) = file.write_at(offset(place), part) {
            // What there is no room for must not take the room of a record.
            let _ = storage.remove(&temporary);
            return Err(error);
        }
        place += count;
    }
    let named = file.sync().and_then(|()| storage.rename(&temporary, path));
    if let Err(error) = named {
        let _ = storage.remove(&temporary);
        return Err(error);
    }
    storage.sync_folder(folder)
}
