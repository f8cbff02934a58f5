//! `reconstruct fetch`: records off a recorder over a serial line.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

use reconstruct::export::fixed::{hex, utc};
use reconstruct::fetch::link::Link;
use reconstruct::fetch::{self, FetchError, State};
use schema::serial::{Entry, record_number};
use serde_json::{Value, json};
use serialport::{DataBits, FlowControl, Parity, SerialPort, StopBits};

use crate::cli::{CliError, GAPS, SOUND, complain, print, print_json};

/// The token, where no file is named.
const VARIABLE: &str = "SVARTBOKS_TOKEN";
/// Longest token, bytes; a file with more is another file.
const LONGEST_TOKEN: usize = 128;

/// Arguments of `fetch`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The token is that of [serial] in the recorder's configuration: in --token-file, or in the \
    environment variable SVARTBOKS_TOKEN. Exit codes: 0 all is here, 1 failed, 2 usage, 3 something could not be fetched."
)]
pub(crate) struct Args {
    /// The serial device
    #[arg(long, value_name = "DEVICE")]
    serial: String,
    /// Folder to put the records into
    #[arg(long, value_name = "DIR", required_unless_present = "list")]
    out: Option<PathBuf>,
    /// File that holds the token
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Bits a second
    #[arg(long, default_value_t = 115_200, value_parser = clap::value_parser!(u32).range(1200..=4_000_000))]
    baud: u32,
    /// Only list what the recorder has
    #[arg(long)]
    list: bool,
    /// Fetch the record of this number only; repeatable
    #[arg(long, value_name = "NUMBER", num_args = 1..)]
    record: Vec<u64>,
    /// Give up after so much silence, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 30, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    patience: u64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl From<FetchError> for CliError {
    fn from(error: FetchError) -> Self {
        Self::Fetch(Box::new(error))
    }
}

fn token(args: &Args) -> Result<String, CliError> {
    let text = match &args.token_file {
        Some(path) => std::fs::read_to_string(path).map_err(|error| CliError::file(path, error))?,
        None => std::env::var(VARIABLE).unwrap_or_default(),
    };
    let token = text.trim_end_matches(['\r', '\n']);
    if token.is_empty() || token.len() > LONGEST_TOKEN {
        return Err(CliError::Token {
            place: args.token_file.as_ref().map_or_else(
                || format!("--token-file or {VARIABLE}"),
                |path| path.display().to_string(),
            ),
            found: token.len(),
        });
    }
    Ok(token.to_owned())
}

/// Runs the command; gives the exit code.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    let token = token(args)?;
    let port = serialport::new(&args.serial, args.baud)
        .data_bits(DataBits::Eight)
        .parity(Parity::None)
        .stop_bits(StopBits::One)
        .flow_control(FlowControl::None)
        .exclusive(true)
        .timeout(Duration::from_secs(2))
        .open()
        .map_err(|error| FetchError::Line {
            device: args.serial.clone(),
            source: error.into(),
        })?;
    let patience = Duration::from_secs(args.patience);
    let mut link = Link::new(&args.serial, port, args.baud, &token, patience);
    link.connect()?;
    let entries = fetch::list(&mut link)?;
    let code = if args.list {
        show(args, &entries)?;
        SOUND
    } else {
        fetch_all(args, &mut link, &entries)?
    };
    link.bye();
    Ok(code)
}

fn about(entry: &Entry) -> Value {
    json!({
        "file": entry.name,
        "number": record_number(&entry.name),
        "bytes": entry.length,
        "changed": utc(entry.changed_s.saturating_mul(1_000_000_000)),
        "sha256": hex(&entry.sha256),
    })
}

fn show(args: &Args, entries: &[Entry]) -> Result<(), CliError> {
    if args.json {
        let files: Vec<Value> = entries.iter().map(about).collect();
        return print_json(&json!({ "files": files }));
    }
    for entry in entries {
        let changed = utc(entry.changed_s.saturating_mul(1_000_000_000));
        print(&format!(
            "{}  {} bytes  {changed}  {}\n",
            entry.name,
            entry.length,
            hex(&entry.sha256)
        ))?;
    }
    Ok(())
}

fn fetch_all(
    args: &Args,
    link: &mut Link<Box<dyn SerialPort>>,
    entries: &[Entry],
) -> Result<u8, CliError> {
    let out = args.out.clone().unwrap_or_default();
    let mut code = SOUND;
    let mut files = Vec::new();
    for number in &args.record {
        if !entries
            .iter()
            .any(|e| record_number(&e.name) == Some(*number))
        {
            complain(
                "error",
                &format!("record {number}: the recorder has none of this number"),
            );
            code = GAPS;
        }
    }
    let chosen = |entry: &&Entry| {
        args.record.is_empty()
            || record_number(&entry.name).is_some_and(|number| args.record.contains(&number))
    };
    let mut over = None;
    for entry in entries.iter().filter(chosen) {
        let mut line = about(entry);
        let (state, words) = if over.is_some() {
            code = GAPS;
            ("left", "LEFT".to_owned())
        } else {
            match fetch::file(link, entry, &out, &mut progress(entry)) {
                Ok(State::Had) => ("had", "had".to_owned()),
                Ok(State::Fetched { resumed, fault }) => {
                    line["resumed_bytes"] = json!(resumed);
                    if let Some(fault) = fault {
                        complain("WARNING", &format!("{}: {fault}", entry.name));
                        line["fault"] = json!(fault);
                        code = GAPS;
                    }
                    (
                        "fetched",
                        format!("fetched, {resumed} bytes were here already"),
                    )
                }
                Err(error) => {
                    complain("error", &format!("{}: {error}", entry.name));
                    line["error"] = json!(error.to_string());
                    code = GAPS;
                    if error.ends_all() {
                        over = Some(error);
                    }
                    ("failed", "FAILED".to_owned())
                }
            }
        };
        line["state"] = json!(state);
        files.push(line);
        if !args.json {
            print(&format!(
                "{}  {} bytes  {}  {words}\n",
                entry.name,
                entry.length,
                hex(&entry.sha256)
            ))?;
        }
    }
    if args.json {
        print_json(&json!({ "files": files, "line_bytes": link.received }))?;
    }
    Ok(code)
}

/// Tells on standard error how far it is, where a person looks at it.
fn progress(entry: &Entry) -> impl FnMut(u64) + use<> {
    let (name, length, mut told) = (entry.name.clone(), entry.length, 0);
    move |done| {
        let mut err = std::io::stderr();
        let percent = done.saturating_mul(100) / length.max(1);
        if percent != told && err.is_terminal() {
            told = percent;
            let end = if done >= length { '\n' } else { '\r' };
            let _ = write!(
                err,
                "{name}: {} of {} kB, {percent} %{end}",
                done / 1000,
                length / 1000
            );
            let _ = err.flush();
        }
    }
}
