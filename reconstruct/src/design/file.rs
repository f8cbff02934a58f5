//! Reading the study's input files: bounded, TOML or JSON, errors that say where.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::de::DeserializeOwned;

use super::DesignError;

/// Largest input file, bytes.
const LARGEST: u64 = 1 << 20;

/// The text of a file.
pub(super) fn read(path: &Path) -> Result<String, DesignError> {
    let fail = |what: String| DesignError::File {
        file: path.display().to_string(),
        what,
    };
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(LARGEST + 1).read_to_end(&mut bytes))
        .map_err(|error| fail(error.to_string()))?;
    if schema::num::u64_of(bytes.len()) > LARGEST {
        return Err(fail("expected at most 1 MiB, found more".to_owned()));
    }
    String::from_utf8(bytes).map_err(|error| {
        fail(format!(
            "expected UTF-8 text, found another byte at {}",
            error.utf8_error().valid_up_to()
        ))
    })
}

/// TOML, or JSON if the text begins with a brace.
pub(super) fn decode<T: DeserializeOwned>(text: &str, source: &str) -> Result<T, DesignError> {
    let fail = |what: String| DesignError::File {
        file: source.to_owned(),
        what: what.trim_end().to_owned(),
    };
    if text.trim_start().starts_with('{') {
        serde_json::from_str(text).map_err(|error| fail(error.to_string()))
    } else {
        toml::from_str(text).map_err(|error| fail(error.to_string()))
    }
}

/// A file, for the messages about its keys.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    /// Its name.
    pub(super) source: &'a str,
}

impl Place<'_> {
    /// An error about a key.
    pub(super) fn wrong(&self, key: &str, expected: &str, found: &str) -> DesignError {
        DesignError::File {
            file: self.source.to_owned(),
            what: format!("{key}: expected {expected}, found {found}"),
        }
    }

    /// A number within its range; not-a-number never is.
    pub(super) fn within(
        &self,
        key: &str,
        value: f64,
        low: f64,
        high: f64,
    ) -> Result<f64, DesignError> {
        if (low..=high).contains(&value) {
            // Adding zero turns -0 into 0.
            Ok(value + 0.0)
        } else {
            Err(self.wrong(key, &format!("{low} to {high}"), &value.to_string()))
        }
    }

    /// A short text without control characters.
    pub(super) fn text(&self, key: &str, text: &str, most: usize) -> Result<String, DesignError> {
        let n = text.chars().count();
        if n > most || text.chars().any(char::is_control) {
            return Err(self.wrong(
                key,
                &format!("at most {most} characters in one line"),
                &format!("{n} characters"),
            ));
        }
        Ok(text.to_owned())
    }

    /// A list no longer than `most`, its times (if any) in order.
    pub(super) fn list(
        &self,
        key: &str,
        times: impl ExactSizeIterator<Item = f64>,
        most: usize,
    ) -> Result<(), DesignError> {
        if times.len() > most {
            return Err(self.wrong(key, &format!("at most {most}"), &times.len().to_string()));
        }
        let mut before = f64::NEG_INFINITY;
        for (i, t) in times.enumerate() {
            if t <= before {
                return Err(self.wrong(
                    &format!("{key}[{i}]"),
                    &format!("a value above the one before it ({before})"),
                    &t.to_string(),
                ));
            }
            before = t;
        }
        Ok(())
    }
}
