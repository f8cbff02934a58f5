//! A small writer of SVG 1.1: presentation attributes only, one decimal, the same input gives the same bytes.

use crate::export::fixed::push;

/// Families that exist, or are replaced alike, on every system; drawn text needs no embedded font.
pub const FONT: &str = "Helvetica, Arial, 'Liberation Sans', sans-serif";

/// Where a text stands relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Begins at the point.
    Start,
    /// Centred on the point.
    Middle,
    /// Ends at the point.
    End,
}

/// SVG elements being written.
#[derive(Clone, Debug, Default)]
pub struct Svg {
    body: String,
}

impl Svg {
    /// Nothing drawn yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// What was drawn, without an outer element.
    #[must_use]
    pub fn into_body(self) -> String {
        self.body
    }

    /// Raw SVG from this writer (never from outside).
    pub fn raw(&mut self, svg: &str) {
        self.body.push_str(svg);
        self.body.push('\n');
    }

    /// A straight line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], style: &str) {
        self.body.push_str("<path d=\"");
        self.points(&[from, to]);
        self.end_style(style);
    }

    /// A line through points.
    pub fn polyline(&mut self, points: &[[f64; 2]], style: &str) {
        if points.len() > 1 {
            self.body.push_str("<path fill=\"none\" d=\"");
            self.points(points);
            self.end_style(style);
        }
    }

    /// Closed rings; with several, an inner one of the other direction is a hole.
    pub fn rings(&mut self, rings: &[Vec<[f64; 2]>], style: &str) {
        self.body.push_str("<path fill-rule=\"evenodd\" d=\"");
        for ring in rings {
            self.points(ring);
            self.body.push('Z');
        }
        self.end_style(style);
    }

    /// One closed ring.
    pub fn polygon(&mut self, ring: &[[f64; 2]], style: &str) {
        self.body.push_str("<path d=\"");
        self.points(ring);
        self.body.push('Z');
        self.end_style(style);
    }

    /// A rectangle.
    pub fn rect(&mut self, [x, y]: [f64; 2], [w, h]: [f64; 2], style: &str) {
        self.polygon(&[[x, y], [x + w, y], [x + w, y + h], [x, y + h]], style);
    }

    /// A circle.
    pub fn circle(&mut self, [x, y]: [f64; 2], radius: f64, style: &str) {
        self.body.push_str("<circle cx=\"");
        push(&mut self.body, x, 1);
        self.body.push_str("\" cy=\"");
        push(&mut self.body, y, 1);
        self.body.push_str("\" r=\"");
        push(&mut self.body, radius, 1);
        self.end_style(style);
    }

    /// Text at a point on its base line.
    pub fn text(&mut self, [x, y]: [f64; 2], size: f64, anchor: Anchor, style: &str, text: &str) {
        self.body.push_str("<text x=\"");
        push(&mut self.body, x, 1);
        self.body.push_str("\" y=\"");
        push(&mut self.body, y, 1);
        self.body.push_str("\" font-size=\"");
        push(&mut self.body, size, 1);
        self.body.push_str(match anchor {
            Anchor::Start => "\"",
            Anchor::Middle => "\" text-anchor=\"middle\"",
            Anchor::End => "\" text-anchor=\"end\"",
        });
        if !style.is_empty() {
            self.body.push(' ');
            self.body.push_str(style);
        }
        self.body.push('>');
        self.body.push_str(&escape(text));
        self.body.push_str("</text>\n");
    }

    fn points(&mut self, points: &[[f64; 2]]) {
        let mut first = true;
        for [x, y] in points
            .iter()
            .filter(|p| p[0].is_finite() && p[1].is_finite())
        {
            self.body.push(if first { 'M' } else { 'L' });
            first = false;
            push(&mut self.body, *x, 1);
            self.body.push(' ');
            push(&mut self.body, *y, 1);
        }
    }

    fn end_style(&mut self, style: &str) {
        self.body.push_str("\" ");
        self.body.push_str(style);
        self.body.push_str("/>\n");
    }
}

/// A picture: what was drawn inside an `svg` element with a title for screen readers.
#[must_use]
pub fn picture([width, height]: [f64; 2], title: &str, description: &str, body: &str) -> String {
    let mut out = String::from("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 ");
    push(&mut out, width, 0);
    out.push(' ');
    push(&mut out, height, 0);
    out.push_str("\" width=\"");
    push(&mut out, width, 0);
    out.push_str("\" height=\"");
    push(&mut out, height, 0);
    out.push_str("\" role=\"img\" font-family=\"");
    out.push_str(FONT);
    out.push_str("\" fill=\"#111\">\n<title>");
    out.push_str(&escape(title));
    out.push_str("</title>\n<desc>");
    out.push_str(&escape(description));
    out.push_str("</desc>\n");
    out.push_str(body);
    out.push_str("</svg>\n");
    out
}

/// The picture as a file of its own.
#[must_use]
pub fn file(picture: &str) -> String {
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{picture}")
}

/// Text made safe for XML and HTML, in content and in quoted attributes; characters neither allows are dropped.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(c),
            // Controls, and the marks that turn the direction of the text after them.
            c if c.is_control()
                || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}') => {}
            '\u{fffe}' | '\u{ffff}' => {}
            c => out.push(c),
        }
    }
    out
}

/// Width of a text in the sans-serif faces above, a few per cent on the safe side.
#[must_use]
pub fn text_width(text: &str, size: f64) -> f64 {
    let units: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | '.' | ',' | '\'' | ':' | ';' | '|' | '!' | ' ' | 'f' | 't' | '('
            | ')' => 0.31,
            'm' | 'w' | 'M' | 'W' | '%' => 0.88,
            'A'..='Z' => 0.71,
            _ => 0.575,
        })
        .sum();
    units * size
}

/// A signed number for a picture, with a true minus sign.
#[must_use]
pub fn signed(x: f64, decimals: usize) -> String {
    crate::export::fixed::fixed(x, decimals).replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::{Svg, escape, signed};

    #[test]
    fn hostile_text_is_disarmed() {
        assert_eq!(
            escape("<b a=\"x\">'&\u{0}\u{202e}"),
            "&lt;b a=&quot;x&quot;&gt;&#39;&amp;"
        );
    }

    #[test]
    fn points_that_are_not_finite_are_left_out() {
        let mut svg = Svg::new();
        svg.polyline(
            &[[0.0, f64::NAN], [1.0, 2.0], [3.0, 4.04]],
            "stroke=\"#000\"",
        );
        assert_eq!(
            svg.into_body(),
            "<path fill=\"none\" d=\"M1.0 2.0L3.0 4.0\" stroke=\"#000\"/>\n"
        );
        assert_eq!(signed(-3.25, 1), "\u{2212}3.3");
    }
}
