//! The store of sealed records, as the sealer's thread uses it.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::Arc;

use schema::{Record, num};

use super::sealer::{Keeper, Kept, Refused};
use crate::config::Settings;
use crate::error::RecorderError;
use crate::keys;
use crate::storage::Storage;
use crate::store::{Vault, VaultError};

/// The error number of a disk that fails; its kind has no name.
const EIO: i32 = 5;

struct InVault {
    vault: Vault,
    storage: Arc<dyn Storage>,
    dir: PathBuf,
}

impl Keeper for InVault {
    fn seal(&mut self, record: Record) -> Result<Kept, Box<Refused>> {
        match self.vault.seal(record) {
            Ok(sealed) => {
                let mut notes = sealed.notes;
                if sealed.already {
                    notes.push("the event had been sealed already".to_owned());
                }
                notes.extend(
                    sealed
                        .removed
                        .iter()
                        .map(|path| format!("{} was removed for it", path.display())),
                );
                Ok(Kept {
                    path: sealed.path,
                    number: sealed.number,
                    notes,
                })
            }
            Err(error) => Err(Box::new(Refused {
                reason: error.to_string(),
                hopeless: matches!(error, VaultError::Record { .. }),
                record: error.into_record(),
            })),
        }
    }

    fn stored(&self) -> u64 {
        num::u64_of(self.vault.records().count())
    }

    fn free_bytes(&self) -> u64 {
        self.storage.free_bytes(&self.dir).unwrap_or(0)
    }
}

/// An open store.
pub(super) struct Opened {
    pub(super) keeper: Box<dyn Keeper>,
    /// Records are signed.
    pub(super) signed: bool,
    /// What was mended, one sentence each.
    pub(super) notes: Vec<String>,
}

/// A store that can not be opened now, as on a file system that came up read-only: records wait in memory, and it is
/// tried again with each.
struct Later {
    storage: Arc<dyn Storage>,
    settings: Arc<Settings>,
    vault: Option<InVault>,
}

impl Keeper for Later {
    fn seal(&mut self, record: Record) -> Result<Kept, Box<Refused>> {
        if self.vault.is_none() {
            match open_vault(&self.storage, &self.settings) {
                Ok((vault, _, _)) => self.vault = Some(vault),
                Err(error) => {
                    return Err(Box::new(Refused {
                        reason: error.to_string(),
                        hopeless: false,
                        record,
                    }));
                }
            }
        }
        match &mut self.vault {
            Some(vault) => vault.seal(record),
            None => Err(Box::new(Refused {
                reason: "the store is not open".to_owned(),
                hopeless: false,
                record,
            })),
        }
    }

    fn stored(&self) -> u64 {
        self.vault.as_ref().map_or(0, Keeper::stored)
    }

    fn free_bytes(&self) -> u64 {
        self.vault.as_ref().map_or(0, Keeper::free_bytes)
    }
}

/// The disk takes nothing now, which is no reason not to record.
pub(super) fn disk_trouble(error: &RecorderError) -> bool {
    let RecorderError::Io { source, .. } = error else {
        return false;
    };
    matches!(
        source.kind(),
        ErrorKind::ReadOnlyFilesystem | ErrorKind::StorageFull | ErrorKind::QuotaExceeded
    ) || source.raw_os_error() == Some(EIO)
}

/// Opens the store. Where the disk takes nothing now it is opened later.
pub(super) fn open_keeper(
    storage: &Arc<dyn Storage>,
    settings: &Arc<Settings>,
) -> Result<Opened, RecorderError> {
    match open_vault(storage, settings) {
        Ok((vault, signed, notes)) => Ok(Opened {
            keeper: Box::new(vault),
            signed,
            notes,
        }),
        Err(error) if disk_trouble(&error) => Ok(Opened {
            keeper: Box::new(Later {
                storage: Arc::clone(storage),
                settings: Arc::clone(settings),
                vault: None,
            }),
            signed: settings.store.key.is_some(),
            notes: vec![format!("records wait in memory: {error}")],
        }),
        Err(error) => Err(error),
    }
}

fn open_vault(
    storage: &Arc<dyn Storage>,
    settings: &Settings,
) -> Result<(InVault, bool, Vec<String>), RecorderError> {
    let store = &settings.store;
    let key = keys::load(store)?;
    let signed = key.is_some();
    let (vault, notes) = Vault::open(
        Arc::clone(storage),
        &store.dir,
        num::usize_of(u64::from(store.keep)),
        key,
        store.encrypt_to.as_deref(),
    )?;
    let vault = InVault {
        vault,
        storage: Arc::clone(storage),
        dir: store.dir.clone(),
    };
    Ok((vault, signed, notes))
}
