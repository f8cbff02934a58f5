//! What can go wrong with a recording: where, what was expected, what was found.

use std::path::PathBuf;

use crate::config::ConfigError;

/// An error of the recorder.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecorderError {
    /// A file or folder could not be used.
    #[error("{}: {action}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The configuration is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The logs hold no frame at all.
    #[error("{logs}: expected lines of candump -L text, found no readable frame{example}")]
    NoFrames {
        /// The logs' names.
        logs: String,
        /// First malformed line, or empty.
        example: String,
    },
    /// Sentences are given and no receiver is configured.
    #[error("--nmea {log}: expected [gnss] with a device in the configuration, found none")]
    NoReceiver {
        /// The log's name.
        log: String,
    },
    /// An interface is renamed to one that no bus names.
    #[error("--map {from}={to}: expected one of the configured interfaces ({known}), found {to}")]
    Map {
        /// Name in the log.
        from: String,
        /// Name asked for.
        to: String,
        /// Configured names.
        known: String,
    },
    /// A key can not be used.
    #[error("{}: expected {expected}, found {found}", path.display())]
    Key {
        /// The key's file, or the ledger's.
        path: PathBuf,
        /// What would do.
        expected: String,
        /// What is there, never the key itself.
        found: String,
    },
    /// Nothing can be encrypted to the configured recipient.
    #[error(transparent)]
    Recipient(#[from] crate::store::encrypt::RecipientError),
    /// The read-out over a serial line could not go on.
    #[error("{device}: {found}")]
    Serial {
        /// The device.
        device: String,
        /// What was found.
        found: String,
    },
    /// The record could not be written.
    #[error("{}: {source}", path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<schema::SchemaError>,
    },
}

impl RecorderError {
    /// An input/output error at a path.
    pub fn io(
        path: impl Into<PathBuf>,
        action: &'static str,
    ) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io {
            path,
            action,
            source,
        }
    }
}
