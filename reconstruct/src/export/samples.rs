//! The record's own samples, unfiltered, in SI: as CSV, and with everything else in the record as JSON.

use schema::num;
use serde_json::{Value, json};

use crate::export::fixed::{hex, push, utc};
use crate::report::case::Case;
use crate::report::summary::finite;

/// Columns of the CSV: the bin's start, then the mean values over the bin.
pub const COLUMNS: &str = "sample,t_s,utc,bins,wheel_left_mps,wheel_right_mps,accel_x_mps2,accel_y_mps2,accel_z_mps2,rate_x_radps,rate_y_radps,rate_z_radps";

/// Every stored sample as one row (RFC 4180); missing values are empty.
#[must_use]
pub fn csv(case: &Case<'_>) -> String {
    let record = case.record;
    let mut out = String::from(COLUMNS);
    out.push_str("\r\n");
    for s in record.samples() {
        out.push_str(&s.index.to_string());
        out.push(',');
        push(&mut out, record.time_s(s.index), 6);
        out.push(',');
        out.push_str(&utc(case.utc_ns(record.monotonic_ns(s.index))));
        out.push(',');
        out.push_str(&s.span.to_string());
        for value in s.sample.fields() {
            out.push(',');
            if let Some(x) = value {
                push(&mut out, x, 6);
            }
        }
        out.push_str("\r\n");
    }
    out
}

/// The whole record as JSON: header, samples in SI, parts, triggers, completion.
#[must_use]
pub fn json(case: &Case<'_>) -> Value {
    let record = case.record;
    let samples: Vec<Value> = record
        .samples()
        .map(|s| {
            let values: Vec<Value> = s.sample.fields().into_iter().map(|v| v.map_or(Value::Null, finite)).collect();
            json!({"sample": s.index, "t_s": finite(record.time_s(s.index)), "bins": s.span, "values": values})
        })
        .collect();
    let raw: Vec<Value> = record
        .raw
        .iter()
        .map(|f| {
            json!({
                "t_s": finite(case.seconds(f.monotonic_ns)), "monotonic_ns": f.monotonic_ns,
                "interface": f.interface, "id": f.id, "flags": f.flags, "data": hex(&f.data),
            })
        })
        .collect();
    json!({
        "file": case.file,
        "sha256": hex(&case.file_sha256),
        "signature": case.signature.name(),
        "damage": case.damage,
        "header": record.header,
        "fields": ["wheel_left_mps", "wheel_right_mps", "accel_x_mps2", "accel_y_mps2", "accel_z_mps2", "rate_x_radps", "rate_y_radps", "rate_z_radps"],
        "samples": samples,
        "clipping": record.clipping,
        "raw": raw,
        "aux": record.aux,
        "gnss": record.gnss,
        "health": record.health,
        "triggers": record.triggers,
        "completion": record.completion,
        "samples_stored": num::u64_of(samples.len()),
    })
}
