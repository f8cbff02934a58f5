//! Log lines from the receiving thread: handed to a thread of their own, which may wait for the journal or a full pipe
//! while frames are received. What finds no room is counted and told later.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

use tracing::Level;

/// Lines that wait at most.
const MOST: usize = 512;
/// How long the end waits for the last lines.
const PATIENCE: Duration = Duration::from_secs(1);

enum Line {
    Text(Level, String),
    Last(SyncSender<()>),
}

static LINES: OnceLock<SyncSender<Line>> = OnceLock::new();
static LEFT_OUT: AtomicU64 = AtomicU64::new(0);

/// Starts the thread. Without it lines are written where they are said.
pub(super) fn start() {
    let (give, lines) = sync_channel(MOST);
    let work = move || {
        while let Ok(line) = lines.recv() {
            match line {
                Line::Text(level, text) => write(level, &text),
                Line::Last(done) => {
                    let _ = done.send(());
                }
            }
            let left_out = LEFT_OUT.swap(0, Ordering::Relaxed);
            if left_out > 0 {
                write(Level::WARN, &format!("{left_out} log lines found no room"));
            }
        }
    };
    let started = std::thread::Builder::new()
        .name("log".to_owned())
        .stack_size(256 * 1024)
        .spawn(work);
    if started.is_ok() {
        // A second daemon in one process (a test) goes on with the first one's thread.
        let _ = LINES.set(give);
    }
}

/// Waits a moment for what was said to be written.
pub(super) fn finish() {
    let (done, wait) = sync_channel(1);
    if let Some(lines) = LINES.get()
        && lines.try_send(Line::Last(done)).is_ok()
    {
        let _ = wait.recv_timeout(PATIENCE);
    }
}

fn write(level: Level, text: &str) {
    match level {
        Level::ERROR => tracing::error!("{text}"),
        Level::WARN => tracing::warn!("{text}"),
        _ => tracing::info!("{text}"),
    }
}

fn say(level: Level, text: String) {
    match LINES.get() {
        None => write(level, &text),
        Some(lines) => {
            if lines.try_send(Line::Text(level, text)).is_err() {
                LEFT_OUT.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

/// All is well.
pub(super) fn info(text: impl Into<String>) {
    say(Level::INFO, text.into());
}

/// Somebody should know.
pub(super) fn warn(text: impl Into<String>) {
    say(Level::WARN, text.into());
}

/// Somebody should act.
pub(super) fn error(text: impl Into<String>) {
    say(Level::ERROR, text.into());
}
