//! The svartboks recorder: CAN frames in, sealed crash records out. In the order the data flows:
//!
//! 1. [`can`]: a frame, and the trait of whatever frames come from; [`log_source`] is one (text by [`candump`]).
//! 2. [`config`]: the TOML file becomes [`config::Settings`], names of signals a [`plan`] of bits ([`dbc`], [`signal`]).
//! 3. [`timebase`]: stamps become a monotonic time; [`decode`]: a frame becomes readings.
//! 4. [`sampler`]: readings become one sample per 10 ms: [`timeline`] takes the jitter out, [`bins`] integrate,
//!    [`axes`] turns the sensor's axes into the body's.
//! 5. [`ring`]: the last seconds, packed.
//! 6. [`trigger`]: a pure machine that says when to freeze and when to seal ([`delta_v`], [`rest`]).
//! 7. [`event`]: the frozen event becomes a record; [`store`] puts it on disk.
//!
//! [`gnss`] makes satellite fixes of signals, or of sentences ([`nmea`]), where the configuration asks for them.
//!
//! [`serve`] reads the records out over a serial line, beside all this.
//!
//! [`pipeline`] joins 3 to 7 and reads no clock; [`replay`] feeds it from logs.

pub mod axes;
pub mod bins;
pub mod can;
pub mod candump;
pub mod check;
pub mod cli;
pub mod clock;
pub mod config;
pub mod daemon;
pub mod dbc;
pub mod decode;
pub mod delta_v;
pub mod error;
pub mod event;
pub mod gnss;
pub mod health;
pub mod imu_stream;
pub mod keys;
pub mod level;
pub mod live;
pub mod log_source;
pub mod moments;
pub mod nmea;
pub mod pace;
pub mod pipeline;
pub mod plan;
pub mod recovery;
pub mod replay;
pub mod rest;
pub mod ring;
pub mod sampler;
pub mod serve;
pub mod signal;
pub mod socket;
pub mod spool;
pub mod storage;
pub mod store;
pub mod timebase;
pub mod timeline;
pub mod trigger;
