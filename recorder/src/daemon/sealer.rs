//! The thread that seals records, so that writing one never holds up the receiving of frames.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use schema::Record;

use crate::error::RecorderError;

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

/// What the thread tells.
#[derive(Debug)]
pub enum Told {
    /// The event whose first trigger fell at this time on the line is on disk.
    Sealed {
        /// On the line, ns.
        trigger_ns: i64,
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
    to: Option<Sender<(Record, i64)>>,
    told: Receiver<Told>,
    thread: Option<JoinHandle<()>>,
}

impl Sealer {
    /// Starts it.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn start(keeper: Box<dyn Keeper>) -> Result<Self, RecorderError> {
        let (to, from) = channel();
        let (tell, told) = channel();
        let thread = std::thread::Builder::new()
            .name("sealer".to_owned())
            .stack_size(512 * 1024)
            .spawn(move || work(keeper, &from, &tell))
            .map_err(RecorderError::io("sealer", "start the thread of"))?;
        Ok(Self {
            to: Some(to),
            told,
            thread: Some(thread),
        })
    }

    /// Hands over a record with the time of its first trigger on the line, ns.
    pub fn seal(&self, record: Record, trigger_ns: i64) {
        if let Some(to) = &self.to {
            // The thread ends only when this side does.
            let _ = to.send((record, trigger_ns));
        }
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

fn work(mut keeper: Box<dyn Keeper>, from: &Receiver<(Record, i64)>, tell: &Sender<Told>) {
    let mut waiting: VecDeque<(Record, i64)> = VecDeque::new();
    let mut open = true;
    while open {
        match from.recv_timeout(AGAIN) {
            Ok(next) if waiting.len() < MOST_WAITING => waiting.push_back(next),
            Ok(_) => {
                let reason = format!("{MOST_WAITING} records wait for the disk already");
                let _ = tell.send(Told::Lost { reason });
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => open = false,
        }
        while let Some((record, trigger_ns)) = waiting.pop_front() {
            match keeper.seal(record) {
                Ok(kept) => {
                    let _ = tell.send(Told::Sealed { trigger_ns, kept });
                    let _ = tell.send(Told::Waiting {
                        count: waiting.len(),
                        reason: String::new(),
                    });
                }
                Err(refused) if refused.hopeless => {
                    let reason = refused.reason;
                    let _ = tell.send(Told::Lost { reason });
                }
                Err(refused) => {
                    waiting.push_front((refused.record, trigger_ns));
                    let _ = tell.send(Told::Waiting {
                        count: waiting.len(),
                        reason: refused.reason,
                    });
                    break;
                }
            }
        }
        let _ = tell.send(Told::Room {
            stored: keeper.stored(),
            free_bytes: keeper.free_bytes(),
        });
    }
}
