//! The five files of a simulated crash.

use std::fs;
use std::path::{Path, PathBuf};

use super::{SimulateError, Simulated};

impl Simulated {
    /// Facts of the events as JSON.
    ///
    /// # Errors
    /// [`SimulateError::Write`] if the facts cannot be put into words, which no finite fact does.
    pub fn facts_json(&self) -> Result<String, SimulateError> {
        serde_json::to_string_pretty(&self.truth.facts)
            .map(|text| text + "\n")
            .map_err(|error| SimulateError::Write {
                path: "facts".to_owned(),
                message: error.to_string(),
            })
    }

    /// Writes `NAME.log`, `NAME.dbc`, `NAME.toml`, `NAME.truth.csv` and `NAME.facts.json` into `folder`,
    /// which is made if it is not there; gives the paths in this order.
    ///
    /// # Errors
    /// [`SimulateError::Write`] with the path that could not be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, SimulateError> {
        let name = self.name();
        let dbc = format!("{name}.dbc");
        let failed = |path: &Path, error: &std::io::Error| SimulateError::Write {
            path: path.display().to_string(),
            message: error.to_string(),
        };
        fs::create_dir_all(folder).map_err(|error| failed(folder, &error))?;
        let files = [
            (format!("{name}.log"), self.candump()),
            (dbc.clone(), self.dbc()),
            (format!("{name}.toml"), self.config(&dbc)),
            (format!("{name}.truth.csv"), self.truth_csv()),
            (format!("{name}.facts.json"), self.facts_json()?),
        ];
        let mut paths = Vec::with_capacity(files.len());
        for (file, text) in files {
            let path = folder.join(file);
            fs::write(&path, text).map_err(|error| failed(&path, &error))?;
            paths.push(path);
        }
        Ok(paths)
    }
}
