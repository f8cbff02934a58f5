//! Files as the daemon uses them. One door, so that a test can record every write, synchronisation and rename of a
//! run and ask what a loss of power at any instant would have left ([`crate::spool`], [`crate::store`]).

pub mod model;

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use schema::num;

/// An open file.
pub trait Stored: Send {
    /// Writes all bytes at an offset.
    ///
    /// # Errors
    /// The file's own.
    fn write_at(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()>;

    /// Returns when everything written (and the length) would survive a loss of power.
    ///
    /// # Errors
    /// The file's own.
    fn sync(&mut self) -> io::Result<()>;
}

/// A file system.
pub trait Storage: Send + Sync {
    /// Makes a folder and those above it; one that is there is no error.
    ///
    /// # Errors
    /// The file system's own; so in all of these.
    fn create_folder(&self, folder: &Path) -> io::Result<()>;
    /// Names of the files in a folder, sorted, whole paths.
    ///
    /// # Errors
    /// The file system's own.
    fn list(&self, folder: &Path) -> io::Result<Vec<PathBuf>>;
    /// Bytes of a file.
    ///
    /// # Errors
    /// The file system's own; `NotFound` where there is none.
    fn length(&self, path: &Path) -> io::Result<u64>;
    /// The whole of a file.
    ///
    /// # Errors
    /// The file system's own; `InvalidData` where it is longer than `most` bytes.
    fn read(&self, path: &Path, most: u64) -> io::Result<Vec<u8>>;
    /// A stretch of a file, whole; shorter where the file ends.
    ///
    /// # Errors
    /// The file system's own.
    fn read_range(&self, path: &Path, offset: u64, length: usize) -> io::Result<Vec<u8>> {
        let bytes = self.read(path, u64::MAX)?;
        let start = num::usize_of(offset).min(bytes.len());
        let end = start.saturating_add(length).min(bytes.len());
        Ok(bytes.get(start..end).unwrap_or_default().to_vec())
    }
    /// A new, empty file, readable by its owner and group alone; one that is there is emptied.
    ///
    /// # Errors
    /// The file system's own.
    fn create(&self, path: &Path) -> io::Result<Box<dyn Stored>>;
    /// An existing file, to be written to.
    ///
    /// # Errors
    /// The file system's own; `NotFound` where there is none.
    fn open(&self, path: &Path) -> io::Result<Box<dyn Stored>>;
    /// A second name for a file; never over an existing one.
    ///
    /// # Errors
    /// The file system's own; `AlreadyExists` where the name is taken.
    fn link(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Another name for a file, over an existing one.
    ///
    /// # Errors
    /// The file system's own.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Removes a file.
    ///
    /// # Errors
    /// The file system's own.
    fn remove(&self, path: &Path) -> io::Result<()>;
    /// Returns when the names in a folder would survive a loss of power.
    ///
    /// # Errors
    /// The file system's own.
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;
    /// Bytes free for us.
    ///
    /// # Errors
    /// The file system's own.
    fn free_bytes(&self, folder: &Path) -> io::Result<u64>;
}

/// A file beside another: its whole name, a point and an ending.
#[must_use]
pub fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(ending);
    PathBuf::from(name)
}

/// The real one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Stored for File {
    fn write_at(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.write_all_at(bytes, offset)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }
}

impl Storage for Disk {
    fn create_folder(&self, folder: &Path) -> io::Result<()> {
        fs::create_dir_all(folder)
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            if entry.file_type()?.is_file() {
                found.push(entry.path());
            }
        }
        found.sort();
        Ok(found)
    }

    fn length(&self, path: &Path) -> io::Result<u64> {
        Ok(fs::metadata(path)?.len())
    }

    fn read(&self, path: &Path, most: u64) -> io::Result<Vec<u8>> {
        let file = File::open(path)?;
        let mut bytes = Vec::new();
        file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
        if num::u64_of(bytes.len()) > most {
            let found = format!("expected at most {most} bytes, found more");
            return Err(io::Error::new(ErrorKind::InvalidData, found));
        }
        Ok(bytes)
    }

    fn read_range(&self, path: &Path, offset: u64, length: usize) -> io::Result<Vec<u8>> {
        let file = File::open(path)?;
        let mut bytes = vec![0; length];
        let mut done = 0;
        while let Some(free) = bytes.get_mut(done..).filter(|free| !free.is_empty()) {
            match file.read_at(free, offset.saturating_add(num::u64_of(done))) {
                Ok(0) => break,
                Ok(count) => done += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        bytes.truncate(done);
        Ok(bytes)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Stored>> {
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(true).mode(0o640);
        Ok(Box::new(options.open(path)?))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Stored>> {
        Ok(Box::new(OpenOptions::new().write(true).open(path)?))
    }

    fn link(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::hard_link(from, to)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        File::open(folder)?.sync_all()
    }

    #[allow(
        clippy::useless_conversion,
        reason = "these have 32 bits on 32-bit targets"
    )]
    fn free_bytes(&self, folder: &Path) -> io::Result<u64> {
        let found = nix::sys::statvfs::statvfs(folder)?;
        Ok(u64::from(found.blocks_available()).saturating_mul(u64::from(found.fragment_size())))
    }
}
