//! The batch smoother on records that are not as they should be, through the same door as a run.
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

use crash::Crash;
use reconstruct::ReconstructError;
use reconstruct::refined::{self, Refined};
use reconstruct::simulate::{Class, Grade, Scenario};
use reconstruct::smooth::Smoother;

fn run(crash: &Crash, smoother: Smoother) -> Result<Refined, ReconstructError> {
    refined::run(&crash.setup(), &crash.rest, &crash.tuning, smoother)
}

/// Largest difference of position and velocity, in standard deviations of the sweep, and of the standard deviations.
fn apart(a: &Refined, b: &Refined) -> [f64; 2] {
    let mut out = [0.0_f64; 2];
    for (a, b) in a.snapshots.iter().zip(&b.snapshots) {
        let off = [(a.nav.r_n.v - b.nav.r_n.v), (a.nav.v_n.v - b.nav.v_n.v)];
        for s in 0..6 {
            let sd = a.p[(s, s)].sqrt().max(1e-3);
            out[0] = out[0].max(off[s / 3][s % 3].abs() / sd);
            out[1] = out[1].max((b.p[(s, s)].sqrt() / sd - 1.0).abs());
        }
    }
    out
}

/// What a run shows is made of the same parts whichever smoother gave it.
#[test]
fn both_smoothers_give_the_same_kind_of_answer() {
    let crash = Crash::draw(Class::Oblique, 81, 30.0);
    let (sweep, batch) = (
        run(&crash, Smoother::Rts).unwrap(),
        run(&crash, Smoother::Batch).unwrap(),
    );
    let [mean, sd] = apart(&sweep, &batch);
    println!(
        "oblique 81: {mean:.2} sd apart, sds differ by {:.1} %",
        100.0 * sd
    );
    assert!(mean < 2.0 && sd < 0.2);
    let (a, b) = (sweep.joint[0].unwrap(), batch.joint[0].unwrap());
    for r in 0..18 {
        for c in 0..18 {
            let scale = (a[(r, r)] * a[(c, c)]).sqrt();
            assert!((a[(r, c)] - b[(r, c)]).abs() < 0.15 * scale, "{r} {c}");
        }
    }
    assert!(batch.batch.is_some() && sweep.batch.is_none());
    for (a, b) in [(&sweep.before, &batch.before), (&sweep.after, &batch.after)] {
        for s in 0..30 {
            assert!((b.1[(s, s)] / a.1[(s, s)] - 1.0).abs() < 0.1, "{s}");
        }
    }
}

/// A record cut 0.3 s after the impact, a gap, a perfect sensor: it settles near the sweep.
#[test]
fn settles_on_faulty_records() {
    let mut cases = Vec::new();
    for seed in 82..85 {
        let mut cut = Crash::draw(Class::Frontal, seed, 30.0);
        let end = cut.epochs.list[cut.motion.impacts[0].last].t_s + 0.3;
        cut.cut(cut.epochs.list.partition_point(|e| e.t_s <= end));
        cases.push((format!("cut {seed}"), cut));
        let mut gap = Crash::draw(Class::Side, seed, 30.0);
        let from = gap.motion.impacts[0].first - 300;
        for epoch in &mut gap.epochs.list[from..from + 50] {
            epoch.measured = [false; 6];
            epoch.wheels = [None; 2];
        }
        cases.push((format!("gap {seed}"), gap));
        let perfect = Scenario::draw_graded(Class::Rear, seed, Grade::Perfect);
        cases.push((format!("perfect {seed}"), Crash::of(&perfect, 30.0)));
        let mut rolled = Crash::draw(Class::Roof, seed, 30.0);
        // The gyro ends at 100 degrees a second.
        rolled.epochs.header.imu.rate_range = Some(1.745);
        for epoch in &mut rolled.epochs.list {
            for axis in 0..3 {
                if epoch.rate[axis].abs() > 1.745 {
                    epoch.rate[axis] = 1.745_f64.copysign(epoch.rate[axis]);
                    epoch.clipped[axis + 3] = epoch.rate[axis].signum();
                }
            }
        }
        rolled.look_again();
        cases.push((format!("clipped roll {seed}"), rolled));
    }
    for (name, crash) in cases { if std::env::var("DBG").is_ok() && !name.contains("roll") { continue; }
        let sweep = run(&crash, Smoother::Rts).unwrap();
        let found = match run(&crash, Smoother::Batch) { Ok(f) => f, Err(e) => { println!("{name}: {e}"); continue } };
        let [mean, sd] = apart(&sweep, &found);
        let mut worst = (0.0, 0, 0);
        for (k, (a, b)) in sweep.snapshots.iter().zip(&found.snapshots).enumerate() {
            for s in 0..6 { let v = b.p[(s,s)].sqrt() / a.p[(s,s)].sqrt().max(1e-3) - 1.0; if v.abs() > worst.0 { worst = (v.abs(), k, s); } }
        }
        let (_, k, s) = worst;
        println!("  worst sd at epoch {k} of {} state {s}: {:.3e} {:.3e}", crash.epochs.list.len(), sweep.snapshots[k].p[(s,s)].sqrt(), found.snapshots[k].p[(s,s)].sqrt());
        for (n, r) in [("sweep", &sweep), ("batch", &found)] {
            let k0 = crash.motion.impacts.first().map_or(0, |p| p.before);
            for k in [0, k0] {
                let t = crash.truth(k); let sn = &r.snapshots[k];
                let off = [sn.nav.r_n.v.x - t.position[0], sn.nav.r_n.v.y - t.position[1], sn.nav.v_n.v.x - t.velocity[0], sn.nav.v_n.v.y - t.velocity[1]];
                let z = [0, 1, 3, 4].iter().zip(off).map(|(i, o)| format!("{o:.3}/{:.3}", sn.p[(*i, *i)].sqrt())).collect::<Vec<_>>();
                println!("   {n} epoch {k}: {}", z.join(" "));
            }
        }
        let batch = found.batch.unwrap();
        println!(
            "{name}: {} linearisations, {:?}, {mean:.2} sd apart, sds differ by {:.1} %",
            batch.linearisations,
            batch.limits,
            100.0 * sd
        );
        assert!(batch.left < 0.01);
        assert!(
            found
                .snapshots
                .iter()
                .all(|s| (0..9).all(|i| s.p[(i, i)] >= 0.0))
        );
    }
}

/// Many more records settle, too; `SVARTBOKS_SEEDS` says how many seeds a class.
#[test]
fn settles_on_every_class() {
    let seeds = std::env::var("SVARTBOKS_SEEDS")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(1);
    let mut most = 0;
    let mut failures = Vec::new();
    for class in Class::CRASHES {
        for seed in 1..=seeds {
            match run(&Crash::draw(class, seed, 30.0), Smoother::Batch) {
                Ok(found) => {
                    let batch = found.batch.unwrap();
                    if batch.linearisations > 6 || batch.limits.total() > 0 {
                        println!(
                            "{class} {seed}: {} linearisations, {:?}",
                            batch.linearisations, batch.limits
                        );
                    }
                    most = most.max(batch.linearisations);
                }
                Err(e) => failures.push(format!("{class} {seed}: {e}")),
            }
        }
    }
    println!(
        "{} classes, {seeds} seeds: at most {most} linearisations, failures {failures:?}",
        Class::CRASHES.len()
    );
    assert!(failures.is_empty());
}

/// What is not a number is an error with a place, not a trajectory.
#[test]
fn not_a_number_is_an_error() {
    let mut crash = Crash::draw(Class::Drive, 86, 30.0);
    crash.epochs.list[500].accel.x = f64::NAN;
    assert!(run(&crash, Smoother::Batch).is_err());
}
