//! Axes: equal ones for plan views, and a panel over time with a logarithmic one, since grades of sensors are
//! decades apart.

use schema::num;

use crate::report::axis::{Scale, step_decimals};
use crate::report::labels::Area;
use crate::report::svg::{Anchor, Svg, signed};

/// Size of the text.
const SIZE: f64 = 14.0;

/// One line.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// Time and value; values that are not positive are left out.
    pub(super) points: Vec<(f64, f64)>,
    /// Attributes of the stroke.
    pub(super) style: String,
}

/// Equal axes in `area` that hold the points, with grid and numbers; x is to the right, y up.
pub(super) fn axes(svg: &mut Svg, area: Area, points: &[[f64; 2]], size: f64) -> [Scale; 2] {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for p in points.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    if low[0] > high[0] {
        (low, high) = ([-1.0; 2], [1.0; 2]);
    }
    let extent = [0, 1].map(|i| (high[i] - low[i]).max(1e-3) * 1.1);
    let metre = (area.w / extent[0]).min(area.h / extent[1]);
    let scale = |axis: usize, from: f64, to: f64, length: f64| {
        let centre = f64::midpoint(low[axis], high[axis]);
        Scale {
            low: centre - 0.5 * length / metre,
            high: centre + 0.5 * length / metre,
            from,
            to,
        }
    };
    let x = scale(0, area.x, area.x + area.w, area.w);
    let y = scale(1, area.y + area.h, area.y, area.h);
    let grid = "stroke=\"#dedede\" stroke-width=\"1\"";
    let (ticks, step) = x.ticks(area.w / (size * 5.0));
    for t in ticks {
        let at = x.at(t);
        svg.line([at, area.y], [at, area.y + area.h], grid);
        let text = signed(t, step_decimals(step));
        svg.text(
            [at, area.y + area.h + size * 1.2],
            size,
            Anchor::Middle,
            "fill=\"#333\"",
            &text,
        );
    }
    let (ticks, step) = y.ticks(area.h / (size * 3.5));
    for t in ticks {
        let at = y.at(t);
        svg.line([area.x, at], [area.x + area.w, at], grid);
        let text = signed(t, step_decimals(step));
        svg.text(
            [area.x - 6.0, at + size * 0.35],
            size,
            Anchor::End,
            "fill=\"#333\"",
            &text,
        );
    }
    [x, y]
}

/// A panel of `size` with title and axes.
pub(super) fn logarithmic(
    size: [f64; 2],
    title: &str,
    time_label: &str,
    curves: &[Curve],
) -> String {
    let mut svg = Svg::new();
    svg.rect([0.0, 0.0], size, "fill=\"#fff\"");
    let area = Area {
        x: 58.0,
        y: 34.0,
        w: size[0] - 76.0,
        h: size[1] - 84.0,
    };
    svg.text(
        [area.x, 23.0],
        16.0,
        Anchor::Start,
        "font-weight=\"bold\"",
        title,
    );
    let known = || {
        curves
            .iter()
            .flat_map(|c| &c.points)
            .filter(|(t, v)| t.is_finite() && *v > 0.0 && v.is_finite())
    };
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
    for (t, v) in known() {
        (low, high) = (low.min(*v), high.max(*v));
        (from, to) = (from.min(*t), to.max(*t));
    }
    if from >= to {
        svg.text(
            [area.x + 0.5 * area.w, area.y + 0.5 * area.h],
            SIZE,
            Anchor::Middle,
            "",
            "nothing to draw",
        );
        return svg.into_body();
    }
    let time = Scale {
        low: from.round(),
        high: to.round(),
        from: area.x,
        to: area.x + area.w,
    };
    // A third of a decade of room, at least one decade.
    let (bottom, top) = (
        low.log10() - 0.08,
        (high.log10() + 0.08).max(low.log10() + 1.0),
    );
    let value = Scale {
        low: bottom,
        high: top,
        from: area.y + area.h,
        to: area.y,
    };
    times(&mut svg, area, &time, time_label);
    values(&mut svg, area, &value);
    for curve in curves {
        let points: Vec<[f64; 2]> = curve
            .points
            .iter()
            .filter(|(t, v)| t.is_finite() && *v > 0.0 && v.is_finite())
            .map(|(t, v)| [time.at(*t), value.at(v.log10())])
            .collect();
        svg.polyline(&points, &curve.style);
    }
    svg.rect(
        [area.x, area.y],
        [area.w, area.h],
        "fill=\"none\" stroke=\"#333\" stroke-width=\"1\"",
    );
    svg.into_body()
}

fn times(svg: &mut Svg, area: Area, time: &Scale, label: &str) {
    let foot = area.y + area.h;
    let (ticks, step) = time.ticks(area.w / (SIZE * 3.6));
    for t in ticks {
        let x = time.at(t);
        svg.line(
            [x, area.y],
            [x, foot],
            "stroke=\"#dedede\" stroke-width=\"1\"",
        );
        svg.text(
            [x, foot + 17.0],
            SIZE,
            Anchor::Middle,
            "fill=\"#333\"",
            &signed(t, step_decimals(step)),
        );
    }
    svg.text(
        [area.x + 0.5 * area.w, foot + 38.0],
        SIZE,
        Anchor::Middle,
        "fill=\"#333\"",
        label,
    );
}

/// Lines at 1 to 9 of every decade, numbers at 1, 2 and 5 (at 1 only where there are many decades).
fn values(svg: &mut Svg, area: Area, value: &Scale) {
    let (first, last) = (num::floor_i64(value.low), num::floor_i64(value.high));
    let sparse = value.high - value.low > 2.5;
    for decade in first..=last.min(first + 30) {
        for digit in 1..=9_u8 {
            let exponent = num::real_i64(decade) + f64::from(digit).log10();
            if exponent < value.low || exponent > value.high {
                continue;
            }
            let y = value.at(exponent);
            let color = if digit == 1 { "#b4b4b4" } else { "#e6e6e6" };
            svg.line(
                [area.x, y],
                [area.x + area.w, y],
                &format!("stroke=\"{color}\" stroke-width=\"1\""),
            );
            if digit == 1 || (!sparse && matches!(digit, 2 | 5)) {
                let places = usize::try_from(-decade).unwrap_or(0);
                let number = f64::from(digit) * 10.0_f64.powf(num::real_i64(decade));
                svg.text(
                    [area.x - 6.0, y + 5.0],
                    SIZE,
                    Anchor::End,
                    "fill=\"#333\"",
                    &signed(number, places),
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Curve, logarithmic};

    #[test]
    fn nothing_and_nonsense_are_drawn_as_nothing() {
        let none = logarithmic([400.0, 300.0], "x", "t", &[]);
        assert!(none.contains("nothing to draw"));
        let odd = Curve {
            points: vec![(-30.0, f64::NAN), (-20.0, 0.0), (-10.0, 2.0), (0.0, 0.003)],
            style: "stroke=\"#000\"".to_owned(),
        };
        let drawn = logarithmic([400.0, 300.0], "x", "t", &[odd]);
        assert!(!drawn.contains("NaN") && !drawn.contains("inf"));
        assert!(drawn.contains(">0.01<") && drawn.contains(">1<"));
    }
}
