//! `validate.html`: one page that needs neither network nor script, for a screen, a phone and paper.

use std::fmt::Write as _;

use crate::report::summary;
use crate::report::svg::escape;
use crate::validate::bars::Bar;
use crate::validate::fixes::Window;
use crate::validate::json::{GENERAL, definition};
use crate::validate::measure::{Measure, When};
use crate::validate::score::BACK_S;
use crate::validate::tables::{Figures, find};
use crate::validate::{ALL, ModelTables, Validation, page_tables as tables, pictures};

const STYLE: &str = include_str!("../report/page.css");
/// What this page has beyond the report.
const OWN: &str = "\
.panels{display:grid;grid-template-columns:repeat(auto-fit,minmax(290px,1fr));gap:10px}
.four{grid-template-columns:repeat(auto-fit,minmax(min(100%,400px),1fr))}
.numbers td,.numbers th:nth-child(n+2){text-align:right;font-variant-numeric:tabular-nums}
.numbers td{white-space:nowrap}
.numbers{font-size:.8rem}
.numbers th,.numbers td{padding:4px 6px}
.numbers tr.first th,.numbers tr.first td{border-top:1px solid #6d757e}
.bars{font-size:.86rem}
.facts td{overflow-wrap:break-word}
.bars .group th{font-weight:bold;background:#f2f4f6;padding-top:10px}
.bars td:last-child{font-weight:bold}
.bars .met td:last-child{color:#1d5c38}
.bars .missed td:last-child{color:#8a0035}
.bars .missed{background:#fdecf1}
.bars .open td:last-child{color:#474e57}
h3{font-size:1.02rem;margin:22px 0 8px;break-after:avoid}
@media print{.panels,.four{grid-template-columns:1fr 1fr}.scroll{overflow:visible}.numbers{font-size:7.5pt}.dense{font-size:6.3pt}.bars{font-size:8.5pt}
.numbers th,.numbers td,.bars th,.bars td{padding:2px 4px}.bars .missed{-webkit-print-color-adjust:exact;print-color-adjust:exact}
.model{break-before:page}}
";

/// Seeds by which figures were chosen.
const TUNED: [u64; 2] = [1, 100];

/// The limits of the method, said before any figure.
const LIMITS: [&str; 5] = [
    "The simulated crashes come from this project's own simulator: what it leaves out is not tested. It has no tyre model beyond slip, sideslip and friction, no deforming sensor mount, and each sensor error is drawn from the law that the sheet states.",
    "The seeds of this run are stated; figures were tuned on seeds 1 to 100 only. Whoever repeats the run with other seeds gets other draws of the same kind.",
    "Intervals say how much a figure could move by the draw of crashes alone. They say nothing of crashes of another kind.",
    "Between simulator and reconstruction lie the packing and the record of the recorder; the CAN bus is left out here and has tests of its own.",
    "Recorded drives are few, of few cars, and without a crash where their table says so; their errors within one drive belong together.",
];

/// The whole page.
#[must_use]
pub fn html(v: &Validation) -> String {
    let mut out = String::with_capacity(400_000);
    let software = summary::software();
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>Validation of the reconstruction</title>\n<style>\n{STYLE}{OWN}</style>\n</head>\n<body>\n<main>\n<header>\n\
         <h1>Validation of the reconstruction</h1>\n<p class=\"sub\">{} &middot; {}</p>\n</header>\n",
        escape(&software),
        escape(&plural(&v.settings.models))
    );
    out.push_str(&banner(v));
    let lists: Vec<(&ModelTables, Vec<Bar>)> =
        v.set.models.iter().map(|t| (t, v.bars(t))).collect();
    for (tables, bars) in &lists {
        out.push_str(&key(tables, bars, lists.len() > 1));
    }
    section(&mut out, "What was tested", &tested(v));
    out.push_str("<section class=\"limits\">\n<h2>What limits this validation</h2>\n<ul>\n");
    for limit in LIMITS {
        let _ = writeln!(out, "<li>{}</li>", escape(limit));
    }
    out.push_str("</ul>\n</section>\n");
    for (tables, bars) in &lists {
        model(&mut out, v, tables, bars);
    }
    section(&mut out, "Not scored", &not_scored(v));
    section(&mut out, "Definitions", &definitions());
    let _ = write!(
        out,
        "<footer>{}. The same seeds, models and recordings give the same bytes on one platform, on any number of processor cores.</footer>\n\
         </main>\n</body>\n</html>\n",
        escape(&software)
    );
    out
}

fn section(out: &mut String, title: &str, body: &str) {
    let _ = write!(
        out,
        "<section>\n<h2>{}</h2>\n{body}</section>\n",
        escape(title)
    );
}

fn plural(models: &[&str]) -> String {
    format!(
        "{} {}",
        if models.len() == 1 { "model" } else { "models" },
        models.join(", ")
    )
}

fn banner(v: &Validation) -> String {
    if v.whole() {
        return String::new();
    }
    let count = v.set.failures.len() + v.unused.len();
    format!(
        "<div class=\"banner\" role=\"alert\"><strong>Not everything could be scored.</strong>{count} {}; each is listed below with the reason. The figures hold for the rest.</div>\n",
        if count == 1 { "case" } else { "cases" }
    )
}

/// The four figures asked for first.
fn key(tables: &ModelTables, bars: &[Bar], name: bool) -> String {
    let mut out = String::new();
    if name {
        let _ = writeln!(out, "<h3>{}</h3>", escape(tables.model));
    }
    out.push_str("<dl class=\"key\">\n");
    let mut card = |term: &str, big: &str, small: &str| {
        let _ = writeln!(
            out,
            "<div><dt>{}</dt><dd class=\"big\">{}</dd><dd class=\"small\">{}</dd></div>",
            escape(term),
            escape(big),
            escape(small)
        );
    };
    let measured = bars.iter().filter(|b| b.met.is_some()).count();
    let met = bars.iter().filter(|b| b.met == Some(true)).count();
    card(
        "Bars met",
        &format!("{met} of {measured}"),
        &format!("{} not measured in this run", bars.len() - measured),
    );
    let at = |m, w| find(&tables.rows, ALL, m, w);
    let quantiles = |f: &Figures, unit: &str, digits: usize| {
        let [median, _, p95] = f.quantiles;
        (
            format!("{:.digits$} {unit}", median.value),
            format!(
                "median; 95 % of the crashes below {:.digits$} {unit}",
                p95.value
            ),
        )
    };
    if let Some(f) = at(Measure::ImpactSpeed, When::Impact(0)) {
        let (big, small) = quantiles(f, "m/s", 2);
        card("Error of the impact speed", &big, &small);
    }
    if let Some(f) = at(Measure::PositionShare, When::Back(0)) {
        let (big, small) = quantiles(f, "%", 2);
        card("Place 30 s before, of distance driven", &big, &small);
    }
    let inside: Vec<f64> = [Measure::Position, Measure::Speed, Measure::Heading]
        .into_iter()
        .flat_map(|m| (0..BACK_S.len()).map(move |i| (m, When::Back(i))))
        .filter_map(|(m, w)| Some(100.0 * at(m, w)?.coverage?[2].value()))
        .collect();
    if let Some(low) = inside.iter().copied().reduce(f64::min) {
        let high = inside.iter().copied().fold(low, f64::max);
        card(
            "Truth inside the 95 % bounds",
            &format!("{low:.1}\u{2013}{high:.1} %"),
            "place, speed and heading, least and most of five instants",
        );
    }
    out.push_str("</dl>\n");
    out
}

fn tested(v: &Validation) -> String {
    let s = &v.settings;
    let mut out = String::new();
    let mut say = |text: String| {
        let _ = writeln!(out, "<p>{}</p>", escape(&text));
    };
    if s.classes.is_empty() {
        say("No crash was simulated in this run.".to_owned());
    } else {
        let each = s.seeds[1] - s.seeds[0] + 1;
        let all = each * schema::num::u64_of(s.classes.len());
        say(format!(
            "{all} simulated crashes: {each} of each of the classes {}, seeds {} to {}. Each is a drive of 40 s at 12 to 33 m/s on a road with curves, crown and slope, a braking of 0.5 to 0.8 g with 5 to 15 % wheel slip and ABS cycling, one or two impacts of 8 to 80 km/h change of velocity with spin, and the slide to rest. The sensors are of consumer grade with the errors that the recorder's configuration states: offsets and their shift at the impact, scale, noise, driving vibration, mounting, late and coarse wheel frames.",
            s.classes.join(", "),
            s.seeds[0],
            s.seeds[1]
        ));
        say("The truth is the simulated motion before any sensor. The reconstruction sees the record alone: 10 ms means, packed as the recorder packs them, from 30 s before the trigger to the end.".to_owned());
    }
    let used = |first: u64, last: u64| first <= TUNED[1] && last >= TUNED[0];
    let simulated = !s.classes.is_empty() && used(s.seeds[0], s.seeds[1]);
    if simulated || s.fault_seeds.is_some_and(|[first, last]| used(first, last)) {
        say(format!(
            "Seeds {} to {} were used in tuning and some of them are in this run: its figures flatter.",
            TUNED[0], TUNED[1]
        ));
    }
    if let Some([first, last]) = s.fault_seeds {
        say(format!(
            "{} faults, one at a time, each in {} crashes (seeds {first} to {last}, the crash classes in turn).",
            v.faults
                .iter()
                .filter(|f| Some(&f.model) == s.models.first())
                .count(),
            last - first + 1
        ));
    }
    if !s.folders.is_empty() {
        say(format!(
            "{} windows of recordings with a truth of their own.",
            v.windows
                .iter()
                .filter(|w| Some(&w.model) == s.models.first())
                .count()
        ));
    }
    out
}

fn model(out: &mut String, v: &Validation, t: &ModelTables, bars: &[Bar]) {
    let simulated = !t.rows.is_empty();
    let _ = writeln!(out, "<div class=\"model\">");
    section(
        out,
        &format!("{}: what must hold", t.model),
        &format!(
            "<p>Verdicts go by the best estimate; \u{201c}not firmly\u{201d} where the interval reaches over the bar. The bars are those of the refined model; others are held against the same, so that they can be compared. {}</p>\n{}",
            escape(&t.left_out().unwrap_or_default()),
            tables::bars(bars)
        ),
    );
    if simulated {
        let _ = writeln!(
            out,
            "<section>\n<h2>{}: are the bounds honest?</h2>\n<p>On the dashed line as many truths lie inside the bounds as were claimed; above it the bounds are too wide, below it too narrow. An honest claim lies in the grey band 95 times in 100.</p>\n{}</section>",
            escape(t.model),
            panels("panels four", &pictures::calibration(t))
        );
        section(
            out,
            &format!("{}: how large are the errors?", t.model),
            &format!(
                "{}{}",
                panels("panels", &pictures::over_time(t)),
                panels("panels", &pictures::by_class(t))
            ),
        );
        section(
            out,
            &format!("{}: figures by class and instant", t.model),
            &figures(t),
        );
    }
    let faults: Vec<_> = v.faults.iter().filter(|f| f.model == t.model).collect();
    if !faults.is_empty() {
        section(
            out,
            &format!("{}: faults", t.model),
            &format!(
                "<p>Percent of the runs with the truth inside the 95 % bounds, and percent whose result names the fault.</p>\n{}",
                tables::faults(&faults)
            ),
        );
    }
    let windows: Vec<&Window> = v.windows.iter().filter(|w| w.model == t.model).collect();
    if !windows.is_empty() {
        section(
            out,
            &format!("{}: recordings", t.model),
            &format!(
                "<p>The path is laid on the fixes 3 to 30 m before its end; the noise of the fixes and the covariance of the laying are added to the ellipse. Reference speeds are taken as exact, though they are not: their shares are the least that can be said.</p>\n{}",
                tables::windows(&windows)
            ),
        );
    }
    out.push_str("</div>\n");
}

fn panels(class: &str, list: &[String]) -> String {
    let mut out = format!("<div class=\"{class}\">\n");
    for panel in list {
        let _ = writeln!(out, "<figure>{panel}</figure>");
    }
    out.push_str("</div>\n");
    out
}

fn figures(t: &ModelTables) -> String {
    let mut out = tables::found(t);
    for (title, measure) in [
        ("Position, m", Measure::Position),
        (
            "Position, % of the distance driven from there",
            Measure::PositionShare,
        ),
        ("Long half axis of the 95 % ellipse, m", Measure::Axis),
        ("Speed, m/s", Measure::Speed),
        ("Heading, degrees", Measure::Heading),
        ("Onset of the impact, ms", Measure::Onset),
        ("Speed at the impact, m/s", Measure::ImpactSpeed),
        ("Speed at the impact, %", Measure::ImpactSpeedShare),
        ("Delta-V longitudinal, m/s", Measure::Longitudinal),
        ("Delta-V lateral, m/s", Measure::Lateral),
        ("Delta-V resultant, m/s", Measure::Resultant),
        ("Principal direction of force, degrees", Measure::Pdof),
    ] {
        let _ = write!(
            out,
            "<h3>{}</h3>\n{}",
            escape(title),
            tables::measure(t, measure)
        );
    }
    let _ = write!(
        out,
        "<h3>Relative errors of delta-V</h3>\n{}",
        tables::delta_v(t)
    );
    out
}

fn not_scored(v: &Validation) -> String {
    let mut list: Vec<(String, String)> = v
        .unused
        .iter()
        .map(|u| (u.name.clone(), u.reason.clone()))
        .collect();
    list.extend(v.set.failures.iter().map(tables::failure));
    if list.is_empty() {
        return "<p>Nothing: every crash and recording asked for was scored.</p>\n".to_owned();
    }
    tables::failures(&list)
}

fn definitions() -> String {
    let measures = Measure::MOMENT.into_iter().chain(Measure::IMPACT);
    let mut rows: Vec<Vec<String>> = measures
        .map(|m| {
            vec![
                format!("{} ({})", m.name(), m.unit()),
                definition(m).to_owned(),
            ]
        })
        .collect();
    rows.extend(GENERAL.map(|(name, text)| vec![name.to_owned(), text.to_owned()]));
    tables::table("facts", &["Name", "Meaning"], &rows)
}
