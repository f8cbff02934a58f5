//! The thread that writes and synchronises the spool, so that a slow disk never holds up the receiving of frames.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use schema::num;

use super::file::SpoolFile;
use super::journal::Journal;
use crate::error::RecorderError;

/// Buffers: one being filled, one being written, one to spare.
const BUFFERS: usize = 2;
/// Flushes that the quantile is taken of.
const REMEMBERED: usize = 8192;

/// A flush that fails is tried again so often, so long apart; frames wait in memory meanwhile.
const TRIES: u32 = 50;
const AGAIN: Duration = Duration::from_millis(100);

/// What the thread measured.
#[derive(Clone, Debug, Default)]
pub struct FlushState {
    /// Flushes since the start.
    pub flushes: u64,
    /// Bytes written since the start.
    pub bytes: u64,
    /// All frames up to this time are durable, ns on the line.
    pub durable_ns: i64,
    /// Longest flush, ns.
    pub longest_ns: i64,
    /// Flushes that failed.
    pub errors: u64,
    /// Durations of the last flushes.
    durations: Recent,
    /// How old the oldest frame of a flush was when it was durable: what a cut just before would have lost.
    ages: Recent,
    /// The same while every frame may be one of a crash.
    alert_ages: Recent,
}

/// The last values, ns.
#[derive(Clone, Debug, Default)]
pub struct Recent {
    values: Vec<i64>,
    at: usize,
}

impl Recent {
    fn add(&mut self, value: i64) {
        if self.values.len() < REMEMBERED {
            self.values.push(value);
        } else if let Some(slot) = self.values.get_mut(self.at) {
            *slot = value;
        }
        self.at = (self.at + 1) % REMEMBERED;
    }

    /// Values there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// True without any.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The value that a part (0 to 1) of them does not exceed, ns; `None` without any.
    #[must_use]
    pub fn quantile_ns(&self, part: f64) -> Option<i64> {
        let mut sorted = self.values.clone();
        sorted.sort_unstable();
        let last = sorted.len().checked_sub(1)?;
        let rank = (part * num::real(sorted.len())).ceil() - 1.0;
        sorted
            .get(num::round_usize(rank.max(0.0)).min(last))
            .copied()
    }
}

impl FlushState {
    fn add(&mut self, batch: &Batch, took_ns: i64, done_ns: i64) {
        self.flushes += 1;
        self.bytes += num::u64_of(batch.bytes.len());
        self.longest_ns = self.longest_ns.max(took_ns);
        self.durable_ns = self.durable_ns.max(batch.upto_ns);
        self.durations.add(took_ns);
        let age = done_ns
            .saturating_add(batch.line_offset_ns)
            .saturating_sub(batch.oldest_ns);
        if batch.alert {
            self.alert_ages.add(age);
        } else {
            self.ages.add(age);
        }
    }

    /// Durations of the last flushes.
    #[must_use]
    pub fn durations(&self) -> &Recent {
        &self.durations
    }

    /// How old the oldest frame of a flush was when it was durable; while every frame may be one of a crash, or else.
    #[must_use]
    pub fn ages(&self, alert: bool) -> &Recent {
        if alert { &self.alert_ages } else { &self.ages }
    }

    fn reserve(&mut self) {
        for recent in [&mut self.durations, &mut self.ages, &mut self.alert_ages] {
            recent.values.reserve_exact(REMEMBERED);
        }
    }
}

/// What is handed over.
#[derive(Debug)]
struct Batch {
    /// Whole blocks.
    bytes: Vec<u8>,
    /// All frames up to this time are in it or before it, on the line.
    upto_ns: i64,
    /// Time of its first entry, on the line.
    oldest_ns: i64,
    /// The line minus the monotonic clock.
    line_offset_ns: i64,
    /// Every frame may be one of a crash.
    alert: bool,
}

/// When a flush is handed over.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// All frames up to this time were received, ns on the line.
    pub upto_ns: i64,
    /// Now on the line, ns.
    pub now_ns: i64,
    /// Now by the monotonic clock, ns.
    pub clock_ns: i64,
    /// Every frame may be one of a crash.
    pub alert: bool,
}

/// The thread, as the receiving thread sees it.
pub struct Syncer {
    to: Option<SyncSender<Batch>>,
    back: Receiver<Vec<u8>>,
    spare: Vec<Vec<u8>>,
    state: Arc<Mutex<FlushState>>,
    thread: Option<JoinHandle<()>>,
}

impl Syncer {
    /// Starts the thread. `now` reads a monotonic clock, ns.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn start(
        mut file: SpoolFile,
        now: impl Fn() -> i64 + Send + 'static,
    ) -> Result<Self, RecorderError> {
        let (to, from) = sync_channel::<Batch>(BUFFERS);
        let (give, back) = sync_channel(BUFFERS + 1);
        let state = Arc::new(Mutex::new(FlushState::default()));
        let shared = Arc::clone(&state);
        // Room for the quantile before memory is locked.
        lock(&shared).reserve();
        let work = move || {
            while let Ok(mut batch) = from.recv() {
                let mut left = TRIES;
                loop {
                    let started = now();
                    let done = file.write(&mut batch.bytes).and_then(|()| file.sync());
                    let done_ns = now();
                    let mut state = lock(&shared);
                    match done {
                        Ok(()) => {
                            state.add(&batch, done_ns.saturating_sub(started), done_ns);
                            break;
                        }
                        Err(_) => state.errors += 1,
                    }
                    drop(state);
                    left -= 1;
                    if left == 0 {
                        break;
                    }
                    thread::sleep(AGAIN);
                }
                if give.send(batch.bytes).is_err() {
                    break;
                }
            }
        };
        let thread = thread::Builder::new()
            .name("spool".to_owned())
            .stack_size(256 * 1024)
            .spawn(work)
            .map_err(RecorderError::io("spool", "start the thread of"))?;
        Ok(Self {
            to: Some(to),
            back,
            spare: (0..BUFFERS)
                .map(|_| Vec::with_capacity(64 * 1024))
                .collect(),
            state,
            thread: Some(thread),
        })
    }

    /// Hands over what waits; false when the thread is still busy with both buffers, and it goes on waiting.
    pub fn flush(&mut self, journal: &mut Journal, moment: Moment) -> bool {
        self.spare.extend(self.back.try_iter());
        let Some(to) = &self.to else { return false };
        let Some(empty) = self.spare.pop() else {
            return false;
        };
        let oldest_ns = journal.oldest_ns().unwrap_or(moment.now_ns);
        let batch = Batch {
            bytes: journal.exchange(empty),
            upto_ns: moment.upto_ns,
            oldest_ns,
            line_offset_ns: moment.now_ns.saturating_sub(moment.clock_ns),
            alert: moment.alert,
        };
        match to.try_send(batch) {
            Ok(()) => true,
            // There are no more buffers than places in the channel, so neither happens while the thread lives.
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        }
    }

    /// True while the thread lives.
    #[must_use]
    pub fn alive(&self) -> bool {
        self.thread
            .as_ref()
            .is_some_and(|thread| !thread.is_finished())
    }

    /// True if a flush can be handed over now.
    pub fn ready(&mut self) -> bool {
        self.spare.extend(self.back.try_iter());
        !self.spare.is_empty()
    }

    /// Waits until everything handed over is written.
    pub fn drain(&mut self) {
        while self.spare.len() < BUFFERS {
            match self.back.recv() {
                Ok(buffer) => self.spare.push(buffer),
                Err(_) => return,
            }
        }
    }

    /// What was measured.
    #[must_use]
    pub fn state(&self) -> FlushState {
        lock(&self.state).clone()
    }
}

impl Drop for Syncer {
    fn drop(&mut self) {
        self.to = None;
        if let Some(thread) = self.thread.take() {
            // The thread can not panic; what it wrote is written.
            let _ = thread.join();
        }
    }
}

fn lock(state: &Mutex<FlushState>) -> std::sync::MutexGuard<'_, FlushState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}
