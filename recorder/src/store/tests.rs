#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

#[path = "../../../schema/tests/support/mod.rs"]
mod support;

mod cuts;
mod faults;
mod opening;
mod weak;

use std::path::Path;
use std::sync::Arc;

use schema::header::{Layout, Origin};
use schema::ledger::audit::{Audit, audit};
use schema::ledger::{FILE_NAME, Kind};
use schema::{Ledger, Record, SecretKey};

use super::lock::{Severity, weakness};
use super::vault::{Sealed, Vault};
use super::{VaultError, rotate};
use crate::storage::model::{Cut, Model};
use crate::storage::{Disk, Storage};

const DIR: &str = "/records";
/// A reserve that is small enough for the tests.
const RESERVE: u64 = 6_000;

fn key() -> SecretKey {
    SecretKey::from_bytes(&[7; 32])
}

/// An event of its own, without a crash.
fn event(number: i64) -> Record {
    live(support::small(), number)
}

/// The record as one of so many hours later.
fn live(mut record: Record, hours: i64) -> Record {
    record.header.clock.offset_ns += hours * 3_600_000_000_000;
    record.header.origin = Origin::Live;
    for block in &mut record.blocks {
        let utc_ns = block.monotonic_ns + record.header.clock.offset_ns;
        block.stamp = schema::time::Stamp::from_utc_ns(utc_ns);
    }
    record
}

/// An event whose change of speed is so many km/h within 100 ms, in x and y alike.
fn crash(number: i64, kmh: f64) -> Record {
    let mut record = support::record(Layout::Full, 1, 200, 100);
    let schema::Scales { wheel, accel, rate } = schema::Scales::default();
    let mut packer = schema::Packer::new(wheel, accel, rate);
    let scale = kmh / 3.6 / 0.1 / 2.0_f64.sqrt();
    let samples = (1..200_u64).map(|k| {
        let mut sample = support::sample(k);
        let pulse = if (100..110).contains(&k) { -scale } else { 0.0 };
        sample.accel = [Some(pulse), Some(pulse), Some(-9.8)];
        (sample.wheels, sample.rate) = ([Some(13.0); 2], [Some(0.0); 3]);
        (k, packer.packed(&sample))
    });
    record.blocks = schema::block::cut(samples.collect::<Vec<_>>(), &support::GRID);
    record.clipping.clear();
    live(record, number)
}

fn open(storage: &Model, keep: usize) -> (Vault, Vec<String>) {
    let storage = Arc::new(storage.clone());
    let (dir, key) = (Path::new(DIR), Some(key()));
    Vault::open_with_reserve(storage, dir, keep, key, None, RESERVE).unwrap()
}

fn ledger(storage: &dyn Storage) -> Ledger {
    let path = Path::new(DIR).join(FILE_NAME);
    Ledger::read(&storage.read(&path, 1 << 24).unwrap())
}

/// Asserts that every record that is there reads, is signed, is the ledger's, and names the one before.
fn assert_whole(storage: &dyn Storage, vault: &Vault) -> Audit {
    let found = audit(&ledger(storage));
    assert_eq!(found.breaks, Vec::<String>::new());
    for held in vault.records() {
        let bytes = storage.read(&held.path, 1 << 26).unwrap();
        let (record, seal) = Record::read(&bytes).unwrap();
        assert!(seal.signed_by(&key().public()));
        let entered = &found.records[&record.header.number];
        assert_eq!(
            (seal.sha256, None),
            (entered.sealed.sha256, entered.removed)
        );
        assert_eq!(entered.sealed.utc_ns, record.utc_ns());
        assert_eq!(entered.sealed.flags.locked, Severity::of(&record).locks());
        assert_eq!(entered.sealed.flags.weak, weakness(&record));
        let before = found.records.get(&(record.header.number - 1));
        let before = before.map_or([0; 32], |before| before.sealed.sha256);
        assert_eq!(record.header.previous_sha256, before);
    }
    for (number, entered) in &found.records {
        let there = vault.records().any(|held| held.number == *number);
        assert_eq!(there, entered.removed.is_none(), "record {number}");
    }
    found
}

fn numbers(vault: &Vault) -> Vec<u64> {
    vault.records().map(|held| held.number).collect()
}

#[test]
fn records_are_chained_signed_entered_and_kept_by_the_rule() {
    let model = Model::new();
    let (mut vault, notes) = open(&model, 5);
    assert_eq!(notes.len(), 1, "{notes:?}");
    for number in 1..=10 {
        let sealed: Sealed = vault.seal(event(number)).unwrap();
        assert_eq!(i64::try_from(sealed.number), Ok(number));
        assert_eq!(sealed.removed.len(), usize::from(number > 5));
        assert!(sealed.path.to_str().unwrap().contains("Z-00"));
        assert_whole(&model, &vault);
    }
    assert_eq!(numbers(&vault), [6, 7, 8, 9, 10]);
    let (vault, notes) = open(&model, 5);
    assert_eq!((numbers(&vault), notes), (vec![6, 7, 8, 9, 10], vec![]));
    // An event that the rule removed is sealed all the same.
    assert!((1..=10).all(|number| vault.sealed_already(event(number).utc_ns())));
    assert!(!vault.sealed_already(event(11).utc_ns()));
}

#[test]
fn ten_crashes_in_a_row_are_all_kept_and_so_after_a_restart() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 5);
    for number in 1..=10 {
        assert!(vault.seal(crash(number, 30.0)).unwrap().locked);
    }
    let (mut vault, _) = open(&model, 5);
    for number in 11..=17 {
        assert!(!vault.seal(event(number)).unwrap().locked);
    }
    let kept: Vec<u64> = (1..=10).chain(13..=17).collect();
    assert_eq!(numbers(&vault), kept);
    assert_whole(&model, &vault);
}

#[test]
fn the_lock_is_at_25_kmh_and_lower_where_the_sensor_stood_at_its_limit() {
    for (kmh, locked) in [(10.0, false), (24.0, false), (26.0, true), (80.0, true)] {
        let record = crash(1, kmh);
        let found = Severity::of(&record);
        assert!((found.delta_v.kmh() - kmh).abs() < 0.3, "{kmh}: {found:?}");
        assert_eq!(found.locks(), locked);
    }
    let clip = |index, axis| schema::parts::Clip {
        index,
        axis,
        sign: -1,
        clipped: 1,
        frames: 10,
    };
    let mut clipped = crash(1, 20.0);
    clipped.clipping = vec![clip(104, 1)];
    assert!(Severity::of(&clipped).locks());
    for elsewhere in [clip(104, 2), clip(20, 0), clip(9_999, 0)] {
        clipped.clipping = vec![elsewhere];
        assert!(!Severity::of(&clipped).locks(), "{elsewhere:?}");
    }
}

#[test]
fn an_event_is_sealed_once() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 5);
    let first = vault.seal(event(1)).unwrap();
    let again = vault.seal(event(1)).unwrap();
    assert!(again.already && !first.already);
    assert_eq!((again.path, again.seal), (first.path, first.seal));
    let (mut vault, _) = open(&model, 5);
    assert!(vault.seal(event(1)).unwrap().already);
    assert_eq!(ledger(&model).entries.len(), 2);
}

#[test]
fn without_a_key_records_and_ledger_are_unsigned_and_sound() {
    let model = Model::new();
    let folder = Path::new(DIR);
    let open = || Vault::open(Arc::new(model.clone()), folder, 5, None, None).unwrap();
    let (mut vault, notes) = open();
    assert!(notes.is_empty() && vault.public_key().is_none());
    for number in 1..=7 {
        assert_eq!(vault.seal(event(number)).unwrap().seal.signature, None);
    }
    let found = audit(&ledger(&model));
    assert_eq!((found.breaks.len(), found.unsigned), (0, 9));
    assert_eq!(numbers(&open().0), [3, 4, 5, 6, 7]);
}

#[test]
fn a_lost_or_damaged_ledger_is_begun_anew_with_the_records_that_are_there() {
    for damage in [true, false] {
        let model = Model::new();
        let (mut vault, _) = open(&model, 5);
        for number in 1..=6 {
            vault
                .seal(crash(number, if number == 3 { 40.0 } else { 9.0 }))
                .unwrap();
        }
        let path = Path::new(DIR).join(FILE_NAME);
        if damage {
            model.open(&path).unwrap().write_at(300, b"damage").unwrap();
        } else {
            model.remove(&path).unwrap();
        }
        let (mut vault, notes) = open(&model, 5);
        assert!(notes.len() >= 5, "{notes:?}");
        assert_eq!(numbers(&vault), [2, 3, 4, 5, 6]);
        assert!(
            ledger(&model).entries[1..]
                .iter()
                .all(|entry| entry.flags.adopted)
        );
        let sealed = vault.seal(event(9)).unwrap();
        assert_eq!(sealed.number, 7);
        let found = audit(&ledger(&model));
        assert_eq!(found.breaks, Vec::<String>::new());
        assert!(found.records[&3].sealed.flags.locked);
        let (record, _) = Record::read(&model.read(&sealed.path, 1 << 20).unwrap()).unwrap();
        assert_eq!(
            record.header.previous_sha256,
            found.records[&6].sealed.sha256
        );
        assert_eq!(
            damage,
            model
                .length(&Path::new(DIR).join("ledger-1.damaged"))
                .is_ok()
        );
    }
}

#[test]
fn strangers_in_the_folder_are_left_alone() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 1);
    vault.seal(event(1)).unwrap();
    // Replays, one of them under the very name of the next record.
    let replay = support::small().to_bytes().unwrap();
    let put = |name: &str| {
        let mut file = model.create(&Path::new(DIR).join(name)).unwrap();
        file.write_at(0, &replay).unwrap();
    };
    put(&super::name_of(event(2).utc_ns(), 2, 1, false));
    put("20260314T150926Z-0099.svb");
    let second = vault.seal(event(2)).unwrap();
    assert!(second.path.to_str().unwrap().ends_with("-2.svb"));
    let (mut vault, _) = open(&model, 1);
    assert_eq!(numbers(&vault), [2]);
    assert_whole(&model, &vault);
    // A record that was changed is not removed as if it were the record.
    model
        .open(&second.path)
        .unwrap()
        .write_at(500, b"changed")
        .unwrap();
    let third = vault.seal(event(3)).unwrap();
    assert!(
        third.removed.is_empty() && third.notes[0].contains("kept"),
        "{third:?}"
    );
    assert!(model.length(&second.path).is_ok());
}

#[test]
fn a_new_key_is_signed_by_the_old_one_or_nobody_vouches_for_it() {
    let folder = std::env::temp_dir().join(format!("svartboks-rotate-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let new = SecretKey::from_bytes(&[8; 32]);
    let open =
        |key: &SecretKey| Vault::open(Arc::new(Disk), &folder, 5, Some(key.clone()), None).unwrap();
    open(&key()).0.seal(event(1)).unwrap();
    let held = super::claim(&folder).unwrap();
    let refused = rotate(&Disk, &folder, &key(), &new, 5).unwrap_err();
    assert!(refused.to_string().contains("running"), "{refused}");
    drop(held);
    assert!(rotate(&Disk, &folder, &new, &key(), 5).is_err());
    assert!(rotate(&Disk, &folder, &key(), &key(), 5).is_err());
    assert!(rotate(&Disk, &folder, &key(), &new, 5).unwrap().is_empty());
    let (mut vault, notes) = open(&new);
    assert!(notes.is_empty(), "{notes:?}");
    vault.seal(event(2)).unwrap();
    let read = || Ledger::read(&std::fs::read(folder.join(FILE_NAME)).unwrap());
    let found = audit(&read());
    assert_eq!(found.breaks, Vec::<String>::new());
    assert!(found.vouches(&key().public(), &new.public()));
    let stranger = SecretKey::from_bytes(&[9; 32]);
    let (_, notes) = open(&stranger);
    assert!(notes[0].contains("nobody vouches"), "{notes:?}");
    assert_eq!(audit(&read()).breaks.len(), 1);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[cfg(not(feature = "age"))]
#[test]
fn a_build_without_encryption_says_so() {
    let recipient = Some("age1zvkyg2lqzraa2lnjvqej32nkuu0ues2s82hzrye869xeexvn73equnujwj");
    let refused = Vault::open(Arc::new(Model::new()), Path::new(DIR), 5, None, recipient);
    let error = refused.map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("cargo feature `age`"), "{error}");
}

#[cfg(feature = "age")]
#[test]
fn an_encrypted_record_is_the_sealed_file_byte_for_byte_within() {
    use std::io::Read;
    let identity = age::x25519::Identity::generate();
    let to = identity.to_public().to_string();
    let model = Model::new();
    let open = || {
        Vault::open(
            Arc::new(model.clone()),
            Path::new(DIR),
            5,
            Some(key()),
            Some(&to),
        )
    };
    let (mut vault, _) = open().unwrap();
    for number in 1..=7 {
        let record = if number == 1 {
            crash(1, 50.0)
        } else {
            event(number)
        };
        let sealed = vault.seal(record).unwrap();
        let file = model.read(&sealed.path, 1 << 20).unwrap();
        assert!(matches!(
            Record::read(&file),
            Err(schema::SchemaError::Encrypted)
        ));
        let inner = schema::envelope::contents(&file).unwrap();
        let decryptor = age::Decryptor::new(inner).unwrap();
        let identities = std::iter::once::<&dyn age::Identity>(&identity);
        let mut plain = Vec::new();
        decryptor
            .decrypt(identities)
            .unwrap()
            .read_to_end(&mut plain)
            .unwrap();
        let (record, seal) = Record::read(&plain).unwrap();
        assert_eq!((record.header.number, seal), (sealed.number, sealed.seal));
        assert_eq!(sealed.path.extension().unwrap(), "sve");
    }
    let (vault, notes) = open().unwrap();
    assert_eq!((numbers(&vault), notes), (vec![1, 3, 4, 5, 6, 7], vec![]));
    assert_eq!(audit(&ledger(&model)).breaks, Vec::<String>::new());
    let flags = schema::ledger::Flags {
        locked: true,
        encrypted: true,
        ..schema::ledger::Flags::default()
    };
    assert_eq!(ledger(&model).entries[1].flags, flags);
    let wrong = Vault::open(
        Arc::new(model.clone()),
        Path::new(DIR),
        5,
        None,
        Some("age1x"),
    );
    assert!(wrong.is_err());
}
