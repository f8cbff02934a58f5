//! Opens the envelope of a record that is encrypted at rest: the cargo feature `age`.

use std::path::{Path, PathBuf};

use crate::cli::CliError;

/// Whom the record may be encrypted to.
#[derive(Debug, Clone, Default, clap::Args)]
pub(crate) struct Identity {
    /// File with the age identity (AGE-SECRET-KEY-1...) that opens encrypted records (.sve)
    #[arg(long, value_name = "FILE")]
    identity: Option<PathBuf>,
}

impl Identity {
    /// The sealed record within an envelope at `path`.
    pub(crate) fn open(&self, path: &Path, envelope: &[u8]) -> Result<Vec<u8>, CliError> {
        let Some(identity) = &self.identity else {
            return Err(CliError::Sealed {
                path: path.display().to_string(),
                found: "an encrypted record: give --identity FILE to open it".to_owned(),
            });
        };
        decrypt(identity, envelope).map_err(|found| CliError::Sealed {
            path: path.display().to_string(),
            found,
        })
    }
}

#[cfg(feature = "age")]
fn decrypt(identity: &Path, envelope: &[u8]) -> Result<Vec<u8>, String> {
    use std::io::Read;

    let limit = schema::num::u64_of(schema::limits::MAX_FILE_BYTES) + 1;
    let cannot = |error: &dyn std::fmt::Display| {
        format!(
            "an encrypted record that {} does not open: {error}",
            identity.display()
        )
    };
    let inner = schema::envelope::contents(envelope).unwrap_or(&[]);
    let mut text = String::new();
    std::fs::File::open(identity)
        .and_then(|file| file.take(65_536).read_to_string(&mut text))
        .map_err(|error| cannot(&error))?;
    let keys = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(str::parse::<age::x25519::Identity>)
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| cannot(&error))?;
    let decryptor = age::Decryptor::new_buffered(inner).map_err(|error| cannot(&error))?;
    let keys = keys.iter().map(|key| {
        let key: &dyn age::Identity = key;
        key
    });
    let mut plain = Vec::new();
    decryptor
        .decrypt(keys)
        .map_err(|error| cannot(&error))?
        .take(limit)
        .read_to_end(&mut plain)
        .map_err(|error| cannot(&error))?;
    Ok(plain)
}

#[cfg(not(feature = "age"))]
fn decrypt(_identity: &Path, _envelope: &[u8]) -> Result<Vec<u8>, String> {
    Err("an encrypted record, which takes a build with the cargo feature `age` to open".to_owned())
}
