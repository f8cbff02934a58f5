//! The self-test finds what is wrong with a sensor, says what is right, and says where it can not tell.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use recorder::daemon::self_test::{Finding, SelfTest};
use schema::Sample;
use support::settings;

const G: f64 = 9.80665;

/// 40 s of driving with curves, then 20 s at rest, as a working car shows them; `change` makes it another.
fn drive(change: impl Fn(u32, &mut Sample)) -> Vec<Finding> {
    let settings = settings(&[]);
    let track = settings.vehicle.track_width_m;
    let mut test = SelfTest::new(&settings);
    for number in 0..6000_u32 {
        let t = f64::from(number) / 100.0;
        // Not noise, but no two samples are alike.
        let shake = (t * 61.3).sin() * 0.05 + (t * 17.9).cos() * 0.03;
        let mut sample = if number < 4000 {
            let speed = 14.0 + (t * 0.3).sin();
            let yaw = 0.2 * (t * 0.5).sin();
            let wheels = [speed + yaw * track / 2.0, speed - yaw * track / 2.0];
            Sample {
                wheels: if number.is_multiple_of(2) {
                    wheels.map(Some)
                } else {
                    [None; 2]
                },
                accel: [Some(shake), Some(speed * yaw + shake), Some(shake - G)],
                rate: [
                    Some(shake * 0.01),
                    Some(shake * 0.01),
                    Some(yaw + shake * 0.01),
                ],
            }
        } else {
            Sample {
                wheels: if number.is_multiple_of(2) {
                    [Some(0.0); 2]
                } else {
                    [None; 2]
                },
                accel: [Some(shake * 0.1), Some(shake * 0.1), Some(shake * 0.1 - G)],
                rate: [Some(shake * 0.001); 3],
            }
        };
        change(number, &mut sample);
        test.sample(&sample);
    }
    test.finish()
}

fn faults(findings: &[Finding]) -> Vec<String> {
    let fault = |finding: &&Finding| matches!(finding, Finding::Fault(_));
    findings.iter().filter(fault).map(Finding::text).collect()
}

#[test]
fn a_sound_car_is_found_sound_in_every_point() {
    let findings = drive(|_, _| ());
    println!("{findings:#?}");
    assert!(
        findings
            .iter()
            .all(|finding| matches!(finding, Finding::Good(_)))
    );
    assert_eq!(findings.len(), 4);
}

#[test]
fn each_fault_is_named() {
    type Change = Box<dyn Fn(u32, &mut Sample)>;
    let cases: Vec<(&str, Change)> = vec![
        (
            "rate y had exactly one value",
            Box::new(|_, sample| sample.rate[1] = Some(0.01)),
        ),
        (
            "accel x had exactly one value",
            Box::new(|number, sample| {
                if number > 2000 {
                    sample.accel[0] = Some(0.3);
                }
            }),
        ),
        (
            "wheel-left had exactly one value",
            Box::new(|number, sample| {
                if number > 1000 && sample.wheels[0].is_some() {
                    sample.wheels[0] = Some(9.0);
                }
            }),
        ),
        (
            "wheels are exchanged, or an axis points",
            Box::new(|_, sample| sample.wheels.swap(0, 1)),
        ),
        (
            "wheel are exchanged",
            Box::new(|_, sample| sample.rate[2] = sample.rate[2].map(|rate| -rate)),
        ),
        (
            "gravity at rest 10.9",
            Box::new(|_, sample| sample.accel[2] = sample.accel[2].map(|z| z * 1.12)),
        ),
        (
            "the gyro's turn is 0.5",
            Box::new(|_, sample| sample.rate[2] = sample.rate[2].map(|rate| rate * 0.5)),
        ),
    ];
    for (wanted, change) in cases {
        let found = faults(&drive(change));
        let wanted = wanted.replace("wheels are", "wheel are");
        assert!(
            found.iter().any(|text| text.contains(&wanted)),
            "{wanted}: {found:?}"
        );
    }
}

#[test]
fn a_parked_car_and_a_motorway_leave_it_open() {
    let parked = drive(|_, sample| {
        sample.wheels = sample.wheels.map(|wheel| wheel.map(|_| 0.0));
        sample.accel = [Some(0.0), Some(0.0), Some(-G)];
        sample.rate = [Some(0.0); 3];
    });
    assert!(
        faults(&parked).is_empty(),
        "a resting sensor of coarse steps is not stuck: {parked:?}"
    );
    let open = |findings: &[Finding], what: &str| {
        findings
            .iter()
            .any(|finding| matches!(finding, Finding::Unknown(text) if text.contains(what)))
    };
    assert!(open(&parked, "stuck signals") && open(&parked, "wheels against gyro"));
    let motorway = drive(|number, sample| {
        if number >= 4000 {
            *sample = Sample::default();
        }
    });
    assert!(open(&motorway, "not at rest"));
}
