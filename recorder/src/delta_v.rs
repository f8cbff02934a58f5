//! Trigger 2: the change of speed within 150 ms, longitudinal or lateral (49 CFR 563, UN R160).
//!
//! What gravity on a slope and the sensor's bias add is taken out: [`crate::level`].

use schema::Sample;

use crate::bins::BIN;
use crate::level::Level;

/// Samples of the 150 ms window.
const WINDOW: usize = 15;
/// Duration of a sample, s.
const STEP: f64 = BIN * 1e-9;
/// Samples the condition must be false before it can fire again: impacts 0.4 s apart are told apart, for a pulse of
/// 140 ms leaves the window 150 ms after its end.
const REARM: u32 = 8;

/// The running sums of both horizontal axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct DeltaV {
    window: [[f64; 2]; WINDOW],
    at: usize,
    level: Level,
    sum: [f64; 2],
    blocked: u32,
    largest: f64,
}

/// A crossing of the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Where in the sample, 0 to 1, by interpolation of the sum.
    pub part: f64,
    /// The sum at the sample's end, m/s.
    pub value: f64,
    /// 0 longitudinal, 1 lateral.
    pub axis: usize,
}

impl DeltaV {
    /// The largest change of speed so far, m/s.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// Takes the next sample; gives the crossing where one fires.
    #[must_use]
    pub fn step(mut self, sample: &Sample, threshold: Option<f64>) -> (Self, Option<Crossing>) {
        let force;
        (self.level, force) = self.level.step(sample);
        let change = force.map(|force| force.unwrap_or(0.0) * STEP);
        if let Some(slot) = self.window.get_mut(self.at) {
            *slot = change;
        }
        self.at = (self.at + 1) % WINDOW;
        let before = self.sum;
        self.sum = self
            .window
            .iter()
            .fold([0.0; 2], |[x, y], [dx, dy]| [x + dx, y + dy]);
        let (axis, value) = if self.sum[0].abs() >= self.sum[1].abs() {
            (0, self.sum[0])
        } else {
            (1, self.sum[1])
        };
        self.largest = self.largest.max(value.abs());
        let Some(threshold) = threshold else {
            return (self, None);
        };
        if value.abs() < threshold {
            self.blocked = self.blocked.saturating_sub(1);
            return (self, None);
        }
        let fires = self.blocked == 0;
        self.blocked = REARM;
        let earlier = before
            .get(axis)
            .map_or(0.0, |before| before.abs())
            .min(threshold);
        let part = ((threshold - earlier) / (value.abs() - earlier).max(f64::MIN_POSITIVE))
            .clamp(0.0, 1.0);
        (self, fires.then_some(Crossing { part, value, axis }))
    }
}
