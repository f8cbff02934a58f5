//! What can be wrong with a record: where, what was expected, what was found.

use crate::seal::Hex;

/// An error of the record format. Offsets are bytes from the start of the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SchemaError {
    /// The file does not begin with the magic bytes.
    #[error("offset 0: expected the magic bytes {}, found {}", Hex(&crate::frame::MAGIC), Hex(.found))]
    Magic {
        /// The first bytes of the file, at most eight.
        found: Vec<u8>,
    },
    /// The file went through a transfer in text mode, which changes line ends.
    #[error("offset 0: expected the magic bytes {}, found {}: line ends were changed by a transfer in text mode", Hex(&crate::frame::MAGIC), Hex(.found))]
    TextMode {
        /// The first bytes of the file, at most eight.
        found: Vec<u8>,
    },
    /// The file is an encrypted envelope: it must be opened before it can be read.
    #[error("offset 0: expected a record, found an encrypted record: decrypt it first")]
    Encrypted,
    /// The format's major version is not known here.
    #[error("header, offset {offset}: expected format version {}.x, found {major}.{minor}", crate::header::FORMAT_VERSION.0)]
    Version {
        /// Offset of the version.
        offset: u64,
        /// Major version of the file.
        major: u16,
        /// Minor version of the file.
        minor: u16,
    },
    /// The file or a structure ends before what it holds.
    #[error("{place}, offset {offset}: expected {expected} more bytes, found {found}")]
    Truncated {
        /// Structure being read.
        place: String,
        /// Byte offset in the file.
        offset: u64,
        /// Bytes needed.
        expected: u64,
        /// Bytes left.
        found: u64,
    },
    /// Bytes follow where the file or the structure should end.
    #[error("{place}, offset {offset}: expected the end, found {found} more bytes")]
    Trailing {
        /// Structure that should have ended.
        place: String,
        /// Offset of the first byte too many.
        offset: u64,
        /// Number of bytes too many.
        found: u64,
    },
    /// Something is larger than its bound.
    #[error("{place}: expected at most {limit} {unit}, found {found}")]
    TooLarge {
        /// What is too large.
        place: String,
        /// The bound.
        limit: u64,
        /// The size found.
        found: u64,
        /// `bytes`, `blocks` and so on.
        unit: &'static str,
    },
    /// A checksum does not hold.
    #[error("{place}, offset {offset}: CRC-32C stored {stored:#010x}, computed {computed:#010x}")]
    Crc {
        /// Structure, or the head of a structure.
        place: String,
        /// Offset of the structure.
        offset: u64,
        /// Checksum in the file.
        stored: u32,
        /// Checksum of the bytes found.
        computed: u32,
    },
    /// A structure is missing, doubled or out of order.
    #[error("offset {offset}: expected {expected}, found {found}")]
    Order {
        /// Offset of the structure found.
        offset: u64,
        /// What should stand here.
        expected: String,
        /// What does.
        found: String,
    },
    /// A value that can not be.
    #[error("{place}{}, {field}: expected {expected}, found {found}", at(*.offset))]
    Value {
        /// Structure that holds it.
        place: String,
        /// Offset of the structure; `None` for a record in memory.
        offset: Option<u64>,
        /// The field.
        field: String,
        /// What is allowed.
        expected: String,
        /// What was found.
        found: String,
    },
    /// The bytes of a header or small part do not decode.
    #[error(
        "{place}, offset {offset}: expected its fields as laid down in FORMAT.md, found: {found}"
    )]
    Decode {
        /// Structure being read.
        place: String,
        /// Offset of its body.
        offset: u64,
        /// The decoder's finding.
        found: String,
    },
    /// A header or small part cannot be stored.
    #[error("{place}: expected it to fit {limit} bytes in every form, found: {found}")]
    Encode {
        /// Structure being written.
        place: String,
        /// Its bound in bytes.
        limit: u64,
        /// The encoder's finding.
        found: String,
    },
    /// The digest does not hold: the file is not what was sealed.
    #[error("seal, offset {offset}: SHA-256 stored {}, computed {}", Hex(.stored), Hex(.computed))]
    Digest {
        /// Offset of the stored digest.
        offset: u64,
        /// Digest in the file.
        stored: [u8; 32],
        /// Digest of the bytes before it.
        computed: [u8; 32],
    },
    /// The record could not be written out.
    #[error("writing the record: {0}")]
    Write(#[from] std::io::Error),
}

fn at(offset: Option<u64>) -> String {
    offset.map_or_else(String::new, |offset| format!(" at offset {offset}"))
}

/// A value that can not be, before it is known where it stands.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) field: String,
    pub(crate) expected: String,
    pub(crate) found: String,
}

impl Fault {
    pub(crate) fn new(
        field: impl Into<String>,
        expected: impl Into<String>,
        found: impl std::fmt::Display,
    ) -> Self {
        Self {
            field: field.into(),
            expected: expected.into(),
            found: found.to_string(),
        }
    }

    /// The error at its place in a file, or in memory.
    pub(crate) fn at(self, place: impl Into<String>, offset: Option<u64>) -> SchemaError {
        SchemaError::Value {
            place: place.into(),
            offset,
            field: self.field,
            expected: self.expected,
            found: self.found,
        }
    }
}
