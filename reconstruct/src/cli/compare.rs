//! `reconstruct compare`: a trajectory against the truth.

use std::path::PathBuf;

use reconstruct::compare::align::Align;
use reconstruct::compare::{self, Options, read, show};

use crate::cli::{CliError, SOUND, print, print_json, run};

/// Arguments of `compare`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The trajectory of a run
    #[arg(value_name = "TRAJECTORY.csv")]
    trajectory: PathBuf,
    /// The truth
    #[arg(
        value_name = "TRUTH.csv",
        help = "Truth: t_s with north_m, east_m, speed_mps, heading_deg (same frame), or with ref_n_m, ref_e_m, ref_speed_mps"
    )]
    truth: PathBuf,
    /// Epoch of the truth
    #[arg(long, help = "Unix time of t_s = 0 in the truth; if neither this nor a column unix_s is there, the speeds are matched", allow_hyphen_values = true, value_name = "UNIX_S", value_parser = run::seconds)]
    truth_epoch: Option<f64>,
    /// Lay the path on the truth by: rest (fixes 3 to 30 m before rest), none (one frame), fit (all fixes)
    #[arg(long, value_name = "HOW")]
    align: Option<How>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum How {
    Rest,
    None,
    Fit,
}

/// Runs the command; gives the exit code.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    let trajectory = read::trajectory(&args.trajectory)?;
    let truth = read::truth(&args.truth)?;
    let align = args.align.map(|how| match how {
        How::Rest => Align::Rest,
        How::None => Align::None,
        How::Fit => Align::Fit,
    });
    let options = Options {
        truth_epoch_s: args.truth_epoch,
        align,
    };
    let result = compare::compare(&trajectory, &truth, &options)?;
    if args.json {
        print_json(&show::json(&result))?;
    } else {
        print(&show::screen(&result))?;
    }
    Ok(SOUND)
}
