//! Where the path lies on a road map: words, a table of the answers, and the picture.

use crate::findings::Reconstruction;
use crate::map::place::{Answer, Placing, side};
use crate::map::search::Verdict;
use crate::report::svg::{escape, signed};
use crate::report::tables::{row, table};
use crate::report::{map_json, map_picture, number};
use crate::stats::two_sided_quantile;

/// The section of the page; empty where no map was given.
#[must_use]
pub fn section(r: &Reconstruction) -> String {
    let Some(placing) = r.map.as_deref() else {
        return String::new();
    };
    let mut out = String::new();
    for sentence in sentences(placing, r.confidence) {
        out.push_str("<p>");
        out.push_str(&escape(&sentence));
        out.push_str("</p>\n");
    }
    out.push_str("<figure>");
    out.push_str(&map_picture::picture(r, placing));
    out.push_str("</figure>\n");
    if !placing.answers.is_empty() {
        out.push_str(&answers(placing, r.confidence));
    }
    out
}

/// One line for the screen, plain ASCII.
pub(crate) fn line(p: &Placing, confidence: f64) -> String {
    match (p.verdict, p.answers.first()) {
        (Verdict::Placed, Some(best)) => format!(
            "rest {:.5}, {:.5} (within {:.0} m), heading {:.1} +-{:.1} deg",
            best.pose.latitude_deg,
            best.pose.longitude_deg,
            map_json::ellipse(best, confidence).semi_major,
            best.pose.heading_deg,
            two_sided_quantile(confidence) * best.pose.sd_deg
        ),
        (Verdict::Ambiguous, _) => "ambiguous: no place is claimed".to_owned(),
        _ => "the path fits no road near the rest point".to_owned(),
    }
}

fn sentences(p: &Placing, confidence: f64) -> Vec<String> {
    let rough = format!(
        "The path before the first impact was laid on the road lines of {}, from a rough place of rest {} (one sigma \
         {:.0} m){}; traffic keeps to the {}.",
        p.file,
        place(p.point.latitude_deg, p.point.longitude_deg, 5),
        p.point.sd_m,
        p.heading.map_or_else(
            || " and no heading".to_owned(),
            |[heading, sd]| format!(
                " and a rough heading of {heading:.0}\u{b0} (one sigma {sd:.0}\u{b0})"
            )
        ),
        side(p.traffic)
    );
    let mut out = vec![rough];
    match (p.verdict, p.answers.first()) {
        (Verdict::Placed, Some(best)) => {
            let e = map_json::ellipse(best, confidence);
            let half = two_sided_quantile(confidence) * best.pose.sd_deg;
            out.push(format!(
                "One place fits: the car came to rest at {}, within an ellipse of half axes {} m and {} m, heading {}\u{b0} \
                 \u{b1} {}\u{b0} clockwise from true north, both with {} confidence{}. {} of {} points of the path \
                 lie on a road. Latitude and heading were used for the terms of the Earth's rotation, and the path \
                 was computed and laid once more.",
                place(best.pose.latitude_deg, best.pose.longitude_deg, 5),
                number_of(e.semi_major),
                number_of(e.semi_minor),
                signed(best.pose.heading_deg, 1),
                number_of(half),
                number::percent(confidence),
                on_roads(best),
                best.fit.on_road,
                best.fit.points
            ));
        }
        (Verdict::Ambiguous, _) => {
            out.push("The answer is ambiguous: no single place is claimed. The most likely one is drawn for orientation only.".to_owned());
            out.extend(p.why.iter().cloned());
        }
        _ => out.extend(p.why.iter().cloned()),
    }
    out
}

fn number_of(x: f64) -> String {
    signed(x, number::decimals(x, 0, 1))
}

fn place(latitude: f64, longitude: f64, digits: usize) -> String {
    format!(
        "{}, {}",
        signed(latitude, digits),
        signed(longitude, digits)
    )
}

fn on_roads(a: &Answer) -> String {
    if a.roads.is_empty() {
        return String::new();
    }
    let named: Vec<&str> = a.roads.iter().take(4).map(String::as_str).collect();
    format!(", on {}", named.join(", "))
}

fn answers(p: &Placing, confidence: f64) -> String {
    let mut rows = String::new();
    for (i, a) in p.answers.iter().take(8).enumerate() {
        let e = map_json::ellipse(a, confidence);
        let name = match (p.verdict, i) {
            (Verdict::Placed, 0) => "The place".to_owned(),
            (Verdict::NoFit, _) => format!("Tried {}", i + 1),
            _ => format!("Answer {}", i + 1),
        };
        let probability = match p.verdict {
            Verdict::NoFit => "none: it does not fit".to_owned(),
            _ if a.probability >= 0.995 => "more than 99 %".to_owned(),
            _ if a.probability < 0.01 => "less than 1 %".to_owned(),
            _ => format!("{:.0} %", 100.0 * a.probability),
        };
        row(
            &mut rows,
            &name,
            &[
                place(a.pose.latitude_deg, a.pose.longitude_deg, 5),
                format!(
                    "{} m and {} m",
                    number_of(e.semi_major),
                    number_of(e.semi_minor)
                ),
                format!(
                    "{}\u{b0} \u{b1} {}\u{b0}",
                    signed(a.pose.heading_deg, 1),
                    number_of(two_sided_quantile(confidence) * a.pose.sd_deg)
                ),
                probability,
                format!("{} of {}", a.fit.on_road, a.fit.points),
            ],
        );
    }
    let ellipse = format!("{} ellipse, half axes", number::percent(confidence));
    table(
        "places",
        &[
            "",
            "Rest: latitude, longitude",
            &ellipse,
            "Heading at rest",
            "Probability",
            "Points on a road",
        ],
        &rows,
    )
}
