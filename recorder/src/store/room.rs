//! Room in the vault: the keep rule, what goes on a full disk, the reserve.

use std::io;
use std::path::{Path, PathBuf};

use schema::ledger::{Flags, Kind};
use schema::{Record, num};

use super::Trouble;
use super::ledger_file::Says;
use super::vault::{Held, Report, Vault};

/// Name of the reserve.
pub(super) const RESERVE: &str = ".reserve";
/// The reserve is written in pieces of so many bytes.
const PIECE: usize = 64 * 1024;

impl Vault {
    /// Removes unlocked records that are not among the newest `keep`, oldest first.
    pub(super) fn keep_rule(&mut self, utc_ns: i64, report: &mut Report) -> Result<(), Trouble> {
        loop {
            let beyond = self.held.len().saturating_sub(self.keep);
            let oldest = self.held.values().take(beyond).find(|held| !held.locked);
            let Some(held) = oldest.cloned() else {
                return Ok(());
            };
            self.give_up(&held, utc_ns, report)?;
        }
    }

    /// Makes room on a full disk; false if nothing may go.
    pub(super) fn make_room(&mut self, utc_ns: i64, report: &mut Report) -> Result<bool, Trouble> {
        if self.reserve {
            let path = self.reserve_path();
            self.storage
                .remove(&path)
                .and_then(|()| self.storage.sync_folder(&self.dir))
                .map_err(Trouble::at(&path, "give up the reserve"))?;
            self.reserve = false;
            report
                .notes
                .push("the disk is full: the reserve was given up".to_owned());
            return Ok(true);
        }
        let oldest = self.held.values().find(|held| !held.locked).cloned();
        let Some(held) = oldest else {
            return Ok(false);
        };
        report.notes.push(format!(
            "the disk is full: record {} goes to make room",
            held.number
        ));
        self.give_up(&held, utc_ns, report)?;
        Ok(true)
    }

    /// Removes a record: says so in the ledger, removes the file, makes that certain. A file that is not the record it
    /// should be stays, and is counted as locked from then on.
    fn give_up(&mut self, held: &Held, utc_ns: i64, report: &mut Report) -> Result<(), Trouble> {
        if let Some(found) = self.not_the_record(held) {
            report.notes.push(format!(
                "{}: expected record {} to be removed, found {found}: kept",
                held.path.display(),
                held.number
            ));
            if let Some(held) = self.held.get_mut(&held.number) {
                held.locked = true;
            }
            return Ok(());
        }
        let says = Says {
            kind: Kind::Removed,
            flags: Flags::default(),
            number: held.number,
            utc_ns,
            sha256: held.sha256,
        };
        let key = self.key.as_ref();
        self.ledger.append(self.storage.as_ref(), says, key)?;
        self.held.remove(&held.number);
        report.removed.push(held.path.clone());
        self.storage
            .remove(&held.path)
            .and_then(|()| self.storage.sync_folder(&self.dir))
            .map_err(Trouble::at(&held.path, "remove the record"))
    }

    /// What stands in a record's place, if it is not the record. An envelope can not be looked into.
    fn not_the_record(&self, held: &Held) -> Option<String> {
        if held.encrypted {
            return None;
        }
        match self.read_record(&held.path) {
            Ok((_, seal)) if seal.sha256 == held.sha256 => None,
            Ok((record, _)) => Some(format!("another record, number {}", record.header.number)),
            Err(found) => Some(found),
        }
    }

    /// Reads a record of the folder.
    pub(super) fn read_record(&self, path: &Path) -> Result<(Record, schema::Seal), String> {
        let most = num::u64_of(schema::limits::MAX_FILE_BYTES);
        let bytes = self.storage.read(path, most).map_err(|e| e.to_string())?;
        Record::read(&bytes).map_err(|e| e.to_string())
    }

    pub(super) fn reserve_path(&self) -> PathBuf {
        self.dir.join(RESERVE)
    }

    /// Makes the reserve anew where there is room for it twice. That it can not be made is no error: there is no room.
    pub fn tend(&mut self) {
        if self.reserve || self.reserve_bytes == 0 {
            return;
        }
        let free = self.storage.free_bytes(&self.dir).unwrap_or(0);
        if free < self.reserve_bytes.saturating_mul(2) {
            return;
        }
        match self.make_reserve() {
            Ok(()) => self.reserve = true,
            Err(_) => {
                let _ = self.storage.remove(&self.reserve_path());
            }
        }
    }

    fn make_reserve(&self) -> io::Result<()> {
        let mut file = self.storage.create(&self.reserve_path())?;
        let piece = vec![0xA5; PIECE];
        let mut at = 0;
        while at < self.reserve_bytes {
            let length = num::usize_of(self.reserve_bytes - at).min(PIECE);
            file.write_at(at, piece.get(..length).unwrap_or(&piece))?;
            at += num::u64_of(length);
        }
        file.sync()?;
        self.storage.sync_folder(&self.dir)
    }
}
