//! `report.html`: one page that needs neither network nor script, for a screen, a phone and paper.

use std::fmt::Write as _;

use crate::findings::Reconstruction;
use crate::report::case::{Case, Signature};
use crate::report::motion::Layout;
use crate::report::number::{self, KMH};
use crate::report::pictures::Pictures;
use crate::report::plan::View;
use crate::report::svg::escape;
use crate::report::{
    finding_tables, fixes, impact_tables, map, record_tables, summary, tables, words,
};
use crate::smooth::Smoother;

const STYLE: &str = include_str!("page.css");

/// The whole page.
#[must_use]
pub fn html(r: &Reconstruction, case: &Case<'_>, pictures: &Pictures) -> String {
    let software = summary::software();
    let mut out = String::with_capacity(400_000);
    let title = format!("Crash reconstruction: {}", case.file);
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>{}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>Crash reconstruction</h1>\n\
         <p class=\"sub\">{} &middot; model {} &middot; bounds at {} confidence</p>\n</header>\n",
        escape(&title),
        escape(case.file),
        escape(r.model),
        number::percent(r.confidence)
    );
    out.push_str(&banner(case));
    out.push_str(&key(r));
    section(&mut out, "Summary", &paragraphs(&words::sentences(r, case)));
    out.push_str(&limits(r));
    let before = if r.impacts.is_empty() {
        "The last seconds before the stop"
    } else {
        "The last seconds before the impact"
    };
    section(&mut out, before, &finding_tables::reaction(r));
    section(&mut out, "The impacts", &impact_tables::all(r));
    section(&mut out, "Roll-over and rest", &finding_tables::rest(r));
    section(&mut out, "Path of the car", &path(r, pictures));
    if r.map.is_some() {
        section(&mut out, "Where on the map", &map::section(r));
    }
    if r.gnss.is_some() {
        section(&mut out, "Satellite fixes", &fixes::section(r));
    }
    section(&mut out, "Motion over time", &over_time(pictures));
    section(&mut out, "Figures and their bounds", &tables::figures(r));
    section(&mut out, "Models side by side", &models(r));
    if !r.details.budgets.is_empty() {
        section(
            &mut out,
            "Where the uncertainty comes from",
            &finding_tables::budgets(r),
        );
    }
    section(
        &mut out,
        "The record",
        &record_tables::identity(case, &software),
    );
    section(&mut out, "Triggers", &record_tables::triggers(case));
    section(
        &mut out,
        "Health of the record",
        &record_tables::health(r, case),
    );
    let seal = format!(
        "<p>{}</p>\n{}",
        escape(case.seal_sentence()),
        record_tables::seal(case)
    );
    section(&mut out, "Seal and digest", &seal);
    section(&mut out, "Method", &method(r));
    let _ = write!(
        out,
        "<footer>{}. Made from {} with SHA-256 {}. The same record and options give the same bytes.</footer>\n</main>\n</body>\n</html>\n",
        escape(&software),
        escape(case.file),
        crate::export::fixed::hex(&case.file_sha256)
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

fn paragraphs(sentences: &[String]) -> String {
    sentences.iter().fold(String::new(), |mut out, s| {
        let _ = writeln!(out, "<p>{}</p>", escape(&s.replace('-', "\u{2011}")));
        out
    })
}

/// Red, above everything: what is wrong with the file this was made from.
fn banner(case: &Case<'_>) -> String {
    const LISTED: usize = 20;
    let broken = case.signature == Signature::Broken;
    if !broken && case.damage.is_empty() && case.record.completion.complete {
        return String::new();
    }
    let (heading, text) = if broken || !case.damage.is_empty() {
        (
            "The seal of this record is broken.",
            "The file was altered or damaged after it was sealed. This report was made from what could still be read; it does not show that the rest is as it was recorded.",
        )
    } else {
        (
            "This record is incomplete.",
            "It holds less than the recorder was set to keep:",
        )
    };
    let mut out =
        format!("<div class=\"banner\" role=\"alert\"><strong>{heading}</strong>{text}\n<ul>\n");
    let reasons = case.damage.iter().chain(&case.record.completion.reasons);
    for reason in reasons.clone().take(LISTED) {
        let _ = writeln!(out, "<li>{}</li>", escape(reason));
    }
    if reasons.count() > LISTED {
        out.push_str("<li>and more</li>\n");
    }
    out.push_str("</ul></div>\n");
    out
}

/// The four numbers asked for first.
fn key(r: &Reconstruction) -> String {
    let mut out = String::from("<dl class=\"key\">\n");
    let mut card = |term: &str, big: &str, small: &str| {
        let _ = writeln!(
            out,
            "<div><dt>{}</dt><dd class=\"big\">{}</dd><dd class=\"small\">{}</dd></div>",
            escape(term),
            escape(big),
            escape(small)
        );
    };
    let none = || "no bounds from this model".to_owned();
    if let Some(impact) = r.impacts.first() {
        let v = &impact.speed_mps;
        let kmh = number::shown(v, KMH, 1).value;
        let bounds = number::bounds(v, KMH, 1, "km/h").unwrap_or_else(none);
        card("Speed at impact", &format!("{kmh} km/h"), &bounds);
        let dv = &impact.delta_v;
        let value = number::shown(&dv.resultant_mps, KMH, 1).value;
        let big = if dv.lower_bound {
            format!("at least {value} km/h")
        } else {
            format!("{value} km/h")
        };
        card(
            "Change of velocity",
            &big,
            &number::bounds(&dv.resultant_mps, KMH, 1, "km/h").unwrap_or_else(none),
        );
        let (words, hour) = number::direction(dv.pdof_deg.value);
        let degrees = number::shown(&dv.pdof_deg, 1.0, 0)
            .value
            .replace('-', "\u{2212}");
        card(
            "Force came from",
            words.trim_start_matches("from "),
            &format!("{hour} o'clock, principal direction {degrees}\u{b0}"),
        );
    } else {
        card("Impact", "none found", "in this record");
        let bounds = number::bounds(&r.top_speed_mps, KMH, 1, "km/h").unwrap_or_else(none);
        card(
            "Largest speed",
            &format!("{} km/h", number::shown(&r.top_speed_mps, KMH, 1).value),
            &bounds,
        );
    }
    if let Some(b) = &r.braking {
        let value = number::shown(&b.mean_mps2, 1.0, 1).value;
        let began = format!("mean, began {}", words::when(b.onset_t_s.value, 2));
        card("Braking", &format!("{value} m/s\u{b2}"), &began);
    } else {
        let bounds = number::bounds(&r.distance_m, 1.0, 1, "m").unwrap_or_else(none);
        let value = number::shown(&r.distance_m, 1.0, 1).value;
        card("Distance", &format!("{value} m"), &bounds);
    }
    out.push_str("</dl>\n");
    out
}

fn limits(r: &Reconstruction) -> String {
    let mut out =
        String::from("<section class=\"limits\">\n<h2>What limits this result</h2>\n<ul>\n");
    for limit in &r.limits {
        let _ = writeln!(out, "<li>{}</li>", escape(limit));
    }
    if r.limits.is_empty() {
        out.push_str("<li>Nothing beyond the bounds stated.</li>\n");
    }
    out.push_str("</ul>\n</section>\n");
    out
}

fn path(r: &Reconstruction, pictures: &Pictures) -> String {
    format!(
        "<div class=\"pair\">\n<figure>{}</figure>\n<figure>{}</figure>\n</div>\n<p class=\"sub\">{}</p>\n",
        pictures.path(View::Overview),
        pictures.path(View::Close),
        escape(&format!(
            "The funnel joins the ellipses of all instants and is a drawing only. The claim is the ellipse of each instant: the true position at that instant lies in it with {} confidence{}.{}",
            number::percent(r.confidence),
            if r.rest_pose.is_some() && r.map.is_some() {
                ", the uncertainty of the fit to the road map included"
            } else if r.gnss.as_ref().is_some_and(|g| g.pose.is_some()) {
                ", the uncertainty of the satellite fixes included"
            } else if r.rest_pose.is_some() {
                ", the uncertainty of the measured rest pose included"
            } else {
                ", relative to the place and heading of rest"
            },
            if r.details.paths.places.is_empty() {
                ""
            } else {
                " The faint lines are samples: whole ways the car may have come, drawn from what is left unsure of all instants together."
            },
        ))
    )
}

fn over_time(pictures: &Pictures) -> String {
    format!(
        "<figure class=\"motion wide\">{}</figure>\n<figure class=\"motion narrow\">{}</figure>\n",
        pictures.motion(Layout::Wide),
        pictures.motion(Layout::Narrow)
    )
}

fn models(r: &Reconstruction) -> String {
    format!("{}{}", tables::models(r), finding_tables::agreement(r))
}

fn method(r: &Reconstruction) -> String {
    let confidence = number::percent(r.confidence);
    let states = states(r);
    format!(
        "<p>The record holds the means over 10 ms of three accelerations, three rates of turn and two wheel speeds. The reconstruction starts where the car stands still, the one instant at which its speed is known, and integrates the motion backwards in time. {states} Wheel speeds are left out under hard braking, in a spin and during the impact.</p>\n\
         <p>Bounds are two-sided at {confidence}: of many such reconstructions, this share of the true values should lie between them. They rest on the sensor's data sheet as configured; an error outside of it (a sensor that came loose, a wrong configuration) is not covered. Change of velocity is the integral of acceleration over the pulse in the car's axes at its onset. At 100 samples a second no SAE J211 channel frequency class is claimed. Times are from the first trigger; headings are clockwise from {}.</p>\n\
         <p>References: backward black-box reconstruction with wheel speeds and road limits [S03]; inertial navigation with levelling at standstill S00; D. Simon and T. L. Chia, Kalman filtering with state equality constraints, and D. Simon and D. L. Simon, constrained Kalman filtering via density function truncation (2010); C. F. van Loan, computing integrals involving the matrix exponential (1978); 49 CFR part 563 and UN Regulation 160 for the definition of delta\u{2011}V.</p>\n",
        if r.rest_pose.is_some() {
            "true north"
        } else {
            "the car's forward axis at rest"
        }
    )
}

/// What the model of the page carries, in sentences.
fn states(r: &Reconstruction) -> String {
    let by = "by the wheel speeds where these agree with the other sensors, by the lack of sideways motion of a rolling car, and by what a road can be";
    match (r.model, r.details.smoother) {
        ("dead-reckoning", _) => "The wheel speeds alone give speed and turn; no other sensor is used.".to_owned(),
        ("published", _) => "The nine-state filter of the published method is used as it was published, with its signs put right: it is there for comparison.".to_owned(),
        ("refined", smoother) => {
            let smoothed = match smoother {
                Some(Smoother::Rts) => " A fixed-interval smoother (Rauch, Tung and Striebel) then brings what was learnt of the sensors in the drive before the crash to the crash itself.",
                Some(Smoother::Batch) => " All instants were then solved together, about their own solution, with weights that keep outlying measurements from pulling: the sweep that serves other records is not exact where the car was not seen at rest, rolled over, or turned unseen.",
                _ => "",
            };
            format!("An error-state Kalman filter carries nine errors of motion (position, velocity and attitude, three axes each) and, beside them, those of the sensors and the car: biases and scales of the accelerometer and the gyro, mounting, wheel scales and delay, sideslip, track width, the sensor's place. It corrects them {by}.{smoothed}")
        }
        _ => format!("An error-state Kalman filter carries nine errors (position, velocity and attitude, three axes each) with the uncertainty of the sensors' offsets, and corrects them {by}."),
    }
}

#[cfg(test)]
mod tests {
    use super::Pictures;
    use crate::report::case::Case;

    fn html(r: &crate::findings::Reconstruction, case: &Case<'_>) -> String {
        super::html(r, case, &Pictures::draw(r, &[]))
    }

    use crate::report::sample_case;

    #[test]
    fn the_page_is_self_contained_and_hostile_names_are_disarmed() {
        let (record, damage) = (sample_case::record(), Vec::new());
        let page = html(
            &sample_case::reconstruction(),
            &sample_case::case(&record, &damage),
        );
        assert!(!page.contains("<script"));
        assert!(page.contains("&lt;script&gt;"));
        let outside: Vec<_> = page
            .match_indices("http")
            .filter(|(i, _)| !page[*i..].starts_with("http://www.w3.org/2000/svg"))
            .collect();
        assert!(
            outside
                .iter()
                .all(|(i, _)| page[*i..].starts_with("http-equiv")),
            "{outside:?}"
        );
        assert!(!page.contains("class=\"banner\""));
        // Results first, then what they rest on.
        let order = [
            "<h2>Summary",
            "<h2>The last seconds before the impact",
            "<h2>The impacts",
            "<h2>Roll-over and rest",
            "<h2>Models side by side",
            "<h2>Where the uncertainty comes from",
            "<h2>The record",
        ]
        .map(|heading| page.find(heading).expect(heading));
        assert!(order.is_sorted());
        assert!(page.contains("wheel &lt;scale&gt;") && !page.contains("<scale>"));
        assert!(page.contains("over the left side") && page.contains("Brake signal, %"));
        for text in [
            "What limits this result",
            "identity unproven",
            "km/h",
            "NaN",
        ] {
            assert_eq!(page.contains(text), text != "NaN", "{text}");
        }
    }

    #[test]
    fn damage_gets_a_banner() {
        let mut record = sample_case::record();
        let damage = vec!["block 17: CRC stored 0x1, computed 0x2 <img>".to_owned()];
        let page = html(
            &sample_case::reconstruction(),
            &sample_case::case(&record, &damage),
        );
        assert!(
            page.contains("The seal of this record is broken.") && page.contains("0x2 &lt;img&gt;")
        );
        record.completion.complete = false;
        record.completion.reasons = vec!["the log ended early".to_owned()];
        let page = html(
            &sample_case::reconstruction(),
            &sample_case::case(&record, &[]),
        );
        assert!(
            page.contains("This record is incomplete.") && page.contains("the log ended early")
        );
    }
}
