//! Faults put into simulated crashes: the bounds must still hold, and the result must name the fault.

use schema::num::{real_u64, usize_of};
use schema::units::STANDARD_GRAVITY;

use crate::simulate::errors::Burst;
use crate::simulate::{Class, Scenario};
use crate::validate::sets::Prepared;

/// Range of the clipped gyro, rad/s.
const GYRO_RANGE_DEGPS: f64 = 100.0;
/// Range of the clipped accelerometer, g.
const ACCEL_RANGE_G: f64 = 16.0;
/// Spin at least given to a crash whose gyro is to clip, deg/s.
const CLIPPING_SPIN_DEGPS: f64 = 130.0;
/// Delta-V at least given to a crash whose accelerometer is to clip, m/s.
const CLIPPING_DELTA_V: f64 = 55.0 / 3.6;
/// Length of the gap in all frames, s.
const GAP_S: f64 = 0.5;
/// Length of the wheels' silence, s.
const DROPOUT_S: f64 = 4.0;
/// From the onset to the cut of the power, s.
const CUT_S: f64 = 0.3;
/// Error of the track width in the header, fraction.
const TRACK_ERROR: f64 = 0.05;
/// Error of the mounting, deg.
const MOUNTING_DEG: f64 = 3.0;
/// From the first to the second impact, s.
const SECOND_S: f64 = 1.0;

/// One kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// One wheel locks as the braking begins, left and right in turn.
    LockOne,
    /// Both lock.
    LockBoth,
    /// No wheel frames for 4 s, beginning 1 to 20 s before the impact.
    Dropout,
    /// Gyro range 100 deg/s, known from the sheet; the spin is at least 130 deg/s.
    GyroClip,
    /// Accelerometer range 16 g, known from the sheet; delta-V is at least 55 km/h.
    AccelClip,
    /// No frames at all for 0.5 s, beginning 15 s before to 2 s after the impact.
    Gap,
    /// The record ends 0.3 s after the onset.
    PowerCut,
    /// Rest on the roof.
    Roof,
    /// Track width in the header 5 % too large or too small, in turn.
    Track,
    /// Mounting off by 3 deg about one axis in turn, either way; the sheet says 1 deg.
    Mounting,
    /// A second impact 1 s after the first.
    Second,
}

impl Fault {
    /// Every fault, in the order of the list.
    pub const ALL: [Self; 11] = [
        Self::LockOne,
        Self::LockBoth,
        Self::Dropout,
        Self::GyroClip,
        Self::AccelClip,
        Self::Gap,
        Self::PowerCut,
        Self::Roof,
        Self::Track,
        Self::Mounting,
        Self::Second,
    ];

    /// Name in tables and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::LockOne => "lock-one",
            Self::LockBoth => "lock-both",
            Self::Dropout => "dropout",
            Self::GyroClip => "gyro-clip",
            Self::AccelClip => "accel-clip",
            Self::Gap => "gap",
            Self::PowerCut => "power-cut",
            Self::Roof => "roof",
            Self::Track => "track-width",
            Self::Mounting => "mounting",
            Self::Second => "second-impact",
        }
    }

    /// One phrase about it.
    #[must_use]
    pub const fn about(self) -> &'static str {
        match self {
            Self::LockOne => "one wheel locked under braking",
            Self::LockBoth => "both wheels locked under braking",
            Self::Dropout => "no wheel speeds for 4 s before the impact",
            Self::GyroClip => "gyro clipped at 100 deg/s",
            Self::AccelClip => "accelerometer clipped at 16 g",
            Self::Gap => "all frames missing for 0.5 s",
            Self::PowerCut => "power cut 0.3 s after the impact, no rest in the record",
            Self::Roof => "rest on the roof",
            Self::Track => "track width wrong by 5 %",
            Self::Mounting => "mounting off by 3 deg, sheet 1 deg",
            Self::Second => "a second impact 1 s later",
        }
    }

    /// The fault counts as named if a sentence of the result's limits has one of these in it (lower case).
    #[must_use]
    pub const fn key_words(self) -> &'static [&'static str] {
        match self {
            Self::LockOne | Self::LockBoth => &["locked", "lock up", "wheel lock"],
            Self::Dropout => &["wheel speeds have"],
            Self::GyroClip => &["gyro stood", "gyros stood", "at a sensor's limit"],
            Self::AccelClip => &["accelerometer stood", "at a sensor's limit"],
            Self::Gap => &["without a whole imu value"],
            Self::PowerCut => &["incomplete", "ends moving", "no rest was found"],
            Self::Roof => &["not come to rest on its wheels", "on its roof"],
            Self::Track => &["track width"],
            Self::Mounting => &["mounting", "mounted"],
            Self::Second => &["2 impacts", "second impact"],
        }
    }

    /// Whether one of the sentences names it.
    #[must_use]
    pub fn named(self, sentences: &[String]) -> bool {
        sentences.iter().any(|sentence| {
            let low = sentence.to_lowercase();
            self.key_words().iter().any(|word| low.contains(word))
        })
    }

    /// The class of a seed: the crash classes in turn.
    #[must_use]
    pub fn class(self, seed: u64) -> Class {
        if self == Self::Roof {
            return Class::Roof;
        }
        let turn = usize_of(seed % 6);
        Class::CRASHES.get(turn).copied().unwrap_or(Class::Frontal)
    }

    /// The scenario of a seed with the fault in it.
    #[must_use]
    pub fn scenario(self, seed: u64) -> Scenario {
        let mut scenario = Scenario::draw(self.class(seed), seed);
        let onset = scenario.manoeuvre.impacts.first().map_or(40.0, |i| i.t);
        // The golden section spreads any run of seeds evenly.
        let spread = (real_u64(seed) * 0.618_033_988_749_895).fract();
        let even = seed.is_multiple_of(2);
        let side = if even { 1.0 } else { -1.0 };
        let plan = &mut scenario.manoeuvre;
        match self {
            Self::LockOne | Self::LockBoth => {
                if let Some(braking) = &mut plan.braking {
                    braking.lock = Some(match self {
                        Self::LockBoth => 2,
                        _ => usize::from(even),
                    });
                }
            }
            Self::Dropout => scenario.errors.wheel_bursts.push(Burst {
                t: onset - 1.0 - 19.0 * spread,
                duration: DROPOUT_S,
            }),
            Self::GyroClip => {
                let range = Some(GYRO_RANGE_DEGPS.to_radians());
                (scenario.errors.rate_range, scenario.sheet.rate_range) = (range, range);
                if let Some(impact) = plan.impacts.first_mut() {
                    let least = (CLIPPING_SPIN_DEGPS + 90.0 * spread).to_radians();
                    if impact.spin.abs() < CLIPPING_SPIN_DEGPS.to_radians() {
                        impact.spin = least.copysign(impact.spin);
                    }
                }
            }
            Self::AccelClip => {
                let range = Some(ACCEL_RANGE_G * STANDARD_GRAVITY);
                (scenario.errors.accel_range, scenario.sheet.accel_range) = (range, range);
                if let Some(impact) = plan.impacts.first_mut() {
                    let [x, y] = impact.delta_v;
                    let gain = (CLIPPING_DELTA_V * (1.0 + 0.4 * spread) / x.hypot(y)).max(1.0);
                    impact.delta_v = [x * gain, y * gain];
                }
            }
            Self::Gap => {
                let burst = Burst {
                    t: onset - 15.0 + 17.0 * spread,
                    duration: GAP_S,
                };
                scenario.errors.bursts.push(burst);
                scenario.errors.wheel_bursts.push(burst);
            }
            Self::Mounting => {
                if let Some(angle) = scenario.errors.mounting.get_mut(usize_of(seed % 3)) {
                    *angle = side * MOUNTING_DEG.to_radians();
                }
            }
            Self::Second => {
                let other = Scenario::draw(Class::Double, seed).manoeuvre.impacts;
                plan.impacts.truncate(1);
                plan.impacts.extend(other.into_iter().skip(1).take(1));
                if let Some(second) = plan.impacts.get_mut(1) {
                    second.t = onset + SECOND_S;
                }
            }
            // These are in the header or the record.
            Self::Track | Self::PowerCut | Self::Roof => {}
        }
        scenario
    }

    /// Simulates and records the crash of a seed with the fault in it.
    ///
    /// # Errors
    /// A sentence on what failed.
    pub fn prepare(self, seed: u64) -> Result<Prepared, String> {
        let cut = (self == Self::PowerCut).then_some(CUT_S);
        let mut prepared = Prepared::new(&self.scenario(seed), cut)?;
        if self == Self::Track {
            let factor = if seed.is_multiple_of(2) {
                1.0 + TRACK_ERROR
            } else {
                1.0 - TRACK_ERROR
            };
            prepared.epochs.header.vehicle.track_width_m *= factor;
        }
        Ok(prepared)
    }
}

#[cfg(test)]
mod tests {
    use super::Fault;
    use crate::simulate::{WheelFrame, simulate};

    #[test]
    fn faults_really_happen() {
        for seed in 1..=6 {
            let gyro = simulate(&Fault::GyroClip.scenario(seed)).unwrap();
            let top = 100_f64.to_radians() - 1e-4;
            assert!(
                gyro.imu.iter().any(|f| f.clipped && f.rate[2].abs() >= top),
                "{seed}"
            );
            let accel = simulate(&Fault::AccelClip.scenario(seed)).unwrap();
            assert!(accel.imu.iter().any(|f| f.clipped), "{seed}");
            let both = simulate(&Fault::LockBoth.scenario(seed)).unwrap();
            let onset = both.truth.facts.impacts[0].t_s;
            let braked = |f: &&WheelFrame| f.t < onset && f.t > onset - 0.1;
            let last = both.wheels.iter().rfind(braked).unwrap();
            let speed = both.truth.facts.impacts[0].speed_mps;
            assert!(
                last.speed.iter().all(|v| *v < 0.5 * speed),
                "{seed}: {last:?} {speed}"
            );
            let second = simulate(&Fault::Second.scenario(seed)).unwrap();
            let impacts = &second.truth.facts.impacts;
            assert!(impacts.len() == 2 && (impacts[1].t_s - impacts[0].t_s - 1.0).abs() < 1e-9);
        }
    }
}
