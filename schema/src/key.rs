//! The device's Ed25519 key: it signs records ([`crate::seal`]) and ledger entries ([`crate::ledger`]).
//!
//! In a file a key is one line: what it is, a space, 64 hexadecimal digits (`FORMAT.md`, 7.3).

use std::fmt;

use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use sha2::{Digest, Sha256};
use zeroize::Zeroizing;

use crate::seal::Hex;

/// What the line of a secret key begins with.
pub const SECRET_PREFIX: &str = "svartboks-secret-key-1";
/// What the line of a public key begins with.
pub const PUBLIC_PREFIX: &str = "svartboks-public-key-1";
/// A key's text is never longer, bytes.
pub const MAX_TEXT_BYTES: usize = 128;

/// What is wrong with a key's text. No error holds anything of the text itself, which may be secret.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KeyError {
    /// It does not say that it is such a key.
    #[error("expected one line `{expected} ` and 64 hexadecimal digits, found something else")]
    Prefix {
        /// What it should begin with.
        expected: &'static str,
    },
    /// A secret key where a public one belongs, or the other way round.
    #[error("expected a line that begins with `{expected}`, found one that begins with `{found}`")]
    Other {
        /// What it should begin with.
        expected: &'static str,
        /// What it does begin with.
        found: &'static str,
    },
    /// The digits are not 64, or no digits.
    #[error(
        "expected 64 hexadecimal digits behind `{expected} `, found {found} characters, or others"
    )]
    Digits {
        /// The prefix.
        expected: &'static str,
        /// Characters found.
        found: usize,
    },
    /// The 32 bytes are no point of the curve, or one of the few that fit many signatures.
    #[error("expected an Ed25519 public key, found 32 bytes that are none, or a weak one")]
    Point,
}

/// The secret half. It is wiped from memory when dropped, and never shown by `Debug`.
pub struct SecretKey(SigningKey);

impl SecretKey {
    /// A key from 32 secret random bytes.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; 32]) -> Self {
        Self(SigningKey::from_bytes(bytes))
    }

    /// A key from the text of its file.
    ///
    /// # Errors
    /// When the text is not one line of that form.
    pub fn from_text(text: &str) -> Result<Self, KeyError> {
        let bytes = Zeroizing::new(parse(text, SECRET_PREFIX, PUBLIC_PREFIX)?);
        Ok(Self::from_bytes(&bytes))
    }

    /// The text of its file, wiped when dropped.
    #[must_use]
    pub fn to_text(&self) -> Zeroizing<String> {
        let bytes = Zeroizing::new(self.0.to_bytes());
        Zeroizing::new(format!("{SECRET_PREFIX} {}\n", Hex(&*bytes)))
    }

    /// The public half.
    #[must_use]
    pub fn public(&self) -> PublicKey {
        PublicKey(self.0.verifying_key())
    }

    /// Signs a message. The same message gives the same signature.
    #[must_use]
    pub fn sign(&self, message: &[u8]) -> [u8; 64] {
        self.0.sign(message).to_bytes()
    }
}

impl Clone for SecretKey {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl fmt::Debug for SecretKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SecretKey(of {})", self.public())
    }
}

/// The public half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PublicKey(VerifyingKey);

impl PublicKey {
    /// A key from its 32 bytes.
    ///
    /// # Errors
    /// When they are no point of the curve, or a weak one.
    pub fn from_bytes(bytes: &[u8; 32]) -> Result<Self, KeyError> {
        match VerifyingKey::from_bytes(bytes) {
            Ok(key) if !key.is_weak() => Ok(Self(key)),
            _ => Err(KeyError::Point),
        }
    }

    /// A key from the text of its file.
    ///
    /// # Errors
    /// When the text is not one line of that form, or the bytes are no key.
    pub fn from_text(text: &str) -> Result<Self, KeyError> {
        Self::from_bytes(&parse(text, PUBLIC_PREFIX, SECRET_PREFIX)?)
    }

    /// The text of its file.
    #[must_use]
    pub fn to_text(&self) -> String {
        format!("{PUBLIC_PREFIX} {}\n", Hex(self.0.as_bytes()))
    }

    /// The 32 bytes of RFC 8032.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; 32] {
        self.0.to_bytes()
    }

    /// Whether the signature is one of this key over the message. Strict: no second form of a signature passes.
    #[must_use]
    pub fn verifies(&self, message: &[u8], signature: &[u8; 64]) -> bool {
        let signature = Signature::from_bytes(signature);
        self.0.verify_strict(message, &signature).is_ok()
    }

    /// A short name to compare by eye: the first 16 bytes of the SHA-256 of the 32 bytes, in hexadecimal digits.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let digest: [u8; 32] = Sha256::digest(self.0.as_bytes()).into();
        Hex(digest.get(..16).unwrap_or(&digest)).to_string()
    }
}

impl fmt::Display for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.fingerprint())
    }
}

fn parse(text: &str, expected: &'static str, other: &'static str) -> Result<[u8; 32], KeyError> {
    let mut words = text.split_ascii_whitespace();
    match words.next() {
        Some(found) if found == expected => {}
        Some(found) if found == other => {
            return Err(KeyError::Other {
                expected,
                found: other,
            });
        }
        _ => return Err(KeyError::Prefix { expected }),
    }
    let digits = words.next().unwrap_or("").as_bytes();
    if words.next().is_some() || text.trim_end().contains(['\n', '\r']) {
        return Err(KeyError::Prefix { expected });
    }
    let wrong = KeyError::Digits {
        expected,
        found: digits.len(),
    };
    if digits.len() != 64 {
        return Err(wrong);
    }
    let mut bytes = [0; 32];
    for (byte, pair) in bytes.iter_mut().zip(digits.chunks_exact(2)) {
        let [high, low] = [pair.first(), pair.last()].map(|digit| {
            let digit = char::from(*digit?).to_digit(16)?;
            u8::try_from(digit).ok()
        });
        *byte = high.ok_or(wrong)? << 4 | low.ok_or(wrong)?;
    }
    Ok(bytes)
}
