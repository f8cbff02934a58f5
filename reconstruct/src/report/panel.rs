//! One panel of a time plot: bands, lines, grid, values off the scale.

use schema::num;

use crate::report::axis::{Scale, step_decimals};
use crate::report::labels::Area;
use crate::report::svg::{Anchor, Svg, signed, text_width};

/// One quantity over time.
#[derive(Clone, Debug)]
pub struct Series {
    /// Time, value, half width of the band; a missing value breaks line and band.
    pub points: Vec<(f64, Option<f64>, f64)>,
    /// Colour of the line.
    pub color: &'static str,
    /// Colour of the band.
    pub band: &'static str,
    /// Dash pattern, empty for a solid line.
    pub dash: &'static str,
}

/// A panel ready to be drawn.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// Heading, with the unit.
    pub title: &'a str,
    /// Where it stands in the picture.
    pub area: Area,
    /// Ends of the time axis, s.
    pub span: [f64; 2],
    /// Ends of the value axis.
    pub range: [f64; 2],
    /// Factor from the series' time to the one printed (1000 for milliseconds).
    pub time_factor: f64,
    /// What to print under the time axis; none: no numbers either.
    pub time_label: Option<&'a str>,
    /// Size of the text.
    pub size: f64,
    /// Makes the clip path's name unique in the page.
    pub id: &'a str,
}

impl Panel<'_> {
    /// The time axis.
    #[must_use]
    pub fn time(&self) -> Scale {
        let [low, high] = self.span;
        Scale {
            low,
            high,
            from: self.area.x,
            to: self.area.x + self.area.w,
        }
    }

    fn value(&self) -> Scale {
        let [low, high] = self.range;
        Scale {
            low,
            high,
            from: self.area.y + self.area.h,
            to: self.area.y,
        }
    }

    /// Background, shaded stretches and grid; to be followed by [`Self::series`] and [`Self::finish`].
    pub fn start(&self, svg: &mut Svg, shaded: &[[f64; 2]]) {
        self.start_bare(svg, shaded);
        let (a, value) = (self.area, self.value());
        let wanted = (a.h / (self.size * 1.7)).max(2.0);
        let mut found = value.ticks(wanted);
        // Two numbers hardly make a scale.
        if found.0.len() < 3 {
            found = value.ticks(1.6 * wanted);
        }
        let (ticks, step) = found;
        for v in ticks {
            let y = value.at(v);
            let style = if v.abs() < 1e-9 {
                "stroke=\"#777\" stroke-width=\"1\""
            } else {
                "stroke=\"#dedede\" stroke-width=\"1\""
            };
            svg.line([a.x, y], [a.x + a.w, y], style);
            let text = signed(v, step_decimals(step));
            svg.text(
                [a.x - 6.0, y + self.size * 0.33],
                self.size * 0.92,
                Anchor::End,
                "fill=\"#333\"",
                &text,
            );
        }
    }

    /// The same without the grid of values.
    pub fn start_bare(&self, svg: &mut Svg, shaded: &[[f64; 2]]) {
        let (a, time) = (self.area, self.time());
        svg.text(
            [a.x, a.y - 7.0],
            self.size,
            Anchor::Start,
            "font-weight=\"bold\"",
            self.title,
        );
        svg.raw(&format!(
            "<clipPath id=\"{}\"><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath>",
            self.id, a.x, a.y, a.w, a.h
        ));
        for [from, to] in shaded {
            let (x, end) = (
                time.at(from.max(self.span[0])),
                time.at(to.min(self.span[1])),
            );
            if end > x {
                hatch(
                    svg,
                    Area {
                        x,
                        y: a.y,
                        w: (end - x).max(2.0),
                        h: a.h,
                    },
                );
            }
        }
        let (ticks, step) = self.printed_time().ticks(a.w / (self.size * 5.0));
        for t in ticks {
            let x = time.at(t / self.time_factor);
            svg.line(
                [x, a.y],
                [x, a.y + a.h],
                "stroke=\"#dedede\" stroke-width=\"1\"",
            );
            if self.time_label.is_some() {
                let text = signed(t, step_decimals(step));
                let size = self.size * 0.92;
                // The last one ends with the frame: at the picture's edge a scroll bar or a wider font would cut it.
                let most = a.x + a.w - 0.5 * text_width(&text, size);
                svg.text(
                    [x.min(most), a.y + a.h + self.size * 1.15],
                    size,
                    Anchor::Middle,
                    "fill=\"#333\"",
                    &text,
                );
            }
        }
        if let Some(label) = self.time_label {
            let at = [a.x + 0.5 * a.w, a.y + a.h + self.size * 2.4];
            svg.text(at, self.size * 0.92, Anchor::Middle, "fill=\"#333\"", label);
        }
    }

    fn printed_time(&self) -> Scale {
        let time = self.time();
        Scale {
            low: time.low * self.time_factor,
            high: time.high * self.time_factor,
            ..time
        }
    }

    /// Band and line of a series, thinned to the picture's width without losing peaks.
    pub fn series(&self, svg: &mut Svg, series: &Series) {
        let (time, value) = (self.time(), self.value());
        svg.raw(&format!("<g clip-path=\"url(#{})\">", self.id));
        for run in runs(&series.points, self.span) {
            let columns = thin(&run, 0.9 * self.area.w);
            let mut ring: Vec<[f64; 2]> = columns
                .iter()
                .map(|c| [time.at(c.t), value.at(c.high)])
                .collect();
            ring.extend(
                columns
                    .iter()
                    .rev()
                    .map(|c| [time.at(c.t), value.at(c.low)]),
            );
            if ring.len() > 3 {
                svg.polygon(&ring, &format!("fill=\"{}\"", series.band));
            }
            let line: Vec<[f64; 2]> = columns
                .iter()
                .flat_map(|c| c.line.iter().map(|(t, v)| [time.at(*t), value.at(*v)]))
                .collect();
            let dash = if series.dash.is_empty() {
                String::new()
            } else {
                format!(" stroke-dasharray=\"{}\"", series.dash)
            };
            let style = format!(
                "stroke=\"{}\" stroke-width=\"1.8\" stroke-linejoin=\"round\"{dash}",
                series.color
            );
            match line.as_slice() {
                [only] => {
                    svg.circle(*only, 1.5, &format!("fill=\"{}\"", series.color));
                }
                many => svg.polyline(many, &style),
            }
        }
        svg.raw("</g>");
    }

    /// Says where the largest value off the scale lies, on each side.
    pub fn off_scale(&self, svg: &mut Svg, series: &Series, unit: &str) {
        let known = || {
            series
                .points
                .iter()
                .filter_map(|(t, v, _)| v.map(|v| (*t, v)))
                .filter(|(t, _)| *t >= self.span[0] && *t <= self.span[1])
        };
        let least = known()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|(_, v)| *v < self.range[0]);
        let most = known()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|(_, v)| *v > self.range[1]);
        for ((t, v), top) in least
            .map(|p| (p, false))
            .into_iter()
            .chain(most.map(|p| (p, true)))
        {
            let x = self.time().at(t);
            let (edge, inward) = if top {
                (self.area.y, 1.0)
            } else {
                (self.area.y + self.area.h, -1.0)
            };
            svg.polygon(
                &[
                    [x, edge],
                    [x - 5.0, edge + 9.0 * inward],
                    [x + 5.0, edge + 9.0 * inward],
                ],
                "fill=\"#111\"",
            );
            // Hundredths of a second are for a crash, not for a drive.
            let decimals = if self.span[1] - self.span[0] > 50.0 {
                0
            } else {
                2
            };
            let text = format!(
                "off scale: {} {unit} at {} s",
                signed(v, 0),
                signed(t, decimals)
            );
            let size = self.size * 0.92;
            let w = text_width(&text, size);
            let left = if x - 10.0 - w > self.area.x {
                x - 10.0 - w
            } else {
                x + 10.0
            };
            let y = if top { edge + size + 1.0 } else { edge - 4.0 };
            svg.rect(
                [left - 2.0, y - size],
                [w + 4.0, size * 1.25],
                "fill=\"#fff\" fill-opacity=\"0.86\"",
            );
            svg.text([left, y], size, Anchor::Start, "", &text);
        }
    }

    /// The frame around everything.
    pub fn finish(&self, svg: &mut Svg) {
        let a = self.area;
        svg.rect(
            [a.x, a.y],
            [a.w, a.h],
            "fill=\"none\" stroke=\"#333\" stroke-width=\"1\"",
        );
    }
}

/// Grey with slanted lines: seen in print as well.
pub fn hatch(svg: &mut Svg, a: Area) {
    svg.rect([a.x, a.y], [a.w, a.h], "fill=\"#d3d3d3\"");
    let mut x = a.x - a.h;
    while x < a.x + a.w {
        let from = [x.max(a.x), a.y + a.h - (x.max(a.x) - x)];
        let to = [
            (x + a.h).min(a.x + a.w),
            a.y + a.h - ((x + a.h).min(a.x + a.w) - x),
        ];
        if to[0] > from[0] {
            svg.line(from, to, "stroke=\"#8a8a8a\" stroke-width=\"1\"");
        }
        x += 8.0;
    }
}

type Known = (f64, f64, f64);

/// Stretches without a missing value inside the span.
fn runs(points: &[(f64, Option<f64>, f64)], span: [f64; 2]) -> Vec<Vec<Known>> {
    let mut out: Vec<Vec<Known>> = vec![Vec::new()];
    for (t, v, half) in points
        .iter()
        .filter(|p| p.0 >= span[0] - 0.011 && p.0 <= span[1] + 0.011)
    {
        match (v, out.last_mut()) {
            (Some(v), Some(run)) if v.is_finite() => {
                run.push((*t, *v, if half.is_finite() { *half } else { 0.0 }));
            }
            (_, Some(run)) if !run.is_empty() => out.push(Vec::new()),
            _ => {}
        }
    }
    out.retain(|run| !run.is_empty());
    out
}

/// One column of the picture.
struct Column {
    t: f64,
    low: f64,
    high: f64,
    line: Vec<(f64, f64)>,
}

/// At most about `columns` columns; in each the least and the largest value survive, in their order.
fn thin(run: &[Known], columns: f64) -> Vec<Column> {
    let per = num::round_usize((num::real(run.len()) / columns.max(1.0)).ceil()).max(1);
    run.chunks(per)
        .filter_map(|chunk| {
            let least = chunk
                .iter()
                .enumerate()
                .min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
            let most = chunk
                .iter()
                .enumerate()
                .max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
            let mut line = vec![(least.1.0, least.1.1)];
            if least.0 != most.0 {
                line.insert(usize::from(most.0 > least.0), (most.1.0, most.1.1));
            }
            Some(Column {
                t: chunk.iter().map(|p| p.0).sum::<f64>() / num::real(chunk.len()),
                low: chunk
                    .iter()
                    .map(|p| p.1 - p.2)
                    .fold(f64::INFINITY, f64::min),
                high: chunk
                    .iter()
                    .map(|p| p.1 + p.2)
                    .fold(f64::NEG_INFINITY, f64::max),
                line,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Panel, runs, thin};
    use crate::report::labels::Area;
    use crate::report::svg::Svg;

    #[test]
    fn the_last_number_of_the_time_axis_ends_with_the_frame() {
        let panel = Panel {
            title: "",
            area: Area {
                x: 64.0,
                y: 24.0,
                w: 920.0,
                h: 118.0,
            },
            span: [-30.0, 10.0],
            range: [0.0, 1.0],
            time_factor: 1.0,
            time_label: Some("seconds"),
            size: 15.0,
            id: "p",
        };
        let mut svg = Svg::new();
        panel.start(&mut svg, &[]);
        let body = svg.into_body();
        let x = |label: &str| -> f64 {
            let line = body
                .lines()
                .find(|l| l.ends_with(&format!(">{label}</text>")));
            let rest = line.and_then(|l| l.split("x=\"").nth(1)).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        assert!(
            x("10") < 977.0 && (x("5") - 869.0).abs() < 0.1,
            "{}",
            x("10")
        );
    }

    #[test]
    fn thinning_keeps_the_peak_and_missing_values_break_the_line() {
        let mut points: Vec<(f64, Option<f64>, f64)> = (0..1000_i32)
            .map(|i| (f64::from(i) * 0.01, Some(0.0), 0.1))
            .collect();
        points[437].1 = Some(-312.0);
        points[700].1 = None;
        let runs = runs(&points, [0.0, 10.0]);
        assert_eq!(runs.len(), 2);
        let columns = thin(&runs[0], 50.0);
        assert!(columns.len() <= 50);
        assert!(
            columns
                .iter()
                .flat_map(|c| &c.line)
                .any(|(_, v)| *v < -311.0)
        );
    }
}
