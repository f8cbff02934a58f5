//! The server's side of the read-out: bytes in, bytes out, and quiet time that passes. It reads no clock and owns no
//! line. Whatever comes, it holds at most one packet, one session that is being proved and one that is open.

use schema::num;
use schema::serial::{
    Deframer, Head, Keys, MessageError, NONCE_BYTES, Refusal, Request, Response, VERSION, line,
    message,
};

use super::shelf::Shelf;

/// Quiet after which a session ends, ms.
pub const SILENCE_MS: u64 = 60_000;
/// Bytes without a packet of the session after which it ends.
const NOISE_BYTES: u64 = 1 << 20;
/// Wait after the first wrong proof, s; each further one doubles it.
const FIRST_WAIT_S: u64 = 2;
/// Longest wait, s.
const LONGEST_WAIT_S: u64 = 256;

#[derive(Debug)]
struct Held {
    session: u32,
    nonces: [[u8; NONCE_BYTES]; 2],
    keys: Keys,
}

/// The server.
#[derive(Debug)]
pub struct Session {
    token: String,
    shelf: Shelf,
    deframer: Deframer,
    /// A challenge was sent.
    asked: Option<Held>,
    /// The token was proved.
    open: Option<Held>,
    failures: u32,
    wait_ms: u64,
    quiet_ms: u64,
    noise: u64,
    sent: u64,
    ended: u64,
    /// What an operator is to know, until it is taken.
    news: Vec<String>,
}

impl Session {
    /// With the token of the configuration.
    #[must_use]
    pub fn new(token: &str, shelf: Shelf) -> Self {
        Self {
            token: token.to_owned(),
            shelf,
            deframer: Deframer::default(),
            asked: None,
            open: None,
            failures: 0,
            wait_ms: 0,
            quiet_ms: 0,
            noise: 0,
            sent: 0,
            ended: 0,
            news: Vec::new(),
        }
    }

    /// Takes bytes off the line; `nonce` gives unpredictable bytes (`None` where the system has none), `send` gets
    /// what goes back, a response at a time.
    pub fn receive(
        &mut self,
        bytes: &[u8],
        nonce: &mut dyn FnMut() -> Option<[u8; NONCE_BYTES]>,
        send: &mut dyn FnMut(&[u8]),
    ) {
        self.quiet_ms = 0;
        for byte in bytes {
            self.noise += 1;
            let Some(Ok(packet)) = self.deframer.push(*byte) else {
                continue;
            };
            if let Some(answer) = self.answer(&packet, nonce) {
                send(&line::frame(&answer));
            }
        }
        if self.noise > NOISE_BYTES {
            self.noise = 0;
            self.end("nothing but noise came");
        }
    }

    /// So much time passed without a byte. Waits after wrong proofs are counted by it alone, so a line that is kept
    /// busy does not shorten them.
    pub fn quiet(&mut self, ms: u64) {
        self.wait_ms = self.wait_ms.saturating_sub(ms);
        self.quiet_ms = self.quiet_ms.saturating_add(ms);
        if self.quiet_ms >= SILENCE_MS {
            self.asked = None;
            self.end("the line fell silent");
        }
    }

    /// The line was cut off from this side: whatever was on it is gone.
    pub fn cut(&mut self) {
        self.deframer = Deframer::default();
        self.asked = None;
        self.end("the device went away");
    }

    /// Sessions that have ended.
    #[must_use]
    pub fn ended(&self) -> u64 {
        self.ended
    }

    /// Bytes held for a packet that has begun.
    #[must_use]
    pub fn held(&self) -> usize {
        self.deframer.held()
    }

    /// What happened since it was last asked, a sentence each.
    pub fn news(&mut self) -> Vec<String> {
        std::mem::take(&mut self.news)
    }

    fn end(&mut self, why: &str) {
        if self.open.take().is_some() {
            self.ended += 1;
            self.news.push(format!(
                "session ended, {why}: {} bytes of files sent",
                self.sent
            ));
        }
    }

    fn answer(
        &mut self,
        packet: &[u8],
        nonce: &mut dyn FnMut() -> Option<[u8; NONCE_BYTES]>,
    ) -> Option<Vec<u8>> {
        let head = message::head(packet)?;
        let open = self.open.as_ref().filter(|o| o.session == head.session);
        let keys = open.map(|open| &open.keys);
        let away = |refusal| Some(Response::Refused(refusal).packet(head, None));
        match Request::read(packet, keys) {
            Ok((_, Request::Hello { nonce: theirs })) => self.hello(head, theirs, nonce),
            Ok((_, Request::Prove { proof })) => self.prove(head, &proof),
            Ok((_, request)) => {
                // The tag held, so the session is open; its keys tag the answer.
                let keys = keys.cloned()?;
                self.noise = 0;
                let response = self.serve(&request);
                Some(response.packet(head, Some(&keys)))
            }
            Err(MessageError::Version(_)) => away(Refusal::Version(VERSION.into())),
            // A response of our own that came back, as from a plug that joins the line's two ends.
            Err(_) if packet.first().is_some_and(|kind| kind & 0x80 != 0) => None,
            Err(MessageError::Tag(_)) => away(Refusal::NoSession),
            Err(_) => Some(Response::Refused(Refusal::Unknown).packet(head, keys)),
        }
    }

    fn hello(
        &mut self,
        head: Head,
        theirs: [u8; NONCE_BYTES],
        nonce: &mut dyn FnMut() -> Option<[u8; NONCE_BYTES]>,
    ) -> Option<Vec<u8>> {
        if let Some(refusal) = self.waiting() {
            return Some(Response::Refused(refusal).packet(head, None));
        }
        let known = [&self.asked, &self.open]
            .into_iter()
            .flatten()
            .find(|held| held.session == head.session && held.nonces[0] == theirs);
        let ours = if let Some(held) = known {
            held.nonces[1]
        } else {
            let ours = nonce()?;
            self.asked = Some(Held {
                session: head.session,
                nonces: [theirs, ours],
                keys: Keys::new(&self.token, head.session, &theirs, &ours),
            });
            ours
        };
        Some(Response::Challenge { nonce: ours }.packet(head, None))
    }

    fn waiting(&self) -> Option<Refusal> {
        let seconds = u32::try_from(self.wait_ms.div_ceil(1000)).unwrap_or(u32::MAX);
        (seconds > 0).then_some(Refusal::Wait(seconds))
    }

    fn prove(&mut self, head: Head, proof: &[u8]) -> Option<Vec<u8>> {
        let away = |refusal| Some(Response::Refused(refusal).packet(head, None));
        let of = |held: &Held| held.session == head.session;
        // A repeated proof gets the same answer, but opens nothing anew.
        if let Some(open) = self.open.as_ref().filter(|held| of(held)) {
            if !open.keys.is_client_proof(proof) {
                return away(Refusal::NoSession);
            }
            return Some(self.welcome(head, &open.keys));
        }
        if let Some(refusal) = self.waiting() {
            return away(refusal);
        }
        let Some(asked) = self.asked.take_if(|held| of(held)) else {
            return away(Refusal::NoSession);
        };
        if !asked.keys.is_client_proof(proof) {
            let wait = (FIRST_WAIT_S << self.failures.min(7)).min(LONGEST_WAIT_S);
            self.failures += 1;
            self.wait_ms = wait * 1000;
            self.news.push(format!(
                "a wrong token, number {} in a row; the next attempt is answered after {wait} s",
                self.failures
            ));
            return away(Refusal::WrongToken(u32::try_from(wait).unwrap_or(u32::MAX)));
        }
        self.end("another began");
        if let Err(error) = self.shelf.refresh() {
            self.news
                .push(format!("the folder of the records: {error}"));
        }
        self.failures = 0;
        self.sent = 0;
        self.noise = 0;
        self.news
            .push(format!("session begun: {} files", self.shelf.len()));
        let welcome = self.welcome(head, &asked.keys);
        self.open = Some(asked);
        Some(welcome)
    }

    fn welcome(&self, head: Head, keys: &Keys) -> Vec<u8> {
        let welcome = Response::Welcome {
            proof: keys.server_proof(),
            files: self.shelf.len(),
        };
        welcome.packet(head, None)
    }

    fn serve(&mut self, request: &Request) -> Response {
        match *request {
            Request::List { first } => {
                let (next, entries) = self.shelf.page(first);
                Response::Page {
                    files: self.shelf.len(),
                    next,
                    entries,
                }
            }
            Request::Read {
                place,
                digest,
                offset,
                length,
            } => match self.shelf.read(place, &digest, offset, length) {
                Ok(bytes) => {
                    self.sent += num::u64_of(bytes.len());
                    Response::Data {
                        place,
                        offset,
                        bytes,
                    }
                }
                Err(refusal) => Response::Refused(refusal),
            },
            Request::Bye => {
                self.end("the reader said goodbye");
                Response::Farewell
            }
            Request::Hello { .. } | Request::Prove { .. } => Response::Refused(Refusal::Unknown),
        }
    }
}
