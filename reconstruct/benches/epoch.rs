//! Cost of one epoch of the nine-state filter beside a hand-written floor, in one run.
//!
//! The floor: 9 x 9 covariance, block-sparse transition, two scalar updates, nothing else. Both run
//! interleaved, many rounds; the medians and their ratio are printed.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    missing_docs,
    reason = "a benchmark prints, reads the clock and fails by panicking"
)]

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use reconstruct::epochs::Epochs;
use reconstruct::filter::{self, Setup, Tuning};
use reconstruct::mechanize::Earth;
use reconstruct::motion::Motion;
use reconstruct::road::RoadLimits;
use reconstruct::simulate::{Class, Scenario, simulate};
use reconstruct::{rest, start};
use schema::Sample;

type M9 = SMatrix<f64, 9, 9>;

/// One epoch of the floor.
fn floor_epoch(p: &mut M9, f_n: &Vector3<f64>, h: f64, rows: &[SVector<f64, 9>; 2]) {
    let a = Matrix3::new(0.0, -f_n.z, f_n.y, f_n.z, 0.0, -f_n.x, -f_n.y, f_n.x, 0.0) * h;
    let block = |r: usize, c: usize| p.fixed_view::<3, 3>(r, c).into_owned();
    let (r, x, y) = (block(0, 0), block(0, 3), block(0, 6));
    let (v, z, w) = (block(3, 3), block(3, 6), block(6, 6));
    let z1 = z - a * w;
    let v1 = v - a * z.transpose() - z1 * a.transpose();
    let y1 = y - z * h;
    let x1 = x - v * h - y1 * a.transpose();
    let r1 = r - x.transpose() * h - (x - v * h) * h;
    let id = Matrix3::identity();
    p.fixed_view_mut::<3, 3>(0, 0).copy_from(&r1);
    p.fixed_view_mut::<3, 3>(0, 3).copy_from(&x1);
    p.fixed_view_mut::<3, 3>(3, 0).copy_from(&x1.transpose());
    p.fixed_view_mut::<3, 3>(0, 6).copy_from(&y1);
    p.fixed_view_mut::<3, 3>(6, 0).copy_from(&y1.transpose());
    p.fixed_view_mut::<3, 3>(3, 3).copy_from(&(v1 + id * 1e-5));
    p.fixed_view_mut::<3, 3>(3, 6).copy_from(&z1);
    p.fixed_view_mut::<3, 3>(6, 3).copy_from(&z1.transpose());
    p.fixed_view_mut::<3, 3>(6, 6).copy_from(&(w + id * 1e-8));
    for row in rows {
        let s = *p * row;
        let k = s / (row.dot(&s) + 0.01);
        *p -= k * s.transpose();
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let scenario = Scenario::draw(Class::Oblique, 7);
    let simulated = simulate(&scenario).unwrap();
    let samples = simulated.samples();
    let last = samples.len();
    let list: Vec<(u64, u8, Sample)> = samples[last - 4000..]
        .iter()
        .zip(1..)
        .map(|(sample, index)| (index, 100, *sample))
        .collect();
    let header = scenario.header();
    let epochs = Epochs::from_samples(header, &list, 0.0, &[]).unwrap();
    let earth = Earth::flat();
    let rest = rest::find(&epochs, earth.gravity);
    let start = start::at_rest(&epochs, &rest, &earth);
    let reversed = epochs.reversed();
    let road = RoadLimits::default();
    let rows = [0.3_f64, -0.2]
        .map(|s| SVector::<f64, 9>::from([0.0, 0.0, 0.0, 1.0, s, 0.1, 2.0, 20.0 * s, 18.0]));
    let (mut floor, mut ours) = (Vec::new(), Vec::new());
    for _ in 0..60 {
        let begin = Instant::now();
        let mut p = M9::identity();
        for k in 0..4000 {
            let t = f64::from(k) * 0.01;
            floor_epoch(
                &mut p,
                &Vector3::new(t.sin(), t.cos(), -9.8),
                0.01,
                black_box(&rows),
            );
        }
        black_box(&p);
        floor.push(begin.elapsed().as_secs_f64() / 4000.0);
        let begin = Instant::now();
        let motion = Motion::look(&reversed, &start, earth.gravity, &[]);
        let setup = Setup {
            anchor: None,
            reversed,
            start: &start,
            motion: &motion,
            earth,
            road: Some(&road),
            tuning: Tuning::default(),
        };
        black_box(filter::run(&setup).unwrap());
        ours.push(begin.elapsed().as_secs_f64() / 4000.0);
    }
    let (floor, ours) = (median(&mut floor), median(&mut ours));
    println!("floor       {:.3} us an epoch", floor * 1e6);
    println!(
        "nine-state  {:.3} us an epoch, first look and mechanisation included",
        ours * 1e6
    );
    println!("ratio       {:.2}", ours / floor);
}
