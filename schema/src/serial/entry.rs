//! A line of the list of files.

use super::auth::TAG_BYTES;
use super::message::{Fields, HEAD_BYTES, MessageError, PAGE_BYTES};
use super::{MAX_NAME, MAX_PACKET, name_is_allowed};

/// Bytes of an entry without its name.
const ENTRY_BYTES: usize = 4 + 8 + 8 + 32 + 1;

/// A file that can be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its place in the list, by which it is asked for.
    pub place: u32,
    /// Its bytes.
    pub length: u64,
    /// When it was last changed, UTC, seconds since 1970.
    pub changed_s: i64,
    /// SHA-256 over all of its bytes.
    pub sha256: [u8; 32],
    /// Its name.
    pub name: String,
}

impl Entry {
    pub(super) fn put(&self, out: &mut Vec<u8>) {
        out.extend(self.place.to_le_bytes());
        out.extend(self.length.to_le_bytes());
        out.extend(self.changed_s.to_le_bytes());
        out.extend(self.sha256);
        let name = self.name.as_bytes();
        let name = name.get(..MAX_NAME).unwrap_or(name);
        out.push(u8::try_from(name.len()).unwrap_or(0));
        out.extend(name);
    }

    pub(super) fn read(body: &mut Fields<'_>) -> Result<Self, MessageError> {
        let entry = Self {
            place: body.u32()?,
            length: body.u64()?,
            changed_s: body.array().map(i64::from_le_bytes)?,
            sha256: body.array()?,
            name: {
                let length = body.u8()?;
                let bytes = body.take(length.into())?.to_vec();
                String::from_utf8(bytes).map_err(|_| body.wrong())?
            },
        };
        // A name is used for a file: one that is not allowed is no name.
        if name_is_allowed(&entry.name) {
            Ok(entry)
        } else {
            Err(body.wrong())
        }
    }

    /// True if this entry still fits a page that holds `bytes` of entries; if so they are added to.
    #[must_use]
    pub fn fits(&self, bytes: &mut usize) -> bool {
        let needed = *bytes + ENTRY_BYTES + self.name.len();
        let fits = needed + HEAD_BYTES + PAGE_BYTES + TAG_BYTES <= MAX_PACKET;
        if fits {
            *bytes = needed;
        }
        fits
    }
}
