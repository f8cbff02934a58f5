//! What stands on the plan: the path in its phases, the car's outline, times, events, the legend.

use schema::num;

use crate::export::funnel::each_second;
use crate::findings::{Impact, Reconstruction};
use crate::report::labels::{Area, Placer};
use crate::report::number::{self, KMH};
use crate::report::plan::{Frame, View, visible};
use crate::report::svg::{Anchor, Svg, signed};
use crate::trajectory::State;

// Blue, vermilion and black differ to every kind of colour vision; width and dashes tell them apart in grey.
const APPROACH: &str = "stroke=\"#1f5a96\" stroke-width=\"3\" stroke-linejoin=\"round\"";
const BRAKING: &str = "stroke=\"#d55e00\" stroke-width=\"6\" stroke-linejoin=\"round\"";
const AFTER: &str =
    "stroke=\"#111\" stroke-width=\"3\" stroke-dasharray=\"8 4\" stroke-linejoin=\"round\"";
const SAMPLE: &str = "stroke=\"#1f5a96\" stroke-width=\"0.7\" stroke-opacity=\"0.45\"";
const FIX: &str = "stroke=\"#117a52\" stroke-width=\"1.3\"";
const LEFT_OUT: &str = "stroke=\"#999\" stroke-width=\"1\"";
const NOMINAL_CAR: [f64; 2] = [4.4, 1.8];

/// Satellite fixes of the time shown: crosses, grey where they were left out.
pub(crate) fn fixes(svg: &mut Svg, frame: &Frame, r: &Reconstruction) {
    for fix in r.gnss.iter().flat_map(|g| &g.residuals) {
        let [x, y] = frame.at(fix.place);
        let style = if fix.used { FIX } else { LEFT_OUT };
        svg.line([x - 4.0, y - 4.0], [x + 4.0, y + 4.0], style);
        svg.line([x - 4.0, y + 4.0], [x + 4.0, y - 4.0], style);
    }
}

/// The path: approach, braking, after the first impact.
pub(crate) fn path(svg: &mut Svg, frame: &Frame, r: &Reconstruction, shown: &[State]) {
    let impact = r.impacts.first().map_or(f64::INFINITY, |i| i.t_s.value);
    let rest = r.rest.t_s.unwrap_or(f64::INFINITY);
    let braking = r
        .braking
        .as_ref()
        .map_or(f64::INFINITY, |b| b.onset_t_s.value)
        .min(impact);
    let brake_end = impact.min(rest);
    let mut stretch = |from: f64, to: f64, style: &str| {
        let points: Vec<[f64; 2]> = shown
            .iter()
            .enumerate()
            .filter(|(i, s)| {
                s.t_s >= from - 0.006
                    && s.t_s <= to + 0.006
                    && (frame.view == View::Close || i % 5 == 0)
            })
            .map(|(_, s)| frame.place(s))
            .collect();
        svg.polyline(&points, style);
    };
    stretch(f64::NEG_INFINITY, braking, APPROACH);
    if braking < brake_end {
        stretch(braking, brake_end, BRAKING);
    }
    stretch(impact.min(brake_end), f64::INFINITY, AFTER);
}

/// The car's outline at rest, at the first impact and every half second between; nominal size.
pub(crate) fn cars(svg: &mut Svg, frame: &Frame, r: &Reconstruction, shown: &[State]) {
    let onset = r.impacts.first().map(|i| i.t_s.value);
    let mut last: Option<[f64; 3]> = None;
    let mut draw = |s: &State, weight: &str| {
        svg.polygon(
            &outline(frame, s),
            &format!(
                "fill=\"#fff\" fill-opacity=\"0.4\" stroke=\"#555\" stroke-width=\"{weight}\""
            ),
        );
        svg.polyline(
            &nose(frame, s),
            &format!("stroke=\"#555\" stroke-width=\"{weight}\""),
        );
    };
    for (i, s) in shown.iter().enumerate() {
        let pose = [s.position[0], s.position[1], s.heading];
        let moved = last.is_none_or(|l| {
            let turn = (l[2] - pose[2]).sin().abs() * 1.5;
            (l[0] - pose[0]).hypot(l[1] - pose[1]) + turn > 1.0
        });
        if i % 50 == 0 && moved {
            draw(s, "1");
            last = Some(pose);
        }
    }
    if let Some(s) = onset.and_then(|t| visible(shown, t)) {
        draw(s, "2");
    }
    if let Some(s) = shown.last() {
        draw(s, "2");
    }
}

/// Points along the outlines drawn thick, for labels to keep off.
pub(crate) fn corners(frame: &Frame, r: &Reconstruction, shown: &[State]) -> Vec<[f64; 2]> {
    let impact = r.impacts.first().and_then(|i| visible(shown, i.t_s.value));
    let mut points = Vec::new();
    for s in impact.into_iter().chain(shown.last()) {
        let ring = outline(frame, s);
        for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            points.extend(
                [0.0, 0.25, 0.5, 0.75]
                    .map(|f| [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1])]),
            );
        }
    }
    points
}

/// Paths drawn from the joint posterior, faint.
pub(crate) fn samples(svg: &mut Svg, frame: &Frame, r: &Reconstruction, shown: &[State]) {
    let paths = &r.details.paths;
    let Some((first, last)) = shown.first().zip(shown.last()) else {
        return;
    };
    let from = paths.t_s.partition_point(|t| *t < first.t_s - 0.1);
    let to = paths.t_s.partition_point(|t| *t <= last.t_s + 1e-9);
    for path in &paths.places {
        let points: Vec<[f64; 2]> = path
            .get(from..to)
            .unwrap_or_default()
            .iter()
            .map(|p| frame.at(*p))
            .collect();
        svg.polyline(&points, SAMPLE);
    }
}

fn outline(frame: &Frame, s: &State) -> Vec<[f64; 2]> {
    let [length, width] = NOMINAL_CAR;
    [
        [0.5, -0.32],
        [0.44, -0.5],
        [-0.5, -0.5],
        [-0.5, 0.5],
        [0.44, 0.5],
        [0.5, 0.32],
    ]
    .iter()
    .map(|[along, across]| body_point(frame, s, along * length, across * width))
    .collect()
}

fn nose(frame: &Frame, s: &State) -> [[f64; 2]; 3] {
    let [length, width] = NOMINAL_CAR;
    [
        body_point(frame, s, 0.12 * length, -0.42 * width),
        body_point(frame, s, 0.36 * length, 0.0),
        body_point(frame, s, 0.12 * length, 0.42 * width),
    ]
}

fn body_point(frame: &Frame, s: &State, forward: f64, right: f64) -> [f64; 2] {
    let (sin, cos) = s.heading.sin_cos();
    frame.at([
        s.position[0] + forward * cos - right * sin,
        s.position[1] + forward * sin + right * cos,
    ])
}

/// A dot each second.
pub(crate) fn dots(svg: &mut Svg, frame: &Frame, shown: &[State]) {
    for (s, second) in each_second(shown) {
        let radius = if second % 5 == 0 { 4.2 } else { 2.6 };
        svg.circle(
            frame.place(s),
            radius,
            "fill=\"#fff\" stroke=\"#111\" stroke-width=\"1.4\"",
        );
    }
}

/// Times beside the dots: each five seconds over the whole window, each second close up, while the car moves
/// and where no named event stands already.
pub(crate) fn times(
    svg: &mut Svg,
    frame: &Frame,
    shown: &[State],
    named: &[[f64; 2]],
    placer: &mut Placer,
) {
    let every = if frame.view == View::Overview { 5 } else { 1 };
    let mut before: Option<[f64; 2]> = None;
    for (s, second) in each_second(shown) {
        let at = frame.place(s);
        let apart = before.is_none_or(|b| (b[0] - at[0]).hypot(b[1] - at[1]) > 14.0);
        let free = named
            .iter()
            .all(|n| (n[0] - at[0]).hypot(n[1] - at[1]) > 16.0);
        if second % every == 0 && apart && free {
            before = Some(at);
            let mut text = format!("{} s", signed(num::real_i64(second), 0));
            if second > 0 {
                text.insert(0, '+');
            }
            placer.label(svg, at, 14.0, false, &[text]);
        }
    }
}

/// Start, onset of braking, impacts and rest, with their labels; gives the places they stand at.
pub(crate) fn events(
    svg: &mut Svg,
    frame: &Frame,
    r: &Reconstruction,
    shown: &[State],
    placer: &mut Placer,
) -> Vec<[f64; 2]> {
    let mut labels: Vec<([f64; 2], Vec<String>)> = Vec::new();
    for (i, impact) in r.impacts.iter().enumerate() {
        let Some(s) = visible(shown, impact.t_s.value) else {
            continue;
        };
        let at = frame.place(s);
        if frame.view == View::Close && i == 0 {
            force(svg, at, s, impact, placer);
        }
        star(svg, at);
        placer.take(Area::about(at, 13.0));
        labels.push((at, impact_label(r, i, impact)));
    }
    let stopped = r.states.last();
    if let Some(s) = stopped {
        let at = frame.place(s);
        svg.rect(
            [at[0] - 6.5, at[1] - 6.5],
            [13.0, 13.0],
            "fill=\"#111\" stroke=\"#fff\" stroke-width=\"1.5\"",
        );
        placer.take(Area::about(at, 8.0));
        let word = if r.rest.found {
            "Rest"
        } else {
            "Record ends, moving"
        };
        labels.push((at, vec![word.to_owned()]));
    }
    if let Some((b, s)) = r
        .braking
        .as_ref()
        .and_then(|b| visible(shown, b.onset_t_s.value).map(|s| (b, s)))
    {
        let at = frame.place(s);
        let tip = [
            [at[0], at[1] - 8.0],
            [at[0] + 8.0, at[1] + 6.0],
            [at[0] - 8.0, at[1] + 6.0],
        ];
        svg.polygon(
            &tip,
            "fill=\"#d55e00\" stroke=\"#fff\" stroke-width=\"1.5\"",
        );
        placer.take(Area::about(at, 9.0));
        labels.push((
            at,
            vec![
                "Braking begins".to_owned(),
                format!("{} s", signed(b.onset_t_s.value, 2)),
            ],
        ));
    }
    if let (View::Overview, Some(s)) = (frame.view, shown.first()) {
        let at = frame.place(s);
        svg.circle(
            at,
            6.5,
            "fill=\"#1f5a96\" stroke=\"#fff\" stroke-width=\"1.5\"",
        );
        placer.take(Area::about(at, 8.0));
        let kmh = number::shown(&r.start_speed_mps, KMH, 1).value;
        labels.push((
            at,
            vec![
                "Start of window".to_owned(),
                format!("{} s, {kmh} km/h", signed(s.t_s, 1)),
            ],
        ));
    }
    for (at, lines) in &labels {
        placer.label(svg, *at, 15.0, true, lines);
    }
    labels.into_iter().map(|(at, _)| at).collect()
}

fn impact_label(r: &Reconstruction, i: usize, impact: &Impact) -> Vec<String> {
    let name = if r.impacts.len() > 1 {
        format!("Impact {}", i + 1)
    } else {
        "Impact".to_owned()
    };
    let speed = number::shown(&impact.speed_mps, KMH, 1);
    let mut lines = vec![name, format!("{} km/h", speed.value)];
    if let Some((low, high)) = speed.bounds {
        lines.push(format!("({low} to {high})"));
    }
    lines
}

/// The direction the force came from, as an arrow onto the car.
fn force(svg: &mut Svg, at: [f64; 2], s: &State, impact: &Impact, placer: &mut Placer) {
    let bearing = s.heading + impact.delta_v.pdof_deg.value.to_radians();
    let (sin, cos) = bearing.sin_cos();
    let along = |d: f64, side: f64| [at[0] + d * sin + side * cos, at[1] - d * cos + side * sin];
    svg.line(
        along(92.0, 0.0),
        along(34.0, 0.0),
        "stroke=\"#a3003f\" stroke-width=\"5\"",
    );
    svg.polygon(
        &[along(18.0, 0.0), along(38.0, 10.0), along(38.0, -10.0)],
        "fill=\"#a3003f\"",
    );
    for d in [30.0, 50.0, 70.0, 90.0] {
        placer.take(Area::about(along(d, 0.0), 9.0));
    }
    let (words, _) = number::direction(impact.delta_v.pdof_deg.value);
    placer.label(
        svg,
        along(96.0, 0.0),
        14.0,
        false,
        &[format!("force {words}")],
    );
}

fn star(svg: &mut Svg, at: [f64; 2]) {
    let ring: Vec<[f64; 2]> = (0..16_u8)
        .map(|i| {
            let (s, c) = (f64::from(i) / 16.0 * std::f64::consts::TAU).sin_cos();
            let radius = if i % 2 == 0 { 13.0 } else { 6.0 };
            [at[0] + radius * s, at[1] - radius * c]
        })
        .collect();
    svg.polygon(
        &ring,
        "fill=\"#a3003f\" stroke=\"#fff\" stroke-width=\"1.5\"",
    );
}

/// The legend: only what is drawn.
pub(crate) fn legend(svg: &mut Svg, r: &Reconstruction, view: View, [x, y]: [f64; 2]) {
    svg.text(
        [x + 570.0, y - 20.0],
        14.0,
        Anchor::End,
        "fill=\"#333\"",
        "metres from the place of rest; dots are full seconds from the trigger",
    );
    let fixes = r.gnss.as_ref().is_some_and(|g| !g.residuals.is_empty());
    let mut entries: Vec<(&str, String)> = vec![("approach", "path".to_owned())];
    if r.braking.is_some() {
        entries.push(("braking", "braking".to_owned()));
    }
    if !r.impacts.is_empty() {
        // With fixes there is no room for both words.
        let after = if fixes { "after" } else { "after impact" };
        entries.push(("after", after.to_owned()));
    }
    entries.push(("funnel", "funnel".to_owned()));
    entries.push((
        "ellipse",
        format!("{} ellipse", number::percent(r.confidence)),
    ));
    if !r.details.paths.places.is_empty() {
        entries.push(("sample", "samples".to_owned()));
    }
    if fixes {
        entries.push(("fix", "fixes".to_owned()));
    }
    let mut at = x;
    for (kind, text) in &entries {
        let (from, to) = ([at, y], [at + 22.0, y]);
        match *kind {
            "fix" => {
                svg.line([at + 7.0, y - 4.0], [at + 15.0, y + 4.0], FIX);
                svg.line([at + 7.0, y + 4.0], [at + 15.0, y - 4.0], FIX);
            }
            "approach" => svg.line(from, to, APPROACH),
            "braking" => svg.line(from, to, BRAKING),
            "after" => svg.line(from, to, AFTER),
            "sample" => svg.line(from, to, SAMPLE),
            "funnel" => svg.rect(
                [at, y - 7.0],
                [22.0, 14.0],
                "fill=\"#dce8f4\" stroke=\"#6d8fb0\" stroke-width=\"1\"",
            ),
            _ => svg.rect(
                [at, y - 7.0],
                [22.0, 14.0],
                "fill=\"none\" stroke=\"#24567f\" stroke-width=\"1.2\" stroke-dasharray=\"4 3\"",
            ),
        }
        svg.text([at + 26.0, y + 5.0], 14.0, Anchor::Start, "", text);
        at += 26.0 + crate::report::svg::text_width(text, 14.0) + 8.0;
    }
    let note = match view {
        View::Overview => {
            "True position at each instant: within that instant's ellipse with the stated confidence."
        }
        View::Close => {
            "Outlines: a nominal 4.4 m x 1.8 m car, for its direction only; the path is the sensor's."
        }
    };
    svg.text([x, y + 32.0], 14.0, Anchor::Start, "fill=\"#333\"", note);
}
