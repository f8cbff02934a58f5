//! Recordings with truth: sealed records, or logs that the recorder is run on.
//!
//! A folder holds, by name:
//! - `NAME.truth.csv`, the truth, in a shape that [`crate::compare::read::truth`] reads;
//! - `NAME.svb`, a record; or `NAME.log` with `NAME.toml`, the recorder's configuration, which may lie in another folder;
//! - `NAME.validate.json`, optional, beside the configuration: `{"trigger_at_s": [58.0], "truth_epoch_s": 1700000000,
//!   "fix_sd_m": 0.1}`: manual triggers, each a window of its own (without: the recorder's own), the Unix time of the
//!   truth's zero (without: from the truth or by matching the speeds), and the noise of a fix per axis.
//!
//! What cannot be used is listed with the reason.

use std::collections::BTreeSet;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use schema::Record;
use serde::Deserialize;

use crate::compare;
use crate::compare::read::{Trajectory, Truth};
use crate::run::{Model, reconstruct};
use crate::validate::fixes::{self, Window};
use crate::validate::sets::options;

/// Noise of a fix if none is stated: satellite positioning with carrier phase, one sigma per axis, m.
const FIX_SD_M: f64 = 0.1;
/// Largest file of any kind that is read, bytes.
const LARGEST: u64 = 1 << 28;
/// Largest sidecar, bytes.
const LARGEST_SIDECAR: u64 = 1 << 20;
/// Most windows of one recording.
const MOST_WINDOWS: usize = 1000;

/// Where recordings are and what plays them.
#[derive(Clone, Debug)]
pub struct FolderPlan {
    /// Folders of recordings.
    pub folders: Vec<PathBuf>,
    /// Where configurations and sidecars are looked for that do not lie beside the log.
    pub configs: Option<PathBuf>,
    /// The recorder.
    pub recorder: PathBuf,
    /// Folder for the records made; the caller removes it.
    pub scratch: PathBuf,
    /// Models.
    pub models: Vec<Model>,
}

/// A recording or window that could not be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unused {
    /// Which.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// The sidecar.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sidecar {
    #[serde(default)]
    trigger_at_s: Vec<f64>,
    truth_epoch_s: Option<f64>,
    fix_sd_m: Option<f64>,
}

impl Sidecar {
    fn parse(text: &str) -> Result<Self, String> {
        let sidecar: Self = serde_json::from_str(text).map_err(|e| {
            format!("expected trigger_at_s, truth_epoch_s and fix_sd_m as JSON, found {e}")
        })?;
        if sidecar.trigger_at_s.len() > MOST_WINDOWS {
            return Err(format!(
                "expected at most {MOST_WINDOWS} triggers, found {}",
                sidecar.trigger_at_s.len()
            ));
        }
        for (name, value, low, high) in sidecar
            .trigger_at_s
            .iter()
            .map(|t| ("trigger_at_s", *t, 0.0, 1e7))
            .chain(
                sidecar
                    .truth_epoch_s
                    .map(|t| ("truth_epoch_s", t, -1e12, 1e12)),
            )
            .chain(sidecar.fix_sd_m.map(|t| ("fix_sd_m", t, 1e-6, 100.0)))
        {
            if !(low..=high).contains(&value) {
                return Err(format!("{name}: expected {low} to {high}, found {value}"));
            }
        }
        Ok(sidecar)
    }
}

/// Scores every recording of the folders; `progress` hears which one is at work.
pub fn run(plan: &FolderPlan, mut progress: impl FnMut(&str)) -> (Vec<Window>, Vec<Unused>) {
    let mut windows = Vec::new();
    let mut unused = Vec::new();
    for folder in &plan.folders {
        let names = match names(folder) {
            Ok(names) => names,
            Err(reason) => {
                unused.push(Unused {
                    name: folder.display().to_string(),
                    reason,
                });
                continue;
            }
        };
        if names.is_empty() {
            unused.push(Unused {
                name: folder.display().to_string(),
                reason: "expected NAME.truth.csv with NAME.svb or NAME.log, found neither"
                    .to_owned(),
            });
        }
        for name in names {
            progress(&name);
            recording(plan, folder, &name, &mut windows, &mut unused);
        }
    }
    (windows, unused)
}

/// Names of the recordings, sorted.
fn names(folder: &Path) -> Result<BTreeSet<String>, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| e.to_string())?;
    let mut names = BTreeSet::new();
    for entry in entries {
        let entry = entry.map_err(|e| e.to_string())?;
        let file = entry.file_name().to_string_lossy().into_owned();
        for end in [".truth.csv", ".svb", ".log"] {
            if let Some(name) = file.strip_suffix(end).filter(|n| !n.is_empty()) {
                names.insert(name.to_owned());
            }
        }
    }
    Ok(names)
}

/// One recording: every window by every model.
fn recording(
    plan: &FolderPlan,
    folder: &Path,
    name: &str,
    windows: &mut Vec<Window>,
    unused: &mut Vec<Unused>,
) {
    let mut fail = |name: String, reason: String| unused.push(Unused { name, reason });
    let (truth, sidecar) = match truth_and_sidecar(plan, folder, name) {
        Ok(found) => found,
        Err(reason) => return fail(name.to_owned(), reason),
    };
    let records = match records(plan, folder, name, &sidecar) {
        Ok(records) => records,
        Err(reason) => return fail(name.to_owned(), reason),
    };
    for (label, record) in records {
        let record = match record {
            Ok(record) => record,
            Err(reason) => {
                fail(label, reason);
                continue;
            }
        };
        for model in &plan.models {
            match window(&record, *model, &truth, &sidecar, &label) {
                Ok(window) => windows.push(window),
                Err(reason) => fail(format!("{label} by {}", model.name()), reason),
            }
        }
    }
}

fn truth_and_sidecar(
    plan: &FolderPlan,
    folder: &Path,
    name: &str,
) -> Result<(Truth, Sidecar), String> {
    let path = folder.join(format!("{name}.truth.csv"));
    if !path.is_file() {
        return Err(format!("expected {name}.truth.csv beside it, found none"));
    }
    small_enough(&path, LARGEST)?;
    let truth = compare::read::truth(&path).map_err(|e| e.to_string())?;
    let Some(path) = beside(plan, folder, &format!("{name}.validate.json")) else {
        return Ok((truth, Sidecar::default()));
    };
    small_enough(&path, LARGEST_SIDECAR)?;
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let sidecar = Sidecar::parse(&text).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok((truth, sidecar))
}

fn small_enough(path: &Path, largest: u64) -> Result<(), String> {
    let bytes = std::fs::metadata(path)
        .map_err(|e| format!("{}: {e}", path.display()))?
        .len();
    if bytes > largest {
        return Err(format!(
            "{}: expected at most {largest} bytes, found {bytes}",
            path.display()
        ));
    }
    Ok(())
}

/// A file beside the recording, else in the folder of the configurations.
fn beside(plan: &FolderPlan, folder: &Path, file: &str) -> Option<PathBuf> {
    let own = folder.join(file);
    let other = plan.configs.as_ref().map(|dir| dir.join(file));
    std::iter::once(own)
        .chain(other)
        .find(|path| path.is_file())
}

/// A record with the window's name, or why there is none.
type Named = (String, Result<Record, String>);

fn records(
    plan: &FolderPlan,
    folder: &Path,
    name: &str,
    sidecar: &Sidecar,
) -> Result<Vec<Named>, String> {
    let sealed = folder.join(format!("{name}.svb"));
    if sealed.is_file() {
        return Ok(vec![(name.to_owned(), read(&sealed))]);
    }
    let log = folder.join(format!("{name}.log"));
    if !log.is_file() {
        return Err(format!(
            "expected {name}.svb or {name}.log beside the truth, found neither"
        ));
    }
    let config = beside(plan, folder, &format!("{name}.toml"))
        .ok_or_else(|| format!("expected {name}.toml, the recorder's configuration, found none"))?;
    let windows: Vec<Option<f64>> = if sidecar.trigger_at_s.is_empty() {
        vec![None]
    } else {
        sidecar.trigger_at_s.iter().copied().map(Some).collect()
    };
    let mut out = Vec::new();
    for trigger in windows {
        let label = trigger.map_or(name.to_owned(), |t| format!("{name} at {t} s"));
        match replay(plan, &config, &log, trigger) {
            Ok(found) if found.len() == 1 => {
                out.extend(found.into_iter().map(|r| (label.clone(), r)));
            }
            Ok(found) => out.extend(
                found
                    .into_iter()
                    .enumerate()
                    .map(|(i, r)| (format!("{label}, record {}", i + 1), r)),
            ),
            Err(reason) => out.push((label, Err(reason))),
        }
    }
    Ok(out)
}

fn read(path: &Path) -> Result<Record, String> {
    small_enough(path, LARGEST)?;
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let (record, _) = Record::read(&bytes).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(record)
}

/// Runs the recorder on a log and reads what it sealed.
fn replay(
    plan: &FolderPlan,
    config: &Path,
    log: &Path,
    trigger: Option<f64>,
) -> Result<Vec<Result<Record, String>>, String> {
    let out = plan.scratch.join("window");
    let _ = std::fs::remove_dir_all(&out);
    std::fs::create_dir_all(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    let mut command = Command::new(&plan.recorder);
    command
        .arg("replay")
        .arg("--config")
        .arg(config)
        .arg("--out")
        .arg(&out);
    if let Some(t) = trigger {
        command.arg("--trigger-at").arg(t.to_string());
    }
    // What it says goes to a file: it may be much.
    let said = plan.scratch.join("said.txt");
    let file = std::fs::File::create(&said).map_err(|e| format!("{}: {e}", said.display()))?;
    let ended = command
        .arg(log)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(file)
        .status()
        .map_err(|e| {
            format!(
                "the recorder {}: {e}; see --recorder",
                plan.recorder.display()
            )
        })?;
    let mut paths: Vec<PathBuf> = std::fs::read_dir(&out)
        .map_err(|e| format!("{}: {e}", out.display()))?
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "svb"))
        .collect();
    paths.sort();
    let records: Vec<Result<Record, String>> = paths.iter().map(|path| read(path)).collect();
    if records.is_empty() {
        return Err(format!(
            "the recorder sealed no record ({ended}): {}",
            last_line(&said)
        ));
    }
    Ok(records)
}

/// The last line of a file of text, of its first megabyte.
fn last_line(path: &Path) -> String {
    let mut bytes = Vec::new();
    let read = std::fs::File::open(path)
        .and_then(|file| file.take(LARGEST_SIDECAR).read_to_end(&mut bytes));
    let text = String::from_utf8_lossy(&bytes);
    match (read, text.lines().last()) {
        (Ok(_), Some(line)) => line.trim().to_owned(),
        _ => "nothing said".to_owned(),
    }
}

fn window(
    record: &Record,
    model: Model,
    truth: &Truth,
    sidecar: &Sidecar,
    label: &str,
) -> Result<Window, String> {
    let result = reconstruct(record, &options(model)).map_err(|e| e.to_string())?;
    let trajectory = Trajectory::of(&result.states);
    fixes::window(
        label,
        &result,
        &trajectory,
        truth,
        sidecar.truth_epoch_s,
        sidecar.fix_sd_m.unwrap_or(FIX_SD_M),
    )
}

#[cfg(test)]
mod tests {
    use super::Sidecar;

    #[test]
    fn sidecars_say_what_is_wrong_with_them() {
        let good = Sidecar::parse("{\"trigger_at_s\": [58, 121.8], \"truth_epoch_s\": 1700000000}");
        assert_eq!(good.unwrap().trigger_at_s, [58.0, 121.8]);
        assert_eq!(Sidecar::parse("{}").unwrap(), Sidecar::default());
        for (text, expected) in [
            ("", "as JSON"),
            ("[1]", "as JSON"),
            ("{\"trigger\": 1}", "unknown field `trigger`"),
            ("{\"trigger_at_s\": [-1]}", "trigger_at_s: expected 0"),
            ("{\"trigger_at_s\": [1e300]}", "trigger_at_s: expected 0"),
            ("{\"fix_sd_m\": 0}", "fix_sd_m: expected"),
        ] {
            let found = Sidecar::parse(text).unwrap_err();
            assert!(found.contains(expected), "{text}: {found}");
        }
    }
}
