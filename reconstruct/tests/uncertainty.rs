//! Where the uncertainty comes from, sample paths, and which smoother answers, on simulated crashes.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured"
)]

use reconstruct::run::Options;
use reconstruct::simulate::{Class, Scenario};
use reconstruct::smooth::Smoother;
use reconstruct::validate::sets::Prepared;

/// Error budget and sample paths of a refined run: shares add up to one, the spread is the one shown, the paths meet at
/// the rest and spread as the ellipses say.
#[test]
fn uncertainty_has_sources_and_paths() {
    for smoother in [Smoother::Rts, Smoother::Batch] {
        let options = Options {
            smoother,
            ..Options::default()
        };
        let (mut inside, mut all) = (0.0, 0.0);
        for seed in 9501..9507 {
            let prepared = Prepared::new(&Scenario::draw(Class::Oblique, seed), None).unwrap();
            let r = prepared.run(&options).unwrap();
            let d = &r.details;
            assert_eq!(d.smoother, Some(smoother));
            let names: Vec<&str> = d.budgets.iter().map(|b| b.figure.as_str()).collect();
            for name in [
                "impact speed",
                "delta-V longitudinal",
                "heading at the start",
            ] {
                assert!(names.contains(&name), "{names:?}");
            }
            for budget in &d.budgets {
                let sum: f64 = budget.sources.iter().map(|s| s.1).sum();
                assert!((sum - 1.0).abs() < 1e-9, "{budget:?}");
                assert!(budget.sd > 0.0 && budget.sources.iter().all(|s| s.1 >= 0.0));
            }
            let near = |name: &str, shown: f64, allowed: f64| {
                let budget = d.budgets.iter().find(|b| b.figure == name).unwrap();
                let off = (budget.sd / shown - 1.0).abs();
                assert!(off < allowed, "{seed} {name}: {} {shown}", budget.sd);
            };
            let impact = &r.impacts[0];
            near("impact speed", impact.speed_mps.sd, 0.05);
            near(
                "delta-V longitudinal",
                impact.delta_v.longitudinal_mps.sd,
                0.05,
            );
            near("heading at impact", impact.heading_deg.sd, 0.05);
            near(
                "heading at the start",
                r.states[0].sd_heading.to_degrees(),
                0.05,
            );
            let first = &r.states[0];
            let (nn, ee, ne) = (
                first.sd_north.powi(2),
                first.sd_east.powi(2),
                first.cov_north_east,
            );
            assert_eq!(d.paths.places.len(), 24);
            assert!((d.paths.t_s[0] - first.t_s).abs() < 0.011);
            for path in &d.paths.places {
                let [n, e] = [
                    path[0][0] - first.position[0],
                    path[0][1] - first.position[1],
                ];
                let chi = (ee * n * n - 2.0 * ne * n * e + nn * e * e) / (nn * ee - ne * ne);
                inside += f64::from(u8::from(chi <= 5.991));
                all += 1.0;
                let last = path.last().unwrap();
                assert!(last[0].hypot(last[1]) < 0.1, "{last:?}");
            }
        }
        let share = inside / all;
        println!(
            "{}: {share:.3} of the sample paths begin in the 95 % ellipse",
            smoother.name()
        );
        // 144 of them: 0.95 +- 0.018.
        assert!((0.90..=0.99).contains(&share), "{share}");
    }
}

/// A run that is asked for no smoother, or for sets, has neither.
#[test]
fn no_smoother_no_budget() {
    let prepared = Prepared::new(&Scenario::draw(Class::Oblique, 9501), None).unwrap();
    for (smoother, alone) in [(Smoother::None, false), (Smoother::Rts, true)] {
        let options = Options {
            smoother,
            alone,
            ..Options::default()
        };
        let d = prepared.run(&options).unwrap().details;
        assert!(d.budgets.is_empty() && d.paths.places.is_empty());
        assert_eq!(d.smoother, Some(smoother));
    }
}

/// A record that ends moving, and a roll-over, are solved all at once; a plain crash is not unless asked.
#[test]
fn the_smoother_follows_the_record() {
    let options = Options {
        alone: true,
        ..Options::default()
    };
    let used = |class, cut| {
        let prepared = Prepared::new(&Scenario::draw(class, 9510), cut).unwrap();
        prepared.run(&options).unwrap().details.smoother
    };
    assert_eq!(used(Class::Frontal, None), Some(Smoother::Rts));
    assert_eq!(used(Class::Frontal, Some(0.3)), Some(Smoother::Batch));
    assert_eq!(used(Class::Roof, None), Some(Smoother::Batch));
}
