//! `gnss analyse` on real drives, turned into logs of a box: what their sensors show, beside what is known of them.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

use nalgebra::Vector3;
use reconstruct::gnss::analyse::spans::Situation;
use reconstruct::gnss::analyse::{Analysis, Logs, Settings, analyse, page, pictures, tables};
use reconstruct::gnss::logs::Axes;
use reconstruct::gnss::rows::{Fix, Head, Leg, Motion};
use reconstruct::wgs84::Geodetic;
use schema::num;
use support::{log, recordings};

/// Where the drives are laid; the truth is in metres about its own origin.
const ORIGIN: Geodetic = Geodetic {
    latitude: 0.558,
    longitude: 0.611,
    height: 50.0,
};
/// Delay given to the receiver's stamps, s.
const DELAY_S: f64 = 0.7;

fn head(equipment: u32, obu_s: f64) -> Head {
    let leg = Leg {
        equipment,
        drive: 1,
        leg: 1,
    };
    Head::bare(leg, obu_s)
}

fn fix(equipment: u32, t_s: f64, ned: &Vector3<f64>, v: &Vector3<f64>) -> Fix {
    let place = ORIGIN.moved(ned);
    Fix {
        good: Some(true),
        ellipsoid_height: Some(place.height),
        velocity_ned: Some((*v).into()),
        ..Fix::bare(head(equipment, t_s), place.latitude, place.longitude)
    }
}

struct Real {
    motions: Vec<(u64, Motion)>,
    fixes: Vec<Fix>,
    reference: Vec<Fix>,
}

/// The log's own axes, 100 Hz; the reference once a second, and the same fixes, late, as those of the box.
fn read(name: &str, zero_s: i64) -> Option<Real> {
    let text = recordings::log(name)?;
    let motions: Vec<(u64, Motion)> = log::imu(&text, zero_s)
        .into_iter()
        .map(|(number, t, accel, rate)| {
            let head = head(2, t);
            (number, Motion { head, accel, rate })
        })
        .collect();
    let columns = ["t_s", "ref_n_m", "ref_e_m", "ref_u_m"];
    let truth = recordings::table(&format!("{name}.truth.csv"), &columns)?;
    let place = |t: f64| recordings::place(&truth, t).map(Vector3::from);
    let (mut fixes, mut reference) = (Vec::new(), Vec::new());
    for t in 1..num::round_i64(motions.last()?.1.head.obu_s) {
        let t = num::real_i64(t);
        let velocity = || Some((place(t + 0.25)? - place(t - 0.25)?) / 0.5);
        if let (Some(ned), Some(v)) = (place(t), velocity()) {
            reference.push(fix(6, t, &ned, &v));
            fixes.push(fix(2, t + DELAY_S, &ned, &v));
        }
    }
    Some(Real {
        motions,
        fixes,
        reference,
    })
}

fn told(real: &Real) -> Analysis {
    let logs = Logs {
        fixes: &real.fixes,
        motions: &real.motions,
        reference: &real.reference,
    };
    analyse(&logs, &Settings::new(Axes::Car, DELAY_S))
}

#[test]
fn real_drives_are_told() {
    let out = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("gnss-analyse-real");
    std::fs::create_dir_all(&out).unwrap();
    for (name, zero, stands) in [
        ("wid08", 1_700_000_000, 2),
        ("wid02", 1_700_000_000, 1),
        ("wid02-consumer", 1_700_000_000, 1),
        ("rav4", 1_533_224_087, 0),
    ] {
        let Some(real) = read(name, zero) else {
            return;
        };
        let a = told(&real);
        let sections = tables::sections(&a);
        let drawn = pictures::draw(&a);
        let html = page::html(&sections, &drawn, &[format!("{name}.log")], &a.spans.notes);
        std::fs::write(out.join(format!("{name}.html")), html).unwrap();
        println!("{name}\n{}", tables::text(&sections));
        assert!(
            a.spans.stands.len() >= stands,
            "{name}: {:?}",
            a.spans.stands
        );
        let list = a.receivers.as_ref().unwrap();
        let delay = list[0].as_ref().unwrap().delay[0].as_ref().unwrap();
        assert!((delay.value_s - DELAY_S).abs() < 0.02, "{name}: {delay:?}");
        // No gyro of these wraps; their ranges are hundreds of degrees a second.
        assert!(
            a.events.as_ref().unwrap().iter().all(|e| e.axis < 3),
            "{name}: {:?}",
            a.events
        );
        if name == "wid02-consumer" {
            // The README of the recordings: about (-0.8, 1.0, 0.3) deg/s at rest.
            let first = a.biases.as_ref().unwrap()[0]
                .rate
                .map(|f| f.value.to_degrees());
            for (found, known) in first.iter().zip([-0.8, 1.0, 0.3]) {
                assert!((found - known).abs() < 0.15, "{first:?}");
            }
        }
        if stands > 0 {
            let spreads = a.spreads.as_ref().unwrap();
            let of = |s: Situation| {
                spreads
                    .iter()
                    .find(|x| x.situation == s)
                    .and_then(|x| x.axis)
            };
            let still = of(Situation::Stop).or(of(Situation::Rest)).unwrap();
            let driving = of(Situation::Driving).unwrap();
            assert!((0..6).all(|i| driving[i].value > still[i].value), "{name}");
        }
    }
}
