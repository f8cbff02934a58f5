//! Keys, signed records, and the ledger.
#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "support/ledgers.rs"]
mod ledgers;
mod support;

use ledgers::{bytes, key, sealed};
use proptest::prelude::*;
use schema::header::{Header, Origin};
use schema::key::KeyError;
use schema::ledger::audit::audit;
use schema::ledger::{ENTRY_BYTES, Entry, Flags, Kind, LedgerError, MAGIC, Weak};
use schema::parts::{Health, Trigger};
use schema::{Ledger, PublicKey, Record, SchemaError, SecretKey};

fn live() -> Record {
    let mut live = support::small();
    live.header.origin = Origin::Live;
    live
}

#[test]
fn a_signed_record_is_verified_by_its_key_alone() {
    let mut file = Vec::new();
    let written = live().write_signed(&mut file, Some(&key(1))).unwrap();
    let (record, seal) = Record::read(&file).unwrap();
    assert_eq!((record, seal), (live(), written));
    assert!(seal.signed_by(&key(1).public()));
    assert!(!seal.signed_by(&key(2).public()));
    let (_, unsigned) = Record::read(&live().to_bytes().unwrap()).unwrap();
    assert!(!unsigned.signed_by(&key(1).public()));
    let mut again = Vec::new();
    live().write_signed(&mut again, Some(&key(1))).unwrap();
    assert_eq!(file, again);
}

#[test]
fn a_replay_is_never_signed() {
    let mut file = Vec::new();
    let refused = support::small().write_signed(&mut file, Some(&key(1)));
    assert!(matches!(refused, Err(SchemaError::Value { .. })) && file.is_empty());
}

#[test]
fn a_key_is_one_line_and_the_two_kinds_are_not_mistaken() {
    let key = key(7);
    let (secret, public) = (key.to_text(), key.public().to_text());
    assert_eq!(
        SecretKey::from_text(&secret).unwrap().public(),
        key.public()
    );
    assert_eq!(PublicKey::from_text(&public).unwrap(), key.public());
    assert_eq!(public.lines().count(), 1);
    assert!(!format!("{key:?}").contains(&secret[23..40]));
    assert!(matches!(
        PublicKey::from_text(&secret),
        Err(KeyError::Other { .. })
    ));
    assert!(matches!(
        SecretKey::from_text(&public),
        Err(KeyError::Other { .. })
    ));
    for wrong in [
        "",
        "hello",
        public.trim_end().split_at(50).0,
        &format!("{public}{public}"),
        &public.replace(' ', ""),
        &format!("{} 00", public.trim_end()),
        &public.replace("key-1", "key-2"),
    ] {
        assert!(PublicKey::from_text(wrong).is_err(), "{wrong}");
    }
    // The point of order 1: it would verify a signature of any message.
    let mut weak = [0; 32];
    weak[0] = 1;
    assert_eq!(PublicKey::from_bytes(&weak), Err(KeyError::Point));
}

/// RFC 8032, 7.1, test 1.
#[test]
fn the_key_is_that_of_rfc_8032() {
    let text = format!(
        "{} 9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60\n",
        schema::key::SECRET_PREFIX
    );
    let key = SecretKey::from_text(&text).unwrap();
    assert!(
        key.public()
            .to_text()
            .ends_with(" d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a\n")
    );
    let signature = key.sign(b"");
    assert_eq!(signature[..4], [0xe5, 0x56, 0x43, 0x00]);
    assert!(key.public().verifies(b"", &signature));
}

#[test]
fn header_and_small_parts_go_round_by_themselves() {
    let record = support::small();
    let header = record.header.to_bytes().unwrap();
    assert_eq!(Header::from_bytes(&header).unwrap(), record.header);
    assert!(Header::from_bytes(&header[1..]).is_err());
    let mut wrong = record.header;
    wrong.number = 0;
    assert!(wrong.to_bytes().is_err());
    let health = record.health.to_bytes().unwrap();
    assert_eq!(Health::from_bytes(&health).unwrap(), record.health);
    let triggers = Trigger::list_to_bytes(&record.triggers).unwrap();
    assert_eq!(
        Trigger::list_from_bytes(&triggers).unwrap(),
        record.triggers
    );
}

#[test]
fn a_ledger_goes_round_and_shows_its_records_and_keys() {
    let entries = ledgers::example();
    let file = bytes(&entries);
    assert_eq!(file.len(), 8 + entries.len() * ENTRY_BYTES);
    let ledger = Ledger::read(&file);
    assert_eq!((ledger.error.as_ref(), &ledger.entries), (None, &entries));
    assert_eq!(ledger.key(), Some(key(2).public()));
    let found = audit(&ledger);
    assert_eq!(found.breaks, Vec::<String>::new());
    assert_eq!(found.records.len(), 3);
    assert!(found.records[&1].removed.is_some() && found.records[&2].removed.is_none());
    assert!(found.records[&2].sealed.flags.locked);
    assert!(found.vouches(&key(1).public(), &key(2).public()));
    assert!(found.vouches(&key(2).public(), &key(1).public()));
    assert!(!found.vouches(&key(3).public(), &key(2).public()));
    // A key that has signed nothing yet can not vouch for what was before it: anyone can name it as his successor.
    let named = audit(&Ledger::read(&bytes(&entries[..5])));
    assert!(named.vouches(&key(1).public(), &key(2).public()));
    assert!(!named.vouches(&key(2).public(), &key(1).public()));
}

#[test]
fn each_flag_of_a_ledger_goes_round_and_what_is_none_is_refused() {
    let plain = sealed(1, None, None, Flags::default()).to_bytes();
    for code in 0..=u8::MAX {
        let mut entry = plain;
        entry[2] = code;
        let check = crc32c::crc32c(&entry[..152]);
        entry[152..].copy_from_slice(&check.to_le_bytes());
        let mut file = MAGIC.to_vec();
        file.extend(entry);
        let ledger = Ledger::read(&file);
        // 0x10, a loss of power, stands only with 8.
        if code >= 32 || code & 0x18 == 0x10 {
            let error = ledger.error.unwrap().to_string();
            assert!(
                error.contains("flags") && error.contains(&format!("found {code}")),
                "{error}"
            );
            continue;
        }
        let flags = ledger.entries[0].flags;
        let weak = [Weak::No, Weak::Yes, Weak::No, Weak::PowerLoss][usize::from(code >> 3)];
        assert_eq!((flags.weak, flags.weak.is_weak()), (weak, code & 8 != 0));
        assert_eq!(
            (flags.locked, flags.encrypted, flags.adopted),
            (code & 1 != 0, code & 2 != 0, code & 4 != 0)
        );
        assert_eq!(bytes(&ledger.entries), file);
    }
}

#[test]
fn every_flipped_bit_of_a_ledger_is_found() {
    let file = bytes(&ledgers::example());
    for bit in 0..file.len() * 8 {
        let mut changed = file.clone();
        changed[bit / 8] ^= 1 << (bit % 8);
        let ledger = Ledger::read(&changed);
        assert!(ledger.error.is_some(), "bit {bit}");
        let torn = matches!(ledger.error, Some(LedgerError::Torn { .. }));
        assert_eq!(torn, bit / 8 >= file.len() - ENTRY_BYTES, "bit {bit}");
    }
}

#[test]
fn a_last_entry_that_was_cut_is_told_from_damage() {
    let entries = ledgers::example();
    let file = bytes(&entries);
    for length in 8..file.len() {
        let ledger = Ledger::read(&file[..length]);
        let whole = (length - 8) / ENTRY_BYTES;
        assert_eq!(ledger.entries, entries[..whole]);
        let torn = (length - 8) % ENTRY_BYTES;
        match ledger.error {
            None => assert_eq!(torn, 0),
            Some(LedgerError::Torn { offset, found, .. }) => {
                assert_eq!((offset, found), (ledger.sound_bytes(), torn));
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn what_a_ledger_can_not_be_is_named() {
    let (old, new) = (key(1), key(2));
    let first = ledgers::new_key(&old, None, &old);
    let one = sealed(1, Some(&first), Some(&old), Flags::default());
    let removed = |number, sha256, before: &Entry| {
        let kind = Kind::Removed;
        let entry = Entry {
            kind,
            number,
            sha256,
            flags: Flags::default(),
            ..one
        };
        entry.signed(Some(before), Some(&old))
    };
    let cases: [(&str, Vec<Entry>); 9] = [
        (
            "signature by the key",
            vec![first, sealed(1, Some(&first), Some(&new), Flags::default())],
        ),
        (
            "found none",
            vec![first, sealed(1, Some(&first), None, Flags::default())],
        ),
        (
            "introduces the key",
            vec![sealed(1, None, Some(&old), Flags::default())],
        ),
        (
            "a number above 1",
            vec![
                first,
                one,
                sealed(1, Some(&one), Some(&old), Flags::default()),
            ],
        ),
        (
            "expected record 2, found 3",
            vec![
                first,
                one,
                sealed(3, Some(&one), Some(&old), Flags::default()),
            ],
        ),
        (
            "no record of that number",
            vec![first, one, removed(5, [1; 32], &one)],
        ),
        (
            "another digest",
            vec![first, one, removed(1, [9; 32], &one)],
        ),
        (
            "signed by itself alone",
            vec![first, one, ledgers::new_key(&new, Some(&one), &new)],
        ),
        (
            "another signature",
            vec![first, one, ledgers::new_key(&new, Some(&one), &key(3))],
        ),
    ];
    for (expected, entries) in cases {
        let found = audit(&Ledger::read(&bytes(&entries)));
        assert!(
            found.breaks.len() == 1 && found.breaks[0].contains(expected),
            "{expected}: {:?}",
            found.breaks
        );
    }
    let locked = Flags {
        locked: true,
        ..Flags::default()
    };
    let kept = sealed(1, Some(&first), Some(&old), locked);
    let found = audit(&Ledger::read(&bytes(&[
        first,
        kept,
        removed(1, kept.sha256, &kept),
    ])));
    assert!(found.breaks[0].contains("locked"), "{:?}", found.breaks);
    // An entry left out, or two in the other order.
    for broken in [vec![first, removed(1, one.sha256, &one)], vec![one, first]] {
        let error = Ledger::read(&bytes(&broken)).error.unwrap().to_string();
        assert!(error.contains("digest of the entry before"), "{error}");
    }
}

proptest! {
    #[test]
    fn any_bytes_give_a_ledger(seed in any::<u64>(), tail in proptest::collection::vec(any::<u8>(), 0..400)) {
        ledgers::drive(&ledgers::mutate(seed));
        ledgers::drive(&tail);
        let mut behind = schema::ledger::MAGIC.to_vec();
        behind.extend(tail);
        ledgers::drive(&behind);
    }

    #[test]
    fn any_text_is_a_key_or_an_error(text in ".{0,90}", digits in "[0-9a-fA-F]{60,66}") {
        let _ = SecretKey::from_text(&text);
        let line = format!("{} {digits}", schema::key::SECRET_PREFIX);
        prop_assert_eq!(SecretKey::from_text(&line).is_ok(), digits.len() == 64);
        let line = format!("{} {digits}", schema::key::PUBLIC_PREFIX);
        let _ = PublicKey::from_text(&line);
    }
}
