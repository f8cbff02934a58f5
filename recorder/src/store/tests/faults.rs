//! A disk that fails, or is full, at any operation.

use std::io::ErrorKind;

use super::*;

#[test]
fn whatever_operation_fails_no_record_is_lost_and_the_chain_holds() {
    let sound = Model::new();
    let (mut vault, _) = open(&sound, 2);
    for number in 1..=4 {
        vault.seal(event(number)).unwrap();
    }
    let operations = sound.tried();
    let mut given_back = 0;
    for kind in [ErrorKind::Other, ErrorKind::StorageFull] {
        for times in [1, 3, 40] {
            for after in 0..operations {
                let model = Model::new();
                let (mut vault, _) = open(&model, 2);
                model.fail(after, times, kind);
                for number in 1..=4 {
                    let mut record = event(number);
                    for _ in 0..80 {
                        match vault.seal(record) {
                            Ok(_) => break,
                            Err(error) => {
                                assert_eq!(
                                    matches!(error, VaultError::Full { .. }),
                                    kind == ErrorKind::StorageFull
                                );
                                assert!(!error.to_string().is_empty());
                                given_back += 1;
                                record = error.into_record();
                                assert_eq!(record.utc_ns(), event(number).utc_ns());
                            }
                        }
                    }
                    assert!(
                        vault.sealed_already(event(number).utc_ns()),
                        "{kind} {times} {after}"
                    );
                }
                model.heal();
                let (mut vault, _) = open(&model, 2);
                vault.seal(event(5)).unwrap();
                let found = assert_whole(&model, &vault);
                assert_eq!(found.records.len(), 5, "{kind} {times} {after}");
                assert!(numbers(&vault).contains(&5));
            }
        }
    }
    println!("{given_back} records given back by errors at {operations} places, all sealed later");
    assert!(given_back > operations);
}

#[test]
fn on_a_full_disk_the_reserve_goes_then_unlocked_records_then_the_record_is_handed_back() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 5);
    vault.seal(crash(1, 30.0)).unwrap();
    vault.seal(event(2)).unwrap();
    vault.seal(event(3)).unwrap();
    // Room for the entries of the ledger, not for a record.
    let slack = 5 * 156;
    model.set_capacity(Some(model.used() + slack));
    let with_reserve = vault.seal(event(4)).unwrap();
    assert!(with_reserve.removed.is_empty() && with_reserve.notes[0].contains("reserve"));
    assert_eq!(numbers(&vault), [1, 2, 3, 4]);
    // The rest of the reserve's place is used up.
    model.set_capacity(Some(model.used() + slack));
    let removing = vault.seal(event(5)).unwrap();
    assert_eq!(
        (removing.removed.len(), numbers(&vault)),
        (1, vec![1, 3, 4, 5])
    );
    assert!(removing.notes[0].contains("record 2 goes"), "{removing:?}");
    assert_whole(&model, &vault);
    // A crash needs the room of all that is not locked, and more.
    model.set_capacity(Some(model.used() + slack));
    let mut large = crash(6, 60.0);
    large.raw = vec![large.raw[0].clone(); 500];
    let Err(VaultError::Full { record }) = vault.seal(large) else {
        panic!("expected the disk to be full");
    };
    assert_eq!(numbers(&vault), [1]);
    // Space returns; a restart in between changes nothing.
    model.set_capacity(None);
    let sealed = vault.seal(*record).unwrap();
    assert_eq!((sealed.number, sealed.locked), (6, true));
    assert_whole(&model, &vault);
    assert_eq!(
        model.length(&Path::new(DIR).join(".reserve")).unwrap(),
        RESERVE
    );
    let entries = ledger(&model).entries;
    let removed: Vec<u64> = entries
        .iter()
        .filter(|e| e.kind == Kind::Removed)
        .map(|e| e.number)
        .collect();
    assert_eq!(removed, [2, 3, 4, 5]);
}

#[test]
fn a_record_that_can_not_be_stored_is_handed_back_and_the_next_one_sealed() {
    let model = Model::new();
    let (mut vault, _) = open(&model, 5);
    let mut wrong = event(1);
    wrong.header.vehicle.track_width_m = f64::NAN;
    let refused = vault.seal(wrong).unwrap_err();
    assert!(matches!(refused, VaultError::Record { .. }), "{refused}");
    assert_eq!(vault.seal(event(2)).unwrap().number, 1);
    assert_whole(&model, &vault);
}
