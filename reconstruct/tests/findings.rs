//! The findings against the truth of simulated crashes: what the bounds hold, class by class.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured"
)]

use std::collections::BTreeMap;

use reconstruct::epochs::Epochs;
use reconstruct::findings::{Figure, Impact, Reconstruction};
use reconstruct::run::{Facts, Options, from_epochs};
use reconstruct::simulate::truth::TrueImpact;
use reconstruct::simulate::{Class, Scenario, Simulated, TruthRow, simulate};
use schema::num::{real, round_usize, u64_of};
use schema::parts::Completion;

/// First seed; tuning used 1 to 100.
const SEEDS: u64 = 5000;

struct Case {
    simulated: Simulated,
    result: Reconstruction,
}

impl Case {
    fn run(class: Class, seed: u64) -> Self {
        Self::run_with(class, seed, &Options::default())
    }

    fn run_with(class: Class, seed: u64, options: &Options) -> Self {
        let simulated = simulate(&Scenario::draw(class, seed)).unwrap();
        let samples = simulated.samples();
        let from = round_usize((simulated.truth.facts.trigger_at_s - 30.0).max(0.01) * 100.0);
        let list: Vec<_> = (from..samples.len())
            .map(|k| (u64_of(k), 100, samples[k]))
            .collect();
        let start_s = (real(from) - 1.0) * 0.01;
        let header = simulated.scenario.header();
        let epochs = Epochs::from_samples(header, &list, start_s, &[]).unwrap();
        let completion = Completion {
            complete: true,
            reasons: Vec::new(),
            ends_at_rest: true,
        };
        let facts = Facts {
            triggers: &[],
            completion: &completion,
            utc_zero_ns: None,
        };
        let result = from_epochs(&epochs, &facts, options).unwrap();
        Self { simulated, result }
    }

    fn row(&self, t: f64) -> &TruthRow {
        let rows = &self.simulated.truth.rows;
        &rows[round_usize(t * 100.0).min(rows.len() - 1)]
    }

    /// True impacts with what was found of them.
    fn pairs(&self) -> Vec<(&TrueImpact, &Impact)> {
        let found = &self.result.impacts;
        let near = |t: &TrueImpact| found.iter().find(|i| (i.t_s.value - t.t_s).abs() < 0.05);
        let truth = self.simulated.truth.facts.impacts.iter();
        truth.filter_map(|t| near(t).map(|i| (t, i))).collect()
    }
}

/// Coverage and size of errors by name.
#[derive(Default)]
struct Table(BTreeMap<&'static str, Vec<(f64, f64)>>);

impl Table {
    fn add(&mut self, name: &'static str, figure: &Figure, truth: f64) {
        let entry = (figure.value - truth, figure.sd);
        self.0.entry(name).or_default().push(entry);
    }

    fn add_angle(&mut self, name: &'static str, figure: &Figure, truth: f64) {
        let off = figure.value - truth;
        let off = off - 360.0 * (off / 360.0).round();
        self.0.entry(name).or_default().push((off, figure.sd));
    }

    /// Share inside 95 %.
    fn inside(&self, name: &str) -> f64 {
        let list = &self.0[name];
        let within = list.iter().filter(|(e, sd)| e.abs() <= 1.96 * sd);
        real(within.count()) / real(list.len())
    }

    fn show(&self, title: &str) {
        for (name, list) in &self.0 {
            let mut errors: Vec<f64> = list.iter().map(|x| x.0.abs()).collect();
            errors.sort_by(f64::total_cmp);
            let mut sds: Vec<f64> = list.iter().map(|x| x.1).collect();
            sds.sort_by(f64::total_cmp);
            println!(
                "{title:9} {name:24} n {:4}  in 95 %: {:5.1}  mean {:8.4}  |error| median {:8.4}  p95 {:8.4}  sd {:8.4}",
                list.len(),
                100.0 * self.inside(name),
                list.iter().map(|x| x.0).sum::<f64>() / real(list.len()),
                errors[list.len() / 2],
                errors[list.len() * 95 / 100],
                sds[list.len() / 2],
            );
        }
    }
}

fn impact(table: &mut Table, truth: &TrueImpact, found: &Impact) {
    let (s, c) = truth.heading_deg.to_radians().sin_cos();
    let (x, y) = (truth.cg.longitudinal_mps, truth.cg.lateral_mps);
    let dv = &found.delta_v;
    table.add("dv longitudinal", &dv.longitudinal_mps, x);
    table.add("dv lateral", &dv.lateral_mps, y);
    table.add("dv resultant", &dv.resultant_mps, truth.cg.resultant_mps);
    table.add("dv north", &dv.north_mps, c * x - s * y);
    table.add("dv east", &dv.east_mps, s * x + c * y);
    table.add_angle("pdof", &dv.pdof_deg, truth.cg.pdof_deg);
    table.add(
        "yaw rate change",
        &dv.yaw_rate_change_degps,
        truth.spin_degps,
    );
    table.add("speed", &found.speed_mps, truth.speed_mps);
    table.add("onset", &found.t_s, truth.t_s);
    table.add("duration", &dv.duration_s, truth.duration_s);
}

/// Way over the ground between two times of the truth.
fn way(rows: &[TruthRow], from: f64, to: f64) -> f64 {
    let speed = |r: &TruthRow| r.velocity[0].hypot(r.velocity[1]);
    rows.windows(2)
        .map(|p| {
            let share = ((to.min(p[1].t_s) - from.max(p[0].t_s)) / 0.01).clamp(0.0, 1.0);
            0.5 * (speed(&p[0]) + speed(&p[1])) * 0.01 * share
        })
        .sum()
}

fn reaction(table: &mut Table, case: &Case) {
    let rows = &case.simulated.truth.rows;
    let onset = case.simulated.truth.facts.impacts[0].t_s;
    for row in &case.result.details.reaction.rows {
        // The table refers to the onset found; the truth is taken at the same time before the true one.
        let t = onset + row.before_s;
        let k = round_usize((t * 100.0).floor());
        let share = t * 100.0 - real(k);
        let mix =
            |f: &dyn Fn(&TruthRow) -> f64| f(&rows[k]) + (f(&rows[k + 1]) - f(&rows[k])) * share;
        if row.before_s < 0.0 {
            table.add("row speed", &row.speed_mps, mix(&|r| r.speed));
            table.add("row distance", &row.distance_m, way(rows, t, onset));
        }
        table.add("row north", &row.north_m, mix(&|r| r.position[0]));
        table.add("row east", &row.east_m, mix(&|r| r.position[1]));
        table.add_angle(
            "row heading",
            &row.heading_deg,
            rows[k].heading.to_degrees(),
        );
    }
}

fn extremes(table: &mut Table, case: &Case) {
    let details = &case.result.details;
    let mean = |t: f64| {
        let middle = round_usize(t * 100.0);
        let window = &case.simulated.truth.rows[middle - 12..=middle + 12];
        window.iter().map(|r| r.accel[1]).sum::<f64>() / real(window.len())
    };
    let slip = |r: &TruthRow| {
        let (s, c) = r.heading.sin_cos();
        let [x, y, _] = r.velocity;
        (y * c - x * s).atan2(x * c + y * s).to_degrees()
    };
    let lateral = details.before.lateral_mps2.unwrap();
    table.add("lateral before", &lateral.value, mean(lateral.t_s));
    let sideslip = details.before.sideslip_deg.unwrap();
    table.add(
        "sideslip before",
        &sideslip.value,
        slip(case.row(sideslip.t_s)),
    );
    let after = details.after.unwrap();
    if let Some(x) = after.sideslip_deg {
        table.add_angle("sideslip after", &x.value, slip(case.row(x.t_s)));
    }
    if let Some(x) = after.lateral_mps2 {
        table.add("lateral after", &x.value, mean(x.t_s));
    }
}

fn rest(table: &mut Table, case: &Case) {
    let facts = &case.simulated.truth.facts;
    let found = case.result.details.final_rest.as_ref().unwrap();
    let moving = |r: &&TruthRow| r.velocity[0].hypot(r.velocity[1]) > 0.1;
    let stop = case.simulated.truth.rows.iter().rfind(moving).unwrap().t_s;
    table.add("stop", &found.stop_t_s, stop);
    table.add_angle("rest roll", &found.roll_deg, facts.rest_roll_deg);
    table.add("rest pitch", &found.pitch_deg, facts.rest_pitch_deg);
    let onset = facts.impacts[0].t_s;
    let way_to = way(&case.simulated.truth.rows, onset, facts.rest_t_s);
    let from = found.from_impact.unwrap();
    table.add("rest path", &from.path_m, way_to);
    let place = case.row(onset);
    table.add(
        "rest straight",
        &from.straight_m,
        place.position[0].hypot(place.position[1]),
    );
    let rows = &case.simulated.truth.rows;
    let turned: f64 = rows[round_usize(onset * 100.0)..]
        .windows(2)
        .map(|p| {
            let step = p[1].heading - p[0].heading;
            step - std::f64::consts::TAU * (step / std::f64::consts::TAU).round()
        })
        .sum();
    table.add("rest rotation", &from.rotation_deg, turned.to_degrees());
}

#[test]
fn bounds_hold_the_truth_in_every_class() {
    let count: u64 = std::env::var("FINDINGS_SEEDS").map_or(16, |n| n.parse().unwrap());
    let first: u64 = std::env::var("FINDINGS_FIRST").map_or(SEEDS, |n| n.parse().unwrap());
    let mut all = Table::default();
    let mut second = Table::default();
    let mut missed = 0;
    for class in Class::CRASHES {
        let mut table = Table::default();
        for seed in first..first + count {
            let case = Case::run(class, seed);
            for (truth, found) in case.pairs() {
                impact(&mut table, truth, found);
                impact(&mut all, truth, found);
            }
            // An impact of hardly 8 km/h may be none by the rule of 49 CFR 563.
            let onset = case.simulated.truth.facts.impacts[0].t_s;
            let first = case.result.impacts.first();
            if first.is_none_or(|i| (i.t_s.value - onset).abs() > 0.05) {
                missed += 1;
                continue;
            }
            for each in [&mut table, &mut all] {
                reaction(each, &case);
                extremes(each, &case);
                rest(each, &case);
            }
            if class == Class::Double {
                double(&mut second, &case);
            }
        }
        if std::env::var("FINDINGS_SHOW").is_ok() {
            table.show(class.name());
        }
    }
    println!("first impact not found in {missed} of {} runs", 6 * count);
    assert!(missed <= 5);
    all.show("all");
    second.show("second");
    for name in all.0.keys() {
        // The largest sideslip is picked among many, and the pick favours what is too large.
        let least = if name.starts_with("sideslip") {
            0.80
        } else {
            0.86
        };
        assert!(all.inside(name) >= least, "{name}: {}", all.inside(name));
    }
    for name in ["dv resultant", "pdof", "interval", "interval path"] {
        assert!(
            second.inside(name) >= 0.80,
            "second, {name}: {}",
            second.inside(name)
        );
    }
}

fn double(table: &mut Table, case: &Case) {
    let facts = &case.simulated.truth.facts;
    let pairs = case.pairs();
    if pairs.len() == 2 {
        impact(table, pairs[1].0, pairs[1].1);
        assert_eq!(case.result.details.multi_event, 2);
        let between = &case.result.details.intervals[0];
        let apart = facts.impacts[1].t_s - facts.impacts[0].t_s;
        table.add("interval", &between.duration_s, apart);
        let rows = &case.simulated.truth.rows;
        let path = way(rows, facts.impacts[0].t_s, facts.impacts[1].t_s);
        table.add("interval path", &between.path_m, path);
    }
}

/// Onto the roof: two quarter turns, in the right direction, and begin and end where they were.
#[test]
fn a_roll_over_is_counted() {
    let mut table = Table::default();
    for seed in SEEDS..SEEDS + 12 {
        let case = Case::run(Class::Roof, seed);
        let plan = case.simulated.scenario.manoeuvre.rollover.unwrap();
        let found = case.result.details.rollover.as_ref().expect("a roll-over");
        println!("{seed}: {found:?} {plan:?}");
        assert_eq!((found.axis, found.quarter_turns), ("roll", 2), "{seed}");
        assert!(found.certain);
        let onset = case.simulated.truth.facts.impacts[0].t_s;
        let truth = case.simulated.truth.facts.rest_roll_deg - case.row(onset).roll.to_degrees();
        let truth = truth - 360.0 * ((truth - plan.angle.to_degrees()) / 360.0).round();
        table.add("angle", &found.angle_deg, truth);
        assert!(
            (found.begin_t_s.value - plan.t).abs() < 0.4 * plan.duration,
            "{seed}"
        );
        assert!((found.end_t_s.value - plan.t - plan.duration).abs() < 0.4 * plan.duration);
        let rest = case.result.details.final_rest.as_ref().unwrap();
        assert_eq!(rest.lies_on, "roof");
    }
    table.show("roof");
    for class in [Class::Side, Class::Stop] {
        for seed in SEEDS..SEEDS + 4 {
            assert_eq!(Case::run(class, seed).result.details.rollover, None);
        }
    }
}

/// A window hides states, never a part of a distance.
#[test]
fn a_window_does_not_shorten_the_way() {
    let whole = Case::run(Class::Frontal, SEEDS + 3);
    let onset = whole.result.impacts[0].t_s.value;
    let options = Options {
        from_s: Some(onset - 3.0),
        to_s: Some(onset + 0.5),
        reaction_s: 8.0,
        ..Options::default()
    };
    let part = Case::run_with(Class::Frontal, SEEDS + 3, &options).result;
    let details = &part.details;
    assert!(part.states.len() < 400);
    assert_eq!(details.final_rest, whole.result.details.final_rest);
    assert_eq!(details.reaction.rows.len(), 17);
    let rows = &whole.result.details.reaction.rows;
    assert_eq!(details.reaction.rows[6..], rows[..]);
}
