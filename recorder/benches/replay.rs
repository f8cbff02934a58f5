//! Frames per second of a replay, from candump text to sealed records, beside a floor: the same text split into lines
//! and words. One thread; the median of several runs.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a bench measures time and prints"
)]

use std::fmt::Write as _;
use std::hint::black_box;
use std::io::Cursor;
use std::path::Path;
use std::time::Instant;

use recorder::config::Settings;
use recorder::replay::{LogInput, ReplayOptions, replay};
use schema::num;

/// Seconds of log: 200 IMU and 50 wheel frames a second, and 800 of no interest.
const SECONDS: usize = 1000;
const RUNS: usize = 7;

fn log() -> String {
    let mut text = String::new();
    let mut frame = |ns: usize, id: usize, data: u64, bytes: usize| {
        let (seconds, micros) = (ns / 1_000_000_000, ns % 1_000_000_000 / 1000);
        let hex = schema::seal::Hex(&data.to_le_bytes()[..bytes]).to_string();
        let seconds = 1_700_000_000 + seconds;
        writeln!(text, "({seconds}.{micros:06}) can0 {id:03X}#{hex}").unwrap();
    };
    for step in 0..SECONDS * 100 {
        let ns = step * 10_000_000;
        let counter = num::u64_of(step % 16) << 60;
        // 1 g on the third axis: 4903 steps of 0.002.
        frame(ns, 0x120, 4903 << 40 | counter, 8);
        frame(ns + 200_000, 0x121, counter, 8);
        if step % 2 == 0 {
            frame(ns + 300_000, 0x122, 0x0088_1388_1300, 5);
        }
        for other in 0..8 {
            let ns = ns + 1_000_000 * (other + 1);
            frame(ns, 0x200 + other, num::u64_of(step), 8);
        }
    }
    text
}

/// Seconds of the median run.
fn median(mut run: impl FnMut()) -> f64 {
    let mut seconds: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds[RUNS / 2]
}

fn main() {
    let etc = Path::new(env!("CARGO_MANIFEST_DIR")).join("etc");
    let settings = Settings::load(&etc.join("recorder.toml")).unwrap();
    let text = log();
    let frames = num::real(text.lines().count());
    let triggers: Vec<f64> = (1..10).map(|k| 100.0 * f64::from(k)).collect();
    let mut records = 0;
    let ours = median(|| {
        let input = LogInput::Reader("-".to_owned(), Box::new(Cursor::new(text.clone())));
        let mut bytes = 0;
        let options = ReplayOptions {
            trigger_at: triggers.clone(),
            sink: Some(Box::new(|record| {
                bytes += record.to_bytes().unwrap().len();
                Ok(())
            })),
            ..ReplayOptions::default()
        };
        records = replay(&settings, vec![input], options).unwrap().records;
        black_box(bytes);
    });
    let floor = median(|| {
        let copy = text.clone();
        let words: usize = copy.lines().map(|line| line.split(' ').count()).sum();
        black_box(words);
    });
    println!(
        "replay: {:.0} frames/s ({frames} frames, {records} records sealed); floor: {:.0} lines/s split into words; \
         {:.1} x the floor's time",
        frames / ours,
        frames / floor,
        ours / floor
    );
}
