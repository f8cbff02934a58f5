//! The fields of one line, and the rows made of them; every complaint has its column.

use crate::gnss::columns::{Column, FIX, MOTION};
use crate::gnss::error::GnssError;
use crate::gnss::layout::{Decimal, Delimiter, EMPTY, Layout};
use crate::gnss::rows::{Fix, Head, Leg, MILLI, MILLI_G, Motion, Row};
use crate::gnss::time;

/// A line cut into the columns of its format.
pub(super) struct Fields<'a> {
    pub(super) file: &'a str,
    pub(super) line: u64,
    pub(super) cells: &'a [&'a str],
    pub(super) layout: Layout,
    pub(super) columns: &'static [Column],
}

/// A row that can be read.
pub(super) trait Parse: Row {
    /// The columns of its format.
    const COLUMNS: &'static [Column];

    /// The row; `None` for a fix that is marked bad and has no position, as receivers write without satellites.
    fn parse(fields: &Fields<'_>) -> Result<Option<Self>, GnssError>;

    /// True if it is marked bad.
    fn is_bad(&self) -> bool;
}

impl<'a> Fields<'a> {
    /// The field of a column, numbered from 1; `None` where it is empty.
    fn text(&self, column: usize) -> Option<&'a str> {
        let text = *self.cells.get(column - 1)?;
        let filler = self.layout.delimiter == Delimiter::Spaces && text == EMPTY;
        (!text.is_empty() && !filler).then_some(text)
    }

    fn fault(&self, column: usize, expected: &'static str) -> GnssError {
        GnssError::Cell {
            file: self.file.to_owned(),
            line: self.line,
            column,
            name: self.columns.get(column - 1).map_or("", |c| c.name),
            expected,
            found: self
                .text(column)
                .map_or_else(|| "an empty field".to_owned(), |t| format!("{t:?}")),
        }
    }

    /// A number in the unit of the file.
    fn real(&self, column: usize) -> Result<Option<f64>, GnssError> {
        let Some(text) = self.text(column) else {
            return Ok(None);
        };
        let (parsed, expected) = match self.layout.decimal {
            Decimal::Point => (text.parse::<f64>(), "a finite number"),
            Decimal::Comma if text.contains('.') => {
                return Err(self.fault(column, "a number with a decimal comma"));
            }
            Decimal::Comma => (
                text.replace(',', ".").parse(),
                "a finite number with a decimal comma",
            ),
        };
        let value = match parsed {
            Ok(value) if value.is_finite() => value,
            _ => return Err(self.fault(column, expected)),
        };
        match self.columns.get(column - 1) {
            Some(c) if !c.holds(value) => Err(GnssError::Range {
                file: self.file.to_owned(),
                line: self.line,
                column,
                name: c.name,
                expected: c.range(),
                found: text.to_owned(),
            }),
            _ => Ok(Some(value)),
        }
    }

    fn required(&self, column: usize) -> Result<f64, GnssError> {
        self.real(column)?
            .ok_or_else(|| self.fault(column, "a number"))
    }

    /// A whole number; `6.0` and `6e0` are as good as `6`.
    fn whole(&self, column: usize) -> Result<Option<u32>, GnssError> {
        let Some(value) = self.real(column)? else {
            return Ok(None);
        };
        let whole = u32::try_from(schema::num::round_i64(value)).ok();
        match whole.filter(|&w| f64::from(w).to_bits() == value.abs().to_bits()) {
            None => Err(self.fault(column, "a whole number")),
            found => Ok(found),
        }
    }

    fn id(&self, column: usize) -> Result<u32, GnssError> {
        self.whole(column)?
            .ok_or_else(|| self.fault(column, "a whole number"))
    }

    fn flag(&self, column: usize) -> Result<Option<bool>, GnssError> {
        match self.whole(column)? {
            None => Ok(None),
            Some(0) => Ok(Some(false)),
            Some(1) => Ok(Some(true)),
            Some(_) => Err(self.fault(column, "0 or 1")),
        }
    }

    /// Three columns, each there or not.
    fn any(&self, columns: [usize; 3]) -> Result<[Option<f64>; 3], GnssError> {
        let [x, y, z] = columns;
        Ok([self.real(x)?, self.real(y)?, self.real(z)?])
    }

    /// Three columns, all there.
    fn all(&self, columns: [usize; 3]) -> Result<[f64; 3], GnssError> {
        let [x, y, z] = columns;
        Ok([self.required(x)?, self.required(y)?, self.required(z)?])
    }

    /// Three columns, all there or none.
    fn all_or_none(&self, columns: [usize; 3]) -> Result<Option<[f64; 3]>, GnssError> {
        if columns.iter().all(|&c| self.text(c).is_none()) {
            return Ok(None);
        }
        self.all(columns).map(Some)
    }

    fn head(&self) -> Result<Head, GnssError> {
        let leg = Leg {
            equipment: self.id(1)?,
            drive: self.id(2)?,
            leg: self.id(3)?,
        };
        let utc_ms = match (self.text(4), self.text(5)) {
            (None, None) => None,
            (day, clock) => {
                let date = day
                    .and_then(time::date)
                    .ok_or_else(|| self.fault(4, "a date yyyy-mm-dd"))?;
                let instant = clock.and_then(|c| time::instant(date, c));
                Some(instant.ok_or_else(|| self.fault(5, "a time hh:mm:ss.fff"))?)
            }
        };
        Ok(Head {
            leg,
            utc_ms,
            week: self.whole(6)?,
            tow_s: self.real(7)?,
            obu_s: self.required(8)?,
        })
    }
}

impl Parse for Fix {
    const COLUMNS: &'static [Column] = &FIX;

    fn parse(f: &Fields<'_>) -> Result<Option<Self>, GnssError> {
        let degrees = |column| Ok::<_, GnssError>(f.real(column)?.map(f64::to_radians));
        let head = f.head()?;
        let good = f.flag(9)?;
        if good == Some(false) && f.text(11).is_none() && f.text(12).is_none() {
            return Ok(None);
        }
        let fix = Self {
            head,
            good,
            fix_type: f.whole(10)?,
            latitude: f.required(11)?.to_radians(),
            longitude: f.required(12)?.to_radians(),
            ellipsoid_height: f.real(13)?,
            sea_height: f.real(14)?,
            speed: f.real(15)?,
            course: degrees(16)?,
            yaw: degrees(17)?,
            pitch: degrees(18)?,
            roll: degrees(19)?,
            horizontal_error: f.real(20)?,
            vertical_error: f.real(21)?,
            sd_ned: f.any([22, 23, 24])?,
            hdop: f.real(25)?,
            pdop: f.real(26)?,
            velocity_ned: f.all_or_none([27, 28, 29])?,
            satellites: f.whole(30)?,
            signal: f.real(31)?,
            sbas: f.flag(32)?,
            integrity_ned: f.any([33, 34, 35])?,
        };
        if fix.ellipsoid_height.or(fix.sea_height).is_none() {
            return Err(f.fault(14, "a height here or in column 13"));
        }
        Ok(Some(fix))
    }

    fn is_bad(&self) -> bool {
        self.good == Some(false)
    }
}

impl Parse for Motion {
    const COLUMNS: &'static [Column] = &MOTION;

    fn parse(f: &Fields<'_>) -> Result<Option<Self>, GnssError> {
        Ok(Some(Self {
            head: f.head()?,
            accel: f.all([9, 10, 11])?.map(|a| a * MILLI_G),
            rate: f.all([12, 13, 14])?.map(|w| (w / MILLI).to_radians()),
        }))
    }

    fn is_bad(&self) -> bool {
        false
    }
}
