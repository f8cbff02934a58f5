//! The simulator against itself: one smooth motion, honest errors, stated ranges.
#![allow(
    clippy::unwrap_used,
    clippy::as_conversions,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::print_stdout,
    clippy::float_cmp,
    clippy::disallowed_methods,
    reason = "tests: a failure may panic, and the time taken is printed"
)]

use nalgebra::{Rotation3, Vector3};
use reconstruct::simulate::{Class, Grade, Scenario, Simulated, simulate};

fn perfect(class: Class, seed: u64, imu_hz: usize) -> Simulated {
    let mut scenario = Scenario::draw_graded(class, seed, Grade::Perfect);
    scenario.imu_hz = imu_hz;
    simulate(&scenario).unwrap()
}

/// Integrates the frames of a perfect IMU forwards from the truth's first row, attitude of the middle of
/// each frame; gives the largest distance to the truth in m, m/s and rad.
fn forward_error(simulated: &Simulated) -> (f64, f64, f64) {
    let rows = &simulated.truth.rows;
    let first = rows[0];
    let dt = 1.0 / simulated.scenario.imu_hz as f64;
    let gravity = Vector3::new(0.0, 0.0, simulated.scenario.gravity);
    let mut c = Rotation3::from_euler_angles(first.roll, first.pitch, first.heading);
    let mut v = Vector3::from(first.velocity);
    let mut r = Vector3::from(first.position);
    let mut worst = (0.0_f64, 0.0_f64, 0.0_f64);
    for frame in simulated.imu.iter().filter(|frame| frame.t > 1e-9) {
        let turn = Vector3::from(frame.rate) * dt;
        let middle = c * Rotation3::new(turn / 2.0);
        let a = middle * Vector3::from(frame.accel) + gravity;
        r += v * dt + a * (dt * dt / 2.0);
        v += a * dt;
        c *= Rotation3::new(turn);
        let bin = frame.t * 100.0;
        if (bin - bin.round()).abs() < 1e-6 {
            let row = &rows[bin.round() as usize];
            let truth = Rotation3::from_euler_angles(row.roll, row.pitch, row.heading);
            worst.0 = worst.0.max((r - Vector3::from(row.position)).norm());
            worst.1 = worst.1.max((v - Vector3::from(row.velocity)).norm());
            worst.2 = worst.2.max(c.angle_to(&truth));
        }
    }
    worst
}

#[test]
fn perfect_imu_integrates_to_the_truth() {
    for class in Class::ALL {
        for seed in 0..3 {
            let simulated = perfect(class, seed, 1000);
            let (position, velocity, angle) = forward_error(&simulated);
            let f = &simulated.truth.facts;
            println!(
                "{class}-{seed}: {position:.6} m {velocity:.7} m/s {angle:.2e} rad; {:.1} s, {:.0} m, rest {:.2} s, roll {:.2} pitch {:.2}; {:?}",
                f.duration_s,
                f.distance_m,
                f.rest_t_s,
                f.rest_roll_deg,
                f.rest_pitch_deg,
                f.impacts.first()
            );
            assert!(position < 3e-3, "{class}-{seed}: {position} m");
        }
    }
}
