//! From the rows of the raw logs to what the filters take, and from a simulated drive to rows.

use nalgebra::Vector3;

use super::drive::{Drive, Fixed, LONGEST_HOLE_S, ReckonError, Speed, Stamped};
use super::forward::Estimate;
use super::published::matrices::{ATT, BIAS, POS, VEL};
use super::published::sensor::{Orientation, to_body};
use super::published::{GnssFix, ImuSample, Input, Step, Used};
use super::read::without_repeats;
use super::rows::{Fix, Head, Leg, MILLI_G, Motion};
use super::sheet::Sheet;
use super::time;
use crate::simulate::city::{BoxSheet, CityDrive, IMU_HZ};
use crate::simulate::tumble::Tumble;
use crate::wgs84::Geodetic;

/// How the sensors sit in the car.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axes {
    /// As the tags of S00 did, with the rotations of its program.
    Tag(Orientation),
    /// Along the car: x forward, y right, z down.
    Car,
}

impl Axes {
    /// Stamp, specific force and rate in the car's axes, SI.
    #[must_use]
    pub fn turned(&self, row: &Motion) -> Stamped {
        let (accel, rate) = match self {
            Self::Tag(orientation) => to_body(
                &Vector3::from(row.accel_milli_g()),
                &Vector3::from(row.rate_milli_deg()),
                orientation,
            ),
            Self::Car => (Vector3::from(row.accel), Vector3::from(row.rate)),
        };
        (row.head.obu_s, accel, rate)
    }

    /// The row of a specific force and a rate in the car's axes: the inverse of [`Self::turned`].
    #[must_use]
    pub fn row(&self, head: Head, accel: &Vector3<f64>, rate: &Vector3<f64>) -> Motion {
        let (accel, rate) = match self {
            Self::Tag(tag) => {
                // The program's milli-g are those of its own gravity and scale.
                let unit = Vector3::new(1.0, 0.0, 0.0);
                let scale = to_body(&unit, &Vector3::zeros(), tag).0.norm();
                (
                    tag.accel().transpose() * accel * (MILLI_G / scale),
                    -(tag.gyro().transpose() * rate),
                )
            }
            Self::Car => (*accel, *rate),
        };
        Motion {
            head,
            accel: accel.into(),
            rate: rate.into(),
        }
    }
}

/// Fixes as our filter takes them: good ones, `latency_s` taken off their stamps. What the receiver says of its errors is
/// kept where it says something; the sheet sets the least.
#[must_use]
pub fn fixes(rows: &[Fix], latency_s: f64, sheet: &Sheet) -> Vec<Fixed> {
    let course = |row: &Fix| Some((row.speed?, row.course?));
    without_repeats(rows)
        .iter()
        .filter(|row| row.good != Some(false))
        .map(|row| {
            let flat = row
                .horizontal_error
                .map_or(0.0, |e| e / std::f64::consts::SQRT_2);
            let said = [flat, flat, row.vertical_error.unwrap_or(0.0)];
            let v_n = row.velocity_ned.map(Vector3::from).or_else(|| {
                course(row).map(|(speed, course)| {
                    Vector3::new(speed * course.cos(), speed * course.sin(), 0.0)
                })
            });
            // A course says nothing of up and down: as unsure as a steep road.
            let down = match (row.velocity_ned, v_n) {
                (None, Some(v)) => 0.1 * v.norm() + 0.2,
                _ => 0.0,
            };
            Fixed {
                t_s: row.head.obu_s - latency_s,
                place: place(row),
                place_sd: Vector3::from_fn(|i, _| row.sd_ned[i].unwrap_or(said[i]))
                    .zip_map(&sheet.fix_floor, f64::max),
                v_n,
                v_sd: sheet.fix_speed_floor + Vector3::new(0.0, 0.0, down),
            }
        })
        .collect()
}

/// Place of a row; the height over the sea where that over the ellipsoid is not there, as in the source's program.
#[must_use]
pub fn place(row: &Fix) -> Geodetic {
    Geodetic {
        latitude: row.latitude,
        longitude: row.longitude,
        height: row.ellipsoid_height.or(row.sea_height).unwrap_or(0.0),
    }
}

/// Rows in the car's axes, each stamp once.
fn stamped(motions: &[Motion], axes: &Axes) -> Vec<Stamped> {
    without_repeats(motions)
        .iter()
        .map(|row| axes.turned(row))
        .collect()
}

/// A drive from both logs.
///
/// # Errors
/// [`ReckonError::Drive`]: see [`Drive::new`].
pub fn drive(
    motions: &[Motion],
    axes: &Axes,
    fixes: Vec<Fixed>,
    speeds: Vec<Speed>,
) -> Result<Drive, ReckonError> {
    Drive::new(&stamped(motions, axes), fixes, speeds)
}

/// The same where the samples have holes that no drive bridges ([`LONGEST_HOLE_S`]): the drives between them, in order. A fix
/// within a hole goes with the drive behind it; a single sample between two holes is of no drive.
///
/// # Errors
/// [`ReckonError::Drive`]: fewer than two samples without a hole between them, or stamps that do not rise.
pub fn drives(motions: &[Motion], axes: &Axes, fixes: &[Fixed]) -> Result<Vec<Drive>, ReckonError> {
    let samples = stamped(motions, axes);
    let mut out: Vec<Drive> = Vec::new();
    for list in samples.chunk_by(|a, b| b.0 - a.0 <= LONGEST_HOLE_S) {
        if list.len() > 1 {
            out.push(Drive::new(list, Vec::new(), Vec::new())?);
        }
    }
    let Some(last) = out.len().checked_sub(1) else {
        return Err(ReckonError::Drive {
            what: format!(
                "expected two inertial samples at most {LONGEST_HOLE_S} s apart, found none among {}",
                samples.len()
            ),
        });
    };
    let mut rest = fixes;
    for (i, drive) in out.iter_mut().enumerate() {
        let end = drive.span().map_or(f64::INFINITY, |s| s[1]);
        let own = if i == last {
            rest.len()
        } else {
            rest.partition_point(|f| f.t_s <= end)
        };
        let (mine, later) = rest.split_at(own);
        drive.fixes = mine.to_vec();
        rest = later;
    }
    Ok(out)
}

/// Least speed of a fix that either filter starts from, m/s [S00, 3.6].
const START_SPEED: f64 = 3.0;

/// Does a drive hold a fix that a filter can start from?
///
/// # Errors
/// [`ReckonError::Drive`] with what its fixes lack: that there are any, the time of the samples, a velocity, speed.
pub fn startable(drive: &Drive) -> Result<(), ReckonError> {
    let fail = |what: String| Err(ReckonError::Drive { what });
    let (Some(a), Some(b)) = (drive.fixes.first(), drive.fixes.last()) else {
        return fail("expected fixes that the receiver does not call bad, found none".to_owned());
    };
    let [begin, end] = drive.span().unwrap_or([f64::INFINITY, f64::NEG_INFINITY]);
    let within: Vec<&Fixed> = drive
        .fixes
        .iter()
        .filter(|f| f.t_s >= begin && f.t_s <= end + 1e-6)
        .collect();
    if within.is_empty() {
        return fail(format!(
            "expected fixes within the time of the inertial samples, {begin:.2} to {end:.2} s, found {} from {:.2} to {:.2} s, their delay taken off",
            drive.fixes.len(),
            a.t_s,
            b.t_s
        ));
    }
    let speeds = within.iter().filter_map(|f| Some(f.v_n?.xy().norm()));
    match speeds.reduce(f64::max) {
        None => fail(format!(
            "expected fixes with a velocity, or a speed and a course, found none of {} within the drive",
            within.len()
        )),
        Some(fastest) if fastest < START_SPEED => fail(format!(
            "expected a fix that moves at {START_SPEED} m/s or more to start from, found none of {} within the drive, the fastest at {fastest:.2} m/s",
            within.len()
        )),
        Some(_) => Ok(()),
    }
}

/// The same as the published filter takes it; fixes without velocity are left out.
#[must_use]
pub fn published(motions: &[Motion], axes: &Axes, rows: &[Fix]) -> Input {
    let fixes = without_repeats(rows);
    let samples = without_repeats(motions);
    Input {
        fixes: fixes
            .iter()
            .filter_map(|row| {
                Some(GnssFix {
                    t_s: row.head.obu_s,
                    lat: row.latitude,
                    lon: row.longitude,
                    height: row.sea_height.or(row.ellipsoid_height)?,
                    v_ned: Vector3::from(row.velocity_ned?),
                })
            })
            .collect(),
        motions: samples
            .iter()
            .map(|row| {
                let (t_s, accel_b, rate_b) = axes.turned(row);
                ImuSample {
                    t_s,
                    accel_b,
                    rate_b,
                }
            })
            .collect(),
    }
}

/// Steps of the published filter as estimates, at the instants they tell of, s. Its axes of place and velocity are those of the
/// Earth and know nothing of one another (3.3), so its variances turn with them; those of its angles are its own.
#[must_use]
pub fn track(steps: &[Step], latency_s: f64) -> Vec<Estimate> {
    let of = |step: &Step| {
        let place = Geodetic {
            latitude: step.lat,
            longitude: step.lon,
            height: step.height,
        };
        let to_local = place.c_en().transpose();
        let mut p = nalgebra::SMatrix::<f64, 9, 9>::zeros();
        for axes in [POS, VEL] {
            let own = step.variances.fixed_rows::<3>(axes).into_owned();
            let turned = to_local * nalgebra::Matrix3::from_diagonal(&own) * to_local.transpose();
            p.fixed_view_mut::<3, 3>(axes, axes).copy_from(&turned);
        }
        for i in ATT..ATT + 3 {
            p[(i, i)] = step.variances[i];
        }
        let angles = step.angles();
        let of_bias = |i: usize| step.variances[BIAS + i].max(0.0).sqrt();
        Estimate {
            t_s: step.t_s - latency_s,
            place,
            v_n: to_local * step.velocity(),
            angles: [
                angles.x,
                angles.y,
                angles.z.rem_euclid(std::f64::consts::TAU),
            ],
            p,
            rate_bias: step.bias(),
            rate_bias_sd: Vector3::from_fn(|i, _| of_bias(i)),
            standing: step.used == Used::Stop,
            fixed: step.used == Used::Gnss,
        }
    };
    steps.iter().map(of).collect()
}

/// The speed when each fix was true, to half a second; NaN, which the published filter leaves out, where there is none.
#[must_use]
pub fn speed_at_fixes(fixes: &[GnssFix], speeds: &[Speed], latency_s: f64) -> Vec<f64> {
    fixes
        .iter()
        .map(|fix| {
            let t = fix.t_s - latency_s;
            let at = speeds.partition_point(|s| s.t_s < t - 0.5);
            speeds
                .get(at)
                .filter(|s| (s.t_s - t).abs() <= 0.5)
                .map_or(f64::NAN, |s| s.speed)
        })
        .collect()
}

/// First moment of a simulated log, ms since 1970: the day of the source's first drive, ten o'clock.
const START_MS: i64 = 1_377_511_200_000;
/// GPS time less UTC then, s.
const LEAP_S: i32 = 16;
/// The on-board unit's clock at that moment, s.
const OBU_S: f64 = 1000.0;
/// Equipment of the box and of the reference receiver.
const BOX: u32 = 2;
const REFERENCE: u32 = 6;

/// A simulated drive as logs: fixes and motions of the box, fixes of a reference receiver without error or delay, one a
/// second.
#[must_use]
pub fn rows(city: &CityDrive, sheet: &BoxSheet, axes: &Axes) -> (Vec<Fix>, Vec<Motion>, Vec<Fix>) {
    let fix = |equipment: u32,
               [t_s, late_s]: [f64; 2],
               place: &Geodetic,
               v: &Vector3<f64>,
               sd: Option<[f64; 3]>| Fix {
        good: Some(true),
        fix_type: Some(3),
        ellipsoid_height: Some(place.height),
        sea_height: Some(place.height),
        speed: Some(v.xy().norm()),
        course: Some(v.y.atan2(v.x).rem_euclid(std::f64::consts::TAU)),
        horizontal_error: sd.map(|sd| sd[0].hypot(sd[1])),
        vertical_error: sd.map(|sd| sd[2]),
        sd_ned: sd.map_or([None; 3], |sd| sd.map(Some)),
        velocity_ned: Some((*v).into()),
        sbas: Some(false),
        ..Fix::bare(
            head(equipment, t_s, late_s),
            place.latitude,
            place.longitude,
        )
    };
    let fixes = city.fixes.iter();
    let truth = city.truth.iter().step_by(IMU_HZ);
    (
        fixes
            .map(|f| {
                fix(
                    BOX,
                    [f.t_s - sheet.latency_s, sheet.latency_s],
                    &f.place,
                    &f.v_n,
                    Some(sheet.fix),
                )
            })
            .collect(),
        city.samples
            .iter()
            .map(|s| axes.row(head(BOX, s.t_s, 0.0), &s.accel, &s.rate))
            .collect(),
        truth
            .map(|t| fix(REFERENCE, [t.t_s, 0.0], &t.place, &t.v_n, None))
            .collect(),
    )
}

/// A simulated box on its sides as a log of motions, in the sensor's own axes.
#[must_use]
pub fn positions(tumble: &Tumble) -> Vec<Motion> {
    let samples = tumble.samples.iter();
    samples
        .map(|s| Axes::Car.row(head(BOX, s.t_s, 0.0), &s.accel, &s.rate))
        .collect()
}

/// Of a row that was true at `t_s` and came `late_s` later.
fn head(equipment: u32, t_s: f64, late_s: f64) -> Head {
    let utc_ms = START_MS + schema::num::round_i64(1000.0 * t_s);
    let gps = time::gps_time(utc_ms, LEAP_S);
    let leg = Leg {
        equipment,
        drive: 1,
        leg: 1,
    };
    Head {
        utc_ms: Some(utc_ms),
        week: gps.map(|g| g.week),
        tow_s: gps.map(|g| g.tow_s),
        ..Head::bare(leg, OBU_S + t_s + late_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_there_and_back() {
        let (accel, rate) = (Vector3::new(1.0, -2.0, -9.7), Vector3::new(0.01, -0.2, 0.5));
        for axes in [Axes::Tag(Orientation::default()), Axes::Car] {
            let row = axes.row(head(2, 3.0, 0.0), &accel, &rate);
            let (t_s, a, w) = axes.turned(&row);
            assert!((t_s - 1003.0).abs() < 1e-9);
            assert!((a - accel).norm() < 1e-9 && (w - rate).norm() < 1e-12);
        }
    }
}
