//! Second blocks: the samples of one UTC second behind the 48-bit time stamp of [S03, 3.2.1].

use crate::num;
use crate::sample::{Codes, SAMPLE_BYTES};
use crate::scale::{Scales, Thinner, unpack};
use crate::time::{Grid, STAMP_BYTES, Stamp};

/// Samples a second at the full rate.
pub const FULL_HZ: u8 = 100;
/// Samples a second of a thinned block.
pub const THIN_HZ: u8 = 20;
/// Samples of the grid that one thinned sample stands for.
pub const THIN_SPAN: u8 = FULL_HZ / THIN_HZ;
/// Samples from the newest within which no block is thinned (15 s).
pub const KEEP_NEWEST: u64 = 1500;
/// Samples from a trigger within which no block is thinned (5 s).
pub const KEEP_TRIGGER: u64 = 500;

/// The samples of one second (the first and last of a record may be partial).
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// UTC second the block belongs to.
    pub stamp: Stamp,
    /// Samples a second: 100, or 20 where the two-rate layout thinned it.
    pub rate_hz: u8,
    /// Index of the first sample on the 100 Hz grid; a 20 Hz sample spans five indices.
    pub first_index: u64,
    /// Start of the first sample's bin on the monotonic grid, ns.
    pub monotonic_ns: i64,
    /// The samples.
    pub samples: Vec<Codes>,
}

impl Block {
    /// Indices of the 100 Hz grid that one of its samples spans: 1, or 5 in a thinned block.
    #[must_use]
    pub fn span(&self) -> u64 {
        u64::from(if self.rate_hz == THIN_HZ {
            THIN_SPAN
        } else {
            1
        })
    }

    /// Index behind its last sample.
    #[must_use]
    pub fn end_index(&self) -> u64 {
        let indices = num::u64_of(self.samples.len()).saturating_mul(self.span());
        self.first_index.saturating_add(indices)
    }

    /// Bytes of stamp and samples as S03 counts them: 1,006 for a full second at 100 Hz, 206 at 20 Hz.
    #[must_use]
    pub fn payload_bytes(&self) -> usize {
        STAMP_BYTES + self.samples.len() * SAMPLE_BYTES
    }
}

/// Lays a run of samples out as blocks: a new one begins at each full UTC second, and after indices that the
/// run leaves out. Indices must increase; one that does not is dropped.
#[must_use]
pub fn cut(run: impl IntoIterator<Item = (u64, Codes)>, grid: &Grid) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for (index, codes) in run {
        let open = blocks.last_mut().filter(|block| index <= block.end_index());
        match open {
            Some(block) if index < block.end_index() => {}
            Some(block) if !grid.starts_second(index) => block.samples.push(codes),
            _ => blocks.push(Block {
                stamp: Stamp::from_utc_ns(grid.utc_ns(index)),
                rate_hz: FULL_HZ,
                first_index: index,
                monotonic_ns: grid.monotonic_ns(index),
                samples: vec![codes],
            }),
        }
    }
    blocks
}

/// Thins whole blocks for the two-rate layout: those of 100 samples that lie more than 15 s from the newest
/// sample and more than 5 s from every trigger (given by sample index) become 20 samples, each the mean of
/// five. Partial blocks stay as they are.
pub fn thin_blocks(blocks: &mut [Block], triggers: &[u64], scales: &Scales) {
    let newest = blocks
        .iter()
        .map(Block::end_index)
        .max()
        .unwrap_or(0)
        .saturating_sub(1);
    let mut thinner = Thinner::new(scales.wheel, scales.accel, scales.rate);
    for block in blocks {
        let (first, last) = (block.first_index, block.end_index().saturating_sub(1));
        let near_trigger = triggers.iter().any(|&at| {
            let distance = first.saturating_sub(at).max(at.saturating_sub(last));
            distance <= KEEP_TRIGGER
        });
        let whole = block.rate_hz == FULL_HZ && block.samples.len() == usize::from(FULL_HZ);
        if !whole || near_trigger || newest.saturating_sub(last) <= KEEP_NEWEST {
            continue;
        }
        thinner.reset();
        block.samples = block
            .samples
            .chunks(usize::from(THIN_SPAN))
            .map(|five| {
                let five: Vec<_> = five.iter().map(|codes| unpack(codes, scales)).collect();
                thinner.thin(&five)
            })
            .collect();
        block.rate_hz = THIN_HZ;
    }
}
