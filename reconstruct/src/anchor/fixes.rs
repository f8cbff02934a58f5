//! What of a record's fixes can be used: when each held, how sure it is, and why others are left out.

use nalgebra::{Matrix2, Vector2, Vector3};
use schema::Record;
use schema::gnss::{Fix, FixQuality, Gnss};
use schema::num::real_i64;

use super::CLOSEST_S;
use crate::constraint::Geometry;

/// After the onset of an impact a receiver's own filter goes on with the motion before it for so long, s.
const AFTER_IMPACT_S: f64 = 3.0;
/// Least spread of north and east each, m: of a fix with whole carrier cycles, with floating ones, of every other.
const FLOOR_M: [f64; 3] = [0.05, 0.4, 1.0];
/// Least spread of a velocity, m/s.
const SPEED_FLOOR: f64 = 0.1;
/// Share of the variance of a fix that stays the same for [`SLOW_S`]: atmosphere and reflections.
const SLOW_SHARE: f64 = 0.8;
/// How long, s.
const SLOW_S: f64 = 60.0;
/// How long an error of the velocity stays the same, s: what a receiver's own filter does.
const SPEED_SLOW_S: f64 = 0.5;
/// Where the antenna is not said to be: one sigma along each horizontal axis of the car, m.
const UNKNOWN_ANTENNA_SD: f64 = 1.5;

/// Why a fix takes no part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Left {
    /// The receiver says that it has none, or gives no place.
    NoFix,
    /// By hand, simulated, or the receiver's own dead reckoning.
    NotMeasured,
    /// Within three seconds of an impact: a receiver's own filter does not follow.
    AfterImpact,
    /// Outside the samples.
    Outside,
    /// It lies off the path by more than both allow.
    Off,
    /// It came within 50 ms of the one before.
    TooClose,
}

impl Left {
    /// Every reason.
    pub const ALL: [Self; 6] = [
        Self::NoFix,
        Self::NotMeasured,
        Self::AfterImpact,
        Self::Outside,
        Self::Off,
        Self::TooClose,
    ];

    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NoFix => "no fix",
            Self::NotMeasured => "not measured",
            Self::AfterImpact => "within 3 s of an impact",
            Self::Outside => "outside the samples",
            Self::Off => "off the path",
            Self::TooClose => "within 50 ms of another",
        }
    }
}

/// A fix that can be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usable {
    /// Its number in the record.
    pub number: usize,
    /// Instant it holds for, seconds from the first trigger.
    pub t_s: f64,
    /// Latitude and longitude, degrees.
    pub degrees: [f64; 2],
    /// Covariance of north and east, m^2, as the receiver or the sheet has it.
    pub covariance: Matrix2<f64>,
    /// North and east, m/s, and the sd of each.
    pub velocity: Option<(Vector2<f64>, f64)>,
}

/// The clock of the fixes against the recorder's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// UTC less monotonic by the fixes, ns, with the sheet's latency.
    pub offset_ns: i64,
    /// Spread of the single fixes about it, s.
    pub scatter_s: f64,
    /// Fixes with a time.
    pub fixes: usize,
}

/// What was heard of satellites.
#[derive(Clone, Debug)]
pub struct Heard {
    /// Usable ones in order of time.
    pub fixes: Vec<Usable>,
    /// The others by number.
    pub left: Vec<(usize, Left)>,
    /// All.
    pub offered: usize,
    /// IMU to antenna, body axes, m.
    pub lever: Vector3<f64>,
    /// What the place of the antenna adds to the covariance of a fix, m^2.
    pub lever_doubt: Matrix2<f64>,
    /// The place of the antenna was given.
    pub antenna_known: bool,
    /// One sigma of the latency, s.
    pub lag_sd: f64,
    /// The clock; `None`: no fix has a time.
    pub clock: Option<Clock>,
}

/// So many fixes of this distance in time count as one, as a factor of the variance.
#[must_use]
pub fn widened(since_s: f64) -> f64 {
    let counts = (2.0 * SLOW_S / since_s.max(CLOSEST_S)).max(1.0);
    SLOW_SHARE * counts + 1.0 - SLOW_SHARE
}

/// The same of a velocity.
#[must_use]
pub fn widened_speed(since_s: f64) -> f64 {
    (2.0 * SPEED_SLOW_S / since_s.max(CLOSEST_S)).max(1.0)
}

/// Looks through the fixes of a record. `onsets` are those of the impacts, `span` is the time of the samples, seconds from the first trigger.
#[must_use]
pub fn hear(record: &Record, gnss: &Gnss, onsets: &[f64], span: [f64; 2]) -> Heard {
    let sheet = &gnss.sheet;
    let zero = record.zero_ns();
    let geometry = Geometry::new(&record.header.vehicle);
    let (lever, sd) = match sheet.antenna_position_m {
        Some(place) => (
            Vector3::from(place) - geometry.imu,
            Vector3::from(sheet.antenna_position_sd_m).map(|s| s.max(0.0)),
        ),
        None => (Vector3::zeros(), Vector3::repeat(UNKNOWN_ANTENNA_SD)),
    };
    let doubt = sd.zip_map(&geometry.imu_sd, f64::hypot);
    // The car turns under it: half of the sum of both axes, each way.
    let lever_doubt = Matrix2::identity() * (0.5 * (doubt.x.powi(2) + doubt.y.powi(2)));
    let clock = clock(gnss);
    let mut heard = Heard {
        fixes: Vec::new(),
        left: Vec::new(),
        offered: gnss.fixes.len(),
        lever,
        lever_doubt,
        antenna_known: sheet.antenna_position_m.is_some(),
        lag_sd: sheet.latency_sd_s,
        clock,
    };
    for (number, fix) in gnss.fixes.iter().enumerate() {
        // A fix with a time holds at that time by the common offset: the jitter of the line is out of it.
        let monotonic = match (fix.utc_ns, clock) {
            (Some(utc), Some(clock)) => {
                real_i64(utc.saturating_sub(clock.offset_ns).saturating_sub(zero)) * 1e-9
            }
            _ => real_i64(fix.monotonic_ns.saturating_sub(zero)) * 1e-9 - sheet.latency_s,
        };
        match usable(number, fix, gnss, monotonic, onsets, span) {
            Ok(fix) => heard.fixes.push(fix),
            Err(why) => heard.left.push((number, why)),
        }
    }
    heard.fixes.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    heard
}

fn usable(
    number: usize,
    fix: &Fix,
    gnss: &Gnss,
    t_s: f64,
    onsets: &[f64],
    span: [f64; 2],
) -> Result<Usable, Left> {
    let Some([latitude, longitude]) = fix.position.filter(|_| fix.quality != FixQuality::None)
    else {
        return Err(Left::NoFix);
    };
    if !fix.quality.is_measured() {
        return Err(Left::NotMeasured);
    }
    if !(span[0]..=span[1]).contains(&t_s) {
        return Err(Left::Outside);
    }
    let after = |onset: f64| (0.0..AFTER_IMPACT_S).contains(&(t_s - onset));
    if onsets.iter().any(|onset| after(*onset)) {
        return Err(Left::AfterImpact);
    }
    let sheet = &gnss.sheet;
    let floor = match fix.quality {
        FixQuality::RtkFixed => FLOOR_M[0],
        FixQuality::RtkFloat => FLOOR_M[1],
        _ => FLOOR_M[2],
    };
    let covariance = fix.horizontal_m2.map_or_else(
        || {
            let sd = sheet.horizontal_sd_m * fix.hdop.unwrap_or(1.0).max(1.0);
            Matrix2::identity() * sd * sd
        },
        |[n, e, ne]| Matrix2::new(n, ne, ne, e),
    );
    let velocity = fix.speed_mps.zip(fix.course).map(|(speed, course)| {
        let (s, c) = course.sin_cos();
        let across = fix.course_sd.map_or(0.0, |sd| sd.min(1.0) * speed);
        let along = fix.speed_sd_mps.unwrap_or(sheet.speed_sd_mps);
        (
            Vector2::new(speed * c, speed * s),
            along.max(across).max(SPEED_FLOOR),
        )
    });
    Ok(Usable {
        number,
        t_s,
        degrees: [latitude.to_degrees(), longitude.to_degrees()],
        covariance: covariance
            + Matrix2::identity() * (floor * floor - least(&covariance)).max(0.0),
        velocity,
    })
}

/// Smaller eigenvalue.
fn least(m: &Matrix2<f64>) -> f64 {
    let (half, det) = (0.5 * m.trace(), m.determinant());
    half - (half * half - det).max(0.0).sqrt()
}

fn clock(gnss: &Gnss) -> Option<Clock> {
    let latency = schema::num::round_i64(gnss.sheet.latency_s * 1e9);
    let mut offsets: Vec<i64> = gnss
        .fixes
        .iter()
        .filter(|f| f.quality.is_measured())
        .filter_map(|f| {
            Some(
                f.utc_ns?
                    .saturating_sub(f.monotonic_ns.saturating_sub(latency)),
            )
        })
        .collect();
    offsets.sort_unstable();
    let offset_ns = *offsets.get(offsets.len() / 2)?;
    let mut off: Vec<f64> = offsets
        .iter()
        .map(|o| real_i64(o.saturating_sub(offset_ns)).abs() * 1e-9)
        .collect();
    off.sort_by(f64::total_cmp);
    Some(Clock {
        offset_ns,
        scatter_s: 1.4826 * off[off.len() / 2],
        fixes: offsets.len(),
    })
}
