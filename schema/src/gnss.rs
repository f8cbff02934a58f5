//! Satellite fixes of a record: an optional part, there only where the configuration asks for it, as it tells where
//! a car has been.
//!
//! What the receiver said stands beside what was made of it: sentences verbatim, each with the time it came.

use serde::Serialize;

use crate::error::SchemaError;
#[cfg(doc)]
use crate::limits;

mod check;
mod layout;

pub(crate) use check::check;
pub(crate) use layout::{parse, put};

/// Name of the part in errors.
const PLACE: &str = "satellite fixes";
/// What stands for a missing time.
const NO_TIME: i64 = i64::MIN;
/// What stands for a missing number of satellites.
const NO_COUNT: u8 = 0xff;

/// Where the fixes came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GnssSource {
    /// Signals of a CAN bus.
    Can,
    /// Sentences of NMEA 0183 on a serial line.
    Nmea,
}

/// What a fix was made from, by the numbers of the sentence GGA of NMEA 0183.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FixQuality {
    /// 0: no fix; the receiver said so. It has no position.
    None,
    /// 1: satellites alone.
    Autonomous,
    /// 2: differential corrections (SBAS among them).
    Differential,
    /// 3: precise positioning service.
    Precise,
    /// 4: real-time kinematic, whole cycles.
    RtkFixed,
    /// 5: real-time kinematic, not whole cycles.
    RtkFloat,
    /// 6: dead reckoning of the receiver itself. It is no measurement.
    Estimated,
    /// 7: entered by hand.
    Manual,
    /// 8: simulated.
    Simulated,
    /// 9: the source does not say, beyond that it is a fix.
    Unstated,
}

impl FixQuality {
    /// In the order of their numbers.
    pub const ALL: [Self; 10] = [
        Self::None,
        Self::Autonomous,
        Self::Differential,
        Self::Precise,
        Self::RtkFixed,
        Self::RtkFloat,
        Self::Estimated,
        Self::Manual,
        Self::Simulated,
        Self::Unstated,
    ];

    /// The number that is stored.
    #[must_use]
    pub fn number(self) -> u8 {
        match self {
            Self::None => 0,
            Self::Autonomous => 1,
            Self::Differential => 2,
            Self::Precise => 3,
            Self::RtkFixed => 4,
            Self::RtkFloat => 5,
            Self::Estimated => 6,
            Self::Manual => 7,
            Self::Simulated => 8,
            Self::Unstated => 9,
        }
    }

    /// That of a number; `None` if there is none of it.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Whether satellites were measured for it: not by hand, simulated or reckoned on.
    #[must_use]
    pub fn is_measured(self) -> bool {
        !matches!(
            self,
            Self::None | Self::Estimated | Self::Manual | Self::Simulated
        )
    }
}

/// Receiver and antenna as configured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GnssSheet {
    /// Where the fixes came from.
    pub source: GnssSource,
    /// The device or the signals, in words of the configuration.
    pub receiver: String,
    /// Antenna from the rear axle's centre on the ground, m, body axes; `None`: not known.
    pub antenna_position_m: Option<[f64; 3]>,
    /// Its standard deviation, m.
    pub antenna_position_sd_m: [f64; 3],
    /// From the instant that a fix holds for to its receive time, s.
    pub latency_s: f64,
    /// Its standard deviation, s.
    pub latency_sd_s: f64,
    /// Of north and east each, where a fix states none, m.
    pub horizontal_sd_m: f64,
    /// Of the height, where a fix states none, m.
    pub height_sd_m: f64,
    /// Of speed and climb, where a fix states none, m/s.
    pub speed_sd_mps: f64,
}

/// One fix as received. Angles in radians on the ellipsoid WGS 84.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fix {
    /// Receive time on the monotonic grid, ns.
    pub monotonic_ns: i64,
    /// UTC that it holds for as the receiver says, ns since 1970.
    pub utc_ns: Option<i64>,
    /// What it was made from.
    pub quality: FixQuality,
    /// Satellites in use.
    pub satellites: Option<u8>,
    /// Latitude and longitude, rad.
    pub position: Option<[f64; 2]>,
    /// Above the ellipsoid, m.
    pub height_m: Option<f64>,
    /// Over ground, m/s, 0 or more.
    pub speed_mps: Option<f64>,
    /// Over ground, rad clockwise from north.
    pub course: Option<f64>,
    /// Upwards, m/s.
    pub climb_mps: Option<f64>,
    /// Covariance that the receiver states: north-north, east-east, north-east, m^2.
    pub horizontal_m2: Option<[f64; 3]>,
    /// Standard deviation of the height that the receiver states, m.
    pub height_sd_m: Option<f64>,
    /// That of the speed, m/s.
    pub speed_sd_mps: Option<f64>,
    /// That of the course, rad.
    pub course_sd: Option<f64>,
    /// Horizontal dilution of precision.
    pub hdop: Option<f64>,
}

impl Fix {
    /// A fix of `quality` at `monotonic_ns` that says nothing else.
    #[must_use]
    pub fn new(monotonic_ns: i64, quality: FixQuality) -> Self {
        Self {
            monotonic_ns,
            utc_ns: None,
            quality,
            satellites: None,
            position: None,
            height_m: None,
            speed_mps: None,
            course: None,
            climb_mps: None,
            horizontal_m2: None,
            height_sd_m: None,
            speed_sd_mps: None,
            course_sd: None,
            hdop: None,
        }
    }
}

/// A sentence as it came.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Sentence {
    /// Receive time of its first byte on the monotonic grid, ns.
    pub monotonic_ns: i64,
    /// From `$` or `!` to the checksum, without the line's end; printable ASCII, at most 255 bytes.
    pub text: String,
}

/// The part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gnss {
    /// Receiver and antenna.
    pub sheet: GnssSheet,
    /// Fixes in order of their receive times.
    pub fixes: Vec<Fix>,
    /// Sentences in order of their receive times; none where the source is CAN, whose frames are among the raw ones.
    pub sentences: Vec<Sentence>,
}

impl Gnss {
    /// The body as `FORMAT.md`, 6.7, lays it down.
    ///
    /// # Errors
    /// A value that may not be stored, or more than [`limits::MAX_FIXES`] or [`limits::MAX_GNSS_BYTES`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, SchemaError> {
        check(self).map_err(|fault| fault.at(PLACE, None))?;
        let mut out = Vec::new();
        put(&mut out, self)?;
        Ok(out)
    }

    /// The part whose body `bytes` are.
    ///
    /// # Errors
    /// What `FORMAT.md`, 6.7, does not allow, with its place.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SchemaError> {
        let gnss = parse(bytes, 0)?;
        check(&gnss).map_err(|fault| fault.at(PLACE, Some(0)))?;
        Ok(gnss)
    }
}
