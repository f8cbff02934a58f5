//! Lines of a file, one at a time and never longer than a bound, so that no file can fill the memory with one.

use std::io::{BufRead, ErrorKind};

/// Bytes of the longest line; 35 full columns take 400.
pub(super) const LINE_BYTES: usize = 4096;
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Why a line is no text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineFault {
    TooLong,
    NotText,
}

/// A line without its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Line {
    /// From 1.
    pub(super) number: u64,
    /// Its text.
    pub(super) text: Result<String, LineFault>,
    /// False for a last line that the file breaks off.
    pub(super) ended: bool,
}

impl Line {
    /// True for what holds no data: blank, or a comment behind `#` or `%`.
    pub(super) fn is_idle(&self) -> bool {
        self.text
            .as_ref()
            .is_ok_and(|t| matches!(t.trim_start().chars().next(), None | Some('#' | '%')))
    }
}

/// Lines of a source.
pub(super) struct Lines<R> {
    source: R,
    number: u64,
}

impl<R: BufRead> Lines<R> {
    pub(super) fn new(source: R) -> Self {
        Self { source, number: 0 }
    }

    /// The next line; `None` at the end.
    pub(super) fn next_line(&mut self) -> std::io::Result<Option<Line>> {
        let mut bytes = Vec::new();
        let (mut any, mut ended, mut too_long) = (false, false, false);
        while !ended {
            let buffer = match self.source.fill_buf() {
                Ok(buffer) => buffer,
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) => return Err(e),
            };
            if buffer.is_empty() {
                break;
            }
            any = true;
            let end = buffer.iter().position(|&b| b == b'\n');
            let piece = &buffer[..end.unwrap_or(buffer.len())];
            // One byte more for the carriage return, which is taken off below.
            too_long |= bytes.len() + piece.len() > LINE_BYTES + 1;
            if !too_long {
                bytes.extend_from_slice(piece);
            }
            ended = end.is_some();
            let used = piece.len() + usize::from(ended);
            self.source.consume(used);
        }
        if !any {
            return Ok(None);
        }
        self.number += 1;
        if bytes.last() == Some(&b'\r') {
            bytes.pop();
        }
        if self.number == 1 && bytes.starts_with(BYTE_ORDER_MARK) {
            bytes.drain(..BYTE_ORDER_MARK.len());
        }
        let text = if too_long || bytes.len() > LINE_BYTES {
            Err(LineFault::TooLong)
        } else {
            String::from_utf8(bytes).map_err(|_| LineFault::NotText)
        };
        Ok(Some(Line {
            number: self.number,
            text,
            ended,
        }))
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::{LINE_BYTES, Line, LineFault, Lines};

    fn all(bytes: &[u8], buffer: usize) -> Vec<Line> {
        let mut lines = Lines::new(BufReader::with_capacity(buffer, bytes));
        std::iter::from_fn(|| lines.next_line().unwrap()).collect()
    }

    #[test]
    fn ends_marks_and_numbers() {
        for buffer in [1, 2, 3, 100] {
            let lines = all(b"\xef\xbb\xbfa\r\n\n # b\n\xff\nlast", buffer);
            let texts: Vec<_> = lines.iter().map(|l| l.text.as_deref().ok()).collect();
            assert_eq!(
                texts,
                [Some("a"), Some(""), Some(" # b"), None, Some("last")]
            );
            assert_eq!(lines[3].text, Err(LineFault::NotText));
            let ended: Vec<bool> = lines.iter().map(|l| l.ended).collect();
            assert_eq!(ended, [true, true, true, true, false]);
            assert_eq!(lines[4].number, 5);
            let idle: Vec<bool> = lines.iter().map(Line::is_idle).collect();
            assert_eq!(idle, [false, true, true, false, false]);
        }
        assert!(all(b"", 8).is_empty());
    }

    #[test]
    fn a_long_line_is_passed_over() {
        let mut bytes = vec![b'x'; LINE_BYTES];
        bytes.extend_from_slice(b"\r\n");
        bytes.extend(vec![b'y'; 3 * LINE_BYTES]);
        bytes.extend_from_slice(b"\nz\n");
        let lines = all(&bytes, 64);
        assert_eq!(lines[0].text.as_ref().unwrap().len(), LINE_BYTES);
        assert_eq!(lines[1].text, Err(LineFault::TooLong));
        assert_eq!(lines[2].text.as_deref(), Ok("z"));
    }
}
