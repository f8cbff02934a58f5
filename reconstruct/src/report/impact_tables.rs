//! The tables of the page about the impacts: one column an impact, the rules for the pulse, the delta-V curve.

use std::fmt::Write as _;

use crate::findings::curve::{Peak, reported};
use crate::findings::{Figure, Impact, Reconstruction};
use crate::report::number::{self, KMH};
use crate::report::svg::escape;
use crate::report::tables::{row, stacked, table, with_bounds};

/// Everything about the impacts; a sentence where there was none.
#[must_use]
pub(crate) fn all(r: &Reconstruction) -> String {
    if r.impacts.is_empty() {
        return "<p>No impact was found in this record.</p>\n".to_owned();
    }
    let mut out = impacts(r);
    out.push_str(&rules(r));
    for (i, impact) in r.impacts.iter().enumerate() {
        out.push_str(&curve(r, i, impact));
    }
    out
}

fn name(r: &Reconstruction, i: usize) -> String {
    if r.impacts.len() > 1 {
        format!("Impact {}", i + 1)
    } else {
        "Impact".to_owned()
    }
}

/// One column an impact.
fn impacts(r: &Reconstruction) -> String {
    let mut rows = String::new();
    let mut line = |heading: &str, cell: &dyn Fn(&Impact) -> String| {
        let cells: Vec<String> = r.impacts.iter().map(cell).collect();
        row(&mut rows, heading, &cells);
    };
    let kmh = |f: &Figure| with_bounds(f, KMH, 1, "km/h");
    let degrees = |f: &Figure| with_bounds(f, 1.0, 1, "\u{b0}");
    line("Onset, s from the trigger", &|i| {
        with_bounds(&i.t_s, 1.0, 3, "s")
    });
    line("Forward speed at the onset", &|i| kmh(&i.speed_mps));
    line("Heading at the onset", &|i| degrees(&i.heading_deg));
    line("Place at the onset, north", &|i| {
        with_bounds(&i.north_m, 1.0, 2, "m")
    });
    line("Place at the onset, east", &|i| {
        with_bounds(&i.east_m, 1.0, 2, "m")
    });
    line("Delta-V, resultant", &|i| kmh(&i.delta_v.resultant_mps));
    line("Delta-V forward, axes of the car at the onset", &|i| {
        kmh(&i.delta_v.longitudinal_mps)
    });
    line("Delta-V to the right, the same axes", &|i| {
        kmh(&i.delta_v.lateral_mps)
    });
    line("Delta-V over the ground, north", &|i| {
        kmh(&i.delta_v.north_mps)
    });
    line("Delta-V over the ground, east", &|i| {
        kmh(&i.delta_v.east_mps)
    });
    line("Direction of the change over the ground", &|i| {
        degrees(&i.delta_v.azimuth_deg)
    });
    line("Principal direction of force", &|i| {
        let (words, hour) = number::direction(i.delta_v.pdof_deg.value);
        format!("{}, {words}, {hour} o'clock", degrees(&i.delta_v.pdof_deg))
    });
    line("Change of yaw rate over the pulse", &|i| {
        with_bounds(&i.delta_v.yaw_rate_change_degps, 1.0, 1, "\u{b0}/s")
    });
    line("Length of the pulse", &|i| {
        with_bounds(&i.delta_v.duration_s, 1.0, 3, "s")
    });
    let peak = |p: Option<&Peak>| {
        p.map_or_else(
            || "none from this model".to_owned(),
            |p| {
                format!(
                    "{}, {} after the onset",
                    with_bounds(&p.value_mps, KMH, 1, "km/h"),
                    with_bounds(&p.after_onset_s, 1000.0, 0, "ms")
                )
            },
        )
    };
    line("Maximum delta-V forward within 300 ms", &|i| {
        peak(i.delta_v.maximum.as_ref().map(|m| &m.longitudinal))
    });
    line("Maximum delta-V to the right within 300 ms", &|i| {
        peak(i.delta_v.maximum.as_ref().map(|m| &m.lateral))
    });
    line("Maximum delta-V, resultant, within 300 ms", &|i| {
        peak(i.delta_v.maximum.as_ref().map(|m| &m.resultant))
    });
    if r.impacts.len() > 1 {
        let between = |of: &dyn Fn(&crate::findings::details::Interval) -> String| {
            let mut cells = vec!["\u{2013}".to_owned()];
            cells.extend(r.details.intervals.iter().map(of));
            cells
        };
        let time = between(&|i| with_bounds(&i.duration_s, 1.0, 3, "s"));
        row(&mut rows, "Time since the impact before", &time);
        let path = between(&|i| with_bounds(&i.path_m, 1.0, 1, "m"));
        row(&mut rows, "Way since the impact before", &path);
    }
    let mut head = vec![String::new()];
    head.extend((0..r.impacts.len()).map(|i| name(r, i)));
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut out = table("plain", &head, &rows);
    let point = if r.impacts[0].delta_v.point == "cg" {
        "centre of gravity"
    } else {
        "sensor's place, as the centre of gravity is not configured"
    };
    let _ = writeln!(
        out,
        "<p>Delta\u{2011}V is that of the {point}, with the turning of the car during the pulse taken out.{}</p>",
        if r.details.multi_event > 1 {
            format!(
                " {} impacts began within 5 s of each other: a crash of several events by 49 CFR 563.",
                r.details.multi_event
            )
        } else {
            String::new()
        }
    );
    out
}

/// Begin and end of each pulse after each rule: one row a rule, two columns an impact.
fn rules(r: &Reconstruction) -> String {
    let mut rows = String::new();
    let cell = |f: &Option<Figure>| {
        f.as_ref()
            .map_or_else(|| "not found".to_owned(), |f| with_bounds(f, 1.0, 3, "s"))
    };
    let first = &r.impacts[0].delta_v.times;
    for (k, rule) in first.iter().map(|t| t.rule).enumerate() {
        let mut cells = Vec::new();
        for impact in &r.impacts {
            if let Some(times) = impact.delta_v.times.get(k) {
                cells.extend([cell(&times.begin_t_s), cell(&times.end_t_s)]);
            }
        }
        row(&mut rows, rule.words(), &stacked(cells));
    }
    if rows.is_empty() {
        return rows;
    }
    let mut head = vec!["Rule for begin and end of the pulse".to_owned()];
    for i in 0..r.impacts.len() {
        head.extend(["begin", "end"].map(|what| format!("{}, {what}", name(r, i))));
    }
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    format!(
        "<h3>Begin and end of the pulse</h3>\n{}",
        table("plain rules", &head, &rows)
    )
}

/// The cumulative curve of one impact.
fn curve(r: &Reconstruction, i: usize, impact: &Impact) -> String {
    let points = reported(&impact.delta_v.curve);
    if points.is_empty() {
        return String::new();
    }
    let mut rows = String::new();
    for p in points {
        let ms = crate::export::fixed::fixed(p.after_onset_s * 1000.0, 0);
        row(
            &mut rows,
            &ms,
            &[
                with_bounds(&p.longitudinal_mps, KMH, 1, ""),
                with_bounds(&p.lateral_mps, KMH, 1, ""),
                with_bounds(&p.resultant_mps, KMH, 1, ""),
            ],
        );
    }
    let head = [
        "After the onset, ms",
        "Forward, km/h",
        "To the right, km/h",
        "Resultant, km/h",
    ];
    format!(
        "<h3>{}: cumulative delta\u{2011}V</h3>\n{}<p class=\"sub\">At the ends of the record's own 10 ms samples, to 250 ms or 30 ms after the end of the pulse, whichever is shorter.</p>\n",
        escape(&name(r, i)),
        table("figures", &head, &rows)
    )
}
