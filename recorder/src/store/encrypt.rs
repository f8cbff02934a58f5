//! Encryption at rest to a recipient's public key: the cargo feature `age`.

#[cfg(feature = "age")]
use std::io;
use std::io::Write;

use schema::{Record, SchemaError, Seal, SecretKey};

/// Whom records are encrypted to. Without the feature there is none.
#[derive(Clone, Debug)]
pub struct Recipient {
    #[cfg(feature = "age")]
    key: std::sync::Arc<str>,
    #[cfg(not(feature = "age"))]
    never: std::convert::Infallible,
}

/// Why nothing can be encrypted to a recipient.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("store.encrypt_to: expected {expected}, found {found}")]
pub struct RecipientError {
    expected: &'static str,
    found: String,
}

#[cfg(feature = "age")]
impl Recipient {
    /// A recipient from the text of an age public key, `age1...`.
    ///
    /// # Errors
    /// When it is none.
    pub fn parse(text: &str) -> Result<Self, RecipientError> {
        let key = std::sync::Arc::from(text.trim());
        match text.trim().parse::<age::x25519::Recipient>() {
            Ok(_) => Ok(Self { key }),
            Err(error) => Err(RecipientError {
                expected: "an age public key (age1...)",
                found: format!("`{text}` ({error})"),
            }),
        }
    }

    /// Writes the sealed record in its envelope.
    pub(super) fn write(
        &self,
        record: &Record,
        out: &mut impl Write,
        key: Option<&SecretKey>,
    ) -> Result<Seal, SchemaError> {
        let other = |error: &dyn std::fmt::Display| io::Error::other(error.to_string());
        let recipient: age::x25519::Recipient = self.key.parse().map_err(|e| other(&e))?;
        let recipients = std::iter::once::<&dyn age::Recipient>(&recipient);
        let encryptor = age::Encryptor::with_recipients(recipients).map_err(|e| other(&e))?;
        out.write_all(&schema::envelope::MAGIC)?;
        let mut inner = encryptor.wrap_output(out)?;
        let seal = record.write_signed(&mut inner, key)?;
        inner.finish()?;
        Ok(seal)
    }
}

#[cfg(not(feature = "age"))]
impl Recipient {
    /// A recipient from the text of an age public key, `age1...`.
    ///
    /// # Errors
    /// Always: this build can not encrypt.
    pub fn parse(text: &str) -> Result<Self, RecipientError> {
        Err(RecipientError {
            expected: "a build with the cargo feature `age`",
            found: format!("`{text}` and a build without it"),
        })
    }

    #[allow(
        clippy::unused_self,
        reason = "the counterpart of the build that can encrypt"
    )]
    pub(super) fn write(
        &self,
        _record: &Record,
        _out: &mut impl Write,
        _key: Option<&SecretKey>,
    ) -> Result<Seal, SchemaError> {
        match self.never {}
    }
}
