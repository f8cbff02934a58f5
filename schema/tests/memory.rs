//! Memory is bounded by the input: a hostile length is refused before anything is allocated for it, and the
//! densest file allowed takes a small multiple of its own size. Alone in its process, so that the peak the
//! kernel counts is that of these reads.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

#[path = "support/mutate.rs"]
mod mutate;
mod support;

use mutate::{Structure, build, parse};
use schema::{Record, SchemaError, limits};

/// Peak resident memory of this process, bytes.
fn peak() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status
        .lines()
        .find(|line| line.starts_with("VmHWM:"))
        .unwrap();
    line.split_whitespace()
        .nth(1)
        .unwrap()
        .parse::<usize>()
        .unwrap()
        * 1024
}

fn set(structures: &[Structure], number: usize, at: usize, value: &[u8]) -> Vec<u8> {
    let mut structures = structures.to_vec();
    structures[number].1[at..at + value.len()].copy_from_slice(value);
    build(&structures, None)
}

#[test]
fn hostile_lengths_take_no_memory() {
    let structures = parse(&support::small().to_bytes().unwrap());
    let base = peak();
    let lengths = [
        u64::MAX,
        1 << 63,
        1 << 36,
        1 << 32,
        (1 << 32) - 1,
        1 << 31,
        1 << 24,
        1 << 20,
    ];
    let mut refused = 0;
    for length in lengths {
        for (number, (_, body)) in structures.iter().enumerate() {
            for at in 0..body.len().saturating_sub(8) {
                for file in [
                    set(&structures, number, at, &length.to_le_bytes()),
                    set(&structures, number, at, &length.to_le_bytes()[..4]),
                ] {
                    refused += usize::from(Record::read(&file).is_err());
                    let _ = Record::salvage(&file);
                }
            }
        }
    }
    let grown = peak() - base;
    println!("{refused} files with hostile lengths refused, peak grew by {grown} bytes");
    assert!(refused > 1000, "{refused}");
    assert!(grown < 16 << 20, "{grown}");

    // A length in a head that its check confirms, but that the file does not hold.
    for length in [u32::MAX, 1 << 30, 1 << 20, 70_000] {
        let mut file = b"\x89SVB\r\n\x1a\nHEAD".to_vec();
        file.extend(length.to_le_bytes());
        let check = crc32c::crc32c(&file[8..]);
        file.extend(check.to_le_bytes());
        assert!(matches!(
            Record::read(&file),
            Err(SchemaError::TooLarge { .. })
        ));
        assert!(Record::salvage(&file).is_err());
    }

    // The densest part: frames without payload, as many as are allowed; then one more.
    let mut dense = structures.clone();
    let count = limits::MAX_RAW_BYTES / limits::RAW_FRAME_BYTES;
    for more in [0, 1] {
        let mut body = u32::try_from(count + more).unwrap().to_le_bytes().to_vec();
        body.resize(4 + (count + more) * limits::RAW_FRAME_BYTES, 0);
        dense.iter_mut().find(|(tag, _)| tag == b"RAWF").unwrap().1 = body;
        let file = build(&dense, None);
        let base = peak();
        let read = Record::read(&file).map(|(record, _)| record.raw.len());
        let grown = peak() - base;
        println!("{} bytes: peak grew by {grown}", file.len());
        assert!(grown < 6 * file.len(), "{grown} for {}", file.len());
        match (more, read) {
            (0, Ok(frames)) => assert_eq!(frames, count),
            (1, Err(SchemaError::TooLarge { .. })) => {}
            (_, other) => panic!("{other:?}"),
        }
    }

    // Beyond the bound of a file nothing is looked at; within it, damage is listed up to a number.
    let huge = vec![0; limits::MAX_FILE_BYTES + 1];
    assert!(matches!(
        Record::read(&huge),
        Err(SchemaError::TooLarge { .. })
    ));
    assert!(matches!(
        Record::salvage(&huge),
        Err(SchemaError::TooLarge { .. })
    ));
    let mut broken = structures[..1].to_vec();
    broken.extend((0..200_000).map(|_| (*b"SECS", vec![])));
    let salvaged = Record::salvage(&build(&broken, None)).unwrap();
    assert_eq!(salvaged.damage.len(), schema::salvage::MAX_DAMAGES);
    assert_eq!(salvaged.unlisted, 200_000 + 7 - 1_000);
}
