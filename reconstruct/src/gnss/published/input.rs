//! What the filter takes: fixes, inertial samples, and where it starts.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::constants::GYRO_BIAS;
use super::error::PublishedError;

/// A fix of the satellite receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssFix {
    /// Time, s.
    pub t_s: f64,
    /// Latitude, rad, north positive.
    pub lat: f64,
    /// Longitude, rad, east positive.
    pub lon: f64,
    /// Height, m (the program takes column 14 of [S00, 6.1], above the sea).
    pub height: f64,
    /// Velocity north, east, down, m/s.
    pub v_ned: Vector3<f64>,
}

/// A sample of accelerometers and gyros, in body axes (x forward, y right, z down); see [`super::sensor::to_body`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Time, s, of the same clock as the fixes'.
    pub t_s: f64,
    /// Specific force, m/s^2.
    pub accel_b: Vector3<f64>,
    /// Rate, rad/s.
    pub rate_b: Vector3<f64>,
}

/// Both, in the order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Input {
    /// Fixes, about one a second.
    pub fixes: Vec<GnssFix>,
    /// Inertial samples, 50 a second.
    pub motions: Vec<ImuSample>,
}

impl Input {
    /// Two fixes and a sample at least, finite numbers, times that do not go back.
    ///
    /// # Errors
    /// [`PublishedError::TooFew`], [`PublishedError::NotFinite`], [`PublishedError::Order`].
    pub fn check(&self) -> Result<(), PublishedError> {
        let enough = |what, needed, found| {
            if found < needed {
                return Err(PublishedError::TooFew {
                    what,
                    needed,
                    found,
                });
            }
            Ok(())
        };
        enough("fixes", 2, self.fixes.len())?;
        enough("inertial samples", 1, self.motions.len())?;
        for (index, fix) in self.fixes.iter().enumerate() {
            let place = [fix.t_s, fix.lat, fix.lon, fix.height];
            if !place.iter().chain(fix.v_ned.iter()).all(|x| x.is_finite()) {
                return Err(PublishedError::NotFinite { what: "fix", index });
            }
        }
        for (index, sample) in self.motions.iter().enumerate() {
            let values = sample.accel_b.iter().chain(sample.rate_b.iter());
            if !(sample.t_s.is_finite() && values.into_iter().all(|x| x.is_finite())) {
                return Err(PublishedError::NotFinite {
                    what: "inertial sample",
                    index,
                });
            }
        }
        in_order("fix", self.fixes.iter().map(|fix| fix.t_s))?;
        in_order("inertial sample", self.motions.iter().map(|m| m.t_s))
    }
}

fn in_order(what: &'static str, times: impl Iterator<Item = f64>) -> Result<(), PublishedError> {
    let mut previous_s = f64::NEG_INFINITY;
    for (index, found_s) in times.enumerate() {
        if found_s < previous_s {
            return Err(PublishedError::Order {
                what,
                index,
                previous_s,
                found_s,
            });
        }
        previous_s = found_s;
    }
    Ok(())
}

/// Where the filter starts. The rates start at the gyros' at the first fix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Initial {
    /// Latitude, rad.
    pub lat: f64,
    /// Longitude, rad.
    pub lon: f64,
    /// Height, m.
    pub height: f64,
    /// Velocity north, east, down, m/s.
    pub v_ned: Vector3<f64>,
    /// Roll, rad.
    pub roll: f64,
    /// Pitch, rad.
    pub pitch: f64,
    /// Yaw, rad.
    pub yaw: f64,
    /// Gyro biases about x, y, z, rad/s.
    pub bias: Vector3<f64>,
}

impl Initial {
    /// As the program starts: the place of the first fix; velocity, pitch and yaw of the reference receiver's velocity
    /// `v_ref` (north, east, down, m/s); no roll; the biases of [`GYRO_BIAS`]. The text (3.7) starts from the
    /// velocity of the fix instead: hand in `fix.v_ned`.
    #[must_use]
    pub fn from_reference(fix: &GnssFix, v_ref: &Vector3<f64>) -> Self {
        Self {
            lat: fix.lat,
            lon: fix.lon,
            height: fix.height,
            v_ned: *v_ref,
            roll: 0.0,
            pitch: (-v_ref.z).atan2((v_ref.x * v_ref.x + v_ref.y * v_ref.y).sqrt()),
            yaw: v_ref.y.atan2(v_ref.x).rem_euclid(TAU),
            bias: Vector3::from(GYRO_BIAS),
        }
    }

    /// Finite numbers.
    ///
    /// # Errors
    /// [`PublishedError::NotFinite`].
    pub fn check(&self) -> Result<(), PublishedError> {
        let scalars = [
            self.lat,
            self.lon,
            self.height,
            self.roll,
            self.pitch,
            self.yaw,
        ];
        let vectors = self.v_ned.iter().chain(self.bias.iter());
        if scalars.iter().chain(vectors).all(|x| x.is_finite()) {
            return Ok(());
        }
        Err(PublishedError::NotFinite {
            what: "initial state",
            index: 0,
        })
    }
}
