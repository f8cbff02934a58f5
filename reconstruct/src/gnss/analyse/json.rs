//! The analysis for programs: SI units and radians; what is not told is `{"cannot_tell": sentence}`.

use serde_json::{Value, json};

use super::allan::Coefficient;
use super::correlated::Figure;
use super::limits::{AXES, Kind};
use super::positions::{Fitted, from_pair};
use super::receiver::{Honesty, QUANTITIES, Receiver, Summary};
use super::spread::Variance;
use super::{Analysis, source};
use crate::gnss::rows::Leg;

fn told<T>(value: &Result<T, String>, json: impl Fn(&T) -> Value) -> Value {
    match value {
        Ok(value) => json(value),
        Err(why) => json!({ "cannot_tell": why }),
    }
}

/// A number, or null where it is not finite.
fn n(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

fn figure(f: &Figure) -> Value {
    json!({
        "value": n(f.value), "se": n(f.se), "low": n(f.low), "high": n(f.high),
        "count": f.count, "effective": n(f.effective), "short": f.short,
    })
}

fn fitted(f: &Fitted) -> Value {
    json!({ "value": n(f.value), "se": n(f.se), "low": n(f.ends[0]), "high": n(f.ends[1]) })
}

fn leg(leg: Leg) -> Value {
    json!({ "equipment": leg.equipment, "drive": leg.drive, "leg": leg.leg })
}

/// The whole analysis.
#[must_use]
pub fn json(a: &Analysis) -> Value {
    json!({
        "confidence": crate::validate::statistics::INTERVAL,
        "receivers": told(&a.receivers, |list| {
            list.iter().map(|r| told(r, receiver)).collect::<Vec<_>>().into()
        }),
        "situations": told(&a.spreads, |_| json!({
            "told_by": a.spans.told_by,
            "bench": a.spans.bench,
            "notes": a.spans.notes,
            "stands": a.spans.stands.iter().map(|s| json!({
                "from_s": s.from_s, "to_s": s.to_s, "situation": s.situation.name(),
                "vibration_variance": n(s.level), "force": s.force.map(n),
            })).collect::<Vec<_>>(),
        })),
        "variance": variances(a),
        "gyro_bias": told(&a.biases, |list| json!({
            "stands": list.iter().map(|b| json!({
                "leg": leg(b.leg), "from_s": b.span_s[0], "to_s": b.span_s[1],
                "situation": b.situation.name(),
                "rate": b.rate.each_ref().map(figure),
            })).collect::<Vec<_>>(),
            "drift": a.drifts.each_ref().map(|d| d.map(|d| json!({
                "range": n(d.range), "range_se": n(d.range_se), "welch_f": n(d.f[0]),
                "dof": [n(d.f[1]), n(d.f[2])], "probability": n(d.p),
            }))),
            "source": source::BIAS.map(|b| json!({ "fixes": b.0, "rate": b.1 })),
        })),
        "positions": positions(a),
        "range": told(&a.events, |events| events.iter().map(|e| {
            let (kind, unwrapped, why) = match &e.kind {
                Kind::Wrap { unwrapped, why } => ("wrap", unwrapped.map_or(Value::Null, n), *why),
                Kind::Saturated => ("saturation", Value::Null, ""),
                Kind::Dead => ("one value only", Value::Null, ""),
            };
            json!({
                "kind": kind, "leg": leg(e.leg), "axis": AXES.get(e.axis), "line": e.line,
                "from_s": e.span_s[0], "to_s": e.span_s[1], "samples": e.samples,
                "before": n(e.values[0]), "first": n(e.values[1]), "limit": n(e.limit),
                "limit_se": e.limit_se.map_or(Value::Null, n), "unwrapped": unwrapped,
                "why_not_unwrapped": why, "confidence": e.confidence.name(),
            })
        }).collect::<Vec<_>>().into()),
        "allan": allan(a),
    })
}

fn receiver(r: &Receiver) -> Value {
    let honesty = |h: &Honesty| {
        json!({
            "nees_per_axis": figure(&h.nees), "inside_95": figure(&h.inside),
            "verdict": h.verdict(),
        })
    };
    let delay = |i: usize| {
        told(&r.delay[i], |d| {
            json!({
                "value_s": d.value_s, "se_s": n(d.se_s), "low_s": n(d.ends_s[0]),
                "high_s": n(d.ends_s[1]), "pairs": d.pairs, "short": d.short,
            })
        })
    };
    json!({
        "leg": leg(r.leg), "good_fixes": r.fixes, "paired": r.paired,
        "clock": match r.clock { super::reference::Clock::Obu => "on-board", super::reference::Clock::Gps => "GPS" },
        "delay_by_velocity": delay(0), "delay_by_position": delay(1),
        "as_stamped": summary(&r.stamped),
        "delay_taken_off": r.shifted.as_ref().map(summary),
        "stated_horizontal": told(&r.honesty[0], honesty),
        "stated_vertical": told(&r.honesty[1], honesty),
        "beyond_integrity": r.breaches.map(|[beyond, of]| json!({ "fixes": beyond, "of": of })),
    })
}

fn summary(s: &Summary) -> Value {
    let mut out = serde_json::Map::new();
    for ((name, unit), f) in QUANTITIES.iter().zip(&s.quantities) {
        let value = f.as_ref().map_or(Value::Null, |f| {
            json!({
                "unit": unit, "mean_absolute": figure(&f.mean_abs), "bias": figure(&f.bias),
                "sd": f.sd.as_ref().map(figure), "rms": figure(&f.rms), "largest": n(f.largest),
            })
        });
        out.insert(name.replace(' ', "_"), value);
    }
    if let Some([half, most]) = &s.flat {
        out.insert("horizontal_50_m".to_owned(), figure(half));
        out.insert("horizontal_95_m".to_owned(), figure(most));
    }
    Value::Object(out)
}

fn variances(a: &Analysis) -> Value {
    let one = |v: &Variance| {
        json!({
            "value": n(v.value), "low": n(v.low), "high": n(v.high), "dof": n(v.dof),
            "samples": v.samples, "windows": v.windows,
        })
    };
    told(&a.spreads, |list| {
        list.iter()
            .map(|s| {
                let three = |first: usize| {
                    s.axis
                        .as_ref()
                        .map(|v| (first..first + 3).map(|i| one(&v[i])).collect::<Vec<_>>())
                };
                json!({
                    "situation": s.situation.name(), "accelerometer": three(0), "gyro": three(3),
                    "source_accelerometer": source::variance(s.situation).map(|v| [v[0], v[1], v[2]]),
                    "source_gyro": source::variance(s.situation).map(|v| [v[3], v[4], v[5]]),
                })
            })
            .collect::<Vec<_>>()
            .into()
    })
}

fn positions(a: &Analysis) -> Value {
    let p = source::POSITIONS;
    let published = [(p[1], p[0]), (p[2], p[3]), (p[5], p[4])]
        .map(|(plus, minus)| from_pair(plus, minus, source::GRAVITY));
    told(&a.positions, |t| {
        json!({
            "gravity": t.gravity[0], "gravity_sd": t.gravity[1], "gravity_from": t.gravity_from,
            "readings": t.positions.iter().zip(p).map(|(own, source)| json!({
                "position": own.name, "spans": own.spans, "off_axis_rad": n(own.off),
                "reading": own.reading.as_ref().map(figure), "source": source,
            })).collect::<Vec<_>>(),
            "calibration": told(&t.calibration, |c| json!({
                "scale": c.scale.each_ref().map(fitted), "bias": c.bias.each_ref().map(fitted),
                "misalignment_xy_xz_yz": told(&c.misalignment, |m| {
                    m.each_ref().map(fitted).to_vec().into()
                }),
                "spans": c.spans, "spare": c.spare, "chi_square_per_spare": c.chi_square.map(n),
            })),
            "source": { "scale": published.map(|f| f[0]), "bias": published.map(|f| f[1]) },
        })
    })
}

fn allan(a: &Analysis) -> Value {
    let coefficient = |c: &Result<Coefficient, String>| {
        told(
            c,
            |c| json!({ "value": n(c.value), "low": n(c.low), "high": n(c.high) }),
        )
    };
    told(&a.allan, |allan| {
        json!({
            "situation": allan.situation.name(), "spans": allan.spans,
            "longest_s": allan.longest_s, "total_s": allan.total_s,
            "axes": AXES.iter().zip(&allan.curves).map(|(axis, c)| json!({
                "axis": axis,
                "white_noise": coefficient(&c.white),
                "bias_instability": coefficient(&c.floor),
                "random_walk": coefficient(&c.walk),
                "points": c.points.iter().map(|p| json!({
                    "tau_s": p.tau_s, "deviation": n(p.deviation), "low": n(p.band[0]),
                    "high": n(p.band[1]), "dof": n(p.dof),
                })).collect::<Vec<_>>(),
            })).collect::<Vec<_>>(),
        })
    })
}
