//! Places labels so that they cover neither each other nor what they label.

use crate::report::svg::{Anchor, Svg, text_width};
use schema::num;

/// A rectangle in picture units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width.
    pub w: f64,
    /// Height.
    pub h: f64,
}

impl Area {
    /// A square about a point.
    #[must_use]
    pub fn about([x, y]: [f64; 2], half: f64) -> Self {
        Self {
            x: x - half,
            y: y - half,
            w: 2.0 * half,
            h: 2.0 * half,
        }
    }

    fn overlap(&self, other: &Self) -> f64 {
        let w = (self.x + self.w).min(other.x + other.w) - self.x.max(other.x);
        let h = (self.y + self.h).min(other.y + other.h) - self.y.max(other.y);
        if w > 0.0 && h > 0.0 { w * h } else { 0.0 }
    }

    fn holds(&self, [x, y]: [f64; 2]) -> bool {
        x > self.x && x < self.x + self.w && y > self.y && y < self.y + self.h
    }

    fn within(&self, outer: &Self) -> bool {
        self.x >= outer.x
            && self.y >= outer.y
            && self.x + self.w <= outer.x + outer.w
            && self.y + self.h <= outer.y + outer.h
    }

    /// The point of the rectangle nearest to another.
    #[must_use]
    pub fn nearest(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            x.clamp(self.x, self.x + self.w),
            y.clamp(self.y, self.y + self.h),
        ]
    }
}

/// Labels placed so far, and what they must not cover.
#[derive(Clone, Debug)]
pub struct Placer {
    bounds: Area,
    taken: Vec<Area>,
    line: Vec<[f64; 2]>,
}

impl Placer {
    /// Labels within `bounds`; `line` is what they had better leave free.
    #[must_use]
    pub fn new(bounds: Area, line: Vec<[f64; 2]>) -> Self {
        Self {
            bounds,
            taken: Vec::new(),
            line,
        }
    }

    /// Keeps an area free.
    pub fn take(&mut self, area: Area) {
        self.taken.push(area);
    }

    /// Takes the first of some areas that covers least of the line; gives its corner, moved by `inset`.
    pub fn emptier(&mut self, areas: &[Area], inset: [f64; 2]) -> [f64; 2] {
        let cost = |a: &Area| {
            self.line.iter().filter(|p| a.holds(**p)).count()
                + 1000 * self.taken.iter().filter(|t| t.overlap(a) > 0.0).count()
        };
        let Some(best) = areas.iter().min_by_key(|a| cost(a)).copied() else {
            return inset;
        };
        self.taken.push(best);
        [best.x + inset[0], best.y + inset[1]]
    }

    /// The best free place for a box of `w` by `h` about `anchor`; `None` if every place covers another label.
    pub fn place(&mut self, anchor: [f64; 2], w: f64, h: f64) -> Option<Area> {
        let mut best: Option<(f64, Area)> = None;
        for reach in [9.0, 18.0, 30.0, 46.0, 66.0, 90.0, 120.0] {
            for turn in 0..16_u8 {
                let (s, c) = (f64::from(turn) / 16.0 * std::f64::consts::TAU).sin_cos();
                let centre = [
                    anchor[0] + c * (reach + 0.5 * w),
                    anchor[1] + s * (reach + 0.5 * h),
                ];
                let area = Area {
                    x: centre[0] - 0.5 * w,
                    y: centre[1] - 0.5 * h,
                    w,
                    h,
                };
                if !area.within(&self.bounds) || self.taken.iter().any(|t| t.overlap(&area) > 0.0) {
                    continue;
                }
                let covered = num::real(self.line.iter().filter(|p| area.holds(**p)).count());
                let cost = covered * 12.0 + reach + if c < -0.1 { 3.0 } else { 0.0 };
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, area));
                }
            }
        }
        let (_, area) = best?;
        self.taken.push(Area {
            x: area.x - 2.0,
            y: area.y - 1.0,
            w: w + 4.0,
            h: h + 2.0,
        });
        Some(area)
    }

    /// Places and draws lines of text (the first in bold if `bold`) with a leader where they stand apart.
    pub fn label(
        &mut self,
        svg: &mut Svg,
        anchor: [f64; 2],
        size: f64,
        bold: bool,
        lines: &[String],
    ) {
        let widest = lines
            .iter()
            .map(|l| text_width(l, size))
            .fold(0.0, f64::max);
        let w = widest * if bold { 1.06 } else { 1.0 } + 8.0;
        let h = num::real(lines.len()) * size * 1.2 + 5.0;
        let Some(area) = self.place(anchor, w, h) else {
            return;
        };
        let near = area.nearest(anchor);
        if (near[0] - anchor[0]).hypot(near[1] - anchor[1]) > 13.0 {
            svg.line(anchor, near, "stroke=\"#444\" stroke-width=\"1\"");
        }
        svg.rect(
            [area.x, area.y],
            [w, h],
            "fill=\"#fff\" fill-opacity=\"0.78\"",
        );
        for (i, line) in lines.iter().enumerate() {
            let y = area.y + 1.0 + size * (1.2 * num::real(i) + 1.0);
            let style = if bold && i == 0 {
                "font-weight=\"bold\""
            } else {
                ""
            };
            svg.text([area.x + 4.0, y], size, Anchor::Start, style, line);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Area, Placer};

    #[test]
    fn labels_never_cover_each_other_nor_leave_the_picture() {
        let bounds = Area {
            x: 0.0,
            y: 0.0,
            w: 400.0,
            h: 300.0,
        };
        let mut placer = Placer::new(bounds, vec![[200.0, 150.0]]);
        let placed: Vec<Area> = (0..12)
            .filter_map(|i| placer.place([200.0 + f64::from(i), 150.0], 80.0, 20.0))
            .collect();
        assert!(placed.len() >= 10, "{}", placed.len());
        for (i, a) in placed.iter().enumerate() {
            assert!(a.within(&bounds));
            assert!(placed.iter().skip(i + 1).all(|b| a.overlap(b) <= 0.0));
        }
        assert!(placer.place([200.0, 150.0], 1000.0, 20.0).is_none());
    }
}
