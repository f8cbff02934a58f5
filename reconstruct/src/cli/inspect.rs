//! `reconstruct inspect`: what a record holds, on a damaged file what can still be read.

use std::fmt::Write as _;
use std::path::PathBuf;

use reconstruct::export::fixed::{fixed, hex, utc};
use reconstruct::report::case::Case;
use reconstruct::report::number::count;
use reconstruct::report::summary::{clock_names, finite, trigger_name, trigger_unit};
use reconstruct::report::terminal::ascii;
use schema::Codes;
use schema::num;
use schema::record::GridSample;
use schema::units::STANDARD_GRAVITY;
use serde_json::{Value, json};

use crate::cli::decrypt::Identity;
use crate::cli::load::Loaded;
use crate::cli::{CliError, print, print_json, run};

/// Arguments of `inspect`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Record to show (.svb)
    record: PathBuf,
    #[command(flatten)]
    identity: Identity,
    /// Show the stored bytes beside the values
    #[arg(long)]
    hex: bool,
    /// First sample to show, seconds from the first trigger
    #[arg(long, allow_hyphen_values = true, value_name = "SECONDS", value_parser = run::seconds)]
    from: Option<f64>,
    /// Last sample to show, seconds from the first trigger
    #[arg(long, allow_hyphen_values = true, value_name = "SECONDS", value_parser = run::seconds)]
    to: Option<f64>,
    /// Show every N-th sample (default: 100, or 1 with --from or --to)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    every: Option<u64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command; gives the exit code.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    let loaded = Loaded::open(&args.record, &args.identity)?;
    let case = loaded.case();
    if args.json {
        print_json(&as_json(&case, args))?;
    } else {
        print(&as_text(&case, args))?;
    }
    Ok(loaded.exit_code())
}

/// The samples asked for, each with its stored codes.
fn chosen<'a>(case: &Case<'a>, args: &Args) -> impl Iterator<Item = (GridSample, Codes)> + use<'a> {
    let record = case.record;
    let (from, to) = (
        args.from.unwrap_or(f64::NEG_INFINITY),
        args.to.unwrap_or(f64::INFINITY),
    );
    let window = args.from.is_some() || args.to.is_some();
    let every = num::usize_of(args.every.unwrap_or(if window { 1 } else { 100 }));
    let codes = record.blocks.iter().flat_map(|b| b.samples.iter().copied());
    record
        .samples()
        .zip(codes)
        .filter(move |(s, _)| (from..=to).contains(&record.time_s(s.index)))
        .step_by(every.max(1))
}

fn as_json(case: &Case<'_>, args: &Args) -> Value {
    let record = case.record;
    let samples: Vec<Value> = chosen(case, args)
        .map(|(s, codes)| {
            let values: Vec<Value> = s.sample.fields().into_iter().map(|v| v.map_or(Value::Null, finite)).collect();
            let mut row = json!({"sample": s.index, "t_s": finite(record.time_s(s.index)), "bins": s.span, "values": values});
            if args.hex {
                row["bytes"] = json!(hex(&codes.to_bytes()));
            }
            row
        })
        .collect();
    json!({
        "file": case.file, "bytes": case.bytes, "sha256": hex(&case.file_sha256),
        "seal_sha256": case.seal_sha256.map(|d| hex(&d)),
        "signature": case.signature.name(), "damage": case.damage, "complete": case.complete(),
        "header": record.header, "completion": record.completion, "triggers": record.triggers,
        "health": record.health,
        "blocks": record.blocks.len(), "first_sample": record.first_index(), "end_sample": record.end_index(),
        "clipped_bins": record.clipping.len(), "raw_frames": record.raw.len(),
        "aux": record.aux.iter().map(|a| json!({"name": a.name, "signal": a.signal, "unit": a.unit, "values": a.values.len()})).collect::<Vec<_>>(),
        "gnss": record.gnss.as_ref().map(|g| json!({"sheet": g.sheet, "fixes": g.fixes, "sentences": g.sentences.len()})),
        "fields": ["wheel_left_mps", "wheel_right_mps", "accel_x_mps2", "accel_y_mps2", "accel_z_mps2", "rate_x_radps", "rate_y_radps", "rate_z_radps"],
        "samples": samples,
    })
}

/// A line of the listing; text out of the record is disarmed.
fn line(out: &mut String, name: &str, text: &str) {
    let _ = writeln!(out, "{name:<12}{}", ascii(text));
}

fn as_text(case: &Case<'_>, args: &Args) -> String {
    let mut out = String::new();
    header(&mut out, case);
    health(&mut out, case);
    if args.hex {
        blocks(&mut out, case);
    }
    samples(&mut out, case, args);
    out
}

fn header(out: &mut String, case: &Case<'_>) {
    let h = &case.record.header;
    line(
        out,
        "record",
        &format!(
            "{}, number {}, {} bytes",
            case.file,
            h.number,
            count(num::u64_of(case.bytes))
        ),
    );
    line(out, "sha-256", &hex(&case.file_sha256));
    line(out, "seal", case.seal_sentence());
    for damage in case.damage {
        line(out, "DAMAGE", damage);
    }
    let named = |text: &str| {
        if text.is_empty() {
            "not stated".to_owned()
        } else {
            text.to_owned()
        }
    };
    line(out, "origin", &case.origin());
    line(out, "device", &named(&h.device_id));
    line(
        out,
        "vehicle",
        &format!(
            "{}, VIN {}, track {} m",
            named(&h.vehicle.name),
            named(&h.vehicle.vin),
            fixed(h.vehicle.track_width_m, 3)
        ),
    );
    line(out, "software", &h.software);
    let (source, quality) = clock_names(case);
    let uncertainty = h.clock.uncertainty_ns.map_or_else(
        || "uncertainty not known".to_owned(),
        |ns| format!("{} s", fixed(num::real_u64(ns) * 1e-9, 6)),
    );
    line(
        out,
        "clock",
        &format!(
            "{source}, {quality}, {uncertainty}; t = 0 at {}",
            utc(case.utc_ns(case.zero_ns()))
        ),
    );
    let range = |x: Option<f64>, factor: f64, unit: &str| {
        x.map_or_else(
            || "unknown".to_owned(),
            |x| format!("{} {unit}", fixed(x * factor, 0)),
        )
    };
    line(
        out,
        "sensor",
        &format!(
            "range {} and {}",
            range(h.imu.accel_range, 1.0 / STANDARD_GRAVITY, "g"),
            range(h.imu.rate_range, 1.0_f64.to_degrees(), "deg/s")
        ),
    );
    content(out, case);
}

/// What the record holds, whether it is whole, and what froze it.
fn content(out: &mut String, case: &Case<'_>) {
    let record = case.record;
    line(
        out,
        "samples",
        &format!(
            "{} in {} blocks, t = {} to {} s, {} clipped bins, {} raw frames, {} auxiliary signals",
            count(num::u64_of(
                record.blocks.iter().map(|b| b.samples.len()).sum()
            )),
            record.blocks.len(),
            fixed(record.time_s(record.first_index()), 3),
            fixed(record.time_s(record.end_index()), 3),
            count(num::u64_of(record.clipping.len())),
            count(num::u64_of(record.raw.len())),
            record.aux.len()
        ),
    );
    if let Some(gnss) = &record.gnss {
        let placed = gnss.fixes.iter().filter(|f| f.position.is_some()).count();
        line(
            out,
            "satellites",
            &format!(
                "{} fixes, {placed} with a place, from {}; {} sentences",
                gnss.fixes.len(),
                gnss.sheet.receiver,
                gnss.sentences.len()
            ),
        );
    }
    let done = &record.completion;
    let complete = if case.complete() {
        "yes".to_owned()
    } else {
        format!("NO: {}", done.reasons.join("; "))
    };
    line(
        out,
        "complete",
        &format!(
            "{complete}; {}",
            if done.ends_at_rest {
                "ends at rest"
            } else {
                "ends moving"
            }
        ),
    );
    for t in &record.triggers {
        let unit = trigger_unit(t.kind).unwrap_or("");
        line(
            out,
            "trigger",
            &format!(
                "{} at t = {} s, value {} {unit}, threshold {} {unit} {}",
                trigger_name(t.kind),
                fixed(case.seconds(t.monotonic_ns), 4),
                fixed(t.value, 3),
                fixed(t.threshold, 3),
                t.source
            ),
        );
    }
}

fn health(out: &mut String, case: &Case<'_>) {
    let h = &case.record.health;
    line(
        out,
        "frames",
        &format!(
            "{} seen, {} dropped, {} error, {} malformed, {} late, {} out of range",
            count(h.frames_seen),
            count(h.frames_dropped),
            count(h.error_frames),
            count(h.malformed),
            count(h.late_frames),
            count(h.out_of_range)
        ),
    );
    for s in &h.signals {
        let lost = s
            .lost_by_counter
            .map_or_else(String::new, |n| format!(", {n} lost by counter"));
        let ms = |ns: u64| fixed(num::real_u64(ns) * 1e-6, 3);
        line(
            out,
            "signal",
            &format!(
                "{}: {} frames, period {} ms, jitter {} ms{lost}",
                s.signal,
                count(s.frames),
                ms(s.period_ns),
                ms(s.jitter_ns)
            ),
        );
    }
    for g in &h.gaps {
        line(
            out,
            "gap",
            &format!(
                "{}: t = {} to {} s",
                g.signal,
                fixed(case.seconds(g.from_ns), 3),
                fixed(case.seconds(g.to_ns), 3)
            ),
        );
    }
    for s in &h.clock_steps {
        line(
            out,
            "clock step",
            &format!(
                "t = {} s by {} ms",
                fixed(case.seconds(s.monotonic_ns), 3),
                fixed(num::real_i64(s.step_ns) * 1e-6, 3)
            ),
        );
    }
    for note in &h.notes {
        line(out, "note", note);
    }
}

fn blocks(out: &mut String, case: &Case<'_>) {
    out.push_str("\nblock  stamp         UTC second           rate  samples  first sample\n");
    for (i, b) in case.record.blocks.iter().enumerate() {
        let s = b.stamp;
        let _ = writeln!(
            out,
            "{i:>5}  {}  {:04}-{:02}-{:02} {:02}:{:02}:{:02}  {:>4}  {:>7}  {:>12}",
            hex(&s.to_bytes()),
            s.year,
            s.month,
            s.day,
            s.hour,
            s.minute,
            s.second,
            b.rate_hz,
            b.samples.len(),
            b.first_index
        );
    }
}

fn samples(out: &mut String, case: &Case<'_>, args: &Args) {
    let bytes = if args.hex { "  stored bytes" } else { "" };
    let _ = writeln!(
        out,
        "\n     t s  wheels km/h     accel m/s2 x,y,z               rate deg/s x,y,z          {bytes}"
    );
    for (s, codes) in chosen(case, args) {
        if s.gap_before > 0 {
            let _ = writeln!(out, "          ({} bins without a sample)", s.gap_before);
        }
        let cell = |x: Option<f64>, factor: f64, digits: usize, width: usize| {
            format!(
                "{:>width$}",
                x.map_or_else(|| "-".to_owned(), |x| fixed(x * factor, digits))
            )
        };
        let [wl, wr, ax, ay, az, wx, wy, wz] = s.sample.fields();
        let _ = write!(
            out,
            "{:>8} {} {} ",
            fixed(case.record.time_s(s.index), 3),
            cell(wl, 3.6, 2, 7),
            cell(wr, 3.6, 2, 7)
        );
        for a in [ax, ay, az] {
            let _ = write!(out, " {}", cell(a, 1.0, 3, 9));
        }
        for w in [wx, wy, wz] {
            let _ = write!(out, " {}", cell(w, 1.0_f64.to_degrees(), 3, 9));
        }
        if args.hex {
            let _ = write!(out, "   {}", hex(&codes.to_bytes()));
        }
        out.push('\n');
    }
}
