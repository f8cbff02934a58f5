//! What came of a file, kept beside the records until it is whole: `NAME.part` begins with the digest and length
//! listed, so that only the same file is gone on with; the whole file gets its name by temporary file, fsync, link
//! and fsync of the folder, never over a different one.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use schema::serial::Entry;
use schema::{Record, SchemaError, num};
use sha2::{Digest, Sha256};

use super::FetchError;
use crate::export::fixed::hex;

/// A part begins with these bytes, then SHA-256 and length as listed.
const MAGIC: &[u8; 8] = b"SVBpart\x01";
/// Bytes before the data.
const HEAD: usize = 8 + 32 + 8;
/// The ledger begins with these.
const LEDGER_MAGIC: &[u8; 8] = b"\x89SVL\r\n\x1a\n";
/// The one file that grows in the recorder.
const LEDGER: &str = "ledger.svl";

/// A file that is being fetched.
#[derive(Debug)]
pub struct Part {
    path: PathBuf,
    file: File,
    length: u64,
}

/// A file that got its name.
#[derive(Debug)]
pub struct Placed {
    /// What is wrong with its content.
    pub fault: Option<String>,
}

fn at(path: &Path) -> impl FnOnce(io::Error) -> FetchError {
    let path = path.to_path_buf();
    move |source| FetchError::File { path, source }
}

fn bounded(path: &Path) -> io::Result<Vec<u8>> {
    let limit = schema::limits::MAX_FILE_BYTES + HEAD + 1;
    let mut bytes = Vec::new();
    File::open(path)?
        .take(num::u64_of(limit))
        .read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// True if the file is there already, the same to the byte.
///
/// # Errors
/// When another file has its name (but for a ledger that may have grown), or the folder can not be read.
pub fn had(entry: &Entry, out: &Path) -> Result<bool, FetchError> {
    let path = out.join(&entry.name);
    let bytes = match bounded(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
        other => other.map_err(at(&path))?,
    };
    if Sha256::digest(&bytes)[..] == entry.sha256 {
        return Ok(true);
    }
    if entry.name == LEDGER {
        return Ok(false);
    }
    Err(FetchError::Taken { path })
}

impl Part {
    /// The part of an earlier fetch of the same bytes, or a new one.
    ///
    /// # Errors
    /// When the folder or the part can not be written.
    pub fn open(entry: &Entry, out: &Path) -> Result<Self, FetchError> {
        fs::create_dir_all(out).map_err(at(out))?;
        let path = out.join(format!("{}.part", entry.name));
        let mut head = MAGIC.to_vec();
        head.extend(entry.sha256);
        head.extend(entry.length.to_le_bytes());
        let mut file = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path)
            .map_err(at(&path))?;
        let mut found = Vec::new();
        (&mut file)
            .take(num::u64_of(HEAD))
            .read_to_end(&mut found)
            .map_err(at(&path))?;
        let bytes = file.metadata().map_err(at(&path))?.len();
        let mut length = bytes.saturating_sub(num::u64_of(HEAD));
        if found != head || length > entry.length {
            length = 0;
            file.set_len(0)
                .and_then(|()| file.write_all(&head))
                .map_err(at(&path))?;
        }
        Ok(Self { path, file, length })
    }

    /// Bytes of the file that are here, from its start.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Adds the next bytes.
    ///
    /// # Errors
    /// When they can not be written.
    pub fn append(&mut self, bytes: &[u8]) -> Result<(), FetchError> {
        self.file.write_all(bytes).map_err(at(&self.path))?;
        self.length += num::u64_of(bytes.len());
        Ok(())
    }

    /// Checks the whole file and gives it its name.
    ///
    /// # Errors
    /// When its digest is not the one listed (the part is then removed, to be fetched anew), another file has the
    /// name, or it can not be written.
    pub fn place(self, entry: &Entry, out: &Path) -> Result<Placed, FetchError> {
        let whole = bounded(&self.path).map_err(at(&self.path))?;
        let bytes = whole.get(HEAD..).unwrap_or_default();
        let computed = Sha256::digest(bytes);
        if computed[..] != entry.sha256 {
            fs::remove_file(&self.path).map_err(at(&self.path))?;
            return Err(FetchError::Digest {
                listed: hex(&entry.sha256),
                computed: hex(&computed),
            });
        }
        let path = out.join(&entry.name);
        let temporary = out.join(format!(".{}.{}.partial", entry.name, std::process::id()));
        let named = write(&temporary, bytes)
            .map_err(at(&temporary))
            .and_then(|()| name(&temporary, &path, bytes));
        // After a link it is a second name; after a failure it is nothing.
        let removed = fs::remove_file(&temporary);
        named?;
        match removed {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(at(&temporary)(error)),
            _ => {}
        }
        File::open(out)
            .and_then(|folder| folder.sync_all())
            .map_err(at(out))?;
        fs::remove_file(&self.path).map_err(at(&self.path))?;
        Ok(Placed {
            fault: fault(&entry.name, bytes),
        })
    }
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

fn name(temporary: &Path, path: &Path, bytes: &[u8]) -> Result<(), FetchError> {
    let taken = || FetchError::Taken {
        path: path.to_path_buf(),
    };
    match fs::hard_link(temporary, path) {
        Ok(()) => Ok(()),
        // A ledger that has grown takes the place of its own beginning; nothing is lost by that.
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            let old = bounded(path).map_err(at(path))?;
            let grown = path.file_name().is_some_and(|name| name == LEDGER);
            if !(grown && bytes.starts_with(&old)) {
                return Err(taken());
            }
            fs::rename(temporary, path).map_err(at(path))
        }
        // A file system without links.
        Err(_) if !path.exists() => fs::rename(temporary, path).map_err(at(path)),
        Err(_) => Err(taken()),
    }
}

/// What is wrong with a file of this name, if something is.
fn fault(name: &str, bytes: &[u8]) -> Option<String> {
    if name == LEDGER {
        let wrong = !bytes.starts_with(LEDGER_MAGIC);
        return wrong.then(|| "it does not begin as a ledger".to_owned());
    }
    match (Record::read(bytes), name.strip_suffix(".sve").is_some()) {
        (Ok(_), false) | (Err(SchemaError::Encrypted), true) => None,
        (Ok(_), true) => Some("expected an encrypted record, found one in the clear".to_owned()),
        (Err(error), _) => Some(error.to_string()),
    }
}
