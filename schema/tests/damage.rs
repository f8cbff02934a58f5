//! Damage of every kind: any flipped bit, any lost or added byte is refused by `read`; `salvage` gives what
//! is left and says what is not.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod support;

use schema::header::Layout;
use schema::{Record, SchemaError, SealState};
use support::{record, small};

/// Where the structure with this tag begins.
fn find(file: &[u8], tag: [u8; 4]) -> usize {
    file.windows(4).position(|four| *four == tag).unwrap()
}

#[test]
fn any_flipped_bit_is_refused() {
    let sound = small().to_bytes().unwrap();
    let mut file = sound.clone();
    for bit in 0..file.len() * 8 {
        file[bit / 8] ^= 1 << (bit % 8);
        assert!(
            Record::read(&file).is_err(),
            "bit {} of byte {}",
            bit % 8,
            bit / 8
        );
        if let Ok(salvaged) = Record::salvage(&file) {
            let found =
                !salvaged.damage.is_empty() || !matches!(salvaged.seal, SealState::Sound(_));
            assert!(found, "bit {} of byte {}", bit % 8, bit / 8);
        }
        file[bit / 8] ^= 1 << (bit % 8);
    }
    assert_eq!(file, sound);
}

#[test]
fn any_other_length_is_refused() {
    let sound = small().to_bytes().unwrap();
    for length in 0..sound.len() {
        assert!(Record::read(&sound[..length]).is_err(), "cut at {length}");
    }
    for byte in 0..=u8::MAX {
        let mut longer = sound.clone();
        longer.push(byte);
        assert!(matches!(
            Record::read(&longer),
            Err(SchemaError::Trailing { .. })
        ));
    }
    for at in 0..sound.len() {
        let mut file = sound.clone();
        file.remove(at);
        assert!(Record::read(&file).is_err(), "without byte {at}");
        file.insert(at, 0);
        file.insert(at, sound[at]);
        assert!(Record::read(&file).is_err(), "with a byte more at {at}");
    }
}

#[test]
fn a_sound_file_is_salvaged_whole() {
    for record in [small(), record(Layout::TwoRate, 3, 4003, 3000)] {
        let file = record.to_bytes().unwrap();
        let salvaged = Record::salvage(&file).unwrap();
        assert!(salvaged.damage.is_empty() && salvaged.unlisted == 0);
        assert_eq!(
            salvaged.seal,
            SealState::Sound(Record::read(&file).unwrap().1)
        );
        assert_eq!(salvaged.record, record);
    }
}

#[test]
fn a_damaged_block_costs_that_block() {
    let sound = record(Layout::Full, 3, 1003, 500);
    let mut file = sound.to_bytes().unwrap();
    let first = find(&file, *b"SECS");
    let block = 12 + 31 + 1006 + 4;
    file[first + 4 * block + 500] ^= 1;
    let salvaged = Record::salvage(&file).unwrap();
    assert_eq!(salvaged.damage.len(), 1);
    assert_eq!(
        salvaged.damage[0].offset,
        u64::try_from(first + 4 * block).unwrap()
    );
    assert_eq!(salvaged.damage[0].bytes, u64::try_from(block).unwrap());
    assert!(matches!(salvaged.seal, SealState::Broken { .. }));
    let mut left = sound;
    left.blocks.remove(4);
    assert_eq!(salvaged.record, left);
    assert!(
        salvaged
            .record
            .samples()
            .any(|sample| sample.gap_before == 100)
    );
}

#[test]
fn a_block_with_a_damaged_head_is_found_by_its_stamp() {
    let sound = record(Layout::TwoRate, 3, 4003, 3000);
    let mut file = sound.to_bytes().unwrap();
    for tag in [first_of(&file, 0), first_of(&file, 3)] {
        for byte in &mut file[tag..tag + 12] {
            *byte ^= 0xFF;
        }
    }
    let salvaged = Record::salvage(&file).unwrap();
    assert_eq!(salvaged.record, sound);
    assert_eq!(
        salvaged
            .damage
            .iter()
            .map(|damage| damage.bytes)
            .collect::<Vec<_>>(),
        [12, 12]
    );
}

/// Offset of the `n`-th block.
fn first_of(file: &[u8], n: usize) -> usize {
    let mut tags = file
        .windows(4)
        .enumerate()
        .filter(|(_, four)| four == b"SECS");
    tags.nth(n).unwrap().0
}

#[test]
fn a_cut_file_gives_the_blocks_before_the_cut() {
    let sound = record(Layout::Full, 3, 1003, 500);
    let file = sound.to_bytes().unwrap();
    let first = find(&file, *b"SECS");
    let salvaged = Record::salvage(&file[..first + 3 * 1053 + 700]).unwrap();
    assert_eq!(salvaged.record.blocks, sound.blocks[..3]);
    assert_eq!(salvaged.seal, SealState::Missing);
    assert!(!salvaged.record.completion.complete);
    // The torn block, and six parts that are not there.
    assert_eq!(salvaged.damage.len(), 1 + 6);
}

#[test]
fn lost_and_added_bytes_cost_what_they_hit() {
    let sound = record(Layout::Full, 3, 1003, 500);
    let file = sound.to_bytes().unwrap();
    let at = find(&file, *b"SECS") + 5 * 1053 + 300;
    let mut left = sound;
    left.blocks.remove(5);
    for damaged in [
        [&file[..at], &file[at + 123..]].concat(),
        [&file[..at], &[0xB8; 77], &file[at..]].concat(),
    ] {
        let salvaged = Record::salvage(&damaged).unwrap();
        assert_eq!(salvaged.record, left);
        assert!(matches!(salvaged.seal, SealState::Broken { .. }));
    }
}

#[test]
fn a_damaged_magic_or_seal_costs_no_values() {
    let sound = small();
    let file = sound.to_bytes().unwrap();
    let without_magic = Record::salvage(&file[8..]).unwrap();
    assert_eq!(without_magic.record, sound);
    assert!(matches!(
        without_magic.damage[0].error,
        SchemaError::Magic { .. }
    ));

    let mut last_check = file.clone();
    *last_check.last_mut().unwrap() ^= 1;
    let salvaged = Record::salvage(&last_check).unwrap();
    assert!(matches!(salvaged.seal, SealState::Sound(_)));
    assert_eq!(salvaged.damage.len(), 1);
}

#[test]
fn without_a_header_nothing_can_be_salvaged() {
    let mut file = small().to_bytes().unwrap();
    file[40] ^= 1;
    assert!(matches!(
        Record::salvage(&file),
        Err(SchemaError::Crc { .. })
    ));
    assert!(Record::salvage(&[]).is_err());
    assert!(Record::salvage(b"HEAD").is_err());
}

#[test]
fn text_mode_and_other_files_are_told_apart() {
    let file = small().to_bytes().unwrap();
    let text: Vec<u8> = file.iter().copied().filter(|&byte| byte != b'\r').collect();
    assert!(matches!(
        Record::read(&text),
        Err(SchemaError::TextMode { .. })
    ));
    assert!(matches!(
        Record::read(b"PNG?"),
        Err(SchemaError::Magic { .. })
    ));
    assert!(matches!(
        Record::read(b"\x89SVE\r\n\x1a\n..."),
        Err(SchemaError::Encrypted)
    ));
    assert!(matches!(
        Record::salvage(b"\x89SVE\r\n\x1a\n..."),
        Err(SchemaError::Encrypted)
    ));
    let error = Record::read(&text).unwrap_err().to_string();
    assert!(error.contains("text mode"), "{error}");
}
