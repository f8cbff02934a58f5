//! Each sensor error of the simulator alone: what it does, and that it does nothing else.
#![allow(
    clippy::unwrap_used,
    clippy::as_conversions,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "tests: a failure may panic"
)]

use nalgebra::{Rotation3, Vector3};
use reconstruct::simulate::errors::Burst;
use reconstruct::simulate::scenario::Axes;
use reconstruct::simulate::{Class, Errors, Grade, Scenario, SimulateError, Simulated, simulate};

fn base() -> Scenario {
    Scenario::draw_graded(Class::Oblique, 11, Grade::Perfect)
}

fn with(change: impl Fn(&mut Errors)) -> Simulated {
    let mut scenario = base();
    change(&mut scenario.errors);
    simulate(&scenario).unwrap()
}

/// Pairs of frames (clean, with error) from `from` to `to` seconds.
fn pairs(a: &Simulated, b: &Simulated, from: f64, to: f64) -> Vec<([f64; 6], [f64; 6])> {
    let six = |f: &reconstruct::simulate::ImuFrame| {
        [
            f.accel[0], f.accel[1], f.accel[2], f.rate[0], f.rate[1], f.rate[2],
        ]
    };
    let both = a.imu.iter().zip(&b.imu);
    both.filter(|(f, _)| f.t > from && f.t < to)
        .map(|(x, y)| (six(x), six(y)))
        .collect()
}

fn sd(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn no_errors_means_the_perfect_grade() {
    assert_eq!(
        base().errors,
        Errors {
            wheel_latency: 0.0,
            ..Errors::none()
        }
    );
    let mut consumer = Scenario::draw(Class::Oblique, 11);
    consumer.errors = Errors::none();
    (consumer.car.imu, consumer.car.cg) = (consumer.car.imu_nominal, consumer.car.cg_nominal);
    let (a, b) = (simulate(&consumer).unwrap(), simulate(&base()).unwrap());
    assert_eq!(a.samples(), b.samples());
}

#[test]
fn bias_shifts_and_jumps_at_the_impact() {
    let clean = with(|_| ());
    let biased = with(|e| {
        e.accel_bias = [0.1, -0.2, 0.3];
        e.rate_bias = [0.01, 0.02, -0.03];
        e.accel_bias_jump[0] = [0.5, 0.0, 0.0];
        e.rate_bias_jump[0] = [0.0, 0.0, 0.2];
    });
    let expected = [0.1, -0.2, 0.3, 0.01, 0.02, -0.03];
    let impact = clean.truth.facts.impacts[0];
    for (jump, from, to) in [
        (0.0, 0.0, impact.t_s),
        (1.0, impact.t_s + impact.duration_s, 60.0),
    ] {
        for (a, b) in pairs(&clean, &biased, from, to) {
            for i in 0..6 {
                let jumped = expected[i] + jump * [0.5, 0.0, 0.0, 0.0, 0.0, 0.2][i];
                assert!((b[i] - a[i] - jumped).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn scale_second_order_and_asymmetry_follow_the_input() {
    let clean = with(|_| ());
    let bent = with(|e| {
        e.accel_scale = [0.01, 0.0, 0.0];
        e.accel_second = [0.0, 1e-4, 0.0];
        e.accel_asymmetry = [0.0, 0.0, 0.02];
        e.rate_scale = [0.0, 0.0, -0.01];
        e.rate_second = [0.1, 0.0, 0.0];
        e.rate_asymmetry = [0.0, 0.1, 0.0];
    });
    for (a, b) in pairs(&clean, &bent, 0.0, 60.0) {
        assert!((b[0] - a[0] * 1.01).abs() < 1e-9);
        assert!((b[1] - a[1] * (1.0 + 1e-4 * a[1])).abs() < 1e-9);
        assert!((b[2] - a[2] * (1.0 + 0.01 * a[2].signum())).abs() < 1e-9);
        assert!((b[3] - a[3] * (1.0 + 0.1 * a[3])).abs() < 1e-9);
        assert!((b[4] - a[4] * (1.0 + 0.05 * a[4].signum())).abs() < 1e-9);
        assert!((b[5] - a[5] * 0.99).abs() < 1e-9);
    }
}

#[test]
fn mounting_turns_both_sensors() {
    let clean = with(|_| ());
    let turned = with(|e| e.mounting = [0.02, -0.03, 0.05]);
    let c = Rotation3::from_euler_angles(0.02, -0.03, 0.05).inverse();
    for (a, b) in pairs(&clean, &turned, 0.0, 60.0) {
        let force = c * Vector3::new(a[0], a[1], a[2]);
        let rate = c * Vector3::new(a[3], a[4], a[5]);
        assert!((force - Vector3::new(b[0], b[1], b[2])).norm() < 1e-9);
        assert!((rate - Vector3::new(b[3], b[4], b[5])).norm() < 1e-9);
    }
}

#[test]
fn clipping_marks_its_frames() {
    let clean = with(|_| ());
    let range = 16.0 * 9.80665;
    let clipped = with(|e| e.accel_range = Some(range));
    assert!(clean.imu.iter().all(|frame| !frame.clipped));
    let beyond = clean
        .imu
        .iter()
        .filter(|f| f.accel.iter().any(|a| a.abs() >= range))
        .count();
    assert_eq!(
        clipped.imu.iter().filter(|frame| frame.clipped).count(),
        beyond
    );
    assert!(beyond > 0, "this seed shall clip");
    assert!(
        clipped
            .imu
            .iter()
            .all(|f| f.accel.iter().all(|a| a.abs() <= range))
    );
}

#[test]
fn white_noise_has_its_density_at_every_rate() {
    for imu_hz in [100, 500] {
        let noisy = |density| {
            let mut scenario = base();
            scenario.imu_hz = imu_hz;
            scenario.errors.accel_density = density;
            scenario.errors.rate_density = density / 10.0;
            simulate(&scenario).unwrap()
        };
        let (clean, noisy) = (noisy(0.0), noisy(0.02));
        let all = pairs(&clean, &noisy, 0.0, 60.0);
        let expected = 0.02 * (imu_hz as f64).sqrt();
        let accel = sd(all.iter().map(|(a, b)| b[0] - a[0]));
        let rate = sd(all.iter().map(|(a, b)| b[5] - a[5]));
        assert!(
            (accel / expected - 1.0).abs() < 0.05,
            "{accel} against {expected}"
        );
        assert!((rate * 10.0 / expected - 1.0).abs() < 0.05, "{rate}");
    }
}

#[test]
fn vibration_grows_with_speed_and_ends_at_rest() {
    let clean = with(|_| ());
    let shaken = with(|e| (e.accel_vibration, e.rate_vibration) = (0.3, 0.005));
    let speed = sd(clean.truth.rows[..3000]
        .iter()
        .map(|row| row.speed.min(30.0)))
        / 25.0;
    let moving = pairs(&clean, &shaken, 0.0, 30.0);
    let found = sd(moving.iter().map(|(a, b)| b[1] - a[1]));
    assert!((found / (0.3 * speed) - 1.0).abs() < 0.08, "{found}");
    let resting = pairs(&clean, &shaken, clean.truth.facts.rest_t_s + 1.0, 60.0);
    assert!(sd(resting.iter().map(|(a, b)| b[1] - a[1])) < 1e-4);
    // Not white: neighbours are alike to a degree.
    let noise: Vec<f64> = moving.iter().map(|(a, b)| b[1] - a[1]).collect();
    let lag: f64 =
        noise.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / (found * found * noise.len() as f64);
    assert!((0.1..0.5).contains(&lag), "correlation of neighbours {lag}");
}

#[test]
fn lost_frames_are_missing_and_counted() {
    let clean = with(|_| ());
    let lossy = with(|e| {
        e.frame_loss = 0.01;
        e.bursts = vec![Burst {
            t: 10.0,
            duration: 0.5,
        }];
    });
    let ratio = lossy.frames.len() as f64 / clean.frames.len() as f64;
    assert!((0.975..0.985).contains(&ratio), "{ratio}");
    let samples = lossy.samples();
    assert!(
        samples[1002..1049]
            .iter()
            .all(|s| s.accel == [None; 3] && s.rate == [None; 3])
    );
    // A single lost frame is bridged, so few bins outside the burst are missing.
    let missing = samples.iter().filter(|s| s.accel[0].is_none()).count();
    assert!((48..56).contains(&missing), "{missing} missing");
    // The counters go on while frames are lost.
    let counters: Vec<u8> = lossy
        .frames
        .iter()
        .filter(|f| f.id == 0x120)
        .map(|f| f.data[7] >> 4)
        .collect();
    let skips = counters
        .windows(2)
        .filter(|w| (w[0] + 1) & 15 != w[1])
        .count();
    assert!((30..80).contains(&skips), "{skips} skips");
    let dead = with(|e| {
        e.wheel_bursts = vec![Burst {
            t: 0.0,
            duration: 100.0,
        }];
    });
    assert!(dead.samples().iter().all(|s| s.wheels == [None; 2]));
}

#[test]
fn wheels_are_late_coarse_scaled_and_cut_off() {
    let clean = with(|_| ());
    let late = with(|e| e.wheel_latency = 0.03);
    let scaled = with(|e| e.wheel_scale = [0.01, -0.01]);
    let cut = with(|e| e.wheel_cutoff = 0.7);
    let noisy = with(|e| e.wheel_noise = 0.05);
    for (n, frame) in clean.wheels.iter().enumerate() {
        let speed = frame.speed;
        assert!((scaled.wheels[n].speed[0] - speed[0] * 1.01).abs() < 1e-9);
        assert!((scaled.wheels[n].speed[1] - speed[1] * 0.99).abs() < 1e-9);
        let expected = speed.map(|v| if v < 0.7 { 0.0 } else { v });
        assert_eq!(cut.wheels[n].speed, expected);
    }
    let found = sd(clean
        .wheels
        .iter()
        .zip(&noisy.wheels)
        .filter(|(a, _)| a.t < 30.0)
        .map(|(a, b)| a.speed[0] - b.speed[0]));
    assert!((found / 0.05 - 1.0).abs() < 0.1, "{found}");
    // Before the braking the wheels' mean is the speed at the rear axle, late by the latency.
    for frame in late
        .wheels
        .iter()
        .filter(|frame| frame.t > 1.0 && frame.t < 35.0)
    {
        let row = |t: f64| late.truth.rows[(t * 100.0).round() as usize].speed;
        let mean = f64::midpoint(frame.speed[0], frame.speed[1]);
        assert!(
            (mean - row(frame.t - 0.03)).abs() < 0.08,
            "{mean} at {}",
            frame.t
        );
    }
}

#[test]
fn braking_slips_and_a_locked_wheel_stands() {
    let mut scenario = base();
    let braking = scenario.manoeuvre.braking.as_mut().unwrap();
    (braking.t, braking.slip, braking.lock) = (38.5, [0.1, 0.1], Some(1));
    let onset = scenario.manoeuvre.impacts[0].t;
    let simulated = simulate(&scenario).unwrap();
    let slip = |from: f64, side: usize| {
        let frames = simulated
            .wheels
            .iter()
            .filter(|f| f.t > from && f.t < onset);
        let values: Vec<f64> = frames
            .map(|f| {
                1.0 - f.speed[side] / simulated.truth.rows[(f.t * 100.0).round() as usize].speed
            })
            .collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    assert!(
        (0.07..0.13).contains(&slip(38.9, 0)),
        "slip {}",
        slip(38.9, 0)
    );
    assert!(slip(39.5, 1) > 0.95, "slip {}", slip(39.5, 1));
}

#[test]
fn frames_carry_the_values() {
    for axes in [Axes::FrontLeftUp, Axes::FrontRightDown] {
        let mut scenario = base();
        scenario.axes = axes;
        let simulated = simulate(&scenario).unwrap();
        let side = if axes == Axes::FrontLeftUp { -1.0 } else { 1.0 };
        let text = simulated.candump();
        assert!(text.starts_with("(1700000000.000000) can0 120#"));
        assert_eq!(text.lines().count(), simulated.frames.len());
        let signed =
            |word: u64, start: u32| ((word << (44 - start)).cast_signed() >> 44) as f64 * 0.002;
        let accel = simulated.frames.iter().filter(|f| f.id == 0x120);
        for (frame, sent) in accel.zip(&simulated.imu) {
            let word = u64::from_le_bytes(frame.data);
            assert!((signed(word, 0) - sent.accel[0]).abs() < 1.01e-3);
            assert!((signed(word, 20) - side * sent.accel[1]).abs() < 1.01e-3);
            assert!((signed(word, 40) - side * sent.accel[2]).abs() < 1.01e-3);
        }
        let wheels = simulated.frames.iter().filter(|f| f.id == 0x122);
        for (frame, sent) in wheels.zip(&simulated.wheels) {
            let left = f64::from(u16::from_be_bytes([frame.data[0], frame.data[1]])) * 0.01;
            assert!((left - sent.speed[0] * 3.6).abs() < 0.0051);
            assert_eq!(frame.payload().len(), 5);
        }
        for id in [
            "BO_ 288 IMU_ACCEL: 8",
            "BO_ 289 IMU_RATE: 8",
            "BO_ 290 CHASSIS: 5",
        ] {
            assert!(simulated.dbc().contains(id));
        }
    }
}

#[test]
fn jitter_delays_and_never_reorders() {
    let jittery = with(|e| e.jitter = 0.003);
    let times: Vec<i64> = jittery
        .frames
        .iter()
        .filter(|f| f.id == 0x120)
        .map(|f| f.unix_ns)
        .collect();
    let start = 1_700_000_000_000_000_000;
    assert_eq!(times[0], start);
    assert!(times.is_sorted());
    let late: Vec<f64> = times
        .iter()
        .enumerate()
        .map(|(n, t)| (t - start) as f64 / 1e9 - n as f64 / 100.0)
        .collect();
    let found = sd(late.iter().copied());
    assert!((found / 0.003 - 1.0).abs() < 0.06, "{found}");
    assert_eq!(jittery.samples(), with(|_| ()).samples());
}

#[test]
fn what_cannot_be_simulated_is_refused() {
    let refused = |change: &dyn Fn(&mut Scenario)| {
        let mut scenario = base();
        change(&mut scenario);
        simulate(&scenario).unwrap_err()
    };
    assert_eq!(refused(&|s| s.imu_hz = 90), SimulateError::ImuRate(90));
    assert!(matches!(
        refused(&|s| s.gravity = f64::NAN),
        SimulateError::Quantity {
            name: "gravity",
            ..
        }
    ));
    assert!(matches!(
        refused(&|s| {
            s.manoeuvre.impacts.clear();
            s.manoeuvre.braking = None;
        }),
        SimulateError::NoRest { .. }
    ));
    assert!(
        "nonsense"
            .parse::<Class>()
            .unwrap_err()
            .to_string()
            .contains("frontal")
    );
}

#[test]
fn five_files_are_written() {
    let folder = std::env::temp_dir().join(format!("simulate-{}", std::process::id()));
    let simulated = with(|_| ());
    let paths = simulated.write(&folder, None).unwrap();
    let names: Vec<_> = paths
        .iter()
        .map(|p| p.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    let ends = ["log", "dbc", "toml", "truth.csv", "facts.json"];
    assert_eq!(names, ends.map(|end| format!("oblique-11.{end}")));
    let facts: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&paths[4]).unwrap()).unwrap();
    assert_eq!(facts["class"], "oblique");
    let truth = std::fs::read_to_string(&paths[3]).unwrap();
    assert!(truth.lines().all(|line| line.split(',').count() == 16));
    std::fs::remove_dir_all(&folder).unwrap();
    let file = std::env::temp_dir().join(format!("simulate-file-{}", std::process::id()));
    std::fs::write(&file, "").unwrap();
    assert!(matches!(
        simulated.write(&file, None).unwrap_err(),
        SimulateError::Write { .. }
    ));
    std::fs::remove_file(&file).unwrap();
}
