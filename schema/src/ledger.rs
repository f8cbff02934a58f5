//! The ledger: number and digest of every record ever sealed, also of those that were removed since. Signed entry by
//! entry, each naming the digest of the one before; only ever appended to (`FORMAT.md`, 7.1).
//!
//! [`Ledger::read`] is total: any bytes give entries, and the first error. [`audit`] says what the entries show.

pub mod audit;

use sha2::{Digest, Sha256};

use crate::key::{PublicKey, SecretKey};
use crate::num;
use crate::seal::{ED25519, UNSIGNED};

/// What every ledger begins with.
pub const MAGIC: [u8; 8] = *b"\x89SVL\r\n\x1a\n";
/// Name of the ledger in the folder of the records.
pub const FILE_NAME: &str = "ledger.svl";
/// Bytes of an entry.
pub const ENTRY_BYTES: usize = 156;
/// Bytes of the longest ledger that is read: 430,000 entries.
pub const MAX_LEDGER_BYTES: usize = 64 << 20;
/// An entry's signature is over these bytes and a digest.
pub const SIGNATURE_DOMAIN: &[u8; 20] = b"svartboks ledger v1\0";

/// Bytes of an entry that its signature is over.
const SIGNED: usize = 88;
/// Bytes of an entry before its check.
const CHECKED: usize = ENTRY_BYTES - 4;

/// What an entry says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A record was sealed.
    Sealed,
    /// A record was removed, by the rule of how many to keep or to make room for a new one.
    Removed,
    /// Entries and records from here on are signed by a new key; the first such entry introduces the first key.
    NewKey,
}

impl Kind {
    fn code(self) -> u8 {
        match self {
            Self::Sealed => 1,
            Self::Removed => 2,
            Self::NewKey => 3,
        }
    }
}

/// What else is said of a sealed record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags {
    /// It is never removed (delta-V above 25 km/h).
    pub locked: bool,
    /// Its file is an encrypted envelope.
    pub encrypted: bool,
    /// It was found in the folder without an entry, and entered after the fact.
    pub adopted: bool,
    /// It goes before the record of a crash does.
    pub weak: Weak,
}

/// Whether a record gives way to those of crashes, as none of its triggers was a peak, a delta-V or a CAN signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weak {
    /// It does not: it is, or may be, one of a crash.
    #[default]
    No,
    /// All its triggers were set by hand or by a loss of power.
    Yes,
    /// As before, and all by a loss of power.
    PowerLoss,
}

impl Weak {
    /// True for either kind of weak record.
    #[must_use]
    pub fn is_weak(self) -> bool {
        self != Self::No
    }

    fn code(self) -> u8 {
        match self {
            Self::No => 0,
            Self::Yes => 8,
            Self::PowerLoss => 8 | 16,
        }
    }

    fn from_code(code: u8) -> Option<Self> {
        let all = [Self::No, Self::Yes, Self::PowerLoss];
        all.into_iter().find(|weak| weak.code() == code & (8 | 16))
    }
}

impl Flags {
    fn code(self) -> u8 {
        let adopted = u8::from(self.adopted) << 2;
        u8::from(self.locked) | u8::from(self.encrypted) << 1 | adopted | self.weak.code()
    }

    fn from_code(code: u8) -> Option<Self> {
        let weak = Weak::from_code(code)?;
        (code < 32).then_some(Self {
            locked: code & 1 != 0,
            encrypted: code & 2 != 0,
            adopted: code & 4 != 0,
            weak,
        })
    }
}

/// An entry as it was read, or as it is to be written by [`Entry::signed`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// What it says.
    pub kind: Kind,
    /// Of the record; none set unless [`Kind::Sealed`].
    pub flags: Flags,
    /// Number of the record; 0 for [`Kind::NewKey`].
    pub number: u64,
    /// UTC, ns since 1970. [`Kind::Sealed`]: exactly `monotonic_ns + clock.offset_ns` of the record's first trigger
    /// (of its first sample if it has none). [`Kind::Removed`]: the same of the record that was to be sealed, 0 if there
    /// was none. [`Kind::NewKey`]: when it was made, 0 if that is not known.
    pub utc_ns: i64,
    /// Digest of the record; the 32 bytes of the new public key for [`Kind::NewKey`].
    pub sha256: [u8; 32],
    /// [`Entry::digest`] of the entry before; zeros in the first.
    pub previous_sha256: [u8; 32],
    /// Ed25519 signature; `None`: unsigned.
    pub signature: Option<[u8; 64]>,
}

impl Entry {
    /// This entry behind `previous`, signed by `key`; unsigned without one.
    #[must_use]
    pub fn signed(mut self, previous: Option<&Self>, key: Option<&SecretKey>) -> Self {
        self.previous_sha256 = previous.map_or([0; 32], Self::digest);
        self.signature = key.map(|_| [0; 64]);
        self.signature = key.map(|key| key.sign(&self.signed_message()));
        self
    }

    /// Whether its signature is one of `key`.
    #[must_use]
    pub fn signed_by(&self, key: &PublicKey) -> bool {
        let message = self.signed_message();
        self.signature
            .is_some_and(|signature| key.verifies(&message, &signature))
    }

    /// SHA-256 of its bytes before the check: what the next entry names.
    #[must_use]
    pub fn digest(&self) -> [u8; 32] {
        let bytes = self.to_bytes();
        Sha256::digest(bytes.get(..CHECKED).unwrap_or(&bytes)).into()
    }

    /// The key that a [`Kind::NewKey`] introduces; `None` for other kinds, or where the bytes are no key.
    #[must_use]
    pub fn new_key(&self) -> Option<PublicKey> {
        (self.kind == Kind::NewKey)
            .then(|| PublicKey::from_bytes(&self.sha256).ok())
            .flatten()
    }

    /// Its 156 bytes.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; ENTRY_BYTES] {
        let kind = if self.signature.is_some() {
            ED25519
        } else {
            UNSIGNED
        };
        let head = [self.kind.code(), kind, self.flags.code(), 0, 0, 0, 0, 0];
        let number = self.number.to_le_bytes();
        let utc = self.utc_ns.to_le_bytes();
        let signature = self.signature.unwrap_or([0; 64]);
        let fields: [&[u8]; 6] = [
            &head,
            &number,
            &utc,
            &self.sha256,
            &self.previous_sha256,
            &signature,
        ];
        let check = fields
            .iter()
            .fold(0, |check, bytes| crc32c::crc32c_append(check, bytes));
        let mut bytes = [0; ENTRY_BYTES];
        let all = fields.iter().copied().flatten().copied();
        for (place, byte) in bytes.iter_mut().zip(all.chain(check.to_le_bytes())) {
            *place = byte;
        }
        bytes
    }

    fn signed_message(&self) -> [u8; 52] {
        let bytes = self.to_bytes();
        let digest: [u8; 32] = Sha256::digest(bytes.get(..SIGNED).unwrap_or(&bytes)).into();
        let mut message = [0; 52];
        let (domain, rest) = message.split_at_mut(SIGNATURE_DOMAIN.len());
        domain.copy_from_slice(SIGNATURE_DOMAIN);
        rest.copy_from_slice(&digest);
        message
    }

    /// Decodes 156 bytes; what is wrong as field, expected, found.
    fn decode(bytes: &[u8; ENTRY_BYTES]) -> Result<Self, (&'static str, String, String)> {
        let (stored, computed) = checks(bytes);
        if stored != computed {
            let found = format!("{stored:#010x}");
            return Err(("CRC-32C", format!("{computed:#010x}"), found));
        }
        let [kind, signed, flags, zeros @ .., _, _, _, _, _] = at::<13>(bytes, 0);
        let kind = match kind {
            1 => Kind::Sealed,
            2 => Kind::Removed,
            3 => Kind::NewKey,
            other => return Err(("kind", "1 to 3".to_owned(), other.to_string())),
        };
        let signature = at::<64>(bytes, 88);
        let signature = match signed {
            UNSIGNED if signature == [0; 64] => None,
            UNSIGNED => {
                let found = "others".to_owned();
                return Err(("signature", "zeros, being unsigned".to_owned(), found));
            }
            ED25519 => Some(signature),
            other => {
                let expected = "0 (unsigned) or 1 (Ed25519)".to_owned();
                return Err(("kind of signature", expected, other.to_string()));
            }
        };
        let found = flags;
        let flags = Flags::from_code(flags)
            .filter(|flags| kind == Kind::Sealed || *flags == Flags::default())
            .ok_or_else(|| {
                let expected = "0 to 15 or 24 to 31, and 0 unless a record was sealed".to_owned();
                ("flags", expected, found.to_string())
            })?;
        if zeros != [0; 5] {
            let found = "others".to_owned();
            return Err(("bytes 3 to 8", "zeros".to_owned(), found));
        }
        let number = u64::from_le_bytes(at(bytes, 8));
        if (number == 0) != (kind == Kind::NewKey) {
            let expected = "0 for a new key, else 1 or more".to_owned();
            return Err(("number", expected, number.to_string()));
        }
        let entry = Self {
            kind,
            flags,
            number,
            utc_ns: i64::from_le_bytes(at(bytes, 16)),
            sha256: at(bytes, 24),
            previous_sha256: at(bytes, 56),
            signature,
        };
        if kind == Kind::NewKey && entry.new_key().is_none() {
            let found = "32 bytes that are none".to_owned();
            return Err(("new key", "an Ed25519 public key".to_owned(), found));
        }
        Ok(entry)
    }
}

/// Stored and computed check.
fn checks(bytes: &[u8; ENTRY_BYTES]) -> (u32, u32) {
    let stored = u32::from_le_bytes(at(bytes, CHECKED));
    let computed = crc32c::crc32c(bytes.get(..CHECKED).unwrap_or(bytes));
    (stored, computed)
}

/// `N` bytes at an offset; zeros beyond the end, which no caller asks for.
fn at<const N: usize>(bytes: &[u8], offset: usize) -> [u8; N] {
    let mut array = [0; N];
    if let Some(found) = bytes.get(offset..offset + N) {
        array.copy_from_slice(found);
    }
    array
}

/// What is wrong with a ledger's bytes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LedgerError {
    /// No ledger.
    #[error("ledger, offset 0: expected the magic bytes of a ledger, found {found}")]
    Magic {
        /// The first bytes, in hexadecimal digits.
        found: String,
    },
    /// Longer than any that is read.
    #[error("ledger: expected at most {MAX_LEDGER_BYTES} bytes, found {found}")]
    TooLarge {
        /// Bytes found.
        found: u64,
    },
    /// The last entry is not whole: what a loss of power leaves while it is being written.
    #[error(
        "ledger, offset {offset}, entry {entry}: expected {ENTRY_BYTES} sound bytes, found {found} at the end: the last entry is torn"
    )]
    Torn {
        /// Its first byte.
        offset: u64,
        /// Its place, from 1.
        entry: usize,
        /// Bytes found.
        found: usize,
    },
    /// An entry holds what can not be, or does not follow the one before.
    #[error("ledger, offset {offset}, entry {entry}, {field}: expected {expected}, found {found}")]
    Entry {
        /// Its first byte.
        offset: u64,
        /// Its place, from 1.
        entry: usize,
        /// The field.
        field: &'static str,
        /// What is allowed.
        expected: String,
        /// What was found.
        found: String,
    },
}

/// A ledger as found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ledger {
    /// Its entries up to the first that is wrong; each names the one before.
    pub entries: Vec<Entry>,
    /// The first thing found wrong; what follows it is not read.
    pub error: Option<LedgerError>,
}

impl Ledger {
    /// Reads a ledger. Any bytes give a value; memory is bounded by their number.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Self {
        let mut ledger = Self::default();
        if bytes.len() > MAX_LEDGER_BYTES {
            let found = num::u64_of(bytes.len());
            ledger.error = Some(LedgerError::TooLarge { found });
            return ledger;
        }
        let Some(rest) = bytes.strip_prefix(&MAGIC) else {
            let found = bytes.get(..MAGIC.len()).unwrap_or(bytes);
            let found = crate::seal::Hex(found).to_string();
            ledger.error = Some(LedgerError::Magic { found });
            return ledger;
        };
        let (whole, torn) = rest.as_chunks::<ENTRY_BYTES>();
        for (place, entry) in whole.iter().enumerate() {
            let last = place + 1 == whole.len() && torn.is_empty();
            match ledger.follow(entry) {
                Ok(entry) => ledger.entries.push(entry),
                Err(("CRC-32C", ..)) if last => {
                    ledger.error = Some(ledger.torn(ENTRY_BYTES));
                    return ledger;
                }
                Err((field, expected, found)) => {
                    ledger.error = Some(LedgerError::Entry {
                        offset: ledger.sound_bytes(),
                        entry: place + 1,
                        field,
                        expected,
                        found,
                    });
                    return ledger;
                }
            }
        }
        if !torn.is_empty() {
            ledger.error = Some(ledger.torn(torn.len()));
        }
        ledger
    }

    /// Bytes from the start in which nothing is wrong; the next entry belongs here.
    #[must_use]
    pub fn sound_bytes(&self) -> u64 {
        num::u64_of(MAGIC.len() + self.entries.len() * ENTRY_BYTES)
    }

    /// The key in force at the end: that of the last [`Kind::NewKey`].
    #[must_use]
    pub fn key(&self) -> Option<PublicKey> {
        self.entries.iter().rev().find_map(Entry::new_key)
    }

    fn torn(&self, found: usize) -> LedgerError {
        LedgerError::Torn {
            offset: self.sound_bytes(),
            entry: self.entries.len() + 1,
            found,
        }
    }

    fn follow(&self, bytes: &[u8; ENTRY_BYTES]) -> Result<Entry, (&'static str, String, String)> {
        let entry = Entry::decode(bytes)?;
        let expected = self.entries.last().map_or([0; 32], Entry::digest);
        if entry.previous_sha256 == expected {
            return Ok(entry);
        }
        let hex = |bytes: &[u8; 32]| crate::seal::Hex(bytes).to_string();
        Err((
            "digest of the entry before",
            hex(&expected),
            hex(&entry.previous_sha256),
        ))
    }
}
