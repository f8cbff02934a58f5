//! What becomes of events on disk, and when the spool begins.

use std::sync::Arc;

use super::sealer::Told;
use super::{Daemon, say};
use crate::clock::monotonic_ns;
use crate::error::RecorderError;
use crate::spool::{Entry, Syncer};

/// Time between two tries to begin the spool, ns.
const AGAIN_NS: i64 = 10_000_000_000;

impl Daemon {
    /// Begins the spool where that is asked for and nothing of an earlier run waits in it.
    pub(super) fn begin_spool(&mut self) {
        if let Some(beginning) = self.beginning.take_if(|beginning| beginning.is_finished()) {
            self.begun(beginning.join());
        }
        let clock = monotonic_ns();
        let due = self.begun_ns == 0 || clock - self.begun_ns >= AGAIN_NS;
        let under_way = self.syncer.is_some() || self.beginning.is_some();
        if !self.settings.spool.enabled || under_way || !due {
            return;
        }
        if self.blocked {
            self.spool_error = Some(
                "an event of an earlier run waits for room on the disk, and the spool holds its only durable copy"
                    .to_owned(),
            );
            return;
        }
        self.begun_ns = clock;
        let begin = Arc::clone(&self.begin);
        // Laying out the file takes seconds on a slow card: frames are received meanwhile.
        let started = std::thread::Builder::new()
            .name("begin".to_owned())
            .stack_size(256 * 1024)
            .spawn(move || begin());
        match started {
            Ok(beginning) => self.beginning = Some(beginning),
            Err(error) => self.spool_error = Some(error.to_string()),
        }
    }

    fn begun(&mut self, done: std::thread::Result<Result<Syncer, RecorderError>>) {
        match done {
            Ok(Ok(syncer)) => {
                self.syncer = Some(syncer);
                self.spool_error = None;
                self.spool_status.0 = 0;
                let at_ns = self.source.now_ns();
                self.spool(&Entry::Session {
                    at_ns,
                    bundle: self.bundle,
                    utc_offset_ns: self.pipeline.shift_ns(),
                });
                self.urgent = true;
            }
            Ok(Err(error)) => {
                say::error(format!("the ring is in memory only: {error}"));
                self.spool_error = Some(error.to_string());
            }
            Err(_) => self.spool_error = Some("the thread that begins it ended".to_owned()),
        }
    }

    /// What the sealer told.
    pub(super) fn told(&mut self, told: Told) {
        match told {
            Told::Sealed { span_ns, kept } => {
                say::info(format!(
                    "sealed record {}: {}",
                    kept.number,
                    kept.path.display()
                ));
                for note in kept.notes {
                    say::warn(note);
                }
                self.records.sealed += 1;
                self.records.newest = Some(kept.path.display().to_string());
                let (first_ns, last_ns) = span_ns;
                self.spool(&Entry::Sealed { first_ns, last_ns });
                self.urgent = true;
            }
            Told::Waiting { count, reason } => {
                self.records.waiting = schema::num::u64_of(count);
                let waiting = (count > 0)
                    .then(|| format!("{count} records wait in memory for the disk: {reason}"));
                if waiting != self.waiting
                    && let Some(text) = &waiting
                {
                    say::error(text.as_str());
                }
                self.blocked &= count > 0;
                self.waiting = waiting;
            }
            Told::Lost { reason } => {
                say::error(format!("a record is lost: {reason}"));
                self.lost += 1;
            }
            Told::Room { stored, free_bytes } => {
                self.records.stored = stored;
                self.records.free_bytes = free_bytes;
            }
        }
    }
}
