//! One sample: eight physical values of one 10 ms bin, and the eight 10-bit codes they are stored as.

/// Fields of a sample [S03, table 3.1].
pub const FIELDS: usize = 8;
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

/// The eight 10-bit codes of a sample in the order of [S03, table 3.1]: wheel left, wheel right,
/// acceleration x, y, z, rate x, y, z. Each is 0 to 1022, or [`MISSING`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Codes(pub [u16; FIELDS]);

impl Default for Codes {
    fn default() -> Self {
        Self([MISSING; FIELDS])
    }
}
