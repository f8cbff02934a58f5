//! What the triggers find and what they do not: 500 graded crashes, ten of the fifty simulated hours, the real drives. The
//! whole run is `cargo run --profile demo -p svartboks-tests --example trigger_statistics`; its tables are in
//! `recorder/TRIGGERS.md`.
#![allow(clippy::print_stdout, reason = "the test prints what it measured")]

use schema::num::real;
use support::trigger_report::{
    CRASH_SEEDS, CRASHES, DRIVE_SEEDS, THRESHOLD_KMH, crash_table, crashes, drive_table, drives,
    real_drives,
};

#[test]
fn the_default_triggers_find_99_of_100_crashes_above_8_kmh() {
    let crashes = crashes(CRASH_SEEDS);
    println!("{}", crash_table(&crashes));
    assert_eq!(crashes.above.len(), CRASHES);
    let found = crashes
        .above
        .iter()
        .filter(|c| c.either().is_some())
        .count();
    assert!(real(found) >= 0.99 * real(CRASHES), "{found} of {CRASHES}");
    for crash in crashes.above.iter().chain(&crashes.below) {
        assert!(
            crash.false_triggers.is_empty(),
            "before the contact: {crash:?}"
        );
    }
}

#[test]
fn ten_hours_of_kerbs_potholes_doors_and_braking_fire_nothing() {
    let driven = drives(DRIVE_SEEDS, 10.0);
    println!("{}", drive_table(&driven, None));
    // Nothing in the drives is a crash: otherwise a trigger would be right.
    assert!(driven.truth.value < THRESHOLD_KMH, "{:?}", driven.truth);
    assert!(driven.fired.is_empty(), "{:?}", driven.fired);
    assert!(driven.met.len() >= 15, "{:?}", driven.met);
}

#[test]
fn real_drives_fire_nothing_and_the_barrier_test_does() {
    let Some(real) = real_drives() else {
        return;
    };
    for (name, hours, fired, largest) in &real.drives {
        println!(
            "{name}: {:.1} s, largest {largest:.2} km/h in 150 ms",
            hours * 3600.0
        );
        assert_eq!(*fired, 0, "{name}");
    }
    let barrier = real.barrier.unwrap_or(f64::NAN);
    assert!((0.0..0.05).contains(&barrier), "{barrier}");
}
