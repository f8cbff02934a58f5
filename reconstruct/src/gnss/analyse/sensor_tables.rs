//! The sensors' part of the tables.

use super::positions::{Calibration, Fitted, Table, from_pair};
use super::spans::Situation;
use super::spread::{Bias, Spread};
use super::tables::{Grid, Section, ends, name, number, short, with_ends, with_se};
use super::{Analysis, source};
use crate::export::fixed::fixed;
use crate::mechanize::EARTH_RATE;

/// Units of the variances shown: what they are multiplied by, and its name.
const ACCEL_UNIT: (f64, &str) = (1e3, "1e-3 (m/s^2)^2");
const RATE_UNIT: (f64, &str) = (1e6, "1e-6 (rad/s)^2");

pub(super) fn variances(a: &Analysis) -> Section {
    let mut out = Section {
        title: "Variance by situation",
        pictures: &["variance"],
        ..Section::default()
    };
    let spreads = match &a.spreads {
        Ok(spreads) => spreads,
        Err(why) => {
            out.words.push(why.clone());
            out.pictures = &[];
            return out;
        }
    };
    out.words.extend(a.spans.notes.iter().cloned());
    if !a.spans.told_by.is_empty() {
        out.words.push(a.spans.told_by.clone());
    }
    out.words.push(
        "About the mean of windows of 4 s, the sensor's own axes; S00 prints its variances without the square of the unit."
            .to_owned(),
    );
    for (title, first, (unit, text)) in [("Gyro", 3, RATE_UNIT), ("Accelerometer", 0, ACCEL_UNIT)] {
        let number = if first == 3 { "4.4" } else { "4.5" };
        let mut grid = Grid::new(
            format!("{title}, {text}"),
            &[
                "situation",
                "x (95 %)",
                "y (95 %)",
                "z (95 %)",
                "windows, samples (dof x, y, z)",
            ],
        );
        for spread in spreads {
            grid.row(variance_row(spread, first, unit));
            if let Some(source) = source::variance(spread.situation) {
                let three = [0, 1, 2].map(|i| short(source[first + i] * unit));
                grid.row(
                    std::iter::once(format!("  S00, table {number}"))
                        .chain(three)
                        .chain([String::new()]),
                );
            }
        }
        out.grids.push(grid);
    }
    out
}

fn variance_row(spread: &Spread, first: usize, unit: f64) -> Vec<String> {
    let name = spread.situation.name().to_owned();
    let Some(all) = &spread.axis else {
        let why = "cannot tell: no window of this kind".to_owned();
        return vec![name, why, String::new(), String::new(), String::new()];
    };
    let own = [all[first], all[first + 1], all[first + 2]];
    let dof = own.map(|v| fixed(v.dof, usize::from(v.dof < 10.0)));
    let [x, y, z] = own.map(|v| with_ends(v.value * unit, v.low * unit, v.high * unit));
    let counts = format!(
        "{}, {} ({})",
        own[0].windows,
        own[0].samples,
        dof.join(", ")
    );
    vec![name, x, y, z, counts]
}

pub(super) fn biases(a: &Analysis) -> Section {
    let mut out = Section {
        title: "Gyro bias at stands",
        pictures: &["bias"],
        ..Section::default()
    };
    let list = match &a.biases {
        Ok(list) => list,
        Err(why) => {
            out.words.push(why.clone());
            out.pictures = &[];
            return out;
        }
    };
    out.grids.push(means(list));
    let said = drifts(a);
    if said.rows.is_empty() {
        out.words
            .push("Cannot tell a drift: fewer than two stands.".to_owned());
    } else {
        out.grids.push(said);
        out.words.push(format!(
            "The Earth's own turning is in these means: up to {} in 1e-3 rad/s from one heading, or side, to another.",
            fixed(2e3 * EARTH_RATE, 2)
        ));
    }
    out
}

/// The biases, S00's behind them.
fn means(list: &[Bias]) -> Grid {
    let mut grid = Grid::new(
        "Mean rate of each stand, 1e-3 rad/s",
        &[
            "stand, s of the box's clock",
            "x",
            "y",
            "z",
            "samples (worth x, y, z)",
        ],
    );
    let several = list.windows(2).any(|w| w[0].leg != w[1].leg);
    for bias in list {
        let kind = if bias.situation == Situation::Rest {
            "rest"
        } else {
            "stop"
        };
        let worth = bias.rate.map(|f| fixed(f.effective, 0)).join(", ");
        let [x, y, z] = bias.rate.map(|f| with_se(&f.scaled(1e3)));
        let leg = if several {
            format!("{}: ", name(bias.leg))
        } else {
            String::new()
        };
        grid.row([
            format!(
                "{leg}{} to {} ({kind})",
                fixed(bias.span_s[0], 1),
                fixed(bias.span_s[1], 1)
            ),
            x,
            y,
            z,
            format!("{} ({worth})", bias.rate[0].count),
        ]);
    }
    for (span, rates) in source::BIAS {
        let [x, y, z] = rates.map(|r| fixed(r * 1e3, 2));
        grid.row([
            format!("  S00, table 4.6, fixes {span}"),
            x,
            y,
            z,
            String::new(),
        ]);
    }
    grid
}

/// The tests for drift.
fn drifts(a: &Analysis) -> Grid {
    let mut said = Grid::new(
        "Drift between stands",
        &[
            "axis",
            "largest - smallest, 1e-3 rad/s",
            "Welch's F (dof)",
            "probability if there is no drift",
            "verdict",
        ],
    );
    for (axis, drift) in ["x", "y", "z"].into_iter().zip(&a.drifts) {
        let Some(d) = drift else {
            continue;
        };
        let verdict = if d.p < 0.01 {
            "more than the noise explains"
        } else {
            "the noise explains it"
        };
        let p = if d.p < 1e-4 {
            "below 0.0001".to_owned()
        } else {
            fixed(d.p, 4)
        };
        let se = d.range_se * 1e3;
        said.row([
            axis.to_owned(),
            format!("{} +- {}", number(d.range * 1e3, se), number(se, se)),
            format!(
                "{} ({}, {})",
                short(d.f[0]),
                fixed(d.f[1], 0),
                fixed(d.f[2], 0)
            ),
            p,
            verdict.to_owned(),
        ]);
    }
    said
}

pub(super) fn positions(a: &Analysis) -> Section {
    let mut out = Section {
        title: "Accelerometer in six positions",
        pictures: &["positions"],
        ..Section::default()
    };
    let table = match &a.positions {
        Ok(table) => table,
        Err(why) => {
            out.words.push(why.clone());
            out.pictures = &[];
            published_fit(&mut out);
            return out;
        }
    };
    out.words.push(format!(
        "Gravity {} m/s^2 +- {}: {}; S00 takes {}.",
        number(table.gravity[0], table.gravity[1]),
        number(table.gravity[1], table.gravity[1]),
        table.gravity_from,
        fixed(source::GRAVITY, 5)
    ));
    let mut grid = Grid::new(
        "Mean reading of the axis along gravity, m/s^2",
        &[
            "position",
            "mean (95 %)",
            "size less gravity",
            "off axis, deg",
            "spans, samples (worth)",
            "S00, table 4.7",
        ],
    );
    for (position, source) in table.positions.iter().zip(source::POSITIONS) {
        let mut row = vec![position.name.to_owned()];
        match &position.reading {
            Some(f) => row.extend([
                ends(f),
                {
                    let se = f.se.hypot(table.gravity[1]);
                    let off = f.value * position.sign - table.gravity[0];
                    format!("{} +- {}", number(off, se), number(se, se))
                },
                fixed(position.off.to_degrees(), 1),
                format!(
                    "{}, {} ({})",
                    position.spans,
                    f.count,
                    fixed(f.effective, 0)
                ),
            ]),
            None => row.extend([
                "missing".to_owned(),
                String::new(),
                String::new(),
                String::new(),
            ]),
        }
        row.push(short4(source));
        grid.row(row);
    }
    out.grids.push(grid);
    match &table.calibration {
        Ok(fit) => {
            out.grids.push(fitted(fit));
            out.words.push(agreement(fit));
        }
        Err(why) => out.words.push(why.clone()),
    }
    pairs(&mut out, table);
    published_fit(&mut out);
    out
}

fn short4(x: f64) -> String {
    number(x, 1e-3)
}

/// Axes of which both ways are there though not all six positions are.
fn pairs(out: &mut Section, table: &Table) {
    if table.calibration.is_ok() {
        return;
    }
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        let reading = |sign: f64| {
            let mut own = table.positions.iter();
            own.find(|p| p.axis == axis && p.sign * sign > 0.0)
                .and_then(|p| p.reading)
        };
        if let (Some(plus), Some(minus)) = (reading(1.0), reading(-1.0)) {
            let [scale, bias] = from_pair(plus.value, minus.value, table.gravity[0]);
            let se = 0.5 * plus.se.hypot(minus.se);
            out.words.push(format!(
                "Axis {letter} from its two positions, if gravity lay exactly along it: scale {} +- {}, bias {} m/s^2 +- {}.",
                number(scale, se / table.gravity[0]),
                number(se / table.gravity[0], se / table.gravity[0]),
                number(bias, se),
                number(se, se),
            ));
        }
    }
}

fn show(f: &Fitted) -> String {
    with_ends(f.value, f.ends[0], f.ends[1])
}

fn fitted(fit: &Calibration) -> Grid {
    let mut grid = Grid::new(
        format!("Least squares over {} still spans", fit.spans),
        &["quantity", "x (95 %)", "y (95 %)", "z (95 %)"],
    );
    let row = |name: &str, f: &[Fitted; 3]| {
        std::iter::once(name.to_owned())
            .chain(f.iter().map(show))
            .collect::<Vec<String>>()
    };
    grid.row(row("scale, reading over force", &fit.scale));
    grid.row(row("bias, m/s^2", &fit.bias));
    match &fit.misalignment {
        Ok(cross) => grid.row(row("misalignment xy, xz, yz, rad", cross)),
        Err(why) => grid.row([
            "misalignment".to_owned(),
            why.clone(),
            String::new(),
            String::new(),
        ]),
    }
    grid
}

fn agreement(fit: &Calibration) -> String {
    let common = "The error of gravity itself is in the scales.";
    match fit.chi_square {
        Some(ratio) => format!(
            "{} spans more than unknowns; chi-square {} for each{}. {common}",
            fit.spare,
            short(ratio),
            if ratio > 1.0 {
                ", by which the errors are enlarged"
            } else {
                ""
            }
        ),
        None => format!(
            "As many spans as unknowns: nothing checks the fit. {common}{}",
            if fit.misalignment.is_err() {
                " A misalignment of the axes that is not told shifts scales and biases by its product with the tilt of each position."
            } else {
                ""
            }
        ),
    }
}

/// S00's six readings, two an axis, in the same way.
fn published_fit(out: &mut Section) {
    let p = source::POSITIONS;
    let mut grid = Grid::new(
        "S00, table 4.7, from each axis' two readings and its gravity",
        &["quantity", "x", "y", "z"],
    );
    let of = [(p[1], p[0]), (p[2], p[3]), (p[5], p[4])]
        .map(|(plus, minus)| from_pair(plus, minus, source::GRAVITY));
    grid.row(std::iter::once("scale".to_owned()).chain(of.map(|f| fixed(f[0], 4))));
    grid.row(std::iter::once("bias, m/s^2".to_owned()).chain(of.map(|f| fixed(f[1], 4))));
    out.grids.push(grid);
    out.words.push("S00 states no error of its readings: 4 s of its noise at rest leave 0.001 m/s^2, a tilt of one degree 0.0015 m/s^2.".to_owned());
}
