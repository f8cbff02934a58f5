//! The comparison for a person (one screen) and for a machine.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::compare::Comparison;
use crate::compare::align::{Align, Alignment};
use crate::compare::score::{CONFIDENCES, Instant, Spread};
use crate::report::summary::finite;
use schema::num;

/// Name of a way to align.
#[must_use]
pub fn align_name(how: Align) -> &'static str {
    match how {
        Align::Rest => "rest",
        Align::None => "none",
        Align::Fit => "fit",
    }
}

/// Everything, with the errors over time at most once a second.
#[must_use]
pub fn json(c: &Comparison) -> Value {
    let spread = |s: Option<&Spread>, factor: f64, unit: &str| {
        s.map(|s| {
            json!({
                "unit": unit, "instants": s.instants,
                "median": finite(s.median * factor), "p95": finite(s.p95 * factor), "max": finite(s.max * factor),
                "inside": s.inside.map(|shares| CONFIDENCES.iter().zip(shares)
                    .map(|(c, share)| json!({"confidence": c, "share": finite(share)})).collect::<Vec<_>>()),
                "nees_per_dof": s.nees.map(finite),
            })
        })
    };
    json!({
        "time": {
            "offset_s": finite(c.time.offset_s), "source": c.time.source,
            "rms_mps": c.time.rms_mps.map(finite), "runner_up_mps": c.time.runner_up_mps.map(finite),
        },
        "alignment": c.alignment.as_ref().map(|a| json!({
            "how": align_name(a.how), "rotation_deg": finite(a.rotation.to_degrees()),
            "rotation_sd_deg": a.rotation_sd.map(|sd| finite(sd.to_degrees())),
            "shift_north_m": finite(a.shift[0]), "shift_east_m": finite(a.shift[1]),
            "fixes": a.fixes, "residual_m": a.residual_m.map(finite),
        })),
        "position": spread(c.score.position.as_ref(), 1.0, "m"),
        "speed": spread(c.score.speed.as_ref(), 1.0, "m/s"),
        "heading": spread(c.score.heading.as_ref(), 1_f64.to_degrees(), "deg"),
        "start": c.score.start.map(|s| json!({
            "t_s": finite(s.t_s), "error_m": finite(s.error_m), "distance_m": finite(s.distance_m),
            "percent_of_distance": s.share.map(|x| finite(x * 100.0)),
            "alignment_sd_m": s.alignment_sd_m.map(finite),
        })),
        "over_time": thinned(&c.score.instants, 1.0).iter().map(|i| json!({
            "t_s": finite(i.t_s), "position_m": i.position_m.map(finite), "along_m": i.along_m.map(finite),
            "across_m": i.across_m.map(finite), "speed_mps": i.speed_mps.map(finite),
            "heading_deg": i.heading.map(|h| finite(h.to_degrees())),
            "position_nees_per_dof": i.position_squares.map(|s| finite(0.5 * s)),
        })).collect::<Vec<_>>(),
    })
}

/// One screen of plain ASCII.
#[must_use]
pub fn screen(c: &Comparison) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}", time_line(c));
    if let Some(a) = &c.alignment {
        let _ = writeln!(out, "{}", align_line(a));
    }
    if let Some(s) = &c.score.start {
        let share = s.share.map_or(String::new(), |x| {
            format!(" = {:.2} % of the {:.0} m driven", x * 100.0, s.distance_m)
        });
        let turn = s
            .alignment_sd_m
            .map_or(String::new(), |m| format!(" (alignment +- {m:.2} m)"));
        let _ = writeln!(
            out,
            "start     t = {:.2} s: {:.2} m off{share}{turn}",
            s.t_s, s.error_m
        );
    }
    let _ = writeln!(
        out,
        "\n          median     p95     max   inside 50/80/95/99 %   NEES/n  instants"
    );
    for (name, s, factor) in [
        ("position m", c.score.position.as_ref(), 1.0),
        ("speed m/s", c.score.speed.as_ref(), 1.0),
        ("heading deg", c.score.heading.as_ref(), 1_f64.to_degrees()),
    ] {
        let Some(s) = s else { continue };
        let inside = s.inside.map_or("no bounds".to_owned(), |shares| {
            shares
                .iter()
                .map(|x| format!("{:.0}", x * 100.0))
                .collect::<Vec<_>>()
                .join("/")
        });
        let nees = s.nees.map_or("-".to_owned(), |n| format!("{n:.2}"));
        let _ = writeln!(
            out,
            "{name:<11}{:>7.3} {:>7.3} {:>7.3}   {inside:<20} {nees:>8} {:>9}",
            s.median * factor,
            s.p95 * factor,
            s.max * factor,
            s.instants
        );
    }
    let _ = writeln!(
        out,
        "\n     t s   position m   along m  across m   speed m/s   heading deg"
    );
    let span = c
        .score
        .instants
        .first()
        .zip(c.score.instants.last())
        .map_or(0.0, |(a, b)| b.t_s - a.t_s);
    for i in thinned(&c.score.instants, (span / 10.0).max(0.01)) {
        let cell = |x: Option<f64>, width: usize| {
            x.map_or_else(|| format!("{:>width$}", "-"), |x| format!("{x:>width$.3}"))
        };
        let _ = writeln!(
            out,
            "{:>8.2} {} {} {} {} {}",
            i.t_s,
            cell(i.position_m, 12),
            cell(i.along_m, 9),
            cell(i.across_m, 9),
            cell(i.speed_mps, 11),
            cell(i.heading.map(f64::to_degrees), 13)
        );
    }
    out
}

fn time_line(c: &Comparison) -> String {
    let how = match c.time.source {
        "utc" => "both tables' UTC".to_owned(),
        "epoch" => "the stated epoch".to_owned(),
        _ => format!(
            "matching speeds: {:.3} m/s rms, next best {}",
            c.time.rms_mps.unwrap_or(f64::NAN),
            c.time
                .runner_up_mps
                .map_or("none".to_owned(), |x| format!("{x:.2} m/s"))
        ),
    };
    format!("time      offset {:.3} s from {how}", c.time.offset_s)
}

fn align_line(a: &Alignment) -> String {
    match (a.rotation_sd, a.residual_m) {
        (Some(sd), Some(rms)) => format!(
            "aligned   on {} fixes ({}): turned {:.2} +- {:.2} deg, residual {rms:.3} m",
            a.fixes,
            if a.how == Align::Rest {
                "3 to 30 m before rest"
            } else {
                "all"
            },
            a.rotation.to_degrees(),
            sd.to_degrees()
        ),
        _ => "aligned   not at all: one frame".to_owned(),
    }
}

/// The first instant and those at least `step` seconds after the one before, and the last.
fn thinned(instants: &[Instant], step: f64) -> Vec<Instant> {
    let mut out: Vec<Instant> = Vec::new();
    for (k, i) in instants.iter().enumerate() {
        let due = out.last().is_none_or(|l| i.t_s - l.t_s >= step - 1e-6);
        if due || (k + 1 == instants.len() && num::real(k) > 0.0) {
            out.push(*i);
        }
    }
    out
}
