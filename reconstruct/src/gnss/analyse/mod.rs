//! What logs of a box tell of its receivers and sensors: chapter 4 of S00 for any logs in its formats.
//!
//! 1. [`receiver`]: deviation from a reference receiver, delay, stated accuracy [S00, tables 4.1 to 4.3].
//! 2. [`spread`]: variances at rest, at stops, driving [S00, tables 4.4 and 4.5], and gyro bias by stop [S00, table 4.6].
//! 3. [`positions`]: the accelerometer in six positions [S00, table 4.7].
//! 4. [`limits`]: outputs that wrap or are held at their limit [S00, 5.2].
//! 5. [`allan`]: Allan deviation over the still spans.
//!
//! [`spans`] cuts the log; [`correlated`] and [`distribution`] are the statistics; [`source`] has S00's figures.
//! [`tables`] puts all of it in words and tables, which [`page`] lays on a page and `gnss analyse` prints; [`json`] is for programs.
//!
//! Every figure has the interval of 95 % that the samples leave, their correlation in time allowed for. What cannot be told is
//! said in a sentence in its place.

pub mod allan;
pub mod correlated;
pub mod distribution;
pub mod json;
pub mod limits;
pub mod page;
pub mod pictures;
mod plot;
pub mod positions;
mod range_tables;
pub mod receiver;
pub mod reference;
mod sensor_tables;
mod signal_pictures;
pub mod source;
pub mod spans;
pub mod spread;
pub mod tables;

use super::logs::Axes;
use super::rows::{Fix, Motion};
use allan::Allan;
use limits::Event;
use positions::Table;
use receiver::Receiver;
use spans::Spans;
use spread::{Bias, Drift, Spread};

/// Equipment of the reference receiver [S00, 6.1, column 1].
pub const REFERENCE: u32 = 6;

/// The logs; any may be empty.
#[derive(Clone, Copy, Debug)]
pub struct Logs<'a> {
    /// Fixes of one receiver or several, by leg and stamp.
    pub fixes: &'a [Fix],
    /// Inertial samples of one equipment with their lines in the file, by leg and stamp.
    pub motions: &'a [(u64, Motion)],
    /// Fixes of a reference receiver.
    pub reference: &'a [Fix],
}

/// How they are to be read.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Axes of the inertial sensors, for the stop detector; all figures are of the sensor's own axes.
    pub axes: Axes,
    /// Delay of the fixes behind the inertial samples, s, for the stop detector.
    pub latency_s: f64,
    /// Spans of rest with the engine off, s of the box's clock.
    pub rest: Vec<[f64; 2]>,
    /// Latitude, rad, where the fixes do not tell it.
    pub latitude: Option<f64>,
}

impl Settings {
    /// Of logs of which no rest and no latitude is known.
    #[must_use]
    pub fn new(axes: Axes, latency_s: f64) -> Self {
        Self {
            axes,
            latency_s,
            rest: Vec::new(),
            latitude: None,
        }
    }
}

/// What the logs tell. An `Err` is a sentence why a part is not told.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// By receiver and leg.
    pub receivers: Result<Vec<Result<Receiver, String>>, String>,
    /// The inertial log cut into stands and drives.
    pub spans: Spans,
    /// Variances by situation.
    pub spreads: Result<Vec<Spread>, String>,
    /// Gyro bias by stand.
    pub biases: Result<Vec<Bias>, String>,
    /// Whether they drift, x, y, z; `None` of fewer than two stands.
    pub drifts: [Option<Drift>; 3],
    /// The accelerometer's positions.
    pub positions: Result<Table, String>,
    /// Ends of the range.
    pub events: Result<Vec<Event>, String>,
    /// Allan deviations.
    pub allan: Result<Allan, String>,
}

/// Everything the logs tell.
#[must_use]
pub fn analyse(logs: &Logs<'_>, settings: &Settings) -> Analysis {
    let receivers = receiver::receivers(logs.fixes, logs.reference, REFERENCE);
    let spans = Spans::cut(
        logs.motions,
        logs.fixes,
        &settings.axes,
        settings.latency_s,
        &settings.rest,
    );
    let untold = if logs.motions.is_empty() {
        Some("Cannot tell: no log of motions.")
    } else if spans.stretches.is_empty() {
        Some("Cannot tell: fewer than two inertial samples without a long gap.")
    } else {
        None
    };
    let told = |ok: bool, why: &str| match untold {
        Some(sentence) => Err(sentence.to_owned()),
        None if !ok => Err(why.to_owned()),
        None => Ok(()),
    };
    // Without fixes the detector asks for less vibration than an engine makes.
    let [never_stands, never_lies] = if logs.fixes.is_empty() {
        ["Cannot tell: no two seconds are still enough to be told from slow driving without fixes (--fixes, or --rest for spans with the engine off).";
            2]
    } else {
        [
            "Cannot tell: the box never stands still for two seconds.",
            "Cannot tell: the box never lies still for two seconds.",
        ]
    };
    let biases = told(!spans.stands.is_empty(), never_stands).map(|()| spread::biases(&spans));
    let drifts = [0, 1, 2].map(|axis| {
        let list = biases.as_ref().ok()?;
        spread::drift(&list.iter().map(|b| b.rate[axis]).collect::<Vec<_>>())
    });
    let latitude = settings.latitude.or_else(|| {
        logs.fixes
            .first()
            .or(logs.reference.first())
            .map(|f| f.latitude)
    });
    Analysis {
        receivers,
        spreads: told(true, "").map(|()| spread::spreads(&spans)),
        positions: told(!spans.stands.is_empty(), never_lies)
            .map(|()| positions::table(&spans, latitude)),
        events: told(true, "").map(|()| limits::events(&spans)),
        allan: told(true, "").and_then(|()| allan::allan(&spans)),
        biases,
        drifts,
        spans,
    }
}

impl Analysis {
    /// True where a log that was given did not tell what it ought to, or a sensor came to the end of its range.
    #[must_use]
    pub fn gaps(&self, logs: &Logs<'_>) -> bool {
        let receivers = match &self.receivers {
            Ok(list) => list.iter().any(Result::is_err),
            Err(_) => !logs.reference.is_empty(),
        };
        let motions = !logs.motions.is_empty()
            && (self.spreads.is_err()
                || self.biases.is_err()
                || self.allan.is_err()
                || self.events.as_ref().map_or(true, |e| !e.is_empty())
                || !self.spans.notes.is_empty()
                || self.half_done());
        receivers || motions
    }

    /// True of a log of some positions and not all of them.
    #[must_use]
    pub fn half_done(&self) -> bool {
        self.positions.as_ref().is_ok_and(|t| {
            t.calibration.is_err() && t.positions.iter().filter(|p| p.reading.is_some()).count() > 1
        })
    }
}
