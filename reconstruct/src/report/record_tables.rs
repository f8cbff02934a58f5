//! The tables of the page about the record: identity, triggers, health, seal.

use schema::num;

use crate::export::fixed::{fixed, hex, utc};
use crate::findings::Reconstruction;
use crate::report::case::{Case, Signature};
use crate::report::number::count;
use crate::report::summary::{clock_names, trigger_name, trigger_unit};
use crate::report::svg::signed;
use crate::report::tables::{row, table};

/// Gaps, clock steps and notes listed one by one; the rest is counted.
const LISTED: usize = 12;

/// One row of a table of facts.
fn fact(rows: &mut String, name: &str, text: String) {
    row(rows, name, &[text]);
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
            count(num::u64_of(case.bytes)),
            header.number
        )],
    );
    row(&mut rows, "Vehicle", &[vehicle]);
    row(&mut rows, "Recording device", &[device.to_owned()]);
    row(&mut rows, "Origin", &[case.origin()]);
    row(&mut rows, "Time of the trigger", &[time_of(case)]);
    row(
        &mut rows,
        "Recorded by",
        std::slice::from_ref(&header.software),
    );
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
                fixed(num::real_u64(ns) * 1e-9, 3)
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
            schema::parts::TriggerKind::PowerLoss => format!(
                "the recording was cut at a wheel speed of {} m/s",
                fixed(t.value, 2)
            ),
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
    let mut rows = String::new();
    let complete = match (case.complete(), case.record.completion.reasons.as_slice()) {
        (true, _) => "yes".to_owned(),
        (false, []) => "no".to_owned(),
        (false, reasons) => format!("no: {}", reasons.join("; ")),
    };
    fact(&mut rows, "Complete", complete);
    counts(&mut rows, r, case);
    signals(&mut rows, case);
    events(&mut rows, case);
    table("facts", &[], &rows)
}

fn counts(rows: &mut String, r: &Reconstruction, case: &Case<'_>) {
    let h = &case.record.health;
    let text = format!(
        "{}; dropped {}; error frames {}",
        count(h.frames_seen),
        count(h.frames_dropped),
        count(h.error_frames)
    );
    fact(rows, "Frames received", text);
    let text = format!(
        "malformed {}; too late {}; values out of the stated range {}",
        count(h.malformed),
        count(h.late_frames),
        count(h.out_of_range)
    );
    fact(rows, "Frames not usable", text);
    let samples = count(num::u64_of(r.states.len()));
    let text = format!(
        "{samples}; incomplete {}; clipped {}",
        count(r.missing_samples),
        count(r.clipped_samples)
    );
    fact(rows, "Samples in the window", text);
    fact(
        rows,
        "Clipped bins in the record",
        count(num::u64_of(case.record.clipping.len())),
    );
    let w = &r.wheels;
    let text = format!(
        "{} offered; {} used; {} refused on physics, {} on their innovation; {} at or below the cut-off",
        count(w.offered),
        count(w.used),
        count(w.refused_physics),
        count(w.refused_innovation),
        count(w.below_cutoff)
    );
    fact(rows, "Wheel values", text);
    let text = format!(
        "applied to {} samples; active on roll {}, pitch {}, vertical speed {}",
        count(r.road.samples),
        count(r.road.roll),
        count(r.road.pitch),
        count(r.road.vertical)
    );
    fact(rows, "Road limits", text);
}

fn signals(rows: &mut String, case: &Case<'_>) {
    let ms = |ns: u64| fixed(num::real_u64(ns) * 1e-6, 2);
    for s in &case.record.health.signals {
        let lost = s.lost_by_counter.map_or_else(
            || "no counter".to_owned(),
            |n| format!("{} lost by its counter", count(n)),
        );
        let text = format!(
            "{} frames, one each {} ms, jitter {} ms, {lost}",
            count(s.frames),
            ms(s.period_ns),
            ms(s.jitter_ns)
        );
        fact(rows, &format!("Signal {}", s.signal), text);
    }
}

fn events(rows: &mut String, case: &Case<'_>) {
    let h = &case.record.health;
    let seconds = |ns: i64, digits: usize| signed(case.seconds(ns), digits);
    for g in h.gaps.iter().take(LISTED) {
        let text = format!(
            "{} silent from {} s to {} s",
            g.signal,
            seconds(g.from_ns, 2),
            seconds(g.to_ns, 2)
        );
        fact(rows, "Gap", text);
    }
    for step in h.clock_steps.iter().take(LISTED) {
        let by = signed(num::real_i64(step.step_ns) * 1e-6, 1);
        fact(
            rows,
            "Clock step",
            format!("{by} ms at {} s", seconds(step.monotonic_ns, 2)),
        );
    }
    for note in h.notes.iter().take(LISTED) {
        fact(rows, "Note", note.clone());
    }
    for (name, all) in [
        ("gaps", h.gaps.len()),
        ("clock steps", h.clock_steps.len()),
        ("notes", h.notes.len()),
    ] {
        if all > LISTED {
            fact(
                rows,
                &format!("Further {name}"),
                count(num::u64_of(all - LISTED)),
            );
        }
    }
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
