//! The header: everything a reader must know that is not motion.
//!
//! Written by bincode with fixed-size little-endian integers, so the byte layout follows from the order of
//! the fields below and is spelled out in `FORMAT.md`. No `usize`, `char` or map may enter these types.

use bincode::{Decode, Encode};
use serde::Serialize;

use crate::check;
use crate::error::SchemaError;
use crate::limits;
use crate::scale::{Scales, TwoSlope, WheelScale};
use crate::wire;

/// Format version written by this crate: major changes break readers, minor ones add. The minor one is 0 in a record
/// without satellite fixes.
pub const FORMAT_VERSION: (u16, u16) = (1, 1);

/// The header of a sealed record.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct Header {
    /// Number of this record in its device's (or replay's) sequence, from 1.
    pub number: u64,
    /// SHA-256 digest of the record before it; zeros for the first or for a replay.
    pub previous_sha256: [u8; 32],
    /// Digest of the record this one was derived from (thinned, exported); `None` for an original.
    pub parent_sha256: Option<[u8; 32]>,
    /// Where the frames came from.
    pub origin: Origin,
    /// Name of the recording device (configuration), empty if none was given.
    pub device_id: String,
    /// Program and version that wrote the record.
    pub software: String,
    /// SHA-256 of the configuration file in force.
    pub config_sha256: [u8; 32],
    /// The car.
    pub vehicle: Vehicle,
    /// The IMU's data sheet as configured.
    pub imu: ImuSheet,
    /// The wheel speed sensors' data sheet as configured.
    pub wheels: WheelSheet,
    /// Scale of the two wheel fields.
    pub wheel_scale: WheelScale,
    /// Scale of the three acceleration fields, m/s^2.
    pub accel_scale: TwoSlope,
    /// Scale of the three rate fields, rad/s.
    pub rate_scale: TwoSlope,
    /// Layout of the second blocks.
    pub layout: Layout,
    /// SAE J211 channel frequency class that is claimed for the samples; `None`: no class is claimed
    /// (always so at 100 Hz: CFC 60 needs at least 600 samples a second).
    pub channel_frequency_class: Option<u16>,
    /// Measured or nominal frame period of each signal group, nanoseconds; 0 if it never arrived.
    pub periods: Periods,
    /// The interfaces that were listened to.
    pub interfaces: Vec<Interface>,
    /// Mapping from the monotonic grid to UTC, frozen for the event.
    pub clock: Clock,
}

impl Header {
    /// The header as `FORMAT.md`, section 4, lays it down, without the version before it.
    ///
    /// # Errors
    /// When a value may not be stored or the whole is beyond its bound.
    pub fn to_bytes(&self) -> Result<Vec<u8>, SchemaError> {
        check::header(self).map_err(|fault| fault.at("header", None))?;
        wire::encode::<{ limits::MAX_HEADER_BYTES }, _>("header", self)
    }

    /// The header whose [`Header::to_bytes`] these are.
    ///
    /// # Errors
    /// When they are not, or hold a value that can not be.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SchemaError> {
        let header: Self = wire::decode::<{ limits::MAX_HEADER_BYTES }, _>("header", 0, bytes)?;
        check::header(&header).map_err(|fault| fault.at("header", Some(0)))?;
        Ok(header)
    }

    /// The three scales of the samples.
    #[must_use]
    pub fn scales(&self) -> Scales {
        Scales {
            wheel: self.wheel_scale,
            accel: self.accel_scale,
            rate: self.rate_scale,
        }
    }
}

/// Where the frames of a record came from.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Origin {
    /// Received live in the car.
    Live,
    /// Replayed from log files; such a record never carries the device's signature.
    Replay {
        /// The logs, in the order they were named.
        logs: Vec<SourceLog>,
    },
}

/// One replayed log.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
pub struct SourceLog {
    /// File name without its folder; `-` for standard input.
    pub name: String,
    /// Bytes the digest covers: the whole file, or what had been read of standard input at sealing.
    pub bytes: u64,
    /// SHA-256 of those bytes.
    pub sha256: [u8; 32],
}

/// The car: identity and the few lengths the mathematics needs.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct Vehicle {
    /// Vehicle identification number; empty if not configured (privacy: it is optional).
    pub vin: String,
    /// Free name; may be empty.
    pub name: String,
    /// Distance between the undriven wheels' centres, m [S03, 2.7].
    pub track_width_m: f64,
    /// IMU position from the rear axle's centre on the ground, body axes (x forward, y right, z down), m.
    pub imu_position_m: Option<[f64; 3]>,
    /// Standard deviation of it, m, per axis.
    pub imu_position_sd_m: [f64; 3],
    /// Centre of gravity, same origin and axes, m.
    pub cg_position_m: Option<[f64; 3]>,
    /// Standard deviation of it, m, per axis.
    pub cg_position_sd_m: [f64; 3],
}

/// The IMU's data sheet, as configured in `[imu]` and `[imu.noise]`. All SI and radians, one sigma.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct ImuSheet {
    /// The accelerometers' own range, m/s^2; `None` if unknown (then clipping can not be told).
    pub accel_range: Option<f64>,
    /// The gyros' own range, rad/s; `None` if unknown.
    pub rate_range: Option<f64>,
    /// White noise density of specific force, m/s^2/sqrt(Hz).
    pub accel_density: f64,
    /// White noise density of rate, rad/s/sqrt(Hz).
    pub rate_density: f64,
    /// Turn-on bias, m/s^2.
    pub accel_bias: f64,
    /// Turn-on bias, rad/s.
    pub rate_bias: f64,
    /// Shift of the bias at an impact, m/s^2.
    pub accel_bias_jump: f64,
    /// Shift of the bias at an impact, rad/s.
    pub rate_bias_jump: f64,
    /// Scale error of the accelerometers, fraction.
    pub accel_scale: f64,
    /// Scale error of the gyros, fraction.
    pub rate_scale: f64,
    /// Vibration of the driving car seen by the accelerometers: sd of one 10 ms sample, m/s^2.
    pub accel_vibration: f64,
    /// Vibration of the driving car seen by the gyros: sd of one 10 ms sample, rad/s.
    pub rate_vibration: f64,
    /// Rotation that was taken out of the signals: roll, pitch, yaw of the mounting, rad.
    pub mounting: [f64; 3],
    /// What is left of it: sd of roll, pitch, yaw, rad.
    pub mounting_sd: [f64; 3],
}

/// The wheel speed sensors' data sheet, as configured in `[wheels]`. One sigma.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize)]
pub struct WheelSheet {
    /// False if the configuration names no wheel signals.
    pub present: bool,
    /// Mean delay from motion to frame, s.
    pub latency_s: f64,
    /// Its standard deviation, s.
    pub latency_sd_s: f64,
    /// Below this speed the sensor reads zero, m/s.
    pub cutoff_mps: f64,
    /// Scale error (tyre radius), fraction, common to both wheels.
    pub scale_sd: f64,
    /// Difference of scale between left and right, fraction.
    pub scale_difference_sd: f64,
    /// White noise of one wheel frame, m/s.
    pub noise_mps: f64,
}

/// Layout of the second blocks [S03, 3.2].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// 100 samples a second throughout.
    Full,
    /// Blocks more than 15 s from the newest sample and more than 5 s from every trigger are thinned to 20
    /// samples a second, each the mean of five.
    TwoRate,
}

/// Frame periods, nanoseconds; 0: never seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Encode, Decode, Serialize)]
pub struct Periods {
    /// Accelerometer frames.
    pub accel_ns: u64,
    /// Rate frames.
    pub rate_ns: u64,
    /// Wheel frames, left and right.
    pub wheels_ns: [u64; 2],
}

/// One CAN interface.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
pub struct Interface {
    /// Name as configured.
    pub name: String,
    /// Offset of its receive clock to the monotonic grid, ns.
    pub offset_ns: i64,
    /// Uncertainty of that offset, ns; `None`: not known.
    pub uncertainty_ns: Option<u64>,
}

/// The mapping `utc_ns = monotonic_ns + offset_ns`, frozen for the event.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
pub struct Clock {
    /// What UTC was taken from.
    pub source: ClockSource,
    /// UTC minus monotonic, ns.
    pub offset_ns: i64,
    /// One-sigma uncertainty of UTC, ns; `None`: cannot be told.
    pub uncertainty_ns: Option<u64>,
    /// A leap second was announced or fell within the event.
    pub leap_second: bool,
}

/// Source of UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClockSource {
    /// The time stamps of the replayed log, whatever clock made them.
    LogStamps,
    /// The system clock, not known to be disciplined.
    SystemClock,
    /// The system clock, disciplined by NTP or PTP.
    Disciplined,
    /// A GNSS receiver.
    Gnss,
}
