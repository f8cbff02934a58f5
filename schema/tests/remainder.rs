//! The remainder of a block: with it, sums over a block are those of the input, at both rates.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

mod support;

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schema::block::{cut, thin_blocks};
use schema::header::Layout;
use schema::sample::{AXES, MISSING, WHEELS};
use schema::time::Grid;
use schema::{Block, Packed, Packer, Sample, Scales, num};
use support::GRID;

fn packer() -> Packer {
    let Scales { wheel, accel, rate } = Scales::default();
    Packer::new(wheel, accel, rate)
}

/// Samples from `first` on as the recorder packs them: reset at each second of `grid`.
fn packed(first: u64, samples: &[Sample], grid: &Grid) -> Vec<(u64, Packed)> {
    let mut packer = packer();
    (first..)
        .zip(samples)
        .map(|(index, sample)| {
            if grid.starts_second(index) {
                packer.reset();
            }
            (index, packer.packed(sample))
        })
        .collect()
}

/// Sums of the axes over the samples that have them.
fn sums(samples: impl IntoIterator<Item = Sample>) -> [f64; AXES] {
    let mut sums = [0.0; AXES];
    for sample in samples {
        for (sum, value) in sums.iter_mut().zip(&sample.fields()[WHEELS..]) {
            *sum += value.unwrap_or(0.0);
        }
    }
    sums
}

/// The bound of a block's sum, for each axis: 1/512 fine step and the rounding of the floats.
fn bounds() -> [f64; AXES] {
    let Scales { accel, rate, .. } = Scales::default();
    let [a, w] = [accel.fine_step, rate.fine_step].map(|step| step / 512.0 + 1e-9);
    [a, a, a, w, w, w]
}

/// Asserts that every block sums to the samples it stands for, which begin at index `first`.
fn assert_sums(blocks: &[Block], first: u64, samples: &[Sample], parts: f64) {
    let at = |index: u64| usize::try_from(index - first).unwrap();
    for block in blocks {
        let span = f64::from(u32::try_from(block.span()).unwrap());
        let stored = sums(block.values(&Scales::default())).map(|sum| sum * span);
        let run = &samples[at(block.first_index)..at(block.end_index())];
        let wanted = sums(run.iter().copied());
        for ((stored, wanted), bound) in stored.iter().zip(wanted).zip(bounds()) {
            assert!(
                (stored - wanted).abs() <= bound * parts,
                "{stored} for {wanted}, block at {}",
                block.first_index
            );
        }
    }
}

/// A value of one of both slopes, below the top; without fine steps the carry is that of coarse ones.
fn axis(top: f64) -> impl Strategy<Value = Option<f64>> {
    let value = prop_oneof![-top / 50.0..top / 50.0, -top * 0.98..top * 0.98, Just(0.0),];
    prop::option::weighted(0.9, value)
}

fn sample() -> impl Strategy<Value = Sample> {
    let accel = || axis(784.0);
    let rate = || axis(17.4);
    ((accel(), accel(), accel()), (rate(), rate(), rate())).prop_map(|(a, w)| Sample {
        wheels: [Some(13.3), None],
        accel: [a.0, a.1, a.2],
        rate: [w.0, w.1, w.2],
    })
}

/// The same, all on the fine slope: there two or three carries fit into a remainder too.
fn fine(samples: &[Sample]) -> Vec<Sample> {
    let small = |sample: &Sample| Sample::from_fields(sample.fields().map(|v| v.map(|v| v / 40.0)));
    samples.iter().map(small).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 128, ..ProptestConfig::default() })]

    /// Whole blocks, a block that begins within its second, and one that ends within it.
    #[test]
    fn a_block_sums_to_its_samples(samples in prop::collection::vec(sample(), 1..350), first in 0_u64..200) {
        let blocks = cut(packed(first, &samples, &GRID), &GRID);
        assert_sums(&blocks, first, &samples, 1.0);
        // Cut within a second, as the ring does: both parts are exact to the rounding at their two ends.
        let samples = fine(&samples);
        let run = packed(first, &samples, &GRID);
        let (before, after) = run.split_at(samples.len() / 2);
        for part in [before, after] {
            assert_sums(&cut(part.iter().copied(), &GRID), first, &samples, 2.0);
        }
    }

    /// The clock stepped: the packer was reset within the record's seconds. Nothing is lost with its carry.
    #[test]
    fn resets_within_a_block_lose_nothing(samples in prop::collection::vec(sample(), 300), shift in 1_i64..100) {
        let moved = Grid { utc_offset_ns: GRID.utc_offset_ns + shift * 10_000_000, ..GRID };
        let samples = fine(&samples);
        let run = packed(3, &samples, &moved);
        assert_sums(&cut(run, &GRID), 3, &samples, 3.0);
    }

    /// A thinned block sums to the full one's samples.
    #[test]
    fn a_thinned_block_sums_to_its_samples(all in prop::collection::vec(sample(), 100)) {
        // Means of five where all or none are there; the samples behind let the first block be thinned.
        let mut samples: Vec<Sample> = all.chunks(5).flat_map(|five| {
            let there = five[0].fields();
            five.iter().map(move |sample| {
                let fields = sample.fields().iter().zip(there).map(|(v, there)| there.map(|_| v.unwrap_or(1.0))).collect::<Vec<_>>();
                Sample::from_fields(fields.try_into().unwrap())
            })
        }).collect();
        samples.resize(1800, Sample { accel: [Some(0.3); 3], ..Sample::default() });
        let mut blocks = cut(packed(3, &samples, &GRID), &GRID);
        thin_blocks(&mut blocks, &[], &Scales::default());
        prop_assert_eq!((blocks[0].rate_hz, blocks[1].rate_hz), (20, 20));
        // Five times the rounding of the thinned remainder, and once that of the full one.
        assert_sums(&blocks[..2], 3, &samples, 6.0);
    }
}

#[test]
fn the_remainder_belongs_to_the_last_value_that_is_there() {
    let Scales { accel, .. } = Scales::default();
    let x = |value| Sample {
        accel: [value, None, Some(1.0)],
        ..Sample::default()
    };
    let samples = [x(Some(1.0)), x(Some(1.02)), x(None), x(None)];
    let blocks = cut(packed(3, &samples, &GRID), &GRID);
    let parts = (0.02 / 0.05 * 256.0_f64).round();
    assert_eq!(blocks[0].remainder, [102, 0, 0, 0, 0, 0]);
    let values: Vec<_> = blocks[0].values(&Scales::default()).collect();
    let last = accel.value(531).unwrap() + parts * accel.fine_step / 256.0;
    let found = values
        .iter()
        .map(|sample| sample.accel[0].map(f64::to_bits));
    let wanted = [accel.value(531), Some(last), None, None].map(|v| v.map(f64::to_bits));
    assert!(found.eq(wanted));
    assert!(values.iter().all(|sample| sample.accel[1].is_none()));
    // The codes are as they were.
    let codes: Vec<u16> = blocks[0].samples.iter().map(|codes| codes.0[2]).collect();
    assert_eq!(codes, [531, 531, MISSING, MISSING]);
}

#[test]
fn the_largest_carry_fits() {
    let Scales { accel, rate, .. } = Scales::default();
    for (value, sign) in [(2000.0, 1), (-2000.0, -1)] {
        let mut packer = packer();
        packer.pack(&Sample {
            accel: [Some(value); 3],
            rate: [Some(value); 3],
            ..Sample::default()
        });
        let parts =
            |limit: f64, step: f64| sign * num::saturate_i16(num::round_i64(limit / step * 256.0));
        let accel = parts(accel.carry_limit, accel.fine_step);
        let rate = parts(rate.carry_limit, rate.fine_step);
        assert_eq!(packer.remainder(), [accel, accel, accel, rate, rate, rate]);
        assert!(accel.abs() < 69 * 256 && rate.abs() < 35 * 256);
        packer.reset();
        assert_eq!(packer.remainder(), [0; AXES]);
    }
}

#[test]
fn an_axis_that_is_missing_throughout_has_none() {
    // The carry of the second before stands when only the rest of the second is cut out.
    let mut samples = vec![
        Sample {
            accel: [Some(1.02); 3],
            ..Sample::default()
        };
        10
    ];
    samples.extend([Sample::default(); 20]);
    let run = packed(3, &samples, &GRID);
    let blocks = cut(run[15..].iter().copied(), &GRID);
    assert_eq!(blocks[0].remainder, [0; AXES]);
    let mut record = support::small();
    record.blocks = blocks;
    record.validate().unwrap();
}

#[test]
fn records_give_their_sums_back() {
    for layout in [Layout::Full, Layout::TwoRate] {
        let record = support::record(layout, 1, 4003, 3000);
        assert!(
            record
                .blocks
                .iter()
                .any(|block| block.remainder != [0; AXES])
        );
        let mut stored = [0.0; AXES];
        for sample in record.samples() {
            let span = f64::from(u32::try_from(sample.span).unwrap());
            for (sum, more) in stored.iter_mut().zip(sums([sample.sample])) {
                *sum += more * span * 0.01;
            }
        }
        let wanted = sums((1..4003).map(support::sample)).map(|sum| sum * 0.01);
        println!("{layout:?}: {stored:?} for {wanted:?}");
        // x has gaps, which a mean of five bridges; the other axes are whole.
        for axis in 1..AXES {
            assert!((stored[axis] - wanted[axis]).abs() < 1e-4, "axis {axis}");
        }
    }
}

/// Normal deviates by the sum of twelve uniform ones.
fn normal(rng: &mut ChaCha8Rng, sd: f64) -> f64 {
    sd * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)
}

/// Delta-V over 40 s of simulated driving with a pulse, the carry reset at each second: the error, m/s, without
/// and with the remainders, and with them in the two-rate layout.
fn delta_v_errors(seed: u64) -> [f64; 3] {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (slow, bias) = (rng.random_range(0.02..0.5), normal(&mut rng, 0.5));
    let samples: Vec<Sample> = (0..4000_u32)
        .map(|k| {
            let pulse = if (3000..3010).contains(&k) {
                -250.0
            } else {
                0.0
            };
            let t = f64::from(k) * 0.01;
            let value = bias + 2.0 * (slow * t).sin() + pulse + normal(&mut rng, 0.05);
            Sample {
                accel: [Some(value), None, None],
                ..Sample::default()
            }
        })
        .collect();
    let scales = Scales::default();
    let delta_v = |blocks: &[Block]| {
        let blocks = blocks.iter().map(|block| {
            let span = f64::from(u32::try_from(block.span()).unwrap());
            sums(block.values(&scales))[0] * span * 0.01
        });
        blocks.sum::<f64>()
    };
    let full = cut(packed(3, &samples, &GRID), &GRID);
    let (mut plain, mut thin) = (full.clone(), full.clone());
    for block in &mut plain {
        block.remainder = [0; AXES];
    }
    thin_blocks(&mut thin, &[3003], &scales);
    assert!(thin[0].rate_hz == 20 && full.len() == 40);
    let wanted = sums(samples)[0] * 0.01;
    [plain, full, thin].map(|blocks| delta_v(&blocks) - wanted)
}

#[test]
fn resets_cost_no_delta_v() {
    let errors: Vec<_> = (0..200).map(delta_v_errors).collect();
    let rms = |of: usize| (errors.iter().map(|e| e[of] * e[of]).sum::<f64>() / 200.0).sqrt();
    let worst = |of: usize| errors.iter().map(|e| e[of].abs()).fold(0.0, f64::max);
    for (of, name) in ["without remainders", "with remainders", "two-rate"]
        .iter()
        .enumerate()
    {
        let (rms, worst) = (rms(of), worst(of));
        println!("delta-V over 40 s, {name}: rms {rms:.2e}, worst {worst:.2e} m/s");
    }
    assert!(rms(0) > 5e-4);
    assert!(
        rms(1) < 1e-5 && worst(1) < 40.0 * 0.05 / 512.0 * 0.01,
        "{}",
        worst(1)
    );
    assert!(rms(2) < 3e-5 && worst(2) < 1e-4, "{}", worst(2));
}
