//! `design.html`: the study on one page that needs neither network nor script.

use std::fmt::Write as _;

use super::expect::Study;
use super::page_tables::{self as tables, minus};
use super::picture::{Picture, line, swatch};
use super::table::{self, digits};
use crate::export::fixed::fixed;
use crate::report::number::{KMH, percent};
use crate::report::summary::software;
use crate::report::svg::escape;
use crate::run::Road;
use crate::stats::two_sided_quantile;

const STYLE: &str = include_str!("../report/page.css");
/// What the report's style has no use for.
const MORE: &str = ".trio{display:grid;grid-template-columns:repeat(auto-fit,minmax(300px,1fr));gap:8px}\n\
    .figures td:nth-of-type(1){font-weight:normal}\n\
    .figures th{white-space:nowrap}.one td:nth-of-type(-n+1),.two td:nth-of-type(-n+2){text-align:left}\n\
    .one th:nth-child(2),.two th:nth-child(2),.two th:nth-child(3){text-align:left!important}\n\
    .legend span{white-space:nowrap;margin-right:22px}.legend svg{vertical-align:middle;margin-right:7px}\n\
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
    section(&mut out, "Expected bounds", &tables::expected(study));
    if study.has_impact {
        section(&mut out, "At the impact", &tables::impacts(study));
    }
    section(&mut out, "What dominates", &tables::sources(study));
    section(
        &mut out,
        "With and without wheels and road limits",
        &tables::aids(study),
    );
    if !study.trials.is_empty() {
        section(
            &mut out,
            "The prediction against drawn sensors",
            &tables::trials(study),
        );
    }
    section(&mut out, "The data sheets", &tables::sheets(study));
    section(
        &mut out,
        "The figures of the source, computed again",
        &tables::figures(),
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

/// What t = 0 is.
pub(super) fn zero(study: &Study) -> &'static str {
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
    for (i, e) in study.expected.iter().enumerate().take(6) {
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
            "<div style=\"border-top-color:{}\"><dt>{}</dt><dd class=\"big\">{} m</dd><dd class=\"small\">{}</dd></div>",
            line(i).0,
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
    let mut out = String::from("<p class=\"legend\">");
    for (i, e) in study.expected.iter().enumerate() {
        let _ = write!(out, "<span>{}{}</span> ", swatch(i), escape(&e.sheet.name));
    }
    let _ = write!(
        out,
        "</p>\n<div class=\"pair\">\n<figure>{}</figure>\n<figure>{}</figure>\n</div>\n<div class=\"trio\">\n",
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
