//! One sample: eight physical values of one 10 ms bin, and the eight 10-bit codes they are stored as.

/// Fields of a sample [S03, table 3.1].
pub const FIELDS: usize = 8;
/// The wheels, the first of the fields.
pub const WHEELS: usize = 2;
/// The axes, the fields behind the wheels: acceleration x, y, z, rate x, y, z.
pub const AXES: usize = FIELDS - WHEELS;
/// Bits of one field.
pub const FIELD_BITS: usize = 10;
/// Bytes of a packed sample.
pub const SAMPLE_BYTES: usize = 10;
/// The code that says: nothing was measured in this bin.
pub const MISSING: u16 = 1023;
/// Duration of one sample at the full rate, nanoseconds.
pub const SAMPLE_NS: i64 = 10_000_000;

const _: () = assert!(FIELDS * FIELD_BITS == 80 && FIELDS * FIELD_BITS == SAMPLE_BYTES * 8);

/// The physical values of one bin: what the sampler makes and the reconstructor filters.
///
/// Sample `k` is the mean over its bin `[k, k + 1)` of 10 ms. `None` is missing; a value is never invented.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Sample {
    /// Ground speed of the left and right undriven wheel, m/s, never negative.
    pub wheels: [Option<f64>; 2],
    /// Specific force along body x (forward), y (right), z (down), m/s^2.
    pub accel: [Option<f64>; 3],
    /// Angular rate about body x, y, z, rad/s.
    pub rate: [Option<f64>; 3],
}

impl Sample {
    /// The eight values in the order of [S03, table 3.1].
    #[must_use]
    pub fn fields(&self) -> [Option<f64>; FIELDS] {
        let ([wl, wr], [ax, ay, az], [wx, wy, wz]) = (self.wheels, self.accel, self.rate);
        [wl, wr, ax, ay, az, wx, wy, wz]
    }

    /// From the eight values in the order of [S03, table 3.1].
    #[must_use]
    pub fn from_fields([wl, wr, ax, ay, az, wx, wy, wz]: [Option<f64>; FIELDS]) -> Self {
        Self {
            wheels: [wl, wr],
            accel: [ax, ay, az],
            rate: [wx, wy, wz],
        }
    }
}

/// The eight 10-bit codes of a sample in the order of [S03, table 3.1]: wheel left, wheel right,
/// acceleration x, y, z, rate x, y, z. Each is 0 to 1022, or [`MISSING`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Codes(pub [u16; FIELDS]);

impl Default for Codes {
    fn default() -> Self {
        Self([MISSING; FIELDS])
    }
}

impl Codes {
    /// The stored form: eight fields of ten bits, most significant bit first, no padding.
    ///
    /// A code above 1023 cannot be stored and becomes [`MISSING`].
    #[must_use]
    pub fn to_bytes(&self) -> [u8; SAMPLE_BYTES] {
        let bits = self.0.iter().fold(0_u128, |bits, &code| {
            (bits << FIELD_BITS) | u128::from(code.min(MISSING))
        });
        let [_, _, _, _, _, _, bytes @ ..] = bits.to_be_bytes();
        bytes
    }

    /// The codes of ten stored bytes; every pattern is a sample.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; SAMPLE_BYTES]) -> Self {
        let mut wide = [0; 16];
        wide[16 - SAMPLE_BYTES..].copy_from_slice(bytes);
        let mut bits = u128::from_be_bytes(wide);
        let mut codes = [MISSING; FIELDS];
        for code in codes.iter_mut().rev() {
            *code = u16::try_from(bits & u128::from(MISSING)).unwrap_or(MISSING);
            bits >>= FIELD_BITS;
        }
        Self(codes)
    }
}
