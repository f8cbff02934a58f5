//! Read-out over a serial line [S03, 4.1: RS-232]: a process of its own beside the daemon, which only reads.
//!
//! The protocol is [`schema::serial`], laid down in `recorder/SERIAL.md`; [`session`] answers, [`shelf`] reads the
//! files. Here is the device: opened, read, written, and opened again when it was unplugged. Time is counted by the
//! port's own read time-outs, so no clock is read.

pub mod session;
pub mod shelf;

use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serialport::{DataBits, FlowControl, Parity, SerialPort, StopBits};

use crate::error::RecorderError;
use session::Session;
use shelf::Shelf;

/// Wait for bytes, ms; also how soon a request to stop is seen.
const WAIT_MS: u64 = 100;
/// Pause before a device that is not there is tried again, in waits.
const RETRY_WAITS: u32 = 10;
/// Waits for room on a line that takes no bytes, after which a response is dropped: the peer asks again.
const STUCK_WAITS: u32 = 50;

/// What to serve, and where.
#[derive(Clone, Debug)]
pub struct Options {
    /// The serial device.
    pub device: String,
    /// Bits a second.
    pub baud: u32,
    /// What a reader must know.
    pub token: String,
    /// Folder of the records.
    pub dir: PathBuf,
    /// End after one session.
    pub once: bool,
}

/// Serves until `stop` is set (or, with `once`, a session has ended). `say` gets what an operator is to know.
///
/// # Errors
/// With `once`, when the device can not be opened or goes away; without, it is tried again. When the system gives no
/// random numbers.
pub fn serve(
    options: &Options,
    stop: &AtomicBool,
    say: &mut dyn FnMut(&str),
) -> Result<(), RecorderError> {
    let mut session = Session::new(&options.token, Shelf::new(&options.dir));
    let mut told = String::new();
    while !stop.load(Ordering::Relaxed) {
        let lost = match open(options) {
            Ok(mut port) => {
                told.clear();
                say(&format!(
                    "{}: open, {} bits a second",
                    options.device, options.baud
                ));
                let Err(lost) = attend(&mut *port, &mut session, options.once, stop, say) else {
                    return Ok(());
                };
                lost
            }
            Err(lost) => lost,
        };
        session.cut();
        if options.once {
            return Err(RecorderError::Serial {
                device: options.device.clone(),
                found: lost,
            });
        }
        if lost != told {
            say(&format!("{}: {lost}; trying again", options.device));
            told = lost;
        }
        for _ in 0..RETRY_WAITS {
            if !stop.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(WAIT_MS));
            }
        }
    }
    Ok(())
}

fn open(options: &Options) -> Result<Box<dyn SerialPort>, String> {
    open_port(
        &options.device,
        options.baud,
        Duration::from_millis(WAIT_MS),
    )
}

/// Opens a serial device for this program alone: 8 data bits, no parity, 1 stop bit, no flow control.
pub(crate) fn open_port(
    device: &str,
    baud: u32,
    wait: Duration,
) -> Result<Box<dyn SerialPort>, String> {
    serialport::new(device, baud)
        .data_bits(DataBits::Eight)
        .parity(Parity::None)
        .stop_bits(StopBits::One)
        .flow_control(FlowControl::None)
        .exclusive(true)
        .timeout(wait)
        .open()
        .map_err(|error| format!("open the device: {error}"))
}

/// Serves on an open port; returns when it is to end, an error where the device is gone.
fn attend(
    port: &mut dyn SerialPort,
    session: &mut Session,
    once: bool,
    stop: &AtomicBool,
    say: &mut dyn FnMut(&str),
) -> Result<(), String> {
    let mut buffer = [0; 4096];
    let ended = session.ended();
    let mut random = true;
    while !(stop.load(Ordering::Relaxed) || once && session.ended() > ended) {
        match port.read(&mut buffer) {
            Ok(0) => return Err("read: the device is gone".to_owned()),
            Ok(count) => {
                let mut nonce = || {
                    let mut bytes = [0; schema::serial::NONCE_BYTES];
                    random = getrandom::fill(&mut bytes).is_ok();
                    random.then_some(bytes)
                };
                let mut lost = None;
                session.receive(&buffer[..count], &mut nonce, &mut |bytes| {
                    if lost.is_none() {
                        lost = send(port, bytes, stop).err();
                    }
                });
                if let Some(error) = lost {
                    return Err(format!("write: {error}"));
                }
            }
            Err(error) if error.kind() == ErrorKind::TimedOut => session.quiet(WAIT_MS),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(format!("read: {error}")),
        }
        for news in session.news() {
            say(&news);
        }
        if !random {
            return Err("the system gives no random numbers".to_owned());
        }
    }
    Ok(())
}

/// Writes a response; one that the line does not take is dropped, since its request will be repeated.
fn send(port: &mut dyn SerialPort, bytes: &[u8], stop: &AtomicBool) -> std::io::Result<()> {
    let (mut rest, mut waits) = (bytes, 0);
    while !rest.is_empty() && waits < STUCK_WAITS && !stop.load(Ordering::Relaxed) {
        match port.write(rest) {
            Ok(count) => {
                rest = rest.get(count..).unwrap_or_default();
                waits = if count == 0 { waits + 1 } else { 0 };
            }
            Err(error) if error.kind() == ErrorKind::TimedOut => waits += 1,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
