//! A drive as our filter takes it: inertial periods in the car's axes, fixes at the instants they were true.

use nalgebra::Vector3;
use schema::num::real;

use crate::wgs84::Geodetic;

/// Why a drive could not be reckoned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReckonError {
    /// The drive does not hold what is needed.
    #[error("drive: {what}")]
    Drive {
        /// Expected and found.
        what: String,
    },
    /// The arithmetic failed.
    #[error("filter at {t_s} s: {what}")]
    Numeric {
        /// s of the box's clock.
        t_s: f64,
        /// Expected and found.
        what: String,
    },
}

/// One period of the inertial sensors, the car's axes (as far as the mounting is known).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// End of the period, s of the box's clock.
    pub t_s: f64,
    /// Length, s.
    pub dt: f64,
    /// Mean specific force, m/s^2.
    pub accel: Vector3<f64>,
    /// Mean rate relative to inertial space, rad/s.
    pub rate: Vector3<f64>,
    /// False where no sample was recorded and the last one was held.
    pub measured: bool,
}

/// A satellite fix at the instant it was true.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fixed {
    /// s of the box's clock, the receiver's delay taken off.
    pub t_s: f64,
    /// Antenna.
    pub place: Geodetic,
    /// One sigma north, east, down, m.
    pub place_sd: Vector3<f64>,
    /// Velocity north, east, down, m/s; `None` where the receiver gave none.
    pub v_n: Option<Vector3<f64>>,
    /// One sigma of it, m/s.
    pub v_sd: Vector3<f64>,
}

/// Speed of the car from elsewhere (a wheel, a reference), m/s along its forward axis at the rear axle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speed {
    /// s of the box's clock.
    pub t_s: f64,
    /// m/s.
    pub speed: f64,
    /// One sigma, m/s.
    pub sd: f64,
}

/// Heading of the car from elsewhere (a reference, a survey of where it stood).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Headed {
    /// s of the box's clock.
    pub t_s: f64,
    /// Clockwise from north, rad.
    pub heading: f64,
    /// One sigma, rad.
    pub sd: f64,
}

/// A drive.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Drive {
    /// Periods without a hole, in order: each ends where the next begins. Of [`Drive::joined`] alone they have holes.
    pub periods: Vec<Period>,
    /// Fixes in order of time.
    pub fixes: Vec<Fixed>,
    /// Speeds in order of time; empty where there are none.
    pub speeds: Vec<Speed>,
    /// Headings in order of time; mostly none.
    pub headings: Vec<Headed>,
}

/// Longest hole bridged by holding the last sample, s: after that the drive ends, and what follows is another one.
pub const LONGEST_HOLE_S: f64 = 5.0;

/// What the sensors put out at one stamp, the car's axes: stamp in s, specific force in m/s^2, rate in rad/s.
pub type Stamped = (f64, Vector3<f64>, Vector3<f64>);

impl Drive {
    /// From stamped samples in order of time. Samples stand for the period that
    /// ends with their stamp; the nominal period is the median. A hole is filled with periods that hold the sample before
    /// it and are marked.
    ///
    /// # Errors
    /// [`ReckonError::Drive`] for fewer than two samples, stamps that do not rise, or a hole beyond 5 s.
    pub fn new(
        samples: &[Stamped],
        fixes: Vec<Fixed>,
        speeds: Vec<Speed>,
    ) -> Result<Self, ReckonError> {
        let fail = |what: String| ReckonError::Drive { what };
        let mut gaps: Vec<f64> = samples.windows(2).map(|w| w[1].0 - w[0].0).collect();
        if gaps.is_empty() {
            return Err(fail(format!(
                "expected at least two inertial samples, found {}",
                samples.len()
            )));
        }
        if let Some(at) = gaps.iter().position(|g| !(*g > 0.0 && g.is_finite())) {
            return Err(fail(format!(
                "inertial sample {}: expected a stamp after {} s, found {} s",
                at + 2,
                samples[at].0,
                samples[at + 1].0
            )));
        }
        gaps.sort_by(f64::total_cmp);
        let period = gaps[gaps.len() / 2];
        let mut periods: Vec<Period> = Vec::with_capacity(samples.len());
        let mut last = samples[0].0 - period;
        for (t_s, accel, rate) in samples {
            let gap = t_s - last;
            if gap > LONGEST_HOLE_S {
                return Err(fail(format!(
                    "no inertial sample for {gap:.1} s before {t_s} s: expected at most {LONGEST_HOLE_S} s in one drive"
                )));
            }
            if gap > 1.6 * period
                && let Some(held) = periods.last().copied()
            {
                let count = schema::num::round_usize(gap / period) - 1;
                let share = gap / real(count + 1);
                for i in 1..=count {
                    periods.push(Period {
                        t_s: last + share * real(i),
                        dt: share,
                        measured: false,
                        ..held
                    });
                }
                last = t_s - share;
            }
            periods.push(Period {
                t_s: *t_s,
                dt: t_s - last,
                accel: *accel,
                rate: *rate,
                measured: true,
            });
            last = *t_s;
        }
        Ok(Self {
            periods,
            fixes,
            speeds,
            headings: Vec::new(),
        })
    }

    /// Drives that follow one another as one, for pictures and counts: no filter can go over its holes.
    #[must_use]
    pub fn joined(drives: &[Self]) -> Self {
        let mut out = Self::default();
        for drive in drives {
            out.periods.extend_from_slice(&drive.periods);
            out.fixes.extend_from_slice(&drive.fixes);
            out.speeds.extend_from_slice(&drive.speeds);
            out.headings.extend_from_slice(&drive.headings);
        }
        out
    }

    /// Begin of the first period and end of the last, s; `None` without periods.
    #[must_use]
    pub fn span(&self) -> Option<[f64; 2]> {
        let (first, last) = (self.periods.first()?, self.periods.last()?);
        Some([first.t_s - first.dt, last.t_s])
    }

    /// The same with every fix dropped but one each `seconds` from the first on; see [`thinned`].
    #[must_use]
    pub fn thinned(&self, seconds: f64) -> Self {
        let keep = thinned(self.fixes.iter().map(|f| f.t_s), seconds);
        let mut keep = keep.iter();
        let mut out = self.clone();
        out.fixes.retain(|_| keep.next() == Some(&true));
        out
    }
}

/// Which of some instants are kept, s: one each `seconds` from the first on. One that comes early by a twentieth of that, at
/// most a tenth of a second, is kept too: the stamps of a receiver jitter.
pub fn thinned(instants: impl Iterator<Item = f64>, seconds: f64) -> Vec<bool> {
    let early = (0.05 * seconds).min(0.1) + 1e-6;
    let mut next = f64::NEG_INFINITY;
    instants
        .map(|t_s| {
            let keep = t_s >= next - early;
            if keep {
                next = t_s.max(next) + seconds;
            }
            keep
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::thinned;

    #[test]
    fn thinned_by_time_and_not_by_count() {
        let kept = |list: &[f64], seconds: f64| -> Vec<f64> {
            let keep = thinned(list.iter().copied(), seconds);
            list.iter()
                .zip(keep)
                .filter(|x| x.1)
                .map(|x| *x.0)
                .collect()
        };
        assert_eq!(kept(&[0.0, 1.0, 2.0, 3.0, 4.0], 2.0), [0.0, 2.0, 4.0]);
        // A gap, and more than one a second.
        assert_eq!(kept(&[0.0, 1.0, 7.0, 8.0, 9.0], 2.0), [0.0, 7.0, 9.0]);
        assert_eq!(kept(&[0.0, 0.2, 0.4, 0.6, 0.8, 1.0], 0.5), [0.0, 0.6]);
        // Stamps that jitter lose none.
        assert_eq!(kept(&[0.0, 0.999, 2.004, 2.998, 4.0], 1.0).len(), 5);
        assert_eq!(kept(&[0.0, 0.01], 0.0).len(), 2);
    }
}
