//! The bars of an evidence-grade reconstruction, on 1,020 simulated crashes whose seeds no figure was chosen on.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured"
)]

use reconstruct::run::Model;
use reconstruct::simulate::Class;
use reconstruct::validate::measure::{Measure, When};
use reconstruct::validate::sets::{Plan, run};
use reconstruct::validate::tables::{Figures, find};
use reconstruct::validate::{ALL, ModelTables, bars::bars, tabulate};

/// What refined does not reach, each with the reason that experiment found.
const NOT_MET: [&str; 5] = [
    // The lever arm (5 cm an axis) and the centre of gravity (2 cm) alone make 0.58 %.
    "delta-V longitudinal, rms error / rms resultant",
    // Light impacts, whose 8 km/h are to be known to 0.05.
    "delta-V longitudinal, rms of each crash's error / resultant",
    "delta-V lateral, rms of each crash's error / resultant",
    // Too wide, in part by what a real drive has and these have not: the Earth turns (without it NEES/n is 0.05 more),
    // gravity is not known, springs rock.
    "position, 0 s: inside the 50 / 80 / 95 / 99 % bounds",
    // By 0.4 of a point at the 50 % level; one standard error is 1.6.
    "heading, -1 s: inside the 50 / 80 / 95 / 99 % bounds",
];

/// The least and the largest share inside the 95 % bounds over all crashes, and the NEES they may have.
fn honest(tables: &ModelTables, least: f64, nees: [f64; 2]) {
    let mut moments: Vec<(Measure, When)> = Vec::new();
    for i in 0..5 {
        for measure in [Measure::Position, Measure::Speed, Measure::Heading] {
            moments.push((measure, When::Back(i)));
        }
    }
    for measure in [
        Measure::ImpactSpeed,
        Measure::Longitudinal,
        Measure::Lateral,
        Measure::Resultant,
    ] {
        moments.push((measure, When::Impact(0)));
    }
    for (measure, when) in moments {
        let figures: &Figures = find(&tables.rows, ALL, measure, when).unwrap();
        let inside = figures.coverage.unwrap()[2].value();
        let mean = figures.nees.unwrap().value;
        let name = format!("{} {} {when:?}", tables.model, measure.name());
        assert!((least..=0.992).contains(&inside), "{name}: inside {inside}");
        assert!((nees[0]..=nees[1]).contains(&mean), "{name}: NEES/n {mean}");
    }
}

/// Seeds 70001 to 70170 of six classes; tuning used seeds 1 to 100.
#[test]
fn a_thousand_crashes_meet_the_bars() {
    let threads = std::thread::available_parallelism().map_or(2, usize::from);
    let plan = Plan {
        classes: Class::CRASHES.to_vec(),
        seeds: 70_001..=70_170,
        models: vec![Model::Refined, Model::NineState],
        threads,
        ideal: None,
    };
    let cases = run(&plan, |_, _| ());
    let set = tabulate(&plan, &cases);
    assert!(set.failures.is_empty(), "{:?}", set.failures);
    let mut missed = Vec::new();
    for tables in &set.models {
        println!("{}: {}", tables.model, tables.left_out().unwrap());
        for bar in bars(tables, &[], &[]) {
            println!(
                "{} {}: {}; bar: {}",
                bar.verdict_in_words(),
                bar.what,
                bar.measured,
                bar.bar
            );
            let known = NOT_MET.contains(&bar.what.as_str());
            if tables.model == Model::Refined.name() && bar.met == Some(false) && !known {
                missed.push(bar.what.clone());
            }
            // The bound of nine-state is 90 % in every measure.
            if bar.what.contains("(the bound of nine-state)") && bar.met == Some(false) {
                missed.push(format!("{}: {}", tables.model, bar.what));
            }
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
    for tables in &set.models {
        if tables.model == Model::Refined.name() {
            honest(tables, 0.93, [0.78, 1.15]);
        } else {
            honest(tables, 0.90, [0.6, 1.3]);
        }
        // The figures that no bar is met for are no worse than they were found.
        let most = if tables.model == Model::Refined.name() {
            [0.78, 0.90]
        } else {
            [1.30, 1.80]
        };
        let pooled = [Measure::LongitudinalPooled, Measure::LateralPooled];
        for (measure, most) in pooled.into_iter().zip(most) {
            let rms = find(&tables.rows, ALL, measure, When::Impact(0))
                .unwrap()
                .rms;
            assert!(rms.value <= most, "{}: {rms:?} %", tables.model);
        }
    }
}
