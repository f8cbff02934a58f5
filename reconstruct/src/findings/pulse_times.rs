//! Begin and end of a pulse after named rules: which one a figure refers to changes what it means.

use nalgebra::Vector3;
use schema::units::STANDARD_GRAVITY;

use crate::findings::Figure;
use crate::findings::crash::Evidence;
use crate::motion::Pulse;

/// 0.8 km/h within 20 ms [49 CFR 563.5], m/s and s.
const CFR_DELTA_V: f64 = 0.8 / 3.6;
const CFR_WINDOW_S: f64 = 0.020;
/// Departure from the level beside the pulse, m/s^2, and how long it must be kept, s.
const HALF_G: f64 = 0.5 * STANDARD_GRAVITY;
const KEPT_S: f64 = 0.020;
/// So far from the pulse a rule is looked for, s.
const REACH_S: f64 = 0.10;
/// One sigma of a crossing that is interpolated within a sample, share of the sample.
const WITHIN_SAMPLE: f64 = 0.35;
/// Steps of the search within a sample.
const FINE: u32 = 20;

/// A rule for begin and end of a pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Ramp of the acceleration drawn back to its level before the pulse; end at the separation. All figures
    /// refer to it.
    Ramp,
    /// 0.8 km/h of delta-V within 20 ms [49 CFR 563.5].
    Cfr563,
    /// 0.5 g from the level beside the pulse, kept for 20 ms.
    HalfG,
}

impl Rule {
    /// Name in `summary.json`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ramp => "ramp",
            Self::Cfr563 => "49-cfr-563",
            Self::HalfG => "half-g",
        }
    }

    /// What it says, for a reader.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Ramp => {
                "Used for every figure here: begins where the rise of the horizontal acceleration, drawn back, leaves its level before the pulse; ends where its fall, seen in axes that do not turn with the car, meets the level that it then keeps, or where the change of velocity is largest if it then swings back"
            }
            Self::Cfr563 => {
                "49 CFR 563.5: begins with the first 20 ms in which the horizontal velocity changes by 0.8 km/h; ends with the first 20 ms after the largest acceleration in which it changes by no more than 0.8 km/h"
            }
            Self::HalfG => {
                "In the manner of ISO/TR 12353\u{2011}3, by a fixed level (not one of its methods A to C): begins where the horizontal acceleration departs from its level before the pulse by 0.5 g and stays beyond for 20 ms; ends where it comes back to within 0.5 g of its level after the pulse and stays within for 20 ms"
            }
        }
    }
}

/// Begin and end after one rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PulseTimes {
    /// The rule.
    pub rule: Rule,
    /// Begin, seconds from the trigger; `None` where the rule finds none.
    pub begin_t_s: Option<Figure>,
    /// End, seconds from the trigger.
    pub end_t_s: Option<Figure>,
}

/// Times of one pulse after every rule.
#[must_use]
pub(crate) fn all(evidence: &Evidence<'_>, pulse: &Pulse) -> Vec<PulseTimes> {
    let q = evidence.quantile;
    let (cfr, half) = (cfr(evidence, pulse), half_g(evidence, pulse));
    vec![
        PulseTimes {
            rule: Rule::Ramp,
            begin_t_s: Some(Figure::new(pulse.onset_s, pulse.onset_sd_s, q)),
            end_t_s: Some(Figure::new(pulse.end_s, pulse.end_sd_s, q)),
        },
        PulseTimes {
            rule: Rule::Cfr563,
            begin_t_s: cfr[0],
            end_t_s: cfr[1],
        },
        PulseTimes {
            rule: Rule::HalfG,
            begin_t_s: half[0],
            end_t_s: half[1],
        },
    ]
}

/// One sigma of the end of a pulse: how far apart the rules put it. A pulse that fades has no sharper end.
#[must_use]
pub(crate) fn end_doubt(times: &[PulseTimes]) -> f64 {
    let ends = || times.iter().filter_map(|t| t.end_t_s).map(|f| f.value);
    let (low, high) = (
        ends().fold(f64::INFINITY, f64::min),
        ends().fold(f64::NEG_INFINITY, f64::max),
    );
    if high > low { 0.5 * (high - low) } else { 0.0 }
}

/// First and one-past-last epoch looked at, and the one of the largest acceleration.
fn stretch(evidence: &Evidence<'_>, pulse: &Pulse) -> (usize, usize, usize) {
    let list = &evidence.epochs.list;
    let from = list.partition_point(|e| e.t_s < pulse.onset_s - REACH_S);
    let to = list.partition_point(|e| e.t_s <= pulse.end_s + REACH_S);
    let size = |k: &usize| evidence.motion.accel[*k].xy().norm();
    let top = (pulse.first..=pulse.last)
        .max_by(|a, b| size(a).total_cmp(&size(b)))
        .unwrap_or(pulse.first);
    (from, to, top)
}

/// Velocity changes by straight lines within a sample; the window slides over them.
fn cfr(evidence: &Evidence<'_>, pulse: &Pulse) -> [Option<Figure>; 2] {
    let list = &evidence.epochs.list;
    let (from, to, top) = stretch(evidence, pulse);
    let mut sum = Vector3::zeros();
    let mut nodes = vec![(list[from].t_s - list[from].dt, sum)];
    for (epoch, accel) in list[from..to].iter().zip(&evidence.motion.accel[from..to]) {
        sum += accel * epoch.dt;
        nodes.push((epoch.t_s, sum));
    }
    let velocity = |t: f64| -> Vector3<f64> {
        let i = nodes.partition_point(|n| n.0 < t).clamp(1, nodes.len() - 1);
        let ((t0, v0), (t1, v1)) = (nodes[i - 1], nodes[i]);
        v0 + (v1 - v0) * ((t - t0) / (t1 - t0)).clamp(0.0, 1.0)
    };
    let change = |t: f64| (velocity(t + CFR_WINDOW_S) - velocity(t)).xy().norm();
    let step = list[pulse.before].dt / f64::from(FINE);
    let (first, end) = (nodes[0].0, nodes[nodes.len() - 1].0 - CFR_WINDOW_S);
    let times = |from: f64| {
        let count = schema::num::round_usize(((end - from) / step).max(0.0).floor());
        (0..count).map(move |i| from + schema::num::real(i) * step)
    };
    let over = |t: &f64| change(*t) > CFR_DELTA_V;
    // A pulse on top of hard braking begins where the window passes 0.8 km/h for the last time before its top.
    let begin = {
        let peak = list[top].t_s - list[top].dt;
        let last_below = times(first)
            .take_while(|t| *t < peak)
            .filter(|t| !over(t))
            .last();
        last_below.map(|t| t + step)
    };
    let finish = times(list[top].t_s)
        .find(|t| !over(t))
        .map(|t| t + CFR_WINDOW_S);
    let imu = &evidence.epochs.header.imu;
    let noise = (imu.accel_density.powi(2) + imu.accel_vibration.powi(2) * 0.01) * CFR_WINDOW_S;
    let figure = |t: f64, at: f64| {
        let slope = (change(at + 2.0 * step) - change(at - 2.0 * step)).abs() / (4.0 * step);
        let dt = list[pulse.before].dt;
        let blur = (noise.sqrt() / slope.max(0.1)).min(CFR_WINDOW_S);
        Figure::new(t, (WITHIN_SAMPLE * dt).hypot(blur), evidence.quantile)
    };
    [
        begin.map(|t| figure(t, t)),
        finish.map(|t| figure(t, t - CFR_WINDOW_S)),
    ]
}

fn half_g(evidence: &Evidence<'_>, pulse: &Pulse) -> [Option<Figure>; 2] {
    let list = &evidence.epochs.list;
    let (from, to, top) = stretch(evidence, pulse);
    let away = |k: usize, level: &Vector3<f64>| (evidence.motion.accel[k] - level).xy().norm();
    let middle = |k: usize| list[k].t_s - 0.5 * list[k].dt;
    // Straight lines between the middles of two samples.
    let crossing = |a: usize, b: usize, level: &Vector3<f64>| {
        let (x, y) = (away(a, level), away(b, level));
        let share = if (y - x).abs() > 1e-9 {
            ((HALF_G - x) / (y - x)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let sd = WITHIN_SAMPLE * list[b].dt;
        Figure::new(
            middle(a) + share * (middle(b) - middle(a)),
            sd,
            evidence.quantile,
        )
    };
    let begin = (from + 1..=top)
        .find(|&k| {
            (k..to)
                .take_while(|&i| list[i].t_s - list[k].t_s < KEPT_S - 1e-6)
                .all(|i| away(i, &pulse.base) > HALF_G)
        })
        .map(|k| crossing(k - 1, k, &pulse.base));
    let end = (top + 1..to)
        .find(|&k| {
            (k..to)
                .take_while(|&i| list[i].t_s - list[k].t_s < KEPT_S - 1e-6)
                .all(|i| away(i, &pulse.level) < HALF_G)
        })
        .map(|k| crossing(k - 1, k, &pulse.level));
    [begin, end]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::epochs::Epochs;
    use crate::motion::Motion;
    use crate::simulate::{Class, Scenario};
    use schema::Sample;
    use schema::num::{real, u64_of};

    /// A half sine of 200 m/s^2 over 100 ms on 8 m/s^2 of braking, seen as 10 ms means: the analytic times.
    #[test]
    fn rules_meet_a_half_sine() {
        let (top, length, braking) = (200.0, 0.1, -8.0);
        let scenario = Scenario::draw(Class::Frontal, 1);
        let sample = Sample {
            accel: [Some(0.0), Some(0.0), Some(-9.81)],
            rate: [Some(0.0); 3],
            wheels: [None; 2],
        };
        let samples: Vec<_> = (0..200).map(|k| (u64_of(k), 100, sample)).collect();
        for shift in [0.0, 0.002, 0.005, 0.0085] {
            let begin = 1.0 + shift;
            let epochs = Epochs::from_samples(scenario.header(), &samples, 0.0, &[]).unwrap();
            let pi = std::f64::consts::PI;
            let velocity = |t: f64| {
                let x = ((t - begin) / length).clamp(0.0, 1.0);
                -top * length / pi * (1.0 - (pi * x).cos()) + braking * t.min(begin)
            };
            let accel: Vec<Vector3<f64>> = epochs
                .list
                .iter()
                .map(|e| Vector3::x() * ((velocity(e.t_s) - velocity(e.t_s - e.dt)) / e.dt))
                .collect();
            let motion = Motion {
                rate_doubt: Vec::new(),
                smooth: accel.clone(),
                rate: vec![Vector3::zeros(); 200],
                impacts: Vec::new(),
                wheels_bad: vec![false; 200],
                after_impact: vec![false; 200],
                accel,
            };
            let pulse = Pulse {
                first: 100,
                last: 109,
                onset_s: begin,
                onset_sd_s: 0.0035,
                before: 99,
                end_s: begin + length,
                end_sd_s: 0.005,
                base: Vector3::x() * braking,
                level: Vector3::zeros(),
            };
            let evidence = Evidence {
                epochs: &epochs,
                motion: &motion,
                snapshots: &[],
                quantile: 1.96,
                joint: &[],
                wheels_only: false,
            };
            // The first 20 ms with 0.8 km/h, by bisection on the analytic velocity.
            let window = |t: f64| (velocity(t + CFR_WINDOW_S) - velocity(t)).abs();
            let (mut low, mut high) = (begin - 0.02, begin + 0.03);
            for _ in 0..60 {
                let mid = 0.5 * (low + high);
                if window(mid) > CFR_DELTA_V {
                    high = mid;
                } else {
                    low = mid;
                }
            }
            let found = all(&evidence, &pulse);
            let near = |f: Option<Figure>, t: f64| {
                let f = f.unwrap();
                assert!(f.low < t && t < f.high, "{shift}: {f:?} {t}");
                assert!(f.sd < 0.012);
            };
            near(found[1].begin_t_s, high);
            // 200 sin(pi x) = 4.9 less the braking that ends at the begin: 2.0 ms and 99.2 ms.
            let crossing = |a: f64| (a / top).asin() / pi * length;
            near(
                found[2].begin_t_s,
                begin + crossing(HALF_G - braking).min(0.0064),
            );
            near(found[2].end_t_s, begin + length - crossing(HALF_G));
            assert!(real(found.len()) > 2.5 && end_doubt(&found) < 0.01);
        }
    }
}
