//! `motion.svg`: speed, accelerations and yaw rate over time with their bands, and the crash pulse close up.

use schema::num;

use crate::findings::curve::{CurvePoint, reported};
use crate::findings::{Figure, Reconstruction};
use crate::report::axis::Scale;
use crate::report::labels::Area;
use crate::report::motion_parts::{
    BLUE, BLUE_BAND, Event, VERMILION, VERMILION_BAND, events, plots, range, series, shaded, span,
};
use crate::report::number::{self, KMH};
use crate::report::panel::{Panel, Series, hatch};
use crate::report::svg::{self, Anchor, Svg, text_width};
use crate::stats::two_sided_quantile;

/// Layout of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// For a file, a screen and paper.
    Wide,
    /// For a phone: narrower, so that the text stays readable.
    Narrow,
}

/// The picture; `prefix` makes its clip paths' names unique in a page.
#[must_use]
pub fn picture(r: &Reconstruction, layout: Layout, prefix: &str) -> String {
    let (width, size, left) = match layout {
        Layout::Wide => (1000.0, 15.0, 64.0),
        Layout::Narrow => (460.0, 14.0, 50.0),
    };
    let mut svg = Svg::new();
    let description = format!(
        "Forward speed, forward and rightward acceleration and yaw rate over time, with bands of {} confidence.",
        number::percent(r.confidence)
    );
    let Some(span) = span(r) else {
        svg.rect([0.0, 0.0], [width, 80.0], "fill=\"#fff\"");
        svg.text(
            [0.5 * width, 45.0],
            size,
            Anchor::Middle,
            "",
            "No samples to draw.",
        );
        return svg::picture(
            [width, 80.0],
            "Motion over time",
            &description,
            &svg.into_body(),
        );
    };
    let z = two_sided_quantile(r.confidence);
    let shaded = shaded(r);
    let plots = plots(r, z);
    let events = events(r);
    let (rows, top) = header(&events, span, [left, width - left - 16.0], size);
    let mut y = top;
    let mut body = Svg::new();
    let count = plots.len();
    for (i, plot) in plots.iter().enumerate() {
        let area = Area {
            x: left,
            y: y + 24.0,
            w: width - left - 16.0,
            h: if i == 0 { 150.0 } else { 118.0 },
        };
        let panel = Panel {
            title: plot.title,
            area,
            span,
            range: plot.range,
            time_factor: 1.0,
            time_label: (i + 1 == count).then_some("seconds from the first trigger"),
            size,
            id: &format!("{prefix}{i}"),
        };
        panel.start(&mut body, &shaded);
        panel.series(&mut body, &plot.series);
        for event in &events {
            let x = panel.time().at(event.t_s);
            body.line([x, area.y], [x, area.y + area.h], event.style);
        }
        panel.off_scale(&mut body, &plot.series, plot.unit);
        panel.finish(&mut body);
        y = area.y + area.h + 12.0;
    }
    y += 2.4 * size;
    y = pulse(
        &mut body,
        r,
        z,
        [left, y, width, size],
        &format!("{prefix}p"),
    );
    y = change(
        &mut body,
        r,
        z,
        [left, y, width, size],
        &format!("{prefix}c"),
    );
    y = legend(&mut body, r, !shaded.is_empty(), [left, y, width, size]);
    svg.rect([0.0, 0.0], [width, y], "fill=\"#fff\"");
    marks(
        &mut svg,
        &events,
        &rows,
        span,
        [left, width, size, top + 24.0],
    );
    svg.raw(&body.into_body());
    svg::picture(
        [width, y],
        "Motion over time",
        &description,
        &svg.into_body(),
    )
}

/// The labels of the events above the panels, and the lines down to the first.
fn marks(
    svg: &mut Svg,
    events: &[Event],
    rows: &[(f64, usize)],
    span: [f64; 2],
    [left, width, size, foot]: [f64; 4],
) {
    let axis = Scale {
        low: span[0],
        high: span[1],
        from: left,
        to: width - 16.0,
    };
    for (event, (x, row)) in events.iter().zip(rows) {
        let base = size * (1.3 * num::real(*row) + 1.2);
        let at = axis.at(event.t_s);
        svg.line([at, base + 4.0], [at, foot], event.style);
        svg.rect(
            [*x - 2.0, base - size],
            [text_width(&event.label, size) + 4.0, size * 1.28],
            "fill=\"#fff\"",
        );
        svg.text([*x, base], size, Anchor::Start, "", &event.label);
    }
}

/// Left edge and row of each event's label so that none overlap; and where the first panel may begin.
fn header(
    events: &[Event],
    span: [f64; 2],
    [left, width]: [f64; 2],
    size: f64,
) -> (Vec<(f64, usize)>, f64) {
    let mut ends: Vec<Vec<[f64; 2]>> = Vec::new();
    let places = events
        .iter()
        .map(|e| {
            // Fonts differ: a replacement may be a tenth wider.
            let w = 1.1 * text_width(&e.label, size) + 10.0;
            let at = left + (e.t_s - span[0]) / (span[1] - span[0]) * width;
            let x = (at - 0.5 * w).clamp(left, (left + width - w).max(left));
            let free = |row: &Vec<[f64; 2]>| row.iter().all(|[a, b]| x > *b || x + w < *a);
            let row = ends.iter().position(free).unwrap_or(ends.len());
            if row == ends.len() {
                ends.push(Vec::new());
            }
            if let Some(taken) = ends.get_mut(row) {
                taken.push([x, x + w]);
            }
            (x, row)
        })
        .collect();
    (places, size * (1.3 * num::real(ends.len()) + 0.6))
}

/// The pulse of the first impact on its own time scale; gives the height reached.
fn pulse(
    svg: &mut Svg,
    r: &Reconstruction,
    z: f64,
    [left, y, width, size]: [f64; 4],
    id: &str,
) -> f64 {
    let Some(impact) = r.impacts.first() else {
        return y;
    };
    let from = impact.t_s.value - 0.06;
    let span = [from, (impact.delta_v.end_t_s + 0.08).max(from + 0.2)];
    let forward = series(r, |s| (s.accel[0], z * s.sd_accel[0]));
    let right = Series {
        color: VERMILION,
        band: VERMILION_BAND,
        dash: "7 3",
        ..series(r, |s| (s.accel[1], z * s.sd_accel[1]))
    };
    let outside = |t: f64| t < span[0] || t > span[1];
    let (a, b) = (range(&forward, 10.0, outside), range(&right, 10.0, outside));
    let panel = Panel {
        title: if width > 700.0 {
            "The pulse: forward (solid) and rightward (dashed) acceleration, means over 10 ms, m/s\u{b2}"
        } else {
            "The pulse: forward, right (dashed), m/s\u{b2}"
        },
        area: Area {
            x: left,
            y: y + 30.0,
            w: width - left - 16.0,
            h: 170.0,
        },
        span,
        range: [a[0].min(b[0]), a[1].max(b[1])],
        time_factor: 1000.0,
        time_label: Some("milliseconds from the first trigger"),
        size,
        id,
    };
    panel.start(svg, &shaded(r));
    panel.series(svg, &right);
    panel.series(svg, &forward);
    for (t, style) in [
        (impact.t_s.value, "stroke=\"#a3003f\" stroke-width=\"1.8\""),
        (
            impact.delta_v.end_t_s,
            "stroke=\"#a3003f\" stroke-width=\"1.2\" stroke-dasharray=\"3 3\"",
        ),
        (
            0.0,
            "stroke=\"#111\" stroke-width=\"1.2\" stroke-dasharray=\"2 3\"",
        ),
    ] {
        if !outside(t) {
            let x = panel.time().at(t);
            svg.line([x, panel.area.y], [x, panel.area.y + panel.area.h], style);
        }
    }
    panel.finish(svg);
    panel.area.y + panel.area.h + 3.4 * size
}

/// The cumulative delta-V of the first impact; gives the height reached.
fn change(
    svg: &mut Svg,
    r: &Reconstruction,
    z: f64,
    [left, y, width, size]: [f64; 4],
    id: &str,
) -> f64 {
    let Some(impact) = r.impacts.first() else {
        return y;
    };
    let points = reported(&impact.delta_v.curve);
    let Some(last) = points.last() else {
        return y;
    };
    let line = |of: &dyn Fn(&CurvePoint) -> Figure, color, band, dash| Series {
        points: std::iter::once((0.0, Some(0.0), 0.0))
            .chain(points.iter().map(|p| {
                let f = of(p);
                (p.after_onset_s, Some(f.value * KMH), z * f.sd * KMH)
            }))
            .collect(),
        color,
        band,
        dash,
    };
    let forward = line(&|p| p.longitudinal_mps, BLUE, BLUE_BAND, "");
    let right = line(&|p| p.lateral_mps, VERMILION, VERMILION_BAND, "7 3");
    let (a, b) = (
        range(&forward, 10.0, |_| false),
        range(&right, 10.0, |_| false),
    );
    let panel = Panel {
        title: if width > 700.0 {
            "Cumulative delta-V: forward (solid) and to the right (dashed), axes of the car at the onset, km/h"
        } else {
            "Delta-V: forward, right (dashed), km/h"
        },
        area: Area {
            x: left,
            y: y + 24.0,
            w: width - left - 16.0,
            h: 150.0,
        },
        span: [0.0, last.after_onset_s.max(0.05)],
        range: [a[0].min(b[0]), a[1].max(b[1])],
        time_factor: 1000.0,
        time_label: Some("milliseconds after the onset of the first impact"),
        size,
        id,
    };
    panel.start(svg, &[]);
    panel.series(svg, &right);
    panel.series(svg, &forward);
    let end = impact.delta_v.end_t_s - impact.t_s.value;
    if end > 0.0 && end < panel.span[1] {
        let x = panel.time().at(end);
        svg.line(
            [x, panel.area.y],
            [x, panel.area.y + panel.area.h],
            "stroke=\"#a3003f\" stroke-width=\"1.2\" stroke-dasharray=\"3 3\"",
        );
    }
    panel.finish(svg);
    panel.area.y + panel.area.h + 3.4 * size
}

fn legend(svg: &mut Svg, r: &Reconstruction, shaded: bool, [left, y, _, size]: [f64; 4]) -> f64 {
    let mut row = y + 10.0;
    svg.rect(
        [left, row - 9.0],
        [26.0, 13.0],
        &format!("fill=\"{BLUE_BAND}\""),
    );
    svg.line(
        [left, row - 2.5],
        [left + 26.0, row - 2.5],
        &format!("stroke=\"{BLUE}\" stroke-width=\"1.8\""),
    );
    let band = format!("estimate and its {} band", number::percent(r.confidence));
    svg.text([left + 33.0, row + 3.0], size, Anchor::Start, "", &band);
    if shaded {
        row += 1.5 * size;
        hatch(
            svg,
            Area {
                x: left,
                y: row - 9.0,
                w: 26.0,
                h: 13.0,
            },
        );
        svg.text(
            [left + 33.0, row + 3.0],
            size,
            Anchor::Start,
            "",
            "samples missing or clipped, bridged",
        );
    }
    row + size
}

#[cfg(test)]
mod tests {
    use super::{Layout, events, header, picture};
    use crate::report::sample_case;

    #[test]
    fn the_same_input_gives_the_same_bytes() {
        let r = sample_case::reconstruction();
        let wide = picture(&r, Layout::Wide, "w");
        assert_eq!(wide, picture(&r.clone(), Layout::Wide, "w"));
        assert!(!wide.contains("NaN"));
        assert!(picture(&r, Layout::Narrow, "n").contains("off scale"));
    }

    #[test]
    fn event_labels_in_one_row_do_not_overlap() {
        let r = sample_case::reconstruction();
        let events = events(&r);
        let (places, _) = header(&events, [-30.0, 8.0], [50.0, 400.0], 14.0);
        for (i, (x, row)) in places.iter().enumerate() {
            for (j, (other, row_other)) in places.iter().enumerate().skip(i + 1) {
                let w = super::text_width(&events[i].label, 14.0);
                let w_other = super::text_width(&events[j].label, 14.0);
                assert!(row != row_other || x + w < *other || other + w_other < *x);
            }
        }
    }

    #[test]
    fn a_window_without_samples_is_drawn_as_such() {
        let mut r = sample_case::reconstruction();
        r.states.clear();
        assert!(picture(&r, Layout::Wide, "w").contains("No samples to draw"));
    }
}
