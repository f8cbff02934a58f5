//! Bit extraction against cantools on random frames: every message of a large real DBC, and of a synthetic one
//! with every kind of signal.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::panic,
    reason = "tests"
)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use recorder::dbc::Database;
use recorder::signal::Reading;
use serde_json::Value;

/// A small generator, so that the frames are the same everywhere (`SplitMix64`).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }
}

fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../target"),
        PathBuf::from,
    )
}

/// A DBC with plain, multiplexed and twice multiplexed messages, both byte orders, signed, floats, CAN FD, extended
/// identifiers, and units that are not ASCII.
fn synthetic() -> String {
    let mut random = Random(7);
    let mut messages = String::new();
    let mut tail = String::new();
    let factors = ["1", "0.01", "0.125", "-0.5", "3.6E-3", "1000"];
    for number in 0..240_u64 {
        let size: u64 = if number % 4 == 3 {
            [12, 24, 32, 64][usize::try_from(number / 4 % 4).unwrap()]
        } else {
            8
        };
        let id = if number % 3 == 2 {
            0x8000_0000 + 0x1_0000 * number + 5
        } else {
            0x100 + number
        };
        writeln!(messages, "BO_ {id} M{number}: {size} NODE").unwrap();
        let kind = number % 5;
        // Bits in use: cantools can not decode messages whose signals overlap.
        let mut used = vec![false; usize::try_from(size * 8).unwrap()];
        used.iter_mut()
            .take([0, 0, 0, 8, 7][usize::try_from(kind).unwrap()])
            .for_each(|bit| *bit = true);
        if kind == 4 {
            writeln!(messages, " SG_ Outer M : 0|3@1+ (1,0) [0|7] \"\" NODE").unwrap();
            writeln!(messages, " SG_ Inner m1M : 3|4@1+ (1,0) [0|15] \"\" NODE").unwrap();
            writeln!(tail, "SG_MUL_VAL_ {id} Inner Outer 1-3, 5-5;").unwrap();
        } else if kind == 3 {
            writeln!(messages, " SG_ Outer M : 7|8@0+ (1,0) [0|0] \"\" NODE").unwrap();
        }
        for signal in (0..16_u64).rev() {
            let mux = match (kind, signal % 3) {
                (3, 0 | 1) => format!("m{} ", signal % 4),
                (4, 0) => "m0 ".to_owned(),
                (4, 1) => "m2 ".to_owned(),
                _ => String::new(),
            };
            let float = match signal {
                13 => Some((32, 1)),
                14 if size > 8 => Some((64, 2)),
                _ => None,
            };
            let bits = float.map_or(
                1 + random.below(if size > 8 { 64 } else { 24 }),
                |(bits, _)| bits,
            );
            let big = random.below(2) == 0;
            let place = |first: u64| -> Option<Vec<usize>> {
                // Big-endian bits are counted from the first on the wire, which is bit 7 of byte 0.
                let at = |bit: u64| if big { bit / 8 * 8 + 7 - bit % 8 } else { bit };
                let bits: Vec<usize> = (first..first + bits)
                    .map(|bit| usize::try_from(at(bit)).unwrap())
                    .collect();
                bits.iter().all(|bit| !used[*bit]).then_some(bits)
            };
            let mut tries =
                (0..60).map(|_| random.below((size * 8 + 1).saturating_sub(bits).max(1_u64)));
            let Some(bits_at) = (bits <= size * 8).then(|| tries.find_map(place)).flatten() else {
                continue;
            };
            for bit in &bits_at {
                used[*bit] = true;
            }
            let start = bits_at[0];
            let sign = if random.below(2) == 0 { '+' } else { '-' };
            let factor = factors[usize::try_from(random.below(6)).unwrap()];
            let order = u8::from(!big);
            writeln!(messages, " SG_ S{signal} {mux}: {start}|{bits}@{order}{sign} ({factor},-12.5) [0|0] \"\u{B0}/s\" NODE")
                .unwrap();
            if kind == 4 && signal % 3 == 0 {
                writeln!(tail, "SG_MUL_VAL_ {id} S{signal} Outer 0-0, 4-7;").unwrap();
            } else if kind == 4 && signal % 3 == 1 {
                writeln!(
                    tail,
                    "SG_MUL_VAL_ {id} S{signal} Inner {}-{};",
                    signal % 5,
                    signal % 5 + 6
                )
                .unwrap();
            }
            if let Some((_, code)) = float {
                writeln!(tail, "SIG_VALTYPE_ {id} S{signal} : {code};").unwrap();
            }
        }
        messages.push('\n');
    }
    // SIG_VALTYPE_ stands before SG_MUL_VAL_.
    let mut lines: Vec<&str> = tail.lines().collect();
    lines.sort_by_key(|line| line.starts_with("SG_MUL"));
    format!(
        "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: NODE\n\n{messages}\n{}\n",
        lines.join("\n")
    )
}

/// Compares every message; gives values compared.
fn compare(name: &str, dbc: &Path, each: usize) -> usize {
    let database = Database::load(dbc).unwrap();
    let mut random = Random(1);
    let mut frames = Vec::new();
    let mut text = String::new();
    for message in &database.messages {
        if message.size == 0 || message.signals.is_empty() {
            continue;
        }
        for _ in 0..each {
            let mut data: Vec<u8> = (0..message.size)
                .map(|_| u8::try_from(random.below(256)).unwrap())
                .collect();
            if random.below(2) == 0 {
                // Small multiplexor values are the ones that carry signals.
                data[0] &= 0x07;
            }
            let hex: String = data.iter().fold(String::new(), |mut hex, byte| {
                write!(hex, "{byte:02x}").unwrap();
                hex
            });
            writeln!(text, "{} {hex}", message.name).unwrap();
            frames.push((message, data));
        }
    }
    let folder = target().join("dbc-oracle");
    fs::create_dir_all(&folder).unwrap();
    let list = folder.join(format!("{name}.frames"));
    fs::write(&list, text).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("cantools_oracle.py");
    let run = Command::new("python3")
        .arg(script)
        .arg(folder.join("venv"))
        .arg(dbc)
        .arg(&list)
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "cantools: {}",
        String::from_utf8_lossy(&run.stderr)
    );
    let answers = String::from_utf8(run.stdout).unwrap();
    assert_eq!(answers.lines().count(), frames.len());
    let (mut compared, mut refused) = (0, 0);
    for ((message, data), answer) in frames.iter().zip(answers.lines()) {
        // json.dumps writes NaN and Infinity, which JSON does not have: they are "not finite" to both sides.
        let answer = answer
            .replace("-Infinity", "null")
            .replace("Infinity", "null")
            .replace("NaN", "null");
        let answer: Value = serde_json::from_str(&answer).unwrap();
        if answer.get("error").is_some() {
            refused += 1;
            continue;
        }
        for signal in &message.signals {
            let label = || format!("{name}: {}.{} {:02x?}", message.name, signal.name, data);
            match (signal.read(data), answer.get(&signal.name)) {
                (Reading::NotSelected, None) => {}
                (Reading::NotFinite, Some(Value::Null)) => compared += 1,
                (Reading::Value(found), Some(Value::Number(expected))) => {
                    let expected = expected.as_f64().unwrap();
                    let close = (found - expected).abs() <= 1e-12 * expected.abs().max(1e-9);
                    assert!(close, "{}: expected {expected}, found {found}", label());
                    compared += 1;
                }
                (found, expected) => panic!("{}: expected {expected:?}, found {found:?}", label()),
            }
        }
    }
    eprintln!(
        "{name}: {compared} values of {} messages agree; {refused} frames refused by cantools",
        database.messages.len()
    );
    assert!(
        refused * 3 < frames.len(),
        "{refused} of {} refused",
        frames.len()
    );
    compared
}

/// True (with a printed line) where cantools can not be had; in CI that is a failure, as the comparison itself shows.
fn no_network() -> bool {
    if std::env::var_os("CI").is_some_and(|ci| ci == "true") {
        return false;
    }
    let venv = target().join("dbc-oracle/venv/bin/python");
    let there = Command::new(venv)
        .args(["-c", "import cantools"])
        .output()
        .is_ok_and(|run| run.status.success());
    let reachable = || {
        let probe = ["-m", "pip", "download", "--quiet", "--no-deps", "--dest"];
        let dest = target().join("dbc-oracle/probe");
        Command::new("python3")
            .args(probe)
            .arg(dest)
            .arg("cantools==45.1.0")
            .output()
            .is_ok_and(|run| run.status.success())
    };
    let absent = !there && !reachable();
    if absent {
        eprintln!("skipped: cantools is not installed and PyPI can not be reached");
    }
    absent
}

#[test]
fn every_message_agrees_with_cantools() {
    if no_network() {
        return;
    }
    let folder = target().join("dbc-oracle");
    fs::create_dir_all(&folder).unwrap();
    let dbc = folder.join("synthetic.dbc");
    fs::write(&dbc, synthetic()).unwrap();
    assert!(compare("synthetic", &dbc, 100) > 50_000);
    let real = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/toyota_2017.dbc");
    if real.exists() {
        assert!(compare("toyota_2017", &real, 200) > 10_000);
    } else {
        eprintln!("skipped: the recordings are not here (toyota_2017.dbc)");
    }
}
