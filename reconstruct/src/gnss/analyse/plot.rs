//! Axes of the pictures: plain and logarithmic, points with error bars.

use schema::num;

use crate::report::axis::{Scale, power_of_ten, step_decimals};
use crate::report::labels::Area;
use crate::report::svg::{Anchor, Svg, signed};

/// Size of the text.
pub(super) const SIZE: f64 = 14.0;
/// Colours of x, y, z: apart in grey, too.
pub(super) const COLORS: [&str; 3] = ["#1f5a96", "#c24e00", "#2e7d4f"];
const GRID: &str = "stroke=\"#dedede\" stroke-width=\"1\"";
const TEXT: &str = "fill=\"#333\"";

/// Bold heading above an area.
pub(super) fn heading(svg: &mut Svg, area: Area, title: &str) {
    svg.text(
        [area.x, area.y - 10.0],
        SIZE + 1.0,
        Anchor::Start,
        "font-weight=\"bold\"",
        title,
    );
}

/// The frame.
pub(super) fn frame(svg: &mut Svg, area: Area) {
    svg.rect(
        [area.x, area.y],
        [area.w, area.h],
        "fill=\"none\" stroke=\"#333\" stroke-width=\"1\"",
    );
}

/// Words under an area.
pub(super) fn below(svg: &mut Svg, area: Area, text: &str) {
    let at = [area.x + 0.5 * area.w, area.y + area.h + 40.0];
    svg.text(at, SIZE, Anchor::Middle, TEXT, text);
}

/// Upright plain axis with grid; the range is widened by a twelfth.
pub(super) fn plain(svg: &mut Svg, area: Area, values: impl Iterator<Item = f64>) -> Scale {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for v in values.filter(|v| v.is_finite()) {
        (low, high) = (low.min(v), high.max(v));
    }
    if low > high {
        (low, high) = (-1.0, 1.0);
    }
    let room = ((high - low) / 12.0).max(1e-9 * high.abs()).max(1e-12);
    let scale = Scale {
        low: low - room,
        high: high + room,
        from: area.y + area.h,
        to: area.y,
    };
    let (ticks, step) = scale.ticks((area.h / (2.4 * SIZE)).max(2.0));
    for tick in ticks {
        let y = scale.at(tick);
        let style = if tick.abs() < 1e-9 * step {
            "stroke=\"#777\" stroke-width=\"1\""
        } else {
            GRID
        };
        svg.line([area.x, y], [area.x + area.w, y], style);
        svg.text(
            [area.x - 6.0, y + 5.0],
            SIZE,
            Anchor::End,
            TEXT,
            &signed(tick, step_decimals(step)),
        );
    }
    scale
}

/// Level axis of time with grid and numbers.
pub(super) fn time(svg: &mut Svg, area: Area, [from, to]: [f64; 2], label: &str) -> Scale {
    let room = ((to - from) * 0.03).max(0.5);
    let scale = Scale {
        low: from - room,
        high: to + room,
        from: area.x,
        to: area.x + area.w,
    };
    let (ticks, step) = scale.ticks(area.w / (SIZE * 6.0));
    for tick in ticks {
        let x = scale.at(tick);
        svg.line([x, area.y], [x, area.y + area.h], GRID);
        svg.text(
            [x, area.y + area.h + 18.0],
            SIZE,
            Anchor::Middle,
            TEXT,
            &signed(tick, step_decimals(step)),
        );
    }
    below(svg, area, label);
    scale
}

/// A logarithmic axis over the values, level or upright: lines at 1 to 9 of every decade, numbers at the decades.
pub(super) fn logarithmic(
    svg: &mut Svg,
    area: Area,
    upright: bool,
    values: impl Iterator<Item = f64>,
) -> Scale {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for v in values.filter(|v| *v > 0.0 && v.is_finite()) {
        (low, high) = (low.min(v.log10()), high.max(v.log10()));
    }
    if low > high {
        (low, high) = (-1.0, 1.0);
    }
    // At least a decade, so that a number stands on the axis.
    let room = (0.5 * (1.1 - (high - low))).max(0.08);
    let (from, to) = if upright {
        (area.y + area.h, area.y)
    } else {
        (area.x, area.x + area.w)
    };
    let scale = Scale {
        low: low - room,
        high: high + room,
        from,
        to,
    };
    let (first, last) = (num::floor_i64(scale.low), num::floor_i64(scale.high));
    for decade in first..=last.min(first + 30) {
        for digit in 1..=9_u8 {
            let at = num::real_i64(decade) + f64::from(digit).log10();
            if at < scale.low || at > scale.high {
                continue;
            }
            let style = if digit == 1 {
                "stroke=\"#b4b4b4\" stroke-width=\"1\""
            } else {
                "stroke=\"#ebebeb\" stroke-width=\"1\""
            };
            let p = scale.at(at);
            let (a, b) = if upright {
                ([area.x, p], [area.x + area.w, p])
            } else {
                ([p, area.y], [p, area.y + area.h])
            };
            svg.line(a, b, style);
            if digit == 1 {
                let (at, anchor) = if upright {
                    ([area.x - 6.0, p + 5.0], Anchor::End)
                } else {
                    ([p, area.y + area.h + 18.0], Anchor::Middle)
                };
                svg.text(at, SIZE, anchor, TEXT, &power_of_ten(decade));
            }
        }
    }
    scale
}

/// A point with its upright error bar, clipped to the area.
pub(super) fn bar(svg: &mut Svg, area: Area, x: f64, [low, value, high]: [f64; 3], color: &str) {
    let inside = |y: f64| {
        if y.is_finite() {
            y.clamp(area.y, area.y + area.h)
        } else {
            area.y
        }
    };
    let stroke = format!("stroke=\"{color}\" stroke-width=\"1.8\"");
    svg.line([x, inside(low)], [x, inside(high)], &stroke);
    for end in [low, high] {
        if end.is_finite() {
            svg.line([x - 4.0, inside(end)], [x + 4.0, inside(end)], &stroke);
        }
    }
    svg.circle([x, inside(value)], 3.6, &format!("fill=\"{color}\""));
}

/// A hollow square: a figure of S00.
pub(super) fn square(svg: &mut Svg, [x, y]: [f64; 2]) {
    svg.rect(
        [x - 4.5, y - 4.5],
        [9.0, 9.0],
        "fill=\"#fff\" stroke=\"#111\" stroke-width=\"1.6\"",
    );
}

/// Colours and what they are, in a line at `at`; `source` adds the square of S00.
pub(super) fn legend(svg: &mut Svg, at: [f64; 2], names: &[(&str, &str)], source: bool) {
    let mut x = at[0];
    for (name, color) in names {
        svg.line(
            [x, at[1] - 5.0],
            [x + 18.0, at[1] - 5.0],
            &format!("stroke=\"{color}\" stroke-width=\"3\""),
        );
        svg.text([x + 24.0, at[1]], SIZE, Anchor::Start, TEXT, name);
        x += 24.0 + crate::report::svg::text_width(name, SIZE) + 18.0;
    }
    if source {
        square(svg, [x + 6.0, at[1] - 5.0]);
        svg.text([x + 18.0, at[1]], SIZE, Anchor::Start, TEXT, "S00");
    }
}
