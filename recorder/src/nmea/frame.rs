//! Sentences in a stream of bytes: from `$` or `!` to `*` and two hexadecimal digits of the checksum.

use std::fmt;

use schema::num;

/// Longest sentence that is taken, bytes from `$` to the checksum. The standard allows 82 with CR LF; receivers with
/// many digits send some more.
pub const LONGEST: usize = 120;

/// A sentence, printable ASCII from `$` or `!` to the checksum, without the line's end.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text {
    bytes: [u8; LONGEST],
    len: u8,
}

/// What came over the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A sentence whose checksum holds.
    Sentence {
        /// Receive time of its first byte, ns, on the clock of whoever feeds the framer.
        at_ns: i64,
        /// The sentence.
        text: Text,
    },
    /// One whose checksum does not.
    BadChecksum,
    /// The beginning of one that is none: too long, without a checksum, or not printable.
    Malformed,
}

/// The exclusive or of all bytes between `$` and `*`.
#[must_use]
pub fn checksum(body: &[u8]) -> u8 {
    body.iter().fold(0, |sum, byte| sum ^ byte)
}

impl Text {
    /// A sentence of these bytes; `None` where they are none, or the checksum does not hold.
    #[must_use]
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let mut framer = Framer::default();
        let (last, before) = bytes.split_last()?;
        for byte in before {
            if framer.push(*byte, 0).is_some() {
                return None;
            }
        }
        match framer.push(*last, 0) {
            Some(Heard::Sentence { text, .. }) if text.as_bytes().len() == bytes.len() => {
                Some(text)
            }
            _ => None,
        }
    }

    /// The bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or_default()
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        std::str::from_utf8(self.as_bytes()).unwrap_or_default()
    }

    /// What stands between `$` and `*`.
    #[must_use]
    pub fn body(&self) -> &[u8] {
        let end = usize::from(self.len).saturating_sub(3);
        self.bytes.get(1..end).unwrap_or_default()
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:?}", self.as_str())
    }
}

/// Finds sentences. It holds one sentence at most; after anything that is none it goes on at the next `$` or `!`.
#[derive(Clone, Debug)]
pub struct Framer {
    held: [u8; LONGEST],
    len: usize,
    /// Where `*` stands.
    star: Option<usize>,
    at_ns: i64,
}

impl Default for Framer {
    fn default() -> Self {
        Self {
            held: [0; LONGEST],
            len: 0,
            star: None,
            at_ns: 0,
        }
    }
}

impl Framer {
    /// The next byte, and when it came.
    pub fn push(&mut self, byte: u8, time_ns: i64) -> Option<Heard> {
        let open = self.len > 0;
        if matches!(byte, b'$' | b'!') {
            self.clear();
            self.at_ns = time_ns;
            self.put(byte);
            return open.then_some(Heard::Malformed);
        }
        if !open {
            return None;
        }
        if !(0x20..0x7f).contains(&byte) || !self.put(byte) {
            self.clear();
            return Some(Heard::Malformed);
        }
        match self.star {
            None if byte == b'*' => {
                self.star = Some(self.len);
                None
            }
            Some(star) if self.len == star + 2 => {
                let heard = self.finish(star);
                self.clear();
                Some(heard)
            }
            _ => None,
        }
    }

    /// The line was cut: what is begun is lost.
    pub fn cut(&mut self) -> Option<Heard> {
        let open = self.len > 0;
        self.clear();
        open.then_some(Heard::Malformed)
    }

    fn put(&mut self, byte: u8) -> bool {
        let Some(place) = self.held.get_mut(self.len) else {
            return false;
        };
        *place = byte;
        self.len += 1;
        true
    }

    fn clear(&mut self) {
        self.len = 0;
        self.star = None;
    }

    /// The sentence whose checksum begins at `star`.
    fn finish(&self, star: usize) -> Heard {
        let body = self.held.get(1..star.saturating_sub(1)).unwrap_or_default();
        let digits = self.held.get(star..self.len).unwrap_or_default();
        let hex = |byte: &u8| char::from(*byte).to_digit(16);
        let stated = match digits {
            [high, low] => hex(high).zip(hex(low)).map(|(high, low)| high * 16 + low),
            _ => None,
        };
        match stated {
            None => Heard::Malformed,
            Some(stated) if stated == u32::from(checksum(body)) => {
                let mut bytes = [0; LONGEST];
                for (place, byte) in bytes.iter_mut().zip(self.held.iter().take(self.len)) {
                    *place = *byte;
                }
                Heard::Sentence {
                    at_ns: self.at_ns,
                    text: Text {
                        bytes,
                        len: u8::try_from(self.len).unwrap_or(u8::MAX),
                    },
                }
            }
            Some(_) => Heard::BadChecksum,
        }
    }
}

/// When each byte of a chunk came that was read at `read_ns`: bytes follow each other at the line's pace (ten bits each),
/// the last one came when it was read, and none before the read before, which left nothing. `left` is the number of bytes
/// behind it in the chunk.
#[must_use]
pub(crate) fn byte_time(read_ns: i64, left: usize, byte_ns: i64, before_ns: i64) -> i64 {
    let behind = i64::try_from(num::u64_of(left)).unwrap_or(i64::MAX);
    read_ns
        .saturating_sub(behind.saturating_mul(byte_ns))
        .max(before_ns.min(read_ns))
}
