//! The tables of the page: figures and models; and what every table is made with.

use std::fmt::Write as _;

use crate::findings::{Figure, Reconstruction};
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
        let place = |f: &Figure| {
            let shown = number::shown(f, 1.0, 2);
            match shown.bounds {
                Some((low, high)) => format!("{} ({low} to {high})", shown.value),
                None => format!("{} (no bounds)", shown.value),
            }
            .replace('-', "\u{2212}")
        };
        let speed = m.impact_speed_mps.as_ref().map_or_else(
            || "no impact".to_owned(),
            |f| {
                let shown = number::shown(f, KMH, 1);
                match shown.bounds {
                    Some((low, high)) => format!("{} ({low} to {high})", shown.value),
                    None => format!("{} (no bounds)", shown.value),
                }
            },
        );
        let name = if m.name == r.model {
            format!("{} (this report)", m.name)
        } else {
            m.name.to_owned()
        };
        row(
            &mut rows,
            &name,
            &[speed, place(&m.start_north_m), place(&m.start_east_m)],
        );
    }
    table(
        "models",
        &[
            "Model",
            "Impact speed, km/h",
            "Start: north, m",
            "Start: east, m",
        ],
        &rows,
    )
}
