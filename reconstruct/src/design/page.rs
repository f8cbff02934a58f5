//! `design.html`: the study on one page that needs neither network nor script.

use std::fmt::Write as _;

use super::expect::{Expected, Study};
use super::picture::{Picture, line};
use super::sheet::DataSheet;
use super::slips::{self, Verdict};
use super::source::Source;
use super::table::{self, digits};
use crate::export::fixed::fixed;
use crate::report::number::{KMH, percent};
use crate::report::summary::software;
use crate::report::svg::escape;
use crate::report::tables::{row, table as framed};
use crate::run::Road;
use crate::stats::two_sided_quantile;

const STYLE: &str = include_str!("../report/page.css");
/// What the report's style has no use for.
const MORE: &str = ".trio{display:grid;grid-template-columns:repeat(auto-fit,minmax(300px,1fr));gap:8px}\n\
    .figures td:nth-of-type(1){font-weight:normal}\n\
    .figures th{white-space:nowrap}.one td:nth-of-type(-n+1),.two td:nth-of-type(-n+2){text-align:left}\n\
    .one th:nth-child(2),.two th:nth-child(2),.two th:nth-child(3){text-align:left!important}\n\
    .swatch{display:inline-block;width:14px;height:14px;margin-right:6px;vertical-align:-2px}\n\
    .slip td{color:#8a0035;font-weight:bold}.slip td:last-child{color:inherit;font-weight:normal}\n\
    .why td:last-child{min-width:300px}\n\
    @media print{.trio{grid-template-columns:repeat(3,1fr)}.swatch{-webkit-print-color-adjust:exact;print-color-adjust:exact}}\n";

/// The whole page.
#[must_use]
pub fn html(study: &Study, picture: &Picture) -> String {
    let settings = &study.settings;
    let bounds = percent(settings.confidence);
    let mut out = String::with_capacity(200_000);
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>Design study: {}</title>\n<style>\n{STYLE}{MORE}</style>\n</head>\n<body>\n<main>\n<header>\n\
         <h1>Design study: the expected funnel</h1>\n<p class=\"sub\">{} &middot; model {} &middot; {} &middot; \
         bounds at {bounds} confidence</p>\n</header>\n",
        escape(&study.plan.name),
        escape(&study.plan.name),
        settings.model.name(),
        aids_sentence(study),
    );
    out.push_str(&intro(study));
    out.push_str(&caveats(study));
    section(&mut out, "Funnels", &funnels(study, picture));
    section(&mut out, "Expected bounds", &expected(study));
    if study.has_impact {
        section(&mut out, "At the impact", &impacts(study));
    }
    section(&mut out, "What dominates", &sources(study));
    section(
        &mut out,
        "With and without wheels and road limits",
        &aids(study),
    );
    if !study.trials.is_empty() {
        section(
            &mut out,
            "The prediction against drawn sensors",
            &trials(study),
        );
    }
    section(&mut out, "The data sheets", &sheets(study));
    section(
        &mut out,
        "The figures of the source, computed again",
        &figures(),
    );
    section(&mut out, "Method", &method(study));
    let _ = write!(
        out,
        "<footer>{}. The same manoeuvre, sheets and options give the same bytes.</footer>\n</main>\n</body>\n</html>\n",
        escape(&software())
    );
    out
}

fn section(out: &mut String, title: &str, body: &str) {
    let _ = write!(out, "<section>\n<h2>{title}</h2>\n{body}</section>\n");
}

fn zero(study: &Study) -> &'static str {
    if study.has_impact { "impact" } else { "rest" }
}

fn aids_sentence(study: &Study) -> &'static str {
    match (study.settings.wheels, study.settings.road != Road::None) {
        (true, true) => "wheel speeds and road limits",
        (true, false) => "wheel speeds, no road limits",
        (false, true) => "no wheel speeds, road limits",
        (false, false) => "neither wheel speeds nor road limits",
    }
}

fn intro(study: &Study) -> String {
    let mut out = String::from("<dl class=\"key\">\n");
    for e in study.expected.iter().take(6) {
        let Some(first) = e.rows.first() else {
            continue;
        };
        let q = two_sided_quantile(study.settings.confidence);
        let small = e.impact.as_ref().map_or_else(
            || format!("half axis at {} s", minus(&fixed(first.t_s, 0))),
            |i| {
                format!(
                    "half axis at {} s; impact speed \u{b1}{} km/h",
                    minus(&fixed(first.t_s, 0)),
                    digits(q * i.sd_speed_mps * KMH)
                )
            },
        );
        let _ = writeln!(
            out,
            "<div><dt>{}</dt><dd class=\"big\">{} m</dd><dd class=\"small\">{}</dd></div>",
            escape(&e.sheet.name),
            digits(first.ellipse.semi_major),
            escape(&small)
        );
    }
    out.push_str("</dl>\n");
    let _ = writeln!(
        out,
        "<p>How well would a record of this manoeuvre tell where the car was and how fast it went, if it were \
         made with each of these sensors? No record is needed for the answer: the covariance of the filter \
         depends on the sensors' data sheets and on the motion. The path is {} m from the first sample to rest.</p>",
        fixed(study.distance_m, 0)
    );
    out
}

fn caveats(study: &Study) -> String {
    let list = table::caveats(study);
    if list.is_empty() {
        return String::new();
    }
    let mut out =
        String::from("<section class=\"limits\">\n<h2>What limits this prediction</h2>\n<ul>\n");
    for sentence in list {
        let _ = writeln!(out, "<li>{}</li>", escape(&sentence));
    }
    out.push_str("</ul>\n</section>\n");
    out
}

fn funnels(study: &Study, picture: &Picture) -> String {
    let mut out = format!(
        "<figure>{}</figure>\n<div class=\"pair\">\n<figure>{}</figure>\n<figure>{}</figure>\n</div>\n<div class=\"trio\">\n",
        picture.legend(),
        picture.plan(),
        picture.ellipses()
    );
    for chart in picture.charts() {
        let _ = writeln!(out, "<figure>{chart}</figure>");
    }
    let _ = writeln!(
        out,
        "</div>\n<p class=\"sub\">The funnel joins the ellipses of all instants and is a drawing only; the claim is \
         the ellipse of each instant: of many such records, {} have the true position of that instant in it.</p>",
        percent(study.settings.confidence)
    );
    out
}

fn minus(text: &str) -> String {
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

fn expected(study: &Study) -> String {
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
        zero(study)
    )
}

fn impacts(study: &Study) -> String {
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

fn sources(study: &Study) -> String {
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

fn aids(study: &Study) -> String {
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

fn trials(study: &Study) -> String {
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

fn sheets(study: &Study) -> String {
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

fn figures() -> String {
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

fn method(study: &Study) -> String {
    format!(
        "<p>The manoeuvre is simulated on a 2 kHz grid with sensors that do nothing wrong but end at their range, \
         recorded as means over 10 ms, and reconstructed with the data sheet asked about in the record's header. \
         What the filter then holds of its own uncertainty is the expected funnel [S03, 3.4.1]. Wheel slip under \
         braking, side\u{2011}slip, springs and the road are part of the manoeuvre and of the simulation. The error \
         that is left with faultless sensors is compared with the ellipse at each instant; where it lies outside, \
         that is said above.</p>\n<p>What the prediction does not hold: errors that are not on the sheet (temperature \
         during the drive, a loose box, a wrong configuration), and another manoeuvre: bounds differ with curves, \
         braking and spin. `--trials` draws sensors from the sheet and tries the prediction. Times are from the {}.</p>\n",
        zero(study)
    )
    .replace("`--trials`", "<code>--trials</code>")
}
