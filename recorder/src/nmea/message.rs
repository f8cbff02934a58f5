//! What a sentence says. Positions in radians, speeds in m/s, courses in radians clockwise from true north, times in ns
//! of the UTC day, dates in days since 1970.

use super::field::{Fields, NoField};
use super::frame::Text;

/// Kinds of sentences that are interpreted, and kept verbatim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Recommended minimum: time, status, position, speed, course, date.
    Rmc,
    /// Fix data: time, position, quality, satellites, HDOP, height.
    Gga,
    /// Course and speed over ground.
    Vtg,
    /// Satellites in use and dilution of precision.
    Gsa,
    /// Error statistics.
    Gst,
    /// Position, time, status.
    Gll,
    /// Time and date.
    Zda,
}

/// RMC.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rmc {
    /// Time of day, ns.
    pub time: Option<i64>,
    /// Status A, and no mode N.
    pub valid: bool,
    /// Latitude and longitude, rad.
    pub position: Option<[f64; 2]>,
    /// Over ground, m/s.
    pub speed: Option<f64>,
    /// Over ground, rad.
    pub course: Option<f64>,
    /// Days since 1970.
    pub date: Option<i64>,
    /// Mode letter (NMEA 2.3 and later): A, D, E, F, M, N, P, R, S.
    pub mode: Option<u8>,
    /// Navigational status (4.1 and later): S safe, C caution, U unsafe, V not given. Most receivers send V always, so
    /// it says nothing about the fix.
    pub status: Option<u8>,
}

/// GGA.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gga {
    /// Time of day, ns.
    pub time: Option<i64>,
    /// Latitude and longitude, rad.
    pub position: Option<[f64; 2]>,
    /// 0 to 8; an empty field is 0.
    pub quality: u8,
    /// Satellites in use.
    pub satellites: Option<u8>,
    /// Horizontal dilution of precision.
    pub hdop: Option<f64>,
    /// Above mean sea level, m.
    pub altitude: Option<f64>,
    /// Mean sea level above the ellipsoid, m.
    pub separation: Option<f64>,
}

/// VTG.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vtg {
    /// Over ground, rad.
    pub course: Option<f64>,
    /// Over ground, m/s.
    pub speed: Option<f64>,
    /// Mode letter.
    pub mode: Option<u8>,
}

/// GSA.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gsa {
    /// 1 no fix, 2 in two dimensions, 3 in three.
    pub fix: Option<u8>,
    /// Horizontal dilution of precision.
    pub hdop: Option<f64>,
}

/// GST.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gst {
    /// Time of day, ns.
    pub time: Option<i64>,
    /// Error ellipse: semi-major and semi-minor axis (sd, m), direction of the major one (rad clockwise from north).
    pub ellipse: Option<[f64; 3]>,
    /// Standard deviations north and east, m.
    pub sd: Option<[f64; 2]>,
    /// Of the height, m.
    pub height_sd: Option<f64>,
}

/// GLL.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gll {
    /// Latitude and longitude, rad.
    pub position: Option<[f64; 2]>,
    /// Time of day, ns.
    pub time: Option<i64>,
    /// Status A, and no mode N.
    pub valid: bool,
    /// Mode letter.
    pub mode: Option<u8>,
}

/// ZDA.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Zda {
    /// Time of day, ns.
    pub time: Option<i64>,
    /// Days since 1970.
    pub date: Option<i64>,
}

/// A sentence's content.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// RMC.
    Rmc(Rmc),
    /// GGA.
    Gga(Gga),
    /// VTG.
    Vtg(Vtg),
    /// GSA.
    Gsa(Gsa),
    /// GST.
    Gst(Gst),
    /// GLL.
    Gll(Gll),
    /// ZDA.
    Zda(Zda),
}

/// What becomes of a sentence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// Its talker and what it says.
    Message([u8; 2], Message),
    /// A kind that is not interpreted, a proprietary one among them.
    Unknown,
    /// A kind that is, with a field that is none.
    Malformed,
}

impl Kind {
    /// In the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Rmc,
        Self::Gga,
        Self::Vtg,
        Self::Gsa,
        Self::Gst,
        Self::Gll,
        Self::Zda,
    ];

    /// The three letters.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Rmc => "RMC",
            Self::Gga => "GGA",
            Self::Vtg => "VTG",
            Self::Gsa => "GSA",
            Self::Gst => "GST",
            Self::Gll => "GLL",
            Self::Zda => "ZDA",
        }
    }

    /// Its place in [`Kind::ALL`].
    #[must_use]
    pub fn number(self) -> usize {
        match self {
            Self::Rmc => 0,
            Self::Gga => 1,
            Self::Vtg => 2,
            Self::Gsa => 3,
            Self::Gst => 4,
            Self::Gll => 5,
            Self::Zda => 6,
        }
    }

    /// That of a sentence; `None` for one that is not interpreted.
    #[must_use]
    pub fn of(text: &Text) -> Option<Self> {
        let address = text.body().split(|byte| *byte == b',').next()?;
        let ([a, b], word) = address.split_first_chunk::<2>()?;
        let talker = a.is_ascii_uppercase() && b.is_ascii_alphanumeric();
        Self::ALL
            .into_iter()
            .find(|kind| talker && kind.word().as_bytes() == word)
    }

    /// Fields that must be there behind the address, since the version of the standard that brought them in.
    fn fewest(self) -> usize {
        match self {
            Self::Rmc => 9,
            Self::Gga => 12,
            Self::Vtg | Self::Gst => 8,
            Self::Gsa => 17,
            Self::Gll => 6,
            Self::Zda => 4,
        }
    }
}

impl Message {
    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Rmc(_) => Kind::Rmc,
            Self::Gga(_) => Kind::Gga,
            Self::Vtg(_) => Kind::Vtg,
            Self::Gsa(_) => Kind::Gsa,
            Self::Gst(_) => Kind::Gst,
            Self::Gll(_) => Kind::Gll,
            Self::Zda(_) => Kind::Zda,
        }
    }

    /// Its time of day, ns.
    #[must_use]
    pub fn time(&self) -> Option<i64> {
        match self {
            Self::Rmc(rmc) => rmc.time,
            Self::Gga(gga) => gga.time,
            Self::Gst(gst) => gst.time,
            Self::Gll(gll) => gll.time,
            Self::Zda(zda) => zda.time,
            Self::Vtg(_) | Self::Gsa(_) => None,
        }
    }
}

/// Reads a sentence.
#[must_use]
pub fn read(text: &Text) -> Reading {
    let Some(kind) = Kind::of(text) else {
        return Reading::Unknown;
    };
    let Some(fields) = Fields::of(text.body()) else {
        return Reading::Malformed;
    };
    if fields.values() < kind.fewest() {
        return Reading::Malformed;
    }
    let talker = match fields.at(0) {
        [a, b, ..] => [*a, *b],
        _ => return Reading::Malformed,
    };
    let message = match kind {
        Kind::Rmc => rmc(&fields).map(Message::Rmc),
        Kind::Gga => gga(&fields).map(Message::Gga),
        Kind::Vtg => vtg(&fields).map(Message::Vtg),
        Kind::Gsa => gsa(&fields).map(Message::Gsa),
        Kind::Gst => gst(&fields).map(Message::Gst),
        Kind::Gll => gll(&fields).map(Message::Gll),
        Kind::Zda => zda(&fields).map(Message::Zda),
    };
    message.map_or(Reading::Malformed, |message| {
        Reading::Message(talker, message)
    })
}

/// Status A is valid, V or an empty field is not; mode N is not either.
fn valid(fields: &Fields<'_>, place: usize, mode: Option<u8>) -> Result<bool, NoField> {
    match fields.letter(place)? {
        Some(b'A') => Ok(mode != Some(b'N')),
        Some(b'V') | None => Ok(false),
        Some(_) => Err(NoField),
    }
}

fn rmc(fields: &Fields<'_>) -> Result<Rmc, NoField> {
    let mode = fields.letter(12)?;
    Ok(Rmc {
        time: fields.time(1)?,
        valid: valid(fields, 2, mode)?,
        position: fields.position(3)?,
        speed: fields.knots(7)?,
        course: fields.course(8)?,
        date: fields.date(9)?,
        mode,
        status: fields.letter(13)?,
    })
}

/// A number in metres: the unit behind it is M, or not there.
fn metres(fields: &Fields<'_>, place: usize) -> Result<Option<f64>, NoField> {
    match fields.letter(place + 1)? {
        Some(b'M') | None => fields.within(place, -1e5, 1e7),
        Some(_) => Err(NoField),
    }
}

fn gga(fields: &Fields<'_>) -> Result<Gga, NoField> {
    let small = |count: u32| u8::try_from(count).unwrap_or(u8::MAX);
    Ok(Gga {
        time: fields.time(1)?,
        position: fields.position(2)?,
        quality: fields.count(6, 8)?.map_or(0, small),
        satellites: fields.count(7, 254)?.map(small),
        hdop: fields.within(8, 0.0, 1e4)?,
        altitude: metres(fields, 9)?,
        separation: metres(fields, 11)?,
    })
}

fn vtg(fields: &Fields<'_>) -> Result<Vtg, NoField> {
    for (place, unit) in [(2, b'T'), (4, b'M'), (6, b'N'), (8, b'K')] {
        if fields.letter(place)?.is_some_and(|found| found != unit) {
            return Err(NoField);
        }
    }
    let kmh = fields.within(7, 0.0, 1e5)?;
    Ok(Vtg {
        course: fields.course(1)?,
        speed: fields.knots(5)?.or(kmh.map(|kmh| kmh / 3.6)),
        mode: fields.letter(9)?,
    })
}

fn gsa(fields: &Fields<'_>) -> Result<Gsa, NoField> {
    let fix = fields.count(2, 3)?;
    Ok(Gsa {
        fix: fix.and_then(|fix| u8::try_from(fix).ok()),
        hdop: fields.within(16, 0.0, 1e4)?,
    })
}

fn gst(fields: &Fields<'_>) -> Result<Gst, NoField> {
    // Receivers without a fix state absurd ones.
    let sd = |place: usize| -> Result<Option<f64>, NoField> {
        Ok(fields.within(place, 0.0, 1e12)?.filter(|sd| *sd <= 1e5))
    };
    let ellipse = match (sd(3)?, sd(4)?, fields.within(5, -360.0, 360.0)?) {
        (Some(major), Some(minor), Some(degrees)) => Some([major, minor, degrees.to_radians()]),
        _ => None,
    };
    Ok(Gst {
        time: fields.time(1)?,
        ellipse,
        sd: sd(6)?.zip(sd(7)?).map(|(north, east)| [north, east]),
        height_sd: sd(8)?,
    })
}

fn gll(fields: &Fields<'_>) -> Result<Gll, NoField> {
    let mode = fields.letter(7)?;
    Ok(Gll {
        position: fields.position(1)?,
        time: fields.time(5)?,
        valid: valid(fields, 6, mode)?,
        mode,
    })
}

fn zda(fields: &Fields<'_>) -> Result<Zda, NoField> {
    Ok(Zda {
        time: fields.time(1)?,
        date: fields.long_date(2)?,
    })
}
