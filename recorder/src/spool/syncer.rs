//! The thread that writes and synchronises the spool, so that a slow disk never holds up the receiving of frames.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use schema::num;

use super::file::SpoolFile;
use super::journal::Journal;
use crate::error::RecorderError;

/// Buffers: one being filled, one being written, one to spare.
const BUFFERS: usize = 2;
/// Flushes that the quantile is taken of.
const REMEMBERED: usize = 8192;

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
    /// How the last one failed.
    pub last_error: Option<String>,
    /// Durations of the last flushes, ns.
    recent: Vec<i64>,
    at: usize,
}

impl FlushState {
    fn add(&mut self, bytes: usize, took_ns: i64) {
        self.flushes += 1;
        self.bytes += num::u64_of(bytes);
        self.longest_ns = self.longest_ns.max(took_ns);
        if self.recent.len() < REMEMBERED {
            self.recent.push(took_ns);
        } else if let Some(slot) = self.recent.get_mut(self.at) {
            *slot = took_ns;
        }
        self.at = (self.at + 1) % REMEMBERED;
    }

    /// A quantile (0 to 1) of the durations of the last flushes, ns; `None` before the first.
    #[must_use]
    pub fn quantile_ns(&self, part: f64) -> Option<i64> {
        let mut sorted = self.recent.clone();
        sorted.sort_unstable();
        let last = sorted.len().checked_sub(1)?;
        // The value that at least this part of them does not exceed.
        let rank = (part * num::real(sorted.len())).ceil() - 1.0;
        sorted
            .get(num::round_usize(rank.max(0.0)).min(last))
            .copied()
    }
}

/// A buffer of blocks, and the time up to which the frames in it and before it reach.
type Batch = (Vec<u8>, i64);

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
        lock(&shared).recent.reserve_exact(REMEMBERED);
        let work = move || {
            while let Ok((mut bytes, upto_ns)) = from.recv() {
                let started = now();
                let done = file.write(&mut bytes).and_then(|()| file.sync());
                let took = now().saturating_sub(started);
                let mut state = lock(&shared);
                match done {
                    Ok(()) => {
                        state.add(bytes.len(), took);
                        state.durable_ns = state.durable_ns.max(upto_ns);
                    }
                    Err(error) => {
                        state.errors += 1;
                        state.last_error = Some(error.to_string());
                    }
                }
                drop(state);
                if give.send(bytes).is_err() {
                    break;
                }
            }
        };
        let thread = thread::Builder::new()
            .name("spool".to_owned())
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
    pub fn flush(&mut self, journal: &mut Journal, upto_ns: i64) -> bool {
        self.spare.extend(self.back.try_iter());
        let Some(to) = &self.to else { return false };
        let Some(empty) = self.spare.pop() else {
            return false;
        };
        let bytes = journal.exchange(empty);
        match to.try_send((bytes, upto_ns)) {
            Ok(()) => true,
            // There are no more buffers than places in the channel, so neither happens while the thread lives.
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        }
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

    /// All frames up to this time are durable, ns on the line.
    #[must_use]
    pub fn durable_ns(&self) -> i64 {
        lock(&self.state).durable_ns
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
