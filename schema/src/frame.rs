//! The frame around every structure: tag, length, check of both, body, check of all.
//!
//! A reader skips tags it does not know. The head has a check of its own so that a damaged body can be
//! stepped over by its length, and a damaged length is not believed.

use std::io::Write;

use crate::error::SchemaError;
use crate::limits;
use crate::num;
use crate::wire::{Cursor, length32, too_large};

/// What every record begins with. The first byte is no ASCII, CR LF and LF tell a transfer in text mode, and
/// 0x1A ends a listing on old systems.
pub(crate) const MAGIC: [u8; 8] = *b"\x89SVB\r\n\x1a\n";
/// What an encrypted envelope begins with.
pub(crate) const ENCRYPTED_MAGIC: [u8; 8] = *b"\x89SVE\r\n\x1a\n";

/// Name of a structure: four ASCII letters.
pub(crate) type Tag = [u8; 4];
pub(crate) const HEADER: Tag = *b"HEAD";
pub(crate) const BLOCK: Tag = *b"SECS";
pub(crate) const CLIPPING: Tag = *b"CLIP";
pub(crate) const RAW: Tag = *b"RAWF";
pub(crate) const AUX: Tag = *b"AUXS";
pub(crate) const GNSS: Tag = *b"GNSS";
pub(crate) const HEALTH: Tag = *b"HLTH";
pub(crate) const TRIGGERS: Tag = *b"TRIG";
pub(crate) const COMPLETION: Tag = *b"DONE";
pub(crate) const SEAL: Tag = *b"SEAL";

/// The structures in their order in the file.
pub(crate) const ORDER: [Tag; 10] = [
    HEADER, BLOCK, CLIPPING, RAW, AUX, GNSS, HEALTH, TRIGGERS, COMPLETION, SEAL,
];

/// Tag, length and the check of both.
pub(crate) const HEAD_BYTES: usize = 12;
/// The check behind the body.
pub(crate) const TAIL_BYTES: usize = 4;
/// Body of a seal: kind, digest, and the signature of a signed one.
pub(crate) const SEAL_BYTES: [usize; 2] = [33, 97];

/// Place of a tag in [`ORDER`]; `None` if it is not known.
pub(crate) fn rank(tag: Tag) -> Option<usize> {
    ORDER.iter().position(|known| *known == tag)
}

/// The largest body a structure may have.
fn limit(tag: Tag) -> usize {
    match tag {
        HEADER => 4 + limits::MAX_HEADER_BYTES,
        BLOCK => limits::MAX_BLOCK_BYTES,
        CLIPPING => 4 + limits::MAX_CLIPS * limits::CLIP_BYTES,
        RAW => 4 + limits::MAX_RAW_BYTES,
        AUX => limits::MAX_AUX_BYTES,
        // The receiver's name and figures beside the lists.
        GNSS => limits::MAX_GNSS_BYTES + 70_000,
        HEALTH => limits::MAX_HEALTH_BYTES,
        TRIGGERS => limits::MAX_TRIGGERS_BYTES,
        COMPLETION => limits::MAX_COMPLETION_BYTES,
        SEAL => SEAL_BYTES[1],
        _ => limits::MAX_FILE_BYTES,
    }
}

/// A tag as an error shows it.
pub(crate) fn name(tag: Tag) -> String {
    match tag {
        HEADER => "header".to_owned(),
        BLOCK => "second block".to_owned(),
        CLIPPING => "clipping".to_owned(),
        RAW => "raw frames".to_owned(),
        AUX => "auxiliary signals".to_owned(),
        GNSS => "satellite fixes".to_owned(),
        HEALTH => "health".to_owned(),
        TRIGGERS => "triggers".to_owned(),
        COMPLETION => "completion".to_owned(),
        SEAL => "seal".to_owned(),
        other => format!("part {}", other.escape_ascii()),
    }
}

/// The head of a structure with a body of `length` bytes.
pub(crate) fn head(tag: Tag, length: u32) -> [u8; HEAD_BYTES] {
    let mut bytes = [0; HEAD_BYTES];
    let (plain, check) = bytes.split_at_mut(8);
    plain[..4].copy_from_slice(&tag);
    plain[4..].copy_from_slice(&length.to_le_bytes());
    check.copy_from_slice(&crc32c::crc32c(plain).to_le_bytes());
    bytes
}

/// Writes a structure.
pub(crate) fn write(out: &mut impl Write, tag: Tag, body: &[u8]) -> Result<(), SchemaError> {
    if body.len() > limit(tag) {
        let limit = num::u64_of(limit(tag));
        return Err(too_large(&name(tag), limit, body.len(), "bytes"));
    }
    let head = head(tag, length32(&name(tag), body.len())?);
    let check = crc32c::crc32c_append(crc32c::crc32c(&head), body);
    out.write_all(&head)?;
    out.write_all(body)?;
    out.write_all(&check.to_le_bytes())?;
    Ok(())
}

/// The head of a structure, its check found sound and its length within its bound and the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Head {
    pub(crate) tag: Tag,
    /// Offset of the structure.
    pub(crate) at: usize,
    /// Bytes of the body.
    pub(crate) length: usize,
}

impl Head {
    /// Offset of the body.
    pub(crate) fn body_at(&self) -> usize {
        self.at + HEAD_BYTES
    }

    /// Offset of what follows the structure.
    pub(crate) fn end(&self) -> usize {
        self.body_at() + self.length + TAIL_BYTES
    }
}

/// Reads the head at `at`, which may lie anywhere.
pub(crate) fn read_head(file: &[u8], at: usize) -> Result<Head, SchemaError> {
    let mut cursor = Cursor::new("structure", file.get(at..).unwrap_or(&[]), at);
    let tag = cursor.array()?;
    let length = cursor.u32()?;
    let stored = cursor.u32()?;
    let [.., a, b, c, d] = head(tag, length);
    let computed = u32::from_le_bytes([a, b, c, d]);
    if stored != computed {
        return Err(SchemaError::Crc {
            place: format!("head of {}", name(tag)),
            offset: num::u64_of(at),
            stored,
            computed,
        });
    }
    let length = num::usize_of(length.into());
    if length > limit(tag) {
        return Err(too_large(
            &name(tag),
            num::u64_of(limit(tag)),
            length,
            "bytes",
        ));
    }
    let needed = length + TAIL_BYTES;
    if needed > cursor.left() {
        return Err(SchemaError::Truncated {
            place: name(tag),
            offset: num::u64_of(at + HEAD_BYTES),
            expected: num::u64_of(needed),
            found: num::u64_of(cursor.left()),
        });
    }
    Ok(Head { tag, at, length })
}

/// The body of a structure after its check.
pub(crate) fn read_body<'a>(file: &'a [u8], head: &Head) -> Result<&'a [u8], SchemaError> {
    let start = head.at.min(file.len());
    let mut cursor = Cursor::new("structure", &file[start..], start);
    let whole = cursor.take(HEAD_BYTES + head.length)?;
    let stored = cursor.u32()?;
    let computed = crc32c::crc32c(whole);
    if stored != computed {
        return Err(SchemaError::Crc {
            place: name(head.tag),
            offset: num::u64_of(head.at),
            stored,
            computed,
        });
    }
    Ok(whole.get(HEAD_BYTES..).unwrap_or(&[]))
}
