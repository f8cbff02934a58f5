//! The tables of `validate.html`.

use std::fmt::Write as _;

use crate::report::svg::escape;
use crate::validate::bars::Bar;
use crate::validate::fault_runs::FaultTables;
use crate::validate::fixes::Window;
use crate::validate::honesty::worst;
use crate::validate::measure::{Measure, When};
use crate::validate::score::BACK_S;
use crate::validate::statistics::{Estimate, Share};
use crate::validate::tables::{Figures, find};
use crate::validate::{Failure, ModelTables};

/// Rows of a list of failures that are shown one by one.
const LISTED: usize = 50;

/// A table of rows of cells; the first column is text, the others are numbers.
pub(super) fn table(class: &str, head: &[&str], rows: &[Vec<String>]) -> String {
    let mut out = format!("<div class=\"scroll\"><table class=\"{class}\">\n<thead><tr>");
    for cell in head {
        let _ = write!(out, "<th>{}</th>", escape(cell));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for (k, row) in rows.iter().enumerate() {
        // A line above the first row of each class.
        let before = k
            .checked_sub(1)
            .and_then(|k| rows.get(k))
            .and_then(|r| r.first());
        out.push_str(if row.first() == before {
            "<tr>"
        } else {
            "<tr class=\"first\">"
        });
        for (i, cell) in row.iter().enumerate() {
            let tag = if i == 0 { "th" } else { "td" };
            let _ = write!(out, "<{tag}>{}</{tag}>", escape(&nice(cell)));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
    out
}

/// Minus signs that are none of a word.
fn nice(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut before = ' ';
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let number = rest.peek().is_some_and(char::is_ascii_digit);
        out.push(if c == '-' && number && !before.is_alphanumeric() {
            '\u{2212}'
        } else {
            c
        });
        before = c;
    }
    out
}

/// What must hold.
pub(super) fn bars(list: &[Bar]) -> String {
    let mut out = String::from(
        "<div class=\"scroll\"><table class=\"bars\">\n<thead><tr><th>What</th><th>Measured (95 % interval)</th><th>Bar</th><th>Verdict</th></tr></thead>\n<tbody>\n",
    );
    let mut item = 0;
    for bar in list {
        if bar.item != item {
            item = bar.item;
            let of = |met: Option<bool>| {
                list.iter()
                    .filter(|b| b.item == item && b.met == met)
                    .count()
            };
            let (met, missed, open) = (of(Some(true)), of(Some(false)), of(None));
            let _ = writeln!(
                out,
                "<tr class=\"group\"><th colspan=\"4\">{item}. {}: {met} met, {missed} not met, {open} not measured</th></tr>",
                Bar::title(item)
            );
        }
        let class = match bar.met {
            Some(true) => "met",
            Some(false) => "missed",
            None => "open",
        };
        let _ = writeln!(
            out,
            "<tr class=\"{class}\"><th>{}</th><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&nice(&bar.what)),
            escape(&nice(&bar.measured)),
            escape(&bar.bar),
            bar.verdict_in_words()
        );
    }
    out.push_str("</tbody></table></div>\n");
    out
}

fn digits(x: f64) -> usize {
    if x.abs() >= 9.995 {
        1
    } else if x.abs() >= 0.995 {
        2
    } else {
        3
    }
}

fn with_interval(e: Option<&Estimate>) -> String {
    e.map_or("\u{2013}".to_owned(), |e| {
        let d = digits(e.value);
        format!("{:.d$} ({:.d$} to {:.d$})", e.value, e.low, e.high)
    })
}

fn shares(shares: Option<[Share; 4]>) -> String {
    shares.map_or("no bounds".to_owned(), |s| {
        s.map(|share| format!("{:.1}", 100.0 * share.value()))
            .join(" / ")
    })
}

fn at95(list: Option<[Share; 4]>) -> String {
    list.and_then(|s| s[2].estimate())
        .map_or("\u{2013}".to_owned(), |e| {
            format!("{:.1} to {:.1}", 100.0 * e.low, 100.0 * e.high)
        })
}

const HEAD: [&str; 9] = [
    "Class",
    "At",
    "Crashes",
    "Median",
    "90th percentile",
    "95th percentile",
    "Inside 50 / 80 / 95 / 99 %, %",
    "at 95 %",
    "NEES/n",
];

fn line(group: &str, when: When, f: &Figures) -> Vec<String> {
    let [median, p90, p95] = &f.quantiles;
    vec![
        group.to_owned(),
        when.name(),
        f.n.to_string(),
        with_interval(Some(median)),
        with_interval(Some(p90)),
        with_interval(Some(p95)),
        shares(f.coverage),
        at95(f.coverage),
        with_interval(f.nees.as_ref()),
    ]
}

/// One measure by class and instant (or impact).
pub(super) fn measure(tables: &ModelTables, measure: Measure) -> String {
    let moment = Measure::MOMENT.contains(&measure);
    let places: Vec<When> = if moment {
        (0..BACK_S.len()).map(When::Back).collect()
    } else {
        vec![When::Impact(0), When::Impact(1)]
    };
    let mut rows = Vec::new();
    for found in &tables.found {
        for when in &places {
            if let Some(f) = find(&tables.rows, &found.group, measure, *when) {
                rows.push(line(&found.group, *when, f));
            }
        }
    }
    table("numbers", &HEAD, &rows)
}

/// Relative errors of delta-V by class.
pub(super) fn delta_v(tables: &ModelTables) -> String {
    let columns = [
        Measure::LongitudinalPooled,
        Measure::LongitudinalShare,
        Measure::LongitudinalOwn,
        Measure::LateralPooled,
        Measure::LateralShare,
    ];
    let mut rows = Vec::new();
    for found in &tables.found {
        for when in [When::Impact(0), When::Impact(1)] {
            let cells: Vec<Option<&Figures>> = columns
                .iter()
                .map(|m| find(&tables.rows, &found.group, *m, when))
                .collect();
            let Some(Some(first)) = cells.first() else {
                continue;
            };
            let mut row = vec![found.group.clone(), when.name(), first.n.to_string()];
            row.extend(cells.iter().map(|f| with_interval(f.map(|f| &f.rms))));
            rows.push(row);
        }
    }
    let head = [
        "Class",
        "At",
        "Crashes",
        "Longitudinal: rms error / rms resultant, %",
        "rms of each error / resultant, %",
        "rms error / rms longitudinal, %",
        "Lateral: rms error / rms resultant, %",
        "rms of each error / resultant, %",
    ];
    table("numbers", &head, &rows)
}

/// What was found at all.
pub(super) fn found(tables: &ModelTables) -> String {
    let rows: Vec<Vec<String>> = tables
        .found
        .iter()
        .map(|f| {
            let of = |s: Share| format!("{} of {}", s.hits, s.of);
            vec![
                f.group.clone(),
                of(f.scored),
                of(f.rest),
                of(f.impacts),
                f.false_impacts.to_string(),
            ]
        })
        .collect();
    table(
        "numbers",
        &[
            "Class",
            "Scored",
            "Rest found",
            "Impacts found",
            "False impacts",
        ],
        &rows,
    )
}

/// Faults.
pub(super) fn faults(list: &[&FaultTables]) -> String {
    let rows: Vec<Vec<String>> = list
        .iter()
        .map(|f| {
            let name = f.fault.name();
            let inside = |m: Measure, w: When| {
                find(&f.rows, name, m, w)
                    .and_then(|f| f.coverage)
                    .map_or("\u{2013}".to_owned(), |s| {
                        format!("{:.0}", 100.0 * s[2].value())
                    })
            };
            let times = |m: Measure| {
                (0..BACK_S.len())
                    .map(|i| inside(m, When::Back(i)))
                    .collect::<Vec<_>>()
                    .join(" / ")
            };
            let impact = |m: Measure| inside(m, When::Impact(0));
            let percent = |s: Share| format!("{:.0}", 100.0 * s.value());
            vec![
                f.fault.about().to_owned(),
                format!("{} of {}", f.found.scored.hits, f.found.scored.of),
                times(Measure::Position),
                times(Measure::Speed),
                times(Measure::Heading),
                impact(Measure::ImpactSpeed),
                format!(
                    "{} / {}",
                    impact(Measure::Longitudinal),
                    impact(Measure::Lateral)
                ),
                worst(&f.rows).map_or("\u{2013}".to_owned(), |(m, w, e)| {
                    format!("{:.0} ({}, {})", 100.0 * e.value, m.words(), w.name())
                }),
                percent(f.named),
                percent(f.named_without),
            ]
        })
        .collect();
    let head = [
        "Fault",
        "Scored",
        "Position at -30 / -10 / -5 / -1 / 0 s",
        "Speed",
        "Heading",
        "Impact speed",
        "Delta-V long. / lat.",
        "Worst",
        "Named",
        "Same words without it",
    ]
    .map(nice);
    table("numbers dense", &head.each_ref().map(String::as_str), &rows)
}

/// Recordings.
pub(super) fn windows(list: &[&Window]) -> String {
    let number = |x: Option<f64>| x.map_or("\u{2013}".to_owned(), |x| format!("{x:.2}"));
    let rows: Vec<Vec<String>> = list
        .iter()
        .map(|w| {
            vec![
                w.name.clone(),
                if w.rest_found { "rest" } else { "moving" }.to_owned(),
                format!("{:.0}", w.distance_m),
                w.fixes.to_string(),
                number(w.start_m),
                number(w.start_percent),
                w.back_percent.map(number).join(" / "),
                shares(w.coverage),
                shares(w.coverage_far),
                w.speed
                    .map_or("\u{2013}".to_owned(), |[a, b]| format!("{a:.3} / {b:.3}")),
                shares(w.speed_coverage),
            ]
        })
        .collect();
    let head = [
        "Window",
        "Ends",
        "Driven, m",
        "Fixes",
        "Start error, m",
        "% of distance",
        "% at -30 / -20 / -10 / -5 s",
        "Fixes inside 50 / 80 / 95 / 99 %, %",
        "Beyond 30 m of the end",
        "Speed error m/s, median / 95 %",
        "Speeds inside, %",
    ]
    .map(nice);
    table("numbers dense", &head.each_ref().map(String::as_str), &rows)
}

/// What could not be scored.
pub(super) fn failures(list: &[(String, String)]) -> String {
    let mut rows: Vec<Vec<String>> = list
        .iter()
        .take(LISTED)
        .map(|(name, reason)| vec![name.clone(), reason.clone()])
        .collect();
    if list.len() > LISTED {
        rows.push(vec![
            format!("and {} more", list.len() - LISTED),
            String::new(),
        ]);
    }
    table("facts", &["What", "Why not"], &rows)
}

/// A failure's line.
pub(super) fn failure(f: &Failure) -> (String, String) {
    (format!("{} by {}", f.crash, f.model), f.reason.clone())
}
