//! Second blocks: the samples of one UTC second behind the 48-bit time stamp of [S03, 3.2.1].

use crate::sample::Codes;
use crate::time::Stamp;

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
