//! The settings that the spool's frames were received under, in files beside it, named by their digest.

use std::path::{Path, PathBuf};

use schema::seal::Hex;

use crate::config::Bundle;
use crate::error::RecorderError;
use crate::storage::{Storage, beside};

/// Bundles of earlier sessions that are kept: names say nothing of age, so enough for any number of reloads.
const KEPT: usize = 64;

/// The file of a bundle: `SPOOL.DIGEST.settings`, the first eight bytes of the digest.
fn place(spool: &Path, digest: &[u8; 32]) -> PathBuf {
    let short = digest.get(..8).unwrap_or_default();
    beside(spool, &format!("{}.settings", Hex(short)))
}

/// Stores a bundle, durably, and forgets the oldest ones.
///
/// # Errors
/// When it can not be written.
pub fn store(
    storage: &dyn Storage,
    spool: &Path,
    bundle: &Bundle,
) -> Result<[u8; 32], RecorderError> {
    let digest = bundle.digest();
    let path = place(spool, &digest);
    let folder = spool.parent().unwrap_or(Path::new(""));
    let error = |action| RecorderError::io(&path, action);
    storage
        .create_folder(folder)
        .map_err(error("create the folder of"))?;
    let bytes = bundle.to_bytes();
    let there = storage.read(&path, Bundle::MOST_BYTES);
    if there.is_ok_and(|there| there == bytes) {
        return Ok(digest);
    }
    let temporary = beside(&path, "part");
    let mut file = storage.create(&temporary).map_err(error("create"))?;
    file.write_at(0, &bytes).map_err(error("write"))?;
    file.sync().map_err(error("synchronise"))?;
    storage.rename(&temporary, &path).map_err(error("name"))?;
    storage
        .sync_folder(folder)
        .map_err(error("synchronise the folder of"))?;
    Ok(digest)
}

/// Removes bundles that no session of the spool needs: all but those named.
///
/// # Errors
/// When the folder can not be read; a file that stays does no harm.
pub fn forget(
    storage: &dyn Storage,
    spool: &Path,
    needed: &[[u8; 32]],
) -> Result<(), RecorderError> {
    let folder = spool.parent().unwrap_or(Path::new(""));
    let stem = spool
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let needed: Vec<PathBuf> = needed.iter().map(|digest| place(spool, digest)).collect();
    let files = storage
        .list(folder)
        .map_err(RecorderError::io(folder, "list the folder"))?;
    let ours = |path: &PathBuf| {
        let name = path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        name.starts_with(&stem) && name.ends_with(".settings")
    };
    let old: Vec<&PathBuf> = files
        .iter()
        .filter(|path| ours(path) && !needed.contains(path))
        .collect();
    for path in old.iter().take(old.len().saturating_sub(KEPT)) {
        let _ = storage.remove(path);
    }
    Ok(())
}

/// Reads a bundle.
///
/// # Errors
/// When it is not there or is not the one named.
pub fn load(
    storage: &dyn Storage,
    spool: &Path,
    digest: &[u8; 32],
) -> Result<Bundle, RecorderError> {
    let path = place(spool, digest);
    let bytes = storage
        .read(&path, Bundle::MOST_BYTES)
        .map_err(RecorderError::io(&path, "read the settings of the spool"))?;
    let bundle = Bundle::from_bytes(&path, &bytes)?;
    if bundle.digest() == *digest {
        Ok(bundle)
    } else {
        Err(RecorderError::io(&path, "check the settings of the spool")(
            std::io::Error::new(
                std::io::ErrorKind::InvalidData,
                format!(
                    "expected the digest {}, found {}",
                    Hex(digest),
                    Hex(&bundle.digest())
                ),
            ),
        ))
    }
}
