//! `reconstruct verify`: what was changed, taken away or forged is named, through the real program.
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(clippy::ptr_arg, reason = "changes of one list of them all")]

#[path = "../../schema/tests/support/ledgers.rs"]
mod ledgers;
#[path = "../../schema/tests/support/mutate.rs"]
mod mutate;
#[path = "../../schema/tests/support/mod.rs"]
mod records;
mod support;

use std::fs;
use std::path::{Path, PathBuf};

use ledgers::key;
use schema::header::Origin;
use schema::ledger::{Entry, FILE_NAME, Flags, Kind};
use schema::seal::signed_message;
use schema::{Record, SecretKey};
use serde_json::Value;
use support::{folder, reconstruct, stderr, stdout};

/// A folder with records 1 to 4 of one device and their ledger; record 1 was removed by the keep rule.
struct Device {
    dir: PathBuf,
    files: Vec<PathBuf>,
    ledger: Vec<Entry>,
}

fn record(number: u64, previous: [u8; 32]) -> Record {
    let mut record = records::record(schema::header::Layout::Full, 1, 250, 150);
    record.header.number = number;
    record.header.previous_sha256 = previous;
    record.header.origin = Origin::Live;
    record.header.vehicle.vin = "WSVB0000000000001".into();
    record
}

fn sealed(record: &Record, key: Option<&SecretKey>) -> (Vec<u8>, [u8; 32]) {
    let mut bytes = Vec::new();
    let seal = record.write_signed(&mut bytes, key).unwrap();
    (bytes, seal.sha256)
}

fn entry(kind: Kind, record: &Record, sha256: [u8; 32]) -> Entry {
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
    fn new(name: &str, change: bool) -> Self {
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

    fn key(&self, seed: u8) -> PathBuf {
        self.dir.join(format!("{seed}.pub"))
    }

    fn write_ledger(&self, entries: &[Entry]) {
        fs::write(self.dir.join(FILE_NAME), ledgers::bytes(entries)).unwrap();
    }

    /// Exit code and finding on the whole folder with a key.
    fn verify(&self, seed: u8) -> (Option<i32>, Value) {
        verify(&[&self.dir], Some(&self.key(seed)))
    }

    /// Asserts exit code 3 and a break that says so.
    fn breaks(&self, expected: &str) {
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

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn verify(paths: &[&Path], key: Option<&Path>) -> (Option<i32>, Value) {
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
    let words = [
        "verify",
        text(&device.dir),
        "--key",
        text(&device.key(1)),
        "--identity",
        text(&file),
    ];
    let shown = reconstruct(&words);
    assert_eq!(shown.status.code(), Some(0), "{}", stdout(&shown));
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
        stdout(&shown).contains("does not open"),
        "{}",
        stdout(&shown)
    );
}
