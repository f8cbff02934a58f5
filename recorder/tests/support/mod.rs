//! Logs made in memory for the example configuration, and replays of them.
#![allow(
    dead_code,
    missing_docs,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::missing_panics_doc,
    clippy::must_use_candidate,
    reason = "support of several test files, each of which uses a part of it"
)]

use std::cell::RefCell;
use std::fmt::Write as _;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use recorder::can::{Frame, FrameSource, Interfaces};
use recorder::config::Settings;
use recorder::log_source::Merged;
use recorder::replay::{LogInput, ReplayOptions, ReplayOutcome, replay};
use schema::{Record, Sample, num};

/// UTC of the logs' time 0, s.
pub const EPOCH: i64 = 1_700_000_000;

pub fn etc() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("etc")
}

/// The example configuration, with lines replaced.
pub fn settings(changes: &[(&str, &str)]) -> Settings {
    let mut text = std::fs::read_to_string(etc().join("recorder.toml")).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Settings::from_toml_str(&text, &etc()).unwrap()
}

/// A log being written.
#[derive(Default)]
pub struct Log {
    lines: Vec<(i64, String)>,
}

impl Log {
    /// A frame at a time in seconds.
    pub fn frame(&mut self, t: f64, id: &str, data: &[u8]) {
        let nanos = num::round_i64(t * 1e9) + EPOCH * 1_000_000_000;
        let hex = schema::seal::Hex(data);
        let line = format!(
            "({}.{:09}) can0 {id}#{hex}",
            nanos / 1_000_000_000,
            nanos % 1_000_000_000
        );
        self.lines.push((nanos, line));
    }

    /// Three 20-bit numbers of 0.002 and a counter.
    fn triple(&mut self, t: f64, id: &str, values: [f64; 3], counter: u64) {
        let mut bits = (counter % 16) << 60;
        for (axis, value) in values.into_iter().enumerate() {
            let code = num::round_i64(value / 0.002)
                .clamp(-524_288, 524_287)
                .cast_unsigned()
                & 0xF_FFFF;
            bits |= code << (20 * axis);
        }
        self.frame(t, id, &bits.to_le_bytes());
    }

    /// An accelerometer frame, front-left-up, m/s^2.
    pub fn accel(&mut self, t: f64, values: [f64; 3], counter: u64) {
        self.triple(t, "120", values, counter);
    }

    /// A rate frame, deg/s.
    pub fn rate(&mut self, t: f64, values: [f64; 3], counter: u64) {
        self.triple(t, "121", values, counter);
    }

    /// A wheel frame, km/h.
    pub fn wheels(&mut self, t: f64, kmh: f64) {
        let code = u16::try_from(num::round_i64(kmh * 100.0))
            .unwrap()
            .to_be_bytes();
        self.frame(t, "122", &[code[0], code[1], code[0], code[1], 0]);
    }

    /// A car at rest (or steady at a speed) from one time to another: IMU and 50 Hz wheels.
    pub fn steady(&mut self, from: f64, to: f64, imu_hz: f64, kmh: f64) {
        let count = num::round_usize((to - from) * imu_hz);
        for k in 0..count {
            let t = from + num::real(k) / imu_hz;
            self.accel(t, [0.0, 0.0, 9.806], num::u64_of(k));
            self.rate(t + 0.0001, [0.0; 3], num::u64_of(k));
        }
        for k in 0..num::round_usize((to - from) * 50.0) {
            self.wheels(from + num::real(k) * 0.02 + 0.0002, kmh);
        }
    }

    /// The text, in order of time.
    pub fn text(mut self) -> String {
        self.lines.sort_by_key(|(time, _)| *time);
        self.unsorted()
    }

    /// The text, in the order it was written.
    pub fn unsorted(self) -> String {
        self.lines
            .iter()
            .fold(String::new(), |mut text, (_, line)| {
                writeln!(text, "{line}").unwrap();
                text
            })
    }
}

/// What a replay in memory gives.
pub struct Run {
    pub outcome: ReplayOutcome,
    pub records: Vec<Record>,
    pub samples: Vec<(u64, Sample)>,
}

pub fn input(text: impl Into<Vec<u8>>) -> Vec<LogInput> {
    vec![LogInput::Reader(
        "-".to_owned(),
        Box::new(Cursor::new(text.into())),
    )]
}

pub fn try_run(
    settings: &Settings,
    text: impl Into<Vec<u8>>,
    trigger_at: &[f64],
) -> Result<Run, recorder::error::RecorderError> {
    let (records, samples) = (RefCell::new(Vec::new()), RefCell::new(Vec::new()));
    let outcome = replay(
        settings,
        input(text),
        ReplayOptions {
            trigger_at: trigger_at.to_vec(),
            sink: Some(Box::new(|record| {
                // Every record must be one that can be sealed.
                record.to_bytes().unwrap();
                records.borrow_mut().push(record);
                Ok(())
            })),
            observer: Some(Box::new(|index, sample| {
                samples.borrow_mut().push((index, *sample));
            })),
            ..ReplayOptions::default()
        },
    )?;
    Ok(Run {
        outcome,
        records: records.into_inner(),
        samples: samples.into_inner(),
    })
}

pub fn run(settings: &Settings, text: impl Into<Vec<u8>>, trigger_at: &[f64]) -> Run {
    try_run(settings, text, trigger_at).unwrap()
}

/// The frames of a log on `can0`.
pub fn frames(text: &str) -> Vec<Frame> {
    let reader: Box<dyn Read> = Box::new(Cursor::new(text.as_bytes().to_vec()));
    let interfaces = Interfaces::new(&["can0".to_owned()], &[]).unwrap();
    let input = LogInput::Reader("log".to_owned(), reader);
    let mut log = Merged::open(vec![input], &interfaces).unwrap();
    let mut found = Vec::new();
    let mut frame = Frame::empty();
    while log.next_frame(&mut frame).unwrap() {
        found.push(frame);
    }
    found
}
