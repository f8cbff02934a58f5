//! Sentences of one instant become one fix.
//!
//! Sentences that state the same time of day are one epoch. One without a time (VTG, GSA) belongs to the epoch that is
//! open, or opens the next one after a pause of 100 ms in which the line carried nothing at all. A second sentence of a kind (GSA apart, which comes once a
//! constellation) begins the next epoch, unless another talker repeats the same instant. An epoch is over when the next
//! one begins or nothing came for half a second.
//!
//! It is a fix where RMC, GGA or GLL say so (status A, quality above 0) and none of them denies it; else it is "no fix",
//! which has no position. An epoch with none of the three says nothing and is left out.

use schema::gnss::{Fix, FixQuality};

use super::message::{Gga, Gll, Gst, Kind, Message, Rmc, Vtg};

/// A sentence without a time so long after the end of the last one belongs to the next epoch, ns.
const PAUSE_NS: i64 = 100_000_000;
/// An epoch is over when nothing came for so long, ns.
const OVER_NS: i64 = 500_000_000;
/// The same time of day within this is the same instant, ns.
const SAME_NS: i64 = 2_000_000_000;
const DAY_NS: i64 = 86_400_000_000_000;
const KINDS: usize = Kind::ALL.len();

/// What was counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Sentences of each kind, in the order of [`Kind::ALL`].
    pub kinds: [u64; KINDS],
    /// Sentences of kinds that are not interpreted.
    pub unknown: u64,
    /// Sentences whose checksum did not hold.
    pub bad_checksum: u64,
    /// Sentences that were none, or had a field that is none.
    pub malformed: u64,
    /// Sentences that came after their epoch was over.
    pub late: u64,
}

impl Counts {
    /// Sentences that were understood.
    #[must_use]
    pub fn sentences(&self) -> u64 {
        self.kinds.iter().sum()
    }
}

/// An epoch that still grows.
#[derive(Clone, Copy, Debug)]
struct Open {
    first_ns: i64,
    /// The line was quiet since.
    quiet_ns: i64,
    time: Option<i64>,
    date: Option<i64>,
    /// Who sent each kind.
    talkers: [Option<[u8; 2]>; KINDS],
    rmc: Option<Rmc>,
    gga: Option<Gga>,
    gll: Option<Gll>,
    vtg: Option<Vtg>,
    gst: Option<Gst>,
    hdop: Option<f64>,
}

/// How a sentence stands to the open epoch.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Within,
    Repeats,
    Next,
}

/// The epoch that was over last, for sentences that come too late.
#[derive(Clone, Copy, Debug)]
struct Over {
    first_ns: i64,
    time: i64,
    talkers: [Option<[u8; 2]>; KINDS],
}

/// Makes fixes of sentences. Times are receive times, ns, on one clock that never steps.
#[derive(Clone, Debug, Default)]
pub struct Epochs {
    open: Option<Open>,
    over: Option<Over>,
    /// The last UTC that was stated with its date, and when it came, ns.
    dated: Option<(i64, i64)>,
    /// UTC minus the clock of the receive times by the recorder, ns: which day it is where the receiver never says.
    pub clock_offset_ns: i64,
    late: u64,
}

impl Epochs {
    /// Sentences that came after their epoch was over.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }

    /// A sentence, and the times its first byte came and its last one; gives the fix of the epoch that it ends, if it
    /// ends one.
    pub fn take(
        &mut self,
        (at_ns, end_ns): (i64, i64),
        talker: [u8; 2],
        message: &Message,
    ) -> Option<Fix> {
        let over = self.advance(at_ns);
        let (kind, time) = (message.kind(), message.time());
        let place = match &self.open {
            Some(open) => open.place(at_ns, talker, kind, time),
            None => Place::Next,
        };
        if place == Place::Next && self.is_late(at_ns, kind, time) {
            self.late += 1;
            return over;
        }
        // The pause has ended the epoch, or the sentence does: never both.
        let fix = match place {
            Place::Next => self.close(),
            Place::Within | Place::Repeats => None,
        };
        let open = self.open.get_or_insert_with(|| Open::new(at_ns));
        open.quiet_ns = open.quiet_ns.max(end_ns);
        if place != Place::Repeats {
            open.add(talker, message);
        }
        over.or(fix)
    }

    /// A sentence of another kind came between these times: it is no pause. Gives the fix of an epoch that was over by
    /// then.
    pub fn pass(&mut self, (at_ns, end_ns): (i64, i64)) -> Option<Fix> {
        let over = self.advance(at_ns);
        if let Some(open) = &mut self.open {
            open.quiet_ns = open.quiet_ns.max(end_ns);
        }
        over
    }

    /// Time has come to here: gives the fix of an epoch that is over by that.
    pub fn advance(&mut self, now_ns: i64) -> Option<Fix> {
        let over = |open: &Open| now_ns.saturating_sub(open.quiet_ns) > OVER_NS;
        if self.open.as_ref().is_some_and(over) {
            return self.close();
        }
        None
    }

    /// The fix of the open epoch as it stands.
    #[must_use]
    pub fn preview(&self) -> Option<Fix> {
        self.open.as_ref().and_then(|open| self.fix(open))
    }

    fn close(&mut self) -> Option<Fix> {
        let open = self.open.take()?;
        let fix = self.fix(&open);
        if let Some(time) = open.time {
            self.over = Some(Over {
                first_ns: open.first_ns,
                time,
                talkers: open.talkers,
            });
            if let Some(date) = open.date {
                self.dated = Some((utc(date, time), open.first_ns));
            }
        }
        fix
    }

    fn is_late(&self, at_ns: i64, kind: Kind, time: Option<i64>) -> bool {
        self.over.as_ref().is_some_and(|over| {
            time == Some(over.time)
                && at_ns.saturating_sub(over.first_ns) < SAME_NS
                && over.talkers.get(kind.number()) == Some(&None)
        })
    }

    /// UTC of a time of day: with the date stated beside it, else on the day that brings it nearest to the last dated
    /// epoch (a roll-over at midnight needs no new date), else to the recorder's clock.
    fn utc(&self, open: &Open) -> Option<i64> {
        let time = open.time?;
        if let Some(date) = open.date {
            return Some(utc(date, time));
        }
        let expected = match self.dated {
            Some((utc_ns, at_ns)) => utc_ns.saturating_add(open.first_ns.saturating_sub(at_ns)),
            None => open.first_ns.saturating_add(self.clock_offset_ns),
        };
        Some(nearest_day(expected, time))
    }

    fn fix(&self, open: &Open) -> Option<Fix> {
        let says = [
            open.rmc.map(|rmc| rmc.valid),
            open.gga.map(|gga| gga.quality > 0),
            open.gll.map(|gll| gll.valid),
        ];
        let said = || says.iter().flatten();
        said().next()?;
        let position = open
            .gga
            .and_then(|gga| gga.position)
            .or(open.rmc.and_then(|rmc| rmc.position))
            .or(open.gll.and_then(|gll| gll.position));
        let mut fix = Fix::new(open.first_ns, FixQuality::None);
        fix.utc_ns = self.utc(open);
        fix.satellites = open.gga.and_then(|gga| gga.satellites);
        fix.hdop = open.gga.and_then(|gga| gga.hdop).or(open.hdop);
        let (Some(position), true) = (position, said().all(|valid| *valid)) else {
            return Some(fix);
        };
        let mode = open.rmc.and_then(|rmc| rmc.mode);
        let mode = mode.or(open.gll.and_then(|gll| gll.mode));
        fix.quality = match open.gga {
            Some(gga) => FixQuality::from_number(gga.quality).unwrap_or(FixQuality::Unstated),
            None => mode.map_or(FixQuality::Unstated, quality),
        };
        fix.position = Some(position);
        // The ellipsoid lies below mean sea level by the separation; without it the height is not known.
        fix.height_m = open
            .gga
            .and_then(|gga| gga.altitude.zip(gga.separation))
            .map(|(altitude, separation)| altitude + separation);
        let vtg = open.vtg.filter(|vtg| vtg.mode != Some(b'N'));
        fix.speed_mps = open
            .rmc
            .and_then(|rmc| rmc.speed)
            .or(vtg.and_then(|vtg| vtg.speed));
        fix.course = open
            .rmc
            .and_then(|rmc| rmc.course)
            .or(vtg.and_then(|vtg| vtg.course));
        fix.horizontal_m2 = open.gst.and_then(|gst| {
            gst.ellipse.map(covariance).or(gst
                .sd
                .map(|[north, east]| [north * north, east * east, 0.0]))
        });
        fix.height_sd_m = open.gst.and_then(|gst| gst.height_sd);
        Some(fix)
    }
}

impl Open {
    fn new(at_ns: i64) -> Self {
        Self {
            first_ns: at_ns,
            quiet_ns: at_ns,
            time: None,
            date: None,
            talkers: [None; KINDS],
            rmc: None,
            gga: None,
            gll: None,
            vtg: None,
            gst: None,
            hdop: None,
        }
    }

    fn place(&self, at_ns: i64, talker: [u8; 2], kind: Kind, time: Option<i64>) -> Place {
        let pause = at_ns.saturating_sub(self.quiet_ns) > PAUSE_NS;
        let same = time.is_some() && time == self.time;
        let joins = match (time, self.time) {
            (Some(_), Some(_)) => same,
            _ => !pause,
        };
        let before = self.talkers.get(kind.number()).copied().flatten();
        match before {
            _ if !joins => Place::Next,
            Some(_) if kind == Kind::Gsa => Place::Within,
            Some(other) if same && other != talker => Place::Repeats,
            Some(_) => Place::Next,
            None => Place::Within,
        }
    }

    fn add(&mut self, talker: [u8; 2], message: &Message) {
        if let Some(slot) = self.talkers.get_mut(message.kind().number()) {
            *slot = Some(talker);
        }
        self.time = self.time.or(message.time());
        match *message {
            Message::Rmc(rmc) => {
                self.rmc = Some(rmc);
                self.date = self.date.or(rmc.date.filter(|_| rmc.time.is_some()));
            }
            Message::Gga(gga) => self.gga = Some(gga),
            Message::Vtg(vtg) => self.vtg = Some(vtg),
            Message::Gsa(gsa) => self.hdop = self.hdop.or(gsa.hdop),
            Message::Gst(gst) => self.gst = Some(gst),
            Message::Gll(gll) => self.gll = Some(gll),
            // It has the year in full.
            Message::Zda(zda) => {
                self.date = zda.date.filter(|_| zda.time.is_some()).or(self.date);
            }
        }
    }
}

fn utc(date: i64, time: i64) -> i64 {
    date.saturating_mul(DAY_NS).saturating_add(time)
}

/// A time of day on the day that brings it nearest to an expected UTC, ns.
#[must_use]
pub(crate) fn nearest_day(expected_ns: i64, time_of_day_ns: i64) -> i64 {
    let off = expected_ns.saturating_sub(time_of_day_ns);
    let day = off.saturating_add(DAY_NS / 2).div_euclid(DAY_NS);
    utc(day, time_of_day_ns)
}

/// What a mode letter says.
fn quality(mode: u8) -> FixQuality {
    match mode {
        b'A' => FixQuality::Autonomous,
        b'D' => FixQuality::Differential,
        b'P' => FixQuality::Precise,
        b'R' => FixQuality::RtkFixed,
        b'F' => FixQuality::RtkFloat,
        b'E' => FixQuality::Estimated,
        b'M' => FixQuality::Manual,
        b'S' => FixQuality::Simulated,
        _ => FixQuality::Unstated,
    }
}

/// Covariance of an error ellipse: north-north, east-east, north-east.
fn covariance([major, minor, direction]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = direction.sin_cos();
    let (a, b) = (major * major, minor * minor);
    [
        a * cos * cos + b * sin * sin,
        a * sin * sin + b * cos * cos,
        (a - b) * sin * cos,
    ]
}

const _: () = assert!(OVER_NS > PAUSE_NS && SAME_NS > OVER_NS);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_of_day_goes_to_the_nearest_day() {
        let day = 20_000 * DAY_NS;
        assert_eq!(nearest_day(day + 5, DAY_NS - 1), day - 1, "before midnight");
        assert_eq!(nearest_day(day - 5, 3), day + 3, "after midnight");
        for hour in 0..48 {
            let at = day + i64::from(hour) * 3_600_000_000_000;
            for time in [0, DAY_NS / 3, DAY_NS - 1] {
                let off = nearest_day(at, time) - at;
                assert!((-DAY_NS / 2..=DAY_NS / 2).contains(&off), "{off}");
            }
        }
        // Beyond all bounds it saturates.
        let _ = (nearest_day(i64::MAX, 0), nearest_day(i64::MIN, DAY_NS));
    }

    #[test]
    fn an_error_ellipse_keeps_its_trace_and_determinant() {
        let [n, e, ne] = covariance([3.0, 2.0, 0.6]);
        assert!((n + e - 13.0).abs() < 1e-12 && (n * e - ne * ne - 36.0).abs() < 1e-9);
        let [n, e, ne] = covariance([3.0, 2.0, 0.0]);
        assert!((n - 9.0).abs() < 1e-12 && (e - 4.0).abs() < 1e-12 && ne.abs() < 1e-12);
    }
}
