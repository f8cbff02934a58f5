//! `reconstruct gnss outages`: fixes of a log withheld as in the experiments of S00.

use std::path::PathBuf;

use clap::ValueEnum;
use reconstruct::gnss::drive::{Drive, LONGEST_HOLE_S};
use reconstruct::gnss::experiments::Experiment;
use reconstruct::gnss::logs;
use reconstruct::gnss::outages::{Material, study};
use reconstruct::gnss::pictures::{page, study as picture};
use reconstruct::gnss::stop::Detector;
use reconstruct::report::svg;
use serde_json::json;

use crate::cli::gnss::failed;
use crate::cli::gnss_logs::{self, LogArgs};
use crate::cli::gnss_receiver::ReceiverArgs;
use crate::cli::gnss_told::Told;
use crate::cli::{CliError, GAPS, SOUND, complain, print, print_json, write_file};

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Filters {
    /// Both
    Both,
    /// Ours
    Refined,
    /// That of S00
    Published,
}

#[derive(Debug, clap::Args)]
#[command(after_help = gnss_logs::EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    logs: LogArgs,
    /// A fix each so many seconds, for each of them
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "5,10,15,30",
        value_name = "SECONDS"
    )]
    lengths: Vec<usize>,
    /// Leave out the windows of 120 s without fixes, without and with the reference's speed
    #[arg(long)]
    no_blind: bool,
    /// Filters
    #[arg(long, value_enum, default_value = "both")]
    filter: Filters,
    /// Folder for outages.html, outages.json and pictures/outages.svg; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    receiver: ReceiverArgs,
}

impl Args {
    /// Options of this command.
    fn entries(&self) -> Vec<(&'static str, &'static str, serde_json::Value)> {
        let filters = match self.filter {
            Filters::Both => "both",
            Filters::Refined => "refined",
            Filters::Published => "published",
        };
        vec![
            ("filter", "Filters", json!(filters)),
            (
                "lengths_s",
                "A fix each so many seconds",
                json!(self.lengths),
            ),
            (
                "blind",
                "Windows of 120 s without fixes, without and with the reference's speed",
                json!(!self.no_blind),
            ),
        ]
    }
}

/// Windows are laid over one drive: of several between holes one has to be chosen.
fn one(drives: &[Drive]) -> Result<Drive, CliError> {
    if let [drive] = drives {
        return Ok(drive.clone());
    }
    let mut spans: Vec<[f64; 2]> = drives.iter().filter_map(Drive::span).collect();
    spans.sort_by(|a, b| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
    let named: Vec<String> = spans
        .iter()
        .take(3)
        .map(|[from, to]| format!("{from:.2} to {to:.2} s"))
        .collect();
    Err(failed(&format!(
        "expected one drive without a hole of more than {LONGEST_HOLE_S} s in its inertial samples, found {}, the longest {}: choose one with --from and --to",
        drives.len(),
        named.join(", ")
    )))
}

pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    if let Some(wrong) = args.lengths.iter().find(|n| !(2..=600).contains(*n)) {
        return Err(failed(&format!(
            "--lengths: expected 2 to 600 s each, found {wrong}"
        )));
    }
    if args.logs.reference.is_none() {
        return Err(failed(
            &"--reference: expected the log of a reference receiver, found none: without one no deviation can be told",
        ));
    }
    let sheet = args.receiver.sheet()?;
    let mut logs = gnss_logs::read(&args.logs)?;
    let axes = args.logs.choice.axes.into();
    let fixed = logs::fixes(&logs.fixes, args.logs.choice.latency, &sheet);
    let drives = logs::drives(&logs.motions, &axes, &fixed).map_err(|e| failed(&e))?;
    let whole = one(&drives)?;
    logs::startable(&whole).map_err(|e| failed(&e))?;
    let plausible = logs.examine(&drives, &fixed, args.logs.choice.latency);
    let found = Detector::default().detect(&whole);
    let known = sheet.heard(&whole, &found);
    let input = logs::published(&logs.motions, &axes, &logs.fixes);
    let mut experiments: Vec<Experiment> =
        args.lengths.iter().map(|n| Experiment::Every(*n)).collect();
    if !args.no_blind {
        experiments.extend([Experiment::Blind, Experiment::ExactSpeed]);
    }
    let material = Material {
        whole: &whole,
        input: &input,
        known: &known,
        reference: &logs.reference,
        latency_s: args.logs.choice.latency,
    };
    let wanted = [
        args.filter != Filters::Refined,
        args.filter != Filters::Published,
    ];
    let study = study(&material, &experiments, wanted).map_err(|e| failed(&e))?;
    for note in &study.notes {
        complain("note", note);
    }
    let notes = logs.notes(&args.logs);
    let folder = args.out.join("pictures");
    std::fs::create_dir_all(&folder).map_err(|e| CliError::file(&folder, e))?;
    let mut said = notes.clone();
    if args.filter != Filters::Published {
        said.insert(0, args.receiver.words());
    }
    let put = Told::new(
        &logs,
        &args.logs,
        (args.filter != Filters::Published).then_some(&args.receiver),
        args.entries(),
    );
    let told = page::Told {
        files: gnss_logs::files(&args.logs),
        notes: said,
        rows: put.rows(),
        ..page::Told::default()
    };
    let html = page::outages(&study, &told);
    write_file(&args.out.join("outages.html"), html.as_bytes())?;
    let drawn = picture::study(&study);
    if !drawn.is_empty() {
        write_file(&folder.join("outages.svg"), svg::file(&drawn).as_bytes())?;
    }
    let mut told = page::study_json(&study);
    told["log_notes"] = json!(notes);
    told["plausibility"] = plausible.json();
    told["receiver"] = args.receiver.json();
    put.put(&mut told);
    write_file(
        &args.out.join("outages.json"),
        format!("{told:#}\n").as_bytes(),
    )?;
    if args.json {
        print_json(&told)?;
    } else {
        print(&format!(
            "Horizontal deviation from the reference; behind the sign \u{b1} standard errors.\n\n{}\n{}\n",
            page::study_text(&study),
            args.out.join("outages.html").display()
        ))?;
    }
    Ok(if study.notes.is_empty() && notes.is_empty() {
        SOUND
    } else {
        GAPS
    })
}
