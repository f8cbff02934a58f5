//! Quantities of a drive over time: deviation, speed and heading, the stop detector, gyro biases.

use super::stage::{Key, Stage, dots, line, range, reduced, strokes, value};
use super::{HOLE_S, OURS, OUTAGE, RECEIVER, Shown, TRUTH, used};
use crate::error_model::{ATT, VEL};
use crate::gnss::forward::Estimate;
use crate::gnss::published::constants::GATE;
use crate::gnss::stands::spans;
use crate::gnss::stop::{self, Detector};
use crate::report::axis::scientific;
use crate::report::panel::{Panel, Series};
use crate::report::svg::Svg;

/// Two-sided, of 95 %.
const TWO_SIDED: f64 = 1.959_964;

/// Our detector's bounds without a fix.
const DEAF: &str = "#6d8fb0";

type Points = Vec<(f64, Option<f64>, f64)>;

fn span(shown: &Shown<'_>) -> [f64; 2] {
    let track = shown.track;
    [
        track.first().map_or(0.0, |e| e.t_s),
        track.last().map_or(1.0, |e| e.t_s),
    ]
}

/// Points with a break before each that comes more than `hole_s` behind the one before.
fn broken(points: impl Iterator<Item = (f64, Option<f64>, f64)>, hole_s: f64) -> Points {
    let mut out = Points::new();
    for point in points {
        if out.last().is_some_and(|l| point.0 - l.0 > hole_s) {
            out.push((point.0, None, 0.0));
        }
        out.push(point);
    }
    out
}

fn quantity(track: &[Estimate], of: impl Fn(&Estimate) -> (f64, f64)) -> Points {
    let points = track.iter().map(|e| {
        let (v, variance) = of(e);
        (e.t_s, Some(v), TWO_SIDED * variance.max(0.0).sqrt())
    });
    broken(points, HOLE_S)
}

fn ours(points: Points) -> Series {
    Series {
        points,
        color: OURS[0],
        band: OURS[1],
        dash: "",
    }
}

/// Deviation from the reference [S00, figures 4.9, 4.10 and 4.15]; `None` without one.
#[must_use]
pub fn deviation(shown: &Shown<'_>) -> Option<String> {
    if shown.seconds.is_empty() {
        return None;
    }
    let of = |f: fn(&super::Second) -> f64| -> Points {
        let seconds = shown.seconds.iter().map(|s| (s.t_s, Some(f(s)), 0.0));
        reduced(broken(seconds, 2.5), f64::INFINITY)
    };
    let (off, bound) = (of(|s| s.off_m), of(|s| s.bound_m));
    let mut own = Vec::new();
    for shot in shown.shots {
        if let Some(place) = shown.reference.at(shot.fix.t_s) {
            own.push([shot.fix.t_s, place.to(&shot.fix.place).xy().norm()]);
        }
    }
    let both: Points = off.iter().chain(&bound).copied().collect();
    let most = range(&both)[1].max(1.0);
    let mut stage = Stage::new("gd", span(shown));
    stage.panel(
        "Horizontal deviation from the reference, m",
        280.0,
        [0.0, most],
        true,
        shown.outages,
        |svg, panel| {
            dots(svg, panel, own.into_iter(), RECEIVER);
            panel.series(svg, &line(bound, OURS[0], "6 4"));
            panel.series(svg, &line(off, TRUTH, ""));
            strokes(svg, panel, used(shown.shots), RECEIVER);
        },
    );
    stage.legend(&[
        (Key::Line(TRUTH), "deviation of the track"),
        (Key::Dashed(OURS[0]), "its bound of 95 %"),
        (Key::Dot(RECEIVER), "deviation of a fix"),
        (Key::Tick(RECEIVER), "fix used"),
        (Key::Band(OUTAGE), "no fix used for 2.5 s and more"),
    ]);
    Some(stage.finish(
        "Deviation from the reference",
        "Horizontal deviation of the track from the reference receiver over time, with its bound of 95 %.",
    ))
}

/// An angle in degrees by full turns to within half a turn of another.
fn near(angle: f64, middle: f64) -> f64 {
    (angle - middle + 180.0).rem_euclid(360.0) + middle - 180.0
}

/// Headings with their bands, deg, the ends of their axis and its middle: the whole circle, or, of a drive that turns by less than
/// half of it, what the drive and the receiver's courses need.
fn headings(track: &[Estimate], courses: &[[f64; 2]]) -> (Points, [f64; 2], f64) {
    let all = |middle: f64| -> Points {
        let mut out: Points = Vec::with_capacity(track.len());
        let mut last: Option<[f64; 2]> = None;
        for e in track {
            let v = near(e.angles[2].to_degrees(), middle);
            if last.is_some_and(|[t_s, l]| (v - l).abs() > 180.0 || e.t_s - t_s > HOLE_S) {
                out.push((e.t_s, None, 0.0));
            }
            last = Some([e.t_s, v]);
            let half = TWO_SIDED * e.p[(ATT + 2, ATT + 2)].max(0.0).sqrt().to_degrees();
            out.push((e.t_s, Some(v), half.min(180.0)));
        }
        out
    };
    let (s, c) = track.iter().fold((0.0, 0.0), |(s, c), e| {
        (s + e.angles[2].sin(), c + e.angles[2].cos())
    });
    let middle = f64::atan2(s, c).to_degrees().rem_euclid(360.0);
    let points = all(middle);
    let course = |c: &[f64; 2]| (c[0], Some(near(c[1], middle)), 0.0);
    let both: Points = points
        .iter()
        .copied()
        .chain(courses.iter().map(course))
        .collect();
    let [low, high] = range(&both);
    if high - low < 180.0 {
        let room = (0.5 * (10.0 - (high - low))).max(0.0);
        return (points, [low - room, high + room], middle);
    }
    (all(180.0), [0.0, 360.0], 180.0)
}

/// Speed and heading with their bands, and the receiver's own.
#[must_use]
pub fn motion(shown: &Shown<'_>) -> String {
    let speed = quantity(shown.track, |e| {
        let v = e.v_n.xy();
        let p = e.p.fixed_view::<2, 2>(VEL, VEL).into_owned();
        let n = v.norm();
        // Where the car stands no direction is singled out: the larger variance.
        let variance = if n > 0.3 {
            (v.transpose() * p * v)[0] / (n * n)
        } else {
            p[(0, 0)].max(p[(1, 1)])
        };
        (n, variance)
    });
    let own = |f: fn(nalgebra::Vector3<f64>) -> Option<f64>| {
        shown
            .shots
            .iter()
            .filter_map(move |s| Some([s.fix.t_s, f(s.fix.v_n?)?]))
    };
    let courses: Vec<[f64; 2]> =
        own(|v| (v.xy().norm() > GATE).then(|| v.y.atan2(v.x).to_degrees()))
            .filter(|c| c[0] >= span(shown)[0])
            .collect();
    let (heading, turns, middle) = headings(shown.track, &courses);
    let truth: Points = shown
        .reference
        .marks
        .iter()
        .map(|m| (m.t_s, m.speed.map(f64::abs), 0.0))
        .collect();
    let mut all = speed.clone();
    all.extend(own(|v| Some(v.xy().norm())).map(|p| (p[0], Some(p[1]), 0.0)));
    let top = range(&all)[1].max(1.0);
    let mut stage = Stage::new("gm", span(shown));
    stage.panel(
        "Speed over ground, m/s",
        210.0,
        [0.0, top],
        false,
        shown.outages,
        |svg, panel| {
            panel.series(svg, &ours(speed));
            dots(svg, panel, own(|v| Some(v.xy().norm())), RECEIVER);
            panel.series(svg, &line(truth, TRUTH, "2 3"));
        },
    );
    stage.panel(
        "Heading, degrees clockwise from north",
        210.0,
        turns,
        true,
        shown.outages,
        |svg, panel| {
            panel.series(svg, &ours(reduced(heading, 180.0)));
            let course = courses.iter().map(|[t, c]| [*t, near(*c, middle)]);
            dots(svg, panel, course, RECEIVER);
        },
    );
    let mut entries = vec![
        (Key::Line(OURS[0]), "track"),
        (Key::Band(OURS[1]), "its band of 95 %"),
        (Key::Dot(RECEIVER), "receiver"),
    ];
    if !shown.reference.marks.is_empty() {
        entries.push((Key::Dashed(TRUTH), "reference (speed)"));
    }
    entries.push((Key::Band(OUTAGE), "no fix used for 2.5 s and more"));
    stage.legend(&entries);
    stage.finish(
        "Speed and heading",
        "Speed over ground and heading over time with their bands of 95 %.",
    )
}

/// A level across a panel of powers of ten; what it is stands in the legend.
fn level(svg: &mut Svg, panel: &Panel<'_>, at: f64, color: &str) {
    let y = value(panel).at(at.log10());
    let a = panel.area;
    svg.line(
        [a.x, y],
        [a.x + a.w, y],
        &format!("stroke=\"{color}\" stroke-width=\"1.4\" stroke-dasharray=\"7 4\""),
    );
}

/// The stop detectors: what they go by and what they say [S00, 3.5, 4.3].
#[must_use]
pub fn stops(shown: &Shown<'_>) -> String {
    let drive = shown.drive;
    let dt = drive.periods.get(1).map_or(0.02, |p| p.dt);
    let log = |v: f64| Some(v.max(1e-9).log10());
    let list = stop::variances(drive, 51.0 * dt);
    let of = |f: &dyn Fn(&[nalgebra::Vector3<f64>; 2]) -> f64| -> Points {
        let all = drive.periods.iter().zip(&list).skip(50);
        broken(all.map(|(p, v)| (p.t_s, log(f(v)), 0.0)), HOLE_S)
    };
    let level_sum = of(&|v| v[0].x + v[0].y);
    let rates = of(&|v| v[1].sum());
    let ends = |points: &Points, levels: [f64; 2]| {
        let [low, high] = range(points);
        [
            low.min(levels[0].log10() - 0.4),
            high.max(levels[1].log10() + 0.4),
        ]
    };
    let ours = Detector::default();
    let ends_of = [drive.periods.first(), drive.periods.last()].map(|p| p.map_or(0.0, |p| p.t_s));
    let mut stage = Stage::new("gs", ends_of);
    let [heard, deaf] = ours.accel.map(|a| a[0]);
    stage.decades(
        "Variance of forward and sideways specific force together over 1 s, (m/s\u{b2})\u{b2}",
        210.0,
        ends(&level_sum, [deaf, heard]),
        false,
        |svg, panel| {
            panel.series(svg, &line(level_sum, "#555", ""));
            level(svg, panel, stop::PUBLISHED, super::PUBLISHED);
            if (deaf / stop::PUBLISHED - 1.0).abs() > 1e-9 {
                level(svg, panel, deaf, DEAF);
            }
            level(svg, panel, heard, OURS[0]);
        },
    );
    let forces = [heard, deaf];
    let [heard, deaf] = ours.rate;
    stage.decades(
        "Variance of the rates about the three axes together over 1 s, (rad/s)\u{b2}",
        170.0,
        ends(&rates, [deaf, heard]),
        false,
        |svg, panel| {
            panel.series(svg, &line(rates, "#555", ""));
            level(svg, panel, deaf, DEAF);
            level(svg, panel, heard, OURS[0]);
        },
    );
    let rates = [heard, deaf];
    let colors = [super::PUBLISHED, "#6d8fb0", OURS[0]];
    let mut rows: Vec<(&str, &str, Vec<[f64; 2]>)> = shown
        .found
        .iter()
        .zip(colors)
        .map(|(f, color)| (f.name, color, spans(drive, &f.flags)))
        .collect();
    if !shown.reference.marks.is_empty() {
        rows.push(("reference, below 0.2 m/s", TRUTH, shown.reference.stands()));
    }
    stage.rows("Standing, as each says", &rows);
    let both = |i: usize| {
        let [force, rate]: [f64; 2] = [forces[i], rates[i]];
        format!(
            "{} (m/s\u{b2})\u{b2}, {} (rad/s)\u{b2}",
            scientific(force),
            scientific(rate)
        )
    };
    let entries = [
        format!(
            "bound of S00: {} (m/s\u{b2})\u{b2}",
            scientific(stop::PUBLISHED)
        ),
        format!("ours without a fix: {}", both(1)),
        format!("ours with a slow fix: {}", both(0)),
    ];
    let keys = [super::PUBLISHED, DEAF, OURS[0]].map(Key::Dashed);
    let entries: Vec<(Key, &str)> = keys
        .into_iter()
        .zip(entries.iter().map(String::as_str))
        .collect();
    stage.legend(&entries);
    stage.finish(
        "The stop detectors",
        "Variances over one second with the detectors' bounds, logarithmic, and the spans found.",
    )
}

/// Gyro biases with their bands.
#[must_use]
pub fn biases(shown: &Shown<'_>) -> String {
    let mut stage = Stage::new("gb", span(shown));
    for (axis, title) in [
        "Gyro bias about the forward axis, mrad/s",
        "About the right axis, mrad/s",
        "About the down axis, mrad/s",
    ]
    .into_iter()
    .enumerate()
    {
        let points = quantity(shown.track, |e| {
            let sd = 1e3 * e.rate_bias_sd[axis];
            (1e3 * e.rate_bias[axis], sd * sd)
        });
        let ends = range(&points);
        stage.panel(
            title,
            120.0,
            ends,
            axis == 2,
            shown.outages,
            |svg, panel| {
                panel.series(svg, &ours(points));
            },
        );
    }
    stage.legend(&[
        (Key::Line(OURS[0]), "bias"),
        (Key::Band(OURS[1]), "its band of 95 %"),
        (Key::Band(OUTAGE), "no fix used for 2.5 s and more"),
    ]);
    stage.finish(
        "Gyro biases",
        "Biases of the three gyros over time with their bands of 95 %.",
    )
}
