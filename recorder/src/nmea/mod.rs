//! NMEA 0183 (4.11) as a satellite receiver sends it over a serial line.
//!
//! 1. [`Framer`]: bytes become sentences with a checksum that holds; whatever else comes is counted and passed over.
//! 2. [`read`]: a sentence becomes a [`Message`], of any talker: RMC, GGA, VTG, GSA, GST, GLL, ZDA.
//! 3. [`Epochs`]: the sentences of one instant become one fix.
//!
//! All of it is total and allocates nothing: any bytes give sentences or counts.

mod epoch;
mod field;
mod frame;
mod message;

pub(crate) use epoch::nearest_day;
pub use epoch::{Counts, Epochs};
pub(crate) use frame::byte_time;
pub use frame::{Framer, Heard, LONGEST, Text, checksum};
pub use message::{Gga, Gll, Gsa, Gst, Kind, Message, Reading, Rmc, Vtg, Zda, read};
