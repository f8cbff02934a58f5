//! Signs that every plan has: the arrow to the north, the scale bar, the plate behind them.

use crate::report::axis::{round_step, step_decimals};
use crate::report::labels::Area;
use crate::report::svg::{Anchor, Svg, signed};

const LINE: &str = "stroke=\"#111\" stroke-width=\"2\"";

/// A plate that lets signs be read on top of a path.
pub(crate) fn plate(svg: &mut Svg, area: Area) {
    svg.rect(
        [area.x, area.y],
        [area.w, area.h],
        "fill=\"#fff\" fill-opacity=\"0.86\"",
    );
}

/// An arrow that points up, 10 wide and 28 high, from its tip; what is up is written beside its foot.
pub(crate) fn arrow(svg: &mut Svg, [x, y]: [f64; 2], size: f64, up: &str) {
    svg.line([x, y + 28.0], [x, y + 8.0], LINE);
    let head = [[x, y], [x + 5.0, y + 11.0], [x - 5.0, y + 11.0]];
    svg.polygon(&head, "fill=\"#111\"");
    svg.text([x + 12.0, y + 20.0], size, Anchor::Start, "", up);
}

/// A bar of a round number of metres.
#[derive(Clone, Debug)]
pub(crate) struct ScaleBar {
    /// Picture units.
    pub(crate) length: f64,
    text: String,
}

impl ScaleBar {
    /// The round number next to a length in picture units.
    pub(crate) fn about(length: f64, per_metre: f64) -> Self {
        let metres = round_step(length / per_metre);
        Self {
            length: metres * per_metre,
            text: format!("{} m", signed(metres, step_decimals(metres))),
        }
    }

    /// Draws it from the left end of its foot.
    pub(crate) fn draw(&self, svg: &mut Svg, [x, y]: [f64; 2], size: f64) {
        let end = x + self.length;
        svg.polyline(&[[x, y - 6.0], [x, y], [end, y], [end, y - 6.0]], LINE);
        let middle = x + 0.5 * self.length;
        svg.text([middle, y - 9.0], size, Anchor::Middle, "", &self.text);
    }
}
