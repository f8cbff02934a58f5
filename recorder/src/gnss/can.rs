//! Signals of a CAN bus become fixes.
//!
//! A fix is a latitude and a longitude of one epoch. Where both stand in one frame that is sure. Where they come in two
//! frames they are halves of one epoch if they came within the *window* of each other: `[gnss] pair_ms`, or half of the
//! latitude's period if that is less, so that the nearest of the neighbouring epochs is always further away than the
//! epoch's own. A half that meets no other is dropped and counted, never completed by one of another epoch.
//!
//! Height, speed, course, climb and UTC belong to the fix if they came within the window of its first half, before or
//! after. What changes slowly and comes in slower messages (validity, quality, satellites, dilution, standard
//! deviations) is taken up to two seconds old. A fix is given when its window is over.
//!
//! A value that is marked as none, by a number outside the range that the DBC states or by no number at all, comes here
//! as NaN: a position without one is "no fix", any other is missing.

use schema::gnss::{Fix, FixQuality};
use schema::num;

use crate::config::Condition;
use crate::nmea::nearest_day;
use crate::pace::Pace;

use super::Arrivals;
use super::tally::Tally;

/// Slow signals are taken up to this age, ns.
const SLOW_NS: i64 = 2_000_000_000;
/// No car is faster over ground, m/s, climbs or falls faster, m/s, or is lower or higher, m: what senders send that have
/// no value is.
const FASTEST: f64 = 150.0;
const STEEPEST: f64 = 100.0;
const LOWEST: f64 = -1000.0;
const HIGHEST: f64 = 20_000.0;
/// Courses are sent from 0 to a turn, or half a turn either way; rounding may go beyond.
const MOST_COURSE: f64 = 1.001 * std::f64::consts::TAU;

/// What a signal says of a fix. Values come in SI and radians, times in ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Latitude.
    Latitude,
    /// Longitude.
    Longitude,
    /// Above the ellipsoid.
    Height,
    /// Over ground.
    Speed,
    /// Clockwise from north.
    Course,
    /// Upwards.
    Climb,
    /// Velocity northwards.
    VelocityNorth,
    /// Velocity eastwards.
    VelocityEast,
    /// Velocity downwards.
    VelocityDown,
    /// UTC since 1970.
    Utc,
    /// UTC since midnight.
    TimeOfDay,
    /// By the numbers of GGA.
    Quality,
    /// Whether there is a fix at all.
    Valid,
    /// In use.
    Satellites,
    /// Horizontal dilution of precision.
    Hdop,
    /// Of north and east each.
    HorizontalSd,
    /// Of the height.
    HeightSd,
    /// Of the speed.
    SpeedSd,
    /// Of the course.
    CourseSd,
}

impl Field {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 19] = [
        Self::Latitude,
        Self::Longitude,
        Self::Height,
        Self::Speed,
        Self::Course,
        Self::Climb,
        Self::VelocityNorth,
        Self::VelocityEast,
        Self::VelocityDown,
        Self::Utc,
        Self::TimeOfDay,
        Self::Quality,
        Self::Valid,
        Self::Satellites,
        Self::Hdop,
        Self::HorizontalSd,
        Self::HeightSd,
        Self::SpeedSd,
        Self::CourseSd,
    ];

    /// Its key in the configuration.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Latitude => "latitude",
            Self::Longitude => "longitude",
            Self::Height => "height",
            Self::Speed => "speed",
            Self::Course => "course",
            Self::Climb => "climb",
            Self::VelocityNorth => "v_north",
            Self::VelocityEast => "v_east",
            Self::VelocityDown => "v_down",
            Self::Utc => "utc",
            Self::TimeOfDay => "time_of_day",
            Self::Quality => "quality",
            Self::Valid => "valid",
            Self::Satellites => "satellites",
            Self::Hdop => "hdop",
            Self::HorizontalSd => "horizontal_sd",
            Self::HeightSd => "height_sd",
            Self::SpeedSd => "speed_sd",
            Self::CourseSd => "course_sd",
        }
    }

    /// Its place in [`Field::ALL`].
    #[must_use]
    pub fn number(self) -> usize {
        Self::ALL
            .iter()
            .position(|field| *field == self)
            .unwrap_or(0)
    }
}

/// How signals are put together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Frames of one epoch come within this of each other, ns.
    pub pair_ns: i64,
    /// When the signal `valid` says that there is a fix; `None` without that signal.
    pub valid: Option<Condition>,
    /// The signal `quality` is mapped.
    pub quality: bool,
}

/// A value and when it came.
type Held = Option<(i64, f64)>;

/// A latitude and a longitude of one epoch.
#[derive(Clone, Copy, Debug)]
struct Pair {
    first_ns: i64,
    latitude: f64,
    longitude: f64,
}

/// Makes fixes of signals. Times are monotonic, ns.
#[derive(Clone, Debug)]
pub struct Assembler {
    rules: Rules,
    held: [Held; Field::ALL.len()],
    tallies: [Tally; Field::ALL.len()],
    /// Latitude and longitude that are still alone.
    halves: [Held; 2],
    open: Option<Pair>,
    pace: Pace,
    /// UTC minus monotonic time by the recorder's clock, ns.
    pub clock_offset_ns: i64,
    /// Halves that met no other.
    pub halved: u64,
    /// Values that are none: marked so, a latitude beyond the pole, a negative speed.
    pub absurd: u64,
}

impl Assembler {
    /// With nothing received.
    #[must_use]
    pub fn new(rules: Rules) -> Self {
        Self {
            rules,
            held: [None; Field::ALL.len()],
            tallies: [Tally::default(); Field::ALL.len()],
            halves: [None; 2],
            open: None,
            pace: Pace::new(),
            clock_offset_ns: 0,
            halved: 0,
            absurd: 0,
        }
    }

    /// How often a signal arrives with a value.
    #[must_use]
    pub fn arrivals(&self, field: Field) -> Arrivals {
        let tally = self.tallies.get(field.number()).copied();
        tally.unwrap_or_default().arrivals(field.key())
    }

    /// A value of the frame received at a time; NaN where the frame says that there is none.
    pub fn take(&mut self, at_ns: i64, field: Field, value: f64) {
        let number = field.number();
        if let Some(held) = self.held.get_mut(number) {
            *held = Some((at_ns, value));
        }
        if let Some(tally) = self.tallies.get_mut(number).filter(|_| !value.is_nan()) {
            tally.arrive(at_ns);
        }
        let half = match field {
            Field::Latitude => 0,
            Field::Longitude => 1,
            _ => return,
        };
        if half == 0 {
            self.pace.arrive(at_ns);
        }
        if let Some(slot) = self.halves.get_mut(half)
            && slot.replace((at_ns, value)).is_some()
        {
            self.halved += 1;
        }
    }

    /// The frame is over: where it completes a pair the fix before is done, and is given.
    pub fn frame(&mut self) -> Option<Fix> {
        let [
            Some((latitude_ns, latitude)),
            Some((longitude_ns, longitude)),
        ] = self.halves
        else {
            return None;
        };
        if (latitude_ns.saturating_sub(longitude_ns)).abs() > self.window_ns() {
            // The older one will not be completed any more; the newer one may be.
            let older = usize::from(longitude_ns < latitude_ns);
            if let Some(slot) = self.halves.get_mut(older) {
                *slot = None;
            }
            self.halved += 1;
            return None;
        }
        self.halves = [None; 2];
        let done = self.close();
        self.open = Some(Pair {
            first_ns: latitude_ns.min(longitude_ns),
            latitude,
            longitude,
        });
        done
    }

    /// Time has come to here: gives the fix whose window is over.
    pub fn advance(&mut self, now_ns: i64) -> Option<Fix> {
        let window_ns = self.window_ns();
        let over = |open: &Pair| now_ns.saturating_sub(open.first_ns) > window_ns;
        if self.open.as_ref().is_some_and(over) {
            return self.close();
        }
        None
    }

    /// The fix that waits, as it stands.
    #[must_use]
    pub fn preview(&self) -> Option<Fix> {
        self.open.as_ref().map(|open| self.fix(open).0)
    }

    fn window_ns(&self) -> i64 {
        let half = num::floor_i64(self.pace.period() / 2.0);
        if half > 0 {
            half.min(self.rules.pair_ns)
        } else {
            self.rules.pair_ns
        }
    }

    fn close(&mut self) -> Option<Fix> {
        let open = self.open.take()?;
        let (fix, absurd) = self.fix(&open);
        self.absurd += absurd;
        Some(fix)
    }

    /// A value that came so near to the fix.
    fn near(&self, open: &Pair, field: Field, window_ns: i64) -> Option<f64> {
        let (at_ns, value) = self.held.get(field.number()).copied().flatten()?;
        ((at_ns.saturating_sub(open.first_ns)).abs() <= window_ns).then_some(value)
    }

    /// The fix, and how many of its values are none.
    fn fix(&self, open: &Pair) -> (Fix, u64) {
        use std::f64::consts::{FRAC_PI_2, PI, TAU};
        let window_ns = self.window_ns();
        let mut absurd = 0;
        let mut keep = |value: Option<f64>, low: f64, high: f64| {
            let kept = value.filter(|value| (low..=high).contains(value));
            absurd += u64::from(value.is_some() && kept.is_none());
            kept
        };
        let of = |field: Field| self.near(open, field, window_ns);
        let slow = |field: Field| self.near(open, field, SLOW_NS);

        let mut fix = Fix::new(open.first_ns, FixQuality::None);
        fix.utc_ns = self.utc(open, window_ns);
        fix.satellites = keep(slow(Field::Satellites), 0.0, 254.0)
            .and_then(|count| u8::try_from(num::round_i64(count)).ok());
        fix.hdop = keep(slow(Field::Hdop), 0.0, 1e4);
        let position = keep(Some(open.latitude), -FRAC_PI_2, FRAC_PI_2)
            .zip(keep(Some(open.longitude), -PI, PI))
            // What senders without a fix send: no car is there.
            .filter(|(latitude, longitude)| latitude.abs() + longitude.abs() > 0.0);
        let quality = self.quality(slow(Field::Valid), slow(Field::Quality));
        let (Some((latitude, longitude)), true) = (position, quality != FixQuality::None) else {
            return (fix, absurd);
        };
        fix.quality = quality;
        fix.position = Some([latitude, longitude]);
        fix.height_m = keep(of(Field::Height), LOWEST, HIGHEST);
        fix.speed_mps = keep(of(Field::Speed), 0.0, FASTEST);
        fix.course =
            keep(of(Field::Course), -MOST_COURSE, MOST_COURSE).map(|course| turned(course, TAU));
        fix.climb_mps = keep(of(Field::Climb), -STEEPEST, STEEPEST);
        if let (Some(north), Some(east)) = (of(Field::VelocityNorth), of(Field::VelocityEast)) {
            fix.speed_mps = keep(Some(north.hypot(east)), 0.0, FASTEST);
            fix.course = (fix.speed_mps > Some(0.0)).then(|| turned(east.atan2(north), TAU));
        }
        let falls = of(Field::VelocityDown).map(|down| -down);
        fix.climb_mps = fix.climb_mps.or(keep(falls, -STEEPEST, STEEPEST));
        fix.horizontal_m2 =
            keep(slow(Field::HorizontalSd), 0.0, 1e5).map(|sd| [sd * sd, sd * sd, 0.0]);
        fix.height_sd_m = keep(slow(Field::HeightSd), 0.0, 1e5);
        fix.speed_sd_mps = keep(slow(Field::SpeedSd), 0.0, 1e5);
        fix.course_sd = keep(slow(Field::CourseSd), 0.0, 1e3);
        (fix, absurd)
    }

    /// What there is says that it is a fix, or it is none.
    fn quality(&self, valid: Option<f64>, quality: Option<f64>) -> FixQuality {
        if let Some(condition) = self.rules.valid
            && !valid.is_some_and(|value| condition.holds(value))
        {
            return FixQuality::None;
        }
        if !self.rules.quality {
            return FixQuality::Unstated;
        }
        quality
            .filter(|number| (0.0..=8.0).contains(number))
            .and_then(|number| u8::try_from(num::round_i64(number)).ok())
            .and_then(FixQuality::from_number)
            .unwrap_or(FixQuality::None)
    }

    fn utc(&self, open: &Pair, window_ns: i64) -> Option<i64> {
        let stated = |field: Field, most: f64| {
            self.near(open, field, window_ns)
                .filter(|ns| (0.0..=most).contains(ns))
                .map(num::round_i64)
        };
        stated(Field::Utc, 9e18).or_else(|| {
            let time = stated(Field::TimeOfDay, 86_401e9)?;
            let now_ns = open.first_ns.saturating_add(self.clock_offset_ns);
            Some(nearest_day(now_ns, time))
        })
    }
}

/// An angle from 0 to a whole turn.
fn turned(angle: f64, turn: f64) -> f64 {
    angle.rem_euclid(turn).clamp(0.0, turn)
}
