//! The analysis in words and tables, once for the terminal and the page.

use super::correlated::Figure;
use super::receiver::{Figures, QUANTITIES, Receiver, Summary};
use super::reference::{Aligned, Clock, Delay};
use super::{Analysis, source};
use crate::export::fixed::fixed;
use crate::gnss::rows::Leg;

/// A table; the first column names the rows.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Grid {
    /// Heading.
    pub title: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<String>>,
}

/// A part of the analysis.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Section {
    /// Heading.
    pub title: &'static str,
    /// Sentences.
    pub words: Vec<String>,
    /// Tables.
    pub grids: Vec<Grid>,
    /// Names of the pictures that belong here ([`super::pictures`]).
    pub pictures: &'static [&'static str],
}

impl Grid {
    pub(super) fn new(title: impl Into<String>, head: &[&str]) -> Self {
        Self {
            title: title.into(),
            head: head.iter().map(|h| (*h).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

/// Decimals that show two digits of a standard error.
fn decimals(se: f64) -> usize {
    if se.is_finite() && se > 0.0 {
        schema::num::round_usize((1.0 - se.log10().floor()).clamp(0.0, 6.0))
    } else {
        3
    }
}

/// A number with as many decimals as an error asks for.
pub(super) fn number(x: f64, se: f64) -> String {
    if x.is_finite() {
        fixed(x, decimals(se))
    } else {
        "no bound".to_owned()
    }
}

/// Three digits.
pub(super) fn short(x: f64) -> String {
    number(x, 0.1 * x.abs())
}

/// Value and standard error.
pub(super) fn with_se(f: &Figure) -> String {
    if f.se.is_finite() {
        format!("{} +- {}", number(f.value, f.se), number(f.se, f.se))
    } else {
        format!("{} (error unknown)", short(f.value))
    }
}

/// Value and the interval of 95 %.
pub(super) fn with_ends(value: f64, low: f64, high: f64) -> String {
    let spread = if high.is_finite() { high - low } else { value };
    let se = 0.25 * spread.abs();
    format!(
        "{} [{}, {}]",
        number(value, se),
        number(low, se),
        number(high, se)
    )
}

pub(super) fn ends(f: &Figure) -> String {
    with_ends(f.value, f.low, f.high)
}

/// Who, where.
pub(super) fn name(leg: Leg) -> String {
    format!(
        "equipment {} drive {} leg {}",
        leg.equipment, leg.drive, leg.leg
    )
}

/// All parts, in the order of S00's chapter.
#[must_use]
pub fn sections(a: &Analysis) -> Vec<Section> {
    vec![
        receivers(a),
        super::sensor_tables::variances(a),
        super::sensor_tables::biases(a),
        super::sensor_tables::positions(a),
        super::range_tables::limits(a),
        super::range_tables::allan(a),
    ]
}

fn receivers(a: &Analysis) -> Section {
    let mut out = Section {
        title: "Receiver against reference",
        pictures: &["deviation"],
        ..Section::default()
    };
    let list = match &a.receivers {
        Ok(list) => list,
        Err(why) => {
            out.words.push(why.clone());
            out.pictures = &[];
            out.grids.push(published());
            return out;
        }
    };
    for receiver in list {
        match receiver {
            Ok(r) => one(&mut out, r),
            Err(why) => out.words.push(why.clone()),
        }
    }
    out.words.push("The reference counts as without error where it states none. Deviations of one drive belong together: the intervals allow for their correlation in time, not for another day's satellites.".to_owned());
    out.grids.push(published());
    out
}

fn one(out: &mut Section, r: &Receiver) {
    let name = name(r.leg);
    let clock = match r.clock {
        Clock::Obu => "on the on-board clock",
        Clock::Gps => "in GPS time, in which a delay of the stamps does not show",
    };
    out.words.push(format!(
        "{name}: {} of {} good fixes meet the reference {clock}.",
        r.paired, r.fixes
    ));
    for (what, delay) in [Aligned::Velocity, Aligned::Place]
        .into_iter()
        .zip(&r.delay)
    {
        out.words.push(match delay {
            Ok(d) => delayed(&name, what, d),
            Err(why) => format!("{name}: {why}"),
        });
    }
    let head = [
        "receiver less reference",
        "mean absolute",
        "bias (95 %)",
        "sd (95 %)",
        "rms (95 %)",
        "largest",
        "fixes (worth)",
    ];
    let mut full = |title: String, summary: &Summary, last: bool| {
        let mut grid = Grid::new(title, &head);
        for ((quantity, unit), f) in QUANTITIES.iter().zip(&summary.quantities) {
            grid.row(quantity_row(&format!("{quantity}, {unit}"), f.as_ref()));
        }
        if let Some([half, most]) = &summary.flat {
            for (label, f) in [("horizontal 50 %, m", half), ("horizontal 95 %, m", most)] {
                let mut row = vec![label.to_owned(), ends(f)];
                row.resize(6, String::new());
                row.push(counted(f));
                grid.row(row);
            }
        }
        if last && summary.quantities.iter().flatten().any(|f| f.bias.short) {
            out.words.push(format!(
                "{name}: the deviations stay alike for so long that the log has few independent ones; the intervals marked (short) may be too narrow."
            ));
        }
        out.grids.push(grid);
    };
    full(
        format!("{name}, as stamped"),
        &r.stamped,
        r.shifted.is_none(),
    );
    if let Some(shifted) = &r.shifted {
        full(format!("{name}, the delay taken off"), shifted, true);
    }
    if let (Some(d), Some(speed)) = (r.taken(), r.speed) {
        out.words.push(format!(
            "{name}: the delay's own doubt is not in the intervals of the last table: its standard error of {} s is {} m along the way at the mean speed of {} m/s. It is in what is said of the stated accuracy.",
            number(d.se_s, d.se_s),
            number(d.se_s * speed, d.se_s * speed),
            fixed(speed, 1)
        ));
    }
    for (what, honesty) in ["horizontal", "vertical"].into_iter().zip(&r.honesty) {
        out.words.push(match honesty {
            Ok(h) => format!(
                "{name}: stated {what} accuracy {}: squared deviation over stated variance {} (1 if it holds), inside the stated 95 %: {} of {} fixes worth {}.",
                h.verdict(),
                ends(&h.nees),
                with_ends(h.inside.value, h.inside.low, h.inside.high),
                h.nees.count,
                fixed(h.nees.effective, 0),
            ),
            Err(why) => format!("{name}: stated {what} accuracy: {why}."),
        });
    }
    out.words.push(match r.breaches {
        Some([beyond, of]) => {
            format!("{name}: {beyond} of {of} fixes lie beyond their stated bounds of integrity.")
        }
        None => format!(
            "{name}: bounds of integrity: cannot tell, the log states none (columns 33 to 35)."
        ),
    });
}

fn delayed(name: &str, what: Aligned, d: &Delay) -> String {
    format!(
        "{name}: delay behind the reference by {}: {} s +- {} (95 %: {} to {}; {} fixes{}).",
        what.name(),
        number(d.value_s, d.se_s),
        number(d.se_s, d.se_s),
        number(d.ends_s[0], d.se_s),
        number(d.ends_s[1], d.se_s),
        d.pairs,
        if d.short {
            ", which are short against their correlation: may be too narrow"
        } else {
            ""
        }
    )
}

fn counted(f: &Figure) -> String {
    format!(
        "{} ({}){}",
        f.count,
        fixed(f.effective, usize::from(f.effective < 10.0)),
        if f.short { " (short)" } else { "" }
    )
}

fn quantity_row(name: &str, f: Option<&Figures>) -> Vec<String> {
    let Some(f) = f else {
        let mut row = vec![name.to_owned(), "cannot tell: not in both logs".to_owned()];
        row.resize(7, String::new());
        return row;
    };
    vec![
        name.to_owned(),
        with_se(&f.mean_abs),
        ends(&f.bias),
        f.sd.as_ref().map_or_else(String::new, ends),
        ends(&f.rms),
        number(f.largest, f.mean_abs.se),
        counted(&f.bias),
    ]
}

fn published() -> Grid {
    let mut grid = Grid::new(
        "S00, tables 4.1 to 4.3: mean absolute deviation of the first 1000 fixes",
        &[
            "drive, receiver",
            "latitude, m",
            "longitude, m",
            "height, m",
            "north, m/s",
            "east, m/s",
            "down, m/s",
        ],
    );
    for (drive, table) in source::DEVIATION {
        for (receiver, values) in source::RECEIVERS.into_iter().zip(table) {
            let cells = values.map(|v| v.map_or_else(|| "-".to_owned(), |v| fixed(v, 2)));
            grid.row(std::iter::once(format!("{drive}, {receiver}")).chain(cells));
        }
    }
    grid
}

/// The whole analysis as text for a terminal.
#[must_use]
pub fn text(sections: &[Section]) -> String {
    let mut out = String::new();
    for section in sections {
        out.push_str(section.title);
        out.push('\n');
        out.push_str(&"-".repeat(section.title.len()));
        out.push('\n');
        for sentence in &section.words {
            out.push_str(sentence);
            out.push('\n');
        }
        for grid in &section.grids {
            out.push('\n');
            out.push_str(&drawn(grid));
        }
        out.push('\n');
    }
    out
}

/// A table with its columns in line.
fn drawn(grid: &Grid) -> String {
    let mut out = format!("{}\n", grid.title);
    let columns = grid.head.len();
    let lines = || std::iter::once(&grid.head).chain(&grid.rows);
    // A sentence in a cell runs on over empty ones.
    let alone = |row: &[String], c: usize| row.iter().skip(c + 1).all(String::is_empty);
    let widths: Vec<usize> = (0..columns)
        .map(|c| {
            lines()
                .filter(|r| !(c > 0 && alone(r, c)) || c + 1 == columns)
                .filter_map(|r| r.get(c))
                .map(|s| s.chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    for row in lines() {
        let mut line = String::from("  ");
        for (c, cell) in row.iter().enumerate().take(columns) {
            let room = widths[c].saturating_sub(cell.chars().count());
            if c == 0 || (alone(row, c) && room == 0) {
                line.push_str(cell);
                line.push_str(&" ".repeat(room));
            } else {
                line.push_str(&" ".repeat(room));
                line.push_str(cell);
            }
            line.push_str("  ");
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}
