//! `recorder key`: make, show and change the device's key.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use schema::PublicKey;
use serde_json::json;

use super::{SOUND, print};
use crate::clock;
use crate::config::Settings;
use crate::error::RecorderError;
use crate::keys;
use crate::storage::Disk;
use crate::store;

/// What to do with the key.
#[derive(Debug, Subcommand)]
pub(super) enum KeyCommand {
    /// Make a device key; its public half goes beside it as FILE.pub. Never writes over an existing file.
    New {
        /// Where the secret key goes (mode 0600).
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        /// The result as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Show a key's public half and fingerprint.
    Show {
        /// A secret or a public key.
        file: PathBuf,
        /// The result as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Enter a new key in the ledger, signed by the old one. The recorder must not be running.
    Rotate {
        /// Configuration (TOML): says which key is the old one and where the ledger is.
        #[arg(long)]
        config: PathBuf,
        /// The new secret key, as `recorder key new` made it.
        #[arg(long, value_name = "FILE")]
        new: PathBuf,
        /// The old secret key (default: that of the configuration).
        #[arg(long, value_name = "FILE")]
        old: Option<PathBuf>,
        /// The result as JSON.
        #[arg(long)]
        json: bool,
    },
}

pub(super) fn run(command: KeyCommand) -> Result<u8, RecorderError> {
    match command {
        KeyCommand::New { out, json } => {
            let key = keys::create(&out)?;
            let lines = [
                format!("secret key   {}", out.display()),
                format!("public key   {}", keys::public_path(&out).display()),
            ];
            show(&key.public(), &lines, json)?;
        }
        KeyCommand::Show { file, json } => {
            let public = keys::read_public(&file)?;
            let lines = [public.to_text().trim_end().to_owned()];
            show(&public, &lines, json)?;
        }
        KeyCommand::Rotate {
            config,
            new,
            old,
            json,
        } => rotate(&config, &new, old.as_deref(), json)?,
    }
    Ok(SOUND)
}

fn show(key: &PublicKey, lines: &[String], json: bool) -> Result<(), RecorderError> {
    if json {
        let text = key.to_text();
        let public = text.trim_end();
        let value = json!({ "public_key": public, "fingerprint": key.fingerprint() });
        return print(&value.to_string());
    }
    for line in lines {
        print(line)?;
    }
    print(&format!("fingerprint  {key}"))
}

fn rotate(config: &Path, new: &Path, old: Option<&Path>, json: bool) -> Result<(), RecorderError> {
    let settings = Settings::load(config)?;
    let old = match old {
        Some(path) => Some(keys::read_secret(path)?),
        None => keys::load(&settings.store)?,
    };
    let old = old.ok_or_else(|| RecorderError::Key {
        path: config.to_path_buf(),
        expected: "[device] key, or --old FILE: the old key signs the new one".to_owned(),
        found: "neither".to_owned(),
    })?;
    let new_key = keys::read_secret(new)?;
    let now = clock::realtime_ns();
    let notes = store::rotate(&Disk, &settings.store.dir, &old, &new_key, now)?;
    let (from, to) = (old.public(), new_key.public());
    if json {
        let value = json!({
            "old_fingerprint": from.fingerprint(),
            "fingerprint": to.fingerprint(),
            "public_key": to.to_text().trim_end(),
            "notes": notes,
        });
        return print(&value.to_string());
    }
    for note in notes {
        print(&note)?;
    }
    print(&format!("old key      {from}"))?;
    print(&format!("new key      {to}, entered in the ledger"))?;
    print(&format!(
        "now set [device] key to {} and start the recorder",
        new.display()
    ))
}
