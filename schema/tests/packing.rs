//! The scales and the error feedback: what packing to ten bits costs, and that it costs no sum.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schema::sample::{FIELDS, MISSING};
use schema::scale::{TwoSlope, WheelScale};
use schema::units::STANDARD_GRAVITY;
use schema::{Codes, Packer, Sample, Scales, Thinner, unpack};

fn packer() -> Packer {
    let Scales { wheel, accel, rate } = Scales::default();
    Packer::new(wheel, accel, rate)
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs().max(1.0)
}

#[test]
fn the_default_scales_lie_where_the_design_says() {
    let accel = TwoSlope::accel_default();
    assert_eq!(accel.value(511), Some(0.0));
    assert!(near(accel.value(1022).unwrap(), 80.0 * STANDARD_GRAVITY));
    assert!(near(accel.value(0).unwrap(), -80.0 * STANDARD_GRAVITY));
    assert!(near(accel.value(511 + 400).unwrap(), 20.0));
    assert!(near(accel.value(512).unwrap(), 0.05));
    assert_eq!(accel.value(MISSING), None);
    assert_eq!(accel.value(u16::MAX), None);
    assert!(
        near(accel.step_at(-19.9), 0.05)
            && near(
                accel.step_at(20.1),
                (80.0 * STANDARD_GRAVITY - 20.0) / 111.0
            )
    );

    let rate = TwoSlope::rate_default();
    assert!(near(rate.value(1022).unwrap(), 1000_f64.to_radians()));
    assert!(near(rate.value(511 - 400).unwrap(), -50_f64.to_radians()));
    assert!(near(rate.value(510).unwrap(), -0.125_f64.to_radians()));

    let wheel = WheelScale::default_kmh();
    assert!(near(wheel.top() * 3.6, 255.5));
    assert!(near(wheel.value(4).unwrap() * 3.6, 1.0));
    assert_eq!(wheel.value(MISSING), None);
}

#[test]
fn what_is_no_number_or_beyond_the_top_is_told() {
    let (accel, wheel) = (TwoSlope::accel_default(), WheelScale::default_kmh());
    assert_eq!(
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300].map(|x| accel.nearest(x)),
        [MISSING, 1022, 0, 1022]
    );
    assert_eq!(
        [f64::NAN, f64::INFINITY, -1.0, 0.0].map(|x| wheel.nearest(x)),
        [MISSING, 1022, 0, 0]
    );
    let mut packer = packer();
    let codes = packer.pack(&Sample {
        wheels: [Some(f64::NAN), None],
        accel: [Some(f64::INFINITY), Some(f64::NAN), None],
        rate: [Some(f64::NEG_INFINITY), None, Some(0.0)],
    });
    assert_eq!(
        codes.0,
        [MISSING, MISSING, 1022, MISSING, MISSING, 0, MISSING, 511]
    );
    assert!(packer.carry().iter().all(|carry| carry.is_finite()));
}

#[test]
fn every_code_is_nearest_to_its_own_value() {
    let Scales { wheel, accel, rate } = Scales::default();
    for code in 0..MISSING {
        assert_eq!(accel.nearest(accel.value(code).unwrap()), code);
        assert_eq!(rate.nearest(rate.value(code).unwrap()), code);
        assert_eq!(wheel.nearest(wheel.value(code).unwrap()), code);
    }
}

#[test]
fn what_saturation_cuts_off_does_not_wind_up() {
    let accel = TwoSlope::accel_default();
    let mut packer = packer();
    let mut x = |value| {
        let sample = Sample {
            accel: [Some(value), None, None],
            ..Sample::default()
        };
        accel.value(packer.pack(&sample).0[2]).unwrap()
    };
    for _ in 0..20 {
        assert!(near(x(2000.0), accel.top()));
    }
    // Half a coarse step is left of 24,000 m/s^2 samples that were cut off; the next sample takes it.
    let after: f64 = (0..5).map(|_| x(1.0)).sum();
    assert!(
        (after - 5.0 - accel.coarse_step / 2.0).abs() <= accel.fine_step / 2.0 + 1e-9,
        "{after}"
    );
}

#[test]
fn a_missing_sample_leaves_the_carry() {
    let mut packer = packer();
    let at = |x: Option<f64>| Sample {
        accel: [x, None, None],
        ..Sample::default()
    };
    packer.pack(&at(Some(0.02)));
    let carried = packer.carry();
    assert!(near(carried[2], 0.02));
    assert_eq!(packer.pack(&at(None)), Codes::default());
    assert_eq!(packer.carry().map(f64::to_bits), carried.map(f64::to_bits));
    packer.reset();
    assert_eq!(packer.carry().map(f64::to_bits), [0; FIELDS]);
}

#[test]
fn a_standing_wheel_is_stored_as_zero() {
    let mut packer = packer();
    let at = |v: f64| Sample {
        wheels: [Some(v), Some(v)],
        ..Sample::default()
    };
    packer.pack(&at(10.0 + 0.125 / 3.6));
    for _ in 0..10 {
        assert_eq!(packer.pack(&at(0.0)).0[..2], [0, 0]);
    }
}

#[test]
fn thinning_averages_what_is_there() {
    let scales = Scales::default();
    let at = |x: Option<f64>, y: Option<f64>| Sample {
        accel: [x, y, None],
        ..Sample::default()
    };
    let five = [
        at(Some(1.0), None),
        at(None, None),
        at(Some(2.0), None),
        at(None, None),
        at(Some(6.0), None),
    ];
    let mut thinner = Thinner::new(scales.wheel, scales.accel, scales.rate);
    let thin = unpack(&thinner.thin(&five), &scales);
    assert!(near(thin.accel[0].unwrap(), 3.0));
    assert_eq!(
        (thin.accel[1], thin.accel[2], thin.wheels),
        (None, None, [None; 2])
    );
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn codes_survive_their_bytes(codes in prop::array::uniform8(0_u16..1024)) {
        prop_assert_eq!(Codes::from_bytes(&Codes(codes).to_bytes()), Codes(codes));
    }

    #[test]
    fn bytes_survive_their_codes(bytes in prop::array::uniform10(0_u8..)) {
        prop_assert_eq!(Codes::from_bytes(&bytes).to_bytes(), bytes);
    }

    #[test]
    fn the_nearest_code_is_within_half_a_step(value in -784.0_f64..784.0) {
        let accel = TwoSlope::accel_default();
        let stored = accel.value(accel.nearest(value)).unwrap();
        prop_assert!((stored - value).abs() <= accel.step_at(value) / 2.0 + 1e-9);
    }

    /// The running sum is within half a step of one sample of the input at every sample, gaps or not.
    #[test]
    fn running_sums_are_exact(
        values in prop::collection::vec(prop::option::weighted(0.9, -700.0_f64..700.0), 1..400),
        fine in prop::bool::ANY,
    ) {
        let (accel, mut packer) = (TwoSlope::accel_default(), packer());
        let (mut wanted, mut stored) = (0.0, 0.0);
        for value in values {
            let value = value.map(|value| if fine { value / 40.0 } else { value });
            let codes = packer.pack(&Sample { accel: [None, value, None], ..Sample::default() });
            let Some(value) = value else {
                prop_assert_eq!(codes.0[3], MISSING);
                continue;
            };
            let unpacked = accel.value(codes.0[3]).unwrap();
            wanted += value;
            stored += unpacked;
            let step = if fine { accel.fine_step } else { accel.coarse_step };
            prop_assert!((wanted - stored).abs() <= step / 2.0 + 1e-6, "{} {}", wanted, stored);
        }
    }

    /// The sums of the thinned samples are those of the full ones, to half a step.
    #[test]
    fn thinned_sums_are_exact(values in prop::collection::vec(-15.0_f64..15.0, 100)) {
        let scales = Scales::default();
        let mut thinner = Thinner::new(scales.wheel, scales.accel, scales.rate);
        let samples: Vec<_> = values.iter().map(|&x| Sample { accel: [None, None, Some(x)], ..Sample::default() }).collect();
        let thin: f64 = samples.chunks(5).map(|five| unpack(&thinner.thin(five), &scales).accel[2].unwrap() * 5.0).sum();
        prop_assert!((thin - values.iter().sum::<f64>()).abs() <= 5.0 * 0.025 + 1e-9);
    }
}

/// Normal deviates by the sum of twelve uniform ones.
fn normal(rng: &mut ChaCha8Rng, sd: f64) -> f64 {
    sd * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)
}

/// Delta-v over 40 s of simulated driving with a pulse, the carry reset at each second: the error in m/s.
fn delta_v_error(seed: u64, feedback: bool) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (accel, mut packer) = (TwoSlope::accel_default(), packer());
    let (slow, bias) = (rng.random_range(0.02..0.5), normal(&mut rng, 0.5));
    let mut error = 0.0;
    for k in 0..4000_u32 {
        let t = f64::from(k) * 0.01;
        let pulse = if (3000..3010).contains(&k) {
            -250.0
        } else {
            0.0
        };
        let value = bias + 2.0 * (slow * t).sin() + pulse + normal(&mut rng, 0.05);
        if k.is_multiple_of(100) || !feedback {
            packer.reset();
        }
        let codes = packer.pack(&Sample {
            accel: [Some(value), None, None],
            ..Sample::default()
        });
        error += (accel.value(codes.0[2]).unwrap() - value) * 0.01;
    }
    error
}

#[test]
fn packing_costs_no_delta_v() {
    let errors = |feedback| (0..200).map(move |seed| delta_v_error(seed, feedback));
    let rms = |feedback| (errors(feedback).map(|e| e * e).sum::<f64>() / 200.0).sqrt();
    let worst = |feedback| errors(feedback).map(f64::abs).fold(0.0, f64::max);
    println!(
        "delta-V over 40 s, carry reset each second: rms {:.5}, worst {:.5} m/s",
        rms(true),
        worst(true)
    );
    println!(
        "without feedback: rms {:.5}, worst {:.5} m/s",
        rms(false),
        worst(false)
    );
    assert!(rms(true) < 0.0012, "{}", rms(true));
    // The hard bound: half a fine step of 10 ms at each of 40 resets.
    assert!(worst(true) < 40.0 * 0.025 * 0.01, "{}", worst(true));
    assert!(rms(false) > 10.0 * rms(true));
}

/// Distance over 30 s and the mean of one second from a wheel, as errors (m, m/s), by noise of one frame.
fn wheel_error(seed: u64, noise: f64, feedback: bool) -> (f64, f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (wheel, mut packer) = (WheelScale::default_kmh(), packer());
    let speed = rng.random_range(5.0..35.0);
    let (mut distance, mut worst_second, mut second) = (0.0, 0.0_f64, 0.0);
    for frame in 0..1500_u32 {
        // 50 frames a second, in steps of 0.01 km/h as many cars send them.
        let value = ((speed + normal(&mut rng, noise)) * 360.0).round() / 360.0;
        if frame.is_multiple_of(50) || !feedback {
            packer.reset();
        }
        let codes = packer.pack(&Sample {
            wheels: [Some(value), None],
            ..Sample::default()
        });
        let error = wheel.value(codes.0[0]).unwrap() - value;
        distance += error * 0.02;
        second += error * 0.02;
        if frame % 50 == 49 {
            worst_second = worst_second.max(second.abs());
            second = 0.0;
        }
    }
    (distance.abs(), worst_second)
}

/// Why wheels have feedback too: at steady speed the same rounding error returns with every frame, a bias that
/// no filter can average away. With feedback it is gone within a second.
#[test]
fn feedback_on_wheels_pays() {
    for noise in [0.0, 0.01, 0.03, 0.1] {
        let mean = |feedback: bool| {
            let all: Vec<_> = (0..100)
                .map(|seed| wheel_error(seed, noise, feedback))
                .collect();
            let n = 100.0;
            (
                all.iter().map(|e| e.0).sum::<f64>() / n,
                all.iter().map(|e| e.1).sum::<f64>() / n,
            )
        };
        let ((plain_m, plain_mps), (fed_m, fed_mps)) = (mean(false), mean(true));
        println!(
            "noise {noise} m/s: distance over 30 s {plain_m:.4} -> {fed_m:.4} m, worst second {plain_mps:.4} -> {fed_mps:.4} m/s"
        );
        assert!(fed_m < 0.25 * plain_m && fed_mps < 0.5 * plain_mps);
    }
}
