//! The block `map` of `summary.json`.

use serde_json::{Value, json};

use crate::export::ellipse::{Covariance, Ellipse};
use crate::export::fixed::hex;
use crate::map::place::{Answer, Placing, side};
use crate::map::search::Verdict;
use crate::report::summary::finite;
use crate::stats::two_sided_quantile;

/// What became of laying the path on the map.
pub(crate) fn placing(p: &Placing, confidence: f64) -> Value {
    let placed = p.verdict == Verdict::Placed;
    let mut answers = p.answers.iter().map(|a| answer(a, confidence));
    let fit = if placed { answers.next() } else { None };
    json!({
        "file": p.file,
        "sha256": hex(&p.sha256),
        "rest_point": {
            "latitude_deg": p.point.latitude_deg,
            "longitude_deg": p.point.longitude_deg,
            "sd_m": p.point.sd_m,
        },
        "rest_heading": p.heading.map(|[heading, sd]| json!({"heading_deg": heading, "sd_deg": sd})),
        "traffic": side(p.traffic),
        "verdict": verdict(p.verdict),
        "ambiguous": p.verdict == Verdict::Ambiguous,
        "why": p.why,
        "runs": p.runs,
        "fit": fit,
        "rivals": answers.collect::<Vec<_>>(),
    })
}

/// The word for a verdict.
pub(crate) fn verdict(v: Verdict) -> &'static str {
    match v {
        Verdict::Placed => "placed",
        Verdict::Ambiguous => "ambiguous",
        Verdict::NoFit => "no-fit",
    }
}

/// The confidence ellipse of an answer's place, in metres about the rough point.
pub(crate) fn ellipse(a: &Answer, confidence: f64) -> Ellipse {
    let p = &a.fit.covariance;
    Ellipse::new(
        [a.fit.pose.x, a.fit.pose.y],
        Covariance {
            north: p[(0, 0)],
            east: p[(1, 1)],
            cross: p[(0, 1)],
        },
        confidence,
    )
}

fn answer(a: &Answer, confidence: f64) -> Value {
    let place = ellipse(a, confidence);
    let half = two_sided_quantile(confidence) * a.pose.sd_deg;
    let p = &a.fit.covariance;
    let entry = |r: usize, c: usize| {
        let unit = |i: usize| if i == 2 { 1.0_f64.to_degrees() } else { 1.0 };
        finite(p[(r, c)] * unit(r) * unit(c))
    };
    let rows: Vec<Vec<Value>> = (0..3)
        .map(|r| (0..3).map(|c| entry(r, c)).collect())
        .collect();
    json!({
        "latitude_deg": finite(a.pose.latitude_deg),
        "longitude_deg": finite(a.pose.longitude_deg),
        "semi_major_m": finite(place.semi_major),
        "semi_minor_m": finite(place.semi_minor),
        "azimuth_deg": finite(place.azimuth.to_degrees().rem_euclid(180.0)),
        "heading_deg": finite(a.pose.heading_deg),
        "heading_low_deg": finite(a.pose.heading_deg - half),
        "heading_high_deg": finite(a.pose.heading_deg + half),
        "covariance_north_east_heading": rows,
        "probability": finite(a.probability),
        "chi_square_per_point": finite(a.fit.chi_square),
        "points": a.fit.points,
        "points_on_road": a.fit.on_road,
        "points_against_oneway": a.fit.against,
        "roads": a.roads,
    })
}
