//! Where in the file a key stands, and which valid name is nearest to a wrong one.

use std::fmt;
use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};

/// A line of the configuration (boxed, as it travels in errors).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place(Box<(PathBuf, usize)>);

impl Place {
    /// The first line of a file.
    pub(crate) fn of_file(file: &Path) -> Self {
        Self(Box::new((file.to_path_buf(), 1)))
    }

    /// The file as named.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.0.0
    }

    /// Line, from 1.
    #[must_use]
    pub fn line(&self) -> usize {
        self.0.1
    }
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}:{}", self.file().display(), self.line())
    }
}

/// The text of the configuration, to find lines in.
pub(crate) struct Source<'a> {
    file: &'a Path,
    text: &'a str,
}

impl<'a> Source<'a> {
    pub(crate) fn new(file: &'a Path, text: &'a str) -> Self {
        Self { file, text }
    }

    /// The line a byte offset lies in.
    pub(crate) fn at(&self, offset: usize) -> Place {
        let before = self.text.get(..offset).unwrap_or(self.text);
        Place(Box::new((
            self.file.to_path_buf(),
            before.matches('\n').count() + 1,
        )))
    }

    /// The line of a key such as `imu.accel[1]` or `bus[0].dbc`; of the nearest table around it if it is not there.
    pub(crate) fn place(&self, key: &str) -> Place {
        let Ok(table) = DeTable::parse(self.text) else {
            return self.at(0);
        };
        let mut offset = 0;
        let mut value: Option<&DeValue<'_>> = None;
        for step in key.split(['.', '[', ']']).filter(|step| !step.is_empty()) {
            let next = match (value, step.parse::<usize>()) {
                (Some(DeValue::Array(items)), Ok(at)) => items
                    .get(at)
                    .map(|item| (item.span().start, item.get_ref())),
                (None, _) => entry(table.get_ref(), step),
                (Some(DeValue::Table(inner)), _) => entry(inner, step),
                _ => None,
            };
            let Some((start, inner)) = next else { break };
            offset = start;
            value = Some(inner);
        }
        self.at(offset)
    }
}

fn entry<'t, 'i>(table: &'t DeTable<'i>, name: &str) -> Option<(usize, &'t DeValue<'i>)> {
    table
        .iter()
        .find(|(key, _)| key.get_ref() == name)
        .map(|(key, value)| (key.span().start, value.get_ref()))
}

/// `; did you mean X?` for the candidate nearest to `name`, or nothing where there is no candidate.
pub fn nearest<'n>(name: &str, candidates: impl IntoIterator<Item = &'n str>) -> String {
    let lower = name.to_lowercase();
    candidates
        .into_iter()
        .min_by_key(|candidate| strsim::damerau_levenshtein(&lower, &candidate.to_lowercase()))
        .map_or_else(String::new, |candidate| {
            format!("; the nearest valid name is `{candidate}`")
        })
}
