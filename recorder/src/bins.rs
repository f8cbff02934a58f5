//! The open bins of the 10 ms grid: the IMU's frames are integrated over them, wheel frames averaged in them.

use std::collections::VecDeque;

use schema::num;
use schema::sample::SAMPLE_NS;

/// Axes of the IMU: acceleration x, y, z, rate x, y, z.
pub const AXES: usize = 6;
/// Signal groups whose frames are counted: accel, rate, wheel left, wheel right.
pub const GROUPS: usize = 4;
/// Most bins that are open at once.
const MAX_OPEN: u64 = 1000;

/// Duration of a bin, ns.
pub const BIN: f64 = 1e7;

/// One open bin, along the sensor's axes.
#[derive(Clone, Debug, Default)]
pub struct Bin {
    /// Integral of each axis over the covered part, SI times ns.
    integral: [f64; AXES],
    /// Covered part of each axis, ns.
    covered: [f64; AXES],
    /// A lost frame of this axis may hide a part of a pulse here.
    torn: [bool; AXES],
    wheel_sum: [f64; 2],
    wheel_frames: [u16; 2],
    /// Frames of each axis whose middle fell here, and those at the sensor's limit downwards and upwards.
    pub axis_frames: [u16; AXES],
    /// See `axis_frames`.
    pub clipped: [[u16; 2]; AXES],
    /// Frames of each group.
    pub frames: [u16; GROUPS],
    /// Frames lost by their counter or time before those that fell here: accel, rate.
    pub lost: [u16; 2],
}

impl Bin {
    /// Mean of an axis over the covered part; `None` where less than half of the bin is covered, and where a lost frame
    /// may hide a part of a pulse.
    #[must_use]
    pub fn mean(&self, axis: usize) -> Option<f64> {
        let covered = self.covered.get(axis).copied().unwrap_or(0.0);
        let integral = self.integral.get(axis).copied().unwrap_or(0.0);
        let torn = self.torn.get(axis).copied().unwrap_or(false);
        (covered >= 0.5 * BIN && !torn).then(|| integral / covered)
    }

    /// Mean of a wheel's frames; `None` if none came.
    #[must_use]
    pub fn wheel(&self, side: usize) -> Option<f64> {
        let frames = f64::from(self.wheel_frames.get(side).copied().unwrap_or(0));
        (frames > 0.0).then(|| self.wheel_sum.get(side).copied().unwrap_or(0.0) / frames)
    }
}

/// The open bins in order.
#[derive(Clone, Debug, Default)]
pub struct Bins {
    base: u64,
    open: VecDeque<Bin>,
}

/// Index of the bin a time lies in; times before the grid's origin are in bin 0.
#[must_use]
pub fn index_of(time_ns: i64) -> u64 {
    u64::try_from(time_ns.div_euclid(SAMPLE_NS)).unwrap_or(0)
}

/// Start of a bin, ns.
#[must_use]
pub fn start_of(index: u64) -> i64 {
    i64::try_from(index)
        .unwrap_or(i64::MAX)
        .saturating_mul(SAMPLE_NS)
}

impl Bins {
    /// Index of the first bin that is not closed.
    #[must_use]
    pub fn base(&self) -> u64 {
        self.base
    }

    /// Begins at a bin; what is open is lost.
    pub fn begin(&mut self, base: u64) {
        self.base = base;
        self.open.clear();
    }

    /// The bin of an index; `None` if it is closed (or absurdly far ahead).
    pub fn at(&mut self, index: u64) -> Option<&mut Bin> {
        let ahead = index
            .checked_sub(self.base)
            .filter(|ahead| *ahead < MAX_OPEN)?;
        let ahead = num::usize_of(ahead);
        while self.open.len() <= ahead {
            self.open.push_back(Bin::default());
        }
        self.open.get_mut(ahead)
    }

    /// Closes the first bin.
    pub fn close(&mut self) -> (u64, Bin) {
        let index = self.base;
        self.base += 1;
        (index, self.open.pop_front().unwrap_or_default())
    }

    /// Spreads a value of each axis (NaN: none) over a stretch of time. False if it lies wholly in closed bins.
    pub fn spread(&mut self, values: &[f64; AXES], start: f64, end: f64) -> bool {
        let mut at = start.max(num::real_i64(start_of(self.base)));
        let mut any = false;
        while at < end {
            let index = index_of(num::floor_i64(at));
            let stop = num::real_i64(start_of(index + 1));
            let until = stop.min(end);
            let Some(bin) = self.at(index) else { break };
            for ((value, integral), covered) in
                values.iter().zip(&mut bin.integral).zip(&mut bin.covered)
            {
                if !value.is_nan() {
                    *integral += value * (until - at);
                    *covered += until - at;
                }
            }
            any = true;
            at = if stop > at { stop } else { end };
        }
        any
    }

    /// Marks the bins of a stretch of time in which a lost frame of these axes may hide a part of a pulse.
    pub fn tear(&mut self, axes: [bool; AXES], start: f64, end: f64) {
        let mut index = index_of(num::floor_i64(start)).max(self.base);
        while num::real_i64(start_of(index)) < end {
            let Some(bin) = self.at(index) else { break };
            for (torn, carried) in bin.torn.iter_mut().zip(axes) {
                *torn |= carried;
            }
            index += 1;
        }
    }

    /// Adds a wheel frame. False if its bin is closed.
    pub fn wheel(&mut self, side: usize, speed: f64, time_ns: i64) -> bool {
        let Some(bin) = self.at(index_of(time_ns)) else {
            return false;
        };
        if let (Some(sum), Some(frames)) =
            (bin.wheel_sum.get_mut(side), bin.wheel_frames.get_mut(side))
        {
            *sum += speed;
            *frames = frames.saturating_add(1);
        }
        true
    }
}
