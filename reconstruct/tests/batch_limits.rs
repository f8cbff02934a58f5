//! What the batch smoother does with limits: of the road, and of a sensor.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/crash.rs"]
mod crash;

use crash::{Crash, with};
use reconstruct::refined::states::Nominal;
use reconstruct::simulate::{Class, Scenario};
use reconstruct::smooth::arrow::factor;
use reconstruct::smooth::batch::{Batch, solve};

/// A road that the car does not keep to: the trajectory is moved to the limit, its spread is not narrowed.
#[test]
fn limits_hold_the_trajectory() {
    let mut scenario = Scenario::draw(Class::Drive, 51);
    scenario.road.pitch_sd *= 2.0;
    let mut crash = Crash::of(&scenario, 30.0);
    let free = with(&crash, |ground| solve(ground).unwrap());
    let most = |batch: &Batch, of: &dyn Fn(&Nominal) -> f64| {
        batch
            .trajectory
            .iter()
            .map(of)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let pitch = |n: &Nominal| n.nav.c_nb.euler().1.abs();
    // Springs add 1.5 degrees to the limit.
    let top = most(&free, &pitch).to_degrees();
    crash.road.pitch_deg = (top - 1.5 - 0.3).max(0.3);
    let limit = crash.road.pitch_deg.to_radians();
    let (held, plain) = with(&crash, |ground| {
        let held = solve(ground).unwrap();
        let plain = factor(&ground.problem(&held.trajectory)).unwrap();
        (held, plain)
    });
    let vertical = |n: &Nominal| {
        let v = n.nav.v_n.v;
        v.z.abs() - v.xy().norm() * limit.sin() - 0.1
    };
    let steepest = most(&held, &pitch);
    println!(
        "steepest {top:.2} deg, held to {:.2} of {:.2}; vertical {:.3} m/s beyond, before {:.3}; {:?}, {} linearisations",
        steepest.to_degrees(),
        limit.to_degrees() + 1.5,
        most(&held, &vertical),
        most(&free, &vertical),
        held.limits,
        held.linearisations
    );
    assert!(held.limits.total() > 0);
    assert!(steepest < limit + 1.55_f64.to_radians() && most(&held, &vertical) < 0.02);
    let mut narrower = 0.0_f64;
    let mut spreads = Vec::new();
    plain.covariances(|_, p| spreads.push(p[(0, 0)]));
    let mut found = spreads.iter();
    held.factor
        .covariances(|_, p| narrower = narrower.max(1.0 - p[(0, 0)] / found.next().unwrap()));
    assert!(narrower < 0.02, "narrower by {narrower}");
}

/// Behind a sensor's limit the noise is one-sided: an estimate below what the sensor showed is pushed up to it.
#[test]
fn clipped_samples_are_one_sided() {
    let mut crash = Crash::draw(Class::Frontal, 52, 30.0);
    let pulse = crash.motion.impacts[0];
    // Claim a limit where there was none: the samples say more than the state allows.
    for k in pulse.first..=pulse.last {
        crash.epochs.list[k].clipped[0] = -1.0;
        crash.epochs.list[k].accel[0] *= 2.0;
    }
    crash.epochs.header.imu.accel_range = Some(30.0);
    with(&crash, |ground| {
        let batch = solve(ground).unwrap();
        assert!(batch.limits.clipped > 0);
        println!(
            "clipped: {:?}, {} linearisations",
            batch.limits, batch.linearisations
        );
        for (i, stage) in batch.problem.stages.iter().enumerate().skip(1) {
            let k = batch.problem.stages[i - 1].k;
            let epoch = &crash.epochs.list[k];
            if epoch.clipped[0] == 0.0 {
                continue;
            }
            let column = batch.trajectory[i - 1].nav.c_nb.m.column(0) / epoch.dt;
            let taken =
                ground.passed.inputs.accel[k][0] + column.dot(&stage.offset.fixed_rows::<3>(3));
            // Specific force backwards, at least as far as the sensor showed.
            assert!(
                taken < epoch.accel[0] + 0.5,
                "epoch {k}: {taken} {}",
                epoch.accel[0]
            );
        }
    });
}
