//! The vault: sealed records in one folder, chained, entered in the ledger, kept by rule.
//!
//! **Order.** A record is written under a temporary name and synchronised, the name too; then its entry is appended to
//! the ledger and synchronised; then it gets its own name and the folder is synchronised; then [`Vault::seal`] returns.
//! A cut before the entry is whole leaves a temporary file that [`Vault::open`] finishes if it is whole and discards
//! if not; a cut after it leaves one that it names. So an entry always has its record, and number, digest and chain
//! never depend on where the cut came.
//!
//! **Keep rule.** The newest `keep` records are kept, and every locked one ([`super::lock`]); the others go, oldest
//! first, but weak ones (by hand, loss of power) before any of a crash, also from among the newest `keep`
//! ([`super::room`]). The ledger says so before a file goes.
//!
//! **Disk full.** First the reserve is given up (a file of [`RESERVE_BYTES`], made anew when there is room), then
//! weak records go, oldest first, then, for one of a crash, other unlocked ones, also among the newest `keep`: a new
//! crash counts for more than an old and light one. If nothing can go the record is handed back in
//! [`VaultError::Full`].

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use schema::header::Origin;
use schema::ledger::{Flags, Kind, Weak};
use schema::{PublicKey, Record, Seal, SecretKey, num};

use super::encrypt::Recipient;
use super::ledger_file::{LedgerFile, Says};
use super::lock;
use super::{Trouble, VaultError, name_of};
use crate::storage::{Storage, Stored};

/// Bytes that are set aside to seal a record, and its entries, on a disk that is full.
pub const RESERVE_BYTES: u64 = 4 << 20;
/// Ending of a temporary name.
pub(super) const PART: &str = ".sealing";
/// Bytes that are collected before they are written.
const BUFFER: usize = 64 * 1024;

/// A record in the vault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held {
    /// Its file.
    pub path: PathBuf,
    /// Its number.
    pub number: u64,
    /// UTC of its first trigger, ns since 1970.
    pub utc_ns: i64,
    /// Its digest.
    pub sha256: [u8; 32],
    /// It is never removed.
    pub locked: bool,
    /// Its file is an encrypted envelope.
    pub encrypted: bool,
    /// It goes before the record of a crash does, unless it is locked.
    pub weak: Weak,
}

impl Held {
    /// The record of an entry.
    pub(super) fn new(path: PathBuf, says: &Says) -> Self {
        Self {
            path,
            number: says.number,
            utc_ns: says.utc_ns,
            sha256: says.sha256,
            locked: says.flags.locked,
            encrypted: says.flags.encrypted,
            weak: says.flags.weak,
        }
    }
}

/// What became of a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sealed {
    /// Its file.
    pub path: PathBuf,
    /// Its number.
    pub number: u64,
    /// Its seal.
    pub seal: Seal,
    /// It is never removed.
    pub locked: bool,
    /// It was there already: an event with the same UTC of its first trigger had been sealed before.
    pub already: bool,
    /// Files that were removed for it, by the keep rule or to make room.
    pub removed: Vec<PathBuf>,
    /// What else happened, one sentence each.
    pub notes: Vec<String>,
}

/// How far a record has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
pub(super) enum Stage {
    /// Whole under its temporary name, which is certain.
    Written,
    /// Entered in the ledger.
    Entered,
    /// Under its own name, which is not certain yet.
    Named,
}

/// A record between its temporary name and its own.
#[derive(Clone, Debug)]
pub(super) struct Pending {
    pub(super) temporary: PathBuf,
    pub(super) held: Held,
    pub(super) flags: Flags,
    pub(super) seal: Seal,
    pub(super) stage: Stage,
}

/// See the module's text.
pub struct Vault {
    pub(super) storage: Arc<dyn Storage>,
    pub(super) dir: PathBuf,
    pub(super) keep: usize,
    pub(super) key: Option<SecretKey>,
    pub(super) recipient: Option<Recipient>,
    pub(super) ledger: LedgerFile,
    /// Records that are there, by number.
    pub(super) held: BTreeMap<u64, Held>,
    /// Events that were sealed and are there or were removed by rule: UTC, number.
    pub(super) events: BTreeMap<i64, u64>,
    /// Number and digest of the newest record ever sealed.
    pub(super) newest: (u64, [u8; 32]),
    pub(super) pending: Option<Pending>,
    pub(super) reserve: bool,
    pub(super) reserve_bytes: u64,
}

impl Vault {
    /// Seals a record: sets its number, the digest of the record before, and its origin (live), writes it signed, and
    /// returns when it would survive a loss of power. An event that has been sealed already ([`Vault::sealed_already`])
    /// is not sealed again, so that a call may be repeated after an error or a restart.
    ///
    /// # Errors
    /// [`VaultError::Full`] when the disk is full and nothing may be removed, others where the disk fails or the record
    /// can not be stored; each hands the record back.
    pub fn seal(&mut self, mut record: Record) -> Result<Sealed, VaultError> {
        let mut report = Report::default();
        let utc_ns = record.utc_ns();
        let done = self.seal_steps(&mut record, utc_ns, &mut report);
        let (held, seal, already) = match done {
            Ok(done) => done,
            Err(trouble) => return Err(trouble.hand_back(record)),
        };
        if let Err(trouble) = self.keep_rule(utc_ns, &mut report) {
            report
                .notes
                .push(format!("older records could not be removed: {trouble}"));
        }
        self.tend();
        Ok(Sealed {
            path: held.path,
            number: held.number,
            seal,
            locked: held.locked,
            already,
            removed: report.removed,
            notes: report.notes,
        })
    }

    fn seal_steps(
        &mut self,
        record: &mut Record,
        utc_ns: i64,
        report: &mut Report,
    ) -> Result<(Held, Seal, bool), Trouble> {
        let before = self.pending.clone();
        self.finish(utc_ns, report)?;
        if let Some(pending) = before.filter(|pending| pending.held.utc_ns == utc_ns) {
            return Ok((pending.held, pending.seal, false));
        }
        if let Some(number) = self.events.get(&utc_ns).copied() {
            let (held, seal) = self.earlier(number, utc_ns);
            return Ok((held, seal, true));
        }
        self.enter_key(lock::weakness(record), report)?;
        record.header.number = self.newest.0 + 1;
        record.header.previous_sha256 = self.newest.1;
        record.header.origin = Origin::Live;
        let pending = self.prepare(record, utc_ns, report)?;
        self.pending = Some(pending.clone());
        self.finish(utc_ns, report)?;
        Ok((pending.held, pending.seal, false))
    }

    /// True where the event whose first trigger was at this UTC (exactly, ns since 1970) has been sealed: its record is
    /// there, or was removed by the keep rule.
    #[must_use]
    pub fn sealed_already(&self, utc_of_first_trigger_ns: i64) -> bool {
        self.events.contains_key(&utc_of_first_trigger_ns)
    }

    /// The records that are there, by number.
    pub fn records(&self) -> impl Iterator<Item = &Held> {
        self.held.values()
    }

    /// Number of the newest record ever sealed; 0 if there is none.
    #[must_use]
    pub fn newest_number(&self) -> u64 {
        self.newest.0
    }

    /// The key that signs; `None`: records are not signed.
    #[must_use]
    pub fn public_key(&self) -> Option<PublicKey> {
        self.key.as_ref().map(SecretKey::public)
    }

    /// The folder of the records.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.dir
    }

    /// Another number of records to keep; takes effect when the next is sealed.
    pub fn set_keep(&mut self, keep: usize) {
        self.keep = keep.max(1);
    }

    /// Writes the record under a temporary name, with room made for it.
    fn prepare(
        &mut self,
        record: &Record,
        utc_ns: i64,
        report: &mut Report,
    ) -> Result<Pending, Trouble> {
        let encrypted = self.recipient.is_some();
        let number = record.header.number;
        let flags = lock::flags(record, encrypted, false);
        let name = self.free_name(utc_ns, number, encrypted);
        let temporary = self.dir.join(format!(".{name}{PART}"));
        let seal = loop {
            match self.write(record, &temporary) {
                Ok(seal) => break seal,
                Err(trouble) => {
                    // What is left of it is in the way of the next try, or of nothing.
                    let _ = self.storage.remove(&temporary);
                    if !trouble.is_full() || !self.make_room(utc_ns, flags.weak, report)? {
                        return Err(trouble);
                    }
                }
            }
        };
        let says = Says::sealed(record, &seal, flags);
        Ok(Pending {
            temporary,
            held: Held::new(self.dir.join(name), &says),
            flags,
            seal,
            stage: Stage::Written,
        })
    }

    fn write(&self, record: &Record, path: &Path) -> Result<Seal, Trouble> {
        let file = self.storage.create(path);
        let mut out = Output::new(file.map_err(Trouble::at(path, "create the record"))?);
        let key = self.key.as_ref();
        let written = match &self.recipient {
            None => record.write_signed(&mut out, key),
            Some(recipient) => recipient.write(record, &mut out, key),
        };
        let seal = written.map_err(Trouble::record(path))?;
        out.flush()
            .and_then(|()| out.file.sync())
            .and_then(|()| self.storage.sync_folder(&self.dir))
            .map_err(Trouble::at(path, "write the record"))?;
        Ok(seal)
    }

    /// Takes a record that is whole under its temporary name to its own, from whatever stage it is at.
    pub(super) fn finish(&mut self, utc_ns: i64, report: &mut Report) -> Result<(), Trouble> {
        while let Some(mut pending) = self.pending.clone() {
            let held = &pending.held;
            let weak = held.weak;
            let stepped = match pending.stage {
                Stage::Written => {
                    let says = Says {
                        kind: Kind::Sealed,
                        flags: pending.flags,
                        number: held.number,
                        utc_ns: held.utc_ns,
                        sha256: held.sha256,
                    };
                    self.ledger
                        .append(self.storage.as_ref(), says, self.key.as_ref())
                        .map(|()| pending.stage = Stage::Entered)
                }
                Stage::Entered => self
                    .storage
                    .rename(&pending.temporary, &held.path)
                    .map_err(Trouble::at(&held.path, "name the record"))
                    .map(|()| pending.stage = Stage::Named),
                Stage::Named => {
                    self.storage
                        .sync_folder(&self.dir)
                        .map_err(Trouble::at(&self.dir, "synchronise the folder"))?;
                    self.newest = (held.number, held.sha256);
                    self.events.insert(held.utc_ns, held.number);
                    self.held.insert(held.number, pending.held);
                    self.pending = None;
                    continue;
                }
            };
            match stepped {
                Ok(()) => self.pending = Some(pending),
                Err(trouble) if trouble.is_full() && self.make_room(utc_ns, weak, report)? => {}
                Err(trouble) => return Err(trouble),
            }
        }
        Ok(())
    }

    /// What is known of an event that was sealed before.
    fn earlier(&self, number: u64, utc_ns: i64) -> (Held, Seal) {
        let gone = || Held {
            path: self.dir.join(name_of(utc_ns, number, 1, false)),
            number,
            utc_ns,
            sha256: [0; 32],
            locked: false,
            encrypted: false,
            weak: Weak::No,
        };
        let held = self.held.get(&number).cloned().unwrap_or_else(gone);
        let seal = Seal {
            sha256: held.sha256,
            signature: None,
        };
        let read = self.read_record(&held.path);
        let seal = read.map_or(seal, |(_, seal)| seal);
        (held, seal)
    }

    /// A name that no file has yet.
    pub(super) fn free_name(&self, utc_ns: i64, number: u64, encrypted: bool) -> String {
        (1..u32::MAX)
            .map(|copy| name_of(utc_ns, number, copy, encrypted))
            .find(|name| self.storage.length(&self.dir.join(name)).is_err())
            .unwrap_or_default()
    }
}

/// What happened beside the sealing.
#[derive(Debug, Default)]
pub(super) struct Report {
    pub(super) removed: Vec<PathBuf>,
    pub(super) notes: Vec<String>,
}

/// Collects bytes and writes them to a file from its start.
struct Output {
    file: Box<dyn Stored>,
    at: u64,
    buffer: Vec<u8>,
}

impl Output {
    fn new(file: Box<dyn Stored>) -> Self {
        Self {
            file,
            at: 0,
            buffer: Vec::with_capacity(BUFFER),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.buffer.len() >= BUFFER {
            self.flush()?;
        }
        let room = (BUFFER - self.buffer.len()).min(bytes.len());
        self.buffer.extend(bytes.iter().take(room));
        Ok(room)
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.buffer.is_empty() {
            self.file.write_at(self.at, &self.buffer)?;
            self.at += num::u64_of(self.buffer.len());
            self.buffer.clear();
        }
        Ok(())
    }
}
