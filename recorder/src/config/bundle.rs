//! A configuration with everything it was made of, so that frames written under it can be understood later,
//! whatever has become of the files.

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::settings::Settings;
use super::{ConfigError, Place};
use crate::dbc::{Database, DbcError};

const MAGIC: &[u8; 8] = b"svbundl1";
/// The texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bundle {
    file: PathBuf,
    text: String,
    databases: Vec<(PathBuf, Vec<u8>)>,
}

impl Settings {
    /// Reads a configuration, and keeps what it was made of.
    ///
    /// # Errors
    /// As [`Settings::load`].
    pub fn load_bundled(path: &Path) -> Result<(Self, Bundle), ConfigError> {
        let text = fs::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.to_path_buf(),
            source,
        })?;
        let databases = RefCell::new(Vec::new());
        let load = |dbc: &Path| {
            let read = |source| DbcError::Read {
                path: dbc.to_path_buf(),
                source,
            };
            // The size is checked there; reading twice what could change between is avoided by parsing our bytes.
            Database::check_size(dbc)?;
            let bytes = fs::read(dbc).map_err(read)?;
            let database = Database::parse(dbc, &bytes)?;
            databases.borrow_mut().push((dbc.to_path_buf(), bytes));
            Ok(database)
        };
        let base_dir = path.parent().unwrap_or(Path::new(""));
        let settings = Self::from_text(path, &text, base_dir, &load)?;
        let bundle = Bundle {
            file: path.to_path_buf(),
            text,
            databases: databases.into_inner(),
        };
        Ok((settings, bundle))
    }
}

impl Bundle {
    /// Largest one that is read, bytes: many buses with big DBC files.
    pub const MOST_BYTES: u64 = 256 * 1024 * 1024;

    /// The settings again.
    ///
    /// # Errors
    /// As [`Settings::load`]; not for a bundle that was made by this version of the program.
    pub fn settings(&self) -> Result<Settings, ConfigError> {
        let load = |dbc: &Path| {
            let found = self.databases.iter().find(|(path, _)| path == dbc);
            let (_, bytes) = found.ok_or_else(|| DbcError::Read {
                path: dbc.to_path_buf(),
                source: std::io::ErrorKind::NotFound.into(),
            })?;
            Database::parse(dbc, bytes)
        };
        let base_dir = self.file.parent().unwrap_or(Path::new(""));
        Settings::from_text(&self.file, &self.text, base_dir, &load)
    }

    /// Its name: SHA-256 of its bytes.
    #[must_use]
    pub fn digest(&self) -> [u8; 32] {
        Sha256::digest(self.to_bytes()).into()
    }

    /// As one sequence of bytes: each text behind its length.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        let mut put = |bytes: &[u8]| {
            out.extend(schema::num::u64_of(bytes.len()).to_le_bytes());
            out.extend(bytes);
        };
        put(self.file.as_os_str().as_encoded_bytes());
        put(self.text.as_bytes());
        for (path, bytes) in &self.databases {
            put(path.as_os_str().as_encoded_bytes());
            put(bytes);
        }
        out
    }

    /// Of such bytes.
    ///
    /// # Errors
    /// Where they are no bundle.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self, ConfigError> {
        Self::parse(bytes).ok_or_else(|| ConfigError::Syntax {
            place: Place::of_file(path),
            message: "expected a bundle of configuration and DBC files, found other bytes"
                .to_owned(),
        })
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(MAGIC)?;
        let mut texts = Vec::new();
        while !rest.is_empty() {
            let (length, behind) = rest.split_first_chunk::<8>()?;
            let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
            let (text, behind) = behind.split_at_checked(length)?;
            texts.push(text);
            rest = behind;
        }
        let path = |bytes: &[u8]| {
            use std::os::unix::ffi::OsStrExt;
            PathBuf::from(std::ffi::OsStr::from_bytes(bytes))
        };
        let [file, text, databases @ ..] = texts.as_slice() else {
            return None;
        };
        let (pairs, []) = databases.as_chunks::<2>() else {
            return None;
        };
        Some(Self {
            file: path(file),
            text: String::from_utf8(text.to_vec()).ok()?,
            databases: pairs
                .iter()
                .map(|[name, bytes]| (path(name), bytes.to_vec()))
                .collect(),
        })
    }
}
