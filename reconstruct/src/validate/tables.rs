//! From scores to figures: error quantiles, coverage, normalised squared errors, by group and instant.

use crate::stats::{ellipse_radius, two_sided_quantile};
use crate::validate::measure::{Measure, When};
use crate::validate::score::{BACK_S, Deviation, ImpactScore, Moment, Score};
use crate::validate::statistics::{Estimate, Share, mean, quantile_estimate, rms, sorted};

/// Confidences at which coverage is counted.
pub const LEVELS: [f64; 4] = [0.50, 0.80, 0.95, 0.99];

/// Figures of one measure over one group.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// Crashes.
    pub n: usize,
    /// Median, 90th and 95th percentile of the absolute error.
    pub quantiles: [Estimate; 3],
    /// Root of the mean squared error.
    pub rms: Estimate,
    /// Mean signed error; `None` where the error has no sign.
    pub bias: Option<Estimate>,
    /// Truth inside the bounds at each of [`LEVELS`]; `None` where no bound is claimed.
    pub coverage: Option<[Share; 4]>,
    /// Mean squared error in units of the claimed covariance, by the degrees of freedom: 1 is honest.
    pub nees: Option<Estimate>,
}

/// One line of the tables.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Class, or `all`.
    pub group: String,
    /// What.
    pub measure: Measure,
    /// Where.
    pub when: When,
    /// The figures.
    pub figures: Figures,
}

/// One crash's part of a row.
struct Sample {
    error: f64,
    signed: bool,
    /// NEES over the degrees of freedom.
    nees: Option<f64>,
    inside: Option<[bool; 4]>,
}

impl Sample {
    fn of(deviation: &Deviation, factor: f64) -> Self {
        let inside = LEVELS.map(|level| deviation.inside(two_sided_quantile(level)));
        Self {
            error: deviation.error * factor,
            signed: true,
            nees: deviation.nees(),
            inside: all(inside),
        }
    }

    fn width(value: f64) -> Self {
        Self {
            error: value,
            signed: false,
            nees: None,
            inside: None,
        }
    }
}

fn all(inside: [Option<bool>; 4]) -> Option<[bool; 4]> {
    let [a, b, c, d] = inside;
    Some([a?, b?, c?, d?])
}

/// Every row of a group of scores.
#[must_use]
pub fn rows(group: &str, scores: &[&Score]) -> Vec<Row> {
    let mut out = Vec::new();
    let mut push = |measure: Measure, when: When, samples: Vec<Sample>| {
        if let Some(figures) = figures(&samples) {
            out.push(Row {
                group: group.to_owned(),
                measure,
                when,
                figures,
            });
        }
    };
    for place in 0..BACK_S.len() {
        for measure in Measure::MOMENT {
            let of = |s: &&Score| s.moments.get(place).and_then(|m| at(measure, m));
            push(
                measure,
                When::Back(place),
                scores.iter().filter_map(of).collect(),
            );
        }
    }
    for place in 0..scores.iter().map(|s| s.impacts.len()).max().unwrap_or(0) {
        let impacts: Vec<&ImpactScore> = scores
            .iter()
            .filter_map(|s| s.impacts.get(place)?.as_ref())
            .collect();
        let size = |i: usize| {
            let parts: Vec<f64> = impacts.iter().map(|x| x.truth[i]).collect();
            rms(&parts).map_or(f64::NAN, |r| r.value)
        };
        let pools = [size(2), size(0)];
        for measure in Measure::IMPACT {
            let of = |i: &&ImpactScore| impact(measure, i, pools);
            push(
                measure,
                When::Impact(place),
                impacts.iter().map(of).collect(),
            );
        }
    }
    out
}

fn at(measure: Measure, moment: &Moment) -> Option<Sample> {
    let radii = LEVELS.map(|level| ellipse_radius(level).powi(2));
    let position = |error: f64| Sample {
        error,
        signed: false,
        nees: moment.nees.map(|x| 0.5 * x),
        inside: moment.nees.map(|x| radii.map(|r| x <= r)),
    };
    match measure {
        Measure::Position => Some(position(moment.position_m)),
        Measure::PositionShare => (moment.distance_m >= 10.0)
            .then(|| position(100.0 * moment.position_m / moment.distance_m)),
        Measure::Speed => Some(Sample::of(&moment.speed, 1.0)),
        Measure::Heading => Some(Sample::of(&moment.heading, 1_f64.to_degrees())),
        _ => moment
            .axis_m
            .map(|axis| Sample::width(axis * ellipse_radius(0.95))),
    }
}

fn impact(measure: Measure, score: &ImpactScore, [resultant, forward]: [f64; 2]) -> Sample {
    let [_, _, own] = score.truth;
    let percent = |part: f64| 100.0 / part.max(1e-9);
    match measure {
        Measure::Onset => Sample::of(&score.onset, 1e3),
        Measure::ImpactSpeedShare => Sample::of(&score.speed, percent(score.true_speed.abs())),
        Measure::ImpactHeading => Sample::of(&score.heading, 1_f64.to_degrees()),
        Measure::Longitudinal => Sample::of(&score.longitudinal, 1.0),
        Measure::Lateral => Sample::of(&score.lateral, 1.0),
        Measure::Resultant => Sample::of(&score.resultant, 1.0),
        Measure::Pdof => Sample::of(&score.pdof, 1.0),
        Measure::LongitudinalPooled => Sample::of(&score.longitudinal, percent(resultant)),
        Measure::LateralPooled => Sample::of(&score.lateral, percent(resultant)),
        Measure::LongitudinalShare => Sample::of(&score.longitudinal, percent(own)),
        Measure::LateralShare => Sample::of(&score.lateral, percent(own)),
        Measure::LongitudinalOwn => Sample::of(&score.longitudinal, percent(forward)),
        _ => Sample::of(&score.speed, 1.0),
    }
}

fn figures(samples: &[Sample]) -> Option<Figures> {
    let errors: Vec<f64> = samples.iter().map(|s| s.error).collect();
    let sizes = sorted(&errors.iter().map(|e| e.abs()).collect::<Vec<_>>());
    let nees: Vec<f64> = samples.iter().filter_map(|s| s.nees).collect();
    let inside: Vec<[bool; 4]> = samples.iter().filter_map(|s| s.inside).collect();
    let part = |q: f64| quantile_estimate(&sizes, q);
    Some(Figures {
        n: samples.len(),
        quantiles: [part(0.5)?, part(0.9)?, part(0.95)?],
        rms: rms(&errors)?,
        bias: mean(&errors).filter(|_| samples.iter().any(|s| s.signed)),
        coverage: (!inside.is_empty())
            .then(|| [0, 1, 2, 3].map(|i| Share::count(inside.iter().map(|x| x[i])))),
        // A mean of squares: the interval's lower end cannot be below zero.
        nees: mean(&nees).map(|e| Estimate {
            low: e.low.max(0.0),
            ..e
        }),
    })
}

/// The row of a group, measure and instant.
#[must_use]
pub fn find<'a>(rows: &'a [Row], group: &str, measure: Measure, when: When) -> Option<&'a Figures> {
    rows.iter()
        .find(|r| r.group == group && r.measure == measure && r.when == when)
        .map(|r| &r.figures)
}

#[cfg(test)]
mod tests {
    use super::{LEVELS, Measure, When, find, rows};
    use crate::validate::score::{Deviation, Moment, Score};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Errors drawn from the very covariance that is claimed: coverage and NEES are what they say.
    #[test]
    fn exact_gaussian_draws_are_found_honest() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        let scores: Vec<Score> = (0..4000)
            .map(|_| {
                let moments = [(); 5].map(|()| {
                    let (a, b) = (draw(), draw());
                    // Claimed: sd 2 north, 1 east, correlation 0.6.
                    let north: f64 = 2.0 * a;
                    let east: f64 = 0.6 * a + 0.8 * b;
                    let (nn, ee, ne): (f64, f64, f64) = (4.0, 1.0, 1.2);
                    let det = nn * ee - ne * ne;
                    let deviation = |error: f64, sd| Deviation {
                        error,
                        sd: Some(sd),
                        open: [false; 2],
                    };
                    Moment {
                        position_m: north.hypot(east),
                        distance_m: 100.0,
                        nees: Some(
                            (ee * north * north - 2.0 * ne * north * east + nn * east * east) / det,
                        ),
                        axis_m: Some(2.0),
                        speed: deviation(0.3 * draw(), 0.3),
                        heading: deviation(0.01 * draw(), 0.02),
                    }
                });
                Score {
                    moments,
                    impacts: Vec::new(),
                    false_impacts: 0,
                    rest_found: true,
                }
            })
            .collect();
        let list: Vec<&Score> = scores.iter().collect();
        let rows = rows("all", &list);
        for measure in [Measure::Position, Measure::Speed] {
            let figures = find(&rows, "all", measure, When::Back(0)).unwrap();
            for (share, level) in figures.coverage.unwrap().into_iter().zip(LEVELS) {
                let bounds = share.estimate().unwrap();
                assert!(
                    (share.value() - level).abs() < 0.02,
                    "{measure:?} {share:?}"
                );
                assert!(bounds.high - bounds.low < 0.035);
            }
            let nees = figures.nees.unwrap();
            assert!((nees.value - 1.0).abs() < 0.06, "{measure:?} {nees:?}");
        }
        // Claimed twice too wide: a quarter of the squared error, and far too often inside.
        let wide = find(&rows, "all", Measure::Heading, When::Back(0)).unwrap();
        assert!((wide.nees.unwrap().value - 0.25).abs() < 0.02);
        assert!(wide.coverage.unwrap()[0].value() > 0.79);
        let speed = find(&rows, "all", Measure::Speed, When::Back(2)).unwrap();
        assert!((speed.rms.value - 0.3).abs() < 0.01);
        assert!((speed.quantiles[0].value - 0.3 * 0.6745).abs() < 0.01);
        assert!(speed.bias.unwrap().value.abs() < 0.02);
    }
}
