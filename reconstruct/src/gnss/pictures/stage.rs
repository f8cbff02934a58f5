//! Panels over time, one above the other, on a common axis.

use schema::num::{self, real};

use crate::report::axis::{Scale, power_of_ten};
use crate::report::labels::Area;
use crate::report::panel::{Panel, Series};
use crate::report::svg::{self, Anchor, Svg, text_width};

pub(super) const WIDTH: f64 = 1000.0;
const LEFT: f64 = 74.0;
const RIGHT: f64 = 18.0;
pub(super) const SIZE: f64 = 14.0;

/// A kind of mark in a legend.
#[derive(Clone, Copy)]
pub(super) enum Key {
    Line(&'static str),
    Dashed(&'static str),
    Band(&'static str),
    Dot(&'static str),
    Ring(&'static str),
    Cross(&'static str),
    Square(&'static str),
    Tick(&'static str),
}

/// A picture of panels being drawn.
pub(super) struct Stage<'a> {
    pub(super) svg: Svg,
    id: &'a str,
    span: [f64; 2],
    y: f64,
    panels: usize,
}

impl<'a> Stage<'a> {
    /// `id` makes the names in it unique on a page; `span` are the ends of the time axis, s.
    pub(super) fn new(id: &'a str, span: [f64; 2]) -> Self {
        let mut svg = Svg::new();
        svg.raw("<!-- panels -->");
        Self {
            svg,
            id,
            span: [span[0], span[1].max(span[0] + 1.0)],
            y: 0.0,
            panels: 0,
        }
    }

    /// Draws a panel of a height: its grid, then what `draw` puts on it. The last has the numbers of the time axis.
    pub(super) fn panel(
        &mut self,
        title: &str,
        height: f64,
        range: [f64; 2],
        last: bool,
        shaded: &[[f64; 2]],
        draw: impl FnOnce(&mut Svg, &Panel<'_>),
    ) {
        let id = format!("{}-{}", self.id, self.panels);
        let panel = self.lay(title, height, range, last, &id);
        shade(&mut self.svg, &panel, shaded);
        panel.start(&mut self.svg, &[]);
        draw(&mut self.svg, &panel);
        panel.finish(&mut self.svg);
        self.close(height, last);
    }

    /// The same with a logarithmic scale: `range` and what is drawn are powers of ten.
    pub(super) fn decades(
        &mut self,
        title: &str,
        height: f64,
        range: [f64; 2],
        last: bool,
        draw: impl FnOnce(&mut Svg, &Panel<'_>),
    ) {
        let id = format!("{}-{}", self.id, self.panels);
        let panel = self.lay(title, height, range, last, &id);
        let value = value(&panel);
        panel.start_bare(&mut self.svg, &[]);
        let a = panel.area;
        for power in num::floor_i64(range[0].ceil())..=num::floor_i64(range[1]) {
            let y = value.at(num::real_i64(power));
            self.svg
                .line([a.x, y], [a.x + a.w, y], "stroke=\"#dedede\"");
            self.svg.text(
                [a.x - 6.0, y + 4.5],
                SIZE * 0.92,
                Anchor::End,
                "fill=\"#333\"",
                &power_of_ten(power),
            );
        }
        draw(&mut self.svg, &panel);
        panel.finish(&mut self.svg);
        self.close(height, last);
    }

    fn lay<'p>(
        &mut self,
        title: &'p str,
        height: f64,
        range: [f64; 2],
        last: bool,
        id: &'p str,
    ) -> Panel<'p> {
        self.panels += 1;
        Panel {
            title,
            area: Area {
                x: LEFT,
                y: self.y + 30.0,
                w: WIDTH - LEFT - RIGHT,
                h: height,
            },
            span: self.span,
            range,
            time_factor: 1.0,
            time_label: last.then_some("time of the box's clock, s"),
            size: SIZE,
            id,
        }
    }

    fn close(&mut self, height: f64, last: bool) {
        self.y += 30.0 + height + if last { 40.0 } else { 0.0 };
    }

    /// Spans as bars, one row a name, under the panels and on their axis.
    pub(super) fn rows(&mut self, title: &str, list: &[(&str, &str, Vec<[f64; 2]>)]) {
        let height = real(list.len()) * 34.0 + 6.0;
        let id = format!("{}-{}", self.id, self.panels);
        let panel = self.lay(title, height, [0.0, 1.0], true, &id);
        panel.start_bare(&mut self.svg, &[]);
        let a = panel.area;
        for (i, (name, color, spans)) in list.iter().enumerate() {
            let y = a.y + 4.0 + 34.0 * real(i);
            for [from, to] in joined(&panel, spans) {
                self.svg.rect(
                    [from, y + 17.0],
                    [(to - from).max(1.5), 14.0],
                    &format!("fill=\"{color}\""),
                );
            }
            let name = if spans.is_empty() {
                format!("{name}: never")
            } else {
                (*name).to_owned()
            };
            // Above its bars, so that it hides none of them.
            self.svg
                .text([a.x + 7.0, y + 12.5], SIZE * 0.86, Anchor::Start, "", &name);
        }
        panel.finish(&mut self.svg);
        self.close(height, true);
    }

    pub(super) fn legend(&mut self, entries: &[(Key, &str)]) {
        self.y = legend(&mut self.svg, self.y + 22.0, entries) - 2.0;
    }

    /// The picture.
    pub(super) fn finish(self, title: &str, description: &str) -> String {
        let size = [WIDTH, self.y + 10.0];
        let mut back = Svg::new();
        back.rect([0.0, 0.0], size, "fill=\"#fff\"");
        let body = back.into_body() + &self.svg.into_body();
        svg::picture(size, title, description, &body)
    }
}

/// The scale of values of a panel.
pub(super) fn value(panel: &Panel<'_>) -> Scale {
    Scale {
        low: panel.range[0],
        high: panel.range[1],
        from: panel.area.y + panel.area.h,
        to: panel.area.y,
    }
}

/// Spans in picture units, those nearer than a unit to each other in one: bounded by the width.
fn joined(panel: &Panel<'_>, spans: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let time = panel.time();
    let mut out: Vec<[f64; 2]> = Vec::new();
    for [from, to] in spans {
        let (a, b) = (
            time.at(from.max(panel.span[0])),
            time.at(to.min(panel.span[1])),
        );
        if b < a {
            continue;
        }
        match out.last_mut() {
            Some(last) if a - last[1] < 1.0 => last[1] = last[1].max(b),
            _ => out.push([a, b]),
        }
    }
    out
}

fn shade(svg: &mut Svg, panel: &Panel<'_>, spans: &[[f64; 2]]) {
    // A fix is fresh for a second: so outages that follow each other stay apart.
    let stale: Vec<[f64; 2]> = spans.iter().map(|[a, b]| [(a + 1.0).min(*b), *b]).collect();
    for [from, to] in joined(panel, &stale) {
        svg.rect(
            [from, panel.area.y],
            [(to - from).max(1.0), panel.area.h],
            &format!("fill=\"{}\"", super::OUTAGE),
        );
    }
}

/// Short strokes on the time axis, at most one a picture unit and a half.
pub(super) fn strokes(
    svg: &mut Svg,
    panel: &Panel<'_>,
    times: impl Iterator<Item = f64>,
    color: &str,
) {
    let time = panel.time();
    let mut last = f64::NEG_INFINITY;
    let foot = panel.area.y + panel.area.h;
    for t in times.filter(|t| *t >= panel.span[0] && *t <= panel.span[1]) {
        let x = time.at(t);
        if x - last >= 1.5 {
            svg.line([x, foot - 7.0], [x, foot], &format!("stroke=\"{color}\""));
            last = x;
        }
    }
}

/// Dots, one a cell of two by two picture units, within the panel.
pub(super) fn dots(
    svg: &mut Svg,
    panel: &Panel<'_>,
    points: impl Iterator<Item = [f64; 2]>,
    color: &str,
) {
    let (time, value) = (panel.time(), value(panel));
    let mut seen = std::collections::BTreeSet::new();
    for [t, v] in points {
        let at = [time.at(t), value.at(v)];
        let within =
            t >= panel.span[0] && t <= panel.span[1] && v >= panel.range[0] && v <= panel.range[1];
        if within && seen.insert(at.map(|x| num::floor_i64(0.5 * x))) {
            svg.circle(at, 1.8, &format!("fill=\"{color}\""));
        }
    }
}

/// A plain line of a colour, no band.
pub(super) fn line(
    points: Vec<(f64, Option<f64>, f64)>,
    color: &'static str,
    dash: &'static str,
) -> Series {
    Series {
        points,
        color,
        band: "none",
        dash,
    }
}

/// Entries in rows; gives the lower edge.
pub(super) fn legend(svg: &mut Svg, top: f64, entries: &[(Key, &str)]) -> f64 {
    let (mut x, mut y) = (16.0, top);
    for (key, text) in entries {
        let w = 34.0 + text_width(text, SIZE * 0.95) + 20.0;
        if x + w > WIDTH - 6.0 {
            x = 16.0;
            y += 24.0;
        }
        let (from, to, middle) = ([x, y], [x + 26.0, y], [x + 13.0, y]);
        match key {
            Key::Line(c) => svg.line(from, to, &format!("stroke=\"{c}\" stroke-width=\"2.4\"")),
            Key::Dashed(c) => svg.line(
                from,
                to,
                &format!("stroke=\"{c}\" stroke-width=\"1.8\" stroke-dasharray=\"6 4\""),
            ),
            Key::Band(c) => svg.rect(
                [x, y - 7.0],
                [26.0, 14.0],
                &format!("fill=\"{c}\" stroke=\"#8a8a8a\" stroke-width=\"0.6\""),
            ),
            Key::Dot(c) => svg.circle(middle, 3.0, &format!("fill=\"{c}\"")),
            Key::Ring(c) => svg.circle(
                middle,
                3.4,
                &format!("fill=\"#fff\" stroke=\"{c}\" stroke-width=\"1.4\""),
            ),
            Key::Cross(c) => cross(svg, middle, c),
            Key::Square(c) => svg.rect([x + 8.0, y - 5.0], [10.0, 10.0], &format!("fill=\"{c}\"")),
            Key::Tick(c) => svg.line(
                [x + 13.0, y - 5.0],
                [x + 13.0, y + 5.0],
                &format!("stroke=\"{c}\""),
            ),
        }
        svg.text([x + 33.0, y + 4.8], SIZE * 0.95, Anchor::Start, "", text);
        x += w;
    }
    y + 14.0
}

pub(super) fn cross(svg: &mut Svg, [x, y]: [f64; 2], color: &str) {
    let style = format!("stroke=\"{color}\" stroke-width=\"1.8\"");
    svg.line([x - 4.0, y - 4.0], [x + 4.0, y + 4.0], &style);
    svg.line([x - 4.0, y + 4.0], [x + 4.0, y - 4.0], &style);
}

/// Ends of a scale that shows every value and, of the bands, what 98 in a hundred need.
pub(super) fn range(points: &[(f64, Option<f64>, f64)]) -> [f64; 2] {
    let known: Vec<(f64, f64)> = points
        .iter()
        .filter_map(|(_, v, half)| v.map(|v| (v, half.max(0.0))))
        .filter(|(v, half)| v.is_finite() && half.is_finite())
        .collect();
    let part = |mut list: Vec<f64>, share: f64| {
        list.sort_by(f64::total_cmp);
        let at = num::round_usize(share * real(list.len().saturating_sub(1)));
        list.get(at).copied()
    };
    let values = || known.iter().map(|k| k.0);
    let low = part(known.iter().map(|k| k.0 - k.1).collect(), 0.02);
    let high = part(known.iter().map(|k| k.0 + k.1).collect(), 0.98);
    let (Some(low), Some(high)) = (low, high) else {
        return [0.0, 1.0];
    };
    let low = values().fold(low, f64::min);
    let high = values().fold(high, f64::max).max(low + 1e-6);
    let margin = 0.06 * (high - low);
    [low - margin, high + margin]
}

/// A series with many breaks in few points: of each of some 1,500 stretches the least and the largest value with the widest
/// band, apart where they are more than `jump` apart, and a break where the stretch has one.
pub(super) fn reduced(
    points: Vec<(f64, Option<f64>, f64)>,
    jump: f64,
) -> Vec<(f64, Option<f64>, f64)> {
    if points.len() < 6000 {
        return points;
    }
    let mut out = Vec::new();
    for part in points.chunks(points.len().div_ceil(1500)) {
        let known = || {
            part.iter()
                .filter_map(|(t, v, half)| v.map(|v| (*t, v, *half)))
        };
        let (Some(least), Some(most)) = (
            known().min_by(|a, b| a.1.total_cmp(&b.1)),
            known().max_by(|a, b| a.1.total_cmp(&b.1)),
        ) else {
            out.push((part[0].0, None, 0.0));
            continue;
        };
        let half = known().map(|k| k.2).fold(0.0, f64::max);
        if part.iter().any(|p| p.1.is_none()) {
            out.push((part[0].0, None, 0.0));
        }
        let pair = if least.0 <= most.0 {
            [least, most]
        } else {
            [most, least]
        };
        out.push((pair[0].0, Some(pair[0].1), half));
        if pair[1].0 > pair[0].0 {
            let broken = part
                .iter()
                .any(|p| p.1.is_none() && p.0 > pair[0].0 && p.0 <= pair[1].0);
            if broken || most.1 - least.1 > jump {
                out.push((pair[1].0, None, 0.0));
            }
            out.push((pair[1].0, Some(pair[1].1), half));
        }
    }
    out
}
