//! Records on disk: written under a temporary name, synchronised, renamed; never over an existing file.

use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use schema::time::Stamp;
use schema::{Record, Seal};

use crate::error::RecorderError;

/// Most names that are tried for a record.
const MOST_NAMES: u32 = 100_000;

/// Writes a record into a folder as `YYYYMMDDThhmmssZ-NNNN.svb` (UTC of the first trigger, and the record's number,
/// or the next free one) and gives its path and seal. After it returns the record survives a loss of power.
///
/// # Errors
/// When the folder or the file can not be written, or the record can not be stored.
pub fn save(record: &Record, dir: &Path) -> Result<(PathBuf, Seal), RecorderError> {
    fs::create_dir_all(dir).map_err(RecorderError::io(dir, "create the folder of the records"))?;
    let temporary = dir.join(format!(
        ".{}-{}.part",
        stem(record, record.header.number),
        std::process::id()
    ));
    let written =
        write(record, &temporary).and_then(|seal| Ok((place(record, dir, &temporary)?, seal)));
    // On success the temporary name is a second link to the record; on failure it is all there is.
    let removed = fs::remove_file(&temporary);
    let (path, seal) = written?;
    match removed {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(RecorderError::io(&temporary, "remove the temporary file")(
                error,
            ));
        }
        _ => {}
    }
    File::open(dir)
        .and_then(|folder| folder.sync_all())
        .map_err(RecorderError::io(dir, "synchronise the folder"))?;
    Ok((path, seal))
}

fn write(record: &Record, path: &Path) -> Result<Seal, RecorderError> {
    let file = File::create(path).map_err(RecorderError::io(path, "create the record"))?;
    let mut out = BufWriter::new(file);
    let seal = record
        .write(&mut out)
        .map_err(|source| RecorderError::Record {
            path: path.to_path_buf(),
            source: Box::new(source),
        })?;
    out.flush()
        .map_err(RecorderError::io(path, "write the record"))?;
    out.get_ref()
        .sync_all()
        .map_err(RecorderError::io(path, "synchronise the record"))?;
    Ok(seal)
}

/// Gives the written file its name by a hard link, which fails where the name is taken (a rename would not).
fn place(record: &Record, dir: &Path, temporary: &Path) -> Result<PathBuf, RecorderError> {
    for step in 0..MOST_NAMES {
        let path = dir.join(format!(
            "{}.svb",
            stem(record, record.header.number + u64::from(step))
        ));
        match fs::hard_link(temporary, &path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            // A file system without hard links: rename, if the name is free.
            Err(_) if !path.exists() => {
                fs::rename(temporary, &path)
                    .map_err(RecorderError::io(&path, "name the record"))?;
                return Ok(path);
            }
            Err(_) => {}
        }
    }
    Err(RecorderError::io(dir, "find a free name for the record")(
        ErrorKind::AlreadyExists.into(),
    ))
}

fn stem(record: &Record, number: u64) -> String {
    let monotonic_ns = record
        .triggers
        .first()
        .map_or(0, |trigger| trigger.monotonic_ns);
    let stamp = Stamp::from_utc_ns(monotonic_ns.saturating_add(record.header.clock.offset_ns));
    format!(
        "{:04}{:02}{:02}T{:02}{:02}{:02}Z-{number:04}",
        stamp.year, stamp.month, stamp.day, stamp.hour, stamp.minute, stamp.second
    )
}
