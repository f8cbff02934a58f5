//! A folder that can not be written to, or has no room, when the vault is opened.

use std::io::ErrorKind;

use super::*;
use crate::error::RecorderError;

fn try_open(model: &Model) -> Result<(Vault, Vec<String>), RecorderError> {
    let (storage, folder) = (Arc::new(model.clone()), Path::new(DIR));
    Vault::open_with_reserve(storage, folder, 5, Some(key()), None, 0)
}

fn files(model: &Model) -> Vec<String> {
    let name = |path: &std::path::PathBuf| path.file_name().unwrap().to_str().unwrap().to_owned();
    model
        .list(Path::new(DIR))
        .unwrap()
        .iter()
        .map(name)
        .collect()
}

fn refused(model: &Model) -> String {
    let error = try_open(model).map(|_| ()).unwrap_err();
    error.to_string()
}

/// Three records, and a ledger that is damaged.
fn damaged() -> Model {
    let model = Model::new();
    let (mut vault, _) = try_open(&model).unwrap();
    for number in 1..=3 {
        vault.seal(event(number)).unwrap();
    }
    let path = Path::new(DIR).join(FILE_NAME);
    model.open(&path).unwrap().write_at(200, b"damage").unwrap();
    model
}

#[test]
fn a_new_folder_that_is_read_only_or_full_is_an_error_that_names_it_and_stays_empty() {
    for kind in [
        ErrorKind::ReadOnlyFilesystem,
        ErrorKind::PermissionDenied,
        ErrorKind::StorageFull,
    ] {
        let model = Model::new();
        model.fail(0, usize::MAX, kind);
        for _ in 0..3 {
            let error = refused(&model);
            assert!(
                error.contains("/records/ledger.svl: begin the ledger"),
                "{error}"
            );
            assert!(files(&model).is_empty());
        }
        model.heal();
        try_open(&model).unwrap().0.seal(event(1)).unwrap();
    }
    // Full in the course of a write.
    let model = Model::new();
    model.set_capacity(Some(3));
    let error = refused(&model);
    assert!(error.contains("/records/ledger.svl"), "{error}");
    assert!(files(&model).is_empty(), "{:?}", files(&model));
}

#[test]
fn whatever_operation_of_opening_fails_it_says_where_and_opens_the_next_time() {
    for new in [true, false] {
        let sound = if new { Model::new() } else { damaged() };
        let before = sound.tried();
        try_open(&sound).unwrap();
        for after in 0..sound.tried() - before {
            for kind in [
                ErrorKind::Other,
                ErrorKind::PermissionDenied,
                ErrorKind::StorageFull,
            ] {
                let model = if new { Model::new() } else { damaged() };
                model.fail(after, 1, kind);
                if let Err(error) = try_open(&model) {
                    assert!(error.to_string().contains("/records/ledger"), "{error}");
                }
                assert!(
                    !files(&model).contains(&".ledger.part".to_owned()),
                    "{after}"
                );
                model.heal();
                let (mut vault, _) = try_open(&model).unwrap();
                let sealed = vault.seal(event(9)).unwrap();
                assert_eq!(sealed.number, if new { 1 } else { 4 });
                assert_whole(&model, &vault);
                let aside = |name: &&String| name.ends_with(".damaged");
                assert_eq!(
                    files(&model).iter().filter(aside).count(),
                    usize::from(!new)
                );
            }
        }
    }
}

#[test]
fn a_sound_folder_that_became_read_only_opens_and_sealing_says_so() {
    let model = Model::new();
    try_open(&model).unwrap().0.seal(event(1)).unwrap();
    let before = files(&model);
    model.fail(0, usize::MAX, ErrorKind::ReadOnlyFilesystem);
    let (mut vault, _) = try_open(&model).unwrap();
    let error = vault.seal(event(2)).unwrap_err();
    assert!(error.to_string().contains("/records/"), "{error}");
    assert_eq!(files(&model), before);
    model.heal();
    assert_eq!(vault.seal(error.into_record()).unwrap().number, 2);
    assert_whole(&model, &vault);
}

#[test]
fn on_a_full_disk_a_damaged_ledger_is_not_set_aside_again_at_each_start() {
    let model = damaged();
    let before = files(&model);
    model.set_capacity(Some(model.used()));
    for _ in 0..10 {
        let error = refused(&model);
        assert!(error.contains("/records/ledger.svl"), "{error}");
        assert_eq!(files(&model), before);
    }
    model.set_capacity(None);
    let (mut vault, notes) = try_open(&model).unwrap();
    assert!(notes[0].contains("ledger-1.damaged"), "{notes:?}");
    assert_eq!(vault.seal(event(4)).unwrap().number, 4);
    assert_eq!(numbers(&vault), [1, 2, 3, 4]);
    assert_whole(&model, &vault);
    // Another damage is kept beside the first.
    let path = Path::new(DIR).join(FILE_NAME);
    model.open(&path).unwrap().write_at(200, b"harm").unwrap();
    let (_, notes) = try_open(&model).unwrap();
    assert!(notes[0].contains("ledger-2.damaged"), "{notes:?}");
}

#[test]
fn a_cut_while_a_damaged_ledger_is_set_aside_leaves_one_copy_of_it() {
    let model = damaged();
    let first = model.changes();
    try_open(&model).unwrap();
    for count in first..=model.changes() {
        let mut left = model.after_cut(count, Cut::Process);
        for _ in 0..3 {
            let again = left.changes();
            try_open(&left).unwrap();
            left = left.after_cut(again + 5, Cut::Process);
        }
        let (vault, _) = try_open(&left).unwrap();
        assert_eq!(numbers(&vault), [1, 2, 3]);
        assert_whole(&left, &vault);
        let aside = files(&left)
            .iter()
            .filter(|name| name.ends_with(".damaged"))
            .count();
        assert_eq!(aside, 1, "{count}");
    }
}
