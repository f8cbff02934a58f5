//! The configuration: TOML becomes a [`Config`] (what was written), a `Config` becomes [`Settings`]
//! (what is valid). Every error names file, line, what was expected and what was found.

mod bundle;
mod condition;
mod file;
mod gnss;
mod locate;
mod mapping;
mod names;
mod operation;
mod settings;
mod units;

pub use bundle::Bundle;
pub use condition::Condition;
pub use file::Config;
pub use gnss::{Device, Gnss, GnssInput, Signals};
pub use locate::{Place, nearest};
pub use operation::default_socket;
pub use operation::{Run, Serial, Spool, Store};
pub use settings::{Bus, CanTrigger, Raw, RawFrames, Ring, Settings, Triggers};

use std::path::PathBuf;

use crate::dbc::DbcError;

/// What is wrong with a configuration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file can not be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no TOML, or a value has another type.
    #[error("{place}: {message}")]
    Syntax {
        /// Where.
        place: Place,
        /// What the TOML reader says.
        message: String,
    },
    /// A key that does not exist.
    #[error("{place}: expected one of the known keys, found `{key}`{hint}")]
    UnknownKey {
        /// Where.
        place: Place,
        /// As written.
        key: String,
        /// The nearest valid key.
        hint: String,
    },
    /// A bus, message or signal that does not exist.
    #[error("{place}: expected {expected}, found `{found}`{hint}")]
    UnknownName {
        /// Where.
        place: Place,
        /// What the name should be.
        expected: String,
        /// As written.
        found: String,
        /// The nearest valid name.
        hint: String,
    },
    /// The DBC gives the signal a unit that does not fit.
    #[error("{place}: {signal}: expected a unit of {expected}, found `{found}`; {remedy}")]
    Unit {
        /// Where.
        place: Place,
        /// The signal.
        signal: String,
        /// Units that would do.
        expected: String,
        /// The DBC's unit.
        found: String,
        /// The key that sets it.
        remedy: String,
    },
    /// A value out of its bounds.
    #[error("{place}: {key}: expected {expected}, found {found}")]
    Value {
        /// Where.
        place: Place,
        /// The key.
        key: String,
        /// What would do.
        expected: String,
        /// As written.
        found: String,
    },
    /// The same thing is assigned twice, or two things overlap.
    #[error("{place}: {key}: expected {expected}, found {found}")]
    Overlap {
        /// Where.
        place: Place,
        /// The later key.
        key: String,
        /// What would do.
        expected: String,
        /// What is there.
        found: String,
    },
    /// A DBC file is wrong.
    #[error("{place}: {source}")]
    Dbc {
        /// Where the configuration names it.
        place: Place,
        /// What is wrong with it.
        source: DbcError,
    },
}
