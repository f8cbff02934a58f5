//! The figures of S03's own error analysis, computed again: where the source slipped, and why.

use schema::units::STANDARD_GRAVITY;

use crate::mechanize::EARTH_RATE;

/// Mean radius of the Earth, m.
const EARTH_RADIUS: f64 = 6.371e6;
/// Speed of the example of [S03, 3.3.1], m/s (90 km/h).
const SPEED: f64 = 25.0;
/// Length of the record, s [S03, 3.2].
const RECORD_S: f64 = 40.0;
/// Where S03 was written: Trondheim.
const LATITUDE_DEG: f64 = 63.4;

/// How the source's figure fares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Wrong.
    Slip,
    /// Right, or right as rounded.
    Agrees,
    /// The source says what happens and gives no number; here it is.
    NotGiven,
}

impl Verdict {
    /// Name in the outputs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Slip => "slip",
            Self::Agrees => "agrees",
            Self::NotGiven => "not given",
        }
    }
}

/// One figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Section of S03.
    pub section: &'static str,
    /// What it is.
    pub what: &'static str,
    /// The source's value; `None`: none given.
    pub source: Option<f64>,
    /// The correct value.
    pub correct: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Decimals worth printing.
    pub decimals: usize,
    /// How it fares.
    pub verdict: Verdict,
    /// Why.
    pub why: String,
}

/// Distance after `t` seconds at a constant acceleration from rest, m [S03, 1.1].
#[must_use]
pub fn fallen(accel: f64, t: f64) -> f64 {
    0.5 * accel * t * t
}

/// The bound on the Coriolis term of [S03, 3.3.1], m/s^2.
#[must_use]
pub fn coriolis_bound(speed: f64) -> f64 {
    2.0 * 6.0_f64.sqrt() * speed * (speed / EARTH_RADIUS + EARTH_RATE)
}

/// The horizontal Coriolis acceleration at a latitude, transport rate included, m/s^2.
#[must_use]
pub fn coriolis_horizontal(speed: f64, latitude_rad: f64) -> f64 {
    let (s, c) = latitude_rad.sin_cos();
    (2.0 * EARTH_RATE * s + speed / EARTH_RADIUS * s / c) * speed
}

/// Every figure of the error analysis in S03, sections 1.2.1, 1.3.1, 3.2.1, 3.3.1 and 3.3.3.
#[must_use]
pub fn figures() -> Vec<Figure> {
    let mut list = accelerometer();
    list.extend(gyro());
    list.extend(coriolis());
    list.extend(others());
    list
}

fn accelerometer() -> Vec<Figure> {
    let mg = 1e-3 * STANDARD_GRAVITY;
    let left_out = |minutes: &str| {
        format!(
            "1 mg is {mg:.5} m/s^2, and half of that times the time squared, {minutes}, is this. The source's \
             figure is what 0.001 m/s^2 would give: g was left out."
        )
    };
    let density = 150e-6 * STANDARD_GRAVITY;
    vec![
        Figure {
            section: "1.2.1",
            what: "position error of a bias of 1 mg after 30 min",
            source: Some(1620.0),
            correct: fallen(mg, 1800.0),
            unit: "m",
            decimals: 0,
            verdict: Verdict::Slip,
            why: left_out("1,800 s"),
        },
        Figure {
            section: "1.2.1",
            what: "position error of a bias of 1 mg after 60 min",
            source: Some(6480.0),
            correct: fallen(mg, 3600.0),
            unit: "m",
            decimals: 0,
            verdict: Verdict::Slip,
            why: left_out("3,600 s"),
        },
        Figure {
            section: "1.2.1",
            what: "position error of a bias of 1 mg over the record of 40 s",
            source: None,
            correct: fallen(mg, RECORD_S),
            unit: "m",
            decimals: 1,
            verdict: Verdict::NotGiven,
            why: "The length of the record is what matters here, not half an hour. A bias that levelling at \
                  rest has turned into tilt cancels on a straight road and returns when the car turns."
                .to_owned(),
        },
        Figure {
            section: "1.2.1",
            what: "position error (one sigma) of white noise of 150 micro-g/sqrt(Hz) after 40 s",
            source: None,
            correct: density * (RECORD_S.powi(3) / 3.0).sqrt(),
            unit: "m",
            decimals: 2,
            verdict: Verdict::NotGiven,
            why: "The density is quoted for the ADXL103, whose data sheet (revision C) says 110; twice integrated it grows \
                  with the time to the power 3/2."
                .to_owned(),
        },
    ]
}

fn gyro() -> Vec<Figure> {
    let bias = 0.01_f64.to_radians();
    vec![Figure {
        section: "1.3.1",
        what: "position error of a gyro bias of 0.01 deg/s over 40 s, through tilt",
        source: None,
        correct: STANDARD_GRAVITY * bias * RECORD_S.powi(3) / 6.0,
        unit: "m",
        decimals: 1,
        verdict: Verdict::NotGiven,
        why: "The source says that a gyro's bias tilts the platform and that the accelerometers then see \
              gravity; the error is g times the bias times the cube of the time over six."
            .to_owned(),
    }]
}

fn coriolis() -> Vec<Figure> {
    let bound = coriolis_bound(SPEED);
    let latitude = LATITUDE_DEG.to_radians();
    let horizontal = 2.0 * EARTH_RATE * SPEED;
    let there = coriolis_horizontal(SPEED, latitude);
    let backwards = 2.0 * 9.5 / (RECORD_S * RECORD_S) * 100.0;
    vec![
        Figure {
            section: "3.3.1",
            what: "bound on the Coriolis term at 90 km/h, 2 sqrt(6) v (v/R + Omega)",
            source: Some(0.95),
            correct: bound * 100.0,
            unit: "cm/s^2",
            decimals: 3,
            verdict: Verdict::Agrees,
            why: "Within one in the last digit (0.94).".to_owned(),
        },
        Figure {
            section: "3.3.1",
            what: "position error of 0.95 cm/s^2 after 40 s",
            source: Some(9.5),
            correct: fallen(0.0095, RECORD_S),
            unit: "m",
            decimals: 1,
            verdict: Verdict::Slip,
            why: format!(
                "Equation 1.1 gives half of 0.0095 times 1,600; 9.5 m would take {backwards:.2} cm/s^2. With \
                 the bound unrounded it is {:.1} m.",
                fallen(bound, RECORD_S)
            ),
        },
        Figure {
            section: "3.3.1",
            what: "horizontal Coriolis acceleration at 90 km/h, at most 2 Omega v",
            source: None,
            correct: horizontal * 100.0,
            unit: "cm/s^2",
            decimals: 3,
            verdict: Verdict::NotGiven,
            why: format!(
                "Reached at the pole; it is what moves the path in plan. The bound, made for a matrix, is {:.1} \
                 times as large. At {LATITUDE_DEG} degrees north, transport rate included, it is {:.3} cm/s^2.",
                bound / horizontal,
                there * 100.0
            ),
        },
        Figure {
            section: "3.3.1",
            what: "position error of that horizontal part after 40 s, heading unknown",
            source: None,
            correct: fallen(horizontal, RECORD_S),
            unit: "m",
            decimals: 1,
            verdict: Verdict::NotGiven,
            why: format!(
                "So much, and not 9.5 m, is at stake where the heading is not known; at {LATITUDE_DEG} degrees \
                 north {:.1} m. The filter carries it as a constant unknown acceleration.",
                fallen(there, RECORD_S)
            ),
        },
    ]
}

fn others() -> Vec<Figure> {
    let second = |hz: f64| hz * 10.0 + 6.0;
    vec![
        Figure {
            section: "2.4",
            what: "crown of 3 % as an angle",
            source: Some(1.7),
            correct: 0.03_f64.atan().to_degrees(),
            unit: "deg",
            decimals: 1,
            verdict: Verdict::Agrees,
            why: "Also 8 % (4.6 deg) and 10 % (5.7 deg).".to_owned(),
        },
        Figure {
            section: "3.3.3",
            what: "vertical speed at 100 km/h on the steepest road, 5.7 deg",
            source: Some(9.9),
            correct: 100.0 * 5.7_f64.to_radians().sin(),
            unit: "km/h",
            decimals: 1,
            verdict: Verdict::Agrees,
            why: "It holds at that speed only: the limit is v sin(5.7 deg).".to_owned(),
        },
        Figure {
            section: "3.2.1",
            what: "storage for 40 s",
            source: Some(8240.0),
            correct: 15.0 * second(100.0) + 25.0 * second(20.0),
            unit: "bytes",
            decimals: 0,
            verdict: Verdict::Slip,
            why: "8,240 bytes is 40 s at 20 samples a second; section 3.2 keeps the last 15 s at 100 a second, \
                  10 bytes each and 6 for the time of every second."
                .to_owned(),
        },
    ]
}

#[cfg(test)]
mod tests {
    use super::{Verdict, coriolis_bound, fallen, figures};

    fn correct(what: &str) -> f64 {
        figures()
            .iter()
            .find(|f| f.what.contains(what))
            .unwrap()
            .correct
    }

    #[test]
    fn one_milli_g_for_half_an_hour_and_an_hour() {
        assert!((correct("after 30 min") - 15_887.0).abs() < 1.0);
        assert!((correct("after 60 min") - 63_547.0).abs() < 1.0);
        // What the source did.
        assert!((fallen(0.001, 1800.0) - 1620.0).abs() < 1e-9);
        assert!((fallen(0.001, 3600.0) - 6480.0).abs() < 1e-9);
    }

    #[test]
    fn coriolis() {
        assert!((coriolis_bound(25.0) - 0.009_41).abs() < 1e-5);
        assert!((correct("0.95 cm/s^2 after") - 7.6).abs() < 1e-9);
        assert!((correct("at most 2 Omega v") - 0.3646).abs() < 1e-4);
        assert!((correct("horizontal part after") - 2.917).abs() < 1e-3);
    }

    #[test]
    fn what_is_called_right_is_right_and_what_is_called_a_slip_is_off() {
        for figure in figures() {
            let Some(source) = figure.source else {
                assert_eq!(figure.verdict, Verdict::NotGiven);
                continue;
            };
            let apart = (source / figure.correct - 1.0).abs();
            match figure.verdict {
                Verdict::Agrees => assert!(apart < 0.015, "{figure:?}"),
                Verdict::Slip => assert!(apart > 0.2, "{figure:?}"),
                Verdict::NotGiven => panic!("{figure:?}"),
            }
        }
    }

    #[test]
    fn bytes() {
        assert!((correct("storage") - 20_240.0).abs() < 1e-9);
    }
}
