//! CAN frames and where they come from: a log now, a socket by the same trait.

use crate::error::RecorderError;

/// SocketCAN's flag of an extended (29-bit) identifier.
pub const EFF: u32 = 0x8000_0000;
/// SocketCAN's flag of a remote transmission request.
pub const RTR: u32 = 0x4000_0000;
/// SocketCAN's flag of an error frame.
pub const ERR: u32 = 0x2000_0000;
/// In [`Frame::flags`]: this is a CAN FD frame.
pub const FD: u8 = 0x80;
/// Most payload bytes of a frame (CAN FD).
pub const MAX_DATA: usize = 64;

/// One frame in a buffer of fixed size, so that none is allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Receive time on the source's own clock (UTC of the log), ns.
    pub time_ns: i64,
    /// Index of the configured bus; [`Frame::FOREIGN`] for an interface that no bus names.
    pub interface: u8,
    /// Identifier with SocketCAN's flag bits [`EFF`], [`RTR`], [`ERR`].
    pub id: u32,
    /// CAN FD flags (BRS 1, ESI 2) and [`FD`]; 0 for a classic frame.
    pub flags: u8,
    /// Payload bytes in use.
    len: u8,
    /// Payload.
    bytes: [u8; MAX_DATA],
}

impl Frame {
    /// Interface of frames that no configured bus names.
    pub const FOREIGN: u8 = u8::MAX;

    /// An empty frame to be read into.
    #[must_use]
    pub const fn empty() -> Self {
        Self {
            time_ns: 0,
            interface: Self::FOREIGN,
            id: 0,
            flags: 0,
            len: 0,
            bytes: [0; MAX_DATA],
        }
    }

    /// A frame with this payload, cut at 64 bytes.
    #[must_use]
    pub fn new(time_ns: i64, interface: u8, id: u32, flags: u8, data: &[u8]) -> Self {
        let mut frame = Self {
            time_ns,
            interface,
            id,
            flags,
            ..Self::empty()
        };
        frame.fill(data);
        frame
    }

    /// The payload.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or_default()
    }

    /// The whole payload buffer; bytes beyond [`Frame::data`] are of no meaning.
    #[must_use]
    pub const fn buffer(&self) -> &[u8; MAX_DATA] {
        &self.bytes
    }

    /// Payload bytes in use.
    #[must_use]
    pub const fn len(&self) -> u8 {
        self.len
    }

    /// True without payload.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Forgets the payload.
    pub const fn clear(&mut self) {
        self.len = 0;
    }

    /// Takes this payload, cut at 64 bytes.
    pub fn fill(&mut self, data: &[u8]) {
        let data = data.get(..MAX_DATA).unwrap_or(data);
        if let Some(slots) = self.bytes.get_mut(..data.len()) {
            slots.copy_from_slice(data);
        }
        self.len = u8::try_from(data.len()).unwrap_or_default();
    }

    /// Appends a byte; false when 64 are there already.
    pub fn push(&mut self, byte: u8) -> bool {
        match self.bytes.get_mut(usize::from(self.len)) {
            Some(slot) => {
                *slot = byte;
                self.len += 1;
                true
            }
            None => false,
        }
    }

    /// True if this frame carries data: neither an error frame nor a remote request.
    #[must_use]
    pub const fn carries_data(&self) -> bool {
        self.id & (ERR | RTR) == 0
    }
}

/// What a source saw that was not a good frame, since it was opened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceHealth {
    /// Lines (or datagrams) that could not be read as a frame.
    pub malformed: u64,
    /// Frames the kernel dropped.
    pub dropped: u64,
    /// The first few malformed ones, one sentence each.
    pub examples: Vec<String>,
    /// Interfaces that no bus names, as found.
    pub foreign: Vec<String>,
}

/// Anything frames can be read from.
pub trait FrameSource {
    /// Reads the next frame into `frame`; false at the end.
    ///
    /// # Errors
    /// When the source itself fails (a file that can not be read); a malformed line is no error but counted.
    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, RecorderError>;

    /// What was seen so far that was not a good frame.
    fn health(&self) -> SourceHealth;
}

/// The interfaces that buses name, and names that stand for them.
#[derive(Clone, Debug, Default)]
pub struct Interfaces {
    names: Vec<String>,
    aliases: Vec<(String, u8)>,
}

impl Interfaces {
    /// The configured interfaces in order; `map` gives pairs (name in the log, configured name).
    ///
    /// # Errors
    /// When a pair maps to an interface that is not configured.
    pub fn new(names: &[String], map: &[(String, String)]) -> Result<Self, RecorderError> {
        let mut aliases = Vec::new();
        for (from, to) in map {
            let at = names
                .iter()
                .position(|name| name == to)
                .and_then(|at| u8::try_from(at).ok());
            match at {
                Some(at) => aliases.push((from.clone(), at)),
                None => {
                    return Err(RecorderError::Map {
                        from: from.clone(),
                        to: to.clone(),
                        known: names.join(", "),
                    });
                }
            }
        }
        Ok(Self {
            names: names.to_vec(),
            aliases,
        })
    }

    /// Index of the bus an interface name stands for.
    #[must_use]
    pub fn find(&self, name: &[u8]) -> Option<u8> {
        if let Some((_, at)) = self
            .aliases
            .iter()
            .find(|(from, _)| from.as_bytes() == name)
        {
            return Some(*at);
        }
        self.names
            .iter()
            .position(|known| known.as_bytes() == name)
            .and_then(|at| u8::try_from(at).ok())
    }
}
