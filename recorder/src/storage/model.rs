//! A file system in memory that knows what a loss of power may leave: the tests' side of the [`Storage`] door.
//!
//! [`Model`] does what a file system does and notes every change. [`Model::after_cut`] then gives a file system as a
//! cut after any of these changes may have left it:
//!
//! - What was written to a file is certain once the file was synchronised. Before that any subset of its 512-byte
//!   sectors may be there, in any order, and a file may have grown without its bytes (zeros).
//! - A name (create, link, rename, remove) is certain once its folder was synchronised. Before that any subset of the
//!   changes may be there; each is whole or absent.
//! - A change that returned an error counts as begun: half of a failed write may be there.
//!
//! Folders themselves are certain as soon as they are made. Clones share one file system.
//!
//! ```
//! use std::path::Path;
//! use recorder::storage::{Storage, Stored};
//! use recorder::storage::model::{Cut, Model};
//!
//! let model = Model::new();
//! model.create_folder(Path::new("/d"))?;
//! let mut file = model.create(Path::new("/d/a"))?;
//! file.write_at(0, b"abc")?;
//! file.sync()?;
//! let before = model.changes();
//! model.sync_folder(Path::new("/d"))?;
//! let lost = model.after_cut(before, Cut::Least);
//! assert!(lost.read(Path::new("/d/a"), 10).is_err());
//! let kept = model.after_cut(model.changes(), Cut::Least);
//! assert_eq!(kept.read(Path::new("/d/a"), 10)?, b"abc");
//! # Ok::<(), std::io::Error>(())
//! ```

mod cut;
mod door;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use schema::num;

use super::Stored;

/// What a disk writes whole or not at all, bytes.
pub const SECTOR: usize = 512;

/// A change of the file system. Files are known by number, so that a name may move.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Change {
    /// A name for a new file.
    Create {
        /// Its name.
        path: PathBuf,
        /// The file.
        file: usize,
    },
    /// A file was emptied.
    Empty {
        /// The file.
        file: usize,
    },
    /// Bytes were written.
    Write {
        /// The file.
        file: usize,
        /// Where.
        offset: usize,
        /// What.
        bytes: Vec<u8>,
    },
    /// A file was synchronised.
    Sync {
        /// The file.
        file: usize,
    },
    /// A second name for a file.
    Link {
        /// The new name.
        path: PathBuf,
        /// The file.
        file: usize,
    },
    /// Another name for a file.
    Rename {
        /// The old name.
        from: PathBuf,
        /// The new name.
        path: PathBuf,
        /// The file.
        file: usize,
    },
    /// A name was removed.
    Remove {
        /// The name.
        path: PathBuf,
    },
    /// A folder was synchronised.
    SyncFolder {
        /// The folder.
        folder: PathBuf,
    },
}

/// How much of what was not synchronised a cut leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// All of it: the process was killed, the system lives.
    Process,
    /// None of it.
    Least,
    /// A subset, drawn from this seed.
    Some(u64),
}

/// Names and contents.
#[derive(Clone, Debug, Default)]
struct Image {
    folders: BTreeSet<PathBuf>,
    names: BTreeMap<PathBuf, usize>,
    files: Vec<Vec<u8>>,
}

impl Image {
    fn apply(&mut self, change: &Change) {
        match change {
            Change::Create { path, file } | Change::Link { path, file } => {
                self.file(*file);
                self.names.insert(path.clone(), *file);
            }
            Change::Rename { from, path, file } => {
                self.file(*file);
                self.names.remove(from);
                self.names.insert(path.clone(), *file);
            }
            Change::Remove { path } => {
                self.names.remove(path);
            }
            Change::Empty { file } => self.file(*file).clear(),
            Change::Write {
                file,
                offset,
                bytes,
            } => self.write(*file, *offset, bytes),
            Change::Sync { .. } | Change::SyncFolder { .. } => {}
        }
    }

    fn file(&mut self, number: usize) -> &mut Vec<u8> {
        if self.files.len() <= number {
            self.files.resize(number + 1, Vec::new());
        }
        &mut self.files[number]
    }

    fn write(&mut self, file: usize, offset: usize, bytes: &[u8]) {
        let file = self.file(file);
        let end = offset + bytes.len();
        if file.len() < end {
            file.resize(end, 0);
        }
        file[offset..end].copy_from_slice(bytes);
    }

    fn bytes(&self, path: &Path) -> io::Result<&Vec<u8>> {
        let number = self.names.get(path).ok_or(ErrorKind::NotFound)?;
        self.files
            .get(*number)
            .ok_or_else(|| ErrorKind::NotFound.into())
    }

    /// Bytes of all files that have a name.
    fn used(&self) -> u64 {
        let named: BTreeSet<usize> = self.names.values().copied().collect();
        let lengths = named.iter().filter_map(|number| self.files.get(*number));
        lengths.map(|file| num::u64_of(file.len())).sum()
    }
}

/// Changes that fail.
#[derive(Clone, Copy, Debug)]
struct Fault {
    /// Changes that still succeed.
    after: usize,
    /// Changes that then fail.
    times: usize,
    kind: ErrorKind,
}

#[derive(Debug, Default)]
struct State {
    base: Image,
    now: Image,
    changes: Vec<Change>,
    capacity: Option<u64>,
    fault: Option<Fault>,
    tried: usize,
}

impl State {
    /// Counts an attempt; an error where it is to fail.
    fn attempt(&mut self) -> io::Result<()> {
        self.tried += 1;
        let Some(fault) = &mut self.fault else {
            return Ok(());
        };
        if fault.after > 0 {
            fault.after -= 1;
            return Ok(());
        }
        if fault.times == 0 {
            self.fault = None;
            return Ok(());
        }
        fault.times -= 1;
        Err(fault.kind.into())
    }

    fn change(&mut self, change: Change) {
        self.now.apply(&change);
        self.changes.push(change);
    }

    fn write(&mut self, file: usize, offset: u64, bytes: &[u8]) -> io::Result<()> {
        let offset = num::usize_of(offset);
        let mut attempt = self.attempt();
        let mut possible = bytes.len();
        if attempt.is_err() {
            possible /= 2;
        }
        if let Some(capacity) = self.capacity {
            let length = self.now.file(file).len();
            let grow = num::u64_of((offset + possible).saturating_sub(length));
            let free = capacity.saturating_sub(self.now.used());
            if grow > free {
                attempt = Err(ErrorKind::StorageFull.into());
                possible = (length + num::usize_of(free))
                    .saturating_sub(offset)
                    .min(possible);
            }
        }
        if possible > 0 {
            self.change(Change::Write {
                file,
                offset,
                bytes: bytes[..possible].to_vec(),
            });
        }
        attempt
    }
}

/// A file system in memory that notes every change. See the module's text.
#[derive(Clone, Debug, Default)]
pub struct Model {
    state: Arc<Mutex<State>>,
}

impl Model {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes noted so far: a place in its history.
    #[must_use]
    pub fn changes(&self) -> usize {
        self.state().changes.len()
    }

    /// Changes tried so far, those that failed too: what [`Model::fail`] counts.
    #[must_use]
    pub fn tried(&self) -> usize {
        self.state().tried
    }

    /// The changes in order, for a test that asks more of them.
    #[must_use]
    pub fn history(&self) -> Vec<Change> {
        self.state().changes.clone()
    }

    /// The number by which [`Change`] knows a file; `None` where the name is not taken.
    #[must_use]
    pub fn number_of(&self, path: &Path) -> Option<usize> {
        self.state().now.names.get(path).copied()
    }

    /// All files together may hold so many bytes; `None`: any number.
    pub fn set_capacity(&self, bytes: Option<u64>) {
        self.state().capacity = bytes;
    }

    /// Bytes of all files that have a name.
    #[must_use]
    pub fn used(&self) -> u64 {
        self.state().now.used()
    }

    /// From now on `after` changes succeed, then `times` fail with `kind`, then all succeed again.
    pub fn fail(&self, after: usize, times: usize, kind: ErrorKind) {
        self.state().fault = Some(Fault { after, times, kind });
    }

    /// Nothing fails any more.
    pub fn heal(&self) {
        self.state().fault = None;
    }

    /// The file system that a cut after the first `count` changes leaves. It has the same capacity, no fault, and a
    /// history of its own.
    #[must_use]
    pub fn after_cut(&self, count: usize, cut: Cut) -> Self {
        let state = self.state();
        let changes = state.changes.get(..count).unwrap_or(&state.changes);
        let image = cut::leave(&state.base, changes, cut, &state.now.folders);
        Self {
            state: Arc::new(Mutex::new(State {
                base: image.clone(),
                now: image,
                capacity: state.capacity,
                ..State::default()
            })),
        }
    }
}

/// An open file of a [`Model`].
struct Open {
    state: Arc<Mutex<State>>,
    file: usize,
}

impl Open {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Stored for Open {
    fn write_at(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.state().write(self.file, offset, bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        let mut state = self.state();
        state.attempt()?;
        state.change(Change::Sync { file: self.file });
        Ok(())
    }
}
