//! What ten bits leave out is in the record: every block of it, cut or whole, sums to the samples it was made of.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

mod support;

use std::collections::BTreeMap;

use schema::{Record, Sample, num};
use support::{Log, Run, run, settings};

/// A moving car from one time to another, with a pulse at 36 s; the stamps behind `seam` are `step` seconds later.
fn drive(from: f64, to: f64, seam: f64, step: f64) -> Log {
    let mut log = Log::default();
    for k in 0..num::round_usize((to - from) * 100.0) {
        let t = from + num::real(k) * 0.01;
        let pulse = if (36.0..36.1).contains(&t) {
            -250.0
        } else {
            0.0
        };
        let accel = [1.3 * (0.7 * t).sin() + pulse, 2.1 * (1.1 * t).cos(), 9.806];
        let rate = [3.0 * (2.3 * t).sin(), 0.7, 40.0 * (0.9 * t).cos()];
        let stamp = if t < seam { t } else { t + step };
        log.accel(stamp, accel, num::u64_of(k));
        log.rate(stamp + 0.0001, rate, num::u64_of(k));
    }
    log
}

/// Sums of the six axes.
fn sums<'a>(samples: impl Iterator<Item = &'a Sample>) -> [f64; 6] {
    let mut sums = [0.0; 6];
    for sample in samples {
        for (sum, value) in sums.iter_mut().zip(&sample.fields()[2..]) {
            *sum += value.unwrap_or(0.0);
        }
    }
    sums
}

/// The largest difference of a block's sum from that of the samples it was made of, in 1/512 fine steps.
fn worst(run: &Run, record: &Record) -> f64 {
    let made: BTreeMap<u64, Sample> = run.samples.iter().copied().collect();
    let scales = record.scales();
    let mut worst = 0.0_f64;
    for block in &record.blocks {
        let values: Vec<Sample> = block.values(&scales).collect();
        let wanted = made.range(block.first_index..block.end_index());
        let pairs = sums(values.iter())
            .into_iter()
            .zip(sums(wanted.map(|(_, sample)| sample)));
        for (axis, (stored, wanted)) in pairs.enumerate() {
            let scale = if axis < 3 { scales.accel } else { scales.rate };
            let apart = (stored * num::real_u64(block.span()) - wanted).abs();
            worst = worst.max(apart / scale.fine_step * 512.0);
        }
    }
    worst
}

#[test]
fn every_block_sums_to_its_samples() {
    let settings = settings(&[]);
    // The ring begins and the log ends within a second.
    let run = run(&settings, drive(0.37, 50.62, 99.0, 0.0).text(), &[]);
    let record = &run.records[0];
    let (first, last) = (&record.blocks[0], record.blocks.last().unwrap());
    assert!(first.samples.len() < 100 && last.samples.len() < 100);
    assert!(record.blocks.iter().all(|block| block.remainder != [0; 6]));
    let worst = worst(&run, record);
    println!(
        "{} blocks: at most {worst:.3}/512 fine steps",
        record.blocks.len()
    );
    // A block that begins within its second has the rounding of two carries.
    assert!(worst <= 2.0 + 1e-6, "{worst}");
}

#[test]
fn thinned_blocks_sum_to_their_samples() {
    let settings = settings(&[("layout = \"full\"", "layout = \"two-rate\"")]);
    let run = run(&settings, drive(0.37, 50.62, 99.0, 0.0).text(), &[]);
    let record = &run.records[0];
    assert!(record.blocks.iter().any(|block| block.rate_hz == 20));
    let worst = worst(&run, record);
    // Five times the rounding of the thinned remainder and once that of the full one.
    assert!(worst <= 6.0 + 1e-6, "{worst}");
}

#[test]
fn a_clock_that_steps_costs_no_sum() {
    let settings = settings(&[]);
    // Back by 1.37 s: the seconds at which the packer is reset are no longer those of the record's blocks.
    let run = run(&settings, drive(0.37, 50.62, 39.5, -1.37).unsorted(), &[]);
    let record = &run.records[0];
    assert!(!record.health.clock_steps.is_empty());
    let worst = worst(&run, record);
    assert!(worst <= 3.0 + 1e-6, "{worst}");
}
