//! Pictures of signals over time and of the Allan deviations.

use super::Analysis;
use super::allan::Curve;
use super::limits::AXES;
use super::pictures::{WIDTH, XYZ};
use super::plot::{COLORS, SIZE, below, frame, heading, legend, logarithmic};
use crate::report::labels::Area;
use crate::report::panel::{Panel, Series};
use crate::report::svg::Svg;

/// Points with a missing value where the time jumps.
pub(super) fn broken(
    points: impl Iterator<Item = (f64, Option<f64>)>,
) -> Vec<(f64, Option<f64>, f64)> {
    let mut out: Vec<(f64, Option<f64>, f64)> = Vec::new();
    let mut step = f64::INFINITY;
    for (t, v) in points {
        if let Some(last) = out.last().map(|p| p.0) {
            if t - last > 3.0 * step {
                out.push((last, None, 0.0));
            } else if t > last {
                step = step.min(t - last);
            }
        }
        out.push((t, v, 0.0));
    }
    out
}

pub(super) fn panel(
    svg: &mut Svg,
    (title, id, label): (&str, &str, Option<&str>),
    span: [f64; 2],
    y: f64,
    series: &[Series],
    shaded: &[[f64; 2]],
) {
    let values = || {
        let points = series.iter().flat_map(|s| &s.points);
        points.filter_map(|p| p.1).filter(|v| v.is_finite())
    };
    let low = values().fold(0.0, f64::min);
    let high = values().fold(0.0, f64::max);
    let room = ((high - low) * 0.08).max(1e-9);
    let panel = Panel {
        title,
        area: Area {
            x: 70.0,
            y,
            w: WIDTH - 90.0,
            h: 112.0,
        },
        span,
        range: [low - room, high + room],
        time_factor: 1.0,
        time_label: label,
        size: SIZE,
        id,
    };
    panel.start(svg, shaded);
    for s in series {
        panel.series(svg, s);
    }
    panel.finish(svg);
}

pub(super) fn limits(a: &Analysis) -> Option<(Svg, f64)> {
    let events = a.events.as_ref().ok().filter(|e| !e.is_empty())?;
    let mut svg = Svg::new();
    let mut y = 40.0;
    let times = || {
        let samples = a.spans.stretches.iter().flat_map(|s| &s.samples);
        samples.map(|s| s.t_s)
    };
    let span = [
        times().fold(f64::INFINITY, f64::min),
        times().fold(f64::NEG_INFINITY, f64::max),
    ];
    let hit: Vec<usize> = (0..6)
        .filter(|i| events.iter().any(|e| e.axis == *i))
        .collect();
    for (k, axis) in hit.iter().enumerate() {
        let all = a.spans.stretches.iter().flat_map(|s| &s.samples);
        let series = Series {
            points: broken(all.map(|s| (s.t_s, Some(s.axis[*axis])))),
            color: COLORS[axis % 3],
            band: "none",
            dash: "",
        };
        // A single sample must be seen: at least three thousandths of the picture.
        let least = 0.0015 * (span[1] - span[0]);
        let shaded: Vec<[f64; 2]> = events
            .iter()
            .filter(|e| e.axis == *axis)
            .map(|e| [e.span_s[0] - least, e.span_s[1] + least])
            .collect();
        let unit = if *axis < 3 { "m/s\u{b2}" } else { "rad/s" };
        let title = format!("{}, {unit}", AXES[*axis]);
        let id = format!("limits-{k}");
        let label = (k + 1 == hit.len()).then_some("s of the box's clock");
        panel(&mut svg, (&title, &id, label), span, y, &[series], &shaded);
        y += 150.0;
    }
    Some((svg, y + 30.0))
}

pub(super) fn curves(list: &[Curve], title: &str) -> Svg {
    let mut svg = Svg::new();
    let area = Area {
        x: 80.0,
        y: 66.0,
        w: WIDTH - 110.0,
        h: 390.0,
    };
    legend(&mut svg, [80.0, 24.0], &XYZ, false);
    heading(&mut svg, area, title);
    let points = || list.iter().flat_map(|c| &c.points);
    let x = logarithmic(&mut svg, area, false, points().map(|p| p.tau_s));
    let y = logarithmic(
        &mut svg,
        area,
        true,
        points().flat_map(|p| [p.band[0], p.deviation, p.band[1]]),
    );
    let at = |tau: f64, v: f64| [x.at(tau.log10()), y.at(v.max(1e-300).log10())];
    svg.raw(&format!(
        "<clipPath id=\"{}\"><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath>\n<g clip-path=\"url(#{})\">",
        clip(title), area.x, area.y, area.w, area.h, clip(title)
    ));
    for (curve, color) in list.iter().zip(COLORS) {
        let mut ring: Vec<[f64; 2]> = curve
            .points
            .iter()
            .map(|p| at(p.tau_s, p.band[1]))
            .collect();
        ring.extend(curve.points.iter().rev().map(|p| at(p.tau_s, p.band[0])));
        if ring.len() > 3 {
            svg.polygon(&ring, &format!("fill=\"{color}\" fill-opacity=\"0.16\""));
        }
    }
    for (curve, color) in list.iter().zip(COLORS) {
        if let (Ok(white), Some(first), Some(last)) =
            (&curve.white, curve.points.first(), curve.points.last())
        {
            let ends = [first.tau_s, last.tau_s].map(|t| at(t, white.value / t.sqrt()));
            svg.polyline(
                &ends,
                &format!("stroke=\"{color}\" stroke-width=\"1.2\" stroke-dasharray=\"6 5\""),
            );
        }
        let line: Vec<[f64; 2]> = curve
            .points
            .iter()
            .map(|p| at(p.tau_s, p.deviation))
            .collect();
        svg.polyline(&line, &format!("stroke=\"{color}\" stroke-width=\"2\""));
        for p in line {
            svg.circle(p, 3.0, &format!("fill=\"{color}\""));
        }
    }
    svg.raw("</g>");
    frame(&mut svg, area);
    below(&mut svg, area, "averaging time, s");
    svg
}

/// A name for the clip path that is the picture's own.
fn clip(title: &str) -> &'static str {
    if title.contains("rad") {
        "allan-gyro-area"
    } else {
        "allan-accel-area"
    }
}
