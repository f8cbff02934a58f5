//! Our GNSS filter where the receiver is not what it says: wild fixes, noise, streets that push it aside, velocities of
//! another car. Simulated town drives whose seeds no figure was chosen on (those used 1 to 20).
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use reconstruct::gnss::drive::Drive;
use reconstruct::gnss::experiments::drive;
use reconstruct::gnss::forward::{self, FixUse, Start};
use reconstruct::gnss::sheet::Sheet;
use reconstruct::gnss::stop::Detector;
use reconstruct::gnss::trial::{ours_smoothed, standing};
use reconstruct::simulate::city::{self, BoxSheet, IMU_HZ};
use reconstruct::validate::workers;
use schema::num::{real, real_u64};

const SEEDS: std::ops::RangeInclusive<u64> = 90_011..=90_020;

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    /// One fix of ten is 30 to 150 m off.
    Wild,
    /// Places and velocities are three times as noisy as stated.
    Noisy,
    /// Between 60 and 90 s every fix is pushed 30 m aside.
    Pushed,
    /// One velocity of ten is another one.
    Velocities,
    /// No fix from 60 to 100 s, and the first three after that are 40 m off.
    Tunnel,
}

impl Fault {
    const ALL: [Self; 6] = [
        Self::None,
        Self::Wild,
        Self::Noisy,
        Self::Pushed,
        Self::Velocities,
        Self::Tunnel,
    ];

    fn put(self, drive: &mut Drive, seed: u64) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = {
            let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0xfa17);
            move || -> f64 { StandardNormal.sample(&mut random) }
        };
        let aside = |angle: f64, by: f64| Vector3::new(by * angle.cos(), by * angle.sin(), 0.0);
        let way = random.random_range(0.0..TAU);
        if self == Self::Tunnel {
            drive.fixes.retain(|f| !(60.0..100.0).contains(&f.t_s));
        }
        for fix in &mut drive.fixes {
            match self {
                Self::Wild if random.random_bool(0.1) => {
                    let (angle, by) = (
                        random.random_range(0.0..TAU),
                        random.random_range(30.0..150.0),
                    );
                    fix.place = fix.place.moved(&aside(angle, by));
                }
                Self::Noisy => {
                    let extra = 8_f64.sqrt();
                    let off = fix.place_sd.map(|sd| sd * extra * normal());
                    fix.place = fix.place.moved(&off);
                    let off = fix.v_sd.map(|sd| sd * extra * normal());
                    fix.v_n = fix.v_n.map(|v| v + off);
                }
                Self::Pushed if (60.0..90.0).contains(&fix.t_s) => {
                    fix.place = fix.place.moved(&aside(way, 30.0));
                }
                Self::Velocities if random.random_bool(0.1) => {
                    let other = aside(
                        random.random_range(0.0..TAU),
                        random.random_range(0.0..20.0),
                    );
                    fix.v_n = fix.v_n.map(|_| other);
                }
                Self::Tunnel if (100.0..103.0).contains(&fix.t_s) => {
                    fix.place = fix.place.moved(&aside(way, 40.0));
                }
                _ => {}
            }
        }
    }
}

/// Of each track, running and smoothed: mean deviation, m, and share inside the 95 % ellipse; fixes refused and forced.
fn one(seed: u64, fault: Fault) -> ([[f64; 2]; 2], FixUse) {
    let sheet = BoxSheet::default();
    let city = city::drive(seed, 200.0, &sheet).unwrap();
    let mut whole = drive(&city, &sheet).unwrap();
    fault.put(&mut whole, seed);
    let known = Sheet::default().heard(&whole, &Detector::default().detect(&whole));
    let (passed, later) = ours_smoothed(&whole, &known, None).unwrap();
    let tracks = [passed.estimates, later];
    let of = tracks.map(|track| {
        let (mut off, mut inside, mut n) = (0.0, 0.0, 0.0);
        for (e, truth) in track
            .iter()
            .zip(&city.truth[passed.first..])
            .skip(500)
            .step_by(50)
        {
            let d = truth.place.to(&e.place).xy();
            off += d.norm();
            inside += f64::from(u8::from(e.holds(&d, 0.95)));
            n += 1.0;
        }
        [off / n, inside / n]
    });
    (of, passed.fixes)
}

#[test]
fn faults_of_the_receiver_are_survived_and_bounded() {
    let seeds: Vec<u64> = SEEDS.collect();
    let threads = std::thread::available_parallelism().map_or(2, usize::from);
    for fault in Fault::ALL {
        let all = workers::run(&seeds, threads, |seed| one(*seed, fault), |_| ());
        let mean = |track: usize, what: usize| {
            all.iter().map(|o| o.0[track][what]).sum::<f64>() / real(all.len())
        };
        let least = all
            .iter()
            .map(|o| o.0[0][1].min(o.0[1][1]))
            .fold(1.0, f64::min);
        let count = |f: fn(&FixUse) -> u64| all.iter().map(|o| real_u64(f(&o.1))).sum::<f64>();
        println!(
            "{fault:?}: running {:.1} m, inside {:.3}; smoothed {:.1} m, inside {:.3} (worst drive {least:.2}); of {} fixes {} refused, {} forced; velocities {} and {}",
            mean(0, 0),
            mean(0, 1),
            mean(1, 0),
            mean(1, 1),
            count(|u| u.offered),
            count(|u| u.refused),
            count(|u| u.forced),
            count(|u| u.speeds_refused),
            count(|u| u.speeds_forced),
        );
        // Found on seeds 1 to 20: running 3.0 to 5.0 m, inside 0.90 to 0.98; smoothed 2.4 to 3.7 m, 0.89 to 0.98.
        assert!(mean(0, 0) < 7.0 && mean(1, 0) < mean(0, 0), "{fault:?}");
        assert!(mean(0, 1) > 0.85 && mean(1, 1) > 0.85, "{fault:?}");
    }
}

/// A filter that begins with the velocity and heading of another car is told so by the fixes, and comes back.
#[test]
fn a_wrong_start_is_come_back_from() {
    let sheet = BoxSheet::default();
    for seed in SEEDS {
        let city = city::drive(seed, 200.0, &sheet).unwrap();
        let whole = drive(&city, &sheet).unwrap();
        let standing = standing(&whole);
        let known = Sheet::default().heard(&whole, &Detector::default().detect(&whole));
        let mut start = Start::at_first_course(&whole, &standing).unwrap();
        start.angles[2] += 1.5;
        start.v_n = Vector3::new(start.v_n.y, -start.v_n.x, 0.0);
        let passed = forward::run(&whole, &standing, &known, &start).unwrap();
        let late = passed.estimates.iter().zip(&city.truth[passed.first..]);
        let off: Vec<f64> = late
            .skip(40 * IMU_HZ)
            .step_by(IMU_HZ)
            .map(|(e, truth)| truth.place.to(&e.place).xy().norm())
            .collect();
        let mean = off.iter().sum::<f64>() / real(off.len());
        println!(
            "seed {seed}: from 40 s on {mean:.1} m off, velocities {} refused, {} forced",
            passed.fixes.speeds_refused, passed.fixes.speeds_forced
        );
        assert!(mean < 10.0, "{mean}");
    }
}
