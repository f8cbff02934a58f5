//! The findings as sentences: every number with its bounds and the confidence they hold at.

use crate::export::fixed::fixed;
use crate::findings::{DeltaV, Figure, Impact, Reconstruction};
use crate::report::case::Case;
use crate::report::number::{self, KMH};

/// The summary in words, one paragraph each.
#[must_use]
pub fn sentences(r: &Reconstruction, case: &Case<'_>) -> Vec<String> {
    let mut out = vec![window(r, case)];
    if let Some(impact) = r.impacts.first() {
        out.push(impact_speed(r, impact));
        out.push(delta_v(r, &impact.delta_v));
    } else {
        out.push("No impact was found in this record.".to_owned());
    }
    out.push(braking(r));
    for (i, later) in r.impacts.iter().enumerate().skip(1) {
        out.push(format!(
            "Impact {} followed {} s after the first, at {}{}. {}",
            i + 1,
            fixed(
                later.t_s.value - r.impacts.first().map_or(0.0, |f| f.t_s.value),
                2
            ),
            number::speed(&later.speed_mps),
            tail(r, number::speed_bounds(&later.speed_mps)),
            delta_v(r, &later.delta_v),
        ));
    }
    out.push(course(r));
    out.extend(roll_over(r));
    out.extend(way_to_rest(r));
    out
}

/// A time relative to the first trigger: `2.13 s before the trigger`.
#[must_use]
pub fn when(t_s: f64, digits: usize) -> String {
    let text = fixed(t_s.abs(), digits);
    if text.chars().all(|c| c == '0' || c == '.') {
        "at the trigger".to_owned()
    } else if t_s < 0.0 {
        format!("{text} s before the trigger")
    } else {
        format!("{text} s after the trigger")
    }
}

/// `; with 95 % confidence between ...`, or that there are no bounds.
fn tail(r: &Reconstruction, bounds: Option<String>) -> String {
    match bounds {
        Some(text) => format!(", with {} confidence {text}", number::percent(r.confidence)),
        None => ", for which this model gives no bounds".to_owned(),
    }
}

fn time_digits(f: &Figure) -> usize {
    number::decimals(0.5 * (f.high - f.low), 1, 3)
}

fn window(r: &Reconstruction, case: &Case<'_>) -> String {
    let (Some(first), Some(last)) = (r.states.first(), r.states.last()) else {
        return "The record holds no samples to reconstruct.".to_owned();
    };
    let kind = match case.record.triggers.first().map(|t| t.kind) {
        Some(schema::parts::TriggerKind::Manual) => "the manual trigger",
        Some(schema::parts::TriggerKind::PowerLoss) => "the loss of power",
        Some(_) => "the first trigger",
        None => "the first sample (no trigger could be read)",
    };
    format!(
        "The reconstruction covers {} s, from {} s before {kind} to {} s after it. All times below count from there.",
        fixed(last.t_s - first.t_s, 1),
        fixed(-first.t_s, 1),
        fixed(last.t_s, 1),
    )
}

fn impact_speed(r: &Reconstruction, impact: &Impact) -> String {
    format!(
        "At the onset of the {}impact, {}, the car was moving at {}{}.",
        if r.impacts.len() > 1 { "first " } else { "" },
        when(impact.t_s.value, time_digits(&impact.t_s).max(2)),
        number::speed(&impact.speed_mps),
        tail(r, number::speed_bounds(&impact.speed_mps)),
    )
}

/// Delta-V with its direction; says *at least* where sensors were clipped.
#[must_use]
pub fn delta_v(r: &Reconstruction, dv: &DeltaV) -> String {
    let (words, hour) = number::direction(dv.pdof_deg.value);
    let point = if dv.point == "cg" {
        "centre of gravity"
    } else {
        "sensor's place"
    };
    let mut text = format!(
        "The impact changed the velocity of the car's {point} by {}{} within {} s{}. The force came {words} ({hour} o'clock{}).",
        if dv.lower_bound { "at least " } else { "" },
        number::speed(&dv.resultant_mps),
        number::shown(&dv.duration_s, 1.0, 2).value,
        tail(r, number::speed_bounds(&dv.resultant_mps)),
        match number::bounds(&dv.pdof_deg, 1.0, 0, "degrees") {
            Some(b) => format!(
                "; principal direction {} degrees, {b}",
                number::shown(&dv.pdof_deg, 1.0, 0).value
            ),
            None => String::new(),
        },
    );
    if dv.lower_bound {
        text.push_str(" The sensors were at the end of their range, so the true change is larger than what they show.");
    }
    text
}

fn braking(r: &Reconstruction) -> String {
    let Some(b) = &r.braking else {
        let before = if r.impacts.is_empty() {
            "the final stop"
        } else {
            "the impact"
        };
        return format!("No braking was found before {before}.");
    };
    let onset = number::shown(&b.onset_t_s, 1.0, 2);
    let bounds = onset.bounds.map(|_| {
        let digits = number::decimals(0.5 * (b.onset_t_s.high - b.onset_t_s.low), 0, 2);
        format!(
            "from {} to {}",
            when(b.onset_t_s.low, digits),
            when(b.onset_t_s.high, digits)
        )
    });
    format!(
        "Braking began {}{}. The mean deceleration was {} m/s\u{b2}{}; the largest (over 0.1 s) was {} m/s\u{b2}.",
        when(b.onset_t_s.value, 2),
        tail(r, bounds),
        number::shown(&b.mean_mps2, 1.0, 2).value,
        tail(r, number::bounds(&b.mean_mps2, 1.0, 2, "m/s\u{b2}")),
        number::shown(&b.peak_mps2, 1.0, 2).value,
    )
}

fn course(r: &Reconstruction) -> String {
    let mut text = format!(
        "Over the whole window the car travelled {} m{}. It entered the window at {}; its largest speed was {} km/h, {}.",
        number::shown(&r.distance_m, 1.0, 1).value,
        tail(r, number::bounds(&r.distance_m, 1.0, 1, "m")),
        number::speed(&r.start_speed_mps),
        number::shown(&r.top_speed_mps, KMH, 1).value,
        when(r.top_speed_t_s, 1),
    );
    match (r.rest.found, r.rest.t_s) {
        (true, Some(t)) => {
            text.push_str(" It came to rest ");
            text.push_str(&when(t, 1));
            text.push('.');
        }
        _ => text.push_str(" The record ends before the car is at rest."),
    }
    text
}

fn roll_over(r: &Reconstruction) -> Option<String> {
    let over = r.details.rollover.as_ref()?;
    let turned = number::shown(&over.angle_deg, 1.0, 0)
        .value
        .replace('-', "");
    let size = Figure {
        low: over.angle_deg.low.abs().min(over.angle_deg.high.abs()),
        high: over.angle_deg.low.abs().max(over.angle_deg.high.abs()),
        ..over.angle_deg
    };
    let side = match (over.axis, over.angle_deg.value > 0.0) {
        ("roll", true) => "over its right side",
        ("roll", false) => "over its left side",
        (_, true) => "backwards over its tail",
        (_, false) => "forwards over its nose",
    };
    Some(format!(
        "The car rolled {side}, from {} to {}: it turned by {turned} degrees{}, that is {} quarter turn{}{}.",
        when(over.begin_t_s.value, 1),
        when(over.end_t_s.value, 1),
        tail(r, number::bounds(&size, 1.0, 0, "degrees")),
        over.quarter_turns,
        if over.quarter_turns == 1 { "" } else { "s" },
        if over.certain {
            ""
        } else {
            "; a gyro was silent or at its limit, so whole turns may be missing"
        },
    ))
}

fn way_to_rest(r: &Reconstruction) -> Option<String> {
    let rest = r.details.final_rest.as_ref()?;
    let from = rest.from_impact.as_ref()?;
    let turn = from.rotation_deg.value;
    let size = Figure {
        value: turn.abs(),
        low: if turn < 0.0 {
            -from.rotation_deg.high
        } else {
            from.rotation_deg.low
        },
        high: if turn < 0.0 {
            -from.rotation_deg.low
        } else {
            from.rotation_deg.high
        },
        ..from.rotation_deg
    };
    Some(format!(
        "From the first impact to the rest it moved {} m along its path{} and turned by {} degrees to the {}{}.{}",
        number::shown(&from.path_m, 1.0, 1).value,
        tail(r, number::bounds(&from.path_m, 1.0, 1, "m")),
        number::shown(&size, 1.0, 1).value,
        if turn < 0.0 { "left" } else { "right" },
        tail(r, number::bounds(&size, 1.0, 1, "degrees")),
        if r.details.no_attitude {
            String::new()
        } else {
            format!(" It lies on its {}.", rest.lies_on)
        },
    ))
}

#[cfg(test)]
mod tests {
    use super::{sentences, when};
    use crate::report::sample_case;

    #[test]
    fn every_sentence_carries_bounds_and_no_machine_word() {
        let r = sample_case::reconstruction();
        let (record, damage) = (sample_case::record(), Vec::new());
        let text = sentences(&r, &sample_case::case(&record, &damage)).join(" ");
        assert!(text.contains("with 95 % confidence between"), "{text}");
        assert!(text.contains("o'clock"));
        assert!(
            !text.contains("NaN") && !text.contains("inf") && !text.contains("None"),
            "{text}"
        );
    }

    #[test]
    fn no_impact_no_braking_no_rest() {
        let mut r = sample_case::reconstruction();
        r.impacts.clear();
        r.braking = None;
        r.rest.found = false;
        let (record, damage) = (sample_case::record(), Vec::new());
        let text = sentences(&r, &sample_case::case(&record, &damage)).join(" ");
        assert!(text.contains("No impact was found"));
        assert!(text.contains("No braking was found before the final stop"));
        assert!(text.contains("ends before the car is at rest"));
        r.states.clear();
        assert!(sentences(&r, &sample_case::case(&record, &damage))[0].contains("no samples"));
    }

    #[test]
    fn times_in_words() {
        assert_eq!(when(-2.134, 2), "2.13 s before the trigger");
        assert_eq!(when(0.001, 2), "at the trigger");
        assert_eq!(when(4.25, 1), "4.3 s after the trigger");
    }
}
