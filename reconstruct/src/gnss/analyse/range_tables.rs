//! Tables of what the sensors' range and noise tell.

use super::allan::Coefficient;
use super::limits::{AXES, Event, Kind};
use super::spans::Situation;
use super::tables::{Grid, Section, number, short};
use super::{Analysis, source};
use crate::export::fixed::fixed;

/// Events listed; the rest is counted.
const LISTED: usize = 40;

pub(super) fn limits(a: &Analysis) -> Section {
    let mut out = Section {
        title: "Wrap and saturation",
        pictures: &["limits"],
        ..Section::default()
    };
    let events = match &a.events {
        Ok(events) => events,
        Err(why) => {
            out.words.push(why.clone());
            out.pictures = &[];
            return out;
        }
    };
    if events.is_empty() {
        out.pictures = &[];
        out.words.push("None found: no gyro output wraps, and no axis is held at a limit. S00's gyro wrapped at about 0.6 rad/s (34.4 deg/s) [S00, 5.2].".to_owned());
        return out;
    }
    out.words.push(format!(
        "{} found. The values in the log are left as they are: an unwrapped value is told here and used nowhere. S00's gyro wrapped at about {} rad/s [S00, 5.2].",
        events.len(),
        source::WRAP
    ));
    if events.len() > LISTED {
        out.words.push(format!(
            "The first {LISTED} are listed; analysis.json has all."
        ));
    }
    let mut grid = Grid::new(
        "Ends of the range, rad/s or m/s^2",
        &[
            "what",
            "axis",
            "s of the box's clock",
            "line",
            "samples",
            "before, then",
            "limit",
            "unwrapped",
            "confidence",
        ],
    );
    for event in events.iter().take(LISTED) {
        grid.row(event_row(event));
    }
    out.grids.push(grid);
    out
}

fn event_row(e: &Event) -> Vec<String> {
    let (what, unwrapped) = match &e.kind {
        Kind::Wrap { unwrapped, why } => (
            "wrap",
            unwrapped.map_or_else(|| format!("cannot tell: {why}"), short),
        ),
        Kind::Saturated => ("saturation", String::new()),
        Kind::Dead => ("one value only", String::new()),
    };
    let limit = match e.limit_se {
        Some(se) if se > 0.0 => format!("{} +- {}", number(e.limit, se), number(se, se)),
        _ => number(e.limit, 1e-3),
    };
    let before = if e.values[0].is_finite() {
        short(e.values[0])
    } else {
        "-".to_owned()
    };
    vec![
        what.to_owned(),
        AXES.get(e.axis).copied().unwrap_or_default().to_owned(),
        format!("{} to {}", fixed(e.span_s[0], 2), fixed(e.span_s[1], 2)),
        e.line.to_string(),
        e.samples.to_string(),
        format!("{before}, {}", short(e.values[1])),
        limit,
        unwrapped,
        e.confidence.name().to_owned(),
    ]
}

pub(super) fn allan(a: &Analysis) -> Section {
    let mut out = Section {
        title: "Allan deviation",
        pictures: &["allan-gyro", "allan-accelerometer"],
        ..Section::default()
    };
    let allan = match &a.allan {
        Ok(allan) => allan,
        Err(why) => {
            out.words.push(why.clone());
            out.pictures = &[];
            return out;
        }
    };
    out.words.push(format!(
        "{} {} ({}), {} s together, the longest {} s.{}",
        allan.spans,
        if allan.spans == 1 { "span" } else { "spans" },
        allan.situation.name(),
        fixed(allan.total_s, 0),
        fixed(allan.longest_s, 0),
        if allan.situation == Situation::Stop {
            " The engine's vibration is in it."
        } else {
            ""
        }
    ));
    let mut grid = Grid::new(
        "Noise (95 %), in rad and m/s^2",
        &[
            "axis",
            "white noise at 1 s, unit/sqrt(Hz)",
            "bias instability",
            "random walk, unit/sqrt(s)",
        ],
    );
    for (axis, curve) in AXES.into_iter().zip(&allan.curves).cycle().skip(3).take(6) {
        let cell = |c: &Result<Coefficient, String>| match c {
            Ok(c) => scientific(c),
            Err(why) => why.clone(),
        };
        grid.row([
            axis.to_owned(),
            cell(&curve.white),
            cell(&curve.floor),
            cell(&curve.walk),
        ]);
    }
    out.grids.push(grid);
    out
}

fn scientific(c: &Coefficient) -> String {
    format!("{:.3e} [{:.2e}, {:.2e}]", c.value, c.low, c.high)
}
