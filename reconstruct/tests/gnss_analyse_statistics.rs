//! The intervals of `gnss analyse`: do they hold what they say, over many seeds? Tuned on seeds 1 to 40, tested on 90001 and after.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use reconstruct::gnss::analyse::allan::{curve, points};
use reconstruct::gnss::analyse::correlated::{Figure, mean, quantile_of, rms, sd};
use reconstruct::gnss::analyse::spread::{drift, pooled};
use schema::num::real;

struct Noise(ChaCha8Rng);

impl Noise {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    fn white(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.normal()).collect()
    }

    /// Unit variance, correlation `phi` from one to the next.
    fn correlated(&mut self, n: usize, phi: f64) -> Vec<f64> {
        let mut x = self.normal();
        (0..n)
            .map(|_| {
                x = phi * x + (1.0 - phi * phi).sqrt() * self.normal();
                x
            })
            .collect()
    }
}

fn share(hits: usize, of: u64) -> f64 {
    real(hits) / schema::num::real_u64(of)
}

const SEEDS: std::ops::Range<u64> = 90_001..91_001;

#[test]
fn means_of_correlated_samples_hold_their_intervals() {
    let of = SEEDS.end - SEEDS.start;
    // Length, correlation, least share inside: the last is a drive of 200 s with satellite errors of 30 s.
    for (n, phi, least) in [
        (20, 0.0, 0.93),
        (200, 0.0, 0.93),
        (1000, 0.0, 0.93),
        (1000, 0.5, 0.93),
        (1000, 0.9, 0.92),
        (1000, 0.98, 0.87),
        (200, 0.967, 0.75),
    ] {
        let held = |figure: fn(&[f64]) -> Option<Figure>, truth: f64| {
            let inside = SEEDS.filter(|s| {
                let f = figure(&Noise::new(*s).correlated(n, phi)).unwrap();
                f.low <= truth && truth <= f.high
            });
            share(inside.count(), of)
        };
        let found = [
            held(mean, 0.0),
            held(rms, 1.0),
            held(sd, 1.0),
            held(|x| quantile_of(x, 0.5), 0.0),
        ];
        println!(
            "{n} samples, correlation {phi}: inside 95 %: mean {:.3}, rms {:.3}, sd {:.3}, median {:.3}",
            found[0], found[1], found[2], found[3]
        );
        assert!(
            found.iter().take(3).all(|f| *f >= least - 0.04),
            "{found:?}"
        );
        assert!(found[0] >= least, "{found:?}");
    }
    // A series short against its correlation says so.
    let short = Noise::new(1).correlated(200, 0.99);
    assert!(mean(&short).unwrap().short && !mean(&Noise::new(1).white(200)).unwrap().short);
    assert!(mean(&[]).is_none() && mean(&[1.0]).unwrap().se.is_infinite());
}

#[test]
fn variances_hold_their_intervals() {
    let of = SEEDS.end - SEEDS.start;
    for (windows, phi) in [(3, 0.0), (20, 0.0), (20, 0.7), (60, 0.3)] {
        let inside = SEEDS.filter(|seed| {
            let mut noise = Noise::new(*seed);
            let series: Vec<Vec<f64>> = (0..windows).map(|_| noise.correlated(200, phi)).collect();
            let v = pooled(&series).unwrap();
            // The mean of a window takes some of the variance of correlated noise.
            let expected = 1.0 - (1.0 + phi) / (1.0 - phi) / 200.0 + 1.0 / 200.0;
            v.low <= expected && expected <= v.high
        });
        let held = share(inside.count(), of);
        println!("variance of {windows} windows, correlation {phi}: {held:.3} inside 95 %");
        assert!((0.92..=0.985).contains(&held), "{held}");
    }
    assert!(pooled(&[vec![1.0], vec![]]).is_none());
}

#[test]
fn a_drift_is_found_where_there_is_one_only() {
    let stands = |noise: &mut Noise, step: f64| {
        let figures: Vec<Figure> = (0..5)
            .map(|k| {
                let x = noise.correlated(300, 0.2);
                mean(&x.iter().map(|v| v + step * real(k)).collect::<Vec<_>>()).unwrap()
            })
            .collect();
        drift(&figures).unwrap().p
    };
    let of = SEEDS.end - SEEDS.start;
    let alarms = |step: f64, level: f64| {
        share(
            SEEDS
                .filter(|s| stands(&mut Noise::new(*s), step) < level)
                .count(),
            of,
        )
    };
    let (none, small) = (alarms(0.0, 0.05), alarms(0.1, 0.01));
    println!(
        "drift: false at the level 0.05: {none:.3}; found at 0.01, 0.1 sigma a stand: {small:.3}"
    );
    assert!(none < 0.07 && small > 0.6, "{none} {small}");
    let one = mean(&Noise::new(1).white(50)).unwrap();
    assert!(drift(&[one]).is_none());
}

/// The overlapping estimate by its definition: means of `m`, neighbours subtracted, at every start.
fn by_definition(x: &[f64], m: usize) -> f64 {
    let mean = |k: usize| x[k..k + m].iter().sum::<f64>() / real(m);
    let starts = x.len() + 1 - 2 * m;
    let sum: f64 = (0..starts).map(|k| (mean(k + m) - mean(k)).powi(2)).sum();
    (sum / (2.0 * real(starts))).sqrt()
}

#[test]
fn allan_deviation_meets_its_definition_and_known_noise() {
    let x = Noise::new(5).correlated(700, 0.4);
    for p in points(std::slice::from_ref(&x), 0.02) {
        let m = schema::num::round_usize(p.tau_s / 0.02);
        assert!((p.deviation / by_definition(&x, m) - 1.0).abs() < 1e-9);
        assert!(p.band[0] < p.deviation && p.deviation < p.band[1]);
    }
    // Bands against white noise (sigma/sqrt(m)) and random walk (sigma sqrt((2 m^2 + 1) / (6 m)) of its steps, at every octave).
    let seeds = 90_001..90_401_u64;
    for walk in [false, true] {
        let mut held = [[0; 2]; 12];
        for seed in seeds.clone() {
            let mut x = Noise::new(seed).white(2000);
            if walk {
                let mut sum = 0.0;
                for v in &mut x {
                    sum += *v;
                    *v = sum;
                }
            }
            for (i, p) in points(&[x], 1.0).iter().enumerate() {
                let m = p.tau_s;
                let truth = if walk {
                    ((2.0 * m * m + 1.0) / (6.0 * m)).sqrt()
                } else {
                    1.0 / m.sqrt()
                };
                held[i][0] += usize::from(p.band[0] <= truth && truth <= p.band[1]);
                held[i][1] += 1;
            }
        }
        // The last octave is shown only where its slope leaves it enough degrees of freedom.
        let often = held.iter().filter(|h| h[1] > 300);
        let shares: Vec<f64> = often.map(|h| real(h[0]) / real(h[1])).collect();
        println!("Allan, walk {walk}: inside the band of 95 % by octave: {shares:.3?}");
        assert!(
            shares.len() >= 9 && shares.iter().all(|s| *s > 0.90),
            "{shares:?}"
        );
    }
}

#[test]
fn white_noise_floor_and_walk_are_read_off() {
    let seeds = 90_001..90_201_u64;
    let of = seeds.end - seeds.start;
    let (mut white, mut walked, mut seen) = ([0; 2], 0, 0);
    let mut false_walk = 0;
    let (mut floors, mut floor_seen) = (0, 0);
    for seed in seeds {
        let mut noise = Noise::new(seed);
        // 50 Hz, two spans of 60 and 120 s: N = 0.01 a root of Hz.
        let spans: Vec<Vec<f64>> = [3000, 6000]
            .iter()
            .map(|n| {
                let x = noise.white(*n);
                x.iter().map(|v| 0.01 * 50.0_f64.sqrt() * v).collect()
            })
            .collect();
        let c = curve(&spans, 0.02);
        let n = c.white.unwrap();
        white[0] += usize::from(n.low <= 0.01 && 0.01 <= n.high);
        false_walk += usize::from(c.walk.is_ok());
        floor_seen += usize::from(c.floor.is_ok());
        // With a random walk of K = 0.02 a root of s.
        let walking: Vec<Vec<f64>> = spans
            .iter()
            .map(|x| {
                let mut sum = 0.0;
                x.iter()
                    .map(|v| {
                        sum += 0.02 * 0.02_f64.sqrt() * noise.normal();
                        v + sum
                    })
                    .collect()
            })
            .collect();
        let c = curve(&walking, 0.02);
        if let Ok(n) = c.white {
            white[1] += usize::from(n.low <= 0.01 && 0.01 <= n.high);
        }
        if let Ok(k) = c.walk {
            seen += 1;
            walked += usize::from(k.low <= 0.02 && 0.02 <= k.high);
        }
        floors += usize::from(c.floor.is_ok());
    }
    println!(
        "white noise inside 95 %: {:.3}, beside a walk {:.3}; walk seen {:.3}, inside {:.3}; seen without one {:.3}, floor without one {:.3}, with walk {:.3}",
        share(white[0], of),
        share(white[1], of),
        share(seen, of),
        real(walked) / real(seen.max(1)),
        share(false_walk, of),
        share(floor_seen, of),
        share(floors, of)
    );
    assert!(share(white[0], of) >= 0.93);
    assert!(share(seen, of) > 0.9 && real(walked) / real(seen) > 0.85);
    assert!(share(false_walk, of) < 0.03);
    // Too short a span tells nothing.
    let short = curve(&[vec![0.1, 0.2, 0.1]], 0.02);
    assert!(short.white.is_err() && short.floor.is_err() && short.walk.is_err());
}
