//! `design.json`: every number of a study.

use serde_json::{Value, json};

use super::expect::{Aid, Expected, Impact, Row, Study};
use super::sheet::DataSheet;
use super::slips;
use super::source::Share;
use super::trial::Trial;
use crate::run::Road;
use crate::stats::two_sided_quantile;

/// A number to a millionth part; null if it is not finite.
fn number(x: f64) -> Value {
    if !x.is_finite() {
        return Value::Null;
    }
    if x == 0.0 {
        return json!(0.0);
    }
    let digits = 10.0_f64.powf(5.0 - x.abs().log10().floor());
    json!((x * digits).round() / digits)
}

/// The whole study.
#[must_use]
pub fn study(study: &Study) -> Value {
    let settings = &study.settings;
    json!({
        "software": crate::report::summary::software(),
        "manoeuvre": {
            "name": study.plan.name,
            "seed": study.plan.scenario.seed,
            "zero": if study.has_impact { "first impact" } else { "begin of the rest" },
            "distance_m": number(study.distance_m),
        },
        "model": settings.model.name(),
        "confidence": settings.confidence,
        "wheels": settings.wheels,
        "road": road(&settings.road),
        "sensors": study.expected.iter().map(|e| sensor(e, settings.confidence)).collect::<Vec<_>>(),
        "trials": study.trials.iter().map(|t| trial(t, settings.confidence)).collect::<Vec<_>>(),
        "source_figures": source_figures(),
    })
}

/// The figures of S03, computed again.
#[must_use]
pub fn source_figures() -> Value {
    let list: Vec<Value> = slips::figures()
        .iter()
        .map(|f| {
            json!({
                "section": f.section,
                "what": f.what,
                "source": f.source,
                "correct": number(f.correct),
                "unit": f.unit,
                "verdict": f.verdict.name(),
                "why": f.why,
            })
        })
        .collect();
    Value::Array(list)
}

fn road(road: &Road) -> Value {
    match road {
        Road::H1 => json!("h1"),
        Road::None => json!("none"),
        Road::File(_) => json!("file"),
    }
}

fn sensor(e: &Expected, confidence: f64) -> Value {
    let shares: Vec<Value> = e.shares.iter().map(share).collect();
    json!({
        "name": e.sheet.name,
        "typical_of": e.sheet.typical_of,
        "sheet": sheet(&e.sheet),
        "at": e.rows.iter().map(|r| row(r, confidence)).collect::<Vec<_>>(),
        "impact": e.impact.as_ref().map(|i| impact(i, confidence)),
        "clipped_samples": e.clipped_samples,
        "shares": shares,
        "aids": e.aids.iter().map(aid).collect::<Vec<_>>(),
    })
}

fn row(r: &Row, confidence: f64) -> Value {
    let q = two_sided_quantile(confidence);
    json!({
        "t_s": r.t_s,
        "semi_major_m": number(r.ellipse.semi_major),
        "semi_minor_m": number(r.ellipse.semi_minor),
        "azimuth_deg": number(r.ellipse.azimuth.to_degrees()),
        "sd_along_m": number(r.sd_along_m),
        "sd_across_m": number(r.sd_across_m),
        "sd_speed_mps": number(r.sd_speed_mps),
        "half_width_speed_mps": number(q * r.sd_speed_mps),
        "sd_heading_deg": number(r.sd_heading_rad.to_degrees()),
        "half_width_heading_deg": number(q * r.sd_heading_rad.to_degrees()),
        "faultless": {
            "off_m": number(r.off_m),
            "off_speed_mps": number(r.off_speed_mps),
            "inside": r.inside,
        },
    })
}

fn impact(i: &Impact, confidence: f64) -> Value {
    let q = two_sided_quantile(confidence);
    json!({
        "speed_mps": number(i.speed_mps),
        "sd_speed_mps": number(i.sd_speed_mps),
        "half_width_speed_mps": number(q * i.sd_speed_mps),
        "delta_v_mps": number(i.delta_v_mps),
        "sd_delta_v_mps": number(i.sd_delta_v_mps),
        "half_width_delta_v_mps": number(q * i.sd_delta_v_mps),
        "sd_pdof_deg": number(i.sd_pdof_deg),
        "lower_bound": i.lower_bound,
        "faultless": {
            "off_speed_mps": number(i.off_speed_mps),
            "off_delta_v_mps": number(i.off_delta_v_mps),
            "outside": i.outside(q).contains(&true),
        },
    })
}

fn share(s: &Share) -> Value {
    json!({
        "source": s.source.name(),
        "position": number(s.position),
        "heading": number(s.heading),
        "impact_speed": s.impact_speed.map(number),
        "delta_v": s.delta_v.map(number),
    })
}

fn aid(a: &Aid) -> Value {
    json!({
        "wheels": a.wheels,
        "road": a.road,
        "semi_major_m": number(a.semi_major_m),
        "sd_speed_mps": number(a.sd_speed_mps),
        "sd_impact_speed_mps": a.sd_impact_speed_mps.map(number),
    })
}

/// In the recorder's keys and units, so that it can be put back as a sheet file.
fn sheet(s: &DataSheet) -> Value {
    let (imu, wheels) = (&s.imu, &s.wheels);
    let three = |x: [f64; 3]| x.map(number).to_vec();
    let mut table = json!({
        "imu": {
            "mounting_sd_deg": three(imu.mounting_sd.map(f64::to_degrees)),
            "noise": {
                "accel_density": number(imu.accel_density),
                "rate_density": number(imu.rate_density.to_degrees()),
                "accel_bias": number(imu.accel_bias),
                "rate_bias": number(imu.rate_bias.to_degrees()),
                "accel_bias_jump": number(imu.accel_bias_jump),
                "rate_bias_jump": number(imu.rate_bias_jump.to_degrees()),
                "accel_scale": number(imu.accel_scale),
                "rate_scale": number(imu.rate_scale),
                "accel_vibration": number(imu.accel_vibration),
                "rate_vibration": number(imu.rate_vibration.to_degrees()),
            },
        },
        "wheels": {
            "latency_ms": number(1e3 * wheels.latency_s),
            "latency_sd_ms": number(1e3 * wheels.latency_sd_s),
            "cutoff_kmh": number(3.6 * wheels.cutoff_mps),
            "scale_sd": number(wheels.scale_sd),
            "scale_difference_sd": number(wheels.scale_difference_sd),
            "noise_kmh": number(3.6 * wheels.noise_mps),
        },
        "vehicle": {
            "imu_position_sd_m": three(s.imu_place_sd),
            "cg_position_sd_m": three(s.cg_place_sd),
        },
    });
    if let Some(range) = imu.accel_range {
        table["imu"]["accel_range_g"] = number(range / schema::units::STANDARD_GRAVITY);
    }
    if let Some(range) = imu.rate_range {
        table["imu"]["rate_range_degps"] = number(range.to_degrees());
    }
    table
}

fn trial(t: &Trial, confidence: f64) -> Value {
    use super::trial::share_within;
    let q = two_sided_quantile(confidence);
    let rows: Vec<Value> = t
        .rows
        .iter()
        .map(|r| {
            let [position, speed, heading] = r.coverage(confidence);
            json!({
                "t_s": r.t_s,
                "position": number(position),
                "speed": number(speed),
                "heading": number(heading),
                "ellipse_factor": number(r.spread(confidence)),
            })
        })
        .collect();
    json!({
        "name": t.name,
        "sets": t.sets,
        "coverage": rows,
        "impact_speed": number(share_within(&t.impact_speed, q)),
        "delta_v": number(share_within(&t.delta_v, q)),
    })
}

#[cfg(test)]
mod tests {
    use super::{number, sheet};
    use crate::design::grades::{GRADES, grade};
    use crate::design::sheet::DataSheet;

    #[test]
    fn numbers_are_rounded_and_never_not_a_number() {
        assert_eq!(number(1.234_567_89).to_string(), "1.23457");
        assert_eq!(number(-0.000_123_456_78).to_string(), "-0.000123457");
        assert!(number(f64::NAN).is_null() && number(f64::INFINITY).is_null());
    }

    /// A printed sheet is a sheet file.
    #[test]
    fn sheets_come_back() {
        for name in GRADES {
            let before = grade(name).unwrap();
            let text = sheet(&before).to_string();
            let after = DataSheet::parse(&text, "printed", name).unwrap();
            let apart = (after.imu.rate_bias / before.imu.rate_bias - 1.0).abs()
                + (after.imu.accel_density / before.imu.accel_density - 1.0).abs()
                + (after.wheels.noise_mps / before.wheels.noise_mps - 1.0).abs();
            assert!(apart < 1e-4, "{name}: {apart}");
        }
    }
}
