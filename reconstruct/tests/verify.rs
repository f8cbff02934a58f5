//! `reconstruct verify` on records: what was changed or forged is named, through the real program.
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(clippy::ptr_arg, reason = "changes of one list of them all")]

#[path = "support/device.rs"]
mod device;
#[path = "../../schema/tests/support/ledgers.rs"]
mod ledgers;
#[path = "../../schema/tests/support/mutate.rs"]
mod mutate;
#[path = "../../schema/tests/support/mod.rs"]
mod records;
mod support;

use std::fs;

use device::{Device, record, sealed, text, verify};
use ledgers::key;
use schema::ledger::FILE_NAME;
use schema::seal::signed_message;
use schema::{Record, SecretKey};
use support::{reconstruct, stderr, stdout};

#[test]
fn a_sound_folder_is_proven_with_the_key_and_unproven_without() {
    let device = Device::new("verify-sound", false);
    let (code, found) = device.verify(1);
    assert_eq!((code, &found["breaks"]), (Some(0), &serde_json::json!([])));
    let notes = found["notes"].to_string();
    assert!(notes.contains("1 of the 4 records"), "{notes}");
    let first = &found["records"][0];
    assert_eq!(
        (&first["number"], &first["signature"]),
        (&2.into(), &"good".into())
    );
    assert_eq!(first["key_fingerprint"], key(1).public().fingerprint());
    for field in ["device_id", "software", "utc", "config_sha256", "vin"] {
        assert!(!first[field].as_str().unwrap().is_empty(), "{field}");
    }
    let shown = reconstruct(&["verify", text(&device.dir), "--key", text(&device.key(1))]);
    let shown = stdout(&shown);
    for word in [
        "WSVB0000000000001",
        "bench",
        "recorder 0.1.0",
        "2026-03-14T15:09:2",
        "proven: signed by key",
        "sound:",
    ] {
        assert!(shown.contains(word), "{word}: {shown}");
    }
    let (code, found) = verify(&[&device.dir], None);
    assert_eq!(
        (code, &found["records"][0]["signature"]),
        (Some(3), &"unchecked".into())
    );
    let shown = stdout(&reconstruct(&["verify", text(&device.files[0])]));
    assert!(shown.contains("identity unproven"), "{shown}");
    // Some of the records, in any order.
    let (code, found) = verify(&[&device.files[2], &device.files[1]], Some(&device.key(1)));
    assert_eq!(code, Some(0), "{found}");
    let (code, found) = verify(&[&device.files[0]], Some(&device.key(1)));
    assert_eq!((code, &found["identity_proven"]), (Some(0), &true.into()));
    let (code, _) = verify(&[&device.files[0]], Some(&device.key(3)));
    assert_eq!(code, Some(3));
}

#[test]
fn a_secret_key_in_place_of_the_public_one_is_refused_without_showing_it() {
    let device = Device::new("verify-secret", false);
    let path = device.dir.join("secret");
    fs::write(&path, &*key(1).to_text()).unwrap();
    let refused = reconstruct(&["verify", text(&device.dir), "--key", text(&path)]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(!stderr(&refused).contains("0101010101"));
}

#[test]
fn replays_and_unsigned_records_are_unproven_whatever_the_key() {
    let device = Device::new("verify-unsigned", false);
    let replay = device.dir.join("replay.svb");
    fs::write(&replay, records::small().to_bytes().unwrap()).unwrap();
    let unsigned = device.dir.join("unsigned.svb");
    fs::write(&unsigned, sealed(&record(9, [0; 32]), None).0).unwrap();
    for (path, word) in [
        (&replay, "a replayed record"),
        (&unsigned, "carries no signature"),
    ] {
        let shown = reconstruct(&["verify", text(path), "--key", text(&device.key(1))]);
        assert_eq!(shown.status.code(), Some(3));
        assert!(stdout(&shown).contains(word), "{}", stdout(&shown));
    }
}

/// The bytes of record 3 with its structures changed, each with right checksums; digest and signature as they were.
fn changed(device: &Device, change: impl FnOnce(&mut Vec<mutate::Structure>)) -> Vec<u8> {
    let bytes = fs::read(&device.files[1]).unwrap();
    let mut structures = mutate::parse(&bytes);
    change(&mut structures);
    let mut built = mutate::build(&structures, Some([0; 64]));
    let from = built.len() - 100;
    built[from..].copy_from_slice(&bytes[bytes.len() - 100..]);
    built
}

/// The same with a digest that holds; signed by a key, or with the signature there was.
fn resealed(
    device: &Device,
    key: Option<&SecretKey>,
    change: impl FnOnce(&mut Vec<mutate::Structure>),
) -> Vec<u8> {
    let bytes = fs::read(&device.files[1]).unwrap();
    let mut structures = mutate::parse(&bytes);
    change(&mut structures);
    let (_, seal) = Record::read(&bytes).unwrap();
    let unsigned = mutate::build(&structures, Some([0; 64]));
    let (_, new) = Record::read(&unsigned).unwrap();
    let signature = key.map_or(seal.signature.unwrap(), |key| {
        key.sign(&signed_message(&new.sha256))
    });
    mutate::build(&structures, Some(signature))
}

fn swap_blocks(structures: &mut Vec<mutate::Structure>) {
    let blocks: Vec<usize> = (0..structures.len())
        .filter(|at| structures[*at].0 == *b"SECS")
        .collect();
    structures.swap(blocks[0], blocks[1]);
}

fn change_health(structures: &mut Vec<mutate::Structure>) {
    let health = structures.iter_mut().find(|s| s.0 == *b"HLTH").unwrap();
    health.1[0] ^= 1;
}

fn add_part(structures: &mut Vec<mutate::Structure>) {
    let end = structures.len() - 1;
    structures.insert(end, (*b"GNSS", vec![1, 2, 3]));
}

#[test]
fn a_change_with_right_checksums_breaks_the_digest() {
    let device = Device::new("verify-change-parts", false);
    let cases: [fn(&mut Vec<mutate::Structure>); 3] = [swap_blocks, change_health, add_part];
    for change in cases {
        let bytes = changed(&device, change);
        fs::write(&device.files[1], bytes).unwrap();
        device.breaks("every byte as it was sealed");
        let again = Device::new("verify-change-parts", false);
        assert_eq!(again.files, device.files);
    }
}

#[test]
fn a_change_with_a_right_digest_breaks_signature_and_ledger() {
    for (name, forger, expected) in [
        ("verify-old-signature", None, "another signature"),
        ("verify-other-key", Some(key(3)), "another signature"),
        (
            "verify-stolen-key",
            Some(key(1)),
            "the digest that the ledger has for record 3",
        ),
    ] {
        let device = Device::new(name, false);
        fs::write(
            &device.files[1],
            resealed(&device, forger.as_ref(), change_health),
        )
        .unwrap();
        device.breaks(expected);
        // The record after it names the one that was there.
        device.breaks("record 3 was changed or replaced");
        fs::remove_file(device.dir.join(FILE_NAME)).unwrap();
        device.breaks("record 3 was changed or replaced");
    }
}

#[test]
fn a_record_that_was_cut_or_added_to_is_broken() {
    let device = Device::new("verify-cut", false);
    let whole = fs::read(&device.files[1]).unwrap();
    let mut longer = whole.clone();
    longer.push(0);
    for bytes in [
        &whole[..whole.len() - 1],
        &whole[..whole.len() / 2],
        &longer,
    ] {
        fs::write(&device.files[1], bytes).unwrap();
        device.breaks("every byte as it was sealed");
    }
    // Nothing can be read: exit code 1 alone, 3 among others.
    fs::write(&device.files[1], &whole[..20]).unwrap();
    let (code, _) = verify(&[&device.files[1]], None);
    assert_eq!(code, Some(1));
    device.breaks("0003.svb");
    device.breaks("expected record 3");
}
