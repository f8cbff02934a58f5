//! Recordings that others made; they lie outside the project and may be absent.

use std::path::{Path, PathBuf};

use recorder::config::Settings;
use schema::num;

/// The folder of the recordings; `None`, and one printed line, where there is none.
pub fn folder() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    if path.is_dir() {
        return Some(path);
    }
    // Each test says it for itself: the lines are counted.
    eprintln!("skipped: the recordings (../shared/data beside the project) are not here");
    None
}

/// A recording's log as text.
pub fn log(name: &str) -> Option<Vec<u8>> {
    folder().map(|folder| std::fs::read(folder.join(format!("{name}.log"))).unwrap())
}

/// The configuration of a recording as text, with pieces replaced.
pub fn config(name: &str, changes: &[(&str, &str)]) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("config/{name}.toml"));
    let mut text = std::fs::read_to_string(path).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{name}.toml has no `{from}`");
        text = text.replace(from, to);
    }
    text
}

/// Settings of a recording, with pieces of the file replaced.
pub fn settings(name: &str, changes: &[(&str, &str)]) -> Settings {
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("config");
    Settings::from_toml_str(&config(name, changes), &base).unwrap()
}

/// A table of numbers by the name of the column; empty fields are NaN.
pub fn table(name: &str, columns: &[&str]) -> Option<Vec<Vec<f64>>> {
    let text = std::fs::read_to_string(folder()?.join(name)).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let places: Vec<usize> = columns
        .iter()
        .map(|column| head.iter().position(|name| name == column).unwrap())
        .collect();
    let rows = lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            places
                .iter()
                .map(|at| cells[*at].parse().unwrap_or(f64::NAN))
                .collect()
        })
        .collect();
    Some(rows)
}

/// Linear interpolation in a table whose first column is the time; `None` outside it.
pub fn at(rows: &[Vec<f64>], t: f64, column: usize) -> Option<f64> {
    let next = rows.partition_point(|row| row[0] <= t);
    let (a, b) = (rows.get(next.checked_sub(1)?)?, rows.get(next)?);
    let part = (t - a[0]) / (b[0] - a[0]);
    Some(a[column] + part * (b[column] - a[column]))
}

/// North, east, down of a table of time, north, east and up; `None` outside it and where one is missing.
pub fn place(rows: &[Vec<f64>], t: f64) -> Option<[f64; 3]> {
    let part = |column: usize| at(rows, t, column).filter(|x| x.is_finite());
    Some([part(1)?, part(2)?, -part(3)?])
}

/// Median of the values.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Share of true values.
pub fn share(flags: &[bool]) -> f64 {
    num::real(flags.iter().filter(|flag| **flag).count()) / num::real(flags.len().max(1))
}
