//! The seal: SHA-256 over every byte before it, then the place of the Ed25519 signature.

use std::fmt;

use crate::key::PublicKey;

/// The signature is over these bytes and the digest, so that it can be taken for nothing else.
pub const SIGNATURE_DOMAIN: &[u8; 20] = b"svartboks record v1\0";
/// Seal of a record that carries no signature.
pub const UNSIGNED: u8 = 0;
/// Seal of a record that carries an Ed25519 signature.
pub const ED25519: u8 = 1;

/// What the file's end says of its own integrity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// SHA-256 over every byte of the file before the digest.
    pub sha256: [u8; 32],
    /// Ed25519 signature over the domain string and the digest; `None` on unsigned (replayed) records.
    pub signature: Option<[u8; 64]>,
}

impl Seal {
    /// Whether the record carries a signature of `key` over its digest. That the digest is that of the file is what
    /// [`crate::Record::read`] has checked.
    #[must_use]
    pub fn signed_by(&self, key: &PublicKey) -> bool {
        let message = signed_message(&self.sha256);
        self.signature
            .is_some_and(|signature| key.verifies(&message, &signature))
    }
}

/// What a damaged file's seal is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SealState {
    /// The digest holds: every byte before it is as it was sealed.
    Sound(Seal),
    /// The digest does not hold.
    Broken {
        /// Digest in the file.
        stored: [u8; 32],
        /// Digest of the bytes before it.
        computed: [u8; 32],
    },
    /// No seal was found: the file was cut, or its seal was destroyed.
    Missing,
}

/// The 52 bytes that are signed for a digest: [`SIGNATURE_DOMAIN`], then the digest.
#[must_use]
pub fn signed_message(sha256: &[u8; 32]) -> [u8; 52] {
    let mut message = [0; 52];
    let (domain, digest) = message.split_at_mut(SIGNATURE_DOMAIN.len());
    domain.copy_from_slice(SIGNATURE_DOMAIN);
    digest.copy_from_slice(sha256);
    message
}

/// Shows bytes as lower-case hexadecimal digits.
#[derive(Clone, Copy, Debug)]
pub struct Hex<'a>(pub &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}
