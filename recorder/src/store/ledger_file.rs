//! The ledger on disk: read once, then only appended to, each entry certain before anything relies on it.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use schema::ledger::{Entry, FILE_NAME, Flags, Kind, LedgerError, MAGIC, MAX_LEDGER_BYTES};
use schema::{Ledger, PublicKey, Record, Seal, SecretKey, num};

use super::Trouble;
use crate::storage::Storage;

/// Files are compared in pieces of so many bytes.
const PIECE: usize = 1 << 20;

/// What an entry is to say; the rest follows from its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Says {
    pub(super) kind: Kind,
    pub(super) flags: Flags,
    pub(super) number: u64,
    pub(super) utc_ns: i64,
    pub(super) sha256: [u8; 32],
}

impl Says {
    /// A record was sealed.
    pub(super) fn sealed(record: &Record, seal: &Seal, flags: Flags) -> Self {
        Self {
            kind: Kind::Sealed,
            flags,
            number: record.header.number,
            utc_ns: record.utc_ns(),
            sha256: seal.sha256,
        }
    }
}

/// The end of the ledger, where the next entry goes.
#[derive(Debug)]
pub(super) struct LedgerFile {
    path: PathBuf,
    last: Option<Entry>,
    length: u64,
    key: Option<PublicKey>,
}

impl LedgerFile {
    /// Reads the ledger of a folder, or begins one; gives its entries. A last entry that a loss of power tore is left
    /// for the next to overwrite; a ledger that is damaged otherwise is set aside under another name.
    pub(super) fn open(
        storage: &dyn Storage,
        dir: &Path,
        notes: &mut Vec<String>,
    ) -> Result<(Self, Vec<Entry>), Trouble> {
        let path = dir.join(FILE_NAME);
        let bytes = match storage.read(&path, num::u64_of(MAX_LEDGER_BYTES)) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => {
                begin(storage, dir, &path)?;
                MAGIC.to_vec()
            }
            Err(error) if error.kind() == ErrorKind::InvalidData => {
                set_aside(storage, dir, &path, &error.to_string(), notes)?;
                MAGIC.to_vec()
            }
            Err(source) => return Err(Trouble::at(&path, "read the ledger")(source)),
        };
        let mut ledger = Ledger::read(&bytes);
        match &ledger.error {
            None => {}
            Some(error @ LedgerError::Torn { .. }) => notes.push(format!("{error}: cut")),
            Some(error) => {
                set_aside(storage, dir, &path, &error.to_string(), notes)?;
                ledger = Ledger::default();
            }
        }
        let file = Self {
            path,
            last: ledger.entries.last().copied(),
            length: ledger.sound_bytes(),
            key: ledger.key(),
        };
        Ok((file, ledger.entries))
    }

    /// The key in force.
    pub(super) fn key(&self) -> Option<PublicKey> {
        self.key
    }

    /// Appends an entry and returns when it is certain. After an error the next entry is written to the same place.
    pub(super) fn append(
        &mut self,
        storage: &dyn Storage,
        says: Says,
        key: Option<&SecretKey>,
    ) -> Result<(), Trouble> {
        let entry = Entry {
            kind: says.kind,
            flags: says.flags,
            number: says.number,
            utc_ns: says.utc_ns,
            sha256: says.sha256,
            previous_sha256: [0; 32],
            signature: None,
        }
        .signed(self.last.as_ref(), key);
        storage
            .open(&self.path)
            .and_then(|mut file| {
                file.write_at(self.length, &entry.to_bytes())?;
                file.sync()
            })
            .map_err(Trouble::at(&self.path, "append to the ledger"))?;
        self.length += num::u64_of(schema::ledger::ENTRY_BYTES);
        self.last = Some(entry);
        self.key = entry.new_key().or(self.key);
        Ok(())
    }

    /// Enters a new key, signed by `by`.
    pub(super) fn new_key(
        &mut self,
        storage: &dyn Storage,
        new: &PublicKey,
        by: &SecretKey,
        utc_ns: i64,
    ) -> Result<(), Trouble> {
        let says = Says {
            kind: Kind::NewKey,
            flags: Flags::default(),
            number: 0,
            utc_ns,
            sha256: new.to_bytes(),
        };
        self.append(storage, says, Some(by))
    }
}

/// An empty ledger, whole under its name or not at all.
fn begin(storage: &dyn Storage, dir: &Path, path: &Path) -> Result<(), Trouble> {
    let temporary = write_empty(storage, dir, path)?;
    put(storage, dir, &temporary, path)
}

/// An empty ledger under a temporary name. After an error nothing is left of it.
fn write_empty(storage: &dyn Storage, dir: &Path, path: &Path) -> Result<PathBuf, Trouble> {
    let temporary = dir.join(".ledger.part");
    let written: io::Result<()> = storage.create(&temporary).and_then(|mut file| {
        file.write_at(0, &MAGIC)?;
        file.sync()
    });
    match written {
        Ok(()) => Ok(temporary),
        Err(source) => {
            let _ = storage.remove(&temporary);
            Err(Trouble::at(path, "begin the ledger")(source))
        }
    }
}

/// Gives it its name.
fn put(storage: &dyn Storage, dir: &Path, temporary: &Path, path: &Path) -> Result<(), Trouble> {
    let named = storage.rename(temporary, path).inspect_err(|_| {
        let _ = storage.remove(temporary);
    });
    named
        .and_then(|()| storage.sync_folder(dir))
        .map_err(Trouble::at(path, "begin the ledger"))
}

/// Keeps a damaged ledger under another name and begins a new one. The new one is written first: where it can not be,
/// as on a full disk, all stays as it was, however often it is tried.
fn set_aside(
    storage: &dyn Storage,
    dir: &Path,
    path: &Path,
    why: &str,
    notes: &mut Vec<String>,
) -> Result<(), Trouble> {
    let temporary = write_empty(storage, dir, path)?;
    // A second name first, so that no cut leaves the folder without it.
    let aside = second_name(storage, dir, path).inspect_err(|_| {
        let _ = storage.remove(&temporary);
    })?;
    put(storage, dir, &temporary, path)?;
    notes.push(format!(
        "{why}; the ledger is kept as {}, a new one begun",
        aside.display()
    ));
    Ok(())
}

/// A second name for the damaged ledger: the last that was given if it is of the same bytes, as an earlier run that did
/// not come to its end leaves it; else a new one.
fn second_name(storage: &dyn Storage, dir: &Path, path: &Path) -> Result<PathBuf, Trouble> {
    let mut last = None;
    for number in 1_u32.. {
        let aside = dir.join(format!("ledger-{number}.damaged"));
        match storage.length(&aside) {
            Ok(_) => last = Some(aside),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                if let Some(last) = last.filter(|last| same_bytes(storage, path, last)) {
                    return Ok(last);
                }
                return storage
                    .link(path, &aside)
                    .and_then(|()| storage.sync_folder(dir))
                    .map(|()| aside.clone())
                    .map_err(Trouble::at(&aside, "set the damaged ledger aside"));
            }
            Err(source) => return Err(Trouble::at(&aside, "set the damaged ledger aside")(source)),
        }
    }
    let source = ErrorKind::AlreadyExists.into();
    Err(Trouble::at(path, "set the damaged ledger aside")(source))
}

/// Whether two files hold the same; false where one can not be read.
fn same_bytes(storage: &dyn Storage, one: &Path, other: &Path) -> bool {
    let (Ok(length), Ok(as_long)) = (storage.length(one), storage.length(other)) else {
        return false;
    };
    let mut pieces = (0..length).step_by(PIECE);
    length == as_long
        && pieces.all(|at| {
            let piece = |path| storage.read_range(path, at, PIECE).ok();
            piece(one).is_some_and(|bytes| Some(bytes) == piece(other))
        })
}
