//! What the filter is told.

use super::constants::{EVERY, LATENCY, STOP_VARIANCE};
use super::error::PublishedError;
use super::variant::Variant;

/// Form of the filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Engine {
    /// Six chains, rows one at a time.
    #[default]
    Chains,
    /// The textbook's matrices.
    Dense,
}

/// How an exact speed enters. The source does not say [S00, 3.8].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpeedUse {
    /// The velocity is set to it, its direction kept; P stays.
    Set,
    /// The velocity in its own direction at that speed is a measurement of all three axes, of this standard deviation,
    /// m/s.
    Measure(f64),
}

/// An exact speed at each fix [S00, 3.8].
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedAid {
    /// Speed at each fix, m/s; one that is not finite is left out, as are those past the end.
    pub speeds: Vec<f64>,
    /// How it enters.
    pub how: SpeedUse,
}

/// What the filter is told.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Text, program, slips.
    pub variant: Variant,
    /// Fixes from one update to the next; `None`: no fix is used. It counts fixes, not seconds. With 1 the program's
    /// own condition is never met; here every fix is used.
    pub every: Option<usize>,
    /// In its place: which fixes are used, one flag each; the first never is.
    pub due: Option<Vec<bool>>,
    /// Bound of the stop detector on var(ax) + var(ay), (m/s^2)^2; `None`: off.
    pub stop: Option<f64>,
    /// Samples by which the fixes are late.
    pub latency: usize,
    /// Exact speeds.
    pub speed: Option<SpeedAid>,
    /// Form of the filter.
    pub engine: Engine,
    /// Whether each step keeps the whole of P.
    pub keep_covariance: bool,
}

impl Default for Options {
    /// The program's.
    fn default() -> Self {
        Self {
            variant: Variant::program(),
            every: Some(EVERY),
            due: None,
            stop: Some(STOP_VARIANCE),
            latency: LATENCY,
            speed: None,
            engine: Engine::Chains,
            keep_covariance: false,
        }
    }
}

impl Options {
    /// Numbers within their ranges.
    ///
    /// # Errors
    /// [`PublishedError::Option`].
    pub fn check(&self) -> Result<(), PublishedError> {
        let wrong = |option, expected, found: String| {
            Err(PublishedError::Option {
                option,
                expected,
                found,
            })
        };
        if self.every == Some(0) {
            return wrong("fixes from one update to the next", "1 or more", "0".into());
        }
        if let Some(bound) = self.stop
            && !(bound.is_finite() && bound >= 0.0)
        {
            return wrong("stop bound", "a number of 0 or more", bound.to_string());
        }
        if let Some(SpeedAid {
            how: SpeedUse::Measure(sd),
            ..
        }) = self.speed
            && !(sd.is_finite() && sd > 0.0)
        {
            return wrong(
                "speed's standard deviation",
                "a positive number",
                sd.to_string(),
            );
        }
        Ok(())
    }
}
