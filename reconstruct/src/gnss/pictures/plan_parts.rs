//! Parts of the plan: grid, scale bar, fixes, labels.

use std::collections::BTreeSet;

use schema::num;

use super::plan::{Frame, LEFT, POINTS, REFUSED, RIGHT, TOP, thinned, within};
use super::stage::{SIZE, WIDTH, cross};
use super::{RECEIVER, Shown};
use crate::gnss::forward::{Estimate, Fate};
use crate::report::axis::step_decimals;
use crate::report::labels::{Area, Placer};
use crate::report::plan_signs::{ScaleBar, arrow, plate};
use crate::report::svg::{Anchor, Svg, signed};

/// Fixes, one of a kind a cell of the picture; cells grow until few are left.
pub(super) fn fixes(svg: &mut Svg, frame: &Frame, shown: &Shown<'_>, span: [f64; 2]) {
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

pub(super) fn labels(
    svg: &mut Svg,
    frame: &Frame,
    shown: &Shown<'_>,
    track: &[&Estimate],
    rings: &[Vec<[f64; 2]>],
    near: bool,
) {
    let bounds = Area {
        x: LEFT,
        y: TOP,
        w: WIDTH - LEFT - RIGHT,
        h: frame.height,
    };
    let line: Vec<[f64; 2]> = track.iter().map(|e| frame.at(&e.place)).collect();
    let mut kept_free = thinned(&line);
    kept_free.extend(rings.iter().flatten());
    let mut placer = Placer::new(bounds, kept_free);
    north_and_scale(svg, frame, &mut placer);
    let mut stands = stands(frame, track);
    stands.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, _, [x, y]) in stands.iter().take(400) {
        let style = "fill=\"#111\" stroke=\"#fff\" stroke-width=\"1\"";
        svg.rect([x - 4.5, y - 4.5], [9.0, 9.0], style);
    }
    let mut said: Vec<([f64; 2], String)> = Vec::new();
    if let (Some(first), Some(last)) = (track.first(), track.last()) {
        let [begins, ends] = if near {
            ["", ""]
        } else {
            ["begins, ", "ends, "]
        };
        said.push((
            frame.at(&first.place),
            format!("{begins}{:.0} s", first.t_s),
        ));
        said.push((frame.at(&last.place), format!("{ends}{:.0} s", last.t_s)));
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

/// Length, begin and place of each stand; those less than a second apart are one.
fn stands(frame: &Frame, track: &[&Estimate]) -> Vec<(f64, f64, [f64; 2])> {
    let mut out: Vec<(f64, f64, [f64; 2])> = Vec::new();
    for run in track.chunk_by(|a, b| a.standing == b.standing) {
        if !run[0].standing || run.len() < 2 {
            continue;
        }
        let (from, to) = (run[0].t_s, run[run.len() - 1].t_s);
        match out.last_mut() {
            Some(last) if from - (last.0 + last.1) < 1.0 => last.0 = to - last.1,
            _ => out.push((to - from, from, frame.at(&run[0].place))),
        }
    }
    out
}

fn north_and_scale(svg: &mut Svg, frame: &Frame, placer: &mut Placer) {
    let bar = ScaleBar::about(90.0, frame.per_metre);
    let (w, h) = (bar.length.max(60.0) + 70.0, 44.0);
    let (right, low) = (WIDTH - RIGHT - w - 6.0, TOP + frame.height - h - 6.0);
    let corner = |x: f64, y: f64| Area { x, y, w, h };
    let corners = [
        corner(LEFT + 6.0, TOP + 6.0),
        corner(right, TOP + 6.0),
        corner(LEFT + 6.0, low),
        corner(right, low),
    ];
    let [x, y] = placer.emptier(&corners, [0.0, 0.0]);
    plate(svg, corner(x, y));
    arrow(svg, [x + 12.0, y + 8.0], SIZE, "N");
    bar.draw(svg, [x + 42.0, y + 34.0], SIZE);
}

pub(super) fn grid(svg: &mut Svg, frame: &Frame) {
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
