//! The whole sealed record: header, second blocks, parts, triggers, completion, seal.

use crate::block::Block;
use crate::header::Header;
use crate::parts::{AuxChannel, Clip, Completion, Health, RawFrame, Trigger};

/// A record in memory. [`Record::write`] seals it; `Record::read` gives it back, or an error.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Header.
    pub header: Header,
    /// Second blocks in order of time.
    pub blocks: Vec<Block>,
    /// Clipped bins.
    pub clipping: Vec<Clip>,
    /// Raw frames about the triggers.
    pub raw: Vec<RawFrame>,
    /// Auxiliary signals.
    pub aux: Vec<AuxChannel>,
    /// Health.
    pub health: Health,
    /// Triggers in order of time; the first is t = 0.
    pub triggers: Vec<Trigger>,
    /// Completion.
    pub completion: Completion,
}
/// tmp
pub struct G {
    /// i
    pub index: u64,
    /// r
    pub rate_hz: u8,
    /// s
    pub sample: crate::Sample,
}
impl Record {
    /// tmp
    pub fn samples(&self) -> std::vec::IntoIter<G> {
        vec![].into_iter()
    }
    /// tmp
    pub fn time_s(&self, _: u64) -> f64 {
        0.0
    }
    /// tmp
    pub fn monotonic_ns(&self, _: u64) -> i64 {
        0
    }
    /// tmp
    pub fn first_index(&self) -> u64 {
        0
    }
}
