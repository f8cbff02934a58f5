//! A session with the recorder: asks, repeats on silence, and takes only the answer to what it asked.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::time::Duration;

use schema::num;
use schema::serial::line::{self, MAX_STUFFED};
use schema::serial::{Deframer, Head, Keys, NONCE_BYTES, Refusal, Request, Response};

use super::FetchError;

/// Wait for an answer beside the time on the line, ms: the recorder may be busy, an adapter may hold bytes back.
const WAIT_MS: u64 = 200;
/// Longest wait, as a multiple of the first.
const MOST_WAITS: u64 = 4;
/// Bytes of noise that count as silence.
const NOISE_BYTES: usize = 32 * MAX_STUFFED;

/// Times a session is begun before its loss is believed.
const MOST_HELLOS: u32 = 20;

/// A line to the recorder.
pub trait Port {
    /// Waits at most so long for bytes.
    ///
    /// # Errors
    /// `TimedOut` where none came; all else ends the fetch.
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize>;
    /// Sends bytes.
    ///
    /// # Errors
    /// `TimedOut` where the line takes none; all else ends the fetch.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;
}

impl Port for Box<dyn serialport::SerialPort> {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        if self.timeout() != wait {
            self.set_timeout(wait)?;
        }
        io::Read::read(self, bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        io::Write::write_all(self, bytes)
    }
}

/// A session.
#[derive(Debug)]
pub struct Link<P> {
    device: String,
    port: P,
    token: String,
    first_wait_ms: u64,
    patience_ms: u64,
    silent_ms: u64,
    silences: u64,
    deframer: Deframer,
    came: VecDeque<Vec<u8>>,
    session: u32,
    request: u32,
    keys: Option<Keys>,
    /// Bytes that came over the line.
    pub received: u64,
}

impl<P: Port> Link<P> {
    /// Over a port of so many bits a second; gives up after so much silence. [`Link::connect`] comes next.
    pub fn new(device: &str, port: P, baud: u32, token: &str, patience: Duration) -> Self {
        // Ten bits a byte; the answer may stand behind another.
        let frame_ms = num::u64_of(2 * MAX_STUFFED) * 10_000 / u64::from(baud.max(1));
        Self {
            device: device.to_owned(),
            port,
            token: token.to_owned(),
            first_wait_ms: WAIT_MS + frame_ms,
            patience_ms: u64::try_from(patience.as_millis()).unwrap_or(u64::MAX),
            silent_ms: 0,
            silences: 0,
            deframer: Deframer::default(),
            came: VecDeque::new(),
            session: 0,
            request: 0,
            keys: None,
            received: 0,
        }
    }

    /// Begins a session: both sides prove that they know the token.
    ///
    /// # Errors
    /// When nothing answers, the recorder refuses, or what answers does not know the token.
    pub fn connect(&mut self) -> Result<(), FetchError> {
        for _ in 0..MOST_HELLOS {
            let random = || {
                let mut bytes = [0; NONCE_BYTES];
                getrandom::fill(&mut bytes).map_err(|_| FetchError::Random)?;
                Ok::<_, FetchError>(bytes)
            };
            let [a, b, c, d, ..] = random()?;
            self.session = u32::from_le_bytes([a, b, c, d]);
            self.keys = None;
            let ours = random()?;
            let theirs = match self.ask(&Request::Hello { nonce: ours })? {
                Response::Challenge { nonce } => nonce,
                Response::Refused(refusal) => return Err(refusal.into()),
                _ => {
                    return Err(FetchError::Response {
                        expected: "a challenge",
                    });
                }
            };
            let keys = Keys::new(&self.token, self.session, &ours, &theirs);
            let proof = keys.client_proof();
            match self.ask(&Request::Prove { proof })? {
                Response::Welcome { proof, .. } if keys.is_server_proof(&proof) => {
                    self.keys = Some(keys);
                    return Ok(());
                }
                Response::Welcome { .. } => return Err(FetchError::NotTheRecorder),
                // It was started anew between the two.
                Response::Refused(Refusal::NoSession) => {}
                Response::Refused(refusal) => return Err(refusal.into()),
                _ => {
                    return Err(FetchError::Response {
                        expected: "a welcome",
                    });
                }
            }
        }
        Err(Refusal::NoSession.into())
    }

    /// Asks until it is answered.
    ///
    /// # Errors
    /// When the line fails, or is silent for too long.
    pub fn ask(&mut self, request: &Request) -> Result<Response, FetchError> {
        let number = self.next_number();
        loop {
            self.send(number, request)?;
            loop {
                match self.receive()? {
                    Some((found, response)) if found == number => return Ok(response),
                    Some(_) => {}
                    None => break,
                }
            }
        }
    }

    /// Ends the session; that nothing answers is no error any more.
    pub fn bye(&mut self) {
        let number = self.next_number();
        for _ in 0..3 {
            if self.send(number, &Request::Bye).is_err() || !matches!(self.receive(), Ok(None)) {
                break;
            }
        }
        self.keys = None;
    }

    /// A number no request of this session had.
    pub(super) fn next_number(&mut self) -> u32 {
        self.request = self.request.wrapping_add(1);
        self.request
    }

    pub(super) fn send(&mut self, number: u32, request: &Request) -> Result<(), FetchError> {
        let head = Head {
            session: self.session,
            request: number,
        };
        let packet = request.packet(head, self.keys.as_ref());
        match self.port.write(&line::frame(&packet)) {
            // A line that takes nothing loses it: it is asked again.
            Err(error) if error.kind() == ErrorKind::TimedOut => Ok(()),
            other => other.map_err(|source| self.line(source)),
        }
    }

    /// The next response of this session, with the number of its request; `None` after silence, or noise as long.
    pub(super) fn receive(&mut self) -> Result<Option<(u32, Response)>, FetchError> {
        let mut noise = 0;
        let wait = self.wait_ms();
        loop {
            while let Some(packet) = self.came.pop_front() {
                // What is damaged, forged or of another session is no answer.
                if let Ok((head, response)) = Response::read(&packet, self.keys.as_ref())
                    && head.session == self.session
                {
                    self.silent_ms = 0;
                    self.silences = 0;
                    return Ok(Some((head.request, response)));
                }
            }
            let mut bytes = [0; 4096];
            match self.port.read(&mut bytes, Duration::from_millis(wait)) {
                Ok(0) => return Err(self.line(ErrorKind::UnexpectedEof.into())),
                Ok(count) => {
                    noise += count;
                    self.received += num::u64_of(count);
                    let bytes = bytes.get(..count).unwrap_or_default();
                    let packets = bytes.iter().filter_map(|byte| self.deframer.push(*byte));
                    self.came.extend(packets.flatten());
                    if noise > NOISE_BYTES && self.came.is_empty() {
                        self.silence(wait)?;
                        return Ok(None);
                    }
                }
                Err(error) if error.kind() == ErrorKind::TimedOut => {
                    self.silence(wait)?;
                    return Ok(None);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(self.line(error)),
            }
        }
    }

    fn wait_ms(&self) -> u64 {
        self.first_wait_ms * (1 + self.silences / 2).min(MOST_WAITS)
    }

    fn silence(&mut self, wait_ms: u64) -> Result<(), FetchError> {
        self.silences += 1;
        self.silent_ms += wait_ms;
        if self.silent_ms >= self.patience_ms {
            return Err(FetchError::Silent {
                seconds: self.silent_ms.div_ceil(1000),
            });
        }
        Ok(())
    }

    fn line(&self, source: io::Error) -> FetchError {
        FetchError::Line {
            device: self.device.clone(),
            source,
        }
    }
}
