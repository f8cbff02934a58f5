//! A signal in a frame: which bits, in which order, and the number they stand for.

use schema::num;

/// How the bits are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
    /// An unsigned integer.
    Unsigned,
    /// A two's complement integer.
    Signed,
    /// IEEE 754 single precision (32 bits).
    Float32,
    /// IEEE 754 double precision (64 bits).
    Float64,
}

/// Order of a signal's bytes in the payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// `@1`: the start bit is the least significant.
    Little,
    /// `@0`: the start bit is the most significant; bits are numbered within bytes from 7 down to 0.
    Big,
}

/// Why bits can not be a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BitsError {
    /// Size out of bounds.
    #[error("expected a size of 1 to 64 bits, found {0}")]
    Size(u64),
    /// Size does not fit the IEEE type.
    #[error("expected {expected} bits for an IEEE float, found {found}")]
    Float {
        /// 32 or 64.
        expected: u64,
        /// As written.
        found: u64,
    },
    /// Beyond the largest payload.
    #[error("expected bits within the 64 bytes of the largest frame, found byte {0}")]
    Beyond(u64),
}

/// The bits of a signal, ready to be taken out of a payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bits {
    first: usize,
    count: usize,
    shift: u32,
    size: u32,
    order: ByteOrder,
    coding: Coding,
}

impl Bits {
    /// Bits as a DBC gives them.
    ///
    /// # Errors
    /// When they are no signal or lie beyond 64 bytes.
    pub fn new(start: u64, size: u64, order: ByteOrder, coding: Coding) -> Result<Self, BitsError> {
        match coding {
            Coding::Float32 if size != 32 => {
                return Err(BitsError::Float {
                    expected: 32,
                    found: size,
                });
            }
            Coding::Float64 if size != 64 => {
                return Err(BitsError::Float {
                    expected: 64,
                    found: size,
                });
            }
            _ => {}
        }
        if size == 0 || size > 64 {
            return Err(BitsError::Size(size));
        }
        let first = start / 8;
        if first >= 64 {
            return Err(BitsError::Beyond(first));
        }
        // Bits of the first byte that do not belong to the signal, then whole bytes to hold the rest.
        let unused = match order {
            ByteOrder::Little => start % 8,
            ByteOrder::Big => 7 - start % 8,
        };
        let count = (unused + size).div_ceil(8);
        if first + count > 64 {
            return Err(BitsError::Beyond(first + count - 1));
        }
        let shift = match order {
            ByteOrder::Little => unused,
            ByteOrder::Big => count * 8 - unused - size,
        };
        let small = |n: u64| u32::try_from(n).unwrap_or(0);
        Ok(Self {
            first: num::usize_of(first),
            count: num::usize_of(count),
            shift: small(shift),
            size: small(size),
            order,
            coding,
        })
    }

    /// Bytes a payload must have to hold the signal.
    #[must_use]
    pub fn bytes_needed(&self) -> usize {
        self.first + self.count
    }

    /// Size in bits, 1 to 64.
    #[must_use]
    pub fn size(&self) -> u32 {
        self.size
    }

    /// True if the number can be negative by itself (before factor and offset).
    #[must_use]
    pub fn signed(&self) -> bool {
        self.coding != Coding::Unsigned
    }

    /// True if both claim a bit of the same payload.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        let own = self.mask();
        other
            .mask()
            .iter()
            .any(|(byte, bits)| own.iter().any(|(at, mine)| at == byte && mine & bits != 0))
    }

    /// Bytes and the bits used of each.
    fn mask(&self) -> Vec<(usize, u8)> {
        let ones = (u128::MAX >> (128 - self.size)) << self.shift;
        (0..self.count)
            .map(|at| {
                let place = match self.order {
                    ByteOrder::Little => at,
                    ByteOrder::Big => self.count - 1 - at,
                };
                let bits = (ones >> (place * 8)) & 0xFF;
                (self.first + at, u8::try_from(bits).unwrap_or(0))
            })
            .collect()
    }

    /// The bits as an unsigned number; `None` if the payload is too short.
    #[must_use]
    pub fn raw(&self, data: &[u8]) -> Option<u64> {
        let bytes = data.get(self.first..self.first + self.count)?;
        let mask = u64::MAX >> (64 - self.size);
        if let [rest @ .., _] = bytes
            && rest.len() < 8
        {
            let fold = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
            let word = match self.order {
                ByteOrder::Little => bytes.iter().rev().fold(0, fold),
                ByteOrder::Big => bytes.iter().fold(0, fold),
            };
            return Some(word >> self.shift & mask);
        }
        // Nine bytes: 64 bits that do not begin on a byte.
        let fold = |sum: u128, byte: &u8| sum << 8 | u128::from(*byte);
        let word = match self.order {
            ByteOrder::Little => bytes.iter().rev().fold(0, fold),
            ByteOrder::Big => bytes.iter().fold(0, fold),
        };
        u64::try_from(word >> self.shift & u128::from(mask)).ok()
    }

    /// The number before factor and offset; `None` if the payload is too short. Floats may be NaN or infinite.
    #[must_use]
    pub fn number(&self, data: &[u8]) -> Option<f64> {
        let raw = self.raw(data)?;
        Some(match self.coding {
            Coding::Unsigned => num::real_u64(raw),
            Coding::Signed => {
                let spare = 64 - self.size;
                num::real_i64((raw << spare).cast_signed() >> spare)
            }
            Coding::Float32 => f64::from(f32::from_bits(u32::try_from(raw).unwrap_or(0))),
            Coding::Float64 => f64::from_bits(raw),
        })
    }
}

/// A multiplexor and the values of it under which a signal is in the frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Selector {
    /// Bits of the multiplexor.
    pub bits: Bits,
    /// Its values, from and to, both included.
    pub ranges: Vec<(u64, u64)>,
}

/// What a frame says of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// A value in the DBC's unit.
    Value(f64),
    /// The multiplexor has another value: no update.
    NotSelected,
    /// The frame does not reach the signal's bits.
    TooShort,
    /// Not a number, or infinite, after factor and offset.
    NotFinite,
}

/// True if every selector has one of its values; `None` if the payload is too short for one.
#[must_use]
pub fn selected(selectors: &[Selector], data: &[u8]) -> Option<bool> {
    for selector in selectors {
        let value = selector.bits.raw(data)?;
        if !selector
            .ranges
            .iter()
            .any(|&(low, high)| (low..=high).contains(&value))
        {
            return Some(false);
        }
    }
    Some(true)
}

/// Bits with factor and offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled {
    /// Where the bits are.
    pub bits: Bits,
    /// Physical value of one step.
    pub factor: f64,
    /// Physical value of zero.
    pub offset: f64,
}

impl Scaled {
    /// The physical value of the signal in a payload whose multiplexor fits.
    #[must_use]
    pub fn read(&self, data: &[u8]) -> Reading {
        match self.bits.number(data) {
            None => Reading::TooShort,
            Some(number) => {
                let value = number * self.factor + self.offset;
                if value.is_finite() {
                    Reading::Value(value)
                } else {
                    Reading::NotFinite
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Bit by bit as the DBC numbers them: slow and plain.
    fn slow(data: &[u8], start: u64, size: u64, order: ByteOrder) -> Option<u64> {
        let bit_at = |at: u64| {
            data.get(num::usize_of(at / 8))
                .map(|byte| u64::from(byte >> (at % 8) & 1))
        };
        let mut value = 0;
        let mut at = start;
        for step in 0..size {
            match order {
                ByteOrder::Little => value |= bit_at(start + step)? << step,
                ByteOrder::Big => {
                    value = value << 1 | bit_at(at)?;
                    at = if at.is_multiple_of(8) {
                        at + 15
                    } else {
                        at - 1
                    };
                }
            }
        }
        Some(value)
    }

    proptest! {
        #[test]
        fn agrees_with_one_bit_at_a_time(data in prop::collection::vec(any::<u8>(), 0..=64), start in 0_u64..512,
                                         size in 1_u64..=64, big in any::<bool>()) {
            let order = if big { ByteOrder::Big } else { ByteOrder::Little };
            if let Ok(bits) = Bits::new(start, size, order, Coding::Unsigned) {
                prop_assert_eq!(bits.raw(&data), slow(&data, start, size, order));
            }
        }

        #[test]
        fn any_bits_and_payload_are_survived(data in prop::collection::vec(any::<u8>(), 0..=64), start in any::<u64>(),
                                             size in any::<u64>(), big in any::<bool>(), kind in 0..4_u8) {
            let order = if big { ByteOrder::Big } else { ByteOrder::Little };
            let coding = [Coding::Unsigned, Coding::Signed, Coding::Float32, Coding::Float64][usize::from(kind)];
            for size in [size, size % 70, 32, 64] {
                if let Ok(bits) = Bits::new(start % 520, size, order, coding) {
                    let _ = Scaled { bits, factor: 1e300, offset: f64::NAN }.read(&data);
                    prop_assert_eq!(bits.raw(&data).is_some(), data.len() >= bits.bytes_needed());
                }
            }
        }
    }

    #[test]
    fn signed_and_floats() {
        let bits = Bits::new(4, 12, ByteOrder::Little, Coding::Signed).unwrap();
        assert_eq!(bits.number(&[0xF0, 0xFF]), Some(-1.0));
        let float = Bits::new(7, 32, ByteOrder::Big, Coding::Float32).unwrap();
        assert_eq!(float.number(&[0x3F, 0xC0, 0, 0]), Some(1.5));
        let scaled = Scaled {
            bits: float,
            factor: 1.0,
            offset: 0.0,
        };
        assert_eq!(scaled.read(&[0x7F, 0xC0, 0, 0]), Reading::NotFinite);
        assert_eq!(scaled.read(&[0x7F, 0xC0, 0]), Reading::TooShort);
    }

    #[test]
    fn overlap_is_by_bits() {
        let low = Bits::new(0, 20, ByteOrder::Little, Coding::Signed).unwrap();
        let next = Bits::new(20, 20, ByteOrder::Little, Coding::Signed).unwrap();
        let across = Bits::new(23, 8, ByteOrder::Big, Coding::Unsigned).unwrap();
        assert!(!low.overlaps(&next));
        assert!(across.overlaps(&next) && across.overlaps(&low));
    }
}
