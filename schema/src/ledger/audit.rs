//! What a ledger shows: which records there were, which keys, and what in it contradicts itself.

use std::collections::BTreeMap;

use super::{Entry, Kind, Ledger};
use crate::key::PublicKey;

/// What the ledger says of one record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entered {
    /// The entry of its sealing.
    pub sealed: Entry,
    /// The entry of its removal.
    pub removed: Option<Entry>,
}

/// A key of the ledger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeyChange {
    /// Place of the entry, from 1.
    pub entry: usize,
    /// The entry.
    pub change: Entry,
    /// The key.
    pub key: PublicKey,
    /// The key before signed it; false for the first key, which signs itself.
    pub by_the_old: bool,
}

/// The finding.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Audit {
    /// Records by number.
    pub records: BTreeMap<u64, Entered>,
    /// Keys in order.
    pub keys: Vec<KeyChange>,
    /// Entries without a signature.
    pub unsigned: usize,
    /// What can not be in a ledger that was only appended to by the device, one sentence each.
    pub breaks: Vec<String>,
}

impl Audit {
    /// True if `key` is one of the ledger's, and the keys from it to the last (or from the first to it) were each
    /// introduced by the one before.
    #[must_use]
    pub fn vouches(&self, trusted: &PublicKey, key: &PublicKey) -> bool {
        let place = |wanted: &PublicKey| self.keys.iter().position(|change| change.key == *wanted);
        let (Some(a), Some(b)) = (place(trusted), place(key)) else {
            return false;
        };
        let (from, to) = (a.min(b), a.max(b));
        let between = self.keys.get(from + 1..=to).unwrap_or(&[]);
        between.iter().all(|change| change.by_the_old)
    }
}

/// Goes through a ledger's entries: signatures by the key in force, numbers in order, removals of what was there.
#[must_use]
pub fn audit(ledger: &Ledger) -> Audit {
    let mut audit = Audit::default();
    let mut key: Option<PublicKey> = None;
    let mut newest = 0;
    if let Some(error) = &ledger.error {
        audit.breaks.push(error.to_string());
    }
    for (place, entry) in ledger.entries.iter().enumerate() {
        let place = place + 1;
        if let Some(new) = entry.new_key() {
            let by_the_old = key.is_some_and(|old| entry.signed_by(&old));
            if !by_the_old && !entry.signed_by(&new) {
                audit.breaks.push(format!(
                    "ledger, entry {place}: expected the new key's entry to be signed by the key before, found another signature"
                ));
            } else if key.is_some() && !by_the_old {
                audit.breaks.push(format!(
                    "ledger, entry {place}: expected the key before to have signed the new key {new}, found it signed by itself alone: nobody vouches for it"
                ));
            }
            audit.keys.push(KeyChange {
                entry: place,
                change: *entry,
                key: new,
                by_the_old,
            });
            key = Some(new);
            continue;
        }
        signature(&mut audit, place, entry, key.as_ref());
        match entry.kind {
            Kind::Sealed => sealed(&mut audit, place, entry, &mut newest),
            Kind::Removed => removed(&mut audit, place, entry),
            Kind::NewKey => {}
        }
    }
    audit
}

fn signature(audit: &mut Audit, place: usize, entry: &Entry, key: Option<&PublicKey>) {
    match (entry.signature, key) {
        (None, None) => audit.unsigned += 1,
        (None, Some(key)) => {
            audit.unsigned += 1;
            audit.breaks.push(format!(
                "ledger, entry {place}: expected a signature by the key {key} in force, found none"
            ));
        }
        (Some(_), Some(key)) if entry.signed_by(key) => {}
        (Some(_), Some(key)) => audit.breaks.push(format!(
            "ledger, entry {place}: expected a signature by the key {key} in force, found another"
        )),
        (Some(_), None) => audit.breaks.push(format!(
            "ledger, entry {place}: expected an entry before that introduces the key it is signed by, found none"
        )),
    }
}

fn sealed(audit: &mut Audit, place: usize, entry: &Entry, newest: &mut u64) {
    if entry.number <= *newest {
        audit.breaks.push(format!(
            "ledger, entry {place}: expected a record with a number above {newest}, found {}",
            entry.number
        ));
        return;
    }
    if *newest != 0 && entry.number != *newest + 1 && !entry.flags.adopted {
        audit.breaks.push(format!(
            "ledger, entry {place}: expected record {}, found {}",
            *newest + 1,
            entry.number
        ));
    }
    *newest = entry.number;
    audit.records.insert(
        entry.number,
        Entered {
            sealed: *entry,
            removed: None,
        },
    );
}

fn removed(audit: &mut Audit, place: usize, entry: &Entry) {
    let found = match audit.records.get_mut(&entry.number) {
        None => "no record of that number entered before",
        Some(record) if record.sealed.sha256 != entry.sha256 => "another digest",
        Some(record) if record.removed.is_some() => "one that was removed already",
        Some(record) if record.sealed.flags.locked => "one that is locked",
        Some(record) => {
            record.removed = Some(*entry);
            return;
        }
    };
    audit.breaks.push(format!(
        "ledger, entry {place}: expected the removal of an unlocked record that is there, found {found} (record {})",
        entry.number
    ));
}
