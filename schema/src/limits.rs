//! The bounds of a record: a reader never holds more than these, whatever the input says.
//!
//! A recorder keeps within them by cutting (raw frames first) and saying so in the completion part.

/// Bytes of a whole file.
pub const MAX_FILE_BYTES: usize = 64 << 20;
/// Bytes of the encoded header.
pub const MAX_HEADER_BYTES: usize = 65_536;
/// Second blocks; a ring of 120 s, 120 s of impacts and 20 s of tail make about 260.
pub const MAX_BLOCKS: usize = 4_096;
/// Clipped bins; 260 s of six axes in both directions make 312,000.
pub const MAX_CLIPS: usize = 1 << 19;
/// Bytes of the raw frames: [`RAW_FRAME_BYTES`] and the payload for each.
pub const MAX_RAW_BYTES: usize = 40 << 20;
/// Bytes of a raw frame without its payload.
pub const RAW_FRAME_BYTES: usize = 15;
/// Payload of one frame (CAN FD).
pub const MAX_FRAME_DATA: usize = 64;
/// Bytes of all auxiliary signals: eight a value.
pub const MAX_AUX_BYTES: usize = 4 << 20;
/// Satellite fixes; 260 s at 20 a second make 5,200.
pub const MAX_FIXES: usize = 1 << 14;
/// Bytes of all satellite fixes and sentences.
pub const MAX_GNSS_BYTES: usize = 4 << 20;
/// Bytes of the encoded health part.
pub const MAX_HEALTH_BYTES: usize = 1 << 20;
/// Bytes of the encoded trigger list.
pub const MAX_TRIGGERS_BYTES: usize = 65_536;
/// Bytes of the encoded completion part.
pub const MAX_COMPLETION_BYTES: usize = 65_536;

/// Bytes of one clipped bin.
pub(crate) const CLIP_BYTES: usize = 14;
/// Bytes of a second block's body before its stamp.
pub(crate) const BEFORE_STAMP: usize = 31;
/// Bytes of the largest second block's body.
pub(crate) const MAX_BLOCK_BYTES: usize = BEFORE_STAMP + 6 + 1000;

// All parts at their bounds still make a file within its bound.
const _: () = assert!(
    MAX_HEADER_BYTES
        + MAX_BLOCKS * (MAX_BLOCK_BYTES + 16)
        + MAX_CLIPS * CLIP_BYTES
        + MAX_RAW_BYTES
        + MAX_AUX_BYTES
        + MAX_GNSS_BYTES
        + 70_000
        + MAX_HEALTH_BYTES
        + MAX_TRIGGERS_BYTES
        + MAX_COMPLETION_BYTES
        + 4_096
        < MAX_FILE_BYTES
);
