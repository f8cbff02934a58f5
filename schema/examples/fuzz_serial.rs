//! Drives the read-out's framing and messages with mutated lines:
//! `cargo run -p svartboks-schema --example fuzz_serial --release -- 10000000 [SEED]`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test driver: what it meets is to stop it, and its finding goes to the terminal"
)]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schema::serial::{Deframer, Head, Keys, MAX_PACKET, Request, Response, line};

fn main() {
    let mut arguments = std::env::args()
        .skip(1)
        .map(|argument| argument.parse::<u64>().unwrap());
    let count = arguments.next().unwrap_or(100_000);
    let mut rng = ChaCha8Rng::seed_from_u64(arguments.next().unwrap_or(1));
    let keys = Keys::new("correct horse battery", 7, &[1; 16], &[2; 16]);
    let head = Head {
        session: 7,
        request: 1,
    };
    let mut deframer = Deframer::default();
    let (mut packets, mut read) = (0_u64, 0_u64);
    for done in 1..=count {
        let mut packet = match rng.random_range(0..4) {
            0 => Request::List {
                first: rng.random(),
            }
            .packet(head, None),
            1 => Response::Data {
                place: rng.random(),
                offset: rng.random(),
                bytes: vec![rng.random(); rng.random_range(0..1024)],
            }
            .packet(head, None),
            2 => vec![0x83; rng.random_range(9..MAX_PACKET - 8)],
            _ => (0..rng.random_range(1..200))
                .map(|_| rng.random())
                .collect(),
        };
        for _ in 0..rng.random_range(0..4) {
            let at = rng.random_range(0..packet.len());
            packet[at] = rng.random();
        }
        if rng.random_bool(0.7) {
            packet.extend(keys.tag(&packet));
        }
        let mut bytes = line::frame(&packet);
        for _ in 0..rng.random_range(0..3) {
            let at = rng.random_range(0..bytes.len());
            match rng.random_range(0..3) {
                0 => drop(bytes.remove(at)),
                1 => bytes.insert(at, bytes[at]),
                _ => bytes[at] = rng.random(),
            }
        }
        for found in bytes
            .into_iter()
            .filter_map(|byte| deframer.push(byte))
            .flatten()
        {
            packets += 1;
            let request = Request::read(&found, Some(&keys)).is_ok();
            let response = Response::read(&found, Some(&keys)).is_ok();
            read += u64::from(request || response);
        }
        if done.is_multiple_of(1_000_000) || done == count {
            println!("{done} mutated lines: {packets} packets, {read} messages, no panic");
        }
    }
}
