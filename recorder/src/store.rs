//! Records on disk: written under a temporary name, synchronised, renamed; never over an existing file.
//!
//! A replay's records go through [`save`]: unsigned and in no ledger. Those of the car go through the [`Vault`].

pub mod encrypt;
mod ledger_file;
pub mod lock;
mod open;
mod room;
mod rotate;
#[cfg(test)]
mod tests;
mod vault;

pub use rotate::rotate;
pub use vault::{Held, RESERVE_BYTES, Sealed, Vault};

use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use schema::time::Stamp;
use schema::{Record, SchemaError, Seal};

use crate::error::RecorderError;

/// Most names that are tried for a record.
const MOST_NAMES: u32 = 100_000;

/// Writes a record into a folder as `YYYYMMDDThhmmssZ-NNNN.svb` (UTC of the first trigger, and the record's number,
/// or the next free one) and gives its path and seal. After it returns the record survives a loss of power.
///
/// # Errors
/// When the folder or the file can not be written, or the record can not be stored.
pub fn save(record: &Record, dir: &Path) -> Result<(PathBuf, Seal), RecorderError> {
    fs::create_dir_all(dir).map_err(RecorderError::io(dir, "create the folder of the records"))?;
    let temporary = dir.join(format!(
        ".{}-{}.part",
        stem(record, record.header.number),
        std::process::id()
    ));
    let written =
        write(record, &temporary).and_then(|seal| Ok((place(record, dir, &temporary)?, seal)));
    // On success the temporary name is a second link to the record; on failure it is all there is.
    let removed = fs::remove_file(&temporary);
    let (path, seal) = written?;
    match removed {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(RecorderError::io(&temporary, "remove the temporary file")(
                error,
            ));
        }
        _ => {}
    }
    File::open(dir)
        .and_then(|folder| folder.sync_all())
        .map_err(RecorderError::io(dir, "synchronise the folder"))?;
    Ok((path, seal))
}

fn write(record: &Record, path: &Path) -> Result<Seal, RecorderError> {
    let file = File::create(path).map_err(RecorderError::io(path, "create the record"))?;
    let mut out = BufWriter::new(file);
    let seal = record
        .write(&mut out)
        .map_err(|source| RecorderError::Record {
            path: path.to_path_buf(),
            source: Box::new(source),
        })?;
    out.flush()
        .map_err(RecorderError::io(path, "write the record"))?;
    out.get_ref()
        .sync_all()
        .map_err(RecorderError::io(path, "synchronise the record"))?;
    Ok(seal)
}

/// Gives the written file its name by a hard link, which fails where the name is taken (a rename would not).
fn place(record: &Record, dir: &Path, temporary: &Path) -> Result<PathBuf, RecorderError> {
    for step in 0..MOST_NAMES {
        let path = dir.join(format!(
            "{}.svb",
            stem(record, record.header.number + u64::from(step))
        ));
        match fs::hard_link(temporary, &path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            // A file system without hard links: rename, if the name is free.
            Err(_) if !path.exists() => {
                fs::rename(temporary, &path)
                    .map_err(RecorderError::io(&path, "name the record"))?;
                return Ok(path);
            }
            Err(_) => {}
        }
    }
    Err(RecorderError::io(dir, "find a free name for the record")(
        ErrorKind::AlreadyExists.into(),
    ))
}

fn stem(record: &Record, number: u64) -> String {
    stem_of(record.utc_ns(), number)
}

/// Name of a record without its ending: UTC of its first trigger, and its number.
fn stem_of(utc_ns: i64, number: u64) -> String {
    let stamp = Stamp::from_utc_ns(utc_ns);
    format!(
        "{:04}{:02}{:02}T{:02}{:02}{:02}Z-{number:04}",
        stamp.year, stamp.month, stamp.day, stamp.hour, stamp.minute, stamp.second
    )
}

/// Name of a record in the vault; `copy` counts from 1 where others have taken its name.
fn name_of(utc_ns: i64, number: u64, copy: u32, encrypted: bool) -> String {
    let ending = if encrypted {
        schema::envelope::SUFFIX
    } else {
        ".svb"
    };
    let stem = stem_of(utc_ns, number);
    if copy <= 1 {
        format!("{stem}{ending}")
    } else {
        format!("{stem}-{copy}{ending}")
    }
}

/// Holds a folder of records for one program: while the file lives no other program gets it.
///
/// # Errors
/// When another program holds it (`WouldBlock`), or the folder can not be used.
pub fn claim(dir: &Path) -> Result<File, RecorderError> {
    // The daemon's own: it holds the same lock on the same file.
    let path = dir.join("recorder.lock");
    let held = fs::create_dir_all(dir).and_then(|()| {
        let file = File::options()
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o640)
            .open(&path)?;
        match file.try_lock() {
            Ok(()) => Ok(file),
            Err(fs::TryLockError::WouldBlock) => Err(std::io::Error::new(
                ErrorKind::WouldBlock,
                "expected no other recorder on this folder, found one running",
            )),
            Err(fs::TryLockError::Error(error)) => Err(error),
        }
    });
    held.map_err(RecorderError::io(path, "hold the folder of the records"))
}

/// Why a record was not sealed. Each hands it back.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VaultError {
    /// The disk is full and nothing may be removed: to be tried again when space returns.
    #[error(
        "the disk is full and no older record may be removed for this one: record kept in memory"
    )]
    Full {
        /// The record.
        record: Box<Record>,
    },
    /// The disk failed: to be tried again.
    #[error("{}: {action}: {source}", path.display())]
    Storage {
        /// The record.
        record: Box<Record>,
        /// Which file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The record holds what can not be stored: trying again does not help.
    #[error("{}: {source}", path.display())]
    Record {
        /// The record.
        record: Box<Record>,
        /// Which file.
        path: PathBuf,
        /// Why.
        source: Box<SchemaError>,
    },
}

impl VaultError {
    /// The record.
    #[must_use]
    pub fn into_record(self) -> Record {
        match self {
            Self::Full { record } | Self::Storage { record, .. } | Self::Record { record, .. } => {
                *record
            }
        }
    }
}

/// What went wrong within the vault.
#[derive(Debug, thiserror::Error)]
enum Trouble {
    #[error("{}: {action}: {source}", path.display())]
    Io {
        path: PathBuf,
        action: &'static str,
        source: std::io::Error,
    },
    #[error("{}: {source}", path.display())]
    Record {
        path: PathBuf,
        source: Box<SchemaError>,
    },
}

impl Trouble {
    fn at(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io {
            path,
            action,
            source,
        }
    }

    fn record(path: &Path) -> impl FnOnce(SchemaError) -> Self {
        let path = path.to_path_buf();
        move |error| match error {
            SchemaError::Write(source) => Self::at(&path, "write the record")(source),
            other => Self::Record {
                path,
                source: Box::new(other),
            },
        }
    }

    /// No space left on the device, or none left in the quota.
    fn is_full(&self) -> bool {
        matches!(self, Self::Io { source, .. }
            if matches!(source.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded))
    }

    fn hand_back(self, record: Record) -> VaultError {
        let record = Box::new(record);
        if self.is_full() {
            return VaultError::Full { record };
        }
        match self {
            Self::Io {
                path,
                action,
                source,
            } => VaultError::Storage {
                record,
                path,
                action,
                source,
            },
            Self::Record { path, source } => VaultError::Record {
                record,
                path,
                source,
            },
        }
    }

    fn into_error(self) -> RecorderError {
        match self {
            Self::Io {
                path,
                action,
                source,
            } => RecorderError::Io {
                path,
                action,
                source,
            },
            Self::Record { path, source } => RecorderError::Record { path, source },
        }
    }
}
