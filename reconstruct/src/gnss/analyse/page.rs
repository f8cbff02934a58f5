//! `analysis.html`: the tables and the pictures on one page that needs neither network nor script.

use std::fmt::Write as _;

use super::pictures::Picture;
use super::tables::{Grid, Section};
use crate::report::summary::software;
use crate::report::svg::escape;

const STYLE: &str = include_str!("../../report/page.css");
/// What the report's style has no use for.
const MORE: &str = ".figures{font-size:.86rem}.figures td:nth-of-type(1){font-weight:normal}\n\
    .figures th,.figures td{padding:4px 7px}.figures tbody th{white-space:nowrap}\n\
    .figures td[colspan],.figures td.said{text-align:left;color:#474e57;white-space:normal}\n\
    .source th,.source td{color:#474e57;font-style:italic}h3{margin-top:22px}\n";

/// The whole page; `logs` names the files it is made from.
#[must_use]
pub fn html(
    sections: &[Section],
    pictures: &[Picture],
    logs: &[String],
    notes: &[String],
) -> String {
    let mut out = String::with_capacity(400_000);
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>Receiver and sensors</title>\n<style>\n{STYLE}{MORE}</style>\n</head>\n<body>\n<main>\n<header>\n\
         <h1>What the logs tell of receiver and sensors</h1>\n<p class=\"sub\">{} &middot; in brackets: intervals of 95 %; behind &plusmn;: one standard error</p>\n</header>\n",
        escape(&logs.join(", "))
    );
    if !notes.is_empty() {
        out.push_str("<section class=\"limits\">\n<h2>What is amiss with the logs</h2>\n<ul>\n");
        for note in notes {
            let _ = writeln!(out, "<li>{}</li>", escape(note));
        }
        out.push_str("</ul>\n</section>\n");
    }
    for section in sections {
        let _ = write!(out, "<section>\n<h2>{}</h2>\n", escape(section.title));
        for sentence in &section.words {
            let _ = writeln!(out, "<p>{}</p>", nice(sentence));
        }
        for picture in pictures
            .iter()
            .filter(|p| section.pictures.contains(&p.name))
        {
            let _ = writeln!(
                out,
                "<figure>{}<figcaption>{}</figcaption></figure>",
                picture.svg,
                escape(&picture.caption)
            );
        }
        for grid in &section.grids {
            table(&mut out, grid);
        }
        out.push_str("</section>\n");
    }
    let _ = write!(
        out,
        "<section>\n<h2>Method</h2>\n{METHOD}</section>\n<footer>{}. The same logs and options give the same bytes.</footer>\n</main>\n</body>\n</html>\n",
        escape(&software())
    );
    out
}

const METHOD: &str = "<p>Standard errors of means come from batch means: at least four integrated autocorrelation times a batch, 5 to 50 batches, \
    Student's interval. A count is followed by how many independent samples it is worth. Variances are about the mean of 4 s, with the degrees of \
    freedom that autocorrelation and the scatter of the windows leave. Stands come from the stop detector of <code>gnss run</code>. \
    Between its fixes the reference follows a cubic. Scale and bias of the accelerometer make the size of each still span's force that of gravity. \
    The Allan deviation is the overlapping one, its degrees of freedom those of Howe, Allan and Barnes (1981).</p>\n\
    <p>Figures marked S00 are those of chapter 4 of the thesis that the formats come from; they stand beside for comparison and are used nowhere.</p>\n";

/// Signs as they are set in print.
fn nice(text: &str) -> String {
    let text = escape(text)
        .replace("+-", "\u{b1}")
        .replace("^2", "\u{b2}")
        .replace("1e-3 ", "10<sup>&minus;3</sup> ")
        .replace("1e-6 ", "10<sup>&minus;6</sup> ");
    let mut out = String::with_capacity(text.len());
    let mut before = ' ';
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let number = rest.peek().is_some_and(char::is_ascii_digit);
        if c == 'e' && before.is_ascii_digit() && rest.peek() == Some(&'-') {
            // 4.85e-3
            rest.next();
            out.push_str("\u{b7}10<sup>\u{2212}");
            while let Some(digit) = rest.next_if(char::is_ascii_digit) {
                out.push(digit);
            }
            out.push_str("</sup>");
        } else if c == '-' && number && matches!(before, ' ' | '[' | '(') {
            out.push('\u{2212}');
        } else {
            out.push(c);
        }
        before = c;
    }
    out
}

fn table(out: &mut String, grid: &Grid) {
    let _ = write!(
        out,
        "<h3>{}</h3>\n<div class=\"scroll\">\n<table class=\"figures\">\n<thead><tr>",
        nice(&grid.title)
    );
    for head in &grid.head {
        let _ = write!(out, "<th>{}</th>", nice(head));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in &grid.rows {
        let source = row.first().is_some_and(|c| c.starts_with("  S00"));
        out.push_str(if source {
            "<tr class=\"source\">"
        } else {
            "<tr>"
        });
        // A sentence alone in the rest of a row runs over it.
        let filled = row.iter().rposition(|c| !c.is_empty()).unwrap_or(0);
        for (c, cell) in row.iter().enumerate() {
            if c == 0 {
                let _ = write!(out, "<th>{}</th>", nice(cell));
            } else if c == filled && c == 1 && row.len() > 2 {
                let _ = write!(out, "<td colspan=\"{}\">{}</td>", row.len() - 1, nice(cell));
                break;
            } else if cell.starts_with("cannot tell") {
                let _ = write!(out, "<td class=\"said\">{}</td>", nice(cell));
            } else {
                let _ = write!(out, "<td>{}</td>", nice(cell));
            }
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table>\n</div>\n");
}
