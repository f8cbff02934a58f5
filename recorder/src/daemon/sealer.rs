//! The thread that seals records, so that writing one never holds up the receiving of frames.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use schema::Record;
use schema::ledger::Weak;

use crate::error::RecorderError;
use crate::store::lock::weakness;

/// Records that wait for room on the disk at most; of more the newest are given up, and that is told.
const MOST_WAITING: usize = 4;
/// Time between two tries.
const AGAIN: Duration = Duration::from_secs(2);

/// Where records are kept.
pub trait Keeper: Send {
    /// Seals a record.
    ///
    /// # Errors
    /// The record back, where it could not be stored, and why.
    fn seal(&mut self, record: Record) -> Result<Kept, Box<Refused>>;

    /// Record files in the folder.
    fn stored(&self) -> u64;

    /// Bytes free for records.
    fn free_bytes(&self) -> u64;
}

/// A record that is on disk.
#[derive(Clone, Debug)]
pub struct Kept {
    /// Its file.
    pub path: PathBuf,
    /// Its number.
    pub number: u64,
    /// What else was done: records that were removed for it, and the like.
    pub notes: Vec<String>,
}

/// One that is not.
#[derive(Debug)]
pub struct Refused {
    /// The record.
    pub record: Record,
    /// Why.
    pub reason: String,
    /// Trying again does not help.
    pub hopeless: bool,
}

/// First and last trigger of an event on the line, ns.
pub type Span = (i64, i64);

/// What the thread tells.
#[derive(Debug)]
pub enum Told {
    /// An event is on disk.
    Sealed {
        /// Its first and last trigger on the line, ns.
        span_ns: Span,
        /// Where.
        kept: Kept,
    },
    /// So many records wait for the disk, and why; 0: none any more.
    Waiting {
        /// How many.
        count: usize,
        /// Why.
        reason: String,
    },
    /// A record was given up.
    Lost {
        /// Why.
        reason: String,
    },
    /// Files and free bytes, now and then.
    Room {
        /// Record files.
        stored: u64,
        /// Bytes free.
        free_bytes: u64,
    },
}

/// The thread.
pub struct Sealer {
    to: Option<SyncSender<(Record, Span)>>,
    told: Receiver<Told>,
    thread: Option<JoinHandle<()>>,
}

impl Sealer {
    /// Starts it, with records that wait already.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn start(
        keeper: Box<dyn Keeper>,
        waiting: VecDeque<(Record, Span)>,
    ) -> Result<Self, RecorderError> {
        let (to, from) = sync_channel(MOST_WAITING);
        let (tell, told) = channel();
        let thread = std::thread::Builder::new()
            .name("sealer".to_owned())
            .stack_size(512 * 1024)
            .spawn(move || work(keeper, waiting, &from, &tell))
            .map_err(RecorderError::io("sealer", "start the thread of"))?;
        Ok(Self {
            to: Some(to),
            told,
            thread: Some(thread),
        })
    }

    /// Hands over a record.
    ///
    /// # Errors
    /// When too many wait already; the record is then lost.
    pub fn seal(&self, record: Record, span: Span) -> Result<(), String> {
        let full = || format!("{MOST_WAITING} records wait for the disk already");
        let to = self.to.as_ref().ok_or_else(full)?;
        to.try_send((record, span)).map_err(|_| full())
    }

    /// What it told since the last call.
    pub fn told(&self) -> impl Iterator<Item = Told> + '_ {
        self.told.try_iter()
    }

    /// Seals what was handed over, then ends. Gives what it told last.
    pub fn finish(&mut self) -> Vec<Told> {
        self.to = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        self.told.try_iter().collect()
    }
}

fn work(
    mut keeper: Box<dyn Keeper>,
    mut waiting: VecDeque<(Record, Span)>,
    from: &Receiver<(Record, Span)>,
    tell: &Sender<Told>,
) {
    let mut open = true;
    while open {
        // While the disk takes nothing the channel is left full: what does not fit there is told where it is handed over.
        let full = waiting.len() >= MOST_WAITING;
        match from.recv_timeout(AGAIN) {
            Ok(next) if full => {
                // Of too many a weak one is given up, else the newest.
                let weak = |(record, _): &(Record, Span)| weakness(record) != Weak::No;
                let given_up = waiting.iter().position(weak);
                if let Some(at) = given_up {
                    waiting.remove(at);
                    waiting.push_back(next);
                }
                let reason = format!("{MOST_WAITING} records wait for the disk already");
                let _ = tell.send(Told::Lost { reason });
            }
            Ok(next) => waiting.push_back(next),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => open = false,
        }
        // One that finds no room holds up none behind it: a crash makes room where a record by hand may not.
        let mut reason = None;
        for (record, span_ns) in std::mem::take(&mut waiting) {
            match keeper.seal(record) {
                Ok(kept) => {
                    let _ = tell.send(Told::Sealed { span_ns, kept });
                }
                Err(refused) if refused.hopeless => {
                    let _ = tell.send(Told::Lost {
                        reason: refused.reason,
                    });
                }
                Err(refused) => {
                    waiting.push_back((refused.record, span_ns));
                    reason.get_or_insert(refused.reason);
                }
            }
        }
        let _ = tell.send(Told::Waiting {
            count: waiting.len(),
            reason: reason.unwrap_or_default(),
        });
        let _ = tell.send(Told::Room {
            stored: keeper.stored(),
            free_bytes: keeper.free_bytes(),
        });
    }
}
