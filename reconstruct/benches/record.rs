//! Cost of one 40 s record: read, reconstructed by all models, written as a table. Medians of interleaved rounds,
//! with a plain copy of the written bytes as the floor.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    missing_docs,
    reason = "a benchmark prints, reads the clock and fails by panicking"
)]

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use reconstruct::export::trajectory::csv;
use reconstruct::run::{Options, reconstruct};
use schema::Record;

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/record");
    let file = fixtures.join("oblique-1.svb");
    let out = std::env::temp_dir().join(format!("svartboks-bench-{}.csv", std::process::id()));
    let mut times: [Vec<f64>; 4] = [const { Vec::new() }; 4];
    for _ in 0..40 {
        let begin = Instant::now();
        let (record, _) = Record::read(&std::fs::read(&file).unwrap()).unwrap();
        times[0].push(begin.elapsed().as_secs_f64());
        let begin = Instant::now();
        let result = reconstruct(&record, &Options::default()).unwrap();
        times[1].push(begin.elapsed().as_secs_f64());
        let begin = Instant::now();
        let text = csv(&result.states);
        std::fs::write(&out, &text).unwrap();
        times[2].push(begin.elapsed().as_secs_f64());
        let begin = Instant::now();
        std::fs::write(&out, black_box(&text)).unwrap();
        times[3].push(begin.elapsed().as_secs_f64());
    }
    std::fs::remove_file(&out).unwrap();
    let [read, run, write, floor] = times.map(|mut t| median(&mut t) * 1e3);
    println!("read          {read:.2} ms");
    println!("reconstruct   {run:.2} ms, three models side by side");
    println!("write         {write:.2} ms (copying the same bytes: {floor:.2} ms)");
    println!("together      {:.2} ms", read + run + write);
}
