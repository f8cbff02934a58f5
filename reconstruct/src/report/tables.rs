//! The tables of the page: figures, models, health of the record.

use std::fmt::Write as _;

use crate::export::fixed::{fixed, hex, utc};
use crate::findings::{Figure, Reconstruction};
use crate::report::case::{Case, Signature};
use crate::report::number::{self, KMH, count};
use crate::report::summary::{clock_names, trigger_name, trigger_unit};
use crate::report::svg::{escape, signed};

/// One row: a heading and cells, each escaped here.
fn row(out: &mut String, heading: &str, cells: &[String]) {
    let _ = write!(out, "<tr><th scope=\"row\">{}</th>", escape(heading));
    for cell in cells {
        let _ = write!(out, "<td>{}</td>", escape(cell));
    }
    out.push_str("</tr>\n");
}

/// A table in a frame that scrolls by itself on a narrow screen.
fn table(class: &str, head: &[&str], rows: &str) -> String {
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

/// Identity: which file, which car, which programs.
#[must_use]
pub fn identity(case: &Case<'_>, software: &str) -> String {
    let header = &case.record.header;
    let vehicle = match (header.vehicle.name.as_str(), header.vehicle.vin.as_str()) {
        ("", "") => "not stated".to_owned(),
        ("", vin) => format!("VIN {vin}"),
        (name, "") => name.to_owned(),
        (name, vin) => format!("{name}, VIN {vin}"),
    };
    let device = if header.device_id.is_empty() {
        "not stated"
    } else {
        &header.device_id
    };
    let mut rows = String::new();
    row(
        &mut rows,
        "Record",
        &[format!(
            "{} ({} bytes), record number {}",
            case.file,
            count(schema::num::u64_of(case.bytes)),
            header.number
        )],
    );
    row(&mut rows, "Vehicle", &[vehicle]);
    row(&mut rows, "Recording device", &[device.to_owned()]);
    row(&mut rows, "Origin", &[case.origin()]);
    row(&mut rows, "Time of the trigger", &[time_of(case)]);
    row(&mut rows, "Recorded by", &[header.software.clone()]);
    row(&mut rows, "Reconstructed by", &[software.to_owned()]);
    row(&mut rows, "SHA-256 of the file", &[hex(&case.file_sha256)]);
    table("facts", &[], &rows)
}

fn time_of(case: &Case<'_>) -> String {
    let text = utc(case.utc_ns(case.zero_ns()));
    let (source, _) = clock_names(case);
    let uncertainty = case.record.header.clock.uncertainty_ns.map_or_else(
        || "uncertainty not known".to_owned(),
        |ns| {
            format!(
                "\u{b1} {} s (one sigma)",
                fixed(schema::num::real_u64(ns) * 1e-9, 3)
            )
        },
    );
    format!("{text}, clock: {}, {uncertainty}", source.replace('-', " "))
}

/// Triggers in order of time.
#[must_use]
pub fn triggers(case: &Case<'_>) -> String {
    let mut rows = String::new();
    for t in &case.record.triggers {
        let unit = trigger_unit(t.kind).unwrap_or("").replace("^2", "\u{b2}");
        let reached = match t.kind {
            schema::parts::TriggerKind::Manual => "by hand".to_owned(),
            _ => format!(
                "{} {unit} (threshold {} {unit})",
                signed(t.value, 2),
                signed(t.threshold, 2)
            ),
        };
        let source = if t.source.is_empty() {
            "-".to_owned()
        } else {
            t.source.clone()
        };
        let when = format!("{} s", signed(case.seconds(t.monotonic_ns), 3));
        row(&mut rows, trigger_name(t.kind), &[when, reached, source]);
    }
    if rows.is_empty() {
        row(
            &mut rows,
            "none readable",
            &["-".to_owned(), "-".to_owned(), "-".to_owned()],
        );
    }
    table(
        "triggers",
        &["Trigger", "Time", "Reached", "Axis or signal"],
        &rows,
    )
}

/// Health of the record: what arrived, what did not, what the clocks did.
#[must_use]
pub fn health(r: &Reconstruction, case: &Case<'_>) -> String {
    let h = &case.record.health;
    let completion = &case.record.completion;
    let mut rows = String::new();
    let complete = match (case.complete(), completion.reasons.as_slice()) {
        (true, _) => "yes".to_owned(),
        (false, []) => "no".to_owned(),
        (false, reasons) => format!("no: {}", reasons.join("; ")),
    };
    row(&mut rows, "Complete", &[complete]);
    row(
        &mut rows,
        "Frames received",
        &[format!(
            "{}; dropped {}; error frames {}",
            count(h.frames_seen),
            count(h.frames_dropped),
            count(h.error_frames)
        )],
    );
    row(
        &mut rows,
        "Frames not usable",
        &[format!(
            "malformed {}; too late {}; values out of the stated range {}",
            count(h.malformed),
            count(h.late_frames),
            count(h.out_of_range)
        )],
    );
    row(
        &mut rows,
        "Samples in the window",
        &[format!(
            "{}; incomplete {}; clipped {}",
            count(schema::num::u64_of(r.states.len())),
            count(r.missing_samples),
            count(r.clipped_samples)
        )],
    );
    row(
        &mut rows,
        "Clipped bins in the record",
        &[count(schema::num::u64_of(case.record.clipping.len()))],
    );
    row(
        &mut rows,
        "Wheel values",
        &[format!(
            "{} offered; {} used; {} refused on physics, {} on their innovation; {} at or below the cut-off",
            count(r.wheels.offered),
            count(r.wheels.used),
            count(r.wheels.refused_physics),
            count(r.wheels.refused_innovation),
            count(r.wheels.below_cutoff)
        )],
    );
    row(
        &mut rows,
        "Road limits",
        &[format!(
            "applied to {} samples; active on roll {}, pitch {}, vertical speed {}",
            count(r.road.samples),
            count(r.road.roll),
            count(r.road.pitch),
            count(r.road.vertical)
        )],
    );
    for s in &h.signals {
        let lost = s.lost_by_counter.map_or_else(
            || "no counter".to_owned(),
            |n| format!("{} lost by its counter", count(n)),
        );
        let ms = |ns: u64| fixed(schema::num::real_u64(ns) * 1e-6, 2);
        row(
            &mut rows,
            &format!("Signal {}", s.signal),
            &[format!(
                "{} frames, one each {} ms, jitter {} ms, {lost}",
                count(s.frames),
                ms(s.period_ns),
                ms(s.jitter_ns)
            )],
        );
    }
    const LISTED: usize = 12;
    for g in h.gaps.iter().take(LISTED) {
        row(
            &mut rows,
            "Gap",
            &[format!(
                "{} silent from {} s to {} s",
                g.signal,
                signed(case.seconds(g.from_ns), 2),
                signed(case.seconds(g.to_ns), 2)
            )],
        );
    }
    if h.gaps.len() > LISTED {
        row(
            &mut rows,
            "Further gaps",
            &[count(schema::num::u64_of(h.gaps.len() - LISTED))],
        );
    }
    for step in h.clock_steps.iter().take(LISTED) {
        row(
            &mut rows,
            "Clock step",
            &[format!(
                "{} ms at {} s",
                signed(schema::num::real_i64(step.step_ns) * 1e-6, 1),
                signed(case.seconds(step.monotonic_ns), 2)
            )],
        );
    }
    for note in h.notes.iter().take(LISTED) {
        row(&mut rows, "Note", &[note.clone()]);
    }
    table("facts", &[], &rows)
}

/// What ties the report to the bytes it was made from.
#[must_use]
pub fn seal(case: &Case<'_>) -> String {
    let mut rows = String::new();
    let status = match case.signature {
        Signature::Broken => "broken",
        Signature::Unsigned => "whole, unsigned: identity unproven",
        Signature::Unchecked => "whole, signature not checked",
    };
    row(&mut rows, "Seal", &[status.to_owned()]);
    row(&mut rows, "SHA-256 of the file", &[hex(&case.file_sha256)]);
    row(
        &mut rows,
        "Digest in the seal",
        &[case
            .seal_sha256
            .map_or_else(|| "not readable".to_owned(), |d| hex(&d))],
    );
    row(
        &mut rows,
        "Configuration (SHA-256)",
        &[hex(&case.record.header.config_sha256)],
    );
    if let schema::header::Origin::Replay { logs } = &case.record.header.origin {
        for log in logs {
            row(
                &mut rows,
                "Replayed log",
                &[format!(
                    "{} ({} bytes), SHA-256 {}",
                    log.name,
                    count(log.bytes),
                    hex(&log.sha256)
                )],
            );
        }
    }
    table("facts", &[], &rows)
}
