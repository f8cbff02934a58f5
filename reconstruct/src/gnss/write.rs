//! Rows to text. What is written can be read: a row that the reader would refuse is an error here.

use std::io::Write;

use crate::gnss::columns::{Column, FIX, MOTION};
use crate::gnss::error::GnssError;
use crate::gnss::layout::{Decimal, Delimiter, EMPTY, Layout};
use crate::gnss::rows::{Fix, Head, Motion};
use crate::gnss::time;

/// Writes a log of fixes [S00, 6.1]: positions to 1e-9 degrees, stamps to the millisecond; `name` stands in
/// complaints.
///
/// # Errors
/// [`GnssError`] where a row holds what the format cannot, or the output fails.
pub fn write_fixes<W: Write>(
    out: W,
    name: &str,
    rows: &[Fix],
    layout: Layout,
) -> Result<(), GnssError> {
    write(out, name, rows, layout, &FIX, fix)
}

/// Writes a log of accelerations and rates [S00, 6.2]: milli-g to three decimals, millidegrees a second to two;
/// `name` stands in complaints.
///
/// # Errors
/// [`GnssError`] where a row holds what the format cannot, or the output fails.
pub fn write_motions<W: Write>(
    out: W,
    name: &str,
    rows: &[Motion],
    layout: Layout,
) -> Result<(), GnssError> {
    write(out, name, rows, layout, &MOTION, motion)
}

fn write<T, W: Write>(
    mut out: W,
    name: &str,
    rows: &[T],
    layout: Layout,
    columns: &'static [Column],
    fill: fn(&mut Pen<'_>, &T) -> Result<(), GnssError>,
) -> Result<(), GnssError> {
    let file = || name.to_owned();
    if layout.delimiter == Delimiter::Comma && layout.decimal == Decimal::Comma {
        return Err(GnssError::Layout { file: file() });
    }
    let io = |error| GnssError::Io {
        file: file(),
        error,
    };
    if layout.header {
        let names: Vec<&str> = columns.iter().map(|c| c.name).collect();
        let line = names.join(layout.delimiter.text().encode_utf8(&mut [0; 4]));
        writeln!(out, "{line}").map_err(io)?;
    }
    for (row, number) in rows.iter().zip(1..) {
        let mut pen = Pen {
            file: name,
            row: number,
            layout,
            columns,
            column: 0,
            line: String::new(),
        };
        fill(&mut pen, row)?;
        writeln!(out, "{}", pen.line).map_err(io)?;
    }
    out.flush().map_err(io)
}

/// A line in the making.
struct Pen<'a> {
    file: &'a str,
    row: usize,
    layout: Layout,
    columns: &'static [Column],
    /// Columns written so far: the number of the last one.
    column: usize,
    line: String,
}

impl Pen<'_> {
    fn push(&mut self, text: &str) {
        if self.column > 0 {
            self.line.push(self.layout.delimiter.text());
        }
        let spaces = self.layout.delimiter == Delimiter::Spaces;
        self.line.push_str(if text.is_empty() && spaces {
            EMPTY
        } else {
            text
        });
        self.column += 1;
    }

    /// A complaint about the column to be written next.
    fn fault(&self, expected: String, found: String) -> GnssError {
        GnssError::Value {
            file: self.file.to_owned(),
            row: self.row,
            column: self.column + 1,
            name: self.columns.get(self.column).map_or("", |c| c.name),
            expected,
            found,
        }
    }

    /// A number in the unit of the file, to the decimals of its column.
    fn real(&mut self, value: f64) -> Result<(), GnssError> {
        let Some(column) = self.columns.get(self.column) else {
            return Err(self.fault("no further column".to_owned(), value.to_string()));
        };
        let mut text = format!("{value:.*}", column.decimals);
        // What counts is the number that will be read.
        let Some(rounded) = text.parse().ok().filter(|&x: &f64| column.holds(x)) else {
            return Err(self.fault(column.range(), value.to_string()));
        };
        if rounded == 0.0 && text.starts_with('-') {
            text.remove(0);
        }
        if self.layout.decimal == Decimal::Comma {
            text = text.replace('.', ",");
        }
        self.push(&text);
        Ok(())
    }

    fn maybe(&mut self, value: Option<f64>) -> Result<(), GnssError> {
        if let Some(value) = value {
            return self.real(value);
        }
        self.push("");
        Ok(())
    }

    fn whole(&mut self, value: Option<u32>) -> Result<(), GnssError> {
        self.maybe(value.map(f64::from))
    }

    fn flag(&mut self, value: Option<bool>) -> Result<(), GnssError> {
        self.maybe(value.map(f64::from))
    }

    fn head(&mut self, head: &Head) -> Result<(), GnssError> {
        for id in [head.leg.equipment, head.leg.drive, head.leg.leg] {
            self.whole(Some(id))?;
        }
        let utc = match head.utc_ms {
            None => Default::default(),
            Some(ms) => time::written(ms, self.layout.decimal.text()).ok_or_else(|| {
                self.fault(
                    "a UTC of the years 1970 to 2261".to_owned(),
                    format!("{ms} ms"),
                )
            })?,
        };
        for text in &utc {
            self.push(text);
        }
        self.whole(head.week)?;
        self.maybe(head.tow_s)?;
        self.real(head.obu_s)
    }
}

fn fix(pen: &mut Pen<'_>, fix: &Fix) -> Result<(), GnssError> {
    pen.head(&fix.head)?;
    pen.flag(fix.good)?;
    pen.whole(fix.fix_type)?;
    pen.real(fix.latitude.to_degrees())?;
    pen.real(fix.longitude.to_degrees())?;
    pen.maybe(fix.ellipsoid_height)?;
    if fix.ellipsoid_height.or(fix.sea_height).is_none() {
        let found = "neither".to_owned();
        return Err(pen.fault("a height here or in column 13".to_owned(), found));
    }
    pen.maybe(fix.sea_height)?;
    pen.maybe(fix.speed)?;
    for angle in [fix.course, fix.yaw, fix.pitch, fix.roll] {
        pen.maybe(angle.map(f64::to_degrees))?;
    }
    pen.maybe(fix.horizontal_error)?;
    pen.maybe(fix.vertical_error)?;
    for value in fix.sd_ned.into_iter().chain([fix.hdop, fix.pdop]) {
        pen.maybe(value)?;
    }
    for axis in 0..3 {
        pen.maybe(fix.velocity_ned.map(|v| v[axis]))?;
    }
    pen.whole(fix.satellites)?;
    pen.maybe(fix.signal)?;
    pen.flag(fix.sbas)?;
    fix.integrity_ned
        .into_iter()
        .try_for_each(|value| pen.maybe(value))
}

fn motion(pen: &mut Pen<'_>, motion: &Motion) -> Result<(), GnssError> {
    pen.head(&motion.head)?;
    motion
        .accel_milli_g()
        .into_iter()
        .chain(motion.rate_milli_deg())
        .try_for_each(|value| pen.real(value))
}
