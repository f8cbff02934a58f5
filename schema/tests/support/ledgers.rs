//! Ledgers for the tests, sound ones and changed ones.
#![allow(
    dead_code,
    reason = "each test file uses its own share of this support"
)]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schema::ledger::audit::audit;
use schema::ledger::{ENTRY_BYTES, Entry, Flags, Kind, MAGIC, Weak};
use schema::{Ledger, SecretKey};

pub(crate) fn key(seed: u8) -> SecretKey {
    SecretKey::from_bytes(&[seed; 32])
}

pub(crate) fn bytes(entries: &[Entry]) -> Vec<u8> {
    let entries = entries.iter().flat_map(Entry::to_bytes);
    MAGIC.into_iter().chain(entries).collect()
}

pub(crate) fn sealed(
    number: u64,
    before: Option<&Entry>,
    key: Option<&SecretKey>,
    flags: Flags,
) -> Entry {
    let entry = Entry {
        kind: Kind::Sealed,
        flags,
        number,
        utc_ns: 1_773_500_966_000_000_000,
        sha256: [u8::try_from(number).unwrap(); 32],
        previous_sha256: [0; 32],
        signature: None,
    };
    entry.signed(before, key)
}

pub(crate) fn new_key(new: &SecretKey, before: Option<&Entry>, by: &SecretKey) -> Entry {
    let entry = Entry {
        kind: Kind::NewKey,
        flags: Flags::default(),
        number: 0,
        utc_ns: 0,
        sha256: new.public().to_bytes(),
        previous_sha256: [0; 32],
        signature: None,
    };
    entry.signed(before, Some(by))
}

/// A key, two records of which the first is removed and the second locked, a new key, a third record, which is weak.
pub(crate) fn example() -> Vec<Entry> {
    let (old, new) = (key(1), key(2));
    let locked = Flags {
        locked: true,
        ..Flags::default()
    };
    let mut entries = vec![new_key(&old, None, &old)];
    entries.push(sealed(1, entries.last(), Some(&old), Flags::default()));
    entries.push(sealed(2, entries.last(), Some(&old), locked));
    let removed = Entry {
        kind: Kind::Removed,
        ..entries[1]
    };
    entries.push(removed.signed(entries.last(), Some(&old)));
    entries.push(new_key(&new, entries.last(), &old));
    let weak = Flags {
        weak: Weak::PowerLoss,
        ..Flags::default()
    };
    entries.push(sealed(3, entries.last(), Some(&new), weak));
    entries
}

/// The example with entries moved, doubled, left out or changed, half of them with checks and chain made right again.
pub(crate) fn mutate(seed: u64) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut entries: Vec<[u8; ENTRY_BYTES]> = example().iter().map(Entry::to_bytes).collect();
    for _ in 0..rng.random_range(0..4) {
        let (a, b) = (
            rng.random_range(0..entries.len()),
            rng.random_range(0..entries.len()),
        );
        match rng.random_range(0..4) {
            0 => entries.swap(a, b),
            1 => entries.insert(a, entries[b]),
            2 if entries.len() > 1 => {
                entries.remove(a);
            }
            _ => entries[a][rng.random_range(0..30)] ^= 1 << rng.random_range(0..8),
        }
    }
    let mut file = MAGIC.to_vec();
    let mend = rng.random_bool(0.5);
    let mut before = [0; 32];
    for mut entry in entries {
        if mend {
            use sha2::{Digest, Sha256};
            entry[56..88].copy_from_slice(&before);
            before = Sha256::digest(&entry[..152]).into();
            let check = crc32c::crc32c(&entry[..152]);
            entry[152..].copy_from_slice(&check.to_le_bytes());
        }
        file.extend(entry);
    }
    if rng.random_bool(0.3) {
        file.truncate(rng.random_range(0..=file.len()));
    }
    file
}

/// Reads a ledger and asserts what must hold of any result; true if it was read to its end.
pub(crate) fn drive(file: &[u8]) -> bool {
    let ledger = Ledger::read(file);
    let found = audit(&ledger);
    let back = bytes(&ledger.entries);
    if let Some(error) = &ledger.error {
        assert!(ledger.entries.is_empty() || file.starts_with(&back));
        assert!(!error.to_string().is_empty());
        assert!(!found.breaks.is_empty());
    } else {
        assert_eq!(back, file);
    }
    assert!(found.records.len() + found.keys.len() <= ledger.entries.len());
    ledger.error.is_none()
}
