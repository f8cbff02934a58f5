//! The part of `summary.json` beyond the main figures: pulses, reaction window, extremes, roll-over, rest, budgets.

use serde_json::{Map, Value, json};

use crate::findings::curve::{CurvePoint, Peak, reported};
use crate::findings::details::Details;
use crate::findings::extremes::{Extreme, Extremes, SIDESLIP_MPS};
use crate::findings::final_rest::{CREEP_MPS, FinalRest};
use crate::findings::pulse_times::PulseTimes;
use crate::findings::reaction::{Reaction, Row};
use crate::findings::rollover::{RollOver, TILT_DEG};
use crate::findings::{DeltaV, Figure, Reconstruction};
use crate::report::summary::{bounded, finite};
use crate::smooth::Smoother;

/// Inserts every detail into the summary.
pub(crate) fn insert(out: &mut Map<String, Value>, r: &Reconstruction) {
    let d = &r.details;
    out.insert("reaction".into(), reaction(&d.reaction));
    let after = d.after.as_ref().map_or(Value::Null, extremes);
    let both = json!({
        "sideslip_above_mps": SIDESLIP_MPS,
        "before_impact": extremes(&d.before),
        "after_impact": after,
    });
    out.insert("extremes".into(), both);
    let over = d.rollover.as_ref().map_or(Value::Null, rollover);
    out.insert("rollover".into(), over);
    let rest = d.final_rest.as_ref().map_or(Value::Null, final_rest);
    out.insert("final_rest".into(), rest);
    out.insert("events".into(), events(r, d));
    let smoother = d.smoother.map(Smoother::name);
    out.insert("smoother".into(), json!(smoother));
    let budgets: Vec<Value> = d
        .budgets
        .iter()
        .map(|b| {
            let sources: Vec<Value> = b
                .sources
                .iter()
                .map(|(name, share)| json!({"source": name, "variance_share": finite(*share)}))
                .collect();
            json!({"figure": b.figure, "unit": b.unit, "sd": finite(b.sd), "sources": sources})
        })
        .collect();
    out.insert("error_budget".into(), Value::Array(budgets));
}

/// Adds to the object of a delta-V what goes beyond its main figures.
pub(crate) fn pulse(map: &mut Map<String, Value>, d: &DeltaV) {
    bounded(map, "north", "mps", &d.north_mps);
    bounded(map, "east", "mps", &d.east_mps);
    map.insert("cov_north_east_m2ps2".into(), finite(d.cov_north_east));
    map.insert(
        "cov_longitudinal_lateral_m2ps2".into(),
        finite(d.cov_longitudinal_lateral),
    );
    bounded(map, "azimuth", "deg", &d.azimuth_deg);
    bounded(map, "yaw_rate_change", "degps", &d.yaw_rate_change_degps);
    map.insert("clipped".into(), json!(d.clipped));
    map.insert("times".into(), d.times.iter().map(times).collect());
    let maximum = d.maximum.as_ref().map_or(Value::Null, |m| {
        json!({
            "longitudinal": peak(&m.longitudinal),
            "lateral": peak(&m.lateral),
            "resultant": peak(&m.resultant),
        })
    });
    map.insert("maximum".into(), maximum);
    map.insert(
        "curve".into(),
        reported(&d.curve).iter().map(point).collect(),
    );
}

fn times(t: &PulseTimes) -> Value {
    let mut map = Map::new();
    map.insert("rule".into(), json!(t.rule.name()));
    map.insert("words".into(), json!(t.rule.words()));
    let or_none = |f: &Option<Figure>| f.unwrap_or(Figure::NONE);
    bounded(&mut map, "begin_t", "s", &or_none(&t.begin_t_s));
    bounded(&mut map, "end_t", "s", &or_none(&t.end_t_s));
    Value::Object(map)
}

fn peak(p: &Peak) -> Value {
    let mut map = Map::new();
    bounded(&mut map, "value", "mps", &p.value_mps);
    bounded(&mut map, "after_onset", "s", &p.after_onset_s);
    Value::Object(map)
}

fn point(p: &CurvePoint) -> Value {
    let mut map = Map::new();
    map.insert("after_onset_s".into(), finite(p.after_onset_s));
    bounded(&mut map, "longitudinal", "mps", &p.longitudinal_mps);
    bounded(&mut map, "lateral", "mps", &p.lateral_mps);
    bounded(&mut map, "resultant", "mps", &p.resultant_mps);
    Value::Object(map)
}

fn reaction(reaction: &Reaction) -> Value {
    json!({
        "reference": reaction.reference.name(),
        "brake_unit": reaction.brake_unit,
        "rows": reaction.rows.iter().map(row).collect::<Vec<_>>(),
    })
}

fn row(row: &Row) -> Value {
    let mut map = Map::new();
    map.insert("before_s".into(), finite(row.before_s));
    map.insert("t_s".into(), finite(row.t_s));
    bounded(&mut map, "speed", "mps", &row.speed_mps);
    bounded(&mut map, "north", "m", &row.north_m);
    bounded(&mut map, "east", "m", &row.east_m);
    map.insert("cov_north_east_m2".into(), finite(row.cov_north_east_m2));
    bounded(&mut map, "heading", "deg", &row.heading_deg);
    bounded(&mut map, "distance", "m", &row.distance_m);
    let or_none = |f: &Option<Figure>| f.unwrap_or(Figure::NONE);
    bounded(
        &mut map,
        "accel_forward",
        "mps2",
        &or_none(&row.forward_mps2),
    );
    bounded(&mut map, "accel_right", "mps2", &or_none(&row.right_mps2));
    map.insert("brake".into(), row.brake.map_or(Value::Null, finite));
    Value::Object(map)
}

fn extremes(e: &Extremes) -> Value {
    let one = |e: &Option<Extreme>, name: &str, unit: &str| {
        e.as_ref().map_or(Value::Null, |e| {
            let mut map = Map::new();
            bounded(&mut map, name, unit, &e.value);
            map.insert("t_s".into(), finite(e.t_s));
            Value::Object(map)
        })
    };
    json!({
        "lateral": one(&e.lateral_mps2, "accel", "mps2"),
        "sideslip": one(&e.sideslip_deg, "angle", "deg"),
        "yaw_rate": one(&e.yaw_rate_degps, "rate", "degps"),
    })
}

fn rollover(over: &RollOver) -> Value {
    let mut map = Map::new();
    map.insert("axis".into(), json!(over.axis));
    bounded(&mut map, "angle", "deg", &over.angle_deg);
    bounded(&mut map, "largest", "deg", &over.largest_deg);
    map.insert("quarter_turns".into(), json!(over.quarter_turns));
    map.insert("certain".into(), json!(over.certain));
    bounded(&mut map, "begin_t", "s", &over.begin_t_s);
    bounded(&mut map, "end_t", "s", &over.end_t_s);
    map.insert("threshold_deg".into(), json!(TILT_DEG));
    Value::Object(map)
}

fn final_rest(rest: &FinalRest) -> Value {
    let mut map = Map::new();
    bounded(&mut map, "stop_t", "s", &rest.stop_t_s);
    map.insert("stop_below_mps".into(), json!(CREEP_MPS));
    map.insert("settled_t_s".into(), finite(rest.settled_t_s));
    bounded(&mut map, "duration", "s", &rest.duration_s);
    bounded(&mut map, "roll", "deg", &rest.roll_deg);
    bounded(&mut map, "pitch", "deg", &rest.pitch_deg);
    bounded(&mut map, "heading", "deg", &rest.heading_deg);
    map.insert("lies_on".into(), json!(rest.lies_on));
    let from = rest.from_impact.as_ref().map_or(Value::Null, |f| {
        let mut map = Map::new();
        bounded(&mut map, "straight", "m", &f.straight_m);
        bounded(&mut map, "path", "m", &f.path_m);
        bounded(&mut map, "rotation", "deg", &f.rotation_deg);
        bounded(&mut map, "duration", "s", &f.duration_s);
        Value::Object(map)
    });
    map.insert("from_impact".into(), from);
    Value::Object(map)
}

fn events(r: &Reconstruction, d: &Details) -> Value {
    let intervals: Vec<Value> = d
        .intervals
        .iter()
        .map(|i| {
            let mut map = Map::new();
            bounded(&mut map, "duration", "s", &i.duration_s);
            bounded(&mut map, "path", "m", &i.path_m);
            Value::Object(map)
        })
        .collect();
    json!({
        "count": r.impacts.len(),
        "within_5_s": d.multi_event,
        "intervals": intervals,
    })
}
