//! The decoders of manoeuvre and sheet files are total: mutated files give a value or an error, and what is
//! accepted can be driven.
//!
//! `MUTATIONS=1000000 cargo test -p svartboks-reconstruct --release --test design_mutation` runs as many as it says.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reconstruct::design::{DataSheet, DesignError, Plan, manoeuvre, sheet};
use reconstruct::simulate::simulate;

/// Values that decoders meet badly.
const NASTY: [&str; 14] = [
    "nan",
    "inf",
    "-inf",
    "-0.0",
    "1e308",
    "-1e-320",
    "9223372036854775807",
    "true",
    "\"\"",
    "[]",
    "{}",
    "[[[[",
    "\u{0}",
    "1979-05-27",
];

fn mutate(text: &str, rng: &mut ChaCha8Rng) -> String {
    let mut lines: Vec<String> = text
        .lines()
        .filter(|l| !l.trim_start().starts_with('#'))
        .map(str::to_owned)
        .collect();
    for _ in 0..rng.random_range(1..4) {
        let at = rng.random_range(0..lines.len());
        match rng.random_range(0..7) {
            0 => {
                lines.remove(at);
            }
            1 => {
                let line = lines[rng.random_range(0..lines.len())].clone();
                lines.insert(at, line);
            }
            2 | 3 => {
                let nasty = NASTY[rng.random_range(0..NASTY.len())];
                if let Some((key, _)) = lines[at].clone().split_once('=') {
                    lines[at] = format!("{key}= {nasty}");
                }
            }
            4 | 5 => {
                // Another number in place of one.
                let factor = [-1.0, 0.0, 0.1, 0.9, 1.1, 10.0][rng.random_range(0..6)];
                lines[at] = scaled(&lines[at], factor, rng.random_range(0..4));
            }
            _ => {
                let mut bytes = lines[at].clone().into_bytes();
                if !bytes.is_empty() {
                    let i = rng.random_range(0..bytes.len());
                    bytes[i] ^= 1 << rng.random_range(0..7);
                }
                lines[at] = String::from_utf8_lossy(&bytes).into_owned();
            }
        }
        if lines.is_empty() {
            lines.push(String::new());
        }
    }
    lines.join("\n")
}

/// The `nth` number of a line, times a factor.
fn scaled(line: &str, factor: f64, nth: usize) -> String {
    let mut out = String::new();
    let mut seen = 0;
    for part in line.split_inclusive([' ', ',', '[', ']', '{', '}']) {
        let (number, tail) =
            part.split_at(part.trim_end_matches([' ', ',', '[', ']', '{', '}']).len());
        match number.parse::<f64>() {
            Ok(x) => {
                let value = if seen == nth { x * factor } else { x };
                out.push_str(&value.to_string());
                seen += 1;
            }
            Err(_) => out.push_str(number),
        }
        out.push_str(tail);
    }
    out
}

fn told(error: &DesignError) {
    let text = error.to_string();
    assert!(text.starts_with("file: ") && text.len() < 4000, "{text}");
}

#[test]
fn mutated_files_give_a_value_or_an_error() {
    let asked = std::env::var("MUTATIONS").ok();
    let count: u32 = asked.map_or(20_000, |count| count.parse().unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(3041);
    let (mut plans, mut sheets, mut driven, mut at_rest) = (0_u32, 0_u32, 0_u32, 0_u32);
    for i in 0..count {
        match Plan::parse(&mutate(manoeuvre::EXAMPLE, &mut rng), "file", "x", 1) {
            Ok(plan) => {
                plans += 1;
                // Some of what is accepted is driven: it comes to rest, or the simulator says why not.
                if driven < 60 && i % 3 == 0 {
                    driven += 1;
                    at_rest += u32::from(simulate(&plan.scenario).is_ok());
                }
            }
            Err(error) => told(&error),
        }
        match DataSheet::parse(&mutate(sheet::EXAMPLE, &mut rng), "file", "x") {
            Ok(sheet) => {
                sheets += 1;
                let imu = &sheet.imu;
                assert!(
                    [
                        imu.accel_bias,
                        imu.rate_bias,
                        imu.accel_density,
                        sheet.wheels.scale_sd
                    ]
                    .iter()
                    .all(|x| x.is_finite() && *x >= 0.0)
                );
            }
            Err(error) => told(&error),
        }
    }
    println!(
        "{count} of each: {plans} manoeuvres and {sheets} sheets accepted; {at_rest} of {driven} driven to rest"
    );
    // The mutations must get past the parser, or they test nothing.
    assert!(plans > count / 10 && sheets > count / 10 && at_rest > driven / 2);
}
