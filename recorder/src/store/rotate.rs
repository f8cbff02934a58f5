//! A new key: entered in the ledger, signed by the old one.

use std::path::Path;

use schema::SecretKey;

use super::ledger_file::LedgerFile;
use super::{Trouble, claim};
use crate::error::RecorderError;
use crate::storage::Storage;

/// Enters `new` as the key in force from here on in the ledger of a folder, signed by `old`. No recorder may run on the
/// folder meanwhile. `utc_ns` is the time of the change, ns since 1970. Gives what there is to say of the ledger.
///
/// # Errors
/// When a recorder runs, the ledger can not be used, its key in force is not `old`, or the two are the same.
pub fn rotate(
    storage: &dyn Storage,
    dir: &Path,
    old: &SecretKey,
    new: &SecretKey,
    utc_ns: i64,
) -> Result<Vec<String>, RecorderError> {
    let _held = claim(dir)?;
    let mut notes = Vec::new();
    let (mut ledger, _) =
        LedgerFile::open(storage, dir, &mut notes).map_err(Trouble::into_error)?;
    let wrong = |expected: String, found: String| RecorderError::Key {
        path: dir.join(schema::ledger::FILE_NAME),
        expected,
        found,
    };
    let (from, to) = (old.public(), new.public());
    if from == to {
        return Err(wrong("a new key".to_owned(), format!("the old one, {to}")));
    }
    match ledger.key() {
        None => ledger
            .new_key(storage, &from, old, utc_ns)
            .map_err(Trouble::into_error)?,
        Some(key) if key == from => {}
        Some(key) => {
            return Err(wrong(
                format!("the ledger's key in force, {key}"),
                format!("{from}"),
            ));
        }
    }
    ledger
        .new_key(storage, &to, old, utc_ns)
        .map_err(Trouble::into_error)?;
    Ok(notes)
}
