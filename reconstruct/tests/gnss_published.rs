//! The published GNSS filter: its matrices, its two forms, numpy's opinion, its slips.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/gnss_drive.rs"]
mod gnss_drive;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use gnss_drive::{Drive, town};
use nalgebra::{DMatrix, SVector};
use reconstruct::gnss::published::constants::{DT, Noise, Process};
use reconstruct::gnss::published::earth::Earth;
use reconstruct::gnss::published::matrices::{
    self, ATT, Cov, Estimator as _, STATES, State, f_matrix, h1, h2, p0, phi, q, q_quadrature, r1,
    r2,
};
use reconstruct::gnss::published::{
    Chains, Engine, Options, PublishedError, Reading, Source, SpeedAid, SpeedUse, Step, Used,
    Variant, run,
};
use reconstruct::matrix::expm;
use schema::num::real;

/// Name and switches.
type Named = (&'static str, fn() -> Variant);

const VARIANTS: [Named; 4] = [
    ("program", Variant::program),
    ("text", Variant::text),
    ("printed", Variant::printed),
    ("corrected", Variant::corrected),
];

fn options(variant: Variant) -> Options {
    Options {
        variant,
        ..Options::default()
    }
}

#[test]
fn q_meets_the_quadrature_of_its_integral() {
    for source in [Source::Program, Source::Text] {
        let process = Process::of(source);
        for dt in [DT, 1.0] {
            let (closed, integral) = (
                q(&process, dt, Reading::Corrected),
                q_quadrature(&process, dt),
            );
            for i in 0..STATES {
                for j in 0..STATES {
                    let off = (closed[(i, j)] - integral[(i, j)]).abs();
                    assert!(off <= 1e-12 * integral[(i, j)].abs(), "{i} {j} {dt}: {off}");
                }
            }
            let apart = q(&process, dt, Reading::Published) - closed;
            for i in 0..STATES {
                for j in 0..STATES {
                    let sign = i == j && (ATT..ATT + 3).contains(&i);
                    let want = if sign {
                        -2.0 * process.bias * dt.powi(3) / 3.0
                    } else {
                        0.0
                    };
                    let rounding = 1e-15 * closed[(i, j)].abs();
                    assert!((apart[(i, j)] - want).abs() <= rounding, "{i} {j}");
                }
            }
        }
    }
}

#[test]
fn phi_is_the_exponential_of_f() {
    let f = DMatrix::from_column_slice(STATES, STATES, f_matrix().as_slice());
    for dt in [DT, 1.0] {
        let e = expm(&(&f * dt)).unwrap();
        let ours = phi(dt, Source::Program);
        let off = (0..STATES * STATES)
            .map(|i| (e.as_slice()[i] - ours.as_slice()[i]).abs())
            .fold(0.0, f64::max);
        assert!(off < 1e-14, "{off}");
        let printed = ours - phi(dt, Source::Text);
        assert_eq!(printed.iter().filter(|x| **x != 0.0).count(), 2);
        assert!((printed[(8, 11)] - dt).abs() + (printed[(8, 14)] + dt).abs() < 1e-15);
    }
}

/// What a fix and a sample measure of the states, in the words of (3.4): not by indices of H.
fn measured(x: &State) -> SVector<f64, 15> {
    let [
        px,
        py,
        pz,
        vx,
        vy,
        vz,
        roll,
        pitch,
        yaw,
        wx,
        wy,
        wz,
        _,
        _,
        _,
    ] = x.data.0[0];
    SVector::from([
        px, py, pz, vx, vy, vz, vx, vy, vz, roll, pitch, yaw, wx, wy, wz,
    ])
}

#[test]
fn h_meets_finite_differences() {
    let x = State::from_fn(|i, _| 0.3 + real(i));
    let keep = [6, 7, 8, 9, 10, 12, 13, 14];
    for j in 0..STATES {
        let mut moved = x;
        moved[j] += 0.5;
        let slope = (measured(&moved) - measured(&x)) / 0.5;
        assert!((slope - h1().column(j)).norm() < 1e-12);
        for (row, from) in keep.into_iter().enumerate() {
            assert!((slope[from] - h2()[(row, j)]).abs() < 1e-12);
        }
    }
}

#[test]
fn r_is_the_table_or_the_program() {
    let text = r1(&Noise::of(Source::Text)).diagonal().map(f64::sqrt);
    let table = [
        6.0, 6.0, 6.0, 0.43, 0.43, 0.43, 1.0, 1.0, 1.0, 100.0, 100.0, 100.0, 0.0134, 0.0234, 0.0053,
    ];
    assert!((text - SVector::from(table)).norm() < 1e-12);
    let program = r2(&Noise::of(Source::Program)).diagonal();
    let printed = [1.0, 1.0, 1.0, 1e4, 1e5, 1.8e-4, 5.5e-4, 2.9e-5];
    assert!((program - SVector::from(printed)).norm() < 1e-9);
    assert!((r1(&Noise::of(Source::Program))[(11, 11)] - 1e10).abs() < 1.0);
    // Root of the program's rates, cut to the table's digits.
    for (variance, printed) in [(1.8e-4_f64, 0.0134), (5.5e-4, 0.0234), (2.9e-5, 0.0053)] {
        assert!((0.0..1e-4).contains(&(variance.sqrt() - printed)));
    }
    assert!((p0().trace() - (9.0 + 1.08 + 3.0 + 3e-4 + 0.3)).abs() < 1e-12);
}

/// Largest difference over the steps, in units of each state's scale and of P's.
fn apart(a: &[Step], b: &[Step]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let (mut x, mut p) = (0.0_f64, 0.0_f64);
    for (a, b) in a.iter().zip(b) {
        assert_eq!(a.used, b.used);
        for i in 0..STATES {
            let scale = [1e6, 10.0, 1.0, 0.1, 0.01][i / 3];
            x = x.max((a.x[i] - b.x[i]).abs() / scale);
            p = p.max((a.variances[i] - b.variances[i]).abs() / b.variances[i]);
        }
        if let (Some(a), Some(b)) = (&a.covariance, &b.covariance) {
            for i in 0..STATES {
                for j in 0..STATES {
                    let scale = (b[(i, i)] * b[(j, j)]).sqrt();
                    p = p.max((a[(i, j)] - b[(i, j)]).abs() / scale);
                }
            }
        }
    }
    (x, p)
}

#[test]
fn chains_meet_the_dense_filter() {
    for (name, variant) in VARIANTS {
        let drive = town(variant(), 3);
        let mut chains = options(variant());
        chains.keep_covariance = true;
        let dense = Options {
            engine: Engine::Dense,
            ..chains.clone()
        };
        let a = run(&drive.input, &drive.initial, &chains).unwrap();
        let b = run(&drive.input, &drive.initial, &dense).unwrap();
        let (x, p) = apart(&a, &b);
        println!("{name}: {} steps, states {x:.1e}, P {p:.1e}", a.len());
        assert!(a.len() >= 2_000 && x < 1e-9 && p < 1e-9);
    }
}

#[test]
fn chains_refuse_what_couples_the_axes() {
    let mut p = p0();
    p[(0, 1)] = 0.1;
    let (phi, q) = (
        phi(DT, Source::Program),
        q(&Process::of(Source::Program), DT, Reading::Published),
    );
    assert!(matches!(
        Chains::new(State::zeros(), &p, &phi, &q),
        Err(PublishedError::Coupled {
            row: 0,
            column: 1,
            ..
        })
    ));
    let mut odd = phi;
    odd[(9, 12)] = 1.0;
    assert!(Chains::new(State::zeros(), &p0(), &odd, &q).is_err());
    let mut negative = p0();
    negative[(3, 3)] = -5.0;
    let mut filter = Chains::new(State::zeros(), &negative, &phi, &Cov::zeros()).unwrap();
    let row = matrices::Row {
        state: 3,
        z: 1.0,
        r: 1.0,
    };
    assert!(filter.update(&[row]).is_err());
}

fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../target"),
        PathBuf::from,
    )
}

/// Python with numpy: `$SVARTBOKS_NUMPY_PYTHON`, or the environment that ./check makes.
fn python() -> Option<PathBuf> {
    let made = target().join("gnss-oracle/venv/bin/python");
    let python = std::env::var_os("SVARTBOKS_NUMPY_PYTHON").map_or(made, PathBuf::from);
    let there = Command::new(&python)
        .args(["-c", "import numpy"])
        .output()
        .is_ok_and(|run| run.status.success());
    if !there {
        eprintln!("skipped: Python with numpy is not installed (./check installs it)");
    }
    there.then_some(python)
}

fn write_drive(folder: &Path, drive: &Drive) {
    let line = |text: &mut String, values: &[f64]| {
        let list: Vec<String> = values.iter().map(|x| format!("{x:e}")).collect();
        writeln!(text, "{}", list.join(",")).unwrap();
    };
    let (mut fixes, mut imu, mut initial) = (String::new(), String::new(), String::new());
    for f in &drive.input.fixes {
        let v = f.v_ned;
        line(&mut fixes, &[f.t_s, f.lat, f.lon, f.height, v.x, v.y, v.z]);
    }
    for m in &drive.input.motions {
        let (f, w) = (m.accel_b, m.rate_b);
        line(&mut imu, &[m.t_s, f.x, f.y, f.z, w.x, w.y, w.z]);
    }
    let i = &drive.initial;
    let (v, b) = (i.v_ned, i.bias);
    line(
        &mut initial,
        &[
            i.lat, i.lon, i.height, v.x, v.y, v.z, i.roll, i.pitch, i.yaw, b.x, b.y, b.z,
        ],
    );
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join("fixes.csv"), fixes).unwrap();
    std::fs::write(folder.join("imu.csv"), imu).unwrap();
    std::fs::write(folder.join("initial.csv"), initial).unwrap();
}

#[test]
fn every_state_meets_numpy() {
    let Some(python) = python() else {
        return;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracle/gnss_published.py");
    for (name, variant) in VARIANTS {
        for (every, stop) in [(5, true), (2, false)] {
            let drive = town(variant(), 11);
            let folder = target().join(format!("gnss-oracle/{name}-{every}"));
            write_drive(&folder, &drive);
            let output = Command::new(&python)
                .arg(&script)
                .arg(&folder)
                .args([name, &every.to_string(), if stop { "1" } else { "0" }])
                .output()
                .unwrap();
            let complaint = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{complaint}");
            let mut ours = options(variant());
            ours.every = Some(every);
            ours.stop = ours.stop.filter(|_| stop);
            let steps = run(&drive.input, &drive.initial, &ours).unwrap();
            let text = String::from_utf8(output.stdout).unwrap();
            assert_eq!(text.lines().count(), steps.len());
            assert!(steps.len() > 1_000);
            let (mut x, mut p) = (0.0_f64, 0.0_f64);
            for (line, step) in text.lines().zip(&steps) {
                let values: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
                for i in 0..STATES {
                    let scale = [1e6, 10.0, 1.0, 0.1, 0.01][i / 3];
                    x = x.max((values[i] - step.x[i]).abs() / scale);
                    p = p.max((values[15 + i] / step.variances[i] - 1.0).abs());
                }
            }
            let count = |used| steps.iter().filter(|s| s.used == used).count();
            println!(
                "{name}, fix every {every}: {} steps, {} fixes, {} at a stop: states {x:.1e}, P {p:.1e}",
                steps.len(),
                count(Used::Gnss),
                count(Used::Stop),
            );
            assert!(count(Used::Gnss) > 3 && (count(Used::Stop) > 100) == stop);
            assert!(x < 1e-9 && p < 1e-9);
        }
    }
}

#[test]
fn geodetic_and_back() {
    for earth in [Reading::Published, Reading::Corrected].map(Earth::of) {
        for lat in [-1.57, -0.7, 0.0, 0.3, 1.1068, 1.56] {
            for lon in [-3.0, 0.0, 0.18] {
                for height in [-100.0, 0.0, 9_000.0] {
                    let r = earth.ecef(lat, lon, height);
                    let [lat1, lon1, height1] = earth.geodetic(&r);
                    assert!((lat1 - lat).abs() < 2e-15 && (lon1 - lon).abs() < 1e-9);
                    assert!((height1 - height).abs() < 1e-8, "{}", height1 - height);
                }
            }
        }
    }
}

#[test]
fn bad_input_is_an_error() {
    let drive = town(Variant::program(), 7);
    let (initial, program) = (drive.initial, Options::default());
    let with = |change: &dyn Fn(&mut reconstruct::gnss::published::Input)| {
        let mut input = drive.input.clone();
        change(&mut input);
        run(&input, &initial, &program).unwrap_err()
    };
    let few = |error| matches!(error, PublishedError::TooFew { .. });
    assert!(few(with(&|i| i.fixes.clear())));
    assert!(few(with(&|i| i.fixes.truncate(1))));
    assert!(few(with(&|i| i.motions.clear())));
    let not_finite = |error| matches!(error, PublishedError::NotFinite { .. });
    assert!(not_finite(with(&|i| i.fixes[3].v_ned.y = f64::NAN)));
    assert!(not_finite(with(&|i| i.fixes[3].lat = f64::INFINITY)));
    assert!(not_finite(with(&|i| i.motions[9].accel_b.y = f64::NAN)));
    assert!(not_finite(with(&|i| i.motions[9].t_s = f64::NAN)));
    assert!(matches!(
        with(&|i| i.fixes.swap(2, 3)),
        PublishedError::Order { index: 3, .. }
    ));
    assert!(matches!(
        with(&|i| i.motions.truncate(100)),
        PublishedError::NoOverlap { .. }
    ));
    assert!(matches!(
        with(&|i| drop(i.motions.drain(..60))),
        PublishedError::Lead {
            needed: 112,
            found: 90
        }
    ));
    assert!(matches!(
        with(&|i| i.motions[200].accel_b.x = 1e308),
        PublishedError::Diverged { .. } | PublishedError::Innovation { .. }
    ));
    let mut start = initial;
    start.yaw = f64::NAN;
    assert!(run(&drive.input, &start, &program).is_err());
    let bad = |change: &dyn Fn(&mut Options)| {
        let mut options = program.clone();
        change(&mut options);
        matches!(
            run(&drive.input, &initial, &options),
            Err(PublishedError::Option { .. })
        )
    };
    assert!(bad(&|o| o.every = Some(0)));
    assert!(bad(&|o| o.stop = Some(f64::NAN)));
    assert!(bad(&|o| o.speed = Some(SpeedAid {
        speeds: vec![],
        how: SpeedUse::Measure(0.0)
    })));
    let huge = Options {
        latency: usize::MAX,
        ..program.clone()
    };
    assert!(run(&drive.input, &initial, &huge).is_err());
    // Samples that end early end the run.
    let mut short = drive.input.clone();
    short.motions.truncate(400);
    assert_eq!(run(&short, &initial, &program).unwrap().len(), 250);
}
