//! `recorder serve`: records read out over a serial line, until a signal ends it.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};

use super::{SOUND, say};
use crate::config::Settings;
use crate::error::RecorderError;
use crate::serve::{Options, serve};

/// Arguments of `serve`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Configuration (TOML); `[serial] token` is what a reader must know.
    #[arg(long)]
    config: PathBuf,
    /// The serial device.
    #[arg(long, value_name = "DEVICE")]
    serial: String,
    /// Bits a second (default: `[serial] baud` of the configuration).
    #[arg(long, value_parser = clap::value_parser!(u32).range(1200..=4_000_000))]
    baud: Option<u32>,
    /// End after one session.
    #[arg(long)]
    once: bool,
}

/// Runs the command.
pub(super) fn run(args: Args, err: &mut impl Write) -> Result<u8, RecorderError> {
    let settings = Settings::load(&args.config)?;
    let serial = settings.serial.ok_or_else(|| RecorderError::Serial {
        device: args.serial.clone(),
        found: format!(
            "{}: expected [serial] with a token, found none",
            args.config.display()
        ),
    })?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGTERM, SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(RecorderError::io(
            "signals",
            "be told of SIGTERM and SIGINT",
        ))?;
    }
    let options = Options {
        device: args.serial,
        baud: args.baud.unwrap_or(serial.baud),
        token: serial.token,
        dir: settings.store.dir,
        once: args.once,
    };
    serve(&options, &stop, &mut |line| say(err, line))?;
    Ok(SOUND)
}
