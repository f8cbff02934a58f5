//! Which record a result was made from, and in what state it was found.

use schema::Record;
use schema::header::Origin;

/// What can be said of the seal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signature {
    /// Whole and unsigned: nothing was altered by accident, but who made it is unproven.
    Unsigned,
    /// Whole, with a signature that no key was given to check.
    Unchecked,
    /// Digest, checksum or structure do not hold.
    Broken,
}

impl Signature {
    /// The word in `summary.json`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Unsigned => "unsigned",
            Self::Unchecked => "unchecked",
            Self::Broken => "broken",
        }
    }
}

/// A record as it was found on disk.
#[derive(Clone, Copy, Debug)]
pub struct Case<'a> {
    /// File name without its folder.
    pub file: &'a str,
    /// Length of the file in bytes.
    pub bytes: usize,
    /// SHA-256 of the whole file, as `sha256sum` prints it.
    pub file_sha256: [u8; 32],
    /// The digest stored in the seal, over every byte before it; `None` where it could not be read.
    pub seal_sha256: Option<[u8; 32]>,
    /// State of the seal.
    pub signature: Signature,
    /// Each damage found, one sentence; empty for a whole record.
    pub damage: &'a [String],
    /// What was read.
    pub record: &'a Record,
}

impl Case<'_> {
    /// Time zero of the reconstruction on the monotonic grid: the first trigger, or else the first sample.
    #[must_use]
    pub fn zero_ns(&self) -> i64 {
        self.record.zero_ns()
    }

    /// Seconds from time zero.
    #[must_use]
    pub fn seconds(&self, monotonic_ns: i64) -> f64 {
        schema::num::real_i64(monotonic_ns.saturating_sub(self.zero_ns())) * 1e-9
    }

    /// UTC of a monotonic time, ns since 1970.
    #[must_use]
    pub fn utc_ns(&self, monotonic_ns: i64) -> i64 {
        monotonic_ns.saturating_add(self.record.header.clock.offset_ns)
    }

    /// True if the file is whole and says that nothing was cut.
    #[must_use]
    pub fn complete(&self) -> bool {
        self.record.completion.complete && self.signature != Signature::Broken
    }

    /// True if the record is a replay of a log.
    #[must_use]
    pub fn replayed(&self) -> bool {
        matches!(self.record.header.origin, Origin::Replay { .. })
    }

    /// How the record came to be, in words.
    #[must_use]
    pub fn origin(&self) -> String {
        match &self.record.header.origin {
            Origin::Live => "received live in the car".to_owned(),
            Origin::Replay { logs } => {
                let names: Vec<&str> = logs.iter().map(|l| l.name.as_str()).collect();
                format!("replayed from {}", names.join(", "))
            }
        }
    }

    /// What the seal proves, in one sentence.
    #[must_use]
    pub fn seal_sentence(&self) -> &'static str {
        match self.signature {
            Signature::Broken => {
                "The seal is broken: bytes of this file were altered, lost or added after it was sealed."
            }
            Signature::Unsigned => {
                "Every checksum and the digest hold, so the file is as it was sealed; it carries no signature, so who made it is unproven."
            }
            Signature::Unchecked => {
                "Every checksum and the digest hold; the file carries a signature, which was not checked against a key."
            }
        }
    }
}
