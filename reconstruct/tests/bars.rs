//! The bars of an evidence-grade reconstruction, on 1,020 simulated crashes whose seeds no figure was chosen on.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured"
)]

use reconstruct::run::Model;
use reconstruct::simulate::Class;
use reconstruct::validate::sets::{Plan, run};
use reconstruct::validate::{bars::bars, tabulate};

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
            if bar.met == Some(false) {
                missed.push(format!("{}: {}", tables.model, bar.what));
            }
        }
    }
    println!("{missed:#?}");
}
