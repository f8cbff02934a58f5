//! What is written is read back, in both layouts, and lies where the design says.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use schema::header::Layout;
use schema::{Record, Sample};
use support::{GRID, record, small};

#[test]
fn a_record_is_read_back_as_it_was() {
    for record in [
        small(),
        record(Layout::Full, 3, 4003, 3000),
        record(Layout::TwoRate, 3, 4003, 3000),
        record(Layout::TwoRate, 0, 4100, 100),
    ] {
        let mut bytes = Vec::new();
        let sealed = record.write(&mut bytes).unwrap();
        let (back, seal) = Record::read(&bytes).unwrap();
        assert_eq!(back, record);
        assert_eq!(seal, sealed);
        assert_eq!(back.to_bytes().unwrap(), bytes);
    }
}

#[test]
fn blocks_hold_as_many_bytes_as_the_source_says() {
    let payload = |record: &Record| {
        record
            .blocks
            .iter()
            .map(schema::Block::payload_bytes)
            .sum::<usize>()
    };
    let full = record(Layout::Full, 3, 4003, 3000);
    assert_eq!(full.blocks.len(), 40);
    assert!(
        full.blocks
            .iter()
            .all(|block| block.payload_bytes() == 1006)
    );
    assert_eq!(payload(&full), 40_240);

    // All of it thinned: another 20 s follow, and the trigger lies in them.
    let mut thin = record(Layout::TwoRate, 3, 6003, 5500);
    thin.blocks.truncate(40);
    assert!(thin.blocks.iter().all(|block| block.payload_bytes() == 206));
    assert_eq!(payload(&thin), 8_240);
}

#[test]
fn the_two_rate_layout_spares_the_newest_and_the_triggers() {
    // Second s of the record is block s; trigger in block 10; newest sample 3999 of 0..4000 after the shift.
    let two = record(Layout::TwoRate, 3, 4003, 1053);
    let thin: Vec<usize> = (0..40).filter(|&s| two.blocks[s].rate_hz == 20).collect();
    // Kept about the trigger: from index 553 to 1553, blocks 5 to 15. Kept at the end: blocks 25 to 39,
    // and 24, whose last sample lies 1500 from the newest.
    let expected: Vec<usize> = (0..5)
        .chain(16..24)
        .chain([24].into_iter().filter(|_| false))
        .collect();
    assert_eq!(thin, expected);
}

#[test]
fn samples_come_in_grid_order_with_gaps_in_sight() {
    let mut two = record(Layout::TwoRate, 1, 4003, 3000);
    two.blocks.remove(30);
    let samples: Vec<_> = two.samples().collect();
    assert_eq!(samples[0].index, 1);
    assert_eq!((two.first_index(), two.end_index()), (1, 4003));
    let mut next = 1;
    for sample in &samples {
        assert_eq!(sample.index, next + sample.gap_before);
        next = sample.index + sample.span;
    }
    assert_eq!(next, 4003);
    let gaps: Vec<_> = samples
        .iter()
        .filter(|sample| sample.gap_before > 0)
        .collect();
    assert_eq!(gaps.len(), 1);
    assert_eq!(gaps[0].gap_before, 100);
    assert_eq!(samples.iter().map(|s| s.span).sum::<u64>(), 4002 - 100);
    assert!(samples.iter().any(|s| s.sample
        == Sample {
            wheels: [None; 2],
            ..s.sample
        }));
}

#[test]
fn time_runs_from_the_first_trigger() {
    let full = record(Layout::Full, 3, 4003, 3000);
    assert_eq!(full.monotonic_ns(3), 0);
    assert_eq!(full.grid(), GRID);
    // The trigger fell 3 ms into its bin.
    assert!((full.time_s(3000) + 0.003).abs() < 1e-12);
    assert!((full.time_s(3) + 29.973).abs() < 1e-12);
    let no_trigger = Record {
        triggers: vec![],
        ..full
    };
    assert!(no_trigger.time_s(3).abs() < 1e-12);
}
