//! `funnel.geojson` (RFC 7946) where a rest pose ties the path to the earth, else `funnel.local.json` with the
//! same structure in metres east and north of the rest point.

use schema::num;
use serde_json::{Value, json};

use crate::export::ellipse::{self, Ellipse, Point, Polygon};
use crate::export::geodesy::TangentPlane;
use crate::findings::Reconstruction;
use crate::trajectory::State;

/// Name of the file this reconstruction's funnel belongs in.
#[must_use]
pub fn file_name(r: &Reconstruction) -> &'static str {
    if r.rest_pose.is_some() {
        "funnel.geojson"
    } else {
        "funnel.local.json"
    }
}

/// How points become coordinates.
struct Map {
    plane: Option<TangentPlane>,
}

impl Map {
    /// Longitude, latitude with 8 decimals (about a millimetre); or east, north in millimetres.
    fn position(&self, p: Point) -> Value {
        let ([x, y], decimals) = match &self.plane {
            Some(plane) => (plane.lon_lat(p[0], p[1]), 1e8),
            None => ([p[1], p[0]], 1e3),
        };
        json!([
            (x * decimals).round() / decimals,
            (y * decimals).round() / decimals
        ])
    }

    /// A closed ring, anticlockwise for an outer ring and clockwise for a hole (RFC 7946, 3.1.6).
    fn ring(&self, points: &[Point], hole: bool) -> Value {
        let doubled: f64 = points
            .iter()
            .zip(points.iter().cycle().skip(1))
            .map(|(a, b)| a[1] * b[0] - b[1] * a[0])
            .sum();
        let mut ring: Vec<Value> = points.iter().map(|p| self.position(*p)).collect();
        if (doubled > 0.0) == hole {
            ring.reverse();
        }
        if let Some(first) = ring.first().cloned() {
            ring.push(first);
        }
        Value::Array(ring)
    }

    fn polygon(&self, polygon: &Polygon) -> Value {
        polygon
            .iter()
            .enumerate()
            .map(|(i, ring)| self.ring(ring, i > 0))
            .collect()
    }
}

/// The whole collection: path, outline (from [`ellipse::outline`]), one ellipse a second, rest, impacts, onset
/// of braking.
#[must_use]
pub fn collection(r: &Reconstruction, outline: &[Polygon]) -> Value {
    let pose = r.rest_pose.as_ref();
    let map = Map {
        plane: pose.map(TangentPlane::at),
    };
    let mut features = Vec::new();
    let path: Vec<&State> = ellipse::thinned(&r.states, 10).collect();
    if path.len() > 1 {
        let line: Value = path
            .iter()
            .map(|s| map.position([s.position[0], s.position[1]]))
            .collect();
        let times: Value = path
            .iter()
            .map(|s| json!((s.t_s * 1e4).round() / 1e4))
            .collect();
        features.push(feature(
            json!({"type": "LineString", "coordinates": line}),
            json!({"kind": "path", "t_s": times}),
        ));
    }
    let outline: Value = outline.iter().map(|p| map.polygon(p)).collect();
    features.push(feature(
        json!({"type": "MultiPolygon", "coordinates": outline}),
        json!({
            "kind": "funnel", "confidence": r.confidence,
            "note": "union of the ellipses, for drawing only: the claim is the ellipse of each instant",
        }),
    ));
    for (s, second) in each_second(&r.states) {
        let e = ellipse::of_state(s, pose, r.confidence);
        features.push(feature(
            json!({"type": "Polygon", "coordinates": [map.ring(&e.points(48), false)]}),
            ellipse_properties(s, &e, second, r.confidence),
        ));
    }
    features.extend(points(r, &map));
    let mut top = json!({"type": "FeatureCollection"});
    if pose.is_none() {
        top["units"] = json!("m");
        top["axes"] = json!(["east_m", "north_m"]);
        top["note"] = json!(
            "metres from the final rest; north is the car's forward axis at rest; not a GeoJSON file, for no rest pose was given"
        );
    }
    top["model"] = json!(r.model);
    top["features"] = Value::Array(features);
    top
}

fn points(r: &Reconstruction, map: &Map) -> Vec<Value> {
    let mut features = Vec::new();
    if let Some(last) = r.states.last() {
        let kind = if r.rest.found { "rest" } else { "end" };
        features.push(point(
            map,
            last,
            json!({"kind": kind, "t_s": round4(last.t_s)}),
        ));
    }
    for (i, impact) in r.impacts.iter().enumerate() {
        if let Some(s) = nearest(&r.states, impact.t_s.value) {
            let properties = json!({
                "kind": "impact", "number": i + 1, "t_s": round4(impact.t_s.value),
                "speed_mps": round4(impact.speed_mps.value), "heading_deg": round4(impact.heading_deg.value),
            });
            features.push(point(map, s, properties));
        }
    }
    if let Some(s) = r
        .braking
        .as_ref()
        .and_then(|b| nearest(&r.states, b.onset_t_s.value))
    {
        features.push(point(
            map,
            s,
            json!({"kind": "braking", "t_s": round4(s.t_s)}),
        ));
    }
    features
}

fn ellipse_properties(s: &State, e: &Ellipse, second: i64, confidence: f64) -> Value {
    json!({
        "kind": "ellipse", "second": second, "t_s": round4(s.t_s), "confidence": confidence,
        "semi_major_m": round4(e.semi_major), "semi_minor_m": round4(e.semi_minor),
        "azimuth_deg": round4(e.azimuth.to_degrees().rem_euclid(180.0)),
    })
}

fn point(map: &Map, s: &State, properties: Value) -> Value {
    feature(
        json!({"type": "Point", "coordinates": map.position([s.position[0], s.position[1]])}),
        properties,
    )
}

fn feature(geometry: Value, properties: Value) -> Value {
    let mut map = serde_json::Map::new();
    map.insert("type".to_owned(), json!("Feature"));
    map.insert("geometry".to_owned(), geometry);
    map.insert("properties".to_owned(), properties);
    Value::Object(map)
}

fn round4(x: f64) -> f64 {
    (x * 1e4).round() / 1e4
}

/// The state nearest to a time; `None` only where there are no states.
#[must_use]
pub fn nearest(states: &[State], t_s: f64) -> Option<&State> {
    let after = states.partition_point(|s| s.t_s < t_s);
    let candidates = [after.checked_sub(1), Some(after)];
    candidates
        .into_iter()
        .flatten()
        .filter_map(|i| states.get(i))
        .min_by(|a, b| (a.t_s - t_s).abs().total_cmp(&(b.t_s - t_s).abs()))
}

/// The state nearest to each full second of the window, with the second.
pub fn each_second(states: &[State]) -> impl Iterator<Item = (&State, i64)> {
    let first = states.first().map_or(0, |s| -num::floor_i64(-s.t_s));
    let last = states.last().map_or(-1, |s| num::floor_i64(s.t_s));
    (first..=last)
        .filter_map(move |second| nearest(states, num::real_i64(second)).map(|s| (s, second)))
}

#[cfg(test)]
mod tests {
    use super::{collection, file_name, nearest};
    use crate::export::ellipse;
    use crate::findings::RestPose;
    use crate::report::sample_case;

    #[test]
    fn local_file_without_a_pose_and_geojson_with_one() {
        let mut r = sample_case::reconstruction();
        assert_eq!(file_name(&r), "funnel.local.json");
        let local = collection(&r, &ellipse::outline(&r.states, r.rest_pose.as_ref(), 0.95));
        assert_eq!(local["axes"][0], "east_m");
        r.rest_pose = Some(RestPose {
            latitude_deg: 59.9,
            longitude_deg: 10.7,
            heading_deg: 0.0,
            sd_m: 0.5,
            sd_deg: 2.0,
        });
        assert_eq!(file_name(&r), "funnel.geojson");
        let geo = collection(&r, &ellipse::outline(&r.states, r.rest_pose.as_ref(), 0.95));
        assert!(geo.get("axes").is_none());
        let kinds: Vec<&str> = geo["features"]
            .as_array()
            .unwrap()
            .iter()
            .map(|f| f["properties"]["kind"].as_str().unwrap())
            .collect();
        for kind in ["path", "funnel", "ellipse", "rest", "impact", "braking"] {
            assert!(kinds.contains(&kind), "{kind}");
        }
        for f in geo["features"].as_array().unwrap() {
            if f["geometry"]["type"] == "Polygon" {
                let ring = f["geometry"]["coordinates"][0].as_array().unwrap();
                assert_eq!(ring.first(), ring.last());
                let area: f64 = ring
                    .windows(2)
                    .map(|p| {
                        p[0][0].as_f64().unwrap() * p[1][1].as_f64().unwrap()
                            - p[1][0].as_f64().unwrap() * p[0][1].as_f64().unwrap()
                    })
                    .sum();
                assert!(area > -1e-12, "outer rings run anticlockwise");
            }
        }
        let wide = |v: &serde_json::Value| {
            v["features"]
                .as_array()
                .unwrap()
                .iter()
                .find(|f| f["properties"]["second"] == -20)
                .unwrap()["properties"]["semi_major_m"]
                .as_f64()
                .unwrap()
        };
        assert!(
            wide(&geo) > wide(&local),
            "the rest pose's covariance widens the ellipse"
        );
    }

    #[test]
    fn nearest_state() {
        let r = sample_case::reconstruction();
        assert!((nearest(&r.states, -3.004).unwrap().t_s + 3.0).abs() < 0.006);
        assert!((nearest(&r.states, -1e9).unwrap().t_s - r.states[0].t_s).abs() < 1e-12);
        assert!(nearest(&[], 0.0).is_none());
    }
}
