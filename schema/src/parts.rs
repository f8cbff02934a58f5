//! The parts behind the second blocks: clipping, raw frames, auxiliary signals, health, triggers, completion.

use bincode::{Decode, Encode};
use serde::Serialize;

use crate::check;
use crate::error::SchemaError;
use crate::limits;
use crate::wire;

/// Frames that stood at the sensor's own limit within one bin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
pub struct Clip {
    /// Index of the sample.
    pub index: u64,
    /// 0 to 2: acceleration x, y, z; 3 to 5: rate x, y, z (body axes).
    pub axis: u8,
    /// Frames at or beyond the range, downwards (-1) or upwards (+1): the sign of the lost part.
    pub sign: i8,
    /// Clipped frames in the bin.
    pub clipped: u16,
    /// All frames of that signal in the bin.
    pub frames: u16,
}

/// A frame as received, kept verbatim about the trigger.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RawFrame {
    /// Receive time on the monotonic grid, ns.
    pub monotonic_ns: i64,
    /// Index into `Header::interfaces`.
    pub interface: u8,
    /// CAN identifier with SocketCAN's flag bits (EFF bit 31, RTR bit 30, ERR bit 29).
    pub id: u32,
    /// CAN FD flags (BRS 1, ESI 2), 0x80 set for an FD frame; 0 for a classic one.
    pub flags: u8,
    /// Payload, at most 64 bytes.
    pub data: Vec<u8>,
}

/// An auxiliary signal at 10 Hz.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AuxChannel {
    /// Name in the configuration, such as `brake`.
    pub name: String,
    /// `MESSAGE.SIGNAL` it was read from.
    pub signal: String,
    /// Unit from the DBC.
    pub unit: String,
    /// Index of the first sample of the first value; each value stands for ten samples.
    pub first_index: u64,
    /// The last value received in each 100 ms; `None` if none was. One that is not finite is stored as missing.
    pub values: Vec<Option<f64>>,
}

/// What made the recorder freeze.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TriggerKind {
    /// 1: |acceleration| of one frame reached the threshold.
    Peak,
    /// 2: delta-V within 150 ms reached the threshold.
    DeltaV,
    /// 3: asked for by hand.
    Manual,
    /// 4: a CAN signal (air-bag, eCall).
    Can,
    /// The recording was cut while the car moved, before any other trigger could fire.
    PowerLoss,
}

/// One trigger of the event, in order of time.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct Trigger {
    /// Which.
    pub kind: TriggerKind,
    /// When, on the monotonic grid, ns.
    pub monotonic_ns: i64,
    /// The sample it fell in; it may lie outside the record's blocks if these were cut.
    pub index: u64,
    /// The value that fired it: m/s^2, m/s, or the signal's value; 0 for manual; the last wheel speed, m/s, for a loss
    /// of power (0: not known).
    pub value: f64,
    /// The threshold in force, same unit; 0 for manual.
    pub threshold: f64,
    /// Body axis of a peak or delta-V trigger (`x`, `y`, `z`), the CAN signal, or empty.
    pub source: String,
}

impl Trigger {
    /// The list as `FORMAT.md`, 6.5, lays it down.
    ///
    /// # Errors
    /// When it is beyond its bound.
    pub fn list_to_bytes(triggers: &Vec<Self>) -> Result<Vec<u8>, SchemaError> {
        wire::encode::<{ limits::MAX_TRIGGERS_BYTES }, _>("triggers", triggers)
    }

    /// The list whose [`Trigger::list_to_bytes`] these are.
    ///
    /// # Errors
    /// When they are not, or hold a value that can not be.
    pub fn list_from_bytes(bytes: &[u8]) -> Result<Vec<Self>, SchemaError> {
        let triggers: Vec<Self> =
            wire::decode::<{ limits::MAX_TRIGGERS_BYTES }, _>("triggers", 0, bytes)?;
        check::each(&triggers, check::trigger).map_err(|fault| fault.at("triggers", Some(0)))?;
        Ok(triggers)
    }
}

/// Whether the record holds all it should.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
pub struct Completion {
    /// True if nothing was cut.
    pub complete: bool,
    /// One sentence for each reason why not.
    pub reasons: Vec<String>,
    /// The car was found at rest at the end.
    pub ends_at_rest: bool,
}

/// Health of the recording over the event: what arrived, what did not, what the clocks did.
#[derive(Clone, Debug, PartialEq, Default, Encode, Decode, Serialize)]
pub struct Health {
    /// Frames seen on all interfaces since the recorder started.
    pub frames_seen: u64,
    /// Frames the kernel dropped (`SO_RXQ_OVFL`).
    pub frames_dropped: u64,
    /// CAN error frames.
    pub error_frames: u64,
    /// Lines of a replayed log that could not be read, or frames too short for their signals.
    pub malformed: u64,
    /// Frames older than the bin already closed.
    pub late_frames: u64,
    /// Values outside the DBC's own minimum and maximum.
    pub out_of_range: u64,
    /// Gaps: a signal group silent for more than three of its periods, within the record.
    pub gaps: Vec<Gap>,
    /// Steps of the clock within the record.
    pub clock_steps: Vec<ClockStep>,
    /// Frame counts of the mapped signals within the record.
    pub signals: Vec<SignalHealth>,
    /// Everything else a reader must hear, one sentence each.
    pub notes: Vec<String>,
}

impl Health {
    /// The part as `FORMAT.md`, 6.4, lays it down.
    ///
    /// # Errors
    /// When it is beyond its bound.
    pub fn to_bytes(&self) -> Result<Vec<u8>, SchemaError> {
        wire::encode::<{ limits::MAX_HEALTH_BYTES }, _>("health", self)
    }

    /// The part whose [`Health::to_bytes`] these are.
    ///
    /// # Errors
    /// When they are not.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SchemaError> {
        wire::decode::<{ limits::MAX_HEALTH_BYTES }, _>("health", 0, bytes)
    }
}

/// A signal group that was silent.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
pub struct Gap {
    /// `accel`, `rate`, `wheel-left`, `wheel-right`.
    pub signal: String,
    /// Last frame before, monotonic ns.
    pub from_ns: i64,
    /// First frame after, monotonic ns; the record's end if it did not come back.
    pub to_ns: i64,
}

/// A step of the clock.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
pub struct ClockStep {
    /// When, monotonic ns.
    pub monotonic_ns: i64,
    /// By how much UTC moved, ns.
    pub step_ns: i64,
}

/// Frames of one signal group within the record.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct SignalHealth {
    /// `accel`, `rate`, `wheel-left`, `wheel-right`.
    pub signal: String,
    /// Frames that carried it.
    pub frames: u64,
    /// Frames missing by its rolling counter; `None` if it has none.
    pub lost_by_counter: Option<u64>,
    /// Measured period, ns; 0 if fewer than two frames.
    pub period_ns: u64,
    /// Standard deviation of the receive jitter about the fitted time line, ns.
    pub jitter_ns: u64,
}
