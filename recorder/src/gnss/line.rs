//! The serial line of a satellite receiver, read by a thread of its own, so that a slow or dead line never holds up the
//! receiving of frames. What it hears waits in a channel of fixed size; what finds no room there is lost and counted.
//!
//! The time of a sentence is that at which its first byte came: the time at which the chunk was read that held it, less
//! what the bytes behind it took on the line (ten bits each), and never before the read before, which had left nothing.
//! A device that buffers (a USB adapter waits up to 16 ms) delays what is told here; that is part of `latency_ms`.
//!
//! A device that goes away is told once, and tried again each second.
//!
//! Nobody waits for the thread: one that is to end ends within a wait, and the thread of another line on the same device
//! begins when it has.

use std::io::ErrorKind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::clock::monotonic_ns;
use crate::config::Device;
use crate::error::RecorderError;
use crate::nmea::{Framer, Heard, byte_time};
use crate::serve::open_port;

/// Wait for bytes; also how soon a request to stop is seen.
const WAIT: Duration = Duration::from_millis(100);
/// Waits before a device that is not there is tried again.
const RETRY_WAITS: u32 = 10;
/// What waits to be taken at most: a second of a full line of 115,200 bit/s.
const MOST_WAITING: usize = 512;
/// Bytes read at a time.
const CHUNK: usize = 1024;

/// What the thread tells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Told {
    /// A sentence or what is none; its time is on the monotonic clock.
    Heard(Heard),
    /// The device was opened or went away, in one sentence.
    Note {
        /// When, ns on the monotonic clock.
        at_ns: i64,
        /// What.
        text: String,
        /// It is a loss.
        loss: bool,
    },
}

/// Counts of the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineState {
    /// The device is open.
    pub open: bool,
    /// Bytes received.
    pub bytes: u64,
    /// Bytes received since the last sentence with a checksum that held, whatever its kind.
    pub strange: u64,
    /// Sentences that found no room, as the recorder was held up.
    pub lost: u64,
    /// Times the device went away.
    pub outages: u64,
}

#[derive(Debug, Default)]
struct Shared {
    stop: AtomicBool,
    open: AtomicBool,
    bytes: AtomicU64,
    strange: AtomicU64,
    lost: AtomicU64,
    outages: AtomicU64,
}

/// The thread, as the receiving thread sees it.
#[derive(Debug)]
pub struct Line {
    told: Receiver<Told>,
    shared: Arc<Shared>,
    device: Device,
    thread: Option<JoinHandle<()>>,
}

impl Line {
    /// Starts the thread. The device need not be there yet.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn start(device: &Device) -> Result<Self, RecorderError> {
        Self::follow(device, None)
    }

    /// Starts the thread in place of another one, which ends. Where both are of one device the new thread waits for the
    /// old one, for a device is opened by one at a time.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn follow(device: &Device, before: Option<Self>) -> Result<Self, RecorderError> {
        let same = |line: &Self| line.device.path == device.path;
        let before = before.filter(same).and_then(|mut line| line.thread.take());
        let (tell, told) = sync_channel(MOST_WAITING);
        let shared = Arc::new(Shared::default());
        let mut reader = Reader {
            device: device.clone(),
            tell,
            shared: Arc::clone(&shared),
        };
        let thread = std::thread::Builder::new()
            .name("gnss".to_owned())
            .stack_size(256 * 1024)
            .spawn(move || {
                if let Some(before) = before {
                    // It can not panic.
                    let _ = before.join();
                }
                reader.work();
            })
            .map_err(RecorderError::io(&device.path, "start the thread of"))?;
        Ok(Self {
            told,
            shared,
            device: device.clone(),
            thread: Some(thread),
        })
    }

    /// The next thing it told, if any waits.
    #[must_use]
    pub fn next(&self) -> Option<Told> {
        self.told.try_recv().ok()
    }

    /// Its counts.
    #[must_use]
    pub fn state(&self) -> LineState {
        LineState {
            open: self.shared.open.load(Relaxed),
            bytes: self.shared.bytes.load(Relaxed),
            strange: self.shared.strange.load(Relaxed),
            lost: self.shared.lost.load(Relaxed),
            outages: self.shared.outages.load(Relaxed),
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.shared.stop.store(true, Relaxed);
    }
}

struct Reader {
    device: Device,
    tell: SyncSender<Told>,
    shared: Arc<Shared>,
}

impl Reader {
    fn work(&mut self) {
        let mut said = String::new();
        while !self.stopped() {
            let lost = match open_port(&self.device.path, self.device.baud, WAIT) {
                Ok(mut port) => {
                    said.clear();
                    self.shared.open.store(true, Relaxed);
                    let (path, baud) = (&self.device.path, self.device.baud);
                    let text = format!("satellite receiver: {path} is open, {baud} bits a second");
                    self.note(text, false);
                    let lost = self.listen(&mut *port);
                    self.shared.open.store(false, Relaxed);
                    if self.stopped() {
                        return;
                    }
                    self.shared.outages.fetch_add(1, Relaxed);
                    lost
                }
                Err(lost) => lost,
            };
            if lost != said {
                let text = format!("satellite receiver: {}: {lost}", self.device.path);
                self.note(text, true);
                said = lost;
            }
            for _ in 0..RETRY_WAITS {
                if !self.stopped() {
                    std::thread::sleep(WAIT);
                }
            }
        }
    }

    /// Reads until it is to stop or the device is gone; gives why.
    fn listen(&self, port: &mut dyn serialport::SerialPort) -> String {
        let mut framer = Framer::default();
        let mut buffer = [0; CHUNK];
        let mut before_ns = monotonic_ns();
        let byte_ns = self.device.byte_ns();
        while !self.stopped() {
            let count = match port.read(&mut buffer) {
                Ok(0) => return "the device is gone".to_owned(),
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::TimedOut => {
                    before_ns = monotonic_ns();
                    continue;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return format!("the device is gone ({error})"),
            };
            let read_ns = monotonic_ns();
            let counted = schema::num::u64_of(count);
            self.shared.bytes.fetch_add(counted, Relaxed);
            self.shared.strange.fetch_add(counted, Relaxed);
            for (at, byte) in buffer.iter().take(count).enumerate() {
                let time_ns = byte_time(read_ns, count - 1 - at, byte_ns, before_ns);
                if let Some(heard) = framer.push(*byte, time_ns) {
                    if let Heard::Sentence { .. } = heard {
                        self.shared.strange.store(0, Relaxed);
                    }
                    self.hand(Told::Heard(heard));
                }
            }
            // A chunk that fills the buffer may have left bytes behind, which came before now.
            if count < CHUNK {
                before_ns = read_ns;
            }
        }
        String::new()
    }

    fn stopped(&self) -> bool {
        self.shared.stop.load(Relaxed)
    }

    fn note(&self, text: String, loss: bool) {
        let at_ns = monotonic_ns();
        self.hand(Told::Note { at_ns, text, loss });
    }

    fn hand(&self, told: Told) {
        if self.tell.try_send(told).is_err() {
            self.shared.lost.fetch_add(1, Relaxed);
        }
    }
}
