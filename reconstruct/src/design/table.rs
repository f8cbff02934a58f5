//! The study on a terminal.

use std::fmt::Write as _;

use super::expect::{Expected, Study};
use super::slips::{self, Verdict};
use super::source::{Share, dominant};
use crate::export::fixed::fixed;
use crate::report::number::{KMH, count, percent};
use crate::run::{Model, Road};
use crate::stats::two_sided_quantile;

/// An aid that widens the funnel by more than this is told of.
const HARM: f64 = 1.1;

/// A group's share may be told for each of these.
type Quantity = (&'static str, fn(&Share) -> Option<f64>);

/// What the shares are told of.
pub(super) const QUANTITIES: [Quantity; 4] = [
    ("position", |s| Some(s.position)),
    ("heading", |s| Some(s.heading)),
    ("impact speed", |s| s.impact_speed),
    ("delta-V", |s| s.delta_v),
];

/// Decimals so that a length or speed has about three digits.
pub(super) fn digits(x: f64) -> String {
    let decimals = match x.abs() {
        x if x >= 99.95 => 0,
        x if x >= 9.995 => 1,
        x if x >= 0.0995 => 2,
        _ => 3,
    };
    fixed(x, decimals)
}

/// Wheels and road limits, in words.
pub(super) fn aids(wheels: bool, road: bool) -> &'static str {
    match (wheels, road) {
        (true, true) => "wheels, road",
        (true, false) => "wheels",
        (false, true) => "road",
        (false, false) => "neither",
    }
}

/// The whole screen.
#[must_use]
pub fn screen(study: &Study) -> String {
    let settings = &study.settings;
    let mut out = String::new();
    let _ = writeln!(
        out,
        "Design study: {} ({} m to rest), model {}, {}",
        study.plan.name,
        fixed(study.distance_m, 0),
        settings.model.name(),
        aids(settings.wheels, settings.road != Road::None),
    );
    let zero = if study.has_impact { "impact" } else { "rest" };
    let bounds = percent(settings.confidence);
    let _ = writeln!(
        out,
        "Expected bounds at {bounds}; t from the {zero}; ellipse: half axes\n"
    );
    let _ = writeln!(
        out,
        "{:<14}{:>6}  {:>17}  {:>12}  {:>11}",
        "sensors", "t (s)", "ellipse (m)", "speed (km/h)", "heading (deg)"
    );
    for e in &study.expected {
        rows(&mut out, e, settings.confidence);
    }
    if study.has_impact {
        impacts(&mut out, study);
    }
    sources(&mut out, study);
    aid_table(&mut out, study);
    warnings(&mut out, study);
    trials(&mut out, study);
    slip_table(&mut out);
    out
}

/// A name cut to fit its column.
fn short(name: &str) -> String {
    name.chars().take(13).collect()
}

fn rows(out: &mut String, e: &Expected, confidence: f64) {
    let q = two_sided_quantile(confidence);
    for (i, r) in e.rows.iter().enumerate() {
        let name = if i == 0 {
            short(&e.sheet.name)
        } else {
            String::new()
        };
        let ellipse = format!(
            "{} x {}",
            digits(r.ellipse.semi_major),
            digits(r.ellipse.semi_minor)
        );
        let _ = writeln!(
            out,
            "{name:<14}{:>6}  {ellipse:>17}  {:>12}  {:>11}",
            fixed(r.t_s, 0),
            format!("+-{}", digits(q * r.sd_speed_mps * KMH)),
            format!("+-{}", digits(q * r.sd_heading_rad.to_degrees())),
        );
    }
}

fn impacts(out: &mut String, study: &Study) {
    let q = two_sided_quantile(study.settings.confidence);
    let _ = writeln!(
        out,
        "\n{:<14}{:>20}  {:>21}  {:>13}",
        "at the impact", "speed (km/h)", "delta-V (km/h)", "PDOF (deg)"
    );
    for e in &study.expected {
        let Some(i) = &e.impact else {
            let _ = writeln!(out, "{:<14}{:>20}", short(&e.sheet.name), "none found");
            continue;
        };
        let least = if i.lower_bound { "at least " } else { "" };
        let _ = writeln!(
            out,
            "{:<14}{:>20}  {:>21}  {:>13}",
            short(&e.sheet.name),
            format!(
                "{} +-{}",
                fixed(i.speed_mps * KMH, 1),
                digits(q * i.sd_speed_mps * KMH)
            ),
            format!(
                "{least}{} +-{}",
                fixed(i.delta_v_mps * KMH, 1),
                digits(q * i.sd_delta_v_mps * KMH)
            ),
            format!("+-{}", digits(q * i.sd_pdof_deg)),
        );
    }
}

/// The dominating group of one quantity, in words.
pub(super) fn dominant_words(e: &Expected, of: fn(&Share) -> Option<f64>) -> String {
    match dominant(&e.shares, of) {
        Some((source, share)) => format!("{} {} %", source.name(), fixed(share * 100.0, 0)),
        None if e.clipped_samples > 0 => "clipping or method".to_owned(),
        None => "the method".to_owned(),
    }
}

fn sources(out: &mut String, study: &Study) {
    let shown = if study.has_impact { 4 } else { 2 };
    let _ = write!(out, "\n{:<14}", "what dominates");
    for (name, _) in &QUANTITIES[..shown] {
        let _ = write!(out, "  {name:<19}");
    }
    out.push('\n');
    for e in &study.expected {
        let mut line = format!("{:<14}", short(&e.sheet.name));
        for (_, of) in &QUANTITIES[..shown] {
            let _ = write!(line, "  {:<19}", dominant_words(e, *of));
        }
        let _ = writeln!(out, "{}", line.trim_end());
    }
    let _ = writeln!(
        out,
        "(share of the variance that goes if that part were without error; \"the method\": no part\n has a tenth)"
    );
}

fn aid_table(out: &mut String, study: &Study) {
    let Some(first) = study.expected.first() else {
        return;
    };
    let _ = write!(out, "\n{:<14}", "half axis (m)");
    for aid in &first.aids {
        let _ = write!(out, "{:>14}", aids(aid.wheels, aid.road));
    }
    let t = first.rows.first().map_or(0.0, |r| r.t_s);
    let _ = writeln!(out, "   at {} s", fixed(t, 0));
    for e in &study.expected {
        let _ = write!(out, "{:<14}", short(&e.sheet.name));
        for aid in &e.aids {
            let _ = write!(out, "{:>14}", digits(aid.semi_major_m));
        }
        out.push('\n');
    }
}

/// What spoils a prediction: sentences, sheets of which the same is to be said in one.
#[must_use]
pub fn caveats(study: &Study) -> Vec<String> {
    let mut list: Vec<(Vec<&str>, String)> = Vec::new();
    for e in &study.expected {
        for sentence in spoilers(study, e) {
            match list.iter_mut().find(|(_, said)| *said == sentence) {
                Some((names, _)) => names.push(&e.sheet.name),
                None => list.push((vec![&e.sheet.name], sentence)),
            }
        }
    }
    list.into_iter()
        .map(|(names, sentence)| format!("{}: {sentence}", names.join(", ")))
        .collect()
}

fn spoilers(study: &Study, e: &Expected) -> Vec<String> {
    let mut list = Vec::new();
    if e.clipped_samples > 0 {
        list.push(format!(
            "a sensor stands at its limit in {} of this manoeuvre; delta-V is a lower bound and the speed before \
             the impact may be off by more than shown.",
            match e.clipped_samples {
                1 => "one sample".to_owned(),
                n => format!("{n} samples"),
            }
        ));
    }
    let outside: Vec<String> = e
        .rows
        .iter()
        .filter(|r| !r.inside)
        .map(|r| format!("{} s ({} m)", fixed(r.t_s, 0), digits(r.off_m)))
        .collect();
    if !outside.is_empty() {
        list.push(format!(
            "even without any sensor error the result lies outside its own ellipse at {}: what is left there is \
             the method's (wheel slip, road, time steps), not the sensor's.",
            outside.join(", ")
        ));
    }
    for wheels in [true, false] {
        let aid = |road: bool| e.aids.iter().find(|a| (a.wheels, a.road) == (wheels, road));
        if let Some((with, without)) = aid(true).zip(aid(false))
            && with.semi_major_m > HARM * without.semi_major_m
        {
            list.push(format!(
                "{} wheel speeds the road limits widen the first ellipse, from {} to {} m{}.",
                if wheels { "with" } else { "without" },
                digits(without.semi_major_m),
                digits(with.semi_major_m),
                if study.settings.model == Model::NineState {
                    ": this filter considers the accelerometers' bias and does not estimate it, and can lose by a \
                     measurement"
                } else {
                    ""
                }
            ));
        }
    }
    if let Some(i) = &e.impact {
        let outside = i.outside(two_sided_quantile(study.settings.confidence));
        for (bad, what, off) in [
            (outside[0], "the speed at impact", i.off_speed_mps),
            (outside[1], "delta-V", i.off_delta_v_mps),
        ] {
            if bad {
                list.push(format!(
                    "even without any sensor error {what} is {} km/h off, outside its own bounds: where this pulse \
                     begins and ends is the method's doubt.",
                    digits(off.abs() * KMH)
                ));
            }
        }
    }
    if study.has_impact && e.impact.is_none() {
        list.push("the impact of this manoeuvre is not found.".to_owned());
    }
    list
}

fn warnings(out: &mut String, study: &Study) {
    for sentence in caveats(study) {
        let _ = writeln!(out, "\nNote. {sentence}");
    }
}

fn trials(out: &mut String, study: &Study) {
    use super::trial::share_within;
    let confidence = study.settings.confidence;
    let q = two_sided_quantile(confidence);
    for trial in &study.trials {
        let _ = writeln!(
            out,
            "\n{}: {} sets of sensors drawn from the sheet, share within the predicted bounds",
            trial.name, trial.sets
        );
        let _ = writeln!(
            out,
            "{:>20}  {:>8}  {:>8}  {:>8}  {:>14}",
            "t (s)", "position", "speed", "heading", "ellipse factor"
        );
        for row in &trial.rows {
            let [position, speed, heading] = row.coverage(confidence);
            let _ = writeln!(
                out,
                "{:>20}  {:>8}  {:>8}  {:>8}  {:>14}",
                fixed(row.t_s, 0),
                fixed(position, 2),
                fixed(speed, 2),
                fixed(heading, 2),
                fixed(row.spread(confidence), 2)
            );
        }
        if !trial.impact_speed.is_empty() {
            let _ = writeln!(
                out,
                "impact speed {}, delta-V {}",
                fixed(share_within(&trial.impact_speed, q), 2),
                fixed(share_within(&trial.delta_v, q), 2)
            );
        }
    }
}

fn slip_table(out: &mut String) {
    out.push_str(
        "\nThe figures of S03, computed again (the reasons are in design.html and design.json)\n",
    );
    for f in slips::figures() {
        let found = match (f.source, f.verdict) {
            (None, _) => "none given".to_owned(),
            (Some(x), Verdict::Slip) => format!("{} is a slip", source_figure(x, f.unit)),
            (Some(x), _) => format!("{} agrees", source_figure(x, f.unit)),
        };
        let _ = writeln!(
            out,
            "{:<6}{}\n      {}; the source: {found}",
            f.section,
            f.what,
            figure(f.correct, f.decimals, f.unit)
        );
    }
}

/// A figure with its unit: three digits apart above ten thousand, true superscripts left to the page.
pub(super) fn figure(x: f64, decimals: usize, unit: &str) -> String {
    let number = if decimals == 0 && x >= 1000.0 {
        count(schema::num::u64_of(schema::num::round_usize(x)))
    } else {
        fixed(x, decimals)
    };
    format!("{number} {unit}")
}

/// The source's figure as it prints it, with its unit.
pub(super) fn source_figure(x: f64, unit: &str) -> String {
    let decimals = (0..2)
        .find(|d| {
            let unit = 10.0_f64.powi(*d);
            ((x * unit).round() / unit - x).abs() < 1e-9
        })
        .unwrap_or(2);
    figure(x, usize::try_from(decimals).unwrap_or(0), unit)
}
