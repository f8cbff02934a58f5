//! The tables of the page about the course of the crash: reaction window, extremes, roll-over and rest, agreement
//! of the models, error budget.

use std::fmt::Write as _;

use schema::num;

use crate::export::fixed::fixed;
use crate::findings::extremes::{Extreme, Extremes, SIDESLIP_MPS};
use crate::findings::final_rest::CREEP_MPS;
use crate::findings::reaction::Reference;
use crate::findings::rollover::TILT_DEG;
use crate::findings::{Figure, Reconstruction};
use crate::report::number::{self, KMH};
use crate::report::svg::{escape, signed};
use crate::report::tables::{row, stacked, table, with_bounds};
use crate::report::words::when;

/// The last seconds, row by row, and the extremes before the impact.
#[must_use]
pub(crate) fn reaction(r: &Reconstruction) -> String {
    let reaction = &r.details.reaction;
    if reaction.rows.is_empty() {
        return "<p>The record holds neither an impact nor a rest to count back from.</p>\n"
            .to_owned();
    }
    let brakes = reaction.brake_unit.is_some();
    let mut rows = String::new();
    for line in &reaction.rows {
        let accel = |f: &Option<Figure>| {
            f.as_ref()
                .map_or_else(|| "missing".to_owned(), |f| with_bounds(f, 1.0, 1, ""))
        };
        let mut cells = vec![
            with_bounds(&line.speed_mps, KMH, 1, ""),
            with_bounds(&line.distance_m, 1.0, 1, ""),
            with_bounds(&line.heading_deg, 1.0, 1, ""),
            accel(&line.forward_mps2),
            accel(&line.right_mps2),
            with_bounds(&line.north_m, 1.0, 1, ""),
            with_bounds(&line.east_m, 1.0, 1, ""),
        ];
        if brakes {
            cells.push(
                line.brake
                    .map_or_else(|| "missing".to_owned(), |b| fixed(b, 1)),
            );
        }
        row(&mut rows, &signed(line.before_s, 1), &stacked(cells));
    }
    let brake = format!("Brake signal{}", unit(reaction.brake_unit.as_deref()));
    let (first, way) = match reaction.reference {
        Reference::Impact => ("Before the impact, s", "Way to the impact, m"),
        Reference::Stop => ("Before standing, s", "Way to the stop, m"),
    };
    let mut head = vec![
        first,
        "Speed, km/h",
        way,
        "Heading, \u{b0}",
        "Forward, m/s\u{b2}",
        "Right, m/s\u{b2}",
        "North, m",
        "East, m",
    ];
    if brakes {
        head.push(&brake);
    }
    let confidence = number::percent(r.confidence);
    format!(
        "{}<p class=\"sub\">In brackets the bounds at {confidence} confidence. Accelerations are means over the 0.1 s before, along and across the car. The bounds of the way take the speed errors as one and the same throughout, which they at most are.{}</p>\n{}",
        table("figures rows", &head, &rows),
        if brakes {
            ""
        } else {
            " No brake signal is recorded."
        },
        extremes(r),
    )
}

fn unit(unit: Option<&str>) -> String {
    match unit {
        None | Some("") => String::new(),
        Some(unit) => format!(", {unit}"),
    }
}

fn extremes(r: &Reconstruction) -> String {
    let d = &r.details;
    let mut rows = String::new();
    let cell = |e: Option<&Extreme>, name: &str, most: usize| {
        e.map_or_else(
            || "none".to_owned(),
            |e| {
                format!(
                    "{}, {}",
                    with_bounds(&e.value, 1.0, most, name),
                    when(e.t_s, 2)
                )
            },
        )
    };
    let mut line =
        |heading: &str, name: &str, most: usize, of: &dyn Fn(&Extremes) -> Option<Extreme>| {
            let mut cells = vec![cell(of(&d.before).as_ref(), name, most)];
            if let Some(after) = &d.after {
                cells.push(cell(of(after).as_ref(), name, most));
            }
            row(&mut rows, heading, &cells);
        };
    line(
        "Lateral acceleration, mean over 0.25 s",
        "m/s\u{b2}",
        2,
        &|e| e.lateral_mps2,
    );
    line(
        &format!("Sideslip above {} km/h", fixed(SIDESLIP_MPS * KMH, 0)),
        "\u{b0}",
        1,
        &|e| e.sideslip_deg,
    );
    line("Yaw rate", "\u{b0}/s", 1, &|e| e.yaw_rate_degps);
    let head: &[&str] = if d.after.is_some() {
        &[
            "Largest value (to the right positive)",
            "Before the first impact",
            "After it",
        ]
    } else {
        &[
            "Largest value (to the right positive)",
            "In the whole window",
        ]
    };
    format!(
        "<h3>Largest lateral motion</h3>\n{}",
        table("plain", head, &rows)
    )
}

/// Roll-over and final rest.
#[must_use]
pub(crate) fn rest(r: &Reconstruction) -> String {
    let mut rows = String::new();
    let mut fact = |name: &str, text: String| row(&mut rows, name, &[text]);
    let degrees = |f: &Figure| with_bounds(f, 1.0, 1, "\u{b0}");
    let seconds = |f: &Figure| with_bounds(f, 1.0, 2, "s");
    let metres = |f: &Figure| with_bounds(f, 1.0, 1, "m");
    match &r.details.rollover {
        Some(over) => {
            let turns = if over.certain {
                format!("{} quarter turns", over.quarter_turns)
            } else {
                format!(
                    "about {} quarter turns; a gyro was silent or at its limit, so whole turns may be missing",
                    over.quarter_turns
                )
            };
            let side = match (over.axis, over.angle_deg.value > 0.0) {
                ("roll", true) => "over the right side",
                ("roll", false) => "over the left side",
                (_, true) => "backwards, nose up",
                (_, false) => "forwards, nose down",
            };
            fact("Roll-over", format!("{side}, {turns}"));
            fact("Angle turned", degrees(&over.angle_deg));
            fact("Largest angle on the way", degrees(&over.largest_deg));
            fact("Roll-over began", seconds(&over.begin_t_s));
            fact("Roll-over ended", seconds(&over.end_t_s));
        }
        None if r.details.no_attitude => fact(
            "Roll-over",
            "cannot be told: this model has no roll and pitch".to_owned(),
        ),
        None => fact(
            "Roll-over",
            format!(
                "none: the car never leaned more than {}\u{b0}",
                fixed(TILT_DEG, 0)
            ),
        ),
    }
    let slow = format!("Slower for good than {} m/s", fixed(CREEP_MPS, 1));
    if let Some(rest) = &r.details.final_rest {
        fact(&slow, seconds(&rest.stop_t_s));
        fact(
            "Still enough for levelling",
            format!("from {}", when(rest.settled_t_s, 2)),
        );
        fact(
            "Length of the rest in the record",
            seconds(&rest.duration_s),
        );
        if !r.details.no_attitude {
            fact("The car lies on its", rest.lies_on.to_owned());
            fact("Roll at rest", degrees(&rest.roll_deg));
            fact("Pitch at rest", degrees(&rest.pitch_deg));
        }
        fact(
            "Heading at rest",
            if r.rest_pose.is_some() {
                degrees(&rest.heading_deg)
            } else {
                "0\u{b0} by definition: no rest pose is given".to_owned()
            },
        );
        if let Some(from) = &rest.from_impact {
            fact("From the first impact, time", seconds(&from.duration_s));
            fact("From the first impact, straight", metres(&from.straight_m));
            fact(
                "From the first impact, along the path",
                metres(&from.path_m),
            );
            fact(
                "Turned on the way, to the right",
                degrees(&from.rotation_deg),
            );
        }
    } else {
        fact(
            "Final rest",
            "not reached: the record ends moving".to_owned(),
        );
    }
    table("facts", &[], &rows)
}

/// Tests of the models' differences: the pairs that disagree, or that none does.
#[must_use]
pub(crate) fn agreement(r: &Reconstruction) -> String {
    if r.comparisons.is_empty() {
        return String::new();
    }
    let mut rows = String::new();
    for c in r.comparisons.iter().filter(|c| c.beyond()) {
        let difference = match c.unit {
            "m/s" => format!("{} km/h", fixed(c.difference * KMH, 1)),
            "degrees" => format!("{}\u{b0}", fixed(c.difference, 1)),
            unit => format!("{} {unit}", fixed(c.difference, 1)),
        };
        row(
            &mut rows,
            &format!("{} and {}", c.models[0], c.models[1]),
            &[
                c.quantity.to_owned(),
                difference,
                fixed(c.chi_square, 1),
                format!(
                    "{} ({} degree{} of freedom)",
                    fixed(c.limit, 1),
                    c.degrees,
                    if c.degrees == 1 { "" } else { "s" }
                ),
            ],
        );
    }
    let confidence = number::percent(r.confidence);
    let note = format!(
        "<p class=\"sub\">Each pair of models is tested in speed, heading, place and delta\u{2011}V at the first impact and in the place at the start: the difference squared over the sum of the two covariances, against chi\u{2011}square at {confidence}. The models share the record, so their errors go together and the sum is too wide: a pair listed here disagrees all the more; one that is not listed may still differ.</p>\n"
    );
    let body = if rows.is_empty() {
        "<p>No two models disagree beyond their joint covariance.</p>\n".to_owned()
    } else {
        table(
            "plain",
            &["Models that disagree", "In", "Apart", "Chi-square", "Limit"],
            &rows,
        )
    };
    format!("{body}{note}")
}

/// Error budgets with bars; empty where the model gives none.
#[must_use]
pub(crate) fn budgets(r: &Reconstruction) -> String {
    let mut out = String::from(
        "<p>How much of each figure's variance (the square of its one sigma) comes from which source, everything else left \
         as it is: a source whose share is half would, if it were not there, leave 0.7 of the one sigma. Positions are those \
         of the sensor as seen from the rest; of a heading measured at the scene they hold nothing.</p>\n<div class=\"budgets\">\n",
    );
    for budget in &r.details.budgets {
        let mut rows = String::new();
        for (name, share) in &budget.sources {
            let share = share.clamp(0.0, 1.0);
            let _ = writeln!(
                rows,
                "<tr><th scope=\"row\">{}</th><td><span>{} %</span><svg viewBox=\"0 0 100 10\" preserveAspectRatio=\"none\" role=\"img\" aria-label=\"{} %\"><rect x=\"0\" y=\"0\" width=\"{}\" height=\"10\" fill=\"#1f5a96\"/></svg></td></tr>",
                escape(name),
                fixed(100.0 * share, 0),
                fixed(100.0 * share, 0),
                num::round_i64(100.0 * share)
            );
        }
        let name = budget.figure.replacen("delta-V", "Delta-V", 1);
        let mut letters = name.chars();
        let name: String = letters
            .next()
            .map(|c| c.to_ascii_uppercase())
            .into_iter()
            .chain(letters)
            .collect();
        let _ = write!(
            out,
            "<div><h3>{}: one sigma {} {}</h3>\n{}</div>\n",
            escape(&name),
            fixed(budget.sd, number::decimals(budget.sd, 1, 4)),
            budget.unit,
            table("budget", &["Source", "Share of the variance"], &rows)
        );
    }
    out.push_str("</div>\n");
    out
}
