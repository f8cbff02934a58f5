//! The picture of the map: road lines, the path on them with its funnel, rivals, the rough point.

use crate::export::ellipse::{self, Ellipse};
use crate::findings::Reconstruction;
use crate::map::place::{Answer, Placing};
use crate::map::search::Verdict;
use crate::report::axis::Scale;
use crate::report::labels::Area;
use crate::report::map_json;
use crate::report::plan_signs::{ScaleBar, arrow, plate};
use crate::report::svg::{self, Anchor, Svg};

const SIZE: [f64; 2] = [1000.0, 680.0];
const FOOT: f64 = 56.0;
const PLACED: &str = "stroke=\"#1f5a96\" stroke-width=\"3\" stroke-linejoin=\"round\"";
const UNSURE: &str =
    "stroke=\"#1f5a96\" stroke-width=\"3\" stroke-linejoin=\"round\" stroke-dasharray=\"9 5\"";
const RIVAL: &str =
    "stroke=\"#d55e00\" stroke-width=\"2\" stroke-linejoin=\"round\" stroke-dasharray=\"3 4\"";
const ROAD: &str = "stroke=\"#a7adb5\" stroke-width=\"2\" stroke-linecap=\"round\"";
const ROUGH: &str =
    "fill=\"none\" stroke=\"#7a2f8f\" stroke-width=\"1.6\" stroke-dasharray=\"6 4\"";
/// Rivals drawn at most.
const RIVALS: usize = 4;

struct Frame {
    east: Scale,
    north: Scale,
    per_metre: f64,
}

impl Frame {
    fn at(&self, [north, east]: [f64; 2]) -> [f64; 2] {
        [self.east.at(east), self.north.at(north)]
    }
}

/// Draws it.
#[must_use]
pub(crate) fn picture(r: &Reconstruction, p: &Placing) -> String {
    let mut svg = Svg::new();
    svg.rect([0.0, 0.0], SIZE, "fill=\"#fff\"");
    let placed = p.verdict == Verdict::Placed;
    let shown: Vec<&Answer> = match p.verdict {
        Verdict::Placed | Verdict::NoFit => p.answers.iter().take(1).collect(),
        Verdict::Ambiguous => p
            .answers
            .iter()
            .enumerate()
            .filter(|(i, a)| *i == 0 || a.probability >= 0.02)
            .map(|(_, a)| a)
            .take(1 + RIVALS)
            .collect(),
    };
    let paths: Vec<Vec<[f64; 2]>> = shown.iter().map(|a| laid(r, a, placed)).collect();
    let frame = frame(&paths, p.point.sd_m);
    svg.raw(&format!(
        "<clipPath id=\"mp\"><rect x=\"1\" y=\"1\" width=\"{}\" height=\"{}\"/></clipPath><g clip-path=\"url(#mp)\">",
        SIZE[0] - 2.0,
        SIZE[1] - FOOT - 2.0
    ));
    roads(&mut svg, &frame, p);
    if let (true, Some(best)) = (placed, shown.first()) {
        funnel(&mut svg, &frame, r, best);
    }
    for (i, path) in paths.iter().enumerate().rev() {
        let style = match (i, placed) {
            (0, true) => PLACED,
            (0, false) => UNSURE,
            _ => RIVAL,
        };
        let line: Vec<[f64; 2]> = path.iter().map(|q| frame.at(*q)).collect();
        svg.polyline(&line, style);
        if let Some(rest) = line.last() {
            let colour = if i == 0 { "#111" } else { "#d55e00" };
            svg.rect(
                [rest[0] - 5.5, rest[1] - 5.5],
                [11.0, 11.0],
                &format!("fill=\"{colour}\" stroke=\"#fff\" stroke-width=\"1.5\""),
            );
        }
    }
    for (i, a) in shown
        .iter()
        .enumerate()
        .filter(|_| p.verdict != Verdict::NoFit)
    {
        let colour = if i == 0 { "#24567f" } else { "#d55e00" };
        ring(
            &mut svg,
            &frame,
            &map_json::ellipse(a, r.confidence),
            &format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.4\""),
        );
    }
    rough(&mut svg, &frame, p);
    svg.raw("</g>");
    svg.rect(
        [0.5, 0.5],
        [SIZE[0] - 1.0, SIZE[1] - FOOT - 1.0],
        "fill=\"none\" stroke=\"#333\" stroke-width=\"1\"",
    );
    marks(&mut svg, &frame);
    legend(&mut svg, p, shown.len());
    let title = match p.verdict {
        Verdict::Placed => "The path on the road map",
        Verdict::Ambiguous => "Places on the road map where the path may lie",
        Verdict::NoFit => "The road map, on which the path fits nowhere",
    };
    svg::picture(
        SIZE,
        title,
        "Plan view, true north up, in metres.",
        &svg.into_body(),
    )
}

/// The path at an answer, north and east of the rough point. A placed reconstruction is turned already.
fn laid(r: &Reconstruction, a: &Answer, placed: bool) -> Vec<[f64; 2]> {
    let heading = if placed { 0.0 } else { a.fit.pose.z };
    let (s, c) = heading.sin_cos();
    ellipse::thinned(&r.states, 10)
        .map(|state| {
            let [n, e, _] = state.position;
            [a.fit.pose.x + c * n - s * e, a.fit.pose.y + s * n + c * e]
        })
        .collect()
}

fn frame(paths: &[Vec<[f64; 2]>], sd_m: f64) -> Frame {
    let (mut low, mut high) = ([-3.0 * sd_m; 2], [3.0 * sd_m; 2]);
    for q in paths.iter().flatten() {
        for axis in 0..2 {
            low[axis] = low[axis].min(q[axis] - 15.0);
            high[axis] = high[axis].max(q[axis] + 15.0);
        }
    }
    let (w, h) = (SIZE[0], SIZE[1] - FOOT);
    let extent = [(high[0] - low[0]) * 1.06, (high[1] - low[1]) * 1.06];
    let per_metre = (h / extent[0]).min(w / extent[1]);
    let centre = [
        f64::midpoint(low[0], high[0]),
        f64::midpoint(low[1], high[1]),
    ];
    let half = [0.5 * h / per_metre, 0.5 * w / per_metre];
    Frame {
        east: Scale {
            low: centre[1] - half[1],
            high: centre[1] + half[1],
            from: 0.0,
            to: w,
        },
        north: Scale {
            low: centre[0] - half[0],
            high: centre[0] + half[0],
            from: h,
            to: 0.0,
        },
        per_metre,
    }
}

/// Road pieces in view; neighbours are joined into one line.
fn roads(svg: &mut Svg, frame: &Frame, p: &Placing) {
    let inside = |q: &[f64; 2]| {
        let margin = 60.0;
        q[0] > frame.north.low - margin
            && q[0] < frame.north.high + margin
            && q[1] > frame.east.low - margin
            && q[1] < frame.east.high + margin
    };
    let mut line: Vec<[f64; 2]> = Vec::new();
    let mut end: Option<[f64; 2]> = None;
    let mut flush = |line: &mut Vec<[f64; 2]>| {
        svg.polyline(line, ROAD);
        line.clear();
    };
    for [a, b] in p.pieces.iter().filter(|[a, b]| inside(a) || inside(b)) {
        let joined = end.is_some_and(|e| (e[0] - a[0]).hypot(e[1] - a[1]) < 1e-6);
        if !joined {
            flush(&mut line);
            line.push(frame.at(*a));
        }
        line.push(frame.at(*b));
        end = Some(*b);
    }
    flush(&mut line);
}

/// The ellipses of the funnel on the earth: one a second.
fn funnel(svg: &mut Svg, frame: &Frame, r: &Reconstruction, best: &Answer) {
    let pose = r.rest_pose.as_ref();
    for polygon in ellipse::outline(&r.states, pose, r.confidence) {
        let rings: Vec<Vec<[f64; 2]>> = polygon
            .iter()
            .map(|ring| {
                ring.iter()
                    .map(|q| frame.at([q[0] + best.fit.pose.x, q[1] + best.fit.pose.y]))
                    .collect()
            })
            .collect();
        svg.rings(
            &rings,
            "fill=\"#bcd3ea\" fill-opacity=\"0.55\" stroke=\"#6d8fb0\" stroke-width=\"0.8\"",
        );
    }
}

fn ring(svg: &mut Svg, frame: &Frame, e: &Ellipse, style: &str) {
    let points: Vec<[f64; 2]> = e.points(48).into_iter().map(|q| frame.at(q)).collect();
    svg.polygon(&points, style);
}

fn rough(svg: &mut Svg, frame: &Frame, p: &Placing) {
    let at = frame.at([0.0, 0.0]);
    svg.circle(at, 2.0 * p.point.sd_m * frame.per_metre, ROUGH);
    for d in [[6.0, 6.0], [6.0, -6.0]] {
        svg.line(
            [at[0] - d[0], at[1] - d[1]],
            [at[0] + d[0], at[1] + d[1]],
            "stroke=\"#7a2f8f\" stroke-width=\"2\"",
        );
    }
}

fn marks(svg: &mut Svg, frame: &Frame) {
    let bar = ScaleBar::about(90.0, frame.per_metre);
    let [x, y] = [16.0, SIZE[1] - FOOT - 14.0];
    let area = Area {
        x: x - 8.0,
        y: y - 28.0,
        w: bar.length + 60.0,
        h: 36.0,
    };
    plate(svg, area);
    bar.draw(svg, [x, y], 15.0);
    let area = Area {
        x: 8.0,
        y: 8.0,
        w: 74.0,
        h: 36.0,
    };
    plate(svg, area);
    arrow(svg, [20.0, 12.0], 15.0, "north");
}

fn legend(svg: &mut Svg, p: &Placing, shown: usize) {
    let mut entries: Vec<(&str, &str)> = vec![("road", "road lines of the map")];
    match p.verdict {
        Verdict::Placed => {
            entries.push(("placed", "path"));
            entries.push(("funnel", "funnel, the fit's doubt included"));
        }
        Verdict::Ambiguous => {
            entries.push(("unsure", "most likely of several, not claimed"));
            if shown > 1 {
                entries.push(("rival", "rivals"));
            }
        }
        Verdict::NoFit if shown > 0 => entries.push(("unsure", "best try: does not fit")),
        Verdict::NoFit => {}
    }
    if shown > 0 {
        entries.push(("rest", "rest"));
    }
    entries.push(("rough", "rough rest point, two sigma"));
    let mut x = 6.0;
    let y = SIZE[1] - FOOT + 28.0;
    for (kind, text) in entries {
        let (from, to) = ([x, y], [x + 28.0, y]);
        match kind {
            "road" => svg.line(from, to, ROAD),
            "placed" => svg.line(from, to, PLACED),
            "unsure" => svg.line(from, to, UNSURE),
            "rival" => svg.line(from, to, RIVAL),
            "funnel" => svg.rect(
                [x, y - 7.0],
                [28.0, 14.0],
                "fill=\"#bcd3ea\" stroke=\"#6d8fb0\" stroke-width=\"0.8\"",
            ),
            "rest" => svg.rect([x + 9.0, y - 5.5], [11.0, 11.0], "fill=\"#111\""),
            _ => svg.circle([x + 14.0, y], 9.0, ROUGH),
        }
        svg.text([x + 34.0, y + 5.0], 15.0, Anchor::Start, "", text);
        x += 34.0 + svg::text_width(text, 15.0) + 16.0;
    }
}
