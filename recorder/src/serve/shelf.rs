//! The files that can be read out: records, encrypted records and the ledger in the store's folder, and nothing else.
//!
//! Files are opened for reading alone and by names that the folder's own listing gave, never by one off the line; a
//! symbolic link is not followed, and what is no regular file is left out.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use nix::fcntl::OFlag;
use schema::limits::MAX_FILE_BYTES;
use schema::num;
use schema::serial::{Entry, MAX_DATA, MAX_FILES, Refusal, name_is_allowed};
use sha2::{Digest, Sha256};

/// Bytes that are digested for one page of the list before the page is cut short, so that it comes in time.
const DIGESTED_A_PAGE: u64 = 4 << 20;
/// The one file that grows while it is read.
const LEDGER: &str = "ledger.svl";

/// What tells a file from another that took its name, or from itself after a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Mark {
    inode: u64,
    length: u64,
    changed_s: i64,
    changed_ns: i64,
}

#[derive(Clone, Debug)]
struct Item {
    name: String,
    mark: Mark,
    sha256: Option<[u8; 32]>,
}

/// The list, as it was when the session began.
#[derive(Debug)]
pub struct Shelf {
    dir: PathBuf,
    items: Vec<Item>,
    digested: u64,
}

impl Shelf {
    /// Of a folder; the list is empty until [`Shelf::refresh`].
    #[must_use]
    pub fn new(dir: &Path) -> Self {
        Self {
            dir: dir.to_path_buf(),
            items: Vec::new(),
            digested: 0,
        }
    }

    /// Lists the folder anew, the newest names last; of more than [`MAX_FILES`] the last. Digests of unchanged files
    /// are kept. A folder that is not there is an empty one.
    ///
    /// # Errors
    /// When the folder can not be read.
    pub fn refresh(&mut self) -> io::Result<()> {
        let folder = match fs::read_dir(&self.dir) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                self.items.clear();
                return Ok(());
            }
            other => other?,
        };
        let mut items: Vec<Item> = Vec::new();
        for entry in folder {
            let entry = entry?;
            let Ok(name) = entry.file_name().into_string() else {
                continue;
            };
            // A file that went away meanwhile is no error. `metadata` of an entry does not follow links.
            let Some(about) = entry.metadata().ok().filter(fs::Metadata::is_file) else {
                continue;
            };
            if !name_is_allowed(&name) || about.len() > num::u64_of(MAX_FILE_BYTES) {
                continue;
            }
            items.push(Item {
                name,
                mark: Mark::of(&about),
                sha256: None,
            });
            if items.len() >= 2 * MAX_FILES {
                newest(&mut items);
            }
        }
        newest(&mut items);
        for item in &mut items {
            let old = self.items.iter().find(|old| old.name == item.name);
            item.sha256 = old
                .filter(|old| old.mark == item.mark)
                .and_then(|old| old.sha256);
        }
        self.items = items;
        Ok(())
    }

    /// Files in the list.
    #[must_use]
    pub fn len(&self) -> u32 {
        u32::try_from(self.items.len()).unwrap_or(u32::MAX)
    }

    /// True of an empty list.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// The entries from a place on that fit one packet, and the place after them. What can not be read is left out.
    pub fn page(&mut self, first: u32) -> (u32, Vec<Entry>) {
        let (mut place, mut used, mut entries) = (first, 0, Vec::new());
        self.digested = 0;
        while place < self.len() && self.digested <= DIGESTED_A_PAGE {
            if let Some(entry) = self.entry(place) {
                if !entry.fits(&mut used) {
                    break;
                }
                entries.push(entry);
            }
            place += 1;
        }
        (place.min(self.len()), entries)
    }

    fn entry(&mut self, place: u32) -> Option<Entry> {
        let item = self.items.get_mut(num::usize_of(place.into()))?;
        if item.sha256.is_none() {
            let file = item.open(&self.dir).ok()?;
            item.sha256 = Some(digest(&file, item.mark.length).ok()?);
            self.digested += item.mark.length;
        }
        Some(Entry {
            place,
            length: item.mark.length,
            changed_s: item.mark.changed_s,
            sha256: item.sha256?,
            name: item.name.clone(),
        })
    }

    /// Bytes of a file of the list.
    ///
    /// # Errors
    /// Why not: no such place or bytes, another file than the one listed, or one that can not be read.
    pub fn read(
        &self,
        place: u32,
        digest: &[u8; 8],
        offset: u64,
        length: u16,
    ) -> Result<Vec<u8>, Refusal> {
        let item = self.items.get(num::usize_of(place.into()));
        let item = item.ok_or(Refusal::NotThere)?;
        let listed = item.sha256.ok_or(Refusal::Changed)?;
        if !listed.starts_with(digest) {
            return Err(Refusal::Changed);
        }
        let left = item.mark.length.saturating_sub(offset);
        let wanted = left.min(length.into());
        if wanted == 0 || usize::from(length) > MAX_DATA {
            return Err(Refusal::NotThere);
        }
        let file = item.open(&self.dir)?;
        let mut bytes = vec![0; num::usize_of(wanted)];
        file.read_exact_at(&mut bytes, offset)
            .map_err(|_| Refusal::Unreadable)?;
        Ok(bytes)
    }
}

/// Sorts by name and keeps the last, which are the newest, and the ledger.
fn newest(items: &mut Vec<Item>) {
    items.sort_by(|a, b| (a.name == LEDGER, &a.name).cmp(&(b.name == LEDGER, &b.name)));
    let more = items.len().saturating_sub(MAX_FILES);
    items.drain(..more);
}

impl Mark {
    fn of(about: &fs::Metadata) -> Self {
        Self {
            inode: about.ino(),
            length: about.len(),
            changed_s: about.mtime(),
            changed_ns: about.mtime_nsec(),
        }
    }
}

impl Item {
    fn open(&self, dir: &Path) -> Result<File, Refusal> {
        // A pipe put in place of a record does not make the opening wait.
        let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC;
        let file = OpenOptions::new()
            .read(true)
            .custom_flags(flags.bits())
            .open(dir.join(&self.name))
            .map_err(|_| Refusal::Changed)?;
        let about = file.metadata().map_err(|_| Refusal::Unreadable)?;
        let found = Mark::of(&about);
        // The ledger is only ever added to: its first bytes stay as they were listed.
        let same = if self.name == LEDGER {
            found.inode == self.mark.inode && found.length >= self.mark.length
        } else {
            found == self.mark
        };
        if about.is_file() && same {
            Ok(file)
        } else {
            Err(Refusal::Changed)
        }
    }
}

fn digest(file: &File, length: u64) -> io::Result<[u8; 32]> {
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 64 << 10];
    let mut at = 0;
    while at < length {
        let wanted = num::usize_of(length - at).min(buffer.len());
        file.read_exact_at(&mut buffer[..wanted], at)?;
        hasher.update(&buffer[..wanted]);
        at += num::u64_of(wanted);
    }
    Ok(hasher.finalize().into())
}
