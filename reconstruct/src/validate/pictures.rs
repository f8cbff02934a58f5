//! Pictures of a validation: calibration, errors over time, errors by class. One SVG a panel, so that a narrow screen
//! can stack them.

use schema::num::real;

use crate::report::axis::{Scale, step_decimals};
use crate::report::svg::{Anchor, Svg, picture};
use crate::validate::measure::{Measure, When};
use crate::validate::score::BACK_S;
use crate::validate::statistics::Share;
use crate::validate::tables::{Figures, LEVELS, find};
use crate::validate::{ALL, ModelTables};

/// Size of a panel.
const SIZE: [f64; 2] = [350.0, 300.0];
/// Plot area: left, top, right, bottom.
const AREA: [f64; 4] = [54.0, 34.0, 336.0, 252.0];
const GRID: &str = "stroke=\"#d5d9de\" stroke-width=\"1\"";
const FRAME: &str = "stroke=\"#474e57\" stroke-width=\"1\"";
const GREY: &str = "fill=\"#474e57\"";
/// One colour an instant, -30 s to 0 s.
const INSTANTS: [&str; 5] = ["#c24e00", "#b8860b", "#2e7d4f", "#1f5a96", "#16191d"];
/// Median, 90th and 95th percentile.
const QUANTILES: [(&str, &str); 3] = [
    ("median", "#16191d"),
    ("90 %", "#1f5a96"),
    ("95 %", "#8fb3d9"),
];

/// Sigmas of a two-sided share, no more than 3.29 (99.9 %): the scale of the calibration plot.
fn sigmas(share: f64) -> f64 {
    crate::stats::two_sided_quantile(share.clamp(0.001, 0.999))
}

/// Coverage found against coverage claimed, of several measures or instants.
struct Series {
    label: String,
    colour: &'static str,
    shares: [Share; 4],
}

/// The calibration plots: position, speed and heading by instant, and the findings at the impact.
#[must_use]
pub fn calibration(tables: &ModelTables) -> Vec<String> {
    let by_time = |measure| -> Vec<Series> {
        (0..BACK_S.len())
            .filter_map(|i| {
                let figures = find(&tables.rows, ALL, measure, When::Back(i))?;
                Some(Series {
                    label: When::Back(i).name().replace('-', "\u{2212}"),
                    colour: INSTANTS.get(i).copied().unwrap_or("#000"),
                    shares: figures.coverage?,
                })
            })
            .collect()
    };
    let impact: Vec<Series> = [
        ("speed", Measure::ImpactSpeed),
        ("delta-V long.", Measure::Longitudinal),
        ("delta-V lat.", Measure::Lateral),
        ("direction", Measure::Pdof),
    ]
    .into_iter()
    .zip(INSTANTS)
    .filter_map(|((label, measure), colour)| {
        let figures = find(&tables.rows, ALL, measure, When::Impact(0))?;
        Some(Series {
            label: label.to_owned(),
            colour,
            shares: figures.coverage?,
        })
    })
    .collect();
    [
        ("Position", by_time(Measure::Position)),
        ("Speed", by_time(Measure::Speed)),
        ("Heading", by_time(Measure::Heading)),
        ("First impact", impact),
    ]
    .into_iter()
    .filter(|(_, series)| !series.is_empty())
    .map(|(title, series)| calibration_panel(title, &series))
    .collect()
}

fn calibration_panel(title: &str, series: &[Series]) -> String {
    let [left, top, right, bottom] = AREA;
    let (low, high) = (sigmas(0.30), sigmas(0.999));
    let x = Scale {
        low,
        high,
        from: left,
        to: right,
    };
    let y = Scale {
        low,
        high,
        from: bottom,
        to: top,
    };
    let mut svg = Svg::new();
    heading(&mut svg, title);
    let of = series.iter().map(|s| s.shares[0].of).max().unwrap_or(0);
    // Where the share found of an honest claim would lie, 95 times in 100.
    let edge = |side: f64| -> Vec<[f64; 2]> {
        (0..=60)
            .map(|i| {
                let z = low + (high - low) * f64::from(i) / 60.0;
                let p = libm::erf(z / std::f64::consts::SQRT_2);
                let spread = side * 1.96 * (p * (1.0 - p) / real(of.max(1))).sqrt();
                [x.at(z), y.at(sigmas((p + spread).clamp(0.31, 0.999)))]
            })
            .collect()
    };
    let mut band = edge(1.0);
    band.extend(edge(-1.0).into_iter().rev());
    svg.polygon(&band, "fill=\"#e3e9f0\"");
    for level in [0.5, 0.8, 0.95, 0.99] {
        let z = sigmas(level);
        svg.line([x.at(z), top], [x.at(z), bottom], GRID);
        svg.line([left, y.at(z)], [right, y.at(z)], GRID);
        let text = format!("{:.0}", level * 100.0);
        svg.text([x.at(z), bottom + 16.0], 12.0, Anchor::Middle, GREY, &text);
        svg.text([left - 6.0, y.at(z) + 4.0], 12.0, Anchor::End, GREY, &text);
    }
    svg.line(
        [x.at(low), y.at(low)],
        [x.at(high), y.at(high)],
        "stroke=\"#474e57\" stroke-width=\"1\" stroke-dasharray=\"4 3\"",
    );
    frame(&mut svg);
    for (i, s) in series.iter().enumerate() {
        let shift = 5.0 * (real(i) - 0.5 * real(series.len() - 1));
        for (share, level) in s.shares.iter().zip(LEVELS) {
            let Some(e) = share.estimate() else { continue };
            let at = x.at(sigmas(level)) + shift;
            let [a, b] = [e.low, e.high].map(|p| y.at(sigmas(p.clamp(0.301, 0.999))));
            let colour = s.colour;
            svg.line(
                [at, a],
                [at, b],
                &format!("stroke=\"{colour}\" stroke-width=\"1.2\""),
            );
            let dot = y.at(sigmas(e.value.clamp(0.301, 0.999)));
            svg.circle([at, dot], 2.8, &format!("fill=\"{colour}\""));
        }
        let row = top + 14.0 + 14.0 * real(i);
        svg.circle(
            [left + 10.0, row - 4.0],
            3.2,
            &format!("fill=\"{}\"", s.colour),
        );
        svg.text([left + 18.0, row], 12.0, Anchor::Start, "", &s.label);
    }
    caption(&mut svg, "claimed, %", "truth inside, %");
    picture(
        SIZE,
        &format!("Calibration: {title}"),
        "Share of crashes with the truth inside the bounds, against the share claimed; on the dashed line the claim is kept.",
        &svg.into_body(),
    )
}

/// Error quantiles over the time before the impact.
#[must_use]
pub fn over_time(tables: &ModelTables) -> Vec<String> {
    [
        ("Position error, m", Measure::Position),
        ("Speed error, m/s", Measure::Speed),
        ("Heading error, deg", Measure::Heading),
    ]
    .into_iter()
    .map(|(title, measure)| {
        let figures: Vec<Option<&Figures>> = (0..BACK_S.len())
            .map(|i| find(&tables.rows, ALL, measure, When::Back(i)))
            .collect();
        time_panel(title, &figures)
    })
    .collect()
}

fn time_panel(title: &str, figures: &[Option<&Figures>]) -> String {
    let [left, top, right, bottom] = AREA;
    let most = figures
        .iter()
        .flatten()
        .map(|f| f.quantiles[2].high)
        .fold(0.0, f64::max);
    let y = Scale {
        low: 0.0,
        high: (1.05 * most).max(1e-6),
        from: bottom,
        to: top,
    };
    let at = |i: usize| left + 26.0 + (right - left - 52.0) * real(i) / 4.0;
    let mut svg = Svg::new();
    heading(&mut svg, title);
    levels(&mut svg, &y);
    for i in 0..figures.len() {
        let name = When::Back(i).name().replace('-', "\u{2212}");
        svg.text([at(i), bottom + 16.0], 12.0, Anchor::Middle, GREY, &name);
    }
    for (q, (label, colour)) in QUANTILES.iter().enumerate() {
        let mut line = Vec::new();
        for (i, f) in figures.iter().enumerate() {
            let Some(e) = f.and_then(|f| f.quantiles.get(q)) else {
                continue;
            };
            line.push([at(i), y.at(e.value)]);
            svg.line(
                [at(i), y.at(e.low)],
                [at(i), y.at(e.high)],
                &format!("stroke=\"{colour}\" stroke-width=\"1.2\""),
            );
            svg.circle([at(i), y.at(e.value)], 2.8, &format!("fill=\"{colour}\""));
        }
        svg.polyline(&line, &format!("stroke=\"{colour}\" stroke-width=\"2\""));
        let row = top + 14.0 + 14.0 * real(q);
        svg.line(
            [right - 70.0, row - 4.0],
            [right - 54.0, row - 4.0],
            &format!("stroke=\"{colour}\" stroke-width=\"2\""),
        );
        svg.text([right - 50.0, row], 12.0, Anchor::Start, "", label);
    }
    frame(&mut svg);
    caption(&mut svg, "before the impact (steps not to scale)", "");
    picture(
        SIZE,
        title,
        "Quantiles of the absolute error at five instants before the impact, with their 95 % intervals.",
        &svg.into_body(),
    )
}

/// Error quantiles by class.
#[must_use]
pub fn by_class(tables: &ModelTables) -> Vec<String> {
    [
        (
            "Position at \u{2212}30 s, % of distance",
            Measure::PositionShare,
            When::Back(0),
        ),
        (
            "Speed at the impact, m/s",
            Measure::ImpactSpeed,
            When::Impact(0),
        ),
        (
            "Delta-V resultant, m/s",
            Measure::Resultant,
            When::Impact(0),
        ),
    ]
    .into_iter()
    .map(|(title, measure, when)| class_panel(tables, title, measure, when))
    .collect()
}

fn class_panel(tables: &ModelTables, title: &str, measure: Measure, when: When) -> String {
    let [_, top, right, bottom] = AREA;
    let left = 66.0;
    let rows: Vec<(&str, &Figures)> = tables
        .found
        .iter()
        .filter_map(|f| {
            Some((
                f.group.as_str(),
                find(&tables.rows, &f.group, measure, when)?,
            ))
        })
        .collect();
    let most = rows
        .iter()
        .map(|(_, f)| f.quantiles[2].value)
        .fold(0.0, f64::max);
    let x = Scale {
        low: 0.0,
        high: (1.08 * most).max(1e-6),
        from: left,
        to: right,
    };
    let mut svg = Svg::new();
    heading(&mut svg, title);
    let (ticks, step) = x.ticks(5.0);
    for tick in ticks {
        svg.line([x.at(tick), top], [x.at(tick), bottom], GRID);
        let text = format!("{tick:.*}", step_decimals(step));
        svg.text(
            [x.at(tick), bottom + 16.0],
            12.0,
            Anchor::Middle,
            GREY,
            &text,
        );
    }
    let pitch = (bottom - top) / real(rows.len().max(1));
    for (i, (name, f)) in rows.iter().enumerate() {
        let middle = top + pitch * (real(i) + 0.5);
        svg.text([left - 6.0, middle + 4.0], 12.0, Anchor::End, "", name);
        for (q, (_, colour)) in QUANTILES.iter().enumerate().rev() {
            let half = [6.0, 4.5, 3.0][2 - q] * (pitch / 30.0).min(1.0) + 1.0;
            let to = x.at(f.quantiles[q].value);
            svg.rect(
                [left, middle - half],
                [to - left, 2.0 * half],
                &format!("fill=\"{colour}\""),
            );
        }
    }
    svg.polyline(&[[left, top], [left, bottom], [right, bottom]], FRAME);
    caption(&mut svg, "dark to light: median, 90 %, 95 %", "");
    picture(
        SIZE,
        title,
        "Median, 90th and 95th percentile of the absolute error of each class.",
        &svg.into_body(),
    )
}

fn heading(svg: &mut Svg, title: &str) {
    svg.text(
        [10.0, 20.0],
        14.0,
        Anchor::Start,
        "font-weight=\"bold\"",
        title,
    );
}

fn caption(svg: &mut Svg, below: &str, beside: &str) {
    let [left, top, right, bottom] = AREA;
    svg.text(
        [f64::midpoint(left, right), bottom + 36.0],
        12.0,
        Anchor::Middle,
        GREY,
        below,
    );
    if !beside.is_empty() {
        let middle = f64::midpoint(top, bottom);
        svg.raw(&format!("<g transform=\"rotate(-90 14 {middle:.1})\">"));
        svg.text([14.0, middle], 12.0, Anchor::Middle, GREY, beside);
        svg.raw("</g>");
    }
}

fn frame(svg: &mut Svg) {
    let [left, top, right, bottom] = AREA;
    svg.polyline(&[[left, top], [left, bottom], [right, bottom]], FRAME);
}

fn levels(svg: &mut Svg, y: &Scale) {
    let [left, _, right, _] = AREA;
    let (ticks, step) = y.ticks(5.0);
    for tick in ticks {
        svg.line([left, y.at(tick)], [right, y.at(tick)], GRID);
        let text = format!("{tick:.*}", step_decimals(step));
        svg.text(
            [left - 6.0, y.at(tick) + 4.0],
            12.0,
            Anchor::End,
            GREY,
            &text,
        );
    }
}
