//! `reconstruct run`: from a record to everything a person sees.

use std::path::{Path, PathBuf};

use reconstruct::ReconstructError;
use reconstruct::export::{ellipse, funnel, trajectory};
use reconstruct::findings::RestPose;
use reconstruct::map::network::Traffic;
use reconstruct::map::place::{self, Job, RestPoint};
use reconstruct::map::roads::Roads;
use reconstruct::report::pictures::Pictures;
use reconstruct::report::{page, summary, terminal};
use reconstruct::road::RoadLimits;
use reconstruct::run::{Model, Options, Road, reconstruct};
use reconstruct::smooth::Smoother;
use serde_json::json;

use crate::cli::decrypt::Identity;
use crate::cli::load::Loaded;
use crate::cli::{CliError, GAPS, SOUND, print, print_json, write_file};

/// Arguments of `run`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Record to reconstruct (.svb)
    record: PathBuf,
    #[command(flatten)]
    identity: Identity,
    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Model of the trajectory: refined, nine-state, published or dead-reckoning
    #[arg(long, default_value = "refined", value_name = "MODEL", value_parser = model)]
    model: Model,
    /// Road limits: h1, none, or a JSON file of limits
    #[arg(long, default_value = "h1", value_name = "h1|none|FILE")]
    road: String,
    /// Rest pose
    #[arg(help = "Where the car came to rest: LAT,LON,HEADING_DEG[,SD_M,SD_DEG], WGS 84; sds 0.5 m and 1 deg if not given", long, allow_hyphen_values = true, value_name = "LAT,LON,HEADING_DEG[,SD_M,SD_DEG]", value_parser = rest_pose)]
    rest_pose: Option<RestPose>,
    /// Road map to lay the path on: GeoJSON, or OpenStreetMap XML (.osm); needs --rest-point
    #[arg(
        long,
        value_name = "FILE",
        requires = "rest_point",
        conflicts_with = "rest_pose"
    )]
    map: Option<PathBuf>,
    /// Rough place
    #[arg(help = "Roughly where the car came to rest: LAT,LON[,SD_M], WGS 84; sd 30 m if not given", long, allow_hyphen_values = true, value_name = "LAT,LON[,SD_M]", value_parser = rest_point, requires = "map")]
    rest_point: Option<RestPoint>,
    /// Rough heading
    #[arg(help = "Heading of the car at rest if roughly known: DEG[,SD_DEG]; sd 20 degrees if not given", long, allow_hyphen_values = true, value_name = "DEG[,SD_DEG]", value_parser = rest_heading, requires = "map")]
    rest_heading: Option<RestHeading>,
    /// Side of the road that traffic keeps to: right or left
    #[arg(long, default_value = "right", value_name = "SIDE", value_parser = traffic)]
    traffic: Traffic,
    /// Smoother, where the model has one: rts (a sweep), batch (all epochs at once) or none
    #[arg(long, default_value = "rts", value_name = "rts|batch|none", value_parser = smoother)]
    smoother: Smoother,
    /// Do not lay the path on the satellite fixes of the record
    #[arg(long)]
    no_fixes: bool,
    /// Confidence of every bound and of the funnel
    #[arg(long, default_value = "0.95", value_name = "SHARE", value_parser = confidence)]
    confidence: f64,
    /// Start of the window, seconds from the first trigger
    #[arg(long, allow_hyphen_values = true, value_name = "SECONDS", value_parser = seconds)]
    from: Option<f64>,
    /// End of the window, seconds from the first trigger
    #[arg(long, allow_hyphen_values = true, value_name = "SECONDS", value_parser = seconds)]
    to: Option<f64>,
    /// Length of the reaction-window table before the impact, 0 to 30 s
    #[arg(long, default_value = "5", value_name = "SECONDS", value_parser = reaction)]
    reaction: f64,
    /// Print the summary as JSON instead of the screen
    #[arg(long)]
    json: bool,
}

/// A model on the command line.
pub(crate) fn model(text: &str) -> Result<Model, String> {
    Model::ALL
        .into_iter()
        .find(|model| model.name() == text)
        .ok_or_else(|| "expected refined, nine-state, published or dead-reckoning".to_owned())
}

fn smoother(text: &str) -> Result<Smoother, String> {
    [Smoother::Rts, Smoother::Batch, Smoother::None]
        .into_iter()
        .find(|s| s.name() == text)
        .ok_or_else(|| "expected rts, batch or none".to_owned())
}

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("expected a number, found {text:?}")),
    }
}

/// Seconds on the command line.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    number(text)
}

/// A confidence on the command line.
pub(crate) fn confidence(text: &str) -> Result<f64, String> {
    let share = number(text)?;
    if (0.01..=0.9999).contains(&share) {
        Ok(share)
    } else {
        Err("expected a share from 0.01 to 0.9999".to_owned())
    }
}

fn reaction(text: &str) -> Result<f64, String> {
    let length = number(text)?;
    if (0.0..=30.0).contains(&length) {
        Ok(length)
    } else {
        Err("expected 0 to 30 seconds".to_owned())
    }
}

/// Heading at rest and its sd, degrees.
#[derive(Clone, Copy, Debug)]
struct RestHeading([f64; 2]);

fn traffic(text: &str) -> Result<Traffic, String> {
    match text {
        "right" => Ok(Traffic::Right),
        "left" => Ok(Traffic::Left),
        _ => Err("expected right or left".to_owned()),
    }
}

/// Numbers between commas, the last one left out or given; each within its range.
fn list<const N: usize>(
    text: &str,
    last: f64,
    ranges: [(&str, f64, f64); N],
) -> Result<[f64; N], String> {
    let parts = text
        .split(',')
        .map(number)
        .collect::<Result<Vec<f64>, String>>()?;
    if parts.len() != N && parts.len() + 1 != N {
        return Err(format!(
            "expected {} or {N} numbers, found {}",
            N - 1,
            parts.len()
        ));
    }
    let mut out = [last; N];
    out[..parts.len()].copy_from_slice(&parts);
    for ((name, low, high), value) in ranges.iter().zip(out) {
        if !(*low..=*high).contains(&value) {
            return Err(format!("{name}: expected {low} to {high}, found {value}"));
        }
    }
    Ok(out)
}

fn rest_point(text: &str) -> Result<RestPoint, String> {
    let ranges = [
        ("latitude", -90.0, 90.0),
        ("longitude", -180.0, 180.0),
        ("sd in metres", 0.1, 500.0),
    ];
    list(text, 30.0, ranges).map(|[latitude_deg, longitude_deg, sd_m]| RestPoint {
        latitude_deg,
        longitude_deg,
        sd_m,
    })
}

fn rest_heading(text: &str) -> Result<RestHeading, String> {
    let ranges = [("heading", -360.0, 360.0), ("sd in degrees", 0.1, 90.0)];
    list(text, 20.0, ranges).map(RestHeading)
}

fn rest_pose(text: &str) -> Result<RestPose, String> {
    let parts = text
        .split(',')
        .map(number)
        .collect::<Result<Vec<f64>, String>>()?;
    let (latitude_deg, longitude_deg, heading_deg, sd_m, sd_deg) = match parts.as_slice() {
        [lat, lon, heading] => (*lat, *lon, *heading, 0.5, 1.0),
        [lat, lon, heading, sd_m, sd_deg] => (*lat, *lon, *heading, *sd_m, *sd_deg),
        other => {
            return Err(format!(
                "expected three or five numbers, found {}",
                other.len()
            ));
        }
    };
    for (name, value, low, high) in [
        ("latitude", latitude_deg, -90.0, 90.0),
        ("longitude", longitude_deg, -180.0, 180.0),
        ("heading", heading_deg, -360.0, 360.0),
        ("sd in metres", sd_m, 0.0, 1000.0),
        ("sd in degrees", sd_deg, 0.0, 180.0),
    ] {
        if !(low..=high).contains(&value) {
            return Err(format!("{name}: expected {low} to {high}, found {value}"));
        }
    }
    Ok(RestPose {
        latitude_deg,
        longitude_deg,
        heading_deg,
        sd_m,
        sd_deg,
    })
}

/// Road limits on the command line.
pub(crate) fn road(text: &str) -> Result<Road, ReconstructError> {
    match text {
        "h1" => Ok(Road::H1),
        "none" => Ok(Road::None),
        file => Ok(Road::File(RoadLimits::load(Path::new(file))?)),
    }
}

/// Runs the command; gives the exit code.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    let options = Options {
        model: args.model,
        road: road(&args.road)?,
        rest_pose: args.rest_pose,
        confidence: args.confidence,
        from_s: args.from,
        to_s: args.to,
        reaction_s: args.reaction,
        smoother: args.smoother,
        fixes: !args.no_fixes,
        ..Options::default()
    };
    let loaded = Loaded::open(&args.record, &args.identity)?;
    let case = loaded.case();
    let mut result = match args.map.as_deref().zip(args.rest_point) {
        Some((map, point)) => place::reconstruct_on(
            &loaded.record,
            &options,
            &Job {
                roads: Roads::load(map)?,
                point,
                heading: args.rest_heading.map(|h| h.0),
                traffic: args.traffic,
            },
        )?,
        None => reconstruct(&loaded.record, &options)?,
    };
    place::lay(&mut result);
    std::fs::create_dir_all(&args.out).map_err(|error| CliError::file(&args.out, error))?;
    let summary = summary::summary(&result, &case);
    let outline = ellipse::outline(&result.states, result.rest_pose.as_ref(), result.confidence);
    let pictures = Pictures::draw(&result, &outline);
    let funnel_name = funnel::file_name(&result);
    let mut files = vec![
        ("trajectory.csv", trajectory::csv(&result.states)),
        ("summary.json", format!("{summary:#}\n")),
        (
            funnel_name,
            format!("{}\n", funnel::collection(&result, &outline)),
        ),
        ("path.svg", pictures.path_file()),
        ("motion.svg", pictures.motion_file()),
        ("report.html", page::html(&result, &case, &pictures)),
    ];
    let paths = &result.details.paths;
    if !paths.places.is_empty() {
        files.push(("sample_paths.csv", trajectory::sample_paths(paths)));
    }
    for (name, text) in &files {
        write_file(&args.out.join(name), text.as_bytes())?;
    }
    // A file of an earlier run (a funnel in the other frame, paths of another model) would contradict the rest of the folder.
    for stale in ["funnel.geojson", "funnel.local.json", "sample_paths.csv"] {
        let path = args.out.join(stale);
        if files.iter().all(|(name, _)| *name != stale) && path.is_file() {
            std::fs::remove_file(&path).map_err(|error| CliError::file(&path, error))?;
        }
    }
    let code = if summary::sound(&result, &case) {
        SOUND
    } else {
        GAPS
    };
    let path = |name: &str| args.out.join(name).display().to_string();
    if args.json {
        let mut printed = summary;
        printed["files"] = json!(files.iter().map(|(name, _)| path(name)).collect::<Vec<_>>());
        printed["exit_code"] = json!(code);
        print_json(&printed)?;
    } else {
        let shown = ["path.svg", "motion.svg", "report.html"].map(path);
        print(&terminal::screen(&result, &case, &shown, code))?;
    }
    Ok(code)
}

#[cfg(test)]
mod tests {
    use super::{
        Smoother, confidence, model, reaction, rest_heading, rest_point, rest_pose, smoother,
        traffic,
    };

    #[test]
    fn arguments() {
        let pose = rest_pose("-33.86,151.2,270").unwrap();
        assert!((pose.latitude_deg + 33.86).abs() < 1e-12 && (pose.sd_m - 0.5).abs() < 1e-12);
        assert!((rest_pose("59.9,10.7,-90,0.1,2").unwrap().sd_deg - 2.0).abs() < 1e-12);
        for wrong in [
            "",
            "1,2",
            "1,2,3,4",
            "91,0,0",
            "0,0,nan",
            "0,181,0",
            "0,0,0,-1,0",
        ] {
            assert!(rest_pose(wrong).is_err(), "{wrong}");
        }
        let point = rest_point("-33.86,-151.2").unwrap();
        assert!((point.latitude_deg + 33.86).abs() < 1e-12 && (point.sd_m - 30.0).abs() < 1e-12);
        assert!((rest_heading("-90,5").unwrap().0[1] - 5.0).abs() < 1e-12);
        for wrong in ["", "1", "91,0", "0,0,0", "0,0,1,2", "x,y"] {
            assert!(rest_point(wrong).is_err(), "{wrong}");
        }
        assert!(rest_heading("1,0").is_err() && traffic("up").is_err());
        assert!(model("refined").is_ok() && model("best").is_err());
        assert!(reaction("31").is_err() && reaction("-1").is_err() && reaction("30").is_ok());
        assert_eq!(smoother("batch"), Ok(Smoother::Batch));
        assert!(
            smoother("kalman")
                .unwrap_err()
                .contains("rts, batch or none")
        );
        assert!(confidence("1").is_err() && confidence("0.5").is_ok());
    }
}
