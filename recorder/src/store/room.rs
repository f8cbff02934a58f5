//! Room in the vault: the keep rule, what goes on a full disk, the reserve.
//!
//! **Weak records** (by hand, loss of power) never push one of a crash out. While more than `keep` are there, those by a
//! loss of power go down to [`MOST_POWER_LOSSES`], oldest first. Where an unlocked record is beyond the newest `keep`,
//! the oldest weak one goes in its place. The newest record of all and locked ones stay. If none is left to go, records
//! of crashes are counted without the weak ones: one more than `keep` may be there, until the next is sealed.

use std::io;
use std::path::{Path, PathBuf};

use schema::ledger::{Flags, Kind, Weak};
use schema::{Record, num};

use super::Trouble;
use super::ledger_file::Says;
use super::vault::{Held, Report, Vault};

/// Name of the reserve.
pub(super) const RESERVE: &str = ".reserve";
/// The reserve is written in pieces of so many bytes.
const PIECE: usize = 64 * 1024;

/// Of records by a loss of power alone so many are kept, where more than `keep` records are there.
const MOST_POWER_LOSSES: usize = 2;

impl Vault {
    /// Removes unlocked records that are not among the newest `keep`, oldest first, weak ones before all others.
    pub(super) fn keep_rule(&mut self, utc_ns: i64, report: &mut Report) -> Result<(), Trouble> {
        loop {
            let Some(held) = self.surplus().cloned() else {
                return Ok(());
            };
            self.give_up(&held, utc_ns, report)?;
        }
    }

    /// The next record that goes by the keep rule.
    fn surplus(&self) -> Option<&Held> {
        let all = || self.held.values();
        let beyond = all().count().saturating_sub(self.keep);
        if beyond == 0 {
            return None;
        }
        let newest = all().next_back().map(|held| held.number);
        let mut weak = all().filter(|held| gives_way(held) && Some(held.number) != newest);
        let by_power_loss = |held: &&Held| gives_way(held) && held.weak == Weak::PowerLoss;
        if all().filter(by_power_loss).count() > MOST_POWER_LOSSES {
            return all().find(by_power_loss);
        }
        all().take(beyond).find(|held| !held.locked)?;
        let crashes = || all().filter(|held| !gives_way(held));
        let beyond = crashes().count().saturating_sub(self.keep);
        let crash = || crashes().take(beyond).find(|held| !held.locked);
        weak.next().or_else(crash)
    }

    /// Makes room on a full disk; false if nothing may go. `weak` is that of the record to be sealed: for a weak one
    /// only weak ones go.
    pub(super) fn make_room(
        &mut self,
        utc_ns: i64,
        weak: Weak,
        report: &mut Report,
    ) -> Result<bool, Trouble> {
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
        let unlocked = || self.held.values().filter(|held| !held.locked);
        let crash = || unlocked().next().filter(|_| !weak.is_weak());
        let oldest = unlocked().find(|held| gives_way(held)).or_else(crash);
        let Some(held) = oldest.cloned() else {
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

/// It goes before the record of a crash does.
fn gives_way(held: &Held) -> bool {
    held.weak.is_weak() && !held.locked
}
