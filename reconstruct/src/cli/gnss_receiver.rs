//! What our filter takes the receiver to be worth: options of `reconstruct gnss run` and `outages`.

use nalgebra::Vector3;
use reconstruct::gnss::sheet::Sheet;
use serde_json::{Value, json};

use crate::cli::CliError;
use crate::cli::gnss::failed;

/// How much less sure a fix is of its height than of its place, as in the default sheet.
const DOWN: f64 = 1.5;
/// Of its velocity up and down.
const SPEED_DOWN: f64 = 0.7;

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Receiver, for our filter (the log's own larger errors stand)")]
pub(crate) struct ReceiverArgs {
    /// Least standard deviation of a fix north and east, m; its height has one and a half times that
    #[arg(long = "receiver-sd", value_name = "M", default_value_t = Sheet::default().fix_floor.x)]
    sd: f64,
    /// Least standard deviation of a fix's velocity north and east, m/s; up and down it is 0.7 of that
    #[arg(long = "receiver-speed-sd", value_name = "MPS", default_value_t = Sheet::default().fix_speed_floor.x)]
    speed_sd: f64,
    /// Share of a fix's variance that stays from one fix to the next, 0 to 1
    #[arg(long = "receiver-slow-share", value_name = "SHARE", default_value_t = Sheet::default().fix_correlated)]
    slow_share: f64,
    /// Time over which that share stays the same, s
    #[arg(long = "receiver-slow-time", value_name = "SECONDS", default_value_t = Sheet::default().fix_time_s)]
    slow_time: f64,
}

impl ReceiverArgs {
    /// The default sheet with this receiver.
    pub(crate) fn sheet(&self) -> Result<Sheet, CliError> {
        for (name, value, [low, high], unit) in [
            ("--receiver-sd", self.sd, [0.001, 1000.0], " m"),
            ("--receiver-speed-sd", self.speed_sd, [0.001, 100.0], " m/s"),
            ("--receiver-slow-share", self.slow_share, [0.0, 1.0], ""),
            ("--receiver-slow-time", self.slow_time, [0.1, 3600.0], " s"),
        ] {
            if !(low..=high).contains(&value) {
                return Err(failed(&format!(
                    "{name}: expected {low} to {high}{unit}, found {value}"
                )));
            }
        }
        let sd = self.sd;
        Ok(Sheet {
            fix_floor: Vector3::new(sd, sd, DOWN * sd),
            fix_speed_floor: Vector3::new(1.0, 1.0, SPEED_DOWN) * self.speed_sd,
            fix_correlated: self.slow_share,
            fix_time_s: self.slow_time,
            ..Sheet::default()
        })
    }

    /// For a page.
    pub(crate) fn words(&self) -> String {
        format!(
            "Our filter takes the receiver's fixes to have a standard deviation of at least {} m north and east, {} m in height and {} m/s in velocity, {:.0} % of the variance the same for {} s (--receiver-sd and its like).",
            self.sd,
            DOWN * self.sd,
            self.speed_sd,
            100.0 * self.slow_share,
            self.slow_time
        )
    }

    /// For the list of what was told.
    pub(crate) fn entries(&self) -> [(&'static str, &'static str, Value); 4] {
        [
            (
                "receiver_sd_m",
                "Least standard deviation of a fix north and east, m",
                json!(self.sd),
            ),
            (
                "receiver_speed_sd_mps",
                "Least standard deviation of a fix's velocity, m/s",
                json!(self.speed_sd),
            ),
            (
                "receiver_slow_share",
                "Share of a fix's variance that stays",
                json!(self.slow_share),
            ),
            (
                "receiver_slow_time_s",
                "Time over which it stays, s",
                json!(self.slow_time),
            ),
        ]
    }

    /// For a machine.
    pub(crate) fn json(&self) -> Value {
        json!({
            "sd_m": self.sd, "speed_sd_mps": self.speed_sd,
            "slow_share": self.slow_share, "slow_time_s": self.slow_time,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::ReceiverArgs;
    use clap::{Args as _, FromArgMatches as _};
    use reconstruct::gnss::sheet::Sheet;

    fn args(words: &[&str]) -> ReceiverArgs {
        let command = ReceiverArgs::augment_args(clap::Command::new("x"));
        let matches = command.get_matches_from(std::iter::once(&"x").chain(words));
        ReceiverArgs::from_arg_matches(&matches).unwrap()
    }

    #[test]
    fn without_options_the_sheet_is_the_default_one() {
        assert_eq!(args(&[]).sheet().unwrap(), Sheet::default());
        let sheet = args(&["--receiver-sd", "0.5"]).sheet().unwrap();
        assert!((sheet.fix_floor.z - 0.75).abs() < 1e-12);
        assert!(args(&["--receiver-sd", "nan"]).sheet().is_err());
    }
}
