//! The seal: SHA-256 over every byte before it, then the place of the Ed25519 signature.

/// What the file's end says of its own integrity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// SHA-256 over every byte of the file before the digest.
    pub sha256: [u8; 32],
    /// Ed25519 signature over the domain string and the digest; `None` on unsigned (replayed) records.
    pub signature: Option<[u8; 64]>,
}
