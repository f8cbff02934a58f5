//! The slips of the published GNSS filter on simulated drives: what each costs.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/gnss_drive.rs"]
mod gnss_drive;

use gnss_drive::{Drive, Plan, drive, town};
use nalgebra::Vector3;
use reconstruct::gnss::published::constants::DT;
use reconstruct::gnss::published::earth::Earth;
use reconstruct::gnss::published::matrices::steady_gain;
use reconstruct::gnss::published::mechanise::body_to_geographic;
use reconstruct::gnss::published::{
    Options, Reading, Source, SpeedAid, SpeedUse, Step, Used, Variant, run,
};
use schema::num::real;

fn options(variant: Variant) -> Options {
    Options {
        variant,
        ..Options::default()
    }
}

/// Distance from the truth at each step, m.
fn errors(drive: &Drive, steps: &[Step]) -> Vec<f64> {
    let off = |s: &Step| (s.position() - drive.truth[s.sample].0).norm();
    steps.iter().map(off).collect()
}

#[test]
fn the_right_turn_of_a_car_that_drives_north() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let east = body_to_geographic(0.0, 0.0, quarter, &Variant::program()) * Vector3::x();
    assert!((east - Vector3::y()).norm() < 1e-15);
    let printed = body_to_geographic(0.0, 0.0, quarter, &Variant::printed()) * Vector3::x();
    assert!((printed + Vector3::y()).norm() < 1e-15);
    // A whole drive, with no fix after the first: only the rotations differ.
    let mut plan = Plan::town(Earth::of(Reading::Published));
    plan.noise = 0.0;
    plan.yaw = 0.0;
    plan.legs = vec![(5.0, 0.0, 0.0), (5.0, 0.0, quarter / 5.0), (6.0, 0.0, 0.0)];
    let drive = drive(&plan, 1);
    let last = |variant: Variant| {
        let mut options = options(variant);
        (options.every, options.stop) = (None, None);
        let steps = run(&drive.input, &drive.initial, &options).unwrap();
        *errors(&drive, &steps).last().unwrap()
    };
    let mut axes = Variant::program();
    axes.rotations = Source::Text;
    let mut still = Variant::program();
    still.transition = Source::Text;
    let (right, axes, still) = (last(Variant::program()), last(axes), last(still));
    println!(
        "end of the turn off by {right:.2} m; axes turned {axes:.0} m; yaw fixed {still:.0} m"
    );
    assert!(right < 3.0 && axes > 100.0 && still > 50.0);
}

/// The velocity measurement is made of the velocity it corrects: of an acceleration only the steady gain enters.
#[test]
fn a_quarter_of_every_acceleration_enters() {
    let gain = steady_gain(4.0 * DT, 1.0);
    assert!((gain - 0.245_7).abs() < 1e-4);
    let mut plan = Plan::town(Earth::of(Reading::Published));
    (plan.noise, plan.speed, plan.yaw) = (0.0, 10.0, 0.0);
    plan.legs = vec![(2.0, 0.0, 0.0), (10.0, 1.0, 0.0)];
    let gained = |variant: Variant| {
        plan_run(&plan, variant, |steps| {
            let at = |i: usize| steps[i].velocity().norm();
            (at(steps.len() - 1) - at(steps.len() - 251)) / 5.0
        })
    };
    let published = gained(Variant::program());
    let mut other = Variant::program();
    other.inertial = Reading::Corrected;
    let propagated = gained(other);
    println!("of 1 m/s^2: {published:.4} published, {propagated:.4} propagated, gain {gain:.4}");
    // Levelling takes the acceleration for a slope, slowly: it has had 3 % of it by then in both.
    assert!((published / propagated - gain).abs() < 1e-3 && (propagated - 1.0).abs() < 0.05);
}

fn plan_run<T>(plan: &Plan, variant: Variant, look: impl Fn(&[Step]) -> T) -> T {
    let drive = drive(plan, 1);
    let mut options = options(variant);
    (options.every, options.stop) = (None, None);
    look(&run(&drive.input, &drive.initial, &options).unwrap())
}

/// In a turn at constant speed the measured velocity's average with its past shortens it, the first-order rotation and
/// the centripetal acceleration stretch it.
#[test]
fn a_turn_changes_the_speed() {
    let mut plan = Plan::town(Earth::of(Reading::Published));
    (plan.noise, plan.speed) = (0.0, 10.0);
    plan.legs = vec![(20.0, 0.0, 0.5)];
    let grown = |variant: Variant| {
        plan_run(&plan, variant, |steps| {
            steps.last().unwrap().velocity().norm()
        })
    };
    let published = grown(Variant::program());
    let mut once = Variant::program();
    once.inertial = Reading::Corrected;
    let measured = grown(once);
    once.turn = Reading::Corrected;
    once.orthogonal = Reading::Corrected;
    let turned = grown(once);
    once.speed = Reading::Corrected;
    let corrected = grown(once);
    println!(
        "10 m/s after 17.8 s at 0.5 rad/s: {published:.3} published, {measured:.3} propagated, {turned:.3} turned \
         once, {corrected:.3} with the speed along x"
    );
    assert!((corrected - 10.0).abs() < 1e-3 && (turned - 10.0).abs() < 1e-3);
    assert!((8.8..8.95).contains(&published) && (10.6..10.75).contains(&measured));
}

#[test]
fn a_stop_sets_the_speed_and_leaves_the_rest() {
    let drive = town(Variant::program(), 5);
    let steps = run(&drive.input, &drive.initial, &Options::default()).unwrap();
    let stops: Vec<usize> = (1..steps.len())
        .filter(|k| steps[*k].used == Used::Stop)
        .collect();
    for k in &stops {
        let (before, at) = (&steps[k - 1], &steps[*k]);
        assert_eq!(at.variances, before.variances);
        assert_eq!(at.position(), before.position());
        assert_eq!(at.bias(), before.bias());
        assert_eq!(at.velocity(), Vector3::zeros());
        assert!((at.angles().z - before.angles().z).abs() < 1e-300);
        assert!(at.angles().fixed_rows::<2>(0).norm() < 0.01);
        // Only where the car stood, but for the window of one second and its noise.
        assert!(drive.truth[at.sample].1 < 0.2);
    }
    let off = Options {
        stop: None,
        ..Options::default()
    };
    let moving = run(&drive.input, &drive.initial, &off).unwrap();
    let mean = |steps: &[Step]| {
        stops
            .iter()
            .map(|k| steps[*k].velocity().norm())
            .sum::<f64>()
            / real(stops.len())
    };
    println!(
        "{} samples at a stop; without the detector {:.2} m/s there",
        stops.len(),
        mean(&moving)
    );
    assert!(stops.len() > 150 && mean(&moving) > 0.05);
}

/// [S00, 3.8]: no fix for two minutes, without and with an exact speed once a second.
#[test]
fn exact_speed_carries_the_filter_through_a_tunnel() {
    let mut plan = Plan::town(Earth::of(Reading::Published));
    plan.legs = vec![
        (15.0, 0.3, 0.0),
        (6.0, 0.0, 0.2),
        (25.0, -0.2, 0.0),
        (10.0, 0.0, -0.15),
        (30.0, 0.25, 0.0),
        (34.0, 0.0, 0.01),
    ];
    let drive = drive(&plan, 17);
    let speeds: Vec<f64> = (0..drive.input.fixes.len())
        .map(|n| drive.truth[150 + 50 * n - plan.latency].1)
        .collect();
    let last = |speed: Option<SpeedAid>| {
        let mut options = options(Variant::program());
        (options.every, options.stop, options.speed) = (None, None, speed);
        let steps = run(&drive.input, &drive.initial, &options).unwrap();
        errors(&drive, &steps).into_iter().fold(0.0, f64::max)
    };
    let aid = |how| {
        Some(SpeedAid {
            speeds: speeds.clone(),
            how,
        })
    };
    let (none, set, measured) = (
        last(None),
        last(aid(SpeedUse::Set)),
        last(aid(SpeedUse::Measure(0.05))),
    );
    println!(
        "120 s without a fix: {none:.0} m; speed set {set:.0} m; speed measured {measured:.0} m"
    );
    assert!(set < 0.3 * none && measured < 0.3 * none);
}

/// The measured course jumps by a turn at north; with the text's variance the jump pulls the yaw.
#[test]
fn course_across_north() {
    let mut plan = Plan::town(Earth::of(Reading::Published));
    (plan.noise, plan.yaw) = (0.0, -0.3);
    plan.legs = vec![(70.0, 0.0, 0.0), (3.0, 0.0, 0.2), (30.0, 0.0, 0.0)];
    let drive = drive(&plan, 2);
    let mut variant = Variant::text();
    let worst = |variant: Variant| {
        let mut options = options(variant);
        // No noise: to the detector the car would stand.
        options.stop = None;
        let steps = run(&drive.input, &drive.initial, &options).unwrap();
        steps
            .iter()
            .map(|s| {
                let off = s.angles().z - drive.truth[s.sample].2;
                (off.sin().atan2(off.cos())).abs()
            })
            .fold(0.0, f64::max)
    };
    let published = worst(variant);
    variant.course = Reading::Corrected;
    let corrected = worst(variant);
    println!("yaw off by at most {published:.3} rad unwrapped, {corrected:.3} rad wrapped");
    assert!(published > 0.5 && corrected < 0.1);
}

/// What the switches are worth, biases known and accelerometers without: the largest error, mean of 20 drives.
#[test]
fn without_fixes_the_corrected_filter_is_nearer() {
    let mean = |variant: Variant, every: Option<usize>| {
        let worst = (0..20).map(|seed| {
            let drive = town(variant, seed);
            let mut options = options(variant);
            options.every = every;
            let steps = run(&drive.input, &drive.initial, &options).unwrap();
            errors(&drive, &steps).into_iter().fold(0.0, f64::max)
        });
        worst.sum::<f64>() / 20.0
    };
    let [program, text, corrected] = [Variant::program(), Variant::text(), Variant::corrected()]
        .map(|v| [Some(5), Some(10), None].map(|every| mean(v, every)));
    println!("largest error of 43 s, fixes every 5, 10 s and none, m:");
    println!("program {program:.1?}, text {text:.1?}, corrected {corrected:.1?}");
    assert!(corrected[2] < 0.5 * program[2]);
}

/// A wrong bias about z stays: the course that would tell has a variance of 1e10 rad^2.
#[test]
fn the_bias_about_z_is_not_estimated() {
    let mut drive = town(Variant::program(), 23);
    drive.initial.bias.z += 0.005;
    let moved = |variant: Variant| {
        let steps = run(&drive.input, &drive.initial, &options(variant)).unwrap();
        steps.last().unwrap().bias().z - drive.initial.bias.z
    };
    let (program, text) = (moved(Variant::program()), moved(Variant::text()));
    println!("of -0.005 rad/s: {program:.1e} in the program, {text:.1e} in the text");
    assert!(program.abs() < 1e-6);
}

#[test]
fn time_constants_of_the_tuning() {
    let constant = |q: f64, r: f64| DT / steady_gain(q * DT, r);
    assert!((constant(1.0, 1e4) - 14.15).abs() < 0.1);
    assert!((constant(1.0, 1e5) - 44.7).abs() < 0.2);
}
