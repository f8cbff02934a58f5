//! `gnss analyse` on simulated drives with known truth: delay, deviations, noise, biases, situations.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/analyse.rs"]
mod made;

use made::{drives, made, settings, told, told_as};
use reconstruct::gnss::analyse::Settings;
use reconstruct::gnss::analyse::spans::Situation;
use reconstruct::gnss::rows::Fix;
use reconstruct::simulate::city::BoxSheet;
use schema::num::real;

#[test]
fn delay_deviation_and_stated_accuracy_of_a_receiver() {
    let (mut delays, mut inside, mut honest) = (Vec::new(), [0; 2], [0; 2]);
    let mut absolute = [0.0; 6];
    for m in drives() {
        let a = told(&m.fixes, &[], &m.reference);
        let list = a.receivers.as_ref().unwrap();
        let r = list[0].as_ref().unwrap();
        for (i, delay) in r.delay.iter().enumerate() {
            let d = delay.as_ref().unwrap();
            inside[i] += usize::from(d.ends_s[0] <= 1.24 && 1.24 <= d.ends_s[1]);
        }
        delays.push(r.delay[0].as_ref().unwrap().value_s - 1.24);
        for (i, h) in r.honesty.iter().enumerate() {
            let h = h.as_ref().unwrap();
            honest[i] += usize::from(h.nees.low <= 1.0 && 1.0 <= h.nees.high);
        }
        for (sum, f) in absolute
            .iter_mut()
            .zip(&r.shifted.as_ref().unwrap().quantities)
        {
            *sum += f.as_ref().unwrap().mean_abs.value / 40.0;
        }
        assert!(a.spreads.is_err() && a.allan.is_err() && a.events.is_err());
    }
    let rms = (delays.iter().map(|d| d * d).sum::<f64>() / 40.0).sqrt();
    println!(
        "delay by velocity: rms {rms:.3} s, inside 95 %: {} of 40, by position {} of 40; stated accuracy held: {honest:?} of 40",
        inside[0], inside[1]
    );
    println!("mean absolute deviation, the delay taken off: {absolute:.2?}");
    assert!(
        rms < 0.05 && inside[0] >= 34 && inside[1] >= 30,
        "{rms} {inside:?}"
    );
    assert!(honest.iter().all(|h| *h >= 30), "{honest:?}");
    // Receiver 2 of S00's table 4.1, which the simulator draws.
    let wanted = [3.61, 2.32, 4.08, 0.31, 0.23, 0.19];
    for (found, wanted) in absolute.iter().zip(wanted) {
        assert!((found / wanted - 1.0).abs() < 0.15, "{absolute:?}");
    }
    // A receiver that claims a third of its errors is caught.
    let mut m = made(90_001);
    for fix in &mut m.fixes {
        fix.sd_ned = fix.sd_ned.map(|s| s.map(|s| s / 3.0));
    }
    let a = told(&m.fixes, &[], &m.reference);
    let list = a.receivers.unwrap();
    let said = list[0].as_ref().unwrap().honesty[0]
        .as_ref()
        .unwrap()
        .verdict();
    assert!(said.contains("too small"), "{said}");
}

/// A short drive leaves the delay unsure, and a delay wrong by hundredths of a second is metres on a fast road.
#[test]
fn an_unsure_delay_is_not_held_against_the_receiver() {
    let (mut blamed, mut open) = (0, 0);
    for m in drives() {
        let a = told(&m.fixes[..m.fixes.len().min(50)], &[], &m.reference);
        let list = a.receivers.as_ref().unwrap();
        let Ok(r) = &list[0] else { continue };
        let said = r.honesty[0].as_ref().unwrap().verdict();
        blamed += usize::from(said.contains("too small"));
        open += usize::from(said.contains("not to be judged"));
        assert!(r.taken().is_none() || r.speed.unwrap() >= 0.0);
    }
    println!("of 40 drives of 50 s: called too small {blamed}, not to be judged {open}");
    assert!(blamed <= 3, "{blamed}");
}

#[test]
fn what_is_missing_is_said() {
    let m = made(90_002);
    let alone = told(&m.reference, &[], &[]);
    assert!(alone.receivers.unwrap_err().contains("reference alone"));
    let none = told(&m.fixes, &m.motions, &[]);
    assert!(none.receivers.unwrap_err().contains("no reference"));
    let standing: Vec<Fix> = m.reference.iter().take(1).copied().collect();
    let a = told(&m.fixes, &[], &standing);
    assert!(
        a.receivers.unwrap()[0]
            .as_ref()
            .unwrap_err()
            .contains("fewer than")
    );
    // Without velocities there is a delay by place only, and no course.
    let bare = |rows: &[Fix]| -> Vec<Fix> {
        let mut rows = rows.to_vec();
        for row in &mut rows {
            row.velocity_ned = None;
        }
        rows
    };
    let a = told(&bare(&m.fixes), &[], &bare(&m.reference));
    let list = a.receivers.unwrap();
    let r = list[0].as_ref().unwrap();
    assert!(r.delay[0].is_err() && r.delay[1].is_ok());
    assert!(r.stamped.quantities[3].is_none() && r.stamped.quantities[0].is_some());
    // The reference among the fixes, as equipment 6.
    let all: Vec<Fix> = m.fixes.iter().chain(&m.reference).copied().collect();
    let list = told(&all, &[], &[]).receivers.unwrap();
    assert!(list.len() == 1 && list[0].is_ok());
}

#[test]
fn variances_and_biases_of_a_drive() {
    let sheet = BoxSheet::default();
    let (mut held, mut of) = (0, 0);
    let (mut biased, mut stands) = (0, 0);
    for m in drives() {
        let a = told(&m.fixes, &m.motions, &m.reference);
        let spreads = a.spreads.as_ref().unwrap();
        let stop = spreads
            .iter()
            .find(|s| s.situation == Situation::Stop)
            .unwrap();
        if let Some(axis) = &stop.axis {
            for (v, truth) in axis[3..].iter().zip(sheet.rate_variance[0]) {
                of += 1;
                held += usize::from(v.low <= truth && truth <= v.high);
            }
        }
        for bias in a.biases.iter().flatten() {
            // The truth is the mean of the drifting bias over the stand, and the Earth's turn, which is small beside the error.
            let first = m
                .motions
                .partition_point(|r| r.head.obu_s < bias.span_s[0] - 0.001);
            let last = m
                .motions
                .partition_point(|r| r.head.obu_s < bias.span_s[1] + 0.001);
            for axis in 0..3 {
                let part = &m.city.rate_bias[first..last];
                let truth = part.iter().map(|b| b[axis]).sum::<f64>() / real(part.len());
                let f = bias.rate[axis];
                stands += 1;
                biased += usize::from(f.low - 7e-5 <= truth && truth <= f.high + 7e-5);
            }
        }
        assert!(a.events.unwrap().is_empty());
    }
    println!(
        "gyro variance at stops inside 95 %: {held} of {of}; bias by stand and axis: {biased} of {stands}"
    );
    assert!(real(held) > 0.75 * real(of) && real(biased) > 0.92 * real(stands));
}

#[test]
fn rest_is_told_from_stop_by_vibration_and_by_the_user() {
    let m = made(90_003);
    let a = told(&m.fixes, &m.motions, &m.reference);
    let stands = a.spans.stands.clone();
    assert!(stands.len() >= 2 && stands.iter().all(|s| s.situation == Situation::Stop));
    assert!(a.spans.told_by.contains("Cannot tell rest from stop"));
    // The last stand's noise shrunk to that of an engine that is off.
    let last = stands.last().unwrap();
    let mut quiet = m.motions.clone();
    for r in quiet.iter_mut().filter(|r| r.head.obu_s >= last.from_s) {
        for i in 0..3 {
            r.accel[i] = last.force[i] + 0.15 * (r.accel[i] - last.force[i]);
        }
    }
    let a = told(&m.fixes, &quiet, &m.reference);
    let rest = a
        .spans
        .stands
        .iter()
        .filter(|s| s.situation == Situation::Rest)
        .count();
    assert!(
        rest == 1 && a.spans.told_by.contains("two levels"),
        "{}",
        a.spans.told_by
    );
    let given = Settings {
        rest: vec![[stands[0].from_s, stands[0].to_s]],
        ..settings()
    };
    let a = told_as(&m.fixes, &m.motions, &[], &given);
    assert_eq!(a.spans.stands[0].situation, Situation::Rest);
    assert!(
        a.spans.stands[1..]
            .iter()
            .all(|s| s.situation == Situation::Stop)
    );
}
