//! Drives `read`, `salvage` and the ledger's reader with mutated files: `cargo run -p svartboks-schema --example fuzz --release -- 10000000 [SEED]`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test driver: what it meets is to stop it, and its finding goes to the terminal"
)]

#[path = "../tests/support/ledgers.rs"]
mod ledgers;
#[path = "../tests/support/mutate.rs"]
mod mutate;
#[path = "../tests/support/mod.rs"]
mod support;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schema::header::{Layout, Origin};

fn main() {
    let mut arguments = std::env::args()
        .skip(1)
        .map(|argument| argument.parse::<u64>().unwrap());
    let count = arguments.next().unwrap_or(100_000);
    let seed = arguments.next().unwrap_or(1);
    let mut live = support::small();
    live.header.origin = Origin::Live;
    let mut thin = support::record(Layout::TwoRate, 3, 2203, 2200);
    thin.blocks.truncate(2);
    let bases = [
        (support::small(), false),
        (live, true),
        (thin, false),
        (support::placed(), false),
    ]
    .map(|(record, signed)| (mutate::parse(&record.to_bytes().unwrap()), signed));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut read, mut salvaged, mut ledgers) = (0_u64, 0_u64, 0_u64);
    for done in 1..=count {
        let (structures, signed) = &bases[rng.random_range(0..bases.len())];
        let outcome = mutate::drive(&mutate::mutate(structures, *signed, &mut rng));
        read += u64::from(outcome.read);
        salvaged += u64::from(outcome.salvaged);
        ledgers += u64::from(ledgers::drive(&ledgers::mutate(seed.wrapping_add(done))));
        if done.is_multiple_of(1_000_000) || done == count {
            println!(
                "{done} mutated files: {read} read, {salvaged} salvaged; as many ledgers: {ledgers} read; no panic"
            );
        }
    }
}
