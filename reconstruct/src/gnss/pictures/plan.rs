//! The drive from above [S00, figures 4.5 to 4.8 and 4.11 to 4.14].

use std::collections::BTreeSet;

use super::stage::{Key, WIDTH, legend};
use super::{HOLE_S, OURS, RECEIVER, Shown, TRUTH, plan_parts as parts};
use crate::export::ellipse::{Covariance, Ellipse};
use crate::gnss::forward::{Estimate, Fate};
use crate::report::axis::Scale;
use crate::report::svg::{self, Svg};
use crate::wgs84::Geodetic;

pub(super) const LEFT: f64 = 66.0;
pub(super) const TOP: f64 = 12.0;
pub(super) const RIGHT: f64 = 14.0;
pub(super) const FOOT: f64 = 48.0;
/// Track without fixes.
const BLIND: &str = "#c24e00";
pub(super) const REFUSED: &str = "#a3003f";
/// Points of one line at most.
pub(super) const POINTS: usize = 6000;
/// Half the length of the close view, s.
const CLOSE_S: f64 = 15.0;

pub(super) struct Frame {
    origin: Geodetic,
    pub(super) east: Scale,
    pub(super) north: Scale,
    pub(super) per_metre: f64,
    pub(super) height: f64,
}

impl Frame {
    pub(super) fn at(&self, place: &Geodetic) -> [f64; 2] {
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
pub(super) fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
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

pub(super) fn within(span: &[f64; 2], t: f64) -> bool {
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
    parts::grid(&mut svg, &frame);
    svg.raw(&format!(
        "<clipPath id=\"{id}\"><rect x=\"{LEFT:.1}\" y=\"{TOP:.1}\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath><g clip-path=\"url(#{id})\">",
        WIDTH - LEFT - RIGHT,
        frame.height
    ));
    let rings = chosen
        .iter()
        .map(|e| ellipse(e, local(&e.place)).points(40));
    let rings: Vec<Vec<[f64; 2]>> = rings
        .map(|ring| {
            let at = |[n, m]: [f64; 2]| [frame.east.at(m), frame.north.at(n)];
            ring.into_iter().map(at).collect()
        })
        .collect();
    for ring in &rings {
        svg.polygon(
            ring,
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
    if near {
        pairs(&mut svg, &frame, &track, &marks);
    }
    parts::fixes(
        &mut svg,
        &frame,
        shown,
        [first.t_s, track.last().map_or(0.0, |e| e.t_s)],
    );
    parts::labels(&mut svg, &frame, shown, &track, &rings, near);
    svg.raw("</g>");
    svg.rect(
        [LEFT, TOP],
        [WIDTH - LEFT - RIGHT, frame.height],
        "fill=\"none\" stroke=\"#333\"",
    );
    let entries = entries(shown, &track, marks.is_empty(), near);
    finish(svg, &frame, &entries, near)
}

/// The legend: what is in the picture, and nothing else.
fn entries(
    shown: &Shown<'_>,
    track: &[&Estimate],
    alone: bool,
    near: bool,
) -> Vec<(Key, &'static str)> {
    let span = [
        track.first().map_or(0.0, |e| e.t_s),
        track.last().map_or(0.0, |e| e.t_s),
    ];
    let mut entries = vec![(Key::Line(OURS[0]), "track")];
    if shown
        .outages
        .iter()
        .any(|o| o[0] < span[1] && o[1] > span[0])
    {
        entries.push((Key::Line(BLIND), "track, no fix used for 2.5 s and more"));
    }
    entries.push((Key::Band(OURS[1]), "ellipse of 95 %"));
    if !alone {
        entries.push((Key::Dashed(TRUTH), "reference"));
        if near {
            entries.push((Key::Dot(OURS[0]), "track each second"));
            entries.push((Key::Dot(TRUTH), "reference each second"));
        }
    }
    let any = |wanted: fn(Option<Fate>) -> bool| {
        let mut own = shown.shots.iter().filter(|s| within(&span, s.fix.t_s));
        own.any(|s| wanted(s.fate))
    };
    if any(|f| f == Some(Fate::Used)) {
        entries.push((Key::Dot(RECEIVER), "fix used"));
    }
    if any(|f| f.is_none()) {
        entries.push((Key::Ring("#777"), "fix withheld"));
    }
    if any(|f| matches!(f, Some(Fate::Refused | Fate::Forced))) {
        entries.push((
            Key::Cross(REFUSED),
            "fix refused, or used only after refusals",
        ));
    }
    if track.iter().any(|e| e.standing) {
        entries.push((Key::Square("#111"), "stand"));
    }
    entries
}

fn finish(mut svg: Svg, frame: &Frame, entries: &[(Key, &str)], near: bool) -> String {
    let foot = legend(&mut svg, TOP + frame.height + FOOT + 8.0, entries);
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
            let step = (pair[1].t_s - pair[0].t_s).min(HOLE_S) * pair[0].v_n.xy().norm();
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
    let mut draw = |run: &[&Estimate], color| {
        let line: Vec<[f64; 2]> = run.iter().map(|e| frame.at(&e.place)).collect();
        svg.polyline(&thinned(&line), &style(color));
    };
    for drive in track.chunk_by(|a, b| b.t_s - a.t_s < HOLE_S) {
        draw(drive, OURS[0]);
        for run in drive.chunk_by(|a, b| blind(a.t_s) == blind(b.t_s)) {
            if blind(run[0].t_s) {
                draw(run, BLIND);
            }
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
        svg.circle(b, 2.3, &format!("fill=\"{TRUTH}\""));
    }
}
