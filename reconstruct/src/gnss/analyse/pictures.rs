//! The pictures: deviation over time, variances, biases, positions, ends of the range, Allan deviations.

use schema::num::real;

use super::Analysis;
use super::plot::{COLORS, SIZE, bar, frame, heading, legend, logarithmic, plain, square, time};
use super::positions::Table;
use super::signal_pictures::{broken, curves, limits, panel};
use super::source;
use super::spans::Situation;
use super::spread::{Bias, Spread};
use crate::report::labels::Area;
use crate::report::panel::Series;
use crate::report::svg::{Anchor, Svg, picture};

/// Width of all pictures.
pub(super) const WIDTH: f64 = 1000.0;
pub(super) const XYZ: [(&str, &str); 3] = [("x", COLORS[0]), ("y", COLORS[1]), ("z", COLORS[2])];

/// A picture by its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Name, of the file too.
    pub name: &'static str,
    /// What it shows.
    pub caption: String,
    /// An `svg` element.
    pub svg: String,
}

/// All pictures that there is something to draw for.
#[must_use]
pub fn draw(a: &Analysis) -> Vec<Picture> {
    let mut out = Vec::new();
    let mut add = |name: &'static str, caption: &str, height: f64, svg: Svg| {
        let mut whole = Svg::new();
        whole.rect([0.0, 0.0], [WIDTH, height], "fill=\"#fff\"");
        let body = whole.into_body() + &svg.into_body();
        out.push(Picture {
            name,
            caption: caption.to_owned(),
            svg: picture([WIDTH, height], caption, caption, &body),
        });
    };
    if let Some((svg, height)) = deviation(a) {
        add(
            "deviation",
            "Receiver less reference over time, the delay taken off where it is told. A colour a receiver.",
            height,
            svg,
        );
    }
    if let Ok(spreads) = &a.spreads
        && spreads.iter().any(|s| s.axis.is_some())
    {
        add(
            "variance",
            "Variance by situation and axis with intervals of 95 %; squares: tables 4.4 and 4.5 of S00.",
            420.0,
            variance(spreads),
        );
    }
    if let Ok(list) = &a.biases
        && !list.is_empty()
    {
        add(
            "bias",
            "Gyro bias at each stand with its interval of 95 %, in the sensor's own axes.",
            380.0,
            bias(list),
        );
    }
    if let Ok(table) = &a.positions
        && table
            .positions
            .iter()
            .filter(|p| p.reading.is_some())
            .count()
            > 1
    {
        add(
            "positions",
            "Reading of the axis along gravity, less gravity, outward from the middle of the axis; squares: table 4.7 of S00.",
            400.0,
            positions(table),
        );
    }
    if let Some((svg, height)) = limits(a) {
        add(
            "limits",
            "Axes that came to the end of their range; hatched: what was found. Values as they stand in the log.",
            height,
            svg,
        );
    }
    if let Ok(allan) = &a.allan {
        let bands =
            "overlapping Allan deviation with its band of 95 %; dashed: white noise as fitted.";
        add(
            "allan-gyro",
            &format!("Gyro: {bands}"),
            520.0,
            curves(
                allan.curves.get(3..6).unwrap_or_default(),
                "Allan deviation, rad/s",
            ),
        );
        add(
            "allan-accelerometer",
            &format!("Accelerometer: {bands}"),
            520.0,
            curves(
                allan.curves.get(0..3).unwrap_or_default(),
                "Allan deviation, m/s\u{b2}",
            ),
        );
    }
    out
}

/// Receivers drawn at most; a line each.
const RECEIVERS: [&str; 6] = [
    "#1f5a96", "#c24e00", "#2e7d4f", "#7a3b8f", "#8a6d00", "#16191d",
];

fn deviation(a: &Analysis) -> Option<(Svg, f64)> {
    let list: Vec<_> = a
        .receivers
        .as_ref()
        .ok()?
        .iter()
        .filter_map(|r| r.as_ref().ok())
        .take(RECEIVERS.len())
        .collect();
    let times = || list.iter().flat_map(|r| r.series.iter().map(|o| o.t_s));
    let span = [
        times().fold(f64::INFINITY, f64::min),
        times().fold(f64::NEG_INFINITY, f64::max),
    ];
    if span[0] >= span[1] {
        return None;
    }
    let mut svg = Svg::new();
    let names: Vec<(String, &str)> = list
        .iter()
        .zip(RECEIVERS)
        .map(|(r, color)| (super::tables::name(r.leg), color))
        .collect();
    let names: Vec<(&str, &str)> = names.iter().map(|(n, c)| (n.as_str(), *c)).collect();
    legend(
        &mut svg,
        [70.0, 22.0],
        names.get(..names.len().min(3)).unwrap_or_default(),
        false,
    );
    let panels: Vec<(usize, &str)> = [
        (0, "North, m"),
        (1, "East, m"),
        (2, "Height, m"),
        (3, "Velocity north, m/s"),
        (4, "Velocity east, m/s"),
    ]
    .into_iter()
    .filter(|(i, _)| {
        list.iter()
            .any(|r| r.series.iter().any(|o| o.value[*i].is_some()))
    })
    .collect();
    let mut y = 62.0;
    let last = panels.len().saturating_sub(1);
    for (k, (quantity, title)) in panels.into_iter().enumerate() {
        let series: Vec<Series> = list
            .iter()
            .zip(RECEIVERS)
            .map(|(r, color)| Series {
                points: broken(r.series.iter().map(|o| (o.t_s, o.value[quantity]))),
                color,
                band: "none",
                dash: "",
            })
            .collect();
        let id = format!("deviation-{k}");
        let label = (k == last).then_some("s of the box's clock");
        panel(&mut svg, (title, &id, label), span, y, &series, &[]);
        y += 150.0;
    }
    Some((svg, y + 30.0))
}

fn variance(spreads: &[Spread]) -> Svg {
    let mut svg = Svg::new();
    legend(&mut svg, [80.0, 24.0], &XYZ, true);
    for (half, (first, title)) in [
        (3, "Gyro, (rad/s)\u{b2}"),
        (0, "Accelerometer, (m/s\u{b2})\u{b2}"),
    ]
    .into_iter()
    .enumerate()
    {
        let area = Area {
            x: 80.0 + 480.0 * real(half),
            y: 66.0,
            w: 400.0,
            h: 290.0,
        };
        heading(&mut svg, area, title);
        let own = spreads.iter().filter_map(|s| s.axis.as_ref());
        let shown = own
            .flat_map(|v| &v[first..first + 3])
            .flat_map(|v| [v.low, v.value, v.high]);
        let known = spreads.iter().filter(|s| s.axis.is_some());
        let published = known
            .filter_map(|s| source::variance(s.situation))
            .flat_map(|v| [v[first], v[first + 1], v[first + 2]]);
        let all: Vec<f64> = shown.chain(published).collect();
        let scale = logarithmic(&mut svg, area, true, all.into_iter());
        let at = |v: f64| scale.at(v.max(1e-300).log10());
        for (column, spread) in spreads.iter().enumerate() {
            let x = area.x + area.w * (real(column) + 0.5) / 4.0;
            for (line, word) in situation_words(spread.situation).into_iter().enumerate() {
                let y = area.y + area.h + 19.0 + 17.0 * real(line);
                svg.text([x, y], SIZE, Anchor::Middle, "fill=\"#333\"", word);
            }
            let Some(axis) = &spread.axis else {
                let y = area.y + 0.5 * area.h;
                svg.text(
                    [x, y],
                    SIZE - 1.0,
                    Anchor::Middle,
                    "fill=\"#777\"",
                    "cannot tell",
                );
                continue;
            };
            for i in 0..3 {
                let x = x + 26.0 * (real(i) - 1.0);
                let v = axis[first + i];
                bar(
                    &mut svg,
                    area,
                    x - 4.0,
                    [v.low, v.value, v.high].map(at),
                    COLORS[i],
                );
                if let Some(source) = source::variance(spread.situation) {
                    square(&mut svg, [x + 6.0, at(source[first + i])]);
                }
            }
        }
        frame(&mut svg, area);
    }
    svg
}

fn situation_words(situation: Situation) -> [&'static str; 2] {
    match situation {
        Situation::Rest => ["at rest,", "engine off"],
        Situation::Stop => ["stop,", "engine on"],
        Situation::Straight => ["driving", "straight"],
        Situation::Driving => ["driving,", "all"],
    }
}

fn bias(list: &[Bias]) -> Svg {
    let mut svg = Svg::new();
    legend(&mut svg, [80.0, 24.0], &XYZ, false);
    let area = Area {
        x: 80.0,
        y: 62.0,
        w: WIDTH - 110.0,
        h: 255.0,
    };
    heading(&mut svg, area, "Mean rate, 10\u{207b}\u{b3} rad/s");
    let figures = || list.iter().flat_map(|b| &b.rate);
    let values: Vec<f64> = figures()
        .flat_map(|f| [f.low * 1e3, f.high * 1e3])
        .collect();
    let scale = plain(&mut svg, area, values.into_iter());
    let span = [
        list.iter()
            .map(|b| b.span_s[0])
            .fold(f64::INFINITY, f64::min),
        list.iter()
            .map(|b| b.span_s[1])
            .fold(f64::NEG_INFINITY, f64::max),
    ];
    let t = time(
        &mut svg,
        area,
        span,
        "s of the box's clock, middle of the stand",
    );
    for bias in list {
        let x = t.at(f64::midpoint(bias.span_s[0], bias.span_s[1]));
        for (i, f) in bias.rate.iter().enumerate() {
            let ends = [f.low, f.value, f.high].map(|v| scale.at(v * 1e3));
            bar(&mut svg, area, x + 7.0 * (real(i) - 1.0), ends, COLORS[i]);
        }
    }
    frame(&mut svg, area);
    svg
}

fn positions(table: &Table) -> Svg {
    let mut svg = Svg::new();
    legend(&mut svg, [80.0, 24.0], &XYZ, true);
    let area = Area {
        x: 80.0,
        y: 66.0,
        w: WIDTH - 110.0,
        h: 275.0,
    };
    heading(
        &mut svg,
        area,
        "Size of the reading less gravity, m/s\u{b2}",
    );
    let off = |reading: f64, sign: f64, g: f64| reading * sign - g;
    let own = table.positions.iter().filter_map(|p| {
        let f = p.reading?;
        Some([f.low, f.high].map(|v| off(v, p.sign, table.gravity[0])))
    });
    let published = table
        .positions
        .iter()
        .zip(source::POSITIONS)
        .map(|(p, s)| off(s, p.sign, source::GRAVITY));
    let all: Vec<f64> = own
        .flatten()
        .chain(published.clone())
        .chain([0.0])
        .collect();
    let scale = plain(&mut svg, area, all.into_iter());
    for (column, (p, source)) in table.positions.iter().zip(published).enumerate() {
        let x = area.x + area.w * (real(column) + 0.5) / 6.0;
        let y = area.y + area.h + 20.0;
        svg.text([x, y], SIZE, Anchor::Middle, "fill=\"#333\"", p.name);
        match &p.reading {
            Some(f) => {
                let ends =
                    [f.low, f.value, f.high].map(|v| scale.at(off(v, p.sign, table.gravity[0])));
                bar(&mut svg, area, x - 8.0, ends, COLORS[p.axis]);
            }
            None => svg.text(
                [x, y + 18.0],
                SIZE - 1.0,
                Anchor::Middle,
                "fill=\"#777\"",
                "missing",
            ),
        }
        square(&mut svg, [x + 8.0, scale.at(source)]);
    }
    frame(&mut svg, area);
    svg
}
