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
        lane.begin(name);
        let result = catch_unwind(AssertUnwindSafe(|| test(&lane)));
        bench::restore();
        lane.end();
        failed |= result.is_err();
        let verdict = if result.is_ok() { "ok" } else { "FAILED" };
        println!("test {name} ... {verdict}");
    }
    ExitCode::from(u8::from(failed))
}
