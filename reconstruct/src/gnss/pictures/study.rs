//! Deviation over time for several lengths of outage, one panel a length [S00, figures 4.9, 4.10 and 4.15].

use super::stage::{Key, Stage, line, strokes};
use super::{OURS, PUBLISHED, RECEIVER};
use crate::gnss::experiments::{Experiment, Outcome};
use crate::gnss::outages::{Curve, Mean, Study};
use crate::gnss::reference::Second;
use crate::report::axis::Scale;
use crate::report::svg::{self, Anchor, Svg, signed};
use schema::num::real;

/// Windows apart from each other, in order of time.
fn points(curve: Option<&Curve>, of: fn(&Second) -> f64) -> Vec<(f64, Option<f64>, f64)> {
    let mut out = Vec::new();
    for window in curve.into_iter().flat_map(|c| &c.seconds) {
        out.extend(window.iter().map(|s| (s.t_s, Some(of(s)), 0.0)));
        out.extend(window.last().map(|s| (s.t_s, None, 0.0)));
    }
    super::stage::reduced(out, f64::INFINITY)
}

/// The picture; an empty text where no experiment was done.
#[must_use]
pub fn study(study: &Study) -> String {
    let ends = |pick: fn(&[f64; 2]) -> f64| {
        study
            .rows
            .iter()
            .flat_map(move |r| r.windows.iter().map(pick))
    };
    let (begin, end) = (
        ends(|w| w[0]).fold(f64::INFINITY, f64::min),
        ends(|w| w[1]).fold(f64::NEG_INFINITY, f64::max),
    );
    if !(begin.is_finite() && end > begin) {
        return String::new();
    }
    let mut stage = Stage::new("go", [begin - 1.0, end + 1.0]);
    let count = study.rows.len();
    for (i, row) in study.rows.iter().enumerate() {
        let published = points(row.published.as_ref(), |s| s.off_m);
        let off = points(row.ours.as_ref(), |s| s.off_m);
        let bound = points(row.ours.as_ref(), |s| s.bound_m);
        let most =
            |list: &[(f64, Option<f64>, f64)]| list.iter().filter_map(|p| p.1).fold(0.0, f64::max);
        // Ours is to be read where the other is far off: what leaves the scale is said.
        let own = most(&off).max(most(&bound));
        let all = own.max(most(&published));
        let top = 1.08 * if own > 0.0 { all.min(4.0 * own) } else { all }.max(1.0);
        let title = format!("{}: horizontal deviation, m", row.experiment.name());
        stage.panel(
            &title,
            130.0,
            [0.0, top],
            i + 1 == count,
            &[],
            |svg, panel| {
                let theirs = line(published, PUBLISHED, "");
                panel.series(svg, &theirs);
                panel.series(svg, &line(bound, OURS[0], "6 4"));
                panel.series(svg, &line(off, OURS[0], ""));
                let fixes = row
                    .windows
                    .iter()
                    .map(|w| w[0])
                    .chain(row.outages.iter().map(|o| o[1]));
                let mut fixes: Vec<f64> = fixes.collect();
                fixes.sort_by(f64::total_cmp);
                strokes(svg, panel, fixes.into_iter(), RECEIVER);
                panel.off_scale(svg, &theirs, "m");
            },
        );
    }
    stage.legend(&[
        (Key::Line(PUBLISHED), "published filter"),
        (Key::Line(OURS[0]), "ours, running"),
        (Key::Dashed(OURS[0]), "its bound of 95 %"),
        (Key::Tick(RECEIVER), "outage begins or ends"),
    ]);
    stage.finish(
        "Deviation over time for several outages",
        "Horizontal deviation from the reference of the published filter and of ours, one panel for each length of outage.",
    )
}

/// The experiments on simulated drives: mean largest deviation with its bounds of 95 %, logarithmic.
#[must_use]
pub fn experiments(all: &[Outcome]) -> String {
    type Of = fn(&Outcome) -> f64;
    let kinds: [(&'static str, &'static str, Of); 4] = [
        (PUBLISHED, "published filter", |o| o.published_m[0]),
        ("#e9a36b", "the same, slips mended", |o| o.published_m[1]),
        (OURS[0], "ours, running", |o| o.ours_m),
        ("#6d8fb0", "ours, smoothed", |o| o.smoothed_m),
    ];
    let (left, right, top, band) = (250.0, 980.0, 30.0, 74.0);
    let foot = top + band * real(Experiment::ALL.len());
    let x = Scale {
        low: 0.0,
        high: 3.0,
        from: left,
        to: right,
    };
    let at = |m: f64| x.at(m.clamp(1.0, 1000.0).log10());
    let mut svg = Svg::new();
    let mut back = Svg::new();
    for m in [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0] {
        svg.line([at(m), top], [at(m), foot], "stroke=\"#dedede\"");
        svg.text(
            [at(m), foot + 17.0],
            13.0,
            Anchor::Middle,
            "fill=\"#333\"",
            &signed(m, 0),
        );
    }
    for (i, experiment) in Experiment::ALL.into_iter().enumerate() {
        let y = top + band * real(i);
        svg.text(
            [left - 10.0, y + 42.0],
            14.0,
            Anchor::End,
            "",
            &experiment.name(),
        );
        svg.line([left, y], [right, y], "stroke=\"#dedede\"");
        if let Some(m) = experiment.source_m() {
            let style = "stroke=\"#111\" stroke-width=\"1.6\" stroke-dasharray=\"4 3\"";
            svg.line([at(m), y + 4.0], [at(m), y + band - 4.0], style);
        }
        for (k, (color, _, of)) in kinds.iter().enumerate() {
            let list: Vec<f64> = all
                .iter()
                .filter(|o| o.experiment == experiment)
                .map(of)
                .collect();
            let Some(mean) = Mean::of(&list) else {
                continue;
            };
            let y = y + 14.0 + 15.5 * real(k);
            let half = 1.96 * mean.error;
            let style = format!("stroke=\"{color}\" stroke-width=\"2.4\"");
            // Of one window no interval can be told.
            if half.is_finite() {
                svg.line([at(mean.mean - half), y], [at(mean.mean + half), y], &style);
            }
            svg.circle([at(mean.mean), y], 4.2, &format!("fill=\"{color}\""));
        }
    }
    svg.text(
        [0.5 * (left + right), foot + 38.0],
        13.0,
        Anchor::Middle,
        "fill=\"#333\"",
        "largest deviation of a window, m: mean over the windows and its interval of 95 %",
    );
    svg.rect(
        [left, top],
        [right - left, foot - top],
        "fill=\"none\" stroke=\"#333\"",
    );
    let mut entries: Vec<(Key, &str)> = kinds.iter().map(|k| (Key::Dot(k.0), k.1)).collect();
    entries.push((Key::Dashed("#111"), "read off its figures by S00"));
    let end = super::stage::legend(&mut svg, foot + 62.0, &entries);
    let size = [super::stage::WIDTH, end + 4.0];
    back.rect([0.0, 0.0], size, "fill=\"#fff\"");
    svg::picture(
        size,
        "The experiments of S00 on simulated drives",
        "Mean largest deviation of each filter in each experiment on a logarithmic scale.",
        &(back.into_body() + &svg.into_body()),
    )
}
