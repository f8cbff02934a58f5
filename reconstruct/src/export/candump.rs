//! The raw frames about the trigger as `candump -L` text, with their original times.

use std::fmt::Write as _;

use crate::export::fixed::hex;
use crate::report::case::Case;

const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;
const FD: u8 = 0x80;

/// One line a frame: `(SECONDS.MICROS) INTERFACE ID#DATA`.
#[must_use]
pub fn text(case: &Case<'_>) -> String {
    let mut out = String::new();
    for frame in &case.record.raw {
        let interface = case
            .record
            .header
            .interfaces
            .get(usize::from(frame.interface));
        let name = interface.map_or_else(|| format!("can{}", frame.interface), |i| token(&i.name));
        let ns = case.utc_ns(frame.monotonic_ns);
        let micros = ns.div_euclid(1000) + i64::from(ns.rem_euclid(1000) >= 500);
        let (seconds, rest) = (micros.div_euclid(1_000_000), micros.rem_euclid(1_000_000));
        let _ = write!(out, "({seconds}.{rest:06}) {name} ");
        let id = frame.id & !(EXTENDED | REMOTE | ERROR);
        let _ = if frame.id & ERROR != 0 {
            write!(out, "{:08X}#", id | ERROR)
        } else if frame.id & EXTENDED != 0 {
            write!(out, "{id:08X}#")
        } else {
            write!(out, "{id:03X}#")
        };
        if frame.flags & FD != 0 {
            let _ = write!(out, "#{:X}", frame.flags & 0x0f);
        }
        if frame.id & REMOTE != 0 {
            out.push('R');
        } else {
            out.push_str(&hex(&frame.data).to_uppercase());
        }
        out.push('\n');
    }
    out
}

/// A name that cannot break the line it stands in.
fn token(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_ascii_graphic() { c } else { '_' })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::text;
    use crate::report::sample_case;
    use schema::parts::RawFrame;

    #[test]
    fn every_kind_of_frame() {
        let mut record = sample_case::record();
        record.header.interfaces[0].name = "can 0\n".to_owned();
        let frame = |id, flags, data: &[u8]| RawFrame {
            monotonic_ns: 29_999_999_600,
            interface: 0,
            id,
            flags,
            data: data.to_vec(),
        };
        record.raw = vec![
            frame(0x120, 0, &[1, 0xab]),
            frame(0x8000_0120, 0, &[]),
            frame(0x4000_0001, 0, &[]),
            frame(0x2000_0004, 0, &[0; 8]),
            frame(0x7ff, 0x81, &[9]),
        ];
        let damage = Vec::new();
        let lines = text(&sample_case::case(&record, &damage));
        let rest: Vec<&str> = lines
            .lines()
            .map(|l| l.strip_prefix("(1700000030.000000) can_0_ ").unwrap())
            .collect();
        assert_eq!(
            rest,
            [
                "120#01AB",
                "00000120#",
                "001#R",
                "20000004#0000000000000000",
                "7FF##109"
            ]
        );
    }
}
