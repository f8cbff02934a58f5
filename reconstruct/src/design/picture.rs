//! `design.svg`: the expected funnels nested in plan view, the ellipses side by side, the bounds over time.

use schema::num;

use super::chart::{self, Curve};
use super::expect::{Expected, Row, Study};
use super::table::digits;
use crate::export::ellipse::{self, Ellipse};
use crate::report::labels::Area;
use crate::report::number::{KMH, percent};
use crate::report::svg::{self, Anchor, Svg, signed, text_width};
use crate::stats::two_sided_quantile;
use crate::trajectory::State;

/// Plan view and the page of ellipses, picture units.
const PANEL: [f64; 2] = [640.0, 640.0];
/// One panel over time.
const CHART: [f64; 2] = [426.0, 330.0];
/// The legend.
const LEGEND_HEIGHT: f64 = 40.0;
/// Line colours that stay apart for colour-blind eyes and in grey, and a dash for each.
const LINES: [(&str, &str); 7] = [
    ("#0b3c6f", ""),
    ("#009e73", "9 3"),
    ("#7a5195", "2 3"),
    ("#c05a00", "12 3 2 3"),
    ("#b0204c", "5 3"),
    ("#4a4a4a", "1 3"),
    ("#2a8fbd", "14 4"),
];

/// Line colour and dash of the sheet at a place in the list.
pub(super) fn line(at: usize) -> (&'static str, &'static str) {
    LINES[at % LINES.len()]
}

fn stroke(at: usize, width: f64) -> String {
    let (color, dash) = line(at);
    let dash = if dash.is_empty() {
        String::new()
    } else {
        format!(" stroke-dasharray=\"{dash}\"")
    };
    format!("stroke=\"{color}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"{dash}")
}

/// The line of the sheet at a place in the list, as a small picture for a legend in text.
pub(super) fn swatch(at: usize) -> String {
    let mut svg = Svg::new();
    svg.line([0.0, 5.0], [44.0, 5.0], &stroke(at, 3.0));
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"44\" height=\"10\" aria-hidden=\"true\">{}</svg>",
        svg.into_body().trim_end()
    )
}

/// The parts, each drawn once for the file and the page.
#[derive(Clone, Debug)]
pub struct Picture {
    legend: String,
    plan: String,
    ellipses: String,
    charts: [String; 3],
    description: String,
}

impl Picture {
    /// Draws a study.
    #[must_use]
    pub fn draw(study: &Study) -> Self {
        let bounds = percent(study.settings.confidence);
        Self {
            legend: legend(study),
            plan: plan(study),
            ellipses: ellipses(study),
            charts: charts(study),
            description: format!(
                "Expected {bounds} bounds of {} on the manoeuvre {}.",
                study
                    .expected
                    .iter()
                    .map(|e| e.sheet.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", "),
                study.plan.name
            ),
        }
    }

    /// Everything in one picture: the file.
    #[must_use]
    pub fn file(&self) -> String {
        let size = [2.0 * PANEL[0], LEGEND_HEIGHT + PANEL[1] + CHART[1]];
        let mut svg = Svg::new();
        svg.rect([0.0, 0.0], size, "fill=\"#fff\"");
        svg.raw(&self.legend);
        let mut place = |x: f64, y: f64, body: &str| {
            svg.raw(&format!("<g transform=\"translate({x} {y})\">"));
            svg.raw(body);
            svg.raw("</g>");
        };
        place(0.0, LEGEND_HEIGHT, &self.plan);
        place(PANEL[0], LEGEND_HEIGHT, &self.ellipses);
        for (i, chart) in self.charts.iter().enumerate() {
            place(CHART[0] * num::real(i), LEGEND_HEIGHT + PANEL[1], chart);
        }
        svg::file(&svg::picture(
            size,
            "Expected funnels",
            &self.description,
            &svg.into_body(),
        ))
    }

    fn part(&self, size: [f64; 2], title: &str, body: &str) -> String {
        svg::picture(size, title, &self.description, body)
    }

    /// The plan view.
    #[must_use]
    pub fn plan(&self) -> String {
        self.part(PANEL, "Expected funnels in plan view", &self.plan)
    }

    /// The ellipses.
    #[must_use]
    pub fn ellipses(&self) -> String {
        self.part(PANEL, "Expected ellipses at four instants", &self.ellipses)
    }

    /// The bounds over time.
    #[must_use]
    pub fn charts(&self) -> [String; 3] {
        self.charts
            .each_ref()
            .map(|body| self.part(CHART, "Expected bounds over time", body))
    }
}

fn legend(study: &Study) -> String {
    let mut svg = Svg::new();
    let names: f64 = study
        .expected
        .iter()
        .map(|e| text_width(&e.sheet.name, 16.0) + 76.0)
        .sum();
    // Many or long names share the width.
    let squeeze = (2.0 * PANEL[0] - 40.0) / names.max(2.0 * PANEL[0] - 40.0);
    let mut x = 20.0;
    for (i, e) in study.expected.iter().enumerate() {
        svg.line([x, 22.0], [x + 40.0 * squeeze, 22.0], &stroke(i, 3.0));
        svg.text(
            [x + 48.0 * squeeze, 27.0],
            16.0 * squeeze,
            Anchor::Start,
            "",
            &e.sheet.name,
        );
        x += (text_width(&e.sheet.name, 16.0) + 76.0) * squeeze;
    }
    svg.into_body()
}

/// States up to the moment the car stands.
fn moving(e: &Expected) -> &[State] {
    let last = e
        .states
        .iter()
        .rposition(|s| s.ground_speed > 0.05)
        .map_or(e.states.len(), |k| k + 1);
    e.states.get(..last).unwrap_or(&e.states)
}

/// Sheets with the widest funnel first, so that the narrower ones lie on top.
fn widest_first(study: &Study) -> Vec<usize> {
    let width = |i: usize| {
        study.expected[i]
            .rows
            .first()
            .map_or(0.0, |r| r.ellipse.semi_major)
    };
    let mut order: Vec<usize> = (0..study.expected.len()).collect();
    order.sort_by(|a, b| width(*b).total_cmp(&width(*a)));
    order
}

fn frame(svg: &mut Svg, area: Area) {
    svg.rect(
        [area.x, area.y],
        [area.w, area.h],
        "fill=\"none\" stroke=\"#333\" stroke-width=\"1\"",
    );
}

fn plan(study: &Study) -> String {
    let mut svg = Svg::new();
    svg.rect([0.0, 0.0], PANEL, "fill=\"#fff\"");
    svg.text(
        [56.0, 24.0],
        18.0,
        Anchor::Start,
        "font-weight=\"bold\"",
        "Expected funnels, nested, to scale (m)",
    );
    let area = Area {
        x: 56.0,
        y: 36.0,
        w: PANEL[0] - 70.0,
        h: PANEL[1] - 96.0,
    };
    let confidence = study.settings.confidence;
    let mut points = Vec::new();
    let outlines: Vec<_> = study
        .expected
        .iter()
        .map(|e| ellipse::outline(moving(e), None, confidence))
        .collect();
    for outline in &outlines {
        points.extend(outline.iter().flatten().flatten().map(|p| [p[1], p[0]]));
    }
    let [x, y] = chart::axes(&mut svg, area, &points, 14.0);
    let at = |p: [f64; 2]| [x.at(p[1]), y.at(p[0])];
    for i in widest_first(study) {
        let color = line(i).0;
        for polygon in &outlines[i] {
            let rings: Vec<Vec<[f64; 2]>> = polygon
                .iter()
                .map(|ring| ring.iter().map(|p| at(*p)).collect())
                .collect();
            svg.rings(
                &rings,
                &format!(
                    "fill=\"{color}\" fill-opacity=\"0.13\" stroke=\"{color}\" stroke-width=\"1.3\""
                ),
            );
        }
    }
    if let Some(e) = study.expected.first() {
        let path: Vec<[f64; 2]> = ellipse::thinned(moving(e), 5)
            .map(|s| at([s.position[0], s.position[1]]))
            .collect();
        svg.polyline(&path, "stroke=\"#111\" stroke-width=\"1.4\"");
        marks(&mut svg, study, e, at);
    }
    frame(&mut svg, area);
    let zero = if study.has_impact { "impact" } else { "rest" };
    svg.text(
        [area.x, PANEL[1] - 20.0],
        14.0,
        Anchor::Start,
        "fill=\"#333\"",
        &format!("up: the car's forward axis at rest; origin: rest; dots: seconds from the {zero}"),
    );
    svg.into_body()
}

fn marks(svg: &mut Svg, study: &Study, e: &Expected, at: impl Fn([f64; 2]) -> [f64; 2]) {
    let zero = if study.has_impact { "impact" } else { "rest" };
    for row in &e.rows {
        if row.t_s > -2.0 && row.t_s < 0.0 {
            continue;
        }
        let p = at(row.ellipse.centre);
        svg.circle(p, 3.5, "fill=\"#111\"");
        let text = if row.t_s < 0.0 {
            format!("{} s", signed(row.t_s, 0))
        } else {
            zero.to_owned()
        };
        let w = text_width(&text, 14.0);
        let left = p[0] + 26.0 + w > PANEL[0] - 14.0;
        let x = if left { p[0] - 26.0 - w } else { p[0] + 24.0 };
        svg.line(
            p,
            [if left { p[0] - 22.0 } else { p[0] + 22.0 }, p[1]],
            "stroke=\"#111\" stroke-width=\"0.8\"",
        );
        svg.rect(
            [x - 2.0, p[1] - 8.0],
            [w + 4.0, 17.0],
            "fill=\"#fff\" fill-opacity=\"0.8\"",
        );
        svg.text([x, p[1] + 5.0], 14.0, Anchor::Start, "", &text);
    }
}

/// Four instants, each with its own scale: ellipses about one centre, the direction of travel up.
fn ellipses(study: &Study) -> String {
    let mut svg = Svg::new();
    svg.rect([0.0, 0.0], PANEL, "fill=\"#fff\"");
    svg.text(
        [56.0, 24.0],
        18.0,
        Anchor::Start,
        "font-weight=\"bold\"",
        "Ellipse of the instant, direction of travel up (m)",
    );
    let Some(first) = study.expected.first() else {
        return svg.into_body();
    };
    let times: Vec<f64> = first.rows.iter().map(|r| r.t_s).take(4).collect();
    for (cell, t_s) in times.iter().enumerate() {
        let (column, line) = (num::real(cell % 2), num::real(cell / 2));
        let area = Area {
            x: 56.0 + column * 298.0,
            y: 60.0 + line * 296.0,
            w: 236.0,
            h: 236.0,
        };
        instant(&mut svg, study, *t_s, area);
    }
    svg.into_body()
}

fn row_at(e: &Expected, t_s: f64) -> Option<&Row> {
    e.rows.iter().find(|r| (r.t_s - t_s).abs() < 1e-9)
}

fn instant(svg: &mut Svg, study: &Study, t_s: f64, area: Area) {
    svg.text(
        [area.x, area.y - 7.0],
        15.0,
        Anchor::Start,
        "font-weight=\"bold\"",
        &format!("{} s", signed(t_s, 0)),
    );
    let mut rings: Vec<(usize, Vec<[f64; 2]>)> = Vec::new();
    for (i, e) in study.expected.iter().enumerate() {
        let Some(row) = row_at(e, t_s) else { continue };
        let Some(state) = super::expect::state_at(&e.states, t_s) else {
            continue;
        };
        let course = if state.ground_speed > 1.0 {
            state.velocity[1].atan2(state.velocity[0])
        } else {
            state.heading
        };
        let turned = Ellipse {
            centre: [0.0; 2],
            azimuth: row.ellipse.azimuth - course,
            ..row.ellipse
        };
        rings.push((
            i,
            turned.points(72).into_iter().map(|[n, e]| [e, n]).collect(),
        ));
    }
    let points: Vec<[f64; 2]> = rings.iter().flat_map(|(_, ring)| ring.clone()).collect();
    let [x, y] = chart::axes(svg, area, &points, 13.0);
    for (i, ring) in &rings {
        let ring: Vec<[f64; 2]> = ring.iter().map(|p| [x.at(p[0]), y.at(p[1])]).collect();
        svg.polygon(&ring, &format!("fill=\"none\" {}", stroke(*i, 2.0)));
    }
    let widest = study
        .expected
        .iter()
        .filter_map(|e| row_at(e, t_s))
        .map(|r| r.ellipse.semi_major)
        .fold(0.0, f64::max);
    svg.text(
        [area.x + area.w, area.y - 7.0],
        13.0,
        Anchor::End,
        "fill=\"#333\"",
        &format!("largest half axis {} m", digits(widest)),
    );
    frame(svg, area);
}

fn charts(study: &Study) -> [String; 3] {
    let q = two_sided_quantile(study.settings.confidence);
    let bounds = percent(study.settings.confidence);
    let confidence = study.settings.confidence;
    let zero = if study.has_impact { "impact" } else { "rest" };
    let of = |value: &dyn Fn(&State) -> f64| -> Vec<Curve> {
        study
            .expected
            .iter()
            .enumerate()
            .map(|(i, e)| Curve {
                points: ellipse::thinned(&e.states, 10)
                    .filter(|s| s.t_s <= 0.0)
                    .map(|s| (s.t_s, value(s)))
                    .collect(),
                style: stroke(i, 2.0),
            })
            .collect()
    };
    let panel = |title: String, curves: Vec<Curve>| {
        chart::logarithmic(CHART, &title, &format!("seconds from the {zero}"), &curves)
    };
    [
        panel(
            format!("Position: larger {bounds} half axis (m)"),
            of(&|s| ellipse::of_state(s, None, confidence).semi_major),
        ),
        panel(
            format!("Speed: {bounds} half width (km/h)"),
            of(&|s| q * s.sd_speed * KMH),
        ),
        panel(
            format!("Heading: {bounds} half width (deg)"),
            of(&|s| q * s.sd_heading.to_degrees()),
        ),
    ]
}
