//! `reconstruct verify` on chain and ledger: what was taken away is missed, a changed ledger named.
#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "support/device.rs"]
mod device;
#[path = "../../schema/tests/support/ledgers.rs"]
mod ledgers;
#[path = "../../schema/tests/support/mod.rs"]
mod records;
mod support;

use std::fs;

use device::{Device, entry, record, sealed, text, verify};
use ledgers::key;
use schema::SecretKey;
use schema::ledger::{Entry, FILE_NAME, Kind};
use support::{folder, reconstruct, stderr};

#[test]
fn a_changed_key_is_followed_through_the_ledger_both_ways() {
    let device = Device::new("verify-change", true);
    for seed in [1, 2] {
        let (code, found) = device.verify(seed);
        assert_eq!(code, Some(0), "{found}");
        assert!(found["notes"].to_string().contains("the key was changed"));
    }
    let (code, found) = device.verify(3);
    assert_eq!(code, Some(3));
    assert!(
        found["breaks"]
            .to_string()
            .contains("expected the given key among its own")
    );
    // Without the ledger a key proves its own records only.
    fs::remove_file(device.dir.join(FILE_NAME)).unwrap();
    let (code, found) = device.verify(1);
    assert_eq!(
        (code, &found["records"][2]["signature"]),
        (Some(3), &"false".into())
    );
    assert!(found["notes"].to_string().contains("no ledger"));
}

#[test]
fn records_that_were_taken_away_are_missed() {
    let device = Device::new("verify-middle", false);
    fs::remove_file(&device.files[1]).unwrap();
    device.breaks("expected record 3 between 2 and 4");
    device.breaks("expected record 3 of 2026-03-14");
    fs::remove_file(device.dir.join(FILE_NAME)).unwrap();
    device.breaks("which only a ledger tells");
    // The newest: the chain can not show it, the ledger does.
    let device = Device::new("verify-newest", false);
    fs::remove_file(&device.files[2]).unwrap();
    device.breaks("expected record 4 of 2026-03-14");
    let (code, found) = verify(&[&device.files[0], &device.files[1]], Some(&device.key(1)));
    assert_eq!(code, Some(0));
    assert!(
        found["notes"].to_string().contains("1 more records"),
        "{found}"
    );
    fs::remove_file(device.dir.join(FILE_NAME)).unwrap();
    let (code, found) = device.verify(1);
    assert_eq!(code, Some(0));
    assert!(
        found["notes"].to_string().contains("can not be told"),
        "{found}"
    );
}

#[test]
fn a_record_put_in_the_place_of_another_is_found() {
    let device = Device::new("verify-placed", false);
    let twin = device.dir.join("twin.svb");
    fs::copy(&device.files[0], &twin).unwrap();
    assert_eq!(device.verify(1).0, Some(0));
    fs::write(&twin, sealed(&record(3, [9; 32]), Some(&key(1))).0).unwrap();
    device.breaks("expected the only record 3");
    fs::write(&twin, sealed(&record(5, [9; 32]), Some(&key(1))).0).unwrap();
    device.breaks("expected record 5 in the ledger");
}

#[test]
fn a_ledger_that_was_changed_is_named() {
    let device = Device::new("verify-ledger", false);
    let sound = device.ledger.clone();
    let resigned = |entries: &[Entry], key: Option<&SecretKey>| {
        let mut all: Vec<Entry> = Vec::new();
        for entry in entries {
            all.push(entry.signed(all.last(), key));
        }
        all
    };
    let mut edited = sound.clone();
    edited[4].utc_ns += 1;
    let mut dropped = sound.clone();
    dropped.remove(3);
    let mut reordered = sound.clone();
    reordered.swap(4, 5);
    let mut unlocked = sound.clone();
    unlocked[3].flags.locked = true;
    let mut without = sound.clone();
    without.remove(4);
    for (entries, expected) in [
        (edited.clone(), "entry 6, digest of the entry before"),
        (dropped.clone(), "entry 4, digest of the entry before"),
        (reordered, "entry 5, digest of the entry before"),
        (unlocked, "digest of the entry before"),
        // The hash chain made right again, by another key or none.
        (resigned(&dropped, Some(&key(3))), "signed"),
        (resigned(&sound, None), "found none"),
        (resigned(&without, Some(&key(1))), "expected record 3"),
        (
            resigned(&edited, Some(&key(1))),
            "the time that the ledger has for record 3",
        ),
    ] {
        device.write_ledger(&entries);
        device.breaks(expected);
    }
    // One edited entry at the end: no later one names it, its signature does.
    let mut last = sound.clone();
    last[5].number = 9;
    device.write_ledger(&last);
    device.breaks("entry 6: expected a signature by the key");
    // Torn, cut, no ledger at all.
    let bytes = ledgers::bytes(&sound);
    let path = device.dir.join(FILE_NAME);
    fs::write(&path, &bytes[..bytes.len() - 10]).unwrap();
    device.breaks("the last entry is torn");
    fs::write(&path, &bytes[..bytes.len() - 156]).unwrap();
    device.breaks("expected record 4 in the ledger");
    fs::write(&path, b"something else").unwrap();
    device.breaks("the magic bytes of a ledger");
    device.write_ledger(&sound);
    assert_eq!(device.verify(1).0, Some(0));
}

#[test]
fn a_forged_past_before_the_real_key_is_not_believed() {
    // A forger's own key, records and ledger, in which he names the device's public key as his successor.
    let dir = folder("verify-forged-past");
    let (forger, real) = (key(3), key(1));
    let mut ledger = vec![ledgers::new_key(&forger, None, &forger)];
    let record = record(1, [0; 32]);
    let (bytes, sha256) = sealed(&record, Some(&forger));
    ledger.push(entry(Kind::Sealed, &record, sha256).signed(ledger.last(), Some(&forger)));
    ledger.push(ledgers::new_key(&real, ledger.last(), &forger));
    fs::write(dir.join("one.svb"), bytes).unwrap();
    fs::write(dir.join(FILE_NAME), ledgers::bytes(&ledger)).unwrap();
    let public = dir.join("real.pub");
    fs::write(&public, real.public().to_text()).unwrap();
    let (code, found) = verify(&[&dir], Some(&public));
    assert_eq!(
        (code, &found["records"][0]["signature"]),
        (Some(3), &"false".into())
    );
}

#[cfg(not(feature = "age"))]
#[test]
fn an_encrypted_record_says_what_it_takes() {
    let dir = folder("verify-encrypted");
    let path = dir.join("one.sve");
    fs::write(&path, [schema::envelope::MAGIC.as_slice(), b"age"].concat()).unwrap();
    let refused = reconstruct(&["verify", text(&path)]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(stderr(&refused).contains("--identity"));
    let refused = reconstruct(&["inspect", text(&path), "--identity", text(&path)]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        stderr(&refused).contains("cargo feature `age`"),
        "{}",
        stderr(&refused)
    );
}

#[cfg(feature = "age")]
#[test]
fn an_encrypted_record_is_verified_and_read_with_its_identity_only() {
    use age::secrecy::ExposeSecret;
    use std::io::Write;
    let device = Device::new("verify-encrypted-age", false);
    let identity = age::x25519::Identity::generate();
    let to = identity.to_public();
    for path in &device.files {
        let plain = fs::read(path).unwrap();
        let recipients = std::iter::once::<&dyn age::Recipient>(&to);
        let mut out = schema::envelope::MAGIC.to_vec();
        let encryptor = age::Encryptor::with_recipients(recipients).unwrap();
        let mut writer = encryptor.wrap_output(&mut out).unwrap();
        writer.write_all(&plain).unwrap();
        writer.finish().unwrap();
        fs::remove_file(path).unwrap();
        fs::write(path.with_extension("sve"), out).unwrap();
    }
    let file = device.dir.join("identity");
    let write = |identity: &age::x25519::Identity| {
        let text = format!("# a comment\n{}\n", identity.to_string().expose_secret());
        fs::write(&file, text).unwrap();
    };
    write(&identity);
    let public = device.key(1);
    let words = [
        "verify",
        text(&device.dir),
        "--key",
        text(&public),
        "--identity",
        text(&file),
    ];
    let shown = reconstruct(&words);
    assert_eq!(shown.status.code(), Some(0), "{}", support::stdout(&shown));
    let one = device.files[0].with_extension("sve");
    let inspected = reconstruct(&["inspect", text(&one), "--identity", text(&file)]);
    assert!(
        [Some(0), Some(3)].contains(&inspected.status.code()),
        "{}",
        stderr(&inspected)
    );
    assert_eq!(reconstruct(&["inspect", text(&one)]).status.code(), Some(1));
    write(&age::x25519::Identity::generate());
    assert_eq!(reconstruct(&words).status.code(), Some(3));
    write(&identity);
    let mut bytes = fs::read(&one).unwrap();
    let end = bytes.len() - 30;
    bytes[end] ^= 1;
    fs::write(&one, bytes).unwrap();
    let shown = reconstruct(&words);
    assert_eq!(shown.status.code(), Some(3));
    assert!(
        support::stdout(&shown).contains("does not open"),
        "{}",
        support::stdout(&shown)
    );
}
