//! Variance of gyro and accelerometer by situation [S00, tables 4.4 and 4.5], and gyro bias at stands [S00, table 4.6].
//!
//! The variance is that about the mean of windows of 4 s, the length of S00's spans, pooled over all windows. Its interval is that of a
//! chi-square with an effective number of degrees of freedom: the least of what Gaussian noise with the autocorrelation of
//! the samples leaves, `N / (1 + 2 sum rho^2)`, and, of eight windows or more, of what the scatter of the windows' own variances
//! allows (`2 m^2 / se^2` with the standard error of [`super::correlated::mean`]).
//!
//! The bias of a stand is its mean, with the standard error of [`super::correlated::mean`]. Whether stands differ by more than that
//! explains is Welch's test of equal means with unequal variances (1951).

use schema::num::{real, round_usize};

use super::correlated::{Figure, mean};
use super::distribution::{f_tail, variance_interval};
use super::spans::{Sample, Situation, Spans};
use crate::gnss::rows::Leg;

/// Length of a window, s.
pub const WINDOW_S: f64 = 4.0;
/// A window whose mean rate of turn is less than this in each of its quarters drives straight ahead, rad/s.
const STRAIGHT: f64 = 0.02;
/// Windows from which their scatter tells.
const SCATTERED: usize = 8;

/// A variance with its interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variance {
    /// Estimate, the unit squared.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Effective degrees of freedom.
    pub dof: f64,
    /// Samples.
    pub samples: usize,
    /// Windows.
    pub windows: usize,
}

/// Variances in one situation.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// Situation.
    pub situation: Situation,
    /// Specific force x, y, z, (m/s^2)^2, then rate x, y, z, (rad/s)^2, the sensor's axes; `None`: no window.
    pub axis: Option<[Variance; 6]>,
}

/// Pooled variance of windows about their own means; `None` if no window has two samples.
#[must_use]
pub fn pooled(windows: &[Vec<f64>]) -> Option<Variance> {
    let (mut squares, mut free, mut samples) = (0.0, 0.0, 0);
    let mut each = Vec::with_capacity(windows.len());
    let mut lags: Vec<f64> = Vec::new();
    for window in windows.iter().filter(|w| w.len() > 1) {
        let n = real(window.len());
        let centre = window.iter().sum::<f64>() / n;
        let off: Vec<f64> = window.iter().map(|v| v - centre).collect();
        let sum: f64 = off.iter().map(|v| v * v).sum();
        squares += sum;
        free += n - 1.0;
        samples += window.len();
        each.push(sum / (n - 1.0));
        lags.resize(lags.len().max(window.len() / 4), 0.0);
        for (k, lag) in lags.iter_mut().enumerate().take(window.len() / 4) {
            *lag += off
                .iter()
                .zip(&off[k + 1..])
                .map(|(a, b)| a * b)
                .sum::<f64>();
        }
    }
    if free <= 0.0 {
        return None;
    }
    let value = squares / free;
    let noise = 2.0 / real(samples).sqrt();
    let rho = |lag: &&f64| squares > 0.0 && (**lag / squares).abs() > noise;
    let memory: f64 = lags
        .iter()
        .filter(rho)
        .map(|lag| (lag / squares).powi(2))
        .sum();
    let mut dof = free / (1.0 + 2.0 * memory);
    if each.len() >= SCATTERED
        && let Some(scatter) = mean(&each)
        && scatter.se > 0.0
    {
        dof = dof.min(2.0 * (scatter.value / scatter.se).powi(2));
    }
    let dof = dof.max(0.1);
    let [low, high] = variance_interval(value, dof);
    Some(Variance {
        value,
        low,
        high,
        dof,
        samples,
        windows: each.len(),
    })
}

/// Variances in all situations.
#[must_use]
pub fn spreads(spans: &Spans) -> Vec<Spread> {
    let turn = turn_at_stands(spans);
    let mut windows: Vec<(Situation, &[Sample])> = Vec::new();
    for stand in &spans.stands {
        let period = spans
            .stretches
            .get(stand.stretch)
            .map_or(0.02, |s| s.period_s);
        let own = spans.of(stand);
        let length = round_usize(WINDOW_S / period).clamp(10, own.len().max(10));
        windows.extend(own.chunks_exact(length).map(|w| (stand.situation, w)));
    }
    for stretch in &spans.stretches {
        let length = round_usize(WINDOW_S / stretch.period_s).max(10);
        for run in stretch
            .samples
            .chunk_by(|a, b| a.driving == b.driving && !b.gap)
        {
            for window in run.chunks_exact(length).filter(|w| w[0].driving) {
                windows.push((Situation::Driving, window));
                let mean = |part: &[Sample]| {
                    part.iter().map(|s| s.turn - turn).sum::<f64>() / real(part.len())
                };
                let quarter = (length / 4).max(1);
                if window.chunks(quarter).all(|p| mean(p).abs() < STRAIGHT) {
                    windows.push((Situation::Straight, window));
                }
            }
        }
    }
    let of = |situation: Situation, axis: usize| -> Option<Variance> {
        let series: Vec<Vec<f64>> = windows
            .iter()
            .filter(|w| w.0 == situation)
            .map(|w| w.1.iter().map(|s| s.axis[axis]).collect())
            .collect();
        pooled(&series)
    };
    let every = |situation| {
        Some([
            of(situation, 0)?,
            of(situation, 1)?,
            of(situation, 2)?,
            of(situation, 3)?,
            of(situation, 4)?,
            of(situation, 5)?,
        ])
    };
    Situation::ALL
        .into_iter()
        .map(|situation| Spread {
            situation,
            axis: every(situation),
        })
        .collect()
}

/// Mean rate of turn at the stands: the bias about the car's down axis, rad/s; 0 where there are none.
fn turn_at_stands(spans: &Spans) -> f64 {
    let still = || {
        let stands = spans.stands.iter();
        stands.flat_map(|s| spans.of(s)).map(|s| s.turn)
    };
    still().sum::<f64>() / real(still().count().max(1))
}

/// Means of a stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Bias {
    /// Leg.
    pub leg: Leg,
    /// Begin and end, s of the box's clock.
    pub span_s: [f64; 2],
    /// Rest or stop.
    pub situation: Situation,
    /// Rate x, y, z, the sensor's axes, rad/s.
    pub rate: [Figure; 3],
}

/// Whether the biases of one axis differ by more than their errors explain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Largest less smallest bias, rad/s.
    pub range: f64,
    /// Standard error of that difference, rad/s.
    pub range_se: f64,
    /// Welch's F and its degrees of freedom.
    pub f: [f64; 3],
    /// Probability of so large an F if all stands had one bias.
    pub p: f64,
}

/// Biases at all stands, in order.
#[must_use]
pub fn biases(spans: &Spans) -> Vec<Bias> {
    let figure = |samples: &[Sample], axis: usize| {
        mean(&samples.iter().map(|s| s.axis[axis]).collect::<Vec<f64>>())
    };
    let one = |stand: &super::spans::Stand| {
        let own = spans.of(stand);
        Some(Bias {
            leg: spans.stretches.get(stand.stretch)?.leg,
            span_s: [stand.from_s, stand.to_s],
            situation: stand.situation,
            rate: [figure(own, 3)?, figure(own, 4)?, figure(own, 5)?],
        })
    };
    spans.stands.iter().filter_map(one).collect()
}

/// Welch's test over the stands' biases of one axis; `None` of fewer than two stands.
#[must_use]
pub fn drift(figures: &[Figure]) -> Option<Drift> {
    let known: Vec<&Figure> = figures
        .iter()
        .filter(|f| f.se > 0.0 && f.se.is_finite())
        .collect();
    if known.len() < 2 {
        return None;
    }
    let k = real(known.len());
    let weight = |f: &Figure| 1.0 / (f.se * f.se);
    let all: f64 = known.iter().map(|f| weight(f)).sum();
    let centre = known.iter().map(|f| weight(f) * f.value).sum::<f64>() / all;
    let between: f64 = known
        .iter()
        .map(|f| weight(f) * (f.value - centre).powi(2))
        .sum::<f64>()
        / (k - 1.0);
    let lambda: f64 = known
        .iter()
        .map(|f| (1.0 - weight(f) / all).powi(2) / f.dof.max(1.0))
        .sum();
    let statistic = between / (1.0 + 2.0 * (k - 2.0) / (k * k - 1.0) * lambda);
    let d2 = (k * k - 1.0) / (3.0 * lambda.max(1e-12));
    let least = known.iter().min_by(|a, b| a.value.total_cmp(&b.value))?;
    let most = known.iter().max_by(|a, b| a.value.total_cmp(&b.value))?;
    Some(Drift {
        range: most.value - least.value,
        range_se: most.se.hypot(least.se),
        f: [statistic, k - 1.0, d2],
        p: f_tail(statistic, k - 1.0, d2),
    })
}
