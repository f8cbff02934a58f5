//! `summary.json`: every figure with `_low` and `_high` beside it, null where there is none.
//!
//! A figure `speed` in `mps` is written `speed_mps`, `speed_low_mps`, `speed_high_mps`.

use schema::header::ClockSource;
use schema::parts::{Trigger, TriggerKind};
use serde_json::{Map, Value, json};

use crate::export::fixed::{hex, utc};
use crate::findings::{Braking, DeltaV, Figure, Impact, ModelAnswer, Reconstruction};
use crate::report::case::Case;
use crate::report::{map_json, number, summary_details};

/// Version of the structure of `summary.json`.
pub const SUMMARY_VERSION: &str = "1.0";

/// The whole summary.
#[must_use]
pub fn summary(r: &Reconstruction, case: &Case<'_>) -> Value {
    let triggers: Vec<Value> = case
        .record
        .triggers
        .iter()
        .map(|t| trigger(t, case))
        .collect();
    let impacts: Vec<Value> = r.impacts.iter().map(impact_with_delta_v).collect();
    let mut out = Map::new();
    out.insert("summary_version".into(), json!(SUMMARY_VERSION));
    out.insert("software".into(), json!(software()));
    out.insert("record".into(), record(case));
    out.insert("model".into(), json!(r.model));
    out.insert("confidence".into(), json!(r.confidence));
    out.insert("sound".into(), json!(sound(r, case)));
    out.insert("window".into(), window(r));
    out.insert("clock".into(), clock(case));
    out.insert(
        "trigger".into(),
        triggers.first().cloned().unwrap_or(Value::Null),
    );
    out.insert("triggers".into(), Value::Array(triggers));
    out.insert("rest".into(), rest(r));
    out.insert("fixes".into(), fixes(r));
    out.insert(
        "impact".into(),
        r.impacts
            .first()
            .map_or(Value::Null, |i| Value::Object(impact(i))),
    );
    out.insert(
        "delta_v".into(),
        r.impacts
            .first()
            .map_or(Value::Null, |i| delta_v(&i.delta_v)),
    );
    out.insert("impacts".into(), Value::Array(impacts));
    out.insert(
        "braking".into(),
        r.braking.as_ref().map_or(Value::Null, braking),
    );
    bounded(&mut out, "distance", "m", &r.distance_m);
    bounded(&mut out, "start_speed", "mps", &r.start_speed_mps);
    bounded(&mut out, "top_speed", "mps", &r.top_speed_mps);
    out.insert("top_speed_t_s".into(), finite(r.top_speed_t_s));
    out.insert(
        "models".into(),
        r.models
            .iter()
            .map(|m| (m.name.to_owned(), model(m)))
            .collect(),
    );
    out.insert("comparisons".into(), comparisons(r));
    summary_details::insert(&mut out, r);
    out.insert("limits".into(), json!(r.limits));
    out.insert(
        "map".into(),
        r.map
            .as_ref()
            .map_or(Value::Null, |m| map_json::placing(m, r.confidence)),
    );
    out.insert("road".into(), road(r));
    out.insert("wheels".into(), wheels(r));
    out.insert("missing_samples".into(), json!(r.missing_samples));
    out.insert("clipped_samples".into(), json!(r.clipped_samples));
    out.insert("gaps".into(), json!(r.gaps));
    out.insert(
        "channel_frequency_class".into(),
        json!(case.record.header.channel_frequency_class),
    );
    Value::Object(out)
}

/// Name and version of this program.
#[must_use]
pub fn software() -> String {
    format!("svartboks-reconstruct {}", env!("CARGO_PKG_VERSION"))
}

/// True where the exit code is 0: a whole, complete record without gaps.
#[must_use]
pub fn sound(r: &Reconstruction, case: &Case<'_>) -> bool {
    case.complete() && !r.gaps && case.damage.is_empty()
}

/// Name of a trigger in the summary.
#[must_use]
pub fn trigger_name(kind: TriggerKind) -> &'static str {
    match kind {
        TriggerKind::Peak => "peak",
        TriggerKind::DeltaV => "delta-v",
        TriggerKind::Manual => "manual",
        TriggerKind::Can => "can",
        TriggerKind::PowerLoss => "power-loss",
    }
}

/// Unit of a trigger's value and threshold; `None` for manual and CAN triggers.
#[must_use]
pub fn trigger_unit(kind: TriggerKind) -> Option<&'static str> {
    match kind {
        TriggerKind::Peak => Some("m/s^2"),
        TriggerKind::DeltaV | TriggerKind::PowerLoss => Some("m/s"),
        TriggerKind::Manual | TriggerKind::Can => None,
    }
}

/// Source and quality of the clock: `none`, `unknown`, or `known` with an uncertainty.
#[must_use]
pub fn clock_names(case: &Case<'_>) -> (&'static str, &'static str) {
    let clock = &case.record.header.clock;
    let source = match clock.source {
        ClockSource::LogStamps => "log-stamps",
        ClockSource::SystemClock => "system-clock",
        ClockSource::Disciplined => "disciplined",
        ClockSource::Gnss => "gnss",
    };
    let quality = match (clock.source, clock.uncertainty_ns) {
        (ClockSource::Disciplined | ClockSource::Gnss, Some(_)) => "disciplined",
        (_, Some(_)) => "bounded",
        (_, None) => "unknown",
    };
    (source, quality)
}

/// A number, or null where it is not finite; nine digits behind the point suffice everywhere.
#[must_use]
pub fn finite(x: f64) -> Value {
    let rounded = (x * 1e9).round() / 1e9;
    if !x.is_finite() {
        Value::Null
    } else if rounded.is_finite() {
        json!(rounded + 0.0)
    } else {
        json!(x)
    }
}

/// Inserts `NAME_UNIT`, its bounds `NAME_low_UNIT`, `NAME_high_UNIT`, and `NAME_sd_UNIT`.
pub(crate) fn bounded(map: &mut Map<String, Value>, name: &str, unit: &str, f: &Figure) {
    map.insert(format!("{name}_{unit}"), finite(f.value));
    map.insert(format!("{name}_low_{unit}"), finite(f.low));
    map.insert(format!("{name}_high_{unit}"), finite(f.high));
    map.insert(format!("{name}_sd_{unit}"), finite(f.sd));
}

fn record(case: &Case<'_>) -> Value {
    json!({
        "file": case.file,
        "bytes": case.bytes,
        "sha256": hex(&case.file_sha256),
        "seal_sha256": case.seal_sha256.map(|d| hex(&d)),
        "complete": case.complete(),
        "reasons": case.record.completion.reasons,
        "signature": case.signature.name(),
        "damage": case.damage,
        "number": case.record.header.number,
        "device_id": case.record.header.device_id,
        "vin": case.record.header.vehicle.vin,
        "vehicle": case.record.header.vehicle.name,
        "recorded_by": case.record.header.software,
        "origin": case.record.header.origin,
    })
}

fn window(r: &Reconstruction) -> Value {
    let ends = r.states.first().zip(r.states.last());
    json!({
        "from_t_s": ends.map(|(first, _)| finite(first.t_s)),
        "to_t_s": ends.map(|(_, last)| finite(last.t_s)),
        "samples": r.states.len(),
    })
}

fn clock(case: &Case<'_>) -> Value {
    let (source, quality) = clock_names(case);
    let clock = &case.record.header.clock;
    json!({
        "source": source,
        "quality": quality,
        "uncertainty_s": clock.uncertainty_ns.map(|ns| schema::num::real_u64(ns) * 1e-9),
        "leap_second": clock.leap_second,
        "zero_utc": utc(case.utc_ns(case.zero_ns())),
    })
}

fn trigger(t: &Trigger, case: &Case<'_>) -> Value {
    json!({
        "kind": trigger_name(t.kind),
        "t_s": finite(case.seconds(t.monotonic_ns)),
        "utc": utc(case.utc_ns(t.monotonic_ns)),
        "value": finite(t.value),
        "threshold": finite(t.threshold),
        "unit": trigger_unit(t.kind),
        "source": t.source,
    })
}

/// What became of satellite fixes; null where the record has none.
fn fixes(r: &Reconstruction) -> Value {
    let Some(gnss) = &r.gnss else {
        return Value::Null;
    };
    let pair = |x: [f64; 2]| json!({"value": finite(x[0]), "sd": finite(x[1])});
    json!({
        "source": gnss.source,
        "offered": gnss.offered,
        "used": gnss.used,
        "left_out": gnss.left.iter().map(|(number, why)| json!({"number": number, "why": why.name()})).collect::<Vec<_>>(),
        "scatter": finite(gnss.scale),
        "placed": gnss.pose.is_some(),
        "why_not": gnss.why,
        "antenna_known": gnss.antenna_known,
        "delay_s": gnss.pose.as_ref().map(|p| pair(p.lag_s)),
        "clock_off_s": gnss.clock_off_s.map(pair),
        "utc_from_fixes": gnss.clock_used,
        "residuals": gnss.residuals.iter().map(|f| json!({
            "number": f.number, "t_s": finite(f.t_s), "used": f.used,
            "north_m": finite(f.place[0]), "east_m": finite(f.place[1]),
            "off_north_m": finite(f.off[0]), "off_east_m": finite(f.off[1]),
        })).collect::<Vec<_>>(),
    })
}

fn rest(r: &Reconstruction) -> Value {
    json!({
        "found": r.rest.found,
        "t_s": r.rest.t_s.map(finite),
        "duration_s": finite(r.rest.duration_s),
        "reason": r.rest.reason,
        "pose": r.rest_pose.map(|p| json!({
            "latitude_deg": p.latitude_deg, "longitude_deg": p.longitude_deg, "heading_deg": p.heading_deg,
            "sd_m": p.sd_m, "sd_deg": p.sd_deg,
        })),
    })
}

fn impact(i: &Impact) -> Map<String, Value> {
    let mut map = Map::new();
    bounded(&mut map, "t", "s", &i.t_s);
    bounded(&mut map, "speed", "mps", &i.speed_mps);
    bounded(&mut map, "heading", "deg", &i.heading_deg);
    bounded(&mut map, "north", "m", &i.north_m);
    bounded(&mut map, "east", "m", &i.east_m);
    map.insert("cov_north_east_m2".into(), finite(i.cov_north_east_m2));
    map
}

fn impact_with_delta_v(i: &Impact) -> Value {
    let mut map = impact(i);
    map.insert("delta_v".into(), delta_v(&i.delta_v));
    Value::Object(map)
}

fn delta_v(d: &DeltaV) -> Value {
    let mut map = Map::new();
    bounded(&mut map, "longitudinal", "mps", &d.longitudinal_mps);
    bounded(&mut map, "lateral", "mps", &d.lateral_mps);
    bounded(&mut map, "resultant", "mps", &d.resultant_mps);
    map.insert("sd_mps".into(), finite(d.resultant_mps.sd));
    bounded(&mut map, "pdof", "deg", &d.pdof_deg);
    let (words, hour) = number::direction(d.pdof_deg.value);
    map.insert("direction".into(), json!(words));
    map.insert("clock_hour".into(), json!(hour));
    bounded(&mut map, "duration", "s", &d.duration_s);
    map.insert("end_t_s".into(), finite(d.end_t_s));
    map.insert("lower_bound".into(), json!(d.lower_bound));
    map.insert("point".into(), json!(d.point));
    summary_details::pulse(&mut map, d);
    Value::Object(map)
}

fn braking(b: &Braking) -> Value {
    let mut map = Map::new();
    bounded(&mut map, "onset_t", "s", &b.onset_t_s);
    bounded(&mut map, "mean", "mps2", &b.mean_mps2);
    bounded(&mut map, "peak", "mps2", &b.peak_mps2);
    Value::Object(map)
}

fn model(m: &ModelAnswer) -> Value {
    let mut start = Map::new();
    bounded(&mut start, "north", "m", &m.start_north_m);
    bounded(&mut start, "east", "m", &m.start_east_m);
    let mut map = Map::new();
    map.insert("start".into(), Value::Object(start));
    bounded(
        &mut map,
        "impact_speed",
        "mps",
        m.impact_speed_mps.as_ref().unwrap_or(&Figure::NONE),
    );
    let impact = m.impact.as_ref().map(|i| {
        let mut map = Map::new();
        bounded(&mut map, "north", "m", &i.north_m);
        bounded(&mut map, "east", "m", &i.east_m);
        bounded(&mut map, "heading", "deg", &i.heading_deg);
        bounded(&mut map, "delta_v_longitudinal", "mps", &i.longitudinal_mps);
        bounded(&mut map, "delta_v_lateral", "mps", &i.lateral_mps);
        Value::Object(map)
    });
    map.insert("impact".into(), impact.unwrap_or(Value::Null));
    Value::Object(map)
}

/// The tests of the models' differences.
fn comparisons(r: &Reconstruction) -> Value {
    r.comparisons
        .iter()
        .map(|c| {
            json!({
                "quantity": c.quantity,
                "models": c.models,
                "difference": finite(c.difference),
                "unit": c.unit,
                "chi_square": finite(c.chi_square),
                "degrees": c.degrees,
                "limit": finite(c.limit),
                "beyond": c.beyond(),
            })
        })
        .collect()
}

fn road(r: &Reconstruction) -> Value {
    json!({
        "samples": r.road.samples,
        "roll_limited": r.road.roll,
        "pitch_limited": r.road.pitch,
        "vertical_limited": r.road.vertical,
    })
}

fn wheels(r: &Reconstruction) -> Value {
    json!({
        "offered": r.wheels.offered,
        "used": r.wheels.used,
        "refused_physics": r.wheels.refused_physics,
        "refused_innovation": r.wheels.refused_innovation,
        "below_cutoff": r.wheels.below_cutoff,
    })
}

#[cfg(test)]
mod tests {
    use super::summary;
    use crate::report::sample_case;

    #[test]
    fn names_of_the_interface_are_there_and_nothing_is_infinite() {
        let (record, damage) = (sample_case::record(), Vec::new());
        let r = sample_case::reconstruction();
        let s = summary(&r, &sample_case::case(&record, &damage));
        for path in [
            "/record/file",
            "/record/sha256",
            "/record/complete",
            "/record/signature",
            "/trigger/kind",
            "/rest/found",
            "/rest/t_s",
            "/impact/t_s",
            "/impact/speed_mps",
            "/impact/speed_low_mps",
            "/impact/speed_high_mps",
            "/impact/heading_deg",
            "/delta_v/longitudinal_mps",
            "/delta_v/lateral_mps",
            "/delta_v/resultant_mps",
            "/delta_v/pdof_deg",
            "/delta_v/duration_s",
            "/delta_v/sd_mps",
            "/delta_v/lower_bound",
            "/braking/onset_t_s",
            "/braking/mean_mps2",
            "/braking/peak_mps2",
            "/distance_m",
            "/distance_low_m",
            "/models/nine-state/start/north_m",
            "/models/dead-reckoning/impact_speed_mps",
            "/limits",
            "/clock/source",
            "/clock/quality",
            "/clock/uncertainty_s",
        ] {
            assert!(s.pointer(path).is_some(), "{path}");
        }
        assert!(
            s.pointer("/models/dead-reckoning/start/north_low_m")
                .unwrap()
                .is_null()
        );
        assert!(s["channel_frequency_class"].is_null());
    }
}
