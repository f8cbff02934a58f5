//! `reconstruct verify`: digests, signatures, chain and ledger of records, and what they say of who, when and how.

use std::fmt::Write as _;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use reconstruct::chain::{Book, Finding, Identity, Link, judge};
use reconstruct::export::fixed::{hex, utc};
use reconstruct::report::case::Signature;
use reconstruct::report::summary::clock_names;
use reconstruct::report::terminal::ascii;
use schema::ledger::{FILE_NAME, MAX_LEDGER_BYTES, audit::audit};
use schema::{Ledger, PublicKey};
use serde_json::{Value, json};

use crate::cli::load::Loaded;
use crate::cli::{CliError, GAPS, SOUND, decrypt, print, print_json};

/// Arguments of `verify`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Records to check (.svb, .sve), or a folder of them
    #[arg(required = true, value_name = "RECORD")]
    records: Vec<PathBuf>,
    /// The device's public key, from whom the records should be; without one identity is unproven. Repeatable
    #[arg(long, value_name = "FILE")]
    key: Vec<PathBuf>,
    /// The recorder's ledger (default: ledger.svl beside the records)
    #[arg(long, value_name = "FILE")]
    ledger: Option<PathBuf>,
    #[command(flatten)]
    identity: decrypt::Identity,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Everything that was read.
struct Found {
    records: Vec<Loaded>,
    /// Files that can not be read as records, in a sentence each.
    unreadable: Vec<String>,
    ledger: Option<(PathBuf, Ledger, Book)>,
    keys: Vec<PublicKey>,
}

/// Runs the command: 0 if everything holds and is proven to be of the given key, else 3.
pub(crate) fn run(args: &Args) -> Result<u8, CliError> {
    let mut read = read(args)?;
    read.records
        .sort_by_key(|loaded| loaded.record.header.number);
    let links: Vec<Link> = read.records.iter().map(link).collect();
    let book = read.ledger.as_ref().map(|(_, _, book)| book);
    let mut finding = judge(&links, book, &read.keys);
    finding.breaks.splice(0..0, read.unreadable.iter().cloned());
    for (loaded, link) in read.records.iter().zip(&links) {
        if link.seal.is_none() {
            let first = loaded.case().damage.first().map_or("", String::as_str);
            finding.breaks.push(format!(
                "{}: expected every byte as it was sealed, found: {first}",
                link.file
            ));
        }
    }
    let sound = finding.sound() && !read.records.is_empty();
    if args.json {
        print_json(&as_json(&read, &finding, sound))?;
    } else {
        print(&as_text(&read, &finding, sound))?;
    }
    Ok(if sound { SOUND } else { GAPS })
}

fn read(args: &Args) -> Result<Found, CliError> {
    let mut keys = Vec::new();
    for path in &args.key {
        let bytes = bounded(path, schema::key::MAX_TEXT_BYTES)?;
        let text = String::from_utf8_lossy(&bytes);
        keys.push(PublicKey::from_text(&text).map_err(|error| CliError::Key {
            path: path.display().to_string(),
            error,
        })?);
    }
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for path in &args.records {
        if path.is_dir() {
            files.extend(records_of(path)?);
            folders.push(path.clone());
        } else {
            files.push(path.clone());
        }
    }
    let alone = files.len() == 1 && folders.is_empty();
    let (mut records, mut unreadable) = (Vec::new(), Vec::new());
    for path in &files {
        match Loaded::open(path, &args.identity) {
            Ok(loaded) => records.push(loaded),
            Err(error) if alone => return Err(error),
            Err(error) => unreadable.push(error.to_string()),
        }
    }
    let live = records.iter().any(|loaded| !loaded.case().replayed());
    let beside = folders
        .first()
        .cloned()
        .or_else(|| Some(files.first()?.parent()?.to_path_buf()))
        .map(|folder| folder.join(FILE_NAME));
    let path = match (&args.ledger, beside) {
        (Some(path), _) => Some(path.clone()),
        // A replay is in no ledger.
        (None, Some(path)) if (live || !folders.is_empty()) && path.is_file() => Some(path),
        (None, _) => None,
    };
    let ledger = path
        .map(|path| {
            let ledger = Ledger::read(&bounded(&path, MAX_LEDGER_BYTES)?);
            let book = Book {
                audit: audit(&ledger),
                whole_folder: !folders.is_empty(),
            };
            Ok::<_, CliError>((path, ledger, book))
        })
        .transpose()?;
    Ok(Found {
        records,
        unreadable,
        ledger,
        keys,
    })
}

/// The records in a folder, by name.
fn records_of(folder: &Path) -> Result<Vec<PathBuf>, CliError> {
    let list = || -> io::Result<Vec<PathBuf>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            let hidden = path
                .file_name()
                .is_none_or(|name| name.to_string_lossy().starts_with('.'));
            let record = path
                .extension()
                .is_some_and(|ending| ending == "svb" || ending == "sve");
            if record && !hidden && path.is_file() {
                found.push(path);
            }
        }
        found.sort();
        Ok(found)
    };
    list().map_err(|error| CliError::file(folder, error))
}

fn bounded(path: &Path, most: usize) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    let limit = schema::num::u64_of(most) + 1;
    fs::File::open(path)
        .and_then(|file| file.take(limit).read_to_end(&mut bytes))
        .map_err(|error| CliError::file(path, error))?;
    Ok(bytes)
}

fn link(loaded: &Loaded) -> Link {
    let case = loaded.case();
    let header = &loaded.record.header;
    Link {
        file: ascii(case.file),
        number: header.number,
        previous_sha256: header.previous_sha256,
        utc_ns: loaded.record.utc_ns(),
        live: !case.replayed(),
        seal: loaded.seal,
    }
}

/// The word for JSON, and why in words where identity is not proven.
fn identity_words(identity: &Identity, loaded: &Loaded) -> (&'static str, String) {
    let unproven = |why: &str| format!("unproven: {why}");
    match identity {
        Identity::Proven(key) => ("good", format!("proven: signed by key {key}")),
        Identity::Unchecked => (
            "unchecked",
            unproven("the record is signed, but no key was given to check it with"),
        ),
        Identity::Unsigned if loaded.case().replayed() => (
            "unsigned",
            unproven("a replayed record carries no signature"),
        ),
        Identity::Unsigned => ("unsigned", unproven("the record carries no signature")),
        Identity::Stranger => (
            "false",
            unproven("the signature is not one of the given key"),
        ),
        Identity::Broken => ("broken", unproven("the file is not as it was sealed")),
    }
}

fn record_json(loaded: &Loaded, identity: &Identity) -> Value {
    let case = loaded.case();
    let header = &loaded.record.header;
    let (source, quality) = clock_names(&case);
    let proven = if let Identity::Proven(key) = identity {
        Some(key.fingerprint())
    } else {
        None
    };
    json!({
        "file": case.file,
        "sha256": hex(&case.file_sha256),
        "seal_sha256": case.seal_sha256.map(|d| hex(&d)),
        "digest_holds": case.signature != Signature::Broken,
        "signature": identity_words(identity, loaded).0,
        "identity_proven": proven.is_some(),
        "complete": case.complete(),
        "damage": case.damage,
        "encrypted": loaded.encrypted,
        "number": header.number,
        "previous_sha256": hex(&header.previous_sha256),
        "origin": header.origin,
        "device_id": header.device_id,
        "vehicle": header.vehicle.name,
        "vin": header.vehicle.vin,
        "key_fingerprint": proven,
        "utc": utc(loaded.record.utc_ns()),
        "clock": { "source": source, "quality": quality, "uncertainty_ns": header.clock.uncertainty_ns },
        "software": header.software,
        "config_sha256": hex(&header.config_sha256),
    })
}

fn as_json(read: &Found, finding: &Finding, sound: bool) -> Value {
    let records: Vec<Value> = read
        .records
        .iter()
        .zip(&finding.identities)
        .map(|(loaded, identity)| record_json(loaded, identity))
        .collect();
    let ledger = read.ledger.as_ref().map(|(path, ledger, book)| {
        json!({
            "file": path.display().to_string(),
            "entries": ledger.entries.len(),
            "records": book.audit.records.len(),
            "removed": book.audit.records.values().filter(|r| r.removed.is_some()).count(),
            "unsigned_entries": book.audit.unsigned,
            "keys": book.audit.keys.iter().map(|k| k.key.fingerprint()).collect::<Vec<_>>(),
            "holds": book.audit.breaks.is_empty(),
        })
    });
    // Of a single record its fields stand at the top, too.
    let mut all = match records.as_slice() {
        [only] => only.clone(),
        _ => json!({}),
    };
    if let Some(all) = all.as_object_mut() {
        all.insert("sound".to_owned(), json!(sound));
        all.insert("breaks".to_owned(), json!(finding.breaks));
        all.insert("notes".to_owned(), json!(finding.notes));
        all.insert("ledger".to_owned(), json!(ledger));
        all.insert("records".to_owned(), json!(records));
    }
    all
}

fn record_text(loaded: &Loaded, identity: &Identity) -> String {
    let case = loaded.case();
    let header = &loaded.record.header;
    let seal = case
        .seal_sha256
        .map_or_else(|| "not readable".to_owned(), |d| hex(&d));
    let digest = if case.signature == Signature::Broken {
        "BROKEN"
    } else {
        "holds: every byte is as it was sealed"
    };
    let or = |text: &str, other: &str| {
        if text.is_empty() {
            other.to_owned()
        } else {
            ascii(text)
        }
    };
    let (source, _) = clock_names(&case);
    let sd = header.clock.uncertainty_ns.map_or_else(
        || "uncertainty unknown".to_owned(),
        |ns| format!("sd {ns} ns"),
    );
    format!(
        "{}\nfile    SHA-256 {}\nseal    SHA-256 {seal}\ndigest  {digest}\nnumber  {}, after SHA-256 {}\nwho     device {}, vehicle {}, VIN {}\nwhen    {} (first trigger; {source}, {sd})\nwith    {}, configuration SHA-256 {}\nidentity {}\n",
        ascii(case.file),
        hex(&case.file_sha256),
        header.number,
        hex(&header.previous_sha256),
        or(&header.device_id, "without a name"),
        or(&header.vehicle.name, "without a name"),
        or(&header.vehicle.vin, "not configured"),
        utc(loaded.record.utc_ns()),
        or(&header.software, "unknown software"),
        hex(&header.config_sha256),
        identity_words(identity, loaded).1,
    )
}

fn as_text(read: &Found, finding: &Finding, sound: bool) -> String {
    let mut out = String::new();
    for (loaded, identity) in read.records.iter().zip(&finding.identities) {
        out.push_str(&record_text(loaded, identity));
        out.push('\n');
    }
    if let Some((path, ledger, book)) = &read.ledger {
        let key = book.audit.keys.last().map_or_else(
            || "no key".to_owned(),
            |change| format!("key {}", change.key),
        );
        let _ = writeln!(
            out,
            "ledger  {}: {} entries, {} records, {key}, {}",
            ascii(&path.display().to_string()),
            ledger.entries.len(),
            book.audit.records.len(),
            if book.audit.breaks.is_empty() {
                "holds"
            } else {
                "BROKEN"
            }
        );
    }
    for note in &finding.notes {
        let _ = writeln!(out, "note    {}", ascii(note));
    }
    for broken in &finding.breaks {
        let _ = writeln!(out, "BREAK   {}", ascii(broken));
    }
    out.push_str(if sound {
        "sound: all digests, signatures and the chain hold\n"
    } else if finding.breaks.is_empty() {
        "identity unproven: nothing is broken, but who made it is not shown\n"
    } else {
        "BROKEN: see above\n"
    });
    out
}
