//! Road centre lines as a map file gives them.

use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::ReconstructError;
use crate::map::{geojson, osm};

/// A larger file is refused: an extract of some kilometres about the place is a few MB.
pub const MAX_BYTES: u64 = 64 * 1024 * 1024;

/// Which way a road may be driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum OneWay {
    /// Both ways.
    #[default]
    No,
    /// In the order of its points only.
    Along,
    /// Against the order of its points only.
    Against,
}

/// One centre line.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct RoadLine {
    /// Name or number; empty where the map has none.
    pub name: String,
    /// Direction of traffic.
    pub oneway: OneWay,
    /// Lanes in all, both ways together.
    pub lanes: Option<f64>,
    /// Width of the carriageway, m.
    pub width_m: Option<f64>,
    /// Latitude and longitude, degrees (WGS 84); two points or more.
    pub line: Vec<[f64; 2]>,
}

/// What a map file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Roads {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: [u8; 32],
    /// Every drivable centre line, in the order of the file.
    pub lines: Vec<RoadLine>,
}

impl Roads {
    /// Reads a GeoJSON or OpenStreetMap XML file, told apart by their content.
    ///
    /// # Errors
    /// [`ReconstructError::Map`] if it cannot be read, is neither, is damaged, or holds no road.
    pub fn load(path: &Path) -> Result<Self, ReconstructError> {
        let file = path.file_name().map_or_else(
            || path.display().to_string(),
            |n| n.to_string_lossy().into_owned(),
        );
        let fail = |what: String| ReconstructError::Map {
            file: path.display().to_string(),
            what,
        };
        let size = std::fs::metadata(path)
            .map_err(|e| fail(e.to_string()))?
            .len();
        if size > MAX_BYTES {
            return Err(fail(format!(
                "expected at most {MAX_BYTES} bytes, found {size}: cut an extract about the place of rest"
            )));
        }
        let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
        Self::read(&file, &bytes).map_err(fail)
    }

    /// Reads the bytes of a map file.
    ///
    /// # Errors
    /// What is wrong with it, and where.
    pub fn read(file: &str, bytes: &[u8]) -> Result<Self, String> {
        let text = std::str::from_utf8(bytes)
            .map_err(|e| format!("offset {}: expected UTF-8 text", e.valid_up_to()))?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let lines = match text.trim_start().chars().next() {
            Some('{') => geojson::read(text)?,
            Some('<') => osm::read(text)?,
            Some(c) => {
                return Err(format!(
                    "offset 0: expected GeoJSON or OpenStreetMap XML, found {c:?}"
                ));
            }
            None => return Err("expected GeoJSON or OpenStreetMap XML, found nothing".to_owned()),
        };
        if lines.is_empty() {
            return Err("expected road centre lines, found none that a car may drive".to_owned());
        }
        Ok(Self {
            file: file.to_owned(),
            sha256: Sha256::digest(bytes).into(),
            lines,
        })
    }
}

/// A place on the earth, or what it should be.
pub(crate) fn place(latitude: f64, longitude: f64) -> Result<[f64; 2], String> {
    if latitude.abs() <= 90.0 && longitude.abs() <= 180.0 {
        Ok([latitude, longitude])
    } else {
        Err(format!(
            "expected latitude -90 to 90 and longitude -180 to 180 (WGS 84), found {latitude}, {longitude}"
        ))
    }
}

/// Kinds of OpenStreetMap `highway` that a car drives on.
pub(crate) fn drivable(highway: &str) -> bool {
    let kind = highway.strip_suffix("_link").unwrap_or(highway);
    matches!(
        kind,
        "motorway"
            | "trunk"
            | "primary"
            | "secondary"
            | "tertiary"
            | "unclassified"
            | "residential"
            | "living_street"
            | "service"
            | "road"
            | "track"
            | "busway"
    )
}

/// Takes one tag or property into a line; gives false if it says that no car drives there.
pub(crate) fn tag(line: &mut RoadLine, key: &str, value: &str) -> bool {
    let number = |text: &str| {
        let text = text.trim().trim_end_matches('m').trim_end();
        text.parse::<f64>().ok().filter(|x| *x > 0.0 && *x < 100.0)
    };
    match key {
        "highway" => return drivable(value),
        "name" | "navn" => line.name = shortened(value),
        "ref" if line.name.is_empty() => line.name = shortened(value),
        "oneway" => {
            line.oneway = match value {
                "yes" | "true" | "1" => OneWay::Along,
                "-1" | "reverse" => OneWay::Against,
                _ => OneWay::No,
            };
        }
        "junction" if matches!(value, "roundabout" | "circular") && line.oneway == OneWay::No => {
            line.oneway = OneWay::Along;
        }
        "lanes" => line.lanes = number(value),
        "width" => line.width_m = number(value),
        _ => {}
    }
    true
}

/// A name from outside, cut to what a table can hold.
fn shortened(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(80).collect()
}

/// Whether two lines are the same to rounding.
#[cfg(test)]
pub(crate) fn near(a: &[[f64; 2]], b: &[[f64; 2]]) -> bool {
    a.len() == b.len()
        && a.iter()
            .flatten()
            .zip(b.iter().flatten())
            .all(|(x, y)| (x - y).abs() < 1e-12)
}

#[cfg(test)]
mod tests {
    use super::{OneWay, RoadLine, Roads, drivable, tag};

    #[test]
    fn content_tells_the_format_and_errors_say_where() {
        for (bytes, want) in [
            (&b""[..], "found nothing"),
            (b"PK\x03", "offset 0"),
            (b"\xff\xfe", "offset 0: expected UTF-8"),
            (b"{}", "type"),
            (b"<osm></osm>", "found none"),
        ] {
            let error = Roads::read("x", bytes).unwrap_err();
            assert!(error.contains(want), "{error}");
        }
    }

    #[test]
    fn tags() {
        let mut line = RoadLine::default();
        for (key, value) in [
            ("ref", "E 6"),
            ("oneway", "-1"),
            ("lanes", "2"),
            ("width", "6.5 m"),
        ] {
            assert!(tag(&mut line, key, value));
        }
        assert_eq!((line.name.as_str(), line.oneway), ("E 6", OneWay::Against));
        assert_eq!((line.lanes, line.width_m), (Some(2.0), Some(6.5)));
        assert!(!tag(&mut line, "highway", "footway"));
        assert!(drivable("motorway_link") && !drivable("cycleway"));
    }
}
