//! Opens a record: whole if it can, else what can still be read, with every damage named.

use std::io::Read;
use std::path::{Path, PathBuf};

use reconstruct::export::fixed::hex;
use reconstruct::report::case::{Case, Signature};
use schema::envelope::{self, MAX_ENVELOPE_BYTES};
use schema::seal::SealState;
use schema::{Record, Seal};
use sha2::{Digest, Sha256};

use crate::cli::decrypt::Identity;
use crate::cli::{CliError, GAPS, SOUND, complain};

/// A record as found on disk.
pub(crate) struct Loaded {
    name: String,
    bytes: usize,
    file_sha256: [u8; 32],
    seal_sha256: Option<[u8; 32]>,
    signature: Signature,
    damage: Vec<String>,
    /// The seal of a file that is whole.
    pub(crate) seal: Option<Seal>,
    /// The file is an encrypted envelope.
    pub(crate) encrypted: bool,
    /// What was read.
    pub(crate) record: Record,
}

/// Damages named one by one on standard error; the rest is counted.
const NAMED: usize = 20;

impl Loaded {
    /// Reads a file. A damaged one is salvaged, with a loud warning.
    pub(crate) fn open(path: &Path, identity: &Identity) -> Result<Self, CliError> {
        let mut bytes = Vec::new();
        let limit = schema::num::u64_of(MAX_ENVELOPE_BYTES) + 1;
        std::fs::File::open(path)
            .and_then(|file| file.take(limit).read_to_end(&mut bytes))
            .map_err(|error| CliError::file(path, error))?;
        let encrypted = envelope::contents(&bytes).is_some();
        let plain = if encrypted {
            &identity.open(path, &bytes)?
        } else {
            &bytes
        };
        let mut loaded = Self::decode(plain).map_err(|error| CliError::Record {
            path: path.display().to_string(),
            error: Box::new(error),
        })?;
        loaded.encrypted = encrypted;
        loaded.bytes = bytes.len();
        loaded.file_sha256 = Sha256::digest(&bytes).into();
        loaded.name = PathBuf::from(path)
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        loaded.warn(path);
        Ok(loaded)
    }

    fn decode(bytes: &[u8]) -> Result<Self, schema::SchemaError> {
        let file_sha256: [u8; 32] = Sha256::digest(bytes).into();
        let whole = |record, seal_sha256, signature, damage| Self {
            name: String::new(),
            bytes: bytes.len(),
            file_sha256,
            seal_sha256,
            signature,
            damage,
            seal: None,
            encrypted: false,
            record,
        };
        let first = match Record::read(bytes) {
            Ok((record, seal)) => {
                let signature = if seal.signature.is_some() {
                    Signature::Unchecked
                } else {
                    Signature::Unsigned
                };
                let mut loaded = whole(record, Some(seal.sha256), signature, Vec::new());
                loaded.seal = Some(seal);
                return Ok(loaded);
            }
            Err(error) => error,
        };
        let salvaged = Record::salvage(bytes)?;
        let mut damage: Vec<String> = salvaged.damage.iter().map(ToString::to_string).collect();
        if salvaged.unlisted > 0 {
            damage.push(format!("{} further damages", salvaged.unlisted));
        }
        let stored = match salvaged.seal {
            SealState::Sound(seal) => Some(seal.sha256),
            SealState::Broken { stored, computed } => {
                damage.push(format!(
                    "seal: SHA-256 stored {}, computed {}",
                    hex(&stored),
                    hex(&computed)
                ));
                Some(stored)
            }
            SealState::Missing => {
                damage.push("seal: none found; the file was cut or its end destroyed".to_owned());
                None
            }
        };
        if damage.is_empty() {
            damage.push(first.to_string());
        }
        Ok(whole(salvaged.record, stored, Signature::Broken, damage))
    }

    fn warn(&self, path: &Path) {
        if self.damage.is_empty() {
            return;
        }
        complain(
            "WARNING",
            &format!(
                "{}: the seal is BROKEN; going on with what can still be read",
                path.display()
            ),
        );
        for damage in self.damage.iter().take(NAMED) {
            complain("WARNING", damage);
        }
        if self.damage.len() > NAMED {
            complain("WARNING", &format!("{} more", self.damage.len() - NAMED));
        }
    }

    /// The record with what is known of its file.
    pub(crate) fn case(&self) -> Case<'_> {
        Case {
            file: &self.name,
            bytes: self.bytes,
            file_sha256: self.file_sha256,
            seal_sha256: self.seal_sha256,
            signature: self.signature,
            damage: &self.damage,
            record: &self.record,
        }
    }

    /// Exit code for a command that only shows the record.
    pub(crate) fn exit_code(&self) -> u8 {
        if self.case().complete() { SOUND } else { GAPS }
    }
}
