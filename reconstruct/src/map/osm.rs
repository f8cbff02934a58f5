//! Centre lines from an OpenStreetMap extract in XML (`.osm`): ways with a `highway` that a car drives on.

use std::collections::HashMap;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use crate::map::roads::{RoadLine, place, tag};

/// A way being read.
#[derive(Default)]
struct Way {
    line: RoadLine,
    nodes: Vec<i64>,
    highway: bool,
    barred: bool,
}

/// Every drivable way. Nodes may stand before or after the ways that use them; where an extract lacks nodes
/// of a way, what is left of it is kept in pieces.
///
/// # Errors
/// What is wrong, with the line of the file.
pub(crate) fn read(text: &str) -> Result<Vec<RoadLine>, String> {
    let mut reader = Reader::from_str(text);
    let mut nodes: HashMap<i64, [f64; 2]> = HashMap::new();
    let mut ways: Vec<Way> = Vec::new();
    let mut current: Option<Way> = None;
    let mut root = false;
    loop {
        let at = reader.buffer_position();
        let here = |what: String| format!("line {}: {what}", line_of(text, at));
        let event = reader.read_event();
        let event =
            event.map_err(|e| format!("line {}: {e}", line_of(text, reader.error_position())))?;
        let (element, closed) = match &event {
            Event::Start(element) => (element, false),
            Event::Empty(element) => (element, true),
            Event::End(end) if end.name().into_inner() == "way" => {
                ways.extend(current.take());
                continue;
            }
            Event::Eof => break,
            _ => continue,
        };
        let name = element.name().into_inner();
        if !root && name != "osm" {
            return Err(here(format!("expected the element <osm>, found <{name}>")));
        }
        root = true;
        match (name, &mut current) {
            ("node", _) => {
                let (id, place) = node(element).map_err(here)?;
                nodes.insert(id, place);
            }
            ("way", _) => {
                current = (!closed).then(Way::default);
            }
            ("nd", Some(way)) => {
                let id = attribute(element, "ref").map_err(here)?;
                way.nodes.push(number(&id, "ref").map_err(here)?);
            }
            ("tag", Some(way)) => {
                let key = attribute(element, "k").map_err(here)?;
                let value = attribute(element, "v").map_err(here)?;
                let open = tag(&mut way.line, &key, &value);
                way.highway |= key == "highway" && open;
                way.barred |= key == "area" && value == "yes";
            }
            _ => {}
        }
    }
    if current.is_some() {
        return Err(format!(
            "line {}: the file ends within a way",
            line_of(text, u64::MAX)
        ));
    }
    let mut out = Vec::new();
    for way in ways.iter().filter(|w| w.highway && !w.barred) {
        pieces(way, &nodes, &mut out);
    }
    Ok(out)
}

fn line_of(text: &str, offset: u64) -> usize {
    let end = usize::try_from(offset).map_or(text.len(), |o| o.min(text.len()));
    text.as_bytes()[..end].split(|b| *b == b'\n').count()
}

fn node(element: &BytesStart<'_>) -> Result<(i64, [f64; 2]), String> {
    let id = number(&attribute(element, "id")?, "id")?;
    let latitude = number(&attribute(element, "lat")?, "lat")?;
    let longitude = number(&attribute(element, "lon")?, "lon")?;
    Ok((id, place(latitude, longitude)?))
}

fn attribute(element: &BytesStart<'_>, key: &str) -> Result<String, String> {
    for attribute in element.attributes() {
        let attribute = attribute.map_err(|e| e.to_string())?;
        if attribute.key.into_inner() == key {
            return attribute
                .normalized_value(XmlVersion::Implicit1_0)
                .map(std::borrow::Cow::into_owned)
                .map_err(|e| e.to_string());
        }
    }
    Err(format!(
        "<{}>: expected an attribute `{key}`",
        element.name().into_inner()
    ))
}

fn number<T: std::str::FromStr>(text: &str, key: &str) -> Result<T, String> {
    text.trim()
        .parse()
        .map_err(|_| format!("{key}: expected a number, found {text:?}"))
}

fn pieces(way: &Way, nodes: &HashMap<i64, [f64; 2]>, out: &mut Vec<RoadLine>) {
    let mut run: Vec<[f64; 2]> = Vec::new();
    let ids = way.nodes.iter().map(Some).chain(std::iter::once(None));
    for id in ids {
        if let Some(place) = id.and_then(|id| nodes.get(id)) {
            run.push(*place);
            continue;
        }
        let line = std::mem::take(&mut run);
        if line.len() > 1 {
            out.push(RoadLine {
                line,
                ..way.line.clone()
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::read;
    use crate::map::roads::{OneWay, near};

    #[test]
    fn ways_before_nodes_missing_nodes_and_kinds() {
        let text = "<?xml version=\"1.0\"?>\n<osm version=\"0.6\">
 <way id=\"7\"><nd ref=\"1\"/><nd ref=\"2\"/><nd ref=\"99\"/><nd ref=\"-3\"/><nd ref=\"1\"/>
  <tag k=\"highway\" v=\"secondary\"/><tag k=\"name\" v=\"A &amp; B\"/><tag k=\"oneway\" v=\"yes\"/></way>
 <way id=\"8\"><nd ref=\"1\"/><nd ref=\"2\"/><tag k=\"highway\" v=\"footway\"/></way>
 <way id=\"9\"><nd ref=\"1\"/><nd ref=\"2\"/><tag k=\"building\" v=\"yes\"/></way>
 <node id=\"1\" lat=\"59.9\" lon=\"10.7\"/><node id=\"2\" lat=\"59.91\" lon=\"10.7\"><tag k=\"x\" v=\"y\"/></node>
 <node id=\"-3\" lat=\"59.92\" lon=\"10.7\"/></osm>";
        let lines = read(text).unwrap();
        assert_eq!(lines.len(), 2);
        assert_eq!(
            (lines[0].name.as_str(), lines[0].oneway),
            ("A & B", OneWay::Along)
        );
        assert!(near(&lines[1].line, &[[59.92, 10.7], [59.9, 10.7]]));
    }

    #[test]
    fn errors_name_the_line() {
        for (text, want) in [
            (
                "<osm>\n<node id=\"1\" lat=\"x\" lon=\"1\"/></osm>",
                "line 2: lat: expected a number",
            ),
            (
                "<osm>\n\n<node id=\"1\" lat=\"95\" lon=\"1\"/></osm>",
                "line 3: expected latitude",
            ),
            ("<osm>\n<node id=\"1\" lon=\"1\"/></osm>", "attribute `lat`"),
            ("<html></html>", "line 1: expected the element <osm>"),
            ("<osm>\n<way id=\"1\">\n", "line 3"),
            ("<osm>\n</way>", "line 2"),
            ("<osm><way><nd ref=\"&bomb;\"/></way></osm>", "line 1"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(want), "{error}");
        }
    }
}
