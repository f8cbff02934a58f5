//! Centre lines from `GeoJSON` (RFC 7946).

use serde_json::Value;

use crate::map::roads::{RoadLine, place, tag};

/// Collections may stand in collections; deeper than this no tool writes.
const MAX_DEPTH: usize = 16;

/// Every `LineString` and `MultiLineString`, with the names of its feature's properties. A feature whose
/// property `highway` names what no car drives on is left out; other kinds of geometry are passed over.
///
/// # Errors
/// What is wrong, with line and column or the index of the feature and of the point.
pub(crate) fn read(text: &str) -> Result<Vec<RoadLine>, String> {
    let root: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let mut out = Vec::new();
    match kind(&root)? {
        "FeatureCollection" => {
            let features = root.get("features").and_then(Value::as_array);
            let features = features.ok_or("expected a list `features`")?;
            for (i, feature) in features.iter().enumerate() {
                take(feature, &mut out).map_err(|e| format!("feature {i}: {e}"))?;
            }
        }
        _ => take(&root, &mut out)?,
    }
    Ok(out)
}

fn kind(value: &Value) -> Result<&str, String> {
    value
        .get("type")
        .and_then(Value::as_str)
        .ok_or_else(|| "expected an object with a `type`".to_owned())
}

/// A feature, or a geometry without one.
fn take(value: &Value, out: &mut Vec<RoadLine>) -> Result<(), String> {
    let mut pattern = RoadLine::default();
    if kind(value)? != "Feature" {
        return geometry(value, &pattern, 0, out);
    }
    if let Some(properties) = value.get("properties").and_then(Value::as_object) {
        for (key, value) in properties {
            let text = match value {
                Value::String(s) => s.clone(),
                Value::Bool(_) | Value::Number(_) => value.to_string(),
                _ => continue,
            };
            if !tag(&mut pattern, key, &text) {
                return Ok(());
            }
        }
    }
    match value.get("geometry") {
        None | Some(Value::Null) => Ok(()),
        Some(shape) => geometry(shape, &pattern, 0, out),
    }
}

fn geometry(
    shape: &Value,
    pattern: &RoadLine,
    depth: usize,
    out: &mut Vec<RoadLine>,
) -> Result<(), String> {
    let list = |name: &str| {
        shape
            .get(name)
            .and_then(Value::as_array)
            .ok_or_else(|| format!("expected a list `{name}`"))
    };
    match kind(shape)? {
        "LineString" => line(list("coordinates")?, pattern, out),
        "MultiLineString" => {
            for (i, part) in list("coordinates")?.iter().enumerate() {
                let points = part
                    .as_array()
                    .ok_or_else(|| format!("line {i}: expected a list of points"))?;
                line(points, pattern, out).map_err(|e| format!("line {i}: {e}"))?;
            }
            Ok(())
        }
        "GeometryCollection" if depth < MAX_DEPTH => {
            for (i, inner) in list("geometries")?.iter().enumerate() {
                geometry(inner, pattern, depth + 1, out)
                    .map_err(|e| format!("geometry {i}: {e}"))?;
            }
            Ok(())
        }
        "GeometryCollection" => Err(format!("collections are nested deeper than {MAX_DEPTH}")),
        "Point" | "MultiPoint" | "Polygon" | "MultiPolygon" => Ok(()),
        other => Err(format!("expected a geometry, found type {other:?}")),
    }
}

fn line(points: &[Value], pattern: &RoadLine, out: &mut Vec<RoadLine>) -> Result<(), String> {
    let mut line = Vec::with_capacity(points.len());
    for (i, point) in points.iter().enumerate() {
        let number = |k: usize| point.get(k).and_then(Value::as_f64);
        let (Some(longitude), Some(latitude)) = (number(0), number(1)) else {
            return Err(format!("point {i}: expected [longitude, latitude]"));
        };
        line.push(place(latitude, longitude).map_err(|e| format!("point {i}: {e}"))?);
    }
    if line.len() < 2 {
        return Err(format!("expected at least 2 points, found {}", line.len()));
    }
    out.push(RoadLine {
        line,
        ..pattern.clone()
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::read;
    use crate::map::roads::{OneWay, near};

    #[test]
    fn features_collections_and_bare_geometries() {
        let text = r#"{"type":"FeatureCollection","features":[
            {"type":"Feature","properties":{"name":"Storgata","oneway":true,"lanes":2},
             "geometry":{"type":"LineString","coordinates":[[10.1,59.9,3.0],[10.2,59.8]]}},
            {"type":"Feature","properties":{"highway":"footway"},
             "geometry":{"type":"LineString","coordinates":[[10.1,59.9],[10.2,59.8]]}},
            {"type":"Feature","properties":null,"geometry":null},
            {"type":"Feature","geometry":{"type":"GeometryCollection","geometries":[
              {"type":"Point","coordinates":[1,2]},
              {"type":"MultiLineString","coordinates":[[[1,2],[3,4]],[[5,6],[7,8]]]}]}}]}"#;
        let lines = read(text).unwrap();
        assert_eq!(lines.len(), 3);
        assert_eq!(
            (lines[0].name.as_str(), lines[0].oneway),
            ("Storgata", OneWay::Along)
        );
        assert!(near(&lines[0].line[1..], &[[59.8, 10.2]]));
        assert!(near(&lines[2].line, &[[6.0, 5.0], [8.0, 7.0]]));
        let bare = r#"{"type":"LineString","coordinates":[[1,2],[3,4]]}"#;
        assert_eq!(read(bare).unwrap().len(), 1);
    }

    #[test]
    fn errors_name_the_feature_and_the_point() {
        let wrap = |geometry: &str| {
            format!(
                r#"{{"type":"FeatureCollection","features":[{{"type":"Feature","geometry":{geometry}}}]}}"#
            )
        };
        for (geometry, want) in [
            (
                r#"{"type":"LineString","coordinates":[[1,2],[612345,6600000]]}"#,
                "feature 0: point 1: expected latitude",
            ),
            (
                r#"{"type":"LineString","coordinates":[[1,2]]}"#,
                "feature 0: expected at least 2",
            ),
            (
                r#"{"type":"LineString","coordinates":[[1,2],["x",3]]}"#,
                "point 1: expected [longitude",
            ),
            (
                r#"{"type":"Curve","coordinates":[]}"#,
                "expected a geometry",
            ),
        ] {
            let error = read(&wrap(geometry)).unwrap_err();
            assert!(error.contains(want), "{error}");
        }
        assert!(
            read("{\"type\":\n 12x")
                .unwrap_err()
                .contains("line 2 column")
        );
        let deep = (0..40).fold(
            r#"{"type":"Point","coordinates":[1,2]}"#.to_owned(),
            |inner, _| format!(r#"{{"type":"GeometryCollection","geometries":[{inner}]}}"#),
        );
        assert!(read(&deep).unwrap_err().contains("nested deeper"));
        assert!(read(&"[".repeat(10_000)).is_err());
    }
}
