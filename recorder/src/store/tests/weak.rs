//! Records by hand or by a loss of power never push one of a crash out.

use schema::ledger::Weak;
use schema::parts::TriggerKind::{self, Can, DeltaV, Manual, Peak, PowerLoss};

use super::*;

/// The record with triggers of these kinds alone.
fn by(kinds: &[TriggerKind], mut record: Record) -> Record {
    let trigger = record.triggers[0].clone();
    let triggers = kinds.iter().map(|kind| schema::parts::Trigger {
        kind: *kind,
        ..trigger.clone()
    });
    record.triggers = triggers.collect();
    record
}

/// What is held: number and kind.
fn held(vault: &Vault) -> Vec<(u64, Weak)> {
    vault
        .records()
        .map(|held| (held.number, held.weak))
        .collect()
}

/// Ten by loss of power and five by hand from the hour `first` on, a restart after each third.
fn drown(mut vault: Vault, first: i64, reopen: &dyn Fn() -> Vault) -> Vault {
    for step in 0..15 {
        let kind = if step < 10 { PowerLoss } else { Manual };
        let sealed = vault.seal(by(&[kind], event(first + step))).unwrap();
        assert_eq!(vault.records().last().unwrap().number, sealed.number);
        if step % 3 == 2 {
            drop(vault);
            vault = reopen();
        }
    }
    vault
}

#[test]
fn a_record_is_weak_if_all_its_triggers_are_by_hand_or_by_a_loss_of_power() {
    for (kinds, weak) in [
        (&[PowerLoss][..], Weak::PowerLoss),
        (&[PowerLoss, PowerLoss], Weak::PowerLoss),
        (&[Manual], Weak::Yes),
        (&[Manual, PowerLoss], Weak::Yes),
        (&[Manual, DeltaV], Weak::No),
        (&[PowerLoss, Peak], Weak::No),
        (&[Can], Weak::No),
        // Nothing is known of it.
        (&[], Weak::No),
    ] {
        assert_eq!(weakness(&by(kinds, event(1))), weak, "{kinds:?}");
    }
}

#[test]
fn a_light_crash_outlives_any_number_of_weak_records_and_restarts() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 5);
    assert!(!vault.seal(crash(1, 20.0)).unwrap().locked);
    let vault = drown(vault, 2, &|| open(&model, 5).0);
    let newest = (13..=16).map(|number| (number, Weak::Yes));
    let expected: Vec<_> = [(1, Weak::No)].into_iter().chain(newest).collect();
    assert_eq!(held(&vault), expected);
    assert_whole(&model, &vault);
    // The next crashes take the places of the weak ones, then of the oldest crash.
    let (mut vault, _) = open(&model, 5);
    for number in 17..=20 {
        vault.seal(crash(number, 12.0)).unwrap();
    }
    assert_eq!(numbers(&vault), [1, 17, 18, 19, 20]);
    vault.seal(crash(21, 12.0)).unwrap();
    assert_eq!(numbers(&vault), [17, 18, 19, 20, 21]);
    assert_whole(&model, &vault);
}

#[test]
fn where_crashes_fill_the_places_a_weak_record_is_kept_beside_them_until_the_next() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 5);
    for number in 1..=5 {
        vault.seal(crash(number, 12.0)).unwrap();
    }
    for number in 6..=9 {
        let kind = if number % 2 == 0 { Manual } else { PowerLoss };
        vault.seal(by(&[kind], event(number))).unwrap();
        let newest = u64::try_from(number).unwrap();
        assert_eq!(numbers(&vault), [1, 2, 3, 4, 5, newest]);
        vault = open(&model, 5).0;
        assert_eq!(numbers(&vault), [1, 2, 3, 4, 5, newest]);
    }
    vault.seal(crash(10, 12.0)).unwrap();
    assert_eq!(numbers(&vault), [2, 3, 4, 5, 10]);
    assert_whole(&model, &vault);
}

#[test]
fn two_records_by_loss_of_power_are_kept_where_more_are_there_than_are_to_be() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 5);
    for number in 1..=5 {
        vault.seal(by(&[PowerLoss], event(number))).unwrap();
    }
    // Five are kept, whatever they are of.
    assert_eq!(numbers(&vault), [1, 2, 3, 4, 5]);
    vault.seal(by(&[Manual], event(6))).unwrap();
    vault.seal(by(&[Manual], event(7))).unwrap();
    vault.seal(crash(8, 30.0)).unwrap();
    assert_eq!(numbers(&vault), [4, 5, 6, 7, 8]);
    // Two by loss of power: the oldest weak one goes, of either kind, and never one that is locked.
    vault.seal(by(&[Manual], event(9))).unwrap();
    assert_eq!(numbers(&vault), [5, 6, 7, 8, 9]);
    assert!(
        vault
            .seal(by(&[PowerLoss], crash(10, 30.0)))
            .unwrap()
            .locked
    );
    for number in 11..=16 {
        vault.seal(by(&[Manual], event(number))).unwrap();
    }
    assert!(
        [8, 10]
            .iter()
            .all(|number| numbers(&vault).contains(number))
    );
    assert_whole(&model, &vault);
}

#[test]
fn on_a_full_disk_weak_records_go_first_and_for_a_weak_one_no_crash_goes() {
    let model = Model::new();
    let open = || {
        Vault::open_with_reserve(
            Arc::new(model.clone()),
            Path::new(DIR),
            5,
            Some(key()),
            None,
            0,
        )
        .unwrap()
        .0
    };
    let mut vault = open();
    vault.seal(live(support::small(), 1)).unwrap();
    vault.seal(by(&[PowerLoss], event(2))).unwrap();
    vault.seal(by(&[Manual], event(3))).unwrap();
    let fill = || model.set_capacity(Some(model.used() + 3 * 156));
    fill();
    vault.seal(event(4)).unwrap();
    assert_eq!(numbers(&vault), [1, 3, 4]);
    fill();
    vault.seal(by(&[PowerLoss], event(5))).unwrap();
    assert_eq!(numbers(&vault), [1, 4, 5]);
    fill();
    vault.seal(event(6)).unwrap();
    assert_eq!(numbers(&vault), [1, 4, 6]);
    fill();
    let refused = vault.seal(by(&[Manual], event(7))).unwrap_err();
    assert!(matches!(refused, VaultError::Full { .. }), "{refused}");
    assert_eq!(numbers(&vault), [1, 4, 6]);
    // A crash counts for more than an old one, as before; and the weak one is sealed when there is room.
    vault = open();
    vault.seal(event(8)).unwrap();
    assert_eq!(numbers(&vault), [4, 6, 7]);
    model.set_capacity(None);
    assert_eq!(vault.seal(refused.into_record()).unwrap().number, 8);
    assert_whole(&model, &vault);
}

#[test]
fn a_weak_record_is_known_again_after_a_cut_and_without_its_ledger() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 5);
    vault.seal(crash(1, 20.0)).unwrap();
    let before = model.changes();
    vault.seal(by(&[PowerLoss], event(2))).unwrap();
    for count in before..=model.changes() {
        for cut in [Cut::Process, Cut::Least] {
            let left = model.after_cut(count, cut);
            let (mut vault, _) = open(&left, 5);
            vault.seal(by(&[PowerLoss], event(2))).unwrap();
            assert_eq!(held(&vault), [(1, Weak::No), (2, Weak::PowerLoss)]);
            assert_whole(&left, &vault);
        }
    }
    model.remove(&Path::new(DIR).join(FILE_NAME)).unwrap();
    let (vault, _) = open(&model, 5);
    assert_eq!(held(&vault), [(1, Weak::No), (2, Weak::PowerLoss)]);
    let vault = drown(vault, 3, &|| open(&model, 5).0);
    assert_eq!(numbers(&vault), [1, 14, 15, 16, 17]);
    assert_whole(&model, &vault);
}

#[cfg(feature = "age")]
#[test]
fn a_light_crash_outlives_weak_records_that_are_encrypted() {
    let to = age::x25519::Identity::generate().to_public().to_string();
    let model = Model::new();
    let open = || {
        let (storage, folder) = (Arc::new(model.clone()), Path::new(DIR));
        Vault::open(storage, folder, 5, Some(key()), Some(&to))
            .unwrap()
            .0
    };
    let mut vault = open();
    vault.seal(crash(1, 20.0)).unwrap();
    for number in 2..=4 {
        vault.seal(by(&[Manual], event(number))).unwrap();
    }
    let vault = drown(open(), 5, &open);
    assert!(vault.records().all(|held| held.encrypted));
    let newest = (16..=19).map(|number| (number, Weak::Yes));
    let expected: Vec<_> = [(1, Weak::No)].into_iter().chain(newest).collect();
    assert_eq!(held(&vault), expected);
    assert_eq!(audit(&ledger(&model)).breaks, Vec::<String>::new());
}
