//! The device's key on disk: where it comes from, who may read it.
//!
//! The file is that of `[device] key`, or, where that is not set, `device.key` among the credentials that systemd hands
//! over (`LoadCredential=device.key:...`, folder `$CREDENTIALS_DIRECTORY`). A file that others than its owner may read
//! is refused; systemd sets the rights of its credentials itself.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use schema::key::{KeyError, MAX_TEXT_BYTES};
use schema::{PublicKey, SecretKey, num};
use zeroize::Zeroizing;

use crate::config::Store;
use crate::error::RecorderError;

/// Name of the key among systemd's credentials.
pub const CREDENTIAL: &str = "device.key";
/// Rights that a secret key's file must not give.
const OTHERS: u32 = 0o077;

/// The device's key by configuration and environment; `None` where there is none: records are then not signed.
///
/// # Errors
/// When the file is there and can not be used, or is configured and not there.
pub fn load(store: &Store) -> Result<Option<SecretKey>, RecorderError> {
    let credentials = std::env::var_os("CREDENTIALS_DIRECTORY").map(PathBuf::from);
    load_from(store.key.as_deref(), credentials.as_deref())
}

fn load_from(
    configured: Option<&Path>,
    credentials: Option<&Path>,
) -> Result<Option<SecretKey>, RecorderError> {
    if let Some(path) = configured {
        let handed_over = credentials.is_some_and(|folder| path.starts_with(folder));
        return read(path, handed_over).map(Some);
    }
    let Some(path) = credentials.map(|folder| folder.join(CREDENTIAL)) else {
        return Ok(None);
    };
    match read(&path, true) {
        Err(RecorderError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
        other => other.map(Some),
    }
}

/// A secret key from its file.
///
/// # Errors
/// When it can not be read, others may read it, or it is no secret key.
pub fn read_secret(path: &Path) -> Result<SecretKey, RecorderError> {
    read(path, false)
}

fn read(path: &Path, handed_over: bool) -> Result<SecretKey, RecorderError> {
    let file = File::open(path).map_err(RecorderError::io(path, "open the key"))?;
    let about = file
        .metadata()
        .map_err(RecorderError::io(path, "look at the key"))?;
    if !handed_over && about.mode() & OTHERS != 0 {
        return Err(RecorderError::Key {
            path: path.to_path_buf(),
            expected: "a secret key that its owner alone may read (mode 0600)".to_owned(),
            found: format!("mode {:04o}", about.mode() & 0o7777),
        });
    }
    let text = text(file, path)?;
    SecretKey::from_text(&text).map_err(wrong(path))
}

/// A public key, or the public half of a secret one, from its file.
///
/// # Errors
/// When it can not be read or is no key.
pub fn read_public(path: &Path) -> Result<PublicKey, RecorderError> {
    let file = File::open(path).map_err(RecorderError::io(path, "open the key"))?;
    let text = text(file, path)?;
    match PublicKey::from_text(&text) {
        Err(KeyError::Other { .. }) => {
            let key = SecretKey::from_text(&text).map_err(wrong(path))?;
            Ok(key.public())
        }
        other => other.map_err(wrong(path)),
    }
}

fn text(file: File, path: &Path) -> Result<Zeroizing<String>, RecorderError> {
    // Of full size from the start: a buffer that grows leaves copies behind.
    let mut text = Zeroizing::new(String::with_capacity(MAX_TEXT_BYTES + 1));
    file.take(num::u64_of(MAX_TEXT_BYTES))
        .read_to_string(&mut text)
        .map_err(RecorderError::io(path, "read the key"))?;
    Ok(text)
}

fn wrong(path: &Path) -> impl Fn(KeyError) -> RecorderError {
    move |error| {
        let text = error.to_string();
        let (expected, found) = text
            .split_once(", found ")
            .unwrap_or((&text, "something else"));
        RecorderError::Key {
            path: path.to_path_buf(),
            expected: expected.trim_start_matches("expected ").to_owned(),
            found: found.to_owned(),
        }
    }
}

/// Makes a key from the system's random numbers and writes it (mode 0600), and the public half beside it under the same
/// name with `.pub`. Neither may exist.
///
/// # Errors
/// When one exists, or can not be written, or the system has no random numbers.
pub fn create(path: &Path) -> Result<SecretKey, RecorderError> {
    let mut bytes = Zeroizing::new([0; 32]);
    getrandom::fill(&mut *bytes).map_err(|error| {
        RecorderError::io(path, "draw random numbers")(std::io::Error::other(error.to_string()))
    })?;
    let key = SecretKey::from_bytes(&bytes);
    let public = public_path(path);
    if public.exists() {
        let taken = ErrorKind::AlreadyExists.into();
        return Err(RecorderError::io(public, "create the public key")(taken));
    }
    write_new(path, 0o600, key.to_text().as_bytes())
        .map_err(RecorderError::io(path, "create the key"))?;
    write_new(&public, 0o644, key.public().to_text().as_bytes())
        .map_err(RecorderError::io(public, "create the public key"))?;
    Ok(key)
}

/// Where the public half of a key lies.
#[must_use]
pub fn public_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".pub");
    PathBuf::from(name)
}

fn write_new(path: &Path, mode: u32, bytes: &[u8]) -> std::io::Result<()> {
    let mut options = OpenOptions::new();
    let mut file = options.write(true).create_new(true).mode(mode).open(path)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use std::os::unix::fs::PermissionsExt;

    use super::*;

    fn folder(name: &str) -> PathBuf {
        let name = format!("svartboks-keys-{name}-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn allow(path: &Path, mode: u32) {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    }

    #[test]
    fn a_new_key_is_its_owners_alone_and_never_written_over() {
        let folder = folder("new");
        let path = folder.join("device.key");
        let key = create(&path).unwrap();
        assert_eq!(path.metadata().unwrap().mode() & 0o7777, 0o600);
        assert_eq!(read_secret(&path).unwrap().public(), key.public());
        let public = public_path(&path);
        for path in [&path, &public] {
            assert_eq!(read_public(path).unwrap(), key.public());
        }
        assert!(read_secret(&public).is_err());
        assert!(create(&path).is_err());
        std::fs::remove_file(&path).unwrap();
        assert!(create(&path).is_err(), "the public half is there");
        std::fs::remove_file(&public).unwrap();
        assert_ne!(create(&path).unwrap().public(), key.public());
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_key_that_others_may_read_is_refused_unless_systemd_hands_it_over() {
        let folder = folder("mode");
        let path = folder.join(CREDENTIAL);
        let key = create(&path).unwrap().public();
        let loaded = |configured: Option<&Path>, credentials: Option<&Path>| {
            load_from(configured, credentials).map(|key| key.map(|key| key.public()))
        };
        assert_eq!(loaded(Some(&path), None).unwrap(), Some(key));
        for mode in [0o640, 0o604, 0o660, 0o644] {
            allow(&path, mode);
            let error = loaded(Some(&path), None).unwrap_err().to_string();
            assert!(error.contains(&format!("{mode:04o}")), "{error}");
            assert_eq!(loaded(None, Some(&folder)).unwrap(), Some(key));
            assert_eq!(loaded(Some(&path), Some(&folder)).unwrap(), Some(key));
        }
        assert_eq!(loaded(None, None).unwrap(), None);
        assert_eq!(loaded(None, Some(&folder.join("other"))).unwrap(), None);
        assert!(loaded(Some(&folder.join("other")), None).is_err());
        std::fs::write(&path, "x".repeat(1000)).unwrap();
        assert!(loaded(None, Some(&folder)).is_err());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
