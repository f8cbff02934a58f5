//! One experiment of [S00, 3.7 and 3.8] on a drive: fixes are withheld in windows, and both filters reckon on.
//!
//! Each window begins with a fix. The published filter begins there, as its program does; ours has run since the drive
//! began, with every fix outside the windows.

use nalgebra::Vector3;
use schema::num::real;

use super::drive::{Drive, Fixed, ReckonError, Speed};
use super::experiments::Experiment;
use super::forward::{self, Estimate, Passed, Start};
use super::logs;
use super::published::constants::{DT, STOP_WINDOW};
use super::published::{
    self, GnssFix, Initial, Input, Options, PublishedError, SpeedAid, SpeedUse, Variant,
};
use super::sheet::Sheet;
use super::smooth;
use super::stop::{Detector, ENTRY_S, EXIT_S};

/// Slack of a comparison of stamps, s.
const SLACK_S: f64 = 1e-6;

/// Which fixes are withheld.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial<'a> {
    /// What is tried.
    pub experiment: Experiment,
    /// First and last instant of each window, s, in order; a window may begin where the one before ends.
    pub windows: &'a [[f64; 2]],
    /// Exact speeds of the whole drive, one a second: used in the windows of [`Experiment::ExactSpeed`].
    pub speeds: &'a [Speed],
}

impl Trial<'_> {
    fn window(&self, t_s: f64) -> Option<&[f64; 2]> {
        let after = self
            .windows
            .partition_point(|w| w[0] <= t_s + SLACK_S)
            .checked_sub(1)?;
        self.windows.get(after).filter(|w| t_s < w[1] + SLACK_S)
    }

    /// True of each fix that is kept, by the instants they were true at, s, in order: outside the windows all, in a window
    /// its first, and those so many seconds from it that the experiment keeps.
    #[must_use]
    pub fn kept(&self, stamps: &[f64]) -> Vec<bool> {
        let mut due: Option<(f64, f64)> = None;
        let keep = |t: &f64| {
            let Some([begin, _]) = self.window(*t) else {
                return true;
            };
            let next = match due {
                Some((of, next)) if of.total_cmp(begin).is_eq() => next,
                _ => f64::NEG_INFINITY,
            };
            let kept = *t >= next - SLACK_S;
            if kept {
                let from = if next.is_finite() { next } else { *t };
                let step = match self.experiment {
                    Experiment::Every(seconds) => real(seconds),
                    Experiment::Blind | Experiment::ExactSpeed => f64::INFINITY,
                };
                due = Some((*begin, from.max(*t - step) + step));
            }
            kept
        };
        stamps.iter().map(keep).collect()
    }

    /// The drive with what is left of its fixes, and the speeds where they are used.
    #[must_use]
    pub fn withheld(&self, whole: &Drive) -> Drive {
        let mut part = whole.clone();
        let stamps: Vec<f64> = part.fixes.iter().map(|f| f.t_s).collect();
        let mut keep = self.kept(&stamps).into_iter();
        part.fixes.retain(|_| keep.next().unwrap_or(true));
        if self.experiment == Experiment::ExactSpeed {
            let within = |s: &&Speed| self.window(s.t_s).is_some();
            part.speeds = self.speeds.iter().filter(within).copied().collect();
        }
        part
    }

    /// The spans within the windows without a kept fix, s: each ends with one or with its window. `fixes` are those of the
    /// whole drive.
    #[must_use]
    pub fn outages(&self, fixes: &[Fixed]) -> Vec<[f64; 2]> {
        let stamps: Vec<f64> = fixes.iter().map(|f| f.t_s).collect();
        let keep = self.kept(&stamps);
        let kept: Vec<f64> = stamps
            .iter()
            .zip(&keep)
            .filter_map(|(t, keep)| keep.then_some(*t))
            .collect();
        let mut out = Vec::new();
        for [begin, end] in self.windows {
            let inside = kept
                .iter()
                .filter(|t| **t > begin - SLACK_S && **t < end - SLACK_S);
            let mut from = *begin;
            for t in inside.copied().chain([*end]) {
                if t - from > 1.5 {
                    out.push([from, t]);
                }
                from = t;
            }
        }
        out
    }

    /// The published filter over window `i`, from its first fix on. `input` holds the whole drive, the stamps of its fixes
    /// `latency_s` late. Its times come back as the instants that are told of.
    ///
    /// # Errors
    /// [`PublishedError`]; [`PublishedError::TooFew`] where a window has fewer than two fixes.
    pub fn published(
        &self,
        i: usize,
        input: &Input,
        latency_s: f64,
        start: &dyn Fn(&GnssFix) -> Initial,
        variant: Variant,
    ) -> Result<Vec<Estimate>, PublishedError> {
        let Some([begin, end]) = self.windows.get(i).copied() else {
            return Ok(Vec::new());
        };
        let within = |t: f64| t - latency_s > begin - 0.01 && t - latency_s < end + 0.01;
        let mut fixes: Vec<GnssFix> = input.fixes.clone();
        fixes.retain(|f| within(f.t_s));
        let [first, last] = match fixes.as_slice() {
            [first, .., last] => [*first, *last],
            few => {
                return Err(PublishedError::TooFew {
                    what: "fixes of a window",
                    needed: 2,
                    found: few.len(),
                });
            }
        };
        // The exact speeds come with the fixes, whether their places are used or not.
        let every = if let Experiment::Every(_) = self.experiment {
            let stamps: Vec<f64> = fixes.iter().map(|f| f.t_s - latency_s).collect();
            let only = Trial {
                windows: &[[begin, end]],
                ..self.clone()
            };
            let mut keep = only.kept(&stamps).into_iter();
            // The last ends the loop and is not used.
            fixes.retain(|f| keep.next().unwrap_or(true) && f.t_s < last.t_s);
            fixes.push(last);
            Some(1)
        } else {
            None
        };
        let latency = schema::num::round_usize(latency_s / DT);
        let lead = real(latency + STOP_WINDOW + 2) * DT;
        let samples = input.motions.iter();
        let part = Input {
            motions: samples
                .filter(|m| m.t_s > first.t_s - lead && m.t_s <= last.t_s)
                .copied()
                .collect(),
            fixes,
        };
        let speed = (self.experiment == Experiment::ExactSpeed).then(|| SpeedAid {
            speeds: logs::speed_at_fixes(&part.fixes, self.speeds, latency_s),
            how: SpeedUse::Set,
        });
        let options = Options {
            variant,
            every,
            latency,
            speed,
            ..Options::default()
        };
        let steps = published::run(&part, &start(&first), &options)?;
        Ok(logs::track(&steps, latency_s))
    }
}

/// Where the car stands, as our filter is told.
#[must_use]
pub fn standing(drive: &Drive) -> Vec<bool> {
    let found = Detector::default().detect(drive);
    Detector::hindsight(drive, &found, ENTRY_S, EXIT_S)
}

/// Our filter over a drive, from its first fix that moves; `bias` is what an earlier stop told of the gyros (rad/s, one
/// sigma), used where no stand before the start does.
///
/// # Errors
/// [`ReckonError`]: no fix that moves, or the arithmetic fails.
pub fn ours(
    drive: &Drive,
    known: &Sheet,
    bias: Option<(Vector3<f64>, f64)>,
) -> Result<Passed, ReckonError> {
    let (standing, start) = begin(drive, bias)?;
    forward::run(drive, &standing, known, &start)
}

/// The same, and each instant of it from all data ([`smooth::run`]).
///
/// # Errors
/// Those of [`ours`].
pub fn ours_smoothed(
    drive: &Drive,
    known: &Sheet,
    bias: Option<(Vector3<f64>, f64)>,
) -> Result<(Passed, Vec<Estimate>), ReckonError> {
    let (standing, start) = begin(drive, bias)?;
    smooth::run(drive, &standing, known, &start)
}

fn begin(
    drive: &Drive,
    bias: Option<(Vector3<f64>, f64)>,
) -> Result<(Vec<bool>, Start), ReckonError> {
    let standing = standing(drive);
    let mut start = Start::at_first_course(drive, &standing)?;
    start.rate_bias = start.rate_bias.or(bias);
    Ok((standing, start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fix_each_so_many_seconds_of_a_window_is_kept() {
        let stamps: Vec<f64> = (0..40_i32).map(f64::from).collect();
        let windows = [[10.0, 20.0], [20.0, 30.0]];
        let trial = |experiment| Trial {
            experiment,
            windows: &windows,
            speeds: &[],
        };
        let kept = |experiment| {
            let keep = trial(experiment).kept(&stamps);
            let inside = stamps.iter().zip(keep).filter(|(t, _)| **t >= 10.0);
            inside
                .filter_map(|(t, k)| (k && *t < 31.0).then_some(*t))
                .collect::<Vec<f64>>()
        };
        assert_eq!(kept(Experiment::Every(5)), [10.0, 15.0, 20.0, 25.0, 30.0]);
        assert_eq!(kept(Experiment::Blind), [10.0, 20.0]);
        // The fix each 4 s starts anew in the second window.
        assert_eq!(
            kept(Experiment::Every(4)),
            [10.0, 14.0, 18.0, 20.0, 24.0, 28.0]
        );
        let fixes: Vec<Fixed> = stamps
            .iter()
            .map(|t| Fixed {
                t_s: *t,
                place: crate::wgs84::Geodetic {
                    latitude: 1.0,
                    longitude: 0.2,
                    height: 0.0,
                },
                place_sd: Vector3::repeat(1.0),
                v_n: None,
                v_sd: Vector3::repeat(1.0),
            })
            .collect();
        assert_eq!(
            trial(Experiment::Every(5)).outages(&fixes),
            [[10.0, 15.0], [15.0, 20.0], [20.0, 25.0], [25.0, 30.0]]
        );
    }
}
