//! The tables of the page: figures and models; and what every table is made with.

use std::fmt::Write as _;

use crate::findings::{AtImpact, Figure, Reconstruction};
use crate::report::number::{self, KMH};
use crate::report::svg::escape;

/// One row: a heading and cells, each escaped here.
pub(crate) fn row(out: &mut String, heading: &str, cells: &[String]) {
    let _ = write!(out, "<tr><th scope=\"row\">{}</th>", escape(heading));
    for cell in cells {
        let _ = write!(out, "<td>{}</td>", escape(cell));
    }
    out.push_str("</tr>\n");
}

/// A table in a frame that scrolls by itself on a narrow screen.
pub(crate) fn table(class: &str, head: &[&str], rows: &str) -> String {
    let mut out = format!("<div class=\"scroll\"><table class=\"{class}\">\n");
    if !head.is_empty() {
        out.push_str("<thead><tr>");
        for cell in head {
            let _ = write!(out, "<th scope=\"col\">{}</th>", escape(cell));
        }
        out.push_str("</tr></thead>\n");
    }
    let _ = write!(out, "<tbody>\n{rows}</tbody></table></div>\n");
    out
}

fn cells(f: &Figure, factor: f64, most: usize, unit: &str) -> Vec<String> {
    let shown = number::shown(f, factor, most);
    let (low, high) = shown
        .bounds
        .unwrap_or_else(|| ("none".to_owned(), "none".to_owned()));
    let minus = |s: String| s.replace('-', "\u{2212}");
    vec![
        minus(format!("{} {unit}", shown.value)),
        minus(low),
        minus(high),
    ]
}

/// `61.3 (60.1 to 62.5) km/h`; open bounds in words.
pub(crate) fn with_bounds(f: &Figure, factor: f64, most: usize, unit: &str) -> String {
    let shown = number::shown(f, factor, most);
    let gap = if unit.is_empty() || unit.starts_with('\u{b0}') {
        ""
    } else {
        " "
    };
    let text = match shown.bounds {
        Some((low, high)) => format!("{}{gap}{unit} ({low} to {high})", shown.value),
        None if f.low.is_finite() => {
            let low = crate::export::fixed::fixed(f.low * factor, most.min(1));
            format!("{}{gap}{unit} (at least {low})", shown.value)
        }
        None if f.high.is_finite() => {
            let high = crate::export::fixed::fixed(f.high * factor, most.min(1));
            format!("{}{gap}{unit} (at most {high})", shown.value)
        }
        None => format!("{}{gap}{unit} (no bounds)", shown.value),
    };
    text.replace('-', "\u{2212}")
}

/// Bounds on a line of their own, for tables with many columns.
pub(crate) fn stacked(cells: Vec<String>) -> Vec<String> {
    let stack = |c: String| c.replacen(" (", "\n(", 1).replace(' ', "\u{a0}");
    cells.into_iter().map(stack).collect()
}

/// Every figure with its bounds; speeds in km/h first, then m/s.
#[must_use]
pub fn figures(r: &Reconstruction) -> String {
    let mut rows = String::new();
    let speed = |rows: &mut String, name: &str, f: &Figure| {
        row(rows, name, &cells(f, KMH, 1, "km/h"));
        row(rows, "", &cells(f, 1.0, 2, "m/s"));
    };
    for (i, impact) in r.impacts.iter().enumerate() {
        let of = if r.impacts.len() > 1 {
            format!(" of impact {}", i + 1)
        } else {
            String::new()
        };
        let dv = &impact.delta_v;
        let least = if dv.lower_bound { " (at least)" } else { "" };
        speed(
            &mut rows,
            &format!("Speed at the onset{of}"),
            &impact.speed_mps,
        );
        row(
            &mut rows,
            &format!("Time of the onset{of}"),
            &cells(&impact.t_s, 1.0, 3, "s"),
        );
        row(
            &mut rows,
            &format!("Heading at the onset{of}"),
            &cells(&impact.heading_deg, 1.0, 1, "\u{b0}"),
        );
        speed(
            &mut rows,
            &format!("Change of velocity, resultant{of}{least}"),
            &dv.resultant_mps,
        );
        speed(
            &mut rows,
            &format!("Change of velocity, forward{of}{least}"),
            &dv.longitudinal_mps,
        );
        speed(
            &mut rows,
            &format!("Change of velocity, to the right{of}{least}"),
            &dv.lateral_mps,
        );
        row(
            &mut rows,
            &format!("Principal direction of force{of}"),
            &cells(&dv.pdof_deg, 1.0, 1, "\u{b0}"),
        );
        row(
            &mut rows,
            &format!("Length of the pulse{of}"),
            &cells(&dv.duration_s, 1.0, 3, "s"),
        );
    }
    if let Some(b) = &r.braking {
        row(
            &mut rows,
            "Onset of braking",
            &cells(&b.onset_t_s, 1.0, 2, "s"),
        );
        row(
            &mut rows,
            "Mean deceleration",
            &cells(&b.mean_mps2, 1.0, 2, "m/s\u{b2}"),
        );
        row(
            &mut rows,
            "Largest deceleration over 0.1 s",
            &cells(&b.peak_mps2, 1.0, 2, "m/s\u{b2}"),
        );
    }
    row(
        &mut rows,
        "Distance travelled in the window",
        &cells(&r.distance_m, 1.0, 1, "m"),
    );
    speed(
        &mut rows,
        "Speed at the start of the window",
        &r.start_speed_mps,
    );
    speed(&mut rows, "Largest speed in the window", &r.top_speed_mps);
    table("figures", &["Figure", "Estimate", "Lower", "Upper"], &rows)
}

/// The models side by side.
#[must_use]
pub fn models(r: &Reconstruction) -> String {
    let mut rows = String::new();
    for m in &r.models {
        let none = || "no impact".to_owned();
        let speed = |f: &Figure| with_bounds(f, KMH, 1, "");
        let place = |f: &Figure| with_bounds(f, 1.0, 2, "");
        let name = if m.name == r.model {
            format!("{} (this report)", m.name)
        } else {
            m.name.to_owned()
        };
        let at = |of: &dyn Fn(&AtImpact) -> String| m.impact.as_ref().map_or_else(none, of);
        row(
            &mut rows,
            &name,
            &stacked(vec![
                m.impact_speed_mps.as_ref().map_or_else(none, speed),
                at(&|i| with_bounds(&i.heading_deg, 1.0, 1, "")),
                at(&|i| place(&i.north_m)),
                at(&|i| place(&i.east_m)),
                at(&|i| speed(&i.longitudinal_mps)),
                at(&|i| speed(&i.lateral_mps)),
                place(&m.start_north_m),
                place(&m.start_east_m),
            ]),
        );
    }
    table(
        "models plain",
        &[
            "Model",
            "Impact speed, km/h",
            "Heading, \u{b0}",
            "Impact: north, m",
            "Impact: east, m",
            "Delta-V forward, km/h",
            "Delta-V right, km/h",
            "Start: north, m",
            "Start: east, m",
        ],
        &rows,
    )
}
