//! The drive from above [S00, figures 4.5 to 4.8 and 4.11 to 4.14].

use std::collections::BTreeSet;

use schema::num;

use super::stage::{Key, SIZE, WIDTH, cross, legend};
use super::{OURS, RECEIVER, Shown, TRUTH};
use crate::export::ellipse::{Covariance, Ellipse};
use crate::gnss::forward::{Estimate, Fate};
use crate::report::axis::{Scale, round_step, step_decimals};
use crate::report::labels::{Area, Placer};
use crate::report::svg::{self, Anchor, Svg, signed};
use crate::wgs84::Geodetic;

const LEFT: f64 = 66.0;
const TOP: f64 = 12.0;
const RIGHT: f64 = 14.0;
const FOOT: f64 = 48.0;
/// Track without fixes.
const BLIND: &str = "#c24e00";
const REFUSED: &str = "#a3003f";
/// Points of one line at most.
const POINTS: usize = 6000;
/// Half the length of the close view, s.
const CLOSE_S: f64 = 15.0;

struct Frame {
    origin: Geodetic,
    east: Scale,
    north: Scale,
    per_metre: f64,
    height: f64,
}

impl Frame {
    fn at(&self, place: &Geodetic) -> [f64; 2] {
        let d = self.origin.to(place);
        [self.east.at(d.y), self.north.at(d.x)]
    }

    fn new(origin: Geodetic, points: &[[f64; 2]], margin: f64) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in points {
            for axis in 0..2 {
                low[axis] = low[axis].min(p[axis] - margin);
                high[axis] = high[axis].max(p[axis] + margin);
            }
        }
        if !(low[0].is_finite() && high[0].is_finite()) {
            (low, high) = ([-10.0; 2], [10.0; 2]);
        }
        let extent = [0, 1].map(|i| ((high[i] - low[i]) * 1.06).max(20.0));
        let w = WIDTH - LEFT - RIGHT;
        let height = (w * extent[0] / extent[1]).clamp(400.0, 780.0);
        let per_metre = (height / extent[0]).min(w / extent[1]);
        let centre = [0, 1].map(|i| f64::midpoint(low[i], high[i]));
        let half = [0.5 * height / per_metre, 0.5 * w / per_metre];
        Self {
            origin,
            east: Scale {
                low: centre[1] - half[1],
                high: centre[1] + half[1],
                from: LEFT,
                to: LEFT + w,
            },
            north: Scale {
                low: centre[0] - half[0],
                high: centre[0] + half[0],
                from: TOP + height,
                to: TOP,
            },
            per_metre,
            height,
        }
    }
}

/// A line in picture units without the points that nobody can see: those nearer than `step` to the one before, and step
/// grows until few are left. Those farthest out on each side stay.
fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let far = |axis: usize, sign: f64| {
        let by =
            |a: &usize, b: &usize| (sign * points[*a][axis]).total_cmp(&(sign * points[*b][axis]));
        (0..points.len()).max_by(by)
    };
    let kept: BTreeSet<usize> = [far(0, 1.0), far(0, -1.0), far(1, 1.0), far(1, -1.0)]
        .into_iter()
        .flatten()
        .chain(points.len().checked_sub(1))
        .collect();
    let mut step: f64 = 0.5;
    loop {
        let mut out: Vec<[f64; 2]> = Vec::new();
        for (i, p) in points.iter().enumerate() {
            let new = out
                .last()
                .is_none_or(|l| (l[0] - p[0]).hypot(l[1] - p[1]) >= step);
            if new || kept.contains(&i) {
                out.push(*p);
            }
        }
        if out.len() <= POINTS || step > 1e4 {
            return out;
        }
        step *= 1.6;
    }
}

fn within(span: &[f64; 2], t: f64) -> bool {
    t >= span[0] && t <= span[1]
}

/// The whole drive.
#[must_use]
pub fn whole(shown: &Shown<'_>) -> String {
    let ends = [f64::NEG_INFINITY, f64::INFINITY];
    picture(shown, ends, false)
}

/// Thirty seconds about the largest deviation, or about the end of the longest outage; `None` where there is neither, or
/// where the drive is no longer than that.
#[must_use]
pub fn close(shown: &Shown<'_>) -> Option<String> {
    let worst = shown
        .seconds
        .iter()
        .max_by(|a, b| a.off_m.total_cmp(&b.off_m))
        .map(|s| s.t_s);
    let longest = shown
        .outages
        .iter()
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
        .map(|o| o[1]);
    let (first, last) = (shown.track.first()?.t_s, shown.track.last()?.t_s);
    if last - first < 3.0 * CLOSE_S {
        return None;
    }
    let middle = worst.or(longest)?.clamp(first + CLOSE_S, last - CLOSE_S);
    Some(picture(shown, [middle - CLOSE_S, middle + CLOSE_S], true))
}

fn picture(shown: &Shown<'_>, span: [f64; 2], near: bool) -> String {
    let track: Vec<&Estimate> = shown
        .track
        .iter()
        .filter(|e| within(&span, e.t_s))
        .collect();
    let Some(first) = track.first() else {
        return svg::picture([WIDTH, 40.0], "No track", "Nothing to draw.", "");
    };
    let origin = shown.track.first().map_or(first.place, |e| e.place);
    let local = |p: &Geodetic| {
        let d = origin.to(p);
        [d.x, d.y]
    };
    let marks: Vec<_> = shown
        .reference
        .marks
        .iter()
        .filter(|m| within(&span, m.t_s) && m.t_s > first.t_s - 1.0)
        .filter(|m| track.last().is_some_and(|e| m.t_s < e.t_s + 1.0))
        .collect();
    let chosen = instants(shown, &track, near);
    let mut points: Vec<[f64; 2]> = track.iter().map(|e| local(&e.place)).collect();
    points.extend(marks.iter().map(|m| local(&m.place)));
    points.extend(
        chosen
            .iter()
            .flat_map(|e| ellipse(e, local(&e.place)).points(12)),
    );
    let frame = Frame::new(origin, &points, if near { 4.0 } else { 10.0 });
    let id = if near { "gpc" } else { "gp" };
    let mut svg = Svg::new();
    grid(&mut svg, &frame);
    svg.raw(&format!(
        "<clipPath id=\"{id}\"><rect x=\"{LEFT:.1}\" y=\"{TOP:.1}\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath><g clip-path=\"url(#{id})\">",
        WIDTH - LEFT - RIGHT,
        frame.height
    ));
    for e in &chosen {
        let ring: Vec<[f64; 2]> = ellipse(e, local(&e.place))
            .points(40)
            .into_iter()
            .map(|[n, m]| [frame.east.at(m), frame.north.at(n)])
            .collect();
        svg.polygon(
            &ring,
            &format!(
                "fill=\"{}\" fill-opacity=\"0.45\" stroke=\"#6d8fb0\" stroke-width=\"0.9\"",
                OURS[1]
            ),
        );
    }
    for run in marks.chunk_by(|a, b| b.t_s - a.t_s < 3.0) {
        let line: Vec<[f64; 2]> = run.iter().map(|m| frame.at(&m.place)).collect();
        svg.polyline(
            &thinned(&line),
            &format!("stroke=\"{TRUTH}\" stroke-width=\"1.6\" stroke-dasharray=\"5 3\""),
        );
    }
    lines(&mut svg, &frame, shown, &track);
    let line: Vec<[f64; 2]> = track.iter().map(|e| frame.at(&e.place)).collect();
    if near {
        pairs(&mut svg, &frame, &track, &marks);
    }
    fixes(
        &mut svg,
        &frame,
        shown,
        [first.t_s, track.last().map_or(0.0, |e| e.t_s)],
    );
    labels(&mut svg, &frame, shown, &track, thinned(&line));
    svg.raw("</g>");
    svg.rect(
        [LEFT, TOP],
        [WIDTH - LEFT - RIGHT, frame.height],
        "fill=\"none\" stroke=\"#333\"",
    );
    finish(svg, &frame, shown, near)
}

fn finish(mut svg: Svg, frame: &Frame, shown: &Shown<'_>, near: bool) -> String {
    let mut entries = vec![
        (Key::Line(OURS[0]), "track"),
        (Key::Line(BLIND), "track, no fix used for 2.5 s and more"),
        (Key::Band(OURS[1]), "ellipse of 95 %"),
    ];
    if !shown.reference.marks.is_empty() {
        entries.push((Key::Dashed(TRUTH), "reference"));
    }
    entries.push((Key::Dot(RECEIVER), "fix used"));
    if shown.shots.iter().any(|s| s.fate.is_none()) {
        entries.push((Key::Ring("#777"), "fix withheld"));
    }
    if shown
        .shots
        .iter()
        .any(|s| matches!(s.fate, Some(Fate::Refused | Fate::Forced)))
    {
        entries.push((
            Key::Cross(REFUSED),
            "fix refused, or used only after refusals",
        ));
    }
    entries.push((Key::Square("#111"), "stand"));
    let foot = legend(&mut svg, TOP + frame.height + FOOT + 8.0, &entries);
    let size = [WIDTH, foot + 4.0];
    let mut back = Svg::new();
    back.rect([0.0, 0.0], size, "fill=\"#fff\"");
    let title = if near {
        "The drive from above, close"
    } else {
        "The drive from above"
    };
    svg::picture(
        size,
        title,
        "Plan view, true north up, in metres from the start of the track.",
        &(back.into_body() + &svg.into_body()),
    )
}

fn ellipse(e: &Estimate, centre: [f64; 2]) -> Ellipse {
    let p = e.horizontal();
    let p = Covariance {
        north: p[(0, 0)],
        east: p[(1, 1)],
        cross: p[(0, 1)],
    };
    Ellipse::new(centre, p, 0.95)
}

/// Where ellipses stand: just before the ends of the longest outages and at even distances; in the close view each 3 s.
fn instants<'e>(shown: &Shown<'_>, track: &[&'e Estimate], near: bool) -> Vec<&'e Estimate> {
    let mut chosen = BTreeSet::new();
    if near {
        let mut next = f64::NEG_INFINITY;
        for (i, e) in track.iter().enumerate() {
            if e.t_s >= next {
                chosen.insert(i);
                next = e.t_s + 3.0;
            }
        }
    } else {
        let mut way = vec![0.0];
        for pair in track.windows(2) {
            let step = (pair[1].t_s - pair[0].t_s) * pair[0].v_n.xy().norm();
            way.push(way[way.len() - 1] + step);
        }
        let all = way[way.len() - 1];
        for i in 0..14_u8 {
            chosen.insert(way.partition_point(|w| *w < all * f64::from(i) / 13.0));
        }
        let mut longest: Vec<&[f64; 2]> = shown.outages.iter().collect();
        longest.sort_by(|a, b| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
        for [_, end] in longest.into_iter().take(12) {
            chosen.insert(
                track
                    .partition_point(|e| e.t_s < end - 0.03)
                    .saturating_sub(1),
            );
        }
    }
    chosen
        .into_iter()
        .filter_map(|i| track.get(i).copied())
        .collect()
}

/// The track, its outages in another colour.
fn lines(svg: &mut Svg, frame: &Frame, shown: &Shown<'_>, track: &[&Estimate]) {
    let blind = |t: f64| {
        let at = shown.outages.partition_point(|o| o[1] < t);
        shown.outages.get(at).is_some_and(|o| within(o, t))
    };
    let style =
        |color| format!("stroke=\"{color}\" stroke-width=\"2.2\" stroke-linejoin=\"round\"");
    let line: Vec<[f64; 2]> = track.iter().map(|e| frame.at(&e.place)).collect();
    svg.polyline(&thinned(&line), &style(OURS[0]));
    for run in track.chunk_by(|a, b| blind(a.t_s) == blind(b.t_s)) {
        if blind(run[0].t_s) {
            let line: Vec<[f64; 2]> = run.iter().map(|e| frame.at(&e.place)).collect();
            svg.polyline(&thinned(&line), &style(BLIND));
        }
    }
}

/// Track and reference of the same second, joined.
fn pairs(
    svg: &mut Svg,
    frame: &Frame,
    track: &[&Estimate],
    marks: &[&crate::gnss::reference::Mark],
) {
    let mut last = f64::NEG_INFINITY;
    for m in marks {
        let at = track.partition_point(|e| e.t_s < m.t_s - 0.011);
        let Some(e) = track.get(at).filter(|e| (e.t_s - m.t_s).abs() < 0.03) else {
            continue;
        };
        if m.t_s - last < 0.9 {
            continue;
        }
        last = m.t_s;
        let (a, b) = (frame.at(&e.place), frame.at(&m.place));
        svg.line(a, b, "stroke=\"#777\" stroke-width=\"0.8\"");
        svg.circle(a, 2.6, &format!("fill=\"{}\"", OURS[0]));
        svg.circle(b, 2.6, "fill=\"#fff\" stroke=\"#111\" stroke-width=\"1\"");
    }
}

/// Fixes, one of a kind a cell of the picture; cells grow until few are left.
fn fixes(svg: &mut Svg, frame: &Frame, shown: &Shown<'_>, span: [f64; 2]) {
    let kind = |fate: Option<Fate>| match fate {
        None => 0_u8,
        Some(Fate::Used) => 1,
        Some(Fate::Refused | Fate::Forced) => 2,
    };
    let list: Vec<(u8, [f64; 2])> = shown
        .shots
        .iter()
        .filter(|s| within(&span, s.fix.t_s))
        .map(|s| (kind(s.fate), frame.at(&s.fix.place)))
        .collect();
    let mut cell: f64 = 2.0;
    let kept = loop {
        let mut seen = BTreeSet::new();
        let fresh =
            |(k, at): &&(u8, [f64; 2])| seen.insert((*k, at.map(|x| num::floor_i64(x / cell))));
        let kept: Vec<_> = list.iter().filter(fresh).collect();
        if kept.len() <= POINTS {
            break kept;
        }
        cell *= 1.5;
    };
    for wanted in 0..3_u8 {
        for (_, at) in kept.iter().filter(|(k, _)| *k == wanted) {
            match wanted {
                0 => svg.circle(*at, 2.6, "fill=\"none\" stroke=\"#777\" stroke-width=\"1\""),
                1 => svg.circle(*at, 2.3, &format!("fill=\"{RECEIVER}\"")),
                _ => cross(svg, *at, REFUSED),
            }
        }
    }
}

fn labels(
    svg: &mut Svg,
    frame: &Frame,
    shown: &Shown<'_>,
    track: &[&Estimate],
    line: Vec<[f64; 2]>,
) {
    let bounds = Area {
        x: LEFT,
        y: TOP,
        w: WIDTH - LEFT - RIGHT,
        h: frame.height,
    };
    let mut placer = Placer::new(bounds, line);
    north_and_scale(svg, frame, &mut placer);
    let runs = track.chunk_by(|a, b| a.standing == b.standing);
    let mut stands: Vec<(f64, f64, [f64; 2])> = runs
        .filter(|run| run[0].standing && run.len() > 1)
        .map(|run| {
            let t = run[0].t_s;
            (run[run.len() - 1].t_s - t, t, frame.at(&run[0].place))
        })
        .collect();
    stands.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, _, [x, y]) in stands.iter().take(400) {
        let style = "fill=\"#111\" stroke=\"#fff\" stroke-width=\"1\"";
        svg.rect([x - 4.5, y - 4.5], [9.0, 9.0], style);
    }
    let mut said: Vec<([f64; 2], String)> = Vec::new();
    if let (Some(first), Some(last)) = (track.first(), track.last()) {
        said.push((
            frame.at(&first.place),
            format!("begins, {:.0} s", first.t_s),
        ));
        said.push((frame.at(&last.place), format!("ends, {:.0} s", last.t_s)));
    }
    let list = || {
        shown
            .seconds
            .iter()
            .filter(|s| track.first().is_some_and(|e| s.t_s >= e.t_s))
    };
    let worst = list()
        .filter(|s| track.last().is_some_and(|e| s.t_s <= e.t_s))
        .max_by(|a, b| a.off_m.total_cmp(&b.off_m));
    if let Some(s) = worst {
        let at = track.partition_point(|e| e.t_s < s.t_s);
        if let Some(e) = track.get(at) {
            let text = format!(
                "largest deviation {:.1} m, bound {:.1} m, {:.0} s",
                s.off_m, s.bound_m, s.t_s
            );
            said.push((frame.at(&e.place), text));
        }
    }
    for (length, t, at) in stands.iter().take(6).filter(|s| s.0 >= 1.0) {
        said.push((*at, format!("stands {length:.0} s from {t:.0} s")));
    }
    for (at, text) in said {
        placer.label(svg, at, 13.0, false, &[text]);
    }
}

fn north_and_scale(svg: &mut Svg, frame: &Frame, placer: &mut Placer) {
    let metres = round_step(90.0 / frame.per_metre);
    let length = metres * frame.per_metre;
    let (w, h) = (length.max(60.0) + 70.0, 44.0);
    let (right, low) = (WIDTH - RIGHT - w - 6.0, TOP + frame.height - h - 6.0);
    let corner = |x: f64, y: f64| Area { x, y, w, h };
    let corners = [
        corner(LEFT + 6.0, TOP + 6.0),
        corner(right, TOP + 6.0),
        corner(LEFT + 6.0, low),
        corner(right, low),
    ];
    let [x, y] = placer.emptier(&corners, [0.0, 0.0]);
    svg.rect([x, y], [w, h], "fill=\"#fff\" fill-opacity=\"0.86\"");
    svg.line(
        [x + 12.0, y + 38.0],
        [x + 12.0, y + 14.0],
        "stroke=\"#111\" stroke-width=\"2\"",
    );
    svg.polygon(
        &[
            [x + 12.0, y + 5.0],
            [x + 17.0, y + 16.0],
            [x + 7.0, y + 16.0],
        ],
        "fill=\"#111\"",
    );
    svg.text([x + 20.0, y + 20.0], SIZE, Anchor::Start, "", "N");
    let (from, foot) = (x + 42.0, y + 34.0);
    svg.polyline(
        &[
            [from, foot - 6.0],
            [from, foot],
            [from + length, foot],
            [from + length, foot - 6.0],
        ],
        "stroke=\"#111\" stroke-width=\"2\"",
    );
    let text = format!("{} m", signed(metres, step_decimals(metres)));
    svg.text(
        [from + 0.5 * length, foot - 9.0],
        SIZE,
        Anchor::Middle,
        "",
        &text,
    );
}

fn grid(svg: &mut Svg, frame: &Frame) {
    let (right, foot) = (WIDTH - RIGHT, TOP + frame.height);
    let wanted = 9.0;
    let (ticks, step) = frame.east.ticks(wanted);
    for v in ticks {
        let x = frame.east.at(v);
        svg.line([x, TOP], [x, foot], "stroke=\"#e6e6e6\"");
        let text = signed(v, step_decimals(step));
        svg.text(
            [x, foot + 16.0],
            13.0,
            Anchor::Middle,
            "fill=\"#333\"",
            &text,
        );
    }
    let wanted = wanted * frame.height / (right - LEFT);
    let least = wanted.max(3.0);
    let (ticks, step) = frame.north.ticks(least);
    for v in ticks {
        let y = frame.north.at(v);
        svg.line([LEFT, y], [right, y], "stroke=\"#e6e6e6\"");
        let text = signed(v, step_decimals(step));
        svg.text(
            [LEFT - 6.0, y + 4.5],
            13.0,
            Anchor::End,
            "fill=\"#333\"",
            &text,
        );
    }
    let middle = 0.5 * (LEFT + right);
    svg.text(
        [middle, foot + 35.0],
        13.0,
        Anchor::Middle,
        "fill=\"#333\"",
        "metres east (across) and north (up) of the start of the track",
    );
}
