//! The ledger on disk: read once, then only appended to, each entry certain before anything relies on it.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use schema::ledger::{Entry, FILE_NAME, Flags, Kind, LedgerError, MAGIC, MAX_LEDGER_BYTES};
use schema::{Ledger, PublicKey, SecretKey, num};

use super::Trouble;
use crate::storage::Storage;

/// What an entry is to say; the rest follows from its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Says {
    pub(super) kind: Kind,
    pub(super) flags: Flags,
    pub(super) number: u64,
    pub(super) utc_ns: i64,
    pub(super) sha256: [u8; 32],
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
    let temporary = dir.join(".ledger.part");
    let written: io::Result<()> = storage.create(&temporary).and_then(|mut file| {
        file.write_at(0, &MAGIC)?;
        file.sync()?;
        storage.rename(&temporary, path)?;
        storage.sync_folder(dir)
    });
    written.map_err(Trouble::at(path, "begin the ledger"))
}

fn set_aside(
    storage: &dyn Storage,
    dir: &Path,
    path: &Path,
    why: &str,
    notes: &mut Vec<String>,
) -> Result<(), Trouble> {
    let free = (1_u32..1_000_000)
        .map(|number| dir.join(format!("ledger-{number}.damaged")))
        .find(|name| matches!(storage.length(name), Err(e) if e.kind() == ErrorKind::NotFound));
    let Some(aside) = free else {
        return Ok(());
    };
    // A second name first, so that no cut leaves the folder without it.
    storage
        .link(path, &aside)
        .and_then(|()| storage.sync_folder(dir))
        .map_err(Trouble::at(&aside, "set the damaged ledger aside"))?;
    notes.push(format!(
        "{why}; the ledger is kept as {}, a new one begun",
        aside.display()
    ));
    begin(storage, dir, path)
}
