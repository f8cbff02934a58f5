//! Fields of a sentence: each is empty, a value, or no such field at all.

use schema::time::Stamp;

/// A field that is not what its place asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NoField;

type Field<T> = Result<Option<T>, NoField>;

/// Most fields of a sentence, its address among them.
const MOST: usize = 40;
/// Longest number, bytes.
const LONGEST_NUMBER: usize = 24;
/// Nanoseconds of a second.
const SECOND_NS: i64 = 1_000_000_000;
/// m/s of a knot.
const KNOT: f64 = 1852.0 / 3600.0;

/// The fields, the address first.
pub(super) struct Fields<'a> {
    all: [&'a [u8]; MOST],
    count: usize,
}

impl<'a> Fields<'a> {
    /// Those of what stands between `$` and `*`; `None` where there are too many.
    pub(super) fn of(body: &'a [u8]) -> Option<Self> {
        let mut all: [&[u8]; MOST] = [&[]; MOST];
        let mut count = 0;
        for field in body.split(|byte| *byte == b',') {
            *all.get_mut(count)? = field;
            count += 1;
        }
        Some(Self { all, count })
    }

    /// The field at a place; empty behind the last.
    pub(super) fn at(&self, place: usize) -> &'a [u8] {
        self.all.get(place).copied().unwrap_or_default()
    }

    /// Fields behind the address.
    pub(super) fn values(&self) -> usize {
        self.count.saturating_sub(1)
    }

    /// A decimal number.
    pub(super) fn number(&self, place: usize) -> Field<f64> {
        number(self.at(place))
    }

    /// A decimal number within bounds, both included.
    pub(super) fn within(&self, place: usize, low: f64, high: f64) -> Field<f64> {
        match self.number(place)? {
            Some(value) if !(low..=high).contains(&value) => Err(NoField),
            value => Ok(value),
        }
    }

    /// A speed in knots, as m/s.
    pub(super) fn knots(&self, place: usize) -> Field<f64> {
        Ok(self.within(place, 0.0, 1e5)?.map(|knots| knots * KNOT))
    }

    /// A course, as radians.
    pub(super) fn course(&self, place: usize) -> Field<f64> {
        let degrees = self.within(place, 0.0, 360.0)?;
        Ok(degrees.map(|degrees| degrees.to_radians().min(std::f64::consts::TAU)))
    }

    /// One letter.
    pub(super) fn letter(&self, place: usize) -> Field<u8> {
        match self.at(place) {
            [] => Ok(None),
            [letter] if letter.is_ascii_alphabetic() => Ok(Some(letter.to_ascii_uppercase())),
            _ => Err(NoField),
        }
    }

    /// A whole number up to a bound.
    pub(super) fn count(&self, place: usize, most: u32) -> Field<u32> {
        let field = self.at(place);
        if field.is_empty() {
            return Ok(None);
        }
        digits(field)
            .filter(|count| *count <= most)
            .map(Some)
            .ok_or(NoField)
    }

    /// Time of day `hhmmss` with or without a fraction, ns. The second may be 60.
    pub(super) fn time(&self, place: usize) -> Field<i64> {
        let field = self.at(place);
        if field.is_empty() {
            return Ok(None);
        }
        let (whole, fraction) = split_fraction(field);
        let [h, m, s] = pairs(whole).ok_or(NoField)?;
        if h > 23 || m > 59 || s > 60 || fraction.len() > 12 {
            return Err(NoField);
        }
        let mut nanos = 0;
        let mut unit = SECOND_NS / 10;
        for digit in fraction {
            if !digit.is_ascii_digit() {
                return Err(NoField);
            }
            nanos += i64::from(digit - b'0') * unit;
            unit /= 10;
        }
        let seconds = i64::from(h * 3600 + m * 60 + s);
        Ok(Some(seconds * SECOND_NS + nanos))
    }

    /// Date `ddmmyy`, as days since 1970. Years 80 to 99 are of the last century.
    pub(super) fn date(&self, place: usize) -> Field<i64> {
        let field = self.at(place);
        if field.is_empty() {
            return Ok(None);
        }
        let [d, m, y] = pairs(field).ok_or(NoField)?;
        days(d, m, if y >= 80 { 1900 + y } else { 2000 + y }).map(Some)
    }

    /// Day, month and year of three fields, as days since 1970.
    pub(super) fn long_date(&self, place: usize) -> Field<i64> {
        let part = |at: usize, most: u32| self.count(place + at, most);
        match (part(0, 31)?, part(1, 12)?, part(2, 8191)?) {
            (Some(d), Some(m), Some(y)) => days(d, m, y).map(Some),
            (None, None, None) => Ok(None),
            _ => Err(NoField),
        }
    }

    /// Latitude and longitude of four fields, rad.
    pub(super) fn position(&self, place: usize) -> Field<[f64; 2]> {
        let angle = |at: usize, most: f64, signs: [u8; 2]| {
            let [plus, minus] = signs;
            match (self.at(place + at), self.letter(place + at + 1)?) {
                ([], _) => Ok(None),
                (field, Some(sign)) if sign == plus => degrees(field, most).map(Some),
                (field, Some(sign)) if sign == minus => {
                    degrees(field, most).map(|angle| Some(-angle))
                }
                _ => Err(NoField),
            }
        };
        let latitude = angle(0, 90.0, *b"NS")?;
        match (latitude, angle(2, 180.0, *b"EW")?) {
            (Some(latitude), Some(longitude)) => Ok(Some([latitude, longitude])),
            (None, None) => Ok(None),
            _ => Err(NoField),
        }
    }
}

/// `dddmm.mmmm` as radians: the last two digits before the point and all behind it are minutes.
fn degrees(field: &[u8], most: f64) -> Result<f64, NoField> {
    let (whole, _) = split_fraction(field);
    let at = whole
        .len()
        .checked_sub(2)
        .filter(|at| *at > 0)
        .ok_or(NoField)?;
    let (degrees, minutes) = field.split_at_checked(at).ok_or(NoField)?;
    let degrees = digits(degrees).ok_or(NoField)?;
    let minutes = number(minutes)?
        .filter(|minutes| (0.0..60.0).contains(minutes))
        .ok_or(NoField)?;
    let angle = f64::from(degrees) + minutes / 60.0;
    if angle > most {
        return Err(NoField);
    }
    Ok(angle.to_radians())
}

fn number(field: &[u8]) -> Field<f64> {
    if field.is_empty() {
        return Ok(None);
    }
    let unsigned = field.strip_prefix(b"-").unwrap_or(field);
    let digits = unsigned.iter().filter(|byte| byte.is_ascii_digit()).count();
    // Of all bytes that are no digits there is one at most, the point.
    let points = usize::from(unsigned.contains(&b'.'));
    if digits == 0 || points + digits != unsigned.len() || field.len() > LONGEST_NUMBER {
        return Err(NoField);
    }
    let text = std::str::from_utf8(field).map_err(|_| NoField)?;
    text.parse().map(Some).map_err(|_| NoField)
}

/// What stands before the point and behind it.
fn split_fraction(field: &[u8]) -> (&[u8], &[u8]) {
    match field.iter().position(|byte| *byte == b'.') {
        Some(point) => (
            field.get(..point).unwrap_or_default(),
            field.get(point + 1..).unwrap_or_default(),
        ),
        None => (field, &[]),
    }
}

fn digits(field: &[u8]) -> Option<u32> {
    if field.is_empty() || field.len() > 9 {
        return None;
    }
    field.iter().try_fold(0_u32, |sum, byte| {
        let digit = char::from(*byte).to_digit(10)?;
        Some(sum * 10 + digit)
    })
}

/// Three numbers of two digits.
fn pairs(field: &[u8]) -> Option<[u32; 3]> {
    let (pairs, []) = field.as_chunks::<2>() else {
        return None;
    };
    let [a, b, c] = pairs else { return None };
    Some([digits(a)?, digits(b)?, digits(c)?])
}

fn days(day: u32, month: u32, year: u32) -> Result<i64, NoField> {
    let small = |number: u32| u8::try_from(number).unwrap_or(u8::MAX);
    let stamp = Stamp {
        year: u16::try_from(year).map_err(|_| NoField)?,
        month: small(month),
        day: small(day),
        hour: 0,
        minute: 0,
        second: 0,
    };
    // Until 2262 nanoseconds have 64 bits.
    if !stamp.is_valid() || !(1970..2262).contains(&year) {
        return Err(NoField);
    }
    Ok(stamp.to_utc_s().div_euclid(86_400))
}
