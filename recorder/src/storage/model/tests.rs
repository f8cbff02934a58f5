#![allow(clippy::unwrap_used, reason = "tests")]

use std::io::ErrorKind;
use std::path::Path;

use super::{Cut, Model};
use crate::storage::Storage;

fn with_file(bytes: &[u8]) -> Model {
    let model = Model::new();
    model.create_folder(Path::new("/d")).unwrap();
    let mut file = model.create(Path::new("/d/a")).unwrap();
    file.write_at(0, bytes).unwrap();
    file.sync().unwrap();
    model.sync_folder(Path::new("/d")).unwrap();
    model
}

#[test]
fn sectors_that_were_not_synchronised_are_there_in_any_subset() {
    let model = with_file(&[1; 2048]);
    let mut file = model.open(Path::new("/d/a")).unwrap();
    file.write_at(256, &[2; 1536]).unwrap();
    let mut found = std::collections::BTreeSet::new();
    for seed in 0..500 {
        let left = model.after_cut(model.changes(), Cut::Some(seed));
        let bytes = left.read(Path::new("/d/a"), 1 << 20).unwrap();
        assert_eq!((bytes[0], bytes[2047], bytes.len()), (1, 1, 2048));
        let sectors: Vec<u8> = [256, 512, 1024, 1536].iter().map(|at| bytes[*at]).collect();
        // A sector's part is whole.
        assert_eq!(
            [bytes[511], bytes[1023], bytes[1535], bytes[1791]],
            *sectors
        );
        found.insert(sectors);
    }
    assert_eq!(found.len(), 16);
    for (cut, expected) in [(Cut::Process, 2), (Cut::Least, 1)] {
        let left = model.after_cut(model.changes(), cut);
        assert_eq!(left.read(Path::new("/d/a"), 4096).unwrap()[300], expected);
    }
}

#[test]
fn names_that_were_not_synchronised_come_in_any_subset_but_each_whole() {
    let model = with_file(b"old");
    let mut file = model.create(Path::new("/d/b")).unwrap();
    file.write_at(0, b"new").unwrap();
    file.sync().unwrap();
    model.rename(Path::new("/d/b"), Path::new("/d/a")).unwrap();
    model.link(Path::new("/d/a"), Path::new("/d/c")).unwrap();
    let mut found = std::collections::BTreeSet::new();
    for seed in 0..500 {
        let left = model.after_cut(model.changes(), Cut::Some(seed));
        let read = |name: &str| left.read(Path::new(name), 10).ok();
        found.insert((
            read("/d/a").unwrap(),
            read("/d/b").is_some(),
            read("/d/c").is_some(),
        ));
    }
    assert_eq!(found.len(), 6, "{found:?}");
    model.sync_folder(Path::new("/d")).unwrap();
    let left = model.after_cut(model.changes(), Cut::Least);
    assert_eq!(left.list(Path::new("/d")).unwrap().len(), 2);
    assert_eq!(left.read(Path::new("/d/a"), 10).unwrap(), b"new");
}

#[test]
fn every_prefix_of_the_history_can_be_left() {
    let model = with_file(b"one");
    let lengths: Vec<Option<u64>> = (0..=model.changes())
        .map(|count| {
            let left = model.after_cut(count, Cut::Process);
            left.length(Path::new("/d/a")).ok()
        })
        .collect();
    assert_eq!(lengths, [None, Some(0), Some(3), Some(3), Some(3)]);
}

#[test]
fn faults_and_a_full_disk_come_as_asked() {
    let model = with_file(b"one");
    model.fail(1, 1, ErrorKind::Other);
    let mut file = model.open(Path::new("/d/a")).unwrap();
    file.write_at(0, b"two").unwrap();
    assert_eq!(file.sync().unwrap_err().kind(), ErrorKind::Other);
    file.sync().unwrap();
    model.set_capacity(Some(6));
    assert_eq!(model.free_bytes(Path::new("/d")).unwrap(), 3);
    let full = file.write_at(3, b"three").unwrap_err();
    assert_eq!((full.kind(), model.used()), (ErrorKind::StorageFull, 6));
    model.remove(Path::new("/d/a")).unwrap();
    assert_eq!(model.used(), 0);
    assert!(matches!(
        model
            .create(Path::new("/nowhere/a"))
            .map(drop)
            .unwrap_err()
            .kind(),
        ErrorKind::NotFound
    ));
}
