//! From physical values to codes and back, with error feedback: what rounding leaves over is carried into
//! the next sample of that axis, so that sums (delta-V, turned angle, distance) stay exact.

use crate::num;
use crate::sample::{AXES, Codes, FIELDS, MISSING, Sample};
use crate::scale::{Scales, TwoSlope, WheelScale};

/// Parts of a fine step in which a block tells what its codes leave out.
pub const REMAINDER_PARTS: f64 = 256.0;

/// The codes of a sample, and what they leave out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Packed {
    /// The codes.
    pub codes: Codes,
    /// How much more [`Packer::remainder`] is after this sample than before it, acceleration x, y, z, rate x, y,
    /// z: value less stored value, so that sums over any run of samples can be made up. 0 where it is missing.
    pub left: [i32; AXES],
}

/// Packs samples, carrying the rounding error of each axis into its next sample.
///
/// With no value beyond the top of a scale, the sum of the stored values differs from the sum of the input by
/// the carry alone: at most half a step of one sample, since the last [`Packer::reset`].
/// A missing sample leaves the carry as it is. What saturation cuts off is not carried beyond `carry_limit`.
#[derive(Clone, Debug)]
pub struct Packer {
    scales: Scales,
    carry: [f64; FIELDS],
}

impl Packer {
    /// With nothing carried.
    #[must_use]
    pub fn new(wheel: WheelScale, accel: TwoSlope, rate: TwoSlope) -> Self {
        let scales = Scales { wheel, accel, rate };
        Self {
            scales,
            carry: [0.0; FIELDS],
        }
    }

    /// Forgets what is carried: called at the start of each second block, so that a block's codes do not
    /// depend on where the ring began.
    pub fn reset(&mut self) {
        self.carry = [0.0; FIELDS];
    }

    /// What is carried into the next sample, in the order of [`Codes`]; m/s, m/s^2, rad/s.
    #[must_use]
    pub fn carry(&self) -> [f64; FIELDS] {
        self.carry
    }

    /// What is carried into the next sample, acceleration x, y, z, rate x, y, z, in 1/256 of the fine step of the
    /// axis, rounded and saturating. The default scales carry at most 68.9 fine steps, which fits.
    #[must_use]
    pub fn remainder(&self) -> [i16; AXES] {
        let [_, _, axes @ ..] = self.carry;
        let [a, w] = [self.scales.accel.fine_step, self.scales.rate.fine_step];
        let mut remainder = [0; AXES];
        for ((part, carry), step) in remainder.iter_mut().zip(axes).zip([a, a, a, w, w, w]) {
            *part = num::saturate_i16(num::round_i64(carry * REMAINDER_PARTS / step));
        }
        remainder
    }

    /// The codes of the next sample as [`Packer::pack`] gives them, and what they leave out.
    pub fn packed(&mut self, sample: &Sample) -> Packed {
        let before = self.remainder();
        let codes = self.pack(sample);
        let mut left = self.remainder().map(i32::from);
        for (left, before) in left.iter_mut().zip(before) {
            *left -= i32::from(before);
        }
        Packed { codes, left }
    }

    /// The codes of the next sample. NaN is missing; infinities saturate.
    pub fn pack(&mut self, sample: &Sample) -> Codes {
        let Scales { wheel, accel, rate } = self.scales;
        let mut codes = [MISSING; FIELDS];
        let fields = codes.iter_mut().zip(&mut self.carry).zip(sample.fields());
        for (field, ((code, carry), value)) in fields.enumerate() {
            let Some(value) = value.filter(|value| !value.is_nan()) else {
                continue;
            };
            *code = match field {
                0 | 1 => pack_wheel(wheel, value, carry),
                2..=4 => pack_two_slope(&accel, value, carry),
                _ => pack_two_slope(&rate, value, carry),
            };
        }
        Codes(codes)
    }
}

/// One field with feedback; `carry` is updated.
fn pack_two_slope(scale: &TwoSlope, value: f64, carry: &mut f64) -> u16 {
    let wanted = value + *carry;
    let code = scale.nearest(wanted);
    *carry = leftover(wanted, scale.value(code), scale.carry_limit);
    code
}

/// A wheel field with feedback. A wheel that stands has code 0 and leaves nothing: rest must look like rest.
fn pack_wheel(scale: WheelScale, value: f64, carry: &mut f64) -> u16 {
    if value <= 0.0 {
        *carry = 0.0;
        return 0;
    }
    let wanted = value + *carry;
    let code = scale.nearest(wanted);
    *carry = leftover(wanted, scale.value(code), scale.step / 2.0);
    code
}

/// What the stored value leaves of the wanted one, within the limit.
fn leftover(wanted: f64, stored: Option<f64>, limit: f64) -> f64 {
    let left = stored.map_or(0.0, |stored| wanted - stored);
    left.max(-limit.abs()).min(limit.abs())
}

/// The physical values of a sample's codes. Those of a whole block are [`crate::Block::values`], which also makes up
/// for what the codes leave out.
#[must_use]
pub fn unpack(codes: &Codes, scales: &Scales) -> Sample {
    let [wl, wr, ax, ay, az, wx, wy, wz] = codes.0;
    let Scales { wheel, accel, rate } = scales;
    Sample {
        wheels: [wl, wr].map(|code| wheel.value(code)),
        accel: [ax, ay, az].map(|code| accel.value(code)),
        rate: [wx, wy, wz].map(|code| rate.value(code)),
    }
}

/// Makes one 20 Hz sample of five for the two-rate layout, with a carry of its own.
#[derive(Clone, Debug)]
pub struct Thinner {
    packer: Packer,
}

impl Thinner {
    /// With nothing carried.
    #[must_use]
    pub fn new(wheel: WheelScale, accel: TwoSlope, rate: TwoSlope) -> Self {
        Self {
            packer: Packer::new(wheel, accel, rate),
        }
    }

    /// Forgets what is carried, at the start of each block.
    pub fn reset(&mut self) {
        self.packer.reset();
    }

    /// What is carried into the next sample: see [`Packer::remainder`].
    #[must_use]
    pub fn remainder(&self) -> [i16; AXES] {
        self.packer.remainder()
    }

    /// The mean, field by field, of those of the five samples that have it; missing if none has.
    pub fn thin(&mut self, five: &[Sample]) -> Codes {
        let mut sums = [(0.0, 0_u32); FIELDS];
        for sample in five {
            for ((sum, count), value) in sums.iter_mut().zip(sample.fields()) {
                if let Some(value) = value {
                    *sum += value;
                    *count += 1;
                }
            }
        }
        let mean = sums.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count)));
        self.packer.pack(&Sample::from_fields(mean))
    }
}
