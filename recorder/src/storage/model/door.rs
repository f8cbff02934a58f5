//! The model as a [`Storage`].

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use schema::num;

use super::{Change, Model, Open};
use crate::storage::{Storage, Stored};

impl Model {
    fn handle(&self, file: usize) -> Box<dyn Stored> {
        Box::new(Open {
            state: self.state.clone(),
            file,
        })
    }
}

impl Storage for Model {
    fn create_folder(&self, folder: &Path) -> io::Result<()> {
        let folders = folder.ancestors().map(Path::to_path_buf);
        self.state().now.folders.extend(folders);
        Ok(())
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        let state = self.state();
        if !state.now.folders.contains(folder) {
            return Err(ErrorKind::NotFound.into());
        }
        let names = state.now.names.keys();
        Ok(names
            .filter(|path| path.parent() == Some(folder))
            .cloned()
            .collect())
    }

    fn length(&self, path: &Path) -> io::Result<u64> {
        Ok(num::u64_of(self.state().now.bytes(path)?.len()))
    }

    fn read(&self, path: &Path, most: u64) -> io::Result<Vec<u8>> {
        let bytes = self.state().now.bytes(path)?.clone();
        if num::u64_of(bytes.len()) > most {
            let found = format!("expected at most {most} bytes, found {}", bytes.len());
            return Err(io::Error::new(ErrorKind::InvalidData, found));
        }
        Ok(bytes)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Stored>> {
        let mut state = self.state();
        let there = path
            .parent()
            .is_some_and(|folder| state.now.folders.contains(folder));
        if !there {
            return Err(ErrorKind::NotFound.into());
        }
        state.attempt()?;
        let there = state.now.names.get(path).copied();
        let file = there.unwrap_or(state.now.files.len());
        let change = if there.is_some() {
            Change::Empty { file }
        } else {
            let path = path.to_path_buf();
            Change::Create { path, file }
        };
        state.change(change);
        drop(state);
        Ok(self.handle(file))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Stored>> {
        let found = self.number_of(path).ok_or(ErrorKind::NotFound)?;
        Ok(self.handle(found))
    }

    fn link(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut state = self.state();
        let file = *state.now.names.get(from).ok_or(ErrorKind::NotFound)?;
        if state.now.names.contains_key(to) {
            return Err(ErrorKind::AlreadyExists.into());
        }
        state.attempt()?;
        state.change(Change::Link {
            path: to.to_path_buf(),
            file,
        });
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut state = self.state();
        let file = *state.now.names.get(from).ok_or(ErrorKind::NotFound)?;
        state.attempt()?;
        state.change(Change::Rename {
            from: from.to_path_buf(),
            path: to.to_path_buf(),
            file,
        });
        Ok(())
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        let mut state = self.state();
        if !state.now.names.contains_key(path) {
            return Err(ErrorKind::NotFound.into());
        }
        state.attempt()?;
        state.change(Change::Remove {
            path: path.to_path_buf(),
        });
        Ok(())
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        let mut state = self.state();
        state.attempt()?;
        state.change(Change::SyncFolder {
            folder: folder.to_path_buf(),
        });
        Ok(())
    }

    fn free_bytes(&self, _folder: &Path) -> io::Result<u64> {
        let state = self.state();
        let capacity = state.capacity.unwrap_or(u64::MAX);
        Ok(capacity.saturating_sub(state.now.used()))
    }
}
