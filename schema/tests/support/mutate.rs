//! Mutated records: bytes changed anywhere, and structures changed inside with checks and digest put right
//! again, so that the change is not refused at the door but reaches the decoders.
#![allow(dead_code, reason = "each user of this support takes its own share")]

use rand::{Rng, RngExt};
use schema::{Record, SealState, unpack};
use sha2::{Digest, Sha256};

const MAGIC: &[u8] = b"\x89SVB\r\n\x1a\n";
const TAGS: [&[u8; 4]; 12] = [
    b"HEAD", b"SECS", b"CLIP", b"RAWF", b"AUXS", b"GNSS", b"HLTH", b"TRIG", b"DONE", b"SEAL",
    b"LATE", b"ZZZZ",
];
/// Values at the edges of integers and floats.
const EDGES: [u64; 16] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0x0100,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    0x7ff8_0000_0000_0000,
    0x7ff0_0000_0000_0000,
    u64::MAX,
];

/// A structure: tag and body.
pub(crate) type Structure = ([u8; 4], Vec<u8>);

/// The structures of a sound file before its seal.
pub(crate) fn parse(file: &[u8]) -> Vec<Structure> {
    let mut structures = Vec::new();
    let mut rest = &file[MAGIC.len()..];
    while !rest.starts_with(b"SEAL") {
        let length = usize::try_from(u32::from_le_bytes(rest[4..8].try_into().unwrap())).unwrap();
        structures.push((
            rest[..4].try_into().unwrap(),
            rest[12..12 + length].to_vec(),
        ));
        rest = &rest[12 + length + 4..];
    }
    structures
}

/// The file of these structures with sound checks and digest, unsigned or with these bytes as its signature.
pub(crate) fn build(structures: &[Structure], signature: Option<[u8; 64]>) -> Vec<u8> {
    let mut file = MAGIC.to_vec();
    for (tag, body) in structures {
        let start = head(&mut file, *tag, body.len());
        file.extend(body);
        file.extend(crc32c::crc32c(&file[start..]).to_le_bytes());
    }
    let start = head(
        &mut file,
        *b"SEAL",
        if signature.is_some() { 97 } else { 33 },
    );
    file.push(u8::from(signature.is_some()));
    file.extend(<[u8; 32]>::from(Sha256::digest(&file)));
    file.extend(signature.iter().flatten());
    file.extend(crc32c::crc32c(&file[start..]).to_le_bytes());
    file
}

/// Appends a head and gives its offset.
fn head(file: &mut Vec<u8>, tag: [u8; 4], length: usize) -> usize {
    let start = file.len();
    file.extend(tag);
    file.extend(u32::try_from(length).unwrap().to_le_bytes());
    file.extend(crc32c::crc32c(&file[start..]).to_le_bytes());
    start
}

/// Changes some bytes: flips, edge values, pieces lost, doubled or moved.
fn change(bytes: &mut Vec<u8>, rng: &mut impl Rng) {
    let place = |rng: &mut _, length: usize| RngExt::random_range(rng, 0..length.max(1));
    let at = place(rng, bytes.len());
    match rng.random_range(0..10) {
        0..3 if !bytes.is_empty() => bytes[at] ^= 1 << rng.random_range(0..8),
        3 if !bytes.is_empty() => bytes[at] = rng.random(),
        4..7 => {
            let value = EDGES[place(rng, EDGES.len())].wrapping_sub(rng.random_range(0..2));
            let width = 1 << rng.random_range(0..4);
            let value = if rng.random() {
                value.to_le_bytes()
            } else {
                value.to_be_bytes()
            };
            for (byte, new) in bytes.iter_mut().skip(at).take(width).zip(value) {
                *byte = new;
            }
        }
        7 => {
            let end = (at + place(rng, 40)).min(bytes.len());
            bytes.drain(at.min(end)..end);
        }
        8 => {
            let end = (at + place(rng, 40)).min(bytes.len());
            let piece = bytes[at.min(end)..end].to_vec();
            let to = place(rng, bytes.len());
            bytes.splice(to..to, piece);
        }
        _ => bytes.truncate(at),
    }
}

/// Gives one axis of a second block another remainder.
fn remainder(body: &mut [u8], rng: &mut impl Rng) {
    let at = 19 + 2 * rng.random_range(0..6);
    let part = match rng.random_range(0..4) {
        0 => i16::MIN,
        1 => i16::MAX,
        _ => rng.random(),
    };
    if let Some(bytes) = body.get_mut(at..at + 2) {
        bytes.copy_from_slice(&part.to_le_bytes());
    }
}

/// The remainder changes the last present value of its axis and no other, and stands on no axis without one.
fn remainders_are_placed(record: &Record) {
    let scales = record.scales();
    for block in &record.blocks {
        let mut left = block.remainder;
        let values: Vec<_> = block.values(&scales).collect();
        assert_eq!(values.len(), block.samples.len());
        for (codes, values) in block.samples.iter().zip(&values).rev() {
            let stored = unpack(codes, &scales).fields();
            for (field, (stored, value)) in stored.iter().zip(values.fields()).enumerate() {
                assert_eq!(stored.is_some(), value.is_some());
                let (Some(stored), Some(value)) = (stored, value) else {
                    continue;
                };
                let scale = [scales.accel, scales.rate][usize::from(field >= 5)];
                let part = match field.checked_sub(2) {
                    Some(axis) => std::mem::take(&mut left[axis]),
                    None => 0,
                };
                let wanted = stored + f64::from(part) * scale.fine_step / 256.0;
                assert_eq!(wanted.to_bits(), value.to_bits());
            }
        }
        assert_eq!(left, [0; 6]);
    }
}

/// One mutated file of a sound one.
pub(crate) fn mutate(structures: &[Structure], signed: bool, rng: &mut impl Rng) -> Vec<u8> {
    let mut structures = structures.to_vec();
    let raw_only = rng.random_bool(0.15);
    for _ in 0..if raw_only { 0 } else { rng.random_range(1..4) } {
        let at = rng.random_range(0..structures.len());
        match rng.random_range(0..20) {
            0 => drop(structures.remove(at)),
            1 => structures.insert(at, structures[at].clone()),
            2 => {
                let other = rng.random_range(0..structures.len());
                structures.swap(at, other);
            }
            3 => structures[at].0 = *TAGS[rng.random_range(0..TAGS.len())],
            4 => {
                let other = structures[rng.random_range(0..structures.len())].1.clone();
                structures[at].1.extend(other);
            }
            5 if structures[at].0 == *b"SECS" => remainder(&mut structures[at].1, rng),
            _ => change(&mut structures[at].1, rng),
        }
        if structures.is_empty() {
            break;
        }
    }
    let mut file = build(&structures, signed.then_some([0x42; 64]));
    if raw_only || rng.random_bool(0.1) {
        for _ in 0..rng.random_range(1..5) {
            change(&mut file, rng);
        }
    }
    file
}

/// What became of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Outcome {
    /// `read` took it.
    pub(crate) read: bool,
    /// `salvage` gave something.
    pub(crate) salvaged: bool,
}

/// Reads and salvages a file and asserts what must hold of any result.
pub(crate) fn drive(file: &[u8]) -> Outcome {
    let read = Record::read(file);
    let salvaged = Record::salvage(file);
    if let Ok((record, seal)) = &read {
        record.validate().unwrap();
        let back = Record::read(&record.to_bytes().unwrap()).unwrap().0;
        assert_eq!(&back, record);
        let salvaged = salvaged.as_ref().unwrap();
        assert!(salvaged.damage.is_empty());
        assert_eq!(&salvaged.record, record);
        assert_eq!(salvaged.seal, SealState::Sound(*seal));
    }
    if let Ok(salvaged) = &salvaged {
        let record = &salvaged.record;
        if !record.blocks.is_empty() {
            record.validate().unwrap();
        }
        if read.is_err() {
            let sound = salvaged.damage.is_empty() && matches!(salvaged.seal, SealState::Sound(_));
            // What only `read` asks for: the order of the structures, and no signature on a replay.
            assert!(
                !sound || out_of_order(file) || file[file.len() - 101] == 1,
                "{:?}",
                read.err()
            );
        }
        assert!(
            salvaged
                .damage
                .iter()
                .all(|damage| !damage.to_string().is_empty())
        );
        remainders_are_placed(record);
        let mut next = record.first_index();
        for sample in record.samples() {
            assert_eq!(sample.index, next + sample.gap_before);
            next = sample.index + sample.span;
            assert!(
                sample
                    .sample
                    .fields()
                    .iter()
                    .flatten()
                    .all(|value| value.is_finite())
            );
            assert!(record.time_s(sample.index).is_finite());
        }
    }
    Outcome {
        read: read.is_ok(),
        salvaged: salvaged.is_ok(),
    }
}

/// The known structures do not stand in the order that `read` asks for.
fn out_of_order(file: &[u8]) -> bool {
    let tags = parse(file);
    let ranks: Vec<_> = tags
        .iter()
        .filter_map(|(tag, _)| TAGS[..10].iter().position(|known| *known == tag))
        .collect();
    !ranks.is_sorted()
}
