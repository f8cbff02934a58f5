//! Satellite fixes of the record: what became of them, where they lay the path, and how far they lie off it.

use schema::gnss::GnssSource;
use schema::num;

use crate::anchor::laid::{Anchored, Pose};
use crate::findings::{Figure, Reconstruction};
use crate::report::number;
use crate::report::svg::escape;
use crate::report::tables::{row, table, with_bounds};
use crate::stats::{ellipse_radius, two_sided_quantile};

/// The section of the page; empty where the record has no fixes or they were not asked for.
#[must_use]
pub fn section(r: &Reconstruction) -> String {
    let Some(gnss) = r.gnss.as_deref() else {
        return String::new();
    };
    let mut rows = String::new();
    let mut add = |name: &str, text: String| row(&mut rows, name, &[text]);
    add(
        "Source",
        match gnss.source {
            GnssSource::Can => "signals of a CAN bus".to_owned(),
            GnssSource::Nmea => "NMEA 0183 on a serial line".to_owned(),
        },
    );
    add("Fixes in the record", gnss.offered.to_string());
    add("Used", gnss.used.to_string());
    for (why, count) in gnss.reasons() {
        add(&format!("Left out: {why}"), count.to_string());
    }
    if let Some(pose) = &gnss.pose {
        placed(&mut add, r, gnss, pose);
    } else if let Some(why) = &gnss.why {
        add("Place on the earth", format!("cannot be told: {why}"));
    }
    if let Some([off, sd]) = gnss.clock_off_s {
        let figure = Figure::new(off, sd, two_sided_quantile(r.confidence));
        add(
            "Clock of the fixes less the recorder's",
            format!(
                "{}; UTC is that of the {}",
                with_bounds(&figure, 1.0, 2, "s"),
                if gnss.clock_used { "fixes" } else { "recorder" }
            ),
        );
    }
    format!(
        "<p>{}</p>\n{}",
        escape(
            "A receiver says where its antenna was. Place, heading and delay of the fixes are estimated together with the path: \
             they bend it, and what is unsure of it is in the place it is laid to. Errors of a receiver stay for a minute or so, \
             and many fixes of one minute are taken for few. Fixes within 3 s of an impact are left out, as a receiver's own filter \
             drives on for a moment."
        ),
        table("fixes", &["", ""], &rows)
    )
}

fn placed(add: &mut impl FnMut(&str, String), r: &Reconstruction, gnss: &Anchored, pose: &Pose) {
    let rest = &pose.rest;
    add(
        "Place of rest",
        format!(
            "{:.6}\u{b0}, {:.6}\u{b0}, within {:.1} m at {}",
            rest.latitude_deg,
            rest.longitude_deg,
            ellipse_radius(r.confidence) * rest.sd_m,
            number::percent(r.confidence)
        ),
    );
    let quantile = two_sided_quantile(r.confidence);
    let heading = Figure::new(rest.heading_deg, rest.sd_deg, quantile);
    add(
        "Heading at rest, from true north",
        with_bounds(&heading, 1.0, 1, "\u{b0}"),
    );
    let delay = Figure::new(pose.lag_s[0], pose.lag_s[1], quantile);
    add(
        "Delay of the fixes beside what is said of it",
        with_bounds(&delay, 1.0, 2, "s"),
    );
    let off: Vec<f64> = gnss
        .residuals
        .iter()
        .filter(|f| f.used)
        .map(|f| f.off[0].hypot(f.off[1]))
        .collect();
    if !off.is_empty() {
        let mean = (off.iter().map(|x| x * x).sum::<f64>() / num::real(off.len())).sqrt();
        let most = off.iter().copied().fold(0.0, f64::max);
        add(
            "Used fixes off the path",
            format!(
                "{mean:.1} m (rms), {most:.1} m at most; they {}",
                if gnss.scale > 1.0 {
                    format!("scatter {:.1} times as far as is said of them", gnss.scale)
                } else {
                    "scatter no farther than is said of them".to_owned()
                }
            ),
        );
    }
}

/// One line for the screen, plain ASCII.
pub(crate) fn line(gnss: &Anchored, confidence: f64) -> String {
    match &gnss.pose {
        Some(pose) => format!(
            "rest {:.5}, {:.5} to {:.1} m, heading {:.1} +-{:.1} deg",
            pose.rest.latitude_deg,
            pose.rest.longitude_deg,
            ellipse_radius(confidence) * pose.rest.sd_m,
            pose.rest.heading_deg,
            two_sided_quantile(confidence) * pose.rest.sd_deg
        ),
        None => "the fixes do not tell where".to_owned(),
    }
}
