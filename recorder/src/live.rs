//! Where live frames come from, as the daemon sees it: CAN sockets in the car, a paced log on the bench.
//!
//! All times are on one *line*: the UTC of the system clock when the source was opened, going on with the monotonic
//! clock. A step of the system clock does not move the line; it is told as a [`Note`], and the sum of all steps is
//! what UTC differs from the line by. As long as no step happened a frame's time is the kernel's own stamp.

use std::time::Duration;

use schema::header::{Clock, Interface};
use serde::{Deserialize, Serialize};

use crate::can::Frame;
use crate::config::Settings;
use crate::error::RecorderError;

/// Something that happened to the source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Note {
    /// The system clock was set.
    ClockStep {
        /// When, ns on the line.
        at_ns: i64,
        /// New minus old UTC, ns.
        step_ns: i64,
    },
    /// An interface went down, came back, had its controller go bus-off, and the like, in one sentence.
    Text {
        /// When, ns on the line.
        at_ns: i64,
        /// What.
        text: String,
    },
}

/// State of one interface.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct InterfaceState {
    /// As configured.
    pub name: String,
    /// Frames can be received.
    pub up: bool,
    /// Frames received.
    pub frames: u64,
    /// Frames the kernel dropped.
    pub dropped: u64,
    /// Error frames.
    pub error_frames: u64,
    /// Times the controller went bus-off.
    pub bus_off: u64,
    /// Datagrams that were no frame, or came without a stamp.
    pub malformed: u64,
    /// Times it went down or disappeared.
    pub outages: u64,
    /// `hardware`, `kernel`, or empty before the first frame.
    pub stamps: String,
    /// Receive buffer in force, bytes.
    pub receive_buffer: u64,
}

/// A source of live frames.
pub trait LiveSource {
    /// Waits at most so long for frames and hands on all that are there, each with [`Frame::time_ns`] on the line.
    /// Returns early when some came. Allocates nothing in steady state.
    ///
    /// # Errors
    /// Only where going on makes no sense; an interface that is down or gone is a [`Note`] and is tried again.
    fn read(&mut self, wait: Duration, take: &mut dyn FnMut(&Frame)) -> Result<(), RecorderError>;

    /// False when no frame will ever come again (a paced log has ended).
    fn open(&self) -> bool;

    /// Now on the line, ns. Looks for steps of the system clock.
    fn now_ns(&mut self) -> i64;

    /// What happened since it was last asked.
    fn next_note(&mut self) -> Option<Note>;

    /// The interfaces, in the order of the configuration.
    fn interfaces(&self) -> &[InterfaceState];

    /// What the record's header says of each interface's clock.
    fn header_interfaces(&self) -> Vec<Interface>;

    /// Source, quality and leap second of UTC now; `offset_ns` is UTC minus the line.
    fn clock(&mut self) -> Clock;

    /// Takes over changed settings: other interfaces, other filters.
    ///
    /// # Errors
    /// When the new settings can not be used; the old ones then stay in force.
    fn reconfigure(&mut self, settings: &Settings) -> Result<(), RecorderError>;
}
