//! `reconstruct verify`: checksums and digest. Without a key nothing can be said of who made the record.

use std::path::PathBuf;

use reconstruct::export::fixed::hex;
use reconstruct::report::case::Signature;
use reconstruct::report::terminal::ascii;
use serde_json::json;

use crate::cli::load::Loaded;
use crate::cli::{CliError, GAPS, print, print_json};

/// Arguments of `verify`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Record to check (.svb)
    record: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command. Always 3 where it finishes: a broken seal, or an identity that is unproven.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    let loaded = Loaded::open(&args.record)?;
    let case = loaded.case();
    let whole = case.signature != Signature::Broken;
    if args.json {
        print_json(&json!({
            "file": case.file,
            "sha256": hex(&case.file_sha256),
            "seal_sha256": case.seal_sha256.map(|d| hex(&d)),
            "digest_holds": whole,
            "signature": case.signature.name(),
            "identity_proven": false,
            "complete": case.complete(),
            "damage": case.damage,
        }))?;
        return Ok(GAPS);
    }
    let seal = case
        .seal_sha256
        .map_or_else(|| "not readable".to_owned(), |d| hex(&d));
    print(&format!(
        "{}\nfile    SHA-256 {}\nseal    SHA-256 {seal}\ndigest  {}\nidentity unproven: {}\n",
        ascii(case.file),
        hex(&case.file_sha256),
        if whole {
            "holds: every byte is as it was sealed"
        } else {
            "BROKEN"
        },
        match case.signature {
            Signature::Unchecked => "the record is signed, but no key was given to check it with",
            _ if case.replayed() => "a replayed record carries no signature",
            _ => "the record carries no signature",
        }
    ))?;
    Ok(GAPS)
}
