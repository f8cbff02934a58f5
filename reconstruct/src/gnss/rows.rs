//! What one line of each log holds [S00, 6.1 and 6.2], in SI units and radians.

use schema::units::STANDARD_GRAVITY;

use crate::gnss::time;

/// m/s^2 of a milli-g [S00, 3.1].
pub const MILLI_G: f64 = STANDARD_GRAVITY / 1000.0;
/// Millidegrees of a degree.
pub(super) const MILLI: f64 = 1000.0;

/// Which unit, on which drive, on which part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Leg {
    /// Equipment; 6 is the reference receiver [S00, 6.1, column 1].
    pub equipment: u32,
    /// Drive [S00, 6.1, column 2].
    pub drive: u32,
    /// Leg of the drive [S00, 6.1, column 3].
    pub leg: u32,
}

/// The first eight columns, the same in both logs: who and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Head {
    /// Equipment, drive and leg [S00, 6.1, columns 1 to 3].
    pub leg: Leg,
    /// UTC, ms since 1970-01-01 as POSIX counts them [S00, 6.1, columns 4 and 5].
    pub utc_ms: Option<i64>,
    /// GPS week, counted from 1980-01-06 [S00, 6.1, column 6].
    pub week: Option<u32>,
    /// GPS time of week, s, 0 to below 604800 [S00, 6.1, column 7].
    pub tow_s: Option<f64>,
    /// Clock of the on-board unit, s: what the two logs share [S00, 6.1, column 8].
    pub obu_s: f64,
}

impl Head {
    /// With the columns that every row has, and no other.
    #[must_use]
    pub fn bare(leg: Leg, obu_s: f64) -> Self {
        Self {
            leg,
            utc_ms: None,
            week: None,
            tow_s: None,
            obu_s,
        }
    }

    /// GPS time less UTC, s: the leap seconds, and what the two columns disagree by; `None` unless both are there.
    #[must_use]
    pub fn gps_minus_utc_s(&self) -> Option<f64> {
        Some(time::gps_minus_utc_s(self.week?, self.tow_s?, self.utc_ms?))
    }
}

/// A row of either log.
pub trait Row: Copy {
    /// The columns that both logs have.
    fn head(&self) -> &Head;
}

/// A fix of the satellite receiver: 35 columns [S00, 6.1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Who and when [S00, 6.1, columns 1 to 8].
    pub head: Head,
    /// True if the receiver calls the fix good [S00, 6.1, column 9].
    pub good: Option<bool>,
    /// Kind of fix, a number of the receiver's own [S00, 6.1, column 10].
    pub fix_type: Option<u32>,
    /// Geodetic latitude, rad, north positive (degrees in the file) [S00, 6.1, column 11].
    pub latitude: f64,
    /// Longitude, rad, east positive (degrees in the file) [S00, 6.1, column 12].
    pub longitude: f64,
    /// Height over the ellipsoid, m [S00, 6.1, column 13]; this or the next is there.
    pub ellipsoid_height: Option<f64>,
    /// Height over sea level, m [S00, 6.1, column 14].
    pub sea_height: Option<f64>,
    /// Speed over ground, m/s [S00, 6.1, column 15].
    pub speed: Option<f64>,
    /// Course over ground, rad clockwise from north, as in the file and not wrapped (degrees in the file)
    /// [S00, 6.1, column 16].
    pub course: Option<f64>,
    /// Yaw, rad/s; the file says degrees a second, axes and sign are not stated [S00, 6.1, column 17].
    pub yaw: Option<f64>,
    /// Pitch, rad/s, as yaw [S00, 6.1, column 18].
    pub pitch: Option<f64>,
    /// Roll, rad/s, as yaw [S00, 6.1, column 19].
    pub roll: Option<f64>,
    /// Horizontal position error as the receiver estimates it, m [S00, 6.1, column 20].
    pub horizontal_error: Option<f64>,
    /// Vertical position error as the receiver estimates it, m [S00, 6.1, column 21].
    pub vertical_error: Option<f64>,
    /// One sigma of the position north, east, down, m [S00, 6.1, columns 22 to 24].
    pub sd_ned: [Option<f64>; 3],
    /// Horizontal dilution of precision [S00, 6.1, column 25].
    pub hdop: Option<f64>,
    /// Position dilution of precision [S00, 6.1, column 26].
    pub pdop: Option<f64>,
    /// Velocity north, east, down, m/s; the log of the E6 has none
    /// [S00, 4.1] [S00, 6.1, columns 27 to 29].
    pub velocity_ned: Option<[f64; 3]>,
    /// Satellites in the solution [S00, 6.1, column 30].
    pub satellites: Option<u32>,
    /// Mean signal quality, unit not stated [S00, 6.1, column 31].
    pub signal: Option<f64>,
    /// True if corrections from a geostationary satellite (SBAS) are in use [S00, 6.1, column 32].
    pub sbas: Option<bool>,
    /// Bounds of integrity north, east, down, m [S00, 6.1, columns 33 to 35].
    pub integrity_ned: [Option<f64>; 3],
}

impl Fix {
    /// A place on the globe, rad, with no other column filled.
    #[must_use]
    pub fn bare(head: Head, latitude: f64, longitude: f64) -> Self {
        Self {
            head,
            latitude,
            longitude,
            good: None,
            fix_type: None,
            ellipsoid_height: None,
            sea_height: None,
            speed: None,
            course: None,
            yaw: None,
            pitch: None,
            roll: None,
            horizontal_error: None,
            vertical_error: None,
            sd_ned: [None; 3],
            hdop: None,
            pdop: None,
            velocity_ned: None,
            satellites: None,
            signal: None,
            sbas: None,
            integrity_ned: [None; 3],
        }
    }
}

impl Row for Fix {
    fn head(&self) -> &Head {
        &self.head
    }
}

/// A sample of the inertial sensors: 14 columns [S00, 6.2].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Who and when [S00, 6.2, columns 1 to 8].
    pub head: Head,
    /// Specific force along x, y, z of the sensor's own axes, m/s^2 (milli-g in the file)
    /// [S00, 6.2, columns 9 to 11]. [S00, 3.3] turns them half round about z for the axes of the car.
    pub accel: [f64; 3],
    /// Rotation about x, y, z of the same axes, rad/s (millidegrees a second in the file)
    /// [S00, 6.2, columns 12 to 14].
    pub rate: [f64; 3],
}

impl Motion {
    /// The specific force as the file has it, milli-g; within a few units in the last place of what was read.
    #[must_use]
    pub fn accel_milli_g(&self) -> [f64; 3] {
        self.accel.map(|a| a / MILLI_G)
    }

    /// The rates as the file has them, millidegrees a second.
    #[must_use]
    pub fn rate_milli_deg(&self) -> [f64; 3] {
        self.rate.map(|w| w.to_degrees() * MILLI)
    }
}

impl Row for Motion {
    fn head(&self) -> &Head {
        &self.head
    }
}

#[cfg(test)]
mod tests {
    use super::{Head, Leg, MILLI_G, Motion};

    #[test]
    fn raw_units_come_back() {
        let leg = Leg {
            equipment: 1,
            drive: 1,
            leg: 1,
        };
        let head = Head {
            leg,
            utc_ms: None,
            week: None,
            tow_s: None,
            obu_s: 0.0,
        };
        for raw in [
            -200_000.0,
            -1000.0,
            -0.001,
            0.0,
            3.904,
            999.999,
            16_000.0_f64,
        ] {
            let motion = Motion {
                head,
                accel: [raw * MILLI_G; 3],
                rate: [(raw / 1000.0).to_radians(); 3],
            };
            for back in [motion.accel_milli_g()[0], motion.rate_milli_deg()[2]] {
                assert!((back - raw).abs() <= 1e-12 * raw.abs(), "{raw} {back}");
            }
        }
        assert!((1000.0 * MILLI_G - 9.806_65).abs() < 1e-12);
        assert!(head.gps_minus_utc_s().is_none());
    }
}
