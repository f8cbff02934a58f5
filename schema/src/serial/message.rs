//! What a packet says: kind, session, number of the request, body and, once both sides have proved that they know the
//! token, a tag. Integers are little-endian. A request can be repeated: the answer is the same.

use super::auth::{Keys, NONCE_BYTES, PROOF_BYTES, TAG_BYTES};
use super::entry::Entry;
use super::refusal::Refusal;
use super::{MAX_DATA, MAX_PACKET, VERSION};

/// Bytes before the body.
pub(super) const HEAD_BYTES: usize = 9;
/// Bytes before the entries of a page.
pub(super) const PAGE_BYTES: usize = 4 + 4 + 1;

const _: () = assert!(HEAD_BYTES + 4 + 8 + MAX_DATA + TAG_BYTES <= MAX_PACKET);

const HELLO: u8 = 0x01;
const PROVE: u8 = 0x02;
const LIST: u8 = 0x03;
const READ: u8 = 0x04;
const BYE: u8 = 0x05;
/// A response is its request's kind with this bit.
const RESPONSE: u8 = 0x80;
/// A refusal in a session, with a tag.
const REFUSED: u8 = 0xfe;
/// A refusal outside of one, without.
const TURNED_AWAY: u8 = 0xff;

/// What every packet begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Number of the session, chosen at random by the client.
    pub session: u32,
    /// Number of the request, counted by the client; a response has that of its request.
    pub request: u32,
}

/// What the client asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Begins a session.
    Hello {
        /// The client's random number.
        nonce: [u8; NONCE_BYTES],
    },
    /// Shows that the client knows the token.
    Prove {
        /// [`Keys::client_proof`].
        proof: [u8; PROOF_BYTES],
    },
    /// A page of the list.
    List {
        /// Place in the list to begin at.
        first: u32,
    },
    /// Bytes of a file.
    Read {
        /// Place of the file in the list.
        place: u32,
        /// First eight bytes of its digest, as listed.
        digest: [u8; 8],
        /// First byte wanted.
        offset: u64,
        /// Bytes wanted, 1 to [`MAX_DATA`].
        length: u16,
    },
    /// Ends the session.
    Bye,
}

/// What the server answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Response {
    /// To [`Request::Hello`].
    Challenge {
        /// The server's random number.
        nonce: [u8; NONCE_BYTES],
    },
    /// To [`Request::Prove`].
    Welcome {
        /// [`Keys::server_proof`].
        proof: [u8; PROOF_BYTES],
        /// Length of the list.
        files: u32,
    },
    /// To [`Request::List`].
    Page {
        /// Length of the list.
        files: u32,
        /// Place at which the next page begins; at the end that length. A file that could not be read is left out.
        next: u32,
        /// The files.
        entries: Vec<Entry>,
    },
    /// To [`Request::Read`].
    Data {
        /// Place of the file in the list.
        place: u32,
        /// First byte.
        offset: u64,
        /// The bytes, as many as were asked for up to the end of the file as listed.
        bytes: Vec<u8>,
    },
    /// To [`Request::Bye`].
    Farewell,
    /// To any request.
    Refused(Refusal),
}

/// What is wrong with a packet that passed its CRC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// Too short, too long, or out of bounds.
    #[error("packet of kind {kind:#04x}: expected its fields, found {found} bytes that are not")]
    Layout {
        /// The kind.
        kind: u8,
        /// Bytes of the packet.
        found: usize,
    },
    /// The kind is not known.
    #[error("packet: kind {0:#04x} is not known")]
    Kind(u8),
    /// The version of the protocol is not known.
    #[error("hello: version {0} of the protocol is not known")]
    Version(u8),
    /// The tag is wrong, or there is no session to have one.
    #[error("packet of kind {0:#04x}: the tag does not hold")]
    Tag(u8),
}

/// The head of a packet, if it has one; for answering one that is not understood.
#[must_use]
pub fn head(packet: &[u8]) -> Option<Head> {
    Some(Head {
        session: u32::from_le_bytes(packet.get(1..5)?.try_into().ok()?),
        request: u32::from_le_bytes(packet.get(5..9)?.try_into().ok()?),
    })
}

pub(super) struct Fields<'a> {
    kind: u8,
    whole: usize,
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(super) fn wrong(&self) -> MessageError {
        MessageError::Layout {
            kind: self.kind,
            found: self.whole,
        }
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], MessageError> {
        let (array, rest) = self.rest.split_first_chunk().ok_or(self.wrong())?;
        self.rest = rest;
        Ok(*array)
    }

    pub(super) fn u8(&mut self) -> Result<u8, MessageError> {
        self.array().map(u8::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, MessageError> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, MessageError> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn take(&mut self, n: usize) -> Result<&'a [u8], MessageError> {
        let (taken, rest) = self.rest.split_at_checked(n).ok_or(self.wrong())?;
        self.rest = rest;
        Ok(taken)
    }

    fn end(&self) -> Result<(), MessageError> {
        self.rest.is_empty().then_some(()).ok_or(self.wrong())
    }
}

/// Splits a packet into its head and its fields; the tag is checked where the kind has one.
fn open<'a>(
    packet: &'a [u8],
    tagged: impl Fn(u8) -> bool,
    keys: Option<&Keys>,
) -> Result<(Head, Fields<'a>), MessageError> {
    let kind = packet.first().copied().unwrap_or(0);
    let short = MessageError::Layout {
        kind,
        found: packet.len(),
    };
    let head = head(packet).ok_or(short)?;
    let mut body = packet;
    if tagged(kind) {
        let at = packet.len().saturating_sub(TAG_BYTES).max(HEAD_BYTES);
        let (before, tag) = packet.split_at(at);
        if !keys.is_some_and(|keys| keys.is_tag(before, tag)) {
            return Err(MessageError::Tag(kind));
        }
        body = before;
    }
    let fields = Fields {
        kind,
        whole: packet.len(),
        rest: &body[HEAD_BYTES..],
    };
    Ok((head, fields))
}

fn start(kind: u8, head: Head) -> Vec<u8> {
    let mut out = Vec::with_capacity(MAX_PACKET);
    out.push(kind);
    out.extend(head.session.to_le_bytes());
    out.extend(head.request.to_le_bytes());
    out
}

fn seal(mut out: Vec<u8>, tagged: bool, keys: Option<&Keys>) -> Vec<u8> {
    if tagged {
        // Without a session there is no key, and the receiver refuses what has no tag.
        out.extend(keys.map(|keys| keys.tag(&out)).unwrap_or_default());
    }
    out
}

fn request_is_tagged(kind: u8) -> bool {
    !matches!(kind, HELLO | PROVE)
}

fn response_is_tagged(kind: u8) -> bool {
    kind != RESPONSE | HELLO && kind != RESPONSE | PROVE && kind != TURNED_AWAY
}

impl Request {
    /// The packet. `keys` of the session tag it, but for [`Request::Hello`] and [`Request::Prove`].
    #[must_use]
    pub fn packet(&self, head: Head, keys: Option<&Keys>) -> Vec<u8> {
        let kind = match self {
            Self::Hello { .. } => HELLO,
            Self::Prove { .. } => PROVE,
            Self::List { .. } => LIST,
            Self::Read { .. } => READ,
            Self::Bye => BYE,
        };
        let mut out = start(kind, head);
        match self {
            Self::Hello { nonce } => {
                out.push(VERSION);
                out.extend(nonce);
            }
            Self::Prove { proof } => out.extend(proof),
            Self::List { first } => out.extend(first.to_le_bytes()),
            Self::Read {
                place,
                digest,
                offset,
                length,
            } => {
                out.extend(place.to_le_bytes());
                out.extend(digest);
                out.extend(offset.to_le_bytes());
                out.extend(length.to_le_bytes());
            }
            Self::Bye => {}
        }
        seal(out, request_is_tagged(kind), keys)
    }

    /// Reads a packet that came to the server.
    ///
    /// # Errors
    /// When it is no request of this version, or its tag does not hold.
    pub fn read(packet: &[u8], keys: Option<&Keys>) -> Result<(Head, Self), MessageError> {
        let (head, mut body) = open(packet, request_is_tagged, keys)?;
        let request = match body.kind {
            HELLO => match body.u8()? {
                VERSION => Self::Hello {
                    nonce: body.array()?,
                },
                other => return Err(MessageError::Version(other)),
            },
            PROVE => Self::Prove {
                proof: body.array()?,
            },
            LIST => Self::List { first: body.u32()? },
            READ => Self::Read {
                place: body.u32()?,
                digest: body.array()?,
                offset: body.u64()?,
                length: body.array().map(u16::from_le_bytes)?,
            },
            BYE => Self::Bye,
            other => return Err(MessageError::Kind(other)),
        };
        body.end()?;
        Ok((head, request))
    }
}

impl Response {
    /// The packet. `keys` of the session tag it, but for [`Response::Challenge`], [`Response::Welcome`] and a refusal
    /// without keys.
    #[must_use]
    pub fn packet(&self, head: Head, keys: Option<&Keys>) -> Vec<u8> {
        let kind = match self {
            Self::Challenge { .. } => RESPONSE | HELLO,
            Self::Welcome { .. } => RESPONSE | PROVE,
            Self::Page { .. } => RESPONSE | LIST,
            Self::Data { .. } => RESPONSE | READ,
            Self::Farewell => RESPONSE | BYE,
            Self::Refused(_) if keys.is_some() => REFUSED,
            Self::Refused(_) => TURNED_AWAY,
        };
        let mut out = start(kind, head);
        match self {
            Self::Challenge { nonce } => {
                out.push(VERSION);
                out.extend(nonce);
            }
            Self::Welcome { proof, files } => {
                out.extend(proof);
                out.extend(files.to_le_bytes());
            }
            Self::Page {
                files,
                next,
                entries,
            } => {
                out.extend(files.to_le_bytes());
                out.extend(next.to_le_bytes());
                out.push(u8::try_from(entries.len()).unwrap_or(0));
                for entry in entries {
                    entry.put(&mut out);
                }
            }
            Self::Data {
                place,
                offset,
                bytes,
            } => {
                out.extend(place.to_le_bytes());
                out.extend(offset.to_le_bytes());
                out.extend(bytes);
            }
            Self::Farewell => {}
            Self::Refused(refusal) => {
                let (code, detail) = refusal.code();
                out.push(code);
                out.extend(detail.to_le_bytes());
            }
        }
        seal(out, response_is_tagged(kind), keys)
    }

    /// Reads a packet that came to the client.
    ///
    /// # Errors
    /// When it is no response of this version, or its tag does not hold.
    pub fn read(packet: &[u8], keys: Option<&Keys>) -> Result<(Head, Self), MessageError> {
        let (head, mut body) = open(packet, response_is_tagged, keys)?;
        let kind = body.kind;
        if kind == REFUSED || kind == TURNED_AWAY {
            let refusal = Refusal::from_code(body.u8()?, body.u32()?);
            body.end()?;
            return Ok((head, Self::Refused(refusal)));
        }
        if kind & RESPONSE == 0 {
            return Err(MessageError::Kind(kind));
        }
        let response = match kind & !RESPONSE {
            HELLO => match body.u8()? {
                VERSION => Self::Challenge {
                    nonce: body.array()?,
                },
                other => return Err(MessageError::Version(other)),
            },
            PROVE => Self::Welcome {
                proof: body.array()?,
                files: body.u32()?,
            },
            LIST => {
                let (files, next) = (body.u32()?, body.u32()?);
                let count = body.u8()?;
                let entries = (0..count).map(|_| Entry::read(&mut body));
                Self::Page {
                    files,
                    next,
                    entries: entries.collect::<Result<_, _>>()?,
                }
            }
            READ => {
                let (place, offset) = (body.u32()?, body.u64()?);
                let bytes = body.take(body.rest.len())?;
                if bytes.len() > MAX_DATA {
                    return Err(body.wrong());
                }
                Self::Data {
                    place,
                    offset,
                    bytes: bytes.to_vec(),
                }
            }
            BYE => Self::Farewell,
            _ => return Err(MessageError::Kind(kind)),
        };
        body.end()?;
        Ok((head, response))
    }
}
