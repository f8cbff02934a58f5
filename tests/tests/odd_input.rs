//! Odd but plausible buses: other rates, two interfaces, CAN FD, extended identifiers. The result must not change.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use reconstruct::findings::Reconstruction;
use reconstruct::simulate::{Class, Scenario, Simulated, simulate};
use recorder::config::Settings;
use schema::num;
use support::crash::{self, Crash};
use support::log::{self, Line};
use support::pipeline;

fn case(imu_hz: usize, wheel_hz: f64) -> Crash {
    let mut scenario = Scenario::draw(Class::Frontal, 8100);
    scenario.imu_hz = imu_hz;
    scenario.wheel_hz = wheel_hz;
    let simulated: Simulated = simulate(&scenario).unwrap();
    Crash {
        lines: log::read(simulated.candump().as_bytes()),
        settings: crash::settings(&simulated, &[]),
        simulated,
    }
}

fn play(crash: &Crash, settings: &Settings, text: String) -> Reconstruction {
    let replayed = pipeline::record(settings, text, &[crash.trigger_at()]);
    let gaps = &replayed.records[0].health.gaps;
    assert!(gaps.len() < 4, "{gaps:?}");
    pipeline::run(&replayed.records[0])
}

/// Impact speed and delta-V against the truth, place 25 s before inside its ellipse.
fn check(what: &str, crash: &Crash, result: &Reconstruction) {
    let (truth, impact) = (&crash.simulated.truth.facts.impacts[0], &result.impacts[0]);
    let (speed, change) = (
        impact.speed_mps.value,
        impact.delta_v.longitudinal_mps.value,
    );
    let moment = crash.moment(result, -25.0);
    eprintln!(
        "{what}: impact speed {speed:.2} (truth {:.2}), delta-V {change:.2} ({:.2}), {:.1} m off 25 s before",
        truth.speed_mps, truth.cg.longitudinal_mps, moment.off
    );
    assert!((speed - truth.speed_mps).abs() < 0.4, "{what}");
    assert!(
        (change / truth.cg.longitudinal_mps - 1.0).abs() < 0.04,
        "{what}"
    );
    assert!(moment.inside(), "{what}: {moment:?}");
}

#[test]
fn rates() {
    for (imu_hz, wheel_hz) in [(100, 50.0), (1000, 20.0), (1000, 50.0), (200, 20.0)] {
        let crash = case(imu_hz, wheel_hz);
        let result = play(&crash, &crash.settings, crash.text());
        check(
            &format!("IMU at {imu_hz} Hz, wheels at {wheel_hz} Hz"),
            &crash,
            &result,
        );
    }
    // Accelerations at 1 kHz, rates as means at 100 Hz.
    let crash = case(1000, 20.0);
    let (rates, mut lines): (Vec<Line>, Vec<Line>) = crash
        .lines
        .iter()
        .cloned()
        .partition(|line| line.id == "121");
    for (k, ten) in rates.chunks_exact(10).enumerate() {
        let codes: Vec<[f64; 3]> = ten
            .iter()
            .map(|line| log::unpack(&line.data, 1.0).0)
            .collect();
        let mean = [0, 1, 2].map(|axis| codes.iter().map(|c| c[axis]).sum::<f64>() / 10.0);
        lines.push(Line {
            data: log::pack(mean, 1.0, num::u64_of(k)),
            ..ten[9].clone()
        });
    }
    let text = log::write(&log::sorted(lines));
    check(
        "accel at 1 kHz, rate at 100 Hz",
        &crash,
        &play(&crash, &crash.settings, text),
    );
}

#[test]
fn two_interfaces_with_skew() {
    let crash = case(100, 50.0);
    let settings = crash::settings(
        &crash.simulated,
        &[
            (
                "\n[imu]\n",
                "\n[[bus]]\ninterface = \"can1\"\ndbc = \"{dbc}\"\n\n[imu]\n",
            ),
            ("\"IMU_ACCEL.", "\"can0:IMU_ACCEL."),
            ("\"IMU_RATE.", "\"can1:IMU_RATE."),
            ("\"CHASSIS.", "\"can1:CHASSIS."),
        ],
    );
    // The second interface's stamps are 3 ms late, and its lines stand where the first's of the same time do.
    let mut lines = crash.lines.clone();
    for line in lines.iter_mut().filter(|line| line.id != "120") {
        line.time_ns += 3_000_000;
        "can1".clone_into(&mut line.bus);
    }
    check(
        "two interfaces, out of order",
        &crash,
        &play(&crash, &settings, log::write(&lines)),
    );
    check(
        "two interfaces, in order",
        &crash,
        &play(&crash, &settings, log::write(&log::sorted(lines))),
    );
}

#[test]
fn extended_identifiers_and_can_fd() {
    let crash = case(100, 50.0);
    let whole = play(&crash, &crash.settings, crash.text());
    let dbc = crash
        .simulated
        .dbc()
        .replace(
            "BO_ 288 ",
            &format!("BO_ {} ", 0x8000_0000_u32 | 0x18FF_0120),
        )
        .replace(
            "BO_ 290 ",
            &format!("BO_ {} ", 0x8000_0000_u32 | 0x0012_0122),
        );
    let settings = crash::settings_with(&crash.simulated, &dbc, &[]);
    let text = crash
        .text()
        .replace(" 120#", " 18FF0120##1")
        .replace(" 122#", " 00120122#");
    assert_eq!(play(&crash, &settings, text.clone()).states, whole.states);
    // A standard identifier of the same number is another message.
    let stray = text.replace(" 121#", " 120#1122334455667788\n(1700000000.5) can0 121#");
    assert!(pipeline::try_record(&settings, stray, &[]).is_ok());
}
