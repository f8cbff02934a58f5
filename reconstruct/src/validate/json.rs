//! `validate.json`.
//!
//! - `format`: `svartboks-validation/1`; `software`; `settings` (classes, seeds, models, fault seeds, folders);
//! - `definitions`: one sentence a measure, and of the intervals;
//! - `models`: one entry a model: `model`, `bars` (`item`, `what`, `measured`, `bar`, `verdict`, `firm`), `found` (by group: `crashes`,
//!   `scored`, `impacts`, `impacts_found`, `false_impacts`, `rest_found`), `width_over_ideal`, and `rows`: `group` (class, or
//!   `all`), `measure`, `unit`, `at` (`-30 s` to `0 s`, `impact 1`), `n`, `median`, `p90`, `p95`, `rms`, `bias`, `coverage`
//!   (`level`, `hits`, `of`, `share`) and `nees_per_degree`;
//! - `faults`: `fault`, `about`, `key_words`, `model`, `runs`, `scored`, `named`, `named_without_fault`, `worst`, `rows`;
//! - `recordings`: one entry a window and model; `unused` and `not_scored`: `name` and `reason`.
//!
//! A figure is `{"value", "low", "high"}`, the ends those of its 95 % interval; `null` where it cannot be told.

use serde_json::{Value, json};

use crate::report::summary;
use crate::validate::fault_runs::FaultTables;
use crate::validate::fixes::{BACK_S, Window};
use crate::validate::honesty::worst;
use crate::validate::measure::Measure;
use crate::validate::statistics::{Estimate, Share};
use crate::validate::tables::{LEVELS, Row};
use crate::validate::{Found, Validation};

/// Name and version of the format.
pub const FORMAT: &str = "svartboks-validation/1";

/// The whole file.
#[must_use]
pub fn json(v: &Validation) -> Value {
    let models: Vec<Value> = v
        .set
        .models
        .iter()
        .map(|tables| {
            let bars: Vec<Value> = v
                .bars(tables)
                .into_iter()
                .map(|b| {
                    json!({ "item": b.item, "what": b.what, "measured": b.measured, "bar": b.bar, "verdict": b.verdict(), "firm": b.firm })
                })
                .collect();
            json!({
                "model": tables.model,
                "bars": bars,
                "found": tables.found.iter().map(found).collect::<Vec<_>>(),
                "width_over_ideal": estimate(tables.width),
                "rows": tables.rows.iter().map(row).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "format": FORMAT,
        "software": summary::software(),
        "settings": {
            "classes": v.settings.classes,
            "seeds": v.settings.seeds,
            "models": v.settings.models,
            "fault_seeds": v.settings.fault_seeds,
            "folders": v.settings.folders,
        },
        "definitions": definitions(),
        "models": models,
        "faults": v.faults.iter().map(fault).collect::<Vec<_>>(),
        "recordings": v.windows.iter().map(window).collect::<Vec<_>>(),
        "unused": v.unused.iter().map(|u| json!({ "name": u.name, "reason": u.reason })).collect::<Vec<_>>(),
        "not_scored": v.set.failures.iter().map(|f| {
            json!({ "name": f.crash, "model": f.model, "reason": f.reason })
        }).collect::<Vec<_>>(),
    })
}

/// What each measure is.
#[must_use]
pub fn definition(measure: Measure) -> &'static str {
    match measure {
        Measure::Position => {
            "horizontal distance of the reconstructed from the true place of the IMU at the same instant, relative to the place and heading at the record's end; NEES by the 2 x 2 covariance, n = 2"
        }
        Measure::PositionShare => {
            "the same distance over the metres truly driven from that instant to the record's end, where these are at least 10 m"
        }
        Measure::Speed => "forward speed less the true one, body axis x",
        Measure::Heading => "heading less the true one, wrapped to half a turn",
        Measure::Axis => "long half axis of the claimed 95 % ellipse (a width, not an error)",
        Measure::Onset => "onset of the impact less the true one",
        Measure::ImpactSpeed => {
            "forward speed at the onset found less the true forward speed at the true onset"
        }
        Measure::ImpactSpeedShare => "the same over the true speed",
        Measure::ImpactHeading => "heading at the onset less the true one, wrapped",
        Measure::Longitudinal => {
            "change of velocity of the centre of gravity over the pulse, body axis x at the onset, less the true one"
        }
        Measure::Lateral => "the same along body axis y, positive to the right",
        Measure::Resultant => "the same, length of the horizontal vector",
        Measure::Pdof => "principal direction of force less the true one, wrapped",
        Measure::LongitudinalPooled => {
            "longitudinal error over the root mean square of the group's true resultants: the rms is rms(error) / rms(true resultant), as published studies of recorders pool them"
        }
        Measure::LateralPooled => "lateral error over the same",
        Measure::LongitudinalShare => {
            "longitudinal error over the true resultant of the same crash: the rms is that of the ratios, in which slight impacts weigh as much as heavy ones"
        }
        Measure::LateralShare => "lateral error over the true resultant of the same crash",
        Measure::LongitudinalOwn => {
            "longitudinal error over the root mean square of the group's true longitudinal components"
        }
    }
}

fn definitions() -> Value {
    let mut out = serde_json::Map::new();
    for measure in Measure::MOMENT.into_iter().chain(Measure::IMPACT) {
        out.insert(measure.name().to_owned(), json!(definition(measure)));
    }
    for (name, text) in GENERAL {
        out.insert(name.to_owned(), json!(text));
    }
    Value::Object(out)
}

/// Definitions that are of no one measure.
pub const GENERAL: [(&str, &str); 6] = [
    (
        "at",
        "seconds before the onset of the first true impact (before rest without one); -30 s is the record's first sample, some hundredths later; 0 s the last sample that ends before the onset",
    ),
    (
        "quantiles",
        "of the absolute error; the interval is that of order statistics, free of any distribution",
    ),
    (
        "rms and bias",
        "root of the mean squared error and mean signed error, intervals from the standard error",
    ),
    (
        "coverage",
        "share of crashes in which the truth lies within the bounds claimed at that level: the ellipse of that instant for a position, two-sided bounds for a scalar, the open side included where sensors were clipped; Wilson interval",
    ),
    (
        "nees_per_degree",
        "mean squared error in units of the claimed covariance over its degrees of freedom: 1 is honest, more is too sure, less is too wide; one-sided claims left out",
    ),
    (
        "named",
        "share of runs with a sentence in the result's limits that has one of the fault's key words; beside it the share of sound runs with such a sentence",
    ),
];

fn estimate(e: Option<Estimate>) -> Value {
    e.map_or(
        Value::Null,
        |e| json!({ "value": number(e.value), "low": number(e.low), "high": number(e.high) }),
    )
}

/// Eight significant digits: more say nothing, and fewer differ less between machines.
fn number(x: f64) -> Value {
    if x.is_finite() {
        format!("{x:.7e}")
            .parse::<f64>()
            .map_or(Value::Null, |x| json!(x))
    } else {
        Value::Null
    }
}

fn share(s: Share) -> Value {
    json!({ "hits": s.hits, "of": s.of, "share": estimate(s.estimate()) })
}

fn coverage(shares: Option<[Share; 4]>) -> Value {
    shares.map_or(Value::Null, |shares| {
        shares
            .into_iter()
            .zip(LEVELS)
            .map(|(s, level)| {
                let mut value = json!({ "level": level });
                if let (Some(own), Some(more)) = (value.as_object_mut(), share(s).as_object_mut()) {
                    own.append(more);
                }
                value
            })
            .collect()
    })
}

fn found(f: &Found) -> Value {
    json!({
        "group": f.group, "crashes": f.scored.of, "scored": f.scored.hits, "impacts": f.impacts.of,
        "impacts_found": f.impacts.hits, "false_impacts": f.false_impacts, "rest_found": f.rest.hits,
    })
}

fn row(r: &Row) -> Value {
    let f = &r.figures;
    let [median, p90, p95] = f.quantiles.map(|q| estimate(Some(q)));
    json!({
        "group": r.group, "measure": r.measure.name(), "unit": r.measure.unit(), "at": r.when.name(), "n": f.n,
        "median": median, "p90": p90, "p95": p95, "rms": estimate(Some(f.rms)), "bias": estimate(f.bias),
        "coverage": coverage(f.coverage), "nees_per_degree": estimate(f.nees),
    })
}

fn fault(f: &FaultTables) -> Value {
    json!({
        "fault": f.fault.name(), "about": f.fault.about(), "key_words": f.fault.key_words(), "model": f.model,
        "runs": f.found.scored.of, "scored": f.found.scored.hits, "named": share(f.named),
        "named_without_fault": share(f.named_without),
        "worst": worst(&f.rows).map(|(m, w, e)| json!({ "measure": m.name(), "at": w.name(), "inside_95": estimate(Some(e)) })),
        "rows": f.rows.iter().map(row).collect::<Vec<_>>(),
    })
}

fn window(w: &Window) -> Value {
    let optional = |x: Option<f64>| x.map_or(Value::Null, number);
    let back: Vec<Value> = BACK_S
        .iter()
        .zip(w.back_percent)
        .map(|(s, x)| json!({ "before_end_s": s, "percent_of_distance": optional(x) }))
        .collect();
    json!({
        "name": w.name, "model": w.model, "rest_found": w.rest_found, "frame_of_truth_is_own": w.same_frame,
        "clock": w.clock, "distance_m": number(w.distance_m), "fixes": w.fixes, "start_error_m": optional(w.start_m),
        "start_percent_of_distance": optional(w.start_percent), "back": back, "coverage": coverage(w.coverage),
        "coverage_beyond_30_m": coverage(w.coverage_far), "nees_per_degree": estimate(w.nees),
        "speed_error_mps": w.speed.map(|[median, p95]| json!({ "median": number(median), "p95": number(p95) })),
        "speed_coverage": coverage(w.speed_coverage), "limits": w.limits,
    })
}
