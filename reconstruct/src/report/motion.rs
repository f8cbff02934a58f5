//! `motion.svg`: speed, accelerations and yaw rate over time with their bands, and the crash pulse close up.

use schema::num;

use crate::findings::Reconstruction;
use crate::report::labels::Area;
use crate::report::number::{self, KMH};
use crate::report::panel::{Panel, Series, hatch};
use crate::report::svg::{self, Anchor, Svg, signed, text_width};
use crate::stats::two_sided_quantile;
use crate::trajectory::State;

const BLUE: &str = "#1f5a96";
const BLUE_BAND: &str = "#b9d0e8";
const VERMILION: &str = "#c24e00";
const VERMILION_BAND: &str = "#f3cdb2";

/// Layout of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// For a file, a screen and paper.
    Wide,
    /// For a phone: narrower, so that the text stays readable.
    Narrow,
}

/// The file `motion.svg`.
#[must_use]
pub fn file(r: &Reconstruction) -> String {
    svg::file(&picture(r, Layout::Wide, "mf"))
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
    y = legend(&mut body, r, !shaded.is_empty(), [left, y, width, size]);
    svg.rect([0.0, 0.0], [width, y], "fill=\"#fff\"");
    let axis = Panel {
        title: "",
        area: Area {
            x: left,
            y: top + 24.0,
            w: width - left - 16.0,
            h: 1.0,
        },
        span,
        range: [0.0, 1.0],
        time_factor: 1.0,
        time_label: None,
        size,
        id: "",
    }
    .time();
    for (event, (x, row)) in events.iter().zip(&rows) {
        let base = size * (1.3 * num::real(*row) + 1.2);
        let at = axis.at(event.t_s);
        svg.line([at, base + 4.0], [at, top + 24.0], event.style);
        svg.rect(
            [*x - 2.0, base - size],
            [text_width(&event.label, size) + 4.0, size * 1.28],
            "fill=\"#fff\"",
        );
        svg.text([*x, base], size, Anchor::Start, "", &event.label);
    }
    svg.raw(&body.into_body());
    svg::picture(
        [width, y],
        "Motion over time",
        &description,
        &svg.into_body(),
    )
}

fn span(r: &Reconstruction) -> Option<[f64; 2]> {
    let (first, last) = r.states.first().zip(r.states.last())?;
    Some([first.t_s, last.t_s.max(first.t_s + 0.1)])
}

/// Stretches whose samples are missing or were bridged.
fn shaded(r: &Reconstruction) -> Vec<[f64; 2]> {
    let mut out: Vec<[f64; 2]> = Vec::new();
    for s in r
        .states
        .iter()
        .filter(|s| s.bridged || s.accel.iter().any(Option::is_none) || s.yaw_rate.is_none())
    {
        match out.last_mut() {
            Some(last) if s.t_s - last[1] < 0.021 => last[1] = s.t_s,
            _ => out.push([s.t_s - 0.01, s.t_s]),
        }
    }
    out
}

struct Plot {
    title: &'static str,
    unit: &'static str,
    series: Series,
    range: [f64; 2],
}

fn series(r: &Reconstruction, value: impl Fn(&State) -> (Option<f64>, f64)) -> Series {
    let points = r
        .states
        .iter()
        .map(|s| (s.t_s, value(s).0, value(s).1))
        .collect();
    Series {
        points,
        color: BLUE,
        band: BLUE_BAND,
        dash: "",
    }
}

fn plots(r: &Reconstruction, z: f64) -> Vec<Plot> {
    let speed = series(r, |s| (Some(s.speed * KMH), z * s.sd_speed * KMH));
    let forward = series(r, |s| (s.accel[0], z * s.sd_accel[0]));
    let right = series(r, |s| (s.accel[1], z * s.sd_accel[1]));
    let yaw = series(r, |s| {
        (
            s.yaw_rate.map(f64::to_degrees),
            z * s.sd_yaw_rate.to_degrees(),
        )
    });
    let quiet = |s: &Series, least: f64| range(s, least, |t| in_pulse(r, t));
    let ranges = [
        range(&speed, 10.0, |_| false),
        quiet(&forward, 4.0),
        quiet(&right, 4.0),
        quiet(&yaw, 10.0),
    ];
    let [r0, r1, r2, r3] = ranges;
    vec![
        Plot {
            title: "Forward speed, km/h",
            unit: "km/h",
            series: speed,
            range: r0,
        },
        Plot {
            title: "Forward acceleration, m/s\u{b2}",
            unit: "m/s\u{b2}",
            series: forward,
            range: r1,
        },
        Plot {
            title: "Rightward acceleration, m/s\u{b2}",
            unit: "m/s\u{b2}",
            series: right,
            range: r2,
        },
        Plot {
            title: "Yaw rate, \u{b0}/s (to the right)",
            unit: "\u{b0}/s",
            series: yaw,
            range: r3,
        },
    ]
}

fn in_pulse(r: &Reconstruction, t: f64) -> bool {
    r.impacts
        .iter()
        .any(|i| t > i.t_s.value - 0.05 && t < i.delta_v.end_t_s + 0.15)
}

/// Ends of an axis that holds zero and every band outside what is left out, at least `least` high.
fn range(s: &Series, least: f64, leave_out: impl Fn(f64) -> bool) -> [f64; 2] {
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for (_, v, half) in s.points.iter().filter(|p| !leave_out(p.0)) {
        if let (Some(v), true) = (v, half.is_finite()) {
            low = low.min(v - half);
            high = high.max(v + half);
        }
    }
    let missing = (least - (high - low)).max(0.0);
    let margin = 0.06 * (high - low + missing);
    [
        if low < 0.0 {
            low - margin - 0.5 * missing
        } else {
            -margin
        },
        high + margin + missing * if low < 0.0 { 0.5 } else { 1.0 },
    ]
}

struct Event {
    t_s: f64,
    label: String,
    style: &'static str,
}

fn events(r: &Reconstruction) -> Vec<Event> {
    let mut out = Vec::new();
    if let Some(b) = &r.braking {
        out.push(Event {
            t_s: b.onset_t_s.value,
            label: format!("braking {} s", signed(b.onset_t_s.value, 2)),
            style: "stroke=\"#c24e00\" stroke-width=\"1.6\" stroke-dasharray=\"7 3\"",
        });
    }
    for (i, impact) in r.impacts.iter().enumerate() {
        let name = if r.impacts.len() > 1 {
            format!("impact {}", i + 1)
        } else {
            "impact".to_owned()
        };
        out.push(Event {
            t_s: impact.t_s.value,
            label: format!("{name} {} s", signed(impact.t_s.value, 3)),
            style: "stroke=\"#a3003f\" stroke-width=\"1.8\"",
        });
    }
    out.push(Event {
        t_s: 0.0,
        label: "trigger".to_owned(),
        style: "stroke=\"#111\" stroke-width=\"1.2\" stroke-dasharray=\"2 3\"",
    });
    if let (true, Some(t)) = (r.rest.found, r.rest.t_s) {
        out.push(Event {
            t_s: t,
            label: format!("rest {} s", signed(t, 1)),
            style: "stroke=\"#111\" stroke-width=\"1.2\" stroke-dasharray=\"9 3 2 3\"",
        });
    }
    if let Some([from, to]) = span(r) {
        out.retain(|e| e.t_s >= from && e.t_s <= to);
    }
    out
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
            let w = text_width(&e.label, size) + 10.0;
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
    use super::{Layout, events, file, header, picture};
    use crate::report::sample_case;

    #[test]
    fn the_same_input_gives_the_same_bytes() {
        let r = sample_case::reconstruction();
        assert_eq!(file(&r), file(&r.clone()));
        assert!(!file(&r).contains("NaN"));
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
