//! The experiments of [S00, 3.7 and 3.8] on simulated town drives: the published filter and ours on the same input.
//!
//! As there, each begins with the place and velocity of a fix, the right heading and the gyro bias of an earlier stop. The
//! program of the source starts with the window; a filter in a car runs before it, so ours is measured in three ways: *cold*, from
//! the same start; with a fix each second until the window begins, and told the heading there as the published filter is; and
//! the same *alone*, with the heading that it found itself. A window's figure is the largest horizontal deviation
//! from the truth at its full seconds.

use nalgebra::Vector3;

use super::drive::{Drive, Fixed, Headed, ReckonError, Stamped};
use super::forward::{self, Estimate, Start};
use super::published::{self, GnssFix, ImuSample, Initial, Input, Variant};
use super::reference::{Reference, Second, compare};
use super::sheet::Sheet;
use super::stop::Detector;
use super::trial::{Trial, ours, ours_smoothed, standing};
use crate::simulate::city::{self, BoxSheet, CityDrive, EARLIER_S, IMU_HZ};

/// Length of a drive, s.
const DRIVE_S: f64 = 200.0;
/// First sample of the first window, and samples between two of them.
const FIRST: usize = 2000;
const APART: usize = 1250;
/// Windows a drive.
const WINDOWS: usize = 6;
/// A window begins at this speed or above, m/s.
const MOVING: f64 = 4.0;
/// Samples in the windows with and without fixes.
const LENGTHS: [usize; 2] = [30 * IMU_HZ, 120 * IMU_HZ];

/// Heading that a window's filters begin with, one sigma, rad: the reference's, which is the truth here.
const HEADING_SD: f64 = 0.002;

/// One experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Experiment {
    /// 30 s with a fix each so many seconds.
    Every(usize),
    /// 120 s without a fix.
    Blind,
    /// The same with the exact speed once a second.
    ExactSpeed,
}

impl Experiment {
    /// In the order of the source.
    pub const ALL: [Self; 6] = [
        Self::Every(5),
        Self::Every(10),
        Self::Every(15),
        Self::Every(30),
        Self::Blind,
        Self::ExactSpeed,
    ];

    /// In words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Every(seconds) => format!("30 s, a fix each {seconds} s"),
            Self::Blind => "120 s without fixes".to_owned(),
            Self::ExactSpeed => "120 s without fixes, exact speed".to_owned(),
        }
    }

    /// Deviation that [S00, 5.4 and 5.5] read off its own figures, m; it gives none without fixes.
    #[must_use]
    pub const fn source_m(self) -> Option<f64> {
        match self {
            Self::Every(5) => Some(6.0),
            Self::Every(10) => Some(20.0),
            Self::Every(15) => Some(30.0),
            Self::Every(_) => Some(50.0),
            Self::Blind => None,
            Self::ExactSpeed => Some(40.0),
        }
    }

    fn length(self) -> usize {
        LENGTHS[usize::from(!matches!(self, Self::Every(_)))]
    }
}

/// One window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Which.
    pub experiment: Experiment,
    /// Largest deviation of the published filter, m: as its program, and with its slips mended.
    pub published_m: [f64; 2],
    /// Of ours from the same start, running, m.
    pub cold_m: f64,
    /// Of ours that ran before, with its own heading, m.
    pub alone_m: f64,
    /// Of ours that ran before and is told the heading where the window begins, as the published filter is, m.
    pub ours_m: f64,
    /// Of the last, smoothed, m.
    pub smoothed_m: f64,
    /// Full seconds, and those at which the truth is inside the ellipse of 95 % of ours, running: told and with its own
    /// heading.
    pub inside: [usize; 3],
}

/// What stopped an experiment.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// Ours.
    #[error(transparent)]
    Ours(#[from] ReckonError),
    /// The published filter.
    #[error("published filter: {0}")]
    Published(#[from] published::PublishedError),
    /// The simulator.
    #[error(transparent)]
    Simulate(#[from] crate::simulate::SimulateError),
}

/// Experiments on the drive of one seed; one whose window begins with a standing car gives nothing.
///
/// # Errors
/// [`ExperimentError`] where a filter or the simulator fails.
pub fn run(
    seed: u64,
    sheet: &BoxSheet,
    experiments: &[Experiment],
) -> Result<Vec<Outcome>, ExperimentError> {
    let city = city::drive(seed, DRIVE_S, sheet)?;
    let drive = drive(&city, sheet)?;
    let known = Sheet::default().heard(&drive, &Detector::default().detect(&drive));
    let truth = Reference::of_truth(&city);
    let speeds = truth.speeds();
    let mut out = Vec::new();
    for experiment in experiments.iter().copied() {
        let windows = if experiment.length() == LENGTHS[0] {
            WINDOWS
        } else {
            1
        };
        for window in 0..windows {
            let first = FIRST + window * APART;
            let moving = city.truth.get(first).is_some_and(|t| t.speed >= MOVING);
            if moving && first + experiment.length() < city.truth.len() {
                let last = first + experiment.length();
                let span = [city.truth[first].t_s, city.truth[last].t_s];
                let mut part = drive.clone();
                part.periods.truncate(last + 1);
                let window = Window {
                    trial: Trial {
                        experiment,
                        windows: &[span],
                        speeds: &speeds,
                    },
                    city: &city,
                    sheet,
                    first,
                    span,
                    truth: &truth,
                };
                out.push(one(&window, &part, &known)?);
            }
        }
    }
    Ok(out)
}

/// The whole drive as ours takes it.
///
/// # Errors
/// [`ReckonError::Drive`]; the simulator's samples give no cause.
pub fn drive(city: &CityDrive, sheet: &BoxSheet) -> Result<Drive, ReckonError> {
    let samples: Vec<Stamped> = city
        .samples
        .iter()
        .map(|s| (s.t_s, s.accel, s.rate))
        .collect();
    let fixes = city
        .fixes
        .iter()
        .map(|fix| Fixed {
            t_s: fix.t_s - sheet.latency_s,
            place: fix.place,
            place_sd: Vector3::from(sheet.fix),
            v_n: Some(fix.v_n),
            v_sd: Vector3::from(sheet.fix_speed),
        })
        .collect();
    Drive::new(&samples, fixes, Vec::new())
}

/// One window of a drive.
struct Window<'a> {
    trial: Trial<'a>,
    city: &'a CityDrive,
    sheet: &'a BoxSheet,
    first: usize,
    span: [f64; 2],
    /// At the full seconds of the window.
    truth: &'a Reference,
}

impl Window<'_> {
    /// What the published filter takes: the whole drive's samples, and its fixes as they came.
    fn input(&self, whole: &Drive) -> Input {
        let fixes = whole.fixes.iter().map(|f| GnssFix {
            t_s: f.t_s + self.sheet.latency_s,
            lat: f.place.latitude,
            lon: f.place.longitude,
            height: f.place.height,
            v_ned: f.v_n.unwrap_or_else(Vector3::zeros),
        });
        let samples = self.city.samples.iter().map(|s| ImuSample {
            t_s: s.t_s,
            accel_b: s.accel,
            rate_b: s.rate,
        });
        Input {
            fixes: fixes.collect(),
            motions: samples.collect(),
        }
    }

    /// Largest deviation of the published filter, m.
    fn published(&self, input: &Input, variant: Variant) -> Result<f64, ExperimentError> {
        let truth = &self.city.truth[self.first];
        let start = |fix: &GnssFix| Initial {
            yaw: truth.angles[2],
            bias: self.city.earlier_bias,
            v_ned: fix.v_ned,
            ..Initial::from_reference(fix, &truth.v_n)
        };
        let latency_s = self.sheet.latency_s;
        let track = self.trial.published(0, input, latency_s, &start, variant)?;
        // It ends before the second of its last fix.
        let last = track.last().map_or(f64::NEG_INFINITY, |e| e.t_s + 1e-3);
        let mut list = self.seconds(&track);
        list.retain(|s| s.t_s < last);
        Ok(most(&list))
    }

    /// Deviations at the full seconds of the window, the first left out.
    fn seconds(&self, track: &[Estimate]) -> Vec<Second> {
        let mut list = compare(track, self.truth);
        list.retain(|s| s.t_s > self.span[0] + 0.01 && s.t_s < self.span[1] + 0.01);
        list
    }
}

fn most(list: &[Second]) -> f64 {
    list.iter().fold(0.0, |m, s| s.off_m.max(m))
}

fn one(window: &Window<'_>, whole: &Drive, known: &Sheet) -> Result<Outcome, ExperimentError> {
    let (city, first) = (window.city, window.first);
    let input = window.input(whole);
    let published_m = [
        window.published(&input, Variant::program())?,
        window.published(&input, Variant::corrected())?,
    ];
    let mut whole = whole.clone();
    whole.fixes.retain(|f| f.t_s < window.span[1] + 0.01);
    let part = window.trial.withheld(&whole);
    let after = |t: f64| t > window.span[0] - 0.01;
    let mut cold = part.clone();
    cold.fixes.retain(|f| after(f.t_s));
    let given = cold.fixes.remove(0);
    let bias_sd = known.rate_drift * (city.truth[first].t_s + EARLIER_S).sqrt();
    let start = Start {
        first,
        place: given.place,
        place_sd: given.place_sd,
        v_n: given.v_n.unwrap_or_else(Vector3::zeros),
        v_sd: given.v_sd,
        angles: [0.0, 0.0, city.truth[first].angles[2]],
        angles_sd: [0.04, 0.04, HEADING_SD],
        by_course: false,
        rate_bias: Some((city.earlier_bias, bias_sd)),
    };
    let cold = forward::run(&cold, &standing(&cold), known, &start)?;
    // As the program: the bias of an earlier stop.
    let bias = (city.earlier_bias, known.rate_drift * EARLIER_S.sqrt());
    let alone = ours(&part, known, Some(bias))?;
    let mut told = part;
    told.headings = vec![Headed {
        t_s: window.span[0],
        heading: city.truth[first].angles[2],
        sd: HEADING_SD,
    }];
    let (passed, later) = ours_smoothed(&told, known, Some(bias))?;
    let running = window.seconds(&passed.estimates);
    let alone = window.seconds(&alone.estimates);
    let holds = |list: &[Second]| list.iter().filter(|s| s.inside).count();
    Ok(Outcome {
        experiment: window.trial.experiment,
        published_m,
        cold_m: most(&window.seconds(&cold.estimates)),
        ours_m: most(&running),
        alone_m: most(&alone),
        smoothed_m: most(&window.seconds(&later)),
        inside: [running.len(), holds(&running), holds(&alone)],
    })
}
