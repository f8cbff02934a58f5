//! The store of sealed records, as the sealer's thread uses it.

use std::path::PathBuf;
use std::sync::Arc;

use schema::Record;

use super::sealer::{Keeper, Kept, Refused};
use crate::config::Settings;
use crate::error::RecorderError;
use crate::storage::Storage;
use crate::store;

struct Plain {
    storage: Arc<dyn Storage>,
    dir: PathBuf,
    number: u64,
}

impl Keeper for Plain {
    fn seal(&mut self, mut record: Record) -> Result<Kept, Box<Refused>> {
        record.header.number = self.number + 1;
        match store::save(&record, &self.dir) {
            Ok((path, _)) => {
                self.number += 1;
                Ok(Kept {
                    path,
                    number: self.number,
                    notes: Vec::new(),
                })
            }
            Err(error) => Err(Box::new(Refused {
                record,
                reason: error.to_string(),
            })),
        }
    }

    fn stored(&self) -> u64 {
        let files = self.storage.list(&self.dir).unwrap_or_default();
        let records = files
            .iter()
            .filter(|path| path.extension().is_some_and(|end| end == "svb"));
        schema::num::u64_of(records.count())
    }

    fn free_bytes(&self) -> u64 {
        self.storage.free_bytes(&self.dir).unwrap_or(0)
    }
}

/// Opens the store; with sentences on what was mended.
pub(super) fn open_keeper(
    storage: &Arc<dyn Storage>,
    settings: &Settings,
) -> Result<(Box<dyn Keeper>, Vec<String>), RecorderError> {
    let plain = Plain {
        storage: Arc::clone(storage),
        dir: settings.store.dir.clone(),
        number: 0,
    };
    Ok((Box::new(plain), Vec::new()))
}
