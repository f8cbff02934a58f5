//! The decoder is total: mutated files give a value or an error, from `read` and from `salvage`.
//!
//! `MUTATIONS=10000000 cargo test -p svartboks-schema --release --test mutation` runs as many as it says.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests"
)]

#[path = "support/mutate.rs"]
mod mutate;
mod support;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schema::header::{Layout, Origin};
use schema::{Record, SchemaError};

#[test]
fn mutated_files_give_a_value_or_an_error() {
    let asked = std::env::var("MUTATIONS").ok();
    let count: u64 = asked.map_or(60_000, |count| count.parse().unwrap());
    let bases = mutate_bases();
    let mut rng = ChaCha8Rng::seed_from_u64(563);
    let (mut read, mut salvaged) = (0_u64, 0_u64);
    for _ in 0..count {
        let (structures, signed) = &bases[rng.random_range(0..bases.len())];
        let outcome = mutate::drive(&mutate::mutate(structures, *signed, &mut rng));
        read += u64::from(outcome.read);
        salvaged += u64::from(outcome.salvaged);
    }
    println!("{count} mutated files: {read} read, {salvaged} salvaged");
    // The mutations must get past the checksums, or they test nothing.
    assert!(
        read > count / 20 && salvaged > count / 3,
        "{read} read, {salvaged} salvaged"
    );
}

fn mutate_bases() -> Vec<(Vec<mutate::Structure>, bool)> {
    let mut live = support::small();
    live.header.origin = Origin::Live;
    let thin = thin();
    let placed = support::placed();
    [
        (support::small(), false),
        (live, true),
        (thin, false),
        (placed, false),
    ]
    .into_iter()
    .map(|(record, signed)| (mutate::parse(&record.to_bytes().unwrap()), signed))
    .collect()
}

/// A thinned block, and the gap to a partial one.
fn thin() -> Record {
    let mut record = support::record(Layout::TwoRate, 3, 2203, 2200);
    let last = record.blocks.last().unwrap().clone();
    record.blocks.truncate(1);
    record.blocks.push(schema::Block {
        samples: last.samples[..3].to_vec(),
        ..last
    });
    record
}

#[test]
fn built_files_are_what_the_writer_writes() {
    let file = support::small().to_bytes().unwrap();
    assert_eq!(mutate::build(&mutate::parse(&file), None), file);
}

#[test]
fn a_signed_record_gives_its_signature_unless_it_is_a_replay() {
    let mut live = support::small();
    live.header.origin = Origin::Live;
    let signed = mutate::build(&mutate::parse(&live.to_bytes().unwrap()), Some([0x42; 64]));
    let (back, seal) = Record::read(&signed).unwrap();
    assert_eq!((back, seal.signature), (live, Some([0x42; 64])));
    for bit in 0..signed.len() * 8 {
        let mut file = signed.clone();
        file[bit / 8] ^= 1 << (bit % 8);
        assert!(
            Record::read(&file).is_err(),
            "bit {} of byte {}",
            bit % 8,
            bit / 8
        );
    }
    let replay = mutate::build(
        &mutate::parse(&support::small().to_bytes().unwrap()),
        Some([0x42; 64]),
    );
    assert!(matches!(
        Record::read(&replay),
        Err(SchemaError::Value { .. })
    ));
}

#[test]
fn unknown_parts_are_skipped_and_known_ones_stand_once_and_in_order() {
    let sound = support::small();
    let structures = mutate::parse(&sound.to_bytes().unwrap());
    let mut more = structures.clone();
    more.insert(2, (*b"LATE", vec![1, 2, 3]));
    more.push((*b"new ", vec![]));
    assert_eq!(Record::read(&mutate::build(&more, None)).unwrap().0, sound);
    let refused = |structures: &[mutate::Structure]| {
        Record::read(&mutate::build(structures, None)).unwrap_err()
    };
    let second_block = |at: usize| structures[at].0 == *b"SECS";
    for at in 0..structures.len() {
        let mut twice = structures.clone();
        twice.insert(at, structures[at].clone());
        let error = refused(&twice);
        assert!(
            matches!(error, SchemaError::Order { .. }) || second_block(at),
            "twice {at}: {error}"
        );
        let mut without = structures.clone();
        without.remove(at);
        // One of two blocks may be missing: then there is a gap.
        if !second_block(at) {
            let error = refused(&without);
            assert!(
                matches!(error, SchemaError::Order { .. }),
                "without {at}: {error}"
            );
        }
        let mut swapped = structures.clone();
        swapped.swap(at, (at + 1) % structures.len());
        let error = refused(&swapped);
        assert!(
            matches!(error, SchemaError::Order { .. }) || second_block(at),
            "swapped {at}: {error}"
        );
    }
    let no_blocks: Vec<_> = structures
        .into_iter()
        .filter(|(tag, _)| tag != b"SECS")
        .collect();
    assert!(matches!(refused(&no_blocks), SchemaError::Order { .. }));
}

#[test]
fn another_major_version_is_refused_and_a_later_minor_one_read() {
    let sound = support::small();
    let mut structures = mutate::parse(&sound.to_bytes().unwrap());
    structures[0].1[2] = 9;
    assert_eq!(
        Record::read(&mutate::build(&structures, None)).unwrap().0,
        sound
    );
    structures[0].1[0] = 2;
    let file = mutate::build(&structures, None);
    assert!(matches!(
        Record::read(&file),
        Err(SchemaError::Version {
            major: 2,
            minor: 9,
            ..
        })
    ));
    assert!(matches!(
        Record::salvage(&file),
        Err(SchemaError::Version {
            major: 2,
            minor: 9,
            ..
        })
    ));
}
