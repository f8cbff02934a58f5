//! The six-position table of `gnss analyse`: hidden scales, biases and misalignments come back; S00's table 4.7.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/analyse.rs"]
mod made;

use made::{settings, told_as};
use reconstruct::gnss::analyse::positions::from_pair;
use reconstruct::gnss::analyse::{Analysis, Settings, source};
use reconstruct::gnss::logs;
use reconstruct::simulate::tumble::{Tumble, TumbleSheet, tumble};

fn positions(t: &Tumble, sheet: &TumbleSheet) -> Analysis {
    let settings = Settings {
        latitude: Some(sheet.latitude),
        ..settings()
    };
    told_as(&[], &logs::positions(t), &[], &settings)
}

#[test]
fn six_positions_give_scale_bias_and_misalignment() {
    let full = TumbleSheet {
        askew: 9,
        ..TumbleSheet::default()
    };
    let square = TumbleSheet {
        misalignment: 0.0,
        ..TumbleSheet::default()
    };
    for (name, sheet) in [("six positions", &square), ("and nine askew", &full)] {
        let (mut held, mut of, mut worst) = ([0; 3], 0, [0.0_f64; 3]);
        for seed in 90_001..90_041_u64 {
            let t = tumble(seed, sheet);
            let a = positions(&t, sheet);
            let table = a.positions.unwrap();
            let c = table.calibration.unwrap();
            assert!(
                a.spans.bench && c.spans == 6 + sheet.askew,
                "{seed} {}",
                c.spans
            );
            of += 3;
            for i in 0..3 {
                for (k, (f, truth)) in [(c.scale[i], t.scale[i]), (c.bias[i], t.bias[i])]
                    .into_iter()
                    .enumerate()
                {
                    held[k] += usize::from(f.ends[0] <= truth && truth <= f.ends[1]);
                    worst[k] = worst[k].max((f.value - truth).abs());
                }
                match &c.misalignment {
                    Ok(m) => {
                        let f = m[i];
                        let truth = t.misalignment[i];
                        held[2] += usize::from(f.ends[0] <= truth && truth <= f.ends[1]);
                        worst[2] = worst[2].max((f.value - truth).abs());
                    }
                    Err(why) => assert!(sheet.askew == 0 && why.contains("cannot tell")),
                }
            }
        }
        println!(
            "{name}: scale, bias, misalignment inside 95 %: {held:?} of {of}; furthest off {worst:.5?}"
        );
        assert!(
            held[0] * 100 >= 88 * of && held[1] * 100 >= 88 * of,
            "{held:?}"
        );
        assert!(sheet.askew == 0 || held[2] * 100 >= 88 * of, "{held:?}");
        assert!(
            worst[0] < 1e-3 && worst[1] < 5e-3 && worst[2] < 2e-3,
            "{worst:?}"
        );
    }
}

#[test]
fn positions_that_are_missing_are_named() {
    let sheet = TumbleSheet {
        without: vec![1, 4],
        ..TumbleSheet::default()
    };
    let a = positions(&tumble(7, &sheet), &sheet);
    assert!(a.half_done());
    let why = a.positions.unwrap().calibration.unwrap_err();
    assert!(
        why.contains("x down") && why.contains("z up") && !why.contains("y up"),
        "{why}"
    );
}

/// The six figures of S00's table 4.7, at its own gravity.
#[test]
fn the_published_positions() {
    let p = source::POSITIONS;
    let found = [(p[1], p[0]), (p[2], p[3]), (p[5], p[4])]
        .map(|(plus, minus)| from_pair(plus, minus, source::GRAVITY));
    for (found, wanted) in found.iter().zip([
        [1.020_80, 0.021_0],
        [1.028_28, 0.104_55],
        [1.036_48, -0.017_0],
    ]) {
        assert!((found[0] - wanted[0]).abs() < 5e-6 && (found[1] - wanted[1]).abs() < 1e-9);
    }
    // Their mean size over gravity is the factor that S00's program takes off, to a thousandth or two.
    let mean = p.iter().map(|v| v.abs()).sum::<f64>() / 6.0 / source::GRAVITY;
    assert!((1.0 / mean - 0.972_3).abs() < 1e-3, "{mean}");
}
