//! Opening the vault: what the last run, or the cut that ended it, left.

use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use schema::header::Origin;
use schema::ledger::{Entry, Kind, Weak};
use schema::{Record, SecretKey, num};

use super::encrypt::Recipient;
use super::ledger_file::{LedgerFile, Says};
use super::lock;
use super::room::RESERVE;
use super::vault::{Held, PART, Pending, RESERVE_BYTES, Report, Stage, Vault};
use super::{Trouble, name_of};
use crate::error::RecorderError;
use crate::storage::Storage;

/// Other names that a record's file may have where its own was taken.
const COPIES: u32 = 9;

impl Vault {
    /// Opens the vault in a folder, which is made if it is not there, and finishes or discards what a cut left half
    /// done. Gives what there is to say of it, one sentence each.
    ///
    /// `keep` is the number of records that are kept, `key` signs (without one nothing is signed), `encrypt_to` is the
    /// age public key that records are encrypted to.
    ///
    /// # Errors
    /// When the folder or its ledger can not be used, or `encrypt_to` is none, or the build can not encrypt.
    pub fn open(
        storage: Arc<dyn Storage>,
        dir: &Path,
        keep: usize,
        key: Option<SecretKey>,
        encrypt_to: Option<&str>,
    ) -> Result<(Self, Vec<String>), RecorderError> {
        Self::open_with_reserve(storage, dir, keep, key, encrypt_to, RESERVE_BYTES)
    }

    /// As [`Vault::open`], with another size of the reserve, bytes; 0: none.
    ///
    /// # Errors
    /// As [`Vault::open`].
    pub fn open_with_reserve(
        storage: Arc<dyn Storage>,
        dir: &Path,
        keep: usize,
        key: Option<SecretKey>,
        encrypt_to: Option<&str>,
        reserve_bytes: u64,
    ) -> Result<(Self, Vec<String>), RecorderError> {
        let recipient = encrypt_to.map(Recipient::parse).transpose()?;
        storage
            .create_folder(dir)
            .map_err(RecorderError::io(dir, "create the folder of the records"))?;
        let mut report = Report::default();
        let (ledger, entries) = LedgerFile::open(storage.as_ref(), dir, &mut report.notes)
            .map_err(Trouble::into_error)?;
        let files = storage
            .list(dir)
            .map_err(RecorderError::io(dir, "list the folder of the records"))?;
        let mut vault = Self {
            storage,
            dir: dir.to_path_buf(),
            keep: keep.max(1),
            key,
            recipient,
            ledger,
            held: BTreeMap::new(),
            events: BTreeMap::new(),
            newest: (0, [0; 32]),
            pending: None,
            reserve: false,
            reserve_bytes,
        };
        let mut left: BTreeSet<PathBuf> = files.into_iter().collect();
        vault.find_reserve(&left);
        let unnamed = vault.take_stock(&entries, &mut left, &mut report);
        let settled = vault
            .finish_unnamed(unnamed, &mut left, &mut report)
            .and_then(|()| vault.enter_key(Weak::No, &mut report))
            .and_then(|()| vault.finish_written(&mut left, &mut report))
            .and_then(|()| vault.adopt(&left, &mut report))
            .and_then(|()| vault.keep_rule(0, &mut report));
        match settled {
            Ok(()) => vault.discard_parts(&left, &mut report),
            // Recording goes on; what is left to do is tried again when a record is sealed.
            Err(trouble) => report.notes.push(trouble.to_string()),
        }
        for path in &report.removed {
            let note = format!("{}: removed by the keep rule", path.display());
            report.notes.push(note);
        }
        vault.tend();
        Ok((vault, report.notes))
    }

    fn find_reserve(&mut self, files: &BTreeSet<PathBuf>) {
        let path = self.reserve_path();
        if !files.contains(&path) {
            return;
        }
        if self.storage.length(&path).ok() == Some(self.reserve_bytes) {
            self.reserve = true;
        } else {
            let _ = self.storage.remove(&path);
        }
    }

    /// What the ledger says, and which file is which. Gives the newest entry if its record has no name.
    fn take_stock(
        &mut self,
        entries: &[Entry],
        left: &mut BTreeSet<PathBuf>,
        report: &mut Report,
    ) -> Option<Entry> {
        let mut removed = BTreeSet::new();
        let mut sealed: BTreeMap<u64, Entry> = BTreeMap::new();
        for entry in entries {
            match entry.kind {
                Kind::Sealed => {
                    sealed.insert(entry.number, *entry);
                    if entry.number >= self.newest.0 {
                        self.newest = (entry.number, entry.sha256);
                    }
                }
                Kind::Removed => {
                    removed.insert(entry.number);
                }
                Kind::NewKey => {}
            }
        }
        let newest = self.newest.0;
        let mut unnamed = None;
        for (number, entry) in sealed {
            let path = self.file_of(&entry, left);
            if let Some(path) = &path {
                left.remove(path);
            }
            match (path, removed.contains(&number)) {
                (Some(path), false) => {
                    self.events.insert(entry.utc_ns, number);
                    let held = held(&entry, path);
                    self.held.insert(number, held);
                }
                (Some(path), true) => {
                    self.events.insert(entry.utc_ns, number);
                    let gone = self.storage.remove(&path);
                    let gone = gone.and_then(|()| self.storage.sync_folder(&self.dir));
                    let note = match gone {
                        Ok(()) => format!("{}: its removal was finished", path.display()),
                        Err(error) => format!("{}: its removal: {error}", path.display()),
                    };
                    report.notes.push(note);
                }
                (None, true) => {
                    self.events.insert(entry.utc_ns, number);
                }
                (None, false) if number == newest => unnamed = Some(entry),
                (None, false) => report.notes.push(lost(number)),
            }
        }
        unnamed
    }

    /// The file of an entry's record, if it is there.
    fn file_of(&self, entry: &Entry, files: &BTreeSet<PathBuf>) -> Option<PathBuf> {
        let names = (1..=COPIES)
            .map(|copy| name_of(entry.utc_ns, entry.number, copy, entry.flags.encrypted));
        let mut there: Vec<PathBuf> = names
            .map(|name| self.dir.join(name))
            .filter(|path| files.contains(path))
            .collect();
        if there.len() > 1 {
            // A stranger has a name that could be the record's: the digest tells.
            let digest = |path: &PathBuf| Some(self.read_record(path).ok()?.1.sha256);
            if let Some(own) = there.iter().position(|p| digest(p) == Some(entry.sha256)) {
                return Some(there.swap_remove(own));
            }
        }
        there.into_iter().next()
    }

    /// The newest record is entered and has no name yet: its temporary file gets it.
    fn finish_unnamed(
        &mut self,
        unnamed: Option<Entry>,
        left: &mut BTreeSet<PathBuf>,
        report: &mut Report,
    ) -> Result<(), Trouble> {
        let Some(entry) = unnamed else {
            return Ok(());
        };
        let parts: Vec<PathBuf> = left.iter().filter(|path| is_part(path)).cloned().collect();
        let own = parts.into_iter().find(|path| {
            if entry.flags.encrypted {
                name_within(path).is_some_and(|name| {
                    (1..=COPIES).any(|c| name == name_of(entry.utc_ns, entry.number, c, true))
                })
            } else {
                self.read_record(path)
                    .is_ok_and(|(_, seal)| seal.sha256 == entry.sha256)
            }
        });
        let Some(temporary) = own else {
            report.notes.push(lost(entry.number));
            return Ok(());
        };
        left.remove(&temporary);
        let name = self.free_name(entry.utc_ns, entry.number, entry.flags.encrypted);
        report
            .notes
            .push(format!("{name}: its sealing was finished"));
        self.pending = Some(Pending {
            temporary,
            held: held(&entry, self.dir.join(name)),
            flags: entry.flags,
            seal: schema::Seal {
                sha256: entry.sha256,
                signature: None,
            },
            stage: Stage::Entered,
        });
        self.finish(entry.utc_ns, report)
    }

    /// Enters the key that signs from here on, if the ledger does not have it as the one in force.
    /// `weak`: that of the record it is entered for.
    pub(super) fn enter_key(&mut self, weak: Weak, report: &mut Report) -> Result<(), Trouble> {
        let Some(key) = self.key.clone() else {
            return Ok(());
        };
        let public = key.public();
        loop {
            if self.ledger.key() == Some(public) {
                return Ok(());
            }
            let before = self.ledger.key();
            let storage = self.storage.clone();
            match self.ledger.new_key(storage.as_ref(), &public, &key, 0) {
                Ok(()) => report.notes.push(match before {
                    None => format!("the ledger's first key is {public}"),
                    Some(old) => format!(
                        "the key is {public} and not {old}, which did not sign the change: nobody vouches for it (recorder key rotate)"
                    ),
                }),
                Err(trouble) if trouble.is_full() && self.make_room(0, weak, report)? => {}
                Err(trouble) => return Err(trouble),
            }
        }
    }

    /// A record that is whole under its temporary name and is the next in the chain is sealed.
    fn finish_written(
        &mut self,
        left: &mut BTreeSet<PathBuf>,
        report: &mut Report,
    ) -> Result<(), Trouble> {
        let parts: Vec<PathBuf> = left.iter().filter(|path| is_part(path)).cloned().collect();
        for temporary in parts {
            let Ok((record, seal)) = self.read_record(&temporary) else {
                continue;
            };
            let next = record.header.number == self.newest.0 + 1
                && record.header.previous_sha256 == self.newest.1;
            if !next || !self.ours(&record, &seal) {
                continue;
            }
            left.remove(&temporary);
            let utc_ns = record.utc_ns();
            let name = self.free_name(utc_ns, record.header.number, false);
            report
                .notes
                .push(format!("{name}: its sealing was finished"));
            let says = Says::sealed(&record, &seal, lock::flags(&record, false, false));
            self.pending = Some(Pending {
                temporary,
                held: Held::new(self.dir.join(name), &says),
                flags: says.flags,
                seal,
                stage: Stage::Written,
            });
            self.finish(utc_ns, report)?;
        }
        Ok(())
    }

    /// Live, and signed by the key if there is one.
    fn ours(&self, record: &Record, seal: &schema::Seal) -> bool {
        let signed = self.key.as_ref().map(|key| seal.signed_by(&key.public()));
        record.header.origin == Origin::Live && signed.unwrap_or(true)
    }

    /// Records of ours that are newer than the ledger knows (it was lost or damaged): they are entered after the fact.
    fn adopt(&mut self, left: &BTreeSet<PathBuf>, report: &mut Report) -> Result<(), Trouble> {
        let mut found: BTreeMap<u64, (PathBuf, Record, schema::Seal)> = BTreeMap::new();
        for path in left.iter().filter(|path| is_record(path)) {
            if number_in(path).is_some_and(|number| number <= self.newest.0) {
                continue;
            }
            if let Ok((record, seal)) = self.read_record(path)
                && record.header.origin == Origin::Live
                && record.header.number > self.newest.0
            {
                found.insert(record.header.number, (path.clone(), record, seal));
            }
        }
        for (number, (path, record, seal)) in found {
            let says = Says::sealed(&record, &seal, lock::flags(&record, false, true));
            let key = self.key.as_ref();
            self.ledger.append(self.storage.as_ref(), says, key)?;
            report.notes.push(format!(
                "{}: the ledger did not have it: entered",
                path.display()
            ));
            self.newest = (number, seal.sha256);
            self.events.insert(record.utc_ns(), number);
            self.held.insert(number, Held::new(path, &says));
        }
        // An envelope can not be looked into; its number is not used again.
        let envelopes = left
            .iter()
            .filter(|path| has_ending(path, schema::envelope::SUFFIX));
        if let Some(number) = envelopes.filter_map(|path| number_in(path)).max()
            && number > self.newest.0
        {
            report.notes.push(format!(
                "the ledger has no record {number}, and the folder an encrypted one: the chain goes on with {}",
                number + 1
            ));
            self.newest.0 = number;
        }
        Ok(())
    }

    /// Removes temporary files that nobody needs.
    fn discard_parts(&self, left: &BTreeSet<PathBuf>, report: &mut Report) {
        let pending = self.pending.as_ref().map(|pending| &pending.temporary);
        for path in left.iter().filter(|path| is_part(path)) {
            if pending == Some(path) {
                continue;
            }
            let removed = match self.storage.remove(path) {
                Ok(()) => "discarded".to_owned(),
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                Err(error) => error.to_string(),
            };
            report.notes.push(format!(
                "{}: a record that was not sealed to its end: {removed}",
                path.display()
            ));
        }
    }
}

fn held(entry: &Entry, path: PathBuf) -> Held {
    let says = Says {
        kind: entry.kind,
        flags: entry.flags,
        number: entry.number,
        utc_ns: entry.utc_ns,
        sha256: entry.sha256,
    };
    Held::new(path, &says)
}

fn lost(number: u64) -> String {
    format!("the ledger has record {number}, and the folder lacks it: it was taken away or lost")
}

fn file_name(path: &Path) -> &str {
    path.file_name().and_then(|n| n.to_str()).unwrap_or("")
}

fn has_ending(path: &Path, ending: &str) -> bool {
    file_name(path).ends_with(ending)
}

fn is_part(path: &Path) -> bool {
    name_within(path).is_some()
}

/// The name that a temporary file is to have.
fn name_within(path: &Path) -> Option<&str> {
    file_name(path).strip_prefix('.')?.strip_suffix(PART)
}

fn is_record(path: &Path) -> bool {
    has_ending(path, ".svb") && !file_name(path).starts_with('.') && file_name(path) != RESERVE
}

/// The number in a record's name.
fn number_in(path: &Path) -> Option<u64> {
    let (_, rest) = file_name(path).split_once("Z-")?;
    let digits = rest.split(['-', '.']).next()?;
    digits
        .parse()
        .ok()
        .filter(|number| *number < num::u64_of(usize::MAX))
}
