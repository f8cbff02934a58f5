//! One block of the spool: 4,096 bytes.
//!
//! | offset | type | what |
//! |---|---|---|
//! | 0 | 4 bytes | `SVS1` |
//! | 4 | u32 | CRC-32C of bytes 8 to 36 + *n* |
//! | 8 | u64 | sequence number, from 1, never used twice; its place is the number modulo the blocks of the file |
//! | 16 | u64 | session |
//! | 24 | i64 | base of the frames' times, ns |
//! | 32 | u16 | *n*, bytes of entries |
//! | 34 | 2 bytes | zero |
//! | 36 | *n* | entries |

use schema::num;

use super::entry::{Entries, Entry, LARGEST};

/// Bytes of a block.
pub const BLOCK_BYTES: usize = 4096;
/// Bytes before the entries.
pub const HEAD_BYTES: usize = 36;

const MAGIC: [u8; 4] = *b"SVS1";

const _: () = assert!(HEAD_BYTES + LARGEST < BLOCK_BYTES);

/// What a sound block says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Sequence number.
    pub sequence: u64,
    /// Session.
    pub session: u64,
    /// Base of the frames' times, ns.
    pub base_ns: i64,
    /// Bytes of entries.
    pub used: usize,
}

/// Sets what is only known when a block is written: number, session and checksum. `block` has its base, length and
/// entries.
pub(super) fn finish(block: &mut [u8], sequence: u64, session: u64) {
    put(block, 0, &MAGIC);
    put(block, 8, &sequence.to_le_bytes());
    put(block, 16, &session.to_le_bytes());
    let used = usize::from(u16::from_le_bytes(get(block, 32)));
    let covered = block.get(8..HEAD_BYTES + used).unwrap_or_default();
    let check = crc32c::crc32c(covered);
    put(block, 4, &check.to_le_bytes());
}

/// Begins a block at the end of `out`: its head, still without number.
pub(super) fn begin(out: &mut Vec<u8>, base_ns: i64) {
    let start = out.len();
    out.resize(start + HEAD_BYTES, 0);
    if let Some(block) = out.get_mut(start..) {
        put(block, 24, &base_ns.to_le_bytes());
    }
}

/// Ends the block that began at `start`: its length, and zeros to its end.
pub(super) fn end(out: &mut Vec<u8>, start: usize) {
    let used = out.len().saturating_sub(start + HEAD_BYTES);
    let used = u16::try_from(used).unwrap_or(0);
    if let Some(block) = out.get_mut(start..) {
        put(block, 32, &used.to_le_bytes());
    }
    out.resize(start + BLOCK_BYTES, 0);
}

fn put(block: &mut [u8], at: usize, bytes: &[u8]) {
    if let Some(place) = block.get_mut(at..at + bytes.len()) {
        place.copy_from_slice(bytes);
    }
}

fn get<const N: usize>(block: &[u8], at: usize) -> [u8; N] {
    let found = block.get(at..).and_then(|rest| rest.first_chunk::<N>());
    found.copied().unwrap_or([0; N])
}

/// The head of a block whose checksum holds; `None` for anything else.
#[must_use]
pub fn read(block: &[u8]) -> Option<Head> {
    let head = Head {
        sequence: u64::from_le_bytes(get(block, 8)),
        session: u64::from_le_bytes(get(block, 16)),
        base_ns: i64::from_le_bytes(get(block, 24)),
        used: usize::from(u16::from_le_bytes(get(block, 32))),
    };
    let covered = block.get(8..HEAD_BYTES + head.used)?;
    let sound = get::<4>(block, 0) == MAGIC
        && crc32c::crc32c(covered) == u32::from_le_bytes(get(block, 4))
        && head.sequence > 0
        && num::u64_of(block.len()) == num::u64_of(BLOCK_BYTES);
    sound.then_some(head)
}

/// The entries of a sound block, in order.
pub fn entries<'a>(block: &'a [u8], head: &Head) -> impl Iterator<Item = Entry> + use<'a> {
    let payload = block
        .get(HEAD_BYTES..HEAD_BYTES + head.used)
        .unwrap_or_default();
    Entries::new(payload, head.base_ns)
}
