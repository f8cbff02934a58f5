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
            let (position, velocity, angle) = forward_error(&perfect(class, seed, 1000));
            assert!(position < 2e-3, "{class}-{seed}: {position} m");
            assert!(velocity < 3e-4, "{class}-{seed}: {velocity} m/s");
            assert!(angle < 2e-5, "{class}-{seed}: {angle} rad");
        }
    }
}

#[test]
fn same_seed_same_bytes_and_other_seeds_differ() {
    let text = |class, seed| {
        let simulated = simulate(&Scenario::draw(class, seed)).unwrap();
        (
            simulated.candump(),
            simulated.truth_csv(),
            simulated.config("a.dbc"),
            simulated.facts_json().unwrap(),
        )
    };
    let first = text(Class::Oblique, 5);
    assert_eq!(first, text(Class::Oblique, 5));
    assert_ne!(first.0, text(Class::Oblique, 6).0);
    assert_ne!(first.1, text(Class::Side, 5).1);
}

#[test]
fn grades_share_the_motion() {
    let rows = |grade| {
        let mut scenario = Scenario::draw_graded(Class::Side, 4, grade);
        (scenario.car.imu, scenario.car.cg) = (scenario.car.imu_nominal, scenario.car.cg_nominal);
        simulate(&scenario).unwrap().truth.rows
    };
    assert_eq!(rows(Grade::Consumer), rows(Grade::Perfect));
}

#[test]
fn drawn_errors_have_the_stated_statistics() {
    let n = 500;
    let scenarios: Vec<_> = (0..n)
        .map(|seed| Scenario::draw(Class::Frontal, seed))
        .collect();
    let sheet = &scenarios[0].sheet;
    let sd = |values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.collect();
        (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
    };
    let axes = |f: &dyn Fn(&Scenario) -> [f64; 3]| sd(&mut scenarios.iter().flat_map(f));
    let checks = [
        (
            "accel bias",
            axes(&|s| s.errors.accel_bias),
            sheet.accel_bias,
        ),
        ("rate bias", axes(&|s| s.errors.rate_bias), sheet.rate_bias),
        (
            "accel jump",
            axes(&|s| s.errors.accel_bias_jump[0]),
            sheet.accel_bias_jump,
        ),
        (
            "rate jump",
            axes(&|s| s.errors.rate_bias_jump[1]),
            sheet.rate_bias_jump,
        ),
        (
            "accel scale",
            axes(&|s| s.errors.accel_scale),
            sheet.accel_scale,
        ),
        (
            "rate scale",
            axes(&|s| s.errors.rate_scale),
            sheet.rate_scale,
        ),
        ("mounting", axes(&|s| s.errors.mounting), sheet.mounting),
        (
            "imu place",
            axes(&|s| [0, 1, 2].map(|i| s.car.imu[i] - s.car.imu_nominal[i])),
            sheet.imu_place,
        ),
        (
            "wheel scale",
            sd(&mut scenarios
                .iter()
                .map(|s| f64::midpoint(s.errors.wheel_scale[0], s.errors.wheel_scale[1]))),
            sheet.wheel_scale,
        ),
        (
            "wheel difference",
            sd(&mut scenarios
                .iter()
                .map(|s| s.errors.wheel_scale[0] - s.errors.wheel_scale[1])),
            sheet.wheel_scale_difference,
        ),
        (
            "latency",
            sd(&mut scenarios.iter().map(|s| s.errors.wheel_latency - 0.0225)),
            scenarios[0].wheel_sheet().latency_sd_s,
        ),
    ];
    for (name, found, expected) in checks {
        assert!(
            (found / expected - 1.0).abs() < 0.12,
            "{name}: {found} against {expected}"
        );
    }
    for s in &scenarios {
        assert!((0.005..0.040).contains(&s.errors.wheel_latency));
        assert!((1.0 / 3.6..3.0 / 3.6).contains(&s.errors.wheel_cutoff));
        assert!((20.0..=50.0).contains(&s.wheel_hz));
    }
}

#[test]
fn configuration_states_the_sheet_and_never_the_draw() {
    let mut scenario = Scenario::draw(Class::Frontal, 1);
    let text = simulate(&scenario).unwrap().config("x.dbc");
    scenario.errors.accel_bias = [9.0; 3];
    scenario.errors.wheel_latency = 0.033;
    scenario.car.imu = [1.0, 1.0, -1.0];
    assert_eq!(text, simulate(&scenario).unwrap().config("x.dbc"));
    for line in [
        "accel_bias = 0.100000",
        "rate_density = 0.010000",
        "latency_ms = 22.500000",
        "dbc = \"x.dbc\"",
    ] {
        assert!(text.lines().any(|l| l == line), "{line} in\n{text}");
    }
}

#[test]
fn classes_reach_their_ranges() {
    for class in Class::ALL {
        let mut spin = 0.0_f64;
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        let mut tilt = 0.0_f64;
        for seed in 0..15 {
            let simulated = simulate(&Scenario::draw_graded(class, seed, Grade::Perfect)).unwrap();
            let facts = &simulated.truth.facts;
            let rows = &simulated.truth.rows;
            let last = rows.last().unwrap();
            assert!(
                Vector3::from(last.velocity).norm() < 1e-4,
                "{class}-{seed} ends moving"
            );
            assert_eq!(last.position, [0.0; 3]);
            assert_eq!(last.heading, 0.0);
            assert!(facts.duration_s - facts.rest_t_s >= 4.0);
            let expected = match class {
                Class::Stop | Class::Drive | Class::Still => 0,
                Class::Double => 2,
                _ => 1,
            };
            assert_eq!(facts.impacts.len(), expected);
            let roll = last.roll.to_degrees().abs();
            assert!(
                if class == Class::Roof {
                    roll > 165.0
                } else {
                    roll < 12.0
                },
                "{class}-{seed}: {roll}"
            );
            tilt = tilt.max(last.pitch.to_degrees().abs());
            let Some(impact) = facts.impacts.first() else {
                continue;
            };
            assert!(impact.t_s >= 40.0 && facts.duration_s >= impact.t_s + 12.0);
            assert!(
                impact.speed_mps > 2.5,
                "{class}-{seed}: {} m/s",
                impact.speed_mps
            );
            let onset = (impact.t_s * 100.0) as usize;
            let before = &rows[..onset - 250];
            let lateral = before
                .iter()
                .map(|row| row.accel[1].abs())
                .fold(0.0, f64::max);
            assert!(lateral < 6.0, "{class}-{seed}: lateral {lateral}");
            if class != Class::Lights {
                assert!(before.iter().all(|row| (18.0..35.0).contains(&row.speed)));
                assert!(before.iter().all(|row| row.roll.to_degrees().abs() < 9.0));
            }
            let pdof = impact.cg.pdof_deg.abs();
            assert!(
                match class {
                    Class::Frontal | Class::Roof => pdof < 30.0,
                    Class::Oblique => (5.0..90.0).contains(&pdof),
                    Class::Side => (25.0..140.0).contains(&pdof),
                    Class::Rear => pdof > 120.0,
                    _ => pdof < 75.0,
                },
                "{class}-{seed}: {pdof}"
            );
            spin = spin.max(impact.spin_degps.abs());
            (least, most) = (
                least.min(impact.cg.resultant_mps),
                most.max(impact.cg.resultant_mps),
            );
        }
        println!(
            "{class}: spin to {spin:.0} deg/s, delta-V {least:.1} to {most:.1} m/s, pitch at rest to {tilt:.1} deg"
        );
        if matches!(class, Class::Oblique | Class::Side) {
            assert!(spin > 150.0 && most > 15.0 && least < 8.0);
        }
    }
}

#[test]
fn delta_v_of_the_facts_is_the_truths_change_of_velocity() {
    for seed in 0..10 {
        let mut scenario = Scenario::draw_graded(Class::Oblique, seed, Grade::Perfect);
        scenario.manoeuvre.impacts[0].t = 40.0;
        scenario.manoeuvre.impacts[0].pulse.duration = 0.1;
        let truth = simulate(&scenario).unwrap().truth;
        let (a, b) = (truth.rows[4000], truth.rows[4010]);
        let c = Rotation3::from_euler_angles(a.roll, a.pitch, a.heading);
        let change = c.inverse() * (Vector3::from(b.velocity) - Vector3::from(a.velocity));
        let impact = truth.facts.impacts[0];
        assert!((change.x - impact.imu.longitudinal_mps).abs() < 1e-9);
        assert!((change.y - impact.imu.lateral_mps).abs() < 1e-9);
        assert!((a.speed - impact.speed_mps).abs() < 1e-9);
        // At the centre of gravity it is the planned change plus the tyres' part (at most about 1 g).
        let planned = scenario.manoeuvre.impacts[0].delta_v;
        let rest =
            (impact.cg.longitudinal_mps - planned[0]).hypot(impact.cg.lateral_mps - planned[1]);
        assert!(rest < 1.2, "seed {seed}: {rest} m/s off the plan");
        assert!(
            (impact.cg.pdof_deg
                - (-impact.cg.lateral_mps)
                    .atan2(-impact.cg.longitudinal_mps)
                    .to_degrees())
            .abs()
                < 1e-9
        );
        // With the IMU at the centre of gravity both are one.
        scenario.car.imu = scenario.car.cg;
        let impact = simulate(&scenario).unwrap().truth.facts.impacts[0];
        assert!((impact.cg.resultant_mps - impact.imu.resultant_mps).abs() < 2e-2);
    }
}

#[test]
fn samples_stand_at_their_rows() {
    let simulated = perfect(Class::Side, 2, 1000);
    let (samples, rows) = (simulated.samples(), &simulated.truth.rows);
    assert_eq!(samples.len(), rows.len());
    let mut worst = 0.0_f64;
    for k in 1..rows.len() {
        let attitude =
            |i: usize| Rotation3::from_euler_angles(rows[i].roll, rows[i].pitch, rows[i].heading);
        let middle = attitude(k - 1).slerp(&attitude(k), 0.5);
        let dv = Vector3::from(rows[k].velocity) - Vector3::from(rows[k - 1].velocity);
        let force =
            middle.inverse() * (dv / 0.01 - Vector3::new(0.0, 0.0, simulated.scenario.gravity));
        let felt = Vector3::from(samples[k].accel.map(Option::unwrap));
        let turn = (attitude(k - 1).inverse() * attitude(k)).scaled_axis() / 0.01;
        worst = worst.max((turn - Vector3::from(samples[k].rate.map(Option::unwrap))).norm());
        // Within a bin of the pulse the body turns while the force changes: a part the mean cannot show.
        let bound = if felt.norm() > 30.0 { 1.0 } else { 0.1 };
        assert!((force - felt).norm() < bound, "row {k}: {force} {felt}");
    }
    assert!(worst < 0.01, "rate differs by {worst} rad/s");
    let total = samples
        .iter()
        .filter(|sample| sample.wheels[0].is_some())
        .count() as f64;
    let expected = rows.len() as f64 / 100.0 * simulated.scenario.wheel_hz;
    assert!(
        (total - expected).abs() < 3.0,
        "{total} wheel values, expected {expected}"
    );
}

#[test]
fn nothing_but_numbers_over_200_seeds_and_fast() {
    let start = std::time::Instant::now();
    let mut seconds = 0.0;
    for seed in 0..200 {
        let class = Class::ALL[seed as usize % 10];
        let simulated = simulate(&Scenario::draw(class, 1000 + seed)).unwrap();
        seconds += simulated.truth.facts.duration_s;
        for row in &simulated.truth.rows {
            let all = [row.roll, row.pitch, row.heading, row.speed, row.yaw_rate];
            let finite = all
                .iter()
                .chain(&row.position)
                .chain(&row.velocity)
                .chain(&row.accel)
                .all(|x| x.is_finite());
            assert!(finite, "{class}-{seed} at {} s", row.t_s);
            assert!(
                row.accel.iter().all(|a| a.abs() < 1500.0),
                "{class}-{seed} at {} s",
                row.t_s
            );
        }
        for sample in simulated.samples() {
            let mut values = sample
                .wheels
                .iter()
                .chain(&sample.accel)
                .chain(&sample.rate)
                .flatten();
            assert!(values.all(|x| x.is_finite()));
        }
        assert!(simulated.frames.is_sorted_by_key(|frame| frame.unix_ns));
    }
    println!(
        "{:.1} ms a crash of {:.0} s",
        start.elapsed().as_secs_f64() * 5.0,
        seconds / 200.0
    );
}
