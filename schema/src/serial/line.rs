//! Packets on a line that loses, doubles and changes bytes: between zero bytes, free of zeros themselves by consistent
//! overhead byte stuffing (Cheshire and Baker, 1999), each behind a CRC-32C.
//!
//! A zero byte is a border and nothing else, so a reader that lost its place finds it again at the next one. A packet
//! has a border on either side: what noise left on the line before it ends at the first.

use super::MAX_PACKET;

/// Bytes of the CRC.
const CRC_BYTES: usize = 4;
/// Most bytes between two borders: packet, CRC, and one byte of stuffing for each 254.
pub const MAX_STUFFED: usize = MAX_PACKET + CRC_BYTES + (MAX_PACKET + CRC_BYTES) / 254 + 1;

/// What is wrong with the bytes between two borders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LineError {
    /// Longer than any packet.
    #[error("expected at most {MAX_STUFFED} bytes between two zeros, found more")]
    Long,
    /// No byte stuffing.
    #[error("expected byte stuffing, found a run of {run} bytes where {left} are left")]
    Stuffing {
        /// Bytes the run should have.
        run: u8,
        /// Bytes there are.
        left: usize,
    },
    /// Too short for a CRC.
    #[error("expected a packet and its 4 bytes of CRC, found {found} bytes")]
    Short {
        /// Bytes there are.
        found: usize,
    },
    /// The CRC does not hold.
    #[error("CRC stored {stored:#010x}, computed {computed:#010x}")]
    Crc {
        /// As received.
        stored: u32,
        /// Of the bytes before it.
        computed: u32,
    },
}

/// A packet as it goes over the line: zero, stuffed packet and CRC, zero.
#[must_use]
pub fn frame(packet: &[u8]) -> Vec<u8> {
    let crc = crc32c::crc32c(packet).to_le_bytes();
    let mut out = Vec::with_capacity(packet.len() + packet.len() / 254 + 8);
    out.push(0);
    let mut run: Vec<u8> = Vec::with_capacity(254);
    let mut ended_by_zero = true;
    for byte in packet.iter().copied().chain(crc) {
        ended_by_zero = byte == 0;
        if ended_by_zero {
            close(&mut out, &mut run, false);
        } else {
            run.push(byte);
            if run.len() == 254 {
                close(&mut out, &mut run, true);
            }
        }
    }
    if ended_by_zero || !run.is_empty() {
        close(&mut out, &mut run, false);
    }
    out.push(0);
    out
}

fn close(out: &mut Vec<u8>, run: &mut Vec<u8>, full: bool) {
    let code = if full { 254 } else { run.len() };
    // A run has at most 254 bytes: the code fits.
    out.push(u8::try_from(code + 1).unwrap_or(u8::MAX));
    out.append(run);
}

/// Takes bytes off a line and gives packets. Never holds more than [`MAX_STUFFED`] bytes.
#[derive(Debug, Default)]
pub struct Deframer {
    held: Vec<u8>,
    long: bool,
    damaged: u64,
}

impl Deframer {
    /// Takes the next byte. `None`: nothing ended here. A packet has passed its CRC.
    pub fn push(&mut self, byte: u8) -> Option<Result<Vec<u8>, LineError>> {
        if byte != 0 {
            if self.held.len() < MAX_STUFFED {
                self.held.push(byte);
            } else {
                self.long = true;
            }
            return None;
        }
        if self.held.is_empty() {
            return None;
        }
        let result = if self.long {
            Err(LineError::Long)
        } else {
            unframe(&self.held)
        };
        self.held.clear();
        self.long = false;
        self.damaged += u64::from(result.is_err());
        Some(result)
    }

    /// How many stretches between borders were no packet.
    #[must_use]
    pub fn damaged(&self) -> u64 {
        self.damaged
    }

    /// Bytes held for the packet that has begun.
    #[must_use]
    pub fn held(&self) -> usize {
        self.held.len()
    }
}

/// The packet in the bytes between two borders.
///
/// # Errors
/// When they are not a packet as [`frame`] makes it.
pub fn unframe(stuffed: &[u8]) -> Result<Vec<u8>, LineError> {
    let mut out = Vec::with_capacity(stuffed.len());
    let mut rest = stuffed;
    while let Some((&run, after)) = rest.split_first() {
        let length = usize::from(run).saturating_sub(1);
        let bytes = after.get(..length).filter(|_| run > 0);
        let bytes = bytes.ok_or(LineError::Stuffing {
            run,
            left: after.len(),
        })?;
        out.extend_from_slice(bytes);
        rest = &after[length..];
        if run != u8::MAX && !rest.is_empty() {
            out.push(0);
        }
    }
    let at = out.len().checked_sub(CRC_BYTES);
    let (packet, crc) = match at {
        Some(at) if at > 0 && at <= MAX_PACKET => out.split_at(at),
        _ => return Err(LineError::Short { found: out.len() }),
    };
    let mut stored = [0; CRC_BYTES];
    stored.copy_from_slice(crc);
    let stored = u32::from_le_bytes(stored);
    let computed = crc32c::crc32c(packet);
    if stored != computed {
        return Err(LineError::Crc { stored, computed });
    }
    out.truncate(out.len() - CRC_BYTES);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all(bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut deframer = Deframer::default();
        bytes
            .iter()
            .filter_map(|byte| deframer.push(*byte))
            .filter_map(Result::ok)
            .collect()
    }

    fn samples() -> Vec<Vec<u8>> {
        let ramp: Vec<u8> = (0..=255).collect();
        let mut out = vec![
            vec![0],
            vec![0; 300],
            vec![1; 253],
            vec![1; 254],
            vec![1; 255],
        ];
        out.extend([ramp.clone(), vec![0xff; MAX_PACKET], ramp.repeat(4)]);
        out.push(b"svartboks".to_vec());
        out
    }

    #[test]
    fn a_packet_comes_back_and_holds_no_zero_on_the_way() {
        for packet in samples() {
            let line = frame(&packet);
            assert!(line[1..line.len() - 1].iter().all(|byte| *byte != 0));
            assert!(line.len() <= MAX_STUFFED + 2);
            assert_eq!(all(&line), std::slice::from_ref(&packet));
            // Borders may be shared or doubled.
            let two = [&line[..], &line[1..], &[0, 0], &line[..]].concat();
            assert_eq!(all(&two), vec![packet; 3]);
        }
    }

    #[test]
    fn the_example_of_the_protocol_page() {
        let line = frame(&[0x11, 0x00, 0x22]);
        assert_eq!(crate::seal::Hex(&line).to_string(), "0002110622a7b2017400");
    }

    #[test]
    fn every_flipped_bit_lost_byte_and_doubled_byte_is_caught() {
        let intact = |line: &[u8], packet: &Vec<u8>, what: &str| {
            for found in all(line) {
                assert_eq!(&found, packet, "{what}");
            }
        };
        for packet in samples() {
            let line = frame(&packet);
            for at in 0..line.len() {
                for bit in 0..8 {
                    let mut bad = line.clone();
                    bad[at] ^= 1 << bit;
                    intact(&bad, &packet, "flipped");
                }
                let mut bad = line.clone();
                bad.remove(at);
                intact(&bad, &packet, "lost");
                let mut bad = line.clone();
                bad.insert(at, line[at]);
                intact(&bad, &packet, "doubled");
            }
        }
    }

    #[test]
    fn garbage_of_any_length_holds_no_more_than_one_packet() {
        let mut deframer = Deframer::default();
        for k in 0..1_000_000_u32 {
            let byte = u8::try_from(k.wrapping_mul(2_654_435_761) >> 24)
                .unwrap()
                .max(1);
            assert_eq!(deframer.push(byte), None);
        }
        assert!(deframer.held.capacity() <= 2 * MAX_STUFFED);
        assert_eq!(deframer.push(0), Some(Err(LineError::Long)));
        assert_eq!((deframer.held(), deframer.damaged()), (0, 1));
    }

    proptest! {
        #[test]
        fn any_bytes_give_packets_or_errors_and_the_next_packet_is_found(
            garbage in proptest::collection::vec(any::<u8>(), 0..3000),
            packet in proptest::collection::vec(any::<u8>(), 1..MAX_PACKET),
        ) {
            let bytes = [&garbage[..], &frame(&packet)[..]].concat();
            prop_assert_eq!(all(&bytes).pop(), Some(packet));
        }
    }
}
