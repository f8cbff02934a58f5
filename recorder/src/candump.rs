//! One line of `candump -L` / `-l` text, parsed by hand: a frame, or what was expected where.

use crate::can::{EFF, ERR, FD, Frame, RTR};

/// Why a line is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineError {
    /// Byte column, from 0.
    pub column: usize,
    /// What should have stood there.
    pub expected: &'static str,
}

/// The time stamp at the beginning of a line, ns, and the column behind it.
pub(crate) fn stamp(line: &[u8]) -> Result<(i64, usize), LineError> {
    let mut cursor = Cursor { line, at: 0 };
    cursor.spaces();
    let time_ns = cursor.stamp()?;
    Ok((time_ns, cursor.at))
}

/// Values of hexadecimal digits; 0xFF is none.
const HEX: [u8; 256] = {
    let mut table = [0xFF_u8; 256];
    let mut digit = 0_u8;
    let mut at = 0_usize;
    while at < 16 {
        let (low, high) = if at < 10 {
            (0x30 + at, 0x30 + at)
        } else {
            (0x57 + at, 0x37 + at)
        };
        table[low] = digit;
        table[high] = digit;
        digit += 1;
        at += 1;
    }
    table
};

fn hex(byte: u8) -> Option<u8> {
    match HEX[usize::from(byte)] {
        0xFF => None,
        digit => Some(digit),
    }
}

/// A cursor over the line.
struct Cursor<'a> {
    line: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn peek(&self) -> Option<u8> {
        self.line.get(self.at).copied()
    }

    fn fail<T>(&self, expected: &'static str) -> Result<T, LineError> {
        Err(LineError {
            column: self.at,
            expected,
        })
    }

    fn expect(&mut self, byte: u8, expected: &'static str) -> Result<(), LineError> {
        if self.peek() == Some(byte) {
            self.at += 1;
            Ok(())
        } else {
            self.fail(expected)
        }
    }

    fn spaces(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t')) {
            self.at += 1;
        }
    }

    fn word(&mut self) -> (usize, usize) {
        let start = self.at;
        while self
            .peek()
            .is_some_and(|byte| !matches!(byte, b' ' | b'\t'))
        {
            self.at += 1;
        }
        (start, self.at)
    }

    /// Decimal digits up to `most`; the number and how many there were.
    fn digits(&mut self, most: usize) -> (i64, usize) {
        let start = self.at;
        let mut number = 0_i64;
        while let Some(byte @ b'0'..=b'9') = self.peek() {
            if self.at - start == most {
                break;
            }
            number = number * 10 + i64::from(byte - b'0');
            self.at += 1;
        }
        (number, self.at - start)
    }

    /// `(seconds.fraction)` in nanoseconds.
    fn stamp(&mut self) -> Result<i64, LineError> {
        self.expect(b'(', "'(' of the time stamp")?;
        // Ten digits reach the year 2286; the product with 1e9 then still fits 63 bits.
        let (seconds, count) = self.digits(10);
        if count == 0 || seconds > 9_000_000_000 {
            return self.fail("seconds of the time stamp (1 to 10 digits)");
        }
        let mut nanos = 0;
        if self.peek() == Some(b'.') {
            self.at += 1;
            let (fraction, count) = self.digits(9);
            if count == 0 {
                return self.fail("fraction of the second");
            }
            nanos = fraction;
            for _ in count..9 {
                nanos *= 10;
            }
        }
        self.expect(b')', "')' after the time stamp")?;
        Ok(seconds * 1_000_000_000 + nanos)
    }

    /// The identifier with SocketCAN's flags.
    fn id(&mut self) -> Result<u32, LineError> {
        let start = self.at;
        let mut id = 0_u32;
        while let Some(digit) = self.peek().and_then(hex) {
            if self.at - start == 8 {
                return self.fail("'#' after the identifier");
            }
            id = id << 4 | u32::from(digit);
            self.at += 1;
        }
        match self.at - start {
            3 if id <= 0x7FF => Ok(id),
            8 if id & ERR != 0 => Ok(id & (ERR | 0x1FFF_FFFF)),
            8 if id <= 0x1FFF_FFFF => Ok(id | EFF),
            _ => Err(LineError {
                column: start,
                expected: "identifier of 3 (to 7FF) or 8 (to 1FFFFFFF) hexadecimal digits",
            }),
        }
    }

    /// Payload bytes as pairs of digits up to the next space, `_` or the end.
    fn payload(&mut self, frame: &mut Frame, most: u8) -> Result<(), LineError> {
        while let Some(high) = self.peek() {
            if matches!(high, b' ' | b'\t' | b'_') {
                break;
            }
            if high == b'.' {
                self.at += 1;
                continue;
            }
            let low = self.line.get(self.at + 1).copied().unwrap_or(0);
            let (Some(high), Some(low)) = (hex(high), hex(low)) else {
                return self.fail("two hexadecimal digits of a payload byte");
            };
            if frame.len() == most || !frame.push(high << 4 | low) {
                return self.fail("the end of the payload");
            }
            self.at += 2;
        }
        Ok(())
    }
}

/// Payload lengths a CAN FD frame can have.
const FD_LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// Parses one line (without its line feed) into `frame`; gives the place (from, to) of
/// the interface's name in it. `frame.interface` is left as is.
///
/// Known forms: `(1700000000.000200) can0 120#0011`, `12345678#..`, `##F..` (CAN FD), `#R` and `#R8`, `#.._B`
/// (raw length code), and a direction ` R` or ` T` behind.
///
/// # Errors
/// The column and what was expected there.
pub fn parse(line: &[u8], frame: &mut Frame) -> Result<(usize, usize), LineError> {
    let mut cursor = Cursor {
        line: line.strip_suffix(b"\r").unwrap_or(line),
        at: 0,
    };
    frame.clear();
    frame.flags = 0;
    cursor.spaces();
    frame.time_ns = cursor.stamp()?;
    cursor.spaces();
    let name = cursor.word();
    if name.0 == name.1 {
        return cursor.fail("an interface name");
    }
    cursor.spaces();
    frame.id = cursor.id()?;
    cursor.expect(b'#', "'#' after the identifier")?;
    match cursor.peek() {
        Some(b'#') => {
            cursor.at += 1;
            let Some(flags) = cursor.peek().and_then(hex) else {
                return cursor.fail("the flags digit of a CAN FD frame");
            };
            cursor.at += 1;
            frame.flags = FD | (flags & 0x0F);
            cursor.payload(frame, 64)?;
            if !FD_LENGTHS.contains(&frame.len()) {
                return cursor
                    .fail("a payload length of CAN FD (0 to 8, 12, 16, 20, 24, 32, 48, 64)");
            }
        }
        Some(b'R' | b'r') => {
            cursor.at += 1;
            frame.id |= RTR;
            if cursor.peek().and_then(hex).is_some() {
                cursor.at += 1;
            }
        }
        _ => cursor.payload(frame, 8)?,
    }
    if cursor.peek() == Some(b'_') {
        cursor.at += 1;
        if cursor.peek().and_then(hex).is_none() {
            return cursor.fail("a raw length code");
        }
        cursor.at += 1;
    }
    cursor.spaces();
    if matches!(cursor.peek(), Some(b'R' | b'T')) {
        cursor.at += 1;
        cursor.spaces();
    }
    if cursor.peek().is_some() {
        return cursor.fail("the end of the line");
    }
    Ok(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(line: &str) -> Result<(Frame, String), LineError> {
        let mut frame = Frame::empty();
        let (from, to) = parse(line.as_bytes(), &mut frame)?;
        Ok((frame, line[from..to].to_owned()))
    }

    #[test]
    fn known_forms() {
        let (frame, name) = read("(1700000000.000200) can0 120#00a1F0\r").unwrap();
        assert_eq!(
            (frame.time_ns, frame.id, name.as_str()),
            (1_700_000_000_000_200_000, 0x120, "can0")
        );
        assert_eq!(frame.data(), [0x00, 0xA1, 0xF0]);
        assert_eq!(
            read("(1.5) vcan1 1234ABCD#").unwrap().0.id,
            0x1234_ABCD | EFF
        );
        assert_eq!(read("(1.5) c 123#R").unwrap().0.id, 0x123 | RTR);
        assert_eq!(read("(1.5) c 123#R8 T").unwrap().0.id, 0x123 | RTR);
        assert_eq!(
            read("(1.5) c 20000004#0000000000000000").unwrap().0.id,
            ERR | 4
        );
        let (fd, _) = read("(1.000000001) c 123##1000102030405060708090A0B R").unwrap();
        assert_eq!(
            (fd.flags, fd.len(), fd.time_ns),
            (FD | 1, 12, 1_000_000_001)
        );
        assert_eq!(read("(1.5) c 123#1122334455667788_B").unwrap().0.len(), 8);
    }

    #[test]
    fn wrong_forms_name_the_column() {
        let cases = [
            ("", 0),
            ("(x) can0 123#", 1),
            ("(1.5 can0 123#", 4),
            ("(1.5) can0", 10),
            ("(1.5) can0 12#00", 11),
            ("(1.5) can0 800#00", 11),
            ("(1.5) can0 FFFFFFFFF#00", 19),
            ("(1.5) can0 123#0", 15),
            ("(1.5) can0 123#0G", 15),
            ("(1.5) can0 123#112233445566778899", 31),
            ("(1.5) can0 123##", 16),
            ("(1.5) can0 123##1112233445566778899", 35),
            ("(1.5) can0 123#00 junk", 18),
            ("(99999999999.5) can0 123#00", 11),
        ];
        for (line, column) in cases {
            assert_eq!(read(line).unwrap_err().column, column, "{line}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived(line in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = parse(&line, &mut Frame::empty());
        }

        #[test]
        fn what_is_written_is_read(seconds in 0_i64..9_000_000_000, micros in 0_i64..1_000_000, id in 0_u32..0x800,
                                   data in prop::collection::vec(any::<u8>(), 0..=8)) {
            let text = schema::seal::Hex(&data);
            let (frame, _) = read(&format!("({seconds}.{micros:06}) can0 {id:03X}#{text}")).unwrap();
            prop_assert_eq!(frame.time_ns, seconds * 1_000_000_000 + micros * 1000);
            prop_assert_eq!(frame.id, id);
            prop_assert_eq!(frame.data(), &data[..]);
        }
    }
}
