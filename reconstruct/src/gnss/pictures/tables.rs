//! Tables of the pages, and the same as text.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::gnss::outages::{Curve, Mean, Row, Study};
use crate::gnss::stands::{Count, SOURCE, per_100};
use crate::report::tables::{row, table};
use crate::validate::statistics::Estimate;

/// `5.4 ± 0.3`; the plain number where one value has no error.
pub(super) fn with_error(mean: Option<Mean>) -> String {
    mean.map_or_else(
        || "cannot tell".to_owned(),
        |m| {
            if m.error.abs() < 1e-12 {
                format!("{:.1} (each of {})", m.mean, m.count)
            } else if m.error.is_finite() {
                // An error of 0.0 is none: one digit of it at least.
                let digits = if m.error < 0.005 {
                    3
                } else {
                    1 + usize::from(m.error < 0.05)
                };
                format!("{:.digits$} \u{b1} {:.digits$}", m.mean, m.error)
            } else {
                format!("{:.1} (one value)", m.mean)
            }
        },
    )
}

/// A figure of which a tenth is shown; a smaller one is said to be so.
pub(super) fn small(x: f64, unit: &str) -> String {
    if x < 0.05 {
        format!("below 0.05 {unit}")
    } else {
        format!("{x:.1} {unit}")
    }
}

fn rate(e: Option<Estimate>) -> String {
    e.map_or_else(
        || "cannot tell".to_owned(),
        |e| format!("{:.1} ({:.1} to {:.1})", e.value, e.low, e.high),
    )
}

const HEAD: [&str; 8] = [
    "detector",
    "seconds",
    "standing",
    "missed",
    "false",
    "missed in 100 s",
    "false in 100 s",
    "stands found",
];

fn cells(c: &Count) -> Vec<String> {
    vec![
        c.seconds.to_string(),
        c.still.to_string(),
        c.missed.to_string(),
        c.false_ones.to_string(),
        rate(per_100(c.missed, c.seconds)),
        rate(per_100(c.false_ones, c.seconds)),
        format!(
            "{} of {}, {} false",
            c.stands.hits, c.stands.of, c.false_spans
        ),
    ]
}

fn source() -> Vec<String> {
    let [wrong, seconds] = SOURCE;
    vec![
        seconds.to_string(),
        "not said".to_owned(),
        wrong.to_string(),
        "0".to_owned(),
        rate(per_100(wrong, seconds)),
        rate(per_100(0, seconds)),
        "not said".to_owned(),
    ]
}

const SOURCE_NAME: &str = "S00's own drives, table 4.8";

/// Stop errors as in [S00, table 4.8], for a page.
#[must_use]
pub(super) fn stops(counts: &[Count]) -> String {
    let mut rows = String::new();
    for c in counts {
        row(&mut rows, c.name, &cells(c));
    }
    row(&mut rows, SOURCE_NAME, &source());
    table("plain rows", &HEAD, &rows)
}

fn aligned(head: &[&str], lines: &[Vec<String>]) -> String {
    let widths: Vec<usize> = (0..head.len())
        .map(|i| {
            let cells = lines
                .iter()
                .filter_map(|l| l.get(i))
                .map(|c| c.chars().count());
            cells.max().unwrap_or(0).max(head[i].chars().count())
        })
        .collect();
    let head: Vec<String> = head.iter().map(|h| (*h).to_owned()).collect();
    let mut out = String::new();
    for line in std::iter::once(&head).chain(lines) {
        for (i, cell) in line.iter().enumerate() {
            let w = widths[i];
            let _ = if i == 0 {
                write!(out, "{cell:w$}")
            } else {
                write!(out, "  {cell:>w$}")
            };
        }
        out.truncate(out.trim_end().len());
        out.push('\n');
    }
    out
}

/// The same as text.
#[must_use]
pub fn stops_text(counts: &[Count]) -> String {
    let named = |name: &str, cells: Vec<String>| {
        let mut line = vec![name.to_owned()];
        line.extend(cells);
        line
    };
    let mut lines: Vec<Vec<String>> = counts.iter().map(|c| named(c.name, cells(c))).collect();
    lines.push(named(SOURCE_NAME, source()));
    aligned(&HEAD, &lines)
}

/// The same for a machine.
#[must_use]
pub fn stops_json(counts: &[Count]) -> Value {
    let interval = |e: Option<Estimate>| e.map(|e| json!([e.value, e.low, e.high]));
    counts
        .iter()
        .map(|c| {
            json!({
                "detector": c.key, "seconds": c.seconds, "standing": c.still, "missed": c.missed, "false": c.false_ones,
                "missed_in_100_s": interval(per_100(c.missed, c.seconds)),
                "false_in_100_s": interval(per_100(c.false_ones, c.seconds)),
                "stands": c.stands.of, "stands_found": c.stands.hits, "false_stands": c.false_spans,
            })
        })
        .collect()
}

const STUDY_HEAD: [&str; 9] = [
    "experiment",
    "filter",
    "outages",
    "at their ends, m",
    "largest, m",
    "windows",
    "largest of a window, m",
    "inside 95 %",
    "S00, m",
];

fn filters(r: &Row) -> [(&'static str, Option<&Curve>); 3] {
    [
        ("published", r.published.as_ref()),
        ("ours", r.ours.as_ref()),
        ("ours, smoothed", r.smoothed.as_ref()),
    ]
}

fn study_lines(study: &Study) -> Vec<Vec<String>> {
    let mut lines = Vec::new();
    for r in &study.rows {
        for (name, curve) in filters(r) {
            let Some(c) = curve else { continue };
            let ends = c.at_ends();
            let inside = c.inside().filter(|_| name != "published");
            lines.push(vec![
                r.experiment.name(),
                name.to_owned(),
                ends.map_or(0, |m| m.count).to_string(),
                with_error(ends),
                ends.map_or_else(String::new, |m| format!("{:.1}", m.largest)),
                c.at_worst().map_or(0, |m| m.count).to_string(),
                with_error(c.at_worst()),
                inside.map_or_else(
                    || "-".to_owned(),
                    |(share, error, n)| {
                        let half = if error.is_finite() && error > 0.0 {
                            format!(" \u{b1} {:.0}", 100.0 * error)
                        } else {
                            String::new()
                        };
                        format!("{:.0}{half} % of {n} s", 100.0 * share)
                    },
                ),
                r.experiment
                    .source_m()
                    .map_or_else(|| "-".to_owned(), |m| format!("about {m:.0}")),
            ]);
        }
    }
    lines
}

/// The outage study for a page.
#[must_use]
pub(super) fn study(study: &Study) -> String {
    let mut rows = String::new();
    for line in study_lines(study) {
        row(&mut rows, &line[0], &line[1..]);
    }
    table("plain rows", &STUDY_HEAD, &rows)
}

/// The same as text.
#[must_use]
pub fn study_text(study: &Study) -> String {
    aligned(&STUDY_HEAD, &study_lines(study))
}

/// The same for a machine; the mean and its standard error are null where nothing was measured, the error where one value
/// was.
#[must_use]
pub fn study_json(study: &Study) -> Value {
    let mean = |m: Option<Mean>| {
        m.map(|m| json!({ "count": m.count, "mean": m.mean, "standard_error": m.error, "largest": m.largest }))
    };
    let mut rows = Vec::new();
    for r in &study.rows {
        for (name, curve) in filters(r) {
            let Some(c) = curve else { continue };
            // Its variances are those of the Earth's axes, not of north and east: as in the table.
            let told = c.inside().filter(|_| name != "published");
            let inside = told.map(|(share, error, n)| {
                json!({ "share": share, "standard_error": error, "seconds": n })
            });
            rows.push(json!({
                "experiment": r.experiment.name(), "filter": name, "at_ends_m": mean(c.at_ends()),
                "largest_of_windows_m": mean(c.at_worst()), "inside_95": inside, "source_m": r.experiment.source_m(),
            }));
        }
    }
    json!({ "rows": rows, "notes": study.notes })
}
