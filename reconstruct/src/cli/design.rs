//! `reconstruct design`: the expected funnel of a sensor on a manoeuvre.

use std::path::{Path, PathBuf};

use reconstruct::design::expect::study;
use reconstruct::design::grades::{GRADES, grade};
use reconstruct::design::trial::trial;
use reconstruct::design::{
    DataSheet, DesignError, Plan, Settings, Study, json, manoeuvre, page, picture, sheet, table,
};
use reconstruct::run::Model;
use reconstruct::simulate::Class;
use serde_json::json;

use crate::cli::{CliError, SOUND, complain, print, print_json, run, write_file};

/// First seed of the sensors drawn for `--trials`.
const TRIAL_SEED: u64 = 1;
/// Most sets of sensors a sheet.
const MOST_TRIALS: u64 = 10_000;

/// Arguments of `design`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Files are TOML, or JSON with the same keys; --example manoeuvre and --example sheet print one of each \
                  with every key explained. A sheet has the keys and units of the recorder's [imu], [imu.noise] and \
                  [wheels]; a whole configuration of the recorder serves too."
)]
pub(crate) struct Args {
    /// Manoeuvre: a class of `reconstruct simulate` (frontal, oblique, side, rear, ...)
    #[arg(
        long,
        default_value = "frontal",
        value_name = "CLASS",
        conflicts_with = "manoeuvre"
    )]
    class: String,
    /// Seed of the manoeuvre, or of what its file leaves to chance
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Manoeuvre from a file
    #[arg(long, value_name = "FILE")]
    manoeuvre: Option<PathBuf>,
    /// Built-in sensors: navigation, tactical, industrial, consumer or automotive; repeatable; all of them if
    /// neither --grade nor --sheet is given
    #[arg(long = "grade", value_name = "NAME")]
    grades: Vec<String>,
    /// Sensors from a data sheet file; repeatable
    #[arg(long = "sheet", value_name = "FILE")]
    sheets: Vec<PathBuf>,
    /// Model whose covariance is read
    #[arg(long, default_value = "refined", value_name = "MODEL", value_parser = run::model)]
    model: Model,
    /// Road limits: h1, none, or a JSON file of limits
    #[arg(long, default_value = "h1", value_name = "h1|none|FILE")]
    road: String,
    /// Leave the car's wheel speeds out
    #[arg(long)]
    no_wheels: bool,
    /// Confidence of every bound
    #[arg(long, default_value = "0.95", value_name = "SHARE", value_parser = run::confidence)]
    confidence: f64,
    /// Try the prediction: draw so many sets of sensors from each sheet and compare with the truth
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u64).range(0..=MOST_TRIALS))]
    trials: u64,
    /// Folder for design.json, design.svg and design.html; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print an example file: manoeuvre or sheet
    #[arg(long, value_name = "KIND", value_parser = ["manoeuvre", "sheet"])]
    example: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command; gives the exit code.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    if let Some(kind) = &args.example {
        let text = if kind == "sheet" {
            sheet::EXAMPLE
        } else {
            manoeuvre::EXAMPLE
        };
        if args.json {
            let table: toml::Table = toml::from_str(text).unwrap_or_default();
            print_json(&json!(table))?;
        } else {
            print(text)?;
        }
        return Ok(SOUND);
    }
    let plan = plan(args)?;
    let sheets = sheets(args)?;
    let settings = Settings {
        model: args.model,
        road: run::road(&args.road)?,
        wheels: !args.no_wheels,
        confidence: args.confidence,
    };
    let mut study = study(plan, &sheets, settings)?;
    for at in 0..study.expected.len() {
        if args.trials == 0 {
            break;
        }
        let expected = &study.expected[at];
        complain(
            "progress",
            &format!(
                "{}: trying {} sets of sensors",
                expected.sheet.name, args.trials
            ),
        );
        let tried = trial(
            &study.plan,
            expected,
            &study.settings,
            TRIAL_SEED,
            args.trials,
        )?;
        study.trials.push(tried);
    }
    let mut value = json::study(&study);
    let files = match &args.out {
        Some(out) => write(&study, &value, out)?,
        None => Vec::new(),
    };
    if args.json {
        value["files"] = json!(files);
        print_json(&value)?;
    } else {
        let mut screen = table::screen(&study);
        if !files.is_empty() {
            screen.push('\n');
        }
        for file in &files {
            screen.push_str(file);
            screen.push('\n');
        }
        print(&screen)?;
    }
    Ok(SOUND)
}

fn plan(args: &Args) -> Result<Plan, DesignError> {
    match &args.manoeuvre {
        Some(file) => Plan::load(file, args.seed),
        None => Ok(Plan::drawn(args.class.parse::<Class>()?, args.seed)),
    }
}

/// Sheets in the order asked for, grades before files; a name that comes twice gets a number.
fn sheets(args: &Args) -> Result<Vec<DataSheet>, DesignError> {
    let mut names: Vec<&str> = args.grades.iter().map(String::as_str).collect();
    if names.is_empty() && args.sheets.is_empty() {
        names.extend(GRADES);
    }
    let mut list = Vec::new();
    for name in names {
        list.push(grade(name).ok_or_else(|| DesignError::UnknownGrade(name.to_owned()))?);
    }
    for file in &args.sheets {
        list.push(DataSheet::load(file)?);
    }
    let mut seen: Vec<String> = Vec::new();
    for sheet in &mut list {
        let mut name = sheet.name.clone();
        let mut count = 1;
        while seen.contains(&name) {
            count += 1;
            name = format!("{} {count}", sheet.name);
        }
        seen.push(name.clone());
        sheet.name = name;
    }
    Ok(list)
}

fn write(study: &Study, value: &serde_json::Value, out: &Path) -> Result<Vec<String>, CliError> {
    std::fs::create_dir_all(out).map_err(|error| CliError::file(out, error))?;
    let picture = picture::Picture::draw(study);
    let files = [
        ("design.json", format!("{value:#}\n")),
        ("design.svg", picture.file()),
        ("design.html", page::html(study, &picture)),
    ];
    let mut written = Vec::new();
    for (name, text) in &files {
        let path = out.join(name);
        write_file(&path, text.as_bytes())?;
        written.push(path.display().to_string());
    }
    Ok(written)
}
