//! A device's folder for the tests of `verify`: records, ledger, public keys.
#![allow(dead_code, reason = "each test file uses some of it")]

use std::fs;
use std::path::{Path, PathBuf};

use schema::header::Origin;
use schema::ledger::{Entry, FILE_NAME, Flags, Kind};
use schema::{Record, SecretKey};
use serde_json::Value;

use crate::ledgers::{self, key};
use crate::records;
use crate::support::{folder, reconstruct, stderr, stdout};

/// A folder with records 1 to 4 of one device and their ledger; record 1 was removed by the keep rule.
pub(crate) struct Device {
    pub(crate) dir: PathBuf,
    pub(crate) files: Vec<PathBuf>,
    pub(crate) ledger: Vec<Entry>,
}

pub(crate) fn record(number: u64, previous: [u8; 32]) -> Record {
    let mut record = records::record(schema::header::Layout::Full, 1, 250, 150);
    record.header.number = number;
    record.header.previous_sha256 = previous;
    record.header.origin = Origin::Live;
    record.header.vehicle.vin = "WSVB0000000000001".into();
    record
}

pub(crate) fn sealed(record: &Record, key: Option<&SecretKey>) -> (Vec<u8>, [u8; 32]) {
    let mut bytes = Vec::new();
    let seal = record.write_signed(&mut bytes, key).unwrap();
    (bytes, seal.sha256)
}

pub(crate) fn entry(kind: Kind, record: &Record, sha256: [u8; 32]) -> Entry {
    Entry {
        kind,
        flags: Flags::default(),
        number: record.header.number,
        utc_ns: record.utc_ns(),
        sha256,
        previous_sha256: [0; 32],
        signature: None,
    }
}

impl Device {
    /// Signed by key 1; record 4 and its entry by key 2 if the key is changed.
    pub(crate) fn new(name: &str, change: bool) -> Self {
        let dir = folder(name);
        let (old, new) = (key(1), key(2));
        let mut ledger = vec![ledgers::new_key(&old, None, &old)];
        let (mut files, mut previous) = (Vec::new(), [0; 32]);
        for number in 1..=4 {
            let key = if change && number == 4 { &new } else { &old };
            if change && number == 4 {
                ledger.push(ledgers::new_key(&new, ledger.last(), &old));
            }
            let record = record(number, previous);
            let (bytes, sha256) = sealed(&record, Some(key));
            previous = sha256;
            let sealed = entry(Kind::Sealed, &record, sha256);
            ledger.push(sealed.signed(ledger.last(), Some(key)));
            if number == 1 {
                let removed = entry(Kind::Removed, &record, sha256);
                ledger.push(removed.signed(ledger.last(), Some(key)));
            } else {
                files.push(dir.join(format!("20260314T150926Z-000{number}.svb")));
                fs::write(files.last().unwrap(), bytes).unwrap();
            }
        }
        let device = Self { dir, files, ledger };
        device.write_ledger(&device.ledger);
        for seed in 1..=3 {
            let text = key(seed).public().to_text();
            fs::write(device.key(seed), text).unwrap();
        }
        device
    }

    pub(crate) fn key(&self, seed: u8) -> PathBuf {
        self.dir.join(format!("{seed}.pub"))
    }

    pub(crate) fn write_ledger(&self, entries: &[Entry]) {
        fs::write(self.dir.join(FILE_NAME), ledgers::bytes(entries)).unwrap();
    }

    /// Exit code and finding on the whole folder with a key.
    pub(crate) fn verify(&self, seed: u8) -> (Option<i32>, Value) {
        verify(&[&self.dir], Some(&self.key(seed)))
    }

    /// Asserts exit code 3 and a break that says so.
    pub(crate) fn breaks(&self, expected: &str) {
        let (code, found) = self.verify(1);
        let breaks = found["breaks"].to_string();
        assert_eq!(code, Some(3), "{breaks}");
        assert!(breaks.contains(expected), "{expected}: {breaks}");
        assert_eq!(found["sound"], false);
        let shown = reconstruct(&["verify", text(&self.dir), "--key", text(&self.key(1))]);
        assert_eq!(shown.status.code(), Some(3));
        assert!(stdout(&shown).contains("BROKEN"));
    }
}

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

pub(crate) fn verify(paths: &[&Path], key: Option<&Path>) -> (Option<i32>, Value) {
    let mut words = vec!["verify", "--json"];
    words.extend(paths.iter().map(|path| text(path)));
    if let Some(key) = key {
        words.extend(["--key", text(key)]);
    }
    let output = reconstruct(&words);
    let found = serde_json::from_slice(&output.stdout);
    (
        output.status.code(),
        found.unwrap_or_else(|_| Value::String(stderr(&output))),
    )
}
