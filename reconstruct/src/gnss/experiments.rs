//! The experiments of [S00, 3.7 and 3.8] on simulated town drives: the published filter and ours on the same input.
//!
//! As there, each begins with the place and velocity of a fix, the right heading and the gyro bias of an earlier stop. The
//! program of the source starts with the window; a filter in a car runs before it, so ours is measured both ways: *cold*, from
//! the same start, and with a fix each second until the window begins. A window's figure is the largest horizontal deviation
//! from the truth at its full seconds.

use nalgebra::{Vector2, Vector3};
use schema::num::real;

use super::drive::{Drive, Fixed, ReckonError, Speed, Stamped};
use super::forward::{self, Estimate, Start};
use super::published::{
    self, GnssFix, ImuSample, Initial, Input, Options, SpeedAid, SpeedUse, Variant,
};
use super::sheet::Sheet;
use super::smooth::smooth;
use super::stop::{Detector, ENTRY_S, EXIT_S};
use crate::simulate::city::{self, BoxSheet, CityDrive, EARLIER_S, IMU_HZ};
use crate::wgs84::Geodetic;

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
    /// Of ours that ran before, m.
    pub ours_m: f64,
    /// Of the same, smoothed, m.
    pub smoothed_m: f64,
    /// Full seconds, and those at which the truth is inside the ellipse of 95 % of ours, running.
    pub inside: [usize; 2],
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

/// All experiments on the drive of one seed.
///
/// # Errors
/// [`ExperimentError`] where a filter or the simulator fails.
pub fn run(seed: u64, sheet: &BoxSheet) -> Result<Vec<Outcome>, ExperimentError> {
    let city = city::drive(seed, DRIVE_S, sheet)?;
    let drive = drive(&city, sheet)?;
    let known = Sheet::default().heard(&drive, &Detector::default().detect(&drive));
    let mut out = Vec::new();
    for experiment in Experiment::ALL {
        let windows = if experiment.length() == LENGTHS[0] {
            WINDOWS
        } else {
            1
        };
        for window in 0..windows {
            let first = FIRST + window * APART;
            let moving = city.truth.get(first).is_some_and(|t| t.speed >= MOVING);
            if moving && first + experiment.length() < city.truth.len() {
                let window = Window::new(experiment, &city, &drive, sheet, first);
                out.push(one(&window, &drive, &known)?);
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
    experiment: Experiment,
    city: &'a CityDrive,
    sheet: &'a BoxSheet,
    first: usize,
    /// Up to the window's end; fixes within it alone.
    part: Drive,
    /// Stamps and exact speeds, one a second.
    speeds: Vec<(f64, f64)>,
}

impl<'a> Window<'a> {
    fn new(
        experiment: Experiment,
        city: &'a CityDrive,
        whole: &Drive,
        sheet: &'a BoxSheet,
        first: usize,
    ) -> Self {
        let last = first + experiment.length();
        let (t_first, t_last) = (city.truth[first].t_s, city.truth[last].t_s);
        let within = |t: f64| t > t_first - 0.01 && t < t_last + 0.01;
        let mut part = whole.clone();
        part.periods.truncate(last + 1);
        part.fixes.retain(|f| within(f.t_s));
        let speeds = city
            .truth
            .iter()
            .filter(|t| within(t.t_s))
            .step_by(IMU_HZ)
            .map(|t| (t.t_s, t.speed))
            .collect();
        Self {
            experiment,
            city,
            sheet,
            first,
            part,
            speeds,
        }
    }

    /// From the truth at sample `k` to a place, north and east, m.
    fn off(&self, k: usize, place: &Geodetic) -> Vector2<f64> {
        self.city.truth[k].place.to(place).xy()
    }

    /// What the published filter takes: the whole drive's samples, the window's fixes.
    fn input(&self) -> Input {
        let city = self.city;
        let fixes = self.part.fixes.iter();
        Input {
            fixes: fixes
                .map(|f| GnssFix {
                    t_s: f.t_s + self.sheet.latency_s,
                    lat: f.place.latitude,
                    lon: f.place.longitude,
                    height: f.place.height,
                    v_ned: f.v_n.unwrap_or_else(Vector3::zeros),
                })
                .collect(),
            motions: city
                .samples
                .iter()
                .map(|s| ImuSample {
                    t_s: s.t_s,
                    accel_b: s.accel,
                    rate_b: s.rate,
                })
                .collect(),
        }
    }

    /// Largest deviation of the published filter, m.
    fn published(&self, input: &Input, variant: Variant) -> Result<f64, ExperimentError> {
        let (city, first) = (self.city, self.first);
        let mut initial = Initial::from_reference(&input.fixes[0], &city.truth[first].v_n);
        initial.yaw = city.truth[first].angles[2];
        initial.bias = city.earlier_bias;
        initial.v_ned = input.fixes[0].v_ned;
        let options = Options {
            variant,
            every: match self.experiment {
                Experiment::Every(seconds) => Some(seconds),
                _ => None,
            },
            speed: (self.experiment == Experiment::ExactSpeed).then(|| SpeedAid {
                speeds: self.speeds.iter().map(|s| s.1).collect(),
                how: SpeedUse::Set,
            }),
            ..Options::default()
        };
        let steps = published::run(input, &initial, &options)?;
        let seconds = steps.iter().filter(|s| full_second(s.sample, first));
        Ok(seconds.fold(0.0, |most, step| {
            let place = Geodetic {
                latitude: step.lat,
                longitude: step.lon,
                height: step.height,
            };
            f64::max(most, self.off(step.sample, &place).norm())
        }))
    }

    /// The part with the fixes withheld that the experiment withholds, the first one among them.
    fn withheld(&self) -> Drive {
        let mut part = self.part.clone();
        let given = part.fixes.remove(0);
        match self.experiment {
            Experiment::Every(seconds) => {
                let mut next = given.t_s + real(seconds) - 1e-6;
                part.fixes.retain(|fix| {
                    let keep = fix.t_s >= next;
                    if keep {
                        next += real(seconds);
                    }
                    keep
                });
            }
            Experiment::Blind => part.fixes.clear(),
            Experiment::ExactSpeed => {
                part.fixes.clear();
                let speed = |(t_s, speed): &(f64, f64)| Speed {
                    t_s: *t_s,
                    speed: *speed,
                    sd: 0.05,
                };
                part.speeds = self.speeds.iter().map(speed).collect();
            }
        }
        part
    }

    /// Deviations at the full seconds of the window from estimates that begin with sample `from`.
    fn seconds(&self, list: &[Estimate], from: usize) -> Vec<(Vector2<f64>, Estimate)> {
        let all = list.iter().enumerate();
        let chosen = all.filter(|(i, _)| full_second(from + i, self.first));
        chosen
            .map(|(i, e)| (self.off(from + i, &e.place), *e))
            .collect()
    }
}

fn one(window: &Window<'_>, whole: &Drive, known: &Sheet) -> Result<Outcome, ExperimentError> {
    let (city, first) = (window.city, window.first);
    let input = window.input();
    let published_m = [
        window.published(&input, Variant::program())?,
        window.published(&input, Variant::corrected())?,
    ];
    let given = window.part.fixes[0];
    let mut part = window.withheld();
    let detector = Detector::default();
    let bias_sd = known.rate_drift * (city.truth[first].t_s + EARLIER_S).sqrt();
    let start = Start {
        first,
        place: given.place,
        place_sd: given.place_sd,
        v_n: given.v_n.unwrap_or_else(Vector3::zeros),
        v_sd: given.v_sd,
        angles: [0.0, 0.0, city.truth[first].angles[2]],
        angles_sd: [0.04, 0.04, 0.01],
        rate_bias: Some((city.earlier_bias, bias_sd)),
    };
    let stands =
        |drive: &Drive| Detector::hindsight(drive, &detector.detect(drive), ENTRY_S, EXIT_S);
    let cold = forward::run(&part, &stands(&part), known, &start)?;
    let before = whole.fixes.iter().filter(|f| f.t_s <= given.t_s + 1e-6);
    part.fixes = before.copied().chain(part.fixes).collect();
    let standing = stands(&part);
    let mut start = Start::at_first_course(&part, &standing)?;
    // As the program: the bias of an earlier stop.
    let bias_sd = known.rate_drift * EARLIER_S.sqrt();
    start.rate_bias = start.rate_bias.or(Some((city.earlier_bias, bias_sd)));
    let passed = forward::run(&part, &standing, known, &start)?;
    let smoothed = smooth(&passed);
    let most = |list: &[(Vector2<f64>, Estimate)]| list.iter().fold(0.0, |m, e| e.0.norm().max(m));
    let running = window.seconds(&passed.estimates, passed.first);
    let holds = running.iter().filter(|(d, e)| e.holds(d, 0.95));
    Ok(Outcome {
        experiment: window.experiment,
        published_m,
        cold_m: most(&window.seconds(&cold.estimates, cold.first)),
        ours_m: most(&running),
        smoothed_m: most(&window.seconds(&smoothed, passed.first)),
        inside: [running.len(), holds.count()],
    })
}

fn full_second(k: usize, first: usize) -> bool {
    k > first && (k - first).is_multiple_of(IMU_HZ)
}
