//! The store of sealed records, as the sealer's thread uses it.

use std::path::PathBuf;
use std::sync::Arc;

use schema::{Record, num};

use super::sealer::{Keeper, Kept, Refused};
use crate::config::Settings;
use crate::error::RecorderError;
use crate::keys;
use crate::storage::Storage;
use crate::store::{Vault, VaultError};

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

/// Opens the store.
pub(super) fn open_keeper(
    storage: &Arc<dyn Storage>,
    settings: &Settings,
) -> Result<Opened, RecorderError> {
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
    let keeper = InVault {
        vault,
        storage: Arc::clone(storage),
        dir: store.dir.clone(),
    };
    Ok(Opened {
        keeper: Box::new(keeper),
        signed,
        notes,
    })
}
