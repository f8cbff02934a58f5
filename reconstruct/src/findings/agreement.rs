//! The models side by side, and whether they agree.

use nalgebra::{Matrix2, Vector2};

use crate::findings::crash::{self, Evidence};
use crate::findings::{AtImpact, Figure, ModelAnswer};
use crate::stats::{ellipse_radius, two_sided_quantile};

/// A quantity that two models both give, and the test of their difference.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// `start position`, `impact speed`, `impact position`, `impact heading` or `delta-V`.
    pub quantity: &'static str,
    /// The two models.
    pub models: [&'static str; 2],
    /// Size of their difference.
    pub difference: f64,
    /// Unit of it.
    pub unit: &'static str,
    /// Square of the difference over the sum of the two covariances. The models use the same record, so their
    /// errors go together and the sum is too wide: what fails all the same disagrees.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: u8,
    /// The chi-square quantile of the run's confidence.
    pub limit: f64,
}

impl Comparison {
    /// True if the two disagree beyond their joint covariance.
    #[must_use]
    pub fn beyond(&self) -> bool {
        self.chi_square > self.limit
    }
}

/// One model's answer at the start of the window (epoch `from`) and at the first impact.
#[must_use]
pub fn answer(name: &'static str, evidence: &Evidence<'_>, from: usize) -> ModelAnswer {
    let snapshot = &evidence.snapshots[from];
    let sd = |i: usize| snapshot.p[(i, i)].max(0.0).sqrt();
    let first = evidence.motion.impacts.first();
    ModelAnswer {
        name,
        start_north_m: Figure::new(snapshot.nav.r_n.v.x, sd(0), evidence.quantile),
        start_east_m: Figure::new(snapshot.nav.r_n.v.y, sd(1), evidence.quantile),
        start_cov_north_east_m2: snapshot.p[(0, 1)],
        impact_speed_mps: first.map(|pulse| crash::speed_at(evidence, pulse)),
        impact: first.map(|pulse| {
            let impact = crash::impact(evidence, 0, pulse);
            AtImpact {
                north_m: impact.north_m,
                east_m: impact.east_m,
                cov_north_east_m2: impact.cov_north_east_m2,
                heading_deg: impact.heading_deg,
                longitudinal_mps: impact.delta_v.longitudinal_mps,
                lateral_mps: impact.delta_v.lateral_mps,
                cov_longitudinal_lateral: impact.delta_v.cov_longitudinal_lateral,
            }
        }),
    }
}

/// Every pair of models in every quantity that both give with a covariance.
#[must_use]
pub fn compare(answers: &[ModelAnswer], confidence: f64) -> Vec<Comparison> {
    let mut out = Vec::new();
    let one = two_sided_quantile(confidence).powi(2);
    let two = ellipse_radius(confidence).powi(2);
    for (i, a) in answers.iter().enumerate() {
        for b in &answers[i + 1..] {
            let mut push = |quantity, unit, degrees, found: Option<(f64, f64)>| {
                if let Some((difference, chi_square)) = found {
                    out.push(Comparison {
                        quantity,
                        models: [a.name, b.name],
                        difference,
                        unit,
                        chi_square,
                        degrees,
                        limit: if degrees == 1 { one } else { two },
                    });
                }
            };
            let speeds = a.impact_speed_mps.as_ref().zip(b.impact_speed_mps.as_ref());
            let speed = speeds.and_then(|(x, y)| scalar(x, y, x.value - y.value));
            push("impact speed", "m/s", 1, speed);
            if let Some((x, y)) = a.impact.as_ref().zip(b.impact.as_ref()) {
                let turn = x.heading_deg.value - y.heading_deg.value;
                let turn = turn - 360.0 * (turn / 360.0).round();
                push(
                    "impact heading",
                    "degrees",
                    1,
                    scalar(&x.heading_deg, &y.heading_deg, turn),
                );
                let place = |m: &AtImpact| (m.north_m, m.east_m, m.cov_north_east_m2);
                push("impact position", "m", 2, plane(place(x), place(y)));
                let dv = |m: &AtImpact| {
                    (
                        m.longitudinal_mps,
                        m.lateral_mps,
                        m.cov_longitudinal_lateral,
                    )
                };
                push("delta-V", "m/s", 2, plane(dv(x), dv(y)));
            }
            let start =
                |m: &ModelAnswer| (m.start_north_m, m.start_east_m, m.start_cov_north_east_m2);
            push("start position", "m", 2, plane(start(a), start(b)));
        }
    }
    out
}

fn scalar(a: &Figure, b: &Figure, difference: f64) -> Option<(f64, f64)> {
    let variance = a.sd * a.sd + b.sd * b.sd;
    (variance > 0.0 && variance.is_finite())
        .then(|| (difference.abs(), difference * difference / variance))
}

type Pair = (Figure, Figure, f64);

fn plane(a: Pair, b: Pair) -> Option<(f64, f64)> {
    let apart = Vector2::new(a.0.value - b.0.value, a.1.value - b.1.value);
    let covariance = |p: &Pair| Matrix2::new(p.0.sd * p.0.sd, p.2, p.2, p.1.sd * p.1.sd);
    let sum = covariance(&a) + covariance(&b);
    if !sum.iter().all(|x| x.is_finite()) {
        return None;
    }
    let solved = sum.cholesky()?.solve(&apart);
    Some((apart.norm(), apart.dot(&solved)))
}

/// Sentences where the model reported here disagrees with another.
#[must_use]
pub fn sentences(comparisons: &[Comparison], model: &str) -> Vec<String> {
    let mut out = Vec::new();
    let mut others: Vec<&str> = Vec::new();
    let with = |c: &Comparison| c.models.into_iter().find(|m| *m != model);
    let ours = |c: &&Comparison| c.beyond() && c.models.contains(&model);
    for c in comparisons.iter().filter(ours) {
        if let Some(other) = with(c)
            && !others.contains(&other)
        {
            others.push(other);
        }
    }
    for other in others {
        let parts: Vec<String> = comparisons
            .iter()
            .filter(ours)
            .filter(|c| c.models.contains(&other))
            .map(|c| match c.unit {
                "m/s" => format!("{} ({:.1} km/h apart)", c.quantity, c.difference * 3.6),
                unit if c.difference < 100.0 => {
                    format!("{} ({:.1} {unit} apart)", c.quantity, c.difference)
                }
                unit => format!("{} ({:.0} {unit} apart)", c.quantity, c.difference),
            })
            .collect();
        let why = if other == "dead-reckoning" || model == "dead-reckoning" {
            ", as braked, locked or lifted wheels make it"
        } else {
            ""
        };
        out.push(format!(
            "The models {model} and {other} disagree beyond their joint uncertainty in {}{why}.",
            listed(&parts)
        ));
    }
    out
}

/// `a, b and c`.
pub(crate) fn listed(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [only] => only.clone(),
        [many @ .., last] => format!("{} and {last}", many.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(name: &'static str, speed: f64, sd: f64, north: f64) -> ModelAnswer {
        let figure = |value, sd| Figure::new(value, sd, 1.96);
        ModelAnswer {
            name,
            start_north_m: figure(north, 1.0),
            start_east_m: figure(0.0, 1.0),
            start_cov_north_east_m2: 0.9,
            impact_speed_mps: Some(figure(speed, sd)),
            impact: None,
        }
    }

    #[test]
    fn what_differs_beyond_the_sum_is_said_and_what_has_no_covariance_is_not_judged() {
        let answers = [
            answer("dead-reckoning", 17.0, 0.3, 1.0),
            answer("nine-state", 19.0, 0.1, 0.0),
            answer("refined", 19.1, 0.1, 0.1),
            answer("bare", 5.0, f64::INFINITY, 0.0),
        ];
        let found = compare(&answers, 0.95);
        let beyond: Vec<_> = found.iter().filter(|c| c.beyond()).collect();
        assert!(beyond.iter().all(|c| c.quantity == "impact speed"));
        assert_eq!(beyond.len(), 2);
        assert!((beyond[0].chi_square - 4.0 / 0.1).abs() < 1e-9);
        // 1 m along the narrow axis of [2, 1.8; 1.8, 2]: the full covariance is used.
        let place = found
            .iter()
            .find(|c| c.quantity == "start position")
            .unwrap();
        assert!((place.chi_square - 2.0 / (4.0 - 3.24)).abs() < 1e-9);
        let said = sentences(&found, "refined");
        assert_eq!(said.len(), 1);
        assert!(said[0].contains("dead-reckoning") && said[0].contains("7.6 km/h"));
        assert!(
            !found
                .iter()
                .any(|c| c.quantity == "impact speed" && c.models.contains(&"bare"))
        );
    }

    #[test]
    fn headings_wrap() {
        let mut answers = [answer("a", 1.0, 1.0, 0.0), answer("b", 1.0, 1.0, 0.0)];
        for (a, heading) in answers.iter_mut().zip([359.5, 0.5]) {
            let f = Figure::new(heading, 1.0, 1.96);
            a.impact = Some(AtImpact {
                north_m: f,
                east_m: f,
                cov_north_east_m2: 0.0,
                heading_deg: f,
                longitudinal_mps: f,
                lateral_mps: f,
                cov_longitudinal_lateral: 0.0,
            });
        }
        let found = compare(&answers, 0.95);
        let heading = found
            .iter()
            .find(|c| c.quantity == "impact heading")
            .unwrap();
        assert!((heading.difference - 1.0).abs() < 1e-9);
    }
}
