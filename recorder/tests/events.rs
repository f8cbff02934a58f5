//! Several impacts, and several events: what becomes one record, and which records stay.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use recorder::storage::{Disk, Storage};
use recorder::store::Vault;
use schema::Record;
use schema::parts::TriggerKind;
use support::{Log, run, settings};

/// A car at 60 km/h that is hit: at each time a pulse of 140 ms with this acceleration, m/s^2, along the car or across.
fn hits(until: f64, hits: &[(f64, [f64; 2])]) -> String {
    let mut log = Log::default();
    let mut number = 0_u32;
    loop {
        let t = f64::from(number) / 100.0;
        if t >= until {
            return log.text();
        }
        let hit = hits.iter().find(|(at, _)| (*at..*at + 0.14).contains(&t));
        let [x, y] = hit.map_or([0.0; 2], |(_, pulse)| *pulse);
        log.accel(t, [x, y, 9.806], u64::from(number));
        log.rate(t + 0.0002, [0.0; 3], u64::from(number));
        if number.is_multiple_of(2) {
            let moving = hits.first().is_none_or(|(at, _)| t < *at);
            log.wheels(t + 0.0004, if moving { 60.0 } else { 0.0 });
        }
        number += 1;
    }
}

#[test]
fn three_impacts_close_together_are_one_record_with_three_marks() {
    let settings = settings(&[]);
    for apart in [0.4, 0.7, 1.0, 2.5, 4.0] {
        let text = hits(
            70.0,
            &[
                (40.0, [-60.0, 0.0]),
                (40.0 + apart, [0.0, 50.0]),
                (40.0 + 2.0 * apart, [40.0, 0.0]),
            ],
        );
        let run = run(&settings, text, &[]);
        assert_eq!(run.records.len(), 1, "{apart} s apart");
        let record = &run.records[0];
        let kinds: Vec<TriggerKind> = record.triggers.iter().map(|trigger| trigger.kind).collect();
        assert_eq!(kinds, [TriggerKind::DeltaV; 3], "{apart} s apart");
        let first = record.triggers[0].monotonic_ns;
        let last = record.triggers[2].monotonic_ns;
        assert!(((last - first) - schema::num::round_i64(2e9 * apart)).abs() < 60_000_000);
        // 30 s before the first, and 10 s behind the last.
        assert!((record.time_s(record.first_index()) + 30.0).abs() < 0.02);
        assert!(record.time_s(record.end_index()) >= 2.0 * apart + 9.98);
        assert!(
            record.completion.complete,
            "{:?}",
            record.completion.reasons
        );
    }
}

struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Ten events: every third is a hit of more than 25 km/h, the others of some 11 km/h.
#[test]
fn of_ten_events_in_a_row_the_grave_ones_stay_and_at_least_five() {
    let settings = settings(&[]);
    let grave = |number: usize| number.is_multiple_of(3);
    let times: Vec<(f64, [f64; 2])> = (0..10)
        .map(|number| {
            let size = if grave(number) { -80.0 } else { -22.0 };
            (40.0 + 45.0 * schema::num::real(number), [size, 0.0])
        })
        .collect();
    let run = run(&settings, hits(500.0, &times), &[]);
    assert_eq!(run.records.len(), 10);

    let folder =
        Folder(std::env::temp_dir().join(format!("recorder-events-{}", std::process::id())));
    let _ = fs::remove_dir_all(&folder.0);
    let storage: Arc<dyn Storage> = Arc::new(Disk);
    let (mut vault, _) = Vault::open(Arc::clone(&storage), &folder.0, 5, None, None).unwrap();
    for record in run.records {
        vault.seal(record).unwrap();
    }
    drop(vault);
    let (vault, notes) = Vault::open(storage, &folder.0, 5, None, None).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    let held: Vec<(u64, bool)> = vault
        .records()
        .map(|held| (held.number, held.locked))
        .collect();
    println!("of ten events there are: {held:?}");
    assert!(held.len() >= 5);
    for number in 0..10 {
        let number = schema::num::u64_of(number);
        if grave(schema::num::usize_of(number)) {
            assert!(
                held.contains(&(number + 1, true)),
                "record {} is locked and there",
                number + 1
            );
        }
    }
    assert_eq!(held.last().unwrap().0, 10, "the newest is there");
    for held in vault.records() {
        let (record, _) = Record::read(&fs::read(&held.path).unwrap()).unwrap();
        assert_eq!(record.header.number, held.number);
    }
}
