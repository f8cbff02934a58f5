//! Reads `trajectory.csv` and truth tables of the shapes in use; every complaint has line and column.

use std::collections::HashMap;
use std::path::Path;

use crate::compare::CompareError;
use crate::trajectory::State;

/// One row of the trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Seconds from the first trigger.
    pub t_s: f64,
    /// North, east, m.
    pub position: [f64; 2],
    /// Velocity north, east, m/s.
    pub velocity: [f64; 2],
    /// Forward speed, m/s.
    pub speed: f64,
    /// Horizontal speed over ground, m/s.
    pub ground_speed: f64,
    /// Heading, rad.
    pub heading: f64,
    /// Variances of north and east, and their covariance, m^2.
    pub covariance: [f64; 3],
    /// One sigma of the forward speed, m/s.
    pub sd_speed: f64,
    /// One sigma of the heading, rad.
    pub sd_heading: f64,
}

/// A trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Rows in order of time.
    pub rows: Vec<Row>,
    /// Unix time of t = 0, s; `None` where no row has UTC.
    pub epoch_s: Option<f64>,
}

impl Trajectory {
    /// Of reconstructed states, without a file between.
    #[must_use]
    pub fn of(states: &[State]) -> Self {
        let row = |s: &State| Row {
            t_s: s.t_s,
            position: [s.position[0], s.position[1]],
            velocity: [s.velocity[0], s.velocity[1]],
            speed: s.speed,
            ground_speed: s.ground_speed,
            heading: s.heading,
            covariance: [s.sd_north.powi(2), s.sd_east.powi(2), s.cov_north_east],
            sd_speed: s.sd_speed,
            sd_heading: s.sd_heading,
        };
        let epoch = |s: &State| Some(schema::num::real_i64(s.utc_ns?) * 1e-9 - s.t_s);
        Self {
            rows: states.iter().map(row).collect(),
            epoch_s: states.first().and_then(epoch),
        }
    }
}

/// One row of the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthRow {
    /// Seconds on the truth's own clock.
    pub t_s: f64,
    /// North, east, m.
    pub position: Option<[f64; 2]>,
    /// Speed, m/s.
    pub speed: Option<f64>,
    /// Heading or course, rad clockwise from the truth's north.
    pub heading: Option<f64>,
}

/// A truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Rows in order of time.
    pub rows: Vec<TruthRow>,
    /// Unix time of t = 0, s, where the table says.
    pub epoch_s: Option<f64>,
    /// True if its frame is the trajectory's own (rest at the origin, north along the car at rest).
    pub same_frame: bool,
    /// True if `heading` is the course over ground.
    pub heading_is_course: bool,
    /// True if `speed` is over ground, not along the body.
    pub speed_is_ground: bool,
}

/// A table as text.
struct Table {
    file: String,
    columns: HashMap<String, usize>,
    rows: Vec<(u64, csv::StringRecord)>,
}

impl Table {
    fn load(path: &Path) -> Result<Self, CompareError> {
        let file = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|error| CompareError::Io {
            file: file.clone(),
            error,
        })?;
        Self::parse(file, &bytes)
    }

    fn parse(file: String, bytes: &[u8]) -> Result<Self, CompareError> {
        let table = |expected: &str, found: String| CompareError::Table {
            file: file.clone(),
            expected: expected.to_owned(),
            found,
        };
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if bytes.iter().all(u8::is_ascii_whitespace) {
            return Err(table("a header line", "an empty file".to_owned()));
        }
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let head = reader
            .headers()
            .map_err(|e| table("a header line of UTF-8 text", e.to_string()))?;
        let mut columns = HashMap::new();
        for (i, name) in head.iter().enumerate() {
            if columns.insert(name.to_owned(), i).is_some() {
                return Err(table("each column once", format!("{name} twice")));
            }
        }
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record
                .map_err(|e| table("as many fields as the header has, in UTF-8", e.to_string()))?;
            let line = record.position().map_or(0, csv::Position::line);
            rows.push((line, record));
        }
        if rows.is_empty() {
            return Err(table(
                "at least one row",
                "a header and nothing else".to_owned(),
            ));
        }
        Ok(Self {
            file,
            columns,
            rows,
        })
    }

    fn has(&self, column: &str) -> bool {
        self.columns.contains_key(column)
    }

    fn need(&self, names: &[&str]) -> Result<(), CompareError> {
        let missing: Vec<&str> = names.iter().copied().filter(|n| !self.has(n)).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let mut found: Vec<&str> = self.columns.keys().map(String::as_str).collect();
        found.sort_unstable();
        Err(CompareError::Table {
            file: self.file.clone(),
            expected: format!("the columns {}", missing.join(", ")),
            found: format!("only {}", found.join(", ")),
        })
    }

    fn cell<'a>(&self, row: &'a csv::StringRecord, column: &str) -> &'a str {
        self.columns
            .get(column)
            .and_then(|i| row.get(*i))
            .unwrap_or("")
    }

    fn fault(&self, line: u64, column: &str, expected: &'static str, found: &str) -> CompareError {
        let found = if found.is_empty() {
            "an empty field".to_owned()
        } else {
            format!("{found:?}")
        };
        CompareError::Cell {
            file: self.file.clone(),
            line,
            column: column.to_owned(),
            expected,
            found,
        }
    }

    /// A number; an empty field or an absent column is `None`.
    fn maybe(
        &self,
        line: u64,
        row: &csv::StringRecord,
        column: &str,
    ) -> Result<Option<f64>, CompareError> {
        let text = self.cell(row, column);
        if text.is_empty() {
            return Ok(None);
        }
        match text.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(Some(x)),
            _ => Err(self.fault(line, column, "a finite number", text)),
        }
    }

    fn number(
        &self,
        line: u64,
        row: &csv::StringRecord,
        column: &str,
    ) -> Result<f64, CompareError> {
        self.maybe(line, row, column)?
            .ok_or_else(|| self.fault(line, column, "a number", ""))
    }

    fn increasing(&self, line: u64, before: Option<f64>, t: f64) -> Result<(), CompareError> {
        if before.is_some_and(|b| t <= b) {
            return Err(self.fault(line, "t_s", "a time after the row before", &t.to_string()));
        }
        Ok(())
    }
}

/// Reads a `trajectory.csv`.
///
/// # Errors
/// [`CompareError`] with line and column of the first thing that is not as it should be.
pub fn trajectory(path: &Path) -> Result<Trajectory, CompareError> {
    parse_trajectory(&Table::load(path)?)
}

fn parse_trajectory(table: &Table) -> Result<Trajectory, CompareError> {
    table.need(&[
        "t_s",
        "utc",
        "north_m",
        "east_m",
        "v_north_mps",
        "v_east_mps",
        "speed_mps",
        "heading_deg",
        "sd_north_m",
        "sd_east_m",
        "cov_north_east_m2",
        "sd_speed_mps",
        "sd_heading_deg",
    ])?;
    let mut rows: Vec<Row> = Vec::with_capacity(table.rows.len());
    let (mut sum, mut count) = (0.0, 0.0);
    let mut first_epoch: Option<f64> = None;
    for (line, text) in &table.rows {
        let number = |column: &str| table.number(*line, text, column);
        let spread = |column: &str| {
            Ok::<f64, CompareError>(table.maybe(*line, text, column)?.unwrap_or(f64::NAN))
        };
        let t_s = number("t_s")?;
        table.increasing(*line, rows.last().map(|r| r.t_s), t_s)?;
        let utc = table.cell(text, "utc");
        if !utc.is_empty() {
            let stamp: jiff::Timestamp = utc
                .parse()
                .map_err(|_| table.fault(*line, "utc", "a time as ISO 8601 with Z", utc))?;
            let epoch = schema::num::real_i64(stamp.as_millisecond()) * 1e-3 - t_s;
            let base = *first_epoch.get_or_insert(epoch);
            sum += epoch - base;
            count += 1.0;
        }
        let velocity = [number("v_north_mps")?, number("v_east_mps")?];
        let ground = table.maybe(*line, text, "ground_speed_mps")?;
        let (n, e) = (spread("sd_north_m")?, spread("sd_east_m")?);
        rows.push(Row {
            t_s,
            position: [number("north_m")?, number("east_m")?],
            velocity,
            speed: number("speed_mps")?,
            ground_speed: ground.unwrap_or_else(|| velocity[0].hypot(velocity[1])),
            heading: number("heading_deg")?.to_radians(),
            covariance: [n * n, e * e, spread("cov_north_east_m2")?],
            sd_speed: spread("sd_speed_mps")?,
            sd_heading: spread("sd_heading_deg")?.to_radians(),
        });
    }
    Ok(Trajectory {
        rows,
        epoch_s: first_epoch.map(|base| base + sum / count),
    })
}

/// Reads a truth table: the simulator's (`north_m, east_m, speed_mps, heading_deg, unix_s`), a survey's
/// (`ref_n_m, ref_e_m, ref_speed_mps`, and `ref_course_deg_cw_from_n` or `ref_yaw_enu_rad`), or a speed only.
///
/// # Errors
/// [`CompareError`] with line and column of the first thing that is not as it should be.
pub fn truth(path: &Path) -> Result<Truth, CompareError> {
    parse_truth(&Table::load(path)?)
}

fn parse_truth(table: &Table) -> Result<Truth, CompareError> {
    table.need(&["t_s"])?;
    let reference = table.has("ref_speed_mps") || table.has("ref_n_m");
    let (north, east, speed) = if reference {
        ("ref_n_m", "ref_e_m", "ref_speed_mps")
    } else {
        ("north_m", "east_m", "speed_mps")
    };
    let placed = table.has(north) && table.has(east);
    if !placed && !table.has(speed) {
        table.need(&[north, east, speed])?;
    }
    let course = table.has("ref_course_deg_cw_from_n");
    let mut rows: Vec<TruthRow> = Vec::with_capacity(table.rows.len());
    let mut epoch_s = None;
    for (line, text) in &table.rows {
        let maybe = |column: &str| table.maybe(*line, text, column);
        let t_s = table.number(*line, text, "t_s")?;
        table.increasing(*line, rows.last().map(|r| r.t_s), t_s)?;
        if let (None, Some(unix)) = (epoch_s, maybe("unix_s")?) {
            epoch_s = Some(unix - t_s);
        }
        let heading = if course {
            maybe("ref_course_deg_cw_from_n")?.map(f64::to_radians)
        } else if reference {
            maybe("ref_yaw_enu_rad")?.map(|yaw| std::f64::consts::FRAC_PI_2 - yaw)
        } else {
            maybe("heading_deg")?.map(f64::to_radians)
        };
        rows.push(TruthRow {
            t_s,
            position: maybe(north)?.zip(maybe(east)?).map(|(n, e)| [n, e]),
            speed: maybe(speed)?,
            heading,
        });
    }
    Ok(Truth {
        rows,
        epoch_s,
        same_frame: !reference && table.has(north),
        heading_is_course: course,
        speed_is_ground: reference,
    })
}

#[cfg(test)]
mod tests {
    use super::{Table, parse_truth};

    fn truth_of(text: &str) -> Result<super::Truth, String> {
        Table::parse("truth.csv".to_owned(), text.as_bytes())
            .and_then(|t| parse_truth(&t))
            .map_err(|e| e.to_string())
    }

    #[test]
    fn shapes_in_use() {
        let survey = truth_of("t_s,ref_e_m,ref_n_m,ref_u_m,ref_speed_mps,ref_course_deg_cw_from_n\n-0.02,0,0,0,,\n1,2,3,0,4.5,90\n").unwrap();
        assert_eq!(survey.rows[1].position, Some([3.0, 2.0]));
        assert!(survey.rows[0].speed.is_none() && survey.heading_is_course && !survey.same_frame);
        let speed_only = truth_of("t_s,speed_mps\n0,15.8\n").unwrap();
        assert!(speed_only.rows[0].position.is_none() && !speed_only.same_frame);
        let own =
            truth_of("t_s,unix_s,north_m,east_m,speed_mps,heading_deg\n1,1700000001,2,3,4,5\n")
                .unwrap();
        assert!(own.same_frame && own.epoch_s == Some(1_700_000_000.0));
    }

    #[test]
    fn complaints_name_line_and_column() {
        for (text, expected) in [
            ("", "truth.csv: expected a header line, found an empty file"),
            ("t_s,speed_mps\n", "found a header and nothing else"),
            ("a,b\n1,2\n", "the columns t_s"),
            ("t_s,foo\n1,2\n", "the columns north_m, east_m, speed_mps"),
            (
                "t_s,speed_mps\n1,2\n2,NaN\n",
                "line 3, column speed_mps: expected a finite number, found \"NaN\"",
            ),
            (
                "t_s,speed_mps\n1,2\n,3\n",
                "line 3, column t_s: expected a number, found an empty field",
            ),
            (
                "t_s,speed_mps\n1,2\n1,3\n",
                "line 3, column t_s: expected a time after the row before",
            ),
            ("t_s,t_s\n1,2\n", "t_s twice"),
            ("t_s,speed_mps\n1,2,3\n", "as many fields"),
        ] {
            let found = truth_of(text).unwrap_err();
            assert!(found.contains(expected), "{found}");
        }
    }
}
