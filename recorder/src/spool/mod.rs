//! The ring on disk: the frames of the mapped messages, as received, and what happened beside them, in a file of
//! fixed size, so that a cut at any instant loses no more than the configured bound.
//!
//! **Frames, not samples.** A sample is known 50 ms after its bin at the earliest ([`crate::sampler`]); its frames are
//! known at once. After a cut they go through the same [`crate::pipeline`] again ([`crate::recovery`]), which gives
//! the record that would have been sealed, raw frames, clipping, auxiliary signals and all, up to the last frame
//! that was written.
//!
//! **Blocks of 4 KiB** ([`block`]), in a circle, each written once and never touched again until the circle comes
//! round: a write that is cut short can not harm what is durable already. One flush is one block as long as fewer
//! than some 5,000 frames a second are mapped, and a file system writes 4 KiB at least, so this wears flash no more
//! than a denser packing would. The file is filled with zeros once, so that a flush changes data alone and no
//! metadata of the file system.
//!
//! **Flush.** The receiving thread fills a [`Journal`]; every `flush_ms`, or 15 ms while an event runs or
//! within a second of a frame with more than 1 g beside gravity, it hands the blocks to a thread of its own ([`Syncer`]) that writes and synchronises them and measures how long
//! that takes. Frames that come while the disk is busy wait in memory, up to 4 MiB.

pub mod block;
pub mod bundles;
mod entry;
mod file;
mod journal;
mod syncer;
pub mod wear;

pub use entry::Entry;
pub use file::{Found, SpoolFile, last_of, read_session, scan};
pub use journal::Journal;
pub use syncer::{FlushState, Moment, Recent, Syncer};

use schema::sample::SAMPLE_NS;

use crate::config::Settings;

/// While an event runs every sample is durable within this, ns.
pub const EVENT_LOSS_NS: i64 = 50_000_000;
/// Time between two flushes while an event runs, ns.
pub const EVENT_FLUSH_NS: i64 = 15_000_000;
/// Bytes of sentences that a block holds at the least.
const SENTENCES_A_BLOCK: i64 = 3000;

/// Blocks that hold everything an event may need: what lies before its first trigger, 120 s of triggers, 20 s of tail
/// and the next event that began meanwhile, one block a flush.
#[must_use]
pub fn blocks_for(settings: &Settings) -> u64 {
    let samples_ns = |samples: u64| {
        i64::try_from(samples)
            .unwrap_or(0)
            .saturating_mul(SAMPLE_NS)
    };
    let before_ns = samples_ns(settings.ring.before).saturating_add(10_000_000_000);
    let event_ns = samples_ns(settings.ring.after).saturating_add(145_000_000_000);
    let flush_ns = settings.spool.flush_ns.max(1);
    let event_flush_ns = flush_ns.min(EVENT_FLUSH_NS);
    // What a full line of the satellite receiver adds: ten bits a byte, each sentence with its head.
    let line = settings.gnss.as_ref().and_then(|gnss| gnss.device());
    let sentences = line.map_or(0, |device| {
        let bytes =
            i64::from(device.baud / 10).saturating_mul((before_ns + event_ns) / 1_000_000_000);
        bytes / SENTENCES_A_BLOCK
    });
    let blocks = before_ns / flush_ns + event_ns / event_flush_ns + sentences + 64;
    u64::try_from(blocks).unwrap_or(0)
}
