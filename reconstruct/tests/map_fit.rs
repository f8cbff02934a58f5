//! x
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]
mod support;
#[path = "support/world.rs"]
mod world;
use nalgebra::{Matrix2, Vector2};
use reconstruct::export::geodesy::TangentPlane;
use reconstruct::map::align::Prior;
use reconstruct::map::drift::Path;
use reconstruct::map::network::{Network, Traffic};
use reconstruct::map::search::{search, Verdict, worst_place};
use reconstruct::run::{Options, reconstruct};
use reconstruct::simulate::Class;
use world::*;

#[test]
fn rate() {
    let mut t = std::collections::BTreeMap::<String, u32>::new();
    let (mut hc, mut pc, mut n) = (0, 0, 0);
    let clock = std::time::Instant::now();
    let mut spent = 0.0;
    for class in Class::CRASHES {
        for seed in 1..=12_u64 {
 if let Ok(d) = std::env::var("DBG") { if d != format!("{class} {seed}") { continue; } }
            let (sim, record) = support::crash(class, seed);
            let r = reconstruct(&record, &Options::default()).unwrap();
            let Some(path) = Path::sample(&r.states, r.impacts.first().map_or(1e9, |i| i.t_s.value)) else { println!("{class} {seed} short"); continue };
            let mut draw = Draw::new(seed * 100 + class as u64);
            let heading = draw.uniform(0.0, std::f64::consts::TAU);
            let rest = Vector2::new(30.0 * draw.normal(), 30.0 * draw.normal());
            let offset = 1.75 + 1.0 * draw.normal();
            let road = centre_line(&driven(&sim), offset, 1.0, &mut draw);
            let mut lines = vec![moved(&road, heading, rest)];
            for _ in 0..10 {
                let from = Vector2::new(draw.uniform(-150.0, 150.0), draw.uniform(-150.0, 150.0));
                let h = draw.uniform(0.0, 6.28);
                lines.push(wandering(from, h, 900.0, &mut draw));
                let mut back = wandering(from, h + std::f64::consts::PI, 500.0, &mut draw); back.reverse();
                lines.push(back);
            }
            let plane = TangentPlane::at(&pose(59.9, 10.7));
            let net = Network::near(&on_earth(&lines, &plane), plane, 1500.0, Traffic::Right).unwrap();
            let prior = Prior { place: Matrix2::identity() * 900.0, heading: None };
            if std::env::var("DBG").is_ok() {
                for (dx, dh) in [(0.0, 0.0), (10.0, 0.02), (-20.0, 0.03), (20.0, -0.04)] {
                    let g = nalgebra::Vector3::new(rest.x + dx * heading.cos(), rest.y + dx * heading.sin(), heading + dh);
                    match reconstruct::map::align::refine(&path, &net, &prior, g) { None => println!("truth {dx}: none"),
                    Some(f) => println!("truth {dx}: off {:.1} chi {:.2} on {}/{} lw {:.1}", (f.pose.xy() - rest).norm(), f.chi_square, f.on_road, f.points, f.log_weight) }
                }
            }
            let c0 = std::time::Instant::now();
            let out = search(&path, &net, &prior);
            spent += c0.elapsed().as_secs_f64();
            let b = out.candidates.first();
            let mut tag = format!("{:?}", out.verdict);
            if let Some(b) = b {
                let f = &b.fit;
                let d = f.pose.xy() - rest;
                let mut a = f.pose.z - heading; a = a.sin().atan2(a.cos());
                let p = f.covariance.fixed_view::<2,2>(0,0).into_owned();
                let maha = d.dot(&(p.try_inverse().unwrap() * d));
                let hs = f.covariance[(2,2)].sqrt();
                let right = d.norm() < 4.0 * worst_place(f) + 5.0 && a.abs() < 4.0 * hs + 0.01;
                tag = format!("{tag} {}", if right { "right" } else { "WRONG" });
                if right && out.verdict == Verdict::Placed { n += 1; hc += u32::from((a/hs).abs() < 1.96); pc += u32::from(maha < 5.99); }
                if !tag.contains("Placed right") || maha > 6.0 || f.chi_square > 0.8 || f.on_road < f.points { println!("{class} {seed} len {:.0} {tag} off {:.1} m sd {:.1} maha {:.1} head {:.2} sd {:.2} p {:.3} chi {:.2} on {}/{} n {} | {}", path.length_m, d.norm(), worst_place(f), maha, a.to_degrees(), hs.to_degrees(), b.probability, f.chi_square, f.on_road, f.points, out.candidates.len(), out.why.join(" ")); }
            } else { println!("{class} {seed} len {:.0} {tag} none", path.length_m); }
            *t.entry(tag).or_default() += 1;
        }
    }
    println!("{t:?} heading {hc}/{n} place {pc}/{n}; {:.0} s, search {spent:.1} s", clock.elapsed().as_secs_f64());
}
