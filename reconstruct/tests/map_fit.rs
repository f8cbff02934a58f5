//! Paths of simulated crashes laid on road maps, against truth: the right road at the right place with honest
//! bounds, or an honest "cannot tell".
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::panic,
    reason = "tests"
)]

mod support;
#[path = "support/world.rs"]
mod world;

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Vector2};
use reconstruct::export::ellipse::Covariance;
use reconstruct::export::geodesy::TangentPlane;
use reconstruct::findings::Reconstruction;
use reconstruct::map::network::Traffic;
use reconstruct::map::place::{Job, RestPoint, lay, reconstruct_on};
use reconstruct::map::roads::{OneWay, RoadLine, Roads};
use reconstruct::map::search::Verdict;
use reconstruct::run::Options;
use reconstruct::simulate::{Class, Scenario, Simulated, simulate};
use schema::num;
use world::{Draw, Line, centre_line, driven, moved, on_earth, pose, wandering};

const PLACE: [f64; 2] = [-33.87, 151.2];
const ROUGH_SD_M: f64 = 30.0;

struct World {
    heading: f64,
    rest: Vector2<f64>,
    lines: Vec<Line>,
}

/// The road of the crash first, then twenty others that cross the place at random.
fn town(simulated: &Simulated, seed: u64) -> World {
    let mut draw = Draw::new(seed);
    let heading = draw.uniform(0.0, TAU);
    let rest = Vector2::new(draw.normal(), draw.normal()) * ROUGH_SD_M;
    let offset = 1.75 + draw.normal();
    let road = centre_line(&driven(simulated), offset, 1.0, &mut draw);
    let mut lines = vec![moved(&road, heading, rest)];
    for _ in 0..10 {
        let from = Vector2::new(draw.uniform(-150.0, 150.0), draw.uniform(-150.0, 150.0));
        let way = draw.uniform(0.0, TAU);
        lines.push(wandering(from, way, 900.0, &mut draw));
        lines.push(wandering(from, way + PI, 500.0, &mut draw));
    }
    World {
        heading,
        rest,
        lines,
    }
}

fn job(lines: Vec<RoadLine>) -> Job {
    Job {
        roads: Roads {
            file: "town.geojson".to_owned(),
            sha256: [0; 32],
            lines,
        },
        point: RestPoint {
            latitude_deg: PLACE[0],
            longitude_deg: PLACE[1],
            sd_m: ROUGH_SD_M,
        },
        heading: None,
        traffic: Traffic::Right,
    }
}

fn on_map(lines: &[Line]) -> Vec<RoadLine> {
    on_earth(lines, &TangentPlane::at(&pose(PLACE[0], PLACE[1])))
}

fn run(simulated: &Simulated, lines: Vec<RoadLine>) -> Reconstruction {
    let record = support::record(simulated);
    let mut result = reconstruct_on(&record, &Options::default(), &job(lines)).unwrap();
    lay(&mut result);
    result
}

fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

#[derive(Default)]
struct Score {
    cases: usize,
    placed: usize,
    wrong: usize,
    /// Ambiguous, with the truth among the answers.
    open: usize,
    no_fit: usize,
    /// Squared errors over their bound at 95 %: heading, place, and the path on the earth 20, 10, 5 s before.
    heading: Vec<f64>,
    place: Vec<f64>,
    path: Vec<f64>,
}

fn mahalanobis(d: Vector2<f64>, p: Matrix2<f64>) -> f64 {
    d.dot(&(p.try_inverse().unwrap() * d))
}

fn score(simulated: &Simulated, world: &World, r: &Reconstruction, out: &mut Score) {
    let placing = r.map.as_ref().unwrap();
    out.cases += 1;
    let near = |i: usize| {
        let fit = &placing.answers[i].fit;
        let d = fit.pose.xy() - world.rest;
        let p = fit.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let turn = wrapped(fit.pose.z - world.heading);
        (d, mahalanobis(d, p), turn, fit.covariance[(2, 2)])
    };
    match placing.verdict {
        Verdict::NoFit => {
            out.no_fit += 1;
            return;
        }
        Verdict::Ambiguous => {
            let among = (0..placing.answers.len()).any(|i| {
                let (d, _, turn, _) = near(i);
                d.norm() < 45.0 && turn.abs() < 0.1
            });
            out.open += usize::from(among);
            assert!(r.rest_pose.is_none() && r.limits[0].contains("ambiguous"));
            return;
        }
        Verdict::Placed => out.placed += 1,
    }
    assert_eq!(placing.runs, 2);
    let (d, squared, turn, variance) = near(0);
    out.wrong += usize::from(d.norm() > 30.0 || turn.abs() > 0.1);
    out.place.push(squared / 5.991);
    out.heading.push(turn * turn / variance / 3.841);
    let trigger = simulated.truth.facts.trigger_at_s;
    let onset = r.impacts.first().map_or(0.0, |i| i.t_s.value);
    let best = r.rest_pose.unwrap();
    let place = placing.answers[0].fit.pose.xy();
    for before in [20.0, 10.0, 5.0] {
        let Some(state) = r.states.iter().rev().find(|s| s.t_s <= onset - before) else {
            continue;
        };
        let row = &simulated.truth.rows[num::round_usize((state.t_s + trigger) * 100.0)];
        let (s, c) = world.heading.sin_cos();
        let [n, e, _] = row.position;
        let truth = world.rest + Vector2::new(c * n - s * e, s * n + c * e);
        let found = place + Vector2::new(state.position[0], state.position[1]);
        let p = Covariance::absolute(state, &best);
        let p = Matrix2::new(p.north, p.cross, p.cross, p.east);
        out.path.push(mahalanobis(found - truth, p) / 5.991);
    }
}

fn scored(classes: &[Class], seeds: std::ops::Range<u64>) -> Score {
    let mut out = Score::default();
    for class in classes {
        for seed in seeds.clone() {
            let simulated = simulate(&Scenario::draw(*class, seed)).unwrap();
            let world = town(&simulated, seed * 10 + num::u64_of(class.name().len()));
            let r = run(&simulated, on_map(&world.lines));
            score(&simulated, &world, &r, &mut out);
        }
    }
    out
}

/// Share within the bound, and the mean of the squares over it.
fn covered(squares: &[f64]) -> (f64, f64) {
    let n = num::real(squares.len().max(1));
    let inside = num::real(squares.iter().filter(|x| **x <= 1.0).count());
    (inside / n, squares.iter().sum::<f64>() / n)
}

/// 66 crashes of seeds that nothing was chosen on, the heading anywhere on the circle, the rough point off by
/// 30 m (one sigma), the lane by 1 m, the drawn line by 1 m.
#[test]
fn the_right_place_with_honest_bounds() {
    let (left, right) = Class::CRASHES.split_at(3);
    let mut parts = std::thread::scope(|s| {
        let halves = [left, right].map(|classes| s.spawn(|| scored(classes, 5000..5011)));
        halves.map(|h| h.join().unwrap())
    });
    let [all, more] = &mut parts;
    all.heading.append(&mut more.heading);
    all.place.append(&mut more.place);
    all.path.append(&mut more.path);
    let placed = all.placed + more.placed;
    let wrong = all.wrong + more.wrong;
    let cases = all.cases + more.cases;
    let open = all.open + more.open;
    let no_fit = all.no_fit + more.no_fit;
    println!(
        "{cases} crashes: {placed} placed, {wrong} of them wrong; {} ambiguous, the truth among the answers of \
         {open}; {no_fit} without a fit",
        cases - placed - no_fit
    );
    let mut honest = true;
    for (name, squares) in [
        ("heading", &all.heading),
        ("place", &all.place),
        ("path on the earth", &all.path),
    ] {
        let (share, mean) = covered(squares);
        println!(
            "{name}: {:.1} % within the 95 % bound, mean square over the bound {mean:.3}",
            100.0 * share
        );
        // Not too narrow, and not so wide that anything passes (0.26 for one number, 0.33 for two).
        honest &= share >= 0.90 && mean > 0.04;
    }
    assert!(honest && wrong == 0 && no_fit <= 1 && placed * 10 >= cases * 6);
}

/// A straight drive on a straight road: both directions fit, and no place along it is fixed.
#[test]
fn a_straight_road_is_ambiguous() {
    for seed in 5100..5103 {
        let mut scenario = Scenario::draw(Class::Frontal, seed);
        scenario.manoeuvre.curves.clear();
        let simulated = simulate(&scenario).unwrap();
        let mut draw = Draw::new(seed);
        let heading = draw.uniform(0.0, TAU);
        let drawn = moved(&driven(&simulated), heading, Vector2::zeros());
        let (first, last) = (drawn[0], drawn[drawn.len() - 1]);
        let way = (last - first).normalize();
        let left = Vector2::new(way.y, -way.x) * 1.75;
        let road = vec![first - way * 2500.0 + left, last + way * 2500.0 + left];
        let r = run(&simulated, on_map(std::slice::from_ref(&road)));
        let placing = r.map.as_ref().unwrap();
        assert_eq!(placing.verdict, Verdict::Ambiguous, "{seed}");
        let why = placing.why.join(" ");
        assert!(why.contains("too straight"), "{why}");
        let turned = placing.answers.iter().skip(1).any(|a| {
            let turn = wrapped(a.fit.pose.z - placing.answers[0].fit.pose.z);
            turn.abs() > 3.0 && a.probability > 0.05
        });
        assert!(turned, "{seed}: no rival the other way round: {why}");
        // One way only: the direction is known, the place along the road still is not.
        let mut lines = on_map(&[road]);
        lines[0].oneway = OneWay::Along;
        let placing = run(&simulated, lines).map.unwrap();
        assert_eq!(placing.verdict, Verdict::Ambiguous);
        let off = wrapped(placing.answers[0].fit.pose.z - heading);
        assert!(off.abs() < 0.1, "{seed}: {off}");
    }
}

/// The same road twice, and a town without the road.
#[test]
fn congruent_roads_are_ambiguous_and_a_missing_road_fits_nowhere() {
    let mut refused = 0;
    for seed in 5200..5206 {
        let class = Class::CRASHES[num::round_usize(num::real_u64(seed % 4))];
        let simulated = simulate(&Scenario::draw(class, seed)).unwrap();
        let world = town(&simulated, seed);
        let mut twice = world.lines.clone();
        twice.push(moved(&world.lines[0], 0.0, Vector2::new(28.0, -24.0)));
        let r = run(&simulated, on_map(&twice));
        let placing = r.map.as_ref().unwrap();
        // The rough point may all but rule one of them out.
        let rivals: f64 = placing.answers.iter().skip(1).map(|a| a.probability).sum();
        assert!(
            placing.verdict == Verdict::Ambiguous || rivals < 0.05,
            "{class} {seed}: {:?}",
            placing.why
        );
        assert!(placing.answers.len() > 1, "{class} {seed}");
        let r = run(&simulated, on_map(&world.lines[1..]));
        let placing = r.map.as_ref().unwrap();
        refused += usize::from(placing.verdict == Verdict::NoFit);
        assert!(
            placing.verdict != Verdict::Placed && r.rest_pose.is_none(),
            "{class} {seed}: placed on a road it never drove on"
        );
        assert!(r.limits[0].contains("map"), "{}", r.limits[0]);
    }
    println!("{refused} of 6 without their road fit nowhere");
    assert!(refused >= 5);
}
