//! The tables for a terminal: plain ASCII.

use std::fmt::Write as _;

use crate::validate::measure::{Measure, When};
use crate::validate::score::BACK_S;
use crate::validate::tables::{Figures, find};
use crate::validate::{ModelTables, SetResult, Validation};

/// Failures named one by one on the screen; the rest are counted.
const NAMED: usize = 10;

/// What must hold, every model beside the other's list.
#[must_use]
pub fn summary(v: &Validation) -> String {
    let mut out = String::new();
    for tables in &v.set.models {
        let bars = v.bars(tables);
        let count = |met| bars.iter().filter(|b| b.met == met).count();
        let _ = writeln!(
            out,
            "{}: {} bars met, {} not met, {} not measured",
            tables.model,
            count(Some(true)),
            count(Some(false)),
            count(None)
        );
        if let Some(text) = tables.left_out() {
            let _ = writeln!(out, "{text}");
        }
        for bar in &bars {
            let _ = writeln!(
                out,
                "{} {:<19} {}: {}; bar: {}",
                bar.item,
                bar.verdict_in_words(),
                bar.what,
                bar.measured,
                bar.bar
            );
        }
        out.push('\n');
    }
    for unused in &v.unused {
        let _ = writeln!(out, "not used: {}: {}", unused.name, unused.reason);
    }
    out
}

/// Every table of a set.
#[must_use]
pub fn screen(set: &SetResult) -> String {
    let mut out = String::new();
    for tables in set.models.iter().filter(|t| !t.rows.is_empty()) {
        model(&mut out, tables);
    }
    if !set.failures.is_empty() {
        let _ = writeln!(out, "not scored: {}", set.failures.len());
        for failure in set.failures.iter().take(NAMED) {
            let _ = writeln!(
                out,
                "  {} by {}: {}",
                failure.crash, failure.model, failure.reason
            );
        }
        if set.failures.len() > NAMED {
            let _ = writeln!(out, "  and {} more", set.failures.len() - NAMED);
        }
    }
    out
}

fn model(out: &mut String, tables: &ModelTables) {
    let _ = writeln!(
        out,
        "{}: errors median/95th percentile (% of distance: median/90th), truth inside the 50/80/95/99 % bounds in %, NEES/n, \
         width: long half axis of the 95 % ellipse",
        tables.model
    );
    let _ = writeln!(
        out,
        "{:<8} {:>5} {:>5} {:>13} {:>11} {:>14} {:>5} {:>6} {:>11} {:>14} {:>5} {:>11} {:>14} {:>5}",
        "class",
        "t",
        "n",
        "position m",
        "% of dist.",
        "inside %",
        "NEES",
        "width",
        "speed m/s",
        "inside %",
        "NEES",
        "heading deg",
        "inside %",
        "NEES"
    );
    for found in &tables.found {
        for place in 0..BACK_S.len() {
            moment(out, tables, &found.group, place);
        }
    }
    let _ = writeln!(
        out,
        "{:<8} {:>8} {:>5} {:>9} {:>11} {:>14} {:>5} {:>11} {:>11} {:>9} {:>14} {:>14} {:>9} {:>9}",
        "class",
        "impact",
        "n",
        "onset ms",
        "speed m/s",
        "inside %",
        "NEES",
        "dv lon % *",
        "dv lat % *",
        "pdof p95",
        "lon inside %",
        "lat inside %",
        "NEES lon",
        "NEES lat"
    );
    for found in &tables.found {
        for place in 0..2 {
            impact(out, tables, &found.group, place);
        }
    }
    let _ = writeln!(
        out,
        "* rms(error)/rms(true resultant), then the rms of the ratios error/true resultant of each crash"
    );
    for found in tables.found.iter().take(1) {
        let _ = writeln!(
            out,
            "scored {} of {}; impacts found {} of {}, false {}; rest found {} of {}",
            found.scored.hits,
            found.scored.of,
            found.impacts.hits,
            found.impacts.of,
            found.false_impacts,
            found.rest.hits,
            found.rest.of
        );
    }
    if let Some(width) = tables.width {
        let _ = writeln!(
            out,
            "long half axis at -30 s over the ideal filter's, median: {:.2} ({:.2} to {:.2})",
            width.value, width.low, width.high
        );
    }
    out.push('\n');
}

fn moment(out: &mut String, tables: &ModelTables, group: &str, place: usize) {
    let when = When::Back(place);
    let row = |measure| find(&tables.rows, group, measure, when);
    let Some(position) = row(Measure::Position) else {
        return;
    };
    let speed = row(Measure::Speed);
    let heading = row(Measure::Heading);
    let _ = writeln!(
        out,
        "{group:<8} {:>5} {:>5} {:>13} {:>11} {:>14} {:>5} {:>6} {:>11} {:>14} {:>5} {:>11} {:>14} {:>5}",
        when.name(),
        position.n,
        pair(Some(position), 2, 2),
        pair(row(Measure::PositionShare), 1, 2),
        inside(Some(position)),
        nees(Some(position)),
        row(Measure::Axis).map_or("-".to_owned(), |f| format!("{:.2}", f.quantiles[0].value)),
        pair(speed, 2, 3),
        inside(speed),
        nees(speed),
        pair(heading, 2, 2),
        inside(heading),
        nees(heading)
    );
}

fn impact(out: &mut String, tables: &ModelTables, group: &str, place: usize) {
    let when = When::Impact(place);
    let row = |measure| find(&tables.rows, group, measure, when);
    let Some(speed) = row(Measure::ImpactSpeed) else {
        return;
    };
    let two = |a: Measure, b: Measure| {
        let rms = |m| row(m).map_or(f64::NAN, |f: &Figures| f.rms.value);
        format!("{:.2}/{:.2}", rms(a), rms(b))
    };
    let (lon, lat) = (row(Measure::Longitudinal), row(Measure::Lateral));
    let _ = writeln!(
        out,
        "{group:<8} {:>8} {:>5} {:>9} {:>11} {:>14} {:>5} {:>11} {:>11} {:>9} {:>14} {:>14} {:>9} {:>9}",
        when.name(),
        speed.n,
        pair(row(Measure::Onset), 2, 1),
        pair(Some(speed), 2, 3),
        inside(Some(speed)),
        nees(Some(speed)),
        two(Measure::LongitudinalPooled, Measure::LongitudinalShare),
        two(Measure::LateralPooled, Measure::LateralShare),
        row(Measure::Pdof).map_or("-".to_owned(), |f| format!("{:.2}", f.quantiles[2].value)),
        inside(lon),
        inside(lat),
        nees(lon),
        nees(lat)
    );
}

/// Median and another quantile.
fn pair(figures: Option<&Figures>, other: usize, digits: usize) -> String {
    figures.map_or("-".to_owned(), |f| {
        let [a, b] = [0, other].map(|i| f.quantiles.get(i).map_or(f64::NAN, |q| q.value));
        format!("{a:.digits$}/{b:.digits$}")
    })
}

fn inside(figures: Option<&Figures>) -> String {
    figures
        .and_then(|f| f.coverage)
        .map_or("-".to_owned(), |shares| {
            shares
                .map(|s| format!("{:.0}", 100.0 * s.value()))
                .join("/")
        })
}

fn nees(figures: Option<&Figures>) -> String {
    figures
        .and_then(|f| f.nees)
        .map_or("-".to_owned(), |n| format!("{:.2}", n.value))
}
