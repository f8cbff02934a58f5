//! `reconstruct simulate`: a seeded crash as log, DBC, configuration and truth, and what a satellite receiver says.

use std::io::{self, Write};
use std::path::PathBuf;

use reconstruct::simulate::fixes::Receiver;
use reconstruct::simulate::{Class, Grade, Scenario, SimulateError, Simulated, simulate};
use serde_json::json;

/// Make a simulated crash: CAN log, DBC, recorder configuration, truth and facts.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// What happens: see --list
    #[arg(long, required_unless_present = "list", value_name = "CLASS")]
    class: Option<String>,
    /// Seed: the same seed gives the same bytes
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Sensors: tactical, consumer or perfect
    #[arg(long, default_value = "consumer", value_name = "GRADE")]
    grade: String,
    /// Folder to write into; made if it is not there
    #[arg(long, default_value = ".", value_name = "DIR")]
    out: PathBuf,
    /// Rate of the IMU frames, Hz: 100, 125, 200, 250, 400, 500 or 1000
    #[arg(long, default_value_t = 100, value_name = "HZ")]
    imu_hz: usize,
    /// Also a satellite receiver, a fix a second: NAME.nmea for `recorder replay --nmea`, its table `[gnss]` in the
    /// configuration, the place of the truth in the facts
    #[arg(long)]
    receiver: bool,
    /// List the classes
    #[arg(long)]
    list: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Why `simulate` failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// The scenario or its files.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// Standard output.
    #[error("standard output: {0}")]
    Print(#[from] io::Error),
}

impl Error {
    /// Exit code: 2 for a wrong argument, else 1.
    pub(crate) const fn exit_code(&self) -> u8 {
        match self {
            Self::Simulate(
                SimulateError::UnknownClass(_)
                | SimulateError::UnknownGrade(_)
                | SimulateError::ImuRate(_),
            ) => 2,
            Self::Simulate(_) | Self::Print(_) => 1,
        }
    }
}

/// Runs the command; gives the exit code.
///
/// # Errors
/// [`Error`] if an argument names nothing known or a file cannot be written.
pub(crate) fn run(args: &Args) -> Result<u8, Error> {
    let mut out = io::stdout().lock();
    let Some(class) = args.class.as_ref().filter(|_| !args.list) else {
        list(&mut out, args.json)?;
        return Ok(0);
    };
    let class: Class = class.parse()?;
    let grade: Grade = args.grade.parse()?;
    let mut scenario = Scenario::draw_graded(class, args.seed, grade);
    scenario.imu_hz = args.imu_hz;
    let simulated = simulate(&scenario)?;
    let receiver = args.receiver.then(|| Receiver {
        clock_off_s: Some(0.0),
        ..Receiver::default()
    });
    let paths = simulated.write(&args.out, receiver.as_ref())?;
    if args.json {
        let files: Vec<String> = paths
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        writeln!(
            out,
            "{:#}",
            json!({ "files": files, "facts": simulated.truth.facts })
        )?;
    } else {
        describe(&mut out, &simulated)?;
        for path in paths {
            writeln!(out, "{}", path.display())?;
        }
    }
    Ok(0)
}

fn list(out: &mut impl Write, as_json: bool) -> io::Result<()> {
    if as_json {
        let classes: Vec<_> = Class::ALL
            .iter()
            .map(|class| json!({ "class": class.name(), "about": class.about() }))
            .collect();
        return writeln!(out, "{:#}", json!({ "classes": classes }));
    }
    for class in Class::ALL {
        writeln!(out, "{:<8} {}", class.name(), class.about())?;
    }
    Ok(())
}

fn describe(out: &mut impl Write, simulated: &Simulated) -> io::Result<()> {
    let facts = &simulated.truth.facts;
    writeln!(
        out,
        "{}: {:.1} s, {:.0} m, {} frames, {} sensors",
        simulated.name(),
        facts.duration_s,
        facts.distance_m,
        simulated.frames.len(),
        facts.grade
    )?;
    for impact in &facts.impacts {
        writeln!(
            out,
            "impact at {:.3} s: {:.1} km/h, delta-V {:.1} km/h from {:.0} deg, spin {:.0} deg/s",
            impact.t_s,
            impact.speed_mps * 3.6,
            impact.cg.resultant_mps * 3.6,
            impact.cg.pdof_deg,
            impact.spin_degps
        )?;
    }
    writeln!(
        out,
        "rest from {:.2} s, trigger at {:.3} s",
        facts.rest_t_s, facts.trigger_at_s
    )
}
