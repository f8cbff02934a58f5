//! `path.svg`: the path in plan view with its funnel, as an overview and as a close view of the crash.

use schema::num;

use crate::export::ellipse::{self, Polygon};
use crate::export::funnel::{each_second, nearest};
use crate::findings::Reconstruction;
use crate::report::axis::{Scale, step_decimals};
use crate::report::labels::{Area, Placer};
use crate::report::number;
use crate::report::plan_marks as marks;
use crate::report::plan_signs::{ScaleBar, arrow, plate};
use crate::report::svg::{self, Anchor, Svg, signed};
use crate::trajectory::State;

/// Size of one panel in picture units.
pub const PANEL: [f64; 2] = [640.0, 700.0];
const LEFT: f64 = 56.0;
const TOP: f64 = 44.0;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 114.0;

/// Which stretch a panel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// The whole window.
    Overview,
    /// From one second before the first impact (or four before rest) to the end.
    Close,
}

/// What both views need of the picture's geometry.
pub(crate) struct Frame {
    pub(crate) east: Scale,
    pub(crate) north: Scale,
    pub(crate) per_metre: f64,
    pub(crate) view: View,
}

impl Frame {
    /// Picture coordinates of a place north and east of rest.
    pub(crate) fn at(&self, [north, east]: [f64; 2]) -> [f64; 2] {
        [self.east.at(east), self.north.at(north)]
    }

    /// Picture coordinates of a state.
    pub(crate) fn place(&self, s: &State) -> [f64; 2] {
        self.at([s.position[0], s.position[1]])
    }
}

/// Both views, drawn once for the file and the page.
#[derive(Clone, Debug)]
pub struct Plan {
    overview: String,
    close: String,
    description: String,
}

impl Plan {
    /// Draws a reconstruction; `outline` is the funnel's, from [`ellipse::outline`].
    #[must_use]
    pub fn draw(r: &Reconstruction, outline: &[Polygon]) -> Self {
        Self {
            overview: body(r, View::Overview, outline, "po"),
            close: body(r, View::Close, outline, "pc"),
            description: description(r),
        }
    }

    /// Both panels side by side: the file `path.svg`.
    #[must_use]
    pub fn file(&self) -> String {
        let [w, h] = PANEL;
        let mut svg = Svg::new();
        svg.rect([0.0, 0.0], [2.0 * w, h], "fill=\"#fff\"");
        svg.raw(&self.overview);
        svg.raw("<g transform=\"translate(640 0)\">");
        svg.raw(&self.close);
        svg.raw("</g>");
        let title = "Path of the car with its funnel";
        svg::file(&svg::picture(
            [2.0 * w, h],
            title,
            &self.description,
            &svg.into_body(),
        ))
    }

    /// One panel as a picture of its own, for the page.
    #[must_use]
    pub fn panel(&self, view: View) -> String {
        let (title, body) = match view {
            View::Overview => ("Path of the car over the whole window", &self.overview),
            View::Close => ("Path of the car about the crash", &self.close),
        };
        svg::picture(PANEL, title, &self.description, body)
    }
}

fn description(r: &Reconstruction) -> String {
    format!(
        "Plan view in metres from the final rest, {} up, with the {} ellipses of the position.",
        if r.rest_pose.is_some() {
            "north"
        } else {
            "the car's forward axis at rest"
        },
        number::percent(r.confidence)
    )
}

/// First second shown in the close view.
fn close_from(r: &Reconstruction) -> f64 {
    let end = r.states.last().map_or(0.0, |s| s.t_s);
    r.impacts
        .first()
        .map_or_else(|| r.rest.t_s.unwrap_or(end) - 4.0, |i| i.t_s.value - 1.0)
}

fn body(r: &Reconstruction, view: View, outline: &[Polygon], prefix: &str) -> String {
    let mut svg = Svg::new();
    let title = match view {
        View::Overview => "Whole window",
        View::Close if r.impacts.is_empty() => "The last seconds",
        View::Close => "The crash, close",
    };
    svg.rect([0.0, 0.0], PANEL, "fill=\"#fff\"");
    svg.text(
        [LEFT, 27.0],
        19.0,
        Anchor::Start,
        "font-weight=\"bold\"",
        title,
    );
    let from = if view == View::Overview {
        f64::NEG_INFINITY
    } else {
        close_from(r)
    };
    let first = r.states.partition_point(|s| s.t_s < from);
    let shown = r.states.get(first..).unwrap_or(&[]);
    if shown.is_empty() {
        svg.text(
            [320.0, 330.0],
            17.0,
            Anchor::Middle,
            "",
            "No samples to draw.",
        );
        return svg.into_body();
    }
    let frame = frame(r, shown, view);
    grid(&mut svg, &frame);
    svg.raw(&clip(prefix));
    svg.raw(&format!("<g clip-path=\"url(#{prefix})\">"));
    funnel(&mut svg, &frame, r, shown, outline);
    if view == View::Close {
        marks::cars(&mut svg, &frame, r, shown);
    }
    marks::samples(&mut svg, &frame, r, shown);
    marks::fixes(&mut svg, &frame, r);
    marks::path(&mut svg, &frame, r, shown);
    marks::dots(&mut svg, &frame, shown);
    svg.raw("</g>");
    let area = Area {
        x: LEFT + 2.0,
        y: TOP + 2.0,
        w: width() - 4.0,
        h: height() - 4.0,
    };
    let mut line: Vec<[f64; 2]> = ellipse::thinned(shown, 5).map(|s| frame.place(s)).collect();
    if view == View::Close {
        line.extend(marks::corners(&frame, r, shown));
    }
    let mut placer = Placer::new(area, line);
    scale_bar(&mut svg, &frame, &mut placer);
    compass(&mut svg, r, &mut placer);
    let named = marks::events(&mut svg, &frame, r, shown, &mut placer);
    marks::times(&mut svg, &frame, shown, &named, &mut placer);
    svg.rect(
        [LEFT, TOP],
        [width(), height()],
        "fill=\"none\" stroke=\"#333\" stroke-width=\"1\"",
    );
    marks::legend(&mut svg, r, view, [LEFT, PANEL[1] - 56.0]);
    svg.into_body()
}

fn width() -> f64 {
    PANEL[0] - LEFT - RIGHT
}

fn height() -> f64 {
    PANEL[1] - TOP - BOTTOM
}

fn clip(prefix: &str) -> String {
    format!(
        "<clipPath id=\"{prefix}\"><rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\"/></clipPath>",
        width(),
        height()
    )
}

/// Equal axes that hold the path, its ellipses and a margin.
fn frame(r: &Reconstruction, shown: &[State], view: View) -> Frame {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut include = |p: [f64; 2], margin: f64| {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis] - margin);
            high[axis] = high[axis].max(p[axis] + margin);
        }
    };
    let car = if view == View::Close { 2.6 } else { 0.0 };
    for s in ellipse::thinned(shown, 10) {
        include([s.position[0], s.position[1]], car);
    }
    for (s, _) in each_second(shown) {
        for p in ellipse::of_state(s, r.rest_pose.as_ref(), r.confidence).points(16) {
            include(p, 0.0);
        }
    }
    let centre = [
        f64::midpoint(low[0], high[0]),
        f64::midpoint(low[1], high[1]),
    ];
    let extent = [
        (high[0] - low[0]).max(6.0) * 1.12,
        (high[1] - low[1]).max(6.0) * 1.12,
    ];
    let per_metre = (height() / extent[0]).min(width() / extent[1]);
    let half = [0.5 * height() / per_metre, 0.5 * width() / per_metre];
    Frame {
        east: Scale {
            low: centre[1] - half[1],
            high: centre[1] + half[1],
            from: LEFT,
            to: LEFT + width(),
        },
        north: Scale {
            low: centre[0] - half[0],
            high: centre[0] + half[0],
            from: TOP + height(),
            to: TOP,
        },
        per_metre,
        view,
    }
}

fn grid(svg: &mut Svg, frame: &Frame) {
    let (foot, side) = (TOP + height(), LEFT + width());
    let (ticks, step) = frame.east.ticks(9.5);
    let digits = step_decimals(step);
    for x in ticks {
        let at = frame.east.at(x);
        svg.line(
            [at, TOP],
            [at, foot],
            "stroke=\"#dedede\" stroke-width=\"1\"",
        );
        svg.text(
            [at, foot + 17.0],
            14.0,
            Anchor::Middle,
            "fill=\"#333\"",
            &signed(x, digits),
        );
    }
    let rows = Scale {
        low: frame.north.low,
        high: frame.north.high,
        from: foot,
        to: TOP,
    };
    let first = -num::floor_i64(-(rows.low / step) + 1e-9);
    let last = num::floor_i64(rows.high / step + 1e-9);
    for i in first..=last.min(first + 200) {
        let y = num::real_i64(i) * step;
        let at = rows.at(y);
        svg.line(
            [LEFT, at],
            [side, at],
            "stroke=\"#dedede\" stroke-width=\"1\"",
        );
        svg.text(
            [LEFT - 6.0, at + 5.0],
            14.0,
            Anchor::End,
            "fill=\"#333\"",
            &signed(y, digits),
        );
    }
}

/// The union of the ellipses, and some of the ellipses themselves.
fn funnel(svg: &mut Svg, frame: &Frame, r: &Reconstruction, shown: &[State], outline: &[Polygon]) {
    let pose = r.rest_pose.as_ref();
    for polygon in outline {
        let rings: Vec<Vec<[f64; 2]>> = polygon
            .iter()
            .map(|ring| ring.iter().map(|p| frame.at(*p)).collect())
            .collect();
        svg.rings(
            &rings,
            "fill=\"#dce8f4\" stroke=\"#6d8fb0\" stroke-width=\"1\"",
        );
    }
    let every = if frame.view == View::Overview { 5 } else { 1 };
    for (s, second) in each_second(shown) {
        let e = ellipse::of_state(s, pose, r.confidence);
        if second % every == 0 && e.semi_major * frame.per_metre > 3.0 {
            let ring: Vec<[f64; 2]> = e.points(48).into_iter().map(|p| frame.at(p)).collect();
            svg.polygon(
                &ring,
                "fill=\"none\" stroke=\"#24567f\" stroke-width=\"1.2\" stroke-dasharray=\"4 3\"",
            );
        }
    }
}

fn scale_bar(svg: &mut Svg, frame: &Frame, placer: &mut Placer) {
    let bar = ScaleBar::about(60.0, frame.per_metre);
    let length = bar.length;
    let corners = [
        [LEFT + 14.0, TOP + height() - 14.0],
        [LEFT + width() - 14.0 - length, TOP + height() - 14.0],
    ];
    let [x, y] = placer.emptier(
        &corners.map(|[x, y]| Area {
            x: x - 6.0,
            y: y - 26.0,
            w: length + 12.0,
            h: 34.0,
        }),
        [6.0, 26.0],
    );
    let area = Area {
        x: x - 6.0,
        y: y - 26.0,
        w: length + 12.0,
        h: 34.0,
    };
    plate(svg, area);
    bar.draw(svg, [x, y], 14.0);
}

fn compass(svg: &mut Svg, r: &Reconstruction, placer: &mut Placer) {
    let text = if r.rest_pose.is_some() {
        "north"
    } else {
        "car's forward axis at rest"
    };
    let w = svg::text_width(text, 14.0) + 30.0;
    let corners = [
        Area {
            x: LEFT + 6.0,
            y: TOP + 6.0,
            w,
            h: 34.0,
        },
        Area {
            x: LEFT + width() - 6.0 - w,
            y: TOP + 6.0,
            w,
            h: 34.0,
        },
    ];
    let [x, y] = placer.emptier(&corners, [0.0, 0.0]);
    plate(svg, Area { x, y, w, h: 34.0 });
    arrow(svg, [x + 11.0, y + 2.0], 14.0, text);
}

/// The state a mark stands at, if the view shows it.
pub(crate) fn visible(shown: &[State], t_s: f64) -> Option<&State> {
    let first = shown.first()?.t_s;
    (t_s >= first - 0.006)
        .then(|| nearest(shown, t_s))
        .flatten()
}
