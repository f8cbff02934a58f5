//! The svartboks crash record.
//!
//! A recorder in a car keeps the last 40 seconds of motion as 80-bit samples; at a crash it freezes them
//! and seals them into one file. This crate is that file and nothing else: no I/O beyond `Read` and
//! `Write`, no linear algebra, no clock. In the order the data flows:
//!
//! 1. [`sample`]: eight physical values, and their eight 10-bit codes [S03, table 3.1].
//! 2. [`scale`]: the two-slope scale between them; [`packer`]: the error feedback that keeps sums exact.
//! 3. [`bridge`]: where a lost frame may be bridged. [`block`]: the samples of one second behind a 48-bit time stamp [S03, 3.2.1], full or two-rate; [`time`].
//! 4. [`header`]: what a reader must know of the car, the sensors and the clocks.
//! 5. [`parts`]: clipping, raw frames, auxiliary signals, health, triggers, completion.
//!    [`gnss`]: satellite fixes, where they are asked for.
//! 6. [`record`]: the whole file, written once and read totally: a value or an error, never a panic, and
//!    never more memory than [`limits`] allow.
//! 7. [`seal`]: the digest over every byte before it, and the signature by the device's [`key`].
//! 8. [`ledger`]: number and digest of every record ever sealed; [`envelope`]: a record that is encrypted at rest.
//! 9. [`salvage`]: what a damaged file still gives, with its damage by name.
//! 10. [`serial`]: the words in which a record is read out over a serial line.
//!
//! Every byte is laid down in `schema/FORMAT.md`.

pub mod block;
pub mod bridge;
pub(crate) mod bytes;
pub(crate) mod check;
pub mod envelope;
pub mod error;
pub(crate) mod frame;
pub mod gnss;
pub mod header;
pub mod key;
pub mod ledger;
pub mod limits;
pub mod num;
pub mod packer;
pub mod parts;
pub(crate) mod read;
pub mod record;
pub mod salvage;
pub mod sample;
pub mod scale;
pub mod seal;
pub mod serial;
pub mod time;
pub mod units;
pub(crate) mod wire;

pub use block::Block;
pub use error::SchemaError;
pub use gnss::Gnss;
pub use header::Header;
pub use key::{PublicKey, SecretKey};
pub use ledger::Ledger;
pub use packer::{Packed, Packer, Thinner, unpack};
pub use record::{GridSample, Record};
pub use salvage::{Damage, Salvaged};
pub use sample::{Codes, Sample};
pub use scale::Scales;
pub use seal::{Seal, SealState};
