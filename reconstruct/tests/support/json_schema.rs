//! The part of JSON Schema 2020-12 that `summary.schema.json` uses; a keyword outside of it is an error.

use serde_json::Value;

/// Every violation, with its place; empty if the value is valid.
pub(crate) fn violations(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    check(schema, schema, value, "$", &mut found);
    found
}

fn check(root: &Value, schema: &Value, value: &Value, place: &str, found: &mut Vec<String>) {
    for (keyword, rule) in schema.as_object().unwrap() {
        match keyword.as_str() {
            // Said, not checked; or checked above for values of another kind.
            "$schema" | "$id" | "$defs" | "title" | "description" => {}
            "required" | "properties" | "additionalProperties" if !value.is_object() => {}
            "items" if !value.is_array() => {}
            "const" if rule == value => {}
            "enum" if rule.as_array().unwrap().contains(value) => {}
            "$ref" => {
                let pointer = rule.as_str().unwrap().strip_prefix('#').unwrap();
                check(root, root.pointer(pointer).unwrap(), value, place, found);
            }
            "type" => {
                let names: Vec<&str> = rule.as_array().map_or_else(
                    || vec![rule.as_str().unwrap()],
                    |a| a.iter().map(|n| n.as_str().unwrap()).collect(),
                );
                if !names.iter().any(|n| is(n, value)) {
                    found.push(format!("{place}: expected {names:?}, found {value}"));
                }
            }
            "required" => {
                for name in rule.as_array().unwrap() {
                    if value.get(name.as_str().unwrap()).is_none() {
                        found.push(format!("{place}: {name} is missing"));
                    }
                }
            }
            "properties" => {
                for (name, inner) in rule.as_object().unwrap() {
                    if let Some(member) = value.get(name) {
                        check(root, inner, member, &format!("{place}.{name}"), found);
                    }
                }
            }
            "additionalProperties" => {
                let known = schema.get("properties");
                for (name, member) in value.as_object().unwrap() {
                    if known.and_then(|k| k.get(name)).is_none() {
                        check(root, rule, member, &format!("{place}.{name}"), found);
                    }
                }
            }
            "items" => {
                for (i, member) in value.as_array().unwrap().iter().enumerate() {
                    check(root, rule, member, &format!("{place}[{i}]"), found);
                }
            }
            "const" => found.push(format!("{place}: expected {rule}, found {value}")),
            "enum" => {
                found.push(format!("{place}: expected one of {rule}, found {value}"));
            }
            "anyOf" => {
                let fits = |s: &Value| {
                    let mut inner = Vec::new();
                    check(root, s, value, place, &mut inner);
                    inner.is_empty()
                };
                if !rule.as_array().unwrap().iter().any(fits) {
                    found.push(format!("{place}: fits none of the alternatives: {value}"));
                }
            }
            "allOf" => rule
                .as_array()
                .unwrap()
                .iter()
                .for_each(|s| check(root, s, value, place, found)),
            "minimum" | "maximum" | "exclusiveMinimum" | "exclusiveMaximum" => {
                let Some(x) = value.as_f64() else { continue };
                let limit = rule.as_f64().unwrap();
                let holds = match keyword.as_str() {
                    "minimum" => x >= limit,
                    "maximum" => x <= limit,
                    "exclusiveMinimum" => x > limit,
                    _ => x < limit,
                };
                if !holds {
                    found.push(format!("{place}: {keyword} {limit}, found {x}"));
                }
            }
            "pattern" => {
                // The one pattern in use: a SHA-256 digest.
                assert_eq!(rule, "^[0-9a-f]{64}$");
                let Some(text) = value.as_str() else { continue };
                if text.len() != 64
                    || !text
                        .bytes()
                        .all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
                {
                    found.push(format!(
                        "{place}: expected 64 hexadecimal digits, found {text}"
                    ));
                }
            }
            other => found.push(format!(
                "{place}: keyword {other} is not known to this test"
            )),
        }
    }
}

fn is(name: &str, value: &Value) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        _ => false,
    }
}
