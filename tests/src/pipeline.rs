//! From a log to a reconstruction in one process; every record goes through its bytes, as it would on a disk.

use std::cell::RefCell;
use std::io::Cursor;

use reconstruct::ReconstructError;
use reconstruct::findings::Reconstruction;
use reconstruct::run::{Options, reconstruct};
use recorder::config::Settings;
use recorder::error::RecorderError;
use recorder::replay::{LogInput, ReplayOptions, ReplayOutcome, replay};
use schema::Record;

/// What a replay gives.
pub struct Replayed {
    /// Its outcome.
    pub outcome: ReplayOutcome,
    /// The records, as read back from their bytes.
    pub records: Vec<Record>,
    /// Their bytes.
    pub bytes: Vec<Vec<u8>>,
}

/// A log in memory.
pub fn input(text: impl Into<Vec<u8>>) -> Vec<LogInput> {
    vec![LogInput::Reader(
        "-".to_owned(),
        Box::new(Cursor::new(text.into())),
    )]
}

/// Replays a log, with manual triggers (seconds from the first frame).
///
/// # Errors
/// As the replay.
pub fn try_record(
    settings: &Settings,
    text: impl Into<Vec<u8>>,
    trigger_at: &[f64],
) -> Result<Replayed, RecorderError> {
    let sealed = RefCell::new(Vec::new());
    let outcome = replay(
        settings,
        input(text),
        ReplayOptions {
            trigger_at: trigger_at.to_vec(),
            sink: Some(Box::new(|record| {
                sealed.borrow_mut().push(record.to_bytes().unwrap());
                Ok(())
            })),
            ..ReplayOptions::default()
        },
    )?;
    let bytes: Vec<Vec<u8>> = sealed.into_inner();
    let records = bytes
        .iter()
        .map(|bytes| Record::read(bytes).unwrap().0)
        .collect();
    Ok(Replayed {
        outcome,
        records,
        bytes,
    })
}

/// As [`try_record`], for logs that must work.
pub fn record(settings: &Settings, text: impl Into<Vec<u8>>, trigger_at: &[f64]) -> Replayed {
    try_record(settings, text, trigger_at).unwrap()
}

/// Reconstructs with the default model, checks that nothing in it is NaN.
///
/// # Errors
/// As the run.
pub fn try_run(record: &Record, options: &Options) -> Result<Reconstruction, ReconstructError> {
    let result = reconstruct(record, options)?;
    for state in &result.states {
        let numbers = [
            state.position[0],
            state.position[1],
            state.position[2],
            state.speed,
            state.heading,
            state.sd_north,
            state.sd_east,
            state.cov_north_east,
            state.sd_speed,
            state.sd_heading,
        ];
        assert!(
            numbers.iter().all(|number| number.is_finite()),
            "t = {}: {state:?}",
            state.t_s
        );
    }
    Ok(result)
}

/// As [`try_run`] with default options, for records that must work.
pub fn run(record: &Record) -> Reconstruction {
    try_run(record, &Options::default()).unwrap()
}
