//! The envelope of a record that is encrypted at rest: [`MAGIC`], then a file of age format version 1 that holds the
//! whole sealed record (`FORMAT.md`, 7.2). The cryptography is the programs' (cargo feature `age`).

/// What every envelope begins with.
pub const MAGIC: [u8; 8] = crate::frame::ENCRYPTED_MAGIC;
/// Ending of a file's name, with its dot.
pub const SUFFIX: &str = ".sve";
/// Most bytes of an envelope: the largest record, and ample room for what age adds (a head of some hundred bytes for
/// a recipient, 16 bytes each 64 KiB).
pub const MAX_ENVELOPE_BYTES: usize = crate::limits::MAX_FILE_BYTES + (1 << 20);

/// The age file within an envelope; `None` where the bytes are no envelope.
#[must_use]
pub fn contents(file: &[u8]) -> Option<&[u8]> {
    file.strip_prefix(&MAGIC)
}
