//! The pages: one file each that needs neither network nor script.

use std::fmt::Write as _;

use super::{Picture, Shown, study as picture, tables};
use crate::gnss::analyse::correlated as figures;
use crate::gnss::experiments::{Experiment, Outcome};
use crate::gnss::forward::Fate;
use crate::gnss::outages::{Mean, Study};
use crate::report::summary;
use crate::report::svg::escape;
use crate::report::tables::{row, table};

pub use tables::{stops_json, stops_text, study_json, study_text};

const STYLE: &str = include_str!("../../report/page.css");

/// Heading, figures asked for first, notes, and sections of a page.
struct Page {
    title: &'static str,
    sub: String,
    /// Term, figure, what it rests on.
    key: Vec<[String; 3]>,
    limits: Vec<String>,
    sections: Vec<(&'static str, String)>,
}

fn html(page: &Page) -> String {
    let mut out = String::new();
    let title = escape(page.title);
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>{title}</h1>\n\
         <p class=\"sub\">{}</p>\n</header>\n",
        escape(&page.sub)
    );
    if !page.key.is_empty() {
        out.push_str("<dl class=\"key\">\n");
        for [term, big, small] in &page.key {
            let _ = writeln!(
                out,
                "<div><dt>{}</dt><dd class=\"big\">{}</dd><dd class=\"small\">{}</dd></div>",
                escape(term),
                escape(big),
                escape(small)
            );
        }
        out.push_str("</dl>\n");
    }
    out.push_str("<section class=\"limits\">\n<h2>What limits this result</h2>\n<ul>\n");
    for limit in &page.limits {
        let _ = writeln!(out, "<li>{}</li>", escape(limit));
    }
    out.push_str("</ul>\n</section>\n");
    for (title, body) in &page.sections {
        let _ = writeln!(
            out,
            "<section>\n<h2>{}</h2>\n{body}</section>",
            escape(title)
        );
    }
    let _ = write!(
        out,
        "<footer>{}. The same logs and options give the same bytes.</footer>\n</main>\n</body>\n</html>\n",
        escape(&summary::software())
    );
    out
}

fn figure(svg: &str, caption: &str) -> String {
    format!(
        "<figure>{svg}<figcaption>{}</figcaption></figure>\n",
        escape(caption)
    )
}

const STOPS_NOTE: &str = "Counted at full seconds against a reference speed of 0.2 m/s, as S00 does; in brackets the exact interval of 95 % of a Poisson rate. Wrong seconds come in runs at the ends of stands and are taken for independent: the true interval is wider. A stand of the reference is two seconds or more; it is found if one of them is.";

/// What a page says of how its figures came about.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// The logs in words.
    pub files: String,
    /// What there is to note.
    pub notes: Vec<String>,
    /// What was taken and told: term and value.
    pub rows: Vec<[String; 2]>,
    /// What of the drive is before the track, if it is worth a word.
    pub begin: Option<String>,
    /// The filter was fed the reference's own speed.
    pub fed: bool,
}

impl Told {
    fn section(&self) -> (&'static str, String) {
        let mut rows = String::new();
        for [term, value] in &self.rows {
            row(&mut rows, term, std::slice::from_ref(value));
        }
        let table = table("plain rows told", &["what", "value"], &rows);
        ("What was taken and told", table)
    }
}

const FED: &str = "The filter was fed the reference's own speed (--exact-speed): the deviation from that reference is not that of a drive without it.";

/// The figures asked for first.
fn first_figures(shown: &Shown<'_>, fed: bool) -> Vec<[String; 3]> {
    let mut key = Vec::new();
    let s = shown.seconds;
    let n = schema::num::real(s.len());
    if s.is_empty() {
        let why = if shown.reference.marks.is_empty() {
            "no reference was given"
        } else {
            "reference and track do not meet"
        };
        key.push(["Deviation".into(), "cannot tell".into(), why.into()]);
    } else {
        let off: Vec<f64> = s.iter().map(|s| s.off_m).collect();
        let mean = figures::mean(&off);
        let largest = off.iter().copied().fold(0.0, f64::max);
        let inside = schema::num::real(s.iter().filter(|s| s.inside).count()) / n;
        let near = |x: f64| format!("{x:.1} m");
        key.push([
            if fed {
                "Mean deviation, with the reference's speed fed in"
            } else {
                "Mean deviation"
            }
            .into(),
            mean.map_or_else(String::new, |m| near(m.value)),
            format!(
                "{}largest {}, of {} instants of the reference",
                mean.filter(|m| m.se.is_finite())
                    .map_or_else(String::new, |m| format!(
                        "standard error {}, ",
                        tables::small(m.se, "m")
                    )),
                near(largest),
                s.len()
            ),
        ]);
        key.push([
            "Inside its ellipse of 95 %".into(),
            format!("{:.0} %", 100.0 * inside),
            "of these instants; they follow each other and are not independent".into(),
        ]);
    }
    let [used, refused, forced] = [Fate::Used, Fate::Refused, Fate::Forced]
        .map(|fate| shown.shots.iter().filter(|s| s.fate == Some(fate)).count());
    let begin = shown.track.first().map_or(f64::INFINITY, |e| e.t_s);
    let left = shown.shots.iter().filter(|s| s.fate.is_none());
    let early = left.clone().filter(|s| s.fix.t_s < begin).count();
    key.push([
        "Fixes used".into(),
        format!("{used}"),
        format!(
            "of {} in the log; {refused} refused, {forced} forced in after refusals, {} not given to the filter, {early} of them before the track begins",
            shown.shots.len(),
            left.count()
        ),
    ]);
    let longest = shown
        .outages
        .iter()
        .map(|o| o[1] - o[0])
        .fold(0.0, f64::max);
    key.push([
        "Longest time without a fix".into(),
        if shown.outages.is_empty() {
            "none".into()
        } else {
            format!("{longest:.0} s")
        },
        match shown.outages.len() {
            0 => "no outage of 2.5 s or more".into(),
            1 => "one outage of 2.5 s or more".into(),
            many => format!("the longest of {many} outages of 2.5 s or more"),
        },
    ]);
    key
}

/// `report.html` of a drive; `pictures` are [`super::all`] of it, with what was told.
#[must_use]
pub fn drive(shown: &Shown<'_>, pictures: &[Picture], told: &Told) -> String {
    let s = shown.seconds;
    let key = first_figures(shown, told.fed);
    let mut limits: Vec<String> = Vec::new();
    limits.extend(told.fed.then(|| FED.to_owned()));
    limits.extend(told.begin.clone());
    limits.push(
        "Bounds are the filter's own: they rest on what it takes for granted of sensors and receiver, and hold as far as that does.".to_owned(),
    );
    if s.is_empty() {
        limits.push(
            "Without a reference nothing here says how far the track is from the truth.".to_owned(),
        );
    } else {
        limits.push(
            "Deviations are from the reference receiver, whose own errors are in them.".to_owned(),
        );
    }
    limits.extend(told.notes.iter().cloned());
    let mut sections: Vec<(&'static str, String)> = Vec::new();
    let mut plans = String::new();
    let mut rest = String::new();
    for (name, caption, svg) in pictures {
        let to = if name.starts_with("plan") {
            &mut plans
        } else {
            &mut rest
        };
        to.push_str(&figure(svg, caption));
    }
    sections.push(("The drive from above", plans));
    if s.is_empty() {
        sections.push((
            "Deviation over time",
            "<p>Cannot tell: without a reference receiver (<code>--reference</code>) that meets the track there is nothing to compare with.</p>\n".into(),
        ));
    }
    sections.push(("Over time", rest));
    let stops = if shown.counts.iter().all(|c| c.seconds == 0) {
        "<p>Cannot tell: no second of a reference with speed lies within the drive.</p>\n"
            .to_owned()
    } else {
        format!(
            "{}<p class=\"sub\">{STOPS_NOTE}</p>\n",
            tables::stops(shown.counts)
        )
    };
    sections.push(("Errors of the stop detectors", stops));
    sections.push(told.section());
    html(&Page {
        title: "A drive from satellite fixes and inertial samples",
        sub: format!("{}; filter: {}", told.files, shown.filter),
        key,
        limits,
        sections,
    })
}

/// `outages.html`.
#[must_use]
pub fn outages(study: &Study, told: &Told) -> String {
    let mut limits = vec![
        "One drive: its windows share a car, a road and a receiver. The figures behind the sign \u{b1} are standard errors over its outages and windows alone.".to_owned(),
        "Deviations are from the reference receiver, whose own errors are in them. The published filter starts each window with the place of its fix and the velocity of the reference; ours has run since the drive began.".to_owned(),
        "S00's figures are those that it read off its own pictures, of other drives.".to_owned(),
    ];
    limits.extend(told.notes.iter().chain(&study.notes).cloned());
    let svg = picture::study(study);
    let drawn = if svg.is_empty() {
        "<p>Cannot tell: no experiment could be done on this drive.</p>\n".to_owned()
    } else {
        figure(
            &svg,
            "Each window begins with a fix. Where the published filter leaves the scale, the largest value is said.",
        )
    };
    html(&Page {
        title: "What outages cost",
        sub: told.files.clone(),
        key: Vec::new(),
        limits,
        sections: vec![
            ("Deviation at the ends of the outages", tables::study(study)),
            ("Deviation over time", drawn),
            told.section(),
        ],
    })
}

/// `experiments.html` of the simulated drives of some seeds.
#[must_use]
pub fn experiments(all: &[Outcome], seeds: [u64; 2]) -> String {
    let mut rows = String::new();
    for experiment in Experiment::ALL {
        let of: Vec<&Outcome> = all.iter().filter(|o| o.experiment == experiment).collect();
        let mean = |f: fn(&Outcome) -> f64| {
            tables::with_error(Mean::of(&of.iter().map(|o| f(o)).collect::<Vec<f64>>()))
        };
        let shares: Vec<f64> = of
            .iter()
            .filter(|o| o.inside[0] > 0)
            .map(|o| 100.0 * schema::num::real(o.inside[1]) / schema::num::real(o.inside[0]))
            .collect();
        row(
            &mut rows,
            &experiment.name(),
            &[
                of.len().to_string(),
                experiment
                    .source_m()
                    .map_or_else(|| "-".to_owned(), |m| format!("{m:.0}")),
                mean(|o| o.published_m[0]),
                mean(|o| o.published_m[1]),
                mean(|o| o.cold_m),
                mean(|o| o.alone_m),
                mean(|o| o.ours_m),
                mean(|o| o.smoothed_m),
                tables::with_error(Mean::of(&shares)),
            ],
        );
    }
    let head = [
        "experiment",
        "windows",
        "S00",
        "published",
        "mended",
        "ours, cold",
        "ours, alone",
        "ours",
        "smoothed",
        "inside 95 %, %",
    ];
    html(&Page {
        title: "The experiments of S00 on simulated drives",
        sub: format!("seeds {} to {}", seeds[0], seeds[1]),
        key: Vec::new(),
        limits: vec![
            "The drives come from this project's own simulator: what it leaves out is not tested."
                .to_owned(),
            "S00's figures are those that it read off its own pictures, of other drives."
                .to_owned(),
        ],
        sections: vec![
            (
                "Largest deviation of a window from the truth, m",
                table("plain rows", &head, &rows)
                    + "<p class=\"sub\">Means over the windows with their standard errors. Cold: from the start that the published program has; ours: with a fix each second until the window begins, and told the heading there, as the published filter is; alone: the same with its own heading.</p>\n",
            ),
            (
                "In a picture",
                figure(
                    &picture::experiments(all),
                    "Bars are intervals of 95 % of the means; a dot without a bar is one window, of which no interval can be told.",
                ),
            ),
        ],
    })
}
