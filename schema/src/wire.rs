//! Bytes in and out: a cursor that never reads beyond its end, and bincode behind one door with fixed-size
//! little-endian integers, a limit, and no trailing bytes.

use bincode::{Decode, Encode};

use crate::error::SchemaError;
use crate::num;

/// Encodes the header or a small part; an error if it would not decode within the same limit to the same value.
pub(crate) fn encode<const LIMIT: usize, T>(place: &str, value: &T) -> Result<Vec<u8>, SchemaError>
where
    T: Encode + Decode<()> + PartialEq,
{
    let error = |found: String| SchemaError::Encode {
        place: place.to_owned(),
        limit: num::u64_of(LIMIT),
        found,
    };
    let bytes =
        bincode::encode_to_vec(value, config::<LIMIT>()).map_err(|e| error(e.to_string()))?;
    match decode::<LIMIT, T>(place, 0, &bytes) {
        Ok(back) if back == *value => Ok(bytes),
        Ok(_) => Err(error("a value that does not equal itself".to_owned())),
        Err(e) => Err(error(format!("{} bytes; {e}", bytes.len()))),
    }
}

/// Decodes the whole of `bytes`, which begin at `offset` of the file.
pub(crate) fn decode<const LIMIT: usize, T: Decode<()>>(
    place: &str,
    offset: usize,
    bytes: &[u8],
) -> Result<T, SchemaError> {
    let (value, used) =
        bincode::decode_from_slice(bytes, config::<LIMIT>()).map_err(|e| SchemaError::Decode {
            place: place.to_owned(),
            offset: num::u64_of(offset),
            found: e.to_string(),
        })?;
    if used == bytes.len() {
        Ok(value)
    } else {
        Err(SchemaError::Trailing {
            place: place.to_owned(),
            offset: num::u64_of(offset.saturating_add(used)),
            found: num::u64_of(bytes.len().saturating_sub(used)),
        })
    }
}

fn config<const LIMIT: usize>() -> impl bincode::config::Config {
    bincode::config::standard()
        .with_little_endian()
        .with_fixed_int_encoding()
        .with_limit::<LIMIT>()
}

/// Reads a structure's bytes in order.
pub(crate) struct Cursor<'a> {
    place: &'a str,
    bytes: &'a [u8],
    at: usize,
    offset: usize,
}

impl<'a> Cursor<'a> {
    /// Over `bytes`, which begin at `offset` of the file.
    pub(crate) fn new(place: &'a str, bytes: &'a [u8], offset: usize) -> Self {
        Self {
            place,
            bytes,
            at: 0,
            offset,
        }
    }

    pub(crate) fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    pub(crate) fn take(&mut self, n: usize) -> Result<&'a [u8], SchemaError> {
        let rest = self.bytes.get(self.at..).unwrap_or(&[]);
        let taken = rest.get(..n).ok_or_else(|| SchemaError::Truncated {
            place: self.place.to_owned(),
            offset: num::u64_of(self.offset.saturating_add(self.at)),
            expected: num::u64_of(n),
            found: num::u64_of(rest.len()),
        })?;
        self.at += n;
        Ok(taken)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], SchemaError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, SchemaError> {
        self.array().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Result<u16, SchemaError> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, SchemaError> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, SchemaError> {
        self.array().map(u64::from_le_bytes)
    }

    pub(crate) fn i64(&mut self) -> Result<i64, SchemaError> {
        self.array().map(i64::from_le_bytes)
    }

    /// A number of elements, each of at least `least` bytes: more than the rest can hold is refused before
    /// anything is allocated for them.
    pub(crate) fn count(&mut self, least: usize) -> Result<usize, SchemaError> {
        let count = num::usize_of(u64::from(self.u32()?));
        let needed = count.saturating_mul(least);
        if needed > self.left() {
            return Err(SchemaError::Truncated {
                place: self.place.to_owned(),
                offset: num::u64_of(self.offset.saturating_add(self.at)),
                expected: num::u64_of(needed),
                found: num::u64_of(self.left()),
            });
        }
        Ok(count)
    }

    /// Nothing may be left.
    pub(crate) fn end(&self) -> Result<(), SchemaError> {
        if self.left() == 0 {
            return Ok(());
        }
        Err(SchemaError::Trailing {
            place: self.place.to_owned(),
            offset: num::u64_of(self.offset.saturating_add(self.at)),
            found: num::u64_of(self.left()),
        })
    }
}

/// A length as the 32 bits it is stored in.
pub(crate) fn length32(place: &str, length: usize) -> Result<u32, SchemaError> {
    u32::try_from(length).map_err(|_| too_large(place, u32::MAX.into(), length, "elements"))
}

/// The error of something beyond its bound.
pub(crate) fn too_large(place: &str, limit: u64, found: usize, unit: &'static str) -> SchemaError {
    SchemaError::TooLarge {
        place: place.to_owned(),
        limit,
        found: num::u64_of(found),
        unit,
    }
}
