//! What `reconstruct gnss` was told and what it took: for its summaries and pages.

use reconstruct::gnss::rows::Leg;
use reconstruct::report::summary;
use serde_json::{Map, Value, json};

use crate::cli::gnss_logs::{LogArgs, Logs};
use crate::cli::gnss_receiver::ReceiverArgs;

/// A log as it was taken.
#[derive(Clone, Debug)]
pub(crate) struct Taken {
    /// Fixes, motions or reference.
    pub(crate) what: &'static str,
    /// Name of the file.
    pub(crate) file: String,
    /// Digest of the bytes that were read, hexadecimal.
    pub(crate) sha256: String,
    /// Rows taken.
    pub(crate) rows: usize,
    /// Equipment, drive and leg of them.
    pub(crate) leg: Option<Leg>,
}

/// One option: its key, what it is in words with its unit, its value.
type Entry = (&'static str, &'static str, Value);

/// What was done, in full.
#[derive(Clone, Debug)]
pub(crate) struct Told {
    taken: Vec<Taken>,
    options: Vec<Entry>,
}

impl Told {
    /// With the options that every command has; `own` are those of the command.
    pub(crate) fn new(
        logs: &Logs,
        args: &LogArgs,
        receiver: Option<&ReceiverArgs>,
        own: Vec<Entry>,
    ) -> Self {
        let c = &args.choice;
        let mut options = own;
        options.extend([
            (
                "latency_s",
                "Delay of the fixes behind the inertial samples, s",
                json!(c.latency),
            ),
            ("axes", "Axes of the inertial sensors", json!(c.axes.name())),
            ("equipment", "Equipment chosen", json!(c.equipment)),
            ("drive", "Drive chosen", json!(c.drive)),
            ("leg", "Leg chosen", json!(c.leg)),
            (
                "from_s",
                "What is before is left out, s of the box's clock",
                json!(c.from),
            ),
            (
                "to_s",
                "What is after is left out, s of the box's clock",
                json!(c.to),
            ),
            (
                "skip_broken",
                "Lines that cannot be read are skipped",
                json!(args.skips_broken()),
            ),
            (
                "confidence",
                "Confidence of ellipses, circles and bands",
                json!(0.95),
            ),
        ]);
        if let Some(receiver) = receiver {
            options.extend(receiver.entries());
        }
        Self {
            taken: logs.taken.clone(),
            options,
        }
    }

    /// Puts it into a summary: program, inputs and options.
    pub(crate) fn put(&self, summary: &mut Value) {
        let mut inputs = Map::new();
        for t in &self.taken {
            inputs.insert(
                t.what.to_owned(),
                json!({
                    "file": t.file, "sha256": t.sha256, "rows": t.rows,
                    "equipment": t.leg.map(|l| l.equipment), "drive": t.leg.map(|l| l.drive),
                    "leg": t.leg.map(|l| l.leg),
                }),
            );
        }
        let options: Map<String, Value> = self
            .options
            .iter()
            .map(|(key, _, value)| ((*key).to_owned(), value.clone()))
            .collect();
        summary["software"] = json!(summary::software());
        summary["inputs"] = Value::Object(inputs);
        summary["options"] = Value::Object(options);
    }

    /// For a page: term and value.
    pub(crate) fn rows(&self) -> Vec<[String; 2]> {
        let mut out = vec![["Program".to_owned(), summary::software()]];
        for t in &self.taken {
            let ids = t.leg.map_or_else(String::new, |l| {
                format!(
                    ", equipment {}, drive {}, leg {}",
                    l.equipment, l.drive, l.leg
                )
            });
            let what = match t.what {
                "fixes" => "Log of fixes",
                "motions" => "Log of inertial samples",
                _ => "Log of the reference",
            };
            out.push([
                what.to_owned(),
                format!("{}: {} rows{ids}; SHA-256 {}", t.file, t.rows, t.sha256),
            ]);
        }
        let words = |key: &str, value: &Value| match value {
            Value::Null if key.ends_with("_s") => "no".to_owned(),
            Value::Null => "any: the log has one".to_owned(),
            Value::Bool(true) => "yes".to_owned(),
            Value::Bool(false) => "no".to_owned(),
            Value::String(text) => text.clone(),
            Value::Array(list) => {
                let each: Vec<String> = list.iter().map(ToString::to_string).collect();
                each.join(", ")
            }
            other => other.to_string(),
        };
        out.extend(
            self.options
                .iter()
                .map(|(key, what, value)| [(*what).to_owned(), words(key, value)]),
        );
        out
    }
}
