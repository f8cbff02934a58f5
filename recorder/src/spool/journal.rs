//! The receiving thread's side of the spool: entries go into blocks in memory, which are handed over at each flush.

use crate::can::Frame;

use super::block::{self, BLOCK_BYTES};
use super::entry::{self, Entry};

/// Blocks that wait in memory at most (4 MiB), then frames are left out and counted.
const MOST_BLOCKS: usize = 1024;

/// Blocks being filled. Allocates nothing as long as a flush fits what an earlier one needed.
#[derive(Debug, Default)]
pub struct Journal {
    /// Whole blocks, and the open one at the end.
    bytes: Vec<u8>,
    /// Where the open block begins.
    open: Option<usize>,
    base_ns: i64,
    /// Time of the first frame that waits, on the line.
    oldest_ns: Option<i64>,
    newest_ns: i64,
    lost: u64,
    scratch: Vec<u8>,
}

impl Journal {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        Self {
            bytes: Vec::with_capacity(16 * BLOCK_BYTES),
            scratch: Vec::with_capacity(entry::LARGEST),
            ..Self::default()
        }
    }

    /// True if nothing waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Frames that found no room since the start.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// A frame.
    pub fn frame(&mut self, frame: &Frame) {
        if self.bytes.len() >= MOST_BLOCKS * BLOCK_BYTES {
            self.lost += 1;
            return;
        }
        self.oldest_ns.get_or_insert(frame.time_ns);
        self.newest_ns = frame.time_ns;
        self.room(entry::frame_bytes(frame), frame.time_ns);
        if !entry::put_frame(&mut self.bytes, self.base_ns, frame) {
            self.close();
            self.room(entry::frame_bytes(frame), frame.time_ns);
            entry::put_frame(&mut self.bytes, self.base_ns, frame);
        }
    }

    /// Anything else. It is taken also where frames find no room, within reason.
    pub fn entry(&mut self, entry: &Entry) {
        if let Entry::Frame(frame) = entry {
            return self.frame(frame);
        }
        if self.bytes.len() >= 2 * MOST_BLOCKS * BLOCK_BYTES {
            self.lost += 1;
            return;
        }
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.clear();
        entry::put(&mut scratch, entry);
        // Frames follow: the block's base is theirs, whatever time the entry tells of.
        let base_ns = if self.newest_ns == 0 {
            entry.time_ns()
        } else {
            self.newest_ns
        };
        self.room(scratch.len(), base_ns);
        self.bytes.extend(&scratch);
        self.scratch = scratch;
    }

    /// Makes room for so many bytes in the open block, or opens one.
    fn room(&mut self, bytes: usize, time_ns: i64) {
        if let Some(start) = self.open {
            if self.bytes.len() - start + bytes <= BLOCK_BYTES {
                return;
            }
            self.close();
        }
        self.open = Some(self.bytes.len());
        self.base_ns = time_ns;
        block::begin(&mut self.bytes, time_ns);
    }

    fn close(&mut self) {
        if let Some(start) = self.open.take() {
            block::end(&mut self.bytes, start);
        }
    }

    /// Time of the first frame that waits, ns on the line.
    #[must_use]
    pub fn oldest_ns(&self) -> Option<i64> {
        self.oldest_ns
    }

    /// Everything that waits, as whole blocks, exchanged for an empty buffer.
    pub fn exchange(&mut self, empty: Vec<u8>) -> Vec<u8> {
        self.close();
        self.oldest_ns = None;
        let mut empty = empty;
        empty.clear();
        std::mem::replace(&mut self.bytes, empty)
    }
}
