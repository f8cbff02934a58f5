//! The read-out over a serial line [S03, 4.1]: what the recorder's `serve` and the investigator's `fetch` say to each
//! other, without the line itself. Pure and total: no I/O, no clock, and any bytes give a value or an error. Every
//! byte is laid down in `recorder/SERIAL.md`.
//!
//! 1. [`mod@line`]: packets between zero bytes, each behind a CRC-32C; a damaged one is never taken for a whole one.
//! 2. [`message`]: what a packet says: requests, each repeatable, and the response to each.
//! 3. [`auth`]: both sides prove that they know the token without sending it; then every packet is tagged.

pub mod auth;
pub mod entry;
pub mod line;
pub mod message;
pub mod refusal;

pub use auth::{Keys, NONCE_BYTES};
pub use entry::Entry;
pub use line::{Deframer, LineError};
pub use message::{Head, MessageError, Request, Response};
pub use refusal::Refusal;

/// Version of the protocol.
pub const VERSION: u8 = 1;
/// Most bytes of a file in one packet.
pub const MAX_DATA: usize = 1024;
/// Most bytes of a packet, with its tag, without its CRC.
pub const MAX_PACKET: usize = 1056;
/// Most bytes of a file's name.
pub const MAX_NAME: usize = 64;
/// Most files that are listed.
pub const MAX_FILES: usize = 4096;

/// True of the names of files that may be read out: records (`.svb`), encrypted records (`.sve`) and `ledger.svl`;
/// of letters, digits, `-`, `_` and `.` alone, not beginning with a dot, at most [`MAX_NAME`] bytes. Nothing else can
/// be asked for, and a reader that writes files by these names writes into its folder alone.
#[must_use]
pub fn name_is_allowed(name: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    name.len() <= MAX_NAME
        && !name.starts_with('.')
        && name.bytes().all(plain)
        && (name == "ledger.svl"
            || [".svb", ".sve"]
                .iter()
                .any(|end| name.strip_suffix(end).is_some_and(|stem| !stem.is_empty())))
}

/// The record's number, where the name of a record ends with it (`20261103T120000Z-0007.svb`: 7).
#[must_use]
pub fn record_number(name: &str) -> Option<u64> {
    let stem = name.strip_suffix(".svb").or(name.strip_suffix(".sve"))?;
    let (_, digits) = stem.rsplit_once('-')?;
    digits
        .bytes()
        .all(|byte| byte.is_ascii_digit())
        .then(|| digits.parse().ok())?
}
