//! The tables of `design.html`.

use std::fmt::Write as _;

use super::expect::{Expected, Study};
use super::picture::line;
use super::sheet::DataSheet;
use super::slips::{self, Verdict};
use super::source::Source;
use super::table::{self, digits};
use crate::export::fixed::fixed;
use crate::report::number::{KMH, percent};
use crate::report::svg::escape;
use crate::report::tables::{row, table as framed};
use crate::stats::two_sided_quantile;

/// A true minus sign.
pub(super) fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

fn name_cell(study: &Study, e: &Expected) -> String {
    let at = study
        .expected
        .iter()
        .position(|other| other.sheet.name == e.sheet.name)
        .unwrap_or(0);
    format!(
        "<span class=\"swatch\" style=\"background:{}\"></span>{}",
        line(at).0,
        escape(&e.sheet.name)
    )
}

/// A row whose heading is HTML of this module.
fn marked_row(out: &mut String, heading: &str, cells: &[String]) {
    let _ = write!(out, "<tr><th scope=\"row\">{heading}</th>");
    for cell in cells {
        let _ = write!(out, "<td>{}</td>", escape(cell));
    }
    out.push_str("</tr>\n");
}

pub(super) fn expected(study: &Study) -> String {
    let q = two_sided_quantile(study.settings.confidence);
    let mut rows = String::new();
    for e in &study.expected {
        for (i, r) in e.rows.iter().enumerate() {
            let heading = if i == 0 {
                name_cell(study, e)
            } else {
                String::new()
            };
            marked_row(
                &mut rows,
                &heading,
                &[
                    minus(&fixed(r.t_s, 0)),
                    format!(
                        "{} \u{d7} {}",
                        digits(r.ellipse.semi_major),
                        digits(r.ellipse.semi_minor)
                    ),
                    format!("{} / {}", digits(r.sd_along_m), digits(r.sd_across_m)),
                    format!("\u{b1}{}", digits(q * r.sd_speed_mps * KMH)),
                    digits(r.sd_speed_mps),
                    format!("\u{b1}{}", digits(q * r.sd_heading_rad.to_degrees())),
                    digits(r.sd_heading_rad.to_degrees()),
                ],
            );
        }
    }
    let bounds = percent(study.settings.confidence);
    let head = [
        "sensors".to_owned(),
        "t (s)".to_owned(),
        format!("{bounds} ellipse, half axes (m)"),
        "sd along / across (m)".to_owned(),
        "speed (km/h)".to_owned(),
        "sd (m/s)".to_owned(),
        "heading (\u{b0})".to_owned(),
        "sd (\u{b0})".to_owned(),
    ];
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    format!(
        "{}<p>Times are seconds from the {}. Bounds (\u{b1}) are half widths at {bounds}, sd is one sigma.</p>\n",
        framed("figures", &head, &rows),
        super::page::zero(study)
    )
}

pub(super) fn impacts(study: &Study) -> String {
    let q = two_sided_quantile(study.settings.confidence);
    let mut rows = String::new();
    for e in &study.expected {
        let cells = match &e.impact {
            None => vec!["not found".to_owned()],
            Some(i) => vec![
                format!(
                    "{} \u{b1}{}",
                    fixed(i.speed_mps * KMH, 1),
                    digits(q * i.sd_speed_mps * KMH)
                ),
                digits(i.sd_speed_mps),
                format!(
                    "{}{} \u{b1}{}",
                    if i.lower_bound { "at least " } else { "" },
                    fixed(i.delta_v_mps * KMH, 1),
                    digits(q * i.sd_delta_v_mps * KMH)
                ),
                digits(i.sd_delta_v_mps),
                format!("\u{b1}{}", digits(q * i.sd_pdof_deg)),
                e.clipped_samples.to_string(),
            ],
        };
        marked_row(&mut rows, &name_cell(study, e), &cells);
    }
    let out = framed(
        "figures",
        &[
            "sensors",
            "speed (km/h)",
            "sd (m/s)",
            "delta\u{2011}V (km/h)",
            "sd (m/s)",
            "direction of force (\u{b0})",
            "samples at limit",
        ],
        &rows,
    );
    format!(
        "{out}<p>Delta\u{2011}V at the centre of gravity; the direction of force from straight ahead; the last column \
         counts samples in which a sensor stood at its range.</p>\n"
    )
}

pub(super) fn sources(study: &Study) -> String {
    let shown = if study.has_impact { 4 } else { 2 };
    let mut rows = String::new();
    for e in &study.expected {
        for (k, (name, of)) in table::QUANTITIES[..shown].iter().enumerate() {
            let heading = if k == 0 {
                name_cell(study, e)
            } else {
                String::new()
            };
            let mut cells = vec![(*name).to_owned(), table::dominant_words(e, *of)];
            for source in Source::ALL {
                let share = e.shares.iter().find(|s| s.source == source).and_then(of);
                cells.push(share.map_or_else(
                    || "\u{2013}".to_owned(),
                    |s| minus(&format!("{} %", fixed(s * 100.0, 0))),
                ));
            }
            marked_row(&mut rows, &heading, &cells);
        }
    }
    let mut head = vec!["sensors", "of", "dominates"];
    head.extend(Source::ALL.iter().map(|s| s.name()));
    format!(
        "{}<p>Share of the variance that goes if that part were without error, everything else as it is; position \
         and heading at the first instant of the table above. The shares need not add up to 100 %: knowing one \
         sensor better makes more of the others, and a filter that only considers a bias, without estimating it, \
         can even lose. \u{201c}The method\u{201d}: no part has a tenth; what is left is side\u{2011}slip, wheel \
         slip, road and the springs.</p>\n",
        framed("figures two", &head, &rows)
    )
}

pub(super) fn aids(study: &Study) -> String {
    let mut rows = String::new();
    for e in &study.expected {
        for (k, aid) in e.aids.iter().enumerate() {
            let heading = if k == 0 {
                name_cell(study, e)
            } else {
                String::new()
            };
            marked_row(
                &mut rows,
                &heading,
                &[
                    table::aids(aid.wheels, aid.road).to_owned(),
                    digits(aid.semi_major_m),
                    digits(aid.sd_speed_mps),
                    aid.sd_impact_speed_mps
                        .map_or_else(|| "\u{2013}".to_owned(), digits),
                ],
            );
        }
    }
    let first = study
        .expected
        .first()
        .and_then(|e| e.rows.first())
        .map_or(0.0, |r| r.t_s);
    let half = format!("half axis at {} s (m)", minus(&fixed(first, 0)));
    framed(
        "figures one",
        &[
            "sensors",
            "aids",
            &half,
            "sd of the speed there (m/s)",
            "sd of the impact speed (m/s)",
        ],
        &rows,
    )
}

pub(super) fn trials(study: &Study) -> String {
    use super::trial::share_within;
    let confidence = study.settings.confidence;
    let q = two_sided_quantile(confidence);
    let share = |x: f64| {
        if x.is_finite() {
            format!("{} %", fixed(x * 100.0, 0))
        } else {
            "\u{2013}".to_owned()
        }
    };
    let mut rows = String::new();
    let mut sets = 0;
    for (trial, e) in study.trials.iter().zip(&study.expected) {
        sets = trial.sets;
        for (k, r) in trial.rows.iter().enumerate() {
            let heading = if k == 0 {
                name_cell(study, e)
            } else {
                String::new()
            };
            let [position, speed, turn] = r.coverage(confidence);
            marked_row(
                &mut rows,
                &heading,
                &[
                    minus(&fixed(r.t_s, 0)),
                    share(position),
                    share(speed),
                    share(turn),
                    fixed(r.spread(confidence), 2),
                ],
            );
        }
        if !trial.impact_speed.is_empty() {
            marked_row(
                &mut rows,
                "",
                &[
                    "impact".to_owned(),
                    format!("delta\u{2011}V {}", share(share_within(&trial.delta_v, q))),
                    share(share_within(&trial.impact_speed, q)),
                    String::new(),
                    String::new(),
                ],
            );
        }
    }
    format!(
        "{}<p>{sets} sets of sensors were drawn from each sheet, put into the same car on the same manoeuvre, recorded \
         and reconstructed; the table gives the share of the true values within the bounds predicted above. It should \
         be about {}. The factor is what the ellipse would have to be scaled by to hold that share: below one, the \
         prediction is cautious. (The simulated Earth does not turn, while the prediction holds the Coriolis \
         acceleration of an unknown heading: good sensors do better here than predicted.)</p>\n",
        framed(
            "figures",
            &[
                "sensors",
                "t (s)",
                "position",
                "speed",
                "heading",
                "ellipse factor"
            ],
            &rows
        ),
        percent(confidence)
    )
}

pub(super) fn sheets(study: &Study) -> String {
    let mut rows = String::new();
    let mut line = |name: &str, of: &dyn Fn(&DataSheet) -> String| {
        let cells: Vec<String> = study.expected.iter().map(|e| of(&e.sheet)).collect();
        row(&mut rows, name, &cells);
    };
    let g = schema::units::STANDARD_GRAVITY;
    line("accelerometer noise (\u{b5}g/\u{221a}Hz)", &|s| {
        significant(s.imu.accel_density / g * 1e6)
    });
    line("accelerometer bias (mg)", &|s| {
        significant(s.imu.accel_bias / g * 1e3)
    });
    line("its shift at an impact (mg)", &|s| {
        significant(s.imu.accel_bias_jump / g * 1e3)
    });
    line("accelerometer scale (%)", &|s| {
        significant(s.imu.accel_scale * 100.0)
    });
    line("accelerometer range (g)", &|s| {
        s.imu
            .accel_range
            .map_or_else(|| "none".to_owned(), |r| significant(r / g))
    });
    line("gyro noise (\u{b0}/s/\u{221a}Hz)", &|s| {
        significant(s.imu.rate_density.to_degrees())
    });
    line("gyro bias (\u{b0}/h)", &|s| {
        significant(s.imu.rate_bias.to_degrees() * 3600.0)
    });
    line("its shift at an impact (\u{b0}/h)", &|s| {
        significant(s.imu.rate_bias_jump.to_degrees() * 3600.0)
    });
    line("gyro scale (%)", &|s| significant(s.imu.rate_scale * 100.0));
    line("gyro range (\u{b0}/s)", &|s| {
        s.imu
            .rate_range
            .map_or_else(|| "none".to_owned(), |r| significant(r.to_degrees()))
    });
    line("mounting (\u{b0})", &|s| {
        significant(s.imu.mounting_sd[2].to_degrees())
    });
    line("place of the box (m)", &|s| significant(s.imu_place_sd[0]));
    line("vibration (m/s\u{b2}, \u{b0}/s)", &|s| {
        format!(
            "{}, {}",
            significant(s.imu.accel_vibration),
            significant(s.imu.rate_vibration.to_degrees())
        )
    });
    line("wheels: radius, left\u{2013}right (%)", &|s| {
        format!(
            "{}, {}",
            significant(s.wheels.scale_sd * 100.0),
            significant(s.wheels.scale_difference_sd * 100.0)
        )
    });
    let mut head = vec!["one sigma"];
    head.extend(study.expected.iter().map(|e| e.sheet.name.as_str()));
    let mut out = framed("figures", &head, &rows);
    out.push_str("<ul>\n");
    for e in study
        .expected
        .iter()
        .filter(|e| !e.sheet.typical_of.is_empty())
    {
        let _ = writeln!(
            out,
            "<li>{}: {}.</li>",
            escape(&e.sheet.name),
            escape(e.sheet.typical_of.trim_end_matches('.'))
        );
    }
    out.push_str("</ul>\n");
    out
}

/// Three significant digits, no trailing zeros.
fn significant(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    let decimals = schema::num::round_usize((2.0 - x.abs().log10().floor()).clamp(0.0, 9.0));
    let text = fixed(x, decimals);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

pub(super) fn figures() -> String {
    let mut rows = String::new();
    for f in slips::figures() {
        let source = f
            .source
            .map_or_else(|| "none".to_owned(), |x| table::source_figure(x, f.unit));
        let class = if f.verdict == Verdict::Slip {
            " class=\"slip\""
        } else {
            ""
        };
        let _ = write!(rows, "<tr{class}><th scope=\"row\">{}</th>", f.section);
        for cell in [
            f.what.to_owned(),
            source,
            table::figure(f.correct, f.decimals, f.unit),
            f.verdict.name().to_owned(),
            f.why,
        ] {
            let cell = cell.replace("^2", "\u{b2}").replace("sqrt(", "\u{221a}(");
            let _ = write!(rows, "<td>{}</td>", escape(&cell));
        }
        rows.push_str("</tr>\n");
    }
    format!(
        "<p>The study that proposed this method [S03] gives a few figures of what its sensors' errors amount to. They \
         are computed here again; where the source slipped it is said how.</p>\n{}",
        framed(
            "why",
            &["section", "figure", "source", "correct", "", "why"],
            &rows
        )
    )
}
