//! What a loss of power leaves of changes that were not synchronised.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::{Change, Cut, Image, SECTOR};

/// What is left of `changes` on top of `base`.
pub(super) fn leave(
    base: &Image,
    changes: &[Change],
    cut: Cut,
    folders: &BTreeSet<PathBuf>,
) -> Image {
    let mut chance = match cut {
        Cut::Process => Chance::of(8),
        Cut::Least => Chance::of(0),
        Cut::Some(seed) => Chance::from_seed(seed),
    };
    let mut synced_files = BTreeMap::new();
    let mut synced_folders = BTreeMap::new();
    for (at, change) in changes.iter().enumerate() {
        match change {
            Change::Sync { file } => {
                synced_files.insert(*file, at);
            }
            Change::SyncFolder { folder } => {
                synced_folders.insert(folder.clone(), at);
            }
            _ => {}
        }
    }
    let mut left = base.clone();
    left.folders.clone_from(folders);
    let mut lengths: BTreeMap<usize, usize> = BTreeMap::new();
    for (at, change) in changes.iter().enumerate() {
        let certain = match change {
            Change::Write { file, .. } | Change::Empty { file } => {
                synced_files.get(file).is_some_and(|sync| at < *sync)
            }
            Change::Create { path, .. }
            | Change::Link { path, .. }
            | Change::Rename { path, .. }
            | Change::Remove { path } => path
                .parent()
                .and_then(|folder| synced_folders.get(folder))
                .is_some_and(|sync| at < *sync),
            Change::Sync { .. } | Change::SyncFolder { .. } => continue,
        };
        if certain {
            left.apply(change);
        } else if let Change::Write {
            file,
            offset,
            bytes,
        } = change
        {
            let length = lengths.entry(*file).or_default();
            *length = (*length).max(offset + bytes.len());
            // The first piece ends at a sector's end; the others are sectors.
            let mut from = 0;
            while from < bytes.len() {
                let to = (from + SECTOR - (offset + from) % SECTOR).min(bytes.len());
                if chance.happens() {
                    left.write(*file, offset + from, &bytes[from..to]);
                }
                from = to;
            }
        } else if chance.happens() {
            left.apply(change);
        }
    }
    for (file, length) in lengths {
        let file = left.file(file);
        if file.len() < length && chance.happens() && chance.happens() {
            file.resize(length, 0);
        }
    }
    left
}

/// Whether something that was not synchronised is there: so many times in eight.
struct Chance {
    eighths: u64,
    state: u64,
}

impl Chance {
    fn of(eighths: u64) -> Self {
        Self { eighths, state: 0 }
    }

    fn from_seed(seed: u64) -> Self {
        let mut chance = Self {
            eighths: 0,
            state: seed,
        };
        chance.eighths = 1 + chance.next() % 7;
        chance
    }

    /// Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014 (`SplitMix64`).
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.state;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn happens(&mut self) -> bool {
        (self.next() >> 32) % 8 < self.eighths
    }
}
