//! The whole run of the triggers' statistics, as the tables of `recorder/TRIGGERS.md`.
//!
//! `cargo run --profile demo -p svartboks-tests --example trigger_statistics [HOURS]`, 50 without.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a report on standard output"
)]

use support::trigger_report::{
    CRASH_SEEDS, DRIVE_SEEDS, NEAR_SEEDS, crash_table, crashes, drive_table, drives, near,
    near_table, real_drives,
};

fn main() {
    let hours = std::env::args()
        .nth(1)
        .map_or(50.0, |word| word.parse().unwrap());
    println!("{}", crash_table(&crashes(CRASH_SEEDS)));
    println!(
        "{}Seeds {NEAR_SEEDS} to {}.\n",
        near_table(&near(NEAR_SEEDS, 400)),
        NEAR_SEEDS + 399
    );
    let driven = drives(DRIVE_SEEDS, hours);
    println!(
        "{}Seeds {DRIVE_SEEDS} on, half an hour each.",
        drive_table(&driven, real_drives().as_ref())
    );
}
