//! Second blocks: the samples of one UTC second behind the 48-bit time stamp of [S03, 3.2.1].

use crate::num;
use crate::packer::{Packed, REMAINDER_PARTS};
use crate::sample::{AXES, Codes, SAMPLE_BYTES, Sample, WHEELS};
use crate::scale::{Scales, TOP_CODE, Thinner, unpack};
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
    /// What the codes of the whole block leave out of its acceleration x, y, z and rate x, y, z, in 1/256 of the
    /// axis's fine step. It belongs to the last sample of the axis that is not missing; 0 if all are.
    pub remainder: [i16; AXES],
    /// The samples, as stored.
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

    /// Its physical values in order: those of the codes, and what the block's codes leave out on the last sample
    /// of each axis that is not missing: value + remainder * fine step / 256, in this order.
    pub fn values<'a>(&'a self, scales: &Scales) -> impl Iterator<Item = Sample> + use<'a> {
        let (scales, last) = (*scales, self.last_present());
        let rest = |axis: usize, step: f64| {
            let parts = self.remainder.get(axis).copied().unwrap_or(0);
            f64::from(parts) * step / REMAINDER_PARTS
        };
        let accel = [0, 1, 2].map(|axis| rest(axis, scales.accel.fine_step));
        let rate = [3, 4, 5].map(|axis| rest(axis, scales.rate.fine_step));
        self.samples.iter().enumerate().map(move |(at, codes)| {
            let mut sample = unpack(codes, &scales);
            let axes = sample.accel.iter_mut().chain(&mut sample.rate);
            let rests = accel.iter().chain(&rate);
            for ((value, rest), last) in axes.zip(rests).zip(&last) {
                if let Some(value) = value.as_mut().filter(|_| *last == Some(at)) {
                    *value += rest;
                }
            }
            sample
        })
    }

    /// Where the last sample of each axis stands that is not missing.
    pub(crate) fn last_present(&self) -> [Option<usize>; AXES] {
        [0, 1, 2, 3, 4, 5].map(|axis| {
            let present = |codes: &Codes| codes.0.get(WHEELS + axis) <= Some(&TOP_CODE);
            self.samples.iter().rposition(present)
        })
    }

    /// Bytes of stamp and samples as S03 counts them: 1,006 for a full second at 100 Hz, 206 at 20 Hz.
    #[must_use]
    pub fn payload_bytes(&self) -> usize {
        STAMP_BYTES + self.samples.len() * SAMPLE_BYTES
    }
}

/// Lays a run of samples out as blocks: a new one begins at each full UTC second, and after indices that the
/// run leaves out. Indices must increase; one that does not is dropped. A block's remainder is what its samples
/// left out in all, saturating, wherever the run begins or the packer was reset.
#[must_use]
pub fn cut(run: impl IntoIterator<Item = (u64, Packed)>, grid: &Grid) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut sums = [0_i64; AXES];
    for (index, Packed { codes, left }) in run {
        let open = blocks.last_mut().filter(|block| index <= block.end_index());
        let block = match open {
            Some(block) if index < block.end_index() => continue,
            Some(block) if !grid.starts_second(index) => block,
            _ => {
                sums = [0; AXES];
                blocks.push_mut(Block {
                    stamp: Stamp::from_utc_ns(grid.utc_ns(index)),
                    rate_hz: FULL_HZ,
                    first_index: index,
                    monotonic_ns: grid.monotonic_ns(index),
                    remainder: [0; AXES],
                    samples: Vec::new(),
                })
            }
        };
        block.samples.push(codes);
        for (sum, left) in sums.iter_mut().zip(left) {
            *sum += i64::from(left);
        }
        block.remainder = sums.map(num::saturate_i16);
    }
    blocks
}

/// Thins whole blocks for the two-rate layout: those of 100 samples that lie more than 15 s from the newest
/// sample and more than 5 s from every trigger (given by sample index) become 20 samples, each the mean of
/// five, with what these leave out of the block's sum as its remainder. Partial blocks stay as they are.
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
        let values: Vec<Sample> = block.values(scales).collect();
        let fives = values.chunks(usize::from(THIN_SPAN));
        block.samples = fives.map(|five| thinner.thin(five)).collect();
        block.remainder = thinner.remainder();
        block.rate_hz = THIN_HZ;
    }
}
