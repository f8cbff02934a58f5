//! Are the bounds honest? Coverage at every level and instant, and the squared errors by the claimed covariance.

use crate::validate::bars::{Bar, least};
use crate::validate::measure::{Measure, When};
use crate::validate::score::BACK_S;
use crate::validate::statistics::Estimate;
use crate::validate::tables::{Figures, LEVELS, Row, find};
use crate::validate::{ALL, ModelTables};

/// Allowed distance of coverage from its level at 50, 80, 95 and 99 %, in percent.
const COVERAGE_SLACK: [f64; 4] = [3.0, 3.0, 2.0, 3.0];
/// Bounds of the mean normalised squared error.
const NEES: [f64; 2] = [0.85, 1.15];
/// Measures of an impact whose bounds must be honest.
const IMPACT_BOUNDS: [Measure; 4] = [
    Measure::ImpactSpeed,
    Measure::Longitudinal,
    Measure::Lateral,
    Measure::Resultant,
];
/// Measures of an instant whose bounds must be honest.
const MOMENT_BOUNDS: [Measure; 3] = [Measure::Position, Measure::Speed, Measure::Heading];

/// The lines of item 4.
pub(super) fn bounds(out: &mut Vec<Bar>, tables: &ModelTables) {
    let places = honest();
    for (measure, when) in &places {
        let figures = find(&tables.rows, ALL, *measure, *when);
        out.push(coverage(*measure, *when, figures));
    }
    let worst = tables
        .rows
        .iter()
        .filter(|r| r.group != ALL && places.contains(&(r.measure, r.when)))
        .filter_map(|r| Some((r, r.figures.coverage.as_ref()?[2].estimate()?)))
        .min_by(|a, b| a.1.value.total_cmp(&b.1.value));
    out.push(least(
        4,
        "inside the 95 % bounds in the worst class",
        worst.map(|(row, e)| {
            (
                format!(
                    "{}, {}, {}",
                    row.group,
                    row.measure.words(),
                    row.when.name()
                ),
                e,
            )
        }),
    ));
    let all = tables
        .rows
        .iter()
        .filter(|r| r.group == ALL && places.contains(&(r.measure, r.when)))
        .filter_map(|r| Some((r, r.figures.coverage.as_ref()?[2].estimate()?)))
        .min_by(|a, b| a.1.value.total_cmp(&b.1.value));
    out.push(least(
        4,
        "inside the 95 % bounds, worst measure over all crashes (the bound of nine-state)",
        all.map(|(row, e)| (format!("{}, {}", row.measure.words(), row.when.name()), e)),
    ));
    out.push(Bar::most(
        4,
        "long half axis at -30 s over the ideal filter's, median",
        tables.width,
        "",
        1.3,
    ));
}

/// Every measure and place whose bounds must be honest.
fn honest() -> Vec<(Measure, When)> {
    let moments = MOMENT_BOUNDS
        .iter()
        .flat_map(|m| (0..BACK_S.len()).map(|i| (*m, When::Back(i))));
    let impacts = IMPACT_BOUNDS.iter().map(|m| (*m, When::Impact(0)));
    moments.chain(impacts).collect()
}

/// Coverage at the four levels and the mean squared error in units of the covariance: both must hold.
fn coverage(measure: Measure, when: When, figures: Option<&Figures>) -> Bar {
    let found = figures.and_then(|f| Some((f.coverage?, f.nees)));
    let percents = found.map(|(shares, _)| shares.map(|share| 100.0 * share.value()));
    let measured = found
        .zip(percents)
        .map_or("not measured".to_owned(), |((shares, nees), p)| {
            let at95 = shares[2].estimate().map_or(String::new(), |e| {
                format!(" (95 %: {:.1} to {:.1})", 100.0 * e.low, 100.0 * e.high)
            });
            let nees = nees.map_or("no NEES".to_owned(), |e| {
                format!("NEES/n {:.2} ({:.2} to {:.2})", e.value, e.low, e.high)
            });
            format!(
                "{} %{at95}; {nees}",
                p.map(|x| format!("{x:.1}")).join(" / ")
            )
        });
    let near = |p: [f64; 4]| {
        p.iter()
            .zip(LEVELS)
            .zip(COVERAGE_SLACK)
            .all(|((x, level), slack)| (x - 100.0 * level).abs() <= slack + 1e-9)
    };
    let honest =
        |nees: Option<Estimate>| nees.is_some_and(|e| (NEES[0]..=NEES[1]).contains(&e.value));
    Bar {
        item: 4,
        what: format!(
            "{}, {}: inside the 50 / 80 / 95 / 99 % bounds",
            measure.words(),
            when.name()
        ),
        measured,
        bar: format!(
            "within 3 / 3 / 2 / 3 points; NEES/n {} to {}",
            NEES[0], NEES[1]
        ),
        met: found
            .zip(percents)
            .map(|((_, nees), p)| near(p) && honest(nees)),
        firm: None,
    }
}

/// The measure with the least coverage at the 95 % level among rows of one group.
#[must_use]
pub fn worst(rows: &[Row]) -> Option<(Measure, When, Estimate)> {
    let places = honest();
    rows.iter()
        .filter(|r| places.contains(&(r.measure, r.when)))
        .filter_map(|r| {
            let share = r.figures.coverage.as_ref()?[2].estimate()?;
            Some((r.measure, r.when, share))
        })
        .min_by(|a, b| a.2.value.total_cmp(&b.2.value))
}
