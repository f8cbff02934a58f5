//! What the recorder's vault seals is what the reconstructor proves: chain, ledger, keep rule, a changed key.
#![allow(clippy::unwrap_used, clippy::indexing_slicing, reason = "tests")]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use reconstruct::chain::{Book, Finding, Identity, Link, judge};
use recorder::storage::Disk;
use recorder::store::{Vault, rotate};
use schema::header::Origin;
use schema::ledger::FILE_NAME;
use schema::ledger::audit::audit;
use schema::{Ledger, PublicKey, Record, SecretKey};

fn folder(name: &str) -> PathBuf {
    let name = format!("svartboks-vault-{name}-{}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    let _ = fs::remove_dir_all(&folder);
    folder
}

/// The committed crash, as if received live; its second copies an hour later each.
fn crash(hours: i64) -> Record {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/record/oblique-1.svb");
    let mut record = Record::read(&fs::read(path).unwrap()).unwrap().0;
    record.header.origin = Origin::Live;
    record.header.clock.offset_ns += hours * 3_600_000_000_000;
    for block in &mut record.blocks {
        let utc_ns = block.monotonic_ns + record.header.clock.offset_ns;
        block.stamp = schema::time::Stamp::from_utc_ns(utc_ns);
    }
    record
}

/// The same without its impact: what is left is not locked.
fn harmless(hours: i64) -> Record {
    let mut record = crash(hours);
    record.blocks.truncate(5);
    record.clipping.clear();
    record
}

fn found(folder: &Path, keys: &[PublicKey]) -> Finding {
    let mut links = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "svb") {
            continue;
        }
        let (record, seal) = Record::read(&fs::read(&path).unwrap()).unwrap();
        links.push(Link {
            file: path.file_name().unwrap().to_string_lossy().into_owned(),
            number: record.header.number,
            previous_sha256: record.header.previous_sha256,
            utc_ns: record.utc_ns(),
            live: record.header.origin == Origin::Live,
            seal: Some(seal),
        });
    }
    let ledger = Ledger::read(&fs::read(folder.join(FILE_NAME)).unwrap());
    let book = Book {
        audit: audit(&ledger),
        whole_folder: true,
    };
    judge(&links, Some(&book), keys)
}

#[test]
fn what_the_vault_keeps_is_proven_also_after_removals_and_a_new_key() {
    let folder = folder("proven");
    let (old, new) = (
        SecretKey::from_bytes(&[1; 32]),
        SecretKey::from_bytes(&[2; 32]),
    );
    let open = |key: &SecretKey| {
        let (vault, _) = Vault::open(Arc::new(Disk), &folder, 5, Some(key.clone()), None).unwrap();
        vault
    };
    let mut vault = open(&old);
    assert!(vault.seal(crash(0)).unwrap().locked);
    for hours in 1..=7 {
        let sealed = vault.seal(harmless(hours)).unwrap();
        assert!(!sealed.locked);
        let finding = found(&folder, &[old.public()]);
        assert!(finding.sound(), "{:?}", finding.breaks);
    }
    drop(vault);
    rotate(&Disk, &folder, &old, &new, 1_790_000_000_000_000_000).unwrap();
    let mut vault = open(&new);
    vault.seal(crash(8)).unwrap();
    // The locked ones and the newest five.
    let kept: Vec<u64> = vault.records().map(|held| held.number).collect();
    assert_eq!(kept, [1, 5, 6, 7, 8, 9]);
    for key in [&old, &new] {
        let finding = found(&folder, &[key.public()]);
        assert!(finding.sound(), "{:?}", finding.breaks);
    }
    let stranger = SecretKey::from_bytes(&[3; 32]);
    let finding = found(&folder, &[stranger.public()]);
    assert!(!finding.sound() && finding.identities.contains(&Identity::Stranger));
    let gone = vault.records().nth(2).unwrap().path.clone();
    fs::remove_file(gone).unwrap();
    let finding = found(&folder, &[new.public()]);
    assert!(
        finding
            .breaks
            .iter()
            .any(|broken| broken.contains("expected record 6"))
    );
    // The recorder goes on all the same, and does not hide it.
    let (_, notes) = Vault::open(Arc::new(Disk), &folder, 5, Some(new.clone()), None).unwrap();
    assert!(
        notes.iter().any(|note| note.contains("record 6")),
        "{notes:?}"
    );
    assert!(!found(&folder, &[new.public()]).sound());
    fs::remove_dir_all(&folder).unwrap();
}
