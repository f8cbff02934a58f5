//! Ends of the range in `gnss analyse`: injected wraps and clipping are found, sound drives have none.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/analyse.rs"]
mod made;

use made::{drives, made, told};
use reconstruct::gnss::analyse::limits::{Confidence, Event, Kind};
use reconstruct::gnss::rows::Motion;
use schema::num::real;

fn events(motions: &[Motion]) -> Vec<Event> {
    told(&[], motions, &[]).events.unwrap()
}

/// To the steps of a real output: 3.9 milli-g and 8.75 millidegrees a second.
fn stepped(motions: &mut [Motion]) {
    for m in motions {
        m.accel = m.accel.map(|a| (a / 0.0383).round() * 0.0383);
        m.rate = m.rate.map(|w| (w / 1.527e-4).round() * 1.527e-4);
    }
}

#[test]
fn sound_drives_have_no_ends_of_the_range() {
    for (seed, m) in (90_101..).zip(drives()) {
        let mut motions = m.motions.clone();
        assert_eq!(events(&motions), [], "{seed}");
        stepped(&mut motions);
        assert_eq!(events(&motions), [], "{seed}, stepped");
    }
}

#[test]
fn wraps_are_found_and_unwrapped() {
    let (mut found, mut made_of, mut right, mut tried) = (0, 0, 0, 0);
    for (seed, m) in (90_101..).zip(drives()) {
        let most = m
            .motions
            .iter()
            .fold(0.0_f64, |x, r| x.max(r.rate[2].abs()));
        let limit = 0.75 * most;
        if limit < 0.15 {
            continue;
        }
        tried += 1;
        let mut wrapped = m.motions.clone();
        for r in &mut wrapped {
            r.rate[2] = (r.rate[2] + limit).rem_euclid(2.0 * limit) - limit;
        }
        let list = events(&wrapped);
        assert!(list.iter().all(|e| e.axis == 5), "{seed}: {list:?}");
        // Samples beyond the limit, and those that an event covers.
        for r in &m.motions {
            if r.rate[2].abs() < limit {
                continue;
            }
            made_of += 1;
            let t = r.head.obu_s;
            found += usize::from(
                list.iter()
                    .any(|e| t >= e.span_s[0] - 1e-6 && t <= e.span_s[1] + 1e-6),
            );
        }
        for e in &list {
            let Kind::Wrap { unwrapped, .. } = e.kind else {
                continue;
            };
            assert!((e.limit / limit - 1.0).abs() < 0.1, "{} {limit}", e.limit);
            if let Some(value) = unwrapped {
                let truth = m
                    .motions
                    .iter()
                    .filter(|r| {
                        r.head.obu_s >= e.span_s[0] - 1e-6 && r.head.obu_s <= e.span_s[1] + 1e-6
                    })
                    .map(|r| r.rate[2])
                    .max_by(|a, b| a.abs().total_cmp(&b.abs()))
                    .unwrap();
                right += usize::from((value - truth).abs() < 0.06);
            }
        }
        if list.len() > 1 {
            assert!(list.iter().any(|e| e.confidence >= Confidence::Medium));
        }
    }
    println!(
        "wraps in {tried} drives: {found} of {made_of} samples beyond the limit are in an event, {right} extremes unwrapped to 0.06 rad/s"
    );
    assert!(
        tried > 10 && found * 10 > 9 * made_of && right > 30,
        "{found} {made_of} {right}"
    );
}

#[test]
fn a_single_turn_as_in_s00_and_its_line() {
    let m = made(3);
    let mut motions = m.motions.clone();
    // A left turn of 0.8 rad/s at most, on a gyro that wraps at 0.6.
    for (k, r) in motions.iter_mut().enumerate() {
        let x = (real(k) - 2000.0) / 50.0;
        let turn = if (0.0..4.0).contains(&x) {
            0.8 * (std::f64::consts::PI * x / 4.0).sin()
        } else {
            0.0
        };
        let rate = 0.2 * r.rate[2] - turn;
        r.rate[2] = (rate + 0.6).rem_euclid(1.2) - 0.6;
    }
    let list = events(&motions);
    assert!(
        !list.is_empty() && list.iter().all(|e| (e.limit - 0.6).abs() < 0.02),
        "{list:?}"
    );
    let value = list
        .iter()
        .find_map(|e| match e.kind {
            Kind::Wrap { unwrapped, .. } => unwrapped,
            _ => None,
        })
        .unwrap();
    assert!(value < -0.6 && value > -0.95, "{value}");
    let at = usize::try_from(list[0].line).unwrap() - 2;
    assert!(motions[at].rate[2] > 0.5 && motions[at - 1].rate[2] < -0.5);
    println!(
        "{} events, limit {:.4}, unwrapped {value:.3}, line {}",
        list.len(),
        list[0].limit,
        list[0].line
    );
}

#[test]
fn clipping_is_found_on_every_axis() {
    let mut found = 0;
    for drive in &drives()[..10] {
        for axis in 0..6 {
            let mut m = drive.clone();
            stepped(&mut m.motions);
            let value = |r: &Motion| {
                if axis < 3 {
                    r.accel[axis]
                } else {
                    r.rate[axis - 3]
                }
            };
            let mut values: Vec<f64> = m.motions.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            // Half a per cent of the samples beyond.
            let limit = values[values.len() - values.len() / 200];
            for r in &mut m.motions {
                if axis < 3 {
                    r.accel[axis] = r.accel[axis].min(limit);
                } else {
                    r.rate[axis - 3] = r.rate[axis - 3].min(limit);
                }
            }
            let list = events(&m.motions);
            assert!(
                list.iter()
                    .all(|e| e.axis == axis && e.kind == Kind::Saturated),
                "{list:?}"
            );
            assert!(list.iter().all(|e| (e.limit - limit).abs() < 1e-9));
            found += usize::from(!list.is_empty());
        }
    }
    println!("clipping at the 99.5th percentile found on {found} of 60 axes");
    assert!(found >= 58, "{found}");
    // An axis that is dead.
    let mut m = made(90_101);
    for r in &mut m.motions {
        r.rate[1] = 0.0;
    }
    assert!(
        events(&m.motions)
            .iter()
            .any(|e| e.kind == Kind::Dead && e.axis == 4)
    );
}
