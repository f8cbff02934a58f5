//! The tests that need SocketCAN. They run as root on vcan0 and vcan1, in a network namespace or a kernel of their
//! own: `tests/vcan/run` sees to that.
//!
//! `vcan --bin FOLDER --root PROJECT --work FOLDER [--own-clock] [--only-own-clock] [NAME...]`
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a program of tests: a failure is a panic, the result a line"
)]

mod bench;
mod car;
mod check;
mod daemon;
mod drives;
mod kills;
mod reaper;
mod sockets;
mod traffic;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::process::ExitCode;

use bench::{Lane, Test};

/// Tests that a machine which is held up from outside can fail: no meter inside sees all of that. They must hold when
/// tried again.
const TIMED: [&str; 3] = [
    "listening_costs_no_more_than_candump",
    "a_full_bus_for_a_minute_loses_no_mapped_frame",
    "daemons_that_are_killed_lose_at_most_the_bound_and_seal_every_event_once",
];

fn main() -> ExitCode {
    let mut lane = Lane::default();
    let (mut own_clock, mut only_own_clock) = (false, false);
    let mut names = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(word) = arguments.next() {
        let mut path = || PathBuf::from(arguments.next().unwrap());
        match word.as_str() {
            "--bin" => lane.bin = path(),
            "--root" => lane.root = path(),
            "--work" => lane.work = path(),
            "--own-clock" => own_clock = true,
            "--only-own-clock" => only_own_clock = true,
            _ => names.push(word),
        }
    }
    let mut failed = false;
    let tests: Vec<Test> = [
        sockets::TESTS,
        traffic::TESTS,
        check::TESTS,
        drives::TESTS,
        kills::TESTS,
    ]
    .concat();
    for (name, sets_clock, test) in tests {
        let wanted = names.is_empty() || names.iter().any(|part| name.contains(part.as_str()));
        if !wanted || (sets_clock && !own_clock) || (only_own_clock && !sets_clock) {
            continue;
        }
        let mut once = || {
            lane.begin(name);
            let result = catch_unwind(AssertUnwindSafe(|| test(&lane)));
            bench::restore();
            lane.end();
            result.map_err(|what| first_line(what.as_ref()).to_owned())
        };
        let mut result = once();
        if let Err(why) = &result
            && TIMED.contains(&name)
        {
            println!("{name} failed: {why}; it hangs on the machine's time and is tried once more");
            result = once();
        }
        failed |= result.is_err();
        if let Err(why) = &result {
            println!("reason {name}: {why}");
        }
        let verdict = if result.is_ok() { "ok" } else { "FAILED" };
        println!("test {name} ... {verdict}");
    }
    ExitCode::from(u8::from(failed))
}

/// What a panic said, for the summary.
fn first_line(what: &(dyn std::any::Any + Send)) -> &str {
    let text = what.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| what.downcast_ref::<&str>().copied());
    let line = text.and_then(|text| text.lines().find(|line| !line.is_empty()));
    line.unwrap_or("no word")
}
