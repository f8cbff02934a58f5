//! The files of a simulated crash.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::fixes::{Received, Receiver, receive};
use super::{SimulateError, Simulated, nmea};

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
    /// which is made if it is not there; gives the paths in this order. With a satellite receiver also `NAME.nmea`, its table
    /// in the configuration, and where the truth lies on the Earth in the facts.
    ///
    /// # Errors
    /// [`SimulateError::Write`] with the path that could not be written.
    pub fn write(
        &self,
        folder: &Path,
        receiver: Option<&Receiver>,
    ) -> Result<Vec<PathBuf>, SimulateError> {
        let name = self.name();
        let dbc = format!("{name}.dbc");
        let failed = |path: &Path, error: &std::io::Error| SimulateError::Write {
            path: path.display().to_string(),
            message: error.to_string(),
        };
        fs::create_dir_all(folder).map_err(|error| failed(folder, &error))?;
        let (mut config, mut nmea) = (self.config(&dbc), None);
        let mut facts = self.facts_json()?;
        if let Some(receiver) = receiver {
            let utc_offset_ns = self.truth.facts.start_unix_s * 1_000_000_000;
            let received = receive(self, receiver, self.scenario.seed, 0, utc_offset_ns);
            config.push_str(&table(receiver));
            facts = self.placed(&received)?;
            nmea = Some(nmea::log(&received.gnss.fixes, utc_offset_ns));
        }
        let mut files = vec![
            (format!("{name}.log"), self.candump()),
            (dbc, self.dbc()),
            (format!("{name}.toml"), config),
            (format!("{name}.truth.csv"), self.truth_csv()),
            (format!("{name}.facts.json"), facts),
        ];
        files.extend(nmea.map(|text| (format!("{name}.nmea"), text)));
        let mut paths = Vec::with_capacity(files.len());
        for (file, text) in files {
            let path = folder.join(file);
            fs::write(&path, text).map_err(|error| failed(&path, &error))?;
            paths.push(path);
        }
        Ok(paths)
    }

    /// The facts with place and heading of the truth's origin, where the car comes to rest, and the receiver's true delay.
    fn placed(&self, received: &Received) -> Result<String, SimulateError> {
        let failed = |error: serde_json::Error| SimulateError::Write {
            path: "facts".to_owned(),
            message: error.to_string(),
        };
        let mut value = serde_json::to_value(&self.truth.facts).map_err(failed)?;
        let pose = &received.pose;
        value["receiver"] = json!({
            "rest": {
                "latitude_deg": pose.latitude_deg, "longitude_deg": pose.longitude_deg,
                "heading_deg": pose.heading_deg,
            },
            "latency_s": received.latency_s,
        });
        serde_json::to_string_pretty(&value)
            .map(|text| text + "\n")
            .map_err(failed)
    }
}

/// What the recorder is told of a receiver: its data sheet, never the drawn errors.
fn table(receiver: &Receiver) -> String {
    let [x, y, z] = receiver.antenna;
    let sd = receiver.antenna_sd.max(1e-3);
    let [late, late_sd, _] = receiver.latency_s.map(|s| s * 1e3);
    format!(
        "\n[gnss]\ndevice = \"/dev/ttyS0\"\nreceiver = \"simulated\"\nlatency_ms = {late:.1}\nlatency_sd_ms = {late_sd:.1}\n\
         antenna_position_m = [{x:.4}, {y:.4}, {z:.4}]\nantenna_position_sd_m = [{sd:.4}, {sd:.4}, {sd:.4}]\n"
    )
}
